"""Access to the page, control of the drive, and refusals; no browser needed."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from bowden.cli.main import main
from bowden.errors import BadInput
from bowden.studio.access import COOKIE, HOST
from bowden.studio.orders import read_order
from bowden.studio.serve import make_server
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from .conftest import Studio

HANGS_S = 600.0  # only ends a test that hangs


def get(studio: Studio, path: str, **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection(studio.access.netloc, timeout=HANGS_S)
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request("GET", path, headers=given)
    response = connection.getresponse()
    response.body = response.read()
    connection.close()
    return response


def cookie(studio: Studio) -> str:
    return f"{COOKIE}={studio.access.cookie}"


@contextmanager
def page(studio: Studio) -> Iterator[ClientConnection]:
    with connect(
        f"ws://{studio.access.netloc}/live",
        origin=studio.access.origin,
        additional_headers={"Cookie": cookie(studio)},
        open_timeout=HANGS_S,
    ) as socket:
        yield socket


def until(socket: ClientConnection, key: str, wanted: object = None) -> dict:
    """Read messages until the state says so; a page that reads is alive."""
    while True:
        socket.send(json.dumps({"do": "alive"}))
        message = json.loads(socket.recv(timeout=HANGS_S))
        if key == "refused" and "refused" in message:
            return message
        now = message.get("now")
        if now is not None and key in now and (now[key] == wanted or wanted is None):
            return now


def test_the_address_works_once_and_only_with_its_token(studio: Studio) -> None:
    assert get(studio, "/").status == 403
    assert get(studio, "/?token=wrong").status == 403
    address = urlsplit(studio.access.address)
    first = get(studio, f"/?{address.query}")
    assert first.status == 303
    given = first.headers["set-cookie"]
    assert "HttpOnly" in given
    assert "samesite=strict" in given.lower()
    assert get(studio, f"/?{address.query}").status == 403
    got = get(studio, "/", Cookie=given.partition(";")[0])
    assert got.status == 200
    assert b"STOP" in got.body
    assert "script-src 'self'" in got.headers["content-security-policy"]


def test_another_origin_and_another_host_name_get_nothing(studio: Studio) -> None:
    assert get(studio, "/", Cookie=cookie(studio)).status == 200
    assert get(studio, "/", Cookie=cookie(studio), Host="evil.example:80").status == 403
    assert get(studio, "/", Cookie=cookie(studio), Origin="http://evil.example").status == 403
    assert get(studio, "/", Cookie=f"{COOKIE}=guess").status == 403
    live = f"ws://{studio.access.netloc}/live"
    for origin, told in (
        ("http://evil.example", cookie(studio)),
        (None, cookie(studio)),
        (studio.access.origin, f"{COOKIE}=guess"),
    ):
        with (
            pytest.raises((InvalidStatus, ConnectionClosed)),
            connect(live, origin=origin, additional_headers={"Cookie": told}) as socket,
        ):
            socket.recv(timeout=HANGS_S)


def test_only_the_page_and_reports_of_the_folder_are_given(studio: Studio) -> None:
    (studio.folder / "report.html").write_text("<p>fine</p>")
    (studio.folder.parent / "secret.html").write_text("secret")
    report = get(studio, "/report/report.html", Cookie=cookie(studio))
    assert report.status == 200
    assert "sandbox" in report.headers["content-security-policy"]
    for path in ("/report/..%2Fsecret.html", "/report/rig.yaml", "/page/..%2Fserver.py"):
        assert get(studio, path, Cookie=cookie(studio)).status == 404
    assert get(studio, "/report/report.html").status == 403


def test_a_page_runs_stops_and_records_the_drive(studio: Studio) -> None:
    with page(studio) as socket:
        now = until(socket, "has_drive", True)
        assert now["node_id"] == 16
        socket.send(json.dumps({"do": "start", "mode": "tunnel"}))
        until(socket, "is_ours", True)
        assert studio.motor_is_on
        socket.send(json.dumps({"do": "record", "name": "run_1"}))
        until(socket, "recording", str(studio.folder / "run_1.blf"))
        socket.send(json.dumps({"do": "mark", "text": "touched"}))
        socket.send(json.dumps({"do": "end_recording"}))
        now = until(socket, "last_recording", str(studio.folder / "run_1.blf"))
        assert now["recordings"] == ["run_1.blf"]
        socket.send(json.dumps({"do": "stop"}))
        until(socket, "is_on", False)
        assert not studio.motor_is_on


def test_a_page_runs_an_experiment_that_ends_by_itself(studio: Studio) -> None:
    with page(studio) as socket:
        offered = json.loads(socket.recv(timeout=60))["experiments"]
        assert [one["name"] for one in offered] == ["1a", "2", "3", "torque"]
        order = {"do": "run", "experiment": "2", "values": {"duration_s": 0.5}, "name": "run_1"}
        socket.send(json.dumps(order))
        until(socket, "is_ours", True)
        now = until(socket, "last_recording", str(studio.folder / "run_1.blf"))
        assert not studio.motor_is_on
        assert now["recordings"] == ["run_1.blf"]
        for wrong in ({"experiment": "9"}, {"values": {"duration_s": -1}}):
            socket.send(json.dumps({**order, "name": "run_2", **wrong}))
            until(socket, "refused")
        assert not studio.motor_is_on


def test_the_configuration_is_shown_changed_and_drawn_anew(studio: Studio) -> None:
    with page(studio) as socket:
        values = {"tunnel_half_width": 0.1, "tunnel_angle_source": "load"}
        socket.send(json.dumps({"do": "configure", "values": values}))
        now = until(socket, "message", "1 entry would change")
        assert now["changes"][0]["after"] == pytest.approx(0.1)
        socket.send(json.dumps({"do": "configure", "values": values, "dry_run": False}))
        now = until(socket, "message", "1 entry changed and read back")
        assert now["tunnel"]["tunnel_half_width"] == pytest.approx(0.1)
        # Inside the wider dead zone nothing is prescribed any more.
        angles, torques = studio.bench.tunnel_curve()
        assert all(t == 0 for a, t in zip(angles, torques, strict=True) if abs(a) < 0.099)


def test_a_second_page_can_watch_and_stop(studio: Studio) -> None:
    with page(studio) as first:
        until(first, "has_drive", True)
        with page(studio) as second:
            second.send(json.dumps({"do": "start", "mode": "tunnel"}))
            assert "a second page" in until(second, "refused")["refused"]
            first.send(json.dumps({"do": "start", "mode": "tunnel"}))
            until(first, "is_ours", True)
            second.send(json.dumps({"do": "stop"}))
            until(first, "is_on", False)


def test_a_page_that_goes_stops_the_motor(
    studio: Studio, unwatched: Callable[[Studio], str]
) -> None:
    with page(studio) as socket:
        socket.send(json.dumps({"do": "start", "mode": "tunnel"}))
        until(socket, "is_ours", True)
    unwatched(studio)


def test_a_page_that_hangs_stops_the_motor(
    studio: Studio, unwatched: Callable[[Studio], str]
) -> None:
    with page(studio) as socket:
        socket.send(json.dumps({"do": "start", "mode": "tunnel"}))
        until(socket, "is_ours", True)
        assert unwatched(studio) == "stopped: the page was not watched"  # open, but sends nothing


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("nonsense", "JSON"),
        ("[]", "order"),
        ('{"do": "explode"}', "explode"),
        ('{"do": "start", "mode": "tunnel", "torque": 1}', "torque"),
        ('{"do": "record", "name": "../run"}', "name"),
        ('{"do": "configure", "values": {}}', "values"),
        ('{"do": "start", "mode": "torque", "torque_nm": 1e999}', "finite"),
    ],
)
def test_an_order_that_does_not_fit_is_refused(text: str, told: str) -> None:
    with pytest.raises(BadInput, match=told):
        read_order(text)


def test_orders_that_cannot_be_carried_out_are_answered(studio: Studio) -> None:
    with page(studio) as socket:
        for order, told in (
            ({"do": "compare", "recordings": ["no.blf"]}, "no recording of the folder"),
            ({"do": "apply_model"}, "a diagnosis first"),
            ({"do": "start", "mode": "torque"}, "tunnel, or torque with a torque"),
        ):
            socket.send(json.dumps(order))
            assert told in until(socket, "refused")["refused"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ["--folder", "no"],
            "no folder; accepted: a folder for recordings that is there (mkdir no)",
        ),
        (["--model", "no.yaml"], "no.yaml: found No such file"),
        (["--model", "/dev/null"], "found no keys, accepted: rig, friction"),
        (["--port", "99999999"], "--port"),
    ],
)
def test_a_studio_that_cannot_start_says_why(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    given = ["--folder", str(tmp_path)] if "--folder" not in arguments else []
    assert main(["studio", "--no-browser", *given, *arguments]) == 2
    assert told in capsys.readouterr().err


def test_a_port_in_use_is_named(studio: Studio, capsys: pytest.CaptureFixture[str]) -> None:
    port = studio.access.netloc.partition(":")[2]
    arguments = ["studio", "--no-browser", "--folder", str(studio.folder), "--port", port]
    assert main(arguments) == 2
    assert port in capsys.readouterr().err


def test_a_second_ctrl_c_is_no_traceback(studio: Studio, capfd: pytest.CaptureFixture[str]) -> None:
    async def stopped_twice() -> None:
        with socket.socket() as listening:
            listening.bind((HOST, 0))
            listening.listen()
            server = make_server(studio.bench, studio.access)
            serving = asyncio.create_task(server.serve([listening]))
            while not server.started:
                await asyncio.sleep(0)
            server.should_exit = server.force_exit = True  # what uvicorn does at the second signal
            await serving

    asyncio.run(stopped_twice())
    assert "Traceback" not in capfd.readouterr().err
