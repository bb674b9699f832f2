"""`Simulator`, metrics, `integrate` and named terms of laws against the reference, and against sums in numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from loops import PIDS, close, law_pair, pair

import armlet as al
from armlet import reference

# Rounding errors of the accelerations, and of the complex-step derivatives of the reference, grow over the steps.
ROUNDING = 1e-9


class Torque(reference.Law):
    """A law that returns one torque (n,) for each sample of 1 ms, as a caller passes to `Simulator.step`."""

    def __init__(self, torques: Any) -> None:
        self.torques = torques

    def terms(self, t: float, q: Any, v: Any, theta: Any = None, theta_dot: Any = None, state: Any = None) -> Any:
        row = min(round(t / 1e-3), len(self.torques) - 1)
        return {"tau": self.torques[row], "state_rate": np.zeros(0)}


@pytest.mark.parametrize("n", [1, 2, 5])
def test_simulator_with_a_law(n: int) -> None:
    rng = np.random.default_rng([75, n])
    arms = pair(rng, n)
    law, theirs = law_pair(rng, "Adaptive", arms)
    q0, v0, force = rng.uniform(-0.3, 0.3, n), rng.uniform(-0.3, 0.3, n), rng.uniform(-2.0, 2.0, 3)
    frame = arms[0].frame_names[-1]
    sim = al.Simulator(al.RigidArm(arms[0]), law, q0, v0=v0, dt=1e-3, force_frame=frame)
    for _ in range(10):
        sim.step(force=force)
    run = reference.simulate(reference.RigidArm(arms[1]), theirs, q0, v0=v0, t_end=0.01, dt=1e-3, force=force, force_frame=frame)
    assert sim.t == pytest.approx(0.01, rel=1e-14) and sim.status == al.Status.SUCCESS
    for name in ("q", "v", "estimate"):
        close(getattr(sim, name), run[name][-1], ROUNDING)
    sim.reset()
    np.testing.assert_array_equal(sim.q, q0)
    assert sim.t == 0.0


@pytest.mark.parametrize("n", [1, 3, 6])
def test_simulator_with_torques_of_the_caller(n: int) -> None:
    rng = np.random.default_rng([76, n])
    arms = pair(rng, n)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    torques = rng.uniform(-3.0, 3.0, (20, n))
    sim = al.Simulator(al.RigidArm(arms[0]), None, np.zeros(n), dt=1e-3)
    sim.set_state(q0, v0)
    for tau in torques:
        sim.step(tau)
        np.testing.assert_array_equal(sim.tau, tau)
    run = reference.simulate(reference.RigidArm(arms[1]), Torque(torques), q0, v0=v0, t_end=0.02, dt=1e-3, sample_time=1e-3)
    close(sim.q, run["q"][-1], ROUNDING)
    close(sim.v, run["v"][-1], ROUNDING)
    sim.reset(q0=v0, v0=q0)
    np.testing.assert_array_equal(sim.state["q"], v0)
    np.testing.assert_array_equal(sim.state["v"], q0)


def test_simulator_of_elastic_joints() -> None:
    rng = np.random.default_rng(77)
    arms = pair(rng, 3)
    K, B = np.array([900.0, 700.0, 500.0]), np.array([0.5, 0.4, 0.3])
    q0 = rng.uniform(-0.3, 0.3, 3)
    states = []
    for lib, arm in zip((al, reference), arms, strict=True):
        law: Any = lib.MotorPD(arm, np.full(3, 0.2), 300.0, 20.0, K)
        plant: Any = lib.ElasticArm(arm, K, B)
        if lib is al:
            sim = al.Simulator(plant, law, q0, dt=5e-4)
            for _ in range(40):
                sim.step()
            states.append({name: getattr(sim, name) for name in ("q", "v", "theta", "theta_dot")})
        else:
            run = reference.simulate(plant, law, q0, t_end=0.02, dt=5e-4)
            states.append({name: run[name][-1] for name in states[0]})
    for name, got in states[0].items():
        close(got, states[1][name], ROUNDING)


def shares(t: Any) -> Any:
    """Return the weight of each record in a time average by the trapezoidal rule."""
    edges = np.concatenate([t[:1], 0.5 * (t[1:] + t[:-1]), t[-1:]])
    return np.diff(edges) / (t[-1] - t[0])


@pytest.mark.parametrize("batch", [False, True], ids=["run", "batch"])
def test_metrics(batch: bool) -> None:
    """Each metric equals its definition, evaluated with the records of the reference's run."""
    rng = np.random.default_rng(78)
    arms = pair(rng, 3)
    law, theirs = law_pair(rng, "ComputedTorque", arms)
    q0 = rng.uniform(-0.3, 0.3, 3)
    run = reference.simulate(reference.RigidArm(arms[1]), theirs, q0, t_end=0.5, dt=5e-3)
    t, q_d = run["t"], np.array([theirs.motion(t)[0] for t in run["t"]])
    desired, way = np.array([0.3, -0.2, 0.1]), shares(t)
    for reference_of_joints in (None, desired):
        aim = q_d if reference_of_joints is None else np.broadcast_to(desired, q_d.shape)
        error = run["q"] - aim
        options: dict[str, Any] = {"reference": reference_of_joints, "band": 0.05}
        if batch:
            found = al.simulate_batch(al.RigidArm(arms[0]), law, np.array([q0, q0]), t_end=0.5, dt=5e-3).metrics(**options)
            got = {name: values[1] for name, values in found.items()}
        else:
            got = dict(al.simulate(al.RigidArm(arms[0]), law, q0, t_end=0.5, dt=5e-3).metrics(**options))
        close(got["error_rms"], np.sqrt(way @ error**2), ROUNDING)
        close(got["error_peak"], np.abs(error).max(axis=0), ROUNDING)
        close(got["error_final"], np.abs(error[-1]), ROUNDING)
        close(got["tau_rms"], np.sqrt(way @ run["tau"] ** 2), ROUNDING)
        close(got["tau_peak"], np.abs(run["tau"]).max(axis=0), ROUNDING)
        late = [k for k in range(t.size) if np.abs(error[k:]).max() <= 0.05]
        assert got["settling_time"] == pytest.approx(t[late[0]] if late else np.nan, nan_ok=True)
        forward = np.sign(aim[-1] - run["q"][0])
        past = np.max((run["q"] * forward), axis=0) - np.max(aim * forward, axis=0)
        close(got["overshoot"], np.maximum(past, 0.0) / np.abs(aim[-1] - run["q"][0]), ROUNDING)


def test_metrics_kept_by_a_batch() -> None:
    """Metrics that a batch computes during the run agree.

    The settling band is 0.3 of the largest error among all joints of the same unit, rad or m.
    """
    rng = np.random.default_rng(79)
    arms = pair(rng, 2)
    law, theirs = law_pair(rng, "PDGravity", arms)
    q0 = rng.uniform(-0.3, 0.3, (2, 2))
    options: dict[str, Any] = {"t_end": 0.5, "dt": 5e-3, "keep": "metrics", "metrics": {"settle": 0.3}}
    found = al.simulate_batch(al.RigidArm(arms[0]), law, q0, **options).metrics()
    for row in range(2):
        run = reference.simulate(reference.RigidArm(arms[1]), theirs, q0[row], t_end=0.5, dt=5e-3)
        error = np.abs(theirs.target - run["q"])
        close(found["error_rms"][row], np.sqrt(shares(run["t"]) @ error**2), ROUNDING)
        close(found["tau_peak"][row], np.abs(run["tau"]).max(axis=0), ROUNDING)
        kinds = arms[0].joint_types
        band = [0.3 * max(error[:, j].max() for j in range(2) if kinds[j] == kinds[i]) for i in range(2)]
        late = [k for k in range(len(error)) if np.all(error[k:] <= band)]
        assert found["settling_time"][row] == pytest.approx(run["t"][late[0]] if late else np.nan, nan_ok=True)


def field(t: Any, y: Any) -> Any:
    """Return the derivative of a damped pendulum with a periodic torque."""
    return np.array([y[1], -np.sin(y[0]) - 0.3 * y[1] + np.cos(2.0 * t)])


@pytest.mark.parametrize(("method", "tolerance"), [("dop853", 1e-10), ("dopri5", 1e-9), ("radau5", 1e-8), ("rodas4", 1e-7)])
def test_integrate(method: str, tolerance: float) -> None:
    """Methods with tolerances of 1e-11 agree with extrapolation, to 10 (dop853) to 10^4 (rodas4) times the tolerance."""
    times = np.linspace(0.0, 3.0, 7)
    options: dict[str, Any] = {"method": method, "rtol": 1e-11, "atol": 1e-11}
    got = al.integrate(field, (0.0, 3.0), [0.4, -0.2], t_eval=times, **options)
    expected = reference.integrate.gbs(field, 0.0, np.array([0.4, -0.2]), times)
    close(got.y, expected, tolerance)


@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_integrate_with_fixed_steps(method: str) -> None:
    y = np.array([0.4, -0.2])
    got = al.integrate(field, (0.0, 1.0), y, method=method, dt=0.01)
    for k in range(100):
        y = reference.integrate.STEPS[method](field, 0.01 * k, y, 0.01)
    # Both codes take the same hundred steps, up to rounding.
    close(got.y[-1], y, 1e-13)


@pytest.mark.parametrize("name", ["PDGravity", *PIDS, "CartesianImpedance"])
@pytest.mark.parametrize("n", [1, 3, 6])
def test_named_parts_of_laws(name: str, n: int) -> None:
    rng = np.random.default_rng([80, n])
    arms = pair(rng, n)
    law, theirs = law_pair(rng, name, arms)
    for q, v in rng.uniform(-1.0, 1.0, (5, 2, n)):
        got, expected = law.terms(0.0, q, v), theirs.terms(0.0, q, v)
        shared = {"tau", "e", "u", "J"} & got.keys() & expected.keys()
        assert {"e"} < shared
        for part in shared:
            # The reference computes gravity with complex steps, which adds rounding errors.
            close(np.asarray(got[part]), expected[part], 1e-12)
        close(law(0.0, q, v), theirs(0.0, q, v), 1e-12)
