"""Theorems about elastic joints under motor-inertia reduction, checked on random arms, targets and forces.

B0 theta_ddot + D0 w + tau_J = u;  dE/dt = F.x_dot - theta_dot'D0 w - x_dot'D_m x_dot + (theta_dot - v).u
x_E = x_d + K_m^-1 F,  tau_E = g(q_E) - J'F
"""

from __future__ import annotations

import warnings
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

K_J, B = np.array([800.0, 500.0]), np.array([0.4, 0.25])
PLANAR = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], coms=[0.25, 0.2], inertias=[0.0625, 0.027])
PLANT = al.ElasticArm(PLANAR, K_J, B)
TIGHT: dict[str, Any] = {"method": "dop853", "rtol": 1e-12, "atol": 1e-12}


def positive(rng: np.random.Generator, n: int, scale: float) -> Array:
    half = rng.normal(size=(n, n))
    return np.asarray(scale * (half @ half.T / n + np.eye(n)))


def impedance(target: Any, reduced: Any = 0.05 * B, **options: Any) -> al.ElasticImpedance:
    return al.ElasticImpedance(PLANAR, target, [300.0, 200.0], [40.0, 30.0], K_J, B, reduced, frame="link2", axes="xy", **options)


def seven_axis() -> al.Arm:
    return models.SEVEN_AXES


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3, 7])
def test_the_motors_feel_like_the_reduced_ones(n: int, relative: bool) -> None:
    """With the law's tau, the motors B theta_ddot + tau_J = tau obey B0 theta_ddot + D0 w + tau_J = u, also for full matrices.

    `w` is theta_dot, or theta_dot - v with relative damping.
    """
    rng = np.random.default_rng(10 * n + relative)
    arm = al.planar_arm([0.4] * n)
    K, inertia, reduced, D0 = (positive(rng, n, scale) for scale in (500.0, 0.3, 0.02, 4.0))
    law = al.ElasticImpedance(
        arm, [0.3], 200.0, 20.0, K, inertia, reduced, frame=f"link{n}", axes="x", motor_damping=D0, relative_damping=relative
    )
    q, v, theta, theta_dot = rng.normal(size=(4, n))
    terms = law.terms(0.0, q, v, theta=theta, theta_dot=theta_dot)
    spring = K @ (theta - q)
    theta_ddot = np.linalg.solve(inertia, terms["tau"] - spring)
    w = theta_dot - v if relative else theta_dot
    scale = np.abs(reduced @ theta_ddot).max() + np.abs(terms["u"]).max()
    # The tolerance covers rounding in the solution of two linear systems.
    np.testing.assert_allclose(reduced @ theta_ddot + D0 @ w + spring, terms["u"], rtol=0.0, atol=1e-12 * scale)
    np.testing.assert_allclose(law(0.0, q, v, theta=theta, theta_dot=theta_dot), terms["tau"], rtol=1e-12)
    np.testing.assert_allclose(terms["tau_J"], spring, rtol=1e-13)


@pytest.mark.parametrize("ratio", [0.3, 1.0])
def test_damping_gives_every_mode_its_ratio(ratio: float) -> None:
    rng = np.random.default_rng(5)
    K, reduced = positive(rng, 3, 500.0), positive(rng, 3, 0.02)
    law = al.ElasticImpedance(
        al.planar_arm([0.3] * 3), [0.3, 0.3], 200.0, 20.0, K, 0.3, reduced, frame="link3", axes="xy", damping_ratio=ratio
    )
    D0 = law.terms(0.0, np.ones(3), np.zeros(3), theta=np.ones(3), theta_dot=np.zeros(3))["D0"]
    # Rounding changes a double root by the square root of eps. So the characteristic equation is checked instead of the roots.
    np.testing.assert_allclose(D0 @ np.linalg.solve(reduced, D0), 4.0 * ratio**2 * K, rtol=1e-11, atol=1e-11 * np.abs(K).max())
    np.testing.assert_allclose(al.damping_from_ratio(reduced, K, ratio), D0, rtol=1e-12)


@pytest.mark.parametrize("case", ["step", "relative", "moving", "wall", "far force"])
def test_the_energy_balances(case: str) -> None:
    """E(t) - E(0) is the integral of its rate, to 1e-8 of the largest E."""
    wall = al.Wall("link2", [0.53, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=2000.0, damping=20.0)
    plant = al.ElasticArm(PLANAR, K_J, B, wall=wall) if case == "wall" else PLANT
    law: al.Law = impedance([0.5, 0.55], relative_damping=case == "relative")
    if case == "moving":
        motion = al.Sinusoid([0.5, 0.4], [0.05, 0.1], [3.0, 2.0], [0.0, 1.0])
        law = al.ElasticTracking(PLANAR, motion, 300.0, 30.0, K_J, B, 0.05 * B, frame="link2", axes="xy")
    options: dict[str, Any] = {"force": [(0.0, [15.0, -5.0]), (0.5, [0.0, 8.0])]}
    if case == "far force":
        options = {"force": [3.0, 9.0, 0.0], "force_frame": "link1"}
    run = al.simulate(plant, law, [0.3, 1.2], v0=[0.4, -0.3], t_end=1.0, t_eval=np.linspace(0.0, 1.0, 201), **options, **TIGHT)
    assert set(run.monitors) == {"skewness", "energy", "energy_balance", "torque_error", "passivity"}
    energy = run.monitors["energy"]
    assert np.ptp(energy) > 0.1
    if case == "wall":
        assert float(np.max(np.asarray(PLANAR.position(run.q, "link2"))[:, 0])) > 0.5301
    # The balance is at most 3e-13 J. The wall has a larger tolerance, because the force of a damped wall jumps at contact.
    share = 1e-6 if case == "wall" else 1e-8
    assert np.abs(run.monitors["energy_balance"]).max() <= share * energy.max()


@pytest.mark.parametrize("friction", [[0.0, 0.0], [2.0, 1.5]])
def test_the_plants_energy_where_the_law_does_not_know_the_plant(friction: list[float]) -> None:
    """The law assumes a different stiffness. The energy balance is that of the plant's energy, so it is zero nevertheless."""
    plant = al.ElasticArm(PLANAR, 0.9 * K_J, B, joint_damping=[0.5, 0.5], motor_friction=friction)
    run = al.simulate(plant, impedance([0.5, 0.55]), [0.3, 1.2], t_end=0.5, t_eval=[0.0, 0.2, 0.5], force=[15.0, -5.0], **TIGHT)
    assert set(run.monitors) == {"skewness", "energy", "energy_balance", "torque_error"}
    assert run.tau is not None and run.theta_dot is not None
    kinetic, potential = PLANAR.energy(run.q[0], run.v[0])
    spring = 0.9 * K_J * (np.asarray(run.theta)[0] - run.q[0])
    assert abs(run.monitors["energy"][0] - kinetic - potential - 0.5 * spring @ (spring / (0.9 * K_J))) < 1e-12
    assert np.abs(run.monitors["energy_balance"]).max() <= 1e-8 * np.abs(run.monitors["energy"]).max()


def test_passivity_and_torque_error_are_what_they_say() -> None:
    law = impedance([0.5, 0.55])
    times = np.linspace(0.0, 1.0, 4001)
    F = np.array([15.0, -5.0])
    run = al.simulate(PLANT, law, [0.3, 1.2], t_end=1.0, t_eval=times, force=F, **TIGHT)
    assert run.theta is not None and run.theta_dot is not None
    x = np.asarray(PLANAR.position(run.q, "link2"))[:, :2]
    through_the_port = (x - x[0]) @ F
    energy = run.monitors["energy"]
    np.testing.assert_allclose(run.monitors["passivity"], through_the_port - (energy - energy[0]), atol=1e-9)
    for k in (0, 40, 4000):
        parts = law.terms(times[k], run.q[k], run.v[k], theta=run.theta[k], theta_dot=run.theta_dot[k])
        assert abs(run.monitors["torque_error"][k] - np.abs(parts["tau_J"] - parts["u"]).max()) < 1e-12


def test_rest_for_random_targets_and_forces() -> None:
    rng = np.random.default_rng(3)
    for _ in range(6):
        q_d, F = rng.uniform([-1.0, 0.7], [1.0, 1.8]), rng.uniform(-20.0, 20.0, 2)
        target = np.asarray(PLANAR.position(q_d, "link2"))[:2]
        law = impedance(target)
        rest = al.equilibrium(PLANT, law, F, q0=q_d)
        wanted = target + F / [300.0, 200.0]
        assert rest.reachable and not rest.spurious and rest.stable and rest.theta is not None
        np.testing.assert_allclose(rest.x, wanted, atol=1e-12)
        load = np.asarray(PLANAR.jacobian(rest.q, "link2"))[:2].T @ F
        np.testing.assert_allclose(rest.tau, np.asarray(PLANAR.gravity(rest.q)) - load, atol=1e-12)
        np.testing.assert_allclose(K_J * (rest.theta - rest.q), rest.tau, atol=1e-11)
        # The run ends at the equilibrium. The rightmost eigenvalue is the slowest mode.
        t_end = 25.0 / -float(rest.eigenvalues.real.max())
        run = al.simulate(PLANT, law, q_d, t_end=t_end, t_eval=[t_end], force=F, **TIGHT)
        assert run.tau is not None
        np.testing.assert_allclose(run.q[-1], rest.q, atol=1e-8)
        np.testing.assert_allclose(run.tau[-1], rest.tau, atol=1e-5)


def test_eigenvalues_are_those_of_the_run() -> None:
    """A small deviation along the slowest eigenvector decays with its eigenvalue."""
    law = impedance([0.5, 0.55])
    rest = al.equilibrium(PLANT, law, q0=[0.3, 1.2])
    assert rest.theta is not None
    slowest = float(rest.eigenvalues.real.max())
    run = al.simulate(PLANT, law, rest.q + np.array([1e-4, 0.0]), theta0=rest.theta, t_end=8.0, t_eval=[6.0, 8.0], **TIGHT)
    ratio = np.linalg.norm(run.q[1] - rest.q) / np.linalg.norm(run.q[0] - rest.q)
    # After 6 s faster modes and products of deviations change the measured rate by 1e-5 of its value.
    assert abs(np.log(ratio) / 2.0 - slowest) < 1e-3 * abs(slowest)


def test_a_redundant_arm_rests() -> None:
    arm = seven_axis()
    plant = al.ElasticArm(arm, 10_000.0, 1.0)
    q_d = np.array([0.2, 0.5, -0.3, 1.2, 0.4, -0.8, 0.1])
    frame = arm.frame_names[-1]
    law = al.ElasticImpedance(arm, arm.position(q_d, frame), 500.0, 60.0, 10_000.0, 1.0, 0.2, frame=frame)
    F = np.array([10.0, -5.0, 8.0])
    rest = al.equilibrium(plant, law, F, q0=q_d)
    np.testing.assert_allclose(rest.x, arm.position(q_d, frame) + F / 500.0, atol=1e-12)
    assert rest.stable and not rest.spurious and rest.eigenvalues.shape == (28,)
    # Four directions of position are free, and the motors do not hold a position.
    assert int(np.sum(np.abs(rest.eigenvalues) < 1e-6 * np.abs(rest.eigenvalues).max())) >= 4


def test_rigid_arms_and_joint_laws_rest_too() -> None:
    law = al.CartesianImpedance(PLANAR, [0.5, 0.55], [300.0, 200.0], [40.0, 30.0], frame="link2", axes="xy")
    rest = al.equilibrium(al.RigidArm(PLANAR), law, [9.0, -8.0], q0=[0.3, 1.2])
    np.testing.assert_allclose(rest.x, [0.53, 0.51], atol=1e-12)
    assert rest.theta is None and rest.stable and rest.eigenvalues.shape == (4,)
    joint = al.JointImpedance(PLANAR, [0.3, 1.2], 100.0, 10.0, K_J, B, 0.05 * B)
    pushed = al.equilibrium(PLANT, joint, [9.0, -8.0, 0.0], q0=[0.3, 1.2], force_frame="link2")
    load = np.asarray(PLANAR.jacobian(pushed.q, "link2"))[:3].T @ [9.0, -8.0, 0.0]
    np.testing.assert_allclose(100.0 * (pushed.q - [0.3, 1.2]), load, atol=1e-11)
    assert pushed.stable and not pushed.spurious


@pytest.mark.parametrize("name", ["desired", "online", "state feedback", "joint impedance"])
def test_regulation(name: str) -> None:
    """Under every law of joint positions the arm comes to rest at its target. The torque there balances gravity."""
    target = np.array([0.6, 0.9])
    laws = {
        "desired": al.MotorPD(PLANAR, target, 150.0, 25.0, K_J),
        "online": al.MotorPD(PLANAR, target, 150.0, 25.0, K_J, online=True),
        "state feedback": al.StateFeedback(PLANAR, target, 200.0, 20.0, 1.0, 0.02, K_J),
        "joint impedance": al.JointImpedance(PLANAR, target, 150.0, 20.0, K_J, B, 0.05 * B),
    }
    run = al.simulate(PLANT, laws[name], [0.0, 0.4], t_end=20.0, t_eval=[0.0, 20.0], **TIGHT)
    assert run.tau is not None and run.theta is not None
    np.testing.assert_allclose(run.q[-1], target, atol=1e-9)
    np.testing.assert_allclose(run.tau[-1], PLANAR.gravity(target), atol=1e-7)
    np.testing.assert_allclose(run.theta[-1], target + np.asarray(PLANAR.gravity(target)) / K_J, atol=1e-9)


def test_error_to_the_rigid_target() -> None:
    """The deviation from the motion of the rigid arm is O(sqrt(B0)) if D0 decreases with B0.

    It does not converge to zero if D0 is fixed. With B0 = B/16, damping of theta_dot - v gives less than a tenth of the deviation that
    damping of theta_dot gives.
    """
    times = np.linspace(0.0, 0.5, 501)
    options: dict[str, Any] = {"t_end": 0.5, "t_eval": times, "force": [10.0, -15.0], "method": "dop853", "rtol": 1e-9, "atol": 1e-11}
    target = np.asarray(PLANAR.position([0.3, 1.2], "link2"))[:2]
    rigid = al.CartesianImpedance(PLANAR, target, [300.0, 200.0], [40.0, 30.0], frame="link2", axes="xy")
    goal = PLANAR.position(al.simulate(al.RigidArm(PLANAR), rigid, [0.3, 1.2], **options).q, "link2")

    def distance(share: float, **how: Any) -> float:
        run = al.simulate(PLANT, impedance(target, share * B, **how), [0.3, 1.2], monitors=False, **options)
        return float(np.linalg.norm(PLANAR.position(run.q, "link2") - goal, axis=1).max())

    tied = [distance(share) for share in (1 / 16, 4.0**-3, 4.0**-7, 4.0**-8)]
    order = np.log(tied[2] / tied[3]) / np.log(4.0)
    assert 0.45 <= order <= 0.5
    assert 0.2 <= np.log(tied[0] / tied[1]) / np.log(4.0) <= 0.4
    fixed = [distance(share, motor_damping=2.0 * np.sqrt(0.05 * B * K_J)) for share in (1 / 16, 4.0**-5)]
    assert abs(fixed[1] / fixed[0] - 1.0) < 0.02
    assert distance(1 / 16, relative_damping=True) < tied[0] / 10.0


@pytest.mark.parametrize("share", [0.02, 0.3, 1.0])
def test_the_sampled_loop_grows_beyond_its_limit(share: float) -> None:
    """The links are too heavy to move. So the loop becomes unstable at the sample time beyond which armlet refuses to run it."""
    arm = al.planar_arm([1.0], masses=[1e12], gravity=(0.0, 0.0))
    stiffness, inertia = 800.0, 0.4
    plant = al.ElasticArm(arm, stiffness, inertia)
    law = al.JointImpedance(arm, [0.0], 1.0, 1.0, stiffness, inertia, share * inertia)
    limit = al.elastic_limits(plant, law, q0=[0.0]).sample_time_max
    D0 = 2.0 * np.sqrt(share * inertia * stiffness)

    def same(t: float, q: Array, v: Array, theta: Array, theta_dot: Array) -> Array:
        # The stability check does not apply to a Python function, so the loop can run beyond the limit.
        spring = stiffness * (theta - q)
        return np.asarray(spring + (-q - v - D0 * theta_dot - spring) / share)

    def growth(law: Any, period: float) -> float:
        """Growth of the motor's deviation over the last 100 of 400 samples."""
        options: dict[str, Any] = {"dt": period / 8, "sample_time": period, "record_every": 8, "monitors": False}
        run = al.simulate(plant, law, [0.0], theta0=[1e-3], t_end=400 * period, **options)
        assert run.theta is not None
        return float(np.abs(run.theta[-20:]).max() / np.abs(run.theta[-120:-100]).max())

    assert growth(same, 1.01 * limit) > 1.2
    assert growth(same, 0.99 * limit) < 0.8
    with pytest.warns(UserWarning, match="above a third"):
        assert growth(law, 0.99 * limit) < 0.8
    with pytest.raises(al.InputError, match="sample_time is too large") as caught:
        growth(law, 1.01 * limit)
    said = float(str(caught.value).split("below ")[1].split(" s,")[0])
    assert 0.99999 * limit < said <= limit
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        growth(law, 0.3 * limit)


def test_a_stable_sample_time_is_accepted_and_an_unstable_one_refused_in_every_run() -> None:
    """With B0 = B and little damping, the held damping torque acts with the sign of sin(w dt). So the loop is stable again for
    2 pi < w dt < 3 pi, with w = sqrt(K_J/B)."""
    arm = al.planar_arm([1.0], masses=[1e12], gravity=(0.0, 0.0))
    stiffness, inertia, damping = 800.0, 0.4, 0.5
    w = np.sqrt(stiffness / inertia)
    plant = al.ElasticArm(arm, stiffness, inertia)

    def law(motor_damping: float, share: float = 1.0) -> al.JointImpedance:
        return al.JointImpedance(arm, [0.0], 1.0, 1.0, stiffness, inertia, share * inertia, motor_damping=motor_damping)

    def simulate(law: Any, period: float) -> Any:
        options: dict[str, Any] = {"dt": period / 8, "sample_time": period, "record_every": 8, "monitors": False}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if isinstance(law, list):
                rows = {"theta0": [[1e-3]] * len(law), "keep": "all"}
                return al.simulate_batch(plant, law, [[0.0]] * len(law), t_end=400 * period, **options, **rows)
            return al.simulate(plant, law, [0.0], t_end=400 * period, theta0=[1e-3], **options)

    assert abs(al.elastic_limits(plant, law(damping), q0=[0.0]).sample_time_max * w / np.pi - 1.0) < 0.1
    theta = simulate(law(damping), 2.5 * np.pi / w).theta
    assert np.abs(theta[-20:]).max() < 0.8 * np.abs(theta[:20]).max()
    with pytest.raises(al.InputError, match="sample_time is too large"):
        simulate(law(damping), 1.5 * np.pi / w)
    # The rule is the same for each run of a batch. The error names the run.
    assert simulate([law(damping), law(1.1 * damping)], 2.5 * np.pi / w).theta.shape[0] == 2
    with pytest.raises(al.InputError, match=r"sample_time is too large .*index 1"):
        simulate([law(damping), law(80.0 * damping)], 2.5 * np.pi / w)
    # Almost without damping, the loop is unstable at every sample time.
    with pytest.raises(al.InputError, match="expected a loop that is stable at short sample times"):
        simulate(law(1e-9, share=0.5), 1e-3)


def test_maps_broadcast() -> None:
    dt, zeta = np.array([[5e-4], [1e-3], [2e-3]]), np.array([0.5, 0.7, 1.0, 2.0])
    fastest = al.smallest_reduced_inertia(0.4, 800.0, dt, damping_ratio=zeta)
    assert fastest.shape == (3, 4)
    # For B0 << B the rule is B0 = K_J (dt / min(4 zeta, 1/zeta))^2, as a function of zeta.
    rule = 800.0 * (dt / np.minimum(4 * zeta, 1 / zeta)) ** 2
    np.testing.assert_allclose(fastest, rule, rtol=0.05)
    # A slow sensor reduces the damping of a weakly damped loop. A fast sensor has no effect.
    bandwidth = np.array([2000.0, 1e6])
    lag = al.smallest_reduced_inertia(0.4, 800.0, dt, damping_ratio=0.3, sensor_bandwidth=bandwidth)
    none = al.smallest_reduced_inertia(0.4, 800.0, dt, damping_ratio=0.3)
    assert lag.shape == (3, 2) and np.all(lag[:, 0] > 1.1 * none[:, 0])
    np.testing.assert_allclose(lag[:, 1], none[:, 0], rtol=0.02)
