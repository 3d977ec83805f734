"""Does the drive render as well with what was found as with the truth? `... --seed N`.

Each case hides an effect, or a law that no catalogue has, in the simulated rig. A run without
compensation is diagnosed with the lab's model and the whole catalogue; what is found goes to the
drive, which inverts it without the load cell's help. The same rig renders with its true model.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import numpy as np
from bowden.cli.demo_diagnosis import ENTRIES, LAB_MODEL, RIG
from bowden.cli.tunnel_experiment import (
    TORQUE_CONSTANT_NM_PER_A,
    render,
    telling_the_law,
    tunnel_of,
)
from bowden.diagnosis.diagnose import diagnose
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.connection import Connection
from bowden.drive.meanings import CompensationLaw
from bowden.drive.reduced_model import reduced_model
from bowden.model import Model, parse_model
from bowden.model.effects import LawTable
from bowden.recording.enabled import until_disabled
from bowden.report.rendering import LawRun
from bowden_rig.bench import Bench
from bowden_rig.rig import parameters
from bowden_rig.rig.hidden import hide
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

#: What is hidden, one a case: moderate, each changes the rendered torque by a tenth or more.
EFFECTS: Final[dict[str, dict[str, float]]] = {
    "viscous_friction": {"mu_v_s_per_m": 0.3},
    "direction_asymmetry": {"a": 0.3},
    "wrap_angle_change": {"extra_wrap_rad": 3.0},
    "tension_dependent_friction": {"p": 0.3},
    "position_dependent_friction": {"a": 0.3, "waves_per_turn": 4.0, "phase_rad": 0.7},
    "torque_constant_error": {"g": 0.15},
    "gravity_imbalance": {"amplitude_nm": 0.3, "phase_rad": 0.5},
    "motor_torque_offset": {"offset_nm": 0.02},
}
#: Change and width, rad, of a friction that rises with load angle one way and falls the other.
LAWS: Final = ((0.4, 0.3), (0.3, 0.15))
#: When the drive is enabled within the operator's stroke of 4 s: where the first slip happens
#: changes a run's error by 6 %.
STARTS_S: Final = np.arange(0.0, 4.0, 0.5)
RECORDED_S, RENDERED_S = 16.0, 10.0


@dataclass(frozen=True)
class Outcome:
    """What came of one case; errors are RMS, N m, over all starts."""

    hidden: str
    verdict: str
    found: tuple[str, ...]
    left_out: tuple[str, ...]
    lab_nm: float
    found_nm: float
    true_nm: float

    @property
    def ratio(self) -> float:
        """Error with what was found over that with the truth."""
        return self.found_nm / self.true_nm


def rendered(
    rig: parameters.Rig,
    model: Model,
    law: CompensationLaw,
    file: Path,
    *,
    length_s: float,
    start_s: float = 0.0,
) -> LawRun:
    """Render the tunnel on a rig whose drive has a model."""
    with VirtualBus(Bench(SimulatedRig(rig, seed=3), make_target("native"))) as bus:
        drive = Drive(Connection(bus, clock=lambda: bus.time_s, threaded=False))
        drive.write("torque_constant", TORQUE_CONSTANT_NM_PER_A)
        entries = ENTRIES | reduced_model(model).entries
        entries |= {"compensation_law": law, "compensation_use_load_cell": 0}
        write(drive, difference(drive, entries))
        bus.advance(start_s)
        with telling_the_law(drive):
            return render(drive, tunnel_of(drive), length_s, file)


def error_nm(rig: parameters.Rig, model: Model, folder: Path) -> float:
    """Return the RMS of the rendered torque's error over runs that start at different moments."""
    law, each = CompensationLaw.MODEL_INVERSION, []
    for start_s in STARTS_S:
        file = folder / "run.blf"
        run = rendered(rig, model, law, file, start_s=start_s, length_s=RENDERED_S)
        each.append(run.figures.rms_error_nm)
    return float(np.sqrt(np.mean(np.square(each))))


def outcome_of(hidden: str, rig: parameters.Rig, truth: Model, seed: int, folder: Path) -> Outcome:
    """Find what is hidden in a rig, apply it, and render with the lab's, found and true model."""
    lab = parse_model(LAB_MODEL, "lab.yaml")
    law, file = CompensationLaw.NONE, folder / "plain.blf"
    plain = rendered(rig, lab, law, file, length_s=RECORDED_S)
    diagnosis = diagnose(lab, [until_disabled(plain.recording)], seed=seed)
    return Outcome(
        hidden,
        diagnosis.verdict,
        tuple(one.name for one in diagnosis.effects),
        tuple(reduced_model(diagnosis.model).left_out),
        error_nm(rig, lab, folder),
        error_nm(rig, diagnosis.model, folder),
        error_nm(rig, truth, folder),
    )


def cases() -> list[tuple[str, parameters.Rig, Model]]:
    """Return name, rig and true model of each case."""
    lab = parse_model(LAB_MODEL, "lab.yaml")
    plain = rig_with(RIG)
    found = [
        (name, hide(plain, name, values), lab.with_effect(name, values))
        for name, values in EFFECTS.items()
    ]
    for change, width_rad in LAWS:
        # Strokes of one length would not tell a law of the angle from one of the time since
        # reversal.
        settings = (
            *RIG,
            "operator.second_share=0.4",
            f"cable.pile_change={change}",
            f"cable.pile_width_rad={width_rad}",
        )
        truth = with_pile(lab, change, width_rad)
        found.append((f"law {change:g}, {width_rad:g} rad", rig_with(settings), truth))
    return found


def with_pile(model: Model, change: float, width_rad: float) -> Model:
    """Return a model with the law of a leaning pile: `cable.pile_change` and `pile_width_rad`."""
    angle = np.linspace(-0.7, 0.7, 17)
    table = LawTable("friction_factor", ("load_angle_rad", "slip_direction"), tuple(angle.tolist()))
    return model.with_law(table, (change * np.tanh(angle / width_rad)).tolist())


def rig_with(settings: Sequence[str]) -> parameters.Rig:
    """Return the rig with settings, each as PART.FIELD=VALUE."""
    rig = parameters.Rig()
    for one in settings:
        rig = parameters.changed(rig, one)
    return rig


def table(outcomes: Sequence[Outcome]) -> str:
    """Return the outcomes as a table in Markdown."""
    rows = [
        "| hidden | verdict | lab's model, mN m | found | true | found over true |",
        "|---|---|---|---|---|---|",
    ]
    for one in outcomes:
        what = f"{one.verdict} {', '.join(one.found)}" + (
            f" (left out: {', '.join(one.left_out)})" if one.left_out else ""
        )
        errors = " | ".join(
            f"{1e3 * error:.1f}" for error in (one.lab_nm, one.found_nm, one.true_nm)
        )
        rows.append(f"| {one.hidden} | {what} | {errors} | {one.ratio:.2f} |")
    return "\n".join(rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run all cases and print the table; `--json` for figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True, help="of the diagnosis")
    parser.add_argument("--only", action="append", metavar="NAME", help="a case; may be repeated")
    parser.add_argument("--json", type=Path, metavar="FILE")
    args = parser.parse_args(arguments)
    outcomes = []
    with tempfile.TemporaryDirectory() as folder:
        for name, rig, truth in cases():
            if args.only and name not in args.only:
                continue
            outcomes.append(outcome_of(name, rig, truth, args.seed, Path(folder)))
            sys.stdout.write(table(outcomes[-1:]).splitlines()[-1] + "\n")
            sys.stdout.flush()
    if args.json:
        args.json.write_text(
            json.dumps([asdict(one) for one in outcomes], indent=1) + "\n", encoding="utf-8"
        )
    sys.stdout.write(table(outcomes) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
