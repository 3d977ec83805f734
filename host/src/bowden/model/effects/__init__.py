"""The catalogue of effects that a transmission may have beside the plain cable in its conduit.

One module an effect, or a close family; `effect` says what an `Effect` is and how a simulation
goes through it. Imports of ours only the pair's numbers and series.
"""

from bowden.model.effects import (
    bearing_friction,
    cable_stiffening,
    cogging,
    conduit_compliance,
    direction_asymmetry,
    dwell_strengthening,
    encoder,
    frictional_lag,
    gravity_imbalance,
    inertia,
    load_cell,
    motor_torque,
    position_dependent_friction,
    presliding_compliance,
    pretension_loss,
    pulley_eccentricity,
    stribeck_friction,
    tension_dependent_friction,
    termination_backlash,
    thermal_friction,
    time_delay,
    viscoelastic_cable,
    viscous_friction,
    wear,
    wrap_angle_change,
)
from bowden.model.effects.effect import Channel, Effect, Parameter, Variant
from bowden.model.effects.law_table import LawTable, table_in
from bowden.model.effects.learned import LEARNED, law_of
from bowden.model.effects.own import GROUP, add_to, installed

CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        viscous_friction.EFFECT,
        stribeck_friction.EFFECT,
        presliding_compliance.EFFECT,
        frictional_lag.EFFECT,
        direction_asymmetry.EFFECT,
        tension_dependent_friction.EFFECT,
        bearing_friction.EFFECT,
        thermal_friction.EFFECT,
        wear.EFFECT,
        dwell_strengthening.EFFECT,
        position_dependent_friction.EFFECT,
        wrap_angle_change.EFFECT,
        conduit_compliance.EFFECT,
        cable_stiffening.EFFECT,
        pretension_loss.EFFECT,
        viscoelastic_cable.EFFECT,
        termination_backlash.EFFECT,
        pulley_eccentricity.EFFECT,
        encoder.ECCENTRICITY,
        encoder.OFFSET,
        load_cell.GAIN,
        load_cell.OFFSET,
        load_cell.DRIFT,
        load_cell.HYSTERESIS,
        motor_torque.CONSTANT,
        motor_torque.OFFSET,
        cogging.EFFECT,
        inertia.MOTOR,
        inertia.LOAD,
        gravity_imbalance.EFFECT,
        time_delay.EFFECT,
        motor_torque.LAG,
    )
}
"""All effects by name, in the order of CONTRACTS, then those of installed packages."""
add_to(CATALOGUE, installed(), f"entry points {GROUP}")

__all__ = [
    "CATALOGUE",
    "LEARNED",
    "Channel",
    "Effect",
    "LawTable",
    "Parameter",
    "Variant",
    "law_of",
    "table_in",
]
