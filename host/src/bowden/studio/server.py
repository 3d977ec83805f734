"""The page over HTTP: static files, reports of the folder, and one WebSocket for everything live.

Only `Access` decides who gets an answer. The first page controls the drive; a second one can watch
and stop it. Forty times a second each page gets the new samples and the state.
"""

from __future__ import annotations

import asyncio
import json
import math
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from bowden.errors import BadInput
from bowden.studio.access import COOKIE, Access
from bowden.studio.bench import StudioBench
from bowden.studio.orders import Alive, StopDrive, read_order

PICTURES_PER_S = 40.0
_STATE_EVERY = 3  # pictures
_REFUSED = "open the address that `bowden studio` has printed; it works once, in one browser"
PAGE = ("index.html", "plot.js", "studio.js", "studio.css")
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}
#: Nothing from elsewhere: no script, no font, no connection but to this server.
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' data:; "
    "connect-src 'self'; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
#: A report brings its own scripts and data; it may show them and reach nothing.
_REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'unsafe-inline'; img-src data: blob:; frame-ancestors 'self'"
)


def make_app(bench: StudioBench, access: Access) -> Starlette:
    """Make the application for one bench."""
    studio = _Studio(bench, access)
    return Starlette(
        routes=[
            Route("/", studio.page),
            Route("/page/{name}", studio.static),
            Route("/report/{name}", studio.report),
            WebSocketRoute("/live", studio.live),
        ]
    )


class _Studio:
    def __init__(self, bench: StudioBench, access: Access) -> None:
        self.bench = bench
        self.access = access
        self._owner: WebSocket | None = None

    async def page(self, request: Request) -> Response:
        """Exchange the token for the cookie, then give the page."""
        if request.headers.get("host") != self.access.netloc:
            return _refuse()
        token = request.query_params.get("token")
        if token is not None and self.access.take_token(token):
            response = RedirectResponse("/", status_code=303)
            response.set_cookie(COOKIE, self.access.cookie, httponly=True, samesite="strict")
            return response
        return await self.static(request)

    async def static(self, request: Request) -> Response:
        """Give a file of the page."""
        if not self._is_ours(request):
            return _refuse()
        name = request.path_params.get("name", "index.html")
        found = files("bowden.studio").joinpath("page", name)
        if name not in PAGE or not found.is_file():
            return PlainTextResponse("not here", status_code=404)
        headers = {"Content-Security-Policy": _POLICY, "Cache-Control": "no-store"}
        return Response(found.read_bytes(), media_type=_TYPES[Path(name).suffix], headers=headers)

    async def report(self, request: Request) -> Response:
        """Give a report of the folder."""
        if not self._is_ours(request):
            return _refuse()
        name = str(request.path_params["name"])
        path = self.bench.folder / name
        if Path(name).name != name or path.suffix != ".html" or not path.is_file():
            return PlainTextResponse("no such report", status_code=404)
        headers = {"Content-Security-Policy": _REPORT_POLICY}
        return FileResponse(path, media_type=_TYPES[".html"], headers=headers)

    async def live(self, socket: WebSocket) -> None:
        """Send what is new, take orders; a page that leaves has no drive any more."""
        told = socket.headers
        if told.get("origin") != self.access.origin or not self.access.is_ours(
            told.get("host", ""), told.get("cookie", ""), told.get("origin")
        ):
            await socket.close(code=1008)
            return
        await socket.accept()
        if self._owner is None:
            self._owner = socket
        sending = asyncio.create_task(self._send(socket))
        try:
            while True:
                await self._take(socket, await socket.receive_text())
        except WebSocketDisconnect:
            pass
        finally:
            sending.cancel()
            with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await sending
            if self._owner is socket:
                self._owner = None
                if self.bench.session.snapshot().is_ours:
                    self.bench.obey(StopDrive(do="stop"))

    async def _take(self, socket: WebSocket, text: str) -> None:
        try:
            order = read_order(text)
            if self._owner is None and not isinstance(order, StopDrive):
                self._owner = socket  # the page that had the drive has left
            if socket is not self._owner and not isinstance(order, StopDrive):
                if not isinstance(order, Alive):
                    raise BadInput("order", "a second page", "the first page, or stop here")
                return
            self.bench.obey(order)
        except BadInput as problem:
            await socket.send_text(json.dumps({"refused": str(problem)}))
        except ValueError as problem:  # a model that cannot be read
            await socket.send_text(json.dumps({"refused": " ".join(str(problem).split())}))

    async def _send(self, socket: WebSocket) -> None:
        loop = asyncio.get_running_loop()
        await socket.send_text(json.dumps({"experiments": self.bench.experiments()}))
        picture = 0
        last = self.bench.session.snapshot().samples
        tunnel: dict[str, float] = {}
        due = loop.time()
        while True:
            rows = self.bench.session.samples_after(last)
            if rows and rows[-1][0] < last:
                last = int(rows[-1][0])
            message: dict[str, Any] = {"rows": [[_plain(value) for value in row] for row in rows]}
            if rows:
                last = int(rows[-1][0])
            if picture % _STATE_EVERY == 0:
                message["now"] = {**self.bench.now(), "has_drive": socket is self._owner}
                if message["now"]["tunnel"] != tunnel:
                    tunnel = message["now"]["tunnel"]
                    message["curve"] = self.bench.tunnel_curve()
            await socket.send_text(json.dumps(message, default=str))
            picture += 1
            due += 1.0 / PICTURES_PER_S
            await asyncio.sleep(max(due - loop.time(), 0.0))

    def _is_ours(self, request: Request) -> bool:
        told = request.headers
        return self.access.is_ours(told.get("host", ""), told.get("cookie", ""), told.get("origin"))


def _plain(value: float) -> float | None:
    return round(value, 6) if math.isfinite(value) else None


def _refuse() -> Response:
    return PlainTextResponse(_REFUSED, status_code=403)
