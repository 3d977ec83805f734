"""The comparison page: whole, self-contained, and saying what it should."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from bowden.diagnosis.compare import Comparison, compare
from bowden.model import Inputs, Mode, parse_model, simulate
from bowden.recording.recording import Recording
from bowden.report.comparison import comparison_report, prescribed_load_torque
from bowden.report.words import verdict

MODEL = parse_model(
    """
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 4000
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: 10
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
  motor_encoder_counts_per_turn: 2000
  load_encoder_counts_per_turn: 10000
friction: {law: coulomb, mu_d: 0.21}
effects: []
numerics: {segments: 20}
""",
    source="rig.yaml",
)


def recording(source: str = "run.csv", **metadata: str) -> Recording:
    time_s = np.arange(6000) * 1e-3
    load = 0.7 * np.sin(2 * np.pi * 0.5 * time_s)
    torque = -np.sign(load) * np.clip(0.5 * (np.abs(load) - 0.05), 0.0, 0.2)  # eq. (7)
    run = simulate(
        MODEL,
        Mode.TORQUE_POSITION,
        Inputs(time_s=time_s, motor_torque_nm=torque, load_angle_rad=load),
    )
    noise = np.random.default_rng(1).normal(0.0, 5e-4, time_s.size)
    return Recording(
        time_s,
        motor_angle_rad=run.motor_angle_rad,
        load_angle_rad=load,
        motor_torque_nm=torque,
        load_torque_nm=run.load_torque_nm + 0.05 + noise,
        metadata=metadata,
        source=source,
    )


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compare(MODEL, [recording(frames_lost="0", rig="<b>rig</b>")])


class Tags(HTMLParser):
    """Collects what a browser would load, and whether every tag is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loads += [value or "" for name, value in attrs if name in ("src", "href", "srcset")]
        if tag not in ("meta", "br", "link", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_loads_nothing_and_is_whole(comparison: Comparison) -> None:
    html = comparison_report(comparison)
    tags = Tags()
    tags.feed(html)
    assert tags.loads == []
    assert tags.open == []
    assert "@import" not in html
    assert not re.search(r"url\(\s*['\"]?https?:", html)
    assert len(html.encode()) < 1e6


def test_the_verdict_is_what_one_reads_first(comparison: Comparison) -> None:
    html = comparison_report(comparison)
    assert verdict(comparison) in html.replace("&#x27;", "'")
    assert html.index('class="verdict"') < html.index("<table>")
    assert "50.0 mN m RMS" in verdict(comparison)
    assert "0 frames lost" in html


def test_what_the_user_wrote_is_shown_and_not_executed(comparison: Comparison) -> None:
    html = comparison_report(comparison)
    assert "&lt;b&gt;rig&lt;/b&gt;" in html
    assert "<b>rig</b>" not in html


def test_every_plot_is_there(comparison: Comparison) -> None:
    html = comparison_report(comparison)
    for name in ("loop-1", "time-1", "velocity-1", "tensions-1", "where"):
        assert f'id="{name}"' in html


def test_many_recordings_stay_small(comparison: Comparison) -> None:
    one = comparison.recordings[0]
    many = replace(
        comparison,
        recordings=tuple(
            replace(one, recording=replace(one.recording, source=f"run-{k}.csv")) for k in range(12)
        ),
    )
    html = comparison_report(many)
    assert len(html.encode()) < 1e6
    assert html.count("run-11.csv") >= 1  # in the table, if not with plots


def test_a_model_at_the_noise_floor_is_called_complete() -> None:
    run = recording()
    clean = replace(run, load_torque_nm=run.load_torque_nm - 0.05)
    assert "within the noise floor of" in verdict(compare(MODEL, [clean]))


@pytest.mark.parametrize("mode", list(Mode))
def test_every_mode_makes_a_page(mode: Mode) -> None:
    html = comparison_report(compare(MODEL, [recording()], mode))
    assert mode.value in html


def test_the_prescribed_tunnel_is_eq_7_at_the_load() -> None:
    run = recording(
        tunnel_half_width_rad="0.05",
        tunnel_stiffness_nm_per_rad="0.5",
        tunnel_torque_limit_nm="0.2",
    )
    torque = prescribed_load_torque(run, ratio=5.2)
    assert torque is not None
    angle = run.load_angle_rad
    # Restoring, nothing within 0.05 rad, saturated beyond 0.45 rad, times 5.2 at the load.
    assert np.all(torque[np.abs(angle) <= 0.05] == 0.0)
    np.testing.assert_allclose(torque[angle > 0.45], -1.04)
    np.testing.assert_allclose(torque[angle < -0.45], 1.04)
    at = int(np.argmin(np.abs(angle - 0.25)))
    assert torque[at] == pytest.approx(-5.2 * 0.5 * (angle[at] - 0.05))
    assert prescribed_load_torque(recording(), ratio=5.2) is None
