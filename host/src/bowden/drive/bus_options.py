"""Which bus: python-can's own ``-i -c -b`` flags, and the simulated rig's bus when none is given.

Makes `BusOptions` from flags and opens a `Connection` from them. The default is UDP multicast on
this machine (nothing leaves it): it needs no CAN hardware, no kernel support and no root.
"""

from __future__ import annotations

import argparse
import errno
import os
import socket
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field

import can
from can.cli import add_bus_arguments as add_python_can_arguments

from bowden.drive.connection import Connection, TimeLimits
from bowden.errors import BadInput, DriveFailed

DEFAULT_INTERFACE = "udp_multicast"
DEFAULT_CHANNEL = "239.74.163.2"
_IP_MULTICAST_ALL = 49  # Linux


@dataclass(frozen=True)
class BusOptions:
    """How to open a bus, in python-can's terms.

    Parameters
    ----------
    interface, channel : str
        python-can's interface and channel.
    bitrate : int or None, bit/s
        None leaves it to the interface.
    further : mapping of str to object
        Further arguments of `can.Bus`.
    """

    interface: str = DEFAULT_INTERFACE
    channel: str | None = DEFAULT_CHANNEL
    bitrate: int | None = None
    further: Mapping[str, object] = field(default_factory=dict)

    def bus_arguments(self) -> dict[str, object]:
        """Return the keyword arguments of `can.Bus`."""
        arguments: dict[str, object] = {"interface": self.interface}
        if self.channel is not None:
            arguments["channel"] = self.channel
        if self.bitrate is not None:
            arguments["bitrate"] = self.bitrate
        if self.interface == DEFAULT_INTERFACE:
            arguments["hop_limit"] = 0  # no frame of a test rig leaves the machine
        return arguments | dict(self.further)

    def flags(self) -> list[str]:
        """Return the flags that give these options to another program."""
        flags = ["-i", self.interface]
        if self.channel is not None:
            flags += ["-c", str(self.channel)]
        if self.bitrate is not None:
            flags += ["-b", str(self.bitrate)]
        if self.further:
            flags += ["--bus-kwargs", *(f"{key}={value}" for key, value in self.further.items())]
        return flags

    def adapter(self) -> dict[str, str]:
        """Return what the side file keeps of it."""
        return {key: str(value) for key, value in self.bus_arguments().items()}


def add_bus_arguments(parser: argparse.ArgumentParser) -> None:
    """Add python-can's bus flags (``-i -c -b --bus-kwargs ...``) to a command."""
    add_python_can_arguments(
        parser,
        group_title="CAN bus (python-can's flags; default: the simulated rig's bus, "
        f"-i {DEFAULT_INTERFACE} -c {DEFAULT_CHANNEL})",
    )


def bus_options(args: argparse.Namespace) -> BusOptions:
    """Return the options that the flags of `add_bus_arguments` ask for.

    Raises
    ------
    BadInput
        A bit rate of zero or less.
    """
    given = vars(args)
    interface = given.get("interface", DEFAULT_INTERFACE)
    default_channel = DEFAULT_CHANNEL if interface == DEFAULT_INTERFACE else None
    bitrate = given.get("bitrate")
    if bitrate is not None and bitrate <= 0:
        raise BadInput("--bitrate", str(bitrate), "a bit rate above 0, such as 1000000")
    further = dict(given.get("bus_kwargs", {}))
    further |= {key: given[key] for key in ("fd", "data_bitrate", "timing") if key in given}
    return BusOptions(interface, given.get("channel", default_channel), bitrate, further)


def open_connection(options: BusOptions, limits: TimeLimits | None = None) -> Connection:
    """Open the bus; `limits` are those of the drives on it.

    Raises
    ------
    DriveFailed
        The interface is not there or cannot be opened.
    """
    try:
        bus = can.Bus(**options.bus_arguments())  # type: ignore[arg-type]
    except Exception as error:
        # Adapters raise whatever their drivers do: OSError, ImportError, TypeError, CanError...
        cause = error.__cause__ or error
        raise DriveFailed(
            f"cannot open the CAN bus ({options.interface}, channel {options.channel}): "
            f"{type(cause).__name__}: {cause}{_hint(options, cause)}"
        ) from error
    if options.interface == DEFAULT_INTERFACE:
        _keep_to_channel(bus)
    return Connection(bus, adapter=options.adapter(), limits=limits)


def _keep_to_channel(bus: can.BusABC) -> None:
    """Hear this channel only: by default, Linux delivers every group of the port to each socket."""
    with suppress(OSError), socket.socket(fileno=os.dup(bus.fileno())) as handle:
        handle.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)


def _hint(options: BusOptions, cause: BaseException) -> str:
    """Return advice on the usual cause."""
    number = cause.errno if isinstance(cause, OSError) else None
    if options.interface == DEFAULT_INTERFACE and number in (errno.ENODEV, errno.ENETUNREACH):
        return "; without a network, `ip route add 239.0.0.0/8 dev lo` (root) gives it a route"
    if options.interface == "socketcan" and number in (errno.ENODEV, errno.ENETDOWN):
        return f"; is it up? `ip link set {options.channel} up type can bitrate 1000000` (root)"
    if options.interface == "socketcan" and number == errno.EAFNOSUPPORT:
        return "; this kernel has no SocketCAN (module can_raw)"
    if isinstance(cause, ImportError | can.CanInterfaceNotImplementedError):
        extra = options.interface.replace("_", "-")
        return f"; `pip install 'python-can[{extra}]'` may bring what is missing"
    return ""
