"""What an experiment returns: its cases, their figures, and one paragraph that says what they mean.

Built by `locked_load`, `tunnel` and `follower`; read by `cli`, `report` and `sweep`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

from bowden.model.description import Model
from bowden.model.measures import CycleMeasures, measure_cycle
from bowden.model.simulation import simulate
from bowden.model.trajectory import Inputs, Mode, Trajectory


@dataclass(frozen=True)
class Case:
    """One simulated run.

    Parameters
    ----------
    label : str
        What sets it apart from the others, for people.
    model : Model
    mode : Mode
    trajectory : Trajectory
    first, steady : CycleMeasures
        The first cycle of a virgin rig, and the last.
    figures : mapping of str to float or None
        What only this experiment has, SI units in the names.
    """

    label: str
    model: Model
    mode: Mode
    trajectory: Trajectory
    first: CycleMeasures
    steady: CycleMeasures
    figures: Mapping[str, float | None] = field(default_factory=dict)


@dataclass(frozen=True)
class Experiment:
    """One of the paper's experiments under one preset.

    Parameters
    ----------
    name : str
        ``1a``, ``1b``, ``2`` or ``3``.
    preset : str
        ``printed`` or ``transmitting``.
    title : str
    finding : str
        What came out and why, in sentences.
    cases : tuple of Case
    beside : Experiment or None
        The same experiment where it shows more; set when this one shows nothing.
    """

    name: str
    preset: str
    title: str
    finding: str
    cases: tuple[Case, ...]
    beside: Experiment | None = None

    def to_document(self) -> dict[str, object]:
        """Return what a program wants to know, without the series."""
        return {
            "experiment": self.name,
            "preset": self.preset,
            "title": self.title,
            "finding": self.finding,
            "cases": [
                {
                    "label": case.label,
                    "mode": case.mode.value,
                    "solver": case.model.solver,
                    "first_cycle": {**asdict(case.first), "loss_j": case.first.loss_j},
                    "steady_cycle": {**asdict(case.steady), "loss_j": case.steady.loss_j},
                    **case.figures,
                }
                for case in self.cases
            ],
            "beside": None if self.beside is None else self.beside.to_document(),
        }


def run_case(  # noqa: PLR0917
    label: str,
    model: Model,
    mode: Mode,
    inputs: Inputs,
    period_s: float,
    figures: Mapping[str, float | None] | None = None,
) -> Case:
    """Simulate one case and measure its first and last whole cycle."""
    return case_of(label, model, mode, simulate(model, mode, inputs), period_s, figures)


def case_of(  # noqa: PLR0917
    label: str,
    model: Model,
    mode: Mode,
    trajectory: Trajectory,
    period_s: float,
    figures: Mapping[str, float | None] | None = None,
) -> Case:
    """Measure a run that is there already."""
    start_s, end_s = float(trajectory.time_s[0]), float(trajectory.time_s[-1])
    cycles = max(1, int((end_s - start_s) / period_s + 1e-6))
    last_s = start_s + (cycles - 1) * period_s
    ratio = model.transmission.pulley_ratio
    return Case(
        label=label,
        model=model,
        mode=mode,
        trajectory=trajectory,
        first=measure_cycle(trajectory, ratio, start_s, period_s),
        steady=measure_cycle(trajectory, ratio, last_s, period_s),
        figures=figures or {},
    )
