"""A posterior for ArviZ: draws of what a fit knows of a model's numbers, and of what was known.

The posterior in a model file is Gaussian, in the values' own units; draws of it carry their
correlations along. The values of a learned law are one variable over its knots.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from bowden.api.offline import ModelLike, model_of
from bowden.diagnosis.result import Diagnosis
from bowden.errors import BadInput
from bowden.estimation.calibrate import Calibration
from bowden.estimation.posterior import Estimate
from bowden.model import Model
from bowden.model.effects import table_in

if TYPE_CHECKING:
    from arviz import InferenceData

_Floats = NDArray[np.float64]
_CHAINS = 4  # all independent: ArviZ wants several
_LAW_VALUE = re.compile(r"effects\[(\d+)\]\.values\[(\d+)\]")


def to_arviz(
    result: Calibration | Diagnosis | ModelLike, *, draws: int = 1000, seed: int = 0
) -> InferenceData:
    """Turn a posterior into draws that ArviZ summarises, plots and writes as netCDF.

    Parameters
    ----------
    result : Calibration, Diagnosis, Model or path
        What a fit knows is in its model; a model file has it under ``posterior``.
    draws : int
        Of each of four chains, 1 or more. They are independent draws, not a sampler's.
    seed : int
        0 or more.

    Returns
    -------
    arviz.InferenceData
        Group ``posterior`` with dimensions (chain, draw), a variable for each path, such as
        ``friction.mu_d``, in the model file's unit; a learned law is ``effects[0].values`` over the
        coordinates of its knots. From a calibration or diagnosis also group ``prior``: the
        tolerances that it began with.

    Raises
    ------
    BadInput
        No posterior there, or ArviZ is not installed.
    """
    if draws < 1:
        raise BadInput("draws", str(draws), "1 or more")
    if seed < 0:
        raise BadInput("seed", str(seed), "0 or more")
    model = result.model if isinstance(result, Calibration | Diagnosis) else model_of(result)
    if isinstance(result, Calibration) and model.document.posterior is None:
        model = result.posterior.as_prior(model)
    section = model.document.posterior
    if section is None:
        raise BadInput(
            model.source,
            "no posterior",
            "a model that calibrate or diagnose wrote, and that explains its recordings",
        )
    from_dict = _from_dict()
    rng = np.random.default_rng(seed)
    mean = np.array([model.value(path) for path in section.paths])
    drawn = rng.multivariate_normal(
        mean, np.array(section.covariance), size=(_CHAINS, draws), method="eigh"
    )
    variables, dims, coords = _variables(model, section.paths, drawn)
    attributes = {"inference_library": "bowden", "model": model.source}
    groups: dict[str, Any] = {"posterior": variables, "posterior_attrs": attributes}
    estimates = () if not isinstance(result, Calibration | Diagnosis) else _estimates(result)
    if prior := _prior(estimates, draws, rng):
        groups |= {"prior": prior, "prior_attrs": attributes}
    return from_dict(**groups, dims=dims, coords=coords)


def _from_dict() -> Callable[..., InferenceData]:
    try:
        with catch_warnings():
            simplefilter("ignore")  # ArviZ announces its next version
            import arviz  # noqa: PLC0415  (optional)
    except ImportError as error:
        raise BadInput(
            "to_arviz", "no ArviZ in this installation", "pip install 'bowden[arviz]'"
        ) from error
    made: Callable[..., InferenceData] = arviz.from_dict
    return made


def _estimates(result: Calibration | Diagnosis) -> tuple[Estimate, ...]:
    return result.calibration if isinstance(result, Diagnosis) else tuple(result.estimates)


def _variables(
    model: Model, paths: tuple[str, ...], drawn: _Floats
) -> tuple[dict[str, _Floats], dict[str, list[str]], Mapping[str, list[float]]]:
    """Return draws by name; a law is one variable over its knots, nan where nothing is known."""
    variables: dict[str, _Floats] = {}
    dims: dict[str, list[str]] = {}
    coords: dict[str, list[float]] = {}
    laws: dict[int, dict[int, int]] = {}  # effect -> knot -> path
    for k, path in enumerate(paths):
        if match := _LAW_VALUE.fullmatch(path):
            laws.setdefault(int(match[1]), {})[int(match[2])] = k
        else:
            variables[path] = drawn[..., k]
    for index, known in laws.items():
        table, _ = table_in(model.document.effects[index])
        assert table is not None  # else the model could not have been read
        shape = tuple(map(len, table.axes))
        values = np.full((*drawn.shape[:-1], math.prod(shape)), np.nan)
        values[..., list(known)] = drawn[..., list(known.values())]
        place = f"effects[{index}]"
        name, along = f"{place}.values", [f"{place}.{one}" for one in table.over]
        variables[name] = values.reshape(*drawn.shape[:-1], *shape)
        dims[name] = along
        coords |= {one: list(axis) for one, axis in zip(along, table.axes, strict=True)}
    return variables, dims, coords


def _prior(
    estimates: tuple[Estimate, ...], draws: int, rng: np.random.Generator
) -> dict[str, _Floats]:
    """Return draws of the tolerances; numbers without one had no prior to draw from."""
    return {
        one.path: one.before + one.tolerance * rng.standard_normal((_CHAINS, draws))
        for one in estimates
        if one.tolerance
    }
