"""Baselines on the same cases: regression of the gap on a library, and "viscous".

Every baseline gets the gap that OUR calibration leaves (so miscalibration is not held against it),
in the channel that disagrees most, and one library of terms; each term is mapped to the effect of
the catalogue whose signature it is, which is fair to regression: where one term stands for several
effects, the mapping lists them and any of them counts.

- `pysindy`: sequentially thresholded least squares (PySINDy's STLSQ) on the normalised terms, as in
  discrepancy modelling; the term that explains most gives the name.
- `sysidentpy`: FROLS orders the terms by error reduction; the first gives the name, if its
  terms pass an F-test at 95 % over the effective number of samples (a bound for
  autocorrelated residuals; the package's own lets 16 % of white noise pass).
- `viscous`: always says viscous friction.
"""

from __future__ import annotations

import time
import warnings
from importlib.util import find_spec

import numpy as np
from bowden.diagnosis.result import Diagnosis, Series
from bowden.recording.recording import Recording
from numpy.typing import NDArray

from hil_tests.benchmarks.diagnosis_score import Answer

Vector = NDArray[np.float64]
EVERY = 10  # samples: the library is regressed at 100 Hz
THRESHOLD = 0.1  # of STLSQ, in standard deviations of the gap

IN_TORQUE = {
    "1": ("load_cell_offset",),
    "t": ("load_cell_drift",),
    "tau_l": ("load_cell_gain", "torque_constant_error"),
    "tau_m": ("torque_constant_error", "load_cell_gain"),
    "sign(v)": ("bearing_friction", "wrap_angle_change", "presliding_compliance"),
    "v": ("viscous_friction",),
    "|v|": ("direction_asymmetry",),
    "sign(v) exp(-v^2)": ("stribeck_friction", "dwell_strengthening"),
    "sign(v) |tau_l|": ("tension_dependent_friction", "wrap_angle_change"),
    "sign(v) t": ("pretension_loss", "wear"),
    "sign(v) Tc": ("thermal_friction",),
    "alpha": ("load_inertia",),
    "sin theta_l": ("gravity_imbalance",),
    "cos theta_l": ("gravity_imbalance",),
    "sign(v) theta_l": ("position_dependent_friction",),
    "sign(v) theta_l^2": ("position_dependent_friction",),
    "sin theta_m": ("pulley_eccentricity", "cogging"),
    "cos theta_m": ("pulley_eccentricity", "cogging"),
    "d tau_l/dt": ("time_delay", "amplifier_lag", "frictional_lag", "viscoelastic_cable"),
    "sign(d tau_l/dt)": ("load_cell_hysteresis", "termination_backlash"),
    "d^2 theta_m/dt^2": ("motor_inertia",),
}
IN_ANGLE = {
    "1": ("encoder_offset", "motor_torque_offset"),
    "t": ("pretension_loss",),
    "tau_m": ("conduit_compliance", "torque_constant_error"),
    "tau_l": ("conduit_compliance",),
    "sign(v)": ("wrap_angle_change", "bearing_friction", "termination_backlash"),
    "v": ("time_delay", "viscous_friction"),
    "|v|": ("direction_asymmetry",),
    "sin theta_m": ("encoder_eccentricity", "pulley_eccentricity"),
    "cos theta_m": ("encoder_eccentricity", "pulley_eccentricity"),
    "tau_m^3": ("cable_stiffening",),
    "d tau_m/dt": ("amplifier_lag", "viscoelastic_cable"),
    "d^2 theta_m/dt^2": ("motor_inertia",),
}


def missing() -> list[str]:
    """Return the packages of the baselines that are not installed."""
    return [name for name in ("pysindy", "sysidentpy") if find_spec(name) is None]


def answers(found: Diagnosis, recording: Recording) -> dict[str, Answer]:
    """Return each baseline's answer to the case that was diagnosed."""
    series = max(
        found.series, key=lambda s: float(np.mean(((s.measured - s.before) / s.sigma) ** 2))
    )
    names, terms, gap = library(series, recording)
    mapping = IN_TORQUE if series.quantity == "load_torque_nm" else IN_ANGLE
    answer = {"viscous": Answer("named", ("viscous_friction",), ("viscous_friction",), seconds=0.0)}
    for method, order in (("pysindy", _by_stlsq), ("sysidentpy", _by_frols)):
        start = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            ranked = [mapping[names[i]] for i in order(terms, gap)]
        ranking = tuple(dict.fromkeys(name for group in ranked for name in group[:1]))
        seconds = time.perf_counter() - start
        if not ranked:
            answer[method] = Answer("complete", (), seconds=seconds)
        elif len(ranked[0]) == 1:
            answer[method] = Answer("named", ranked[0], ranking, seconds=seconds)
        else:
            answer[method] = Answer("ambiguous", ranked[0][:3], ranking, seconds=seconds)
    return answer


def library(series: Series, recording: Recording) -> tuple[list[str], NDArray[np.float64], Vector]:
    """Return the terms' names, their columns (normalised), and the gap, at 100 Hz."""
    t = recording.time_s
    width = 21

    def smooth(values: Vector) -> Vector:
        kernel = np.hanning(width + 2)[1:-1]
        padded = np.pad(values, width // 2, mode="edge")
        return np.asarray(np.convolve(padded, kernel / kernel.sum(), mode="valid"))

    load, motor = smooth(recording.load_angle_rad), smooth(recording.motor_angle_rad)
    v = np.gradient(load, t)
    sign = np.tanh(v / 0.02)
    tau_l, tau_m = smooth(recording.load_torque_nm), smooth(recording.motor_torque_nm)
    slope = np.gradient(tau_l, t)
    warm = recording.channels.get("conduit_temperature_c")
    columns = {
        "1": np.ones_like(t),
        "t": t,
        "tau_l": tau_l,
        "tau_m": tau_m,
        "sign(v)": sign,
        "v": v,
        "|v|": np.abs(v),
        "sign(v) exp(-v^2)": sign * np.exp(-((v / 0.15) ** 2)),
        "sign(v) |tau_l|": sign * np.abs(tau_l),
        "sign(v) t": sign * t,
        "alpha": np.gradient(v, t),
        "sin theta_l": np.sin(load),
        "cos theta_l": np.cos(load) - np.cos(load).mean(),
        "sign(v) theta_l": sign * load,
        "sign(v) theta_l^2": sign * load**2,
        "sin theta_m": np.sin(motor),
        "cos theta_m": np.cos(motor),
        "tau_m^3": tau_m**3,
        "d tau_l/dt": slope,
        "sign(d tau_l/dt)": np.tanh(slope),
        "d tau_m/dt": np.gradient(tau_m, t),
        "d^2 theta_m/dt^2": np.gradient(np.gradient(motor, t), t),
    }
    if warm is not None:
        columns["sign(v) Tc"] = sign * (smooth(warm) - 20.0)
    mapping = IN_TORQUE if series.quantity == "load_torque_nm" else IN_ANGLE
    names = [name for name in mapping if name in columns and np.ptp(columns[name]) >= 0.0]
    table = np.column_stack([columns[name][::EVERY] for name in names])
    scale = np.sqrt(np.mean(table**2, axis=0))
    keep = scale > 0.0
    gap = (series.measured - series.before) / series.sigma
    return (
        [n for n, k in zip(names, keep, strict=True) if k],
        (table / scale)[:, keep],
        gap[::EVERY],
    )


def _by_stlsq(terms: NDArray[np.float64], gap: Vector) -> list[int]:
    """Return the columns that survive, most explaining first; none if that is too little."""
    from pysindy import STLSQ  # noqa: PLC0415

    found = STLSQ(threshold=THRESHOLD * float(gap.std()), alpha=1e-3).fit(terms, gap[:, None])
    size = np.abs(np.ravel(found.coef_))
    order = [int(i) for i in np.argsort(-size) if size[i] > 0.0]
    if not order or not _significant(terms[:, order], gap):
        return []
    return order


def _by_frols(terms: NDArray[np.float64], gap: Vector) -> list[int]:
    """Return the columns in FROLS' order, if the first one is significant."""
    from sysidentpy.basis_function import Polynomial  # noqa: PLC0415
    from sysidentpy.model_structure_selection import FROLS  # noqa: PLC0415

    model = FROLS(
        n_terms=5,
        order_selection=False,
        xlag=[[1]] * terms.shape[1],
        ylag=1,
        model_type="NFIR",
        basis_function=Polynomial(degree=1),
    )
    model.fit(X=np.vstack([terms[1:], terms[-1:]]), y=gap[:, None])
    regressors = np.asarray(model.final_model)[:, 0]
    order = [int(code) // 1000 - 2 for code in regressors if int(code) >= 2000]
    if not order or not _significant(terms[:, order], gap):
        return []
    return order


def _significant(terms: NDArray[np.float64], gap: Vector) -> bool:
    """F-test of the chosen terms at 95 %, over the effective number of samples."""
    from scipy.stats import f  # noqa: PLC0415

    rest = gap - terms @ np.linalg.lstsq(terms, gap, rcond=None)[0]
    n, used = rest.size, terms.shape[1]
    centred = rest - rest.mean()
    power = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[: n // 4]
    correlation = correlation / correlation[0]
    ends = np.flatnonzero(correlation < 0.05)
    effective = n / (1.0 + 2.0 * float(correlation[1 : ends[0]].sum())) if ends.size else 0.0
    free = max(effective - used, 1.0)
    gain = float(gap @ gap - rest @ rest) / used / (float(rest @ rest) / free)
    return bool(gain > f.ppf(1.0 - 0.05 / len(IN_TORQUE), used, free))
