"""Figures and results in words, for the page and for the terminal alike.

Pure functions; `page`, `comparison` and the command line use them so that both say the same.
"""

from __future__ import annotations

import math

from bowden.diagnosis.compare import Comparison
from bowden.diagnosis.odds import NOTHING, UNLISTED
from bowden.model.effects import CATALOGUE
from bowden.recording.channels import MAIN_CHANNELS, channel

NAMES = {name: channel(name).words for name in MAIN_CHANNELS}
_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def quantity_with_unit(column: str, value: float | None) -> str:
    """Return a column's value in words: ``("load_torque_nm", 0.0521)`` gives ``52.1 mN m``."""
    return si(value, channel(column).unit)


def si(value: float | None, unit: str) -> str:
    """Three significant digits with an SI prefix that keeps the number between 1 and 1000.

    Parameters
    ----------
    value : float or None
        In the plain unit; None gives a dash.
    unit : str
        ``"N m"``, ``"rad"``, ...

    Returns
    -------
    str
    """
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0.0:
        return f"0 {unit}"
    scale, prefix = next(((s, p) for s, p in _PREFIXES if abs(value) >= 0.9995 * s), _PREFIXES[-1])
    return f"{_digits(value / scale, 3)} {prefix}{unit}"


def percent(share: float | None) -> str:
    """Return a share as a percentage of two significant digits; None gives a dash."""
    if share is None or not math.isfinite(share):
        return "–"
    return f"{_digits(100.0 * share, 2)} %"


def verdict(comparison: Comparison) -> str:
    """Say in one or two sentences how far the model is from what was measured."""
    figures = comparison.figures
    name = NAMES[comparison.quantity]
    gap = si(figures.gap, "N m")
    text = f"The model misses the measured {name} by {gap} RMS"
    if figures.relative_gap is not None:
        text += f", {percent(figures.relative_gap)} of its {si(figures.full_scale, 'N m')} peak"
    if figures.noise_floor > 0.0:
        ratio = figures.gap / figures.noise_floor
        floor = si(figures.noise_floor, "N m")
        if ratio <= 1.1:
            return f"{text}: within the noise floor of {floor}."
        text += f": {_digits(ratio, 2)} times the noise floor of {floor}"
    return f"{text}."


def constants(comparison: Comparison) -> str:
    """Return one sentence on what of the gap is constant or proportional; empty where little is."""
    parts = []
    for step in comparison.budget:
        if step.value is None or step.share < 0.05:
            continue
        if step.step.startswith("constant"):
            parts.append(
                f"a constant of {si(step.value, 'N m')} explains {percent(step.share)} of it"
            )
        else:
            parts.append(
                f"a proportion of {percent(abs(step.value))} explains {percent(step.share)}"
            )
    if not parts:
        return ""
    text = ", ".join(parts)
    return f"Of the squared gap, {text.removesuffix(' of it')}."


def whereabouts(comparison: Comparison) -> str:
    """Return one sentence on where most of the gap is; empty when there is no gap."""
    if not comparison.where or comparison.figures.gap == 0.0:
        return ""
    worst = comparison.where[0]
    return (
        f"The largest part of what varies, {percent(worst.share_of_gap)}, arises in "
        f"{percent(worst.share_of_time)} of the time: {worst.condition}."
    )


def _digits(value: float, digits: int) -> str:
    """Return fixed-point text of so many significant digits, at least the integer part."""
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return f"{value:.{decimals}f}".replace("-", "−")


def title_of(name: str) -> str:
    """Return the title of an effect within a sentence."""
    title = CATALOGUE[name].title if name in CATALOGUE else name.replace("_", " ")
    return title[0].lower() + title[1:]


def explanation_of(names: str) -> str:
    """Return an explanation of the posterior in words."""
    if names == NOTHING:
        return "no effect is missing"
    if names == UNLISTED:
        return "an effect outside the catalogue"
    return " and ".join(title_of(name) for name in names.split(" + "))
