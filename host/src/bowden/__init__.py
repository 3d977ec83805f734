"""bowden: host tools for a drive that feels through a cable-conduit transmission.

`import bowden` gives a small flat interface; `bowden.api` holds it. Nothing is loaded before it is
used, so that importing costs a millisecond::

    import bowden

    model = bowden.read_model("my_rig.yaml")
    run = bowden.read_recording("run.csv")
    comparison = bowden.compare(model, run)
    bowden.figures(comparison)["loop"].show()
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.2.0"

if TYPE_CHECKING:
    from bowden.api.figure_files import write_figures as write_figures
    from bowden.api.live import Rig as Rig
    from bowden.api.live import apply as apply
    from bowden.api.live import configure as configure
    from bowden.api.live import connect as connect
    from bowden.api.live import record as record
    from bowden.api.offline import calibrate as calibrate
    from bowden.api.offline import compare as compare
    from bowden.api.offline import diagnose as diagnose
    from bowden.api.offline import estimate as estimate
    from bowden.api.offline import extend as extend
    from bowden.api.offline import find as find
    from bowden.api.offline import read_model as read_model
    from bowden.api.offline import simulate as simulate
    from bowden.api.offline import verify as verify
    from bowden.api.offline import write_model as write_model
    from bowden.api.pages import write_report as write_report
    from bowden.api.plots import figures as figures
    from bowden.api.posterior import to_arviz as to_arviz
    from bowden.api.tables import to_dataframe as to_dataframe
    from bowden.errors import BadInput as BadInput
    from bowden.errors import DriveFailed as DriveFailed
    from bowden.model import Model as Model
    from bowden.model import ModelError as ModelError
    from bowden.model import table_1 as table_1
    from bowden.recording.csv_file import write_csv as write_csv
    from bowden.recording.read import read_recording as read_recording
    from bowden.recording.recording import Recording as Recording

_MODULES = {
    "BadInput": "bowden.errors",
    "DriveFailed": "bowden.errors",
    "Model": "bowden.model",
    "ModelError": "bowden.model",
    "Recording": "bowden.recording.recording",
    "Rig": "bowden.api.live",
    "apply": "bowden.api.live",
    "calibrate": "bowden.api.offline",
    "compare": "bowden.api.offline",
    "configure": "bowden.api.live",
    "connect": "bowden.api.live",
    "diagnose": "bowden.api.offline",
    "estimate": "bowden.api.offline",
    "extend": "bowden.api.offline",
    "figures": "bowden.api.plots",
    "find": "bowden.api.offline",
    "read_model": "bowden.api.offline",
    "read_recording": "bowden.recording.read",
    "record": "bowden.api.live",
    "simulate": "bowden.api.offline",
    "table_1": "bowden.model",
    "to_arviz": "bowden.api.posterior",
    "to_dataframe": "bowden.api.tables",
    "verify": "bowden.api.offline",
    "write_csv": "bowden.recording.csv_file",
    "write_figures": "bowden.api.figure_files",
    "write_model": "bowden.api.offline",
    "write_report": "bowden.api.pages",
}

__all__ = ["__version__", *_MODULES]  # noqa: PLE0604  (the keys are the names)


def __getattr__(name: str) -> object:
    """Load what is asked for."""
    if name not in _MODULES:
        raise AttributeError(f"module 'bowden' has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
