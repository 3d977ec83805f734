"""The frame of the command line: what is loaded, what is printed where, and the exit status."""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec

import numpy as np
import pytest
from bowden.cli import main as frame
from bowden.cli.output import print_json
from bowden.errors import BadInput, DriveFailed
from bowden.model.errors import ModelError

THERE = [name for name in frame.COMMANDS if find_spec(f"bowden.cli.{name.replace('-', '_')}")]


def status_of(error: BaseException) -> int:
    def run(_args: argparse.Namespace) -> int:
        raise error

    return frame.run_command("record", argparse.Namespace(), run)


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (BadInput("a.csv, line 3", "x", "y"), 2, "a.csv, line 3: found x; accepted: y"),
        (ModelError(["one:\n  two"]), 2, "one: two"),
        (FileNotFoundError(2, "No such file or directory", "m.yaml"), 2, "m.yaml: No such file"),
        (DriveFailed("node 16 is not there"), 3, "node 16 is not there"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (frame.Terminated(), 143, "terminated"),
    ],
)
def test_each_failure_is_one_line_and_its_status(
    error: BaseException, status: int, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status_of(error) == status
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("bowden record: ")
    assert line in shown.err
    assert shown.err.count("\n") == 1


def test_a_bug_is_not_hidden() -> None:
    with pytest.raises(ValueError, match="a bug"):
        status_of(ValueError("a bug"))


@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 143)]
)
def test_signals_run_the_clean_up(number: signal.Signals, status: int) -> None:
    cleaned: list[bool] = []

    def run(_args: argparse.Namespace) -> int:
        try:
            signal.raise_signal(number)
        finally:
            cleaned.append(True)
        return 0

    # A user who runs the tests under nohup has it ignored, which is respected (next test).
    usual = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
    found = signal.signal(number, usual)
    try:
        assert frame.run_command("record", argparse.Namespace(), run) == status
        assert cleaned
        assert signal.getsignal(number) is usual
    finally:
        signal.signal(number, found)


def test_a_background_job_can_be_interrupted_and_nohup_is_respected() -> None:
    def signals(_args: argparse.Namespace) -> int:
        assert signal.getsignal(signal.SIGINT) is not signal.SIG_IGN
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        return 0

    before = {n: signal.signal(n, signal.SIG_IGN) for n in (signal.SIGINT, signal.SIGHUP)}
    try:
        assert frame.run_command("record", argparse.Namespace(), signals) == 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_usage_errors_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["nonsense"], ["record"], ["record", "--duration", "soon"]):
        with pytest.raises(SystemExit) as left:
            frame.main(arguments)
        assert left.value.code == 2
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("name", THERE)
def test_every_command_explains_itself(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        frame.main([name, "--help"])
    assert left.value.code == 0
    shown = capsys.readouterr().out
    assert f"usage: bowden {name}" in shown
    assert f"bowden {name} " in shown.partition("examples:")[2]


def test_help_lists_all_commands_and_loads_none() -> None:
    code = (
        "import sys; from bowden.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('numpy', 'can', 'canopen', 'numba', 'rich') if m in sys.modules])"
    )
    shown = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert all(name in shown for name in frame.COMMANDS)
    assert shown.endswith("[]\n")


def test_completion_knows_the_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame, "COMMANDS", {name: frame.COMMANDS[name] for name in THERE})
    for shell in ("bash", "zsh"):
        assert frame.main(["--print-completion", shell]) == 0


def test_json_has_plain_numbers_and_null_for_what_json_cannot_say(
    capsys: pytest.CaptureFixture[str],
) -> None:
    print_json({"a": np.float64(1.5), "b": np.array([1.0, np.nan]), "c": (float("inf"), "µ")})
    shown = capsys.readouterr().out
    assert json.loads(shown) == {"a": 1.5, "b": [1.0, None], "c": [None, "µ"]}


def test_a_reader_that_leaves_early_is_no_traceback() -> None:
    code = (
        "import argparse, sys; from bowden.cli.main import run_command\n"
        "sys.exit(run_command('x', argparse.Namespace(), lambda a: print('x' * 100_000) or 0))"
    )
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, "-c", code], stdout=write, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(write)
    assert done.returncode == 141
    assert done.stderr == ""


def test_a_reader_of_people_s_text_that_leaves_early_is_not_a_rejection() -> None:
    code = (
        "import argparse, sys; from bowden.cli.main import run_command\n"
        "from bowden.cli.output import console\n"
        "say = lambda a: console().print('x' * 100_000) or 0\n"
        "sys.exit(run_command('x', argparse.Namespace(), say))"
    )
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([sys.executable, "-c", code], stderr=write, check=False)
    os.close(write)
    assert done.returncode == 141  # rich's own answer is 1, which means that `verify` rejects


def test_ctrl_c_while_a_command_is_loaded_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def load(_name: str) -> frame.Command:
        raise KeyboardInterrupt

    monkeypatch.setattr(frame, "_load", load)
    assert frame.main(["record", "run.blf"]) == 130
    assert capsys.readouterr().err == "bowden record: interrupted\n"


@pytest.mark.parametrize("closed", ["1", "2"])
def test_a_closed_stream_loses_its_text_only(closed: str) -> None:
    command = '"$0" -m bowden.cli.main od search tunnel_stiffness --json'
    done = subprocess.run(
        ["sh", "-c", f"{command} {closed}>&-", sys.executable],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "" if closed == "1" else json.loads(done.stdout)


def test_a_full_stderr_does_not_change_the_status() -> None:
    command = '"$0" -m bowden.cli.main od search nothing_of_the_kind 2> /dev/full'
    done = subprocess.run(["sh", "-c", command, sys.executable], check=False)
    assert done.returncode == 2


#: Commands that run until they are stopped and report nothing at their end.
SERVERS = ("rig", "studio")


def every_option(parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.Action]]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name in action.choices:
                yield from every_option(action.choices[name])
        else:
            yield parser.prog, action


@pytest.mark.parametrize("name", THERE)
def test_every_option_is_explained_and_every_report_is_a_document(name: str) -> None:
    options = [
        (prog, action)
        for prog, action in every_option(frame.build_parser([name]))
        if prog.startswith(f"bowden {name}")
    ]
    assert [f"{prog} {one.dest}" for prog, one in options if not one.help] == []
    flags = {flag for _, one in options for flag in one.option_strings}
    assert ("--json" in flags) is (name not in SERVERS)
