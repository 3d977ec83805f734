"""The one type that every recording becomes, whatever file it came from.

A time base and any number of named channels (`channels.CHANNELS` lists those that have a meaning).
Readers and importers build it; `diagnosis`, `report` and `cli` read it, and say with `require` what
they need.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bowden.errors import BadInput
from bowden.recording.channels import CHANNELS, TIME

_Floats = NDArray[np.float64]

#: A step in time is a gap when it is longer than this many of the steps that are usual.
GAP_STEPS = 5.0
#: Share of the steps that are no longer than what counts as usual: uneven sampling has no gaps.
USUAL_SHARE = 0.9


@dataclass(frozen=True, init=False, eq=False)
class Recording:
    """Samples of one run of one rig; SI units, signs as on the physics page.

    Parameters
    ----------
    time_s : array_like of shape (n,), s
        Strictly increasing; steps may be uneven and may hold gaps.
    channels : mapping of str to array_like of shape (n,), optional
        By name, in the unit that the name ends with. None is required here: a motor-only rig has no
        load channels, a rig without a load cell no ``load_torque_nm``.
    metadata : mapping of str to str, optional
        The ``# key: value`` lines or the side file's fields.
    source : str
        Where it came from, for messages.
    before : Recording, optional
        What the rig did just before, as far as it was recorded: a simulation runs through it first,
        and nothing in it is judged. See `since`.
    **named : array_like of shape (n,)
        Channels as keyword arguments; they go before `channels` of the same name.

    Raises
    ------
    ValueError
        A channel without one value for each sample.
    """

    time_s: _Floats
    channels: Mapping[str, _Floats]
    metadata: Mapping[str, str]
    source: str
    before: Recording | None

    def __init__(
        self,
        time_s: ArrayLike,
        channels: Mapping[str, ArrayLike] | None = None,
        *,
        metadata: Mapping[str, str] | None = None,
        source: str = "recording",
        before: Recording | None = None,
        **named: ArrayLike,
    ) -> None:
        time = np.asarray(time_s, dtype=np.float64)
        held = {
            name: np.asarray(values, dtype=np.float64)
            for name, values in {**(channels or {}), **named}.items()
        }
        for name, values in {TIME: time, **held}.items():
            if values.shape != (time.size,):
                raise ValueError(
                    f"{source}, {name}: found shape {values.shape}; accepted: one value for each "
                    f"of {time.size} samples"
                )
        for field, value in (
            ("time_s", time),
            ("channels", held),
            ("metadata", dict(metadata or {})),
            ("source", source),
            ("before", before),
        ):
            object.__setattr__(self, field, value)

    def __getitem__(self, name: str) -> _Floats:
        """Return a channel (or the time) by name; one that is not there is refused by name."""
        if name == TIME:
            return self.time_s
        if name not in self.channels:
            self.require([name])
        return self.channels[name]

    @property
    def motor_angle_rad(self) -> _Floats:
        """Motor encoder, shape (n,), rad; positive winds cable a."""
        return self["motor_angle_rad"]

    @property
    def load_angle_rad(self) -> _Floats:
        """Load encoder, shape (n,), rad; positive is the motion that cable a produces."""
        return self["load_angle_rad"]

    @property
    def motor_torque_nm(self) -> _Floats:
        """Torque applied by the motor on its pulley, shape (n,), N m."""
        return self["motor_torque_nm"]

    @property
    def load_torque_nm(self) -> _Floats:
        """Torque applied by the cables on the load pulley, shape (n,), N m."""
        return self["load_torque_nm"]

    @property
    def gaps(self) -> tuple[tuple[float, float], ...]:
        """Start and length, s, of each gap in time: see `time_gaps`."""
        return tuple(time_gaps(self.time_s))

    def require(self, names: Iterable[str], purpose: str = "") -> None:
        """Refuse a recording without certain channels.

        Parameters
        ----------
        names : iterable of str
            What is needed.
        purpose : str, optional
            What needs it, for the message: ``"mode torque-position"``.

        Raises
        ------
        BadInput
            Names what is missing, what is there, and what needs it.
        """
        missing = [name for name in names if name != TIME and name not in self.channels]
        if missing:
            known = sorted(self.channels, key=lambda name: name not in CHANNELS)
            raise BadInput(
                self.source,
                f"no {' and no '.join(missing)} (its channels: {', '.join(known) or 'none'})",
                f"a recording with {' and '.join(missing)}"
                + (f", which {purpose} needs" if purpose else ""),
            )

    def with_channels(
        self, channels: Mapping[str, ArrayLike] | None = None, **named: ArrayLike
    ) -> Recording:
        """Return the recording with channels added or replaced, by mapping or by keyword."""
        changed = {**self.channels, **(channels or {}), **named}
        return self._with(self.time_s, changed)

    def without_channels(self, names: Iterable[str]) -> Recording:
        """Return the recording without some channels; names that it does not have are ignored."""
        left = {name: values for name, values in self.channels.items() if name not in set(names)}
        return self._with(self.time_s, left)

    def select(self, samples: slice | NDArray[np.generic]) -> Recording:
        """Return some of the samples, in every channel.

        Parameters
        ----------
        samples : slice or ndarray of int or bool
            As numpy indexes; rising, so that time still increases.
        """
        chosen = {name: values[samples] for name, values in self.channels.items()}
        return self._with(self.time_s[samples], chosen)

    def since(self, seconds: float) -> Recording:
        """Return the recording without its first seconds, which stand in `before`.

        Cables hold tensions of what was done to them before a recording began. The first strokes
        erase them: after those a simulation from virgin cables is as right as it can be.

        Parameters
        ----------
        seconds : float, s
            From the first sample; 0 or more.

        Raises
        ------
        BadInput
            Fewer than two samples are left.
        """
        first = int(np.searchsorted(self.time_s, self.time_s[0] + seconds))
        if first == 0:
            return self
        if self.time_s.size - first < 2:
            length_s = float(self.time_s[-1] - self.time_s[0])
            raise BadInput(self.source, f"{length_s:.3g} s", f"more than {seconds:g} s")
        earlier = self.select(slice(first))
        return self.select(slice(first, None)).with_before(earlier)

    def with_before(self, before: Recording | None) -> Recording:
        """Return the same recording with other samples of what the rig did just before."""
        return Recording(
            self.time_s,
            self.channels,
            metadata=self.metadata,
            source=self.source,
            before=before,
        )

    def _with(self, time_s: _Floats, channels: Mapping[str, ArrayLike]) -> Recording:
        return Recording(
            time_s, channels, metadata=self.metadata, source=self.source, before=self.before
        )


def time_gaps(time_s: _Floats) -> list[tuple[float, float]]:
    """Find gaps in time: steps longer than five of the steps that nine in ten stay within.

    Measured against the long among the usual steps, so that sampling that is merely uneven (a
    logger that writes on change, a host's timer) has no gaps.

    Parameters
    ----------
    time_s : ndarray of shape (n,), s
        Strictly increasing.

    Returns
    -------
    list of (float, float)
        Start and length of each, s.
    """
    step = np.diff(time_s)
    if not step.size:
        return []
    usual = float(np.quantile(step, USUAL_SHARE, method="lower"))
    (where,) = np.nonzero(step > GAP_STEPS * usual)
    return [(float(time_s[i]), float(step[i])) for i in where]
