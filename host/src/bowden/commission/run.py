"""Run the steps of a commissioning in order, keep its progress, end in model and configuration.

What is done is in the folder's file and is not done again; a drive that has lost what was written
meanwhile (a restart) gets it again. At the end the drive stores its configuration, also when a
commissioning that had ended goes on with a step that was not wanted before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from bowden.commission.by_hand import (
    find_counts,
    find_current_zero,
    find_directions,
    find_load_cell,
    learn_pulses,
    set_zero,
)
from bowden.commission.job import WRITABLE, Facts, Job, Operator
from bowden.commission.state import (
    CommissioningState,
    DoneStep,
    DriveIdentity,
    StepFinding,
    open_state,
    save_state,
)
from bowden.commission.with_motor import (
    find_cables,
    find_motor_direction,
    find_torque_constant,
    find_winding,
)
from bowden.counted import counted
from bowden.drive.client import Drive
from bowden.drive.configuration import difference, store, write
from bowden.drive.reduced_model import reduced_model
from bowden.drive.restart import require_bridge_off
from bowden.errors import BadInput
from bowden.model import Model, format_model, parse_model
from bowden.recording.atomic import replace_whole

MODEL_FILE = "model.yaml"


@dataclass(frozen=True)
class CommissioningStep:
    """One step: its name in the state file, what it is about, and what does it.

    `takes`: the facts by which it measures.
    """

    name: str
    title: str
    do: Callable[[Job], list[StepFinding]]
    takes: tuple[str, ...] = ()


def configure_nominal(job: Job) -> list[StepFinding]:
    """Write the model file's rig into the drive."""
    reduced = reduced_model(job.model)
    changes = difference(job.drive, reduced.entries)
    job.operator.ask(
        "Nominal rig",
        "",
        f"nothing to do: the model sets {counted(len(changes), 'entry', 'entries')} of the drive",
    )
    job.write(reduced.entries)
    same = len(reduced.entries) - len(changes)
    found = f"{counted(len(changes), 'entry', 'entries')} written, {same} as they were"
    return [StepFinding(what="configuration", verdict="as stated", found=found)]


def keep(job: Job) -> list[StepFinding]:
    """Have the drive keep all of it across power-off."""
    job.operator.ask("Keep", "", "nothing to do: the drive stores its configuration")
    store(job.drive)
    return [StepFinding(what="configuration", verdict="as stated", found="stored in the drive")]


STEPS = (
    CommissioningStep("nominal", "write the model's rig into the drive", configure_nominal),
    CommissioningStep("directions", "signs of both encoders and of the load cell", find_directions),
    CommissioningStep(
        "counts",
        "counts per turn of both encoders",
        find_counts,
        takes=("angle_rad", "angle_tolerance_rad"),
    ),
    CommissioningStep("current_zero", "current with the bridge off", find_current_zero),
    CommissioningStep(
        "load_cell",
        "zero and gain of the load cell",
        find_load_cell,
        takes=("weights_kg", "lever_m"),
    ),
    CommissioningStep("winding", "resistance and inductance of the motor", find_winding),
    CommissioningStep("motor_direction", "sign of the motor", find_motor_direction),
    CommissioningStep("torque_constant", "torque per ampere", find_torque_constant),
    CommissioningStep("cables", "stiffness, pretension and friction", find_cables),
    CommissioningStep("zero", "zero of the angles", set_zero),
    CommissioningStep("index", "index pulses of both encoders", learn_pulses),
    CommissioningStep("keep", "store the configuration", keep),
)


def steps_for(facts: Facts) -> list[CommissioningStep]:
    """Return the steps that such a rig needs, in order."""
    return [step for step in STEPS if facts.learn_index or step.name != "index"]


def commission(
    drive: Drive, model_file: Path, folder: Path, operator: Operator, facts: Facts
) -> CommissioningState:
    """Go through the steps that are not done yet.

    Parameters
    ----------
    drive : Drive
        Bridge off; left so.
    model_file : Path
        The nominal rig: lengths, radii, counts, and first guesses of the rest.
    folder : Path
        Made where it is not there. At the end `MODEL_FILE` in it has the posterior.
    operator : Operator
    facts : Facts

    Raises
    ------
    BadInput
        A folder of another drive or model, facts other than those by which a step was done, or a
        recording that does not hold what a step needs.
    DriveFailed
    Declined
        The operator ended it; what is done stays done.
    """
    require_bridge_off(drive, "commissioning")
    identity = DriveIdentity(
        node_id=drive.node_id, serial_number=drive.read_raw("identity.serial_number")
    )
    state = open_state(folder, model_file, identity)
    _require_same_facts(state, facts)
    folder.mkdir(parents=True, exist_ok=True)
    model = _read_model(folder / MODEL_FILE if state.steps else model_file)
    job = Job(drive, model, folder, operator, facts)
    write(drive, difference(drive, state.written, WRITABLE))
    news = False
    for step in steps_for(facts):
        if state.done(step.name) is not None and not (news and step.do is keep):
            continue
        news = True
        job.recordings.clear()
        job.written.clear()
        findings = step.do(job)
        for finding in findings:
            operator.tell(finding)
        with replace_whole(folder / MODEL_FILE) as temporary:
            temporary.write_text(format_model(job.model), encoding="utf-8")
        done = DoneStep(
            name=step.name,
            ended=datetime.now(UTC).isoformat(timespec="seconds"),
            facts=facts.named(step.takes),
            recordings=tuple(job.recordings),
            findings=tuple(findings),
            written=dict(job.written),
        )
        others = [step for step in state.steps if step.name != done.name]
        state = state.model_copy(update={"steps": (*others, done)})
        save_state(folder, state)
    return state


def _require_same_facts(state: CommissioningState, facts: Facts) -> None:
    for step in STEPS:
        done = state.done(step.name)
        for name, value in facts.named(step.takes).items():
            taken = value if done is None else done.facts.get(name, value)
            if value != taken:
                found, was = (" ".join(f"{one:.6g}" for one in each) for each in (value, taken))
                accepted = f"{was}, by which {step.name} was done, or another folder (--output)"
                raise BadInput(name, found, accepted)


def _read_model(path: Path) -> Model:
    return parse_model(path.read_text(encoding="utf-8"), source=str(path))
