"""The projection of `Adaptive`: estimates stay physically possible, and the stability proof of Slotine and Li remains valid.

P(pi_hat) >= P_min / 2 at all times,   V1_dot = -s'Kd s - c (pi_hat - pi) . g with c (pi_hat - pi) . g >= 0,   e -> 0

`P` is the pseudo-inertia of a body, `P_min` its lower bound, and `-c g` the correction along the gradient `g`. The *boundary
layer* of a body has all `P` with `P >= P_min / 2` but not `P >= P_min`.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

SHARE = 0.2
"""Lower bound of the bodies in most tests, relative to the true bodies: the part of a data sheet that a user trusts."""


def body(rng: np.random.Generator) -> list[float]:
    """Parameters of six point masses and a small sphere. The pseudo-inertia exceeds that of the lower bound."""
    phi = np.array([0.1, 0, 0, 0, 0.02, 0, 0.02, 0, 0, 0.02])
    for m, x, y, z in np.column_stack([rng.uniform(0.2, 0.4, 6), rng.uniform(-0.3, 0.3, (6, 3))]):
        phi += m * np.array([1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
    return list(phi)


def chain(rng: np.random.Generator, n: int) -> al.Arm:
    joints = [{"type": "R", "axis": list(rng.standard_normal(3)), "xyz": [0.3, 0.0, 0.1], "phi": body(rng)} for _ in range(n)]
    return al.Arm.from_chain(joints, gravity=(0.0, 0.0, -9.81))


def pseudo(pi: Array) -> Array:
    """Pseudo-inertia (..., 4, 4) of parameters (..., 10)."""
    m, hx, hy, hz, xx, xy, yy, xz, yz, zz = np.moveaxis(pi, -1, 0)
    half = (xx + yy + zz) / 2
    rows = [[half - xx, -xy, -xz, hx], [-xy, half - yy, -yz, hy], [-xz, -yz, half - zz, hz], [hx, hy, hz, m]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def shares(estimate: Array, least: Array) -> Array:
    """For every body, the largest k with P(estimate) >= k P(least). The projection guarantees at least 1/2."""
    inverse = np.linalg.inv(np.linalg.cholesky(pseudo(least.reshape(-1, 10))))
    bodies = inverse @ pseudo(estimate.reshape(*estimate.shape[:-1], -1, 10)) @ np.swapaxes(inverse, -1, -2)
    return np.asarray(np.linalg.eigvalsh(bodies)[..., 0], dtype=np.float64)


def sinusoid(n: int) -> al.Sinusoid:
    return al.Sinusoid(np.zeros(n), np.full(n, 0.5), 1.0 + 0.7 * np.arange(n), np.zeros(n))


def gamma_of(form: str, rng: np.random.Generator, p: int) -> Any:
    """A scalar gain, or a full matrix that couples all bodies, with a condition number of about 30."""
    if form == "scalar":
        return 0.05
    root = rng.standard_normal((p, p))
    return 0.1 * (root @ root.T / p + 0.1 * np.eye(p))


STARTS: dict[str, Callable[[al.Arm], Array | None]] = {
    "nothing": lambda arm: None,
    "near the border": lambda arm: 1.1 * SHARE * arm.parameters,
    "negative": lambda arm: -arm.parameters,
    "flat": lambda arm: np.tile([1.0, 0.3, 0, 0, 0, 0, 0.1, 0, 0, 0.1], arm.n),
}


@pytest.mark.parametrize("form", ["scalar", "full"])
@pytest.mark.parametrize("start", STARTS)
def test_bodies_stay_possible_and_the_proof_holds(form: str, start: str) -> None:
    rng = np.random.default_rng(31)
    arm = chain(rng, 3)
    least = SHARE * arm.parameters  # the proof requires that the true parameters exceed the bound
    gamma, estimate = gamma_of(form, rng, 30), STARTS[start](arm)
    options: dict[str, Any] = {"t_end": 10.0, "method": "dop853", "rtol": 1e-9, "atol": 1e-10, "t_eval": np.linspace(0, 10, 201)}
    motion, q0 = sinusoid(3), [0.5, -0.4, 0.3]
    law = al.Adaptive(arm, motion, 30.0, 10.0, gamma, estimate=estimate, projection=least)
    run = al.simulate(al.RigidArm(arm), law, q0, **options)
    assert run.estimate is not None
    # The start is inside, up to rounding. The estimate never leaves the boundary layer, because its inner edge attracts.
    assert np.min(shares(run.estimate[0], least)) > 1.0 - 1e-12
    assert np.min(shares(run.estimate, least)) > 0.5
    assert all(arm.check_parameters(row) for row in run.estimate)
    value, balance = run.monitors["lyapunov"], run.monitors["lyapunov_balance"]
    # The balance is the energy that the projection has dissipated. Both functions are monotone up to the error of the integrator.
    assert np.all(np.diff(value) < 1e-8) and np.all(np.diff(balance) > -1e-7) and value[-1] < value[0] - 0.1
    error = np.abs(run.q - np.array([motion(t)[0] for t in run.t]))
    assert np.max(error[-20:]) < 0.3 * np.max(error[:20])
    # Without the projection the estimate becomes physically impossible.
    free = al.simulate(al.RigidArm(arm), al.Adaptive(arm, motion, 30.0, 10.0, gamma, estimate=run.estimate[0]), q0, **options)
    assert free.estimate is not None and np.min(shares(free.estimate, least)) < 0.0
    assert balance[-1] > 1e-6


def test_inside_the_projection_changes_nothing() -> None:
    """With a small gain and the true parameters as start, no body approaches its bound. So both runs have equal bits."""
    arm = chain(np.random.default_rng(32), 2)
    runs = []
    for projection in (None, 1e-4):
        law = al.Adaptive(arm, sinusoid(2), 30.0, 10.0, 1e-3, estimate=arm.parameters, projection=projection)
        runs.append(al.simulate(al.RigidArm(arm), law, [0.1, 0.2], t_end=1.0, dt=1e-3))
    np.testing.assert_array_equal(runs[0].q, runs[1].q)
    np.testing.assert_array_equal(np.asarray(runs[0].estimate), np.asarray(runs[1].estimate))


@pytest.mark.slow
def test_rows_of_a_batch_are_the_single_runs() -> None:
    """A batch has rows inside and outside of the boundary layer, and laws with different bounds."""
    rng = np.random.default_rng(33)
    arm, trust = chain(rng, 2), rng.uniform(0.2, 0.4, 11)
    starts = rng.uniform(-1.0, 1.0, (11, 1)) * arm.parameters
    least = [k * arm.parameters for k in trust]
    laws = [al.Adaptive(arm, sinusoid(2), 30.0, 10.0, 0.005, estimate=e, projection=b) for e, b in zip(starts, least, strict=True)]
    batch = al.simulate_batch(al.RigidArm(arm), laws, np.zeros((11, 2)), t_end=1.0, dt=1e-4, record_every=500)
    assert batch.estimate is not None
    for i, law in enumerate(laws):
        run = al.simulate(al.RigidArm(arm), law, np.zeros(2), t_end=1.0, dt=1e-4, record_every=500)
        # The rows of the batch agree with single runs up to rounding.
        np.testing.assert_allclose(batch.estimate[i], np.asarray(run.estimate), rtol=0.0, atol=1e-12)
        assert np.min(shares(batch.estimate[i], least[i])) > 0.5


def test_every_kind_of_method_integrates_the_projection() -> None:
    """The rate is Lipschitz-continuous, so adaptive, implicit (exact Jacobians by dual numbers) and sampled loops can integrate it."""
    arm = chain(np.random.default_rng(34), 2)
    least = SHARE * arm.parameters
    law = al.Adaptive(arm, sinusoid(2), 30.0, 10.0, 0.05, projection=least)
    ends = {}
    for method in ("dop853", "radau5", "rodas4"):
        run = al.simulate(al.RigidArm(arm), law, [0.5, -0.4], t_end=3.0, method=method, rtol=1e-8, atol=1e-9)
        assert run.estimate is not None and np.min(shares(run.estimate, least)) > 0.5
        ends[method] = np.concatenate([run.q[-1], run.v[-1], run.estimate[-1]])
    # Where the estimate of a body enters or leaves the boundary layer, its rate has a kink, which reduces the order of the methods. So the
    # tolerance is 100 times `rtol`.
    np.testing.assert_allclose(ends["radau5"], ends["dop853"], atol=1e-6)
    np.testing.assert_allclose(ends["rodas4"], ends["dop853"], atol=1e-6)
    run = al.simulate(al.RigidArm(arm), law, [0.5, -0.4], t_end=3.0, dt=1e-3, sample_time=1e-3)
    assert run.estimate is not None and np.min(shares(run.estimate, least)) > 0.5


def test_the_planar_pr_stays_positive_definite() -> None:
    arm = models.PR
    motion = al.Sinusoid([0.0, 0.3], [0.5, 0.8], [1.0, 1.7], [0.0, 0.0])
    least = np.array([0.2, 0.0, 0.05])
    law = al.Adaptive(arm, motion, [40.0, 20.0], [20.0, 10.0], 5.0, projection=least)
    run = al.simulate(al.RigidArm(arm), law, [0.6, -0.9], t_end=20.0, method="dop853", rtol=1e-10, atol=1e-11)
    assert run.estimate is not None
    A, B, C = run.estimate.T
    # (A, B, C) >= least / 2 as matrices.
    assert np.min(A) > 0.1 and np.min((A - 0.1) * (C - 0.025) - B * B) > 0.0
    value = run.monitors["lyapunov"]
    assert np.all(np.diff(value) < 1e-8) and np.min(np.diff(run.monitors["lyapunov_balance"])) > -1e-8
    assert run.monitors["lyapunov_balance"][-1] > 1e-6  # the projection was active
    assert np.max(np.abs(run.q[-1] - motion(20.0)[0])) < 1e-2


def test_invalid_projections_are_refused_and_valid_ones_stored() -> None:
    arm = chain(np.random.default_rng(35), 2)

    def law(projection: Any, **more: Any) -> al.Adaptive:
        return al.Adaptive(arm, al.Hold([0.0, 0.0]), 10.0, 5.0, 1.0, projection=projection, **more)

    with pytest.raises(al.InputError, match=r"projection has the wrong shape: expected a scalar or \(20,\)"):
        law(np.ones(10))
    with pytest.raises(al.InputError, match=r"projection is not physically possible: .*first bad body 1"):
        law(np.concatenate([arm.parameters[:10], np.zeros(10)]))
    for bad in (0.0, -1.0, np.nan, np.inf, "x", [[1.0]], 1j):
        with pytest.raises(al.InputError, match="projection"):
            law(bad)
    with pytest.raises(al.InputError, match="projection has nothing to do"):
        law(0.01, natural=True, estimate=arm.parameters)
    with pytest.raises(al.InputError, match="projection needs whole bodies"):
        law(0.01, base=arm.base_parameters())
    for given in (0.01, 0.1 * arm.parameters):
        one = law(given)
        again = pickle.loads(pickle.dumps(one))
        assert "projection=" in repr(one)
        state = np.asarray(one.terms(0.0, [0.1, 0.2], [0.3, 0.4], state=-arm.parameters)["estimate_rate"])
        np.testing.assert_array_equal(again.terms(0.0, [0.1, 0.2], [0.3, 0.4], state=-arm.parameters)["estimate_rate"], state)


def test_a_bound_of_a_given_mass_has_a_radius_of_gyration_of_0_141_m() -> None:
    """Without an estimate, the law starts at the lower bound. Its mean square distance from each plane is (0.1 m)^2."""
    arm = models.SIX_AXES
    law = al.Adaptive(arm, al.Hold(np.zeros(6)), 40.0, 20.0, 0.5, projection=0.5)
    bodies = law.terms(0.0, np.zeros(6), np.zeros(6))["state"].reshape(-1, 10)
    np.testing.assert_allclose(bodies[:, 0], 0.5, rtol=1e-12)
    # The moments of inertia I_xx, I_yy and I_zz about the centre are m r^2.
    np.testing.assert_allclose(np.sqrt(bodies[:, [4, 6, 9]] / bodies[:, :1]), 0.1 * np.sqrt(2.0), rtol=1e-12)
