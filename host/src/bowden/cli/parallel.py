"""Run one function on many tasks: on the cores of this machine, or on a Dask cluster.

The function is one of a module, and arguments and results are plain, so that they travel.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Generator, Sequence
from typing import Any, TypeVar, cast

from bowden.errors import BadInput

Result = TypeVar("Result")

_CONNECT_WITHIN_S = 10


def add_scheduler_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--scheduler``."""
    parser.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler (extra [cluster])")


def on_this_machine(
    function: Callable[..., Result], tasks: Sequence[tuple[object, ...]], jobs: int = -1
) -> Generator[Result]:
    """Yield each task's result as it comes.

    Parameters
    ----------
    function : callable
    tasks : sequence of tuple
        The arguments of each.
    jobs : int, default -1
        At the same time; -1: one a core.
    """
    from joblib import Parallel, delayed  # noqa: PLC0415  (keeps --help fast)

    results: Generator[Result] = Parallel(n_jobs=jobs, return_as="generator_unordered")(
        delayed(function)(*task) for task in tasks
    )
    return results


def on_cluster(
    function: Callable[..., Result], tasks: Sequence[tuple[object, ...]], scheduler: str
) -> Generator[Result]:
    """Yield each task's result as it comes from a Dask cluster.

    Raises
    ------
    BadInput
        The extra is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client, as_completed  # noqa: PLC0415  (an extra, large)
        from distributed.comm.addressing import parse_address  # noqa: PLC0415
    except ModuleNotFoundError as missing:
        raise BadInput(
            "--scheduler",
            f"an installation without {missing.name}",
            "pip install 'bowden[cluster]', or no --scheduler",
        ) from missing
    try:
        cast(Any, parse_address)(scheduler, strict=True)  # else Client tries it for 20 s
        client: Any = cast(Any, Client)(scheduler, timeout=_CONNECT_WITHIN_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise BadInput(
            "--scheduler", f"no Dask scheduler at {scheduler}", "tcp://HOST:8786"
        ) from error

    def results() -> Generator[Result]:
        with client:
            futures = [client.submit(function, *task, pure=False) for task in tasks]
            for future in cast(Any, as_completed)(futures, loop=client.loop):
                yield future.result()
                future.release()

    return results()
