"""Rigs whose true numbers are drawn from the priors in their model files, recorded, then fitted.

`trials` draws one rig, records it by the independent solver (`hil_tests.hidden_effects`), fits it
by bowden's public functions in each `SETTINGS` that is its turn, and returns what the fits said
beside the truth. `calibration` runs many rigs, `calibration_score` counts.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from bowden.estimation.calibrate import Calibration, calibrate
from bowden.estimation.covariance import Data, covariance
from bowden.estimation.fit import as_fitted
from bowden.estimation.likelihood import Scales, best_scales, whiten
from bowden.estimation.quantities import estimate
from bowden.model import Mode, Model, ModelError, parse_model
from bowden.recording.recording import Recording
from bowden.workers import workers

from hil_tests.benchmarks.calibration_score import Number, Trial
from hil_tests.hidden_effects import excitation
from hil_tests.hidden_effects.hidden import Signals
from hil_tests.hidden_effects.recordings import Rig, draw_rig
from hil_tests.hidden_effects.strength import (
    CELL_NOISE_NM,
    LOAD_COUNTS,
    MOTOR_COUNTS,
    counts,
    read_out,
)

LENGTH_S = (15.0, 20.0)
RATES_HZ = (500.0, 1000.0)
RARE = 4  # every fourth rig: four recordings, or an `estimate`
ROUNDING = 1.0 / np.sqrt(12.0)  # counts, RMS
LOCKED_NM_PER_N = 0.1  # of pretension: one cable goes slack at about 0.08 (PHYSICS.md)
MODE = Mode.TORQUE_POSITION


@dataclass(frozen=True)
class Setting:
    """What is fitted to what.

    Parameters
    ----------
    name : str
        As in the table.
    recordings : int
    counted : bool
        Whether angles are counts; else they carry white noise of the same size.
    quantity : str or None
        Of `estimate`, with flat priors of its numbers; None: `calibrate`.
    every : int
        Which share of the rigs.
    """

    name: str
    recordings: int = 1
    counted: bool = True
    quantity: str | None = None
    every: int = 1


SETTINGS = (
    Setting("calibrate, one recording"),
    Setting("calibrate, one recording, angles with white noise", counted=False),
    Setting("calibrate, four recordings", recordings=4, every=RARE),
    Setting(
        "calibrate, four recordings, angles with white noise", 4, counted=False, every=2 * RARE
    ),
    Setting("estimate friction", quantity="friction", every=RARE),
    Setting("estimate pretension", quantity="pretension", every=RARE),
    Setting("estimate stiffness, load locked", quantity="stiffness", every=RARE),
)
FLAT = {
    "friction": ("mu_d",),
    "pretension": ("pretension_n",),
    "stiffness": ("axial_stiffness_n", "pretension_n", "mu_d"),
}


def trials(seed: int, number: int) -> list[Trial]:
    """Draw one rig, fit it in every setting whose turn it is; a rig is the same for a seed."""
    rng = np.random.default_rng([seed, number])
    rig = draw_rig(rng, most_sigmas=np.inf)
    rate_hz = RATES_HZ[number % len(RATES_HZ)]
    length_s = float(rng.uniform(*LENGTH_S))
    mine = [one for one in SETTINGS if number % one.every == 0]
    recorded = Recorded(rig, rng, rate_hz, length_s)
    return [_trial(recorded, setting, number) for setting in mine]


class Recorded:
    """The recordings of one rig, made when they are asked for."""

    def __init__(self, rig: Rig, rng: np.random.Generator, rate_hz: float, length_s: float) -> None:
        self.rig, self.rate_hz = rig, rate_hz
        self._draws = self._of(rng, length_s)
        self._locked = rng.spawn(1)[0]
        self._length_s = length_s
        self._made: list[tuple[Recording, Recording]] = []

    def get(self, setting: Setting) -> list[Recording]:
        """Return what a setting is fitted to."""
        if setting.quantity == "stiffness":
            rng = self._locked
            return [_read(self.rig, _held(rng, self.rig, self._length_s), rng, self.rate_hz)[0]]
        while len(self._made) < setting.recordings:
            self._made.append(next(self._draws))
        return [one[0 if setting.counted else 1] for one in self._made[: setting.recordings]]

    def _of(
        self, rng: np.random.Generator, length_s: float
    ) -> Iterator[tuple[Recording, Recording]]:
        pair = self.rig.pair
        friction_nm = (
            2.0 * pair.ends.motor_radius_m * pair.law.pretension_n * pair.mu * pair.wrap_rad
        )
        while True:
            signals = excitation.draw(rng, min(0.9 * friction_nm + 0.05, 0.6), length_s)
            yield _read(self.rig, signals, rng, self.rate_hz)


def _held(rng: np.random.Generator, rig: Rig, length_s: float) -> Signals:
    """Motor torque alone, the load locked."""
    drawn = excitation.draw(rng, 0.0, length_s)
    held = np.zeros(drawn.time_s.size)
    most_nm = LOCKED_NM_PER_N * rig.pair.law.pretension_n
    torque = excitation.motor_torque(rng, drawn.time_s, held, most_nm)
    return replace(drawn, motor_torque_nm=torque, load_angle_rad=held)


def _read(
    rig: Rig, signals: Signals, rng: np.random.Generator, rate_hz: float
) -> tuple[Recording, Recording]:
    """Return what the sensors said: encoders with counts, and with white noise as large."""
    seen = read_out(rig.pair, signals, [])
    cell = seen.load_torque_nm + rng.normal(0.0, CELL_NOISE_NM, signals.time_s.size)
    stride = round(excitation.RATE_HZ / rate_hz)
    torques = {"motor_torque_nm": signals.motor_torque_nm, "load_torque_nm": cell}
    exact = {
        "motor_angle_rad": (seen.motor_angle_rad, MOTOR_COUNTS),
        "load_angle_rad": (seen.load_angle_rad, LOAD_COUNTS),
    }
    counted = {name: counts(angle, per_turn) for name, (angle, per_turn) in exact.items()}
    noisy = {
        name: angle + rng.normal(0.0, ROUNDING * 2.0 * np.pi / per_turn, angle.size)
        for name, (angle, per_turn) in exact.items()
    }
    first, second = (
        Recording(
            signals.time_s[::stride],
            {name: values[::stride] for name, values in (angles | torques).items()},
        )
        for angles in (counted, noisy)
    )
    return first, second


def _trial(recorded: Recorded, setting: Setting, number: int) -> Trial:
    rig = recorded.rig
    told = Trial(number, setting.name, recorded.rate_hz, setting.recordings)
    try:
        recordings = recorded.get(setting)
    except ArithmeticError as error:
        return replace(told, error=f"not drawn: {error}")
    model = parse_model(_without_tolerance(rig.model_yaml, FLAT.get(setting.quantity or "", ())))
    start = time.perf_counter()
    try:
        found = _fit(model, recordings, setting)
    except ModelError as error:
        return replace(told, error=str(error))
    seconds = time.perf_counter() - start
    numbers = tuple(
        Number(one.path, rig.nominal[one.path.rpartition(".")[2]], one.value, one.low, one.high)
        for one in found.estimates
    )
    blocks = block_squares(true_model(rig), recordings[0]) if setting.recordings == 1 else ()
    return replace(told, seconds=seconds, numbers=numbers, blocks=blocks)


def _fit(model: Model, recordings: list[Recording], setting: Setting) -> Calibration:
    if setting.quantity is None:
        return calibrate(model, recordings, MODE)
    return estimate(setting.quantity, model, recordings).calibration


def _without_tolerance(text: str, names: tuple[str, ...]) -> str:
    """Return a model file in which some numbers have no tolerance: their prior is flat."""
    for name in names:
        text = re.sub(rf"{name}: {{value: ([^,]+), [^}}]+}}", rf"{name}: \1", text)
    return text


def true_model(rig: Rig) -> Model:
    """Return the model with the true numbers, solved as fits solve it."""
    model = parse_model(rig.model_yaml)
    values = {path: rig.nominal[path.rpartition(".")[2]] for path, _, _ in model.free_parameters()}
    return as_fitted(model.with_values(values), MODE)


def block_squares(model: Model, recording: Recording) -> tuple[float, ...]:
    """Return whitened chi-squared over its count, block by block, of a model that is true.

    The scales of the covariance are read off the residual, as every fit does.
    """
    data = Data.of(recording, 0, model, MODE)
    noise = covariance(data, model)
    residual = data.observations.measured - data.predict(model) - noise.offset
    with workers(1) as pool:
        scales = best_scales([(data, noise, residual, None)], Scales((0.0, 0.0)), pool)
    white = whiten(data, noise, scales, residual[:, None])
    return tuple((white.squares[:, 0] / white.sizes).tolist())
