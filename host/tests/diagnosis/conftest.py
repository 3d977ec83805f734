"""What tests of the diagnosis share: sets of effects of a rig that hides a gain and an offset."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from bowden.diagnosis.material import as_searched
from bowden.diagnosis.sets import Sets
from bowden.workers import workers

from .lab import CELL, GAIN, HIDDEN, MODEL, OFFSET, material_with


@pytest.fixture(scope="module")
def sets() -> Iterator[Sets]:
    with workers(1) as pool:
        found = Sets(material_with(pool, HIDDEN), as_searched(MODEL))
        found.screen([GAIN, OFFSET, CELL])
        yield found
