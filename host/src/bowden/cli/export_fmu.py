"""Write a model as an FMU (FMI 3.0, co-simulation) for Simulink, Modelica tools, C or Python.

Inputs are the mode's two series, held over a communication step; outputs the other two, the four
end tensions and the slack flags. The FMU runs the model on its mesh (numerics.segments) and gives
what `bowden simulate` gives for the same inputs, one step later. It starts virgin.

It is a Python FMU: where it runs, a Python with bowden must be found.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bowden.cli.model_arguments import add_mode_argument, add_model_argument, mode_of, read_model
from bowden.cli.output import add_json_argument, console, print_json
from bowden.errors import BadInput
from bowden.recording.atomic import refuse_unwritable

EXAMPLES = """examples:
  bowden export-fmu rig.yaml --output pair.fmu
  bowden export-fmu rig.yaml --mode position-position --segments 50 --output pair.fmu
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_model_argument(parser)
    add_mode_argument(parser)
    parser.add_argument("--segments", type=int, metavar="N", help="solve on a mesh of N segments")
    parser.add_argument(
        "--output", type=Path, metavar="OUT.fmu", help="default: the model's name with .fmu"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace OUT if it is there")
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Write it and say what is in it."""
    from bowden.fmu.co_simulation import inputs_of, outputs_of  # noqa: PLC0415  (fast --help)
    from bowden.fmu.export import export_fmu  # noqa: PLC0415
    from bowden.model.experiments.variants import with_segments  # noqa: PLC0415

    path: Path = args.output or args.model.with_suffix(".fmu")
    if path.suffix != ".fmu":
        raise BadInput(str(path), f"a name that ends in {path.suffix!r}", "OUT.fmu")
    if path.exists() and not args.overwrite:
        raise BadInput(str(path), "a file with that name", "a new name, or --overwrite")
    refuse_unwritable([path])
    model, mode = read_model(args.model), mode_of(args)
    if args.segments is not None:
        model = with_segments(model, args.segments)
    export_fmu(model, mode, path)
    inputs, outputs = ([one.name for one in some] for some in (inputs_of(mode), outputs_of(mode)))
    out = console()
    out.print(f"{path}: FMI 3.0, co-simulation, {mode.value}", soft_wrap=True)
    out.print(f"inputs: {', '.join(inputs)}; outputs: {', '.join(outputs)}", soft_wrap=True)
    if args.json:
        print_json(
            {
                "fmu": str(path), "fmi": "3.0", "mode": mode.value,
                "inputs": inputs, "outputs": outputs,
            }
        )  # fmt: skip
    return 0
