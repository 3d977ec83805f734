"""How fast the bench is: simulated seconds per wall-clock second, as JSON on stdout.

    python -m hil_tests.speed

A list of {name, value, unit, context}: the plant alone, the drive's tick alone, and both together
with frames carried, each the best of several rounds.
"""

from __future__ import annotations

import json
import platform
import sys
import time
from collections.abc import Callable

from hil_tests.bench import TICKS_PER_S, Bench
from hil_tests.lockstep_host import NMT_START, LockstepHost
from hil_tests.rig.rig import SimulatedRig
from hil_tests.targets.target import make_target
from hil_tests.virtual_bus import VirtualBus

ROUNDS = 5
TICKS = 2000


def realtime_factor(work: Callable[[], None]) -> float:
    """Virtual seconds a wall-clock second, where `work` is TICKS control periods."""
    best_s = float("inf")
    for _ in range(ROUNDS):
        start_s = time.perf_counter()
        work()
        best_s = min(best_s, time.perf_counter() - start_s)
    return TICKS / TICKS_PER_S / best_s


def measure() -> list[dict[str, str | float]]:
    """Run each case; one row a figure."""
    rig, target = SimulatedRig(), make_target("native")
    host = LockstepHost(VirtualBus(Bench(SimulatedRig(), make_target("native"))))
    host.nmt(NMT_START)
    host.listen(0.01)

    def plant() -> None:
        for _ in range(TICKS):
            rig.plant.advance(1.0, True, 0.1, 1.0)

    def tick() -> None:
        for _ in range(TICKS):
            target.tick(rig.sensors)

    def bench() -> None:
        host.listen(TICKS / TICKS_PER_S)
        host.frames.clear()

    plant()  # the first call compiles or loads
    context = f"{platform.machine()}, Python {platform.python_version()}, one core"
    cases = {"plant": plant, "native_tick": tick, "with_drive": bench}
    factors = {name: realtime_factor(work) for name, work in cases.items()}
    host.bus.shutdown()
    return [
        {
            "name": f"bench.{name}.realtime_factor",
            "value": round(factor, 2),
            "unit": "simulated s per s",
            "context": context,
        }
        for name, factor in factors.items()
    ]


if __name__ == "__main__":
    json.dump(measure(), sys.stdout, indent=2)
    sys.stdout.write("\n")
