"""Effects as a search sees them: each is counted from the model without it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bowden.diagnosis.candidates import Candidate, candidates
from bowden.diagnosis.material import as_searched
from bowden.diagnosis.probes import switched_off
from bowden.estimation.covariance import Data
from bowden.model import Mode
from bowden.recording.recording import Recording

from .lab import MODEL, TRUTH, measured

EVERY = candidates()


@pytest.fixture(scope="module")
def data() -> Data:
    one = measured(TRUTH)
    warm = Recording(one.time_s, one.channels, conduit_temperature_c=20.0 + 0.1 * one.time_s)
    return Data.of(warm, 0, MODEL, Mode.TORQUE_POSITION, 1, step_s=16e-3)


@pytest.mark.parametrize("effect", EVERY, ids=[" ".join(one.key).strip() for one in EVERY])
def test_an_effect_of_no_strength_does_nothing_whatever_its_shape(
    effect: Candidate, data: Data
) -> None:
    """Screening counts what an effect does from the prediction without it."""
    model = as_searched(MODEL)
    without = data.predict(model, [])
    for shape in effect.shapes():
        off = effect.added_to(model, switched_off(effect, shape))
        # A spring that is switched off is a million times as stiff as one can be.
        np.testing.assert_allclose(data.predict(off, []), without, rtol=0.0, atol=1e-6)


def test_every_harmonic_that_a_motor_may_cog_with_is_looked_at() -> None:
    (cogging,) = candidates(("cogging",))
    (harmonic,) = (one for one in cogging.variant.parameters if one.name == "harmonic")
    found = {shape["harmonic"] for shape in cogging.shapes()}
    assert found == set(range(int(harmonic.low), int(harmonic.high) + 1))


def test_a_bump_wherever_it_is_has_a_start_that_looks_like_it() -> None:
    """From others a fit ends at a dip elsewhere: each of them explains some of the bump."""
    (bump,) = (one for one in candidates(("position_dependent_friction",)) if "bump" in one.key)
    (width,) = (one.typical for one in bump.variant.parameters if one.name == "width_rad")
    centres = {shape["centre_rad"] for shape in bump.shapes()}
    for centre_rad in np.linspace(-1.5, 1.5, 301):
        nearest = min(abs(centre_rad - one) for one in centres)
        # The correlation of two bumps of one width so far apart.
        assert math.exp(-0.5 * (nearest / width) ** 2) > 0.95
