"""Recordings for other tools: Parquet, MATLAB (.mat), MCAP (robotics) and MF4 (automotive).

One function a form, each whole or not at all; names keep their unit, metadata goes along. The
packages are extras, imported when used. `csv_file` has the exchange form.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from types import ModuleType

from bowden.errors import BadInput
from bowden.recording.atomic import replace_whole
from bowden.recording.channels import TIME, channel
from bowden.recording.recording import Recording
from bowden.recording.source_bytes import ending, is_packed

_MATLAB_NAME = 63  # characters of a variable


def write_recording(recording: Recording, path: Path) -> None:
    """Write a recording in the form that the path's ending says.

    Raises
    ------
    BadInput
        Another ending, a package that is not installed, or a path that cannot be written.
    """
    writer = WRITERS.get(ending(path))
    if writer is None or (is_packed(path) and writer is not _write_csv):
        raise BadInput(str(path), f"a name that ends in {path.suffix!r}", ", ".join(WRITERS))
    writer(recording, path)


def write_parquet(recording: Recording, path: Path) -> None:
    """Write a Parquet file: a column a channel; unit and metadata in the schema."""
    pyarrow = _package("pyarrow", "parquet", path)
    parquet = _package("pyarrow.parquet", "parquet", path)
    columns = {TIME: recording.time_s, **recording.channels}
    fields = [
        pyarrow.field(name, pyarrow.float64(), metadata={"unit": channel(name).unit})
        for name in columns
    ]
    schema = pyarrow.schema(fields, metadata=dict(recording.metadata))
    table = pyarrow.table(columns, schema=schema)
    with replace_whole(path) as temporary:
        parquet.write_table(table, temporary)


def write_mat(recording: Recording, path: Path) -> None:
    """Write a MATLAB file (version 5): a column vector a channel, structs `units`, `metadata`."""
    from scipy.io import savemat  # noqa: PLC0415  (slow to import)

    columns = {TIME: recording.time_s, **recording.channels}
    names = {name: _matlab_name(name) for name in columns}
    content: dict[str, object] = {names[name]: values for name, values in columns.items()}
    content["units"] = {names[name]: channel(name).unit for name in columns}
    content["metadata"] = {_matlab_name(key): text for key, text in recording.metadata.items()}
    with replace_whole(path) as temporary, temporary.open("wb") as file:
        savemat(file, content, long_field_names=True, oned_as="column", do_compression=True)


def write_mcap(recording: Recording, path: Path) -> None:
    """Write an MCAP file: a JSON message a sample on ``/bowden/sample``, marks on ``/bowden/mark``.

    Times are UTC: when the recording started (metadata) plus its own time.
    """
    writing = _package("mcap.writer", "mcap", path)
    start_ns = _start_ns(recording)
    columns = {TIME: recording.time_s, **recording.channels}
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    with replace_whole(path) as temporary, temporary.open("wb") as file:
        writer = writing.Writer(file)
        writer.start(profile="", library="bowden")
        units = {name: {"type": "number", "description": channel(name).unit} for name in columns}
        samples = _topic(writer, "sample", units)
        marks = _topic(writer, "mark", {"text": {"type": "string"}})
        writer.add_metadata("recording", dict(recording.metadata))
        for number, row in enumerate(rows):
            at_ns = start_ns + round(row[0] * 1e9)
            data = json.dumps(dict(zip(columns, row, strict=True))).encode()
            writer.add_message(samples, at_ns, data, at_ns, sequence=number)
        for time_s, text in _marks(recording):
            at_ns = start_ns + round(time_s * 1e9)
            writer.add_message(marks, at_ns, json.dumps({"text": text}).encode(), at_ns)
        writer.finish()


def write_mf4(recording: Recording, path: Path) -> None:
    """Write an MDF 4 file: a signal with its unit a channel; metadata in the header's comment."""
    asammdf = _package("asammdf", "mdf", path)
    signals = [
        asammdf.Signal(
            samples=values,
            timestamps=recording.time_s,
            name=name,
            unit=channel(name).unit,
            comment=channel(name).purpose,
        )
        for name, values in recording.channels.items()
    ]
    buffer = io.BytesIO()
    with asammdf.MDF(version="4.10") as file:
        file.append(signals, comment="bowden")
        file.start_time = datetime.fromtimestamp(_start_ns(recording) / 1e9, UTC)
        file.header.comment = "\n".join(
            f"{key}: {text}" for key, text in recording.metadata.items()
        )
        file.save(buffer)
    with replace_whole(path) as temporary:
        temporary.write_bytes(buffer.getvalue())


def _write_csv(recording: Recording, path: Path) -> None:
    from bowden.recording.csv_file import write_csv  # noqa: PLC0415  (all others do without)

    write_csv(recording, path)


#: What each ending is written by.
WRITERS: dict[str, Callable[[Recording, Path], None]] = {
    ".csv": _write_csv,
    ".parquet": write_parquet,
    ".mat": write_mat,
    ".mcap": write_mcap,
    ".mf4": write_mf4,
}


def _package(name: str, extra: str, path: Path) -> ModuleType:
    import importlib  # noqa: PLC0415

    try:
        return importlib.import_module(name)
    except ImportError as error:
        todo = f"pip install 'bowden[{extra}]'"
        raise BadInput(str(path), f"no package {name.partition('.')[0]}", todo) from error


def _topic(writer: object, name: str, properties: dict[str, dict[str, str]]) -> int:
    schema = {"type": "object", "properties": properties}
    data = json.dumps(schema).encode()
    schema_id = writer.register_schema(f"bowden.{name}", "jsonschema", data)  # type: ignore[attr-defined]
    channel_id: int = writer.register_channel(f"/bowden/{name}", "json", schema_id)  # type: ignore[attr-defined]
    return channel_id


def _start_ns(recording: Recording) -> int:
    """Return when it started, ns since 1970 UTC; 0 where it is unknown."""
    try:
        started = datetime.fromisoformat(recording.metadata["started"])
    except (KeyError, ValueError):
        return 0
    return int(started.timestamp() * 1e9)


def _marks(recording: Recording) -> list[tuple[float, str]]:
    """Return the marks in the metadata: ``3.120 s touched; 4.000 s let go``."""
    found = re.findall(
        r"(?:^|; )([\d.]+) s (.*?)(?=; [\d.]+ s |$)", recording.metadata.get("marks", "")
    )
    return [(float(time_s), text) for time_s, text in found]


def _matlab_name(name: str) -> str:
    plain = re.sub(r"\W", "_", name)[:_MATLAB_NAME]
    return plain if plain[:1].isalpha() else f"x{plain}"[:_MATLAB_NAME]
