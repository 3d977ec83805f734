"""Which experiment would tell the candidates apart best: each is simulated for every candidate.

Takes the candidates' fitted models and the noise of the sensors; returns a sentence with numbers
and a command. The experiments are those that a hand at the load and `bowden record` can run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from bowden.model import Inputs, Mode, Model, ModelError, Trajectory, simulate
from bowden.model.experiments.tunnel import tunnel_torque
from bowden.model.experiments.variants import with_pretension, with_segments
from bowden.signals.prediction import PREDICTED
from bowden.workers import workers

_Floats = NDArray[np.float64]

STEP_S, SEGMENTS = 0.01, 40  # a comparison of models on one mesh needs no fine one
MOST_CANDIDATES = 3
NEARLY_AS_GOOD = 0.8  # of the best separation: then the simpler experiment, earlier in the list
TELLS_APART = 2.0  # times the noise, sample by sample
SHOWS = 1.0  # times the noise: less shows nothing
AMPLITUDE_RAD = float(np.radians(40.0))


@dataclass(frozen=True)
class NextExperiment:
    """What to do next.

    Parameters
    ----------
    text : str
        In a sentence or two, with numbers.
    command : str
        To record it.
    separation : float
        RMS difference between the two most similar candidates' predictions, in sigmas, after
        calibration has done what it may to hide it.
    """

    text: str
    command: str
    separation: float


@dataclass(frozen=True)
class Protocol:
    """An experiment: what a person does, what the motor does, and for how long."""

    name: str
    do: str
    duration_s: float
    angle: Callable[[_Floats], _Floats]
    enable: str = "tunnel"
    pretension: float = 1.0

    def torque_nm(self, angle: _Floats, level_nm: float) -> _Floats:
        """Motor torque of the drive meanwhile."""
        if self.enable == "tunnel":
            return np.asarray(tunnel_torque(angle))
        return np.full(angle.size, level_nm if self.enable == "torque" else 0.0)

    def command(self, level_nm: float) -> str:
        """Return the command that records it."""
        how = {
            "tunnel": "--enable tunnel",
            "torque": f"--enable torque --torque {level_nm:.2g}",
            "zero": "--enable torque --torque 0",
        }[self.enable]
        return f"bowden record {self.name}.blf --duration {self.duration_s:g} {how}"


def _strokes(frequency_hz: float, amplitude: float = AMPLITUDE_RAD) -> Callable[[_Floats], _Floats]:
    return lambda time_s: np.asarray(amplitude * np.sin(2.0 * np.pi * frequency_hz * time_s))


def _staircase(time_s: _Floats) -> _Floats:
    """Strokes at four constant speeds, from 0.1 to 2 rad/s, one after the other."""
    speed = np.array([0.1, 0.3, 0.8, 2.0])[np.minimum((time_s / 15.0).astype(int), 3)]
    phase = np.cumsum(speed) * STEP_S / (4.0 * AMPLITUDE_RAD)
    return np.asarray(AMPLITUDE_RAD * (4.0 * np.abs((phase + 0.25) % 1.0 - 0.5) - 1.0))


def _with_pauses(time_s: _Floats) -> _Floats:
    """Strokes of a second, with pauses that grow from 0.5 to 8 s."""
    pauses = (0.5, 1.0, 2.0, 4.0, 8.0, 0.5, 1.0, 2.0, 4.0, 8.0)
    angle, start, level = np.zeros_like(time_s), 0.0, 0.0
    for number, pause in enumerate(pauses):
        target = AMPLITUDE_RAD if number % 2 == 0 else -AMPLITUDE_RAD
        share = np.clip(time_s - start, 0.0, 1.0)
        smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        angle = np.where(time_s >= start, level + (target - level) * smooth, angle)
        start, level = start + 1.0 + pause, target
    return angle


def _minor_loops(time_s: _Floats) -> _Floats:
    """Small strokes upon a slow large one."""
    slow = AMPLITUDE_RAD * np.sin(2.0 * np.pi * 0.05 * time_s)
    return np.asarray(slow + 0.06 * np.sin(2.0 * np.pi * 0.6 * time_s))


def _locked(time_s: _Floats) -> _Floats:
    return np.zeros_like(time_s)


PROTOCOLS = (
    Protocol("strokes", "move the load by ±40° at 0.5 Hz in the tunnel", 20.0, _strokes(0.5)),
    Protocol("slow", "move the load by ±40° at 0.05 Hz in the tunnel", 40.0, _strokes(0.05)),
    Protocol("fast", "move the load by ±40° at 1.5 Hz in the tunnel", 20.0, _strokes(1.5)),
    Protocol("speeds", "move the load by ±40° at 0.1, 0.3, 0.8 and 2 rad/s", 60.0, _staircase),
    Protocol("free", "move the load by ±40° without motor torque", 20.0, _strokes(0.5), "zero"),
    Protocol("loaded", "move the load by ±40° against the motor", 20.0, _strokes(0.5), "torque"),
    Protocol("pauses", "move the load with pauses of 0.5 to 8 s in the tunnel", 45.0, _with_pauses),
    Protocol(
        "loops", "move the load in small loops of ±3° upon slow ones of ±40°", 40.0, _minor_loops
    ),
    Protocol("wide", "move the load by ±90° at 0.2 Hz", 30.0, _strokes(0.2, float(np.pi / 2))),
    Protocol("locked", "lock the load and hold a motor torque", 10.0, _locked, "torque"),
    Protocol(
        "low",
        "lower the pretension to 60 % and move the load by ±40° at 0.5 Hz in the tunnel",
        20.0,
        _strokes(0.5),
        pretension=0.6,
    ),
    Protocol(
        "long",
        "move the load by ±40° at 0.5 Hz in the tunnel for two minutes, the conduit's temperature "
        "recorded",
        120.0,
        _strokes(0.5),
    ),
)
"""Simplest first."""


def next_experiment(
    candidates: Sequence[tuple[str, Model]], mode: Mode, sigma: Mapping[str, float]
) -> NextExperiment | None:
    """Choose the experiment that separates candidates best.

    Parameters
    ----------
    candidates : sequence of (str, Model)
        Names and fitted models, best first; the first three count. One of them may be the model
        without any effect.
    mode : Mode
        Whose predicted channels are compared. The simulation itself imposes motor torque and load
        angle, as the experiments do.
    sigma : mapping of str to float
        Usual noise of each predicted channel, N m or rad.

    Returns
    -------
    NextExperiment or None
        None where there are fewer than two candidates, or none of the experiments can be simulated.
    """
    chosen = [(name, _coarse(model)) for name, model in candidates[:MOST_CANDIDATES]]
    if len(chosen) < 2:
        return None
    with workers() as pool:
        found = pool.map(partial(_separation, chosen, mode, sigma), PROTOCOLS)
    reached = [(pair, one) for pair, one in zip(found, PROTOCOLS, strict=True) if pair is not None]
    if not reached:
        return None
    most = max(pair.sigmas for pair, _ in reached)
    pair, protocol = next(x for x in reached if x[0].sigmas >= NEARLY_AS_GOOD * most)
    return NextExperiment(
        _text(pair, protocol), protocol.command(_level(chosen[0][1])), pair.sigmas
    )


@dataclass(frozen=True)
class _Pair:
    """The two candidates that an experiment separates least."""

    names: tuple[str, str]
    sigmas: float
    channel: str
    difference: float


def _separation(
    candidates: Sequence[tuple[str, Model]],
    mode: Mode,
    sigma: Mapping[str, float],
    protocol: Protocol,
) -> _Pair | None:
    runs = []
    for name, model in candidates:
        run = _run(model, protocol)
        if run is None:
            return None
        runs.append((name, run))
    channels = [name for name in PREDICTED[mode] if sigma.get(name, 0.0) > 0.0]
    movable = _sensitivities(_plain(candidates[0][1]), protocol, channels, sigma)
    pairs = []
    for (first, a), (second, b) in combinations(runs, 2):
        left = _hidden(_weighted(a, b, channels, sigma), movable)
        size = left.size // max(len(channels), 1)
        by_channel = [
            float(np.sqrt(np.mean(left[k * size : (k + 1) * size] ** 2)))
            for k in range(len(channels))
        ]
        worst = int(np.argmax(by_channel))
        name = channels[worst]
        pairs.append(
            _Pair((first, second), by_channel[worst], name, by_channel[worst] * sigma[name])
        )
    return min(pairs, key=lambda pair: pair.sigmas)


def _coarse(model: Model) -> Model:
    segments = model.transmission.segments
    if model.solver != "mesh" or not segments or segments <= SEGMENTS:
        return model
    return with_segments(model, SEGMENTS)


def _plain(model: Model) -> Model:
    """Return the model without its effects, which is the fastest to simulate."""
    return replace(model, document=model.document.model_copy(update={"effects": ()}))


def _run(model: Model, protocol: Protocol) -> Trajectory | None:
    """Simulate an experiment; None where the model cannot."""
    time_s: _Floats = np.arange(round(protocol.duration_s / STEP_S)) * np.float64(STEP_S)
    angle = protocol.angle(time_s)
    torque = protocol.torque_nm(angle, _level(model))
    if protocol.angle is _locked:  # the drive ramps the torque up, and down again
        ramp = np.minimum(time_s, protocol.duration_s - time_s)
        torque = torque * np.minimum(ramp / (0.4 * protocol.duration_s), 1.0)
    inputs = Inputs(
        time_s,
        motor_torque_nm=torque,
        load_angle_rad=angle,
        conduit_temperature_c=20.0 + 0.08 * time_s,
    )
    try:
        if protocol.pretension != 1.0:
            pretension = model.document.rig.cable.pretension_n.value
            model = with_pretension(model, protocol.pretension * pretension)
        run = simulate(model, Mode.TORQUE_POSITION, inputs)
    except ModelError:
        return None
    finite = np.all(np.isfinite(run.load_torque_nm)) and np.all(np.isfinite(run.motor_angle_rad))
    return run if finite else None


def _level(model: Model) -> float:
    """Motor torque to hold: half of what one cable's pretension makes at the pulley."""
    pair = model.transmission
    return float(f"{0.5 * pair.motor_pulley_radius_m * pair.pretension_n:.1g}")


def _weighted(
    first: Trajectory, second: Trajectory, channels: Sequence[str], sigma: Mapping[str, float]
) -> _Floats:
    """Difference of two predictions in sigmas, one channel after the other."""
    parts = []
    for name in channels:
        difference = getattr(first, name) - getattr(second, name)
        if name.endswith("_rad"):  # an encoder's zero says nothing
            difference = difference - difference.mean()
        parts.append(difference / sigma[name])
    return np.concatenate(parts) if parts else np.zeros(0)


def _sensitivities(
    model: Model,
    protocol: Protocol,
    channels: Sequence[str],
    sigma: Mapping[str, float],
) -> _Floats:
    """Return what a tolerance of each known number does to the predictions, a column each."""
    centre = _run(model, protocol) if model.free_parameters() else None
    if centre is None:
        return np.zeros((0, 0))
    columns = []
    for path, _, sigma_of_it in model.free_parameters():
        half, _ = model.moved(path, 0.5 * sigma_of_it)
        run = _run(half, protocol)
        if run is not None:
            columns.append(2.0 * _weighted(run, centre, channels, sigma))
    return np.stack(columns, axis=1) if columns else np.zeros((0, 0))


def _hidden(difference: _Floats, movable: _Floats) -> _Floats:
    """Take out what calibration within its tolerances would hide."""
    if not movable.size:
        return difference
    normal = movable.T @ movable + np.eye(movable.shape[1])
    return np.asarray(difference - movable @ np.linalg.solve(normal, movable.T @ difference))


def _text(pair: _Pair, protocol: Protocol) -> str:
    first, second = (name.replace("_", " ") for name in pair.names)
    unit, scale = ("mrad", 1e3) if pair.channel.endswith("_rad") else ("mN m", 1e3)
    channel = pair.channel.rpartition("_")[0].replace("_", " ")
    what = protocol.do[0].upper() + protocol.do[1:]
    apart = (
        f"{first} and {second} then differ by {scale * pair.difference:.3g} {unit} RMS in "
        f"{channel}, {pair.sigmas:.3g} times the noise, after calibration"
    )
    if pair.sigmas < SHOWS:
        return f"No experiment that the drive can run would tell {first} and {second} apart."
    if pair.sigmas < TELLS_APART:
        return (
            f"No experiment that the drive can run tells {first} and {second} apart well. Best: "
            f"{protocol.do}, for {protocol.duration_s:g} s; {apart}."
        )
    return f"{what}, for {protocol.duration_s:g} s: {apart}."
