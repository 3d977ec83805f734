"""What the true model leaves of the same samples: how much of a gap is chance, how much is ours.

A few moments after reversals, and rests that are one sample each, carry most of what counts are
worth, so that a right model may leave 0.4 or 1.7 of the noise floor. `diagnosis` asks here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from bowden.diagnosis.result import Diagnosis
from bowden.model import Model, ModelError, parse_model
from bowden.recording.recording import Recording
from bowden.signals.dequantise import estimate_channels
from bowden.signals.prediction import simulate_recording

from hil_tests.hidden_effects import random_laws
from hil_tests.hidden_effects.recordings import LAW_KINDS, Case

CALIBRATED = {
    "pretension_n": "rig.cable.pretension_n",
    "mu_d": "friction.mu_d",
    "mu_s": "friction.mu_s",
    "axial_stiffness_n": "rig.cable.axial_stiffness_n",
}


def over_truth(case: Case, recordings: Sequence[Recording], found: Diagnosis) -> float:
    """Return the gap after over what the true model leaves, held out; of the worse channel.

    nan where the truth is in no catalogue or cannot be run, where the data allowed no verdict, and
    for sets.
    """
    if case.truth.kind in {"unlisted", *LAW_KINDS} or not found.series or len(recordings) > 1:
        return math.nan
    model = true_model(case)
    given = estimate_channels(recordings[0], model, found.mode).recording
    try:
        trajectory = simulate_recording(model, found.mode, given)
    except ModelError:
        return math.nan
    ratios = []
    for gap, one in zip(found.gaps, found.series, strict=True):
        left = one.measured - getattr(trajectory, one.quantity)
        if one.quantity.endswith("_rad"):  # an encoder's zero is known to a fraction of a count
            left -= left.mean()
        ratios.append(gap.after / float(np.sqrt(np.mean(left**2))))
    return max(ratios)


def true_model(case: Case) -> Model:
    """Return the lab's model with the true calibration and what is hidden."""
    true = case.truth.calibration["rig"]
    model = parse_model(case.model_yaml).with_values(
        {path: true[name] for name, path in CALIBRATED.items() if name in true}
    )
    for name, values in case.truth.effects:
        model = model.with_effect(name, values)
    return model


def law_inside(case: Case, found: Diagnosis) -> float:
    """Return the share of a learned law's knots at which the true curve lies in the 95 % band.

    nan where another law was learned, or the true one follows the cell's own torque, whose range is
    not in the case. The true curve is that over the true argument: counts tell of a reversal late,
    and noise reaches beyond the range of a temperature.
    """
    (name, values), one = case.truth.effects[0], found.learned
    if one is None or case.signals is None or f"over {random_laws.CELL}" in name:
        return math.nan
    if f"{one.place} over {' and '.join(one.arguments)}" != name:
        return math.nan
    x, _, low, high = one.curve.T
    at = [x] if one.second is None else [x, one.second]
    true = random_laws.true_law(name, values, case.signals, *at)
    return float(np.mean((low <= true) & (true <= high)))
