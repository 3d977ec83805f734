"""The compensation laws that are compared, and how a lab configures the drive for one.

Output: entries of the object dictionary in SI units, for `trial` to write over the bus.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from bowden.drive.meanings import CompensationLaw

from hil_tests.render.rigs import LENGTH_M, RenderRig
from hil_tests.render.tasks import Task

SEGMENTS: Final = 20
MOST_CONTINUOUS_A: Final = 60.0  # range of the entries
MOST_SLEW_NM_PER_S: Final = 1000.0
# The default of this entry is chosen for the model inversion, which corrects with the cell what is
# left over. Force control alone wants more: on developing seeds its error falls by a third.
INTEGRAL_GAIN_HZ: Final = 20.0
FULL_TORQUE_S: Final = 5e-3  # slew: the motor may go from nothing to its limit in this time


@dataclass(frozen=True)
class Law:
    """A row of the table: entry compensation_law, and whether the load cell may be used."""

    name: str
    number: CompensationLaw
    load_cell: bool = False


NAIVE: Final = Law(CompensationLaw.NONE.word, CompensationLaw.NONE)
OURS: Final = CompensationLaw.MODEL_INVERSION.word
WITHOUT_CELL: Final = f"{OURS}-without-cell"
FROM_LOAD_CELL: Final = {
    CompensationLaw.INTEGRAL,
    CompensationLaw.ADAPTIVE_HYSTERESIS,
    CompensationLaw.MODEL_INVERSION,
}
LAWS: Final = (
    *(Law(law.word, law, load_cell=law in FROM_LOAD_CELL) for law in CompensationLaw),
    Law(WITHOUT_CELL, CompensationLaw.MODEL_INVERSION),
)


def law_named(name: str) -> Law:
    """Return the law of that name; ValueError says which there are."""
    for law in LAWS:
        if law.name == name:
            return law
    raise ValueError(f"law: found {name!r}; accepted: {', '.join(x.name for x in LAWS)}")


def entries(rig: RenderRig, law: Law, task: Task) -> dict[str, float]:
    """Entries to write, by name, in SI units: what the lab assumes of its rig."""
    belief, tunnel = rig.belief, task.tunnel(rig)
    curvature = 1.0 / rig.rig.cable.path[0][1]
    tuned = (
        {"compensation_integral_gain": INTEGRAL_GAIN_HZ}
        if law.number == CompensationLaw.INTEGRAL
        else {}
    )
    return tuned | {
        "cable_segments": SEGMENTS,
        **{f"segment_length.{i + 1}": LENGTH_M / SEGMENTS for i in range(SEGMENTS)},
        **{f"segment_curvature.{i + 1}": curvature for i in range(SEGMENTS)},
        "cable_axial_stiffness": belief.axial_stiffness_n,
        "cable_pretension": belief.pretension_n,
        "friction_dynamic": belief.friction,
        "friction_static": belief.friction,
        "friction_deviation": belief.friction_deviation,
        "motor_torque_limit": rig.motor_limit_nm,
        "motor_torque_slew": min(rig.motor_limit_nm / FULL_TORQUE_S, MOST_SLEW_NM_PER_S),
        "tunnel_half_width": tunnel.half_width_rad,
        "tunnel_stiffness": tunnel.stiffness_nm_per_rad,
        "tunnel_torque_limit": tunnel.limit_nm,
        # motor and amplifier are as large as the torque: heat is not what is measured
        "motor_current_continuous": min(rig.rig.motor.current_limit_a, MOST_CONTINUOUS_A),
        "bridge_current_continuous": min(rig.rig.motor.current_limit_a, MOST_CONTINUOUS_A),
        "motor_inertia": belief.motor_inertia_kg_m2,
        "compensation_law": law.number,
        "compensation_use_load_cell": float(law.load_cell),
    }
