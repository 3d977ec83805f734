"""The data gate on a recording of the independent solver: a missing effect is no wrong unit."""

from bowden.estimation.gate.check import check_data
from bowden.model import Mode, parse_model

from hil_tests.benchmarks.diagnosis import recordings_of
from hil_tests.hidden_effects.recordings import draw_case

# A smooth law of the motor's torque that takes nearly all of the cables' wind-up away: the motor's
# angle is then as far from the prediction as if it were in turns.
WITHOUT_WIND_UP = 4100191


def test_a_law_that_takes_the_wind_up_away_stops_no_good_recording() -> None:
    case = draw_case(WITHOUT_WIND_UP, "smooth_law", length_s=30.0)
    found = check_data(parse_model(case.model_yaml), recordings_of(case), Mode.TORQUE_POSITION)
    assert [one.severity for one in found] == ["warn"]
    assert [one.what for one in found] == ["far"]
