"""Threads that simulate side by side while linear algebra keeps to one thread each.

Fits solve thousands of small systems between simulations. A BLAS that spreads each over all cores
lets its idle threads spin: a diagnosis from a script took eight times the processor time of one
from the command line, which starts with one BLAS thread.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import islice
from typing import TypeVar

from threadpoolctl import threadpool_limits

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def cores() -> int:
    """Return how many cores this process may use, which may be fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def workers() -> Iterator[ThreadPoolExecutor]:
    """Return as many threads as there are cores; BLAS has one thread until they end."""
    with (
        threadpool_limits(1, user_api="blas"),
        ThreadPoolExecutor(max_workers=cores()) as pool,
    ):
        yield pool


def a_few_at_a_time(
    pool: ThreadPoolExecutor, what: Callable[[_Item], _Result], items: Iterable[_Item]
) -> Iterator[_Result]:
    """Map over items of which memory holds only as many as there are cores.

    Not from within a task of the pool: that would wait for threads that wait for it.
    """
    left = iter(items)
    while few := list(islice(left, cores())):
        yield from pool.map(what, few)
