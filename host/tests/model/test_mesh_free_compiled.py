"""The mesh-free solver's kernels do the same compiled and as plain Python."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import numpy as np


def test_the_compiled_kernels_are_the_plain_python_ones(tmp_path: Any) -> None:
    """The same file without numba, warnings being errors, gives the same numbers."""
    script = tmp_path / "uncompiled.py"
    script.write_text(
        "import sys\n"
        "import numpy as np\n"
        "from bowden.model.mesh_free.solver import simulate_mesh_free\n"
        "from bowden.model.trajectory import Mode\n"
        "from bowden.model.transmission import FrictionLaw, Transmission\n"
        "answers = []\n"
        "for pretension in (0.0, 2.0, 10.0):\n"
        "    rig = Transmission(4000.0, np.array([0.5, 0.4, 0.7]), np.array([4.0, 0.0, 2.0]),\n"
        "                       pretension, 0.02, 0.104, FrictionLaw(0.3, 0.3))\n"
        "    t = np.linspace(0.0, 6.0, 120)\n"
        "    a, b = 0.3 * np.sin(2 * t), 0.1 * np.sin(3 * t + 0.2) - 0.1 * np.sin(0.2)\n"
        "    for mode, first, second in ((Mode.TORQUE_POSITION, a, b),\n"
        "            (Mode.POSITION_TORQUE, a, 5 * b), (Mode.POSITION_POSITION, a, b)):\n"
        "        out = simulate_mesh_free(rig, mode, t, first, second)\n"
        "        answers.append([out.motor_angle_rad, out.load_angle_rad, out.motor_tension_a_n,\n"
        "                        out.load_tension_a_n, out.motor_tension_b_n, out.slack])\n"
        "np.save(sys.argv[1], np.array(answers))\n"
    )
    results = []
    for name, disable in (("plain", "1"), ("compiled", "0")):
        target = tmp_path / f"{name}.npy"
        environment = {**os.environ, "NUMBA_DISABLE_JIT": disable}
        command = [sys.executable, "-W", "error", str(script), str(target)]
        subprocess.run(command, env=environment, check=True)
        results.append(np.load(target))
    # compilers may contract a*b + c; the difference is rounding
    np.testing.assert_allclose(results[0], results[1], rtol=1e-9, atol=1e-9)
