"""The motor's electrical side and the current amplifier, as the emulated board sees them.

The equations (winding resistance and inductance, back-EMF, switching by TIM1, freewheeling) are
solved in bridge.c between two changes of the PWM; here are the parameters and their source. The
mechanical side stays in the simulated rig: it gives the speed and takes the mean current.
"""

from __future__ import annotations

from dataclasses import dataclass

from hil_tests.targets.board_map import CURRENT_UA_PER_CODE, CURRENT_ZERO_CODE


@dataclass(frozen=True)
class Motor:
    """A brushed DC motor on an H-bridge.

    Parameters
    ----------
    resistance_ohm, inductance_h : float
        Of winding and leads, both > 0. Defaults: a 24 V, 150 W motor of 60 mN m/A (time constant
        0.5 ms; the datasheet class of a Maxon RE 40).
    back_emf_v_s_per_rad : float
        Equals the torque constant in N m/A.
    diode_drop_v : float
        Of each freewheeling diode.
    """

    resistance_ohm: float = 0.6
    inductance_h: float = 0.3e-3
    back_emf_v_s_per_rad: float = 0.060
    diode_drop_v: float = 0.7

    def __post_init__(self) -> None:
        if self.resistance_ohm <= 0 or self.inductance_h <= 0:
            raise ValueError("resistance and inductance of the motor must be positive")

    def parameters(self) -> dict[str, float]:
        """Return ``bridge_parameters_t`` of api.h."""
        return {
            "resistance_ohm": self.resistance_ohm,
            "inductance_h": self.inductance_h,
            "back_emf_v_s_per_rad": self.back_emf_v_s_per_rad,
            "diode_drop_v": self.diode_drop_v,
            "ampere_per_code": CURRENT_UA_PER_CODE * 1e-6,
            "zero_code": float(CURRENT_ZERO_CODE),
        }
