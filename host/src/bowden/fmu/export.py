"""Write a model as an FMU: FMI 3.0, co-simulation, by the package pythonfmu3."""

from __future__ import annotations

import json
import shutil
import tempfile
from importlib.metadata import version
from pathlib import Path

from bowden.errors import BadInput
from bowden.fmu.co_simulation import CoSimulation
from bowden.model import Mode, Model, format_model
from bowden.recording.atomic import replace_whole

CLASS = "BowdenPair"
_SLAVE = Path(__file__).with_name("slave.py")


def export_fmu(model: Model, mode: Mode, path: Path) -> None:
    """Write the FMU, whole or not at all.

    Parameters
    ----------
    model : Model
        Solved on its mesh, whatever solver it names.
    mode : Mode
        Which two series are its inputs.
    path : Path

    Raises
    ------
    BadInput
        The package pythonfmu3 is not installed, or the path cannot be written.
    bowden.model.ModelError
        An effect or a motor inertia, which cannot be stepped.
    """
    try:
        from pythonfmu3.builder import FmuBuilder  # noqa: PLC0415  (an extra)
    except ModuleNotFoundError:
        accepted = "pip install 'bowden[fmu]'"
        raise BadInput("bowden export-fmu", "no package pythonfmu3", accepted) from None
    CoSimulation(model, mode)  # what cannot be stepped is told here, not inside of the FMU
    with tempfile.TemporaryDirectory(prefix="bowden_fmu_") as name:
        folder = Path(name)
        about = {
            "mode": mode.value,
            "version": version("bowden"),
            "description": f"pair of Bowden cables, {mode.value}; inputs are held over a step",
        }
        resources = folder / "model.yaml", folder / "about.json"
        resources[0].write_text(format_model(model), encoding="utf-8")
        resources[1].write_text(json.dumps(about), encoding="utf-8")
        # The builder makes the unit once, beside its script, to describe it.
        script = folder / "script" / "bowden_pair.py"
        script.parent.mkdir()
        shutil.copy(_SLAVE, script)
        built = FmuBuilder.build_FMU(script, folder / "built", resources)
        with replace_whole(path) as temporary:
            shutil.copy(built, temporary)
