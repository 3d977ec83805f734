"""The page in a real browser: headless Chromium, driven by Playwright, on the simulated rig."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator

import pytest
from bowden.recording.read import read_recording
from playwright.sync_api import Page, expect, sync_playwright

from .conftest import Studio

CHROMIUM = next(
    (
        path
        for name in ("chromium", "chromium-browser", "google-chrome")
        if (path := shutil.which(name))
    ),
    None,
)
pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium on this machine (Debian: apt-get install chromium)"
)
HANGS_MS = 600_000  # only ends a test that hangs


@pytest.fixture
def page(studio: Studio) -> Iterator[Page]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox"], timeout=HANGS_MS
        )
        page = browser.new_page(viewport={"width": 1280, "height": 1000})
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on(
            "console",
            lambda message: problems.append(message.text) if message.type == "error" else None,
        )
        page.set_default_timeout(HANGS_MS)
        expect.set_options(timeout=HANGS_MS)
        page.goto(studio.access.address)
        expect(page.locator("#state")).to_contain_text("switch on disabled")
        yield page
        browser.close()
        assert problems == []


def start(page: Page) -> None:
    page.click("text=start the motor")
    expect(page.locator("#state")).to_contain_text("operation enabled")


def coloured_pixels(page: Page, name: str) -> int:
    """Count the pixels of a canvas on which something is drawn."""
    script = """canvas => { const data = canvas.getContext('2d')
        .getImageData(0, 0, canvas.width, canvas.height).data;
        let count = 0; for (let i = 3; i < data.length; i += 4) count += data[i] > 0;
        return count; }"""
    return int(page.locator(f"#{name}").evaluate(script))


def test_run_see_the_loop_record_stop(page: Page, studio: Studio) -> None:
    assert "token" not in page.url
    start(page)
    assert studio.motor_is_on
    page.click("#recording")
    expect(page.locator("#state")).to_contain_text(re.compile(r"recording [2-9]\."))
    assert coloured_pixels(page, "loop") > 2000
    assert coloured_pixels(page, "time") > 2000
    # Along the cables: the pretension of 10 N, and what the operator's motion makes of it.
    low_n, high_n = page.evaluate("tensions.ranges[1]")
    assert low_n < 10 < high_n
    page.click("#mark")
    page.click("#recording")
    expect(page.locator("#recordings label")).to_have_text(" run_1.blf")
    # The space bar stops, also while the user types a name.
    page.focus("#name")
    page.keyboard.press("Space")
    expect(page.locator("#state")).to_contain_text("switch on disabled")
    assert not studio.motor_is_on
    recording = read_recording(studio.folder / "run_1.blf")
    assert recording.metadata["marks"].endswith("mark")
    page.check("#recordings input")
    page.click("text=compare with the model")
    expect(page.locator("#job")).to_contain_text("compare done", timeout=HANGS_MS)
    report = page.frame_locator("iframe")
    expect(report.locator("h1")).to_have_text("Measured and simulated")


def await_next_state(page: Page) -> None:
    """Wait until the page has taken another of the many states a second."""
    page.evaluate("""() => new Promise((resolve) => {
        const first = now, look = () => now === first ? requestAnimationFrame(look) : resolve();
        look(); })""")


def test_a_refusal_stays_until_there_is_something_new(page: Page, studio: Studio) -> None:
    page.click("text=compare with the model")
    expect(page.locator("#message")).to_have_text("choose a recording first")
    await_next_state(page)
    expect(page.locator("#message")).to_have_text("choose a recording first")
    # An empty field is no torque of 0 N m.
    page.check("input[value=torque]")
    page.fill("#torque", "")
    page.click("text=start the motor")
    expect(page.locator("#message")).to_contain_text("found torque without a torque")
    await_next_state(page)
    expect(page.locator("#message")).to_contain_text("found torque without a torque")
    assert not studio.motor_is_on
    page.click("#recording")
    expect(page.locator("#message")).to_have_text("recording into run_1.blf")


def test_the_stop_is_always_in_sight_and_works(page: Page, studio: Studio) -> None:
    start(page)
    page.set_viewport_size({"width": 420, "height": 700})
    page.mouse.wheel(0, 5000)
    expect(page.locator("#stop")).to_be_in_viewport()
    box = page.locator("#stop").bounding_box()
    assert box is not None
    assert box["width"] * box["height"] > 8000
    page.click("#stop")
    expect(page.locator("#state")).to_contain_text("switch on disabled")
    assert not studio.motor_is_on


def test_losing_the_page_stops_the_motor(
    page: Page, studio: Studio, unwatched: Callable[[Studio], str]
) -> None:
    start(page)
    page.goto("about:blank")
    unwatched(studio)


def test_the_diff_is_shown_before_it_is_written(page: Page, studio: Studio) -> None:
    page.fill("[name=tunnel_half_width]", "0.1")
    page.click("text=what would change?")
    expect(page.locator("#changes")).to_contain_text("tunnel_half_width")
    assert studio.bench.session.snapshot().tunnel["tunnel_half_width"] == pytest.approx(0.05)
    page.click("text=write to the drive")
    expect(page.locator("#message")).to_contain_text("changed and read back")
    assert studio.bench.session.snapshot().tunnel["tunnel_half_width"] == pytest.approx(0.1)


def test_the_verdict_s_next_command_is_a_button(page: Page, studio: Studio) -> None:
    told = {
        "verdict": "ambiguous",
        "next_experiment": "Slow strokes would tell them apart.",
        "next_command": "bowden record slow.blf --duration 1.5 --enable torque --torque 0.05",
    }
    (studio.folder / "none.html").write_text("<p>a report</p>")
    studio.bench.note_job(
        {"do": "diagnose", "state": "done", "report": "none.html"} | {"result": told}
    )
    expect(page.locator("#advice")).to_contain_text("Slow strokes")
    page.click("#next")
    expect(page.locator("#recordings label")).to_have_text(" slow.blf")
    expect(page.locator("#state")).to_contain_text("switch on disabled")
    assert not studio.motor_is_on
    recording = read_recording(studio.folder / "slow.blf")
    assert recording.metadata["target_torque_nm"] == "0.05"
    # It ends by the drive's clock, some pictures of the page after its time.
    assert recording.time_s[-1] - recording.time_s[0] > 1.4


def test_an_experiment_with_its_parameters(page: Page, studio: Studio) -> None:
    page.select_option("[name=experiment]", "torque")
    page.fill("[name=torque_nm]", "0.04")
    page.fill("[name=duration_s]", "0.6")
    page.fill("#runname", "pull_1")
    page.click("text=run and record")
    expect(page.locator("#recordings label")).to_have_text(" pull_1.blf")
    expect(page.locator("#state")).to_contain_text("switch on disabled")
    assert not studio.motor_is_on
    recording = read_recording(studio.folder / "pull_1.blf")
    assert recording.metadata["target_torque_nm"] == "0.04"
    assert "cut" not in recording.metadata


def test_any_entry_is_shown_before_it_is_written(page: Page) -> None:
    page.fill("#entry", "compensation_law=nothing")
    page.click("text=what would change?")
    expect(page.locator("#message")).to_contain_text("compensation_law")
    page.fill("#entry", "motor_torque_limit=0.4")
    page.click("text=what would change?")
    expect(page.locator("#changes")).to_contain_text("motor_torque_limit")
    expect(page.locator("#changes")).to_contain_text("0.5 → 0.4 N m")
