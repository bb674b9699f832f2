"""Batches whose rows differ in structure: a row has what a single run has, or the batch is refused by name."""

from __future__ import annotations

import itertools
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armlet as al

ARM = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], inertias=[0.3, 0.2])
PHI = [2, 0.4, 0, 0, 0.02, 0, 0.2, 0, 0, 0.2]
LINK = {"type": "R", "phi": PHI}
LIMITED = al.Arm.from_chain([LINK | {"lower": -1.0, "upper": 1.0, "damping": 0.5, "friction": 0.2}, LINK | {"xyz": [0.5, 0, 0]}])
HOLD = al.PDGravity(ARM, [0.3, 0.7], 20.0, 4.0)
WALL = al.Wall("link2", [0.7, 0, 0], [-1, 0, 0], stiffness=1e3, damping=5.0)
POSTURE = al.NullSpace([0.3, 0.5], 1.0, 1.0)
GUARD: dict[str, Any] = {"reaction": "stop", "stiffness": 100.0, "damping": 5.0}


def impedance(**more: Any) -> al.CartesianImpedance:
    return al.CartesianImpedance(ARM, **({"target": [0.6], "stiffness": 300.0, "damping": 10.0, "frame": "link2", "axes": "x"} | more))


def stack(*tasks: Any, **more: Any) -> al.PriorityAcceleration:
    return al.PriorityAcceleration(ARM, list(tasks), **more)


X, Y, XY = al.Task("link2", "x", [0.6], 9.0), al.Task("link2", "y", [0.4], 9.0), al.Task("link2", "xy", [0.6, 0.4], 9.0)
PLANTS = {
    "plain": al.RigidArm(LIMITED),
    "dry friction": al.RigidArm(LIMITED, friction=True),
    "LuGre": al.RigidArm(LIMITED, friction=al.LuGre(coulomb=1.0, stiffness=300.0, damping=2.0)),
    "wall": al.RigidArm(LIMITED, wall=WALL),
    "another wall": al.RigidArm(LIMITED, wall=al.Wall("link1", [0.3, 0, 0], [-1, 0, 0], stiffness=1e3, damping=5.0)),
    "stops": al.RigidArm(LIMITED, stops=al.JointStops(1e3, 5.0, lower=-0.1, upper=0.2)),
    "without limits": al.RigidArm(ARM),
}
IMPEDANCES = {
    "plain": impedance(),
    "null space": impedance(nullspace=POSTURE),
    "coupling": impedance(compensate_coupling=True),
    "limited": impedance(tau_max=5.0),
    "another axis": impedance(axes="y"),
    "another frame": impedance(target=[0.4], frame="link1", axes="y"),
    "no position": impedance(target=[0.4], axes="rz"),
}
STACKS = {
    "one": stack(XY),
    "with posture": stack(X, al.PostureTask([0.1, 0.2], 5.0)),
    "two": stack(X, Y),
    "clamp": stack(XY, method="clamp"),
}
TRACKERS = {
    "target": al.PID(ARM, [0.3, 0.7], 20.0, 5.0, 4.0),
    "motion": al.PID(ARM, al.Quintic([0.0, 0.4], [0.3, 0.7], 0.5), 20.0, 5.0, 4.0),
}
GUARDS = {
    "hold": al.Guarded(HOLD, al.MomentumObserver(ARM, 20.0, threshold=5.0)),
    "another threshold": al.Guarded(HOLD, al.MomentumObserver(ARM, 30.0, threshold=9.0)),
    "no threshold": al.Guarded(HOLD, al.MomentumObserver(ARM, 20.0)),
    "impedance": al.Guarded(impedance(), al.MomentumObserver(ARM, 20.0, threshold=5.0)),
    "reaction": al.Guarded(HOLD, al.MomentumObserver(ARM, 20.0, threshold=5.0), **GUARD),
}
KINDS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "plants": (PLANTS, {"law": HOLD}),
    "impedances": (IMPEDANCES, {"plant": PLANTS["plain"]}),
    "stacks": (STACKS, {"plant": PLANTS["plain"]}),
    "trackers": (TRACKERS, {"plant": PLANTS["plain"]}),
    "guards": (GUARDS, {"plant": PLANTS["plain"]}),
}
CLOCKS: dict[str, dict[str, Any]] = {
    "rk4": {"dt": 1e-3},
    "sampled": {"dt": 1e-3, "sample_time": 1e-3},
    "dop853": {"method": "dop853", "t_eval": np.linspace(0.0, 0.03, 4)},
}
FIELDS = (
    "q",
    "v",
    "tau",
    "friction",
    "bristles",
    "estimate",
    "contact_force",
    "position_error",
    "orientation_error",
    "target",
    "parameters",
)
FIELDS += ("residual", "touched", "contact_state")
Q0 = [0.1, 0.4]


def same_row(row: al.Run, run: al.Run, fields: tuple[str, ...] = FIELDS) -> None:
    for name in fields:
        got, expected = getattr(row, name), getattr(run, name)
        assert (got is None) == (expected is None), name
        if expected is not None:
            # A row and a single run may differ by rounding, which these loops do not amplify.
            np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-9, err_msg=name)
    assert (row.limits is None) == (run.limits is None) and list(row.monitors) == list(run.monitors)
    for name, values in run.monitors.items():
        np.testing.assert_allclose(row.monitors[name], values, rtol=1e-6, atol=1e-8, err_msg=name)
    found, expected = row.metrics(), run.metrics()
    assert list(found) == list(expected)
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-6, atol=1e-8, err_msg=name)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # some rows start outside of limits or fall below their observer's noise
@pytest.mark.parametrize("monitors", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_a_row_is_a_single_run_or_the_batch_is_refused(kind: str, monitors: bool, tmp_path: Path) -> None:
    varied, fixed = KINDS[kind]
    ran = 0
    for a, b in itertools.permutations(varied, 2):
        given = {"plant": "plant", "law": "law"} | fixed
        place = "law" if "plant" in fixed else "plant"
        both = [varied[a], varied[b]]
        for clock in CLOCKS.values():
            options = clock | {"t_end": 0.03, "monitors": monitors}
            if "reaction" in (a, b) and "sample_time" not in clock:
                continue  # this law alone requires a sample time
            try:
                batch = al.simulate_batch(**(given | {place: both}), q0=[Q0, Q0], **options)
            except al.InputError as error:
                assert f": {place} " in str(error) and "(first bad index 1)" in str(error), (a, b, str(error))
                continue
            ran += 1
            batch.save(tmp_path / "batch.npz")
            stored, pickled = al.load(tmp_path / "batch.npz"), pickle.loads(pickle.dumps(batch))
            for i in range(2):
                run = al.simulate(**(given | {place: both[i]}), q0=Q0, **options)
                for each in (batch, stored, pickled):
                    assert isinstance(each, al.BatchRun)
                    same_row(each[i], run)
            try:
                summed = al.simulate_batch(**(given | {place: both}), q0=[Q0, Q0], **options, keep="metrics").metrics()
            except al.InputError as error:
                # Metrics have one number per task with a position.
                assert "wrong number of tasks with a position" in str(error)
                continue
            for name, values in batch.metrics().items():
                np.testing.assert_allclose(summed[name], values, rtol=1e-9, atol=1e-9, err_msg=name)
    assert ran


def test_different_levels_are_refused_by_name() -> None:
    with pytest.raises(
        al.InputError, match=r"law mixes structures: expected the monitors .*error_1.* got .*error_2.* \(first bad index 1\)"
    ):
        al.simulate_batch(PLANTS["plain"], [STACKS["one"], STACKS["with posture"]], [Q0, Q0], t_end=0.01, dt=1e-3)
    with pytest.raises(al.InputError, match="wrong number of tasks with a position: expected 1, got 2"):
        al.simulate_batch(PLANTS["plain"], [STACKS["one"], STACKS["two"]], [Q0, Q0], t_end=0.01, dt=1e-3, monitors=False, keep="metrics")
    batch = al.simulate_batch(PLANTS["plain"], [STACKS["one"], STACKS["two"]], [Q0, Q0], t_end=0.01, dt=1e-3, monitors=False)
    for i, law in enumerate((STACKS["one"], STACKS["two"])):
        same_row(batch[i], al.simulate(PLANTS["plain"], law, Q0, t_end=0.01, dt=1e-3, monitors=False))


def test_the_first_bad_row_counts_from_the_start_of_the_batch() -> None:
    """With progress a batch runs in pieces of 64 rows."""
    laws = [IMPEDANCES["plain"]] * 70 + [IMPEDANCES["null space"]] + [IMPEDANCES["plain"]] * 9
    with pytest.raises(al.InputError, match=r"law mixes structures.*\(first bad index 70\)"):
        al.simulate_batch(PLANTS["plain"], laws, [Q0] * 80, t_end=0.01, dt=1e-3, progress=lambda done, runs: None)


def test_arms_with_different_numbers_of_bodies(tmp_path: Path) -> None:
    """The second arm has a mimic joint, so it has one joint and two bodies."""
    link = {"type": "R", "phi": [1, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}
    arms = [al.Arm.from_chain([link]), al.Arm.from_chain([link, link | {"xyz": [0.5, 0, 0], "mimic": {"joint": 0}}])]
    plants, laws = [al.RigidArm(arm) for arm in arms], [al.PDGravity(arm, [0.5], 20.0, 4.0) for arm in arms]
    batch = al.simulate_batch(plants, laws, [[0.0], [0.0]], t_end=0.1, dt=1e-3)
    assert batch.parameters is not None and batch.parameters.shape == (2, 20)
    np.testing.assert_array_equal(np.isnan(batch.parameters).sum(axis=1), [10, 0])
    batch.save(tmp_path / "batch.npz")
    for each in (batch, al.load(tmp_path / "batch.npz"), pickle.loads(pickle.dumps(batch))):
        for i in range(2):
            same_row(each[i], al.simulate(plants[i], laws[i], [0.0], t_end=0.1, dt=1e-3))


def test_rows_with_other_joints_or_frames_of_the_force_are_refused() -> None:
    slide = al.Arm.from_chain([LINK, LINK | {"type": "P"}])
    with pytest.raises(al.InputError, match=r"plant mixes types of joints.*\(first bad index 1\)"):
        al.simulate_batch([al.RigidArm(ARM), al.RigidArm(slide)], HOLD, [Q0, Q0], t_end=0.01, dt=1e-3)
    laws = [IMPEDANCES["another frame"], IMPEDANCES["another axis"]]
    options: dict[str, Any] = {"t_end": 0.01, "dt": 1e-3, "force": [5.0]}
    with pytest.raises(al.InputError, match=r"force_frame is missing.*different ones \(first bad index 1\)"):
        al.simulate_batch(PLANTS["plain"], laws, [Q0, Q0], **options)
    options |= {"force": [5.0, 0.0, 0.0], "force_frame": "link2"}
    batch = al.simulate_batch(PLANTS["plain"], laws, [Q0, Q0], **options)
    for i, law in enumerate(laws):
        np.testing.assert_allclose(batch.q[i], al.simulate(PLANTS["plain"], law, Q0, **options).q, rtol=0.0, atol=1e-12)
