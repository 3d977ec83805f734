"""The diagnosis page: whole, self-contained, and saying what the diagnosis says."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from bowden.diagnosis.excitation import excitation
from bowden.diagnosis.localise import localise
from bowden.diagnosis.result import Diagnosis, NamedEffect, Ranked, Series, Value
from bowden.diagnosis.waterfall import BudgetStep
from bowden.estimation.gap import Gap
from bowden.estimation.gate.finding import Finding
from bowden.estimation.posterior import Estimate
from bowden.model import Inputs, Mode, Model, parse_model, simulate
from bowden.recording.recording import Recording
from bowden.report.diagnosis import TITLES, diagnosis_report
from bowden.signals.prediction import simulate_recording

MODEL = parse_model(
    """
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 4000
    path: [{length_m: 2.0, radius_m: 0.28}]
    pretension_n: {value: 10, tolerance: 10 %}
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
  motor_encoder_counts_per_turn: 2000
  load_encoder_counts_per_turn: 10000
friction: {law: coulomb, mu_d: {value: 0.21, tolerance: 10 %}}
effects: []
numerics: {segments: 20}
""",
    source="rig.yaml",
)
MODE = Mode.TORQUE_POSITION
SIGMA = {"load_torque_nm": 1e-3, "motor_angle_rad": 1e-3}


def run_of(model: Model) -> Recording:
    time_s = np.arange(20_000) * 1e-3
    load = 0.6 * np.sin(2 * np.pi * 0.5 * time_s)
    torque = 0.12 * np.sin(2 * np.pi * 0.31 * time_s)
    run = simulate(model, MODE, Inputs(time_s, motor_torque_nm=torque, load_angle_rad=load))
    noise = np.random.default_rng(1).normal(0.0, 1e-3, (2, time_s.size))
    return Recording(
        time_s,
        motor_angle_rad=run.motor_angle_rad + noise[0],
        load_angle_rad=load,
        motor_torque_nm=torque,
        load_torque_nm=run.load_torque_nm + noise[1],
        source="<b>run</b>.csv",
    )


@pytest.fixture(scope="module")
def named() -> Diagnosis:
    return named_diagnosis()


def named_diagnosis() -> Diagnosis:
    """A gap made by gravity, as `diagnose` would report it."""
    extended = MODEL.with_effect("gravity_imbalance", {"amplitude_nm": 0.03, "phase_rad": 0.8})
    recording = run_of(extended)
    before, after = (simulate_recording(one, MODE, recording) for one in (MODEL, extended))
    series = tuple(
        Series(
            source=recording.source,
            quantity=name,
            time_s=recording.time_s,
            measured=getattr(recording, name),
            before=getattr(before, name),
            after=getattr(after, name),
            sigma=np.full(recording.time_s.size, sigma),
        )
        for name, sigma in SIGMA.items()
    )
    where = localise([(series[0].measured - series[0].before) / 1e-3], [recording], [before])
    gaps = (Gap("load_torque_nm", 21e-3, 1.03e-3, 1e-3), Gap("motor_angle_rad", 1e-3, 1e-3, 1e-3))
    return Diagnosis(
        verdict="named",
        sentence="Handle gravity is missing: with it the load torque's gap falls to the noise.",
        effects=(
            NamedEffect(
                "gravity_imbalance",
                "Handle gravity",
                "",
                {
                    "amplitude_nm": Value(0.0301, 0.0295, 0.0308, "N m"),
                    "phase_rad": Value(0.79, 0.76, 0.83, "rad"),
                },
                0.97,
            ),
        ),
        ranking=tuple(
            Ranked(name, variant, score, 1e-3)
            for name, variant, score in (
                ("gravity_imbalance", "", 412.0),
                ("load_cell_offset", "", 310.0),
                ("encoder_eccentricity", "load", 120.0),
                ("viscous_friction", "", 3.0),
                ("wear", "", -2.0),
            )
        ),
        cannot_tell_apart=(("gravity_imbalance", "load_cell_offset"),),
        where=where.places,
        where_map=where.map,
        gap=gaps[0],
        gaps=gaps,
        calibration=(
            Estimate("rig.cable.pretension_n", 10.0, 10.4, 10.3, 10.5, 0.05, 1.0, 0.4, False, True),
            Estimate("friction.mu_d", 0.21, 0.14, 0.13, 0.15, 0.005, 0.021, -3.3, True, True),
        ),
        quality=(Finding("gap", "run.csv, time_s", "1 gap", "none", "warn"),),
        excitation=excitation(MODEL, [recording]),
        next_experiment="Move the load by ±90°: they then differ by 12 mN m, 12 times the noise.",
        next_command="bowden record wide.blf --duration 30 --enable tunnel",
        model=extended,
        mode=MODE,
        series=series,
        notes=("a note",),
        seed=7,
        odds={"viscous_friction": 0.97, "unlisted": 0.03},
        budget=(
            BudgetStep("model file", 0.05, 0.0, 0.0, 0.0),
            BudgetStep("calibration", 0.04, 0.36, 0.2, 0.5),
            BudgetStep("viscous_friction", 0.002, 0.63, 0.5, 0.8),
            BudgetStep("noise floor", 0.001, 0.01, 0.01, 0.01),
        ),
    )


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


def words(html: str) -> str:
    """What a reader sees, without scripts and tags."""
    body = re.sub(r"<script.*?</script>", " ", html, flags=re.DOTALL)
    return " ".join(re.sub(r"<[^>]+>", " ", body).split())


def test_the_page_loads_nothing_and_is_whole(named: Diagnosis) -> None:
    html = diagnosis_report(named)
    tags = Tags()
    tags.feed(html)
    assert tags.loads == []
    assert tags.open == []
    assert len(html.encode()) < 8e6


def test_the_verdict_is_what_one_reads_first(named: Diagnosis) -> None:
    html = diagnosis_report(named)
    assert named.sentence in html.replace("&#x27;", "'")
    assert html.index('class="verdict"') < html.index('class="tiles"') < html.index("<table>")
    text = words(html)
    assert "21.0 mN m" in text
    assert "1.03 ×" in text
    assert "97 %" in text


def test_what_is_missing_has_numbers_units_and_what_it_is_confused_with(named: Diagnosis) -> None:
    text = words(diagnosis_report(named))
    assert "0.0301" in text
    assert "0.0295 .. 0.0308" in text
    assert "do not distinguish it from load-cell offset" in text
    assert "bowden record wide.blf --duration 30 --enable tunnel" in text


def test_every_plot_is_there(named: Diagnosis) -> None:
    html = diagnosis_report(named)
    for name in ("series-1", "map", "places", "ranking", "calibration"):
        assert f'id="{name}"' in html


def test_what_the_user_wrote_is_shown_and_not_executed(named: Diagnosis) -> None:
    html = diagnosis_report(named, {"model file": "<i>rig</i>"})
    assert "<b>run</b>" not in html
    assert "<i>rig</i>" not in html
    assert "&lt;i&gt;rig&lt;/i&gt;" in html


def test_the_page_shows_where_it_was_found_and_not_where_it_was_not(named: Diagnosis) -> None:
    assert any(one.significant for one in named.where)
    quiet = replace(named, where=tuple(replace(one, significant=False) for one in named.where))
    html = diagnosis_report(quiet)
    assert 'id="places"' not in html
    assert "No condition holds more" in html


@pytest.mark.parametrize("verdict", list(TITLES))
def test_every_verdict_makes_a_page(named: Diagnosis, verdict: str) -> None:
    one = replace(named, verdict=verdict)  # type: ignore[arg-type]
    if verdict in ("complete", "unlisted", "insufficient_excitation", "bad_data"):
        one = replace(one, effects=())
    html = diagnosis_report(one)
    assert TITLES[verdict] in html
    if not one.effects:
        assert "with the effect" not in words(html)


def test_what_stops_a_verdict_comes_before_everything_else(named: Diagnosis) -> None:
    stop = Finding("sign", "run.csv", "load torque has the wrong sign", "the right one", "stop")
    bare = replace(
        named,
        verdict="bad_data",
        effects=(),
        ranking=(),
        where=(),
        where_map=None,
        calibration=(),
        series=(),
        quality=(stop,),
        next_experiment="",
        next_command="",
    )
    html = diagnosis_report(bare)
    text = words(html)
    assert text.index("load torque has the wrong sign") < text.index("The data")
    assert 'id="series-1"' not in html


def test_ties_are_shown_side_by_side(named: Diagnosis) -> None:
    other = NamedEffect(
        "load_cell_offset",
        "Load-cell offset",
        "",
        {"offset_nm": Value(0.02, 0.01, 0.03, "N m")},
        0.4,
    )
    tie = replace(named, verdict="ambiguous", effects=(*named.effects, other))
    text = words(diagnosis_report(tie))
    assert "explains the recordings as well" in text
    assert "0.01 .. 0.03" in text
