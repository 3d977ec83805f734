"""Draws the README's picture: the torque at the load, uncompensated and compensated, on one scale.

    python -m hil_tests.benchmarks.readme_picture --output docs/images/tunnel.svg

Runs the tunnel of Experiment 2 on the simulated rig in virtual time, without compensation and with
the inversion of the rig's model, and writes one animated SVG: both loops are drawn in as the load
moves, then stay. Nothing in the picture is hand-made; the figures in it are those of the run.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from bowden.cli.tunnel_experiment import (
    SETTLE_S,
    TORQUE_CONSTANT_NM_PER_A,
    TORQUE_LIMIT_NM,
    render,
    tunnel_of,
)
from bowden.diagnosis.rendering import PrescribedTunnel
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, write
from bowden.drive.connection import Connection
from bowden.drive.meanings import CompensationLaw
from bowden.drive.reduced_model import reduced_model
from bowden.model import table_1
from bowden.recording.atomic import replace_whole
from bowden.report.rendering import LawRun
from bowden_rig.bench import Bench
from bowden_rig.rig.parameters import Rig, changed
from bowden_rig.rig.rig import SimulatedRig
from bowden_rig.targets import make_target
from bowden_rig.virtual_bus import VirtualBus
from numpy.typing import NDArray

DURATION_S: Final = 9.0
PERIOD_S: Final = 4.0
PRETENSION_N: Final = 5.0
SETTINGS: Final = (
    f"cable.pretension_n={PRETENSION_N:g}",
    f"motor.torque_constant_nm_per_a={TORQUE_CONSTANT_NM_PER_A:g}",
    "cable.viscous_s_per_m=0",
    "operator.frequency_hz=0.25",
)
WIDTH, HEIGHT = 860, 430
LEFT, RIGHT, TOP, BOTTOM = 74, 20, 52, 52
DRAW_S: Final = 5.0  # in which a loop is drawn in
POINTS: Final = 700

_STYLE = """
text{font:15px system-ui,-apple-system,"Segoe UI",Roboto,sans-serif;fill:#1f2328}
.soft{fill:#59636e}.grid{stroke:#d1d9e0;stroke-width:1}.zero{stroke:#818b98;stroke-width:1.2}
.none{stroke:#c2410c}.law{stroke:#0969da}.wanted{stroke:#1f2328;stroke-dasharray:7 5}
.tnone{fill:#c2410c}.tlaw{fill:#0969da}path{fill:none;stroke-width:2.4;stroke-linejoin:round}
.none,.law{stroke-dasharray:1;stroke-dashoffset:1;animation:draw 5s linear forwards}
.law{animation-delay:5s}.tlaw{opacity:0;animation:show .6s 5s forwards}
@keyframes draw{to{stroke-dashoffset:0}}@keyframes show{to{opacity:1}}
@media(prefers-reduced-motion:reduce){.none,.law{animation:none;stroke-dashoffset:0}
.tlaw{animation:none;opacity:1}}
@media(prefers-color-scheme:dark){text{fill:#f0f6fc}.soft{fill:#9198a1}.grid{stroke:#3d444d}
.zero{stroke:#656c76}.wanted{stroke:#f0f6fc}.none{stroke:#ff9b5e}.tnone{fill:#ff9b5e}
.law{stroke:#58a6ff}.tlaw{fill:#58a6ff}}
"""


def main() -> None:
    """Run the two laws and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--output", type=Path, default=Path("docs/images/tunnel.svg"))
    output: Path = parser.parse_args().output
    tunnel, runs = measured(("none", "model-inversion"))
    with replace_whole(output) as temporary:
        temporary.write_text(picture(tunnel, *runs), encoding="utf-8")
    for run in runs:
        print(f"{run.law}: {1e3 * run.figures.rms_error_nm:.1f} mN m RMS")  # noqa: T201


def measured(laws: tuple[str, ...]) -> tuple[PrescribedTunnel, list[LawRun]]:
    """Run the tunnel with each law on the same rig, in virtual time."""
    rig = Rig()
    for setting in SETTINGS:
        rig = changed(rig, setting)
    model = table_1().with_values({"rig.cable.pretension_n": PRETENSION_N})
    with (
        VirtualBus(Bench(SimulatedRig(rig, 1), make_target("native"))) as bus,
        tempfile.TemporaryDirectory() as folder,
    ):
        drive = Drive(Connection(bus, clock=lambda: bus.time_s, threaded=False))
        drive.write("torque_constant", TORQUE_CONSTANT_NM_PER_A)
        entries = dict(reduced_model(model).entries)
        entries["friction_static"] = entries["friction_dynamic"]  # as in a lined conduit
        write(drive, difference(drive, entries | {"motor_torque_limit": TORQUE_LIMIT_NM}))
        tunnel = tunnel_of(drive)
        runs = []
        for law in laws:
            drive.write_raw("compensation_law", CompensationLaw.named(law, "law"))
            runs.append(render(drive, tunnel, DURATION_S, Path(folder) / f"{law}.blf"))
        return tunnel, runs


def picture(tunnel: PrescribedTunnel, naive: LawRun, law: LawRun) -> str:
    """Return the animated SVG."""
    loops = {run.law: _last_period(run) for run in (naive, law)}
    angle = np.degrees(np.concatenate([loop[0] for loop in loops.values()]))
    torque = np.concatenate([loop[1] for loop in loops.values()])
    low, high = float(angle.min()) - 1.0, float(angle.max()) + 1.0
    peak = 1.08 * float(np.abs(torque).max())

    def at(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
        px = LEFT + (np.degrees(x) - low) / (high - low) * (WIDTH - LEFT - RIGHT)
        py = TOP + (peak - y) / (2 * peak) * (HEIGHT - TOP - BOTTOM)
        return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(px, py, strict=True))

    parts = []
    for tick in range(-40, 41, 20):
        x = LEFT + (tick - low) / (high - low) * (WIDTH - LEFT - RIGHT)
        parts.append(
            f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>'
        )
        parts.append(
            f'<text class="soft" x="{x:.1f}" y="{HEIGHT - BOTTOM + 20}" text-anchor="middle">{tick}°</text>'
        )
    for level in range(-int(peak), int(peak) + 1):
        y = TOP + (peak - level) / (2 * peak) * (HEIGHT - TOP - BOTTOM)
        kind = "grid" if level else "zero"
        parts.append(
            f'<line class="{kind}" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
        )
        parts.append(
            f'<text class="soft" x="{LEFT - 10}" y="{y + 5:.1f}" text-anchor="end">{level}</text>'
        )
    ends = np.radians(np.linspace(low + 1.0, high - 1.0, 200))
    parts.append(f'<path class="none" pathLength="1" d="{at(*loops[naive.law])}"/>')
    parts.append(f'<path class="law" pathLength="1" d="{at(*loops[law.law])}"/>')
    parts.append(f'<path class="wanted" d="{at(ends, tunnel.wanted_nm(ends))}"/>')
    errors = [run.figures.rms_error_nm for run in (naive, law)]
    share = 100.0 * errors[1] / errors[0]
    middle = (TOP + HEIGHT - BOTTOM) / 2
    label = (
        "Torque at the load against load angle. Without compensation the loop is "
        f"{errors[0]:.2f} N m RMS from the wanted torque, with the model inversion {errors[1]:.2f}."
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{label}">'
        f"<title>{label}</title><style>{_STYLE}</style>{''.join(parts)}"
        f'<text x="{LEFT}" y="24">- - wanted</text>'
        f'<text class="tnone" x="{LEFT + 120}" y="24">uncompensated: {errors[0]:.2f} N m RMS error</text>'
        f'<text class="tlaw" x="{LEFT + 420}" y="24">bowden: {errors[1]:.2f} N m, {share:.0f} % of it</text>'
        f'<text class="soft" x="{WIDTH / 2}" y="{HEIGHT - 10}" text-anchor="middle">load angle</text>'
        f'<text class="soft" transform="translate(22 {middle}) rotate(-90)" text-anchor="middle">'
        "torque at the load (N m)</text></svg>\n"
    )


def _last_period(run: LawRun) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return angle and torque at the load over the last period, thinned."""
    recording = run.recording
    end_s = recording.time_s[-1] - 0.2  # the bridge goes off
    kept = (recording.time_s > max(end_s - PERIOD_S, recording.time_s[0] + SETTLE_S)) & (
        recording.time_s < end_s
    )
    chosen = np.flatnonzero(kept)[:: max(1, int(kept.sum()) // POINTS)]
    return recording.load_angle_rad[chosen], recording.load_torque_nm[chosen]


if __name__ == "__main__":
    main()
