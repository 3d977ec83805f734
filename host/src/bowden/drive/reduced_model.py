"""The model that the drive runs: a model file reduced to entries of its object dictionary.

The drive knows the pair of cables with Coulomb friction and stiction in at most 40 segments. The
path is resampled into segments of equal length that keep its wrap angle; effects that the drive has
numbers for (`Effect.on_drive`) are folded into them; what is left over is named. `configure`,
`apply` and the experiments write the result.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bowden.drive.dictionary import lookup
from bowden.errors import BadInput
from bowden.model import Model
from bowden.model.effects import CATALOGUE

DEFAULT_SEGMENTS = 20

#: Friction laws that the drive computes.
LAWS = ("coulomb", "stiction")


@dataclass(frozen=True)
class ReducedModel:
    """What of a model goes to the drive.

    Parameters
    ----------
    entries : dict of str to float
        Entry name to value in the entry's unit.
    folded : tuple of str
        Effects that are in those numbers.
    left_out : tuple of str
        What the drive cannot run, with its place in the model file.
    """

    entries: dict[str, float]
    folded: tuple[str, ...]
    left_out: tuple[str, ...]


def reduced_model(model: Model, segments: int = DEFAULT_SEGMENTS) -> ReducedModel:
    """Reduce a model.

    Parameters
    ----------
    model : Model
        The offline model.
    segments : int
        Segments of each cable, 1 .. 40.

    Raises
    ------
    BadInput
        A number of segments that the drive does not have.
    """
    entry = lookup("cable_segments")
    if not entry.low <= segments <= entry.high:
        raise BadInput("--segments", str(segments), f"{entry.low} .. {entry.high}")
    folded, left_out, kept = [], [], []
    for number, effect in enumerate(model.document.effects):
        name = str(effect["name"])
        if CATALOGUE[name].on_drive:
            folded.append(name)
            kept.append(effect)
        else:
            left_out.append(f"effects[{number}] {name}")
    law = model.document.friction.law
    if law not in LAWS:
        left_out.append(f"friction.law {law}")
    document = model.document.model_copy(update={"effects": kept})
    return ReducedModel(
        _entries(replace(model, document=document), segments), tuple(folded), tuple(left_out)
    )


def _entries(model: Model, segments: int) -> dict[str, float]:
    pair = model.transmission
    # The wrap angle up to each end of a segment; its difference quotient is the mean curvature.
    piece_ends_m = np.concatenate(([0.0], np.cumsum(pair.piece_length_m)))
    wrap_rad = np.concatenate(([0.0], np.cumsum(pair.piece_length_m * pair.piece_curvature_per_m)))
    ends_m = np.linspace(0.0, pair.length_m, segments + 1)
    length_m = pair.length_m / segments
    curvature_per_m = np.diff(np.interp(ends_m, piece_ends_m, wrap_rad)) / length_m
    entries: dict[str, float] = {
        "motor_pulley_radius": pair.motor_pulley_radius_m,
        "load_pulley_radius": pair.load_pulley_radius_m,
        "cable_axial_stiffness": pair.axial_stiffness_n,
        "cable_pretension": pair.pretension_n,
        "friction_dynamic": pair.friction.mu_d,
        "friction_static": pair.friction.mu_s,
        # Without a stiction length the paper's scheme holds: mu_s acts over one segment.
        "stiction_length": pair.friction.stiction_length_m or length_m,
        "cable_segments": segments,
    }
    rig = model.document.rig
    for name, counts in (
        ("motor_encoder_resolution", rig.motor_encoder_counts_per_turn),
        ("load_encoder_resolution", rig.load_encoder_counts_per_turn),
    ):
        if counts is not None:  # a model file need not say; then the drive's own stays
            entries[name] = counts.value
    for number, effect in enumerate(model.document.effects):
        if effect["name"] == "motor_inertia":
            entries["motor_inertia"] = model.value(f"effects[{number}].inertia_kg_m2")
    for number, curvature in enumerate(curvature_per_m.tolist(), 1):
        entries[f"segment_length.{number}"] = length_m
        entries[f"segment_curvature.{number}"] = curvature
    return entries
