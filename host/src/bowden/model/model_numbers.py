"""From a checked model file to the numbers that the solvers read.

Takes a `ModelFile` and its effects, and says what does not go together. `description.Model`
offers the result.
"""

# ruff: noqa: ANN401  (what a YAML file holds is not known before it is checked)

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bowden.model.errors import ModelError
from bowden.model.friction.bouc_wen import BoucWen, Branch
from bowden.model.friction.dahl import Dahl
from bowden.model.friction.lugre import LuGre
from bowden.model.lumped import Lumped
from bowden.model.mesh_free.solver import refuse_what_is_not_coulomb
from bowden.model.model_effects import InForce
from bowden.model.model_file import (
    BRISTLE_LAWS,
    LAW_KEYS,
    SOLVER_KEYS,
    BoucWenBranch,
    Friction,
    ModelFile,
    Quantity,
)
from bowden.model.transmission import FrictionLaw, Transmission


def transmission_of(document: ModelFile, effects: Sequence[InForce]) -> Transmission:
    """Build the numbers of the pair, with the effects that change them.

    Raises
    ------
    ModelError
        A value out of range.
    """
    pair = _pair(document)
    problems: list[str] = []
    for one in effects:
        if one.variant.pair is not None:
            try:
                pair = one.variant.pair(pair, one.values)
            except ModelError as error:
                problems += [f"{one.where}: {problem}" for problem in error.problems]
    if problems:
        raise ModelError(problems)
    return pair


def solver_of(document: ModelFile, pair: Transmission, effects: Sequence[InForce]) -> str:
    """Choose the solver: what the file names or implies, or what friction and effects need."""
    chosen = document.numerics.chosen()
    if chosen is not None:
        return chosen
    if document.friction.law in BRISTLE_LAWS:
        return "lumped"
    plain = _plain_friction(pair) and not _mesh_only(pair, effects)
    return "mesh_free" if plain else "mesh"


def lumped_of(document: ModelFile) -> Lumped:
    """Build what the lumped transmission has beyond the numbers of the pair."""
    numerics, friction = document.numerics, document.friction
    given = {
        key: _plain_value(getattr(numerics, key))
        for key in SOLVER_KEYS["lumped"]
        if getattr(numerics, key) is not None
    }
    if friction.law in BRISTLE_LAWS:
        given["law"] = _bristle_law(friction)
    return Lumped(**given)


def misfits(document: ModelFile, pair: Transmission, effects: Sequence[InForce]) -> list[str]:
    """Return whether friction, effects and solver go together."""
    name = document.friction.law
    solver = solver_of(document, pair, effects)
    if solver != "lumped" and name in BRISTLE_LAWS:
        return [f"friction.law: found {name} with solver {solver}, accepted: lumped"]
    try:
        if solver == "mesh_free":
            refuse_what_is_not_coulomb(pair)
        if solver == "lumped":
            lumped_of(document)
    except ModelError as error:
        return [f"friction, numerics: {problem}" for problem in error.problems]
    only = _mesh_only(pair, effects)
    if solver != "mesh" and only:
        return [f"numerics.solver: found {solver} with {only}, accepted: mesh"]
    if solver == "lumped" and not _plain_friction(pair):
        return ["numerics.solver: found lumped with stiction or a friction effect, accepted: mesh"]
    return []


def _mesh_only(pair: Transmission, effects: Sequence[InForce]) -> str:
    """Return which effect, beside a friction law, only the mesh can compute; "" for none."""
    for one in effects:
        if one.variant.histories is not None:
            return one.effect.name
    plain = pair.is_plain and pair.motor_inertia_kg_m2 == 0.0
    return "" if plain else "an effect of cables or pulleys"


def _plain_friction(pair: Transmission) -> bool:
    law = pair.friction
    return law.is_coulomb and not law.has_stiction and law.direction_asymmetry == 0


def _bristle_law(friction: Friction) -> Dahl | LuGre | BoucWen:
    given: dict[str, Any] = {
        key: getattr(friction, key)
        for key in LAW_KEYS[friction.law]
        if getattr(friction, key) is not None
    }
    for key, value in given.items():
        if isinstance(value, BoucWenBranch):
            parts = {name: _plain_value(part) for name, part in value if part is not None}
            given[key] = Branch(**parts)
        else:
            given[key] = _plain_value(value)
    kinds = {"dahl": Dahl, "lugre": LuGre, "bouc_wen": BoucWen}
    made: Dahl | LuGre | BoucWen = kinds[friction.law](**given)
    return made


def _plain_value(value: Any) -> Any:
    return value.value if isinstance(value, Quantity) else value


def _pair(document: ModelFile) -> Transmission:
    """Build the numbers of the pair, without effects."""
    cable, numerics, law = document.rig.cable, document.numerics, document.friction
    lengths = np.array([piece.length_m.value for piece in cable.path])
    if cable.axial_stiffness_n is not None:
        stiffness = cable.axial_stiffness_n.value
    else:
        assert cable.end_to_end_stiffness_n_per_m is not None  # the schema says one of the two
        stiffness = cable.end_to_end_stiffness_n_per_m.value * cable.length_m.value
    mu_d = law.mu_d.value
    friction = FrictionLaw(
        mu_d=mu_d,
        mu_s=law.mu_s.value if law.mu_s is not None else mu_d,
        stiction_length_m=_optional(law.stiction_length_m),
    )
    if law.memory_s is not None:
        friction = replace(friction, memory_s=law.memory_s.value)
    pair = Transmission(
        axial_stiffness_n=stiffness,
        piece_length_m=lengths,
        piece_curvature_per_m=np.array([1.0 / piece.radius_m.value for piece in cable.path]),
        pretension_n=cable.pretension_n.value,
        motor_pulley_radius_m=document.rig.motor_pulley_radius_m.value,
        load_pulley_radius_m=document.rig.load_pulley_radius_m.value,
        friction=friction,
        segments=numerics.segments,
        graded=numerics.grading == "curvature",
    )
    if cable.initial_profile is not None:
        at = [point.position_m.value for point in cable.initial_profile]
        tension = [point.tension_n.value for point in cable.initial_profile]
        pair = replace(pair, initial_position_m=np.array(at), initial_tension_n=np.array(tension))
    if numerics.rest_time_s is not None:
        pair = replace(pair, rest_time_s=numerics.rest_time_s.value)
    if numerics.velocity_dead_band_m_per_s is not None:
        band = numerics.velocity_dead_band_m_per_s.value
        pair = replace(pair, velocity_dead_band_m_per_s=band)
    if numerics.damping_s is not None:
        pair = replace(pair, damping_s=numerics.damping_s.value)
    return pair


def _optional(quantity: Quantity | None) -> float | None:
    return None if quantity is None else quantity.value
