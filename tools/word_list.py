"""Finds words that a reader of the field would have to guess, and says which term to write.

    python -m tools.word_list             every tracked text file; exit status 1 where one is found

The list is short on purpose: pictures and personifications for which the field has a term (the
glossary, docs/glossary.md). A use that is right is justified on its own line: ``word-list: ok`` and
the reason.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
SUFFIXES: Final = (".py", ".c", ".h", ".md", ".yaml", ".toml")
JUSTIFIED: Final = "word-list: ok"
ITSELF: Final = ("tools/word_list.py", "tools/tests/")

#: What is found (a regular expression, whole words, any case) and what to write instead.
WORDS: Final = {
    r"foretold|foretells?": "predicted, forecast",
    r"astray": "relative lack of fit; diverged",
    r"patience": "back-off counter, time-out",
    r"nobody(?:'s)?|somebody": "the operator, the user, another program; not identifiable",
    r"leeway": "model-form error",
    r"speaks? (?:for|against)|spoken (?:for|against)": "log-likelihood; rejected by held-out data",
    r"liveliness": "intensity, scale",
    r"(?:a )?person's hand": "operator",
    r"strangers?|outsiders?": "independent implementation",
    r"(?:first|fresh|closer) looks?": "candidate screening, refined search",
    r"own noise|mere noise": "noise floor, noise scale",
    r"rungs?|ladders?": "fallback level",
    r"wish(?:es)?": "set-point, set-point change",
    r"worth its numbers": "log-likelihood gain per parameter",
    r"does not dare|dares?": "declined",
    r"(?:at|from) rest": "at standstill, from standstill",
}
_PATTERNS: Final = [(re.compile(rf"\b(?:{w})\b", re.IGNORECASE), term) for w, term in WORDS.items()]


def findings(path: str, text: str) -> Iterator[str]:
    """Yield one line for each word that is on the list and not justified."""
    for number, line in enumerate(text.splitlines(), start=1):
        if JUSTIFIED in line:
            continue
        for pattern, term in _PATTERNS:
            for match in pattern.finditer(line):
                yield f"{path}:{number}: found {match.group()!r}; accepted: {term}"


def tracked_files() -> Iterable[str]:
    """Return the text files that are checked, relative to the repository."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    return [name for name in listed if name.endswith(SUFFIXES) and not name.startswith(ITSELF)]


def main() -> int:
    """Check every file; the exit status."""
    found = [
        finding
        for name in tracked_files()
        if (ROOT / name).is_file()
        for finding in findings(name, (ROOT / name).read_text(encoding="utf-8"))
    ]
    sys.stderr.writelines(f"{finding}\n" for finding in found)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
