"""Sweeps from arguments to the finished table: locally, interrupted and continued, on Dask."""

from __future__ import annotations

import builtins
import csv
import gc
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from bowden.cli import parallel
from bowden.cli import sweep as command
from bowden.cli.main import main
from bowden.model import format_model
from bowden.model.experiments import as_printed
from bowden.model.sweep import Row, Sweep, run_points


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "rig.yaml"
    path.write_text(format_model(as_printed()))
    return path


def arguments(model: Path, output: Path, *more: str) -> list[str]:
    vary = ["--vary", "rig.cable.pretension_n=1:3:3", "--vary", "friction.mu_d=0.1,0.2"]
    given = ["sweep", str(model), "--experiment", "1", "--output", str(output), *vary]
    return [*given, *more]


def in_this_process(sweep: Sweep, tasks: Sequence[Sequence[int]]) -> Iterator[list[Row]]:
    """Compute as the workers do, without starting any."""
    text = format_model(sweep.model)
    for task in tasks:
        yield run_points(text, sweep.experiment, [(i, sweep.values(i)) for i in task])


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "_on_this_machine", in_this_process)


def rows_of(output: Path) -> list[dict[str, str]]:
    lines = [x for x in output.read_text().splitlines() if not x.startswith("#")]
    return list(csv.DictReader(lines))


def test_the_same_rows_from_joblib_and_from_two_dask_workers(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from distributed import LocalCluster  # noqa: PLC0415  (an extra)

    assert main(arguments(model, tmp_path / "here.csv", "--json")) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["rows"], document["computed"], document["failed"]) == (6, 6, 0)
    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        there = arguments(model, tmp_path / "there.csv", "--scheduler", cluster.scheduler_address)
        assert main(there) == 0
    assert (tmp_path / "there.csv").read_bytes() == (tmp_path / "here.csv").read_bytes()
    rows = rows_of(tmp_path / "here.csv")
    assert [row["index"] for row in rows] == [str(i) for i in range(6)]
    # T0 = 1, 2, 3 N; mu 0.2: m = 1.4286, slack below T0 = 0.125 r (1 - e^-m) / 2 r^2 m = 1.66 N
    assert float(rows[1]["steady_efficiency"]) == pytest.approx(0.239651, rel=1e-5)
    assert not list(tmp_path.glob("*.partial"))


@pytest.mark.usefixtures("quick")
def test_an_interrupted_sweep_goes_on_where_it_was(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    output, partial = tmp_path / "out.csv", tmp_path / "out.csv.partial"

    def interrupted(sweep: Sweep, tasks: Sequence[Sequence[int]]) -> Iterator[list[Row]]:
        rows = in_this_process(sweep, tasks)
        for _ in range(4):
            yield next(rows)
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "_on_this_machine", interrupted)
    assert main(arguments(model, output)) == 130
    assert not output.exists()
    text = partial.read_text()
    assert text.count("\n") == 5  # what it is, and four rows
    partial.write_text(text + '{"index": 4, "rig.ca')  # killed in the middle of a line

    computed: list[int] = []

    def counted(sweep: Sweep, tasks: Sequence[Sequence[int]]) -> Iterator[list[Row]]:
        computed.extend(i for task in tasks for i in task)
        return in_this_process(sweep, tasks)

    monkeypatch.setattr(command, "_on_this_machine", counted)
    assert main(arguments(model, output)) == 0
    assert computed == [4, 5]
    assert "going on" in capsys.readouterr().err
    assert not partial.exists()
    again = tmp_path / "again.csv"
    assert main(arguments(model, again)) == 0
    assert again.read_bytes() == output.read_bytes()


@pytest.mark.usefixtures("quick")
def test_a_finished_sweep_is_not_computed_again(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    output = tmp_path / "out.csv"
    assert main(arguments(model, output)) == 0
    monkeypatch.setattr(command, "_on_this_machine", _never)
    assert main(arguments(model, output, "--json")) == 0
    assert json.loads(capsys.readouterr().out)["computed"] == 0


def _never(*_: object) -> Iterator[list[Row]]:
    raise AssertionError("nothing is missing")


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("name", ["out.csv", "out.csv.partial"])
def test_rows_of_another_sweep_are_not_touched(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    output = tmp_path / "out.csv"
    assert main(arguments(model, output)) == 0
    if name.endswith("partial"):
        output.unlink()
        (tmp_path / name).write_text('{"sweep": "0123456789abcdef"}\n{"index": 0}\n')
    before = (tmp_path / name).read_bytes()
    capsys.readouterr()
    other = arguments(model, output, "--vary", "rig.cable.axial_stiffness_n=2000")
    assert main(other) == 2
    shown = capsys.readouterr().err
    assert name in shown
    assert "another --output" in shown
    assert shown.count("\n") == 1
    assert (tmp_path / name).read_bytes() == before


@pytest.mark.usefixtures("quick")
def test_random_draws_repeat_with_their_seed(model: Path, tmp_path: Path) -> None:
    def draw(name: str, seed: str) -> bytes:
        command_line = ["sweep", str(model), "--experiment", "1", "--random", "3", "--seed", seed]
        command_line += ["--vary", "rig.cable.pretension_n=1:3", "--output", str(tmp_path / name)]
        assert main(command_line) == 0
        return (tmp_path / name).read_bytes()

    assert draw("a.csv", "1") == draw("b.csv", "1") != draw("c.csv", "2")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "node1"])
def test_a_scheduler_that_is_not_there_is_one_line(
    address: str, model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    monkeypatch.setattr(parallel, "_CONNECT_WITHIN_S", 0.2)
    output = tmp_path / "out.csv"
    assert main(arguments(model, output, "--scheduler", address)) == 2
    gc.collect()  # a half-made client complains when it is collected
    shown = capsys.readouterr().err
    assert f"no Dask scheduler at {address}" in shown
    assert shown.count("\n") == 1
    assert not list(tmp_path.glob("out.csv*"))


def test_without_the_extra_it_says_what_to_install(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    real: Callable[..., Any] = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name == "distributed":
            raise ModuleNotFoundError(name="distributed")
        return real(name, *args, **kwargs)

    monkeypatch.delitem(sys.modules, "distributed", raising=False)
    monkeypatch.setattr(builtins, "__import__", without)
    assert main(arguments(model, tmp_path / "out.csv", "--scheduler", "tcp://x:1")) == 2
    assert "bowden[cluster]" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        (["--seed", "1"], "--random"),
        (["--random", "0"], "--random"),
        (["--vary", "nonsense"], "--vary"),
        (["--vary", "friction.mu=1"], "friction.mu"),
        (["--vary", "friction.mu_s=-1"], "mu_s"),
    ],
)
def test_bad_input_is_one_line_before_anything_runs(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], more: list[str], complaint: str
) -> None:
    assert main(arguments(model, tmp_path / "out.csv", *more)) == 2
    shown = capsys.readouterr().err
    assert complaint in shown
    assert shown.count("\n") == 1
    assert not list(tmp_path.glob("out.csv*"))
