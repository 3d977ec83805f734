"""One rig, one law, one task (or all): figures on stdout, and a plot.

    python -m hil_tests.render --seed 1 --law model-inversion --task tunnel --plot OUT.html

Developing seeds are 1 to 999; the reporting seeds of the benchmark begin at 200 000.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hil_tests.render.laws import LAWS, NAIVE, law_named
from hil_tests.render.plot import write_plot
from hil_tests.render.rigs import draw
from hil_tests.render.tasks import TASKS, task_named
from hil_tests.render.trial import judge, run


def main() -> int:
    """Run what was asked for; the exit status."""
    parser = argparse.ArgumentParser(prog="python -m hil_tests.render", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of the rig")
    parser.add_argument("--law", default="all", help="all, or " + ", ".join(x.name for x in LAWS))
    parser.add_argument("--task", default="all", help="all, or " + ", ".join(x.name for x in TASKS))
    parser.add_argument("--plot", type=Path, metavar="OUT.html", help="of the last trial")
    options = parser.parse_args()
    try:
        laws = LAWS if options.law == "all" else (law_named(options.law),)
        tasks = TASKS if options.task == "all" else (task_named(options.task),)
    except ValueError as error:
        parser.error(str(error))
    rig = draw(options.seed)
    cable, operator = rig.rig.cable, rig.rig.operator
    say(
        f"rig {rig.seed}: wrap {2.0 / cable.path[0][1]:.2f} rad, T0 {cable.pretension_n:.2f} N, "
        f"mu {cable.friction:.3f}, EA {cable.axial_stiffness_n:.0f} N, friction "
        f"{rig.friction_nm:.3f} of {rig.motor_limit_nm:.3f} N m at the motor"
        f"{' (apart)' if rig.apart else ''}, tunnel {rig.tunnel.limit_nm:.3f} N m, motor "
        f"{1e6 * rig.rig.motor.inertia_kg_m2:.0f} g cm2 x 0.1, operator "
        f"{operator.stiffness_nm_per_rad:.1f} N m/rad {operator.damping_nm_s_per_rad:.2f} "
        "N m s/rad, "
        f"load side {0.25 * rig.rig.sensing.load_encoder_delay_ticks:g} ms late"
    )
    for effect, parameters in rig.hidden.items():
        values = ", ".join(f"{name} {value:.4g}" for name, value in parameters.items())
        say(f"hidden: {effect}: {values}")
    belief = rig.belief
    say(
        f"the drive believes mu {belief.friction:.3f}, T0 {belief.pretension_n:.2f} N, "
        f"EA {belief.axial_stiffness_n:.0f} N"
    )
    say(
        f"{'task':15}{'law':30}{'rms':>8}{'ratio':>7}{'peak':>8}{'felt':>8}{'stiff':>7}{'energy':>8}"
    )
    for task in tasks:
        naive = judge(run(rig, NAIVE, task))
        for law in laws:
            trial = run(rig, law, task)
            o = judge(trial)
            ratio = o.rms_nm / naive.rms_nm if naive.rms_nm > 0.0 else float("nan")
            marks = " LIMIT CYCLE" * o.limit_cycle + " BRIDGE OFF" * o.bridge_off
            marks += f" fell back {o.fallback:.0%}" if o.fallback > 0.0 else ""
            say(
                f"{task.name:15}{law.name:30}{o.rms_nm:8.4f}{ratio:7.3f}{o.peak_nm:8.3f}"
                f"{o.felt_friction_nm:8.4f}{o.stiffness:7.2f}{o.net_energy:8.3f}{marks}"
            )
            if options.plot is not None:
                write_plot(trial, options.plot)
    return 0


def say(line: str) -> None:
    """Write a line on stdout."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
