"""Prints the result of a fit for `calibrate` and `estimate`: numbers, nuisance numbers, gap."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from bowden.cli.output import console
from bowden.digits import rounded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bowden.estimation.calibrate import Calibration
    from bowden.estimation.posterior import Estimate, NuisanceEstimate
    from bowden.recording.session import Session

TOLD_SIGMAS = 3.0  # a nuisance number beyond so many standard errors is shown


def show(calibration: Calibration, caveats: Sequence[str], written: Path | None) -> None:
    """Print the result to stderr."""
    from rich import box  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415  (keeps --help fast)

    from bowden.report.words import quantity_with_unit  # noqa: PLC0415

    out = console()
    for nuisance in calibration.nuisances:
        if abs(nuisance.value) > TOLD_SIGMAS * nuisance.sigma:
            out.print(_measurement(nuisance, calibration.recordings), soft_wrap=True)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("parameter", overflow="fold")
    for name in ("before", "now", "95 % interval", "moved"):
        table.add_column(name, justify="right", no_wrap=True)
    for one in calibration.estimates:
        table.add_row(
            one.path, f"{one.before:.4g}", _at(one.value, one), _interval(one), _moved(one)
        )
    out.print(table)
    for caveat in caveats:
        out.print(caveat, soft_wrap=True)
    for gap in calibration.held_out:
        if gap.noise_floor == 0.0:
            continue
        before, after, floor = (
            quantity_with_unit(gap.quantity, value)
            for value in (gap.before, gap.after, gap.noise_floor)
        )
        out.print(
            f"held-out gap in {gap.quantity}: {before} before, {after} after, noise floor {floor}",
            soft_wrap=True,
        )
    count = calibration.held_out_is.count(", ") + 1
    shown = calibration.held_out_is if count == 1 else f"{count} recordings"
    out.print(f"held out: {shown}", soft_wrap=True)
    if written:
        out.print(f"model: {written}", soft_wrap=True)


def _interval(one: Estimate) -> str:
    if one.low is None or one.high is None:
        return "–"
    return f"{_at(one.low, one)} .. {_at(one.high, one)}"


def _at(value: float, one: Estimate) -> str:
    return rounded(value, 0.5 * abs((one.high or 0.0) - (one.low or 0.0)))


def _moved(one: Estimate) -> str:
    if one.at_bound:
        return "to its bound"
    if one.change_in_sigmas is not None:
        return f"{one.change_in_sigmas:+.1f} sigma"
    return f"{100.0 * (one.value / one.before - 1.0):+.2g} %" if one.before else ""


def _measurement(one: NuisanceEstimate, recordings: Sequence[str]) -> str:
    """Return the nuisance numbers that differ from zero, in words."""
    names = [Path(recordings[k]).name for k in one.recordings]
    where = names[0] if len(names) == 1 else f"{len(names)} recordings"
    scale, unit = {"N m": (1e3, "mN m"), "rad": (1e3, "mrad"), "s": (1e3, "ms")}.get(
        one.unit, (100.0, "%")
    )
    value = f"{scale * one.value:+.3g} ± {scale * 1.96 * one.sigma:.2g} {unit}"
    return f"{one.kind} of {one.channel} in {where}: {value}"


def sources(session: Session) -> list[dict[str, str]]:
    """Return the provenance of recordings: name and SHA-256 of each file."""
    paths = [Path(one.source) for one in session.recordings]
    return [
        {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
        for path in paths
        if path.is_file()
    ]
