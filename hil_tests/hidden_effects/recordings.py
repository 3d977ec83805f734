"""Cases of the benchmark: a recording as a lab delivers it, the lab's model file, the truth apart.

A case is drawn from a seed: a rig around Table I, what the lab assumes of it (the truth is off by
the tolerances that the model file states), half a minute of motion, a hidden truth (none, one
effect, two, four, or one that no catalogue has), sensors. The strength of the hidden effect is set
in units of the noise floor: what quantisation and noise do to the predicted channels. Several
recordings of one rig: `sets`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hil_tests.hidden_effects import draws, effects, excitation, random_laws, unlisted
from hil_tests.hidden_effects.cable_law import Law
from hil_tests.hidden_effects.continuum import Pair
from hil_tests.hidden_effects.hidden import Draw, Hidden, Signals, Values, Vector
from hil_tests.hidden_effects.pair_motion import Ends
from hil_tests.hidden_effects.strength import (
    CELL_NOISE_NM,
    LOAD_COUNTS,
    MOTOR_COUNTS,
    Read,
    counts,
    draw_strength,
    floor_of,
    read_out,
    sized,
    strength_of,
)

KINDS = ("complete", "single", "pair", "several", "unlisted", "smooth_law")
SURFACE = "smooth_surface"  # a smooth law of two arguments: by name, not in turn with the others
LAW_KINDS = ("smooth_law", SURFACE)
TOLERANCE = 0.1  # that the lab states of each number that it has measured
COUNTS = {"complete": 0, "pair": 2, "several": 4}  # of effects that are hidden; else one
WARMS = ("thermal_friction", "cell_temperature_crosstalk", *random_laws.WARMS)  # not without it


@dataclass(frozen=True)
class Rig:
    """The true pair and the model file of the lab."""

    pair: Pair
    model_yaml: str
    nominal: dict[str, float]


@dataclass(frozen=True)
class Truth:
    """What is hidden: not for the diagnosis."""

    seed: int
    kind: str
    effects: tuple[tuple[str, dict[str, float]], ...]
    strength: float
    noise_floor: dict[str, float]
    calibration: dict[str, dict[str, float]]
    source: str = "continuum"

    def to_json(self) -> str:
        """Return it as text for truth.json."""
        document = dict(vars(self))
        document["effects"] = [{"name": n, "parameters": p} for n, p in self.effects]
        return json.dumps(document, indent=2) + "\n"


@dataclass(frozen=True)
class Case:
    """A recording's columns by name, the model file, the truth, and what else was recorded.

    `signals`: what the recording's sensors read, as it was; not for the diagnosis.
    """

    columns: dict[str, Vector]
    model_yaml: str
    truth: Truth
    more: tuple[dict[str, Vector], ...] = ()
    signals: Signals | None = None

    def csv_text(self) -> str:
        """Return the recording in its exchange form; nothing in it tells the truth."""
        names = list(self.columns)
        lines = ["# rig: bench", "# sample_rate_hz: 1000", ",".join(names)]
        digits = ["%.4f" if n == "time_s" else "%.8g" for n in names]
        table = np.column_stack(list(self.columns.values()))
        form = ",".join(digits)
        lines += [form % tuple(row) for row in table]
        return "\n".join(lines) + "\n"

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Write recording.csv, model.yaml and truth.json; return the first two."""
        folder.mkdir(parents=True, exist_ok=True)
        recording, model = folder / "recording.csv", folder / "model.yaml"
        recording.write_text(self.csv_text(), encoding="utf-8")
        model.write_text(self.model_yaml, encoding="utf-8")
        (folder / "truth.json").write_text(self.truth.to_json(), encoding="utf-8")
        return recording, model


def draw_rig(rng: np.random.Generator, most_sigmas: float = 2.0, *, stiction: bool = False) -> Rig:
    """Draw a rig around Table I, and the truth from the tolerances of its model file.

    `most_sigmas`: no number is further from the file's; infinite: drawn from the prior itself.
    `stiction`: with mu_s above mu_d; the rig is else the same.
    """
    length = round(float(rng.uniform(1.2, 2.4)), 2)
    wrap = float(rng.uniform(3.0, 7.0))
    straight = round(float(rng.uniform(0.1, 0.4)), 2) if rng.random() < 0.4 else 0.0
    first = round(float(rng.uniform(0.35, 0.65)) * (length - straight), 2)
    bends = [first, length - straight - first]
    share = float(rng.uniform(0.35, 0.65))
    radii = [round(bends[0] / (wrap * share), 3), round(bends[1] / (wrap * (1.0 - share)), 3)]
    pieces = [(bends[0], radii[0]), (bends[1], radii[1])]
    if straight:
        pieces.insert(1, (straight, np.inf))
    believed = {
        "pretension_n": round(float(rng.uniform(5.0, 20.0)), 1),
        "mu_d": round(float(rng.uniform(0.10, 0.25)), 3),
        "axial_stiffness_n": round(float(rng.uniform(2500.0, 7000.0)), -1),
    }

    def off() -> float:
        return 1.0 + TOLERANCE * float(np.clip(rng.normal(), -most_sigmas, most_sigmas))

    true = {name: value * off() for name, value in believed.items()}
    law, breakaway_m = f"law: coulomb, mu_d: {_tolerated(believed['mu_d'])}", 0.0
    if stiction:
        believed["mu_s"] = round(believed["mu_d"] * float(rng.uniform(1.2, 2.0)), 3)
        length_m = round(float(np.exp(rng.uniform(np.log(0.02), np.log(0.2)))), 3)
        true["mu_s"] = max(believed["mu_s"] * off(), 1.05 * true["mu_d"])
        law = law.replace("coulomb", "stiction") + f", mu_s: {_tolerated(believed['mu_s'])}"
        law += f", stiction_length_m: {length_m}"
        breakaway_m = (true["mu_s"] - true["mu_d"]) * length_m
    path = "\n".join(
        f"      - {{length_m: {x:.4g}, radius_m: {'.inf' if np.isinf(r) else format(r, '.4g')}}}"
        for x, r in pieces
    )
    pieces = [(float(f"{x:.4g}"), r) for x, r in pieces]
    model_yaml = f"""\
rig:
  cable:
    length_m: {sum(x for x, _ in pieces):.6g}
    axial_stiffness_n: {_tolerated(believed["axial_stiffness_n"])}
    path:
{path}
    pretension_n: {_tolerated(believed["pretension_n"])}
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
  motor_encoder_counts_per_turn: {MOTOR_COUNTS}
  load_encoder_counts_per_turn: {LOAD_COUNTS}
  load_cell_noise_nm: {CELL_NOISE_NM}
friction: {{{law}}}
effects: []
numerics: {{segments: 100}}
"""
    cable = Law(true["pretension_n"], true["axial_stiffness_n"], breakaway_m=breakaway_m)
    pair = Pair(tuple(pieces), true["mu_d"], cable, Ends(0.020, 0.104))
    nominal = {f"believed {k}": v for k, v in believed.items()} | true
    return Rig(pair, model_yaml, nominal)


def _tolerated(value: float) -> str:
    return f"{{value: {value:g}, tolerance: {100 * TOLERANCE:g} %}}"


def random_of(seed: int, kind: str, names: Sequence[str]) -> np.random.Generator:
    """Return the generator of a case; ValueError where there is no such kind."""
    if kind not in (every := (*KINDS, SURFACE)):
        raise ValueError(f"kind: found {kind!r}; accepted: {', '.join(every)}")
    return np.random.default_rng([seed, *(ord(c) for c in kind + "".join(names))])


def draw_names(rng: np.random.Generator, kind: str) -> list[str]:
    """Draw what is hidden, by name."""
    count = COUNTS.get(kind, 1)
    if count == 0:
        return []
    return [str(x) for x in rng.choice(list(hidden_of(kind)), count, replace=False)]


def hidden_of(kind: str) -> Mapping[str, effects.Hide]:
    """Return what a case of a kind may hide, by name."""
    others = {
        "unlisted": unlisted.HIDE,
        "smooth_law": random_laws.HIDE,
        SURFACE: random_laws.SURFACES,
    }
    return others.get(kind, effects.HIDE)


def draw_effect(rng: np.random.Generator, kind: str, name: str, pair: Pair) -> Draw:
    """Draw the numbers of an effect; its strength stays open."""
    if kind in LAW_KINDS:
        return random_laws.draw(name, rng)
    return unlisted.draw(name, rng) if kind == "unlisted" else draws.DRAWS[name](rng, pair)


@dataclass(frozen=True)
class Plain:
    """A run of a pair in which nothing is hidden, and the noise floor of its channels."""

    signals: Signals
    read: Read
    floor: dict[str, float]


def as_is(pair: Pair, signals: Signals) -> Plain:
    """Run a pair in which nothing is hidden."""
    read = read_out(pair, signals, [])
    return Plain(signals, read, floor_of(pair, signals, read))


def hide(
    rng: np.random.Generator, kind: str, names: Sequence[str], pair: Pair, runs: Sequence[Plain]
) -> tuple[list[Hidden], list[float]]:
    """Draw effects, each as strong as the kind has it, and their strengths in noise floors.

    The strength of an effect is that in the run that shows it best.
    """
    wanted = draw_strength(rng, kind)
    twist = pair.ends.load_radius_m / pair.ends.motor_radius_m
    found: list[Hidden] = []
    worths: list[float] = []
    for name in names:
        make = hidden_of(kind)[name]

        def run(values: Values, make: effects.Hide = make) -> tuple[float, Hidden]:
            one = make(values)
            reads = [read_out(pair, plain.signals, [one]) for plain in runs]
            strengths = [
                strength_of(read, plain.read, plain.floor, twist)
                for read, plain in zip(reads, runs, strict=True)
            ]
            return max(strengths), one

        _, worth, one = sized(draw_effect(rng, kind, name, pair), wanted, run)
        found.append(one)
        worths.append(worth)
    return found, worths


def most_torque_nm(pair: Pair) -> float:
    """Return the motor torque that a lab goes up to: most of what friction carries."""
    friction_nm = 2.0 * pair.ends.motor_radius_m * pair.law.pretension_n
    friction_nm *= pair.mu * pair.wrap_rad
    return min(0.9 * friction_nm + 0.05, 0.6)


def as_recorded(rng: np.random.Generator, signals: Signals, read: Read) -> dict[str, Vector]:
    """Return the columns of a recording: whole counts, and the load cell's noise."""
    return {
        "time_s": signals.time_s,
        "motor_angle_rad": counts(read.motor_angle_rad, MOTOR_COUNTS),
        "load_angle_rad": counts(read.load_angle_rad, LOAD_COUNTS),
        "motor_torque_nm": signals.motor_torque_nm,
        "load_torque_nm": read.load_torque_nm + rng.normal(0.0, CELL_NOISE_NM, signals.time_s.size),
    }


def thermometer(rng: np.random.Generator, signals: Signals) -> dict[str, Vector]:
    """Return the column of a thermometer on the conduit."""
    noise = rng.normal(0.0, 0.02, signals.time_s.size)
    return {"conduit_temperature_c": signals.temperature_c + noise}


def draw_case(
    seed: int,
    kind: str,
    effect: str | Sequence[str] | None = None,
    length_s: float = 30.0,
    *,
    stiction: bool = False,
) -> Case:
    """Draw a case.

    Parameters
    ----------
    seed : int
        All that is random comes from it, the kind and the effect's name.
    kind : "complete", "single", "pair", "several", "unlisted", "smooth_law"
    effect : str or several of them, optional
        Names; drawn where they are not given.
    length_s : float
    stiction : bool
        Whether the rig's mu_s is above its mu_d.
    """
    names = [effect] if isinstance(effect, str) else list(effect or ())
    rng = random_of(seed, kind, names)
    rig = draw_rig(rng, stiction=stiction)
    signals = excitation.draw(rng, most_torque_nm(rig.pair), length_s)
    names = names or draw_names(rng, kind)
    plain = as_is(rig.pair, signals)
    hidden, worths = hide(rng, kind, names, rig.pair, [plain])
    read = read_out(rig.pair, signals, hidden)
    columns = as_recorded(rng, signals, read)
    if rng.random() < 0.5 or set(WARMS) & set(names):
        columns |= thermometer(rng, signals)
    truth = Truth(
        seed,
        kind,
        tuple((h.name, h.parameters) for h in hidden),
        min(worths, default=0.0),
        plain.floor,
        {"rig": rig.nominal},
    )
    return Case(columns, rig.model_yaml, truth, signals=signals)
