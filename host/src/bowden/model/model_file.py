"""The schema of a model file: what may stand in it, in which unit, within which limits.

Pydantic classes only; `description` reads text through them and turns the answer into a `Model`.
"""

# ruff: noqa: ANN401  (what a YAML file holds is not known before it is checked)

from __future__ import annotations

import itertools
import math
import re
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    field_validator,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError

PERCENT = re.compile(r"^\s*([0-9.eE+-]+)\s*%\s*$")


class Part(BaseModel):
    """Anything with named keys: unknown ones are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        self.fits()
        return self

    def fits(self) -> None:
        """Check that the keys go together.

        Raises
        ------
        PydanticCustomError
        """


class Quantity(Part):
    """A number that may carry the 1-sigma tolerance by which calibration may move it.

    In the file: ``10`` or ``{value: 10, tolerance: 10 %}`` or ``{value: 10, tolerance: 0.5}``.
    """

    value: float
    tolerance: float | str | None = None

    @field_validator("value", mode="before")
    @classmethod
    def _is_number(cls, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
            raise PydanticCustomError("number", "found {found}, accepted: a number", _found(value))
        return float(value)

    @field_validator("tolerance", mode="before")
    @classmethod
    def _is_tolerance(cls, value: Any) -> Any:
        if value is None or sigma_of(1.0, value) is not None:
            return value
        raise PydanticCustomError(
            "tolerance",
            "found {found}, accepted: a share such as '10 %', or a positive number in its unit",
            _found(value),
        )

    @property
    def sigma(self) -> float | None:
        """One standard deviation in the quantity's own unit; None when no tolerance is given."""
        return None if self.tolerance is None else sigma_of(self.value, self.tolerance)

    @model_serializer
    def _as_written(self) -> Any:
        if self.tolerance is None:
            return self.value
        return {"value": self.value, "tolerance": self.tolerance}


def sigma_of(value: float, tolerance: Any) -> float | None:
    """Return the tolerance as one sigma in the value's unit; None if it is none."""
    if isinstance(tolerance, str):
        match = PERCENT.match(tolerance)
        try:
            share = float(match.group(1)) / 100 if match else math.nan
        except ValueError:
            return None
        return abs(value) * share if 0 < share < math.inf else None
    if isinstance(tolerance, bool) or not isinstance(tolerance, int | float):
        return None
    return float(tolerance) if 0 < tolerance < math.inf else None


def _found(value: Any) -> dict[str, Any]:
    return {"found": "nothing" if value is None else repr(value)}


def _as_mapping(value: Any) -> Any:
    return value if isinstance(value, dict | Quantity) else {"value": value}


def _limited(low: float, accepted: str, *, closed: bool, infinite: bool = False) -> AfterValidator:
    def check(quantity: Quantity) -> Quantity:
        value = quantity.value
        above = value >= low if closed else value > low
        if not above or (math.isinf(value) and not infinite):
            raise PydanticCustomError(
                "limit", "found {found}, accepted: " + accepted, {"found": f"{value:g}"}
            )
        return quantity

    return AfterValidator(check)


Number = Annotated[Quantity, BeforeValidator(_as_mapping)]
Positive = Annotated[Number, _limited(0, "a number above 0", closed=False)]
Radius = Annotated[
    Number, _limited(0, "a number above 0, or .inf for straight", closed=False, infinite=True)
]
NotNegative = Annotated[Number, _limited(0, "0 or more", closed=True)]
Finite = Annotated[Number, _limited(-math.inf, "a finite number", closed=False)]


class PathPiece(Part):
    """A stretch of conduit with one radius of curvature, from the motor on."""

    length_m: Positive
    radius_m: Radius


class TensionPoint(Part):
    """One point of an initial tension profile; linear in between."""

    position_m: NotNegative
    tension_n: NotNegative


class Cable(Part):
    """Each of the two cables, and the way of its conduit."""

    length_m: Positive
    axial_stiffness_n: Positive | None = None
    end_to_end_stiffness_n_per_m: Positive | None = None
    path: Annotated[tuple[PathPiece, ...], Field(min_length=1)]
    pretension_n: NotNegative
    initial_profile: tuple[TensionPoint, ...] | None = None

    def fits(self) -> None:
        """Refuse a path, a stiffness or a profile that does not fit the rest of the cable."""
        given = [self.axial_stiffness_n, self.end_to_end_stiffness_n_per_m]
        if sum(x is not None for x in given) != 1:
            raise PydanticCustomError(
                "stiffness",
                "found {found} of axial_stiffness_n and end_to_end_stiffness_n_per_m, "
                "accepted: one of the two",
                {"found": "both" if given[0] else "none"},
            )
        total = sum(piece.length_m.value for piece in self.path)
        if abs(total - self.length_m.value) > 1e-6 * self.length_m.value:
            raise PydanticCustomError(
                "path",
                "found pieces of {total} m in path, accepted: length_m, {length} m",
                {"total": f"{total:g}", "length": f"{self.length_m.value:g}"},
            )
        if self.initial_profile is not None:
            _check_profile(self.initial_profile, self.length_m.value)


def _check_profile(points: tuple[TensionPoint, ...], length_m: float) -> None:
    at = [point.position_m.value for point in points]
    rising = all(a < b for a, b in itertools.pairwise(at))
    if len(at) < 2 or not rising or at[0] != 0 or abs(at[-1] - length_m) > 1e-6 * length_m:
        raise PydanticCustomError(
            "profile",
            "found initial_profile at {at} m, accepted: rising positions from 0 to {length} m",
            {"at": str(at), "length": f"{length_m:g}"},
        )


class RigSection(Part):
    """What is built: cables, pulleys, sensors."""

    cable: Cable
    motor_pulley_radius_m: Positive
    load_pulley_radius_m: Positive
    motor_encoder_counts_per_turn: Positive | None = None
    load_encoder_counts_per_turn: Positive | None = None
    load_cell_noise_nm: NotNegative | None = None


class BoucWenBranch(Part):
    """Shape of the modified Bouc-Wen hysteresis in one direction."""

    sigma: Positive | None = None
    exponent: Positive | None = None
    limit: Positive | None = None


LAW_KEYS: dict[str, tuple[str, ...]] = {
    "coulomb": (),
    "stiction": ("mu_s", "stiction_length_m"),
    "dahl": ("presliding_m", "exponent"),
    "lugre": (
        "presliding_m",
        "stiction_ratio",
        "stribeck_speed_m_per_s",
        "bristle_damping_s",
        "viscous_s_per_m",
    ),
    "bouc_wen": ("presliding_m", "forward", "backward", "alpha_per_m", "nu"),
}
"""What a friction law may have beside ``mu_d``; the first of each is needed."""

BRISTLE_LAWS = tuple(law for law in LAW_KEYS if law not in ("coulomb", "stiction"))


class Friction(Part):
    """The law between cable and conduit; `bowden.model.friction` has the equations."""

    law: Literal["coulomb", "stiction", "dahl", "lugre", "bouc_wen"]
    mu_d: NotNegative
    memory_s: NotNegative | None = None
    mu_s: NotNegative | None = None
    stiction_length_m: Positive | None = None
    presliding_m: Positive | None = None
    exponent: NotNegative | None = None
    stiction_ratio: Positive | None = None
    stribeck_speed_m_per_s: Positive | None = None
    bristle_damping_s: NotNegative | None = None
    viscous_s_per_m: NotNegative | None = None
    forward: BoucWenBranch | None = None
    backward: BoucWenBranch | None = None
    alpha_per_m: NotNegative | None = None
    nu: Finite | None = None

    def fits(self) -> None:
        """Refuse numbers that the law does not have or that do not go together."""
        own = LAW_KEYS[self.law]
        for law, keys in LAW_KEYS.items():
            for key in keys:
                if key not in own and getattr(self, key) is not None:
                    raise PydanticCustomError(
                        "law",
                        "found {key} with law {found}, accepted: law: {law}",
                        {"key": key, "found": self.law, "law": law},
                    )
        if own and getattr(self, own[0]) is None:
            raise PydanticCustomError(
                "law",
                "found law {law} without {key}, accepted: {key}",
                {"law": self.law, "key": own[0]},
            )
        if self.mu_s is not None and self.mu_s.value < self.mu_d.value:
            raise PydanticCustomError(
                "law",
                "found mu_s {mu_s} below mu_d {mu_d}, accepted: mu_s >= mu_d",
                {"mu_s": f"{self.mu_s.value:g}", "mu_d": f"{self.mu_d.value:g}"},
            )


SOLVER_KEYS: dict[str, tuple[str, ...]] = {
    "mesh": ("segments", "grading", "rest_time_s", "velocity_dead_band_m_per_s", "damping_s"),
    "mesh_free": (),
    "lumped": ("elements", "cable_mass_kg_per_m", "damping_s", "motor_inertia_kg_m2"),
}
"""What may be said beside the solver's name; keys without a name choose their solver."""


class Numerics(Part):
    """How the equations are solved; all of it may be left out."""

    solver: Literal["mesh", "mesh_free", "lumped"] | None = None
    segments: Annotated[int, Field(strict=True, ge=1, le=100_000)] | None = None
    grading: Literal["uniform", "curvature"] | None = None
    rest_time_s: NotNegative | None = None
    velocity_dead_band_m_per_s: NotNegative | None = None
    elements: Annotated[int, Field(strict=True, ge=1, le=10_000)] | None = None
    cable_mass_kg_per_m: Positive | None = None
    damping_s: NotNegative | None = None
    motor_inertia_kg_m2: NotNegative | None = None

    def fits(self) -> None:
        """Refuse keys that the solver does not have."""
        for key in self._given():
            solvers = [solver for solver, keys in SOLVER_KEYS.items() if key in keys]
            if self.chosen() not in solvers:
                raise PydanticCustomError(
                    "solver",
                    "found {key} with solver {found}, accepted: solver: {solver}",
                    {"key": key, "found": str(self.chosen()), "solver": " or ".join(solvers)},
                )

    def chosen(self) -> str | None:
        """Return the solver that the file names, or that a key of it implies."""
        if self.solver is not None:
            return self.solver
        given = self._given()
        most = max(SOLVER_KEYS, key=lambda solver: len(given & set(SOLVER_KEYS[solver])))
        return most if given else None

    def _given(self) -> set[str]:
        keys = {key for keys in SOLVER_KEYS.values() for key in keys}
        return {key for key in keys if getattr(self, key) is not None}


class Source(Part):
    """A recording that a posterior was fitted to."""

    file: str
    sha256: str


class PosteriorSection(Part):
    """What a fit knows of the numbers in the file together: the next fit's prior.

    The mean is the file's own values; a number that is moved by hand takes the mean along.
    """

    paths: Annotated[tuple[str, ...], Field(min_length=1)]
    covariance: tuple[tuple[float, ...], ...]
    fitted: tuple[Source, ...] = ()
    held_out: tuple[str, ...] = ()
    bowden_version: str = ""

    @model_validator(mode="after")
    def _is_covariance(self) -> PosteriorSection:
        matrix = np.array(
            [row if len(row) == len(self.paths) else [math.nan] for row in self.covariance],
            dtype=object,
        )
        size = len(self.paths)
        if matrix.shape != (size, size):
            raise PydanticCustomError(
                "covariance",
                "found a covariance of another shape, accepted: {size} rows of {size} numbers",
                {"size": size},
            )
        values = matrix.astype(np.float64)
        scale = np.sqrt(np.abs(np.diag(values)))
        even = values / np.maximum(np.outer(scale, scale), 1e-300)
        if not np.all(np.isfinite(values)) or not np.allclose(values, values.T):
            raise PydanticCustomError(
                "covariance", "found no symmetric numbers, accepted: a covariance", {}
            )
        if np.any(np.diag(values) <= 0.0) or float(np.linalg.eigvalsh(even).min()) < -1e-6:
            raise PydanticCustomError(
                "covariance",
                "found a matrix that is not positive, accepted: a covariance",
                {},
            )
        return self


class ModelFile(Part):
    """A whole model file."""

    rig: RigSection
    friction: Friction
    effects: tuple[dict[str, Any], ...] = ()
    numerics: Numerics = Numerics()
    posterior: PosteriorSection | None = None
