"""Benches to order for one test, and the verdict on them when it is over.

`conftest` makes a fixture of it. Every bench keeps its truth and its traffic: `artefacts` writes
them down when the test fails.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import can
from bowden_rig.bench import EMCY, Bench
from bowden_rig.frame_loss import Loss
from bowden_rig.rig.parameters import Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.target import DEFAULT_NODE_ID, fitted
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

from hil_tests.lockstep_host import FAULT_BIT, LockstepHost

LAST_WORDS_S: Final = 0.02  # for an EMCY that is on its way


class Benches:
    """Builds benches for one test, booted, and checks them at its end.

    A test that provokes an error says so beforehand: ``benches.expected = {0x8130}``.

    Parameters
    ----------
    target_name : str
        As given to pytest --target.
    """

    def __init__(self, target_name: str) -> None:
        self.expected: set[int] = set()
        self._target_name = target_name
        self._hosts: list[LockstepHost[VirtualBus]] = []

    def __call__(
        self,
        rig: Rig | None = None,
        seed: int = 0,
        node_id: int = DEFAULT_NODE_ID,
        drop: Loss | None = None,
    ) -> LockstepHost[VirtualBus]:
        """Build a bench; the host on its wire has just heard the boot-up message."""
        target = make_target(self._target_name, node_id, rig)
        simulated = SimulatedRig(fitted(rig or Rig(), target.capabilities), seed)
        host = LockstepHost(VirtualBus(Bench(simulated, target, trace=True), drop), node_id)
        self._hosts.append(host)
        host.await_boot()
        return host

    @property
    def benches(self) -> list[Bench]:
        """Benches built so far."""
        return [host.bus.bench for host in self._hosts]

    def complaints(self) -> list[str]:
        """List what is wrong: unexpected errors, a drive in fault, and the targets' own."""
        found = []
        for host in self._hosts:
            bench = host.bus.bench
            status = 0
            # over a wire of its own: the test may have shut, filtered or thinned out the other
            with VirtualBus(bench) as bus:
                bus.advance(LAST_WORDS_S)
                if not self.expected:
                    status = LockstepHost(bus, host.node_id).statusword()
            found += verdict(bench.emergencies, status, expected=self.expected)
            found += bench.target.complaints()
        return found

    def close(self) -> None:
        """Shut the wires."""
        for host in self._hosts:
            host.bus.shutdown()


def verdict(
    frames: Iterable[can.Message],
    statusword: int,
    error_frames: int = 0,
    expected: set[int] | frozenset[int] = frozenset(),
) -> list[str]:
    """Judge one drive by what it said: EMCY codes, fault bit, errors on the bus."""
    codes = {
        int.from_bytes(m.data[:2], "little")
        for m in frames
        if EMCY < m.arbitration_id < EMCY + 0x80
    } - {0}
    found = [f"unexpected EMCY {code:04X}h" for code in sorted(codes - expected)]
    found += [f"EMCY {code:04X}h never came" for code in sorted(expected - codes)]
    if statusword & FAULT_BIT:
        found.append("the drive is in Fault")
    if error_frames:
        found.append(f"{error_frames} error frames on the bus")
    return found
