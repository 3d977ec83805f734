"""What a lab does with the rig in half a minute: handle strokes, rests, motor torques, warming.

Strokes of several lengths and speeds (0.05 .. 2.5 rad/s), sine-like or at constant speed; rests of
0.5 .. 3 s; motor torque at levels (zero among them), in ramps, or as a tunnel around the middle.
Everything starts at standstill at zero, and is drawn from a random generator alone.
"""

from __future__ import annotations

import numpy as np

from hil_tests.hidden_effects.hidden import Signals, Vector

RATE_HZ = 1000.0
ROUNDING_S = 0.04  # in which a stroke at constant speed comes to speed
TUNNEL_NM_PER_RAD = 0.5
TUNNEL_EDGE_RAD = 0.05
TUNNEL_MOST_NM = 0.2


def handle(rng: np.random.Generator, time_s: Vector) -> Vector:
    """Return the handle's angle, rad: strokes and rests, one after the other."""
    end = float(time_s[-1])
    knots_t, knots_x = [np.array([0.0])], [np.array([0.0])]
    at, now = 0.0, float(rng.uniform(0.2, 0.6))
    knots_t.append(np.array([now]))
    knots_x.append(np.array([0.0]))
    amplitude, speed, sine, strokes_left = 0.3, 1.0, True, 0
    slow_done = 0.0
    while now < end:
        if strokes_left == 0:
            strokes_left = int(rng.integers(2, 6))
            amplitude = float(rng.choice([0.1, 0.25, 0.45, 0.7]) * rng.uniform(0.8, 1.2))
            speed = float(np.exp(rng.uniform(np.log(0.05), np.log(2.5))))
            if speed < 0.15:
                slow_done += 1
                speed = speed if slow_done < 3 else 1.2
            sine = bool(rng.random() < 0.5)
            if rng.random() < 0.6:
                now += float(rng.uniform(0.5, 3.0))
                knots_t.append(np.array([now]))
                knots_x.append(np.array([at]))
        side = -1.0 if at > 0.0 else 1.0
        target = side * min(amplitude, 0.5 * 5.0 * speed) * float(rng.uniform(0.7, 1.0))
        lasts = 0.5 * np.pi * abs(target - at) / speed if sine else abs(target - at) / speed
        lasts = max(lasts, 2.5 * ROUNDING_S)
        share = np.linspace(0.0, 1.0, max(int(lasts * RATE_HZ), 8))[1:]
        way = 0.5 - 0.5 * np.cos(np.pi * share) if sine else _rounded(share, ROUNDING_S / lasts)
        knots_t.append(now + share * lasts)
        knots_x.append(at + (target - at) * way)
        now, at = now + lasts, target
        strokes_left -= 1
    return np.asarray(np.interp(time_s, np.concatenate(knots_t), np.concatenate(knots_x)))


def _rounded(share: Vector, corner: float) -> Vector:
    """Way from 0 to 1 at constant speed, with speeding up and slowing down over `corner`."""
    speed = 1.0 / (1.0 - corner)
    way = speed * (share - 0.5 * corner)
    way = np.where(share < corner, 0.5 * speed * share**2 / corner, way)
    late = 1.0 - share
    return np.asarray(np.where(late < corner, 1.0 - 0.5 * speed * late**2 / corner, way))


def motor_torque(rng: np.random.Generator, time_s: Vector, angle: Vector, most_nm: float) -> Vector:
    """Return the motor's torque, N m: levels with ramps between them, at times a tunnel on top."""
    knots_t, knots_x = [0.0, 0.4], [0.0, 0.0]
    while knots_t[-1] < time_s[-1]:
        level = 0.0 if rng.random() < 0.25 else float(rng.uniform(-1.0, 1.0)) * most_nm
        rate = float(np.exp(rng.uniform(np.log(0.1), np.log(3.0))))
        knots_t.append(knots_t[-1] + max(abs(level - knots_x[-1]) / rate, 0.02))
        knots_x.append(level)
        knots_t.append(knots_t[-1] + float(rng.uniform(0.5, 4.0)))
        knots_x.append(level)
    torque = np.interp(time_s, knots_t, knots_x)
    if rng.random() < 0.5:
        first, last = np.sort(rng.uniform(0.0, time_s[-1], 2))
        inside = np.clip((time_s - first) / 0.5, 0.0, 1.0) * np.clip(
            (last - time_s) / 0.5, 0.0, 1.0
        )
        beyond = np.maximum(np.abs(angle) - TUNNEL_EDGE_RAD, 0.0)
        tunnel = -np.sign(angle) * np.minimum(TUNNEL_NM_PER_RAD * beyond, TUNNEL_MOST_NM)
        torque = torque * (1.0 - 0.5 * inside) + tunnel * inside
    return np.asarray(torque)


def temperature(rng: np.random.Generator, time_s: Vector) -> Vector:
    """Return the conduit's temperature, degC: it warms and cools by 10 to 20 K, not in a line."""
    swing = float(rng.uniform(10.0, 20.0))
    period = float(rng.uniform(12.0, 25.0))
    start = float(rng.uniform(0.0, 2.0 * np.pi))
    wave = np.sin(2.0 * np.pi * time_s / period + start)
    return np.asarray(20.0 + 0.5 * swing * (wave - wave[0] + 0.3))


def draw(rng: np.random.Generator, most_nm: float, length_s: float = 30.0) -> Signals:
    """Draw all of it for one recording; `most_nm` is the largest motor torque."""
    time_s = np.arange(round(length_s * RATE_HZ)) / RATE_HZ
    angle = handle(rng, time_s)
    torque = motor_torque(rng, time_s, angle, most_nm)
    return Signals(time_s, torque, angle, temperature(rng, time_s))
