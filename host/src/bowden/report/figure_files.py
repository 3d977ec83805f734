"""Figures as files for papers: vector drawings (SVG, PDF) and their data (CSV).

Takes the plotly figures that the reports show and draws them as the reports do (`svg`), with the
colours of light paper written out, so that each file stands alone. PDF is made of the SVG by the
package cairosvg, an extra.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Final

import plotly.graph_objects as go

from bowden.errors import BadInput
from bowden.recording.atomic import replace_whole
from bowden.report import svg

WIDTH_PX: Final = 760.0  # at 96 to the inch 20 cm: two columns of a paper
_STYLE: Final = (
    "text{font-family:Helvetica,Arial,sans-serif;font-size:13px;fill:#1a1a1a}"
    ".tick{fill:#5c6066;font-size:12px}.grid{stroke:#dfe2e6}.axis{stroke:#5c6066}"
    ".line{fill:none;stroke-linejoin:round}"
)


def write_figure(plot: go.Figure, path: Path) -> None:
    """Write a figure in the form that the path's ending says, whole or not at all.

    Parameters
    ----------
    plot : plotly Figure
    path : Path
        ``.svg``, ``.pdf`` or ``.csv``.

    Raises
    ------
    BadInput
        Another ending, PDF without the package cairosvg, or a path that cannot be written.
    """
    if path.suffix not in FORMS:
        raise BadInput(str(path), f"a name that ends in {path.suffix!r}", ", ".join(FORMS))
    content = FORMS[path.suffix](plot)
    with replace_whole(path) as temporary:
        temporary.write_bytes(content)


def refuse_missing(form: str) -> None:
    """Refuse a form whose package is not installed, before anything is computed.

    Raises
    ------
    BadInput
        ``.pdf`` without the package cairosvg or its library.
    """
    if form == ".pdf":
        _cairosvg()


def _svg(plot: go.Figure) -> bytes:
    return standalone(plot).encode()


def standalone(plot: go.Figure) -> str:
    """Return a figure as an SVG document that needs no page around it."""
    drawn = svg.draw(plot, WIDTH_PX, svg.describe(plot))
    drawn = re.sub(r"<[^>]*var\(--c\)[^>]*>", _light, drawn)
    size = re.search(r'viewBox="0 0 (\S+) (\S+)"', drawn)
    assert size is not None
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size.group(1)}" height="{size.group(2)}" '
    )
    opened = drawn.replace("<svg ", head, 1)
    return opened.replace(">", f"><style>{_STYLE}</style>", 1)


def _light(tag: re.Match[str]) -> str:
    """Write out the colour that a tag has by its class (`svg_elements.DARK`)."""
    code = re.search(r"\bc([0-9a-f]{6})\b", tag.group())
    assert code is not None
    return tag.group().replace("var(--c)", f"#{code.group(1)}")


def _pdf(plot: go.Figure) -> bytes:
    return bytes(_cairosvg()(bytestring=standalone(plot).encode()))


def _cairosvg() -> Callable[..., bytes]:
    try:
        from cairosvg import svg2pdf  # noqa: PLC0415  (an extra)
    except ImportError:
        raise BadInput("PDF", "no package cairosvg", "pip install 'bowden[pdf]'") from None
    except OSError:  # its library
        raise BadInput("PDF", "no library cairo", "Debian: apt-get install libcairo2") from None
    return svg2pdf  # type: ignore[no-any-return]


def _csv(plot: go.Figure) -> bytes:
    """Return every sample of every curve, a row each: curve, x, y."""
    text = StringIO()
    text.write("curve,x,y\n")
    for trace in plot.data:
        if trace.type == "heatmap" or trace.x is None:
            continue
        name = '"' + (trace.name or "").replace('"', '""') + '"'
        for x, y in zip(trace.x, trace.y, strict=True):
            text.write(f"{name},{_cell(x)},{_cell(y)}\n")
    return text.getvalue().encode()


def _cell(value: object) -> str:
    return '"' + value.replace('"', '""') + '"' if isinstance(value, str) else f"{value:.9g}"


#: What each ending is made by.
FORMS: Final[dict[str, Callable[[go.Figure], bytes]]] = {".svg": _svg, ".pdf": _pdf, ".csv": _csv}
