"""Faults of a recording are named, and good recordings have no findings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.estimation.gate.check import check_data
from bowden.estimation.gate.finding import Finding
from bowden.model import Inputs, Mode, Model, parse_model, simulate
from bowden.recording.recording import Recording

from ..rigs import TABLE_1, as_recording, experiment_2

MODEL = parse_model(TABLE_1)
MODE = Mode.TORQUE_POSITION
LOAD_COUNT, MOTOR_COUNT = 2 * np.pi / 10_000, 2 * np.pi / 2000


def sensed(run: Recording) -> Recording:
    """With counts and noise, as sensors have them."""
    generator = np.random.default_rng(1)
    return replace(
        run,
        motor_angle_rad=np.round(run.motor_angle_rad / MOTOR_COUNT) * MOTOR_COUNT,
        load_angle_rad=np.round(run.load_angle_rad / LOAD_COUNT) * LOAD_COUNT,
        load_torque_nm=run.load_torque_nm + generator.normal(0, 5e-4, run.time_s.size),
        source="run.csv",
    )


def busy(model: Model = MODEL) -> Recording:
    """An operator moves the load, a sine of torque at the motor."""
    time_s = np.arange(8000) * 1e-3
    load = 0.6 * np.sin(2 * np.pi * 0.4 * time_s)
    torque = 0.15 * np.sin(2 * np.pi * 0.31 * time_s)
    inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=load)
    return sensed(as_recording(simulate(model, MODE, inputs)))


def locked() -> Recording:
    """Experiment 1: the load does not move, and with Table I nothing reaches it."""
    time_s = np.arange(8000) * 1e-3
    torque = 0.125 * np.sin(2 * np.pi * 0.3 * time_s)
    inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=0 * time_s)
    return sensed(as_recording(simulate(MODEL, MODE, inputs)))


RUN = busy()


def stops(run: Recording, mode: Mode = MODE) -> list[Finding]:
    return [one for one in check_data(MODEL, [run], mode) if one.severity == "stop"]


@pytest.mark.parametrize("run", [RUN, locked(), sensed(experiment_2(MODEL))])
@pytest.mark.parametrize("mode", list(Mode))
def test_a_good_recording_has_no_findings(run: Recording, mode: Mode) -> None:
    assert check_data(MODEL, [run], mode) == ()


@pytest.mark.parametrize(
    "effect",
    [
        ("viscous_friction", {"mu_v_s_per_m": 1.0}),
        ("wrap_angle_change", {"extra_wrap_rad": 2.0}),
        ("load_cell_gain", {"g": 0.1}),
        ("gravity_imbalance", {"amplitude_nm": 0.5, "phase_rad": 0.3}),
        ("direction_asymmetry", {"a": 0.3}),
    ],
)
def test_a_strong_missing_effect_is_no_bad_recording(effect: tuple[str, dict[str, float]]) -> None:
    run = busy(MODEL.with_effect(*effect))
    assert stops(run) == []


@pytest.mark.parametrize(
    ("channel", "factor", "what", "words"),
    [
        ("load_torque_nm", -1.0, "sign", "load torque has the wrong sign"),
        ("motor_torque_nm", -1.0, "sign", "motor torque has the wrong sign"),
        ("motor_angle_rad", -1.0, "sign", "motor angle has the wrong sign"),
        ("load_angle_rad", -1.0, "sign", "load angle has the wrong sign"),
        ("load_torque_nm", 1e3, "units", "load torque seems to be in mN m (1000 times too large)"),
        ("load_torque_nm", 1e-3, "units", "load torque seems to be in kN m (1000 times too small)"),
        ("motor_torque_nm", 1e3, "units", "motor torque seems to be in mN m (1000 "),
        ("motor_angle_rad", 180 / np.pi, "units", "motor angle seems to be in degrees"),
        ("load_angle_rad", 180 / np.pi, "units", "load angle seems to be in degrees"),
        ("load_angle_rad", 1e3, "units", "load angle seems to be in mrad"),
    ],
)
def test_wrong_signs_and_units_are_recognised(
    channel: str, factor: float, what: str, words: str
) -> None:
    wrong = replace(RUN, **{channel: factor * getattr(RUN, channel)})
    (finding, *_) = stops(wrong)
    assert finding.what == what
    assert words in finding.text


def test_channels_in_each_others_place() -> None:
    wrong = replace(RUN, motor_torque_nm=RUN.load_torque_nm, load_torque_nm=RUN.motor_torque_nm)
    (finding, *_) = stops(wrong)
    assert finding.what == "swapped"
    assert "motor and load torque" in finding.text


def test_friction_beyond_the_model_is_no_other_rig() -> None:
    # The motor turns half as far for a rad of the load, but late in a stroke as far as ever.
    rough = parse_model(TABLE_1.replace("value: 0.21,", "value: 0.8,"))
    run = busy(rough)
    assert not np.isclose(_ratio_of(run), _ratio_of(RUN), rtol=0.2)
    assert not any(finding.what == "rig" for finding in stops(run))


def _ratio_of(run: Recording) -> float:
    return float(np.polyfit(run.load_angle_rad, run.motor_angle_rad, 1)[0])


def test_another_rig() -> None:
    other = parse_model(
        TABLE_1.replace("motor_pulley_radius_m: 0.020", "motor_pulley_radius_m: 0.03")
    )
    assert any(finding.what == "rig" for finding in stops(busy(other)))


def test_a_clipped_load_cell() -> None:
    level = 0.8 * float(RUN.load_torque_nm.max())
    clipped = replace(RUN, load_torque_nm=np.minimum(RUN.load_torque_nm, level))
    (finding, *_) = stops(clipped)
    assert finding.what == "clipped"
    assert f"{level:.4g} N m" in finding.text


def test_a_load_cell_that_drops_out() -> None:
    torque = RUN.load_torque_nm.copy()
    torque[3000:3300] = 0.0
    assert {finding.what for finding in stops(replace(RUN, load_torque_nm=torque))} >= {"held"}


@pytest.mark.parametrize("digits", [6, 12])
@pytest.mark.parametrize("sigma_nm", [0.0, 5e-4])
def test_levels_of_torque_and_rests_are_no_dropouts(digits: int, sigma_nm: float) -> None:
    """What a drive is told to apply has no noise, and a simulated cell need have none."""
    time_s = np.arange(12_000) * 1e-3
    load = 0.4 * np.sin(np.clip(np.mod(time_s, 4.0), 0.0, 2.0) * np.pi)  # 2 s moving, 2 s still
    corners_s, levels_nm = (
        [0, 2, 3, 5, 6, 8, 9, 11, 12],
        [0, 0.12, 0.12, 0.05, 0.05, -0.1, -0.1, 0, 0],
    )
    torque = np.interp(time_s, corners_s, levels_nm)
    torque += 0.01 * np.sin(np.pi * time_s) ** 2 * (np.abs(np.gradient(torque)) > 0.0)
    run = simulate(MODEL, MODE, Inputs(time_s, motor_torque_nm=torque, load_angle_rad=load))
    read = as_recording(run)
    noise = np.random.default_rng(2).normal(0.0, sigma_nm, time_s.size)
    given = np.round(torque, digits), np.round(read.load_torque_nm + noise, digits)
    recording = replace(read, motor_torque_nm=given[0], load_torque_nm=given[1])
    assert check_data(MODEL, [recording], MODE) == ()


def test_spikes_are_found() -> None:
    torque = RUN.load_torque_nm.copy()
    torque[[1000, 2500, 4000]] += 2.0
    found = check_data(MODEL, [replace(RUN, load_torque_nm=torque)], MODE)
    assert [(one.what, one.severity) for one in found] == [("spikes", "warn")]
    assert "3 samples" in found[0].text


@pytest.mark.parametrize("channel", ["load_torque_nm", "motor_angle_rad"])
def test_a_dead_sensor(channel: str) -> None:
    dead = replace(RUN, **{channel: np.full(RUN.time_s.size, 0.1)})
    (finding, *_) = stops(dead)
    assert finding.what == "constant"


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("noise_nm", [0.0, 5e-4])
def test_a_cell_that_feels_nothing_is_dead_unless_play_may_hide_all(
    moves: bool, noise_nm: float
) -> None:
    """A locked load behind play, and a cell that shows its noise: nothing says that it is dead."""
    model = MODEL.with_values({"friction.mu_d": 0.05})
    time_s = np.arange(8000) * 1e-3
    torque = 0.3 * np.sin(2 * np.pi * 0.3 * time_s)
    load = 0.3 * moves * np.sin(2 * np.pi * 0.4 * time_s)
    run = simulate(model, MODE, Inputs(time_s, motor_torque_nm=torque, load_angle_rad=load))
    read = np.random.default_rng(3).normal(0.0, noise_nm, time_s.size)
    found = check_data(model, [replace(sensed(as_recording(run)), load_torque_nm=read)], MODE)
    says = [one.severity for one in found if one.what == "constant"]
    assert says == ["stop" if moves or noise_nm == 0.0 else "warn"]
    assert moves or noise_nm == 0.0 or "stop" not in [one.severity for one in found]


def test_a_dead_load_encoder() -> None:
    assert stops(replace(RUN, load_angle_rad=np.zeros(RUN.time_s.size)))[0].what == "constant"


def test_nothing_moves() -> None:
    zero = np.zeros(RUN.time_s.size)
    still = Recording(
        RUN.time_s,
        motor_angle_rad=zero,
        load_angle_rad=zero,
        motor_torque_nm=zero,
        load_torque_nm=zero,
    )
    assert stops(still)[0].what == "constant"


def test_time() -> None:
    assert stops(_cut(RUN, slice(0, 150)))[0].what == "short"
    slow = replace(RUN, time_s=1e3 * RUN.time_s)
    assert stops(slow)[0].what == "sampling"
    assert "is time_s in s" in stops(slow)[0].text
    kept = np.ones(RUN.time_s.size, dtype=bool)
    kept[2000:2300] = False
    found = check_data(MODEL, [_cut(RUN, kept)], MODE)
    assert [(one.what, one.severity) for one in found] == [("gap", "warn")]
    kept[2000:6000] = False
    assert "gap" in {one.what for one in stops(_cut(RUN, kept))}


def test_an_encoder_that_is_not_the_model_files() -> None:
    count = 2 * np.pi / 4000
    other = replace(RUN, load_angle_rad=np.round(RUN.load_angle_rad / count) * count)
    found = check_data(MODEL, [other], MODE)
    assert ("resolution", "stop") in {(one.what, one.severity) for one in found}
    assert any("4000 counts" in one.text and "10000" in one.text for one in found)


def test_each_recording_is_named() -> None:
    bad = replace(RUN, load_torque_nm=-RUN.load_torque_nm, source="bad.csv")
    found = check_data(MODEL, [RUN, bad], MODE)
    assert [one.where for one in found] == ["bad.csv"]


def _cut(run: Recording, kept: slice | np.ndarray) -> Recording:
    return Recording(
        run.time_s[kept],
        motor_angle_rad=run.motor_angle_rad[kept],
        load_angle_rad=run.load_angle_rad[kept],
        motor_torque_nm=run.motor_torque_nm[kept],
        load_torque_nm=run.load_torque_nm[kept],
        source=run.source,
    )


@pytest.mark.parametrize("factor", [0.93, 1.07])
def test_a_torque_that_just_reaches_a_locked_load_or_just_does_not_is_no_unit(
    factor: float,
) -> None:
    # With Table I the front arrives at 0.501 N m; friction a few percent off decides whether the
    # cell reads a few hundredths or nothing at all.
    time_s = np.arange(8000) * 1e-3
    torque = 0.505 * np.sin(2 * np.pi * 0.3 * time_s)
    inputs = Inputs(time_s, motor_torque_nm=torque, load_angle_rad=0 * time_s)
    rig = MODEL.with_values({"friction.mu_d": factor * MODEL.value("friction.mu_d")})
    assert stops(sensed(as_recording(simulate(rig, MODE, inputs)))) == []
