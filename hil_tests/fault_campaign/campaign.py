"""Runs rows of the campaign, one situation after the other; the references of a situation once.

Input: target names, situations, faults. Output: `Outcome`s in that order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

from bowden_rig.native import NativeTarget
from bowden_rig.target import Target

from hil_tests.fault_campaign.faults import FAULTS, Fault
from hil_tests.fault_campaign.outcome import Outcome, judge
from hil_tests.fault_campaign.situations import SITUATIONS, situation
from hil_tests.fault_campaign.trial import Trace, runner
from hil_tests.targets.emulated import EmulatedTarget

TARGETS: dict[str, Callable[[], Target]] = {"native": NativeTarget, "emulated": EmulatedTarget}


@dataclass(frozen=True)
class Batch:
    """Faults in one situation on one target."""

    target: str
    situation: str
    faults: tuple[Fault, ...]


def run_batch(batch: Batch) -> list[Outcome]:
    """Run a batch; its references first."""
    where = situation(batch.situation)
    run = runner(where, TARGETS[batch.target])
    references: dict[bool, tuple[Trace, Trace]] = {}
    outcomes = []
    for fault in batch.faults:
        if fault.stop not in references:
            references[fault.stop] = (run(None, fault.stop, False), run(None, fault.stop, True))
        trace = run(fault, fault.stop, False)
        outcomes.append(judge(batch.target, where, fault, trace, references[fault.stop]))
    return outcomes


def batches(
    targets: Iterable[str], situations: Sequence[str] = (), faults: Sequence[str] = ()
) -> list[Batch]:
    """Return every row that was asked for, by situation; no names: all of them."""
    chosen = tuple(f for f in FAULTS if not faults or f.name in faults)
    names = [s.name for s in SITUATIONS if not situations or s.name in situations]
    return [Batch(target, name, chosen) for target in targets for name in names]


def run_all(work: Sequence[Batch], jobs: int = 1) -> Iterator[list[Outcome]]:
    """Run batches in `jobs` processes; results in the order of the batches, as they come."""
    if jobs == 1:
        yield from map(run_batch, work)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(run_batch, work)
