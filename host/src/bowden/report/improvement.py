"""The page of `bowden improve`: the rendering round by round, what was found, and a learned law.

Takes each round's run and diagnosis, returns HTML text. The frame comes from `page`, the tunnel's
loops from `rendering`, the law's curve from `learned_law`.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from bowden.diagnosis.rendering import PrescribedTunnel
from bowden.diagnosis.result import Diagnosis
from bowden.diagnosis.wording import law_in_words
from bowden.report.learned_law import HiddenLaw, learned_section
from bowden.report.page import Section, figure, page, paragraph, table, tiles
from bowden.report.rendering import LawRun, loops
from bowden.report.words import percent, quantity_with_unit, si

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Step:
    """One round: what the drive rendered with the model that it had, and what that showed.

    The last may be without a diagnosis: it shows what the last model renders.
    """

    run: LawRun
    diagnosis: Diagnosis | None = None


def improvement_report(
    steps: Sequence[Step],
    tunnel: PrescribedTunnel,
    settle_s: float,
    *,
    rig: str,
    finding: str,
    hidden: HiddenLaw | None = None,
) -> str:
    """Make the page.

    Parameters
    ----------
    steps : sequence of Step
        At least one, the first with its diagnosis.
    tunnel : PrescribedTunnel
    settle_s : float, s
        Left out of figures and plots at the start of each run.
    rig : str
        What was measured, in words.
    finding : str
        How it ended.
    hidden : HiddenLaw, optional
        The law that a simulated rig really has, drawn beside the learned one.

    Returns
    -------
    str
        A self-contained HTML document.
    """
    every = [one.diagnosis for one in steps if one.diagnosis is not None]
    learned = next((one for one in every if one.learned is not None), None)
    return page(
        title="The model, improved while the drive works",
        subtitle=f"Measured on {rig} · the first {settle_s:g} s of each run are left out",
        verdict=finding[0].upper() + finding[1:],
        sections=[
            Section("", [tiles(_tiles(steps))]),
            Section(
                "The tunnel, round by round",
                [
                    paragraph(
                        "Orange: the torque that is to arrive at the load. Blue: what the load "
                        "cell read while the drive compensated with the model that it had in that "
                        "round. A perfect model would lay blue on orange."
                    ),
                    figure(loops([one.run for one in steps], tunnel, settle_s), "improved-loops"),
                ],
            ),
            Section("What each round found", [_rounds(steps)]),
            *(learned_section(learned, hidden) if learned is not None else []),
        ],
        facts={
            "recordings": ", ".join(one.run.file for one in steps),
            "made with": f"bowden {version('bowden')}, Python {platform.python_version()}",
        },
    )


def _tiles(steps: Sequence[Step]) -> list[tuple[str, str]]:
    first, last = steps[0], steps[-1]
    gap = [one.diagnosis for one in steps if one.diagnosis is not None][-1].gap
    begun = first.run.figures.rms_error_nm
    found = [(si(begun, "N m"), "rendering error in round 1 (RMS)")]
    if len(steps) > 1:
        now = last.run.figures.rms_error_nm
        found.append((si(now, "N m"), f"in round {len(steps)}"))
        found.append((percent(now / begun if begun else None), "of it left"))
    found.append((quantity_with_unit(gap.quantity, gap.after), "what the model leaves unexplained"))
    found.append((quantity_with_unit(gap.quantity, gap.noise_floor), "noise floor of these data"))
    return found


def _rounds(steps: Sequence[Step]) -> str:
    rows = []
    for number, (run, diagnosis) in enumerate(((s.run, s.diagnosis) for s in steps), 1):
        if diagnosis is None:
            error = si(run.figures.rms_error_nm, "N m")
            rows.append([f"round {number}: rendered with that", error, "–", "–", "–"])
            continue
        gap = diagnosis.gap
        what = [one.title for one in diagnosis.effects]
        if diagnosis.learned is not None:
            what = [law_in_words(diagnosis.learned)]
        said = diagnosis.verdict.replace("_", " ")
        rows.append(
            [
                f"round {number}: {said}" + (f", {' or '.join(what)}" if what else ""),
                si(run.figures.rms_error_nm, "N m"),
                quantity_with_unit(gap.quantity, gap.before),
                quantity_with_unit(gap.quantity, gap.after),
                quantity_with_unit(gap.quantity, gap.noise_floor),
            ]
        )
    header = ("verdict", "rendering error", "gap, model it had", "with what was found", "floor")
    return table(header, rows)
