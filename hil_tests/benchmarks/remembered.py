"""Search again with another constant, at the cost of what the constant changes.

The slow steps of `bowden.diagnosis.search` remember what they have returned. A result is used again
where the arguments are the same and so is every constant of the modules that the step can call.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
from bowden.diagnosis import fitting, growing, proposals, search, sets, weighing
from bowden.diagnosis.fitting import Start
from bowden.diagnosis.screening import Screen

from hil_tests.benchmarks.decision_constants import constants, reached_from

#: Where each step is looked up, its name, and the module beyond which it calls nothing. `_base`
#: stands in `sets` but only fits.
STEPS: Final[tuple[tuple[Any, str, str], ...]] = (
    (search, "as_searched", "material"),
    (sets, "_base", "fitting"),
    (fitting, "_noises_about", "fitting"),
    (proposals, "start_of", "fitting"),
    (growing, "start_of", "fitting"),
    (Start, "unmoved", "fitting"),
    (Start, "begun", "fitting"),
    (sets, "finish", "fitting"),
    (sets, "Screen", "screening"),
    (proposals, "Screen", "screening"),
    (Screen, "screen", "screening"),
    (Screen, "anew", "screening"),
    (Screen, "peaks", "screening"),
    (Screen, "annealed", "screening"),
    (search, "predict_unseen", "predict"),
    (weighing, "predict_unseen", "predict"),
)


class Memory:
    """What the steps of one case's searches have returned, and the time that this saved."""

    def __init__(self) -> None:
        self.saved_s = 0.0
        self._known: dict[object, tuple[object, float, object]] = {}

    @contextmanager
    def used(self) -> Iterator[None]:
        """While it is open, the steps remember."""
        before = [getattr(place, name) for place, name, _ in STEPS]
        wrapped: dict[object, Callable[..., object]] = {}
        try:
            for (place, name, reach), step in zip(STEPS, before, strict=True):
                setattr(place, name, wrapped.setdefault(step, self._remembering(step, reach)))
            yield
        finally:
            for (place, name, _), step in zip(STEPS, before, strict=True):
                setattr(place, name, step)

    def _remembering(self, step: Callable[..., object], reach: str) -> Callable[..., object]:
        modules = reached_from(reach)
        read = [one for one in constants() if one.module in modules]

        def remembering(*arguments: object) -> object:
            key = (step, _key(arguments), _key([one.value for one in read]))
            if key in self._known:
                result, seconds, _ = self._known[key]
                self.saved_s += seconds
                return result
            began, saved = time.process_time(), self.saved_s
            result = step(*arguments)
            seconds = time.process_time() - began + self.saved_s - saved
            self._known[key] = result, seconds, arguments  # kept: an identity must stay theirs
            return result

        return remembering


def _key(value: object) -> object:
    """Return what is equal for equal numbers, text and collections, and for the same object."""
    if isinstance(value, Mapping):
        return tuple((name, _key(one)) for name, one in value.items())
    if isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(map(_key, value))
    if isinstance(value, np.ndarray):
        return value.tobytes()
    return value if isinstance(value, str | int | float | None) else id(value)
