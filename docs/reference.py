"""Writes the generated pages of the site: command line, Python interface, model file, recordings.

`conf` calls it before Sphinx reads the sources. Each page comes from what the program itself goes
by: the argument parser, the names of `import bowden`, the schema of model files, the registry of
channels. The folder `docs/reference` is not kept in the repository.
"""

from __future__ import annotations

import argparse
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

import bowden
from bowden.cli.main import COMMANDS, build_parser
from bowden.model.effects import CATALOGUE
from bowden.model.model_file import LAW_KEYS, SOLVER_KEYS, ModelFile, Part, Quantity
from bowden.recording.channels import CHANNELS

CLASSES = ("Model", "Recording", "Rig", "BadInput", "DriveFailed", "ModelError")
MODEL_FILE_INTRODUCTION = """# Model file

A YAML file holds what is known of a rig, and how well. All quantities are SI. Any number may carry
its tolerance, one standard deviation, by which calibration and diagnosis may move it:
`10`, `{value: 10, tolerance: 10 %}` or `{value: 10, tolerance: 0.5}`.
Unknown keys, wrong units and impossible values are refused, all at once, with their paths.
Examples: [table_1.yaml](../examples/table_1.yaml), [surgical_tool.yaml](../examples/surgical_tool.yaml).
"""
RECORDING_INTRODUCTION = """# Recording format

**CSV, the exchange form.** Comment lines `# key: value` first (`rig`, `model`, `sample_rate_hz`, `notes`, ...),
then a header row, then numbers. Time increases strictly; uneven steps and gaps are allowed. Signs: positive motor
angle winds cable a, the motor torque is applied by the motor on its pulley, the load torque by the cables on the load.

    # notes: anything
    time_s,motor_angle_rad,load_angle_rad,motor_torque_nm,load_torque_nm
    0.000,0.0000,0.0000,0.0000,0.0000

**BLF, the capture.** `bowden record run.blf` keeps the raw CAN frames, and beside them `run.blf.json`: what was recorded,
git and object-dictionary hash, adapter, clock fit, and which frames were lost. Every command that takes a
recording takes either form.

NaN, text and non-increasing time are refused with the line number. A column may be missing unless the mode needs it:
`torque-position` takes motor torque and load angle, `position-torque` motor angle and load torque,
`position-position` both angles. Unknown columns are kept; a name ends with its unit.

## Channels
"""


def write_reference(folder: Path) -> None:
    """Write every generated page into the folder, leaving unchanged ones untouched."""
    folder.mkdir(exist_ok=True)
    for name, text in (
        ("cli.md", command_line()),
        ("api.md", python_interface()),
        ("model-file.md", model_file()),
        ("recording-format.md", recording_format()),
    ):
        page = folder / name
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def command_line() -> str:
    """Return the page of all commands with their help texts."""
    parser = build_parser(list(COMMANDS))
    commands = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    parts = [
        "# Command line\n\n"
        "Exit status: 0 done; 1 `verify` says no; 2 bad input or usage; 3 the drive or the bus failed. "
        "`--json` prints one JSON document to stdout; text for people goes to stderr.\n"
    ]
    parts += [f"- [`bowden {name}`](#bowden-{name}): {text}" for name, text in COMMANDS.items()]
    for name in COMMANDS:
        text = commands.choices[name].format_help().replace("```", "")
        parts.append(f"\n## bowden {name}\n\n```text\n{text.rstrip()}\n```")
    return "\n".join(parts) + "\n"


def python_interface() -> str:
    """Return the page of all names of `import bowden`."""
    parts = [
        "# Python interface\n\nEverything below is reached as `bowden.NAME` after `import bowden`.\n"
    ]
    functions = [name for name in bowden.__all__ if name not in (*CLASSES, "__version__")]
    for name in functions:
        parts.append(f"## {name}\n\n```{{eval-rst}}\n.. autofunction:: bowden.{name}\n```\n")
    for name in CLASSES:
        members = "\n   :members:" if name in ("Model", "Recording") else ""
        parts.append(f"## {name}\n\n```{{eval-rst}}\n.. autoclass:: bowden.{name}{members}\n```\n")
    return "\n".join(parts)


def model_file() -> str:
    """Return the page of all keys of a model file."""
    parts = [MODEL_FILE_INTRODUCTION]
    for title, part in _parts(ModelFile, ""):
        text = (part.__doc__ or "").split("\n")[0].replace("``", "`")
        parts += [
            f"## {title or 'Top level'}\n",
            f"{text}\n",
            "| key | value | default |\n|---|---|---|",
        ]
        for key, field in part.model_fields.items():
            default = (
                "required" if field.is_required() else str(field.default).replace("None", "none")
            )
            parts.append(f"| `{key}` | {_kind(field.annotation)} | {default} |")
        parts.append("")
    parts.append("## Friction laws\n\n| `law` | further keys; the first is required |\n|---|---|")
    parts += [
        f"| `{law}` | {', '.join(f'`{k}`' for k in keys) or '–'} |"
        for law, keys in LAW_KEYS.items()
    ]
    parts.append("\n## Solvers\n\n| `solver` | further keys |\n|---|---|")
    parts += [
        f"| `{s}` | {', '.join(f'`{k}`' for k in keys) or '–'} |" for s, keys in SOLVER_KEYS.items()
    ]
    parts.append(
        "\n## Effects\n\nEach entry of `effects` has a `name`, at times a `variant`, and the parameters. "
        "[Effects](../effects.md) has their laws.\n\n| name | variant | parameters |\n|---|---|---|"
    )
    for name, effect in CATALOGUE.items():
        for variant in effect.variants:
            keys = ", ".join(
                f"`{p.name}` ({p.unit})" if p.unit else f"`{p.name}`" for p in variant.parameters
            )
            parts.append(f"| `{name}` | {variant.where or '–'} | {keys} |")
    return "\n".join(parts) + "\n"


def recording_format() -> str:
    """Return the page of the recording formats and all channels with a meaning."""
    rows = [
        f"| `{c.name}` | {c.unit or '–'} | {c.end if c.end != 'none' else '–'} | {c.source} | {c.purpose} |"
        for c in CHANNELS.values()
    ]
    header = "| column | unit | end | source | |\n|---|---|---|---|---|"
    return "\n".join([RECORDING_INTRODUCTION, header, *rows]) + "\n"


def _parts(part: type[Part], path: str) -> Iterator[tuple[str, type[Part]]]:
    """Walk through the schema: the path of each mapping and its class."""
    yield path, part
    for key, field in part.model_fields.items():
        for inner in _classes(field.annotation):
            if issubclass(inner, Part) and inner is not Quantity:
                many = get_origin(_plain(field.annotation)) is tuple
                yield from _parts(inner, f"{path}.{key}".lstrip(".") + ("[]" if many else ""))


def _classes(annotation: Any) -> Iterator[type]:
    if isinstance(annotation, type) and get_origin(annotation) is None:
        yield annotation
    for inner in get_args(annotation):
        yield from _classes(inner)


def _plain(annotation: Any) -> Any:
    """Return an annotation without ``Annotated`` and without ``| None``."""
    if get_origin(annotation) in (Union, types.UnionType):
        kept = [inner for inner in get_args(annotation) if inner is not type(None)]
        return _plain(kept[0]) if len(kept) == 1 else annotation
    if hasattr(annotation, "__metadata__"):
        return _plain(get_args(annotation)[0])
    return annotation


def _kind(annotation: Any) -> str:
    plain = _plain(annotation)
    if get_origin(plain) is Literal:
        return ", ".join(f"`{value}`" for value in get_args(plain))
    if get_origin(plain) is tuple:
        return "list"
    if get_origin(plain) in (dict, list):
        return "mapping" if get_origin(plain) is dict else "list"
    names = {
        Quantity: "number",
        int: "whole number",
        float: "number",
        str: "text",
        bool: "yes or no",
    }
    return names.get(plain, "mapping" if isinstance(plain, type) else "value")
