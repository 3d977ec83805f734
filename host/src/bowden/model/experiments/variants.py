"""Models that differ from a given one in what an experiment varies: pretension, loops, friction.

Each function returns a new `Model`; the given one stays as it is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from bowden.model.description import Model
from bowden.model.errors import ModelError
from bowden.model.model_file import Part, PathPiece, Quantity

P = TypeVar("P", bound=Part)


def with_pretension(model: Model, pretension_n: float) -> Model:
    """Return the model with both cables at another pretension.

    Raises
    ------
    ModelError
        The model starts from a tension profile instead, so that a pretension would change nothing.
    """
    if model.document.rig.cable.initial_profile is not None:
        raise ModelError(
            "rig.cable.initial_profile: found a profile where the experiment sets the pretension; "
            "accepted: pretension_n alone",
            model.source,
        )
    return model.with_values({"rig.cable.pretension_n": pretension_n})


def with_loops(model: Model, loops: int) -> Model:
    """Return the model with its conduit in `loops` full turns of one radius, ``L/(2 pi n)``."""
    length = model.document.rig.cable.length_m
    radius = Quantity(value=length.value / (2.0 * math.pi * loops))
    path = (PathPiece(length_m=Quantity(value=length.value), radius_m=radius),)
    cable = _changed(model.document.rig.cable, path=path)
    return _with(model, rig=_changed(model.document.rig, cable=cable))


def with_segments(model: Model, segments: int) -> Model:
    """Return the model solved on a mesh of so many segments a cable.

    Raises
    ------
    ModelError
        Fewer than one segment.
    """
    if segments < 1:
        raise ModelError(f"segments: found {segments}, accepted: 1 or more")
    numerics = _changed(model.document.numerics, solver=None, segments=segments)
    return _with(model, numerics=numerics)


def without_mesh(model: Model) -> Model:
    """Return the model solved exactly, by the mesh-free solver."""
    numerics = _changed(model.document.numerics, solver="mesh_free", segments=None, grading=None)
    return _with(model, numerics=numerics)


def without_stiction_length(model: Model) -> Model:
    """Return the model with mu_s over one segment, as eqs. (4) and (6) print it.

    Without a mesh there is no segment for the excess to act over: it vanishes.
    """
    friction = _changed(model.document.friction, stiction_length_m=None)
    return _with(model, friction=friction)


def with_memory(model: Model, memory_s: float) -> Model:
    """Return the model with another memory of the sliding speed, where friction falls with it."""
    friction = _changed(model.document.friction, memory_s=Quantity(value=memory_s))
    return _with(model, friction=friction)


def with_damping(model: Model, damping_s: float) -> Model:
    """Return the model with other losses in the strands, which count with a motor's inertia."""
    return _with(
        model, numerics=_changed(model.document.numerics, damping_s=Quantity(value=damping_s))
    )


def with_effects(model: Model, places: Sequence[int]) -> Model:
    """Return the model with those of its effects that stand at some places of its list alone."""
    kept = tuple(model.document.effects[k] for k in places)
    return _with(model, effects=kept, posterior=None)


def with_viscous_term(model: Model, mu_v_s_per_m: float) -> Model:
    """Return the model with ``mu(v) = mu_d + mu_v abs(v)`` in place of any such term it has."""
    others = tuple(e for e in model.document.effects if e.get("name") != "viscous_friction")
    term = {"name": "viscous_friction", "mu_v_s_per_m": mu_v_s_per_m}
    return _with(model, effects=(*others, term))


def _changed(part: P, **values: object) -> P:
    return part.model_copy(update=values)


def _with(model: Model, **parts: object) -> Model:
    changed = replace(model, document=_changed(model.document, **parts))
    _ = changed.transmission  # checks the numbers together
    return changed
