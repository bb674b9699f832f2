"""Friction, external wrenches, derivatives and centres of mass of random trees against the reference, 1 to 8 joints.

armlet differentiates its recursions. The reference samples torques at five angles of each joint, and derives centres of mass from
potential energies.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from trees import close, driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]

CASES = [(n, seed) for n in range(1, 9) for seed in range(2)]


def states(arm: al.Arm, seed: int, count: int) -> Array:
    """Return random joint vectors (count, 2, 1, n). Some velocities are exactly zero, where Coulomb friction is discontinuous."""
    x = np.random.default_rng([arm.n, seed, 2]).uniform(-2.0, 2.0, (count, 2, 1, arm.n))
    x[1, 0, 0] = 0.0
    return x


def size(*values: Array) -> float:
    """Return the largest magnitude of all entries, the scale of rounding."""
    return max(float(np.abs(value).max(initial=0.0)) for value in values)


@pytest.mark.parametrize(("n", "seed"), CASES)
@pytest.mark.parametrize("friction", [False, True])
def test_dynamics_under_friction_and_a_wrench(n: int, seed: int, friction: bool) -> None:
    arm, theirs = driven_tree(n, seed)
    q, v, a = states(arm, seed, 3)
    load: dict[str, Any] = {"wrench": np.random.default_rng(seed).normal(size=6), "wrench_frame": arm.frame_names[-1]}
    mass = theirs.mass_matrix(q)
    for options in ({"friction": friction}, {"friction": friction} | load):
        tau = theirs.inverse_dynamics(q, v, a, **options)
        close(arm.inverse_dynamics(q, v, a, **options), tau, size(mass))
        # The test multiplies the difference of the accelerations by M, and so compares torques.
        apart = arm.forward_dynamics(q, v, tau, **options) - theirs.forward_dynamics(q, v, tau, **options)
        close(np.einsum("...ij,...j->...i", mass, apart), np.zeros(q.shape), size(mass, tau))
    close(arm.bias(q, v, friction=friction), theirs.bias(q, v, friction=friction), size(mass))


@pytest.mark.parametrize(("n", "seed"), CASES)
def test_regressor_columns_of_rotors_and_friction(n: int, seed: int) -> None:
    arm, theirs = driven_tree(n, seed)
    q, v, v_r, a_r = states(arm, seed, 4)
    for options in ({"armature": True}, {"friction": True}, {"armature": True, "friction": True}):
        close(arm.regressor(q, v, v_r, a_r, **options), theirs.regressor(q, v, v_r, a_r, **options))


@pytest.mark.parametrize(("n", "seed"), CASES)
@pytest.mark.parametrize("friction", [False, True])
def test_slopes(n: int, seed: int, friction: bool) -> None:
    arm, theirs = driven_tree(n, seed)
    q, v, x = states(arm, seed, 3)
    mass, most = theirs.mass_matrix(q), size(theirs.inverse_dynamics(q, v, x))
    for got, want in zip(
        arm.inverse_dynamics_derivatives(q, v, x, friction=friction),
        ref.inverse_dynamics_derivatives(theirs, q, v, x, friction=friction),
        strict=True,
    ):
        close(got, want, most)
    inverse = np.linalg.inv(mass)
    # Rounding of a torque is multiplied by the inverse inertia twice: in the acceleration and in its derivative.
    most = size(inverse) * (most + size(mass) * size(inverse) * size(x))
    for got, want in zip(
        arm.forward_dynamics_derivatives(q, v, x, friction=friction),
        ref.forward_dynamics_derivatives(theirs, q, v, x, friction=friction),
        strict=True,
    ):
        close(got, want, most)
    if n <= 4:
        for got, want in zip(arm.linearize(q, v, x, friction=friction), ref.linearize(theirs, q, v, x, friction=friction), strict=True):
            close(got, want, most)


@pytest.mark.parametrize("closed", ["planar_pr", "pendulum"])
def test_slopes_of_arms_in_closed_form(closed: str) -> None:
    arguments = {"planar_pr": (2.0, 0.7, 0.5), "pendulum": (2.0, 3.0)}[closed]
    arm, theirs = getattr(al, closed)(*arguments), getattr(ref, closed)(*arguments)
    q, v, x = states(arm, 0, 3)
    for name in ("inverse_dynamics_derivatives", "forward_dynamics_derivatives", "linearize"):
        for got, want in zip(getattr(arm, name)(q, v, x), getattr(ref, name)(theirs, q, v, x), strict=True):
            close(got, want, 10.0)


@pytest.mark.parametrize(("n", "seed"), CASES)
def test_centres_of_mass(n: int, seed: int) -> None:
    arm, theirs = driven_tree(n, seed)
    q, _ = states(arm, seed, 2)
    close(arm.center_of_mass(q), theirs.center_of_mass(q))
    close(arm.center_of_mass_jacobian(q), theirs.center_of_mass_jacobian(q))
