"""Other nodes of the bus, described by DBC or EDS and a few lines of YAML, as channels.

    strain gauge:
      dbc: gauge.dbc
      channels:
        handle_force_n: {message: Gauge, signal: Force}
    imu:
      eds: imu.eds
      node: 32
      channels:
        forearm_rate_rad_per_s: {object: '6000h:1', scale: 0.001}

What the description says is resolved here, when recording begins, into plain places of bits; a
capture never needs the description again. `scale` and `offset` come on top of a DBC's own.
All contradictions are reported together.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from bowden.errors import BadInput
from bowden.recording.channels import MAIN_CHANNELS, TIME
from bowden.recording.side_file import ForeignSignal, ForeignSource
from bowden.recording.yaml_file import FilePart, nearest, read_yaml

WHAT = "a description of other nodes (bowden record --help)"
_OBJECT = re.compile(r"(?:0x)?([0-9a-f]{4})h?(?:[:.]([0-9]{1,3}))?", re.IGNORECASE)
_CHANNEL = r"^[a-z][a-z0-9_]*$"
_PDO_DOES_NOT_EXIST, _EXTENDED = 1 << 31, 1 << 29
_SIGNED_TYPES = (0x02, 0x03, 0x04, 0x10, 0x12, 0x13, 0x14, 0x15)  # CiA 301 table 44
_FLOAT_TYPES = (0x08, 0x11)


class ForeignChannel(FilePart):
    """Where a channel's value is: a DBC's message and signal, or an object of an EDS."""

    message: str | None = None
    signal: str | None = None
    object: str | None = None
    scale: float = Field(default=1.0)
    offset: float = 0.0
    unit: str | None = None


class ForeignNode(FilePart):
    """One node."""

    dbc: str | None = None
    eds: str | None = None
    node: int | None = Field(default=None, ge=1, le=127)
    channels: dict[str, ForeignChannel] = Field(min_length=1)

    @model_validator(mode="after")
    def _one_description(self) -> ForeignNode:
        if (self.dbc is None) == (self.eds is None):
            raise ValueError("needs one of dbc and eds")
        if self.eds is not None and self.node is None:
            raise ValueError("an eds needs node: its node id")
        return self


class ForeignFile(FilePart):
    """The whole file: nodes by name."""

    nodes: dict[str, ForeignNode]

    @model_validator(mode="before")
    @classmethod
    def _by_name(cls, tree: Any) -> Any:  # noqa: ANN401  (whatever YAML holds)
        return {"nodes": tree} if isinstance(tree, dict) and "nodes" not in tree else tree


def read_foreign(path: Path) -> list[ForeignSource]:
    """Read the description of other nodes.

    Returns
    -------
    list of ForeignSource
        One a frame.

    Raises
    ------
    BadInput
        The file, a DBC that contradicts itself, an EDS without that object in a TPDO, a name that
        is taken; with the node and the channel.
    """
    content = read_yaml(path, ForeignFile, WHAT)
    sources: list[ForeignSource] = []
    taken = {TIME, *MAIN_CHANNELS}
    for name, node in content.nodes.items():
        for channel in node.channels:
            where = f"{path}, {name}.{channel}"
            if not re.match(_CHANNEL, channel):
                raise BadInput(
                    where, "that name", "small letters, digits, _ and the unit at its end"
                )
            if channel in taken:
                raise BadInput(where, "a name that is taken", "another name")
            taken.add(channel)
        by_dbc = node.dbc is not None
        signals = _of_dbc(path, name, node) if by_dbc else _of_eds(path, name, node)
        sources += _by_frame(name, signals)
    return sources


_Found = tuple[ForeignSource, ForeignSignal]


def _by_frame(name: str, found: Iterator[_Found]) -> list[ForeignSource]:
    """Join the signals of each frame."""
    frames: dict[tuple[int, bool], ForeignSource] = {}
    for frame, signal in found:
        key = frame.cob_id, frame.extended
        known = frames.get(key, frame)
        frames[key] = known.model_copy(update={"signals": [*known.signals, signal]})
    several = len(frames) > 1
    return [
        one.model_copy(update={"name": f"{name} {one.cob_id:X}h" if several else name})
        for one in frames.values()
    ]


def _of_dbc(path: Path, name: str, node: ForeignNode) -> Iterator[_Found]:
    dbc_path = path.parent / str(node.dbc)
    try:
        import cantools  # noqa: PLC0415  (an extra)
    except ImportError as error:
        raise BadInput(str(dbc_path), "no package cantools", "pip install 'bowden[dbc]'") from error
    try:
        database: Any = cantools.database.load_file(dbc_path, database_format="dbc", strict=True)
    except OSError as error:
        raise BadInput(str(dbc_path), error.strerror or str(error), "a DBC file") from error
    except Exception as error:
        # cantools and its parser raise errors of several kinds.
        problem = " ".join(str(error).split())
        raise BadInput(str(dbc_path), problem, "a DBC that does not contradict itself") from error
    messages = {message.name: message for message in database.messages}
    for channel, wanted in node.channels.items():
        where = f"{path}, {name}.{channel}"
        if wanted.message is None or wanted.signal is None:
            raise BadInput(where, "no message or no signal", "both: names of the DBC")
        message = messages.get(wanted.message)
        if message is None:
            raise BadInput(where, wanted.message, nearest(wanted.message, list(messages)))
        signals = {signal.name: signal for signal in message.signals}
        signal = signals.get(wanted.signal)
        if signal is None:
            raise BadInput(where, wanted.signal, nearest(wanted.signal, list(signals)))
        if signal.multiplexer_ids or message.length > 8:
            raise BadInput(where, "a multiplexed signal or a CAN FD frame", "a plain signal")
        if wanted.unit is not None and wanted.unit != (signal.unit or ""):
            raise BadInput(where, f"unit {signal.unit!r} in the DBC", f"unit {wanted.unit!r}")
        little = signal.byte_order == "little_endian"
        if little:
            shift = signal.start
        else:  # start is the highest bit; counted from the first byte's bit 7
            shift = 64 - (8 * (signal.start // 8) + 7 - signal.start % 8) - signal.length
        yield (
            ForeignSource(
                name=name,
                cob_id=message.frame_id,
                extended=message.is_extended_frame,
                length=message.length,
                signals=[],
                described_by=f"{dbc_path.name}: {message.name}",
                period_s=message.cycle_time / 1e3 if message.cycle_time else None,
            ),
            ForeignSignal(
                column=channel,
                shift=shift,
                bits=signal.length,
                little_endian=little,
                kind=_kind(signal.is_signed, signal.is_float),
                scale=float(signal.scale) * wanted.scale,
                offset=float(signal.offset) * wanted.scale + wanted.offset,
            ),
        )


def _of_eds(path: Path, name: str, node: ForeignNode) -> Iterator[_Found]:
    import canopen  # noqa: PLC0415  (slow to import)

    eds_path = path.parent / str(node.eds)
    try:
        dictionary: Any = canopen.import_od(str(eds_path), node_id=node.node)
    except OSError as error:
        raise BadInput(str(eds_path), error.strerror or str(error), "an EDS file") from error
    except Exception as error:
        # The parser raises errors of several kinds.
        problem = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(str(eds_path), problem, "an EDS (CiA 306)") from error
    mapped = dict(_mapped_objects(dictionary, node.node or 0))
    for channel, wanted in node.channels.items():
        where = f"{path}, {name}.{channel}"
        match = _OBJECT.fullmatch(wanted.object or "")
        if match is None:
            raise BadInput(where, repr(wanted.object), "object: an address such as '6000h:1'")
        key = int(match[1], 16), int(match[2] or 0)
        if key not in mapped:
            there = ", ".join(f"{index:04X}h:{sub}" for index, sub in mapped)
            raise BadInput(where, f"{wanted.object} in no TPDO of {eds_path.name}", there or "none")
        frame, shift, bits, data_type = mapped[key]
        kind = _kind(data_type in _SIGNED_TYPES, data_type in _FLOAT_TYPES)
        yield (
            frame.model_copy(update={"name": name, "described_by": eds_path.name}),
            ForeignSignal(
                column=channel,
                shift=shift,
                bits=bits,
                little_endian=True,
                kind=kind,
                scale=wanted.scale,
                offset=wanted.offset,
            ),
        )


def _mapped_objects(
    dictionary: Any,  # noqa: ANN401  (canopen is untyped)
    node_id: int,
) -> Iterator[tuple[tuple[int, int], tuple[ForeignSource, int, int, int]]]:
    """Yield each object that a TPDO carries by default: its frame, place, size and type."""
    for number in range(512):
        if 0x1800 + number not in dictionary or 0x1A00 + number not in dictionary:
            continue
        cob_id = dictionary[0x1800 + number][1].default or 0
        count = dictionary[0x1A00 + number][0].default or 0
        if cob_id & _PDO_DOES_NOT_EXIST:
            continue
        entries = []
        shift = 0
        for place in range(1, count + 1):
            mapping = dictionary[0x1A00 + number][place].default or 0
            index, sub, bits = mapping >> 16, mapping >> 8 & 0xFF, mapping & 0xFF
            entries.append((index, sub, bits, shift))
            shift += bits
        if not 0 < shift <= 64:
            continue
        frame = ForeignSource(
            name=str(node_id),
            cob_id=cob_id & 0x1FFFFFFF if cob_id & _EXTENDED else cob_id & 0x7FF,
            extended=bool(cob_id & _EXTENDED),
            length=(shift + 7) // 8,
            signals=[],
        )
        for index, sub, bits, start in entries:
            if (variable := dictionary.get_variable(index, sub)) is not None:
                yield (index, sub), (frame, start, bits, variable.data_type)


def _kind(is_signed: bool, is_float: bool) -> Any:  # noqa: ANN401  (the literal of ForeignSignal)
    return "float" if is_float else "signed" if is_signed else "unsigned"
