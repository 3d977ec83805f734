"""The paper's experiments on the model: imposed signals, simulation, findings.

Pure functions over a `Model`; no file, no plot. `signals` makes what is imposed, `variants` the
models of a series, `locked_load`, `tunnel` and `follower` are Experiments 1, 2 and 3. `bowden
experiment` shows the `Experiment` that `run_experiment` returns; `sweep` takes single cases.
"""

from bowden.model.closed_loop import PiFollower
from bowden.model.experiments.catalogue import (
    EXPERIMENTS,
    PRESETS,
    as_printed,
    run_experiment,
    single_case,
)
from bowden.model.experiments.result import Case, Experiment

__all__ = [
    "EXPERIMENTS",
    "PRESETS",
    "Case",
    "Experiment",
    "PiFollower",
    "as_printed",
    "run_experiment",
    "single_case",
]
