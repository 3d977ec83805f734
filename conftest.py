"""Options that every test folder shares; the bench's target is chosen here (docs/testing.md)."""

from __future__ import annotations

import os

import pytest
from hypothesis import settings

# As `bowden.cli.main` does; before anything imports numpy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Spelt out here and in hil_tests/targets: this file must not import the bench, or tests
# of the model would need a built firmware.
TARGETS = ("native", "emulated", "hardware")

# How long an example takes is the machine's affair, not the law's.
settings.register_profile("bowden", deadline=None)
settings.load_profile("bowden")


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("bench", "bowden's bench")
    add = group.addoption
    add(
        "--target",
        default="native",
        choices=TARGETS,
        help="where the drive's firmware runs in hil_tests (default: native)",
    )
    add(
        "--require-target",
        action="store_true",
        help="what the target cannot do fails instead of being skipped",
    )
    add("--can-interface", metavar="NAME", help="of --target=hardware, as python-can's -i")
    add("--can-channel", metavar="NAME", help="as python-can's -c")
    add("--can-bitrate", metavar="BIT/S", type=int, help="as python-can's -b")
    add("--node-id", metavar="1..126", type=int, default=16, help="of the board (default: 16)")
    add(
        "--allow-motion",
        action="store_true",
        help="tests may switch a real board's bridge on: the rig must be safe to move",
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers",
        "needs(*capabilities): skipped on a target that lacks one; bowden_rig/target.py",
    )


@pytest.fixture(scope="session")
def target_name(request: pytest.FixtureRequest) -> str:
    return str(request.config.getoption("--target"))
