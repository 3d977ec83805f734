"""A drive in scripts and notebooks: connect, configure, record; a simulated rig to try it on.

`connect` and `Rig` are context managers: at the end of the block, however it ends, the bridge is
off, and the drive has been asked whether it is.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Literal

from bowden.api.offline import ModelLike, model_of
from bowden.drive import client
from bowden.drive.bus_options import DEFAULT_CHANNEL, DEFAULT_INTERFACE, BusOptions
from bowden.drive.capture import record as record_capture
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.configuration import store as store_configuration
from bowden.drive.dictionary import DEFAULT_NODE_ID
from bowden.drive.forecast import Forecast, forecast
from bowden.drive.meanings import CompensationLaw, ModeOfOperation
from bowden.drive.power import Run, power_state, safe_stop
from bowden.drive.reduced_model import DEFAULT_SEGMENTS, reduced_model
from bowden.drive.simulated_rig import own_rig
from bowden.errors import BadInput, DriveFailed
from bowden.recording.read import read_recording
from bowden.recording.recording import Recording

#: States of CiA 402 in which the bridge is off.
_OFF = ("switch on disabled", "ready to switch on", "not ready to switch on", "fault")


@contextmanager
def connect(
    interface: str = DEFAULT_INTERFACE,
    channel: str | None = None,
    bitrate: int | None = None,
    *,
    node_id: int = DEFAULT_NODE_ID,
    force: bool = False,
) -> Iterator[Drive]:
    """Open the bus and find the drive; at the end of the block its bridge is off.

    Parameters
    ----------
    interface, channel, bitrate : str, str, int
        python-can's ``-i -c -b``; by default the bus of ``bowden rig``.
    node_id : int
        1 .. 126.
    force : bool
        Also work with a drive whose object dictionary is another one.

    Raises
    ------
    DriveFailed
        No bus, no drive, another dictionary; or, at the end, a bridge that is not known to be off.
    """
    if channel is None and interface == DEFAULT_INTERFACE:
        channel = DEFAULT_CHANNEL
    with (
        client.connect(BusOptions(interface, channel, bitrate), node_id, force=force) as drive,
        left_safe(drive),
    ):
        yield drive


class Rig(AbstractContextManager[Drive]):
    """The simulated rig, running in real time as long as the ``with`` block; gives its drive.

    Needs the package `bowden-rig`. The rig is a process of its own on a bus that no other program
    uses; it runs the drive's real firmware.

    Parameters
    ----------
    target : str
        ``"native"``, or ``"emulated"`` in a checkout of the repository.
    seed : int
        Of the sensors' noise.
    settings : mapping of str to object, optional
        What to change in the rig: ``{"cable.extra_wrap_rad": 3}``; ``bowden rig --rig-help``.

    Examples
    --------
    >>> with bowden.Rig(seed=1) as drive:  # doctest: +SKIP
    ...     bowden.configure(drive, bowden.table_1())
    ...     run = bowden.record(drive, 10.0, enable="tunnel")
    """

    def __init__(
        self,
        target: str = "native",
        seed: int = 0,
        settings: Mapping[str, object] | None = None,
    ) -> None:
        self._arguments = ["--target", target, "--seed", str(seed)]
        for name, value in (settings or {}).items():
            self._arguments += ["--set", f"{name}={value}"]
        self._open = ExitStack()

    def __enter__(self) -> Drive:
        """Start the rig and return its drive."""
        with ExitStack() as stack:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="bowden-"))
            log_path = Path(folder) / "rig.log"
            drive = stack.enter_context(own_rig(BusOptions(), self._arguments, log_path))
            stack.enter_context(left_safe(drive))
            self._open = stack.pop_all()
        return drive

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Turn the bridge off and end the rig."""
        self._open.__exit__(kind, error, trace)


def configure(drive: Drive, model: ModelLike, *, segments: int = DEFAULT_SEGMENTS) -> int:
    """Write a model, reduced to what the drive supports, to the drive and read it back.

    Parameters
    ----------
    drive : Drive
    model : Model or path
    segments : int
        Of each cable, 1 .. 40.

    Returns
    -------
    int
        How many entries changed.

    Raises
    ------
    BadInput
        The drive cannot run the model; the message lists what it does not support.
    """
    reduced = reduced_model(model_of(model), segments)
    if reduced.left_out:
        raise BadInput("model", ", ".join(reduced.left_out), "what the drive supports")
    changes = difference(drive, reduced.entries)
    write(drive, changes)
    return len(changes)


@dataclass(frozen=True)
class AppliedModel:
    """What a drive took of a model.

    Parameters
    ----------
    changed : int
        Entries of the drive that were changed.
    left_out : tuple of str
        What the drive cannot run: its place in the model file, and why.
    forecast : Forecast
        How far the drive's model is from the full one, and what its compensation should leave.
    """

    changed: int
    left_out: tuple[str, ...]
    forecast: Forecast


def apply(
    drive: Drive,
    model: ModelLike,
    *,
    compensation: str | None = None,
    without_unsupported: bool = False,
    store: bool = False,
    segments: int = DEFAULT_SEGMENTS,
) -> AppliedModel:
    """Make a drive run a model: reduce it, write it, read it back, and say what to expect.

    Parameters
    ----------
    drive : Drive
        Its bridge is off.
    model : Model or path
    compensation : str, optional
        The law that is to work with it: ``"model-inversion"``, ``"coulomb"``...; by default the
        drive's own choice stays.
    without_unsupported : bool
        Leave out what the drive cannot run instead of refusing.
    store : bool
        Have the drive keep its configuration across power-off.
    segments : int
        Of each cable, 1 .. 40.

    Raises
    ------
    BadInput
        The drive cannot run the model; the message lists what it does not support.
    DriveFailed
        The drive refused; its old configuration is back.
    """
    full = model_of(model)
    reduced = reduced_model(full, segments)
    if reduced.left_out and not without_unsupported:
        raise BadInput("model", ", ".join(reduced.left_out), "what the drive supports")
    wanted = dict(reduced.entries)
    if compensation is not None:
        wanted["compensation_law"] = CompensationLaw.named(compensation, "compensation")
    expected = forecast(full, reduced.in_drive)
    changes = difference(drive, wanted)
    write(drive, changes)
    if store:
        store_configuration(drive)
    return AppliedModel(len(changes), reduced.left_out, expected)


def record(
    drive: Drive,
    duration_s: float,
    path: str | Path | None = None,
    *,
    enable: Literal["tunnel", "torque"] | None = None,
    torque_nm: float = 0.0,
) -> Recording:
    """Record a drive, and run it meanwhile if asked to.

    Parameters
    ----------
    drive : Drive
    duration_s : float, s
        More than 0.
    path : str or Path, optional
        Keep the raw CAN frames here (``.blf``), with a side file that lists every lost frame.
    enable : str, optional
        ``"tunnel"`` or ``"torque"`` turns the bridge on for the recording; by default the drive is
        only listened to.
    torque_nm : float, N m
        Motor torque, with ``enable="torque"``.

    Returns
    -------
    Recording
        In SI units, by the drive's clock.

    Raises
    ------
    DriveFailed
        The drive failed, restarted or vanished. Its bridge is off.
    """
    run = {
        None: None,
        "tunnel": Run(ModeOfOperation.TUNNEL),
        "torque": Run(ModeOfOperation.TORQUE, torque_nm),
    }[enable]
    with tempfile.TemporaryDirectory(prefix="bowden-") as folder:
        kept = Path(path) if path is not None else Path(folder) / "run.blf"
        record_capture(drive, kept, duration_s, run=run)
        return read_recording(kept)


@contextmanager
def left_safe(drive: Drive) -> Iterator[None]:
    """Check at the end of the block that the bridge is off; the first failure is raised."""
    try:
        yield
    except BaseException:
        with suppress(DriveFailed):
            _turn_off(drive)
        raise
    _turn_off(drive)


def _turn_off(drive: Drive) -> None:
    if power_state(drive.read_raw("statusword")) not in _OFF:
        safe_stop(drive)
