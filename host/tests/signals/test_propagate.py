"""Local noise: it covers the error that is really there, at reversals as elsewhere."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from bowden.model import Inputs, Mode, parse_model, simulate
from bowden.model.experiments.variants import with_damping, with_memory
from bowden.recording.recording import Recording
from bowden.signals.dequantise import EDGE_NOISE
from bowden.signals.prediction import simulate_recording
from bowden.signals.propagate import LocalNoise, local_noise, noise_floor

from ..rigs import TABLE_1

MODEL = parse_model(TABLE_1)
EXACT = parse_model(TABLE_1.replace("{segments: 50}", "{solver: mesh_free}"))
TIME_S = np.arange(12_000) * 1e-3
LOAD_COUNT, MOTOR_COUNT = 2 * np.pi / 10_000, 2 * np.pi / 2000
MODE = Mode.TORQUE_POSITION


def motion(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Load angle and motor torque."""
    torque = 0.12 * np.sin(2 * np.pi * 0.31 * TIME_S)
    if kind == "sine":
        return 0.6 * np.sin(2 * np.pi * 0.4 * TIME_S), torque
    if kind == "triangle":
        return 0.5 * (4 * np.abs((0.25 * TIME_S) % 1 - 0.5) - 1) + 0.5, torque
    corner = np.random.default_rng(5).uniform(-0.6, 0.6, 12)
    corner[0] = 0.0
    share = np.clip((TIME_S % 1.5) / 0.8, 0.0, 1.0)
    step = (TIME_S // 1.5).astype(int)
    smooth = 10 * share**3 - 15 * share**4 + 6 * share**5
    return corner[step] + (corner[step + 1] - corner[step]) * smooth, torque


@cache
def measured(kind: str) -> Recording:
    """What sensors make of a run of the exact solution."""
    load, torque = motion(kind)
    run = simulate(EXACT, MODE, Inputs(TIME_S, motor_torque_nm=torque, load_angle_rad=load))
    generator = np.random.default_rng(1)

    def counted(angle: np.ndarray, count: float) -> np.ndarray:
        edges = generator.normal(0.0, EDGE_NOISE, angle.size)
        return np.round(angle / count + edges) * count

    return Recording(
        TIME_S,
        motor_angle_rad=counted(run.motor_angle_rad, MOTOR_COUNT),
        load_angle_rad=counted(load, LOAD_COUNT),
        motor_torque_nm=torque + generator.normal(0.0, 3e-4, TIME_S.size),
        load_torque_nm=run.load_torque_nm + generator.normal(0.0, 5e-4, TIME_S.size),
    )


@cache
def noise_of(kind: str) -> LocalNoise:
    return local_noise(MODEL, MODE, measured(kind))


def gap(kind: str, channel: str) -> np.ndarray:
    best = noise_of(kind).estimates.recording
    simulated = simulate_recording(MODEL, MODE, best)
    return np.asarray(getattr(best, channel) - getattr(simulated, channel))


@pytest.mark.parametrize("kind", ["sine", "triangle", "rests"])
@pytest.mark.parametrize("channel", ["load_torque_nm", "motor_angle_rad"])
def test_sigma_covers_the_error_of_a_right_model(kind: str, channel: str) -> None:
    scaled = np.abs(gap(kind, channel)) / noise_of(kind).sigma[channel]
    # 68 and 95 % of a normal error. Errors persist from reversal to reversal, so a run of 12 s
    # is worth some dozens of independent ones: +-10 % either way; too wide is no harm to a verdict.
    assert np.mean(scaled < 1.0) > 0.6
    assert np.mean(scaled < 2.0) > 0.87
    assert np.mean(scaled < 1.0) < 0.93


@pytest.mark.parametrize("kind", ["sine", "triangle", "rests"])
def test_the_floor_is_what_a_right_model_leaves(kind: str) -> None:
    floor = noise_floor(noise_of(kind).sigma["load_torque_nm"])
    left = np.sqrt(np.mean(gap(kind, "load_torque_nm") ** 2))
    # A few reversals make most of either: a factor of two is what six of them allow.
    assert 0.4 < left / floor < 1.6


def test_a_count_is_worth_much_more_after_a_reversal() -> None:
    sigma = noise_of("sine").sigma["load_torque_nm"]
    load, _ = motion("sine")
    speed = np.gradient(load, TIME_S)
    (turn,) = np.nonzero(np.diff(np.sign(speed)))
    after = np.unique(turn[:, None] + np.arange(1, 15))
    sliding = np.abs(speed) > 0.9 * speed.max()
    assert np.median(sigma[after]) > 20 * np.median(sigma[sliding])
    # While the pair slides, friction is constant and only the load cell and the motor torque count:
    # 0.5 mN m, and 5.2 times what smoothing leaves of 0.3 mN m.
    assert np.median(sigma[sliding]) < 1.5e-3


def test_estimates_leave_less_than_the_readings() -> None:
    read = measured("sine")
    simulated = simulate_recording(MODEL, MODE, read).load_torque_nm
    plain = np.sqrt(np.mean((read.load_torque_nm - simulated) ** 2))
    assert np.sqrt(np.mean(gap("sine", "load_torque_nm") ** 2)) < 0.6 * plain


def test_parts_add_up_in_squares() -> None:
    found = noise_of("sine")
    for channel, parts in found.parts.items():
        total = np.sqrt(sum(part**2 for part in parts.values()))
        np.testing.assert_allclose(found.sigma[channel], total, rtol=1e-12)


def test_the_same_seed_gives_the_same_noise() -> None:
    again = local_noise(MODEL, MODE, measured("triangle"))
    other = local_noise(MODEL, MODE, measured("triangle"), seed=1)
    for channel, sigma in noise_of("triangle").sigma.items():
        np.testing.assert_array_equal(again.sigma[channel], sigma)
        assert np.any(other.sigma[channel] != sigma)


def test_a_clean_recording_still_has_a_positive_sigma() -> None:
    load, torque = motion("sine")
    run = simulate(EXACT, MODE, Inputs(TIME_S, motor_torque_nm=torque, load_angle_rad=load))
    clean = Recording(
        TIME_S,
        motor_angle_rad=run.motor_angle_rad,
        load_angle_rad=load,
        motor_torque_nm=torque,
        load_torque_nm=run.load_torque_nm,
    )
    found = local_noise(EXACT, MODE, clean, draws=4)
    assert all(np.all(sigma > 0.0) for sigma in found.sigma.values())
    # Half a sample of the torque's slope, 0.6 mN m at most, times the ratio of the pulleys.
    assert noise_floor(found.sigma["load_torque_nm"]) < 2e-3


def test_a_torque_that_is_held_from_sample_to_sample_is_within_the_noise() -> None:
    """Steps or straight lines between its samples: a recording does not say."""
    load, _ = motion("sine")
    torque = 0.1 * np.sign(np.sin(2 * np.pi * 0.7 * TIME_S))
    late = TIME_S - 0.5e-3
    found = []
    for given in (torque, np.interp(late, TIME_S, torque)):
        inputs = Inputs(TIME_S, motor_torque_nm=given, load_angle_rad=load)
        found.append(simulate(EXACT, MODE, inputs).load_torque_nm)
    clean = Recording(
        TIME_S,
        motor_angle_rad=np.zeros_like(load),
        load_angle_rad=load,
        motor_torque_nm=torque,
        load_torque_nm=found[0],
    )
    sigma = local_noise(EXACT, MODE, clean, draws=4).sigma["load_torque_nm"]
    apart = np.abs(found[1] - found[0])
    assert apart.max() > 0.1  # N m: a step's middle
    # All of half a sample where the noise is that of a choice between none, early and late.
    assert np.sqrt(np.mean(apart**2)) < 1.3 * np.sqrt(np.mean(sigma**2))


def test_errors_of_the_inputs_last_and_the_sensors_do_not() -> None:
    found = noise_of("sine")
    share = found.share("load_torque_nm")
    inputs = found.parts["load_torque_nm"]["inputs"] / found.sigma["load_torque_nm"]
    least, most = inputs <= np.quantile(inputs, 0.1), inputs >= np.quantile(inputs, 0.9)
    assert np.median(share[most]) < 0.1
    assert np.median(share[least]) > 1.5 * np.median(share[most])
    assert np.all((share > 0.0) & (share <= 1.0))
    assert 0.005 < found.memory_s["load_torque_nm"] < 3.0  # a stroke lasts 1.25 s
    every_fifth = np.arange(0, TIME_S.size, 5)
    fewer = local_noise(MODEL, MODE, measured("sine"), samples=lambda _: every_fifth)
    thin = fewer.share("load_torque_nm")
    assert np.all(thin >= share[every_fifth] * (1 - 1e-9))
    assert thin.sum() <= share.sum() * 1.01


@pytest.mark.parametrize("mode", [Mode.POSITION_TORQUE, Mode.POSITION_POSITION])
def test_the_other_modes(mode: Mode) -> None:
    found = local_noise(MODEL, mode, measured("sine"), draws=4)
    assert len(found.sigma) == 2
    assert all(np.all(np.isfinite(sigma)) for sigma in found.sigma.values())


def test_the_floor_of_chosen_samples() -> None:
    sigma = np.array([3.0, 4.0, 100.0])
    assert noise_floor(sigma, np.array([True, True, False])) == pytest.approx(np.sqrt(12.5))
    assert noise_floor([sigma[:1], sigma[1:2]]) == pytest.approx(np.sqrt(12.5))
    assert noise_floor(sigma, np.zeros(3, dtype=bool)) == 0.0


def test_where_friction_falls_with_speed_another_memory_is_within_the_noise() -> None:
    slow = {"a": 0.4, "v_s_m_per_s": 0.05}
    model = MODEL.with_effect("stribeck_friction", slow)
    noise = local_noise(model, MODE, measured("sine"), draws=4)
    assert not np.any(noise_of("sine").parts["load_torque_nm"]["open"])
    other = with_memory(model, 2.0 * model.transmission.friction.memory_s)
    apart = [
        simulate_recording(one, MODE, noise.recording).load_torque_nm for one in (model, other)
    ]
    # Twice the memory is not more than the three times that the noise allows for.
    scaled = np.abs(apart[1] - apart[0]) / noise.sigma["load_torque_nm"]
    assert np.sqrt(np.mean(scaled**2)) < 1.0


def test_how_soon_a_motor_stops_ringing_is_within_the_noise() -> None:
    model = MODEL.with_effect("motor_inertia", {"inertia_kg_m2": 3e-5})
    noise = local_noise(model, MODE, measured("stop"), draws=4)
    other = with_damping(model, 0.5 * model.transmission.damping_s)
    apart = [
        simulate_recording(one, MODE, noise.recording).motor_angle_rad for one in (model, other)
    ]
    rings = np.abs(apart[1] - apart[0])
    assert rings.max() > 0.5 * 2 * np.pi / 2000  # half a count of the motor's encoder: it shows
    # Half of the losses is not less than the third that the noise allows for.
    where = rings > 0.3 * rings.max()
    assert np.sqrt(np.mean((rings / noise.sigma["motor_angle_rad"])[where] ** 2)) < 1.0


def test_what_a_law_that_is_one_of_several_does_is_open_by_its_share() -> None:
    """Bristles may act otherwise by a third of what they do, where they do it."""
    bristles = MODEL.with_effect("presliding_compliance", {"slip_m": 3e-4})
    both = bristles.with_effect("load_cell_offset", {"offset_nm": 0.02})
    recording = measured("sine")
    strict = local_noise(both, MODE, recording, seed=2, draws=4)
    plain, share = MODEL.with_effect("load_cell_offset", {"offset_nm": 0.02}), 0.3
    lenient = local_noise(both, MODE, recording, seed=2, draws=4, or_else=[(plain, share)])
    for name in ("load_torque_nm", "motor_angle_rad"):
        assert np.all(strict.parts[name]["open"] == 0.0)
        does = np.abs(
            getattr(simulate_recording(both, MODE, strict.recording), name)
            - getattr(simulate_recording(plain, MODE, strict.recording), name)
        )
        # Smoothed over 20 ms, so the mean square is that of the effect.
        found = float(np.mean(lenient.parts[name]["open"] ** 2)) ** 0.5
        assert found == pytest.approx(share * float(np.mean(does**2)) ** 0.5, rel=0.02)
        assert np.all(lenient.sigma[name] >= strict.sigma[name])
