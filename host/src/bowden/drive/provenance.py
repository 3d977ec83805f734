"""Metadata of a capture: what its PDOs carry, the drive's settings, who recorded it.

Reads the drive, writes nothing; `capture` puts the answer into the side file.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from bowden.drive.client import Drive
from bowden.drive.dictionary import TABLE, TPDOS
from bowden.drive.entry import Entry, Layout
from bowden.drive.meanings import CompensationLaw, ModeOfOperation, TunnelAngleSource
from bowden.drive.power import Run
from bowden.errors import DriveFailed
from bowden.recording.channels import name_with_unit
from bowden.recording.side_file import OtherDrive, PdoField, PdoLayout, SideFile

_PDO_DOES_NOT_EXIST = 1 << 31


def read_layouts(drive: Drive) -> list[Layout]:
    """Read from the drive what its TPDOs carry now; someone may have mapped them anew."""
    layouts = []
    for default in TPDOS:
        cob_id = drive.read_raw(f"{default.name}_communication.cob_id")
        if cob_id & _PDO_DOES_NOT_EXIST:
            continue
        count = drive.read_raw(f"{default.name}_mapping.count")
        entries = [
            _mapped(drive, drive.read_raw(f"{default.name}_mapping.object_{i}"))
            for i in range(1, count + 1)
        ]
        layouts.append(Layout(default.name, cob_id & 0x7FF, default.event_ms, tuple(entries)))
    names = [{entry.name for entry in layout.entries} for layout in layouts] or [set()]
    if {"sample_counter", "device_time"} - names[0] or any(
        "sample_counter_low" not in others for others in names[1:]
    ):
        raise DriveFailed(
            f"node {drive.node_id} does not send sample_counter and device_time in its first TPDO "
            "and sample_counter_low in the others: reset it to its default mapping"
        )
    return layouts


def _mapped(drive: Drive, mapping: int) -> Entry:
    entry = TABLE.at(mapping >> 16, mapping >> 8 & 0xFF)
    if entry is None:
        raise DriveFailed(f"node {drive.node_id} maps {mapping >> 16:04X}h, unknown to this bowden")
    return entry


def side_file(
    drives: Sequence[Drive], layouts: Sequence[list[Layout]], metadata: dict[str, str]
) -> SideFile:
    """Make the side file of a recording that is about to start; the first drive's is the time."""
    first, *others = drives
    return SideFile(
        bowden=version("bowden"),
        git=_git_describe(),
        dictionary_hash=_hash(first),
        node_id=first.node_id,
        adapter=first.connection.adapter,
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        sample_period_s=_period_s(first),
        pdos=_pdos(layouts[0]),
        others=[
            OtherDrive(
                node_id=drive.node_id,
                dictionary_hash=_hash(drive),
                sample_period_s=_period_s(drive),
                pdos=_pdos(of_drive, f"node{drive.node_id}_"),
            )
            for drive, of_drive in zip(others, layouts[1:], strict=True)
        ],
        metadata=metadata,
    )


def _hash(drive: Drive) -> str:
    return f"{drive.read_raw('dictionary_hash'):08X}h"


def _period_s(drive: Drive) -> float:
    return drive.read("tpdo1_communication.event_timer") or 1e-3


def _pdos(layouts: Iterable[Layout], prefix: str = "") -> list[PdoLayout]:
    return [
        PdoLayout(
            name=layout.name.upper(),
            cob_id=layout.cob_id,
            fields=[_field(entry, prefix) for entry in layout.entries],
        )
        for layout in layouts
    ]


def _field(entry: Entry, prefix: str) -> PdoField:
    if entry.name == "statusword":
        column = "status"
    else:
        column = name_with_unit(entry.name.replace(".", "_"), entry.unit)
    return PdoField(
        name=entry.name,
        bits=entry.bits,
        signed=entry.signed,
        scale=1.0 if entry.scale is None else entry.scale,
        column=prefix + column,
    )


def run_metadata(drive: Drive, run: Run | None) -> dict[str, str]:
    """Return the drive's mode and settings, so that the recording can be read without the drive."""
    if run is None:
        return {}
    law = {"compensation": CompensationLaw.word_of(drive.read_raw("compensation_law"))}
    if run.mode is ModeOfOperation.TORQUE:
        if run.follow is not None:
            torque = {"torque_profile": str(run.follow)}
        elif run.profile is not None:
            torque = {"torque_profile": run.profile.name}
        else:
            torque = {"target_torque_nm": f"{run.torque_nm:.9g}"}
        return law | {"drive_mode": "torque"} | torque
    return law | {
        "drive_mode": "tunnel",
        "tunnel_half_width_rad": f"{drive.read('tunnel_half_width'):.9g}",
        "tunnel_stiffness_nm_per_rad": f"{drive.read('tunnel_stiffness'):.9g}",
        "tunnel_torque_limit_nm": f"{drive.read('tunnel_torque_limit'):.9g}",
        "tunnel_angle_source": TunnelAngleSource.word_of(drive.read_raw("tunnel_angle_source")),
    }


def _git_describe() -> str | None:
    """Return the state of the source that records, where it runs from a git checkout."""
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--tags"],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            timeout=5,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None
