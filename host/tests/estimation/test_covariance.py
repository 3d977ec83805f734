"""The covariance of observations: it covers the error that is really there, wherever it arises."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from bowden.estimation.covariance import Covariance, Data, covariance
from bowden.estimation.likelihood import Scales, block_costs, whiten
from bowden.model import Inputs, Mode, Model, ModelError, parse_model, simulate
from bowden.model.experiments.variants import with_damping, with_memory, with_segments
from bowden.recording.recording import Recording
from bowden.signals.alternatives import other_memories, solved_two_ways
from bowden.signals.dequantise import EDGE_NOISE
from bowden.signals.prediction import PREDICTED

from ..rigs import TABLE_1

MODEL = parse_model(TABLE_1)
EXACT = parse_model(TABLE_1.replace("{segments: 50}", "{solver: mesh_free}"))
STICKING = TABLE_1.replace("coulomb", "stiction").replace("10 %}}", "10 %}, mu_s: 0.4}")
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
def right_noise_of(kind: str) -> tuple[Data, Covariance]:
    return noise_of(kind, MODEL)


def noise_of(kind: str, model: Model) -> tuple[Data, Covariance]:
    data = Data.of(measured(kind), 0, model, MODE)
    return data, covariance(data, model)


def apart(data: Data, *models: Model) -> np.ndarray:
    return np.asarray(np.abs(np.subtract(*(data.predict(one) for one in models))))


@pytest.mark.parametrize("kind", ["sine", "triangle", "rests"])
@pytest.mark.parametrize("channel", [0, 1])
def test_sigma_covers_the_error_of_a_right_model(kind: str, channel: int) -> None:
    data, noise = right_noise_of(kind)
    rows = data.observations.channel == channel
    gap = data.observations.measured - data.predict(MODEL) - noise.offset
    scaled = np.abs(gap[rows] - channel * np.mean(gap[rows])) / noise.sigma[rows]
    # An edge's error is uniform, within 1.73 sigma; the torque's lasts from reversal to reversal,
    # so that a run of 12 s has some dozens of independent ones: their RMS is known to 20 %.
    assert np.sqrt(np.mean(scaled**2)) < 1.2
    assert np.mean(scaled < 2.0) > 0.87


@pytest.mark.parametrize("kind", ["sine", "random"])
def test_what_a_mesh_errs_by_is_within_the_noise_whatever_its_shape(kind: str) -> None:
    """Segments let go one by one: elsewhere on a mesh that is twice as fine, and without one."""
    load, torque = motion(kind)
    run = simulate(EXACT, MODE, Inputs(TIME_S, motor_torque_nm=torque, load_angle_rad=load))
    noise_nm = np.random.default_rng(1).normal(0.0, 5e-4, TIME_S.size)
    cell_nm = run.load_torque_nm + noise_nm  # the given channels are exact: only the mesh errs
    channels = {"load_angle_rad": load, "motor_torque_nm": torque, "load_torque_nm": cell_nm}
    recording = Recording(TIME_S, motor_angle_rad=run.motor_angle_rad, **channels)
    data = Data.of(recording, 0, EXACT, MODE)
    coarse, fine = with_segments(EXACT, 25), with_segments(EXACT, 50)
    correction = data.predict(fine) - data.predict(coarse)
    noise = covariance(data, coarse, correction=correction)
    left = data.observations.measured - data.predict(coarse) - noise.offset
    white = whiten(data, noise, Scales((0.0, 0.0)), left[:, None])
    # One block in four may leave more than twice what is expected. Were the error of the
    # correction's shape alone, one in three would, up to 47 times.
    chi = white.squares[:, 0] / white.sizes
    assert np.quantile(chi, 0.75) < 2.0
    assert np.max(chi) < 6.0


def test_a_count_matters_much_more_after_a_reversal() -> None:
    data, noise = right_noise_of("sine")
    rows = data.observations.channel == 0
    time_s, sigma = data.observations.time_s[rows], noise.sigma[rows]
    load, _ = motion("sine")
    speed = np.gradient(load, TIME_S)
    turns = TIME_S[1:][np.diff(np.sign(speed)) != 0]
    since = (time_s - turns[:, None])[:, :]
    after = np.any((since > 0.0) & (since < 15e-3), axis=0)
    sliding = np.abs(np.interp(time_s, TIME_S, speed)) > 0.9 * speed.max()
    assert np.median(sigma[after]) > 10 * np.median(sigma[sliding])
    # While the pair slides, friction is constant and only the load cell and the motor torque count:
    # 0.5 mN m, and 5.2 times what smoothing leaves of 0.3 mN m.
    assert np.median(sigma[sliding]) < 1.5e-3


def test_the_same_seed_gives_the_same_covariance() -> None:
    data, noise = right_noise_of("triangle")
    again = covariance(Data.of(measured("triangle"), 0, MODEL, MODE), MODEL)
    other = covariance(Data.of(measured("triangle"), 0, MODEL, MODE, seed=1), MODEL)
    np.testing.assert_array_equal(again.sigma, noise.sigma)
    assert np.any(other.sigma != noise.sigma)
    assert data.observations.time_s.size == noise.sigma.size


def test_a_path_that_the_model_cannot_run_leaves_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    data, noise = right_noise_of("triangle")
    lost = list(data.paths())[::4]
    predict = Data.predict

    def some(
        self: Data, model: Model, numbers: Any, given: Recording | None = None, near: Any = None
    ) -> Any:
        if any(given is one for one in lost):
            raise ModelError("found no agreement", model.source)
        return predict(self, model, numbers, given, near)

    monkeypatch.setattr(Data, "predict", some)
    fewer = covariance(data, MODEL)
    # A standard deviation from 36 paths is known to 12 %, the same paths are in both.
    assert np.sqrt(np.mean(fewer.sigma**2) / np.mean(noise.sigma**2)) == pytest.approx(1, abs=0.12)
    lost += list(data.paths())
    with pytest.raises(ModelError, match="no drawn input path"):
        covariance(data, MODEL)


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
    data = Data.of(clean, 0, EXACT, MODE)
    sigma = covariance(data, EXACT).sigma
    assert np.all(sigma > 0.0)
    # Half a sample of the torque's slope, 0.6 mN m at most, times the ratio of the pulleys.
    assert np.sqrt(np.mean(sigma[data.observations.channel == 0] ** 2)) < 2e-3


def test_a_torque_that_is_held_from_sample_to_sample_is_within_the_noise() -> None:
    """Steps or straight lines between its samples: a recording does not say."""
    load, _ = motion("sine")
    torque = 0.1 * np.sign(np.sin(2 * np.pi * 0.7 * TIME_S))
    late = TIME_S - 0.5e-3
    found = []
    for given in (torque, np.interp(late, TIME_S, torque)):
        inputs = Inputs(TIME_S, motor_torque_nm=given, load_angle_rad=load)
        found.append(simulate(EXACT, MODE, inputs).load_torque_nm)
    # Noise decides that all samples count as observations, not only those after a change.
    cell = np.random.default_rng(4).normal(0.0, 1e-4, TIME_S.size)
    clean = Recording(
        TIME_S,
        motor_angle_rad=np.zeros_like(load),
        load_angle_rad=load,
        motor_torque_nm=torque,
        load_torque_nm=found[0] + cell,
    )
    data = Data.of(clean, 0, EXACT, MODE)
    rows = data.observations.channel == 0
    sigma = covariance(data, EXACT).sigma[rows]
    step = np.interp(data.observations.time_s[rows], TIME_S, np.abs(found[1] - found[0]))
    # All of half a sample where the noise is that of a choice between none, early and late.
    assert np.sqrt(np.mean(step**2)) < 1.3 * np.sqrt(np.mean(sigma**2))


@pytest.mark.parametrize("mode", [Mode.POSITION_TORQUE, Mode.POSITION_POSITION])
def test_the_other_modes(mode: Mode) -> None:
    data = Data.of(measured("sine"), 0, MODEL, mode)
    assert len(PREDICTED[mode]) == len(np.unique(data.observations.channel))
    assert np.all(np.isfinite(covariance(data, MODEL).sigma))


def test_where_friction_falls_with_speed_another_memory_is_within_the_noise() -> None:
    model = MODEL.with_effect("stribeck_friction", {"a": 0.4, "v_s_m_per_s": 0.05})
    data, noise = noise_of("sine", model)
    other = with_memory(model, 2.0 * model.transmission.friction.memory_s)
    rows = data.observations.channel == 0
    # Twice the memory is not more than the three times that the noise allows for.
    scaled = (apart(data, model, other) / noise.sigma)[rows]
    assert np.sqrt(np.mean(scaled**2)) < 1.0


@pytest.mark.parametrize("kind", ["rests", "triangle"])
def test_a_rig_of_another_memory_slips_within_the_noise_at_any_steps(kind: str) -> None:
    model = MODEL.with_effect("stribeck_friction", {"a": 0.4, "v_s_m_per_s": 0.05})
    data, noise = noise_of(kind, model)
    assert data.is_thinned
    rig = with_memory(model, 2 / 3 * model.transmission.friction.memory_s)
    gap = data.sampled(1e-3).predict(rig) - data.predict(model) - noise.offset
    white = whiten(data, noise, Scales((0.0, 0.0)), gap[:, None])
    # A slip lasts for a block: all of its observations are off by one draw of 48, within 1.7 sigma.
    assert np.max(white.squares[:, 0] / white.sizes) < 3.0


def test_a_memory_is_open_where_it_is_one_of_the_sliding_speed() -> None:
    curve = {"a": 0.4, "v_s_m_per_s": 0.05}
    speed = MODEL.with_effect("stribeck_friction", curve)
    own = {"fall": 0.4, "fall_m_per_s": 0.05, "memory_s": 0.015}
    told = MODEL.with_effect("frictional_lag", own)
    memory_s = speed.transmission.friction.memory_s
    found = other_memories(speed, 12)
    assert sum(share**2 for _, share in found) == pytest.approx(1.0)
    memories = [other.transmission.friction.memory_s / memory_s for other, _ in found]
    assert min(memories) == pytest.approx(1 / 3)
    assert max(memories) == pytest.approx(3.0)
    for one in (MODEL, told, with_memory(speed, 0.0)):
        assert not other_memories(one, 12)


def test_how_soon_a_motor_s_oscillation_ends_is_within_the_noise() -> None:
    model = MODEL.with_effect("motor_inertia", {"inertia_kg_m2": 3e-5})
    data, noise = noise_of("stop", model)
    other = with_damping(model, 0.5 * model.transmission.damping_s)
    rows = data.observations.channel == 1
    swing = apart(data, model, other)[rows]
    assert swing.max() > 0.5 * MOTOR_COUNT  # half a count of the motor's encoder: it shows
    # Half of the losses is not less than the third that the noise allows for.
    where = swing > 0.3 * swing.max()
    assert np.sqrt(np.mean((swing / noise.sigma[rows])[where] ** 2)) < 1.0


def test_a_damping_that_the_model_tells_is_no_noise() -> None:
    inertia = {"inertia_kg_m2": 3e-5}
    open_to, told = (
        noise_of("stop", MODEL.with_effect("motor_inertia", values))[1].sigma
        for values in (inertia, inertia | {"damping": 1.0})
    )
    assert np.all(told <= open_to)
    assert told.sum() < 0.9 * open_to.sum()


@pytest.mark.parametrize("kind", ["sine", "triangle", "rests"])
def test_what_a_further_path_may_do_is_what_the_drawn_ones_do_nearby(kind: str) -> None:
    """Of 48 paths the next one is beyond all with a probability of 1/49: its share of the variance.

    As far about an observation as what a model lacks is correlated, 0.15 s, in the same channel.
    """
    data, noise = right_noise_of(kind)
    seen = data.observations
    variance = noise.sigma**2 - noise.own
    for row in range(0, variance.size, 7):
        alike = seen.channel == seen.channel[row]
        apart_s = np.abs(seen.time_s - seen.time_s[row])
        # An observation just 0.15 s away may count or not: its time is rounded.
        low, high = (variance[alike & (apart_s <= most)].max() for most in (0.1499, 0.1501))
        assert np.sqrt(low / 49) * (1 - 1e-9) <= noise.shifted[row]
        assert noise.shifted[row] <= np.sqrt(high / 49) * (1 + 1e-9)


def test_another_mesh_is_within_the_noise_unless_it_is_another_rig() -> None:
    """Stiction without a length acts over a segment, eq. (6): the shorter, the less it holds."""
    load, torque = motion("rests")
    inputs = Inputs(TIME_S, motor_torque_nm=torque, load_angle_rad=load)
    for length, is_another in (("", True), (", stiction_length_m: 0.1", False)):
        model = parse_model(STICKING.replace("mu_s: 0.4", "mu_s: 0.4" + length))
        run = simulate(model, MODE, inputs)
        cell_nm = run.load_torque_nm + np.random.default_rng(1).normal(0.0, 1e-3, TIME_S.size)
        channels = {"load_angle_rad": load, "motor_torque_nm": torque, "load_torque_nm": cell_nm}
        recording = Recording(TIME_S, motor_angle_rad=run.motor_angle_rad, **channels)
        data = Data.of(recording, 0, model, MODE)
        beyond = apart(data, model, with_segments(model, 100)) / covariance(data, model).sigma
        assert beyond.max() > 10.0 if is_another else beyond.max() < 1.0


@pytest.mark.parametrize("effect", [None, ("pretension_loss", {"a": 1e-6, "tau_s": 60.0})])
def test_which_way_a_slip_is_solved_is_within_the_noise(
    effect: tuple[str, dict[str, float]] | None,
) -> None:
    """Neither a rig nor a weak effect that only the implicit steps can take is likelier by it."""
    model = parse_model(STICKING.replace("mu_s: 0.4", "mu_s: 0.4, stiction_length_m: 0.1"))
    ways = solved_two_ways(model, MODE)
    assert ways is not None
    load, torque = motion("rests")
    run = simulate(ways[1], MODE, Inputs(TIME_S, motor_torque_nm=torque, load_angle_rad=load))
    cell_nm = run.load_torque_nm + np.random.default_rng(1).normal(0.0, 5e-4, TIME_S.size)
    channels = {"load_angle_rad": load, "motor_torque_nm": torque, "load_torque_nm": cell_nm}
    recording = Recording(TIME_S, motor_angle_rad=run.motor_angle_rad, **channels)
    data = Data.of(recording, 0, model, MODE)
    noise = covariance(data, model.with_effect(*effect) if effect else model)
    cost = []
    for one in ways:
        left = data.observations.measured - data.predict(one)
        white = whiten(data, noise, Scales((0.0, 0.0)), left[:, None])
        cost.append(float(np.sum(block_costs(white))))
    assert (apart(data, *ways) / np.sqrt(noise.own)).max() > 10.0  # they differ at some slips
    assert abs(cost[0] - cost[1]) < 5.0
