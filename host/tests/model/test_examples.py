"""The model files that the documentation shows are accepted, and Table I is the paper's."""

from __future__ import annotations

from pathlib import Path

import pytest
from bowden.model import parse_model, table_1
from bowden.model.description import TABLE_1_COULOMB

EXAMPLES = Path(__file__).resolve().parents[3] / "docs" / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_example_is_accepted(path: Path) -> None:
    assert parse_model(path.read_text(encoding="utf-8"), str(path)).transmission.length_m > 0


def test_table_1_is_the_built_in_one() -> None:
    text = (EXAMPLES / "table_1.yaml").read_text(encoding="utf-8")
    assert vars(parse_model(text).transmission) == vars(table_1().transmission)


def test_the_demo_writes_the_coulomb_example() -> None:
    text = (EXAMPLES / "table_1_coulomb.yaml").read_text(encoding="utf-8")
    assert parse_model(TABLE_1_COULOMB).document == parse_model(text).document


def test_the_coulomb_example_differs_in_friction_at_standstill_only() -> None:
    text = (EXAMPLES / "table_1_coulomb.yaml").read_text(encoding="utf-8")
    coulomb, printed = parse_model(text).transmission, table_1().transmission
    assert not coulomb.friction.has_stiction
    assert coulomb.friction.mu_d == printed.friction.mu_d
    assert coulomb.axial_stiffness_n == printed.axial_stiffness_n
    assert coulomb.pretension_n == printed.pretension_n
