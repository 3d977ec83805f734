"""The comparison report: what was measured beside what the model says, on one page.

Takes a `Comparison`, returns HTML text; who calls it writes the file. Words come from `words`,
plots from `plots`, the frame from `page`.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.counted import counted
from bowden.diagnosis.compare import Comparison, Figures, RecordingComparison
from bowden.model import format_model
from bowden.recording.recording import Recording
from bowden.report import plots
from bowden.report.page import Section, figure, listing, page, paragraph, table
from bowden.report.words import NAMES, percent, quantity_with_unit, si, verdict, whereabouts

POINTS_A_TRACE = 5000
POINTS_A_PAGE = 24_000  # at about 35 characters each, keeps the page below 1 MB
DETAILED = 3  # recordings that get plots; the others are in the table
_TRACES_A_RECORDING = 19


def comparison_report(comparison: Comparison, facts: Mapping[str, str] | None = None) -> str:
    """Make the page.

    Parameters
    ----------
    comparison : Comparison
    facts : mapping of str to str, optional
        More lines for the small print: model file, hashes, what else the caller knows.

    Returns
    -------
    str
        A self-contained HTML document of less than 1 MB.
    """
    worst_first = sorted(comparison.recordings, key=lambda one: -one.figures.gap)
    detailed = worst_first[:DETAILED]
    points = min(POINTS_A_TRACE, POINTS_A_PAGE // (_TRACES_A_RECORDING * len(detailed)))
    sections = [_overview(comparison)]
    for number, one in enumerate(detailed, start=1):
        sections += _details(comparison, one, number, points, alone=len(detailed) == 1)
    sections.append(_where(comparison))
    sections.append(Section("The model", [listing("model file", format_model(comparison.model))]))
    return page(
        title="Measured and simulated",
        subtitle=_subtitle(comparison),
        verdict=f"{verdict(comparison)} {whereabouts(comparison)}",
        sections=sections,
        facts={**_facts(comparison), **(facts or {})},
    )


def _subtitle(comparison: Comparison) -> str:
    duration = sum(float(np.ptp(one.recording.time_s)) for one in comparison.recordings)
    recordings = counted(len(comparison.recordings), "recording", "recordings")
    lost = [one.recording.metadata.get("frames_lost", "") for one in comparison.recordings]
    losses = f", {sum(map(int, lost))} frames lost" if all(map(str.isdigit, lost)) else ""
    return (
        f"{recordings}, {duration:.0f} s in all{losses} · {comparison.mode.value} mode: "
        f"{NAMES[comparison.quantity]} is predicted and compared"
    )


def _overview(comparison: Comparison) -> Section:
    header = [
        "",
        "gap (RMS)",
        "of peak",
        "largest",
        "mean",
        "first cycle",
        "later",
        "noise floor",
        NAMES[comparison.other_quantity],
    ]
    rows = [
        [
            _name(one.recording),
            *_row(one.figures),
            quantity_with_unit(comparison.other_quantity, one.other_gap),
        ]
        for one in comparison.recordings
    ]
    if len(rows) > 1:
        rows.append(["all", *_row(comparison.figures), ""])
    return Section(
        "Figures",
        [
            table(header, rows),
            paragraph(
                f"Gap: measured minus simulated {NAMES[comparison.quantity]}. Friction depends "
                "on the earlier motion, so the first cycle is apart. The noise floor is estimated "
                "from the recording; no model can come below it. The last column is the gap in the "
                "other predicted quantity."
            ),
        ],
    )


def _where(comparison: Comparison) -> Section:
    text = (
        "Outward is away from the middle of the motion. A blue bar longer than the grey one marks "
        "a condition in which the model is worse than elsewhere."
    )
    return Section("Where the gap is", [paragraph(text), figure(plots.where(comparison), "where")])


def _row(figures: Figures) -> list[str]:
    return [
        si(figures.gap, "N m"),
        percent(figures.relative_gap),
        si(figures.peak, "N m"),
        si(figures.bias, "N m"),
        si(figures.first_cycle, "N m"),
        si(figures.steady, "N m"),
        si(figures.noise_floor, "N m"),
    ]


def _details(
    comparison: Comparison, one: RecordingComparison, number: int, points: int, *, alone: bool
) -> list[Section]:
    level = 2 if alone else 3

    def title(text: str) -> str:
        return text if alone else f"{_name(one.recording)}: {text[0].lower()}{text[1:]}"

    fit = one.velocity_fit
    prescribed = prescribed_load_torque(one.recording, comparison.model.transmission.pulley_ratio)
    if comparison.quantity != "load_torque_nm":
        prescribed = None
    slack = float(np.mean(one.trajectory.slack != 0))
    pauses = (
        [
            paragraph(
                f"The recording has {len(one.time_gaps)} gaps in time, longest "
                f"{max(length for _, length in one.time_gaps):.3g} s; the model bridges them."
            )
        ]
        if one.time_gaps
        else []
    )
    return [
        Section(
            title("Torque against angle"),
            [
                paragraph(
                    "The area of the loop is the work that the transmission takes in a cycle. "
                    "The dashed curve is what a transmission without friction would show; where "
                    "the simulated curve leaves the measured one, the model lacks something."
                ),
                figure(plots.loop(comparison, one, prescribed, points), f"loop-{number}"),
            ],
            level,
        ),
        Section(
            title("Over time"),
            [*pauses, figure(plots.over_time(comparison, one, points), f"time-{number}")],
            level,
        ),
        Section(
            title("Residual against velocity"),
            [
                paragraph(
                    f"A straight line takes {percent(fit.share_explained)} of the residual's "
                    f"variance, with a slope of {si(fit.slope, 'N m s/rad')}. A clear slope points "
                    "to viscous friction, a step at zero to a wrong friction or pretension, "
                    "two branches to inertia or delay."
                ),
                figure(plots.against_velocity(one, min(points, 4000)), f"velocity-{number}"),
            ],
            level,
        ),
        Section(
            title("Tensions in the model"),
            [
                paragraph(
                    f"A cable is slack in {percent(slack)} of the time; then the other one "
                    "carries the torque alone and friction follows its tension."
                    if slack > 0.0
                    else "No cable goes slack: the friction of the pair stays constant."
                ),
                figure(plots.tensions(one, points), f"tensions-{number}"),
            ],
            level,
        ),
    ]


def prescribed_load_torque(recording: Recording, ratio: float) -> NDArray[np.float64] | None:
    """Torque that the recording's tunnel, eq. (7), asks for at the load without losses.

    Parameters
    ----------
    recording : Recording
        Its metadata names the tunnel: `tunnel_half_width_rad`, `tunnel_stiffness_nm_per_rad`,
        `tunnel_torque_limit_nm`, and `tunnel_angle_source` (load, motor, scaled-motor).
    ratio : float
        Load pulley radius over motor pulley radius.

    Returns
    -------
    ndarray of shape (n,), N m, or None
        None when the metadata does not name a tunnel.
    """
    names = ("tunnel_half_width_rad", "tunnel_stiffness_nm_per_rad", "tunnel_torque_limit_nm")
    try:
        half_width, stiffness, limit = (float(recording.metadata[name]) for name in names)
    except (KeyError, ValueError):
        return None
    angle = {
        "motor": recording.motor_angle_rad,
        "scaled-motor": recording.motor_angle_rad / ratio,
    }.get(recording.metadata.get("tunnel_angle_source", "load"), recording.load_angle_rad)
    beyond = np.maximum(np.abs(angle) - half_width, 0.0)
    return np.asarray(-np.sign(angle) * np.minimum(stiffness * beyond, limit) * ratio)


def _name(recording: Recording) -> str:
    return Path(recording.source).name


def _facts(comparison: Comparison) -> dict[str, str]:
    facts = {}
    for one in comparison.recordings[:DETAILED]:
        metadata = "; ".join(f"{key}: {value}" for key, value in one.recording.metadata.items())
        facts[_name(one.recording)] = metadata or "no metadata"
    facts["made with"] = f"bowden {version('bowden')}, Python {platform.python_version()}"
    return facts
