"""Diagnose a hidden effect of a simulated rig, apply the model and measure the rendering again.

A simulated rig of its own has conduits with more bends than the lab's model says. The drive
renders the tunnel without compensation and with two laws on that model: Coulomb feed-forward, which
assumes the model, and its inversion, which corrects itself with the load cell. `diagnose` names
what the model lacks, the extended model goes to the drive, and the same tunnel runs again. Nothing
tells the diagnosis what is hidden.

--part learned hides a law that no catalogue has instead: it is learned as a curve with its band,
goes to the drive as a table, and the tunnel is rendered again; see learned/report.html.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.diagnose import show, write_extended, write_report
from bowden.cli.output import add_json_argument, console, print_json, say, stages, styled
from bowden.cli.own_rig_arguments import start_own_rig
from bowden.cli.rig import add_target_argument
from bowden.cli.tunnel_experiment import (
    SETTLE_S,
    TORQUE_CONSTANT_NM_PER_A,
    TORQUE_LIMIT_NM,
    render,
    show_figures,
    telling_the_law,
    tunnel_of,
)
from bowden.counted import counted
from bowden.diagnosis.rendering import PrescribedTunnel
from bowden.drive.bus_options import add_bus_arguments
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.meanings import CompensationLaw
from bowden.drive.reduced_model import reduced_model
from bowden.errors import BadInput
from bowden.model import Model, parse_model
from bowden.recording.atomic import replace_whole
from bowden.recording.enabled import until_disabled
from bowden.report.rendering import LawRun, rendering_report

if TYPE_CHECKING:
    from bowden.diagnosis.result import Diagnosis

EXAMPLES = """examples:
  bowden demo-diagnosis
  bowden demo-diagnosis --hide cable.extra_wrap_rad=-2       fewer bends than in the model
  bowden demo-diagnosis --hide cable.viscous_s_per_m=0.2     named, and a table of the drive
  bowden demo-diagnosis --part learned                       only the law that no catalogue has
"""

#: What the lab assumes of its rig, and how well it knows it.
LAB_MODEL = """\
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: {value: 4000, tolerance: 5 %}
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: {value: 5, tolerance: 3 %}
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
  motor_encoder_counts_per_turn: 2000
  load_encoder_counts_per_turn: 10000
  load_cell_noise_nm: 0.0005
friction: {law: coulomb, mu_d: {value: 0.21, tolerance: 3 %}}
effects:
- {name: motor_inertia, inertia_kg_m2: 3.0e-5}      # from the motor's data sheet
numerics: {segments: 32}
"""

#: The rig's truth: three radians more wrap than the path tells of.
HIDDEN = "cable.extra_wrap_rad=3"

#: The rest of the rig: half of Table I's pretension, a motor that can carry the friction, friction
#: that is dry, a calm operator.
RIG = (
    "cable.pretension_n=5",
    f"motor.torque_constant_nm_per_a={TORQUE_CONSTANT_NM_PER_A:g}",
    "cable.viscous_s_per_m=0",
    "operator.frequency_hz=0.25",
)

#: A tunnel in which the uncompensated cables stay taut: what they do slack shows the inertias too.
ENTRIES = {"motor_torque_limit": TORQUE_LIMIT_NM, "tunnel_torque_limit": 0.05}

LAWS = (CompensationLaw.COULOMB, CompensationLaw.MODEL_INVERSION)


@dataclass(frozen=True)
class Loop:
    """What came out.

    Parameters
    ----------
    none : LawRun
        Without compensation: what was diagnosed.
    before, after : tuple of LawRun
        Each of `LAWS` with the lab's model and with the diagnosed one.
    tunnel : PrescribedTunnel
    diagnosis : Diagnosis
    """

    none: LawRun
    before: tuple[LawRun, ...]
    after: tuple[LawRun, ...]
    tunnel: PrescribedTunnel
    diagnosis: Diagnosis

    @property
    def runs(self) -> tuple[LawRun, ...]:
        """All of them, law by law."""
        pairs = zip(self.before, self.after, strict=True)
        return (self.none, *(run for pair in pairs for run in pair))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "--duration", type=float, default=11.0, metavar="S", help="of each run (default: 11)"
    )
    parser.add_argument(
        "--hide",
        action="append",
        metavar="PART.FIELD=VALUE",
        help=f"the rig's truth (default: {HIDDEN}; see bowden rig --rig-help)",
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("demo-diagnosis"),
        metavar="DIR",
        help="default: ./demo-diagnosis",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of noise and diagnosis")
    parser.add_argument(
        "--part",
        choices=("both", "named", "learned"),
        default="named",
        help="a hidden effect that has a name, a law that has none (takes minutes), "
        "or both (default: %(default)s)",
    )
    add_target_argument(parser)
    add_json_argument(parser)
    add_bus_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Close the loop on a rig of its own, and say what came out."""
    if not args.duration > SETTLE_S:
        raise BadInput("--duration", f"{args.duration:g}", f"seconds, more than {SETTLE_S:g}")
    directory: Path = args.output
    directory.mkdir(parents=True, exist_ok=True)
    document: dict[str, object] = {}
    if args.part != "learned":
        document |= _named(args, directory)
    if args.part != "named":
        from bowden.cli.demo_learned import learn_a_law  # noqa: PLC0415  (after the first part)

        document["learned"] = learn_a_law(args, directory / "learned")
    if args.json:
        print_json(document)
    return 0


def _named(args: argparse.Namespace, directory: Path) -> dict[str, object]:
    """Run the first part: an effect that has a name."""
    hidden = args.hide or [HIDDEN]
    say(f"starting the simulated rig; hidden in it: {', '.join(hidden)}")
    with start_own_rig(args, directory, [*RIG, *hidden]) as drive:
        loop = close_the_loop(drive, directory, args.duration, args.seed)
    report = directory / "report.html"
    with replace_whole(report) as temporary:
        page = rendering_report(loop.runs, loop.tunnel, SETTLE_S, "the simulated rig")
        temporary.write_text(page, encoding="utf-8")
    show_figures(loop.runs)
    for name, file in (
        ("verdict", "diagnosis.html"),
        ("rendering", report.name),
        ("model", "extended.yaml"),
    ):
        shown = styled((f"{name:<10}", "bold"), str((directory / file).resolve()))
        console().print(shown, soft_wrap=True)
    return _document(loop, hidden, report)


def close_the_loop(
    drive: Drive,
    directory: Path,
    duration_s: float,
    seed: int,
    names: Sequence[str] | None = None,
) -> Loop:
    """Render, diagnose, apply, render again.

    Parameters
    ----------
    drive : Drive
        On a rig whose operator moves while the drive runs.
    directory : Path
        For recordings, models and the page of the diagnosis.
    duration_s : float, s
        Of each run.
    seed : int
        Of the diagnosis.
    names : sequence of str, optional
        Candidates; the whole catalogue when absent.
    """
    (directory / "lab.yaml").write_text(LAB_MODEL, encoding="utf-8")
    lab = parse_model(LAB_MODEL, "lab.yaml")
    drive.write("torque_constant", TORQUE_CONSTANT_NM_PER_A)
    write(drive, difference(drive, ENTRIES))
    tunnel = tunnel_of(drive)

    def rendered(law: CompensationLaw, model: Model, of: str) -> LawRun:
        _apply(drive, model, law)
        title = f"{law.doc}, {of} model" if of else ""
        path = directory / f"{'-'.join(filter(None, (law.word, of)))}.blf"
        return render(drive, tunnel, duration_s, path, title)

    with telling_the_law(drive):
        say("the tunnel without compensation, then with the lab's model")
        none = rendered(CompensationLaw.NONE, lab, "")
        before = tuple(rendered(law, lab, "lab") for law in LAWS)
        drive.nmt("PRE-OPERATIONAL")  # samples are not recorded meanwhile
        diagnosis = _diagnose(lab, none, directory, seed, names)
        say("the same tunnel again, with the extended model")
        after = tuple(rendered(law, diagnosis.model, "diagnosed") for law in LAWS)
    return Loop(none, before, after, tunnel, diagnosis)


def _apply(drive: Drive, model: Model, law: CompensationLaw) -> None:
    """Give the drive model and law, as `bowden apply --without-unsupported` does."""
    reduced = reduced_model(model)
    changes = difference(drive, reduced.entries | {"compensation_law": law})
    write(drive, changes)
    entries = counted(len(changes), "entry", "entries")
    say(f"{law.word}: {entries} changed; effects in them: {', '.join(reduced.folded)}")


def _diagnose(
    lab: Model, naive: LawRun, directory: Path, seed: int, names: Sequence[str] | None
) -> Diagnosis:
    """Ask what the lab's model lacks to explain the uncompensated run; write model and page."""
    from bowden.diagnosis.diagnose import diagnose  # noqa: PLC0415  (keeps --help fast)

    say(f"diagnosing {naive.file} with the lab's model; this takes minutes")
    with stages("diagnosing") as tell:
        diagnosis = diagnose(
            lab,
            [until_disabled(naive.recording)],
            seed=seed,
            names=names,
            progress=tell,
        )
    show(diagnosis)
    write_extended(diagnosis, directory / "extended.yaml", [naive.file])
    write_report(diagnosis, directory / "diagnosis.html", "lab.yaml")
    return diagnosis


def _document(loop: Loop, hidden: Sequence[str], report: Path) -> dict[str, object]:
    none = loop.none.figures.rms_error_nm
    errors = {
        after.law: {
            "lab_model": before.figures.rms_error_nm,
            "diagnosed_model": after.figures.rms_error_nm,
        }
        for before, after in zip(loop.before, loop.after, strict=True)
    }
    return {
        "hidden": list(hidden),
        "diagnosis": loop.diagnosis.to_document() | {"model": str(report.parent / "extended.yaml")},
        "rendering_error_nm": {"none": none} | errors,
        "report": str(report),
    }
