"""Elastic joints against `armlet.reference`: random trees, full matrices, tasks with fewer rows than joints, rest poses and limits.

The reference shares no formula with armlet. It differentiates Lagrange's equations and computes the inner loop from the acceleration of
the reduced motor. Rest poses and stability limits result from differences and bisection.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from loops import body, close
from numpy.typing import NDArray

import armlet as al
from armlet import reference

Array = NDArray[np.float64]


def pair(rng: np.random.Generator, n: int) -> tuple[al.Arm, Any]:
    def joint() -> dict[str, Any]:
        axis, rpy, xyz = rng.standard_normal(3), rng.uniform(-1.0, 1.0, 3), rng.uniform(-0.4, 0.4, 3)
        return {"type": "R", "axis": list(axis), "rpy": list(rpy), "xyz": list(xyz), "phi": list(body(rng))}

    chain, gravity = [joint() for _ in range(n)], rng.uniform(-6.0, 6.0, 3)
    return al.Arm.from_chain(chain, gravity=gravity), reference.Arm.from_chain(chain, gravity=gravity)


def positive(rng: np.random.Generator, n: int, scale: float) -> Array:
    half = rng.normal(size=(n, n))
    return np.asarray(scale * (half @ half.T / n + np.eye(n)))


def laws(rng: np.random.Generator, arms: tuple[al.Arm, Any], axes: str, relative: bool) -> tuple[Any, Any, Any, Any]:
    ours, theirs = arms
    n, m = ours.n, len(axes.replace("r", "").replace(" ", ""))
    K, B, B0 = positive(rng, n, 2000.0), positive(rng, n, 0.5), positive(rng, n, 0.2)
    frame = ours.frame_names[-1]
    here = np.asarray(ours.position(np.full(n, 0.2), frame))
    target = np.concatenate([here, [0.1, 0.2, -0.1]])[[{"x": 0, "y": 1, "z": 2}[c] + (3 if r else 0) for r, c in letters(axes)]]
    given = (target, positive(rng, m, 80.0), positive(rng, m, 10.0), K, B, B0)
    options = {"frame": frame, "axes": axes, "damping_ratio": 0.8, "relative_damping": relative}
    return (
        al.ElasticArm(ours, K, B),
        al.ElasticImpedance(ours, *given, **options),
        reference.ElasticArm(theirs, K, B),
        reference.ElasticImpedance(theirs, *given, **options),
    )


def letters(axes: str) -> list[tuple[bool, str]]:
    found, turn = [], False
    for c in axes.replace(" ", ""):
        if c == "r":
            turn = True
        else:
            found.append((turn, c))
            turn = False
    return found


CASES = [(1, "x"), (2, "zx"), (3, "xyz"), (4, "xyz"), (6, "xyz rx ry rz"), (7, "yz rx"), (8, "xyz")]


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize(("n", "axes"), CASES)
def test_law(n: int, axes: str, relative: bool) -> None:
    rng = np.random.default_rng(100 * n + relative)
    _, ours, _, theirs = laws(rng, pair(rng, n), axes, relative)
    for _ in range(3):
        q, v, theta, theta_dot = rng.uniform(-1.0, 1.0, (4, n))
        parts = ours.terms(0.0, q, v, theta=theta, theta_dot=theta_dot)
        expected = theirs.terms(0.0, q, v, theta, theta_dot)
        # The torque is a product of several matrices, which amplify rounding.
        for name in ("u", "tau", "tau_J", "e", "J", "x_dot"):
            close(parts[name], expected[name], 1e-12)
        close(ours(0.0, q, v, theta=theta, theta_dot=theta_dot), expected["tau"], 1e-12)


@pytest.mark.parametrize(("n", "axes"), [(1, "x"), (2, "zx"), (3, "xyz"), (4, "xyz rx")])
def test_run(n: int, axes: str) -> None:
    rng = np.random.default_rng(7 + n)
    plant, ours, their_plant, theirs = laws(rng, pair(rng, n), axes, False)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    m = ours.terms(0.0, q0, v0, theta=q0, theta_dot=v0)["e"].size
    force = [(0.0, rng.uniform(-5.0, 5.0, m)), (0.03, rng.uniform(-5.0, 5.0, m))]
    options: dict[str, Any] = {"v0": v0, "t_end": 0.05, "dt": 1e-3, "force": force}
    run = al.simulate(plant, ours, q0, **options)
    expected = reference.simulate(their_plant, theirs, q0, **options)
    # Both codes take equal steps. They differ by rounding, which grows at the rate of the loop.
    for name in ("q", "v", "theta", "theta_dot", "tau"):
        close(getattr(run, name), expected[name], 1e-9)


def test_rest_and_eigenvalues() -> None:
    rng = np.random.default_rng(11)
    arms = models.THREE_LINKS, models.REFERENCE_THREE_LINKS
    K, B = [900.0, 700.0, 500.0], [0.4, 0.3, 0.2]
    for _ in range(3):
        q_d = rng.uniform([-1.0, 0.5, 0.3], [1.0, 1.2, 1.0])
        target = np.asarray(arms[0].pose(q_d, "link3"))
        given = (np.array([*target[:2, 3], q_d.sum()]), [300.0, 300.0, 60.0], [30.0, 30.0, 6.0], K, B, [0.05, 0.04, 0.03])
        ours = al.ElasticImpedance(arms[0], *given, frame="link3", axes="xy rz")
        theirs = reference.ElasticImpedance(arms[1], *given, frame="link3", axes="xy rz")
        F = rng.uniform(-5.0, 5.0, 3) * [1.0, 1.0, 0.2]
        rest = al.equilibrium(al.ElasticArm(arms[0], K, B), ours, F, q0=q_d)
        expected = reference.equilibrium(reference.ElasticArm(arms[1], K, B), theirs, F, q0=q_d)
        close(rest.q, expected.q, 1e-10)
        close(rest.tau, expected.tau, 1e-9)
        assert (rest.reachable, rest.spurious, rest.stable) == (expected.reachable, expected.spurious, expected.stable)
        # The reference computes derivatives from extrapolated differences, which are less accurate.
        ours_sorted, theirs_sorted = (np.sort_complex(np.round(values, 6)) for values in (rest.eigenvalues, expected.eigenvalues))
        close(np.abs(ours_sorted), np.abs(theirs_sorted), 1e-6)


def test_limits() -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        B, K, zeta, dt = rng.uniform(0.1, 1.0), rng.uniform(200.0, 2000.0), rng.uniform(0.5, 1.5), rng.uniform(2e-4, 2e-3)
        ours = float(al.smallest_reduced_inertia(B, K, dt, damping_ratio=zeta))
        # Both codes bisect the spectral radius, which hardly changes near the limit.
        assert abs(ours / reference.smallest_reduced_inertia(B, K, dt, damping_ratio=zeta) - 1.0) < 1e-6
        M, b0, d = rng.uniform(0.3, 2.0), rng.uniform(0.01, 0.1), rng.uniform(0.0, 10.0)
        D0 = 2.0 * np.sqrt(b0 * K)
        assert abs(float(al.stiffness_limit(M, K, b0, d)) / reference.stiffness_limit(M, K, b0, d, motor_damping=float(D0)) - 1.0) < 1e-8
