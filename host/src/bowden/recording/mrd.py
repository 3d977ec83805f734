"""Importer for recordings of the Medical Robotics and Devices Lab's surgical-tool test stand.

Reads one text file of `MRDLab/mis-tool-characterization` (O'Neill, Stephens, Kowalewski, IEEE RA-L
3(4), 2018: a cable-driven surgical tool with torque and angle measured at both ends) and builds a
`Recording`, which then goes wherever any recording goes. The proximal end is our motor, the distal
end our load. Touches nothing but the file that it reads.

The files' header is not to be trusted (it says milliseconds where the column holds seconds), signs
are not documented, and the distal torque has no zero. What is found or assumed instead is written
into the recording's metadata under `import_...`, so that nobody has to guess later:

- *Angles* count from the first kept sample. The load's sign is the one that makes it move with the
  motor.
- *Torque signs* follow from the power flow: over many cycles nothing in the rig produces energy, so
  the motor puts work in and the load takes work out.
- *Proximal zero*: `torque0AverageTorque` of the header.
- *Distal zero*: the first sample. The resistive load engages only after it, whatever its step: the
  first samples of twelve runs are within 15 counts (0.6 mN m) of each other's mean, while the
  torque that follows ranges over 3000.
- *Start-up*: the load jumps on and rings for up to half a second; that part is cut off.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.errors import BadInput
from bowden.recording.recording import Recording

_Floats = NDArray[np.float64]

TORQUE_NM_PER_COUNT = 3.9811e-5
PROXIMAL_COUNTS_PER_TURN = 8192
DISTAL_COUNTS_PER_TURN = 4000
MOTOR_COUNTS_PER_TURN = 4196 * 35  # encoder counts times the gearbox
STARTUP_S = 0.5

_COLUMNS = 10
_TIME, _ANGLE_M, _TORQUE_M, _CURRENT, _ANGLE_L, _TORQUE_L, _BRAKE, _COMMAND, _MOTOR = range(9)


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
        The `<tool>_<XY>.TXT` file.
    startup_s : float, default 0.5
        Seconds to cut off at the start, >= 0.
    distal_zero_counts : float, optional
        The distal torque sensor's reading without load; the first sample when absent.

    Returns
    -------
    Recording
        Signs as on the physics page; the stand's other columns too; what was assumed in
        `metadata`.

    Raises
    ------
    BadInput
        No such file, a line that is not ten numbers, or nothing left after the start-up.
    """
    path = Path(path)
    header, rows = _parse(path)
    time_s, time_note, keep = _seconds(rows[:, _TIME])
    if not keep.all():
        rows = rows[keep]
    time_s = time_s[keep]

    first = int(np.searchsorted(time_s, time_s[0] + startup_s))
    if time_s.size - first < 100:
        raise BadInput(
            str(path),
            f"{time_s[-1] - time_s[0]:.3f} s of data",
            f"more than the start-up of {startup_s} s that is cut off",
        )
    proximal_zero, zero_note = _proximal_zero(header)
    distal_zero = float(rows[0, _TORQUE_L]) if distal_zero_counts is None else distal_zero_counts

    rows = rows[first:]
    time_s = time_s[first:] - time_s[first]
    motor_angle = _angle_rad(rows[:, _ANGLE_M], PROXIMAL_COUNTS_PER_TURN)
    load_angle = _angle_rad(rows[:, _ANGLE_L], DISTAL_COUNTS_PER_TURN)
    motor_torque = (rows[:, _TORQUE_M] - proximal_zero) * TORQUE_NM_PER_COUNT
    load_torque = (rows[:, _TORQUE_L] - distal_zero) * TORQUE_NM_PER_COUNT

    correlation = float(np.corrcoef(np.diff(motor_angle[::10]), np.diff(load_angle[::10]))[0, 1])
    load_angle = _flip(load_angle, correlation)
    motor_work = _net_work_share(motor_torque, motor_angle)
    load_work = _net_work_share(load_torque, load_angle)
    motor_torque = _flip(motor_torque, motor_work)
    load_torque = _flip(load_torque, load_work)

    return Recording(
        time_s=time_s,
        motor_angle_rad=motor_angle,
        load_angle_rad=load_angle,
        motor_torque_nm=motor_torque,
        load_torque_nm=load_torque,
        channels={
            "motor_current_a": rows[:, _CURRENT].copy(),
            "brake_command_a": rows[:, _BRAKE].copy(),
            "motor_command": rows[:, _COMMAND].copy(),
            "geared_motor_angle_rad": _angle_rad(rows[:, _MOTOR], MOTOR_COUNTS_PER_TURN),
        },
        metadata={
            "rig": f"MRD surgical-tool stand, {path.stem}",
            "sample_rate_hz": f"{1.0 / float(np.median(np.diff(time_s))):.6g}",
            "data_source": "MRDLab/mis-tool-characterization, doi 10.1109/LRA.2018.2849862, "
            "Open Database License",
            "import_time": time_note,
            "import_startup": f"first {startup_s:g} s cut off",
            "import_angles": "zero at the first kept sample; load sign "
            f"{'reversed' if correlation < 0 else 'kept'} (correlation of the motions "
            f"{correlation:+.2f})",
            "import_motor_torque": f"zero {zero_note}; sign {_sign_note(motor_work)}",
            "import_load_torque": f"zero {distal_zero:g} counts "
            f"({'first sample' if distal_zero_counts is None else 'given'}); "
            f"sign {_sign_note(load_work)}",
            "notes": header[1].lstrip("% ") if len(header) > 1 else "",
        },
        source=str(path),
    )


def _parse(path: Path) -> tuple[list[str], _Floats]:
    """Return the header lines and the ten columns."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise BadInput(str(path), error.strerror or "no file", "a readable MRD text file") from None
    header = [line for line in lines if line.startswith("%")]
    numbered = [
        (number, line)
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.startswith("%")
    ]
    if not numbered:
        raise BadInput(str(path), "no rows", "rows of ten comma-separated numbers")
    values = []
    for number, line in numbered:
        cells = line.split(",")
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            row = []
        if len(row) != _COLUMNS or not np.all(np.isfinite(row)):
            raise BadInput(
                f"{path}, line {number}", repr(line[:60]), "ten comma-separated finite numbers"
            )
        values.append(row)
    return header, np.array(values)


def _seconds(column: _Floats) -> tuple[_Floats, str, NDArray[np.bool_]]:
    """Time in seconds from the first row, how it was read, and which rows to keep.

    The unit follows from the step (the stand samples at 1 kHz); where the clock jumps back it has
    wrapped, and time goes on with one step; rows that repeat a time are dropped.
    """
    step = np.diff(column)
    usual = float(np.median(step[step > 0])) if np.any(step > 0) else 1.0
    unit, name = (1e-3, "milliseconds") if usual >= 0.5 else (1.0, "seconds")
    wraps = step < 0
    time_s = np.concatenate([[0.0], np.cumsum(np.where(wraps, usual, step))]) * unit
    keep = np.concatenate([[True], step != 0])
    note = (
        f"column in {name}; {int(wraps.sum())} wraps joined; {int((~keep).sum())} repeats dropped"
    )
    return time_s, note, keep


def _proximal_zero(header: list[str]) -> tuple[float, str]:
    for line in header:
        name, _, value = line.lstrip("% ").partition("=")
        if name.strip() == "torque0AverageTorque":
            try:
                return float(value), f"{float(value):g} counts (header)"
            except ValueError:
                break
    return 0.0, "0 counts (none in the header)"


def _angle_rad(counts: _Floats, counts_per_turn: int) -> _Floats:
    """Angle from the first row; a jump of more than half a turn is the counter's wrap."""
    unwrapped = np.unwrap(counts, period=counts_per_turn)
    return np.asarray((unwrapped - unwrapped[0]) * (2.0 * np.pi / counts_per_turn))


def _net_work_share(torque_nm: _Floats, angle_rad: _Floats) -> float:
    """Net work over the work moved to and fro, -1..1; an offset of the torque cancels."""
    power = (torque_nm - torque_nm.mean())[1:] * np.diff(angle_rad)
    moved = float(np.sum(np.abs(power)))
    return float(np.sum(power)) / moved if moved > 0.0 else 0.0


def _flip(values: _Floats, indicator: float) -> _Floats:
    return -values if indicator < 0.0 else values


def _sign_note(work_share: float) -> str:
    kept = "reversed" if work_share < 0.0 else "kept"
    doubt = "" if abs(work_share) > 0.05 else ", doubtful"
    return f"{kept} (net work is {abs(work_share):.0%} of the work moved{doubt})"
