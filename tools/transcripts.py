"""Writes into the pages what their commands print: `make transcripts [PAGES="first-hour ..."]`.

A line of a ```console block that begins with ``$ `` is a command, the lines up to the next one are
its output. Each page in `PAGES` names the place in which its commands run, one after the other:

in_process   on the simulated rig in virtual time (`tools.lent_rig`); a test compares all of it
wheels       a user's empty folder with the built wheels, without compiler and repository
repository   a user's empty folder; the page clones ``$REPOSITORY``

A command that fails ends the writing: no page shows an error that its text does not expect.
"""

from __future__ import annotations

import contextlib
import datetime
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import bowden
from bowden.cli.main import main as bowden_main
from bowden.model import format_model, table_1

from tools.lent_rig import lent_rig

ROOT: Final = Path(__file__).resolve().parents[1]
BLOCK: Final = re.compile(r"(?<=^```console\n).*?(?=^```)", re.MULTILINE | re.DOTALL)
FOOTER: Final = re.compile(r"^\*Written by `make transcripts`.*?\*$", re.MULTILINE | re.DOTALL)
WIDTH: Final = "100"  # columns of the terminal
USERS_PROGRAMS: Final = ("python3", "ls", "cat", "uname", "basename")
KEPT: Final = ("LANG", "PIP_", "SSL_")  # of the environment: how packages are fetched here
SLOW_S: Final = 2.0  # a command that takes longer has its time in the footer

#: Runs one command and returns what it prints; raises where it fails.
Run = Callable[[str], str]


class CommandFailed(RuntimeError):  # noqa: N818  (as `DriveFailed`)
    """A command of a page failed; the message holds what it printed."""


def commands(page: str) -> list[str]:
    """Return the commands of a page in their order."""
    lines = [line for block in BLOCK.findall(page) for line in block.splitlines()]
    return [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]


def written(page: str, run: Run) -> str:
    """Return the page with what each command prints now."""

    def block(match: re.Match[str]) -> str:
        return "".join(f"$ {command}\n{run(command)}" for command in commands_of(match.group()))

    def commands_of(body: str) -> list[str]:
        return commands(f"```console\n{body}```")

    return BLOCK.sub(block, page)


def shape(page: str) -> str:
    """Return the words of a page: equal where only numbers and the widths of tables differ."""
    text = re.sub(r"\b[0-9A-Fa-f]{8}h?\b|[-+−]?\d[\d.,]*(e[-+]\d+)?", "#", FOOTER.sub("", page))
    return re.sub(r"[\s─━]+", " ", text)


@contextlib.contextmanager
def in_process() -> Iterator[Run]:
    """Run ``bowden`` commands here, in a new folder with a model file ``rig.yaml``."""
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name), lent_rig():
        model = table_1().with_values({"friction.mu_d": 0.2})
        Path("rig.yaml").write_text(format_model(model), encoding="utf-8")
        yield run_here


def run_here(command: str) -> str:
    """Run a ``bowden`` command in this process; CommandFailed where its status is not 0."""
    printed = io.StringIO()
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = WIDTH
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            status = bowden_main(shlex.split(command)[1:])
    finally:
        del os.environ["COLUMNS"]
        if before is not None:
            os.environ["COLUMNS"] = before
    if status:
        raise CommandFailed(f"{command}: status {status}\n{printed.getvalue()}")
    return tidy(printed.getvalue())


@contextlib.contextmanager
def wheels() -> Iterator[Run]:
    """Run in a user's folder that holds the wheels, with Python and a few programs on the path."""
    with users_folder() as (folder, environment):
        for wheel in (ROOT / "dist").glob("*.whl"):
            shutil.copy(wheel, folder)
        programs = folder.parent / "programs"
        programs.mkdir()
        for name in USERS_PROGRAMS:  # scripts: a linked Python would not find its library
            python = f"{sys.base_exec_prefix}/bin/python3"
            runs = python if name == "python3" else shutil.which(name)
            program = programs / name
            program.write_text(f'#!/bin/sh\nexec {runs} "$@"\n', encoding="utf-8")
            program.chmod(0o755)
        with shell(folder, {**environment, "PATH": str(programs)}) as run:
            yield run


@contextlib.contextmanager
def repository() -> Iterator[Run]:
    """Run in a user's folder, with the programs of this machine."""
    with users_folder() as (folder, environment):
        path = os.pathsep.join(
            entry for entry in os.environ["PATH"].split(os.pathsep) if ".venv" not in entry
        )
        with shell(folder, {**environment, "PATH": path, "REPOSITORY": str(ROOT)}) as run:
            yield run


@contextlib.contextmanager
def users_folder() -> Iterator[tuple[Path, dict[str, str]]]:
    """Give a new empty folder and an environment with a home of its own."""
    with tempfile.TemporaryDirectory() as name:
        home, folder = Path(name) / "home", Path(name) / "work"
        home.mkdir()
        folder.mkdir()
        kept = {key: value for key, value in os.environ.items() if key.startswith(KEPT)}
        yield folder, {**kept, "HOME": str(home), "COLUMNS": WIDTH}


@contextlib.contextmanager
def shell(folder: Path, environment: dict[str, str]) -> Iterator[Run]:
    """Run commands in one shell, so that ``cd`` and an activated environment stay."""
    process = subprocess.Popen(
        ["/bin/sh"],
        cwd=folder,
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    asked, answers = process.stdin, process.stdout

    def run(command: str) -> str:
        asked.write(f"{command}\nstatus=$?; echo; echo end-of-command $status\n")
        asked.flush()
        printed = ""
        for line in answers:
            if line.startswith("end-of-command "):
                if line.split()[1] != "0":
                    break
                return tidy(printed.replace(str(folder), "~"))
            printed += line
        raise CommandFailed(f"{command}\n{printed}")

    with process:
        yield run
        asked.close()


def tidy(printed: str) -> str:
    """Return the output as a page shows it: no trailing blanks, no empty lines at its ends."""
    lines = [line.rstrip() for line in printed.expandtabs().split("\n")]
    text = "\n".join(lines).strip("\n")
    return f"{text}\n" if text else ""


#: Page and the place in which its commands run.
PAGES: Final[dict[str, Callable[[], contextlib.AbstractContextManager[Run]]]] = {
    "first-hour": in_process,
    "new-user-wheels": wheels,
    "new-user-repository": repository,
}


def renew(name: str) -> None:
    """Run a page's commands, write what they print, and how long the slow ones took."""
    path = ROOT / "docs" / f"{name}.md"
    times: list[str] = []
    load = os.getloadavg()[0]
    with PAGES[name]() as run:

        def timed(command: str) -> str:
            start = time.monotonic()
            printed = run(command)
            if (taken := time.monotonic() - start) > SLOW_S:
                times.append(f"`{command}` {taken:.0f} s")
            return printed

        page = written(path.read_text(encoding="utf-8"), timed)
    footer = (
        f"*Written by `make transcripts`, version {bowden.__version__}, "
        f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d}"
    )
    if PAGES[name] is not in_process:
        footer += f"; {os.cpu_count()} cores, load {load:.1f}. Times: {', '.join(times)}"
    path.write_text(FOOTER.sub(lambda _: f"{footer}.*", page), encoding="utf-8")


def main(names: list[str]) -> int:
    """Renew the named pages, all without names; the exit status."""
    if unknown := [name for name in names if name not in PAGES]:
        sys.stderr.write(f"found {unknown[0]}; accepted: {', '.join(PAGES)}\n")
        return 2
    for name in names or PAGES:
        sys.stderr.write(f"docs/{name}.md\n")
        try:
            renew(name)
        except CommandFailed as failed:
            sys.stderr.write(f"{failed}\n")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
