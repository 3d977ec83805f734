"""The frame of every report: one HTML file that opens anywhere, prints, and loads nothing.

Knows HTML and nothing of transmissions. `comparison` fills it with words, tables and plots. Figures
are static SVG (`svg`), drawn once for wide screens and once for phones; a few lines of script
export each as SVG or CSV, and each table as LaTeX. Follows the reader's light or dark setting.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import plotly.graph_objects as go

from bowden.report import svg

_STYLE = """
:root { color-scheme: light dark; --ink: #1a1a1a; --soft: #5c6066; --line: #dfe2e6;
  --paper: #ffffff; --around: #f4f5f7; --blue: #0072b2; }
@media (prefers-color-scheme: dark) { :root { --ink: #f0f2f4; --soft: #aab0b8; --line: #363c44;
  --paper: #16191d; --around: #0d0f12; --blue: #5db8f0; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--around); color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
main { max-width: 1020px; margin: 0 auto; padding: 48px 56px 40px; background: var(--paper); }
h1 { font-size: 26px; line-height: 1.25; font-weight: 650; margin: 0 0 4px; }
h2 { font-size: 20px; font-weight: 620; margin: 44px 0 6px; }
h3 { font-size: 16px; font-weight: 620; margin: 30px 0 2px; }
p { margin: 6px 0 12px; max-width: 46em; }
a { color: var(--blue); }
.subtitle { color: var(--soft); margin-bottom: 24px; max-width: none; }
.verdict { font-size: 19px; line-height: 1.5; border-left: 4px solid var(--blue);
  padding: 4px 0 4px 18px; margin: 20px 0 24px; max-width: none; }
table { border-collapse: collapse; width: 100%; font-size: 14px; margin: 12px 0 20px;
  font-variant-numeric: tabular-nums; }
th { text-align: right; font-weight: 600; color: var(--soft); border-bottom: 1.5px solid var(--ink);
  padding: 6px 0 6px 14px; vertical-align: bottom; }
td { text-align: right; border-bottom: 1px solid var(--line); padding: 6px 0 6px 14px;
  white-space: nowrap; }
th:first-child, td:first-child { text-align: left; min-width: 7em; padding-left: 0;
  white-space: normal; overflow-wrap: anywhere; }
figure { margin: 6px 0 0; }
figcaption { color: var(--soft); font-size: 13px; margin: 2px 0 10px; }
.narrow { display: none; }
.export { display: inline; white-space: nowrap; }
.export button { font: inherit; color: var(--blue); background: none; border: 0; padding: 0 4px;
  text-decoration: underline; cursor: pointer; }
button:focus-visible, summary:focus-visible, .scroll:focus-visible { outline: 2px solid var(--blue);
  outline-offset: 2px; }
.scroll { overflow-x: auto; }
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
pre { background: var(--around); padding: 14px 18px; font-size: 13px; line-height: 1.45;
  overflow-x: auto; }
footer { margin-top: 48px; border-top: 1px solid var(--line); padding-top: 14px;
  color: var(--soft); font-size: 13px; }
footer dl { display: grid; grid-template-columns: max-content 1fr; gap: 2px 18px; margin: 0; }
footer dt { font-weight: 600; }
footer dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 700px) { main { padding: 24px 16px; } .wide { display: none; }
  .narrow { display: block; } h1 { font-size: 22px; } .verdict { font-size: 17px; }
  footer dl { grid-template-columns: 1fr; } }
@media print { body { background: none; } main { max-width: none; padding: 0; }
  figure, table { break-inside: avoid; } .export, details { display: none !important; } }
"""

_WIDE_PX, _NARROW_PX = 908, 358

#: Exports: a figure as SVG with its colours written out, its data as CSV, a table as LaTeX.
_SCRIPT = r"""
function save(name,type,text){const a=document.createElement('a');
a.href=URL.createObjectURL(new Blob([text],{type}));a.download=name;a.click()}
function svgOf(f){const o=f.querySelector('svg'),s=o.cloneNode(true);
const from=[...o.querySelectorAll('*')],to=[...s.querySelectorAll('*')];
from.forEach((e,i)=>{const c=getComputedStyle(e);for(const p of
['fill','stroke','stroke-width','font-size','font-family'])to[i].style[p]=c[p]});
s.setAttribute('xmlns','http://www.w3.org/2000/svg');return s.outerHTML}
function csvOf(f){const d=JSON.parse(f.querySelector('script').textContent);
return d.map(t=>['# '+t.name,'x,y',...t.x.map((x,i)=>x+','+t.y[i])].join('\n')).join('\n\n')}
function texOf(t){const e=s=>s.replace(/\u2212/g,'-').replace(/([&%#_$])/g,'\$1');
const r=[...t.rows].map(r=>[...r.cells].map(c=>e(c.textContent)).join(' & ')+' \\');
return '\begin{tabular}{l'+'r'.repeat(t.rows[0].cells.length-1)+'}\n\hline\n'+r[0]+
'\n\hline\n'+r.slice(1).join('\n')+'\n\hline\n\end{tabular}\n'}
document.addEventListener('click',e=>{const b=e.target.closest('button[data-as]');if(!b)return;
const f=b.closest('figure,.tabular'),n=f.id||'table';
if(b.dataset.as==='svg')save(n+'.svg','image/svg+xml',svgOf(f));
if(b.dataset.as==='csv')save(n+'.csv','text/csv',csvOf(f));
if(b.dataset.as==='tex')save(n+'.tex','text/plain',texOf(f.querySelector('table')))});
"""


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


def table(
    header: Sequence[str], rows: Sequence[Sequence[str]], links: Sequence[str | None] = ()
) -> str:
    """Return a table; the first column is text, the others are aligned as numbers.

    Parameters
    ----------
    header : sequence of str
    rows : sequence of sequence of str
    links : sequence of str or None, optional
        Where the first cell of each row leads.
    """
    head = "".join(
        f'<th scope="col">{escape(cell)}</th>' if cell else "<td></td>" for cell in header
    )
    body = ""
    for row, link in itertools.zip_longest(rows, links):
        first, *others = map(escape, row)
        cells = [f'<a href="{escape(link)}">{first}</a>' if link else first, *others]
        body += "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
    return (
        f'<div class="tabular"><div class="scroll" tabindex="0"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>{_exports('tex')}</div>"
    )


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


def figure(plot: go.Figure, name: str, caption: str = "") -> str:
    """Return a plot with its caption and its exports.

    Parameters
    ----------
    plot : plotly Figure
    name : str
        Unique on the page; letters, digits and hyphens.
    caption : str, optional
        By default what the axes and the curves say.
    """
    text = caption or svg.describe(plot)
    data = json.dumps(svg.data_of(plot), separators=(",", ":")).replace("</", r"<\/")
    return (
        f'<figure id="{name}"><div class="wide">{svg.draw(plot, _WIDE_PX, text)}</div>'
        f'<div class="narrow">{svg.draw(plot, _NARROW_PX, text)}</div>'
        f"<figcaption>{escape(text)} {_exports('svg', 'csv')}</figcaption>"
        f'<script type="application/json">{data}</script></figure>'
    )


def _exports(*kinds: str) -> str:
    """Return the buttons that save a figure or a table."""
    names = {"svg": "SVG", "csv": "CSV", "tex": "LaTeX"}
    buttons = "".join(
        f'<button type="button" data-as="{kind}">{names[kind]}</button>' for kind in kinds
    )
    return f'<span class="export">{buttons}</span>'


def page(
    title: str, subtitle: str, verdict: str, sections: Sequence[Section], facts: Mapping[str, str]
) -> str:
    """Return the whole HTML document.

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
        f"<title>{escape(title)}</title><style>{_STYLE}{svg.style()}</style></head>\n<body><main>"
        f'<h1>{escape(title)}</h1><p class="subtitle">{escape(subtitle)}</p>'
        f'<p class="verdict">{escape(verdict)}</p>{body}'
        f"<footer><dl>{small_print}</dl></footer></main><script>{_SCRIPT}</script></body></html>\n"
    )


def _heading(part: Section) -> str:
    return f"<h{part.level}>{escape(part.title)}</h{part.level}>" if part.title else ""
