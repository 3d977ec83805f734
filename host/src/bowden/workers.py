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
from threading import local
from typing import TypeVar

from threadpoolctl import threadpool_limits

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def cores() -> int:
    """Return how many cores this process may use, which may be fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Workers:
    """Threads that work side by side; what a task asks of them it does itself, one by one.

    Waiting for the others it would hold a thread that they may wait for. A single item is no task:
    whoever asks for it does it, and the threads are free for what that asks of them.

    Parameters
    ----------
    pool : ThreadPoolExecutor
    """

    def __init__(self, pool: ThreadPoolExecutor) -> None:
        self._pool, self._here = pool, local()

    def map(self, what: Callable[[_Item], _Result], items: Iterable[_Item]) -> Iterator[_Result]:
        """Return the results in the order of the items."""
        items = list(items)
        if len(items) == 1 or getattr(self._here, "works", False):
            return map(what, items)

        def one(item: _Item) -> _Result:
            self._here.works = True
            return what(item)

        return self._pool.map(one, items)


@contextmanager
def workers(count: int | None = None) -> Iterator[Workers]:
    """Return so many threads, or one a core; BLAS has one thread until they end."""
    with (
        threadpool_limits(1, user_api="blas"),
        ThreadPoolExecutor(max_workers=count or cores()) as pool,
    ):
        yield Workers(pool)


def a_few_at_a_time(
    pool: Workers, what: Callable[[_Item], _Result], items: Iterable[_Item]
) -> Iterator[_Result]:
    """Map over items of which memory holds only as many as there are cores."""
    left = iter(items)
    while few := list(islice(left, cores())):
        yield from pool.map(what, few)
