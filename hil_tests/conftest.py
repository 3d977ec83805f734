"""Fixtures of the bench tests: a bench or a wire to order, a verdict at the end, and what is left.

What a target cannot do is resolved here and nowhere else: ``@pytest.mark.needs("several")``.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from bowden_rig.target import CAPABILITIES, SIMULATED_RIG

from hil_tests.artefacts import directory_of, keep, keep_traffic
from hil_tests.benches import Benches, verdict
from hil_tests.lockstep_host import LockstepHost, Wire
from hil_tests.targets.choice import capabilities_of, missing_firmware
from hil_tests.targets.hardware import Guard, HardwareWire, open_wire

BUILD = Path(__file__).resolve().parents[1] / "build"
WIRE = pytest.StashKey[HardwareWire]()
MADE = pytest.StashKey[Benches]()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip (or fail, with --require-target) a test that needs what the target has not got."""
    name = str(item.config.getoption("--target"))
    if "target_name" in getattr(item, "fixturenames", ()) and (missing := missing_firmware(name)):
        pytest.fail(missing, pytrace=False)
    needed = {str(name) for mark in item.iter_markers("needs") for name in mark.args}
    if needed - CAPABILITIES:
        pytest.fail(
            f"needs: found {sorted(needed - CAPABILITIES)}; accepted: {sorted(CAPABILITIES)}",
            pytrace=False,
        )
    lacking = needed - capabilities_of(name, bool(item.config.getoption("--allow-motion")))
    if lacking:
        text = f"target {name} lacks: {', '.join(sorted(lacking))}"
        if item.config.getoption("--require-target"):
            pytest.fail(text, pytrace=False)
        pytest.skip(text)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Keep traces of a failed test and say where they are."""
    report = yield
    made, wire = item.stash.get(MADE, None), item.stash.get(WIRE, None)
    if report.failed and (made or wire):
        directory = directory_of(BUILD / "artifacts", item.nodeid)
        kept = (
            [path for k, b in enumerate(made.benches) for path in keep(directory, b, k)]
            if made
            else []
        )
        if wire:
            kept.append(keep_traffic(directory, wire.traffic, 0))
        report.sections.append(("kept for this failure", "\n".join(map(str, kept))))
    return report


@pytest.fixture
def benches(request: pytest.FixtureRequest, target_name: str) -> Iterator[Benches]:
    """A factory of benches; fails the test at its end on any error that it did not announce."""
    made = request.node.stash[MADE] = Benches(target_name)
    yield made
    complaints = made.complaints()
    made.close()
    assert not complaints


@pytest.fixture
def host(request: pytest.FixtureRequest, target_name: str) -> Iterator[LockstepHost[Wire]]:
    """A host on the wire of one drive that has just booted, whatever the target; judged as well."""
    option = request.config.getoption
    if SIMULATED_RIG in capabilities_of(target_name, allow_motion=False):
        yield request.getfixturevalue("benches")()
        return
    wire = open_wire(
        option("--can-interface"),
        option("--can-channel"),
        option("--can-bitrate"),
        Guard(option("--node-id"), option("--allow-motion")),
    )
    request.node.stash[WIRE] = wire
    with wire:
        talker: LockstepHost[Wire] = LockstepHost(wire, option("--node-id"))
        wire.restart(talker)
        yield talker
        talker.disable()
        complaints = verdict(talker.frames, talker.statusword(), wire.error_frames)
    assert not complaints
