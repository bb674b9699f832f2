"""Steps at jumps of motion and force, and steps in which a Python function raises: `Simulator` has the motion of `simulate`."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

ARM = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], inertias=[0.3, 0.2])
PLANT = al.RigidArm(ARM)
HOLD = al.PDGravity(ARM, [0.3, 0.5], 60.0, 10.0)
PUSH = [(0.0, [0.0, 0.0, 0.0]), (0.05, [20.0, -10.0, 0.0])]
SWING = al.BangBang([0.0, 0.0], [0.5, 0.4], 0.1)
JUMPS: dict[str, tuple[Any, dict[str, Any]]] = {
    "force": (HOLD, {"force": PUSH, "force_frame": "link2"}),
    "force between two steps": (HOLD, {"force": [(0.0373, [20.0, -10.0, 0.0])], "force_frame": "link2"}),
    "motion": (al.ComputedTorque(ARM, SWING, 100.0, 20.0), {}),
    "motion and force": (al.ComputedTorque(ARM, SWING, 100.0, 20.0), {"force": PUSH, "force_frame": "link2"}),
}
METHODS = ("euler", "semi_implicit", "rk4", "ros2")


@pytest.mark.parametrize("sample_time", [None, 2e-3])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", JUMPS)
def test_jumps_divide_the_steps_as_in_simulate(case: str, method: str, sample_time: float | None) -> None:
    law, more = JUMPS[case]
    options: dict[str, Any] = more | {"dt": 1e-3, "method": method, "sample_time": sample_time}
    run = al.simulate(PLANT, law, [0.0, 0.0], t_end=0.12, monitors=False, **options)
    sim = al.Simulator(PLANT, law, [0.0, 0.0], **options)

    def follow() -> None:
        for k in range(round(sim.t / 1e-3), 120):
            # Rounding errors: programs and direct evaluation may round differently.
            np.testing.assert_allclose(sim.q, run.q[k], rtol=0.0, atol=1e-11)
            np.testing.assert_allclose(sim.v, run.v[k], rtol=0.0, atol=1e-11)
            if k == 60:
                copy = pickle.loads(pickle.dumps(sim))
                for _ in range(60):
                    copy.step()
                np.testing.assert_allclose(copy.q, run.q[-1], rtol=0.0, atol=1e-11)
            sim.step()
        np.testing.assert_allclose(sim.q, run.q[-1], rtol=0.0, atol=1e-11)

    follow()
    sim.reset()
    follow()


FOUR = al.planar_arm([1.0, 1.0, 0.25, 0.25])
REACH: Any = [al.Task("link4", "xy", [0.5, 0.3], 4.0), al.Task("link2", "xy", [1.5, -1.0], 4.0)]
EQUAL: dict[str, tuple[Any, Any, list[float]]] = {
    "hold": (PLANT, HOLD, [0.0, 0.5]),
    "motion": (PLANT, al.ComputedTorque(ARM, al.Sinusoid([0.1, 0.2], [0.3, 0.3], [2.0, 3.0], [0.0, 0.0]), 100.0, 20.0), [0.0, 0.5]),
    "integral": (PLANT, al.PID(ARM, [0.3, 1.0], 100.0, 50.0, 20.0), [0.0, 0.5]),
    "stick-slip": (al.RigidArm(ARM, friction=al.StickSlip(coulomb=[1.0, 0.5])), HOLD, [0.0, 0.5]),
    # The outstretched arm is singular.
    "priority": (al.VelocityArm(FOUR), al.PriorityVelocity(FOUR, REACH), [0.0] * 4),
    "priority with limits": (al.VelocityArm(FOUR), al.PriorityVelocity(FOUR, REACH, "exact", v_max=0.5), [0.0] * 4),
}


@pytest.mark.parametrize("sample_time", [None, 2e-3])
@pytest.mark.parametrize("method", ["euler", "rk4"])
@pytest.mark.parametrize("case", EQUAL)
def test_steps_have_the_bits_of_simulate(case: str, method: str, sample_time: float | None) -> None:
    """The last step of `simulate` ends at `t_end`, so its length can differ by a rounding error."""
    plant, law, q0 = EQUAL[case]
    options: dict[str, Any] = {"dt": 1e-3, "method": method, "sample_time": sample_time}
    run = al.simulate(plant, law, q0, t_end=0.2, monitors=False, **options)
    sim = al.Simulator(plant, law, q0, **options)
    for k in range(1, 200):
        sim.step()
        np.testing.assert_array_equal(sim.q, run.q[k])
    sim.step()
    np.testing.assert_allclose(sim.q, run.q[-1], rtol=0.0, atol=1e-14)


def own_steps(law: Any, push: Callable[[float], Array], n: int, dt: float) -> tuple[Array, Array]:
    """The classical Runge-Kutta method in numpy. The last stage of a step uses the limit of the input from the left."""
    q, v = np.zeros(2), np.zeros(2)

    def slope(t: float, q: Array, v: Array) -> tuple[Array, Array]:
        return v, ARM.forward_dynamics(q, v, law(t, q, v) + ARM.jacobian(q, "link2")[:3].T @ push(t))

    for k in range(n):
        t = k * dt + 1e-12
        k1 = slope(t, q, v)
        k2 = slope(t + dt / 2, q + dt / 2 * k1[0], v + dt / 2 * k1[1])
        k3 = slope(t + dt / 2, q + dt / 2 * k2[0], v + dt / 2 * k2[1])
        k4 = slope(t + dt - 2e-12, q + dt * k3[0], v + dt * k3[1])
        q, v = (x + dt / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip((q, v), k1, k2, k3, k4, strict=True))
    return q, v


@pytest.mark.parametrize(("case", "t_end"), [("force", 0.05), ("force", 0.1), ("motion", 0.05), ("motion", 0.1)])
def test_a_step_uses_the_input_on_its_side_of_the_jump(case: str, t_end: float) -> None:
    """The times of the ends are jumps, except 0.1 s of the force."""
    law, more = JUMPS[case]

    def push(t: float) -> Array:
        return np.array(PUSH[1][1] if "force" in more and t >= 0.05 else [0.0, 0.0, 0.0])

    q, v = own_steps(law, push, round(t_end / 1e-3), 1e-3)
    run = al.simulate(PLANT, law, [0.0, 0.0], t_end=t_end, dt=1e-3, monitors=False, **more)
    # The own times differ from the steps by 1e-12 s, and the input changes by up to 1e3 per second.
    np.testing.assert_allclose(run.q[-1], q, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(run.v[-1], v, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("method", [*METHODS, "dopri5", "dop853", "radau5", "rodas4"])
@pytest.mark.parametrize("case", ["force", "motion"])
def test_a_run_that_ends_at_a_jump_is_the_start_of_a_longer_run(case: str, method: str) -> None:
    law, more = JUMPS[case]
    adaptive = method in ("dopri5", "dop853", "radau5", "rodas4")
    options: dict[str, Any] = more | {"method": method, "monitors": False}
    options |= {"t_eval": [0.05], "rtol": 1e-9, "atol": 1e-10} if adaptive else {"dt": 1e-3}
    short = al.simulate(PLANT, law, [0.0, 0.0], t_end=0.05, **options)
    longer = al.simulate(PLANT, law, [0.0, 0.0], t_end=0.1, **options)
    # Adaptive methods choose other steps before another end, with errors of about the tolerance.
    place, tolerance = (0, 1e-7) if adaptive else (50, 1e-12)
    np.testing.assert_allclose(short.v[-1], longer.v[place], rtol=0.0, atol=tolerance)


STUCK = al.RigidArm(ARM, friction=al.StickSlip(coulomb=[30.0, 0.2]))


@pytest.mark.parametrize("sample_time", [None, 1e-3, 4e-3, al.Sampling(2e-3, delay=1e-3, noise={"q": 1e-4})], ids=str)
@pytest.mark.parametrize("plant", [PLANT, STUCK], ids=["free", "stick-slip"])
@pytest.mark.parametrize("method", METHODS)
def test_after_an_exception_the_step_is_repeated(method: str, plant: Any, sample_time: Any) -> None:
    armed = {"at": np.inf}

    def force(t: float) -> list[float]:
        if t >= armed["at"]:
            raise KeyError("once")
        return [np.cos(50.0 * t), 0.3, 0.0]

    def made() -> al.Simulator:
        options: dict[str, Any] = {"dt": 1e-3, "method": method, "sample_time": sample_time}
        return al.Simulator(plant, HOLD, [0.1, 0.2], force=force, force_frame="link2", **options)

    undisturbed, sim = made(), made()
    # Euler's method uses the force only at the start of a step.
    instants = (0.0, 0.4e-3, 0.9e-3) if method in ("rk4", "ros2") else (0.0,)
    for k in range(20):
        for since in instants if k in (7, 10) else ():
            armed["at"], before = sim.t + since, sim.state
            try:
                with pytest.raises(KeyError, match="once"):
                    sim.step()
            finally:
                armed["at"] = np.inf
            assert sim.status == al.Status.SUCCESS
            for name, value in before.items():
                np.testing.assert_array_equal(sim.state[name], value)
        undisturbed.step()
        sim.step()
        np.testing.assert_array_equal(sim.q, undisturbed.q)
        np.testing.assert_array_equal(sim.v, undisturbed.v)
        np.testing.assert_array_equal(sim.tau, undisturbed.tau)


def test_a_law_that_raises_is_called_again() -> None:
    calls: list[float] = []

    def law(t: float, q: Array, v: Array) -> Array:
        calls.append(t)
        if len(calls) == 3:
            raise KeyError("once")
        return 5.0 * (0.2 - q) - v

    sim = al.Simulator(PLANT, law, [0.1, 0.2], dt=1e-3, sample_time=2e-3)
    for _ in range(4):
        sim.step()
    with pytest.raises(KeyError):
        sim.step()
    for _ in range(3):
        sim.step()
    assert calls == pytest.approx([0.0, 2e-3, 4e-3, 4e-3, 6e-3], abs=1e-15)


@pytest.mark.parametrize("method", METHODS)
def test_a_reset_after_a_divergence_restores_the_bits(method: str) -> None:
    sim = al.Simulator(PLANT, HOLD, [0.1, 0.2], dt=1e-3, method=method, force_frame="link2")

    def steps() -> Array:
        for _ in range(20):
            sim.step()
        return np.concatenate([sim.q, sim.v])

    first = steps()
    with pytest.raises(al.SolveError):
        sim.step(force=[1e308, 1e308, 0.0])
    sim.reset()
    np.testing.assert_array_equal(steps(), first)


def test_a_state_that_is_set_is_measured() -> None:
    """The sample of a step that diverged belongs to the state before `set_state`."""
    sampling = al.Sampling(1e-3, resolution={"q": 1e-9})
    sim = al.Simulator(PLANT, HOLD, [0.1, 0.2], dt=1e-3, sample_time=sampling, force_frame="link2")
    sim.step()
    with pytest.raises(al.SolveError):
        sim.step(force=[1e308, 1e308, 0.0])
    sim.set_state([0.4, 0.1], [0.0, 0.0])
    sim.step()
    # The sensor rounds by 1e-9 rad, and the gain is 60.
    np.testing.assert_allclose(sim.tau, HOLD(0.0, [0.4, 0.1], [0.0, 0.0]), rtol=0.0, atol=1e-6)


PID = al.PID(ARM, [0.3, 0.5], 60.0, 10.0, 20.0, tau_max=[50.0, 50.0])
GUARDED = al.Guarded(HOLD, al.MomentumObserver(ARM, 50.0, threshold=100.0), reaction="stop", stiffness=200.0, damping=30.0)
QUEUES = [al.Sampling(2e-3, delay=4e-3), al.Sampling(3e-3, rate_limit=500.0), al.Sampling(2e-3, delay=3e-3, rate_limit=900.0)]


@pytest.mark.parametrize(("law", "sampling"), [(PID, None), *((law, each) for law in (PID, GUARDED) for each in (1e-3, 4e-3, *QUEUES))])
@pytest.mark.parametrize("method", METHODS)
def test_an_input_of_the_caller_does_not_change_the_law(method: str, law: Any, sampling: Any) -> None:
    """In a step with an input of the caller, the plant moves as without a law, and the state of the law does not change."""
    sim = al.Simulator(PLANT, law, [0.1, 0.2], dt=1e-3, method=method, sample_time=sampling)
    alone = al.Simulator(PLANT, None, [0.1, 0.2], dt=1e-3, method=method)
    for k in range(12):
        sim.step()
        estimate, given = sim.estimate.copy(), [3.0 - k, 0.5 * k]
        alone.set_state(sim.q.copy(), sim.v.copy())
        sim.step(given)
        alone.step(given)
        np.testing.assert_array_equal(sim.estimate, estimate)
        np.testing.assert_array_equal(sim.tau, given)
        # The stages of "ros2" solve one system of equations for all states.
        np.testing.assert_allclose(sim.q, alone.q, rtol=0.0, atol=1e-12 if method == "ros2" else 0.0)


@pytest.mark.parametrize("sampling", [4e-3, al.Sampling(4e-3, rate_limit=500.0)], ids=["plain", "limited rate"])
def test_what_acts_after_an_input_of_the_caller(sampling: Any) -> None:
    """A controller that stores its outputs continues with the last one. A plain controller holds the input until its next sample."""
    sim = al.Simulator(PLANT, HOLD, [0.1, 0.2], dt=1e-3, sample_time=sampling)
    for _ in range(12):
        sim.step()
    last = sim.tau.copy()
    sim.step([7.0, -8.0])  # this step begins with a sample, which is not taken
    sim.step()
    np.testing.assert_array_equal(sim.tau, [7.0, -8.0] if sampling == 4e-3 else last)


@pytest.mark.parametrize("sampling", [None, 2e-3, *QUEUES], ids=str)
def test_a_reset_forgets_inputs_and_samples(sampling: Any) -> None:
    sim = al.Simulator(PLANT, HOLD, [0.1, 0.2], dt=1e-3, sample_time=sampling)

    def steps() -> Array:
        rows = []
        for given in ([[1.0, 2.0]], [], [], [[3.0, 1.0]], [], [], []):
            sim.step(*given)
            rows.append(np.concatenate([sim.q, sim.v, sim.tau]))
        return np.array(rows)

    first = steps()
    sim.reset()
    np.testing.assert_array_equal(steps(), first)


@pytest.mark.parametrize("sampling", [None, 1e-3, al.Sampling(2e-3, delay=2e-3)], ids=str)
@pytest.mark.parametrize("driven", [False, True], ids=["law", "driven"])
def test_angles_beyond_the_range_of_machine_code(driven: bool, sampling: Any) -> None:
    """The interpreter repeats the step that exceeds 10^6 rad, and continues. Whole turns change the motion only by rounding."""
    # The law has no springs, so that its output does not depend on whole turns.
    law = al.PDGravity(ARM, [0.3, 0.5], 1e-12, 10.0)
    sims = [al.Simulator(PLANT, law, [0.1, 0.2], dt=1e-3, sample_time=sampling, state_limit=np.inf) for _ in range(2)]
    turns = 2.0 * np.pi * 159155.0  # the first joint reaches 10^6 rad within 20 steps
    for sim, more in zip(sims, (0.0, turns), strict=True):
        sim.set_state([1e6 - turns - 0.05 + more, 0.2], [10.0, 0.0])
    for _ in range(20):
        for sim in sims:
            sim.step(*([[1.0, -0.5]] if driven else []))
        # The rounding error of the angle is 1e-10 rad.
        np.testing.assert_allclose(sims[1].q - [turns, 0.0], sims[0].q, rtol=0.0, atol=1e-8)
    assert sims[1].q[0] > 1e6
    for sim in sims:
        sim.reset()
        sim.step()
    np.testing.assert_array_equal(sims[1].q, sims[0].q)
