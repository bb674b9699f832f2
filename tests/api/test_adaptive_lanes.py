"""Batches of adaptive runs compute one run per lane. Each row has the bits of a single run, whatever its lane and the other rows are."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

T_END = 0.6
METHODS = ("dopri5", "dop853")


def chain(rng: np.random.Generator, n: int) -> al.Arm:
    """A random chain with revolute joints, and a prismatic joint in the middle."""
    joints: list[dict[str, Any]] = []
    for k in range(n):
        mass, com, inertia = rng.uniform(0.5, 2.0), rng.uniform(-0.1, 0.1, 3), np.diag(rng.uniform(0.02, 0.05, 3))
        inertia = inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))
        phi = [mass, *(mass * com), *(inertia[i, j] for i, j in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))]
        kind = "P" if n > 1 and k == n // 2 else "R"
        axis, rpy, xyz = rng.normal(size=3), rng.uniform(-2.0, 2.0, 3), rng.uniform(-0.3, 0.3, 3)
        joints.append({"type": kind, "axis": axis.tolist(), "rpy": rpy.tolist(), "xyz": xyz.tolist(), "phi": phi})
    return al.Arm.from_chain(joints)


def moving(rng: np.random.Generator, n: int) -> al.Motion:
    return al.Sinusoid(rng.uniform(-0.5, 0.5, n), rng.uniform(0.0, 0.4, n), rng.uniform(1.0, 4.0, n), rng.uniform(0.0, 6.0, n))


def require_rows_of_single_runs(plant: Any, law: Any, q0: Array, v0: Array, **options: Any) -> Any:
    """Require that each row of the batch has the bits of a single run, and return the batch."""
    batch = al.simulate_batch(plant, law, q0, v0=v0, **options)
    for i in range(len(q0)):
        one = [each[i] if isinstance(each, list) else each for each in (plant, law)]
        run = al.simulate(one[0], one[1], q0[i], v0=v0[i], throw=False, **options)
        assert run.status == batch.status[i]
        records = len(run.t)
        row = batch[i]
        pairs = [(name, getattr(row, name), getattr(run, name)) for name in ("q", "v", "tau", "estimate", "theta", "theta_dot")]
        pairs += [(name, row.monitors[name], run.monitors[name]) for name in run.monitors]
        for name, ours, theirs in pairs:
            if theirs is None or (name.startswith("theta") and not isinstance(one[0], al.ElasticArm)):
                continue
            np.testing.assert_array_equal(ours[:records], theirs, err_msg=f"row {i}, {name}")
            assert np.isnan(ours[records:]).all()
    return batch


def start(rng: np.random.Generator, rows: int, n: int) -> tuple[Array, Array]:
    return rng.uniform(-1.0, 1.0, (rows, n)), rng.uniform(-1.0, 1.0, (rows, n))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("n", "rows"), [(1, 4), (2, 19), (3, 9), (5, 8), (7, 11)])
def test_rows_of_random_loops(method: str, n: int, rows: int) -> None:
    """Loops of all sizes, with constant and moving targets. Some runs end while others wait for a lane."""
    rng = np.random.default_rng([n, rows])
    arm = chain(rng, n)
    q0, v0 = start(rng, rows, n)
    still = al.PDGravity(arm, rng.uniform(-0.5, 0.5, n), 20.0, 4.0)
    adaptive = al.Adaptive(arm, moving(rng, n), 20.0, 8.0, 0.5)
    times = np.sort(rng.uniform(0.0, T_END, 6))
    for law, t_eval in ((still, times), (adaptive, np.array([0.0, *times])), (still, np.array([T_END]))):
        for rtol in (1e-4, 1e-9):
            batch = require_rows_of_single_runs(al.RigidArm(arm), law, q0, v0, t_end=T_END, method=method, rtol=rtol, t_eval=t_eval)
            assert np.all(batch.status == al.Status.SUCCESS)


@pytest.mark.parametrize("method", METHODS)
def test_rows_of_different_loops(method: str) -> None:
    """Arms, gains and motions differ between rows, so that rows have several structures and step sizes."""
    rng = np.random.default_rng(7)
    arms = [chain(rng, 3), chain(rng, 3)]
    plants = [al.RigidArm(arms[k % 2]) for k in range(23)]
    laws = [al.ComputedTorque(arms[k % 2], moving(rng, 3), rng.uniform(10.0, 2000.0), 10.0) for k in range(23)]
    q0, v0 = start(rng, 23, 3)
    require_rows_of_single_runs(plants, laws, q0, v0, t_end=T_END, method=method, t_eval=np.linspace(0.0, T_END, 5))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sampling", [0.05, al.Sampling(0.04, delay=0.02)], ids=["held", "late"])
def test_rows_of_sampled_loops(method: str, sampling: Any) -> None:
    rng = np.random.default_rng(8)
    arm = models.TWO_LINKS
    q0, v0 = start(rng, 10, 2)
    law = al.ComputedTorque(arm, moving(rng, 2), 100.0, 20.0)
    options: dict[str, Any] = {"t_end": T_END, "method": method, "t_eval": [0.1, 0.23, 0.6], "sample_time": sampling}
    require_rows_of_single_runs(al.RigidArm(arm), law, q0, v0, **options)


@pytest.mark.parametrize("method", METHODS)
def test_rows_with_stops_and_friction(method: str) -> None:
    """Contacts and stick-slip friction change modes at times that differ between the lanes."""
    rng = np.random.default_rng(9)
    arm = al.planar_arm([0.5, 0.4], gravity=(0.0, 0.0))
    law = al.PDGravity(arm, [0.9, 0.0], 60.0, 2.0)
    q0, v0 = start(rng, 12, 2)
    stops = al.JointStops([2e3, 1e3], [20.0, 10.0], lower=[-0.5, -0.2], upper=[0.6, 1.4])
    for plant in (al.RigidArm(arm, stops=stops), al.RigidArm(arm, friction=al.StickSlip(coulomb=[4.0, 2.0]))):
        require_rows_of_single_runs(plant, law, 0.3 * q0, v0, t_end=T_END, method=method, t_eval=np.linspace(0.0, T_END, 9))


@pytest.mark.parametrize("method", METHODS)
def test_rows_of_elastic_arms(method: str) -> None:
    """Rows with their own forces. The force jumps, and every jump begins a segment."""
    rng = np.random.default_rng(12)
    arm = models.TWO_LINKS
    law = al.ElasticImpedance(arm, [0.6, 0.3], 200.0, 30.0, 500.0, 0.5, 0.2, frame="link2", axes="xy")
    q0, v0 = start(rng, 6, 2)
    options: dict[str, Any] = {"t_end": T_END, "method": method, "t_eval": [0.2, 0.5], "force": [(0.1, [3.0, 1.0]), (0.35, [0.0, -2.0])]}
    require_rows_of_single_runs(al.ElasticArm(arm, 500.0, 0.5), law, q0, v0, **options)


@pytest.mark.parametrize("method", METHODS)
def test_rows_that_fail(method: str) -> None:
    """A row that diverges, and a row whose angle exceeds the range of the programs' sines. The other rows keep their bits."""
    arm = models.TWO_LINKS
    rng = np.random.default_rng(10)
    q0, v0 = start(rng, 12, 2)
    q0[4], v0[7, 0], q0[9, 1] = 9.999e5, 1e7, 1.2e6
    law = al.PDGravity(arm, [0.3, 0.2], 20.0, 4.0)
    options: dict[str, Any] = {"t_end": T_END, "method": method, "t_eval": [0.3, T_END], "state_limit": 2e7, "rtol": 1e-6}
    batch = require_rows_of_single_runs(al.RigidArm(arm), law, q0, v0, **options)
    clean = np.setdiff1d(np.arange(12), [4, 7, 9])
    others = al.simulate_batch(al.RigidArm(arm), law, q0[clean], v0=v0[clean], **options)
    np.testing.assert_array_equal(batch.q[clean], others.q)


@pytest.mark.parametrize("keep", ["final", "metrics"])
def test_rows_of_summaries(keep: Any) -> None:
    """A summary of a row does not depend on its lane, on the other rows or on the number of threads."""
    rng = np.random.default_rng(11)
    arm = chain(rng, 4)
    q0, v0 = start(rng, 37, 4)
    law = al.PDGravity(arm, np.zeros(4), 20.0, 4.0)
    options: dict[str, Any] = {"t_end": T_END, "method": "dop853", "keep": keep}
    whole = al.simulate_batch(al.RigidArm(arm), law, q0, v0=v0, threads=3, **options)
    order = rng.permutation(37)
    mixed = al.simulate_batch(al.RigidArm(arm), law, q0[order], v0=v0[order], threads=1, **options)
    few = [al.simulate_batch(al.RigidArm(arm), law, q0[i : i + 1], v0=v0[i : i + 1], **options) for i in (0, 20)]
    for name in ("q", "v", "tau"):
        np.testing.assert_array_equal(getattr(mixed, name), getattr(whole, name)[order])
        np.testing.assert_array_equal(np.concatenate([getattr(each, name) for each in few]), getattr(whole, name)[[0, 20]])
    if keep == "metrics":
        for name, values in whole.metrics().items():
            np.testing.assert_array_equal(mixed.metrics()[name], values[order], err_msg=name)
            np.testing.assert_array_equal(few[1].metrics()[name][0], values[20], err_msg=name)
