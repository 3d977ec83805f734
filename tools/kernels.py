"""Compiles the model's kernels ahead of the tests; numba keeps them on disk.

    python -m tools.kernels              about a minute where none are kept

Two test workers that start together would each compile the same ones.
"""

from __future__ import annotations

import contextlib
import sys

import numpy as np
from bowden.model import Inputs, Mode, Model, ModelError, simulate, table_1
from bowden.model.effects import CATALOGUE
from bowden.model.experiments.variants import without_mesh, without_stiction_length


def models() -> list[Model]:
    """Return models that need each kernel: every solver, every law and every effect."""
    plain = table_1()
    found = [plain, without_mesh(without_stiction_length(plain))]
    found += [
        plain.with_effect(effect.name, variant.typical)
        for effect in CATALOGUE.values()
        for variant in effect.variants
        if variant.is_computed
    ]
    return found


def main() -> int:
    """Run each model for a moment."""
    time_s = np.linspace(0.0, 0.2, 201)
    torque_nm, angle_rad = 0.1 * np.sin(20.0 * time_s), 0.1 * np.sin(10.0 * time_s)
    inputs = Inputs(time_s, motor_torque_nm=torque_nm, load_angle_rad=angle_rad)
    for model in models():
        with contextlib.suppress(ModelError):  # no temperature here; a kernel is compiled before
            simulate(model, Mode.TORQUE_POSITION, inputs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
