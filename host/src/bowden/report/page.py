"""The frame of every report: one HTML file that opens anywhere, prints, and loads nothing.

Knows HTML and nothing of transmissions. `comparison` fills it with words, tables and plots.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import plotly.graph_objects as go
import plotly.io
from plotly.offline import get_plotlyjs

_STYLE = """
:root { --ink: #1a1a1a; --soft: #5c6066; --line: #dfe2e6; --paper: #ffffff; --blue: #0072b2; }
* { box-sizing: border-box; }
body { margin: 0; background: #f4f5f7; color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
main { max-width: 1020px; margin: 0 auto; padding: 48px 56px 40px; background: var(--paper); }
h1 { font-size: 26px; line-height: 1.25; font-weight: 650; margin: 0 0 4px; }
h2 { font-size: 20px; font-weight: 620; margin: 44px 0 6px; }
h3 { font-size: 16px; font-weight: 620; margin: 30px 0 2px; }
p { margin: 6px 0 12px; max-width: 46em; }
.subtitle { color: var(--soft); margin-bottom: 24px; max-width: none; }
.verdict { font-size: 19px; line-height: 1.5; border-left: 4px solid var(--blue);
  padding: 4px 0 4px 18px; margin: 20px 0 24px; max-width: none; }
table { border-collapse: collapse; width: 100%; font-size: 14px; margin: 12px 0 20px;
  font-variant-numeric: tabular-nums; }
th { text-align: right; font-weight: 600; color: var(--soft); border-bottom: 1.5px solid var(--ink);
  padding: 6px 0 6px 14px; vertical-align: bottom; }
td { text-align: right; border-bottom: 1px solid var(--line); padding: 6px 0 6px 14px;
  white-space: nowrap; }
th:first-child, td:first-child { text-align: left; padding-left: 0; white-space: normal;
  overflow-wrap: anywhere; }
figure { margin: 6px 0 0; }
.tiles { display: flex; flex-wrap: wrap; gap: 12px; margin: 0 0 8px; }
.tiles div { flex: 1 1 150px; border: 1px solid var(--line); border-radius: 8px;
  padding: 12px 16px; }
.tiles b { display: block; font-size: 21px; font-weight: 620; line-height: 1.3;
  font-variant-numeric: tabular-nums; white-space: nowrap; }
.tiles span { color: var(--soft); font-size: 13px; line-height: 1.35; display: block; }
ul { margin: 6px 0 12px; padding-left: 1.3em; max-width: 46em; }
.command { white-space: pre-wrap; border-left: 3px solid var(--blue); }
details { margin: 12px 0; }
summary { cursor: pointer; color: var(--soft); }
pre { background: #f7f8f9; padding: 14px 18px; font-size: 13px; line-height: 1.45;
  overflow-x: auto; }
footer { margin-top: 48px; border-top: 1px solid var(--line); padding-top: 14px;
  color: var(--soft); font-size: 13px; }
footer dl { display: grid; grid-template-columns: max-content 1fr; gap: 2px 18px; margin: 0; }
footer dt { font-weight: 600; }
footer dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 700px) { main { padding: 24px 18px; } }
@media print { body { background: none; } main { max-width: none; padding: 0; }
  figure, table { break-inside: avoid; } .modebar, details { display: none !important; } }
"""

_CONFIG = {"displaylogo": False, "responsive": True, "displayModeBar": False}


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Parameters
    ----------
    title : str
        Empty: no heading.
    body : sequence of str
        HTML from `paragraph`, `table`, `listing`, `figure` and the like, in order.
    level : int, default 2
        2 or 3, the heading's rank.
    """

    title: str
    body: Sequence[str]
    level: int = 2


def paragraph(text: str) -> str:
    """Return plain text as a paragraph."""
    return f"<p>{escape(text)}</p>"


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table; the first column is text, the others are aligned as numbers."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def folded(summary: str, html: str) -> str:
    """Return HTML that is folded away under its summary."""
    return f"<details><summary>{escape(summary)}</summary>{html}</details>"


def listing(summary: str, text: str) -> str:
    """Return text in fixed pitch, folded away under its summary."""
    return folded(summary, f"<pre>{escape(text)}</pre>")


def tiles(figures: Sequence[tuple[str, str]]) -> str:
    """Return a row of large figures, each (figure, label)."""
    cells = "".join(
        f"<div><b>{escape(value)}</b><span>{escape(label)}</span></div>" for value, label in figures
    )
    return f'<div class="tiles">{cells}</div>'


def items(texts: Sequence[str]) -> str:
    """Return texts as a list of points."""
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in texts)}</ul>"


def command(line: str) -> str:
    """Return a command line to copy."""
    return f'<pre class="command">{escape(line)}</pre>'


def figure(plot: go.Figure, name: str) -> str:
    """Return a plot.

    Parameters
    ----------
    plot : plotly Figure
    name : str
        Unique on the page; letters, digits and hyphens.
    """
    drawn = plotly.io.to_html(
        plot, include_plotlyjs=False, full_html=False, div_id=name, config=_CONFIG
    )
    return f"<figure>{drawn}</figure>"


def page(
    title: str, subtitle: str, verdict: str, sections: Sequence[Section], facts: Mapping[str, str]
) -> str:
    """Return the whole HTML document, with the plotting library inside.

    Parameters
    ----------
    title, subtitle, verdict : str
        Plain text; the verdict stands out under the title.
    sections : sequence of Section
    facts : mapping of str to str
        Files, versions, hashes: the small print at the end.
    """
    body = "".join(f"<section>{_heading(part)}{''.join(part.body)}</section>" for part in sections)
    small_print = "".join(
        f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts.items()
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE}</style>"
        f"<script>{get_plotlyjs()}</script></head>\n<body><main>"
        f'<h1>{escape(title)}</h1><p class="subtitle">{escape(subtitle)}</p>'
        f'<p class="verdict">{escape(verdict)}</p>{body}'
        f"<footer><dl>{small_print}</dl></footer></main></body></html>\n"
    )


def _heading(part: Section) -> str:
    return f"<h{part.level}>{escape(part.title)}</h{part.level}>" if part.title else ""
