"""Running the server until Ctrl-C or until the bench fails; nothing outlives it."""

from __future__ import annotations

import asyncio
import socket

import uvicorn

from bowden.studio.access import Access
from bowden.studio.bench import StudioBench
from bowden.studio.server import make_app

_LOOK_S = 0.2
_CLOSE_WITHIN_S = 1


def serve(bench: StudioBench, access: Access, listening: socket.socket) -> None:
    """Serve the page; returns when the bench has failed, raises KeyboardInterrupt on Ctrl-C."""
    server = make_server(bench, access)

    async def until_ended() -> None:
        looking = asyncio.create_task(_end_with(bench, server))
        try:
            await server.serve(sockets=[listening])
        finally:
            looking.cancel()

    bench.start()
    try:
        asyncio.run(until_ended())
    finally:
        bench.end()


def make_server(bench: StudioBench, access: Access) -> uvicorn.Server:
    """Make the server; the socket is the caller's."""
    config = uvicorn.Config(
        make_app(bench, access),
        lifespan="off",  # nothing to begin or end; Ctrl-C would be an error of it, with a traceback
        log_level="warning",
        access_log=False,
        timeout_graceful_shutdown=_CLOSE_WITHIN_S,
        ws="websockets-sansio",
        ws_max_size=1 << 16,
    )
    return uvicorn.Server(config)


async def _end_with(bench: StudioBench, server: uvicorn.Server) -> None:
    while bench.failure is None:
        await asyncio.sleep(_LOOK_S)
    server.should_exit = True
