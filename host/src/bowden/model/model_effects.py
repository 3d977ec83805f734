"""From the ``effects`` of a model file to the catalogue's entries with their values.

Takes the list as it was read, says what is wrong with it, and returns the effects in force;
`model_numbers` puts those that change the pair into its numbers, `simulation` runs the rest.
"""

# ruff: noqa: ANN401  (what a YAML file holds is not known before it is checked)

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import TypeAdapter, ValidationError

from bowden.model.effects import CATALOGUE, LEARNED, Effect, Variant, law_of, table_in
from bowden.model.model_file import Number, Quantity
from bowden.model.model_problems import nearest, problem_line

NUMBER: TypeAdapter[Quantity] = TypeAdapter(Number)


@dataclass(frozen=True)
class InForce:
    """An effect that a model has, with its values.

    Parameters
    ----------
    where : str
        Its place in the file: ``effects[0]``.
    effect : Effect
    variant : Variant
    values : dict of str to float
        Of all the variant's parameters.
    """

    where: str
    effect: Effect
    variant: Variant
    values: dict[str, float]


def effects_in_force(entries: Sequence[Mapping[str, Any]]) -> tuple[list[InForce], list[str]]:
    """Read the entries; return those that are right, and all that is wrong."""
    found: list[InForce] = []
    problems: list[str] = []
    for i, entry in enumerate(entries):
        where = f"effects[{i}]"
        one, wrong = _read(where, entry)
        problems += wrong
        if one is None:
            continue
        twin = next((x for x in found if x.variant is one.variant), None)
        if twin is not None:
            problems.append(
                f"{where}: {one.effect.name} with {', '.join(one.values)} stands in {twin.where} "
                "already, accepted: once"
            )
        found.append(one)
    return found, problems


def effect_problems(entries: Any) -> list[str]:
    """Problems of the effects of a file whose other parts have some too."""
    if not isinstance(entries, list):
        return []
    return [
        problem
        for i, entry in enumerate(entries)
        if isinstance(entry, dict)
        for problem in _read(f"effects[{i}]", entry)[1]
    ]


def _read(where: str, entry: Mapping[str, Any]) -> tuple[InForce | None, list[str]]:
    name = entry.get("name")
    if name == LEARNED:
        return _read_learned(where, entry)
    if not isinstance(name, str) or name not in CATALOGUE:
        hint = nearest(str(name), list(CATALOGUE)) if isinstance(name, str) else ""
        return None, [f"{where}.name: found {name!r}, no known effect{hint}"]
    effect = CATALOGUE[name]
    given = {str(key): value for key, value in entry.items() if key != "name"}
    variant = max(effect.variants, key=lambda one: len(set(one.names) & set(given)))
    if not variant.is_computed:
        return None, [f"{where}: {name} is a known effect that the offline model cannot compute"]
    problems = [
        f"{where}.{one.name}: missing"
        for one in variant.parameters
        if one.name not in given and not one.optional
    ]
    for key in given:
        if key not in variant.names:
            other = next((v for v in effect.variants if key in v.names), None)
            problems.append(
                f"{where}.{key}: unknown key{nearest(key, list(variant.names))}"
                if other is None
                else f"{where}.{key}: found with {', '.join(variant.names)}, accepted: "
                f"another entry of {name} for it"
            )
    values: dict[str, float] = {}
    for parameter in variant.parameters:
        key = parameter.name
        if key not in given:
            if parameter.optional:
                values[key] = variant.off[key]
            continue
        try:
            values[key] = NUMBER.validate_python(given[key]).value
        except ValidationError as error:
            problems.append(problem_line({**error.errors()[0], "loc": (f"{where}.{key}",)}, {}))
            continue
        problem = parameter.problem(values[key])
        if problem:
            problems.append(f"{where}.{key}: {problem}")
    return (None if problems else InForce(where, effect, variant, values)), problems


LEARNED_KEYS = ("name", "place", "arguments", "x", "y", "values")


def _read_learned(where: str, entry: Mapping[str, Any]) -> tuple[InForce | None, list[str]]:
    table, wrong = table_in(entry)
    wrong += [
        f"{key}: unknown key{nearest(str(key), list(LEARNED_KEYS))}"
        for key in entry
        if key not in LEARNED_KEYS
    ]
    if table is None or wrong:
        return None, [f"{where}.{one}" for one in wrong]
    effect = law_of(table)
    (variant,) = effect.variants
    values = dict(zip(table.names, (float(one) for one in entry["values"]), strict=True))
    problems = [
        f"{where}.{one.name}: {problem}"
        for one in variant.parameters
        if (problem := one.problem(values[one.name]))
    ]
    return (None if problems else InForce(where, effect, variant, values)), problems


def effect_of(entry: Mapping[str, Any]) -> Effect:
    """Return the effect of a checked entry of a model file."""
    if entry["name"] == LEARNED:
        table, wrong = table_in(entry)
        assert table is not None, wrong
        return law_of(table)
    return CATALOGUE[str(entry["name"])]
