"""A model file as text, and the `Model` it describes.

`model_file` holds the schema, `effects` the effects; `simulate` and calibration read the `Model`.
No file is opened here: text in, text out.
"""

# ruff: noqa: ANN401  (what a YAML file holds is not known before it is checked)

from __future__ import annotations

import difflib
import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from bowden.model.effects import APPLIED, CATALOGUE
from bowden.model.errors import ModelError
from bowden.model.model_file import Finite, ModelFile, Quantity
from bowden.model.transmission import FrictionLaw, Transmission

_STEP = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)|\[(\d+)\]")
_NUMBER: TypeAdapter[Quantity] = TypeAdapter(Finite)

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
    def transmission(self) -> Transmission:
        """The numbers that the solvers read, effects applied.

        Raises
        ------
        ModelError
            An effect that is unknown or that the model cannot compute, or a value out of range.
        """
        pair = _pair(self.document)
        problems: list[str] = []
        for i, effect in enumerate(self.document.effects):
            where = f"effects[{i}]"
            parameters, found = _effect_values(where, effect)
            problems += found
            if not found:
                try:
                    pair = APPLIED[str(effect["name"])][1](pair, parameters)
                except ModelError as error:
                    problems += [f"{where}: {problem}" for problem in error.problems]
        if problems:
            raise ModelError(problems, self.source)
        return pair

    @property
    def solver(self) -> str:
        """Which solver answers: ``mesh`` or ``mesh_free``.

        The mesh where the file says so or gives segments, and where friction depends on rate or
        tension or holds more at rest; the mesh-free solution otherwise.
        """
        numerics = self.document.numerics
        if numerics.solver is not None:
            return numerics.solver
        law = self.transmission.friction
        meshed = numerics.segments is not None or law.has_stiction or not law.is_coulomb
        return "mesh" if meshed else "mesh_free"

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
            raise ModelError(f"{path}: found no number there{_nearest(path, known)}", self.source)
        return known[path].value

    def with_values(self, values: Mapping[str, float]) -> Model:
        """Return the model with other numbers at the given paths; tolerances stay.

        A new ``rig.cable.length_m`` stretches the pieces of the path along.

        Raises
        ------
        ModelError
            A path that holds no number, or a value that is impossible there.
        """
        tree = self.document.model_dump(exclude_none=True)
        length = values.get("rig.cable.length_m")
        if length is not None:
            self.value("rig.cable.length_m")
            for piece in tree["rig"]["cable"]["path"]:
                factor = length / self.value("rig.cable.length_m")
                piece["length_m"] = _moved(piece["length_m"], factor * _plain(piece["length_m"]))
        for path, value in values.items():
            self.value(path)
            _set(tree, path, float(value))
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
        problems = [_problem(dict(detail), tree) for detail in error.errors()]
        problems += _effect_problems(tree.get("effects"))
        raise ModelError([p for p in problems if p], source) from None
    model = Model(document, source)
    _ = model.transmission  # checks the effects, and the numbers together
    return model


def _effect_problems(effects: Any) -> list[str]:
    """Problems of the effects of a file whose other parts have some too."""
    if not isinstance(effects, list):
        return []
    known = [(i, e) for i, e in enumerate(effects) if isinstance(e, dict)]
    return [problem for i, e in known for problem in _effect_values(f"effects[{i}]", e)[1]]


def _problem(detail: dict[str, Any], tree: Any) -> str:
    """One line for one finding of pydantic."""
    steps = list(detail["loc"])
    # A plain number is checked as the `value` of a quantity: that step is not in the file.
    if steps and steps[-1] == "value" and not isinstance(_at(tree, steps[:-1]), dict):
        steps.pop()
    where = ""
    for step in steps:
        where += f"[{step}]" if isinstance(step, int) else f".{step}" if where else str(step)
    kind, found = detail["type"], detail["input"]
    if kind == "too_short" and found:
        return ""  # pydantic counts only the pieces that are right; those that are not say why
    if kind == "extra_forbidden":
        siblings = _accepted_keys(steps[:-1])
        return f"{where}: unknown key{_nearest(str(steps[-1]), siblings)}"
    if kind == "missing":
        return f"{where}: missing"
    if kind in ("model_type", "tuple_type", "dict_type"):
        return f"{where}: found {found!r}, accepted: {'a list' if kind == 'tuple_type' else 'keys'}"
    if "ctx" in detail and "expected" in detail["ctx"]:
        return f"{where}: found {found!r}, accepted: {detail['ctx']['expected']}"
    message = str(detail["msg"])
    if message.startswith("Input should be "):
        message = f"found {found!r}, accepted: {message.removeprefix('Input should be ')}"
    elif not message.startswith("found"):
        message = f"found {found!r}; {message}"
    return f"{where or 'model'}: {message}"


def _at(tree: Any, steps: list[Any]) -> Any:
    for step in steps:
        try:
            tree = tree[step]
        except (KeyError, IndexError, TypeError):
            return None
    return tree


def _accepted_keys(steps: list[Any]) -> list[str]:
    """Keys of the schema at a place, found by walking the annotations."""
    schema: dict[str, Any] = ModelFile.model_json_schema()
    defs, here = schema["$defs"], schema
    for step in steps:
        here = here.get("items", {}) if isinstance(step, int) else here["properties"].get(step, {})
        here = next((o for o in here.get("anyOf", [here]) if o.get("type") != "null"), here)
        if "$ref" in here:
            here = defs[here["$ref"].rsplit("/", 1)[1]]
    return list(here.get("properties", {}))


def _nearest(key: str, known: Mapping[str, Any] | list[str]) -> str:
    close = difflib.get_close_matches(key, list(known), n=1, cutoff=0.5)
    if close:
        return f", did you mean {close[0]}?"
    return f", accepted: {', '.join(known)}" if known else ""


def _effect_values(where: str, effect: Mapping[str, Any]) -> tuple[dict[str, float], list[str]]:
    """Read an entry of `effects`: its parameters, or what is wrong with it."""
    name = effect.get("name")
    if not isinstance(name, str) or name not in CATALOGUE:
        hint = _nearest(str(name), list(CATALOGUE)) if isinstance(name, str) else ""
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
        f"{where}.{k}: unknown key{_nearest(k, list(needed))}" for k in given if k not in needed
    ]
    values = {}
    for key in needed:
        if key in given:
            try:
                values[key] = _NUMBER.validate_python(given[key]).value
            except ValidationError as error:
                problems.append(_problem({**error.errors()[0], "loc": (f"{where}.{key}",)}, {}))
    return values, problems


def _quantities(document: ModelFile) -> Iterator[tuple[str, Quantity]]:
    """All numbers of a file with their paths."""
    yield from _walk("", document)
    for i, effect in enumerate(document.effects):
        for key, value in effect.items():
            if key != "name":
                yield f"effects[{i}].{key}", _NUMBER.validate_python(value)


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
    steps: list[Any] = [name or int(index) for name, index in _STEP.findall(path)]
    for step in steps[:-1]:
        tree = tree[step]
    tree[steps[-1]] = _moved(tree[steps[-1]], value)


def _plain(written: Any) -> float:
    return float(written["value"] if isinstance(written, dict) else written)


def _moved(written: Any, value: float) -> Any:
    return {**written, "value": value} if isinstance(written, dict) else value


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
