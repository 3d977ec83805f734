"""What stands beside the figures: errors that no drive can stay below, and what knowledge is worth.

`wave_bound_nm` is derived; `informed` is a rig whose drive is told the truth, for the same law.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
from bowden_rig.bench import TICKS_PER_S

from hil_tests.render.rigs import RenderRig, told_truth
from hil_tests.render.tasks import Task

INFORMED: Final = "informed"  # ours, told the truth of the cables and by sensors that are not late


def wave_bound_nm(rig: RenderRig, task: Task) -> float:
    """Return the RMS error that torque steps have because a change runs along a cable as a wave.

    For L/c after each step of A the old torque acts on the load, c = sqrt(EA / lambda). 0 where the
    wanted torque follows from where the load is.
    """
    target = task.target_nm(rig)
    if target is None:
        return 0.0
    cable = rig.rig.cable
    late_s = cable.length_m * math.sqrt(cable.mass_per_length_kg_per_m / cable.axial_stiffness_n)
    first = round(task.scored_from_s * TICKS_PER_S)
    steps_nm = rig.ratio * np.diff(target[first - 1 :])
    scored_s = task.duration_s - task.scored_from_s
    return math.sqrt(float(np.sum(steps_nm**2)) * late_s / scored_s)


def informed(rig: RenderRig) -> RenderRig:
    """Return the rig with a drive that is told what its cables are, by sensors that are not late.

    The effects hidden in it stay. What is left of the error then is the law's own, the waves', the
    motor's and the hidden effects'.
    """
    sensing = replace(rig.rig.sensing, load_encoder_delay_ticks=0, load_cell_delay_ticks=0)
    return replace(rig, belief=told_truth(rig), rig=replace(rig.rig, sensing=sensing))
