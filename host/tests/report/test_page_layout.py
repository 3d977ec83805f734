"""Reports on a phone, on a wide screen, in dark mode and for screen readers.

Layout is measured by headless Chromium, where there is one (Debian package chromium).
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest
from bowden.diagnosis.compare import compare
from bowden.model import Mode, table_1
from bowden.model.experiments import run_experiment
from bowden.recording.recording import Recording
from bowden.report.comparison import comparison_report
from bowden.report.diagnosis import diagnosis_report
from bowden.report.experiment import experiment_report
from bowden.report.svg import data_of, describe, draw
from bowden.report.svg_elements import DARK
from bowden.signals.prediction import simulate_recording
from playwright.sync_api import Browser, sync_playwright

from .test_diagnosis_report import named_diagnosis

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
HANGS_MS = 600_000  # only ends a test that hangs
LIGHT_PAPER, DARK_PAPER = "#ffffff", "#16191d"

#: Width of the content, the least height of a drawing's words, each word's contrast (WCAG 2.2).
MEASURE = """() => {
    const shown = e => e.getClientRects().length > 0 && e.textContent.trim() !== '';
    const rgb = text => text.match(/[\\d.]+/g).map(Number);
    const luminance = c => [0.2126, 0.7152, 0.0722].reduce((sum, weight, i) => {
        const x = c[i] / 255;
        return sum + weight * (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
    }, 0);
    const paper = e => {
        for (; e; e = e.parentElement) {
            const c = rgb(getComputedStyle(e).backgroundColor);
            if (c.length < 4 || c[3] === 1) return c;
        }
        return matchMedia('(prefers-color-scheme: dark)').matches ? [0, 0, 0] : [255, 255, 255];
    };
    const drawn = [...document.querySelectorAll('.plot text')].filter(shown);
    const written = [...document.querySelectorAll('body *')].filter(e => shown(e)
        && !e.closest('script, style') && [...e.childNodes].some(
            n => n.nodeType === 3 && n.textContent.trim() !== ''));
    return {
        content_px: document.documentElement.scrollWidth,
        drawn_px: Math.min(...drawn.map(e => e.getBoundingClientRect().height)),
        contrasts: written.map(e => {
            const style = getComputedStyle(e);
            const ink = luminance(rgb(e.closest('svg') ? style.fill : style.color));
            const under = luminance(paper(e));
            const [high, low] = ink > under ? [ink, under] : [under, ink];
            return [(high + 0.05) / (low + 0.05), e.textContent.trim().slice(0, 60)];
        }),
    };
}"""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A comparison with noise, as large as such a page becomes with one recording of 20 s."""
    time_s = np.arange(0.0, 20.0, 1e-3)
    angle = 0.6 * np.sin(np.pi * time_s)
    given = Recording(time_s, load_angle_rad=angle, motor_torque_nm=-0.15 * np.sin(np.pi * time_s))
    model = table_1()
    truth = simulate_recording(model, Mode.TORQUE_POSITION, given)
    noise = 0.02 * np.random.default_rng(0).standard_normal(time_s.size)
    run = given.with_channels(
        motor_angle_rad=truth.motor_angle_rad, load_torque_nm=truth.load_torque_nm + noise
    )
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(
        comparison_report(compare(model, [run], Mode.TORQUE_POSITION)), encoding="utf-8"
    )
    return path


def luminance(code: str) -> float:
    """Relative luminance of WCAG 2.2."""
    parts = [int(code[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a: str, b: str) -> float:
    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


# WCAG 2.2, 1.4.11: graphics that carry meaning need 3 to 1. Shades of areas are beside a legend.
@pytest.mark.parametrize("code", sorted(set(DARK) - {"#c9cdd2", "#eef0f2", "#dfe3e8", "#e08a00"}))
def test_curves_stand_out_on_light_and_dark_paper(code: str) -> None:
    assert contrast(code, LIGHT_PAPER) >= 3.0
    assert contrast(DARK[code], DARK_PAPER) >= 3.0


def test_the_page_is_below_a_megabyte_and_loads_nothing(page: Path) -> None:
    html = page.read_text(encoding="utf-8")
    assert len(html.encode()) < 1e6
    assert "http" not in re.sub(r"http://www\.w3\.org/\S+", "", html)


def test_every_figure_has_a_text_a_caption_and_data(page: Path) -> None:
    html = page.read_text(encoding="utf-8")
    figures = re.findall(r"<figure.*?</figure>", html, re.DOTALL)
    assert len(figures) >= 5
    for figure in figures:
        labels = set(re.findall(r'role="img" aria-label="([^"]{10,})"', figure))
        assert len(labels) == 1
        assert "<figcaption>" in figure
        data = re.search(r'<script type="application/json">(.*?)</script>', figure, re.DOTALL)
        assert data is not None
        assert all(len(trace["x"]) == len(trace["y"]) for trace in json.loads(data.group(1)))


def test_a_drawing_puts_values_where_its_ticks_say() -> None:
    plot = go.Figure(go.Scatter(x=[0.0, 10.0], y=[0.0, 5.0], mode="lines", name="line"))
    plot.update_xaxes(title_text="time (s)", range=[0.0, 10.0])
    plot.update_yaxes(title_text="torque (N m)", range=[0.0, 5.0])
    plot.update_layout(height=300, showlegend=False)
    drawn = draw(plot, 500, "label")
    path = re.search(r'<path d="M([\d.]+) ([\d.]+)l0 0 ?(-?[\d.]+) ?(-?[\d.]+)"', drawn)
    assert path is not None
    x, y, dx, dy = map(float, path.groups())
    ticks = {
        text: (float(at_x), float(at_y))
        for at_x, at_y, text in re.findall(r'x="([\d.]+)" y="([\d.]+)"[^>]*>([\d.]+)</text>', drawn)
    }
    assert ticks["10"][0] == pytest.approx(x + dx, abs=0.2)
    assert ticks["5"][1] - 4 == pytest.approx(y + dy, abs=0.2)  # a label's base line
    assert describe(plot) == "Torque (N m) against time (s): line."
    assert data_of(plot) == [{"name": "line", "x": [0.0, 10.0], "y": [0.0, 5.0]}]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        program = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox"], timeout=HANGS_MS
        )
        yield program
        program.close()


@pytest.fixture(scope="module")
def reports(page: Path) -> dict[str, str]:
    """A report of each kind."""
    return {
        "comparison": page.read_text(encoding="utf-8"),
        "diagnosis": diagnosis_report(named_diagnosis()),
        "experiment": experiment_report(run_experiment("1a")),
    }


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine (apt install chromium)")
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1000, 1600])
@pytest.mark.parametrize("kind", ["comparison", "diagnosis", "experiment"])
def test_a_report_fits_the_screen_and_its_words_stand_out(
    reports: dict[str, str], browser: Browser, kind: str, width: int, scheme: Any
) -> None:
    context = browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True
    )
    context.set_default_timeout(HANGS_MS)
    opened = context.new_page()
    problems: list[str] = []
    opened.on("pageerror", lambda error: problems.append(str(error)))
    opened.set_content(reports[kind])
    measured = opened.evaluate(MEASURE)
    context.close()
    assert problems == []
    assert measured["content_px"] <= width
    assert measured["drawn_px"] >= 10.0  # readable without zooming
    assert len(measured["contrasts"]) > 30
    worst, text = min(measured["contrasts"])
    assert worst >= 4.5, text  # WCAG 2.2, 1.4.3
