"""Derivatives of the dynamics, compared with extrapolated differences, and their relations to the dynamics."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

ARMS = {name: al.load_urdf(al.example_urdf(name)) for name in ("planar_2r", "planar_pr", "six_axis", "seven_axis", "two_arms")}


def slope(f: Callable[[Array], Array], x: Array) -> Array:
    """df/dx by central differences, extrapolated twice. The error is h^6 / 7! times the seventh derivative, plus rounding / h."""
    columns = []
    for j in range(x.size):
        step = np.zeros_like(x)

        def difference(h: float, step: Array = step, j: int = j) -> Array:
            step[j] = h
            return (f(x + step) - f(x - step)) / (2.0 * h)

        d = [difference(h) for h in (0.04, 0.02, 0.01)]
        once = [(4.0 * fine - coarse) / 3.0 for coarse, fine in pairwise(d)]
        columns.append((16.0 * once[1] - once[0]) / 15.0)
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS.keys())
@pytest.mark.parametrize("friction", [False, True])
def test_slopes(arm: al.Arm, friction: bool) -> None:
    # No velocity is near zero, where Coulomb friction jumps.
    rng = np.random.default_rng(3)
    q, a = rng.uniform(-1.0, 1.0, (2, arm.n))
    v = rng.uniform(0.3, 1.0, arm.n) * rng.choice([-1.0, 1.0], arm.n)
    by_q, by_v, by_a = arm.inverse_dynamics_derivatives(q, v, a, friction=friction)
    f = partial(arm.inverse_dynamics, friction=friction)
    # Extrapolation is accurate to 1e-12 of the largest entry. Forward dynamics amplifies its error.
    for got, want in (
        (by_q, slope(lambda x: f(x, v, a), q)),
        (by_v, slope(lambda x: f(q, x, a), v)),
        (by_a, slope(lambda x: f(q, v, x), a)),
    ):
        np.testing.assert_allclose(got, want, rtol=0.0, atol=1e-9 * max(1.0, float(np.abs(want).max())))
    np.testing.assert_allclose(by_a, arm.mass_matrix(q), rtol=1e-13, atol=1e-13)
    tau = f(q, v, a)
    by_q, by_v, by_tau = arm.forward_dynamics_derivatives(q, v, tau, friction=friction)
    g = partial(arm.forward_dynamics, friction=friction)
    for got, want in (
        (by_q, slope(lambda x: g(x, v, tau), q)),
        (by_v, slope(lambda x: g(q, x, tau), v)),
        (by_tau, slope(lambda x: g(q, v, x), tau)),
    ):
        np.testing.assert_allclose(got, want, rtol=0.0, atol=1e-7 * max(1.0, float(np.abs(want).max())))


@pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS.keys())
def test_slopes_by_velocity_are_twice_the_christoffel_matrix(arm: al.Arm) -> None:
    q, v, a = np.random.default_rng(4).uniform(-1.0, 1.0, (3, 9, arm.n))
    np.testing.assert_allclose(arm.inverse_dynamics_derivatives(q, v, a)[1], 2.0 * arm.coriolis_matrix(q, v), rtol=1e-12, atol=1e-12)


def test_linearisation_predicts_a_small_step() -> None:
    arm = ARMS["seven_axis"]
    rng = np.random.default_rng(5)
    q, v = rng.uniform(-0.5, 0.5, (2, 4, arm.n))
    tau = arm.inverse_dynamics(q, v, rng.uniform(-1.0, 1.0, (4, arm.n)))
    A, B = arm.linearize(q, v, tau)
    assert A.shape == (4, 14, 14) and B.shape == (4, 14, 7)
    dx, dtau = 1e-4 * rng.uniform(-1.0, 1.0, (4, 14)), 1e-4 * rng.uniform(-1.0, 1.0, (4, 7))
    moved = arm.forward_dynamics(q + dx[:, :7], v + dx[:, 7:], tau + dtau) - arm.forward_dynamics(q, v, tau)
    predicted = np.einsum("kij,kj->ki", A, dx) + np.einsum("kij,kj->ki", B, dtau)
    np.testing.assert_allclose(predicted[:, :7], dx[:, 7:], rtol=1e-15)
    # The remainder is of second order in the changes. It is at most 8e-5 of the largest entry of `moved`.
    np.testing.assert_allclose(predicted[:, 7:], moved, rtol=0.0, atol=3e-4 * float(np.abs(moved).max()))


def test_broadcasting_and_out() -> None:
    arm = ARMS["six_axis"]
    q, v, tau = np.random.default_rng(6).uniform(-1.0, 1.0, (3, 4, 1, arm.n))
    v = np.swapaxes(v, 0, 1)
    for f, sizes in (
        (arm.inverse_dynamics_derivatives, [(6, 6)] * 3),
        (arm.forward_dynamics_derivatives, [(6, 6)] * 3),
        (arm.linearize, [(12, 12), (12, 6)]),
    ):
        call: Any = f
        results = call(q, v, tau)
        out = tuple(np.full((4, 4, *size), np.nan) for size in sizes)
        given = call(q, v, tau, out=out)
        for one, own, back in zip(results, out, given, strict=True):
            assert back is own and one.shape == own.shape and one.flags.c_contiguous and one.flags.owndata
            np.testing.assert_array_equal(one, own)
        np.testing.assert_array_equal(results[0][2, 3], call(q[2, 0], v[0, 3], tau[2, 0])[0])
        with pytest.raises(al.InputError, match=f"out is not a tuple of {len(sizes)} arrays"):
            call(q, v, tau, out=out[0])
        with pytest.raises(al.InputError, match="out has the wrong shape"):
            call(q, v, tau, out=tuple(array[0] for array in out))
        with pytest.raises(al.InputError, match="out overlaps"):
            call(
                q,
                v,
                tau,
                out=(out[0],) * len(sizes) if len(sizes) == 3 else (out[0], out[0].reshape(-1)[: 4 * 4 * 12 * 6].reshape(4, 4, 12, 6)),
            )
        with pytest.raises(al.InputError, match=r"first bad index \(3, 0, 1\)"):
            bad = tau.copy()
            bad[3, 0, 1] = np.inf
            call(q, v, bad)


def test_a_singular_mass_matrix_is_refused() -> None:
    arm = al.pendulum(1.0, 1.0).with_parameters(np.zeros(10))
    with pytest.raises(al.InputError, match="not finite"):
        arm.linearize([0.0], [0.0], [1.0])


def test_the_pr_arm_by_differences() -> None:
    """The closed-form arm with three parameters has derivatives for every shape. Those of forward dynamics follow from inverse dynamics."""
    arm = al.planar_pr(2.0, 0.5, 0.4)
    q, v, a = np.random.default_rng(8).uniform(-2.0, 2.0, (3, 5, 2))
    tau = arm.inverse_dynamics(q, v, a)
    by_q, by_v, mass = arm.inverse_dynamics_derivatives(q, v, a)
    a_q, a_v, inverse = arm.forward_dynamics_derivatives(q, v, tau)
    h = 1e-5
    for j, e in enumerate(h * np.eye(2)):
        for slope, moved in (
            (by_q, lambda e: arm.inverse_dynamics(q + e, v, a)),
            (by_v, lambda e: arm.inverse_dynamics(q, v + e, a)),
            (a_q, lambda e: arm.forward_dynamics(q + e, v, tau)),
            (a_v, lambda e: arm.forward_dynamics(q, v + e, tau)),
        ):
            # Central differences have an error of h^2 times the third derivative, here at most 4e-11.
            np.testing.assert_allclose(slope[..., j], (moved(e) - moved(-e)) / (2.0 * h), rtol=0.0, atol=1e-7)
    np.testing.assert_array_equal(mass, arm.mass_matrix(q))
    np.testing.assert_allclose(by_v, 2.0 * arm.coriolis_matrix(q, v), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(inverse @ mass, np.broadcast_to(np.eye(2), (5, 2, 2)), rtol=0.0, atol=1e-13)
    A, B = arm.linearize(q[0], v[0], tau[0])
    np.testing.assert_array_equal(A, np.block([[np.zeros((2, 2)), np.eye(2)], [a_q[0], a_v[0]]]))
    np.testing.assert_array_equal(B, np.vstack([np.zeros((2, 2)), inverse[0]]))
    with pytest.raises(al.InputError, match="forward_dynamics_derivatives: q, v, tau give a result that is not finite"):
        arm.with_parameters([1.0, 1.0, 1.0]).forward_dynamics_derivatives([0.0, 0.0], [0.0, 1.0], [1.0, 0.0])
    with pytest.raises(al.InputError, match="linearize: friction is not part of this arm"):
        arm.linearize([0.0, 0.0], [0.0, 0.0], [0.0, 0.0], friction=True)
