"""Threads beside each other, each with linear algebra of its own."""

from __future__ import annotations

import os
from threading import Barrier

import numpy as np
import pytest
from bowden.workers import cores, workers
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


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no affinity on this system")
def test_a_process_that_is_held_to_one_core_counts_one() -> None:
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        assert cores() == 1
    finally:
        os.sched_setaffinity(0, before)
