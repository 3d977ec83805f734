"""The live pages beside the wall clock: `bowden studio` in headless Chromium, `bowden watch`.

    python -m hil_tests.benchmarks --only paced_pages

One simulated rig runs as a process and renders the tunnel, moved by its operator, at 1 kHz. The
page's age is measured from outside: a second listener on the bus notes when each sample came, the
browser notes when the picture after the one that shows it begins, both by this machine's clock.
Other work on this machine is in these figures, so each comes with its load.
"""

from __future__ import annotations

import fcntl
import os
import pty
import re
import shutil
import statistics
import struct
import subprocess
import tempfile
import termios
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np
from bowden.drive.bus_options import BusOptions
from bowden.drive.simulated_rig import own_bus
from playwright.sync_api import Page, expect, sync_playwright

from hil_tests.benchmarks.measurement import Figure, load
from hil_tests.benchmarks.processes import (
    bowden_command,
    core_s,
    resident_bytes,
    rigs,
    sample_arrivals,
)

STUDIO_S: Final = 1800.0
WATCH_S: Final = 60.0
WARM_S: Final = 120.0
NODE: Final = 16
_CHROMIUM: Final = ("chromium", "chromium-browser", "google-chrome")
_STARTS_WITHIN_S: Final = 120.0
_LOOK_EVERY_S: Final = 5.0
#: Notes, after each picture, when the next one begins and the newest sample's device time.
_NOTE_PICTURES: Final = """() => {
    window.pictures = [];
    const draw = loop.draw.bind(loop);
    loop.draw = (...all) => {
        draw(...all);
        const device_s = rows[rows.length - 1][1];
        requestAnimationFrame(() => window.pictures.push([Date.now() / 1000, device_s]));
    };
}"""
_TAKE_PICTURES: Final = "() => window.pictures.splice(0)"


def figures(studio_s: float = STUDIO_S, watch_s: float = WATCH_S) -> list[Figure]:
    """Measure both pages."""
    options = own_bus(BusOptions())
    with tempfile.TemporaryDirectory(prefix="bowden_pages_") as name:
        folder = Path(name)
        with rigs(options, [NODE], folder):
            return [*watch(options, folder, watch_s), *studio(options, folder, studio_s)]


def watch(options: BusOptions, folder: Path, duration_s: float) -> list[Figure]:
    """Measure the processor time of `bowden watch` in a terminal of 120 by 40 characters."""
    master, slave = pty.openpty()
    _resize(slave)
    command = bowden_command(options, "watch", "--folder", str(folder))
    process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave)
    os.close(slave)
    shown = bytearray()
    reader = threading.Thread(target=_read_all, args=(master, shown), daemon=True)
    reader.start()
    deadline = time.monotonic() + _STARTS_WITHIN_S
    while b"samples" not in shown:
        if time.monotonic() > deadline or process.poll() is not None:
            raise TimeoutError(f"bowden watch shows nothing: {bytes(shown[-300:])!r}")
        time.sleep(0.2)
    began_s, before_s = time.monotonic(), core_s(process.pid)
    time.sleep(duration_s)
    share = (core_s(process.pid) - before_s) / (time.monotonic() - began_s)
    os.write(master, b"q")
    process.wait(_STARTS_WITHIN_S)
    os.close(master)
    context = f"{duration_s:g} s at 1 kHz, the operator moves the load; {load()}"
    return [Figure("host.watch.core_share", share, "1", context, "0.1")]


def studio(options: BusOptions, folder: Path, duration_s: float) -> list[Figure]:
    """Run the tunnel with the page open and measure its pictures, their age and the memory."""
    command = bowden_command(options, "studio", "--folder", str(folder), "--no-browser")
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    address = next(found[0] for line in process.stdout if (found := re.search(r"http://\S+", line)))
    with sample_arrivals(options, NODE) as arrivals, sync_playwright() as playwright:
        path = next(there for name in _CHROMIUM if (there := shutil.which(name)))
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 1000})
        page.goto(address)
        _start_motor(page)
        page.evaluate(_NOTE_PICTURES)
        pictures, sizes = _look(page, process.pid, duration_s)
        browser.close()
    process.terminate()
    process.wait(_STARTS_WITHIN_S)
    return _judge(np.array(pictures), np.array(arrivals), np.array(sizes), duration_s)


def _look(
    page: Page, pid: int, duration_s: float
) -> tuple[list[list[float]], list[tuple[float, ...]]]:
    """Collect the pictures; in each look its time and the server's core time, s, and memories."""
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")
    pictures: list[list[float]] = []
    sizes: list[tuple[float, ...]] = []
    began_s = time.monotonic()
    while (now_s := time.monotonic() - began_s) < duration_s:
        page.wait_for_timeout(1e3 * _LOOK_EVERY_S)
        pictures += page.evaluate(_TAKE_PICTURES)
        session.send("HeapProfiler.collectGarbage")
        metrics = session.send("Performance.getMetrics")["metrics"]
        heap = next(one["value"] for one in metrics if one["name"] == "JSHeapUsedSize")
        has_stopped = "operation enabled" not in (page.locator("#state").text_content() or "")
        if has_stopped:  # the page was not drawn for a second, or the host was late
            _start_motor(page)
        sizes.append((now_s, core_s(pid), resident_bytes(pid), heap, float(has_stopped)))
    return pictures, sizes


def _start_motor(page: Page) -> None:
    page.click("text=start the motor", timeout=1e3 * _STARTS_WITHIN_S)
    expect(page.locator("#state")).to_contain_text("operation enabled", timeout=60_000)


def _judge(
    pictures: np.ndarray, arrivals: np.ndarray, sizes: np.ndarray, duration_s: float
) -> list[Figure]:
    shown_s, device_s = pictures.T
    came_at = np.interp(device_s, arrivals[:, 0], arrivals[:, 1])
    age_s = shown_s - came_at
    # until the picture after it, a picture grows older
    oldest_s = age_s[:-1] + np.diff(shown_s)
    whole = np.bincount((shown_s - shown_s[0]).astype(int))[:-1]
    warm = sizes[:, 0] >= min(WARM_S, 0.1 * duration_s)
    kept = sizes[warm]
    fifth = max(len(kept) // 5, 1)
    server, heap = (
        (statistics.median(column[-fifth:]) - statistics.median(column[:fifth])) / 1e6
        for column in (kept[:, 2], kept[:, 3])
    )
    cores = (sizes[-1, 1] - sizes[0, 1]) / (sizes[-1, 0] - sizes[0, 0])
    context = f"{duration_s:g} s of the tunnel at 1 kHz, headless Chromium; {load()}"
    rows = [
        ("pictures", (len(shown_s) - 1) / (shown_s[-1] - shown_s[0]), "1/s", "30"),
        ("pictures_1_percent", float(np.quantile(whole, 0.01)), "1/s", ""),
        ("age_median", float(np.median(age_s)), "s", "0.15"),
        ("age_99", float(np.quantile(age_s, 0.99)), "s", "0.15"),
        ("age_before_next_99", float(np.quantile(oldest_s, 0.99)), "s", "0.15"),
        ("age_over_150_ms", float(np.mean(age_s > 0.15)), "1", "0"),
        ("motor_stops", float(np.sum(sizes[:, 4])), "1", ""),
        ("server_core_share", float(cores), "1", ""),
        ("server_growth", server, "MB", "0"),
        ("page_growth", heap, "MB", "0"),
    ]
    return [
        Figure(f"host.studio.{key}", value, unit, context, goal) for key, value, unit, goal in rows
    ]


def _resize(terminal: int) -> None:
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))


def _read_all(terminal: int, shown: bytearray) -> None:
    with suppress(OSError):  # the terminal is closed
        while data := os.read(terminal, 65536):
            shown += data
