"""The page docs/compensation-benchmark.md: how the laws were compared, and the tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from bowden_rig.rig.constants import CONTROL_PERIOD_S

from hil_tests.render.laws import OURS, WITHOUT_CELL
from hil_tests.render.rigs import LENGTH_M, draw
from hil_tests.render.table import error_ratios, markdown
from hil_tests.render.trial import Outcome

TEXT: Final = """\
# Compensation: the benchmark

Written by `python -m hil_tests.benchmarks.render --first-seed {first} --rigs {rigs} --chip \
--output docs/compensation-benchmark.md`; do not edit. What the laws are and how to tune them is in
[compensation.md](compensation.md).

Every law does the same tasks on the same rigs, on the natively built drive (the same sources as the
flashed ELF, bit for bit). The simulated rig is not the drive's model: distributed masses, bristle
friction, noise, quantisation. The rigs are drawn from the seeds {first} to {last}; the laws were
developed on seeds below 1000 only.

- **Rigs** (`hil_tests/render/rigs.py`): wrap 1 to 8 rad, pretension 1 to 20 N, mu 0.05 to 0.25, EA
  2 to 8 kN, motor limit 0.3 to 3 N m, motor inertia 1e-5 to 5e-5 kg m2, handle 1e-3 to 1e-2 kg m2,
  an operator of 5 to 200 N m/rad, load cell noise 0.2 to 2 mN m, load encoder and load cell up to 2
  ms late. Two effects of the catalogue are hidden in each at moderate strength.
- **What the drive assumes**: friction, pretension, stiffness and motor inertia are wrong by up to
  15 % each, independently. It is configured over the bus; what is not listed here has its default,
  but for the gain of the integral law: the default is chosen for the model inversion, and force
  control alone does better with twice of it (found on developing seeds).
- **The tunnel** has the paper's width and stiffness. Its torque limit, at most the paper's
  0.2 N m, is what the motor can render beyond its friction, less a tenth.
- **Tasks** (`hil_tests/render/tasks.py`): strokes through the tunnel at 0.25, 0.5 and 1 Hz, to and
  fro over the wall's edge, free strokes in a wide dead zone, torque steps, rest in the wall and in
  the dead zone.

What the columns mean; the truth is the rig's, not the load cell's:

- **error ratio**: RMS of torque on the load less wanted torque, over all tasks of a rig, over that
  of the naive law (`none`) on the same rig. **Trials worse than naive**: single tasks, by more than
  1 % and 20 mN m. **Peak ratio**: largest error of any task over the naive law's.
- **friction felt**: energy that the cables take in free strokes over the length of the path, over
  that of the naive law. **Stiffness**: slope of the rendered wall over the wanted one.
- **limit cycles**: rigs whose load torque or motor keeps oscillating at standstill.
- **active paths**: rigs with a closed path on which the cables give the operator over 1 % more
  than the wanted torque would, as a part of the energy exchanged on that path (in free strokes,
  where nothing is to be exchanged: of the friction's work). **Worst path**: the largest such
  part. **Of the friction**: the same energy as a part of what the pair's friction would take on
  that path.
- **slack**: median part of the time with an empty cable. **Fell back**: part of the time in which
  a lower fallback level ran. **Stopped**: trials in which the drive went to fault.

"""


WORST: Final = 5


def document(
    outcomes: Sequence[Outcome], first_seed: int, rigs: int, chip: Mapping[str, float]
) -> str:
    """Write the page.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Of all laws on all rigs.
    first_seed, rigs : int
    chip : mapping of str to float
        What was measured on the flashed ELF, by name; may be empty.
    """
    text = TEXT.format(first=first_seed, last=first_seed + rigs - 1, rigs=rigs)
    parts = [text + markdown(outcomes)]
    parts += [_worst(outcomes, law) for law in (OURS, WITHOUT_CELL) if _has(outcomes, law)]
    if chip:
        rows = "\n".join(f"| {name} | {value:.5g} |" for name, value in chip.items())
        parts.append(f"## On the flashed ELF\n\n| figure | |\n| --- | ---: |\n{rows}\n")
    return "\n".join(parts)


def _has(outcomes: Sequence[Outcome], law: str) -> bool:
    return any(o.law == law for o in outcomes)


def _worst(outcomes: Sequence[Outcome], law: str) -> str:
    """Write which rigs a law does worst on, and what they are."""
    counted = [o for o in outcomes if not o.apart]
    ratios = error_ratios(counted, law)
    rows = [
        f"## Where {law} does worst\n",
        "| seed | error ratio | wrap | pretension | friction, of the motor's limit | operator "
        "| late "
        "| hidden |",
        "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |",
    ]
    for seed in sorted(ratios, key=lambda seed: -ratios[seed])[:WORST]:
        rig = draw(seed)
        cable, operator, sensing = rig.rig.cable, rig.rig.operator, rig.rig.sensing
        rows.append(
            f"| {seed} | {ratios[seed]:.3f} | {LENGTH_M / cable.path[0][1]:.1f} rad "
            f"| {cable.pretension_n:.1f} N | {rig.friction_nm / rig.motor_limit_nm:.0%} "
            f"| {operator.stiffness_nm_per_rad:.0f} N m/rad "
            f"| {1e3 * CONTROL_PERIOD_S * sensing.load_encoder_delay_ticks:.2g} ms "
            f"| {', '.join(rig.hidden)} |"
        )
    return "\n".join(rows) + "\n"
