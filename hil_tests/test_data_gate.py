"""The data gate on a recording of the independent solver: a missing effect is no wrong unit."""

import pytest
from bowden.estimation.gate.check import check_data
from bowden.model import Mode, parse_model

from hil_tests.benchmarks.data_gate import trial
from hil_tests.benchmarks.diagnosis import Job, excited, recordings_of
from hil_tests.hidden_effects.recordings import draw_case

# A smooth law of the motor's torque that takes nearly all of the cables' wind-up away: the motor's
# angle is then as far from the prediction as if it were in turns.
WITHOUT_WIND_UP = 4100191


def test_a_law_that_takes_the_wind_up_away_stops_no_good_recording() -> None:
    case = draw_case(WITHOUT_WIND_UP, "smooth_law", length_s=30.0)
    found = check_data(parse_model(case.model_yaml), recordings_of(case), Mode.TORQUE_POSITION)
    assert [one.severity for one in found] == ["warn"]
    assert [one.what for one in found] == ["far"]


@pytest.mark.parametrize(
    ("seed", "number"),
    [
        pytest.param(4400000, 64, id="friction that jumps at one place is no step of the zero"),
        pytest.param(4400000, 104, id="a plateau of friction is no saturated cell"),
        pytest.param(4400000, 177, id="a torque that hardly arrives has no other unit"),
        pytest.param(4700000, 68, id="a plateau at no motor torque is no saturated cell"),
    ],
)
def test_what_a_rig_does_stops_no_good_recording(seed: int, number: int) -> None:
    found = trial(seed, number, faults=False)
    assert found is not None
    assert found.stopped == ""


def test_a_model_that_is_far_from_the_rig_has_no_wrong_clock() -> None:
    """Friction is half as much again: another clock mends a little of that, too."""
    case = excited(Job(930111, "pair", ("wrap_angle_change", "motor_inertia")))
    found = check_data(parse_model(case.model_yaml), recordings_of(case), Mode.TORQUE_POSITION)
    assert "stop" not in {one.severity for one in found}


def test_friction_far_beyond_the_models_is_no_wrong_unit() -> None:
    """A wrap angle adds as much again; with a motor torque of next to nothing the load alone does.

    As a unit that was more than 100 times as likely, beside friction that is a third more at most.
    """
    case = excited(Job(1201331000, "single", ("wrap_angle_change",)))
    found = check_data(parse_model(case.model_yaml), recordings_of(case), Mode.TORQUE_POSITION)
    assert "stop" not in {one.severity for one in found}


def test_a_torque_that_just_arrives_at_a_locked_load_has_no_other_unit() -> None:
    """With a sixth less friction 0.03 N m do, and 0.002 as the model file has it."""
    case = excited(Job(1211347000, "single", ("load_cell_drift",), 20.0, recordings=3))
    found = check_data(parse_model(case.model_yaml), recordings_of(case), Mode.TORQUE_POSITION)
    assert "stop" not in {one.severity for one in found}


def test_a_locked_load_and_strokes_of_one_rig_are_of_one_rig() -> None:
    """A tenth more or less friction decides how much of the motor's torque a locked load feels."""
    case = excited(Job(571913200, "complete", (), 20.0, recordings=4))
    found = check_data(parse_model(case.model_yaml), recordings_of(case), Mode.TORQUE_POSITION)
    assert "two_rigs" not in {one.what for one in found}


@pytest.mark.parametrize(("step_nm", "stops"), [(0.0, []), (0.6, ["zero_step"])])
def test_a_jump_no_larger_than_the_rigs_slips_is_no_step_of_the_zero(
    step_nm: float, stops: list[str]
) -> None:
    """By the model a cable that gives way makes up to 0.36 N m; the cell jumps by 0.03 once."""
    case = excited(Job(1521511000, "single", ("torque_constant_error",), stiction=True))
    (one,) = recordings_of(case)
    one = one.with_channels(load_torque_nm=one.load_torque_nm + step_nm * (one.time_s > 12.3))
    found = check_data(parse_model(case.model_yaml), [one], Mode.TORQUE_POSITION)
    assert [each.what for each in found if each.severity == "stop"] == stops
