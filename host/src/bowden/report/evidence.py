"""How the answer of a diagnosis is known: its rivals, its validation, its calibration.

Takes a `Diagnosis`, returns sections of the page that `report.diagnosis` makes.
"""

from __future__ import annotations

from bowden.diagnosis.result import Diagnosis
from bowden.digits import interval
from bowden.report import diagnosis_plots as plots
from bowden.report.page import Section, figure, folded, items, paragraph, table
from bowden.report.words import NAMES, explanation_of, percent, quantity_with_unit, title_of


def evidence_sections(diagnosis: Diagnosis) -> list[Section]:
    """Return the sections, of those that the diagnosis has something for."""
    return [*_ranking(diagnosis), *_validation(diagnosis), *_calibration(diagnosis)]


def _ranking(diagnosis: Diagnosis) -> list[Section]:
    if not diagnosis.ranking:
        return []
    rows = [
        [
            title_of(one.name) + (f" ({one.variant})" if one.variant else ""),
            f"{one.score:.1f}",
            quantity_with_unit(diagnosis.gap.quantity, one.held_out_gap),
        ]
        for one in diagnosis.ranking
    ]
    groups = [" = ".join(map(title_of, group)) for group in diagnosis.cannot_tell_apart]
    alike = (
        [paragraph("What these recordings cannot separate:"), items(groups[:12])] if groups else []
    )
    named = {one.name for one in diagnosis.effects}
    return [
        Section(
            "Candidates",
            [
                paragraph(
                    "Every effect of the catalogue was screened; the most promising were fitted "
                    "together with the calibration. The gain is that of the best set that holds "
                    "it: how much more likely it makes stretches that its fit has not seen than "
                    "the calibrated model does (natural logarithm, all stretches together)."
                ),
                figure(plots.ranking(diagnosis.ranking, named), "ranking"),
                *alike,
                folded("all candidates", table(["", "gain", "held-out gap"], rows)),
            ],
        )
    ]


def _validation(diagnosis: Diagnosis) -> list[Section]:
    """Show what each split of the data says by itself, and whether residuals are noise."""
    found = diagnosis.validation
    if found is None:
        return []
    splits = [
        [one.held_out, explanation_of(one.explanation), percent(one.probability)]
        for one in found.splits
    ]
    kinds = (("itself", found.whiteness), ("an input", found.independence))
    rows = [
        [NAMES[one.quantity], f"{kind}: {one.by}", f"{one.value:+.2f}", f"{one.p_value:.2g}"]
        for kind, every in kinds
        for one in every
        if one.by
    ]
    return [
        Section(
            "Validation",
            [
                paragraph(
                    "Each split is predicted by fits that have not seen it, and says by itself "
                    "which explanation is the likeliest. Residuals of a valid model are white and "
                    "independent of the inputs."
                ),
                table(["held out", "likeliest explanation", "probability"], splits),
                paragraph(found.text),
                folded(
                    "largest correlations of the residuals",
                    table(["residual of", "with", "correlation", "p"], rows),
                ),
            ],
        )
    ]


def _calibration(diagnosis: Diagnosis) -> list[Section]:
    if not diagnosis.calibration:
        return []
    rows = [
        [
            one.path,
            f"{one.before:.4g}",
            f"{one.value:.4g}",
            "–" if one.low is None or one.high is None else interval(one.low, one.high),
            "to its bound"
            if one.at_bound
            else (f"{one.change_in_sigmas:+.1f} σ" if one.change_in_sigmas is not None else "–"),
        ]
        for one in diagnosis.calibration
    ]
    return [
        Section(
            "Calibration",
            [
                paragraph(
                    "What the model file gives a tolerance was moved first, held back by it, so "
                    "that a miscalibration is not called a missing effect. More than 3 σ would be "
                    "a finding of its own."
                ),
                figure(plots.calibration(diagnosis.calibration), "calibration"),
                table(["", "file", "now", "95 % interval", "moved"], rows),
            ],
        )
    ]
