"""Coulomb's law on a curved conduit: the capstan equation, eq. (1) of the paper.

    dT/ds = +-mu_d T / R      so      T_far = T_near exp(+-a),  a = mu_d * wrap angle

Source: Euler and Eytelwein; in this form Kaneko et al. 1991 and eq. (1) of Borowski, Metz and
Sergi. mu_d has no unit. Tension falls along the motion's way back: friction opposes motion.

Direction asymmetry is the same law with two coefficients, mu_d (1 + a) while the pair moves towards
positive angle and mu_d (1 - a) back; a = 0 is the limit.
"""

from __future__ import annotations

import numpy as np

from bowden.model.trajectory import FloatArray


def slide_exponent(mu_d: float, asymmetry: float, wrap_rad: FloatArray) -> FloatArray:
    """Return a of each segment while it slides.

    Parameters
    ----------
    mu_d : float
    asymmetry : float, -1 .. 1
    wrap_rad : ndarray of shape (N,), rad

    Returns
    -------
    ndarray of shape (2, 2, N)
        By cable (a, b) and direction of its motion (towards the motor, towards the load).
    """
    positive = mu_d * (1 + asymmetry) * wrap_rad
    negative = mu_d * (1 - asymmetry) * wrap_rad
    # The pair moves to positive angle when cable a runs to the motor and cable b to the load.
    return np.array([[positive, negative], [negative, positive]])
