"""Reads a drive's supervision: checks that fail now, that are latched, and why a reset failed.

Input: a `Drive`. Output: `FaultReport`, in words, with what to do. Nothing is written.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from bowden.drive.client import Drive
from bowden.drive.dictionary import EMERGENCIES, SUPERVISION
from bowden.drive.faults import describe_emergency
from bowden.drive.meanings import AngleReference, LimitsActive, ResetCause, Statusword
from bowden.drive.power import power_state

LOG_PLACES = 16


@dataclass(frozen=True)
class Failure:
    """A check of the supervision that has failed.

    Parameters
    ----------
    check : str
        Its name.
    text, watches, limit, advice : str
        What it means, what it watches, its limit, what to do.
    code : int
        Its EMCY code.
    present : bool
        It fails now; else it is over and only latched.
    refused_reset : bool
        It refused the last fault reset.
    """

    check: str
    text: str
    watches: str
    limit: str
    advice: str
    code: int
    present: bool
    refused_reset: bool


@dataclass(frozen=True)
class LoggedFault:
    """A fault of the drive's log, which outlives power-off.

    Parameters
    ----------
    code : int
        Its EMCY code.
    text : str
        What it means, and what to do.
    reset_cause : str
        Why the program had started in which it came.
    uptime_s : int, s
        From that start.
    """

    code: int
    text: str
    reset_cause: str
    uptime_s: int


@dataclass(frozen=True)
class FaultReport:
    """Everything that a drive reports about its faults.

    Parameters
    ----------
    node_id : int
    power_state : str
        CiA 402 state.
    failures : tuple of Failure
        Present or latched, in the order of the table.
    limits : tuple of str
        Limits that cut the torque now; no faults.
    deadline_ms : int
        command_deadline; 0: the host has opted out.
    history : tuple of str
        EMCY codes since power-on in words, newest first.
    log : tuple of LoggedFault
        The last faults, newest first, also from before power-off.
    last_reset : str
        Why the program of the drive started.
    angle_reference : str
        Where its angles count from.
    """

    node_id: int
    power_state: str
    failures: tuple[Failure, ...]
    limits: tuple[str, ...]
    deadline_ms: int
    history: tuple[str, ...]
    log: tuple[LoggedFault, ...]
    last_reset: str
    angle_reference: str


def fault_report(drive: Drive) -> FaultReport:
    """Read a drive's faults; DriveFailed where it does not answer."""
    statusword = drive.read_raw("statusword")
    present = drive.read_raw("supervision_present")
    latched = drive.read_raw("supervision_latched")
    limits = drive.read_raw("limits_active")
    opted_out = bool(statusword & Statusword.NO_DEADLINE)
    history = [
        drive.read_raw(f"error_history.{place}") & 0xFFFF
        for place in range(1, drive.read_raw("error_history.count") + 1)
    ]
    return FaultReport(
        node_id=drive.node_id,
        power_state=power_state(statusword),
        failures=failures(present, latched, drive.read_raw("fault_reset_refused")),
        limits=tuple(limit.doc for limit in LimitsActive if limits & limit),
        deadline_ms=0 if opted_out else drive.read_raw("command_deadline"),
        history=tuple(describe_emergency(code) for code in history),
        log=tuple(_logged(drive)),
        last_reset=ResetCause.describe(drive.read_raw("reset_cause")),
        angle_reference=AngleReference.describe(drive.read_raw("angle_reference")),
    )


def _logged(drive: Drive) -> Iterator[LoggedFault]:
    for place in range(1, LOG_PLACES + 1):
        entry = drive.read_raw(f"fault_log.{place}")
        if entry == 0:
            return
        code, cause = entry & 0xFFFF, entry >> 16 & 0xFF
        uptime_s = drive.read_raw(f"fault_log_uptime.{place}")
        yield LoggedFault(code, describe_emergency(code), ResetCause.describe(cause), uptime_s)


def failures(present: int, latched: int, refused: int) -> tuple[Failure, ...]:
    """Put the bits of the supervision's entries into words."""
    emergencies = {emergency.name: emergency for emergency in EMERGENCIES}
    found = []
    for check in SUPERVISION:
        if not (present | latched) >> check.bit & 1:
            continue
        emergency = emergencies[check.emergency]
        found.append(
            Failure(
                check=check.name,
                text=emergency.doc,
                watches=check.watches,
                limit=check.limit,
                advice=emergency.advice,
                code=emergency.code,
                present=bool(present >> check.bit & 1),
                refused_reset=bool(refused >> check.bit & 1),
            )
        )
    return tuple(found)
