"""What happens in a task, one row a control period: the operator's mind and hold, the cables.

Output of `tasks`, input of both plants. A row is `COLUMNS`: angle (rad) and speed (rad/s) that the
operator wants; how well the handle is held, 0 let go .. 1; how tense the arm is, over its usual
stiffness (its damping goes with the root); wrap added to the path (rad); pretension over its first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from bowden_rig.rig import state as at
from bowden_rig.rig.rig import SimulatedRig
from numpy.typing import NDArray

COLUMNS: Final = ("angle_rad", "speed_rad_per_s", "hold", "tense", "extra_wrap_rad", "pretension")
Array = NDArray[np.float64]
Conditions = dict[str, Array]  # columns that are not as usual


def course(motion: Array, changed: Conditions) -> Array:
    """Put angle and speed, shape (ticks, 2), and what is not as usual together; (ticks, 6)."""
    usual = {"hold": 1.0, "tense": 1.0, "extra_wrap_rad": 0.0, "pretension": 1.0}
    if unknown := set(changed) - set(usual):
        raise ValueError(f"conditions: found {sorted(unknown)}; accepted: {sorted(usual)}")
    columns = [changed.get(k, np.full(len(motion), v)) for k, v in usual.items()]
    return np.column_stack([motion, *columns])


def imposer(rig: SimulatedRig) -> Callable[[Array], None]:
    """Return what makes the conditions of a course's row those of the simulated rig."""
    plant, description = rig.plant, rig.description
    constants: Any = plant.packed_constants[0]
    wrap_rad = plant.wrap_rad.copy()
    operator, pretension_n = description.operator, description.cable.pretension_n
    last: list[tuple[float, ...]] = [(1.0, 1.0, 0.0, 1.0)]

    def impose(row: Array) -> None:
        hold, tense, extra, tension = now = tuple(row[2:].tolist())
        if now == last[0]:
            return
        last[0] = now
        constants["operator_stiffness_nm"] = hold * tense * operator.stiffness_nm_per_rad
        constants["operator_damping_nm_s"] = hold * tense**0.5 * operator.damping_nm_s_per_rad
        plant.wrap_rad[:] = np.maximum(wrap_rad + extra / len(wrap_rad), 0.0)
        constants["pretension_n"] = tension * pretension_n  # what ageing starts from
        plant.scalars[at.PRETENSION] = tension * pretension_n

    return impose
