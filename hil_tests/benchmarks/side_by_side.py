"""Cases of a benchmark in processes of their own; each result as soon as its case ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import active_children, get_context
from typing import TypeVar

R = TypeVar("R")


def each(run: Callable[..., R], cases: Iterable[tuple[object, ...]], workers: int) -> Iterator[R]:
    """Yield the result of each case, in the order in which they end.

    Whoever stops to ask ends the processes: a case takes minutes, and its result is not needed.

    Parameters
    ----------
    run : callable
        Of a module, so that a process finds it.
    cases : iterable of tuple
        Its arguments.
    workers : int
        Cases at the same time; with 1 they run here, in their order.
    """
    if workers == 1:
        yield from (run(*case) for case in cases)
        return
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
    try:
        for done in as_completed([pool.submit(run, *case) for case in cases]):
            yield done.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in active_children():
            worker.terminate()
