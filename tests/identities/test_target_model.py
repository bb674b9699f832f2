"""The target model of Cartesian impedance along runs: `M_x x'' + (S_x + D_m) x' + K_m (x - x_d) = F`.

`run.monitors["target_balance"]` is its largest residual and `run.monitors["target"]` its largest term, N or N m.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

PLANAR = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], coms=[0.25, 0.2], inertias=[0.0625, 0.027])
SEVEN = models.SEVEN_AXES
# The tolerance is this fraction of the largest value of `target`. The inverse in M_x amplifies rounding.
TOLERANCE = 1e-9


def definite(rng: np.random.Generator, m: int, scale: float) -> Array:
    root = rng.normal(size=(m, m))
    return np.asarray(scale * (root @ root.T / m + np.eye(m)))


def holds(run: Any) -> None:
    target, balance = run.monitors["target"], run.monitors["target_balance"]
    assert target.max() > 1.0 and target.shape == balance.shape == run.t.shape
    assert (balance <= TOLERANCE * target.max()).all()


@pytest.mark.parametrize("n", [2, 3, 4, 7])
@pytest.mark.parametrize("axes", ["xy", "y", "x rz"])
def test_planar_arms_obey_their_target_model(n: int, axes: str) -> None:
    """The target model is valid for square and redundant arms, full gain matrices and a changing force."""
    rng = np.random.default_rng([n, len(axes)])
    arm, frame = al.planar_arm(rng.uniform(0.3, 0.6, n)), f"link{n}"
    m = len(axes.replace("rz", "r").replace(" ", ""))
    q0 = rng.uniform(0.4, 0.9, n)
    pose = {"x": arm.position(q0, frame)[0], "y": arm.position(q0, frame)[1], "r": q0.sum()}
    target = [pose[axis] + 0.05 for axis in axes.replace("rz", "r").replace(" ", "")]
    law = al.CartesianImpedance(arm, target, definite(rng, m, 200.0), definite(rng, m, 30.0), frame=frame, axes=axes)
    push = rng.normal(size=m)
    options: dict[str, Any] = {"t_end": 0.5, "method": "dop853", "force": lambda t: 10.0 * push * np.cos(3.0 * t)}
    holds(al.simulate(al.RigidArm(arm), law, q0, **options))


def test_a_pose_and_a_wrench_at_another_frame() -> None:
    q0 = np.array([0.1, 0.5, 0.1, -1.2, 0.2, 0.6, 0.1])
    law = al.CartesianImpedance(SEVEN, [0.4, 0.2, 0.5, 0.1, 3.0, 0.2], 300.0, 40.0, frame="tcp", axes="xyz rx ry rz")
    elbow = SEVEN.frame_names[4]
    for force in ({"force": [1.0, -2.0, 3.0, 0.1, 0.2, -0.3]}, {"force": [5.0, 1.0, 2.0, 0.0, 0.5, 0.0], "force_frame": elbow}):
        run = al.simulate(al.RigidArm(SEVEN), law, q0, t_end=0.2, dt=1e-3, check_limits=False, **force)
        assert run.monitors["target"].min() > 0.0
        holds(run)


def test_the_monitors_equal_their_definitions() -> None:
    """The monitors equal the equation with `S_x = J^-T C J^-1 - M_x J-dot J^-1`, `J` square, and `x''` from the plant's acceleration."""
    K_m, D_m, x_d, F = np.array([300.0, 200.0]), np.array([40.0, 30.0]), np.array([0.6, 0.4]), np.array([10.0, -15.0])
    law = al.CartesianImpedance(PLANAR, x_d, K_m, D_m, frame="link2", axes="xy")
    run = al.simulate(al.RigidArm(PLANAR), law, [0.3, 1.2], t_end=1.0, dt=1e-2, force=F)
    for k in (0, 30, 100):
        q, v, tau = run.q[k], run.v[k], run.tau[k]
        J, J_dot = PLANAR.jacobian(q, "link2")[:2], PLANAR.jacobian_dot(q, v, "link2")[:2]
        inverse = np.linalg.inv(J)
        M_x = inverse.T @ PLANAR.mass_matrix(q) @ inverse
        S_x = inverse.T @ PLANAR.coriolis_matrix(q, v) @ inverse - M_x @ J_dot @ inverse
        a = PLANAR.forward_dynamics(q, v, tau, wrench=[*F, 0.0, 0.0, 0.0, 0.0], wrench_frame="link2")
        x, x_dot, x_ddot = PLANAR.position(q, "link2")[:2], J @ v, J @ a + J_dot @ v
        terms = np.array([M_x @ x_ddot, S_x @ x_dot, D_m * x_dot, K_m * (x - x_d), F])
        # The terms agree up to rounding.
        assert abs(run.monitors["target"][k] - np.abs(terms).max()) < 1e-11
        assert np.abs(terms[:4].sum(axis=0) - F).max() < 1e-11


def test_a_wrong_model_gives_a_residual() -> None:
    """The law compensates the gravity of a lighter arm. So the residual of the target model is the missing force."""
    lighter = PLANAR.with_parameters(0.9 * PLANAR.parameters)
    law = al.CartesianImpedance(lighter, [0.6, 0.4], 300.0, 40.0, frame="link2", axes="xy")
    run = al.simulate(al.RigidArm(PLANAR), law, [0.3, 1.2], t_end=0.1, dt=1e-3)
    missing = np.linalg.solve(PLANAR.jacobian(run.q[0], "link2")[:2].T, 0.1 * PLANAR.gravity(run.q[0]))
    assert run.monitors["target_balance"][0] == pytest.approx(np.abs(missing).max(), rel=1e-9)


@pytest.mark.parametrize("bend", [0.0, 1e-9, 1e-3, 0.5])
def test_near_singularities_the_model_is_not_defined(bend: float) -> None:
    law = al.CartesianImpedance(PLANAR, [0.6, 0.4], 300.0, 40.0, frame="link2", axes="xy")
    run = al.simulate(al.RigidArm(PLANAR), law, [0.3, bend], t_end=1e-3, dt=1e-3)
    assert (run.monitors["target"][0] > 0.0) == (bend > 0.1)
    assert run.monitors["target_balance"][0] <= TOLERANCE * run.monitors["target"][0]


def test_more_rows_than_joints_have_no_model() -> None:
    law = al.CartesianImpedance(PLANAR, [0.6, 0.4, 0.3], 300.0, 40.0, frame="link2", axes="xy rz")
    run = al.simulate(al.RigidArm(PLANAR), law, [0.3, 1.2], t_end=0.01, dt=1e-3)
    assert not run.monitors["target"].any() and not run.monitors["target_balance"].any()


def test_runs_have_the_monitors_if_the_theory_is_valid() -> None:
    law = al.CartesianImpedance(PLANAR, [0.6, 0.4], 300.0, 40.0, frame="link2", axes="xy")
    wall = al.Wall("link2", point=[0.75, 0.0, 0.0], normal=[-1.0, 0.0, 0.0], stiffness=1e4, damping=50.0)
    plain = al.RigidArm(PLANAR)
    for plant, options, there in (
        (plain, {}, True),
        (plain, {"sample_time": 1e-3}, False),
        (plain, {"tau_max": [90.0, 90.0]}, False),
        (al.RigidArm(PLANAR, wall=wall), {}, False),
        (al.RigidArm(PLANAR, friction=True), {}, False),
    ):
        run = al.simulate(plant, law, [0.3, 1.2], t_end=0.01, dt=1e-3, **options)
        assert ("target_balance" in run.monitors) == there
        assert list(run.monitors)[:3] == ["skewness", "energy", "energy_balance"]


def test_rows_of_a_batch_have_the_monitors_of_their_runs() -> None:
    laws = [al.CartesianImpedance(PLANAR, [0.6, y], 300.0, 40.0, frame="link2", axes="xy") for y in (0.3, 0.4, 0.5)]
    q0, forces = [0.3, 1.2], [[10.0, 0.0], [0.0, -5.0], [3.0, 4.0]]
    options: dict[str, Any] = {"t_end": 0.2, "dt": 1e-3}
    batch = al.simulate_batch(al.RigidArm(PLANAR), laws, [q0] * 3, force=forces, **options)
    for row, (law, force) in enumerate(zip(laws, forces, strict=True)):
        run = al.simulate(al.RigidArm(PLANAR), law, q0, force=force, **options)
        for name in ("target", "target_balance"):
            # A batch and a single run may differ by rounding.
            np.testing.assert_allclose(batch.monitors[name][row], run.monitors[name], rtol=1e-9, atol=1e-10)


Q0 = np.array([0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3])
OPTIONS: dict[str, dict[str, Any]] = {
    "consistent": {"nullspace": "consistent"},
    "static": {"nullspace": "static"},
    "coupling": {"nullspace": "consistent", "compensate_coupling": True},
    "static, coupling": {"nullspace": "static", "compensate_coupling": True, "feedforward": 2.0},
    "integral": {"nullspace": "static", "integral_gain": 50.0, "feedforward": -1.0},
    "coupling alone": {"compensate_coupling": True},
}


def redundant(axes: str, options: dict[str, Any], *, moves: bool, eps: float | None = None) -> al.CartesianImpedance:
    """An impedance law of the seven-axis arm. Its target is the start, or, if `moves`, a motion to a position nearby."""
    m = 3 if axes == "xyz" else 6
    given = dict(options)
    if "nullspace" in given:
        posture = Q0 + np.array([0.5, -0.2, -0.6, 0.2, 0.3, 0.2, -0.4])
        given["nullspace"] = al.NullSpace(al.Quintic(posture, Q0, 0.4), 30.0, 12.0, projection=given["nullspace"])
    if "feedforward" in given:
        given["feedforward"] = np.full(m, given["feedforward"])
    pose = SEVEN.pose_vector(Q0, "tcp")[:m]
    away = np.array([0.05, -0.08, 0.05, 0.1, -0.1, 0.15])[:m]
    target = al.Quintic(pose, pose + away, 0.3) if moves else pose + away
    return al.CartesianImpedance(SEVEN, target, 400.0, 40.0, frame="tcp", axes=axes, eps=eps, **given)


@pytest.mark.parametrize("axes", ["xyz", "xyz rx ry rz"])
@pytest.mark.parametrize("options", OPTIONS)
def test_options_of_redundant_arms_keep_a_target_model(options: str, axes: str) -> None:
    """The target model includes the wrenches of the options in `F`.

    With compensated coupling its inertial term is `M_x (x'' - x_d'')`, and it has no term `S_x x'`.
    """
    plant = al.RigidArm(SEVEN)
    own: dict[str, Any] = {"force": [1.0, 2.0, 3.0, 0.1, 0.2, 0.3][: 3 if axes == "xyz" else 6]}
    for force in (own, {"force": [5.0, 1.0, 2.0, 0.0, 0.5, 0.0], "force_frame": SEVEN.frame_names[4]}):
        for moves in (False, True):
            law = redundant(axes, OPTIONS[options], moves=moves, eps=1e-3)
            run = al.simulate(plant, law, Q0, t_end=0.2, dt=1e-3, check_limits=False, **force)
            assert not run.monitors["loss"].any() if "loss" in run.monitors else "nullspace" not in OPTIONS[options]
            holds(run)


def test_terms_of_the_options_in_the_model() -> None:
    """The model is checked at one time with the law's terms and with `x''` from the acceleration of the plant."""
    for options in OPTIONS.values():
        law = redundant("xyz", options, moves=True)
        run = al.simulate(al.RigidArm(SEVEN), law, Q0, t_end=0.1, dt=1e-3)
        t, q, v, tau = run.t[70], run.q[70], run.v[70], run.tau[70]
        state = {} if run.estimate is None else {"state": run.estimate[70]}
        parts, M = law.terms(t, q, v, **state), SEVEN.mass_matrix(q)
        J, J_dot = SEVEN.jacobian(q, "tcp")[:3], SEVEN.jacobian_dot(q, v, "tcp")[:3]
        spread = J @ np.linalg.inv(M)
        M_x = np.linalg.inv(spread @ J.T)
        x_ddot = J @ SEVEN.forward_dynamics(q, v, tau) + J_dot @ v
        x_d, rate, second = law_target(law, t)
        coupled = bool(options.get("compensate_coupling"))
        S_x_dot = np.zeros(3) if coupled else M_x @ (spread @ SEVEN.coriolis_matrix(q, v) @ v - J_dot @ v)
        F = np.full(3, options.get("feedforward", 0.0)) + (run.estimate[70] if run.estimate is not None else 0.0)
        F = F + M_x @ spread @ parts.get("null_torque", np.zeros(7))
        terms = np.array([M_x @ (x_ddot - second * coupled), S_x_dot, 40.0 * (J @ v - rate), 400.0 * (SEVEN.position(q, "tcp") - x_d), F])
        # The inverse in M_x amplifies rounding.
        assert np.abs(terms[:4].sum(axis=0) - F).max() < 1e-9
        assert run.monitors["target"][70] == pytest.approx(np.abs(terms).max(), abs=1e-9)


def law_target(law: al.CartesianImpedance, t: float) -> tuple[Array, Array, Array]:
    pose = SEVEN.pose_vector(Q0, "tcp")[:3]
    motion = al.Quintic(pose, pose + np.array([0.05, -0.08, 0.05]), 0.3)
    q, v, a = motion(t)
    np.testing.assert_array_equal(law.terms(t, Q0, np.zeros(7))["x_d"], q)
    return q, v, a


def test_limits_and_losses_end_the_model() -> None:
    """A law with limits has no target model. Where the clamp acts, the model is not defined, and the loss is recorded."""
    plant = al.RigidArm(SEVEN)
    limited = redundant("xyz", OPTIONS["consistent"] | {"wrench_max": 500.0}, moves=False)
    run = al.simulate(plant, limited, Q0, t_end=0.01, dt=1e-3)
    assert list(run.monitors) == ["skewness", "energy", "energy_balance", "loss"]
    law = redundant("xyz", OPTIONS["coupling"], moves=False, eps=0.9)
    run = al.simulate(plant, law, Q0, t_end=0.05, dt=1e-3)
    assert (run.monitors["loss"] > 0.0).all() and not run.monitors["target"].any()
    # The clamp changes the torque: a law with smaller eps has another torque in the same state.
    exact = redundant("xyz", OPTIONS["coupling"], moves=False)
    assert np.abs(law(0.0, run.q[-1], run.v[-1]) - exact(0.0, run.q[-1], run.v[-1])).max() > 1e-3


@pytest.mark.parametrize("projection", ["consistent", "static"])
def test_the_loss_along_a_run(projection: str) -> None:
    """The target leaves the workspace, so the arm stretches.

    The recorded loss equals that of the law's terms, in single runs and batches.
    """
    start = SEVEN.position(Q0, "tcp")
    out = al.Quintic(start, start + 1.5 * (start - np.array([0.0, 0.0, 0.3])), 0.5)
    posture = al.NullSpace(Q0, 30.0, 12.0, projection=projection)  # type: ignore[arg-type]
    laws = [
        al.CartesianImpedance(SEVEN, out, 400.0, 60.0, frame="tcp", nullspace=posture, eps=0.1),
        al.CartesianImpedance(SEVEN, out, 400.0, 60.0, frame="tcp"),
    ]
    options: dict[str, Any] = {"t_end": 1.0, "dt": 1e-3, "record_every": 50, "check_limits": False}
    run = al.simulate(al.RigidArm(SEVEN), laws[0], Q0, **options)
    wanted = [float(laws[0].terms(t, q, v)["loss"]) for t, q, v in zip(run.t, run.q, run.v, strict=True)]
    np.testing.assert_allclose(run.monitors["loss"], wanted, rtol=0.0, atol=1e-12)
    assert wanted[0] == 0.0 and max(wanted) > 0.1
    batch = al.simulate_batch(al.RigidArm(SEVEN), laws[0], [Q0, Q0], **options)
    np.testing.assert_allclose(batch.monitors["loss"], [run.monitors["loss"]] * 2, atol=1e-8)
    # A law without a posture has no loss, so the two laws have different monitors.
    with pytest.raises(al.InputError, match=r"law mixes structures: expected the monitors .*loss in all runs"):
        al.simulate_batch(al.RigidArm(SEVEN), laws, [Q0, Q0], **options)
    assert "loss" not in al.simulate(al.RigidArm(SEVEN), laws[1], Q0, **options).monitors
    K_J, B = np.full(7, 3000.0), np.full(7, 0.5)
    for more in ({}, {"tau_max": 200.0}):
        elastic = al.ElasticImpedance(SEVEN, out, 400.0, 60.0, K_J, B, 0.1, frame="tcp", nullspace=posture, eps=0.9, **more)
        run = al.simulate(al.ElasticArm(SEVEN, K_J, B), elastic, Q0, **options)
        assert ("passivity" in run.monitors) == (not more) and run.theta is not None
        last = elastic.terms(1.0, run.q[-1], run.v[-1], theta=run.theta[-1], theta_dot=run.v[-1])["loss"]
        assert run.monitors["loss"].min() > 0.0 and run.monitors["loss"][-1] == pytest.approx(float(last), abs=1e-12)
