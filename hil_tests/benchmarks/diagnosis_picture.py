"""The confusion matrix as a self-contained SVG: rows the truth, columns the answer."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from hil_tests.benchmarks.diagnosis_score import Result, confusion

CELL, LEFT, TOP = 20, 210, 200
RIGHT, WRONG = "#2a6f4e", "#b4492f"


def svg(results: Sequence[Result]) -> str:
    """Draw it; the diagonal in green, the rest in red, both darker with the share of the row."""
    rows, columns, counts = confusion(results)
    right = {r.label for r in results if r.kind == "unlisted"}
    width, height = LEFT + CELL * len(columns) + 20, TOP + CELL * len(rows) + 20
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" font-family="sans-serif" font-size="11">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
        f'<text x="{LEFT}" y="14" fill="#555">what the diagnosis says (columns), '
        "what was hidden (rows)</text>",
    ]
    for j, name in enumerate(columns):
        x = LEFT + CELL * j + 14
        parts.append(
            f'<text transform="translate({x},{TOP - 6}) rotate(-60)">{escape(name)}</text>'
        )
    for i, (name, row) in enumerate(zip(rows, counts, strict=True)):
        y = TOP + CELL * i
        parts.append(f'<text x="{LEFT - 6}" y="{y + 14}" text-anchor="end">{escape(name)}</text>')
        for j, count in enumerate(row):
            x = LEFT + CELL * j
            good = columns[j] == name or (name in right and columns[j] == "(unlisted)")
            strength = count / max(sum(row), 1)
            fill = (RIGHT if good else WRONG) if count else "#f2f2ef"
            opacity = 0.25 + 0.75 * strength if count else 1.0
            parts.append(
                f'<rect x="{x}" y="{y}" width="{CELL - 1}" height="{CELL - 1}" '
                f'fill="{fill}" fill-opacity="{opacity:.2f}"/>'
            )
            if count:
                parts.append(
                    f'<text x="{x + 9}" y="{y + 14}" text-anchor="middle" '
                    f'fill="{"white" if strength > 0.4 else "black"}">{count}</text>'
                )
    return "\n".join([*parts, "</svg>"]) + "\n"
