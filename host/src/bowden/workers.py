"""Threads that simulate side by side while linear algebra keeps to one thread each.

Fits solve thousands of small systems between simulations. A BLAS that spreads each over all cores
lets its idle threads spin: a diagnosis from a script took eight times the processor time of one
from the command line, which starts with one BLAS thread.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from threading import Condition, Lock, Thread, local
from typing import Any, Generic, TypeVar

from threadpoolctl import threadpool_limits

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")


def cores() -> int:
    """Return how many cores this process may use, which may be fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Batch(Generic[_Item, _Result]):
    """The items of one `Workers.map`, and what became of them."""

    def __init__(
        self,
        what: Callable[[_Item], _Result],
        items: Iterable[_Item],
        asked_by: _Batch[Any, Any] | None,
    ) -> None:
        self._what, self._left, self._asked_by = what, enumerate(items), asked_by
        self._taking = Lock()
        self._results: dict[int, _Result] = {}
        self._errors: dict[int, BaseException] = {}
        self.workers = 0  # threads that have come for an item and not done it yet

    def is_within(self, other: _Batch[Any, Any]) -> bool:
        """Whether it is the other, or an item of the other asked for it, directly or not."""
        one: _Batch[Any, Any] | None = self
        while one is not None and one is not other:
            one = one._asked_by
        return one is other

    def do_next(self) -> bool:
        """Do the next item; False where there is none or one has failed."""
        with self._taking:
            taken = next(self._left, None)
        if taken is None:
            return False
        index, item = taken
        try:
            self._results[index] = self._what(item)
        except BaseException as error:  # noqa: BLE001  (raised where the results are asked for)
            self._errors[index] = error
        return not self._errors

    def results(self) -> list[_Result]:
        """Return the results in the order of the items, or raise the first error."""
        if self._errors:
            raise self._errors[min(self._errors)]
        return [self._results[index] for index in sorted(self._results)]


class Workers:
    """Threads that work side by side, whoever asks among them.

    What a task asks for is shared, too: while a thread waits for items that others do, it does what
    those ask for, and nothing else, so none waits for itself and none is idle beside work.

    Parameters
    ----------
    threads : int
        With the one that asks.
    """

    def __init__(self, threads: int) -> None:
        self._changed, self._here = Condition(), local()
        self._open: list[_Batch[Any, Any]] = []  # with items left; the oldest first
        self._ended = False
        self._helpers = [Thread(target=self._work, daemon=True) for _ in range(threads - 1)]
        for one in self._helpers:
            one.start()

    def map(self, what: Callable[[_Item], _Result], items: Iterable[_Item]) -> list[_Result]:
        """Return the results in the order of the items.

        An item is taken when a thread is free for it: memory holds no more of them than threads.
        """
        mine = _Batch(what, items, getattr(self._here, "batch", None))
        with self._changed:
            self._open.append(mine)
            self._changed.notify_all()
        self._work(mine)
        return mine.results()

    def end(self) -> None:
        """Let the threads go."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        for one in self._helpers:
            one.join()

    def _work(self, within: _Batch[Any, Any] | None = None) -> None:
        """Do items until those of a batch are done, or, without one, to the end."""
        before = getattr(self._here, "batch", None)
        while (batch := self._with_work(within)) is not None:
            self._here.batch = batch
            has_more = batch.do_next()
            with self._changed:
                batch.workers -= 1
                if not has_more and batch in self._open:
                    self._open.remove(batch)
                self._changed.notify_all()
        self._here.batch = before

    def _with_work(self, within: _Batch[Any, Any] | None) -> _Batch[Any, Any] | None:
        """Return a batch that may have an item left, as soon as there is one; None at the end."""
        with self._changed:
            while True:
                if self._ended if within is None else self._is_done(within):
                    return None
                for one in self._open:
                    if within is None or one.is_within(within):
                        one.workers += 1
                        return one
                self._changed.wait()

    def _is_done(self, batch: _Batch[Any, Any]) -> bool:
        return batch not in self._open and batch.workers == 0


@contextmanager
def workers(count: int | None = None) -> Iterator[Workers]:
    """Return so many threads, or one a core; BLAS has one thread until they end."""
    with threadpool_limits(1, user_api="blas"):
        pool = Workers(count or cores())
        try:
            yield pool
        finally:
            pool.end()
