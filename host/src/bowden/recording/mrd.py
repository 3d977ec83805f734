"""Importer for recordings of the Medical Robotics and Devices Lab's surgical-tool test stand.

Reads files of `MRDLab/mis-tool-characterization` (O'Neill, Stephens, Kowalewski, IEEE RA-L 3(4),
2018: a cable-driven surgical tool with torque and angle measured at both ends), packed or not. The
proximal end is our motor, the distal end our load. The runs of one set (names that differ in the
last number only) share their zeros, the sets of one tool the tool. `mrd_file` reads the columns.

The header is unreliable (it says milliseconds where the column holds seconds) and signs are not
documented. What is found or assumed is written into the metadata under `import_...`:

- *Angle zeros* are the counters' own: they run on from run to run of a set, so that all its runs
  share one zero. The zeros of the two ends are not aligned with each other.
- *Torque zeros* are the header's, `torque0AverageTorque` and `torque2ZeroLoad`. The second is 0 in
  every file, and the first may have been taken with friction in the tool: a constant between the
  two torques is not known.
- *Signs*, one for all runs that are read together: the load's angle moves with the motor's; over
  many cycles nothing in the rig produces energy, so the motor puts work in and the load takes it
  out.
- *Start-up*: the load starts abruptly and oscillates for up to half a second; that part is cut off.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.recording.mrd_file import (
    ANGLE_L,
    ANGLE_M,
    BRAKE,
    COMMAND,
    CURRENT,
    MOTOR,
    TORQUE_L,
    TORQUE_M,
    StandRun,
    read_stand_run,
)
from bowden.recording.recording import Recording
from bowden.recording.session import Groups, SessionEntry, SessionFile
from bowden.recording.source_bytes import read_text, stem

_Floats = NDArray[np.float64]

TORQUE_NM_PER_COUNT = 3.9811e-5
PROXIMAL_COUNTS_PER_TURN = 8192
DISTAL_COUNTS_PER_TURN = 4000
MOTOR_COUNTS_PER_TURN = 4196 * 35  # encoder counts times the gearbox
STARTUP_S = 0.5
#: Net work below this share of the work moved back and forth leaves a torque's sign in doubt.
DOUBTFUL_SHARE = 0.05

_NAME = re.compile(r"(?P<set>(?P<tool>.+?)(?:_(?P<path>(?:Roll|Pitch)_\d+))?)_(?P<run>\d{2,3})")


@dataclass(frozen=True)
class _Signs:
    """What the signs of a set of runs follow from; each is negative where a sign is reversed.

    Parameters
    ----------
    together : float
        Correlation of the two ends' motions.
    motor_work, load_work : float
        Net work into the cables at the motor and out of them at the load, over the work moved.
    """

    together: float
    motor_work: float
    load_work: float

    @classmethod
    def of(cls, runs: Sequence[StandRun]) -> _Signs:
        """Find the signs of runs that share them."""
        together = _correlation(runs)
        load_work = _net_work_share(runs, TORQUE_L, ANGLE_L)
        return cls(together, _net_work_share(runs, TORQUE_M, ANGLE_M), _sign(together) * load_work)


def read_mrd(
    path: str | Path,
    *,
    startup_s: float = STARTUP_S,
    distal_zero_counts: float | None = None,
) -> Recording:
    """Read one run of the test stand.

    Parameters
    ----------
    path : str or Path
        The `<tool>_<XY>.TXT` file, also packed.
    startup_s : float, default 0.5
        Seconds to cut off at the start, >= 0.
    distal_zero_counts : float, optional
        The distal torque sensor's reading without load; the header's when absent.

    Returns
    -------
    Recording
        Signs as on the physics page; the stand's other columns too; what was assumed in `metadata`.

    Raises
    ------
    BadInput
        No such file, a line that is not ten numbers, or nothing left after the start-up.
    """
    return _read([Path(path)], startup_s, distal_zero_counts)[0]


def read_mrd_folder(
    folder: str | Path,
    *,
    startup_s: float = STARTUP_S,
    distal_zero_counts: float | None = None,
) -> tuple[list[Recording], SessionFile]:
    """Read all runs of a folder, with one set of signs, and what they share.

    Parameters
    ----------
    folder : str or Path
        With `<tool>[_Roll_<n> | _Pitch_<n>]_<number>.TXT` files, packed or not, of one tool.
    startup_s, distal_zero_counts
        As for `read_mrd`.

    Returns
    -------
    recordings : list of Recording
        In the order of the names.
    session : SessionFile
        Zeros by set, path by the roll or pitch that the names tell; the files are ``NAME.csv``.

    Raises
    ------
    BadInput
        No run in the folder, runs of several tools, or what `read_mrd` raises.
    """
    folder = Path(folder)
    paths = sorted(
        path for path in folder.glob("*") if re.search(r"\.TXT(\.gz)?$", path.name, re.IGNORECASE)
    )
    named = {path: found for path in paths if (found := _NAME.fullmatch(stem(path)))}
    if not named:
        raise BadInput(str(folder), "no run of the test stand", "files like TOOL_12.TXT[.gz]")
    tools = sorted({found["tool"] for found in named.values()})
    if len(tools) > 1:
        raise BadInput(str(folder), f"runs of {', '.join(tools)}", "runs of one tool in a folder")
    recordings = _read(list(named), startup_s, distal_zero_counts)
    entries = [
        SessionEntry(
            file=f"{stem(path)}.csv",
            zeros=found["set"],
            path=found["path"],
            notes=_readme(path, found["path"]),
        )
        for path, found in named.items()
    ]
    shared = Groups(tool=tools[0], path=None if entries[0].path else "as mounted")
    return recordings, SessionFile(
        rig=f"MRD surgical-tool stand, {tools[0]}", shared=shared, recordings=tuple(entries)
    )


def _read(
    paths: Sequence[Path], startup_s: float, distal_zero_counts: float | None
) -> list[Recording]:
    """Read runs that share their signs."""
    if not 0.0 <= startup_s < float("inf"):
        raise BadInput("start-up", f"{startup_s:g}", "seconds, 0 or more")
    runs = [read_stand_run(path, startup_s) for path in paths]
    signs = _Signs.of(runs)
    return [_recording(run, signs, distal_zero_counts) for run in runs]


def _recording(run: StandRun, signs: _Signs, distal_zero_counts: float | None) -> Recording:
    rows = run.rows
    load_sign, motor_work, load_work = _sign(signs.together), signs.motor_work, signs.load_work
    motor_zero, motor_note = _zero(run.header, "torque0AverageTorque")
    load_zero, load_note = _zero(run.header, "torque2ZeroLoad")
    if distal_zero_counts is not None:
        load_zero, load_note = distal_zero_counts, f"{distal_zero_counts:g} counts (given)"
    pulses = ", ".join(f"{k}={v}" for k, v in run.header.items() if k.startswith("idxPulse"))
    return Recording(
        run.time_s,
        motor_angle_rad=_angle_rad(rows[:, ANGLE_M], PROXIMAL_COUNTS_PER_TURN),
        load_angle_rad=load_sign * _angle_rad(rows[:, ANGLE_L], DISTAL_COUNTS_PER_TURN),
        motor_torque_nm=_sign(motor_work) * (rows[:, TORQUE_M] - motor_zero) * TORQUE_NM_PER_COUNT,
        load_torque_nm=_sign(load_work) * (rows[:, TORQUE_L] - load_zero) * TORQUE_NM_PER_COUNT,
        motor_current_a=rows[:, CURRENT],
        brake_command_a=rows[:, BRAKE],
        motor_command=rows[:, COMMAND],
        geared_motor_angle_rad=_angle_rad(rows[:, MOTOR], MOTOR_COUNTS_PER_TURN),
        metadata={
            "rig": f"MRD surgical-tool stand, {stem(run.path)}",
            "sample_rate_hz": f"{1.0 / float(np.median(np.diff(run.time_s))):.6g}",
            "data_source": "MRDLab/mis-tool-characterization, doi 10.1109/LRA.2018.2849862, "
            "Open Database License",
            "import_time": run.time_note,
            "import_angles": "zero of the counters, one for all runs of a set; load sign "
            f"{'reversed' if load_sign < 0 else 'kept'} (correlation of the motions "
            f"{signs.together:+.2f})" + (f"; index pulses {pulses}" if pulses else ""),
            "import_motor_torque": f"zero {motor_note}; sign {_sign_note(motor_work)}",
            "import_load_torque": f"zero {load_note}; sign {_sign_note(load_work)}",
            "notes": run.note,
        },
        source=str(run.path),
    )


def _zero(header: dict[str, str], name: str) -> tuple[float, str]:
    """Return a torque's zero in counts and where it is from; 0 where the header has none."""
    try:
        zero = float(header[name])
    except (KeyError, ValueError):
        return 0.0, "0 counts (none in the header)"
    return (zero, f"{zero:g} counts (header)") if np.isfinite(zero) else _zero({}, name)


def _angle_rad(counts: _Floats, counts_per_turn: int) -> _Floats:
    """Angle from the counter's zero; a jump of more than half a turn is the counter's wrap."""
    return np.asarray(np.unwrap(counts, period=counts_per_turn) * (2.0 * np.pi / counts_per_turn))


def _correlation(runs: Sequence[StandRun]) -> float:
    """Correlate the two ends' motions, in steps of ten samples, over all runs; -1..1."""
    motor, load = (
        np.concatenate([np.diff(run.rows[::10, column]) for run in runs])
        for column in (ANGLE_M, ANGLE_L)
    )
    norm = float(np.sqrt(np.sum(motor**2) * np.sum(load**2)))
    return float(np.sum(motor * load)) / norm if norm > 0.0 else 0.0


def _net_work_share(runs: Sequence[StandRun], torque: int, angle: int) -> float:
    """Net work over the work moved back and forth, -1..1; an offset of the torque cancels."""
    net = moved = 0.0
    for run in runs:
        values = run.rows[:, torque]
        power = (values - values.mean())[1:] * np.diff(run.rows[:, angle])
        net, moved = net + float(np.sum(power)), moved + float(np.sum(np.abs(power)))
    return net / moved if moved > 0.0 else 0.0


def _sign(work_share: float) -> float:
    return -1.0 if work_share < 0.0 else 1.0


def _sign_note(work_share: float) -> str:
    kept = "reversed" if work_share < 0.0 else "kept"
    doubt = "" if abs(work_share) > DOUBTFUL_SHARE else ", doubtful"
    return f"{kept} (net work is {abs(work_share):.0%} of the work moved{doubt})"


def _readme(run: Path, path: str | None) -> str | None:
    """Return what the set's readme says of its path: ``readme_Roll_1.txt``, or ``readme.txt``."""
    for name in (f"readme_{path}.txt", "readme.txt"):
        readme = run.with_name(name)
        if path and readme.is_file():
            return " ".join(read_text(readme, "a text file", "latin-1").split("\n\n")[0].split())
    return None
