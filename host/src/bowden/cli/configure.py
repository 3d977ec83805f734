"""Write a model's rig into the drive: pulleys, cables and path, friction, and the tunnel if given.

Shows what differs, writes it, and reads every value back; nothing is written with --dry-run. The
path is resampled into segments of equal length that keep its wrap angle. Calibration values
(torque constant, load cell) are not touched.
"""

from __future__ import annotations

import argparse
from itertools import groupby
from pathlib import Path

import numpy as np
from rich.table import Table

from bowden.cli.drive_arguments import add_drive_arguments, connect_drive
from bowden.cli.output import add_json_argument, console, print_json
from bowden.drive.configuration import Change, difference, write
from bowden.drive.dictionary import lookup
from bowden.drive.provenance import ANGLE_SOURCES
from bowden.errors import BadInput
from bowden.model import Model, parse_model

EXAMPLES = """examples:
  bowden configure rig.yaml --dry-run
  bowden configure rig.yaml --tunnel-half-width 0.05 --tunnel-stiffness 0.5
  bowden configure rig.yaml --segments 40 -i socketcan -c can0
"""

DEFAULT_SEGMENTS = 20

#: Option of this command: entry of the drive, help.
_OPTIONS = {
    "tunnel_half_width": "half width of the tunnel's dead zone in rad",
    "tunnel_stiffness": "stiffness of the tunnel's walls in N m/rad",
    "tunnel_torque_limit": "where the tunnel's torque saturates, in N m",
    "motor_torque_limit": "largest motor torque in N m",
    "motor_torque_slew": "fastest change of the motor torque in N m/s",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("model", type=Path, metavar="MODEL.yaml", help="the model file")
    parser.add_argument("--dry-run", action="store_true", help="only show what would be written")
    parser.add_argument(
        "--segments",
        type=int,
        default=DEFAULT_SEGMENTS,
        metavar="N",
        help=f"segments of each cable in the drive's model (default {DEFAULT_SEGMENTS})",
    )
    for name, text in _OPTIONS.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=float, metavar="X", help=text)
    parser.add_argument(
        "--tunnel-angle", choices=ANGLE_SOURCES, help="the angle that the tunnel is about"
    )
    add_json_argument(parser)
    add_drive_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Compare, write, read back, and report."""
    model = parse_model(args.model.read_text(encoding="utf-8"), source=str(args.model))
    wanted = wanted_configuration(model, args.segments)
    wanted |= {name: getattr(args, name) for name in _OPTIONS if getattr(args, name) is not None}
    if args.tunnel_angle:
        wanted["tunnel_angle_source"] = ANGLE_SOURCES.index(args.tunnel_angle)
    left_out = not_on_the_drive(model)
    with connect_drive(args) as drive:
        changes = difference(drive, wanted)
        if not args.dry_run:
            write(drive, changes)
    if args.json:
        print_json(
            {
                "node_id": args.node,
                "changes": [
                    {"name": c.name, "before": c.before, "wanted": c.wanted, "unit": c.unit}
                    for c in changes
                ],
                "written": not args.dry_run,
                "not_on_the_drive": left_out,
            }
        )
    _show(args, changes, len(wanted), left_out)
    return 0


def wanted_configuration(model: Model, segments: int = DEFAULT_SEGMENTS) -> dict[str, float]:
    """Return the drive's entries (SI values by name) that describe the model's rig.

    Parameters
    ----------
    model : Model
        The offline model.
    segments : int
        Segments of each cable, 1 .. 40.

    Raises
    ------
    BadInput
        A number of segments that the drive does not have.
    """
    entry = lookup("cable_segments")
    if not entry.low <= segments <= entry.high:
        raise BadInput("--segments", str(segments), f"{entry.low} .. {entry.high}")
    pair = model.transmission
    # The wrap angle up to each end of a segment; its difference quotient is the mean curvature.
    piece_ends_m = np.concatenate(([0.0], np.cumsum(pair.piece_length_m)))
    wrap_rad = np.concatenate(([0.0], np.cumsum(pair.piece_length_m * pair.piece_curvature_per_m)))
    ends_m = np.linspace(0.0, pair.length_m, segments + 1)
    length_m = pair.length_m / segments
    curvature_per_m = np.diff(np.interp(ends_m, piece_ends_m, wrap_rad)) / length_m
    # Without a stiction length the paper's scheme holds: mu_s acts over one segment.
    stiction_m = pair.friction.stiction_length_m or length_m
    wanted: dict[str, float] = {
        "motor_pulley_radius": pair.motor_pulley_radius_m,
        "load_pulley_radius": pair.load_pulley_radius_m,
        "cable_axial_stiffness": pair.axial_stiffness_n,
        "cable_pretension": pair.pretension_n,
        "friction_dynamic": pair.friction.mu_d,
        "friction_static": pair.friction.mu_s,
        "stiction_length": stiction_m,
        "cable_segments": segments,
    }
    rig = model.document.rig
    for name, counts in (
        ("motor_encoder_resolution", rig.motor_encoder_counts_per_turn),
        ("load_encoder_resolution", rig.load_encoder_counts_per_turn),
    ):
        if counts is not None:  # a model file need not say; then the drive's own stays
            wanted[name] = counts.value
    for number, curvature in enumerate(curvature_per_m.tolist(), 1):
        wanted[f"segment_length.{number}"] = length_m
        wanted[f"segment_curvature.{number}"] = curvature
    rig = model.document.rig
    if rig.motor_encoder_counts_per_turn is not None:
        wanted["motor_encoder_resolution"] = rig.motor_encoder_counts_per_turn.value
    if rig.load_encoder_counts_per_turn is not None:
        wanted["load_encoder_resolution"] = rig.load_encoder_counts_per_turn.value
    return wanted


def not_on_the_drive(model: Model) -> list[str]:
    """Return what the model has and the drive's cable model has not."""
    pair, law = model.transmission, model.transmission.friction
    terms = {
        "viscous friction": law.mu_v_s_per_m != 0,
        "Stribeck friction": law.stribeck_gain != 0,
        "tension-dependent friction": law.tension_exponent != 0,
        "direction asymmetry": law.direction_asymmetry != 0,
        "the initial tension profile": pair.initial_tension_n is not None,
    }
    return [name for name, there in terms.items() if there]


def _show(
    args: argparse.Namespace, changes: list[Change], compared: int, left_out: list[str]
) -> None:
    out = console()
    if changes:
        out.print(_table(changes))
    state = "would change" if args.dry_run else "written and read back"
    same = compared - len(changes)
    out.print(f"node {args.node}: {len(changes)} entries {state}, {same} already as wanted")
    if left_out:
        out.print(f"not in the drive's cable model, left out: {', '.join(left_out)}")


def _table(changes: list[Change]) -> Table:
    """Show the changes; neighbours in an array that change alike share a line."""
    table = Table("entry", "before", "after", "unit")
    for (stem, before, wanted), group in groupby(
        sorted(changes, key=lambda change: lookup(change.name).index),
        key=lambda change: (change.name.partition(".")[0], change.before, change.wanted),
    ):
        names = [change.name.partition(".")[2] for change in group]
        place = names[0] if len(names) == 1 else f"{names[0]}-{names[-1]}"
        unit = next(change.unit for change in changes if change.name.startswith(stem))
        table.add_row(f"{stem}.{place}" if place else stem, f"{before:.9g}", f"{wanted:.9g}", unit)
    return table
