"""Transcripts: what is taken for a command, what is compared, and pages that still hold."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tools.transcripts import (
    PAGES,
    CommandFailed,
    commands,
    run_here,
    shape,
    shell,
    users_folder,
    written,
)

DOCS = Path(__file__).parents[2] / "docs"
PAGE = "# Page\n\n```console\n$ first\nold\n$ second\n```\ntext\n```sh\n$ other\n```\n"


def test_each_command_gets_its_own_output_and_the_text_stays() -> None:
    assert commands(PAGE) == ["first", "second"]
    now = written(PAGE, lambda command: f"of {command}\n")
    assert now == PAGE.replace("old\n$ second\n", "of first\n$ second\nof second\n")


def test_numbers_and_widths_may_differ_but_no_word() -> None:
    assert shape("gap  229 mN m ──\n12D2A161h") == shape("gap 4.5e-3 mN m ─\nF59F0338h")
    assert shape("gap 229 mN m") != shape("gap 229 N m")


def test_a_command_that_fails_ends_the_writing() -> None:
    with users_folder() as (folder, environment), shell(folder, environment) as run:
        assert run("there=~; echo hello") == "hello\n"
        assert run('[ "$there" ] && echo kept') == "kept\n"
        with pytest.raises(CommandFailed, match="no-such-file"):
            run("/bin/cat no-such-file")
    with pytest.raises(CommandFailed, match=r"(?s)status 2.*no-such"):
        run_here("bowden compare no-such.yaml no-such.csv")


@pytest.mark.parametrize("name", PAGES)
def test_every_page_was_written_by_its_commands(name: str) -> None:
    page = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    assert "*Written by `make transcripts`, version" in page
    assert commands(page)


def test_the_targets_that_the_page_lists_are_those_of_now() -> None:
    """The cheap command of that page; the first hour is compared whole in `host/tests/drive`."""
    page = (DOCS / "new-user-repository.md").read_text(encoding="utf-8")
    shown = [line for line in page.splitlines() if line.startswith("  make ")]
    assert len(shown) > 10
    now = subprocess.run(["make", "help"], capture_output=True, text=True, check=True).stdout
    for line in shown:
        assert line in now.splitlines(), "make transcripts PAGES=new-user-repository"
