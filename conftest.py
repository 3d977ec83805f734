"""Options that every test folder shares; the bench's targets are chosen here."""

from __future__ import annotations

import pytest

TARGETS = ("native",)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--target",
        default="native",
        choices=TARGETS,
        help="where the drive's firmware runs in hil_tests (default: native)",
    )


@pytest.fixture(scope="session")
def target_name(request: pytest.FixtureRequest) -> str:
    return str(request.config.getoption("--target"))
