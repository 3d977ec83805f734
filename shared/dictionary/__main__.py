"""Command line of the generator: write the outputs, or with ``--check`` only compare them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shared.dictionary.outputs import ROOT, SOURCE, outputs
from shared.dictionary.schema import SchemaError


def main(arguments: list[str] | None = None) -> int:
    """Return 0 when everything is up to date or was written, 1 when stale, 2 for a bad source."""
    parser = argparse.ArgumentParser(prog="python -m shared.dictionary", description=__doc__)
    parser.add_argument("--check", action="store_true", help="compare only; exit 1 if stale")
    check = parser.parse_args(arguments).check
    try:
        texts = outputs(SOURCE)
    except SchemaError as problem:
        sys.stderr.write(f"{problem}\n")
        return 2
    stale = [p for p, text in texts.items() if not (ROOT / p).is_file() or _read(p) != text]
    for path in stale:
        sys.stderr.write(f"{path}: {'stale' if check else 'written'}\n")
        if not check:
            (ROOT / path).parent.mkdir(parents=True, exist_ok=True)
            (ROOT / path).write_text(texts[path], encoding="utf-8", newline="\n")
    return 1 if check and stale else 0


def _read(path: Path) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
