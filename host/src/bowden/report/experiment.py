"""The page of one of the paper's experiments: finding, figures, and plots beside each other.

Takes an `Experiment`, returns HTML text. Plots come from `experiment_plots`, the frame from `page`.
"""

from __future__ import annotations

import platform
from importlib.metadata import version

from bowden.model import format_model
from bowden.model.experiments import Experiment
from bowden.model.measures import CycleMeasures
from bowden.report import experiment_plots as plots
from bowden.report.page import Section, figure, listing, page, paragraph, table
from bowden.report.words import percent, si

PRESET_WORDS = {"printed": "as printed", "transmitting": "where torque arrives"}
_HEADER_LOCKED = (
    "",
    "cycle",
    "efficiency",
    "load torque, p-p",
    "dead zone",
    "loop area, motor",
    "slack",
)
_HEADER_MOVING = (
    "",
    "cycle",
    "motor's share",
    "load torque, p-p",
    "backlash",
    "loop area, load",
    "lost",
    "slack",
)


def experiment_report(experiment: Experiment) -> str:
    """Make the page.

    Parameters
    ----------
    experiment : Experiment

    Returns
    -------
    str
        A self-contained HTML document.
    """
    parts = [experiment] if experiment.beside is None else [experiment, experiment.beside]
    sections = []
    for part in parts:
        if len(parts) > 1:
            sections.append(Section(f"{part.title}, {PRESET_WORDS[part.preset]}", []))
        if part is not experiment:
            sections[-1] = Section(sections[-1].title, [paragraph(part.finding)])
        sections += _SECTIONS[part.name](part, 3 if len(parts) > 1 else 2)
    models = [
        listing(f"model file, {case.label}", format_model(case.model)) for case in experiment.cases
    ]
    sections.append(Section("The models", models))
    return page(
        title=experiment.title,
        subtitle=f"Everything on this page is simulated · preset: {experiment.preset} · "
        f"solver: {', '.join(sorted({case.model.solver for case in experiment.cases}))}",
        verdict=experiment.finding,
        sections=sections,
        facts={"made with": f"bowden {version('bowden')}, Python {platform.python_version()}"},
    )


def figures_table(experiment: Experiment) -> tuple[tuple[str, ...], list[list[str]]]:
    """Return the table of figures, first and steady cycle apart: header and rows."""
    locked = experiment.name in ("1a", "1b")
    row = _locked_row if locked else _moving_row
    rows = [
        [case.label if cycle == "first" else "", cycle, *row(measures)]
        for case in experiment.cases
        for cycle, measures in (("first", case.first), ("steady", case.steady))
    ]
    return (_HEADER_LOCKED if locked else _HEADER_MOVING), rows


def _locked_row(measures: CycleMeasures) -> list[str]:
    return [
        percent(measures.efficiency),
        si(measures.load_torque_pp_nm, "N m"),
        si(measures.dead_zone_nm, "N m"),
        si(measures.motor_loop_j, "J"),
        percent(measures.slack_share),
    ]


def _moving_row(measures: CycleMeasures) -> list[str]:
    return [
        percent(measures.motor_share),
        si(measures.load_torque_pp_nm, "N m"),
        si(measures.backlash_rad, "rad"),
        si(measures.load_loop_j, "J"),
        si(measures.loss_j, "J"),
        percent(measures.slack_share),
    ]


def _figures(experiment: Experiment, level: int) -> Section:
    header, rows = figures_table(experiment)
    return Section("Figures, first cycle and steady cycle apart", [table(header, rows)], level)


def _locked(experiment: Experiment, level: int) -> list[Section]:
    return [
        Section(
            "Motor's loop, and the torque at the load",
            [
                paragraph(
                    "Left: the motor winds up cable that stretches behind its friction. Right: "
                    "the torque at the locked load against the lossless one (orange). A flat line "
                    "means that the motion dies out inside the conduit."
                ),
                figure(
                    plots.locked_load(experiment.cases),
                    f"locked-{experiment.name}-{experiment.preset}",
                ),
            ],
            level,
        ),
        _figures(experiment, level),
    ]


def _tunnel(experiment: Experiment, level: int) -> list[Section]:
    plain, viscous = experiment.cases
    noise = plain.model.document.rig.load_cell_noise_nm
    noise_nm = noise.value if noise else 0.0
    return [
        Section(
            "Tunnel asked for and torque felt",
            [
                paragraph(
                    "Torque that the motor renders, and torque that reaches the operator. "
                    "The area inside is the work that the conduit takes."
                ),
                figure(plots.tunnel_loop(experiment.cases), "tunnel-loop"),
            ],
            level,
        ),
        Section(
            "Over time",
            [figure(plots.over_time(plain, 4.0), "tunnel-time")],
            level,
        ),
        Section(
            "Residual against velocity",
            [
                paragraph(
                    "The rig here is the model with the viscous term plus the load cell's noise of "
                    f"{si(noise_nm, 'N m')}. Left: what a model without the term misses of it. "
                    "Right: the model with the term leaves the noise alone, because this rig "
                    "has nothing else to miss."
                ),
                figure(plots.viscous_residual(viscous, plain, noise_nm), "tunnel-velocity"),
            ],
            level,
        ),
        _figures(experiment, level),
    ]


def _follower(experiment: Experiment, level: int) -> list[Section]:
    return [
        Section(
            "Who overcomes the friction",
            [
                paragraph(
                    "An ideal follower moves one half of the cable and the operator the other: the "
                    "same torque, of opposite sign. A real one lags: the operator moves more."
                ),
                figure(plots.sharing(experiment.cases, 4.0), "sharing"),
            ],
            level,
        ),
        Section(
            "Torque against angle",
            [figure(plots.sharing_loops(experiment.cases), "sharing-loops")],
            level,
        ),
        _figures(experiment, level),
    ]


_SECTIONS = {"1a": _locked, "1b": _locked, "2": _tunnel, "3": _follower}
