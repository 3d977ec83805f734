"""The situations in which a line breaks: state of the drive, mode, law, and what the operator does.

`enter` brings a bench there the way a plain CANopen master does: configuration by SDO, then RPDO 1
every 10 ms and a heartbeat, with the drive's own defaults for everything that guards it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from bowden.drive.dictionary import TABLE
from bowden.drive.meanings import CompensationLaw, ModeOfOperation
from bowden_rig.rig.parameters import Cable, Operator, Rig

PRETENSION_N: Final = 5.0  # friction of 0.3 N m at the motor: the limit leaves a law room
MOTOR_LIMIT_NM: Final = 0.5  # default of motor_torque_limit
RATIO: Final = 5.2
ENTRIES: Final = {"cable_pretension": PRETENSION_N, "motor_torque_limit": MOTOR_LIMIT_NM}
TORQUE_NM: Final = 0.1
SETTLED_S: Final = 0.3  # configuration taken, states gone through
STROKE_S: Final = 1.2  # from enabling to the handle's turning point outside the tunnel
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, STOP = 0x06, 0x07, 0x0F, 0x02, 0x00

STROKES: Final = Operator(
    motion="sine", amplitude_rad=math.radians(20.0), frequency_hz=1.0, ramp_s=0.25
)
STILL: Final = Operator(motion="still")


@dataclass(frozen=True)
class Situation:
    """Where the drive is when the line breaks.

    Parameters
    ----------
    name : str
    controlwords : tuple of int
        On the way there, 20 ms each; the last one goes on.
    mode : ModeOfOperation
    law : CompensationLaw
    onset_s : float
        From the first controlword to the fault.
    operator : Operator
    operational : bool
        NMT operational, else pre-operational.
    faulted : bool
        In Fault, by a supply that was missing once.
    stops : bool
        The host asks for a quick stop at the onset.
    command_deadline_s : float or None
        Of the drive; None: its default.
    guarded : bool
        The host maps `command_guard` into RPDO 1 and fills it.
    """

    name: str
    controlwords: tuple[int, ...]
    mode: ModeOfOperation = ModeOfOperation.TORQUE
    law: CompensationLaw = CompensationLaw.NONE
    onset_s: float = SETTLED_S
    operator: Operator = STILL
    operational: bool = True
    faulted: bool = False
    stops: bool = False
    command_deadline_s: float | None = None
    guarded: bool = False

    @property
    def rig(self) -> Rig:
        """The rig that belongs to it."""
        return Rig(cable=Cable(pretension_n=PRETENSION_N), operator=self.operator)

    @property
    def bridge_on(self) -> bool:
        """Return whether torque flows when the line breaks."""
        return self.controlwords[-1] == ENABLE and self.operational and not self.faulted

    def entries(self) -> dict[str, float]:
        """Entries to configure, in their units."""
        entries = ENTRIES | {"compensation_law": float(self.law)}
        if self.command_deadline_s is not None:
            entries["command_deadline"] = self.command_deadline_s
        return entries


UP: Final = (SHUTDOWN, SWITCH_ON, ENABLE)
SITUATIONS: Final = (
    Situation("pre-operational", (ENABLE,), operational=False),
    Situation("switch-on-disabled", (STOP,)),
    Situation("ready-to-switch-on", (SHUTDOWN,)),
    Situation("switched-on", (SHUTDOWN, SWITCH_ON)),
    Situation("fault", UP, faulted=True),
    Situation("quick-stop", UP, stops=True),
    *(Situation(f"torque-{law.word}", UP, law=law) for law in CompensationLaw),
    *(
        Situation(
            f"tunnel-{law.word}",
            UP,
            mode=ModeOfOperation.TUNNEL,
            law=law,
            onset_s=SETTLED_S + STROKE_S,
            operator=STROKES,
        )
        for law in CompensationLaw
    ),
)


def situation(name: str) -> Situation:
    """Return the situation of that name; ValueError says which there are."""
    for found in SITUATIONS:
        if found.name == name:
            return found
    names = ", ".join(s.name for s in SITUATIONS)
    raise ValueError(f"situation: found {name!r}; accepted: {names}")


def raw_entries(wanted: dict[str, float]) -> list[tuple[int, int, int, int]]:
    """Return index, sub-index, raw value and bytes of each entry."""
    found = [(TABLE.lookup(name), value) for name, value in wanted.items()]
    return [(e.index, e.sub, e.to_raw(value), e.bits // 8) for e, value in found]
