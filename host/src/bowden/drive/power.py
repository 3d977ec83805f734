"""Enabling and disabling the drive: the CiA 402 sequence, with every step checked.

`powered` is the only way in that users need: whatever happens inside its block, the bridge is off
at the end. While the bridge is on, the drive watches the host's heartbeat, and the RPDO where
torques go through it, and stops by itself when the host dies or hangs. Such an RPDO is guarded
(`command_guard`): the drive refuses a frame that was changed or repeated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bowden.drive.client import Drive
from bowden.drive.command_guard import command_mapping, default_mapping, guard_mapping
from bowden.drive.configuration import difference, write
from bowden.drive.connection import HOST_NODE_ID
from bowden.drive.culprit import refused_configuration
from bowden.drive.faults import describe_emergency
from bowden.drive.meanings import ModeOfOperation
from bowden.errors import BadInput, DriveFailed

if TYPE_CHECKING:
    from bowden.drive.position_follower import FollowLoad
    from bowden.drive.torque_profile import TorqueProfile

HEARTBEAT_TIMEOUT_MS = 1000
# Half of the default command_deadline; torques are sent 25 times as often. The heartbeat goes on
# wherever this program listens, whether it sends torques or not.
RPDO_DEADLINE_MS = 250
_ANSWERS_OUT_S = 0.02
_SILENT_S = 0.3
_FAULT_BIT = 0x0008
_ROLES = ("config", "communication")
_WATCHED = ("consumer_heartbeat.1", "rpdo1_communication.event_timer", *guard_mapping())


@dataclass(frozen=True)
class Run:
    """What the drive does while its bridge is on.

    Parameters
    ----------
    mode : ModeOfOperation
    torque_nm : float, N m
        Motor torque in mode TORQUE; the drive approaches it with its slew rate.
    profile : TorqueProfile, optional
        In mode TORQUE, what a recording sends from its first sample on, after `torque_nm`.
    follow : FollowLoad, optional
        Instead of a profile: the controller that a recording runs.
    """

    mode: ModeOfOperation
    torque_nm: float = 0.0
    profile: TorqueProfile | None = None
    follow: FollowLoad | None = None

    @property
    def uses_rpdo(self) -> bool:
        """Whether torques go through RPDO 1 while it is recorded."""
        return self.profile is not None or self.follow is not None


#: CiA 402 states: mask and value of the statusword.
_STATES = (
    ("not ready to switch on", 0x4F, 0x00),
    ("switch on disabled", 0x4F, 0x40),
    ("ready to switch on", 0x6F, 0x21),
    ("switched on", 0x6F, 0x23),
    ("operation enabled", 0x6F, 0x27),
    ("quick stop active", 0x6F, 0x07),
    ("fault reaction active", 0x4F, 0x0F),
    ("fault", 0x4F, 0x08),
)
#: States in which the motor may carry current.
BRIDGE_ON = ("operation enabled", "quick stop active", "fault reaction active")

_QUICK_STOP, _DISABLE_VOLTAGE, _SHUTDOWN = 0x02, 0x00, 0x06
_SWITCH_ON, _ENABLE_OPERATION, _FAULT_RESET = 0x07, 0x0F, 0x80


def power_state(statusword: int) -> str:
    """Return the CiA 402 state in a statusword."""
    for name, mask, value in _STATES:
        if statusword & mask == value:
            return name
    return f"unknown (statusword {statusword:04X}h)"


def is_fault(statusword: int) -> bool:
    """Return whether a statusword reports a fault or the reaction to one."""
    return bool(statusword & _FAULT_BIT)


def require_unused(drive: Drive) -> None:
    """Refuse a drive that another program runs, before anything that would stop its motion.

    Raises
    ------
    DriveFailed
        Its bridge is on.
    """
    if (state := power_state(drive.read_raw("statusword"))) in BRIDGE_ON:
        raise DriveFailed(
            f"node {drive.node_id} is in {state!r}: another program runs it; end that first "
            "(or `bowden stop`)"
        )


def require_allowed_torque(drive: Drive, torque_nm: float, where: str = "motor torque") -> None:
    """Refuse a motor torque that the drive would cut, before anything moves.

    Raises
    ------
    BadInput
        More than `motor_torque_limit`, or no number.
    """
    limit_nm = drive.read("motor_torque_limit")
    if not abs(torque_nm) <= limit_nm:  # not: nan
        raise BadInput(
            where,
            f"{torque_nm:g} N m",
            f"at most {limit_nm:g} N m (bowden od write motor_torque_limit=...)",
        )


@contextmanager
def powered(drive: Drive, run: Run) -> Iterator[None]:
    """Turn the bridge on for the ``with`` block, and safely off at its end, however it ends.

    Parameters
    ----------
    drive : Drive
        Ends in NMT pre-operational with its bridge off.
    run : Run
        What to do.

    Raises
    ------
    BadInput
        A torque beyond the drive's limit.
    DriveFailed
        Another program runs the drive, a fault that cannot be reset, a configuration that cannot
        run, or a step not taken.
    """
    require_unused(drive)
    if run.torque_nm:
        require_allowed_torque(drive, run.torque_nm)
    before = {name: drive.read(name) for name in _WATCHED}
    try:
        enable(drive, run)
        yield
    except BaseException:
        # The first failure is reported; without our heartbeat the drive stops by itself.
        with suppress(DriveFailed):
            _stop_and_restore(drive, before)
        drive.connection.stop_heartbeat()
        raise
    _stop_and_restore(drive, before)


def _stop_and_restore(drive: Drive, before: Mapping[str, float]) -> None:
    safe_stop(drive)  # ends in pre-operational, where all of it may be written
    write(drive, difference(drive, before, _ROLES))


def enable(drive: Drive, run: Run) -> None:
    """Bring the drive to "operation enabled"; use `powered`, which also brings it back."""
    if culprit := refused_configuration(drive):
        raise DriveFailed(
            f"node {drive.node_id} cannot run with its {culprit}: "
            "write a working configuration with `bowden configure`"
        )
    drive.write_raw("target_torque", 0)
    drive.write_raw("consumer_heartbeat.1", HOST_NODE_ID << 16 | HEARTBEAT_TIMEOUT_MS)
    drive.connection.start_heartbeat()
    if run.uses_rpdo:
        drive.nmt("PRE-OPERATIONAL")
        drive.write_raw("rpdo1_communication.event_timer", RPDO_DEADLINE_MS)
        if command_mapping(drive) == default_mapping():  # another one is refused by the sender
            write(drive, difference(drive, guard_mapping(), _ROLES))
    drive.nmt("OPERATIONAL")
    if is_fault(drive.read_raw("statusword")):
        _reset_fault(drive)
    drive.write_raw("mode_of_operation", run.mode)
    _step(drive, _SHUTDOWN, "ready to switch on")
    _step(drive, _SWITCH_ON, "switched on")
    _step(drive, _ENABLE_OPERATION, "operation enabled")
    if run.mode is ModeOfOperation.TORQUE:
        drive.write("target_torque", run.torque_nm)


def safe_stop(drive: Drive) -> None:
    """Quick stop, turn the bridge off and see that it is off.

    Raises
    ------
    DriveFailed
        The drive does not say that its bridge is off. Everything that can be sent has been sent;
        and without the host's heartbeat the drive turns it off by itself.
    """
    # After Ctrl-C, the answer to an interrupted transfer may still be on its way.
    drive.connection.listen(_ANSWERS_OUT_S)
    if drive.connection.silence_s(drive.node_id) > _SILENT_S:
        drive.nmt("PRE-OPERATIONAL")  # it may still receive: do not wait for answers first
    try:
        if power_state(drive.read_raw("statusword")) in BRIDGE_ON:
            drive.write_raw("controlword", _QUICK_STOP)
            _wait_for(drive, lambda state: state not in BRIDGE_ON)
        drive.write_raw("controlword", _DISABLE_VOLTAGE)
        state = _wait_for(drive, lambda state: state not in BRIDGE_ON)
    except DriveFailed as error:
        drive.nmt("PRE-OPERATIONAL")  # leaving operational turns the bridge off as well
        drive.connection.stop_heartbeat()
        raise DriveFailed(
            f"node {drive.node_id} has not confirmed that its bridge is off ({error}); it turns it "
            f"off by itself after {HEARTBEAT_TIMEOUT_MS} ms without this host"
        ) from error
    drive.nmt("PRE-OPERATIONAL")
    drive.connection.stop_heartbeat()
    if state in BRIDGE_ON:
        raise DriveFailed(f"node {drive.node_id} stays in {state!r}: cut its power")


def _reset_fault(drive: Drive) -> None:
    drive.write_raw("controlword", _DISABLE_VOLTAGE)
    drive.write_raw("controlword", _FAULT_RESET)  # acts on the rising edge
    drive.write_raw("controlword", _DISABLE_VOLTAGE)
    if "fault" in _wait_for(drive, lambda state: "fault" not in state):
        raise DriveFailed(f"node {drive.node_id} has a fault that stays: {last_error(drive)}")


def last_error(drive: Drive) -> str:
    """Return the drive's present error in words."""
    return describe_emergency(drive.read_raw("error_code"))


def _step(drive: Drive, controlword: int, wanted: str) -> None:
    drive.write_raw("controlword", controlword)
    state = _wait_for(drive, lambda state: state == wanted or "fault" in state)
    if state != wanted:
        error = drive.read_raw("error_code")
        why = describe_emergency(error) if error else "no error reported"
        raise DriveFailed(f"node {drive.node_id} does not reach {wanted!r} but {state!r}: {why}")


def _wait_for(drive: Drive, reached: Callable[[str], bool]) -> str:
    """Read the state until it is `reached` or time is over; return the last one."""
    clock = drive.connection.clock
    deadline = clock() + drive.connection.limits.state_s
    while True:
        state = power_state(drive.read_raw("statusword"))
        if reached(state) or clock() >= deadline:
            return state
