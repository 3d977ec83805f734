"""The layers of effects between a recording and the cables, and the way through them and back.

Takes the effects in force and the series of one simulation; `simulation` asks it what the cables
feel, gives it what they answer, and reads what a recording would say. Knows no effect by name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from bowden.model.effects import CATALOGUE
from bowden.model.effects.effect import Channel, Enters
from bowden.model.errors import ModelError
from bowden.model.histories import Histories, TorqueSlope
from bowden.model.model_effects import InForce
from bowden.model.trajectory import COLUMNS, FloatArray, Inputs, Mode, Trajectory, speed_of
from bowden.model.transmission import Transmission

OUTSIDE_IN = get_args(Enters)
SHIFT_RAD = 1e-3  # either way, for slopes: a twentieth of a radian of the 48th harmonic
STEEPEST = 0.5  # of the softest that cables can be: steeper, and a pulley could snap over


@dataclass(frozen=True)
class Asked:
    """What a solver is asked.

    Parameters
    ----------
    motor, load : ndarray of shape (n,)
        The mode's two series, as they act on the cables.
    histories : Histories
    slope : TorqueSlope or None
        Of the one that is a torque, if that is known.
    """

    motor: FloatArray
    load: FloatArray
    histories: Histories
    slope: TorqueSlope | None = None

    @property
    def _parts(self) -> list[FloatArray]:
        every = self.histories
        histories = (every.friction_factor, every.friction_factor_back, every.lengthening_m)
        about = () if self.slope is None else (self.slope.about_rad,)
        return [self.motor, self.load, *(part for part in histories if part is not None), *about]

    @property
    def series(self) -> FloatArray:
        """All of it in one row."""
        return np.concatenate(self._parts)

    def with_series(self, row: FloatArray) -> Asked:
        """Return the same from another such row."""
        parts = iter(np.split(row, len(self._parts)))
        motor, load = next(parts), next(parts)
        histories = self.histories
        factor = next(parts) if histories.friction_factor is not None else None
        back = next(parts) if histories.friction_factor_back is not None else None
        length = next(parts) if histories.lengthening_m is not None else None
        slope = self.slope and replace(self.slope, about_rad=next(parts))
        return Asked(motor, load, Histories(factor, back, length), slope)

    def agrees_with(self, other: Asked, share: float) -> bool:
        """Return whether both ask the same, but for a share of each series' largest value."""
        return all(
            np.abs(x - y).max() <= share * np.abs(y).max()
            for x, y in zip(self._parts, other._parts, strict=True)
        )


class Layers:
    """One simulation's way through the effects.

    `sides[0]` holds what a recording says, `sides[-1]` what acts on the cables, and those between
    what stands between two layers. Angles that are not given are there too, from the last pass.

    Parameters
    ----------
    effects : sequence of InForce
        Of the model, in any order: layers lie by where effects enter, then as in the catalogue.
    mode : Mode
        Which channels are given.
    takes_slopes : bool
        Whether the solver settles a torque together with the angle that it depends on.
    """

    def __init__(self, effects: Sequence[InForce], mode: Mode, *, takes_slopes: bool) -> None:
        ordered = sorted(effects, key=_depth)
        self._layers = [one for one in ordered if one.variant.channels]
        self._histories = [one for one in ordered if one.variant.histories is not None]
        self._given, self._speeds = mode.columns, mode.speeds
        # Angles first: on the way out, torques look at them.
        self._predicted = [name for name in COLUMNS if name not in mode.columns]
        self.sides: list[dict[str, FloatArray]] = [{} for _ in range(len(self._layers) + 1)]
        self._turned = next(
            (n for n in self._given if takes_slopes and self._feels_itself(n)), None
        )

    @property
    def is_empty(self) -> bool:
        """Return whether there is nothing between the recording and the solver."""
        return not self._layers and not self._histories

    @property
    def looks_ahead(self) -> bool:
        """Return whether what acts on the cables depends on what they are yet to answer."""
        return bool(self._looked_at)

    @property
    def _looked_at(self) -> list[str]:
        """Which predicted channels are looked at on the way in."""
        seen = {name for one in self._histories for name in one.variant.sees}
        seen |= {name for given in self._given for name in self._seen_by(given)}
        return [name for name in self._predicted if name in seen]

    def _seen_by(self, name: str) -> set[str]:
        channels = [channel for one in self._layers for channel in one.variant.channels]
        return {seen for channel in channels if channel.name == name for seen in channel.sees}

    def _feels_itself(self, name: str) -> bool:
        """Return whether a channel is a torque that depends on the angle of its own pulley."""
        angle = _angle_of(name)
        return angle in self._predicted and angle in self._seen_by(name)

    def begin(
        self, inputs: Inputs, pair: Transmission, near: Trajectory | None = None
    ) -> FloatArray:
        """Take the series of a recording, and what is predicted from a trajectory near it.

        Without one a predicted angle follows the other one at first.

        Returns
        -------
        ndarray of shape (n,), s
            The recording's times, and others before them by each channel's delay, where a late
            channel has its corners.
        """
        delays = [
            one.values[channel.late_by]
            for one in self._layers
            for channel in one.variant.channels
            if channel.late_by is not None
        ]
        time_s = np.asarray(inputs.time_s, dtype=np.float64)
        ratio = pair.pulley_ratio
        times = _with_earlier(time_s, delays)
        series: dict[str, FloatArray] = {"time_s": times}
        for name in (*self._given, "conduit_temperature_c", *self._speeds):
            values = getattr(inputs, name)
            if values is None:
                continue
            same = times.size == time_s.size
            series[name] = np.asarray(values, float) if same else np.interp(times, time_s, values)
        if "motor_angle_rad" not in series:
            series["motor_angle_rad"] = ratio * series["load_angle_rad"]
        if "load_angle_rad" not in series:
            series["load_angle_rad"] = series["motor_angle_rad"] / ratio
        for side in self.sides:
            side.update(series)
        if near is not None and self.looks_ahead:
            for name in self._predicted:
                values = np.interp(times, near.time_s, getattr(near, name))
                for side in self.sides:
                    side[name] = values
            self._undo(self._looked_at)
        return times

    def felt(self, pair: Transmission) -> Asked:
        """Work out what acts on the cables, as far as their answer is known."""
        slope = self._slope(pair)
        self._undo(self._given)
        inside, histories = self.sides[-1], Histories()
        for one in self._histories:
            assert one.variant.histories is not None
            histories = histories & one.variant.histories(inside, pair, one.values)
        return Asked(inside[self._given[0]], inside[self._given[1]], histories, slope)

    def at_answer(self, asked: Asked) -> Asked:
        """Return what the solver was asked, at the angle that it found."""
        slope = asked.slope
        if self._turned is None or slope is None:
            return asked
        angle_rad = self.sides[-1][_angle_of(self._turned)]
        more_nm = slope.nm_per_rad * (angle_rad - slope.about_rad)
        moved = replace(asked, slope=TorqueSlope(slope.nm_per_rad, angle_rad))
        if self._turned == "motor_torque_nm":
            return replace(moved, motor=asked.motor + more_nm)
        return replace(moved, load=asked.load + more_nm)

    def _slope(self, pair: Transmission) -> TorqueSlope | None:
        """Work out how a given torque changes with its pulley's angle, about the last answer."""
        if self._turned is None:
            return None
        inside, angle = self.sides[-1], _angle_of(self._turned)
        about_rad, found = inside[angle], []
        if self._predicted[-1] not in inside:  # no answer yet
            return TorqueSlope(np.zeros_like(about_rad), about_rad)
        for shift_rad in (SHIFT_RAD, -SHIFT_RAD):
            inside[angle] = about_rad + shift_rad
            self._apply(self._looked_at)
            self._undo(self._given)
            found.append(inside[self._turned])
        inside[angle] = about_rad
        self._apply(self._looked_at)
        slope = (found[0] - found[1]) / (2.0 * SHIFT_RAD)
        # What drives a pulley on grows with the motor's angle and falls with the load's.
        way, radius_m = (
            (1.0, pair.motor_pulley_radius_m)
            if self._turned.startswith("motor")
            else (-1.0, pair.load_pulley_radius_m)
        )
        most = STEEPEST * pair.softest_n_per_m * radius_m**2
        return TorqueSlope(way * np.minimum(way * slope, most), about_rad)

    def _undo(self, names: Sequence[str]) -> None:
        """Go in: from what a recording says of some channels to what acts on the cables."""
        for k, one in enumerate(self._layers):
            outer, inner = self.sides[k], self.sides[k + 1]
            for name in names:
                channel = _channel(one, name)
                inner[name] = (
                    outer[name]
                    if channel is None
                    else channel.undone(outer[name], outer, one.values)
                )
                if channel is not None and name.endswith("_angle_rad"):
                    for side in self.sides[k + 1 :]:  # another path has another speed
                        side.pop(speed_of(name), None)

    def answer(self, trajectory: Trajectory) -> None:
        """Take what the cables answered, and work out what a recording says of it."""
        for name in self._predicted:
            self.sides[-1][name] = getattr(trajectory, name)
        self._apply(self._predicted)

    def _apply(self, names: Sequence[str]) -> None:
        """Go out: from what the cables answered to what a recording says of some channels."""
        for k in range(len(self._layers) - 1, -1, -1):
            one, outer, inner = self._layers[k], self.sides[k], self.sides[k + 1]
            for name in names:
                channel = _channel(one, name)
                outer[name] = (
                    inner[name]
                    if channel is None
                    else channel.applied(inner[name], outer, one.values)
                )


def _angle_of(name: str) -> str:
    """Return the name of the angle at a channel's pulley."""
    return name.split("_", maxsplit=1)[0] + "_angle_rad"


def refuse_layers(effects: Sequence[InForce], who: str) -> None:
    """Refuse effects that are more than other constants of the pair, where only those are read.

    Raises
    ------
    ModelError
    """
    left_out = [one for one in effects if one.variant.channels or one.variant.histories is not None]
    if left_out:
        raise ModelError(
            f"{left_out[0].where}: found {left_out[0].effect.name}, which {who} leaves out; "
            "accepted: effects that change the pair's constants"
        )


def _depth(one: InForce) -> tuple[int, int, int]:
    effect, order = one.effect, list(CATALOGUE)
    entry = order.index(effect.name) if effect.name in CATALOGUE else len(order)  # learned: inmost
    return OUTSIDE_IN.index(effect.enters), entry, effect.variants.index(one.variant)


def _channel(one: InForce, name: str) -> Channel | None:
    return next((channel for channel in one.variant.channels if channel.name == name), None)


def _with_earlier(time_s: FloatArray, delays: Sequence[float]) -> FloatArray:
    """Return the times with those that lie a delay before each; none twice but for rounding."""
    times = time_s
    for delay in filter(None, delays):
        earlier = time_s - delay
        after = np.searchsorted(times, earlier)
        gap = np.minimum(
            np.abs(earlier - times[np.maximum(after - 1, 0)]),
            np.abs(times[np.minimum(after, times.size - 1)] - earlier),
        )
        new = (earlier > time_s[0]) & (gap > 1e-6 * float(np.median(np.diff(time_s))))
        times = np.sort(np.concatenate([times, earlier[new]]))
    return times
