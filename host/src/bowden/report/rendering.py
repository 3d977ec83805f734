"""The page of the tunnel experiment on a drive: Fig. 6 for each compensation law, and the figures.

Takes the runs of one experiment, returns HTML text. The frame comes from `page`.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from bowden.diagnosis.rendering import PrescribedTunnel, Rendering, stretch_of
from bowden.recording.recording import Recording
from bowden.report.canvas import PRESCRIBED, SIMULATED, draw, dress, legend_above
from bowden.report.page import Section, figure, page, paragraph, table
from bowden.report.words import percent, si

_POINTS = 2500
_COLUMNS = 2
_ROW_PX = 300


@dataclass(frozen=True)
class LawRun:
    """One law's run.

    Parameters
    ----------
    law : str
        Its word, as commands take it: ``smooth-inverse``.
    recording : Recording
    figures : Rendering
    file : str
        Name of the recording.
    title : str
        What people read.
    """

    law: str
    recording: Recording
    figures: Rendering
    file: str
    title: str


def rendering_report(
    runs: Sequence[LawRun], tunnel: PrescribedTunnel, settle_s: float, rig: str
) -> str:
    """Make the page.

    Parameters
    ----------
    runs : sequence of LawRun
        The one without compensation first.
    tunnel : PrescribedTunnel
    settle_s : float, s
        Left out of figures and plots at the start of each run.
    rig : str
        Which rig, in words.

    Returns
    -------
    str
        A self-contained HTML document.
    """
    header, rows = figures_table(runs)
    return page(
        title="Experiment 2 on the drive: the tunnel, law by law",
        subtitle=f"Measured on {rig} · the first {settle_s:g} s of each run are left out",
        verdict=finding(runs),
        sections=[
            Section(
                "Tunnel wanted and torque felt",
                [
                    paragraph(
                        "Orange: the torque that is to arrive at the load, the tunnel times the "
                        "transmission ratio. Blue: what the load cell read. The area inside the "
                        "blue loop is the work that the conduit takes from the operator."
                    ),
                    figure(loops(runs, tunnel, settle_s), "rendering-loops"),
                ],
            ),
            Section(
                "Figures",
                [
                    table(header, rows),
                    paragraph(
                        "Errors are of the torque at the load against the wanted one. Felt in the "
                        "dead zone: RMS of the torque where none is wanted. The law's share: of "
                        "the time in which the law ran and not a lesser one."
                    ),
                ],
            ),
        ],
        facts={
            "recordings": ", ".join(run.file for run in runs),
            "made with": f"bowden {version('bowden')}, Python {platform.python_version()}",
        },
    )


def figures_table(runs: Sequence[LawRun]) -> tuple[tuple[str, ...], list[list[str]]]:
    """Return header and rows."""
    header = ("law", "RMS error", "of none", "peak error", "felt in dead zone", "lost", "law ran")
    naive = runs[0].figures.rms_error_nm
    rows = [
        [
            run.title,
            si(run.figures.rms_error_nm, "N m"),
            percent(run.figures.rms_error_nm / naive if naive else None),
            si(run.figures.peak_error_nm, "N m"),
            si(run.figures.dead_zone_friction_nm, "N m"),
            si(run.figures.loss_w, "W"),
            percent(run.figures.full_law_share),
        ]
        for run in runs
    ]
    return header, rows


def finding(runs: Sequence[LawRun]) -> str:
    """Say in a sentence what came out."""
    none, *others = runs
    text = (
        f"Without compensation the torque at the load is {si(none.figures.rms_error_nm, 'N m')} "
        "RMS from the wanted one."
    )
    if not others or not none.figures.rms_error_nm:
        return text
    best = min(others, key=lambda run: run.figures.rms_error_nm)
    share = percent(best.figures.rms_error_nm / none.figures.rms_error_nm)
    return (
        f"{text} The best of the others, {best.title}, leaves "
        f"{si(best.figures.rms_error_nm, 'N m')}, {share} of it."
    )


def loops(runs: Sequence[LawRun], tunnel: PrescribedTunnel, settle_s: float) -> go.Figure:
    """Draw wanted and felt torque over the load angle, a panel a law (Fig. 6)."""
    columns = min(_COLUMNS, len(runs))
    alone = len(runs) % columns  # an odd one takes the whole first row: pairs stay side by side
    rows = alone + len(runs) // columns
    whole_row: list[dict[str, int] | None] = [{"colspan": columns}, None]
    plot = make_subplots(
        rows=rows,
        cols=columns,
        specs=[whole_row] * alone + [[{}] * columns] * (rows - alone),
        shared_xaxes=True,
        shared_yaxes=True,
        horizontal_spacing=0.06,
        vertical_spacing=0.24 / (rows + 1),
        subplot_titles=[run.title for run in runs],
    )
    for number, run in enumerate(runs):
        row, col = divmod(number + alone if number else 0, columns)
        taken = stretch_of(run.recording, tunnel, settle_s)
        angle, felt = taken.load_angle_rad, taken.felt_nm
        ends = np.linspace(angle.min(), angle.max(), 401)
        for name, line, curve in (
            ("felt at the load", SIMULATED, (np.degrees(angle), felt)),
            (
                "wanted",
                PRESCRIBED | {"width": 2.2},
                (np.degrees(ends), tunnel.wanted_nm(ends)),
            ),
        ):
            draw(
                plot,
                curve,
                name,
                line,
                points=_POINTS,
                row=row + 1,
                col=col + 1,
                listed=number == 0,
            )
    dress(plot, height=90 + _ROW_PX * rows)
    plot.update_xaxes(title_text="load angle (°)", row=rows)
    if alone and rows > 1:
        plot.update_xaxes(showticklabels=False, row=1)
    plot.update_yaxes(matches="y")  # one scale for all laws: they are compared
    plot.update_yaxes(title_text="load torque (N m)", col=1)
    plot.update_layout(legend=legend_above(1.0 + 40 / (_ROW_PX * rows)), margin={"t": 80})
    return plot
