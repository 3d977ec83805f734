"""What a named law may leave, and what that says of its numbers."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from bowden.diagnosis.rules.decide import HeldOutResidual, without_rejected
from bowden.diagnosis.rules.select import Selection

MANY = 1e6  # independent samples: no allowance for chance beyond 1.35


def test_what_is_left_is_noise_up_to_chance_and_to_the_parts_own_errors() -> None:
    assert HeldOutResidual(before=1.0, after=1.3, samples=MANY).is_noise
    assert not HeldOutResidual(before=1.5, after=1.4, samples=MANY).is_noise
    assert HeldOutResidual(before=2.0, after=1.5, samples=200.0).is_noise  # 1.35 + 4/sqrt(400)
    assert HeldOutResidual(before=200.0, after=5.0, samples=MANY).is_noise  # 3 % is
    assert not HeldOutResidual(before=20.0, after=5.0, samples=MANY).is_noise


def test_three_laws_together_have_to_leave_mere_noise() -> None:
    left = HeldOutResidual(before=20.0, after=1.2, samples=2.0)
    assert left.is_noise_after(1)
    assert left.is_noise_after(2)
    assert not left.is_noise_after(3)
    assert HeldOutResidual(before=20.0, after=1.05, samples=2.0).is_noise_after(3)


def test_numbers_are_as_sure_as_the_law_is_followed() -> None:
    assert HeldOutResidual(before=20.0, after=1.3, samples=MANY).lack_of_fit == 0.0
    # What is left beyond chance, sqrt(4^2 - 1.35^2), over what is explained, sqrt(20^2 - 4^2).
    assert HeldOutResidual(before=20.0, after=4.0, samples=MANY).lack_of_fit == pytest.approx(
        0.192, abs=2e-3
    )
    assert HeldOutResidual(before=3.0, after=3.0, samples=MANY).lack_of_fit == 0.0


@pytest.mark.parametrize(("gained", "named"), [(-3.0, False), (1.0, True), (10.0, True)])
def test_what_was_held_out_must_not_speak_against_an_effect(gained: float, named: bool) -> None:
    base = SimpleNamespace(effects=())
    chosen = SimpleNamespace(effects=("viscous_friction",))
    selection = Selection(base, chosen, chosen, chosen.effects, [], [], None, None)  # type: ignore[arg-type]
    rest = HeldOutResidual(before=1.2, after=1.1, samples=MANY, gained=gained)
    found, left = without_rejected(selection, rest)
    assert (found.chosen is chosen) is named
    assert (found.reported is chosen) is named
    assert left.after == (rest.after if named else rest.before)
