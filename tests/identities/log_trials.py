"""Logs of a simulator in numpy with one wrong assumption each, for the tests of `fit.refuted`.

The arm has a vertical axis and two horizontal ones: shoulder and elbow. Its equations of motion are those of Newton and Euler, for many
logs at once. Torques and positions of a log have the noise, the quantisation, the uneven times and the lost samples of a real one.

    python tests/identities/log_trials.py inverse 100               100 logs of each fault, fitted as an arm
    python tests/identities/log_trials.py prediction 20 delay       20 logs of a fault, fitted as a plant
"""

from __future__ import annotations

import sys
from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
PLACES = np.array([[0.0, 0.0, 0.3], [0.0, 0.0, 0.2], [0.5, 0.0, 0.0]])
MASSES = np.array([4.0, 3.0, 2.0])
CENTRES = np.array([[0.02, 0.01, 0.05], [0.24, 0.03, 0.01], [0.19, -0.02, 0.02]])
INERTIAS = np.array([np.diag(each) for each in ([0.03, 0.03, 0.02], [0.01, 0.08, 0.08], [0.005, 0.04, 0.04])])
GRAVITY = np.array([0.0, 0.0, -9.81])
ROTORS, VISCOUS, COULOMB = np.array([0.5, 0.6, 0.3]), np.array([1.5, 2.0, 0.8]), np.array([2.0, 2.5, 1.2])
NAMES = ("yaw", "shoulder", "elbow")


def about_origin(mass: float, centre: Array, inertia: Array) -> list[float]:
    """The ten inertial parameters of a body about the origin of its frame."""
    whole = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return [mass, *(mass * centre), whole[0, 0], whole[0, 1], whole[1, 1], whole[0, 2], whole[1, 2], whole[2, 2]]


def arm() -> al.Arm:
    joints: list[dict[str, Any]] = [
        {"type": "R", "axis": AXES[i], "xyz": PLACES[i], "name": NAMES[i], "phi": about_origin(MASSES[i], CENTRES[i], INERTIAS[i])}
        for i in range(3)
    ]
    return al.Arm.from_chain(joints, gravity=GRAVITY)


def turned(axis: Array, angle: Array, back: bool = False) -> Array:
    """Rotation matrices (.., 3, 3) about an axis; transposed with `back`."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    K = -K if back else K
    angle = angle[..., None, None]
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K)


def bodies(q: Array, v: Array, a: Array, gravity: Array = GRAVITY, payload: Array | float = 0.0) -> Array:
    """Torques (.., 3) of the bodies by Newton and Euler. A payload (..,) is a point mass at 0.3 m on the last link."""
    R = [turned(AXES[i], q[..., i]) for i in range(3)]
    w = np.zeros((*q.shape[:-1], 3))
    dw, acc = np.zeros_like(w), np.broadcast_to(-gravity, w.shape)
    states = []
    for i in range(3):
        acc = acc + np.cross(dw, PLACES[i]) + np.cross(w, np.cross(w, PLACES[i]))
        w, dw, acc = (np.einsum("...ji,...j->...i", R[i], each) for each in (w, dw, acc))
        rate = AXES[i] * v[..., i : i + 1]
        dw = dw + np.cross(w, rate) + AXES[i] * a[..., i : i + 1]
        w = w + rate
        states.append((w, dw, acc))
    tau = np.zeros_like(q)
    force, moment = np.zeros_like(w), np.zeros_like(w)
    for i in (2, 1, 0):
        w, dw, acc = states[i]
        parts = [(np.asarray(MASSES[i]), CENTRES[i], INERTIAS[i])]
        if i == 2:
            parts.append((np.asarray(payload), np.array([0.3, 0.0, 0.05]), np.zeros((3, 3))))
        if i < 2:
            force = np.einsum("...ij,...j->...i", R[i + 1], force)
            moment = np.einsum("...ij,...j->...i", R[i + 1], moment) + np.cross(PLACES[i + 1], force)
        for mass, centre, inertia in parts:
            own = mass[..., None] * (acc + np.cross(dw, centre) + np.cross(w, np.cross(w, centre)))
            force = force + own
            moment = moment + np.cross(centre, own) + dw @ inertia + np.cross(w, w @ inertia)
        tau[..., i] = moment @ AXES[i]
    return tau


class Motion:
    """A sum of sinusoids for each joint, with four derivatives."""

    def __init__(self, rng: np.random.Generator, size: float = 1.0) -> None:
        self.speed = 2.0 * np.pi * rng.uniform([0.1, 0.25, 0.5], [0.2, 0.45, 0.75], (3, 3))
        self.phase = rng.uniform(0.0, 2.0 * np.pi, (3, 3))
        self.size = size * np.array([0.8, 0.35, 0.2]) * rng.uniform(0.8, 1.2, (3, 3))

    def __call__(self, t: Array, order: int = 0) -> Array:
        angle = self.speed * t[:, None, None] + self.phase + 0.5 * np.pi * order
        return np.asarray(np.sum(self.size * self.speed**order * np.sin(angle), axis=2))


PERIOD, DURATION = 0.005, 20.0
KINDS = ("inertia", "rotors", "viscous", "coulomb", "offsets")
#: The wrong assumptions, with the kinds that the fit leaves out.
FAULTS = {name: KINDS for name in ("torque_constant", "gravity", "elasticity", "delay", "saturation", "payload", "clock_drift", "stribeck")}
FAULTS |= {name: tuple(kind for kind in KINDS if kind != name) for name in ("rotors", "viscous", "coulomb", "offsets")}


class Robot:
    """Torques of the motors that move the arm, with the fault `name`, and the positions that the motors show."""

    def __init__(self, rng: np.random.Generator, name: str = "") -> None:
        self.name, self.motion = name, Motion(rng)
        self.offset = rng.uniform(-1.0, 1.0, 3) + 0.5
        self.compliance = np.array([0.0, 1.0, 0.0]) / 800.0 if name == "elasticity" else np.zeros(3)
        tilt = np.deg2rad(5.0) if name == "gravity" else 0.0
        course = rng.uniform(0.0, 2.0 * np.pi)
        self.gravity = 9.81 * np.array([np.sin(tilt) * np.cos(course), np.sin(tilt) * np.sin(course), -np.cos(tilt)])

    def links(self, t: Array) -> Array:
        payload = np.where(t > 0.5 * DURATION, 0.4, 0.0) if self.name == "payload" else 0.0
        return bodies(self.motion(t), self.motion(t, 1), self.motion(t, 2), self.gravity, payload)

    def motors(self, t: Array) -> tuple[Array, Array]:
        """Positions and torques of the motors. The derivatives of the elastic deflection are difference quotients."""
        h = 1e-3
        before, now, after = (self.links(t + step) for step in (-h, 0.0, h))
        q = self.motion(t) + self.compliance * now
        v = self.motion(t, 1) + self.compliance * (after - before) / (2.0 * h)
        a = self.motion(t, 2) + self.compliance * (after - 2.0 * now + before) / h**2
        tau = now + ROTORS * a + VISCOUS * v + COULOMB * np.sign(v) + self.offset
        if self.name == "stribeck":
            tau += np.array([0.0, 3.0, 0.0]) * np.exp(-((v / 0.15) ** 2)) * np.sign(v)
        return q, tau


def saturated(robots: list[Robot], limit: Array) -> tuple[Array, Array, Array]:
    """Positions and commanded torques (B, K, 3) of tracking loops whose motors have a torque limit, without Coulomb friction."""
    step, every = 0.5 * PERIOD, 2
    t = step * np.arange(round(DURATION / step))
    q_d, v_d = (np.stack([robot.motion(t, order) for robot in robots]) for order in (0, 1))
    q, v = q_d[:, 0].copy(), v_d[:, 0].copy()
    unit = np.eye(3)[:, None, :] * np.ones((len(robots), 1))
    gains = np.array([200.0, 400.0, 150.0]), np.array([20.0, 40.0, 15.0])
    kept: list[tuple[Array, Array]] = []
    for k in range(len(t)):
        bias = bodies(q, v, 0.0 * q) + VISCOUS * v
        columns = bodies(np.broadcast_to(q, unit.shape), 0.0 * unit, unit, np.zeros(3))
        M = np.moveaxis(columns, 0, -1) + np.diag(ROTORS)
        command = gains[0] * (q_d[:, k] - q) + gains[1] * (v_d[:, k] - v) + bias
        if k % every == 0:
            kept.append((q, command + np.stack([robot.offset for robot in robots])))
        acceleration = np.linalg.solve(M, (np.clip(command, -limit, limit) - bias)[..., None])[..., 0]
        v = v + step * acceleration
        q = q + step * v
    positions, torques = zip(*kept, strict=True)
    return t[::every], np.stack(positions, axis=1), np.stack(torques, axis=1)


def recorded(rng: np.random.Generator, robot: Robot, noise: Array | float, delay: int) -> al.Log:
    """A log with quantised encoders, noisy torques, uneven times, and 1 % of lost samples. Torques act `delay` samples later."""
    late = delay + (robot.name == "delay")
    t = PERIOD * np.arange(round(DURATION / PERIOD)) + 0.02 * PERIOD * rng.uniform(-1.0, 1.0, round(DURATION / PERIOD))
    q, tau = robot.motors(t)
    at = t * (1.0 + 1.0e-3) if robot.name == "clock_drift" else t
    tau = robot.motors(at + late * PERIOD)[1] if late or robot.name == "clock_drift" else tau
    if robot.name == "torque_constant":
        tau[:, 2] *= 1.1
    return as_recorded(rng, t, q, tau, noise)


#: Noise of the torques of a right log, N m, and what the filter leaves of white noise at 200 Hz.
NOISE, FILTERED = np.array([0.4, 0.4, 0.2]), 0.282


def fitted(log: al.Log, name: str, delay: int = 0, predicted: bool = False) -> al.LogFit:
    """The fit of a log with the wrong assumption `name`: of an arm, or of a plant that predicts the positions."""
    model = al.RigidArm(arm()) if predicted else arm()
    return al.fit_log(model, log, FAULTS.get(name, KINDS), delay=delay * PERIOD, held=False)


def trial(name: str, seed: int, predicted: bool = False) -> al.LogFit:
    """The fit of one log. Its noise is a third of what the wrong assumption leaves in the residual of one joint of the inverse fit."""
    rng = np.random.default_rng(seed)
    robot, delay = Robot(rng, name), int(rng.integers(0, 4))
    noise = NOISE
    if name:
        fault = fitted(recorded(rng, robot, 0.0, delay), name, delay).residuals
        right = Robot(rng)
        right.motion = robot.motion
        other = fitted(recorded(rng, right, 0.0, delay), "", delay).residuals
        noise = sized(fault, other)
    return fitted(recorded(rng, robot, noise, delay), name, delay, predicted)


def sized(fault: Array, right: Array) -> Array:
    """The noise that is a third of what a fault adds to the residual of one joint."""
    return np.asarray(NOISE * (np.sqrt(np.maximum(fault**2 - right**2, 0.0)) / (FILTERED * NOISE)).max() / 3.0)


def saturated_trials(count: int, seed: int, predicted: bool = False) -> list[al.LogFit]:
    """The fits of logs in which the torque of the shoulder saturates at 18 N m."""
    rngs = [np.random.default_rng([seed, k]) for k in range(count)]
    t, q, tau = saturated([Robot(rng, "saturation") for rng in rngs], np.array([np.inf, 18.0, np.inf]))
    fits = []
    for k, rng in enumerate(rngs):
        fault = fitted(as_recorded(rng, t, q[k], tau[k], 0.0), "saturation").residuals
        fits.append(fitted(as_recorded(rng, t, q[k], tau[k], sized(fault, np.zeros(3))), "saturation", 0, predicted))
    return fits


def first(fit: al.LogFit) -> str:
    """The name of the first refuted assumption; empty if there is none."""
    return fit.refuted[0].name if fit.refuted else ""


def main(count: int, names: list[str], predicted: bool) -> None:
    """Print how often each assumption was named first."""
    for name in names or ["", *FAULTS]:
        name = name.replace("right", "")
        fits = saturated_trials(count, 0, predicted) if name == "saturation" else (trial(name, seed, predicted) for seed in range(count))
        print(f"{name or 'right'}: {dict(Counter(first(fit) or 'nothing' for fit in fits))}", flush=True)


def as_recorded(rng: np.random.Generator, t: Array, q: Array, tau: Array, noise: Array | float) -> al.Log:
    step = 2.0 * np.pi / 2**17
    kept = rng.uniform(size=len(t)) > 0.01
    kept[[0, -1]] = True
    noisy = tau + noise * rng.normal(size=tau.shape)
    return al.Log(t[kept], step * np.round(q[kept] / step), tau=noisy[kept], names=NAMES)


if __name__ == "__main__":
    main(int(sys.argv[2]), sys.argv[3:], sys.argv[1] == "prediction")
