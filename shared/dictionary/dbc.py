"""The DBC: what runs on the bus by itself, for loggers and viewers (cantools, SavvyCAN, asammdf).

PDOs, heartbeat and EMCY of a node with the default id. SDO is left out: a DBC cannot express it.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping

from cantools.database.can import Database, Message, Node, Signal
from cantools.database.conversion import BaseConversion
from cantools.database.namedsignalvalue import NamedSignalValue

from shared.dictionary.dictionary import Dictionary, Variable
from shared.dictionary.schema import Pdo

_DRIVE = "bowden"
_HOST = "host"
_STATES = {0: "boot_up", 4: "stopped", 5: "operational", 127: "pre_operational"}


def text(dictionary: Dictionary) -> str:
    """Text of the DBC file."""
    node_id = dictionary.device.default_node_id
    messages = [_pdo(dictionary, f"RPDO{p.number}", p, _HOST) for p in dictionary.rpdos]
    messages += [_pdo(dictionary, f"TPDO{p.number}", p, _DRIVE) for p in dictionary.tpdos]
    messages.append(_emcy(dictionary, node_id))
    state = _signal("nmt_state", 0, 8, choices=_STATES)
    messages.append(_message("HEARTBEAT", 0x700 + node_id, [state], _DRIVE))
    messages.sort(key=lambda m: m.frame_id)
    nodes = [Node(name, None) for name in (_DRIVE, _HOST)]
    text = Database(messages=messages, nodes=nodes, version="").as_dbc_string()
    return text.replace("\r\n", "\n")


def _pdo(dictionary: Dictionary, name: str, pdo: Pdo, sender: str) -> Message:
    signals, start = [], 0
    for entry in pdo.map:
        variable = dictionary.find(entry)[1]
        signals.append(_value(entry.replace(".", "_"), start, variable))
        start += variable.type.bits
    frame_id = pdo.cob_id + dictionary.device.default_node_id
    return _message(name, frame_id, signals, sender, cycle_time=pdo.event_ms or None)


def _emcy(dictionary: Dictionary, node_id: int) -> Message:
    codes = {e.code: e.name for e in dictionary.emergencies}
    signals = [
        _signal("error_code", 0, 16, choices=codes),
        _signal("error_register", 16, 8),
        _signal("error_detail", 24, 32),
        _age(56),
    ]
    return _message("EMCY", 0x80 + node_id, signals, _DRIVE)


def _age(start: int) -> Signal:
    return Signal(
        name="error_age",
        start=start,
        length=8,
        byte_order="little_endian",
        conversion=BaseConversion.factory(scale=0.01),
        unit="s",
        comment="how long ago it was; 2.55 s and more",
        receivers=[_HOST],
    )


def _message(
    name: str, frame_id: int, signals: list[Signal], sender: str, cycle_time: int | None = None
) -> Message:
    return Message(
        frame_id=frame_id,
        name=name,
        length=(max(s.start + s.length for s in signals) + 7) // 8,
        signals=signals,
        senders=[sender],
        cycle_time=cycle_time,
        strict=True,
    )


def _value(name: str, start: int, variable: Variable) -> Signal:
    scale = 1.0 if variable.scale is None else variable.scale
    return Signal(
        name=name,
        start=start,
        length=variable.type.bits,
        byte_order="little_endian",
        is_signed=variable.type.signed,
        conversion=BaseConversion.factory(scale=scale, choices=_choices(variable)),
        minimum=_decimal(variable.low * scale),
        maximum=_decimal(variable.high * scale),
        unit=variable.unit,
        comment=_comment(variable),
        receivers=[_HOST if variable.pdo == "tx" else _DRIVE],
    )


def _choices(variable: Variable) -> OrderedDict[int, str | NamedSignalValue] | None:
    enumeration = variable.enumeration
    if enumeration is None or enumeration.is_bits:
        return None
    return OrderedDict((meaning.number, meaning.name) for meaning in enumeration.meanings)


def _comment(variable: Variable) -> str | None:
    """Return the doc, with the bits, for which a DBC has no table of its own."""
    enumeration = variable.enumeration
    if enumeration is None or not enumeration.is_bits:
        return variable.doc or None
    bits = ", ".join(f"{meaning.number} {meaning.name}" for meaning in enumeration.meanings)
    return f"{variable.doc}; bits: {bits}"


def _decimal(limit: float) -> float:
    """Without the last binary digits of a product: 4294.967295 and not 4294.9672949999995."""
    return float(f"{limit:.12g}")


def _signal(name: str, start: int, length: int, choices: Mapping[int, str] | None = None) -> Signal:
    return Signal(
        name=name,
        start=start,
        length=length,
        byte_order="little_endian",
        conversion=BaseConversion.factory(choices=OrderedDict(choices) if choices else None),
        receivers=[_HOST],
    )
