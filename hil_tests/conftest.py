"""Fixtures of the bench tests: a bench to order, and a verdict on it when the test is over."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from hil_tests.bench import Bench
from hil_tests.frame_loss import Loss
from hil_tests.lockstep_host import FAULT_BIT, LockstepHost
from hil_tests.rig.parameters import Rig
from hil_tests.rig.rig import SimulatedRig
from hil_tests.targets.target import DEFAULT_NODE_ID, make_target
from hil_tests.virtual_bus import VirtualBus


class Benches:
    """Builds benches for one test and judges them at its end.

    A test that provokes an error says so beforehand: ``benches.expected = {0x8130}``.
    """

    def __init__(self, target_name: str) -> None:
        self.expected: set[int] = set()
        self._target_name = target_name
        self._hosts: list[LockstepHost] = []

    def __call__(
        self,
        rig: Rig | None = None,
        seed: int = 0,
        node_id: int = DEFAULT_NODE_ID,
        drop: Loss | None = None,
        trace: bool = False,
    ) -> LockstepHost:
        target = make_target(self._target_name, node_id)
        bus = VirtualBus(Bench(SimulatedRig(rig, seed), target, trace), drop)
        self._hosts.append(LockstepHost(bus, node_id))
        return self._hosts[-1]

    def complaints(self) -> list[str]:
        """What is wrong: unexpected emergencies, and a drive in fault without an expected one."""
        found = []
        for host in self._hosts:
            bench = host.bus.bench
            codes = {int.from_bytes(m.data[:2], "little") for m in bench.emergencies}
            found += [f"unexpected EMCY {code:04X}h" for code in sorted(codes - self.expected)]
            found += [f"EMCY {code:04X}h never came" for code in sorted(self.expected - codes)]
            if bench.ticks and not self.expected:
                # over a wire of its own: the test may have shut, filtered or thinned out the other
                with VirtualBus(bench) as bus:
                    if LockstepHost(bus, host.node_id).statusword() & FAULT_BIT:
                        found.append("the drive is in Fault")
        return found

    def close(self) -> None:
        for host in self._hosts:
            host.bus.shutdown()


@pytest.fixture
def benches(target_name: str) -> Iterator[Benches]:
    """A factory of benches; fails the test at its end on any error that it did not announce."""
    made = Benches(target_name)
    yield made
    complaints = made.complaints()
    made.close()
    assert not complaints
