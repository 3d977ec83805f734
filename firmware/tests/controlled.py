"""A compensation that controls a pair, for the tests of the laws: one call a tick, no rig.

The pair is a second transmission of the same code, so nothing is proved of rigs that are unlike the
model: that is what hil_tests/render measures.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from bowden.drive.meanings import CompensationFlags, CompensationLaw
from numpy.typing import NDArray

from firmware.tests.native import Pair, ffi, lib, settings

RATIO = 5.2
FRICTION_NM = 3.12  # 2 r_load T0 m of Table I, at the load
TICKS_PER_S = 4000
INVERSION = CompensationLaw.MODEL_INVERSION
COUNT_NM = 65_345  # of a load encoder of 10000 counts
LIMITED, HELD_TAUT, RESTING, DAMPED, DISAGREES = CompensationFlags


class Controlled:
    """A compensation, its own model, and the pair that stands for the cables, all of Table I.

    The motor has no inertia, and is where the torque of the last tick puts it, or `inertia_kg_m2`.
    """

    def __init__(
        self, rig: Any = None, model: Any = None, inertia_kg_m2: float = 0.0, **changes: int
    ) -> None:
        self.inertia_kg_m2 = inertia_kg_m2
        self.motor_rad = self.motor_rad_per_s = 0.0
        self.rig: Any = Pair(rig or settings())
        self.model: Any = Pair(
            model or settings(motor_dead_band_unm=500, load_dead_band_nm=COUNT_NM)
        )
        self.raw: Any = ffi.new("compensation_t *")
        self.settings: Any = ffi.new(
            "compensation_settings_t *",
            {
                "ticks_per_s": TICKS_PER_S,
                "torque_limit_unm": 2_000_000,
                "motor_inertia_gmm2": 30_000,
                "motor_count_nm": 62_832,
                "load_count_nm": COUNT_NM,
                "friction_share_ppm": 1_000_000,
                "friction_deviation_ppm": 122_000,
                "standstill_band_unm": 10_000,
                "integral_gain_mhz": 10_000,
                **changes,
            },
        )
        lib.compensation_configure(self.raw, self.model.raw, self.settings)
        lib.compensation_configure_laws(self.raw, self.model.raw)
        self.inputs: Any = ffi.new("compensation_inputs_t *", {"law": INVERSION, "active": True})
        self.torque_unm = 0
        self.encoder_slip_nm = 0
        self.cell_error_unm = 0

    def tick(self, wanted_nm: float, load_angle_rad: float, cell: bool = False) -> float:
        """One tick; the load torque that arrives (N m)."""
        load_arc_nm = round(load_angle_rad * 0.104e9)
        if self.inertia_kg_m2 > 0.0:
            self._turn_motor(load_arc_nm)
        else:
            lib.transmission_step_torque(self.rig.raw, self.torque_unm, load_arc_nm)
        arrives_unm = int(lib.transmission_load_torque_unm(self.rig.raw))
        found = self.inputs
        found.load_cell_valid = cell
        found.wanted_unm = round(wanted_nm * 1e6)
        found.motor_arc_nm = self.rig.raw.motor.arc_nm + self.encoder_slip_nm
        found.load_arc_nm = load_arc_nm
        found.motor_torque_unm = self.torque_unm
        found.load_cell_unm = arrives_unm + self.cell_error_unm
        lib.compensation_step(self.raw, self.model.raw, found)
        self.torque_unm = int(self.raw.outputs.motor_torque_unm)
        return arrives_unm * 1e-6

    def _turn_motor(self, load_arc_nm: int) -> None:
        """Semi-implicit Euler; next to a front the pair is 5 times as stiff: 0.2 rad a step."""
        for _ in range(4):
            pull_nm = lib.transmission_motor_torque_unm(self.rig.raw) * 1e-6
            step_s = 0.25 / TICKS_PER_S
            self.motor_rad_per_s += step_s / self.inertia_kg_m2 * (self.torque_unm * 1e-6 - pull_nm)
            self.motor_rad += step_s * self.motor_rad_per_s
            lib.transmission_step_position(
                self.rig.raw, round(self.motor_rad * 0.020e9), load_arc_nm
            )

    def run(self, wanted_nm: Any, angle_rad: NDArray[np.float64], **kind: bool) -> Any:
        """Load torque of each tick."""
        wanted = np.broadcast_to(np.asarray(wanted_nm, float), angle_rad.shape)
        return np.array(
            [
                self.tick(w, a, **kind)
                for w, a in zip(wanted.tolist(), angle_rad.tolist(), strict=True)
            ]
        )


def stroke(start_rad: float, end_rad: float, seconds: float = 0.5) -> NDArray[np.float64]:
    return np.linspace(start_rad, end_rad, round(seconds * TICKS_PER_S))
