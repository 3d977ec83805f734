"""From recordings to a verdict: named, complete, or honestly nothing."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import pytest
from bowden.diagnosis import growing, time_limit
from bowden.diagnosis.diagnose import diagnose
from bowden.diagnosis.result import Diagnosis
from bowden.model import format_model, parse_model
from bowden.workers import cores

from .lab import MODEL, TRUTH, measured

NAMES = ("load_cell_offset", "gravity_imbalance", "direction_asymmetry", "load_cell_gain")
HIDDEN = {
    "gravity_imbalance": {"amplitude_nm": 0.03, "phase_rad": 0.8},
    "direction_asymmetry": {"a": 0.03},
    "load_cell_offset": {"offset_nm": -0.02},
}


@cache
def diagnosed(name: str) -> Diagnosis:
    truth = TRUTH.with_effect(name, HIDDEN[name]) if name else TRUTH
    return diagnose(MODEL, [measured(truth)], names=NAMES, seed=1)


def test_an_effect_that_the_file_has_stays_and_another_is_named_beside_it() -> None:
    known, hidden = "gravity_imbalance", "direction_asymmetry"
    truth = TRUTH.with_effect(known, HIDDEN[known]).with_effect(hidden, HIDDEN[hidden])
    found = diagnose(
        MODEL.with_effect(known, HIDDEN[known]), [measured(truth)], names=NAMES, seed=1
    )
    assert [one.name for one in found.effects] == [hidden]
    assert found.effects[0].parameters["a"].value == pytest.approx(HIDDEN[hidden]["a"], abs=0.003)
    assert [one["name"] for one in found.model.document.effects] == [known, hidden]


@pytest.mark.parametrize("name", HIDDEN)
def test_a_hidden_effect_is_named_with_its_size(name: str) -> None:
    found = diagnosed(name)
    assert found.verdict == "named"
    (effect,) = found.effects
    assert effect.name == name
    assert effect.confidence > 0.9
    for parameter, value in HIDDEN[name].items():
        interval = effect.parameters[parameter]
        slack = 0.5 * (interval.high - interval.low)  # 95 % intervals miss once in twenty
        assert interval.low - slack <= value <= interval.high + slack
    assert found.gap.after <= 1.1 * found.gap.noise_floor
    assert found.ranking[0].name == name


def test_a_right_answer_is_every_split_s_and_leaves_noise() -> None:
    found = diagnosed("gravity_imbalance").validation
    assert found is not None
    assert found.agreeing == len(found.splits) == 4
    assert not any(one.is_significant for one in (*found.whiteness, *found.independence))
    assert "4 of 4 splits" in found.text


@pytest.mark.parametrize(
    ("asymmetry", "weight_nm", "first"),
    [(0.06, 0.03, "direction_asymmetry"), (0.015, 0.20, "gravity_imbalance")],
)
def test_of_two_effects_the_one_that_explains_more_comes_first(
    asymmetry: float, weight_nm: float, first: str
) -> None:
    truth = TRUTH.with_effect("direction_asymmetry", {"a": asymmetry})
    weight = {"amplitude_nm": weight_nm, "phase_rad": 0.8}
    truth = truth.with_effect("gravity_imbalance", weight)
    found = diagnose(MODEL, [measured(truth)], names=NAMES, seed=1)
    names = [one.name for one in found.effects]
    assert set(names) == {"direction_asymmetry", "gravity_imbalance"}
    assert names[0] == first


def test_four_effects_at_once_are_all_named() -> None:
    # Each hides the others: the wrap nearly doubles friction, and what an offset leaves looks like
    # asymmetry until the torque constant is right.
    hidden = {
        "direction_asymmetry": {"a": -0.2},
        "torque_constant_error": {"g": -0.15},
        "load_cell_offset": {"offset_nm": -0.14},
        "wrap_angle_change": {"extra_wrap_rad": 4.0},
    }
    truth = TRUTH
    for name, values in hidden.items():
        truth = truth.with_effect(name, values)
    names = (*hidden, "gravity_imbalance", "motor_torque_offset")
    found = diagnose(MODEL, [measured(truth)], names=names, seed=1)
    assert found.verdict == "named"
    assert {one.name for one in found.effects} == set(hidden)


@pytest.mark.parametrize("zeroed", [False, True])
def test_an_encoder_off_centre_may_count_from_anywhere(zeroed: bool) -> None:
    """Zeroed where the rig stood, the reading is short by e sin(phase): 12 mrad, 4 counts."""
    hidden = {"e_rad": 0.015, "phase_rad": 0.9}
    recording = measured(TRUTH.with_effect("encoder_eccentricity", hidden))
    if zeroed:
        angle = recording.motor_angle_rad
        recording = replace(recording, motor_angle_rad=angle - angle[0])
    found = diagnose(MODEL, [recording], names=("encoder_eccentricity", "encoder_offset"), seed=1)
    assert [one.name for one in found.effects] == ["encoder_eccentricity"]
    values = found.effects[0].parameters
    assert values["e_rad"].value == pytest.approx(0.015, rel=0.03)
    assert values["phase_rad"].value == pytest.approx(0.9, abs=0.03)


def test_nothing_is_invented_for_a_complete_model() -> None:
    found = diagnosed("")
    assert found.verdict == "complete"
    assert found.effects == ()
    assert "Calibration within the tolerances explains these recordings" in found.sentence


def test_an_effect_below_the_noise_of_a_sample_gets_no_name() -> None:
    # 0.1 mN m on 12 000 samples of 0.5 mN m each is beyond doubt, but a simulator's own errors are
    # as large, and they are no effect.
    hidden = TRUTH.with_effect("load_cell_offset", {"offset_nm": 1e-4})
    assert diagnose(MODEL, [measured(hidden)], names=NAMES, seed=1).verdict == "complete"


def test_an_effect_above_it_is_named_although_reversals_are_noisier_still() -> None:
    hidden = TRUTH.with_effect("load_cell_offset", {"offset_nm": 1.5e-3})
    found = diagnose(MODEL, [measured(hidden)], names=NAMES, seed=1)
    torque = next(gap for gap in found.gaps if gap.quantity == "load_torque_nm")
    assert torque.noise_floor > 1.5e-3
    # A weight that hangs level is an offset, too, over strokes as short as these: it may tie.
    assert found.effects[0].name == "load_cell_offset"
    assert {one.name for one in found.effects} <= {"load_cell_offset", "gravity_imbalance"}


def test_a_strong_effect_is_found_although_the_numbers_are_far_off() -> None:
    # Without the effect no calibration fits, and its search runs far away (to 4 tolerances): what
    # is fitted on top of it has to find back.
    rig = TRUTH.with_values({"rig.cable.pretension_n": 8.9, "friction.mu_d": 0.19})
    hidden = rig.with_effect("direction_asymmetry", {"a": -0.18})
    found = diagnose(MODEL, [measured(hidden)], names=NAMES, seed=1)
    assert found.verdict == "named"
    assert [one.name for one in found.effects] == ["direction_asymmetry"]
    assert found.effects[0].parameters["a"].value == pytest.approx(-0.18, abs=0.01)


def test_a_number_far_out_of_its_tolerance_is_a_finding() -> None:
    # Half of the wrap is gone. Friction knows only mu times wrap: mu could take it, at five
    # tolerances.
    hidden = TRUTH.with_effect("wrap_angle_change", {"extra_wrap_rad": -3.5})
    names = ("wrap_angle_change", "load_cell_offset")
    found = diagnose(MODEL, [measured(hidden)], names=names, seed=1)
    assert found.verdict == "named"
    assert [one.name for one in found.effects] == ["wrap_angle_change"]


def test_calibration_finds_the_numbers_that_were_off() -> None:
    moved = {one.path: one for one in diagnosed("").calibration}
    assert moved["rig.cable.pretension_n"].value == pytest.approx(10.6, rel=0.01)
    assert moved["friction.mu_d"].value == pytest.approx(0.203, rel=0.01)


def test_the_document_is_the_contract() -> None:
    document = json.loads(json.dumps(diagnosed("gravity_imbalance").to_document(), default=float))
    assert document["verdict"] == "named"
    (effect,) = document["effects"]
    assert set(effect) >= {"name", "parameters", "confidence"}
    for value in effect["parameters"].values():
        assert value["low"] <= value["value"] <= value["high"]
    assert set(document["ranking"][0]) >= {"name", "score", "held_out_gap"}
    assert set(document["where"][0]) >= {"condition", "share_of_gap"}
    assert set(document["gap"]) >= {"quantity", "metric", "before", "after", "noise_floor"}
    assert document["gap"]["metric"] == "RMS, held out"
    assert isinstance(document["next_experiment"], str)
    assert isinstance(document["cannot_tell_apart"], list)


def test_the_same_seed_gives_the_same_answer() -> None:
    again = diagnose(
        MODEL,
        [measured(TRUTH.with_effect("load_cell_offset", HIDDEN["load_cell_offset"]))],
        names=NAMES,
        seed=1,
    )
    assert again.to_document() == diagnosed("load_cell_offset").to_document()


def test_the_extended_model_is_a_model_file_with_the_effect() -> None:
    model = diagnosed("direction_asymmetry").model
    assert [effect["name"] for effect in model.document.effects] == ["direction_asymmetry"]
    assert model.document.numerics == MODEL.document.numerics


def test_a_bad_recording_gets_no_verdict_but_words() -> None:
    run = measured(TRUTH)
    found = diagnose(MODEL, [replace(run, load_torque_nm=1e3 * run.load_torque_nm)], names=NAMES)
    assert found.verdict == "bad_data"
    assert found.effects == ()
    assert "1000 times too large" in found.sentence
    assert found.to_document()["quality"]


def test_one_candidate_that_explains_little_is_no_error() -> None:
    """Much is missing, and there is no second effect to go on with."""
    truth = TRUTH.with_effect("gravity_imbalance", {"amplitude_nm": 0.4, "phase_rad": 0.8})
    found = diagnose(MODEL, [measured(truth)], names=("load_inertia",), seed=1)
    assert found.verdict == "unlisted"


def test_what_no_candidate_explains_is_unlisted() -> None:
    """A motion that the play of a termination swallows, and no candidate that knows of play."""
    hidden = TRUTH.with_effect("termination_backlash", {"play_rad": 0.01})
    found = diagnose(MODEL, [measured(hidden)], names=NAMES, seed=1)
    assert found.verdict == "unlisted"
    assert found.effects == ()
    assert found.odds["unlisted"] > 0.95
    assert found.gap.after > 1.5 * found.gap.noise_floor


def test_two_names_for_one_thing_are_a_tie() -> None:
    """A cell that reads 5 % more, or a motor that gives 5 % less in a stiffer, tighter cable."""
    hidden = TRUTH.with_effect("load_cell_gain", {"g": 0.05})
    stiffness = "axial_stiffness_n: 4000.0"
    text = format_model(MODEL)
    assert stiffness in text
    unsure = parse_model(
        text.replace(stiffness, "axial_stiffness_n: {value: 4000, tolerance: 10 %}")
    )
    names = ("load_cell_gain", "torque_constant_error", "load_cell_offset")
    found = diagnose(unsure, [measured(hidden)], names=names, seed=1)
    assert found.verdict == "ambiguous"
    assert {one.name for one in found.effects} == {"load_cell_gain", "torque_constant_error"}
    assert found.cannot_tell_apart == (("load_cell_gain", "torque_constant_error"),)
    assert found.next_experiment


def test_recordings_that_cannot_show_an_effect_say_so() -> None:
    """Friction over temperature, and no temperature was recorded."""
    found = diagnose(MODEL, [measured(TRUTH)], names=("thermal_friction",), seed=1)
    assert found.verdict == "insufficient_excitation"


def test_what_is_called_held_out_no_fit_has_seen() -> None:
    """A disturbance in one stretch stays there whole: had its own fit seen it, part would go."""
    run = measured(TRUTH)
    stretch = (run.time_s > 6.1) & (run.time_s < 6.4)
    moved = replace(run, load_torque_nm=run.load_torque_nm + 5e-3 * stretch)
    clean, disturbed = (
        next(
            one
            for one in diagnose(MODEL, [each], names=("load_cell_offset",), seed=1).series
            if one.quantity == "load_torque_nm"
        )
        for each in (run, moved)
    )
    # Fits of the other stretches move by what other stretches' noise allows: a tenth of it.
    shift = (disturbed.before - clean.before)[stretch]
    assert abs(shift.mean()) < 0.1 * 5e-3


@pytest.mark.parametrize("count", [1, 3])
def test_more_recordings_make_it_surer(count: int) -> None:
    """An effect of the size of a sample's noise: three recordings know it better than one."""
    hidden = TRUTH.with_effect("direction_asymmetry", {"a": 0.03})
    runs = [measured(hidden) for _ in range(count)]
    found = diagnose(MODEL, runs, names=NAMES, seed=1)
    assert [one.name for one in found.effects] == ["direction_asymmetry"]
    value = found.effects[0].parameters["a"]
    assert value.low <= 0.03 <= value.high
    assert len(found.series) == 2 * count


def test_a_time_limit_ends_the_search_and_says_so() -> None:
    hidden = TRUTH.with_effect("load_cell_offset", HIDDEN["load_cell_offset"])
    found = diagnose(MODEL, [measured(hidden)], names=NAMES, seed=1, time_limit_s=1e-9)
    assert found.effects == ()
    assert any("time limit" in one for one in found.notes)


def test_a_time_limit_ends_the_search_within_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever waits would wait for minutes where a step fits many sets of four effects."""
    hidden = TRUTH.with_effect("load_cell_offset", HIDDEN["load_cell_offset"])
    fitted = []
    before = growing._with_effect

    def one_of_many(*given: Any) -> Any:
        fitted.append(given)
        monkeypatch.setattr(time_limit, "time", SimpleNamespace(monotonic=lambda: math.inf))
        return before(*given)

    monkeypatch.setattr(growing, "_with_effect", one_of_many)
    found = diagnose(MODEL, [measured(hidden)], names=NAMES, seed=1, time_limit_s=1e6)
    assert 1 <= len(fitted) <= cores()  # those that others had begun beside it
    assert any("time limit" in one for one in found.notes)


def test_a_zero_far_from_half_a_count_is_an_effect_and_no_nuisance() -> None:
    hidden = TRUTH.with_effect("encoder_offset", {"offset_rad": 0.02})  # six counts
    found = diagnose(MODEL, [measured(hidden)], names=("encoder_offset", *NAMES), seed=1)
    # Of which encoder, a constant between the two cannot say.
    assert [one.name for one in found.effects] == ["encoder_offset"]
