"""What only samples that lie closer together show, named by a search on from where one ended.

Fits keep a sample each 8 ms and the turning points: what a rotor's ringing does in between is lost
to them, and a selection that explains those samples may leave much of the others. Then one more
effect is looked for in closer ones. Called by `diagnose`, after `select` and `form_error`.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from bowden.diagnosis.candidates import Candidate
from bowden.diagnosis.rules.decide import HeldOutResidual
from bowden.diagnosis.rules.figures import rest_of
from bowden.diagnosis.rules.hypothesis import MOST_EFFECTS
from bowden.diagnosis.rules.noise_scale import AT_FLOOR
from bowden.diagnosis.rules.prepare import prepare
from bowden.diagnosis.rules.problem import WeighedRecording, WeighedRecordings
from bowden.diagnosis.rules.select import Selection, look_closer
from bowden.model import Mode, Model, ModelError
from bowden.recording.recording import Recording

CLOSER_S = 2e-3


def closely(
    selection: Selection,
    rest: HeldOutResidual,
    mode: Mode,
    recordings: Sequence[Recording],
    candidates: Sequence[Candidate],
    *,
    seed: int,
    pool: ThreadPoolExecutor,
) -> tuple[Selection, HeldOutResidual]:
    """Return a selection with one more effect, and what it leaves of all samples.

    Both as they were given where that is noise already, where the fitted samples show as well that
    something is missing, or where no further effect helps.

    Parameters
    ----------
    selection : Selection
    rest : HeldOutResidual
        What it leaves of all samples.
    mode : Mode
    recordings : sequence of Recording
        As they were read.
    candidates : sequence of Candidate
    seed : int
    pool : ThreadPoolExecutor
    """
    chosen = selection.chosen
    enough = len(chosen.effects)
    if rest.is_noise_after(enough) or chosen.rest >= AT_FLOOR or enough == MOST_EFFECTS:
        return selection, rest

    def weigh(model: Model) -> list[WeighedRecording]:
        return prepare(model, mode, recordings, seed, pool, step_s=CLOSER_S)

    try:
        model = chosen.fitted.model
        problem = WeighedRecordings(mode, weigh(model), weigh).with_noise_of(model, anew=False)
        found = look_closer(selection, candidates, problem, pool=pool)
        ready = prepare(found.chosen.fitted.model, mode, recordings, seed, pool, step_s=0.0)
        left = rest_of(found, WeighedRecordings(mode, ready), pool)
    except ModelError:  # it runs what was measured, but not every path beside it
        return selection, rest
    return (found, left) if left.is_noise_after(len(found.chosen.effects)) else (selection, rest)
