"""What is at standstill, with stiction, compiled: all at first, and what turns round or rests.

`slides` of a cable says for its motor's and its load's end which way it slides (outward 1, else -1,
0 not yet) and how many cells from it. `cable_profile` lets fronts go on from there, each with the
step of tension that a place at standstill holds; `pair_motion` asks after each sample what rests.
Knows only numbers.
"""

# ruff: noqa: PLR0917  (kernels take their arguments by place)

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil_tests.hidden_effects.cable_law import Law
from hil_tests.hidden_effects.compiled import compiled

Vector = NDArray[np.float64]

STILL_M_PER_S = 1e-6  # of an end: slower is at standstill


@compiled
def turned(
    slides: NDArray[np.float64],
    motor_outward_m: float,
    load_outward_m: float,
    whole: bool,
    cells: int,
) -> bool:
    """Let an end that turns round begin anew; return whether one did.

    Of a cable that slides whole the other end keeps all but a place that stands still.
    """
    found = False
    for end in range(2):
        outward_m = motor_outward_m if end == 0 else load_outward_m
        way = 1.0 if outward_m > 0.0 else -1.0
        if outward_m != 0.0 and slides[end, 0] != way:
            found = found or slides[end, 0] != 0.0
            slides[end, 0], slides[end, 1] = way, 0.0
    if whole and found:
        for end in range(2):
            slides[end, 1] = min(slides[end, 1], cells - 1.0)
    return found


@compiled
def stick(
    law: Law,
    dt: float,
    moved_m: tuple[float, float],
    rested_s: Vector,
    whole: Vector,
    slides: NDArray[np.float64],
) -> None:
    """Let what slides from an end stand still once that end has rested; a whole cable from both.

    `moved_m` of motor and load within the sample; `rested_s` of either, `whole` and `slides` of
    both cables.
    """
    for end in range(2):
        moves = abs(moved_m[end]) > STILL_M_PER_S * dt
        rested_s[end] = 0.0 if moves else rested_s[end] + dt
    both = rested_s[0] > law.rest_s and rested_s[1] > law.rest_s
    for cable in range(2):
        if whole[cable] > 0.0 and not both:
            continue
        for end in range(2):
            if rested_s[end] > law.rest_s:
                slides[cable, end, :] = 0.0
        if both:
            whole[cable] = 0.0
