"""A law that no catalogue has is learned: its place, its argument and its curve."""

from __future__ import annotations

import numpy as np
import pytest
from bowden.diagnosis.diagnose import diagnose
from bowden.diagnosis.result import Diagnosis, Learned
from bowden.model import Mode, parse_model

from hil_tests.benchmarks.diagnosis import recordings_of
from hil_tests.benchmarks.diagnosis_truth import law_inside
from hil_tests.hidden_effects import effects, random_laws
from hil_tests.hidden_effects.hidden import Signals
from hil_tests.hidden_effects.recordings import SURFACE, Case, draw_case, draw_rig

CANDIDATES = ["bearing_friction", "gravity_imbalance", "load_cell_gain"]  # few, to be quick


def found_in(case: Case) -> Diagnosis:
    model = parse_model(case.model_yaml)
    return diagnose(model, [recordings_of(case)[0]], Mode.TORQUE_POSITION, names=CANDIDATES)


def learned_in(case: Case) -> tuple[Diagnosis, Learned]:
    """A law is learned, and it is the one that is hidden: its place and its arguments."""
    found = found_in(case)
    assert found.verdict == "unlisted"
    assert found.learned is not None
    ((hidden, _),) = case.truth.effects
    assert f"{found.learned.place} over {' and '.join(found.learned.arguments)}" == hidden
    return found, found.learned


def test_a_hidden_law_is_learned_with_its_place_argument_and_curve() -> None:
    case = draw_case(9, "smooth_law", "motor_torque_nm over load_angle_rad and direction", 10.0)
    found, learned = learned_in(case)
    # Seventeen knots, each inside with 95 %: fewer than 14 of them happens once in a thousand.
    assert law_inside(case, found) >= 14 / 17
    # A few moments of rest, where counts leave the path open, are all that stays.
    assert found.gap.after < 0.5 * found.gap.before
    document = found.to_document()["learned"]
    assert isinstance(document, dict)
    assert np.shape(document["curve"]) == (17, 4)
    assert "a torque at the motor that varies with load angle" in found.sentence
    # The extended model is a model file that holds the law, and explains as much.
    assert found.model.effects[-1].values == dict(
        zip((f"values[{k}]" for k in range(17)), learned.curve[:, 1].tolist(), strict=True)
    )


def test_a_hidden_law_of_two_arguments_is_learned_over_both() -> None:
    case = draw_case(5, SURFACE, "load_torque_nm over motor_torque_nm and time_s", 20.0)
    found, _ = learned_in(case)
    # Of 81 knots, each inside with 95 % and as likely as its neighbours: ten misses are many.
    assert law_inside(case, found) >= 71 / 81
    # Of one argument, time or torque, the best leaves half of it.
    assert found.gap.after < 0.2 * found.gap.before
    assert "varies with motor torque and time" in found.sentence


def test_a_listed_effect_gets_its_name_and_no_law() -> None:
    found = found_in(draw_case(11, "single", "gravity_imbalance", 8.0))
    assert [one.name for one in found.effects] == ["gravity_imbalance"]
    assert found.learned is None
    assert "learned" not in found.to_document()


def test_a_level_law_by_the_slip_that_is_hidden_is_a_hidden_asymmetry() -> None:
    level = {"size": 0.2, "level": 1.0} | {f"a_{k}": 0.0 for k in (1, 2, 3)}
    level |= {f"phase_{k}_rad": 0.0 for k in (1, 2, 3)}
    one = random_laws.HIDE["friction_factor over load_angle_rad and slip_direction"](level)
    other = effects.HIDE["direction_asymmetry"]({"a": 0.2})
    time_s = np.linspace(0.0, 1.0, 50)
    signals = Signals(time_s, np.zeros(50), np.sin(6.0 * time_s), np.full(50, 20.0))
    pair = draw_rig(np.random.default_rng(1)).pair
    found, expected = (hidden.histories(signals, pair) for hidden in (one, other))
    np.testing.assert_array_equal(found.friction_plus, expected.friction_plus)
    np.testing.assert_array_equal(found.friction_minus, expected.friction_minus)


def test_a_law_of_the_benchmark_counts_for_both_directions_as_the_contract_says() -> None:
    angle = np.array([0.0, 0.1, 0.2, 0.2, 0.1, 0.0, 0.0, 0.1])
    assert random_laws.direction(angle) == pytest.approx([1, 1, 1, 1, -1, -1, -1, 1])
