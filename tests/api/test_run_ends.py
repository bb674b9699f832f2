"""Ends of runs: a state beyond `state_limit` or a monitor that is not finite is a failure; a balance that is not zero is a warning."""

from __future__ import annotations

import pickle
import warnings
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = al.planar_arm([1.0, 1.0])
PLANT = al.RigidArm(ARM)
# This loop is stable in continuous time, but strongly unstable with steps of 0.5 s.
LAW = al.PDGravity(ARM, [1.0, 0.5], kp=100.0, kd=20.0)
COARSE: dict[str, Any] = {"t_end": 1.0, "dt": 0.5}
FREE = al.PDGravity(al.planar_arm([1.0, 1.0], gravity=(0.0, 0.0)), [0.0, 0.0], kp=1e-9, kd=1e-9)
FLYING = al.RigidArm(al.planar_arm([1.0, 1.0], gravity=(0.0, 0.0)))


def test_nonsense_is_no_success() -> None:
    with pytest.raises(al.SolveError, match=r"diverged: .*state_limit") as caught:
        al.simulate(PLANT, LAW, [0.0, 0.0], **COARSE)
    assert caught.value.status is al.Status.DIVERGED and caught.value.t == 0.5
    assert caught.value.partial.t.tolist() == [0.0]
    batch = al.simulate_batch(PLANT, LAW, np.zeros((3, 2)), **COARSE)
    assert batch.status.tolist() == [al.Status.DIVERGED] * 3 and batch.stats["ended"].tolist() == [0.5] * 3
    assert np.isfinite(batch.q[:, 0]).all() and np.isnan(batch.q[:, 1:]).all() and np.isnan(batch.monitors["energy"][:, 1:]).all()


@pytest.mark.parametrize("method", ["euler", "semi_implicit", "rk4", "ros2", "dopri5", "dop853", "radau5", "rodas4"])
def test_the_limit_is_the_callers(method: str) -> None:
    """The run ends at the first step after which a position or a velocity exceeds `state_limit`."""
    steps = {"dt": 1e-3} if method in ("euler", "semi_implicit", "rk4", "ros2") else {}
    with pytest.raises(al.SolveError) as caught:
        al.simulate(FLYING, FREE, [0.0, 0.0], v0=[2.0, 0.0], t_end=2.0, method=method, state_limit=2.5, **steps)  # type: ignore[arg-type]
    run, t = caught.value.partial, caught.value.t
    assert caught.value.status is al.Status.DIVERGED and len(run.t) and t is not None
    assert np.abs(run.q).max() <= 2.5 and np.abs(run.v).max() <= 2.5 and run.t[-1] <= t < 2.0
    if steps:
        # With fixed steps, the last record is one step before the time of the error.
        assert run.t[-1] == pytest.approx(t - 1e-3, abs=1e-12)
    full = al.simulate(FLYING, FREE, [0.0, 0.0], v0=[2.0, 0.0], t_end=2.0, method=method, state_limit=np.inf, **steps)  # type: ignore[arg-type]
    assert full.status is al.Status.SUCCESS and max(np.abs(full.q).max(), np.abs(full.v).max()) > 2.5


LEARNING = al.Adaptive(models.PR, al.Hold([1.0, 0.5]), 40.0, 20.0, 5.0)


@pytest.mark.parametrize(
    ("plant", "law", "extra"),
    [(PLANT, LAW, {}), (al.RigidArm(models.PR), LEARNING, {}), (al.RigidArm(models.PR), LEARNING, {"monitors": False})],
)
@pytest.mark.parametrize("bad", [0, 3, 8])
def test_neighbours_keep_their_bits(plant: Any, law: Any, extra: dict[str, Any], bad: int) -> None:
    q0 = np.random.default_rng(1).uniform(-0.3, 0.3, (9, 2))
    v0 = np.zeros((9, 2))
    options = {"t_end": 0.3, "dt": 2e-3, "record_every": 7, "state_limit": 30.0} | extra
    sound = al.simulate_batch(plant, law, q0, v0=v0, **options)
    v0[bad] = 29.999
    q0[bad] = 29.999  # continues at 30 rad/s or m/s and exceeds the limit within the first steps
    batch = al.simulate_batch(plant, law, q0, v0=v0, **options)
    others = np.arange(9) != bad
    assert batch.status[bad] == al.Status.DIVERGED and (batch.status[others] == al.Status.SUCCESS).all()
    assert np.isnan(batch.q[bad, 1:]).all() and np.isfinite(batch.q[bad, 0]).all()
    assert np.array_equal(batch.q[others], sound.q[others]) and np.array_equal(batch.tau[others], sound.tau[others])


def test_motors_are_bounded_too() -> None:
    plant = al.ElasticArm(ARM, 1e3, 0.1)
    law = al.MotorPD(ARM, [0.0, 0.0], 10.0, 1.0, joint_stiffness=1e3)
    with pytest.raises(al.SolveError):
        al.simulate(plant, law, [0.0, 0.0], theta_dot0=[7.0, 0.0], t_end=0.1, dt=1e-4, state_limit=6.0)


def test_a_start_beyond_the_limit() -> None:
    for extra in ({"dt": 1e-2}, {"method": "dop853"}):
        with pytest.raises(al.SolveError) as caught:
            al.simulate(PLANT, LAW, [1e7, 0.0], t_end=0.1, **extra)  # type: ignore[arg-type]
        assert caught.value.t == 0.0 and len(caught.value.partial.t) == 0


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_invalid_state_limits_are_refused(value: float) -> None:
    for call in (
        lambda: al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.1, dt=1e-2, state_limit=value),
        lambda: al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), t_end=0.1, dt=1e-2, state_limit=value),
        lambda: al.Simulator(PLANT, LAW, [0.0, 0.0], dt=1e-2, state_limit=value),
    ):
        with pytest.raises(al.InputError, match="state_limit is not positive: expected > 0, got"):
            call()


@pytest.mark.parametrize("extra", [{"dt": 1e-3}, {"method": "dop853", "t_eval": [0.0, 0.05, 0.1]}])
def test_a_monitor_that_is_not_finite_ends_the_run(extra: dict[str, Any]) -> None:
    """The state is finite and small, but the energy overflows."""
    heavy = al.planar_arm([1.0, 1.0], masses=[1e308, 1e308], gravity=(0.0, -9.81))
    law = al.PDGravity(heavy, [0.0, 0.0], kp=1e-3, kd=1e-3)
    options = {"v0": [1e5, 0.0], "t_end": 0.1} | extra
    with pytest.raises(al.SolveError) as caught:
        al.simulate(al.RigidArm(heavy), law, [0.0, 0.0], **options)
    assert caught.value.status is al.Status.DIVERGED and caught.value.t == 0.0
    batch = al.simulate_batch(al.RigidArm(heavy), law, [[0.0, 0.0]], **options | {"v0": [[1e5, 0.0]]})
    assert batch.status.tolist() == [al.Status.DIVERGED] and np.isnan(batch.q).all()


def test_a_balance_that_does_not_close_is_warned_of() -> None:
    """The steps are unstable here, but in these few steps the state does not reach the limit."""
    with pytest.warns(UserWarning, match=r"simulate: the energy balance does not close: .* J are missing.*reduce dt") as warned:
        run = al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.12, dt=0.04, state_limit=np.inf)
    assert run.status is al.Status.SUCCESS and __file__ == warned[0].filename
    found = al.metrics(run)
    assert found["energy_error"] > 0.1 and found["completed"] == 1.0 and "energy_error" in str(found)
    with pytest.warns(UserWarning, match=r"simulate_batch: the energy balance does not close in 2 of 2 runs \(first bad index 0\)"):
        al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), t_end=0.12, dt=0.04, state_limit=np.inf)
    with pytest.warns(UserWarning, match="does not close in 2 of 2 runs"):
        batch = al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), t_end=0.12, dt=0.04, state_limit=np.inf, keep="metrics")
    assert batch.metrics()["energy_error"].tolist() == [float(found["energy_error"])] * 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fine = al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.12, dt=1e-3)
        assert al.metrics(fine)["energy_error"] < 1e-6
        al.simulate(PLANT, al.PDGravity(ARM, [0.0, 0.0], 10.0, 1.0), [0.0, 0.0], t_end=0.1, dt=1e-2)  # at rest, with rounding only
        al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.5, dt=1e-3, method="euler")


def test_a_lyapunov_function_that_rises_is_warned_of() -> None:
    with pytest.warns(UserWarning) as warned:
        al.simulate(al.RigidArm(models.PR), LEARNING, [0.0, 0.0], t_end=0.3, dt=0.3)
    assert any("Lyapunov function rises" in str(each.message) for each in warned)


def test_metrics_say_that_a_run_did_not_end() -> None:
    run = al.simulate(PLANT, LAW, [0.0, 0.0], **COARSE, throw=False)
    found = al.metrics(run)
    assert found["completed"] == 0.0 and np.isnan(found["error_final"]).all() and np.isnan(found["energy_error"])
    batch = al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), **COARSE, keep="metrics")
    assert batch.metrics()["completed"].tolist() == [0.0, 0.0]


def test_scenarios_report_both() -> None:
    data = {
        "arm": {"kind": "planar_arm", "lengths": [1.0, 1.0]},
        "law": {"kind": "PDGravity", "target": [1.0, 0.5], "kp": 100.0, "kd": 20.0},
        "run": {"q0": [0.0, 0.0], "t_end": 0.12, "dt": 0.04, "state_limit": 1e300},
    }
    with pytest.warns(UserWarning, match="energy balance does not close"):
        al.Scenario(data).run()
    with pytest.raises(al.SolveError, match="diverged"):
        al.Scenario(data).replace({"run.state_limit": 2.0}).run()
    table = al.sweep(al.Scenario(data), vary={"law.kd": [20.0, 0.1]})
    assert table["status"].tolist() == [0, 0] and table["energy_error"][0] > 0.1 and table["completed"].tolist() == [1.0, 1.0]


class TestSimulator:
    def test_a_diverging_step_raises(self) -> None:
        sim = al.Simulator(PLANT, LAW, [0.0, 0.0], dt=0.5)
        assert sim.status is al.Status.SUCCESS
        with pytest.raises(al.SolveError, match=r"^Simulator.step: the step from t = 0 s on diverges: .*state_limit") as caught:
            sim.step()
        error = caught.value
        assert error.status is al.Status.DIVERGED and error.t == 0.0 and error.partial["q"].tolist() == [0.0, 0.0]
        # Neither this step nor any later step is taken.
        assert sim.status is al.Status.DIVERGED and sim.t == 0.0 and sim.q.tolist() == sim.v.tolist() == [0.0, 0.0]
        with pytest.raises(al.SolveError):
            sim.step([0.0, 0.0])
        sim.set_state([0.1, 0.2], [0.0, 0.0])
        assert sim.status is al.Status.SUCCESS
        sim.step([0.0, 0.0])
        assert sim.t == 0.5
        with pytest.raises(al.SolveError):
            for _ in range(100):
                sim.step()
        assert np.isfinite(sim.q).all() and np.abs(sim.q).max() < 1e6
        sim.reset()
        assert sim.status is al.Status.SUCCESS and sim.t == 0.0

    def test_a_law_that_gives_nan(self) -> None:
        sim = al.Simulator(PLANT, None, [0.0, 0.0], dt=1e-3)
        with pytest.raises(al.InputError, match="tau is not finite"):
            sim.step([np.nan, 0.0])
        assert sim.status is al.Status.SUCCESS
        sim = al.Simulator(PLANT, None, [0.0, 0.0], dt=1e-3, state_limit=1.0)
        with pytest.raises(al.SolveError):
            for _ in range(1000):
                sim.step([100.0, 0.0])
        assert np.abs([sim.q, sim.v]).max() <= 1.0 and sim.t > 0.0

    def test_a_simulator_diverges_at_the_same_time_as_simulate(self) -> None:
        options: dict[str, Any] = {"dt": 2e-2, "v0": [2.0, 0.0], "state_limit": 2.5}
        with pytest.raises(al.SolveError) as caught:
            al.simulate(FLYING, FREE, [0.0, 0.0], t_end=2.0, **options)
        sim = al.Simulator(FLYING, FREE, [0.0, 0.0], **options)
        with pytest.raises(al.SolveError) as stepped:
            for _ in range(1000):
                sim.step()
        assert stepped.value.t == pytest.approx(caught.value.t - 2e-2)
        # The recording loop and the loop of single steps differ by rounding.
        assert np.abs(sim.q - caught.value.partial.q[-1]).max() < 1e-12

    @pytest.mark.parametrize("method", ["rk4", "euler", "semi_implicit", "ros2"])
    def test_a_force_of_one_step(self, method: str) -> None:
        """A force that acts from 10 ms to 30 ms, as an argument of the steps and as an argument of `simulate`."""
        arm = al.load_urdf(al.example_urdf("planar_2r"))
        law = al.CartesianImpedance(arm, [0.5, 0.3], 300.0, 40.0, frame="tool", axes="xz")
        push = [20.0, -10.0]
        run = al.simulate(al.RigidArm(arm), law, [0.3, 0.8], t_end=0.05, dt=1e-3, method=method,
                          force=[(0.0, [0.0, 0.0]), (0.01, push), (0.03, [0.0, 0.0])])  # fmt: skip
        sim = al.Simulator(al.RigidArm(arm), law, [0.3, 0.8], dt=1e-3, method=method)
        for k in range(50):
            sim.step(force=push if 10 <= k < 30 else None)
        # The times of both loops are sums of steps that round differently.
        assert np.abs(sim.q - run.q[-1]).max() < 1e-12
        free = al.simulate(al.RigidArm(arm), law, [0.3, 0.8], t_end=0.05, dt=1e-3, method=method)
        assert np.abs(sim.q - free.q[-1]).max() > 1e-4

    def test_where_a_force_acts(self) -> None:
        arm = al.load_urdf(al.example_urdf("planar_2r"))
        q = [0.3, 0.8]
        sim = al.Simulator(al.RigidArm(arm), None, q, dt=1e-6, force_frame="tool")
        force = np.array([1.0, 2.0, 3.0])
        sim.step(arm.gravity(q), force=force)
        a = arm.forward_dynamics(q, [0.0, 0.0], arm.gravity(q) + arm.jacobian(q, "tool")[:3].T @ force)
        assert np.allclose(sim.v / 1e-6, a, rtol=1e-4)
        for bad, message in (([1.0], "wrong shape"), ([np.nan, 0.0, 0.0], "not finite")):
            with pytest.raises(al.InputError, match=f"^Simulator.step: force .*{message}"):
                sim.step([0.0, 0.0], force=bad)
        with pytest.raises(al.InputError, match="force has no frame to act at"):
            al.Simulator(PLANT, LAW, [0.0, 0.0], dt=1e-3).step(force=[1.0, 0.0, 0.0])

    def test_set_state(self) -> None:
        sim = al.Simulator(PLANT, LAW, [0.0, 0.0], dt=1e-3)
        for _ in range(5):
            sim.step()
        sim.set_state([0.3, -0.2], [1.0, 2.0])
        assert sim.t == pytest.approx(5e-3) and sim.q.tolist() == [0.3, -0.2] and sim.v.tolist() == [1.0, 2.0]
        other = al.Simulator(PLANT, LAW, [0.3, -0.2], v0=[1.0, 2.0], dt=1e-3)
        for _ in range(5):
            sim.step()
            other.step()
        assert np.array_equal(sim.q, other.q)
        for bad in ([0.0], [np.inf, 0.0]):
            with pytest.raises(al.InputError, match=r"^Simulator.set_state: q "):
                sim.set_state(bad, [0.0, 0.0])
        elastic = al.Simulator(al.ElasticArm(ARM, 1e3, 0.1), None, [0.0, 0.0], dt=1e-4)
        elastic.set_state([0.3, -0.2], [1.0, 2.0])
        assert np.allclose(1e3 * (elastic.theta - elastic.q), ARM.gravity([0.3, -0.2]))  # type: ignore[operator]
        assert elastic.theta_dot is not None and elastic.theta_dot.tolist() == [1.0, 2.0]

    def test_motors_are_set_too(self) -> None:
        plant = al.ElasticArm(ARM, 1e3, 0.1)
        law = al.MotorPD(ARM, [0.2, 0.1], 10.0, 1.0, joint_stiffness=1e3)
        sim = al.Simulator(plant, law, [0.0, 0.0], dt=1e-4)
        sim.step()
        state: dict[str, Any] = {"theta": [0.4, -0.1], "theta_dot": [0.5, 0.6]}
        sim.set_state([0.3, -0.2], [1.0, 2.0], **state)
        assert sim.theta.tolist() == [0.4, -0.1] and sim.theta_dot.tolist() == [0.5, 0.6]  # type: ignore[union-attr]
        for _ in range(20):
            sim.step()
        run = al.simulate(plant, law, [0.3, -0.2], v0=[1.0, 2.0], theta0=state["theta"], theta_dot0=state["theta_dot"], t_end=2e-3, dt=1e-4)
        # The law does not depend on time, so equal states give equal steps.
        assert np.array_equal(sim.q, run.q[-1]) and np.array_equal(sim.theta, run.theta[-1])  # type: ignore[arg-type, index]
        with pytest.raises(al.InputError, match=r"^Simulator.set_state: theta_dot is not finite"):
            sim.set_state([0.0, 0.0], [0.0, 0.0], theta_dot=[np.nan, 0.0])
        with pytest.raises(al.InputError, match=r"^Simulator.set_state: theta is not used: expected None for"):
            al.Simulator(PLANT, LAW, [0.0, 0.0], dt=1e-3).set_state([0.0, 0.0], [0.0, 0.0], theta=[0.0, 0.0])

    def test_the_state_of_the_law_is_set_too(self) -> None:
        """A loop that continues from the state of another loop gives the same bits.

        The state of a law includes its integral, its estimate with filters, its observer and its contact.
        """
        watch = al.MomentumObserver(ARM, 50.0, threshold=0.5)
        retract = {"stiffness": 100.0, "damping": 20.0, "speed": 0.3, "duration": 0.5}
        inner = al.PID(ARM, [0.4, 0.1], 60.0, 30.0, 10.0, derivative_filter=200.0, observer_bandwidth=10.0)
        laws: list[Any] = [
            inner,
            al.Adaptive(ARM, al.Hold([0.4, 0.1]), 60.0, 20.0, 1.0, composite=1.0),
            al.Guarded(inner, watch, "retract", **retract),
        ]
        for law in laws:
            options: dict[str, Any] = {"dt": 1e-3, "sample_time": 1e-3, "force": [8.0, -9.0, 0.0], "force_frame": "link2"}
            first = al.Simulator(PLANT, law, [0.3, 0.5], **options)
            for _ in range(60):
                first.step()
            second = al.Simulator(PLANT, law, [0.0, 0.0], **options)
            second.set_state(first.q, first.v, estimate=first.estimate)
            assert np.array_equal(second.estimate, first.estimate)  # type: ignore[arg-type]
            for sim in (first, second):
                for _ in range(40):
                    sim.step()
            assert np.array_equal(first.q, second.q) and np.array_equal(first.estimate, second.estimate)  # type: ignore[arg-type]
            # A law with a reset state gives a different torque.
            second.reset(first.q, first.v)
            second.step()
            first.step()
            assert np.abs(first.q - second.q).max() > 1e-9
            for bad, problem in ([[0.0]], "has the wrong shape"), (np.full(first.estimate.shape, np.nan), "is not finite"):  # type: ignore[union-attr]
                with pytest.raises(al.InputError, match=f"^Simulator.set_state: estimate {problem}"):
                    second.set_state(first.q, first.v, estimate=bad)
        with pytest.raises(al.InputError, match=r"^Simulator.set_state: estimate is not used: expected None for a law without a state"):
            al.Simulator(PLANT, LAW, [0.0, 0.0], dt=1e-3).set_state([0.0, 0.0], [0.0, 0.0], estimate=[0.0])

    def test_the_fastest_joint_is_named(self) -> None:
        options: dict[str, Any] = {"dt": 1e-2, "v0": [0.0, 2.0], "state_limit": 2.5}
        with pytest.raises(al.SolveError, match=r"the fastest joint before it: v\[[01]\] = ") as caught:
            sim = al.Simulator(FLYING, FREE, [0.0, 0.0], **options)
            for _ in range(1000):
                sim.step()
        with pytest.raises(al.SolveError, match=r"the fastest joint at the last record, t = .* s: v\[[01]\] = ") as ended:
            al.simulate(FLYING, FREE, [0.0, 0.0], t_end=10.0, **options)
        assert caught.value.t is not None and ended.value.t == pytest.approx(caught.value.t + 1e-2)
        i = int(np.abs(sim.v).argmax())
        assert f"v[{i}] = {sim.v[i]:.4f}" in str(caught.value) and f"v[{i}] = {sim.v[i]:.4g}" in str(ended.value)

    @pytest.mark.parametrize("method", ["euler", "semi_implicit", "rk4", "ros2"])
    @pytest.mark.parametrize("sample_time", [None, 2e-3])
    def test_steps_have_the_bits_of_the_run(self, method: str, sample_time: float | None) -> None:
        """Steps of a `Simulator` have the bits of a run, for laws without task priority."""
        elastic = al.MotorPD(ARM, [0.2, 0.1], 10.0, 1.0, joint_stiffness=1e3)
        loops: list[tuple[Any, Any]] = [
            (PLANT, al.ComputedTorque(ARM, al.Quintic([0.3, 0.5], [0.6, 0.1], 0.2), 100.0, 20.0)),
            (PLANT, al.Adaptive(ARM, al.Hold([0.1, 0.2]), 40.0, 20.0, 2.0)),
            (PLANT, al.CartesianImpedance(ARM, [1.2, 0.8], 100.0, 20.0, frame="link2", axes="xy")),
            (al.ElasticArm(ARM, 1e3, 0.1), elastic),
        ]
        for plant, law in loops:
            options: dict[str, Any] = {"dt": 1e-3, "method": method, "sample_time": sample_time}
            # A step that ends at t_end, or where the motion jumps, differs from dt by rounding.
            run = al.simulate(plant, law, [0.3, 0.5], t_end=0.052, monitors=False, **options)
            sim = al.Simulator(plant, law, [0.3, 0.5], **options)
            for k in range(50):
                sim.step()
                assert sim.q.tobytes() == run.q[k + 1].tobytes() and sim.v.tobytes() == run.v[k + 1].tobytes()

    def test_pickles_after_a_fault(self) -> None:
        sim = al.Simulator(PLANT, LAW, [0.0, 0.0], dt=0.5)
        with pytest.raises(al.SolveError) as caught:
            sim.step()
        assert pickle.loads(pickle.dumps(caught.value)).status is al.Status.DIVERGED
        assert np.array_equal(pickle.loads(pickle.dumps(sim)).q, sim.q)


class TestUnusedArguments:
    """An argument that the method does not use is refused."""

    @pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5", "rodas4"])
    def test_dt(self, method: str) -> None:
        options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3, "method": method, "t_eval": [0.1]}
        with pytest.raises(al.InputError, match=rf"^simulate: dt is not used: expected None for {method}, .* got 0\.001"):
            al.simulate(PLANT, LAW, [0.0, 0.0], **options)
        with pytest.raises(al.InputError, match=r"^simulate_batch: dt is not used"):
            al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), **options)

    @pytest.mark.parametrize("method", ["euler", "semi_implicit", "rk4", "ros2"])
    @pytest.mark.parametrize("name", ["rtol", "atol"])
    def test_tolerances(self, method: str, name: str) -> None:
        options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3, "method": method, name: 1e-8}
        with pytest.raises(al.InputError, match=rf"^simulate: {name} is not used: expected None for {method}, .* got 1e-08"):
            al.simulate(PLANT, LAW, [0.0, 0.0], **options)
        with pytest.raises(al.InputError, match=rf"^simulate_batch: {name} is not used"):
            al.simulate_batch(PLANT, LAW, np.zeros((2, 2)), **options)

    def test_stats_contain_the_options_in_effect(self) -> None:
        fixed = al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.01, dt=1e-3)
        assert fixed.stats["dt"] == 1e-3 and "rtol" not in fixed.stats
        assert al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.01, sample_time=2e-3).stats["dt"] == 2e-3
        adaptive = al.simulate(PLANT, LAW, [0.0, 0.0], t_end=0.01, method="dop853", rtol=1e-6)
        assert (adaptive.stats["rtol"], adaptive.stats["atol"]) == (1e-6, 1e-10) and "dt" not in adaptive.stats

    def test_scenarios(self) -> None:
        data = {
            "arm": {"kind": "planar_arm", "lengths": [1.0, 1.0]},
            "law": {"kind": "PDGravity", "target": [1.0, 0.5], "kp": 100.0, "kd": 20.0},
            "run": {"q0": [0.0, 0.0], "t_end": 0.1, "dt": 1e-3, "rtol": 1e-6},
        }
        with pytest.raises(al.InputError, match=r"\$\.run\.rtol: is not used"):
            al.Scenario(data).run()


def test_monitors_of_prioritised_accelerations() -> None:
    """The monitors are the energy of the plant, and error and residual of every level, as the pages describe."""
    arm = models.SEVEN_AXES
    q0 = np.array([0.0, 0.6, 0.1, -1.4, 0.2, 0.9, 0.0])
    tip = arm.position(q0, "tcp")
    law = al.PriorityAcceleration(arm, [al.Task("tcp", "xyz", tip + np.array([0.05, 0.0, 0.02]), 100.0), al.PostureTask(q0, 4.0)])
    run = al.simulate(al.RigidArm(arm), law, q0, t_end=0.05, dt=1e-3, record_every=10)
    assert list(run.monitors) == ["skewness", "energy", "energy_balance", "error_1", "residual_1", "error_2", "residual_2"]
    for k, t in enumerate(run.t):
        terms = law.terms(float(t), run.q[k], run.v[k])
        for level in (1, 2):
            e, residual = terms["e"][level - 1], terms["residuals"][level - 1]
            assert run.monitors[f"error_{level}"][k] == pytest.approx(np.linalg.norm(e), rel=1e-9, abs=1e-12)
            assert run.monitors[f"residual_{level}"][k] == pytest.approx(np.linalg.norm(residual), rel=1e-9, abs=1e-9)
    assert np.abs(run.monitors["energy_balance"]).max() < 1e-6 * np.abs(run.monitors["energy"]).max()
    batch = al.simulate_batch(al.RigidArm(arm), law, q0[None], t_end=0.05, dt=1e-3, record_every=10)
    assert np.allclose(batch.monitors["error_1"][0], run.monitors["error_1"], atol=1e-12)
