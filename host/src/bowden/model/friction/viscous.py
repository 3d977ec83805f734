"""Viscous term: friction that grows with the segment's own speed.

    mu(v) = mu_d + mu_v |v|         mu_v in s/m, v in m/s

Source: the paper's Fig. 7 has such a term and gives no value; with this form friction keeps its
proportion to the tension. Limit: mu_v = 0, or motion so slow that mu_v |v| vanishes against mu_d.

A law in mu: where the conduit is straight, or the cable slack, it has no effect.
"""

from __future__ import annotations

from bowden.model.compiled import compiled_in_place


@compiled_in_place
def viscous_term(mu_v: float, speed: float) -> float:
    """Return mu_v |v|; mu_v in s/m, speed in m/s."""
    return mu_v * abs(speed)
