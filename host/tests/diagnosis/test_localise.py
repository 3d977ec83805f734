"""Where a disagreement sits is found where it was put, and nowhere when it is only noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bowden.diagnosis.localise import SIGNIFICANT, localise
from bowden.model import Inputs, Mode, parse_model, simulate
from bowden.recording.recording import Recording
from scipy.signal import lfilter

from ..rigs import TABLE_1_COARSE

TIME_S = np.arange(20_000) * 1e-3
ANGLE = 0.6 * np.sin(2 * np.pi * 0.4 * TIME_S)
SPEED = 0.6 * 2 * np.pi * 0.4 * np.cos(2 * np.pi * 0.4 * TIME_S)
ZERO = np.zeros(TIME_S.size)
TORQUE = 0.1 * np.sin(2 * np.pi * 0.27 * TIME_S)
RUN = Recording(
    TIME_S,
    motor_angle_rad=5.2 * ANGLE,
    load_angle_rad=ANGLE,
    motor_torque_nm=TORQUE,
    load_torque_nm=ZERO,
    source="a.csv",
)


def red_noise(seed: int, memory_s: float = 0.05) -> np.ndarray:
    """Unit variance, autocorrelated as the residuals of a friction model are."""
    keep = np.exp(-1e-3 / memory_s)
    white = np.random.default_rng(seed).normal(size=TIME_S.size)
    return np.asarray(lfilter([np.sqrt(1 - keep**2)], [1.0, -keep], white))


def test_noise_alone_sits_nowhere() -> None:
    """However long it remembers; with independent samples taken for granted, most runs would."""
    alarms = [
        any(one.significant for one in localise([red_noise(seed)], [RUN]).places)
        for seed in range(40)
    ]
    # 5 % expected at most; 6 or more of 40 has a chance of 1.4 %.
    assert sum(alarms) <= 5
    assert SIGNIFICANT == 0.05


PLANTED = {
    "load angle 0.4..0.6 rad": ANGLE > 0.42,
    "load moving towards negative angle": SPEED < 0.0,
    "load speed above": np.abs(SPEED) > 1.35,
    "last third of the time": TIME_S > 13.4,
    "motor torque above": TORQUE > 0.06,
}


@pytest.mark.parametrize("place", PLANTED)
def test_a_disagreement_is_found_where_it_was_put(place: str) -> None:
    residual = red_noise(1) + 3.0 * PLANTED[place]
    found = localise([residual], [RUN]).places[0]
    assert found.condition.startswith(place)
    assert found.significant
    assert found.share_of_gap > 1.5 * found.share_of_time
    assert found.bias > 1.5


def test_after_reversals() -> None:
    phase = (TIME_S * 0.8) % 1.0  # two reversals a cycle of 2.5 s, at 0.625 s and every 1.25 s
    since = ((phase - 0.5) % 1.0) / 0.8
    residual = red_noise(2) + 4.0 * ((since > 0.05) & (since < 0.2))
    places = [one.condition for one in localise([residual], [RUN]).places if one.significant]
    assert "time since reversal 0.05..0.2 s" in places[:2]


def test_one_recording_of_several() -> None:
    other = replace(RUN, source="b.csv")
    places = localise([red_noise(3), 3.0 * red_noise(4)], [RUN, other]).places
    assert places[0].condition == "recording b.csv"


def test_temperature_and_tension() -> None:
    warm = RUN.with_channels(conduit_temperature_c=20.0 + 10 * np.sin(0.2 * TIME_S) ** 2)
    model = parse_model(TABLE_1_COARSE)
    inputs = Inputs(TIME_S, motor_torque_nm=TORQUE, load_angle_rad=ANGLE)
    run = simulate(model, Mode.TORQUE_POSITION, inputs)
    residual = red_noise(5) + 3.0 * (warm["conduit_temperature_c"] > 26.0)
    places = localise([residual], [warm], [run]).places
    assert places[0].condition.startswith("conduit temperature above")
    assert any(one.condition.startswith("highest tension") for one in places)


def test_shares_of_a_kind_add_up() -> None:
    places = localise([red_noise(6)], [RUN]).places
    for kind in ("load angle", "motor torque", "time since reversal", "load speed", "load moving"):
        of_kind = [one for one in places if one.condition.startswith(kind)]
        rest = [one for one in places if one.condition == "load at standstill"]
        parts = of_kind + (rest if kind == "load speed" else [])
        assert sum(one.share_of_gap for one in parts) == pytest.approx(1.0), kind
        assert sum(one.share_of_time for one in parts) == pytest.approx(1.0), kind


def test_frequencies() -> None:
    slow = localise([np.sin(2 * np.pi * 0.5 * TIME_S)], [RUN]).frequencies
    assert max(slow, key=lambda one: one.share_of_gap).condition == "frequency 0.3..1 Hz"
    white = localise([np.random.default_rng(7).normal(size=TIME_S.size)], [RUN]).frequencies
    for one in white:
        assert one.share_of_gap == pytest.approx(one.share_of_time, abs=0.02)


def test_the_map_has_it_in_the_right_cell() -> None:
    residual = np.where((ANGLE > 0.3) & (SPEED > 0.8), 5.0, 0.1)
    found = localise([residual], [RUN]).map
    middle = (found.angle_edges_rad[1:] + found.angle_edges_rad[:-1]) / 2
    speed = (found.velocity_edges_rad_s[1:] + found.velocity_edges_rad_s[:-1]) / 2
    hot = found.mean > 2.5
    assert hot.any()
    for row, column in zip(*np.nonzero(hot), strict=True):
        assert middle[column] > 0.25
        assert speed[row] > 0.5
    assert np.isnan(found.mean[0, 0])  # full speed at the end of the stroke: never there


def test_too_short_to_say() -> None:
    few = slice(0, 4500)
    short = RUN.select(few)
    places = localise([np.abs(ANGLE[few])], [short]).places
    assert all(one.p_value == 1.0 and not one.significant for one in places)


def test_the_same_seed_gives_the_same_answer() -> None:
    assert localise([red_noise(8)], [RUN]).places == localise([red_noise(8)], [RUN]).places
