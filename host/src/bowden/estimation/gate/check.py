"""The data gate itself: every check on every recording, what stops first.

`check_data` returns the findings, `admit` the warnings or a refusal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bowden.estimation.gate.course import check_course
from bowden.estimation.gate.encoders import check_encoders
from bowden.estimation.gate.finding import BadData, Finding, stops
from bowden.estimation.gate.rigs import check_rigs
from bowden.estimation.gate.sensors import check_sensors
from bowden.estimation.gate.time_base import check_time_base
from bowden.estimation.gate.units import check_against_model
from bowden.model import Mode, Model
from bowden.recording.recording import Recording


def check_data(model: Model, recordings: Sequence[Recording], mode: Mode) -> tuple[Finding, ...]:
    """Look for what would make every number that is fitted to recordings nonsense.

    Parameters
    ----------
    model : Model
        Simulated once a recording; some two dozen times on a thinned one where the answer is far
        from what was measured.
    recordings : sequence of Recording
        Of one rig. Channels that are not there are not looked at.
    mode : Mode

    Returns
    -------
    tuple of Finding
        What stops first.
    """
    found: list[Finding] = []
    for one in recordings:
        found += _check_one(model, one, mode, Path(one.source).name)
    if len(recordings) > 1 and not any(
        one.severity == "stop" or one.what in {"short", "empty"} for one in found
    ):
        found += check_rigs(model, mode, recordings)
    return tuple(sorted(found, key=lambda finding: finding.severity != "stop"))


def admit(model: Model, recordings: Sequence[Recording], mode: Mode) -> tuple[Finding, ...]:
    """Return the warnings about recordings, or refuse them.

    A recording that is too short for a verdict is admitted: the fit's intervals become wide.

    Parameters
    ----------
    model, recordings, mode
        As for `check_data`.

    Raises
    ------
    BadData
        A finding stops.
    """
    findings = tuple(
        replace(one, severity="warn") if one.what == "short" else one
        for one in check_data(model, recordings, mode)
    )
    if stops(findings):
        raise BadData(findings)
    return findings


def _check_one(model: Model, one: Recording, mode: Mode, name: str) -> list[Finding]:
    found = list(check_time_base(one, name))
    if any(finding.what in {"empty", "short", "not_finite"} for finding in found):
        return found
    found += check_sensors(one, name)
    found += check_encoders(model, one, name)
    if not any(finding.what == "units" for finding in found):
        found += check_against_model(model, mode, one, name)
    if not stops(found):
        found += check_course(model, one, name)
    return found
