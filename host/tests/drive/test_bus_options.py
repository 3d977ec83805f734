"""The bus: python-can's flags, the default, and the error when it cannot be opened."""

from __future__ import annotations

import argparse
import socket

import can
import pytest
from bowden.drive import bus_options as module
from bowden.drive.bus_options import (
    BusOptions,
    add_bus_arguments,
    bus_options,
    open_connection,
)
from bowden.errors import BadInput, DriveFailed


def parsed(*arguments: str) -> BusOptions:
    parser = argparse.ArgumentParser()
    add_bus_arguments(parser)
    return bus_options(parser.parse_args(arguments))


def test_the_default_never_leaves_this_machine() -> None:
    assert parsed().bus_arguments() == {
        "interface": "udp_multicast",
        "channel": "239.74.163.2",
        "hop_limit": 0,
    }


def test_flags_mean_what_they_mean_to_python_can() -> None:
    options = parsed("-i", "slcan", "-c", "/dev/ttyACM0", "-b", "500000")
    assert options.bus_arguments() == {
        "interface": "slcan",
        "channel": "/dev/ttyACM0",
        "bitrate": 500_000,
    }
    options = parsed("-i", "udp_multicast", "-c", "239.1.1.1", "--bus-kwargs", "port=4", "fd=false")
    assert options.bus_arguments() == {
        "interface": "udp_multicast",
        "channel": "239.1.1.1",
        "hop_limit": 0,
        "port": 4,
        "fd": False,
    }


@pytest.mark.parametrize(
    "arguments",
    [[], ["-i", "socketcan", "-c", "can0"], ["-c", "239.1.1.1", "--bus-kwargs", "port=4"]],
)
def test_the_rig_s_process_gets_the_same_bus_by_flags(arguments: list[str]) -> None:
    options = parsed(*arguments)
    assert parsed(*options.flags()) == options


def test_a_bit_rate_of_zero_is_refused() -> None:
    with pytest.raises(BadInput, match="--bitrate"):
        parsed("-b", "0")


@pytest.mark.parametrize(
    ("options", "cause", "told"),
    [
        (BusOptions(), OSError(19, "No such device"), "ip route add 239"),
        (BusOptions("socketcan", "can0"), OSError(19, "No such device"), "ip link set can0 up"),
        (BusOptions("socketcan", "can0"), OSError(97, "Address family"), "no SocketCAN"),
        (BusOptions("gs_usb", "0"), ModuleNotFoundError("No module named 'usb'"), "[gs-usb]"),
        (BusOptions("pcan", "PCAN_USBBUS1"), can.CanInitializationError("no dongle"), "no dongle"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_reported_with_advice(
    monkeypatch: pytest.MonkeyPatch, options: BusOptions, cause: Exception, told: str
) -> None:
    def refuse(**_arguments: object) -> None:
        raise can.CanInitializationError("python-can's own text") from cause

    monkeypatch.setattr(module.can, "Bus", refuse)
    with pytest.raises(DriveFailed) as failure:
        open_connection(options)
    assert told in str(failure.value)
    assert f"({options.interface}, channel {options.channel})" in str(failure.value)


def test_a_channel_of_the_default_bus_is_a_bus_of_its_own() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        port = free.getsockname()[1]
    mine, other = (
        BusOptions(channel=channel, further={"port": port})
        for channel in ("239.74.163.3", "239.74.163.4")
    )
    frames = [can.Message(arbitration_id=one, is_extended_id=False) for one in (0x7E1, 0x7E2)]
    try:
        with (
            open_connection(mine) as connection,
            can.Bus(**other.bus_arguments()) as elsewhere,
            can.Bus(**mine.bus_arguments()) as beside,
        ):
            heard: list[int] = []
            connection.set_tap(lambda frame: heard.append(frame.arbitration_id))
            for bus, frame in ((elsewhere, frames[0]), (beside, frames[1])):
                bus.send(frame)
                bus.recv(1.0)  # it has come back: the kernel has delivered it to all
            connection.listen(0.1)
    except (can.CanError, DriveFailed) as error:
        pytest.skip(f"no multicast on this machine: {error}")
    if not heard:
        pytest.skip("multicast does not come back on this machine")
    assert heard == [0x7E2]
