"""Store and restore parameters (0x1010, 0x1011): what a lab has set survives power-off."""

from __future__ import annotations

import pytest
from bowden_rig.target import SIMULATED_RIG
from bowden_rig.virtual_bus import VirtualBus

from hil_tests.benches import Benches
from hil_tests.lockstep_host import NMT_RESET_NODE, LockstepHost, SdoAbort

pytestmark = pytest.mark.needs(SIMULATED_RIG)  # a real board's configuration must not be changed

Host = LockstepHost[VirtualBus]

STORE, RESTORE, STATE = 0x1010, 0x1011, 0x2009
SAVE, LOAD = 0x65766173, 0x64616F6C
DONE = 2
PRETENSION, PRETENSION_DEFAULT = 0x2111, 10_000_000  # uN
CURVATURE = 0x2114
TORQUE = -2


def number(host: Host, index: int, sub: int = 0) -> int:
    return int.from_bytes(host.read(index, sub), "little")


def restart(host: Host) -> None:
    host.nmt(NMT_RESET_NODE)
    host.await_boot(2.0)
    host.listen(0.01)


def test_saved_configuration_survives_a_restart(benches: Benches) -> None:
    host = benches()
    host.write(PRETENSION, 0, 7_000_000, 4)
    host.write(CURVATURE, 40, 123_456, 4)
    host.write(STORE, 1, SAVE, 4)  # answered when it is kept
    assert number(host, STATE) == DONE
    restart(host)
    assert number(host, PRETENSION) == 7_000_000
    assert number(host, CURVATURE, 40) == 123_456
    assert number(host, CURVATURE, 39) != 123_456
    assert number(host, STATE) == 0


def test_what_was_not_saved_is_forgotten(benches: Benches) -> None:
    host = benches()
    host.write(PRETENSION, 0, 7_000_000, 4)
    restart(host)
    assert number(host, PRETENSION) == PRETENSION_DEFAULT


def test_restored_defaults_come_with_the_next_start(benches: Benches) -> None:
    host = benches()
    host.write(PRETENSION, 0, 7_000_000, 4)
    host.write(STORE, 1, SAVE, 4)  # answered when it is kept
    assert number(host, STATE) == DONE
    host.write(RESTORE, 1, LOAD, 4)
    assert number(host, STATE) == DONE
    assert number(host, PRETENSION) == 7_000_000
    restart(host)
    assert number(host, PRETENSION) == PRETENSION_DEFAULT


@pytest.mark.parametrize(("index", "value"), [(STORE, 1), (STORE, LOAD), (RESTORE, SAVE)])
def test_only_the_signature_starts_it(benches: Benches, index: int, value: int) -> None:
    host = benches()
    with pytest.raises(SdoAbort, match="08000020h"):
        host.write(index, 1, value, 4)
    assert number(host, index, 1) == 1
    assert number(host, STATE) == 0


@pytest.mark.needs("motion")
def test_nothing_is_saved_while_the_bridge_is_on(benches: Benches) -> None:
    host = benches()
    host.enable(TORQUE)
    with pytest.raises(SdoAbort, match="08000022h"):
        host.write(STORE, 1, SAVE, 4)
    host.disable()
    host.write(STORE, 1, SAVE, 4)  # answered when it is kept
    assert number(host, STATE) == DONE


FAULT_LOG, FAULT_LOG_UPTIME, ORIGIN = 0x2010, 0x2011, 0x200B
COMMAND_LATE, POWER_ON = 0x8131, 1


def test_the_last_faults_survive_power_off_and_touch_no_configuration(benches: Benches) -> None:
    benches.expected = {COMMAND_LATE}
    host = benches()
    host.write(PRETENSION, 0, 7_000_000, 4)  # not saved, and not to be
    host.enable(TORQUE, guarded=True)
    host.listen(1.0)  # the host falls silent: the fault, and the time to write it
    assert number(host, FAULT_LOG, 1) == POWER_ON << 16 | COMMAND_LATE
    assert number(host, STATE) == 0  # no save was requested
    host.bus.bench.target.reset()
    host.await_boot(2.0)
    host.listen(0.01)
    assert number(host, FAULT_LOG, 1) == POWER_ON << 16 | COMMAND_LATE
    assert number(host, FAULT_LOG_UPTIME, 1) == 0
    assert number(host, FAULT_LOG, 2) == 0
    assert number(host, PRETENSION) == PRETENSION_DEFAULT
    assert number(host, ORIGIN, 1) == 0  # a log is no configuration


def test_a_growing_log_leaves_the_saved_configuration(benches: Benches) -> None:
    benches.expected = {COMMAND_LATE}
    host = benches()
    host.write(PRETENSION, 0, 7_000_000, 4)
    host.write(STORE, 1, SAVE, 4)
    host.enable(TORQUE, guarded=True)
    host.listen(1.0)
    host.write(RESTORE, 1, LOAD, 4)
    restart(host)
    assert number(host, PRETENSION) == PRETENSION_DEFAULT
    assert number(host, FAULT_LOG, 1) & 0xFFFF == COMMAND_LATE


NODE_ID, BIT_RATE = 0x2012, 0x2013


def test_a_stored_node_id_counts_from_the_next_start_on(benches: Benches) -> None:
    host = benches()
    host.write(NODE_ID, 0, 21, 1)
    assert number(host, NODE_ID) == 21  # and the node still answers as before
    host.write(STORE, 1, SAVE, 4)
    host.nmt(NMT_RESET_NODE)
    host.node_id = 21
    host.await_boot(2.0)
    assert number(host, NODE_ID) == 21


@pytest.mark.parametrize(("value", "size"), [(0, 1), (128, 1)])
def test_no_impossible_node_id_is_taken(benches: Benches, value: int, size: int) -> None:
    with pytest.raises(SdoAbort):
        benches().write(NODE_ID, 0, value, size)
