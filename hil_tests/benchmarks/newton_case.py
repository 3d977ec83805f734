"""One cable in its conduit, in Newton: a script for the interpreter that has `newton` installed.

Reads {length_m, turning_rad, mu, axial_stiffness_n, pretension_n, pinholes, iterations, step_s,
pull_m: [...]} from stdin and writes {near_n, far_n, step_s} to stdout. Imports nothing of this
package, so that it runs in another environment; `newton_tendon` calls it.

The conduit is a polygon in a plane: pinholes at equal distances, each with an equal bend, half an
edge at both ends. The far end is fixed, the near one moves along the first edge.
"""

from __future__ import annotations

import json
import math
import sys
import time

import newton  # type: ignore[import-not-found, unused-ignore]
import numpy as np
import warp as wp  # type: ignore[import-not-found, unused-ignore]


def main() -> None:
    """Run the case."""
    case = json.load(sys.stdin)
    n = case["pinholes"]
    edges = [0.5] + [1.0] * (n - 1) + [0.5]
    compliance = [e * case["length_m"] / n / case["axial_stiffness_n"] for e in edges]
    points, heading = [np.zeros(2)], 0.0
    for i, edge in enumerate(edges):
        if i:
            heading += case["turning_rad"] / n
        step = edge * case["length_m"] / n
        points.append(points[-1] + step * np.array([math.cos(heading), math.sin(heading)]))

    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    near = builder.add_body(
        xform=wp.transform(p=wp.vec3(0.0, 0.0, 0.0), q=wp.quat_identity()),
        mass=0.0,
        is_kinematic=True,
    )
    kinds = newton.TendonGuideType
    route = [newton.TendonGuide(body=near, guide_type=kinds.ANCHOR)]
    for i, point in enumerate(points[1:]):
        last = i == n
        length = float(np.linalg.norm(points[i + 1] - points[i]))
        route.append(
            newton.TendonGuide(
                body=-1,
                guide_type=kinds.ANCHOR if last else kinds.PINHOLE,
                mu=0.0 if last else case["mu"],
                offset=(float(point[0]), float(point[1]), 0.0),
                compliance=compliance[i],
                rest_length=length - case["pretension_n"] * compliance[i],
            )
        )
    builder.add_tendon(route)
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverXPBD(model, iterations=case["iterations"])
    now, then, control = model.state(), model.state(), model.control()

    near_n, far_n = [], []
    begun = 0.0
    for sample, pull in enumerate(case["pull_m"]):
        if sample == 20:  # compiled and warm
            begun = time.perf_counter()
        pose = np.array([[-pull, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]], dtype=np.float32)
        now.body_q.assign(pose)
        solver.step(now, then, control, None, case["step_s"])
        now, then = then, now
        tension = solver.tendon_segment_material_tension.numpy()
        near_n.append(float(tension[0]))
        far_n.append(float(tension[-1]))
    took = (time.perf_counter() - begun) / (len(near_n) - 20)
    answer = {"near_n": near_n, "far_n": far_n, "step_s": took, "version": newton.__version__}
    sys.stdout.write("\n" + json.dumps(answer))


if __name__ == "__main__":
    main()
