"""Records a rig, given the operator's motion and the motor torque, as the drive does.

The drive is started and enabled over its bus, renders the torque (mode -2), and is read as a host
reads it: every fourth control tick what its process data would say. What no rig's parameter can
change from moment to moment (friction, pretension) is written into the rig's state meanwhile.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from bowden_rig.bench import TICKS_PER_S, Bench
from bowden_rig.rig import state as at
from bowden_rig.rig.parameters import Rig
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus

from hil_tests import native_loop
from hil_tests.hidden_effects.continuum import Histories
from hil_tests.hidden_effects.hidden import Signals, Vector
from hil_tests.lockstep_host import LockstepHost

MOTOR_TORQUE_LIMIT: Final = 0x2107  # entry, in uN m
LIMIT_NM: Final = 0.8
# The drive assumes another rig than the case's, and may heat its motor: entries
# stretch_tolerance (nm) and both continuous currents (uA).
UNGUARDED: Final = {0x2145: 100_000_000, 0x2146: 60_000_000, 0x2148: 60_000_000}
MOST_LOAD_NM: Final = 8.3  # process data carry 24 bits of micronewton metres
TORQUE_MODE: Final = -2
SETTLE_S: Final = 0.06  # the drive takes a configuration 50 ms after its last entry
CHUNK: Final = 10  # samples between two changes of the rig's state
WATCHED: Final = (
    "motor_angle_urad",
    "load_angle_urad",
    "motor_torque_unm",
    "load_torque_unm",
    "conduit_temperature_mdegc",
)


def record(
    rig: Rig, signals: Signals, seed: int, histories: Histories | None = None
) -> dict[str, Vector]:
    """Simulate the given operator motion and motor torque; return what the drive records.

    Parameters
    ----------
    rig : Rig
        Holds still until the drive is enabled.
    signals : Signals
        `motor_torque_nm` is the drive's set-point, `load_angle_rad` the operator's intended angle.
    seed : int
        Of the sensors' noise.
    histories : Histories, optional
        Changes of friction and of the cables' length, for a rig in which nothing else ages.

    Returns
    -------
    dict of str to ndarray
        The columns of a recording.

    Raises
    ------
    ArithmeticError
        The drive stopped, or its process data cannot carry the torque.
    """
    bench = Bench(SimulatedRig(rig, seed), make_target("native"))
    host = LockstepHost(VirtualBus(bench))
    host.await_boot()
    host.write(MOTOR_TORQUE_LIMIT, 0, round(1e6 * LIMIT_NM), 4)
    for entry, value in UNGUARDED.items():
        host.write(entry, 0, value, 4)
    host.listen(SETTLE_S)
    host.enable(TORQUE_MODE)
    size = signals.time_s.size
    ticks = round(signals.time_s[1] * TICKS_PER_S)  # a sample
    time_s = np.arange(size * ticks) / TICKS_PER_S
    angle = np.interp(time_s, signals.time_s, signals.load_angle_rad)
    operator = np.column_stack([angle, np.gradient(angle, time_s)])
    torque = np.interp(time_s, signals.time_s, signals.motor_torque_nm)
    rows, on = [], True
    chunk = size if histories is None else CHUNK
    for first in range(0, size, chunk):
        if histories is not None:
            _change(bench.rig, histories, first)
        some = slice(ticks * first, ticks * min(first + chunk, size))
        done = native_loop.run(bench, some.stop - some.start, operator[some], torque[some], WATCHED)
        rows.append(done.drive[::ticks])
        on &= bool(done.bridge_enabled.all())
    host.bus.shutdown()
    motor, load, tau, cell, heat = 1e-6 * np.vstack(rows).T.astype(np.float64)
    if not on or float(np.abs(cell).max()) > MOST_LOAD_NM:
        raise ArithmeticError("the drive stopped, or cannot tell the load torque")
    return {
        "time_s": signals.time_s,
        "motor_angle_rad": motor,
        "load_angle_rad": load,
        "motor_torque_nm": tau,
        "load_torque_nm": cell,
        "conduit_temperature_c": 1e3 * heat,
    }


def _change(rig: SimulatedRig, histories: Histories, sample: int) -> None:
    """Set friction and pretension as they are at a sample."""
    scalars, cable = rig.plant.scalars, rig.description.cable
    if histories.friction_plus is not None:
        scalars[at.FRICTION_FACTOR] = histories.friction_plus[sample]
    if histories.extra_length_m is not None:
        strain = histories.extra_length_m[sample] / cable.length_m
        slack_n = cable.axial_stiffness_n * strain
        scalars[at.PRETENSION] = max(cable.pretension_n - slack_n, 0.0)
