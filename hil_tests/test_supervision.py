"""The supervision lets healthy rigs alone: random rigs, wrong models, hidden effects, every law."""

from __future__ import annotations

import pytest
from bowden.drive.dictionary import lookup
from bowden.drive.meanings import CompensationLaw, Supervision
from bowden_rig.native import NativeTarget

from hil_tests.render import trial
from hil_tests.render.laws import LAWS, entries
from hil_tests.render.rigs import draw
from hil_tests.render.tasks import task_named
from hil_tests.render.trial import run

RIGS = range(8000, 8100)
TASKS = ("tunnel-fast", "steps", "tunnel-slow", "wall-edge")
TIGHTER_M = 1.5e-3  # stretch_tolerance is 2 mm by default


@pytest.mark.parametrize("seeds", [RIGS[i::4] for i in range(4)], ids=lambda s: f"from {s[0]}")
def test_no_healthy_rig_is_stopped(seeds: range, monkeypatch: pytest.MonkeyPatch) -> None:
    """With three quarters of the tolerance: what is left is the margin of the default."""
    monkeypatch.setattr(trial, "entries", lambda *a: entries(*a) | {"stretch_tolerance": TIGHTER_M})
    stopped = []
    for seed in seeds:
        rig, law = draw(seed), LAWS[seed % len(LAWS)]
        target = NativeTarget.for_rig(16, rig.rig)
        found = run(rig, law, task_named(TASKS[seed // len(LAWS) % len(TASKS)]), target)
        if found.bridge_off:
            place = target.entry("supervision_latched")
            bits = target.inside().drive[place.offset : place.offset + 4].view("uint32")[0]
            stopped.append((seed, law.name, str(Supervision(int(bits)))))
    assert stopped == []


def test_the_default_leaves_a_margin_and_every_law_is_among_them() -> None:
    tolerance = lookup("stretch_tolerance")
    assert tolerance.to_value(int(tolerance.default)) > 1.3 * TIGHTER_M
    assert {law.number for law in LAWS} == set(CompensationLaw)
