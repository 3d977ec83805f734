"""The pages hold: links lead somewhere, commands exist with their options, Python blocks run."""

from __future__ import annotations

import importlib.util
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import bowden
import numpy as np
import pytest
from bowden.cli.main import COMMANDS, build_parser
from bowden.model.effects import CATALOGUE

from tools.transcripts import commands

ROOT = Path(__file__).resolve().parents[3]
PAGES = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "notebooks").glob("*.md")]
)
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)|!\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```(\w*)([^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
GENERATED = ROOT / "docs" / "reference"  # made when the site is built; `make docs` checks its links


def slug(line: str) -> str:
    """Anchor of a heading, as GitHub and MyST make it; empty for any other line."""
    if not line.startswith("#"):
        return ""
    title = re.sub(r"[`*]", "", line.lstrip("#").strip()).lower()
    return re.sub(r"[^\w\- ]", "", title).replace(" ", "-")


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings."""
    return {slug(line) for line in page.read_text(encoding="utf-8").splitlines()}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page: Path) -> None:
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    for match in LINK.finditer(text):
        target = match.group(1) or match.group(2)
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if GENERATED in file.parents:
            continue
        assert file.exists(), f"{page.name}: {target}"
        if anchor:
            assert anchor in anchors(file), f"{page.name}: {target}"


def command_lines() -> Iterator[tuple[str, str]]:
    """Every `bowden ...` line of a code block: page, and the command without its comment."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        blocks = [body for kind, _, body in FENCE.findall(text) if kind in ("", "sh", "bash")]
        blocks.append("\n".join(commands(text)))  # of transcripts, without what they print
        blocks += re.findall(r"(?:^    .*\n)+", FENCE.sub("", text), re.MULTILINE)
        for block in blocks:
            for written in re.sub(r"\\\n\s*", "", block).splitlines():
                line = written.strip().removeprefix("$ ").removeprefix(".venv/bin/")
                if line.startswith("bowden ") and "COMMAND" not in line:
                    yield page.name, line


@pytest.mark.parametrize(("page", "line"), sorted(set(command_lines())))
def test_every_command_is_one_that_the_program_takes(
    page: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shipped = dict(CATALOGUE)
    words = shlex.split(line, comments=True)
    words = words[1 : words.index(">") if ">" in words else None]
    words = [word for word in words if word != "&"]
    assert words[0] in COMMANDS or words[0].startswith("-"), f"{page}: {line}"
    for word in words:
        if word.endswith(".py"):  # a file of the reader's own: the page's example
            text = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
            block = next(body for kind, _, body in FENCE.findall(text) if kind == "python")
            Path(word).write_text(f"{block}\nEFFECTS = (EFFECT,)\n", encoding="utf-8")
    if words == ["--version"]:
        return
    try:
        build_parser([words[0]]).parse_args(words)
    finally:  # --effects lists its effects in the catalogue of this process
        CATALOGUE.clear()
        CATALOGUE.update(shipped)


def test_make_targets_that_pages_name_exist() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for page in PAGES:
        for name in re.findall(r"(?:^ {4}|`)make ([a-z-]+)", page.read_text(), re.MULTILINE):
            assert name in targets, f"{page.name}: make {name}"


def test_python_blocks_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the folder of a checkout, with a recording of one's own."""
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    time_s = np.arange(0.0, 4.0, 4e-3)
    given = bowden.Recording(
        time_s, motor_torque_nm=0.1 * np.sin(4 * time_s), load_angle_rad=0.2 * np.sin(6 * time_s)
    )
    run = bowden.simulate(bowden.table_1(), given)
    noise = 1e-3 * np.random.default_rng(1).standard_normal((2, time_s.size))
    read = {
        "load_torque_nm": run.load_torque_nm + noise[0],
        "motor_angle_rad": run.motor_angle_rad + noise[1],
    }
    bowden.write_csv(run.with_channels(read), tmp_path / "run.csv")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    blocks = [
        body
        for kind, options, body in FENCE.findall(text)
        if kind == "python" and "no-run" not in options
    ]
    assert blocks
    names: dict[str, object] = {}
    for body in blocks:
        exec(compile(body, "python.md", "exec"), names)
    assert (tmp_path / "posterior.nc").exists()
    assert (tmp_path / "loop.html").stat().st_size > 1000


#: A newcomer's questions, as the front page asks them, and what must stand on the page it leads to.
ANSWERS = {
    "columns": r"load_torque_nm",
    "keys": r"pretension_n",
    "tolerance": r"tolerance",
    "stop the drive": r"Ctrl-C",
    "How good": r"without load cell",
    "verdict": r"named|complete",
    "compensation law": r"model-inversion",
    "read, set or save": r"bowden od",
    "Simulink": r"FMU",
    "switches the motor off": r"emergency stop",
    "wire a board": r"encoder",
    "option X": r"--json",
    "add an effect": r"effect",
}


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The generated pages, as the site has them."""
    spec = importlib.util.spec_from_file_location("reference", ROOT / "docs" / "reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    folder = tmp_path_factory.mktemp("reference")
    module.write_reference(folder)
    return folder


def linked_text(reference: Path, target: str) -> str:
    """Return the page, or its section, that a link on the front page leads to."""
    name, _, anchor = target.partition("#")
    page = ROOT / "docs" / name
    page = reference / page.name if page.parent == GENERATED else page
    text = page.read_text(encoding="utf-8")
    if not anchor:
        return text
    sections = re.split(r"^(?=#)", text, flags=re.MULTILINE)
    return next(part for part in sections if slug(part.partition("\n")[0]) == anchor)


def test_a_newcomers_questions_are_one_click_from_the_front_page(reference: Path) -> None:
    front = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([^|]+\?) \| (.+) \|$", front, re.MULTILINE)
    assert len(rows) >= 10
    asked = {words: row for words in ANSWERS for row in rows if words in row[0]}
    assert asked.keys() == ANSWERS.keys()
    assert len(asked) == len(rows)
    for words, (question, answer) in asked.items():
        targets = [link[0] for link in LINK.findall(answer)]
        assert re.search(ANSWERS[words], linked_text(reference, targets[0])), question
        # As plain Markdown, without the generated pages, there is an answer, too.
        kept = [target for target in targets if not target.startswith("reference/")]
        assert kept or "--help" in answer, question


def test_the_readme_is_one_click_from_the_questions() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "docs/index.md#quick-answers" in readme
    assert len(readme.splitlines()) < 120
