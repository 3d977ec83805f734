"""A conduit that turns by another angle than the model's path says, far beyond its tolerance."""

from __future__ import annotations

from dataclasses import replace

from bowden.model.effects.effect import Effect, Parameter, Values, Variant
from bowden.model.errors import ModelError
from bowden.model.transmission import Transmission


def _pair(pair: Transmission, p: Values) -> Transmission:
    extra = p["extra_wrap_rad"]
    if extra == 0:
        return pair
    if pair.wrap_rad == 0:
        raise ModelError("extra_wrap_rad: found a straight path, accepted: one with a bend")
    if pair.wrap_rad + extra < 0:
        raise ModelError(
            f"extra_wrap_rad: found {extra:g}, accepted: -{pair.wrap_rad:g} or more, the path's"
        )
    factor = 1.0 + extra / pair.wrap_rad
    return replace(pair, piece_curvature_per_m=pair.piece_curvature_per_m * factor)


EFFECT = Effect(
    name="wrap_angle_change",
    title="Changed wrap angle",
    enters="cable",
    variants=(
        Variant(
            "",
            (
                Parameter(
                    "extra_wrap_rad", "rad", -6.0, 6.0, 0.0, 1.0, "on top of the path's angle"
                ),
            ),
            pair=_pair,
        ),
    ),
    law="every curvature times (path angle + extra) / path angle",
    signature="gain and width of the loop change together, at every speed and tension",
    excited_by=("reversal",),
    confused_with=("thermal_friction", "wear", "pretension_loss"),
)
