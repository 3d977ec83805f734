"""What the linter takes for the firmware's room is the firmware's room."""

from __future__ import annotations

import re

import pytest

from shared.dictionary import lint
from shared.dictionary.outputs import ROOT


@pytest.mark.parametrize(
    ("header", "macro", "known"),
    [
        ("pdo.h", "PDO_RX_MAX", lint.RPDO_MAX),
        ("pdo.h", "PDO_TX_MAX", lint.TPDO_MAX),
        ("sdo.h", "SDO_BUFFER_SIZE", lint.VALUE_MAX),
    ],
)
def test_limits_agree(header: str, macro: str, known: int) -> None:
    text = (ROOT / "firmware" / "canopen" / header).read_text()
    found = re.search(rf"#define {macro} (\d+)", text)
    assert found is not None
    assert int(found[1]) == known
