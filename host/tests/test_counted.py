"""Numbers of things in messages."""

from __future__ import annotations

import pytest
from bowden.counted import counted


@pytest.mark.parametrize(
    ("count", "said"), [(0, "0 entries differ"), (1, "1 entry differs"), (2, "2 entries differ")]
)
def test_one_is_not_several(count: int, said: str) -> None:
    assert counted(count, "entry differs", "entries differ") == said
