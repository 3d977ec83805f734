"""Threads that simulate side by side while linear algebra keeps to one thread each.

Fits solve thousands of small systems between simulations. A BLAS that spreads each over all cores
lets its idle threads spin: a diagnosis from a script took eight times the processor time of one
from the command line, which starts with one BLAS thread.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def workers() -> Iterator[ThreadPoolExecutor]:
    """Return as many threads as there are cores; BLAS has one thread until they end."""
    with (
        threadpool_limits(1, user_api="blas"),
        ThreadPoolExecutor(max_workers=os.cpu_count()) as pool,
    ):
        yield pool
