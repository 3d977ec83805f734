"""Stiction: a segment at standstill holds more than a sliding one, eq. (6) of the paper.

    breaks away at   |ln(T_far / T_near)| = mu_d ds/R + (mu_s - mu_d) l_s/R
    slides at        |ln(T_far / T_near)| = mu_d ds/R

Source: eqs. (4) and (6). As printed, l_s is the length ds of the segment, so that breakaway depends
on the mesh: of the whole cable at T0 exp(m (1 - 1/N) + mu_s L/(R N)). With a stiction length of its
own the excess is the same whatever N. mu_s has no unit, l_s is in metres.

Limit: mu_s = mu_d, or l_s = 0, is Coulomb's law.
"""

from __future__ import annotations

from bowden.model.trajectory import FloatArray


def breakaway_excess(
    mu_s: float,
    mu_d: float,
    stiction_length_m: float | None,
    length_m: FloatArray,
    wrap_rad: FloatArray,
) -> FloatArray:
    """Return what each segment at standstill holds beyond its sliding friction, in ln tension.

    Parameters
    ----------
    mu_s, mu_d : float
    stiction_length_m : float or None, m
        None: the length of the segment.
    length_m, wrap_rad : ndarray of shape (N,), m and rad
    """
    if stiction_length_m is None:
        return (mu_s - mu_d) * wrap_rad
    return (mu_s - mu_d) * stiction_length_m * wrap_rad / length_m
