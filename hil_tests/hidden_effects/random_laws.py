"""Random smooth laws of one argument or two at one place, hidden in the continuum.

What a rig may have that no catalogue lists: a torque or a factor on friction that follows an angle,
a speed, a torque or time, with or without a direction: of a torque the load's motion, of friction
that in which each place of a cable slides. The continuum cannot have friction by the load's motion:
it falls all along a cable at once, and where the cable stands it would have to give way, which the
continuum leaves out. Written from the definitions in the contracts, not from `bowden.model`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from hil_tests.hidden_effects.continuum import Histories, Pair
from hil_tests.hidden_effects.effects import both
from hil_tests.hidden_effects.hidden import Draw, Hidden, Signals, Values, Vector

MOVED_RAD = 2e-4  # so much motion says a direction


def direction(angle_rad: Vector) -> Vector:
    """Return the sign of the last motion; that of the first before it."""
    found = np.zeros(angle_rad.size)
    turn, way = angle_rad[0], 0.0
    for i, here in enumerate(angle_rad):
        if abs(here - turn) > MOVED_RAD and np.sign(here - turn) != way:
            way = float(np.sign(here - turn))
        if way * (here - turn) > 0.0:
            turn = here
        found[i] = way
    first = found[np.flatnonzero(found)[0]] if found.any() else 1.0
    found[found == 0.0] = first
    return found


def since_reversal(signals: Signals) -> Vector:
    """Return the time since the load's motion last changed its direction, s."""
    way = direction(signals.load_angle_rad)
    changes = np.concatenate([[0], np.flatnonzero(np.diff(way)) + 1])
    last = changes[np.searchsorted(changes, np.arange(way.size), side="right") - 1]
    return np.asarray(signals.time_s - signals.time_s[last])


WAVES = 3  # cosines over the visited range: smooth
ARGUMENTS: dict[str, Callable[[Signals], Vector]] = {
    "load_angle_rad": lambda s: s.load_angle_rad,
    "load_speed_rad_per_s": lambda s: np.gradient(s.load_angle_rad, s.time_s),
    "motor_torque_nm": lambda s: s.motor_torque_nm,
    "time_s": lambda s: s.time_s - s.time_s[0],
    "time_since_reversal_s": since_reversal,
    "conduit_temperature_c": lambda s: s.temperature_c,
}
PLACES = {
    "load_torque_nm": (2e-3, 2.0),
    "motor_torque_nm": (5e-4, 0.2),
    "friction_factor": (0.03, 0.8),
}
LOAD, SLIP = "direction", "slip_direction"  # whose direction a law may go by
CELL = "load_torque_nm"  # the cell's own torque: at its place only


def _share(seen: Vector, at: Vector | None = None) -> Vector:
    """Return where values lie in the range of what was seen, 0..1."""
    low, high = float(seen.min()), float(seen.max())
    return np.asarray(np.clip(((seen if at is None else at) - low) / (high - low), 0.0, 1.0))


def curve(p: Values, u: Vector, v: Vector | None = None) -> Vector:
    """Return the law's value: cosines over the range, in units of its size.

    Over a second argument each of them is another cosine's size.
    """
    waves = []
    for k in range(1, WAVES + 1):
        wave = p[f"a_{k}"] * np.cos(np.pi * k * u + p[f"phase_{k}_rad"])
        waves.append(wave if v is None else wave * np.cos(np.pi * v + p[f"across_{k}_rad"]))
    return np.asarray(p["size"] * (p["level"] + np.sum(waves, axis=0)))


def _law(place: str, over: tuple[str, ...], direction_of: str, p: Values) -> Hidden:
    def value(signals: Signals, own: Vector | None = None) -> Vector:
        seen = [ARGUMENTS[name](signals) if own is None else own for name in over]
        found = curve(p, *map(_share, seen))
        return found * direction(signals.load_angle_rad) if direction_of == LOAD else found

    def factors(signals: Signals, pair: Pair) -> Histories:
        del pair
        f = value(signals)
        return Histories(1.0 + f, 1.0 - f) if direction_of == SLIP else both(1.0 + f)

    name = name_of(place, over, direction_of)
    if place == "friction_factor":
        return Hidden(name, dict(p), histories=factors)
    if place == "motor_torque_nm":
        return Hidden(name, dict(p), true_torque=lambda x, s: x + value(s))
    own = over == (CELL,)
    return Hidden(name, dict(p), read_load_torque=lambda x, s: x + value(s, x if own else None))


def true_law(name: str, p: Values, signals: Signals, *at: Vector) -> Vector:
    """Return the true curve at some arguments; of the cell's own torque only the pair knows it."""
    over = [one for one in name.split(" over ")[1].split(" and ") if one in ARGUMENTS]
    seen = [ARGUMENTS[one](signals) for one in over]
    return curve(p, *map(_share, seen, at))


def name_of(place: str, over: tuple[str, ...], direction_of: str) -> str:
    """Return what a law is called: its place and its arguments."""
    return f"{place} over {' and '.join([*over, *filter(None, [direction_of])])}"


def _laws(overs: Callable[[str], list[tuple[str, ...]]]) -> dict[str, Callable[[Values], Hidden]]:
    return {
        name_of(place, over, direction_of): partial(_law, place, over, direction_of)
        for place in PLACES
        for over in overs(place)
        for direction_of in ("", SLIP if place == "friction_factor" else LOAD)
    }


HIDE = _laws(lambda place: [(one,) for one in (*ARGUMENTS, *((CELL,) if place == CELL else ()))])
"""Name -> from parameter values to the hidden law."""
SURFACES = _laws(
    lambda _: [
        ("load_angle_rad", "motor_torque_nm"),
        ("load_angle_rad", "time_s"),
        ("motor_torque_nm", "time_s"),
    ]
)
"""The same over two arguments."""

WARMS = tuple(name for name in HIDE if "temperature" in name)


def draw(name: str, rng: np.random.Generator) -> Draw:
    """Draw the shape of a law; its strength is called `size`."""
    low, high = PLACES[name.split(" over ", maxsplit=1)[0]]
    shape = {"size": 0.3 * high, "level": float(rng.normal(0.0, 0.5))}
    for k in range(1, WAVES + 1):
        shape[f"a_{k}"] = float(rng.normal()) / k
        shape[f"phase_{k}_rad"] = float(rng.uniform(0.0, 2.0 * np.pi))
    if name in SURFACES:
        shape |= {f"across_{k}_rad": float(rng.uniform(0.0, np.pi)) for k in range(1, WAVES + 1)}
    return Draw(shape, "size", low, high)
