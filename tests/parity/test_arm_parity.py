"""Trees of armlet against the reference: 1 to 8 joints, revolute and prismatic, with branches and fixed bodies.

armlet uses recursions over bodies. The reference multiplies homogeneous transforms and differentiates energies with complex steps.
"""

from __future__ import annotations

import models
import numpy as np
import pytest
from trees import both, close

import armlet as al
from armlet import reference as ref
from armlet.reference.task import pose_vector, rotation_matrix


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("n", range(1, 9))
def test_trees(n: int, seed: int) -> None:
    arm, reference, place, joints = both(n, seed)
    assert arm.n == reference.n == n and sorted(place) == list(range(n))
    rng = np.random.default_rng([n, seed, 1])
    q, v, a, v_r, a_r = rng.uniform(-2.0, 2.0, (5, 3, n))
    # The reference orders its joints differently, so the test permutes the states.
    there = np.argsort(place)
    Q, V, A, V_r, A_r = (x[:, there] for x in (q, v, a, v_r, a_r))
    rows, columns = np.ix_(place, place)
    mass = reference.mass_matrix(Q)[:, rows, columns]
    scale = float(np.abs(mass).max())
    close(arm.mass_matrix(q), mass)
    close(arm.coriolis_matrix(q, v), reference.coriolis_matrix(Q, V)[:, rows, columns], scale)
    close(arm.christoffel(q), reference.christoffel(Q)[np.ix_(range(3), place, place, place)], scale)
    close(arm.gravity(q), reference.gravity(Q)[:, place], scale)
    close(arm.bias(q, v), reference.bias(Q, V)[:, place], scale)
    tau = reference.inverse_dynamics(Q, V, A)[:, place]
    close(arm.inverse_dynamics(q, v, a), tau, scale)
    # The test multiplies the difference of the accelerations by M, and so compares torques.
    solved = reference.forward_dynamics(Q, V, tau[:, there])[:, place]
    close(np.einsum("kij,kj->ki", mass, arm.forward_dynamics(q, v, tau) - solved), np.zeros((3, n)), max(scale, float(np.abs(tau).max())))
    blocks = np.concatenate([np.arange(10 * j, 10 * j + 10) for j in place])
    close(arm.parameters, reference.parameters[blocks])
    close(arm.regressor(q, v, v_r, a_r), reference.regressor(Q, V, V_r, A_r)[:, place][:, :, blocks])
    for mine, theirs in zip(arm.energy(q, v), reference.energy(Q, V), strict=True):
        close(mine, theirs, scale)
    for k in range(len(joints)):
        frame = f"link{k + 1}"
        close(arm.pose(q, frame), reference.pose(Q, frame))
        close(arm.pose_vector(q, frame), pose_vector(reference, Q, frame), 4.0)  # angles are up to pi
        close(arm.jacobian(q, frame), reference.jacobian(Q, frame)[:, :, place])
        close(arm.jacobian_dot(q, v, frame), reference.jacobian_dot(Q, V, frame)[:, :, place], 10.0)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (2, -3, 6)])
def test_the_rotation_vector_of_a_pose_at_half_turns(axis: tuple[float, float, float]) -> None:
    """The exponential of the rotation vector is the rotation, near angles of zero and of half a turn.

    The angle is at most pi. A batch gives the same bits as single calls.
    """
    arm = al.Arm.from_chain([{"type": "R", "axis": axis}])
    steps = np.array([0.0, 1e-300, 1e-12, 1e-8, 1e-5, 9.9e-5, 1.01e-4, 1e-2, 1.0])
    q = np.concatenate([turn + side * steps for turn in (-np.pi, 0.0, np.pi) for side in (-1.0, 1.0)])[:, None]
    many = arm.pose_vector(np.tile(q, (200, 1)), "link1")
    one = np.array([arm.pose_vector(row, "link1") for row in q])
    assert np.array_equal(many, np.tile(one, (200, 1)))
    assert np.all(one[:, :3] == 0.0) and np.linalg.norm(one[:, 3:], axis=1).max() <= np.pi * (1.0 + 4e-16)
    for vector, X in zip(one[:, 3:], arm.pose(q, "link1"), strict=True):
        # Rounding is a few units in the last place of 1 for each entry, and of pi for the angle.
        np.testing.assert_allclose(rotation_matrix(vector), X[:3, :3], rtol=0.0, atol=4e-15)


def test_the_trees_are_trees() -> None:
    """The random trees include branches, prismatic joints, fixed bodies, several roots, and joint orders that differ."""
    seen = {"branch": 0, "slide": 0, "fixed": 0, "forest": 0, "order": 0}
    for n in range(1, 9):
        for seed in range(6):
            _, _, place, joints = both(n, seed)
            parents = [joint["parent"] for joint in joints]
            seen["branch"] += len(set(parents)) < len(parents)
            seen["slide"] += any(joint["type"] == "P" for joint in joints)
            seen["fixed"] += any(joint["type"] == "fixed" for joint in joints)
            seen["forest"] += parents.count(-1) > 1
            seen["order"] += list(place) != sorted(place)
    assert min(seen.values()) >= 5, seen


@pytest.mark.parametrize("n", [3, 5, 8])
def test_the_christoffel_matrix_is_symmetric_in_its_vectors(n: int) -> None:
    """C(q, x) y = C(q, y) x. For n >= 3 only the Christoffel factorisation among all skew ones has this property."""
    arm, *_ = both(n, 0)
    q, x, y = np.random.default_rng(n).uniform(-2.0, 2.0, (3, 20, n))
    one, other = arm.coriolis_matrix(q, x) @ y[..., None], arm.coriolis_matrix(q, y) @ x[..., None]
    close(one, other)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_the_christoffel_symbols_make_the_coriolis_matrix(n: int) -> None:
    """C(q, v)[i, j] = sum_k c[i, j, k] v[k], for one configuration and for batches large enough for compiled programs."""
    arm, *_ = both(n, 0)
    q, v = np.random.default_rng(n).uniform(-2.0, 2.0, (2, 3, 200, n))
    symbols = arm.christoffel(q)
    assert np.all(symbols == np.swapaxes(symbols, -1, -2))
    close(np.einsum("...ijk,...k->...ij", symbols, v), arm.coriolis_matrix(q, v))
    out = np.empty((n, n, n))
    assert arm.christoffel(q[1, 7], out=out) is out and np.all(out == symbols[1, 7])


def test_christoffel_symbols_of_arms_in_closed_form() -> None:
    q = np.random.default_rng(3).uniform(-2.0, 2.0, (20, 2))
    close(al.planar_pr(2.0, 0.5, 0.7).christoffel(q), ref.planar_pr(2.0, 0.5, 0.7).christoffel(q))
    close(al.pendulum(2.0, 3.0).christoffel(q[:, :1]), ref.pendulum(2.0, 3.0).christoffel(q[:, :1]))


def test_christoffel_refuses_what_is_no_configuration() -> None:
    arm = models.TWO_LINKS
    for q, where in (([0.0], ""), ([0.0, np.nan], r".*first bad index 1"), ([[0.0, 0.0], [np.inf, 0.0]], r".*first bad index \(1, 0\)")):
        with pytest.raises(al.InputError, match=f"christoffel: q{where}"):
            arm.christoffel(q)
    with pytest.raises(al.InputError, match="christoffel: out"):
        arm.christoffel([0.0, 0.0], out=np.empty((2, 2)))
