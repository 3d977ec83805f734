"""The bench behind the page: one live session in a thread, the recordings' folder, long jobs.

Independent of HTTP. The session's thread stops the motor when the page is not heard from; the
folder is the only place that is read or written. Comparing and diagnosing run as commands of their
own, so that a fit never delays the bus.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bowden.diagnosis.rendering import PrescribedTunnel
from bowden.drive.live import LiveSession
from bowden.drive.live_experiment import EXPERIMENTS
from bowden.drive.live_state import (
    EndRecording,
    MarkMoment,
    RunTimed,
    StartMotor,
    StartRecording,
    StopMotor,
    WriteValues,
    run_named,
)
from bowden.errors import BadInput
from bowden.studio.orders import (
    Alive,
    ApplyModel,
    BeginRecording,
    ChangeValues,
    CloseRecording,
    Examine,
    Order,
    RunExperiment,
    SetPageMark,
    StartDrive,
    StopDrive,
)

RECORDINGS = (".blf", ".csv")
DIAGNOSED = "diagnosed.yaml"
_LONGEST_JOB_S = 900.0


class StudioBench:
    """A drive, a folder, and at most one job.

    Parameters
    ----------
    session : LiveSession
        Turned by this bench's thread from `start` to `end`; closed by its owner.
    folder : Path
        Of the recordings.
    model : Path or None
        What recordings are compared with.
    """

    def __init__(self, session: LiveSession, folder: Path, model: Path | None) -> None:
        self.session = session
        self.folder = folder
        self.model = model
        self.failure: Exception | None = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._turn, name="bowden studio bus")
        self._job_lock = threading.Lock()
        self._job: dict[str, Any] = {"state": "none"}
        self._process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Begin to watch the drive."""
        self._thread.start()

    def end(self) -> None:
        """Stop watching and end the job."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()

    def obey(self, order: Order) -> None:
        """Do what a page that has the drive asks for, or hand it to the session.

        Raises
        ------
        BadInput
            A file that is not there, a job under way, no model.
        """
        session = self.session
        match order:
            case Alive():
                session.alive()
            case StopDrive():
                session.request(StopMotor())
            case StartDrive(mode=mode, torque_nm=torque_nm):
                session.alive()
                session.request(StartMotor(run_named(mode, torque_nm)))
            case BeginRecording(name=name, notes=notes):
                session.request(StartRecording(self._capture(name), notes))
            case RunExperiment(experiment=chosen, values=values, name=name):
                if chosen not in EXPERIMENTS:
                    raise BadInput("experiment", chosen, ", ".join(EXPERIMENTS))
                session.alive()
                timed = EXPERIMENTS[chosen].timed_run(values)
                session.request(RunTimed(timed, self._capture(name)))
            case CloseRecording():
                session.request(EndRecording())
            case SetPageMark(text=text):
                session.request(MarkMoment(text))
            case ChangeValues(values=values, dry_run=dry_run):
                session.request(WriteValues(dict(values), dry_run))
            case Examine(do=do, recordings=names, experiment=chosen):
                recordings = [self._recording(name) for name in names]
                self._begin_job(do, recordings, chosen)
            case ApplyModel(dry_run=dry_run):
                session.request(WriteValues(self._diagnosed_entries(), dry_run))

    def now(self) -> dict[str, Any]:
        """Return all that the page shows, but the samples."""
        shown = asdict(self.session.snapshot())
        return shown | {"job": self.job, "recordings": self.recordings()}

    @property
    def job(self) -> dict[str, Any]:
        """The last job: its state (none, running, done, failed) and what came out."""
        with self._job_lock:
            return dict(self._job)

    def note_job(self, job: dict[str, Any]) -> None:
        """Take a job that has run elsewhere as the last one."""
        with self._job_lock:
            self._job = dict(job)

    def recordings(self) -> list[str]:
        """Return the names of the folder's recordings, newest first."""
        found = [path for path in self.folder.iterdir() if path.suffix in RECORDINGS]
        found.sort(key=lambda path: path.stat().st_mtime, reverse=True)
        return [path.name for path in found]

    def experiments(self) -> list[dict[str, Any]]:
        """Return what the page offers: names, what the operator does, parameters."""
        return [
            {
                "name": one.name,
                "title": one.title,
                "before": one.before,
                "parameters": [asdict(parameter) for parameter in one.parameters],
            }
            for one in EXPERIMENTS.values()
        ]

    def tunnel_curve(self, reach_rad: float = 0.8, points: int = 161) -> list[list[float]]:
        """Return the prescribed torque at the load over the load's angle: angles, torques."""
        import numpy as np  # noqa: PLC0415

        tunnel = self.session.snapshot().tunnel
        prescribed = PrescribedTunnel(
            half_width_rad=tunnel["tunnel_half_width"],
            stiffness_nm_per_rad=tunnel["tunnel_stiffness"],
            torque_limit_nm=tunnel["tunnel_torque_limit"],
            ratio=self.session.ratio,
        )
        angle = np.linspace(-reach_rad, reach_rad, points)
        return [angle.tolist(), prescribed.wanted_nm(angle).tolist()]

    def _turn(self) -> None:
        try:
            while not self._ended.is_set():
                self.session.turn()
        except Exception as failure:  # noqa: BLE001  (the server ends and raises it)
            self.failure = failure

    def _capture(self, name: str) -> Path:
        return self.folder / f"{name.removesuffix('.blf')}.blf"

    def _recording(self, name: str) -> Path:
        path = self.folder / name
        if path.suffix not in RECORDINGS or not path.is_file():
            raise BadInput(
                name, "no recording of the folder", ", ".join(self.recordings()) or "one"
            )
        return path

    def _begin_job(self, do: str, recordings: Sequence[Path], experiment: str) -> None:
        if self.model is None:
            raise BadInput(do, "no model", "bowden studio --model MODEL.yaml")
        with self._job_lock:
            if self._job["state"] == "running":
                raise BadInput(do, f"{self._job['do']} under way", "its end first")
            report = f"{do}_{recordings[0].stem}.html"
            self._job = {"state": "running", "do": do, "report": report}
        arguments = [do, str(self.model), *map(str, recordings), "--json"]
        if do == "figures":
            arguments = ["experiment", experiment, "--model", str(self.model), "--json"]
            arguments += ["--recordings", *map(str, recordings)]
        arguments += ["--report", str(self.folder / report)]
        if do == "diagnose":
            arguments += ["--write-model", str(self.folder / DIAGNOSED)]
        threading.Thread(target=self._run_job, args=(arguments,), daemon=True).start()

    def _run_job(self, arguments: list[str]) -> None:
        command = [sys.executable, "-m", "bowden.cli.main", *arguments]
        try:
            self._process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
            out, err = self._process.communicate(timeout=_LONGEST_JOB_S)
            ended = {"state": "done", "result": json.loads(out)} if out.strip() else {}
            last = next((line for line in reversed(err.splitlines()) if line.strip()), "no answer")
            ended = ended or {"state": "failed", "why": last}
        except (OSError, subprocess.TimeoutExpired, json.JSONDecodeError) as problem:
            if self._process is not None:
                self._process.kill()
            ended = {"state": "failed", "why": str(problem)}
        with self._job_lock:
            self._job |= ended

    def _diagnosed_entries(self) -> dict[str, float | str]:
        from bowden.drive.reduced_model import reduced_model  # noqa: PLC0415
        from bowden.model import parse_model  # noqa: PLC0415  (slow to import)

        path = self.folder / DIAGNOSED
        if not path.is_file():
            raise BadInput("apply_model", "no diagnosed model", "a diagnosis first")
        model = parse_model(path.read_text(encoding="utf-8"), source=str(path))
        return dict(reduced_model(model).entries)
