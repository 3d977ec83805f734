"""A model file as text, and the `Model` it describes.

`model_file` holds the schema, `model_numbers` makes numbers of it, `model_problems` words what is
wrong; `simulate` and calibration read the `Model`.
No file is opened here: text in, text out.
"""

# ruff: noqa: ANN401  (what a YAML file holds is not known before it is checked)

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from bowden.model.effects import LEARNED, LawTable
from bowden.model.errors import ModelError
from bowden.model.lumped import Lumped
from bowden.model.model_changes import DoubtfulChange, steps_of, with_numbers
from bowden.model.model_effects import NUMBER, InForce, effect_problems, effects_in_force
from bowden.model.model_file import ModelFile, PosteriorSection, Quantity
from bowden.model.model_numbers import lumped_of, misfits, solver_of, transmission_of
from bowden.model.model_problems import nearest, problem_line
from bowden.model.transmission import Transmission

TABLE_1 = """\
# Table I of the paper. Its K = 2 kN/m is read as the stiffness of one cable from end to end, so
# that EA = K L = 4000 N; the other reading, K for both cables in parallel, is EA = 2000 N: then
# angles and backlash double and torques stay as they are.
rig:
  cable:
    length_m: 2.0
    axial_stiffness_n: 4000.0
    path:
    - {length_m: 2.0, radius_m: 0.28}
    pretension_n: {value: 10.0, tolerance: 10 %}
  motor_pulley_radius_m: 0.020
  load_pulley_radius_m: 0.104
  motor_encoder_counts_per_turn: 2000.0
  load_encoder_counts_per_turn: 10000.0
  load_cell_noise_nm: 0.0005
friction: {law: stiction, mu_d: 0.21, mu_s: 0.63, stiction_length_m: 0.1}
effects: []
numerics: {segments: 100}
"""
#: The same without the extra friction at standstill, solved without a mesh.
TABLE_1_COULOMB = TABLE_1.replace(
    "friction: {law: stiction, mu_d: 0.21, mu_s: 0.63, stiction_length_m: 0.1}",
    "friction: {law: coulomb, mu_d: {value: 0.21, tolerance: 10 %}}",
).replace("numerics: {segments: 100}", "numerics: {solver: mesh_free}")


@dataclass(frozen=True)
class Model:
    """A rig, its friction, its effects and how to solve it; made by `parse_model`.

    Parameters
    ----------
    document : ModelFile
        The checked file.
    source : str
        Where it came from, for messages.
    """

    document: ModelFile
    source: str = field(default="model", compare=False)

    @cached_property
    def effects(self) -> tuple[InForce, ...]:
        """The effects that the file lists, with their values.

        Raises
        ------
        ModelError
            An effect that is unknown or that the model cannot compute, or an impossible value.
        """
        found, problems = effects_in_force(self.document.effects)
        if problems:
            raise ModelError(problems, self.source)
        return tuple(found)

    @cached_property
    def transmission(self) -> Transmission:
        """The numbers that the solvers read, with the effects that change them.

        Raises
        ------
        ModelError
            What `effects` raises, or a value out of range.
        """
        effects = self.effects
        try:
            return transmission_of(self.document, effects)
        except ModelError as error:
            raise ModelError(error.problems, self.source) from None

    @property
    def solver(self) -> str:
        """Which solver answers: ``mesh``, ``mesh_free`` or ``lumped``.

        The one that the file names or, by a key such as segments, implies. Otherwise the lumped
        transmission for a bristle law; the mesh where friction depends on rate, tension, direction
        or an effect's history, or holds more at standstill; the mesh-free solution for the rest.
        """
        return solver_of(self.document, self.transmission, self.effects)

    @cached_property
    def lumped(self) -> Lumped:
        """What the lumped transmission has beyond the numbers of the pair.

        Raises
        ------
        ModelError
            A value out of range.
        """
        return lumped_of(self.document)

    def free_parameters(self) -> list[tuple[str, float, float]]:
        """List the numbers that carry a tolerance: (path, value, one sigma)."""
        return [
            (path, quantity.value, quantity.sigma)
            for path, quantity in _quantities(self.document)
            if quantity.sigma is not None
        ]

    def value(self, path: str) -> float:
        """Return the number at a path such as ``rig.cable.path[0].radius_m``.

        Raises
        ------
        ModelError
            No number stands there.
        """
        known = dict(_quantities(self.document))
        if path not in known:
            raise ModelError(f"{path}: found no number there{nearest(path, known)}", self.source)
        return known[path].value

    def with_values(self, values: Mapping[str, float]) -> Model:
        """Return the model with other numbers at the given paths; tolerances stay.

        A new ``rig.cable.length_m`` stretches the pieces of the path along.

        Raises
        ------
        ModelError
            A path that holds no number, or a value that is impossible there.
        """
        values = {**self._stretched(values), **values}
        try:
            model = Model(with_numbers(self.document, values), self.source)
            if not misfits(model.document, model.transmission, model.effects):
                return model
        except (DoubtfulChange, ModelError):
            pass
        # Impossible: read as a file with these numbers would be, which says all that is wrong.
        tree = self.document.model_dump(exclude_none=True)
        for path, value in values.items():
            self.value(path)
            _set(tree, path, float(value))
        return _checked(tree, self.source)

    def moved(self, path: str, step: float) -> tuple[Model, float]:
        """Return the model with one number moved by a step, and the step.

        A number that is at its limit, as mu_d beside mu_s, is moved the other way.

        Raises
        ------
        ModelError
            A path that holds no number, or no rig either way.
        """
        try:
            return self.with_values({path: self.value(path) + step}), step
        except ModelError:
            return self.with_values({path: self.value(path) - step}), -step

    def _stretched(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the lengths of the path's pieces for another length of the cable."""
        length = values.get("rig.cable.length_m")
        if length is None:
            return {}
        cable = self.document.rig.cable
        factor = length / cable.length_m.value
        return {
            f"rig.cable.path[{i}].length_m": factor * piece.length_m.value
            for i, piece in enumerate(cable.path)
        }

    def with_posterior(self, posterior: PosteriorSection) -> Model:
        """Return the model with what a fit knows of its numbers together."""
        return replace(self, document=self.document.model_copy(update={"posterior": posterior}))

    def with_effect(self, name: str, values: Mapping[str, float]) -> Model:
        """Return the model with one more effect, last in its list.

        Parameters
        ----------
        name : str
            In `bowden.model.effects.CATALOGUE`.
        values : mapping of str to float
            All parameters of one of its variants; afterwards at ``effects[i].<parameter>``.

        Raises
        ------
        ModelError
            What the model file would be refused for.
        """
        return self._with_entry({"name": name, **{k: float(v) for k, v in values.items()}})

    def with_law(self, table: LawTable, values: Sequence[float]) -> Model:
        """Return the model with a learned law, last in its list of effects.

        Parameters
        ----------
        table : LawTable
        values : sequence of float
            One a knot; afterwards at ``effects[i].values[k]``.

        Raises
        ------
        ModelError
            What the model file would be refused for.
        """
        return self._with_entry(
            {
                "name": LEARNED,
                "place": table.place,
                "arguments": list(table.arguments),
                **dict(zip(("x", "y"), map(list, table.axes), strict=False)),
                "values": [float(one) for one in values],
            }
        )

    def _with_entry(self, entry: dict[str, Any]) -> Model:
        tree = self.document.model_dump(exclude_none=True)
        tree["effects"] = [*tree["effects"], entry]
        return _checked(tree, self.source)

    def without_effect(self, index: int) -> Model:
        """Return the model with one effect less.

        Parameters
        ----------
        index : int
            Its place in the list.
        """
        tree = self.document.model_dump(exclude_none=True)
        tree["effects"] = [*tree["effects"][:index], *tree["effects"][index + 1 :]]
        return _checked(tree, self.source)


def parse_model(text: str, source: str = "model") -> Model:
    """Read a model file.

    Parameters
    ----------
    text : str
        YAML; CONTRACTS and ``docs`` describe it.
    source : str
        Its name, for messages.

    Raises
    ------
    ModelError
        All problems at once, each with its path, what was found and what is accepted.
    """
    try:
        tree = YAML(typ="safe", pure=True).load(text)
    except MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else "?"
        raise ModelError(f"line {line}: {error.problem}; accepted: YAML", source) from error
    except (YAMLError, ValueError) as error:
        raise ModelError(f"found no YAML: {str(error).splitlines()[0]}", source) from error
    if not isinstance(tree, dict):
        raise ModelError("found no keys, accepted: rig, friction, effects, numerics", source)
    return _checked(tree, source)


def format_model(model: Model) -> str:
    """Write a model as the text of a model file; `parse_model` reads it back unchanged."""
    writer = YAML()
    writer.default_flow_style = None
    writer.width = 100
    out = io.StringIO()
    writer.dump(model.document.model_dump(exclude_none=True, mode="python"), out)
    return out.getvalue()


def table_1() -> Model:
    """Return the rig of the paper's Table I."""
    return parse_model(TABLE_1, source="Table I")


def _checked(tree: dict[str, Any], source: str) -> Model:
    try:
        document = ModelFile.model_validate(tree)
    except ValidationError as error:
        problems = [problem_line(dict(detail), tree) for detail in error.errors()]
        problems += effect_problems(tree.get("effects"))
        raise ModelError([p for p in problems if p], source) from None
    model = Model(document, source)
    # Checks the effects, and the numbers together.
    problems = misfits(document, model.transmission, model.effects)
    if problems:
        raise ModelError(problems, source)
    return model


def _quantities(document: ModelFile) -> Iterator[tuple[str, Quantity]]:
    """All numbers of a file with their paths."""
    yield from _walk("", document)
    for i, effect in enumerate(document.effects):
        for key, value in effect.items():
            if key == "values":  # of a learned law
                for k, one in enumerate(value):
                    yield f"effects[{i}].values[{k}]", NUMBER.validate_python(one)
            elif key != "name" and effect["name"] != LEARNED:
                yield f"effects[{i}].{key}", NUMBER.validate_python(value)


def _walk(path: str, part: Any) -> Iterator[tuple[str, Quantity]]:
    if isinstance(part, Quantity):
        yield path, part
    elif isinstance(part, tuple):
        for i, item in enumerate(part):
            yield from _walk(f"{path}[{i}]", item)
    elif hasattr(type(part), "model_fields"):
        for name in type(part).model_fields:
            yield from _walk(f"{path}.{name}" if path else name, getattr(part, name))


def _set(tree: Any, path: str, value: float) -> None:
    steps = steps_of(path)
    for step in steps[:-1]:
        tree = tree[step]
    tree[steps[-1]] = _moved(tree[steps[-1]], value)


def _moved(written: Any, value: float) -> Any:
    return {**written, "value": value} if isinstance(written, dict) else value
