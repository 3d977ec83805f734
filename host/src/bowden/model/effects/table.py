"""The catalogue as a Markdown table for ``docs/effects.md``.

``python -m bowden.model.effects.table`` writes it to the standard output; a test compares the page.
"""

from __future__ import annotations

import sys

from bowden.model.effects import CATALOGUE
from bowden.model.effects.effect import Effect, Parameter

HEAD = """\
| name | enters | law | parameters: plausible range | shows as | needs | looks like |
|---|---|---|---|---|---|---|
"""


def markdown_table() -> str:
    """Return the table, one row an effect."""
    return HEAD + "".join(_row(effect) for effect in CATALOGUE.values())


def _row(effect: Effect) -> str:
    places = []
    for variant in effect.variants:
        listed = ", ".join(_parameter(one) for one in variant.parameters)
        places.append(f"{variant.where}: {listed}" if variant.where else listed)
    cells = [
        f"`{effect.name}`",
        effect.enters,
        effect.law.replace("|", "\\|"),
        "; ".join(places),
        effect.signature,
        ", ".join(effect.excited_by),
        ", ".join(effect.confused_with),
    ]
    return f"| {' | '.join(cells)} |\n"


def _parameter(one: Parameter) -> str:
    if one.period is not None:
        return f"`{one.name}`"
    return f"`{one.name}` {one.low:g} .. {one.high:g}"


if __name__ == "__main__":
    sys.stdout.write(markdown_table())
