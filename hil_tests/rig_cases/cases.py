"""Cases drawn for the dynamic rig: what a careful lab would hand in, and the truth apart.

Rigs, assumptions, motions and effects are drawn as for the continuum. The rig moves as masses do,
so the lab states what it knows of that: the motor's inertia, from its data sheet. It keeps its
cables taut, because slack ones show the inertias of everything, its operator is calm, and its
cables and liner are stiff and well damped. The rest of what the rig has and no model file knows is
small against the noise floor, or calibrated away: shear of the liner over 50 nm, the cable's own
mass, whose weight adds a per mille of friction and whose waves take a millisecond or two. What the
operator does within a count of the encoder is real, and left in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from bowden_rig.rig.constants import CONTROL_PERIOD_S, least_substeps
from bowden_rig.rig.hidden import hide
from bowden_rig.rig.parameters import Cable, Load, Motor, Operator, Rig, Sensing

from hil_tests.hidden_effects import effects, excitation, unlisted
from hil_tests.hidden_effects.hidden import Hidden, Signals, Values, Vector, together
from hil_tests.hidden_effects.recordings import (
    WARMS,
    Case,
    Truth,
    draw_effect,
    draw_names,
    draw_rig,
    random_of,
)
from hil_tests.hidden_effects.recordings import Rig as LabRig
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
from hil_tests.rig_cases.recording import MOST_LOAD_NM, record

LINER_N_PER_M2: Final = 1.5e8
STRANDS_S: Final = 1e-4  # of damping: a motor that rings for long shows its cables' mass
ELEMENTS: Final = 24  # 32, 64 and 128 differ by a twentieth of a noise floor
LIGHT_KG_M2: Final = 1e-6  # a motor whose inertia is not to be seen
TAUT: Final = 0.85  # of the motor torque at which a cable of the sliding pair goes slack
UNSTATED: Final = ("motor_inertia",)


def draw_case(
    seed: int,
    kind: str,
    effect: str | Sequence[str] | None = None,
    length_s: float = 30.0,
) -> Case:
    """Draw a case; as `hil_tests.hidden_effects.recordings.draw_case`.

    Raises
    ------
    ArithmeticError
        This rig cannot be run with what is hidden in it.
    """
    names = [effect] if isinstance(effect, str) else list(effect or ())
    rng = random_of(seed, kind, names)
    lab, most_nm = _draw_lab(rng)
    signals = excitation.draw(rng, most_nm, length_s)
    torque = np.clip(signals.motor_torque_nm, -most_nm, most_nm)
    signals = replace(signals, motor_torque_nm=torque)
    names = names or draw_names(rng, kind)
    floor = floor_of(lab.pair, signals, read_out(lab.pair, signals, []))
    wanted = draw_strength(rng, kind)
    rig = _draw_rig(rng, lab, warm=bool(set(WARMS) & set(names)))
    stated_kg_m2 = rig.motor.inertia_kg_m2
    if set(UNSTATED) & set(names):
        rig = replace(rig, motor=replace(rig.motor, inertia_kg_m2=LIGHT_KG_M2))
    noise = int(rng.integers(2**31))
    twist = rig.load.pulley_radius_m / rig.motor.pulley_radius_m
    columns = base = record(rig, signals, noise)
    found: list[tuple[str, dict[str, float]]] = []
    strength = 0.0
    for name in names:

        def run(values: Values, name: str = name) -> tuple[float, dict[str, Vector]]:
            read = _with_hidden(rig, lab, signals, noise, [(name, values)])
            return strength_of(_read(read), _read(base), floor, twist), read

        values, worth, columns = sized(draw_effect(rng, kind, name, lab.pair), wanted, run)
        found.append((name, _as_run(name, values)))
        strength = worth if strength == 0.0 else min(strength, worth)
    if len(found) > 1:
        columns = _with_hidden(rig, lab, signals, noise, found)
    if not rig.cable.warming_change_k:
        columns = {k: v for k, v in columns.items() if k != "conduit_temperature_c"}
    known = "[]"
    if not set(UNSTATED) & set(names):
        known = f"[{{name: motor_inertia, inertia_kg_m2: {stated_kg_m2:g}}}]"
    model_yaml = lab.model_yaml.replace("effects: []", f"effects: {known}")
    truth = Truth(seed, kind, tuple(found), strength, floor, {"rig": lab.nominal}, "rig")
    return Case(columns, model_yaml, truth)


def _draw_lab(rng: np.random.Generator) -> tuple[LabRig, float]:
    """Draw a rig whose torques the drive can tell, and the torque that leaves its cables taut."""
    while True:
        lab = draw_rig(rng)
        ends, m = lab.pair.ends, lab.pair.mu * lab.pair.wrap_rad
        friction_nm = 2.0 * ends.motor_radius_m * lab.pair.law.pretension_n * m
        # Sliding, T0 + s and T0 - s are the means of the two cables; one of them is slack at 0.
        most_nm = min(TAUT * friction_nm / math.expm1(m), 0.6)
        ratio = ends.load_radius_m / ends.motor_radius_m
        if ratio * (friction_nm + most_nm) < 0.9 * MOST_LOAD_NM:
            return lab, most_nm


def _draw_rig(rng: np.random.Generator, lab: LabRig, *, warm: bool) -> Rig:
    """Draw what the continuum has no number for: motor, handle, operator, warming."""
    pair = lab.pair
    warm = bool(rng.random() < 0.5) or warm
    cable = Cable(
        path=pair.pieces,
        axial_stiffness_n=pair.law.axial_stiffness_n,
        pretension_n=pair.law.pretension_n,
        friction=pair.mu,
        viscous_s_per_m=0.0,
        contact_stiffness_n_per_m2=LINER_N_PER_M2,
        material_damping_s=STRANDS_S,
        stiffest_n=100.0,
        warming_change_k=float(rng.uniform(10.0, 20.0)) if warm else 0.0,
        warming_time_s=float(rng.uniform(5.0, 12.0)),
    )
    motor = Motor(inertia_kg_m2=float(f"{rng.uniform(1e-5, 2e-5):.2g}"))
    load = Load(inertia_kg_m2=float(rng.uniform(2e-3, 6e-3)))
    stiffness = float(rng.uniform(150.0, 250.0))
    critical = 2.0 * math.sqrt(stiffness * load.inertia_kg_m2)
    operator = Operator(
        motion="still",
        stiffness_nm_per_rad=stiffness,
        damping_nm_s_per_rad=critical * float(rng.uniform(0.9, 1.2)),
    )
    sensing = Sensing(
        motor_counts_per_turn=MOTOR_COUNTS,
        load_counts_per_turn=LOAD_COUNTS,
        load_cell_noise_nm=CELL_NOISE_NM,
        conduit_temperature_c=20.0,
    )
    steps = least_substeps(cable, ELEMENTS)
    return Rig(cable, motor, load, operator, sensing, elements=ELEMENTS, substeps=steps)


def _as_run(name: str, values: Values) -> dict[str, float]:
    """Return the parameters as the rig can have them: whole control periods of delay."""
    if name != "time_delay":
        return dict(values)
    return {k: CONTROL_PERIOD_S * round(v / CONTROL_PERIOD_S) for k, v in values.items()}


def _with_hidden(
    rig: Rig,
    lab: LabRig,
    signals: Signals,
    noise: int,
    hidden: Sequence[tuple[str, Values]],
) -> dict[str, Vector]:
    """Record the rig with what is hidden: in its parameters, or, unlisted, around it."""
    around: list[Hidden] = []
    for name, values in hidden:
        if name in effects.HIDE:
            rig = hide(rig, name, values)
        else:
            around.append(unlisted.HIDE[name](values))
    histories = together([one.histories(signals, lab.pair) for one in around])
    changes = histories.friction_plus is not None or histories.extra_length_m is not None
    if changes:  # they are the rig's ageing
        rig = replace(rig, cable=replace(rig.cable, warming_change_k=0.0))
    columns = record(rig, signals, noise, histories if changes else None)
    read = replace(signals, temperature_c=columns["conduit_temperature_c"])
    for one in around:
        motor = one.read_motor_angle(columns["motor_angle_rad"], read)
        columns["motor_angle_rad"] = counts(motor, MOTOR_COUNTS)
        columns["load_torque_nm"] = one.read_load_torque(columns["load_torque_nm"], read)
    return columns


def _read(columns: dict[str, Vector]) -> Read:
    return Read(columns["motor_angle_rad"], columns["load_angle_rad"], columns["load_torque_nm"])
