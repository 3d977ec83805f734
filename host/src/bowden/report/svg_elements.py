"""The smallest parts of a drawing: lines, texts, and colours that a dark page changes."""

# ruff: noqa: ANN401  (plotly is not typed)

from __future__ import annotations

from html import escape
from typing import Any

#: Colours on a light page, and what stands for each on a dark one (contrast above 4.5 to 1).
DARK = {
    "#1a1a1a": "#f0f2f4",
    "#0072b2": "#5db8f0",
    "#e08a00": "#ffb74d",
    "#5c6066": "#aab0b8",
    "#c9cdd2": "#4a5058",
    "#8a6d00": "#e0c050",
    "#7a869a": "#a9b4c8",
    "#b5501b": "#ff9b66",
    "#eef0f2": "#22262b",
    "#dfe3e8": "#2f353c",
}


def colour_of(code: Any, attribute: str) -> str:
    """Return the attributes that give a colour: a class where the dark style has another one."""
    text = str(code)
    if text in DARK:
        return f'class="c{text[1:]}" style="{attribute}:var(--c)"'
    return f'style="{attribute}:{escape(text, quote=True)}"'


def dash_of(pattern: str | None) -> str:
    """Return the attribute of a dash pattern such as ``"6px,3px"``."""
    return f' stroke-dasharray="{pattern.replace("px", "")}"' if pattern else ""


def line_between(kind: str, x1: float, y1: float, x2: float, y2: float) -> str:
    """Return a line of a kind that the style knows: grid, axis."""
    return f'<line class="{kind}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def text_at(kind: str, x: float, y: float, text: str, anchor: str) -> str:
    """Return a text; ``anchor`` says which of its ends is at the place."""
    name = f' class="{kind}"' if kind else ""
    return f'<text{name} x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
