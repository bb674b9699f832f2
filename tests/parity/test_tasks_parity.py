"""Tasks in priority on arms against `armlet.reference`, which differentiates poses and factorises matrices by other methods."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al
from armlet import reference

Array = NDArray[np.float64]
METHODS = ["exact", "clamp", "damped", "chiaverini"]


def joints(rng: np.random.Generator, n: int) -> list[dict[str, Any]]:
    def one() -> dict[str, Any]:
        kind = "R" if rng.uniform() < 0.8 else "P"
        axis, rpy, xyz = rng.standard_normal(3), rng.uniform(-1.0, 1.0, 3), rng.uniform(-0.4, 0.4, 3)
        m, c = rng.uniform(0.5, 2.0), rng.uniform(-0.2, 0.2, 3)
        phi = [m, *(m * c), 0.1, 0.0, 0.1, 0.0, 0.0, 0.1]
        return {"type": kind, "axis": list(axis), "rpy": list(rpy), "xyz": list(xyz), "phi": phi}

    return [one() for _ in range(n)]


def pair(rng: np.random.Generator, n: int) -> tuple[al.Arm, Any]:
    chain = joints(rng, n)
    return al.Arm.from_chain(chain), reference.Arm.from_chain(chain)


def tasks(rng: np.random.Generator, arm: al.Arm, kind: Any) -> list[Any]:
    """Return a task with a moving target and, below it in priority, a task with a constant target.

    The first has a vector as gain, the second a matrix. `kind` is armlet or the reference.
    """
    last, first = arm.frame_names[-1], arm.frame_names[arm.n // 2]
    full = rng.uniform(0.5, 1.0, (3, 3))
    start, end = rng.uniform(-0.3, 0.3, (2, 3))
    if kind is al:
        return [
            al.Task(last, "x y rz", al.Quintic(start, end, 0.5), rng.uniform(1.0, 4.0, 3)),
            al.Task(first, "xyz", rng.uniform(-0.3, 0.3, 3), full @ full.T + np.eye(3)),
        ]
    return [
        reference.Task(last, "x y rz", reference.Quintic(start, end, 0.5), gain=rng.uniform(1.0, 4.0, 3)),
        reference.Task(first, "xyz", target=rng.uniform(-0.3, 0.3, 3), gain=full @ full.T + np.eye(3)),
    ]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("n", [4, 6, 8])
def test_a_run_is_the_references(n: int, method: str) -> None:
    arms = pair(np.random.default_rng(n), n)
    q0 = np.random.default_rng(20 + n).uniform(-1.0, 1.0, n)
    law = al.PriorityVelocity(arms[0], tasks(np.random.default_rng(1), arms[0], al), method)
    other = reference.PriorityVelocity(arms[1], tasks(np.random.default_rng(1), arms[0], reference), method)
    for t in (0.0, 0.21, 0.9):
        # The inverses of the Jacobians amplify rounding.
        expected = other.terms(t, q0, np.zeros(n))
        got = law(t, q0, np.zeros(n))
        np.testing.assert_allclose(got, expected["tau"], rtol=0, atol=1e-11 * (1 + np.abs(expected["tau"]).max()))
        np.testing.assert_allclose(np.concatenate(law.terms(t, q0, np.zeros(n))["e"]), expected["e"], rtol=0, atol=1e-13)
    run = al.simulate(al.VelocityArm(arms[0]), law, q0, t_end=0.2, dt=0.01)
    reference_run = reference.simulate(reference.VelocityArm(arms[1]), other, q0, t_end=0.2, dt=0.01)
    # Rounding errors grow over the steps.
    np.testing.assert_allclose(run.q, reference_run["q"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.v, run.tau, rtol=0, atol=0)


def test_a_sampled_run_is_the_references() -> None:
    arms = pair(np.random.default_rng(3), 5)
    law = al.PriorityVelocity(arms[0], tasks(np.random.default_rng(2), arms[0], al))
    other = reference.PriorityVelocity(arms[1], tasks(np.random.default_rng(2), arms[0], reference))
    q0 = np.full(5, 0.3)
    run = al.simulate(al.VelocityArm(arms[0]), law, q0, t_end=0.2, dt=0.005, sample_time=0.02)
    reference_run = reference.simulate(reference.VelocityArm(arms[1]), other, q0, t_end=0.2, dt=0.005, sample_time=0.02)
    np.testing.assert_allclose(run.q, reference_run["q"], rtol=0, atol=1e-11)
