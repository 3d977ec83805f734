"""From a checked model file to the numbers that the solvers read.

Takes a `ModelFile`, applies its effects, and says what does not go together. `description.Model`
offers the result.
"""

# ruff: noqa: ANN401  (what a YAML file holds is not known before it is checked)

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from bowden.model.effects import APPLIED, CATALOGUE
from bowden.model.errors import ModelError
from bowden.model.friction.bouc_wen import BoucWen, Branch
from bowden.model.friction.dahl import Dahl
from bowden.model.friction.lugre import LuGre
from bowden.model.lumped import Lumped
from bowden.model.mesh_free import refuse_what_is_not_coulomb
from bowden.model.model_file import (
    BRISTLE_LAWS,
    LAW_KEYS,
    SOLVER_KEYS,
    BoucWenBranch,
    Finite,
    Friction,
    ModelFile,
    Quantity,
)
from bowden.model.model_problems import nearest, problem_line
from bowden.model.transmission import FrictionLaw, Transmission

NUMBER: TypeAdapter[Quantity] = TypeAdapter(Finite)


def transmission_of(document: ModelFile) -> Transmission:
    """Build the numbers of the pair, effects applied.

    Raises
    ------
    ModelError
        All that is wrong with the effects, or a value out of range.
    """
    pair = _pair(document)
    problems: list[str] = []
    for i, effect in enumerate(document.effects):
        where = f"effects[{i}]"
        parameters, found = _effect_values(where, effect)
        problems += found
        if not found:
            try:
                pair = APPLIED[str(effect["name"])][1](pair, parameters)
            except ModelError as error:
                problems += [f"{where}: {problem}" for problem in error.problems]
    if problems:
        raise ModelError(problems)
    return pair


def solver_of(document: ModelFile, pair: Transmission) -> str:
    """Choose the solver: what the file names or implies, or what the friction needs."""
    chosen = document.numerics.chosen()
    if chosen is not None:
        return chosen
    if document.friction.law in BRISTLE_LAWS:
        return "lumped"
    law = pair.friction
    plain = law.is_coulomb and not law.has_stiction and law.direction_asymmetry == 0
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


def misfits(document: ModelFile, pair: Transmission) -> list[str]:
    """Say whether friction and solver go together."""
    law, name = pair.friction, document.friction.law
    solver = solver_of(document, pair)
    if solver != "lumped" and name in BRISTLE_LAWS:
        return [f"friction.law: found {name} with solver {solver}, accepted: lumped"]
    try:
        if solver == "mesh_free":
            refuse_what_is_not_coulomb(pair)
        if solver == "lumped":
            lumped_of(document)
    except ModelError as error:
        return [f"friction, numerics: {problem}" for problem in error.problems]
    plain = law.is_coulomb and not law.has_stiction and law.direction_asymmetry == 0
    if solver == "lumped" and not plain:
        return ["numerics.solver: found lumped with stiction or a friction effect, accepted: mesh"]
    return []


def effect_problems(effects: Any) -> list[str]:
    """Problems of the effects of a file whose other parts have some too."""
    if not isinstance(effects, list):
        return []
    known = [(i, e) for i, e in enumerate(effects) if isinstance(e, dict)]
    return [problem for i, e in known for problem in _effect_values(f"effects[{i}]", e)[1]]


def _effect_values(where: str, effect: Mapping[str, Any]) -> tuple[dict[str, float], list[str]]:
    """Read an entry of `effects`: its parameters, or what is wrong with it."""
    name = effect.get("name")
    if not isinstance(name, str) or name not in CATALOGUE:
        hint = nearest(str(name), list(CATALOGUE)) if isinstance(name, str) else ""
        return {}, [f"{where}.name: found {name!r}, no known effect{hint}"]
    if name not in APPLIED:
        return {}, [
            f"{where}: {name} is a known effect that the offline model cannot compute; "
            f"it can: {', '.join(APPLIED)}"
        ]
    needed = APPLIED[name][0]
    given = {str(key): value for key, value in effect.items() if key != "name"}
    problems = [f"{where}.{key}: missing" for key in needed if key not in given]
    problems += [
        f"{where}.{k}: unknown key{nearest(k, list(needed))}" for k in given if k not in needed
    ]
    values = {}
    for key in needed:
        if key in given:
            try:
                values[key] = NUMBER.validate_python(given[key]).value
            except ValidationError as error:
                problems.append(problem_line({**error.errors()[0], "loc": (f"{where}.{key}",)}, {}))
    return values, problems


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
    return pair


def _optional(quantity: Quantity | None) -> float | None:
    return None if quantity is None else quantity.value
