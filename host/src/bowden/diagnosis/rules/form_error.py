"""Model-form error: fit and judge a law with what its form leaves open as part of the noise.

Dahl's bristle or a stiff spring, friction that ages in motion or only at standstill: a name stands
for laws that differ by a third of what they do, and a few samples that are known to half a
millinewton metre would refuse all but one of them, or pull its numbers to where it fits
those. So where the chosen law leaves more than the noise, it is fitted and judged once more, each
sample's noise widened by `Effect.form_error` of what the effect does there (`propagate`). The
reported noise floor stays that of the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from bowden.diagnosis.rules.decide import HeldOutResidual
from bowden.diagnosis.rules.figures import rest_of
from bowden.diagnosis.rules.hypothesis import again
from bowden.diagnosis.rules.prepare import prepare
from bowden.diagnosis.rules.problem import WeighedRecording, WeighedRecordings
from bowden.diagnosis.rules.select import Selection
from bowden.model import Mode, Model, ModelError
from bowden.model.effects.effect import EXACT
from bowden.recording.recording import Recording

ROUNDS = 2  # what an effect does depends on the numbers that are fitted


def with_form_error(
    selection: Selection,
    rest: HeldOutResidual,
    mode: Mode,
    recordings: Sequence[Recording],
    *,
    seed: int,
    pool: ThreadPoolExecutor,
) -> tuple[Selection, HeldOutResidual]:
    """Return the selection with other `reported` numbers, and what they leave.

    Both as they were given, where that is noise already, where the law is the only one of its name,
    or where even so it leaves more than noise.

    Parameters
    ----------
    selection : Selection
    rest : HeldOutResidual
        What it leaves.
    mode : Mode
    recordings : sequence of Recording
        As they were read.
    seed : int
    pool : ThreadPoolExecutor
    """
    if rest.is_noise or selection.chosen.form_error <= EXACT:
        return selection, rest
    try:
        found, left = _judged_again(selection, mode, recordings, seed, pool)
    except ModelError:  # it runs what was measured, but not every path beside it
        return selection, rest
    return (found, left) if left.is_noise else (selection, rest)


def _judged_again(
    selection: Selection,
    mode: Mode,
    recordings: Sequence[Recording],
    seed: int,
    pool: ThreadPoolExecutor,
) -> tuple[Selection, HeldOutResidual]:

    def weigh(model: Model) -> list[WeighedRecording]:
        return prepare(model, mode, recordings, seed, pool, or_else=_without(model, selection))

    one = selection.chosen
    for _ in range(ROUNDS):
        model = one.fitted.model
        problem = WeighedRecordings(mode, weigh(model), weigh).with_noise_of(model, anew=False)
        one = again(one, problem)
    model = one.fitted.model
    or_else = _without(model, selection)
    ready = prepare(model, mode, recordings, seed, pool, step_s=0.0, or_else=or_else)
    found = replace(selection, reported=one)
    return found, rest_of(found, WeighedRecordings(mode, ready), pool)


def _without(model: Model, selection: Selection) -> list[tuple[Model, float]]:
    """Return the model without each effect whose name stands for several laws, and its share."""
    effects = selection.chosen.effects
    first = len(model.document.effects) - len(effects)
    return [
        # What one effect alone does is what calibration cannot do without it.
        (model.without_effect(i) if len(effects) > 1 else selection.base.fitted.model, form_error)
        for i, form_error in enumerate((one.effect.form_error for one in effects), first)
        if form_error > EXACT
    ]
