"""The inventory: what is in a recording is counted as anybody would count it."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from bowden.diagnosis.excitation import Excitation, excitation, shows
from bowden.model import parse_model
from bowden.model.effects import CATALOGUE
from bowden.model.effects.effect import Excitation as Word
from bowden.recording.recording import Recording

from ..rigs import TABLE_1

MODEL = parse_model(TABLE_1)
TIME_S = np.arange(24_000) * 1e-3


def run(load: np.ndarray, torque: np.ndarray | float = 0.0, **extra: np.ndarray) -> Recording:
    time_s = TIME_S[: load.size]
    given = torque + np.zeros(load.size)
    return Recording(
        time_s,
        motor_angle_rad=5.2 * load,
        load_angle_rad=load,
        motor_torque_nm=given,
        load_torque_nm=0.0 * load,
        channels=extra,
    )


def inventory(*recordings: Recording) -> dict[str, Excitation]:
    return {one.name: one for one in excitation(MODEL, recordings)}


STROKES = 0.7 * np.sin(2 * np.pi * 0.5 * TIME_S)


def test_every_word_of_the_vocabulary_is_counted_and_no_other() -> None:
    assert tuple(inventory(run(STROKES))) == get_args(Word)
    for effect in CATALOGUE.values():
        assert set(effect.excited_by) <= set(get_args(Word))


def test_strokes() -> None:
    found = inventory(run(STROKES, 0.1 * np.sin(2 * np.pi * 0.2 * TIME_S)))
    assert found["reversal"].value == 24  # two a cycle of 2 s
    assert found["angle_range"].value == pytest.approx(1.4, rel=1e-3)
    assert found["motor_turns"].value == pytest.approx(5.2 * 1.4 / (2 * np.pi), rel=1e-3)
    assert found["many_cycles"].value == pytest.approx(12 * 4 * 0.7 * 0.104, rel=0.01)
    # 95 % of abs(sin) are below sin(0.95 pi / 2).
    peak = 0.7 * np.pi**2 * np.sin(0.95 * np.pi / 2)
    assert found["acceleration"].value == pytest.approx(peak, rel=0.03)
    assert found["load_range"].value == pytest.approx(0.2 / (0.02 * 10.0), rel=0.01)
    for name in ("reversal", "speed_range", "load_range", "long_time", "acceleration"):
        assert found[name].present, name
    assert not found["standstill"].present
    assert not found["temperature_range"].present


def test_pauses() -> None:
    share = np.clip((TIME_S % 2.0) / 1.2, 0.0, 1.0)  # 0.8 s of pause every 2 s
    found = inventory(run(0.3 * np.where(TIME_S % 4 < 2, share, 1 - share)))
    # The velocity looks 50 ms either way.
    assert found["standstill"].value == pytest.approx(0.8, abs=0.11)
    assert found["standstill"].present


def test_one_speed_is_no_range() -> None:
    triangle = 0.6 * (4 * np.abs((TIME_S / 4) % 1 - 0.5) - 1)
    assert not inventory(run(triangle))["speed_range"].present
    assert inventory(run(STROKES))["speed_range"].present


def test_slow_motion() -> None:
    # 10 mm/s at the cable, which is 0.096 rad/s.
    assert inventory(run(0.0962 * TIME_S))["slow_motion"].value == pytest.approx(24.0, rel=0.01)
    assert inventory(run(1.0 * TIME_S))["slow_motion"].value == 0.0


def test_temperature_counts_only_where_every_recording_has_it() -> None:
    warm = run(STROKES, conduit_temperature_c=20.0 + TIME_S / 2)
    assert inventory(warm)["temperature_range"].value == pytest.approx(12.0, rel=0.01)
    assert inventory(warm, run(STROKES))["temperature_range"].value == 0.0


def test_trembling_is_no_reversal() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-3, TIME_S.size)
    assert inventory(run(0.02 * TIME_S + noise))["reversal"].value == 0


def test_a_locked_load_moves_at_the_motor() -> None:
    motor = 0.008 * np.sin(2 * np.pi * 0.5 * TIME_S)  # 16 mrad, as Experiment 1 has it
    zero = 0.0 * TIME_S
    locked = Recording(
        TIME_S,
        motor_angle_rad=motor,
        load_angle_rad=zero,
        motor_torque_nm=0.1 * np.sin(TIME_S),
        load_torque_nm=zero,
    )
    found = inventory(locked)
    assert found["reversal"].value == 24
    assert not found["angle_range"].present


def test_the_model_tells_tensions() -> None:
    # Without motor torque the load end of one cable falls to 1.5719 N of 10 (PHYSICS.md).
    assert inventory(run(STROKES))["slack_or_low_tension"].value == pytest.approx(0.157, rel=0.02)
    # With 0.3 N m one cable goes slack.
    slack = inventory(run(STROKES, -0.8 * np.sin(2 * np.pi * 0.5 * TIME_S)))
    assert slack["slack_or_low_tension"].present


def test_an_effect_shows_where_all_it_needs_is_there() -> None:
    found = excitation(MODEL, [run(STROKES)])
    assert shows(found, ("reversal", "speed_range"))
    assert not shows(found, ("reversal", "temperature_range"))
    assert shows(found, ())
    assert "too little" in next(one.text for one in found if one.name == "standstill")
