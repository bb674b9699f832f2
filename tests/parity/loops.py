"""Random arms and laws, made with armlet and with the reference. Their accelerations suit steps of 1 ms."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import armlet as al
from armlet import reference

Array = NDArray[np.float64]

#: Names of `law_pair` that make a PID law.
PIDS = ("PID", "PID that moves", "PD with an observer", "PID with all options")


def body(rng: np.random.Generator) -> Array:
    """Return the inertial parameters (10,) of six point masses, one of them at the origin, plus a rotational inertia."""
    phi = np.zeros(10)
    for k in range(6):
        m = rng.uniform(0.2, 0.4)
        x, y, z = rng.uniform(-0.3, 0.3, 3) if k else (0.0, 0.0, 0.0)
        phi += m * np.array([1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
    # The extra inertia keeps accelerations of light last links small enough for steps of 1 ms.
    return phi + np.array([0, 0, 0, 0, 0.05, 0, 0.05, 0, 0, 0.05])


def joints(rng: np.random.Generator, n: int) -> list[dict[str, Any]]:
    def one() -> dict[str, Any]:
        kind = "R" if rng.uniform() < 0.7 else "P"
        axis, rpy, xyz = rng.standard_normal(3), rng.uniform(-1.0, 1.0, 3), rng.uniform(-0.4, 0.4, 3)
        return {"type": kind, "axis": list(axis), "rpy": list(rpy), "xyz": list(xyz), "phi": list(body(rng))}

    return [one() for _ in range(n)]


def pair(rng: np.random.Generator, n: int) -> tuple[al.Arm, Any]:
    chain, gravity = joints(rng, n), rng.uniform(-6.0, 6.0, 3)
    return al.Arm.from_chain(chain, gravity=gravity), reference.Arm.from_chain(chain, gravity=gravity)


def close(got: Array, expected: Array, tolerance: float) -> None:
    scale = max(1.0, float(np.max(np.abs(expected), initial=0.0)))
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=tolerance * scale)


def law_pair(rng: np.random.Generator, name: str, arms: tuple[al.Arm, Any]) -> tuple[al.Law, Any]:
    ours, theirs = arms
    n = ours.n
    start, end = rng.uniform(-0.5, 0.5, (2, n))
    motions = al.Quintic(start, end, 0.2), reference.Quintic(start, end, 0.2)
    frame = ours.frame_names[-1]
    if name == "Adaptive":
        kp, kd, gamma = rng.uniform(5.0, 20.0, n), rng.uniform(2.0, 6.0, n), rng.uniform(0.1, 2.0, 10 * n)
        estimate = rng.uniform(0.0, 0.3, 10 * n)
        return (
            al.Adaptive(ours, motions[0], kp, kd, gamma, estimate=estimate),
            reference.Adaptive(theirs, motions[1], kp, kd, gamma, estimate=estimate),
        )
    if name == "ComputedTorque":
        return al.ComputedTorque(ours, motions[0], 100.0, 20.0), reference.ComputedTorque(theirs, motions[1], 100.0, 20.0)
    if name == "PDGravity":
        return al.PDGravity(ours, end, 20.0, 6.0), reference.PDGravity(theirs, end, 20.0, 6.0)
    if name == "PID":
        # Some joints start with a torque beyond tau_max.
        gains = (rng.uniform(10.0, 30.0, n), rng.uniform(5.0, 40.0, (n, n)) / n + 30.0 * np.eye(n), rng.uniform(2.0, 6.0, n))
        gains = (gains[0], 0.5 * (gains[1] + gains[1].T), gains[2])
        limits = rng.uniform(1.0, 30.0, n)
        return al.PID(ours, end, *gains, tau_max=limits), reference.PID(theirs, end, *gains, tau_max=limits)
    if name == "PID that moves":
        return al.PID(ours, motions[0], 30.0, 20.0, 6.0), reference.PID(theirs, motions[1], 30.0, 20.0, 6.0)
    if name == "PD with an observer":
        # The nominal inertia is the mass matrix at the first desired position.
        options: dict[str, Any] = {"observer_bandwidth": rng.uniform(20.0, 60.0, n)}
        return al.PID(ours, motions[0], 30.0, None, 6.0, **options), reference.PID(theirs, motions[1], 30.0, None, 6.0, **options)
    if name == "PID with all options":
        options = {"tau_max": rng.uniform(1.0, 30.0, n), "derivative_filter": rng.uniform(80.0, 200.0, n), "friction": True}
        options |= {"friction_speed": 0.3, "observer_bandwidth": 40.0, "nominal_inertia": rng.uniform(0.2, 0.6, n)}
        rubbing = {"damping": rng.uniform(0.5, 2.0, n), "friction": rng.uniform(0.5, 2.0, n)}
        ours, theirs = ours.with_drives(**rubbing), theirs.with_drives(**rubbing)
        return al.PID(ours, motions[0], 30.0, 20.0, 6.0, **options), reference.PID(theirs, motions[1], 30.0, 20.0, 6.0, **options)
    axes = "xyz" if n < 6 else "xyz rz rx"
    m = 3 if n < 6 else 5
    target = np.append(ours.position(np.zeros(n), frame), [0.1, 0.2])[:m]
    arguments = (target, rng.uniform(50.0, 100.0, m), rng.uniform(5.0, 15.0, m))
    return (
        al.CartesianImpedance(ours, *arguments, frame=frame, axes=axes),
        reference.CartesianImpedance(theirs, *arguments, frame=frame, axes=axes),
    )
