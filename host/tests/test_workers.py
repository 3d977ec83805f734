"""Threads beside each other, each with linear algebra of its own."""

from __future__ import annotations

import os
from collections.abc import Iterator
from threading import Barrier

import numpy as np
import pytest
from bowden.workers import cores, workers
from hypothesis import given
from hypothesis import strategies as st
from threadpoolctl import threadpool_info


def _blas_threads() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_blas_keeps_to_one_thread_beside_the_workers_and_gets_its_threads_back() -> None:
    np.linalg.solve(np.eye(2), np.ones(2))
    before = _blas_threads()
    with workers() as pool:
        assert set().union(*pool.map(lambda _: _blas_threads(), range(4))) == {1}
    assert _blas_threads() == before


def test_a_task_that_asks_the_workers_gets_its_answer() -> None:
    """With one thread, which it holds itself, it would wait for ever."""

    def rows(n: int) -> list[int]:
        return list(pool.map(lambda k: 10 * n + k, range(3)))

    with workers(1) as pool:
        assert list(pool.map(rows, range(2))) == [[0, 1, 2], [10, 11, 12]]
        assert rows(2) == [20, 21, 22]


def test_what_a_single_item_asks_for_is_done_side_by_side() -> None:
    """It is done where it is asked for: in a thread its tasks would wait for one another."""
    both = Barrier(2, timeout=20.0)  # s: neither gets through before the other has come

    def halves(_: int) -> list[int]:
        return list(pool.map(lambda _half: both.wait(), range(2)))

    with workers(2) as pool:
        assert [sorted(one) for one in pool.map(halves, [0])] == [[0, 1]]


def test_what_one_of_many_tasks_asks_for_is_shared_by_those_that_are_done() -> None:
    """The last of some tasks would keep one core busy and the others waiting."""
    both = Barrier(2, timeout=20.0)  # s: neither gets through before the other has come

    def task(parts: int) -> int:
        return len(pool.map(lambda _part: both.wait(), range(parts)))

    with workers(2) as pool:
        assert pool.map(task, [0, 2]) == [0, 2]


def test_items_are_made_when_a_thread_is_free_for_them() -> None:
    """Paths drawn all at once fill the memory."""
    held, most = 0, 0

    def items() -> Iterator[int]:
        nonlocal held, most
        for k in range(20):
            held += 1
            most = max(most, held)
            yield k

    def done(item: int) -> int:
        nonlocal held
        held -= 1
        return item

    with workers(1) as pool:
        assert pool.map(done, items()) == list(range(20))
    assert most == 1


@pytest.mark.parametrize("threads", [1, 3])
def test_the_first_item_that_fails_is_what_the_caller_learns(threads: int) -> None:
    def one(item: int) -> int:
        if item in {3, 5}:
            raise ValueError(item)
        return item

    with workers(threads) as pool:
        with pytest.raises(ValueError, match="3"):
            pool.map(one, range(9))
        assert pool.map(one, range(3)) == [0, 1, 2]


@given(
    threads=st.integers(1, 4),
    sizes=st.lists(st.integers(0, 4), max_size=6),
)
def test_tasks_within_tasks_answer_in_order(threads: int, sizes: list[int]) -> None:
    with workers(threads) as pool:

        def task(size: int) -> list[int]:
            return pool.map(lambda k: 10 * size + k, range(size))

        assert pool.map(task, sizes) == [[10 * size + k for k in range(size)] for size in sizes]


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no affinity on this system")
def test_a_process_that_is_held_to_one_core_counts_one() -> None:
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        assert cores() == 1
    finally:
        os.sched_setaffinity(0, before)
