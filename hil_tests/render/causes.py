"""Why a trial is as bad as it is: the same trial with one thing put right at a time.

Input: a rig, a law, a task. Output: how much of the error is left without a hidden effect, with a
true number in the drive's model, with sensors that are not late, with a stronger motor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from hil_tests.render.laws import Law
from hil_tests.render.rigs import RenderRig, draw, told_truth
from hil_tests.render.tasks import Task
from hil_tests.render.trial import Plant, judge, run

STRONGER: Final = 2.0  # times the motor's torque
COUNTS_BELOW: Final = 0.8  # of the error: what leaves less is a cause
NUMBERS: Final = {
    "friction": "friction",
    "pretension_n": "pretension",
    "axial_stiffness_n": "stiffness",
    "motor_inertia_kg_m2": "motor inertia",
}


@dataclass(frozen=True)
class Cause:
    """What was put right, and the error that is left of the trial's, 0 .. 1 or above."""

    put_right: str
    left: float


def put_right(rig: RenderRig) -> Iterator[tuple[str, RenderRig]]:
    """Yield what is put right, and the rig with it."""
    for name in rig.hidden:
        yield f"without {name}", draw(rig.seed, without=(name,))
    truth = told_truth(rig)
    for field, name in NUMBERS.items():
        true: float = getattr(truth, field)
        off = getattr(rig.belief, field) / true - 1.0
        yield (
            f"{name} known (was {off:+.0%})",
            replace(rig, belief=replace(rig.belief, **{field: true})),
        )
    late = rig.rig.sensing
    if late.load_encoder_delay_ticks:
        sensing = replace(late, load_encoder_delay_ticks=0, load_cell_delay_ticks=0)
        yield (
            f"sensors not {0.25 * late.load_encoder_delay_ticks:.2g} ms late",
            replace(rig, rig=replace(rig.rig, sensing=sensing)),
        )
    motor = rig.rig.motor
    strong = replace(motor, current_limit_a=STRONGER * motor.current_limit_a)
    yield (
        f"motor {STRONGER:g} times as strong",
        replace(
            rig,
            rig=replace(rig.rig, motor=strong),
            motor_limit_nm=STRONGER * rig.motor_limit_nm,
        ),
    )


def causes(rig: RenderRig, law: Law, task: Task, plant: Plant, error_nm: float) -> list[Cause]:
    """Return what makes a trial's error, most important first; empty: no single thing.

    Parameters
    ----------
    rig, law, task, plant
    error_nm : float
        RMS error of the trial as it is, > 0.
    """
    found = [
        Cause(name, judge(run(right, law, task, plant=plant)).rms_nm / error_nm)
        for name, right in put_right(rig)
    ]
    return sorted((c for c in found if c.left < COUNTS_BELOW), key=lambda cause: cause.left)
