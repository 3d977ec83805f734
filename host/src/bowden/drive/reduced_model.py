"""The model that the drive runs: a model file reduced to entries of its object dictionary.

The drive knows the pair of cables with Coulomb friction and stiction in at most 40 segments. The
path is resampled into segments of equal length that keep its wrap angle. Effects are folded into
such numbers or become tables (`effect_ways`); what is left over is named. `configure`, `apply` and
the experiments write the result.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bowden.drive.dictionary import lookup
from bowden.drive.effect_ways import folded, way_of
from bowden.drive.friction_deviation import friction_deviation
from bowden.drive.tables import TABLES, DriveTable, table_entries
from bowden.errors import BadInput
from bowden.model import Model

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
    tabled : tuple of str
        Effects that are in tables.
    tables : tuple of DriveTable
        Those tables; they are in `entries`, too.
    left_out : tuple of str
        What the drive cannot run: its place in the model file, and why.
    in_drive : Model
        The model without what is left out: what the drive assumes, but for its segments.
    """

    entries: dict[str, float]
    folded: tuple[str, ...]
    tabled: tuple[str, ...]
    tables: tuple[DriveTable, ...]
    left_out: tuple[str, ...]
    in_drive: Model


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
    in_numbers, in_tables, left_out = [], [], []
    kept_numbers, kept = [], []
    tables: tuple[DriveTable, ...] = ()
    for written, effect in zip(model.document.effects, model.effects, strict=True):
        name = effect.effect.name
        way = way_of(effect, written)
        made = way.tables(effect.values, effect.variant, model.transmission) if way.tables else ()
        if way.how == "folded":
            in_numbers.append(name)
            kept_numbers.append(written)
        elif made and len(tables) + len(made) <= TABLES:
            in_tables.append(name)
            tables += made
        else:
            full = f"no room: the drive has {TABLES} tables" if made else way.why
            left_out.append(f"{effect.where} {name} ({full})")
            continue
        kept.append(written)
    law = model.document.friction.law
    if law not in LAWS:
        left_out.append(f"friction.law {law}")
    entries = _entries(folded(_with(model, kept_numbers)), segments) | _deviations(model)
    return ReducedModel(
        entries=entries | table_entries(tables),
        folded=tuple(in_numbers),
        tabled=tuple(in_tables),
        tables=tables,
        left_out=tuple(left_out),
        in_drive=folded(_with(model, kept)),
    )


def _with(model: Model, effects: list[dict[str, Any]]) -> Model:
    document = model.document.model_copy(update={"effects": tuple(effects)})
    return replace(model, document=document)


def _deviations(model: Model) -> dict[str, float]:
    """Return how well the file knows the friction, within what the drive takes; else nothing."""
    deviation = friction_deviation(model)
    if deviation is None:
        return {}
    entry = lookup("friction_deviation")
    scale = entry.scale or 1.0
    return {entry.name: min(max(deviation, entry.low * scale), entry.high * scale)}


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
