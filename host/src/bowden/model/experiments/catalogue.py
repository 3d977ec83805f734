"""The experiments, and the rig on which they run by default.

`run_experiment` returns what `bowden experiment` shows; `single_case` is one run of a model as it
stands, for sweeps.
"""

from __future__ import annotations

from collections.abc import Callable

from bowden.model.closed_loop import PiFollower
from bowden.model.description import Model, table_1
from bowden.model.errors import ModelError
from bowden.model.experiments.follower import follower, ideal_case
from bowden.model.experiments.locked_load import locked_load_case, loop_series, pretension_series
from bowden.model.experiments.result import Case, Experiment
from bowden.model.experiments.tunnel import tunnel, tunnel_case
from bowden.model.experiments.variants import without_mesh, without_stiction_length

PRESETS = ("printed", "transmitting")

EXPERIMENTS: dict[str, Callable[[Model, str], Experiment]] = {
    "1a": pretension_series,
    "1b": loop_series,
    "2": tunnel,
    "3": follower,
}

SINGLE_CASES: dict[str, Callable[[Model], Case]] = {
    "1": locked_load_case,
    "2": tunnel_case,
    "3": ideal_case,
}


def as_printed() -> Model:
    """Return Table I, mu_s over one segment as eqs. (4) and (6) print it, solved exactly.

    Without a mesh a segment has no length and the excess of mu_s over mu_d vanishes; with
    `with_segments` it acts as in the paper.
    """
    return without_mesh(without_stiction_length(table_1()))


def run_experiment(
    name: str,
    model: Model | None = None,
    preset: str = "printed",
    gains: PiFollower | None = None,
) -> Experiment:
    """Run one of the paper's experiments.

    Parameters
    ----------
    name : str
        A key of `EXPERIMENTS`.
    model : Model, optional
        The rig; Table I when not given. What the experiment varies is replaced.
    preset : str
        ``printed`` is the paper's regime. ``transmitting`` has a pretension with which torque
        arrives (1a: 1, 1.5, 2, 2.4 N; 1b: 0.6 N; 2 and 3: 2 N).
    gains : PiFollower, optional
        Of the controller in Experiment 3; the others have none.

    Returns
    -------
    Experiment
        With the transmitting preset beside it where nothing arrives at any case's load.

    Raises
    ------
    ModelError
        An unknown name or preset, or a model that the experiment cannot vary.
    """
    if name not in EXPERIMENTS:
        raise ModelError(f"experiment: found {name!r}, accepted: {', '.join(EXPERIMENTS)}")
    if preset not in PRESETS:
        raise ModelError(f"preset: found {preset!r}, accepted: {', '.join(PRESETS)}")
    rig = as_printed() if model is None else model
    if name == "3":
        return follower(rig, preset, gains)
    result = EXPERIMENTS[name](rig, preset)
    silent = all(case.steady.load_torque_pp_nm == 0.0 for case in result.cases)
    if not silent or preset == "transmitting":
        return result
    return Experiment(
        result.name,
        result.preset,
        result.title,
        result.finding,
        result.cases,
        beside=EXPERIMENTS[name](rig, "transmitting"),
    )


def single_case(name: str, model: Model) -> Case:
    """Run a model as it stands through experiment 1 (load locked), 2 (tunnel) or 3 (following)."""
    if name not in SINGLE_CASES:
        raise ModelError(f"experiment: found {name!r}, accepted: {', '.join(SINGLE_CASES)}")
    return SINGLE_CASES[name](model)
