"""What a failed test leaves: the CAN trace (BLF), the rig's truth (npz) and a plot of it (HTML).

Called by `conftest` with the benches of the test; of a real board there is only the trace. Open the
plot in any browser; ``numpy.load`` the truth; `bowden`'s readers and any CAN tool take the trace.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Final

import can
import numpy as np
from bowden.report.canvas import MEASURED, PRESCRIBED, RESIDUAL, SIMULATED, draw, dress
from bowden_rig.bench import Bench, Truth
from numpy.typing import NDArray
from plotly.subplots import make_subplots

POINTS: Final = 4000

_Curve = tuple[str, NDArray[np.float64], dict[str, object]]  # name, values, line


def directory_of(root: Path, test: str) -> Path:
    """Return an empty folder for that test's artefacts (not yet made)."""
    file, _, name = test.partition("::")
    name = re.sub(r"[^\w.-]+", "-", f"{Path(file).stem}-{name}").strip("-")
    directory = root / name
    shutil.rmtree(directory, ignore_errors=True)
    return directory


def keep(directory: Path, bench: Bench, number: int) -> list[Path]:
    """Write down what a bench has kept; the files, none where it never ran."""
    if not bench.ticks:
        return []
    trace = keep_traffic(directory, bench.traffic, number)
    truth_path, plot = directory / f"truth-{number}.npz", directory / f"plot-{number}.html"
    truth = bench.truth()
    np.savez_compressed(truth_path, **asdict(truth))
    _plot(truth, plot)
    return [trace, truth_path, plot]


def keep_traffic(directory: Path, traffic: Iterable[can.Message], number: int) -> Path:
    """Write down the frames of one wire, all that there is of a real board."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"can-{number}.blf"
    with can.BLFWriter(path) as writer:
        for message in traffic:
            writer.on_message_received(message)
    return path


def _plot(truth: Truth, path: Path) -> None:
    """Angles, torques and tensions against time, one above the other."""
    figure = make_subplots(rows=4, cols=1, shared_xaxes=True, vertical_spacing=0.04)
    panels: tuple[tuple[str, tuple[_Curve, ...]], ...] = (
        (
            "angle (°)",
            (
                ("motor angle", np.degrees(truth.motor_angle_rad), SIMULATED),
                ("load angle", np.degrees(truth.load_angle_rad), MEASURED),
            ),
        ),
        (
            "torque (N m)",
            (
                ("motor torque", truth.motor_torque_nm, SIMULATED),
                ("load torque", truth.load_torque_nm, MEASURED),
            ),
        ),
        (
            "tension (N)",
            (
                ("cable a at the load", truth.load_tension_a_n, SIMULATED),
                ("cable b at the load", truth.load_tension_b_n, PRESCRIBED),
            ),
        ),
        ("bridge", (("bridge on", truth.bridge_enabled.astype(np.float64), RESIDUAL),)),
    )
    for row, (title, curves) in enumerate(panels, start=1):
        for name, values, line in curves:
            draw(figure, (truth.time_s, values), name, line, points=POINTS, row=row)
        figure.update_yaxes(title=title, row=row, col=1)
    figure.update_xaxes(title="time (s)", row=len(panels), col=1)
    dress(figure, 900)
    figure.write_html(path, include_plotlyjs=True)
