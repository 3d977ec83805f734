"""The diagnosis page: what is missing, how that is known, and what to do next.

Takes a `Diagnosis`, returns HTML text; who calls it writes the file. Plots come from
`diagnosis_plots`, the frame from `page`. In the order in which a reader asks: is something missing,
what, where does it show, how much smaller is the gap, what else was tried, can the data be trusted.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

from bowden.counted import counted
from bowden.diagnosis.result import Diagnosis, NamedEffect, Series, Value
from bowden.digits import interval
from bowden.estimation.gap import Gap
from bowden.model import format_model
from bowden.model.effects import CATALOGUE
from bowden.report import diagnosis_plots as plots
from bowden.report.evidence import evidence_sections
from bowden.report.learned_law import learned_section
from bowden.report.page import (
    Section,
    command,
    figure,
    items,
    listing,
    page,
    paragraph,
    table,
    tiles,
)
from bowden.report.words import NAMES, explanation_of, percent, quantity_with_unit, title_of

POINTS_A_TRACE = 5000
DETAILED = 4  # recordings that get plots
PLACES = 8
LEAST_SHOWN = 0.01  # of probability
TITLES = {
    "named": "What the model lacks",
    "complete": "The model explains these recordings",
    "unlisted": "An effect outside the catalogue is missing",
    "ambiguous": "More than one explanation",
    "insufficient_excitation": "These recordings would show no effect",
    "bad_data": "These data cannot be trusted",
}


def diagnosis_report(diagnosis: Diagnosis, facts: Mapping[str, str] | None = None) -> str:
    """Make the page.

    Parameters
    ----------
    diagnosis : Diagnosis
    facts : mapping of str to str, optional
        More lines for the small print: model file, hashes, what else the caller knows.

    Returns
    -------
    str
        A self-contained HTML document of less than 8 MB.
    """
    sections = [
        Section("", [tiles(_tiles(diagnosis))]),
        *_stops(diagnosis),
        *_budget(diagnosis),
        *learned_section(diagnosis),
        *_effects(diagnosis),
        *_before_and_after(diagnosis),
        *_where(diagnosis),
        *evidence_sections(diagnosis),
        *_next(diagnosis),
        *_data(diagnosis),
        Section(
            "The model",
            [listing("model file, calibrated, with its effects", format_model(diagnosis.model))],
        ),
    ]
    return page(
        title=TITLES[diagnosis.verdict],
        subtitle=_subtitle(diagnosis),
        verdict=diagnosis.sentence,
        sections=sections,
        facts={**_facts(diagnosis), **(facts or {})},
    )


def _subtitle(diagnosis: Diagnosis) -> str:
    of = _quantity_series(diagnosis, diagnosis.gap.quantity)
    duration = sum(float(one.time_s[-1] - one.time_s[0]) for one in of)
    recordings = counted(len(of), "recording", "recordings")
    names = " and ".join(NAMES[gap.quantity] for gap in diagnosis.gaps)
    return f"{recordings}, {duration:.0f} s in all · {diagnosis.mode.value} mode: {names} judged"


def _quantity_series(diagnosis: Diagnosis, quantity: str) -> list[Series]:
    return [one for one in diagnosis.series if one.quantity == quantity]


def _tiles(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return the figures that one looks for first, with their labels."""
    gap = diagnosis.gap
    name = NAMES[gap.quantity]
    found = [(_amount(gap, gap.before), f"{name} gap, calibrated model")]
    if diagnosis.effects or diagnosis.learned:
        what = "with the effect" + _plural(diagnosis.effects)
        found.append((_amount(gap, gap.after), "with the law" if diagnosis.learned else what))
    found.append((_amount(gap, gap.noise_floor), "noise floor of these data"))
    if gap.noise_floor > 0.0:
        found.append((f"{gap.after / gap.noise_floor:.2f} ×", "gap after, in noise floors"))
    if diagnosis.verdict == "named":
        found.append((percent(min(one.confidence for one in diagnosis.effects)), "confidence"))
    return found


def _amount(gap: Gap, value: float) -> str:
    return quantity_with_unit(gap.quantity, value)


def _plural(things: tuple[object, ...]) -> str:
    return "s" if len(things) > 1 else ""


def _stops(diagnosis: Diagnosis) -> list[Section]:
    """Show first the faults that put all other results in doubt."""
    stops = [one.text for one in diagnosis.quality if one.severity == "stop"]
    return [Section("Check this first", [items(stops)])] if stops else []


def _budget(diagnosis: Diagnosis) -> list[Section]:
    """Show where the gap goes, how sure the explanation is, and what to do next."""
    if not diagnosis.budget:
        return []
    body = [figure(plots.waterfall(diagnosis.budget, diagnosis.gap.quantity), "waterfall")]
    odds = [
        [explanation_of(names), percent(share)]
        for names, share in diagnosis.odds.items()
        if share >= LEAST_SHOWN
    ]
    body.append(table(["explanation", "probability"], odds))
    if diagnosis.next_command:
        body += [paragraph("To type next:"), command(diagnosis.next_command)]
    return [Section("Where the gap goes", body)]


def _effects(diagnosis: Diagnosis) -> list[Section]:
    found = []
    tie = diagnosis.verdict == "ambiguous"
    for one in diagnosis.effects:
        effect = CATALOGUE[one.name]
        place = f", at the {one.variant}" if one.variant else ""
        body = [
            paragraph(f"Law: {effect.law}. It shows as: {effect.signature}."),
            table(
                ["parameter", "value", "95 % interval", "unit", "plausible"],
                [_parameter_row(one, name, value) for name, value in one.parameters.items()],
            ),
        ]
        alike = _confused(diagnosis, one.name)
        if alike:
            body.append(paragraph(alike))
        share = f" ({percent(one.confidence)})" if tie else ""
        found.append(Section(f"{effect.title}{place}{share}", body, 3 if tie else 2))
    if tie:
        text = "Each of these explains the recordings as well as the others."
        return [Section("The explanations", [paragraph(text)]), *found]
    return found


def _parameter_row(one: NamedEffect, name: str, value: Value) -> list[str]:
    known = {p.name: p for p in CATALOGUE[one.name].parameters}
    plausible = f"{known[name].low:.3g} .. {known[name].high:.3g}" if name in known else ""
    meaning = f"{known[name].meaning} ({name})" if name in known else name
    return [
        meaning,
        f"{value.value:.4g}",
        interval(value.low, value.high),
        value.unit,
        plausible,
    ]


def _confused(diagnosis: Diagnosis, name: str) -> str:
    """Return the effects that it is mistaken for: with these data, and in general."""
    here = sorted(
        {title_of(x) for group in diagnosis.cannot_tell_apart if name in group for x in group}
        - {title_of(name)}
    )
    usual = [title_of(x) for x in CATALOGUE[name].confused_with if x in CATALOGUE]
    separated = [x for x in usual if x not in here]
    text = ""
    if here:
        text += f"These recordings do not distinguish it from {_series_of(here)}. "
    if separated:
        text += f"Often mistaken for {_series_of(separated)}; these recordings distinguish them."
    return text.strip()


def _series_of(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


def _before_and_after(diagnosis: Diagnosis) -> list[Section]:
    rows = [
        [
            NAMES[gap.quantity],
            _amount(gap, gap.before),
            _amount(gap, gap.after),
            _amount(gap, gap.noise_floor),
            f"{gap.after / gap.noise_floor:.2f}" if gap.noise_floor > 0.0 else "–",
        ]
        for gap in diagnosis.gaps
    ]
    body = [
        paragraph(
            "Each stretch is predicted by a fit that has not seen it. The noise floor is the "
            "gap of a correct model: encoder counts, sensor noise and the simulator's own error."
        ),
        table(["", "calibrated", "with the effect", "noise floor", "gap, in noise floors"], rows),
    ]
    improved = bool(diagnosis.effects) or diagnosis.learned is not None
    if not improved:
        body[1] = table(
            ["", "calibrated", "noise floor", "in floors"],
            [[row[0], row[1], row[3], row[4]] for row in rows],
        )
    for number, one in enumerate(_quantity_series(diagnosis, diagnosis.gap.quantity)[:DETAILED], 1):
        plot = plots.before_and_after(one, POINTS_A_TRACE, improved=improved)
        if len(diagnosis.series) > len(diagnosis.gaps):
            body.append(paragraph(Path(one.source).name))
        body.append(figure(plot, f"series-{number}"))
    return [Section("Before and after", body)] if diagnosis.series else []


def _where(diagnosis: Diagnosis) -> list[Section]:
    body = []
    if diagnosis.where_map is not None:
        body += [
            paragraph(
                "The calibrated model's disagreement, in units of the noise, wherever the rig has "
                "been. Blue: more was measured than simulated; red: less."
            ),
            figure(plots.residual_map(diagnosis.where_map), "map"),
        ]
    places = [one for one in diagnosis.where if one.significant][:PLACES]
    if places:
        body += [
            paragraph(
                "Conditions that hold more of the disagreement than chance would put there (tested "
                "on blocks longer than the disagreement's memory)."
            ),
            figure(plots.places(places), "places"),
        ]
    elif diagnosis.where:
        body.append(paragraph("No condition holds more of it than chance would put there."))
    return [Section("Where it shows", body)] if body else []


def _next(diagnosis: Diagnosis) -> list[Section]:
    if not diagnosis.next_experiment:
        return []
    body = [paragraph(diagnosis.next_experiment)]
    if diagnosis.next_command:
        body.append(command(diagnosis.next_command))
    return [Section("Next experiment", body)]


def _data(diagnosis: Diagnosis) -> list[Section]:
    warnings = [one.text for one in diagnosis.quality if one.severity != "stop"]
    body = [items(warnings)] if warnings else [paragraph("No fault was found in the recordings.")]
    if diagnosis.excitation:
        rows = [
            [one.meaning, f"{one.value:.3g} {one.unit}", f"{one.needed:.3g}", _mark(one.present)]
            for one in diagnosis.excitation
        ]
        body.append(table(["what the recordings contain", "", "needed", ""], rows))
    if diagnosis.notes:
        body.append(items(list(diagnosis.notes)))
    return [Section("The data", body)]


def _mark(present: bool) -> str:
    return "✓" if present else "too little"


def _facts(diagnosis: Diagnosis) -> dict[str, str]:
    names = dict.fromkeys(one.source for one in diagnosis.series)
    return {
        "recordings": ", ".join(Path(name).name for name in names),
        "seed": str(diagnosis.seed),
        "made with": f"bowden {version('bowden')}, Python {platform.python_version()}",
    }
