"""Cases of the dynamic rig: a lab's files without the truth, repeatable, like the continuum."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bowden_rig.rig.hidden import TABLE
from bowden_rig.rig.parameters import Cable, Motor, Operator, Rig

from hil_tests import rig_cases
from hil_tests.hidden_effects import effects, unlisted
from hil_tests.hidden_effects.continuum import Histories, solve
from hil_tests.hidden_effects.hidden import Signals
from hil_tests.hidden_effects.recordings import draw_rig
from hil_tests.rig_cases.cases import draw_case
from hil_tests.rig_cases.recording import record

SHORT_S = 2.0
CALM = Operator(motion="still", stiffness_nm_per_rad=200.0, damping_nm_s_per_rad=2.0)


def there_and_back(length_s: float = 2.5) -> Signals:
    time_s = np.arange(round(1000 * length_s)) / 1000
    angle = 0.15 * (1.0 - np.cos(np.pi * np.maximum(time_s - 0.5, 0.0)))
    return Signals(time_s, np.full(time_s.size, 0.05), angle, np.full(time_s.size, 20.0))


def test_a_case_depends_on_its_seed_alone() -> None:
    one, same, other = (draw_case(s, "single", "load_cell_gain", SHORT_S) for s in (5, 5, 6))
    assert one.csv_text() == same.csv_text()
    assert (one.model_yaml, one.truth) == (same.model_yaml, same.truth)
    assert one.csv_text() != other.csv_text()
    assert one.truth.source == "rig"


@pytest.mark.parametrize(("kind", "names"), [("complete", 0), ("single", 1), ("pair", 2)])
def test_a_recording_does_not_contain_the_truth(kind: str, names: int) -> None:
    case = draw_case(4, kind, length_s=SHORT_S)
    assert len(case.truth.effects) == names
    text = case.csv_text() + case.model_yaml.replace("motor_inertia", "")
    for name in [*effects.HIDE, *unlisted.HIDE]:
        assert name not in text


def test_every_effect_of_the_catalogue_can_be_hidden_in_the_rig() -> None:
    assert list(TABLE) == list(effects.HIDE)


def test_the_lab_states_the_inertia_of_its_motor_unless_that_is_what_is_hidden() -> None:
    (stated,) = re.findall(
        r"motor_inertia, inertia_kg_m2: (\S+)}", draw_case(4, "complete", length_s=0.5).model_yaml
    )
    assert 1e-5 <= float(stated) <= 2e-5
    assert "effects: []" in draw_case(4, "single", "motor_inertia", 0.5).model_yaml


def test_a_delay_is_told_as_the_rig_has_it() -> None:
    ((_, values),) = draw_case(8, "single", "time_delay", SHORT_S).truth.effects
    (delay_s,) = values.values()
    assert delay_s > 0.0
    assert delay_s / 250e-6 == pytest.approx(round(delay_s / 250e-6))


@pytest.mark.parametrize("name", ["friction_flicker", "intermittent_encoder_slip"])
def test_an_effect_outside_the_catalogue_is_visible(name: str) -> None:
    case = draw_case(3, "unlisted", name, 4.0)
    assert case.truth.kind == "unlisted"
    assert case.truth.strength > 1.0


def test_the_rig_does_what_the_continuum_does_where_nothing_is_hidden() -> None:
    lab = draw_rig(np.random.default_rng(11))
    signals = there_and_back()
    pair = lab.pair
    rig = Rig(
        Cable(
            path=pair.pieces,
            axial_stiffness_n=pair.law.axial_stiffness_n,
            pretension_n=pair.law.pretension_n,
            friction=pair.mu,
            viscous_s_per_m=0.0,
            contact_stiffness_n_per_m2=1.5e8,
        ),
        motor=Motor(inertia_kg_m2=1e-5),
        operator=CALM,
    )
    said = record(rig, signals, 1)
    answer = solve(pair, signals.time_s, said["motor_torque_nm"], said["load_angle_rad"])
    late = signals.time_s > 1.2  # the pair slides as a whole
    slides = late & (np.abs(np.gradient(signals.load_angle_rad, signals.time_s)) > 0.2)
    gap = said["load_torque_nm"] - answer.load_torque_nm
    # The weight of the cables adds 1e-3 of 3..8 N m, the cell's noise 0.5 mN m.
    assert np.abs(np.median(gap[slides])) < 0.01


def test_a_factor_on_friction_acts_while_it_lasts() -> None:
    signals = there_and_back()
    doubled = Histories(np.where(signals.time_s > 1.3, 1.5, 1.0), None, None)
    rig = Rig(Cable(viscous_s_per_m=0.0), operator=CALM)
    plain, changed = record(rig, signals, 1), record(rig, signals, 1, doubled)
    torque = changed["load_torque_nm"]
    assert np.array_equal(torque[:1300], plain["load_torque_nm"][:1300])
    # Sliding, all of friction grows by half; 0.26 N m is what the motor gives meanwhile.
    assert torque[1480] - 0.26 == pytest.approx(1.5 * (plain["load_torque_nm"][1480] - 0.26), 0.03)


def test_a_drive_that_cannot_tell_the_torque_is_refused() -> None:
    strong = Rig(Cable(pretension_n=40.0), operator=replace(CALM, stiffness_nm_per_rad=500.0))
    with pytest.raises(ArithmeticError, match="cannot tell"):
        record(strong, there_and_back(), 1)


def test_the_maker_of_cases_imports_nothing_of_the_diagnosis() -> None:
    for source in Path(rig_cases.__file__).parent.glob("*.py"):
        assert not re.search(r"^\s*(from|import) bowden\b", source.read_text("utf-8"), re.M), source
