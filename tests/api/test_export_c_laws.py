"""Laws as C return armlet's torques to the last bit, in single calls and in sampled loops.

They include laws with states, every kind of motion, and task priority.
"""

from __future__ import annotations

import itertools
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compiled_c import COMPILERS, Controller
from test_export_c_arms import ARMS, branched

import armlet as al

# Only the laws are compared, so the runs need not be accurate.
pytestmark = [
    pytest.mark.compile,
    pytest.mark.filterwarnings("ignore:.*balance does not close:UserWarning", "ignore:.*close to unstable:UserWarning"),
]

SIX, SEVEN = (al.load_urdf(al.example_urdf(name)) for name in ("six_axis", "seven_axis"))
PLANAR = al.planar_arm([0.5, 0.4, 0.3], masses=[3.0, 2.0, 1.0])
CHAINS = {"planar 3R": PLANAR, "six axes": SIX, "seven axes": SEVEN, "tree": branched()}
ALL = CHAINS | {"planar_pr": ARMS["planar_pr"](), "pendulum": ARMS["pendulum"]()}


def quintic(arm: al.Arm) -> al.Quintic:
    return al.Quintic(np.zeros(arm.n), np.linspace(0.4, -0.5, arm.n), 0.3)


def target(arm: al.Arm) -> np.ndarray:
    return np.linspace(0.3, -0.4, arm.n)


def limits(arm: al.Arm) -> np.ndarray:
    """Torque limits; the last joint has none."""
    return np.append(np.full(arm.n - 1, 5.0), np.inf)


def full(arm: al.Arm, k: float) -> np.ndarray:
    return k * np.eye(arm.n) + 0.1


RIGID: dict[str, Callable[[al.Arm], al.Law]] = {
    "PDGravity": lambda arm: al.PDGravity(arm, target(arm), kp=60.0, kd=15.0),
    "PDGravity, full": lambda arm: al.PDGravity(arm, target(arm), kp=full(arm, 60.0), kd=full(arm, 15.0)),
    "ComputedTorque": lambda arm: al.ComputedTorque(arm, quintic(arm), kp=100.0, kd=20.0),
    "PID": lambda arm: al.PID(arm, target(arm), kp=60.0, ki=40.0, kd=15.0),
    "PID, all options": lambda arm: al.PID(
        arm, quintic(arm), kp=60.0, ki=40.0, kd=15.0, tau_max=limits(arm), derivative_filter=100.0, friction=True, observer_bandwidth=30.0
    ),
    "PID within limits": lambda arm: al.PID(arm, target(arm), kp=60.0, ki=40.0, kd=15.0, tau_max=limits(arm)),
    "Adaptive": lambda arm: al.Adaptive(arm, quintic(arm), kp=40.0, kd=20.0, gamma=0.2),
    "Adaptive, composite": lambda arm: al.Adaptive(arm, quintic(arm), 40.0, 20.0, 0.1, composite=0.3, armature=True),
    "Adaptive, estimate": lambda arm: al.Adaptive(arm, quintic(arm), kp=40.0, kd=20.0, gamma=0.2, estimate=0.9 * arm.parameters),
}
#: Laws with tasks of a frame.
FRAMED: dict[str, Callable[[al.Arm], al.Law]] = {
    "CartesianImpedance": lambda arm: al.CartesianImpedance(arm, [0.5, 0.2], 300.0, 60.0, frame=str(arm.tip_frame), axes="xy"),
    "CartesianImpedance, turning": lambda arm: al.CartesianImpedance(
        arm, [0.5, 0.2, 0.1], [300.0, 200.0, 30.0], [60.0, 50.0, 3.0], frame=str(arm.tip_frame), axes="xy rz"
    ),
    "CartesianImpedance, null space": lambda arm: al.CartesianImpedance(
        arm,
        al.Quintic([0.5, 0.2], [0.4, 0.3], 0.3),
        300.0,
        60.0,
        frame=str(arm.tip_frame),
        axes="xy",
        nullspace=al.NullSpace(target(arm), 20.0, 5.0),
        compensate_coupling=True,
    ),
    "CartesianImpedance, integral": lambda arm: al.CartesianImpedance(
        arm, [0.5, 0.2], 300.0, 60.0, frame=str(arm.tip_frame), axes="xy", integral_gain=50.0, wrench_max=80.0, tau_max=30.0
    ),
}
K, B, B0 = 2000.0, 0.3, 0.1
ELASTIC: dict[str, Callable[[al.Arm], al.Law]] = {
    "ElasticImpedance": lambda arm: al.ElasticImpedance(arm, [0.5, 0.2], 100.0, 20.0, K, B, B0, frame=str(arm.tip_frame), axes="xy"),
    "ElasticTracking": lambda arm: al.ElasticTracking(
        arm, al.Quintic([0.5, 0.2], [0.4, 0.3], 0.3), 100.0, 20.0, K, B, B0, frame=str(arm.tip_frame), axes="xy"
    ),
    "JointImpedance": lambda arm: al.JointImpedance(arm, target(arm), 100.0, 20.0, K, B, B0),
    "JointTracking": lambda arm: al.JointTracking(arm, quintic(arm), 100.0, 20.0, K, B),
    "MotorPD": lambda arm: al.MotorPD(arm, target(arm), 100.0, 20.0, K),
    "MotorPD, online": lambda arm: al.MotorPD(arm, target(arm), 100.0, 20.0, K, online=True),
    "StateFeedback": lambda arm: al.StateFeedback(arm, target(arm), 100.0, 20.0, 0.5, 0.01, K),
    "JointImpedance, moving": lambda arm: al.JointImpedance(arm, quintic(arm), 100.0, 20.0, K, B, B0),
    "StateFeedback, moving": lambda arm: al.StateFeedback(arm, quintic(arm), 100.0, 20.0, 0.5, 0.01, K),
}
CASES = [(law, arm) for law in RIGID for arm in ALL] + [(law, arm) for law in (*FRAMED, *ELASTIC) for arm in CHAINS]


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize(("name", "arm"), CASES)
def test_a_law_has_the_bits_of_armlet(name: str, arm: str, compiler: str, tmp_path: Path) -> None:
    law = (RIGID | FRAMED | ELASTIC)[name](ALL[arm])
    c = Controller(al.export_c(law, tmp_path), compiler)
    rng, n = np.random.default_rng(11), ALL[arm].n
    motors = ("theta", "theta_dot") if name in ELASTIC else ()
    # The first state is at rest at zero.
    for k in range(1000):
        t, x = rng.uniform(0.0, 0.4), rng.uniform(-3.0, 3.0, (4, n)) * (k > 0)
        if motors:
            x[2] = x[0] + rng.uniform(-0.05, 0.05, n)
        c.init()
        z = {}
        if c.p:
            c.memory[n : n + c.p] = rng.uniform(-2.0, 2.0, c.p)
            z["state"] = c.state
            # The first call of a law would initialise its filters. So the state of an earlier call at the same time is set.
            c.memory[n + 2 * c.p] = t
            c.memory[n + 2 * c.p + 1 :].view(np.int32)[0] = 1
        expected = law(t, x[0], x[1], **dict(zip(motors, x[2:], strict=False)), **z)
        np.testing.assert_array_equal(c(t, *x[: 4 if motors else 2]), expected, err_msg=f"state {k}")


def times(knots: int) -> Any:
    """Times of uneven knots, s."""
    return 0.03 + np.cumsum(np.linspace(0.01, 0.05, knots))


MOTIONS: dict[str, Callable[[al.Arm], al.Motion]] = {
    "Hold": lambda arm: al.Hold(target(arm)),
    "Quintic": quintic,
    "BangBang": lambda arm: al.BangBang(np.zeros(arm.n), target(arm), 0.3),
    "Sinusoid": lambda arm: al.Sinusoid(target(arm), np.full((arm.n, 2), 0.3), [[1.0, 7.3]] * arm.n, [[0.1, -2.0]] * arm.n),
    "Sinusoid, one term": lambda arm: al.Sinusoid(target(arm), np.zeros(arm.n), np.full(arm.n, 3.0), np.zeros(arm.n)),
    "Table": lambda arm: al.Table(0.013, *table(arm, 12), start=0.05),
    "Table of one knot": lambda arm: al.Table(0.013, *table(arm, 1)),
    "Spline": lambda arm: al.Spline(times(9), table(arm, 9)[0]),
    "Spline with velocities": lambda arm: al.Spline(times(9), *table(arm, 9)[:2]),
    "Spline with accelerations": lambda arm: al.Spline(times(2), *table(arm, 2)),
    "path": lambda arm: al.time_path(arm, waypoints(arm), tau_max=200.0, v_max=3.0, a_max=20.0, check_limits=False),
    "path of limited torque rate": lambda arm: al.time_path(
        arm, waypoints(arm), tau_max=200.0, v_max=3.0, torque_rate=4000.0, check_limits=False
    ),
    "path of one point": lambda arm: al.time_path(arm, np.array([target(arm), target(arm)]), tau_max=200.0, check_limits=False),
}


def table(arm: al.Arm, knots: int) -> np.ndarray:
    return np.random.default_rng(3).uniform(-1.0, 1.0, (3, knots, arm.n))


def waypoints(arm: al.Arm) -> np.ndarray:
    return np.array([np.zeros(arm.n), target(arm), 0.5 * target(arm) + 0.2, np.full(arm.n, -0.2)])


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_in_c_has_the_bits_of_armlet(name: str, compiler: str, tmp_path: Path) -> None:
    motion = MOTIONS[name](PLANAR)
    compare(al.ComputedTorque(PLANAR, motion, kp=100.0, kd=20.0), motion, 2, compiler, tmp_path)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", [name for name in MOTIONS if name not in ("BangBang", "Spline with velocities")])
def test_jerk_and_snap_in_c_have_the_bits_of_armlet(name: str, compiler: str, tmp_path: Path) -> None:
    motion = MOTIONS[name](PLANAR)
    if name.startswith("path"):
        with pytest.raises(al.InputError, match="jumps" if name == "path" else "has no C of jerk and snap"):
            al.export_c(al.JointTracking(PLANAR, motion, 100.0, 20.0, K, B), tmp_path)
    else:
        compare(al.JointTracking(PLANAR, motion, 100.0, 20.0, K, B), motion, 4, compiler, tmp_path)


def compare(law: al.Law, motion: al.Motion, parts: int, compiler: str, folder: Path) -> None:
    """Compare the law with its C code at 1000 times and states, which have this number of parts."""
    c = Controller(al.export_c(law, folder), compiler)
    end = getattr(motion, "duration", 0.4)
    ends = [0.0, end, 0.5 * end, np.nextafter(end, 0.0), np.nextafter(end, 9.0), 0.3, 0.15, -0.1, 1e3]
    ends += [0.05 + 0.013 * k for k in range(12)] + [float(t) for t in getattr(motion, "times", [])]
    x = np.random.default_rng(12).uniform(-2.0, 2.0, (1000, parts, 3))
    times = np.append(ends, np.random.default_rng(13).uniform(-0.05, 1.2 * end + 0.1, 1000 - len(ends)))
    motors = ("theta", "theta_dot")
    for t, state in zip(times, x, strict=True):
        expected = law(t, *state[:2], **dict(zip(motors, state[2:], strict=False)))
        np.testing.assert_array_equal(c(t, *state), expected, err_msg=f"t = {t!r}")


LOOPS: dict[str, Callable[[al.Arm], al.Law]] = {
    "Adaptive": lambda arm: al.Adaptive(arm, quintic(arm), kp=40.0, kd=20.0, gamma=0.2),
    "Adaptive, sinusoid": lambda arm: al.Adaptive(arm, MOTIONS["Sinusoid"](arm), kp=40.0, kd=20.0, gamma=0.2),
    # The acceleration of this motion jumps within a step.
    "Adaptive, bang-bang": lambda arm: al.Adaptive(arm, al.BangBang(np.zeros(arm.n), target(arm), 0.2347), kp=40.0, kd=20.0, gamma=0.2),
    "PID": RIGID["PID within limits"],
    "PID, all options": RIGID["PID, all options"],
    "Adaptive, composite": RIGID["Adaptive, composite"],
    "PDGravity": RIGID["PDGravity"],
}


@pytest.mark.parametrize("methods", [["rk4"], ["euler", "semi_implicit"]], ids=["rk4", "euler, semi_implicit"])
@pytest.mark.parametrize("name", LOOPS)
def test_the_state_advances_as_in_a_sampled_loop(name: str, methods: list[str], tmp_path: Path) -> None:
    """At every sample of a run, the C has the input and the state of the run's law."""
    arm, dt = SIX, 1e-3
    law = LOOPS[name](arm)
    options: list[dict[str, Any]] = [{"dt": dt, "method": method} for method in methods] if name != "PDGravity" else [{}]
    texts = {tuple(file.read_text() for file in al.export_c(law, tmp_path, **given)) for given in options}
    assert len(texts) == 1
    c = Controller([tmp_path / file for file in ("law.h", "law.c", "CMakeLists.txt")], COMPILERS[0])
    for method, samples in itertools.product(methods, (1, 4)):
        c.init()
        compare_with_run(c, arm, law, dt, samples, method)


def compare_with_run(c: Controller, arm: al.Arm, law: al.Law, dt: float, samples: int, method: str) -> None:
    options: dict[str, Any] = {"t_end": 0.4, "dt": dt, "sample_time": samples * dt, "record_every": samples, "method": method}
    run = al.simulate(al.RigidArm(arm), law, np.linspace(0.1, -0.2, arm.n), check_limits=False, **options)
    states = run.estimate
    # The last step ends at `t_end`, which is not a multiple of `dt`, so it is not compared.
    for k in range(len(run.t) - 1):
        np.testing.assert_array_equal(c(run.t[k], run.q[k], run.v[k]), run.tau[k], err_msg=f"sample {k}")
        if states is not None:
            np.testing.assert_array_equal(c.state, states[k], err_msg=f"sample {k}")


@pytest.mark.parametrize("reaction", [None, "stop", "float", "retract"])
def test_a_guarded_law_reacts_in_c_as_in_a_loop(reaction: str | None, tmp_path: Path) -> None:
    """The observer needs the sample time `dt`. The force on the tip is constant, because a jump would divide a step of the run."""
    inner = al.ComputedTorque(PLANAR, quintic(PLANAR), 100.0, 20.0)
    gains: dict[str, Any] = {None: {}, "float": {"damping": 2.0}}.get(reaction, {"stiffness": 60.0, "damping": 9.0})
    law = al.Guarded(inner, al.MomentumObserver(PLANAR, 50.0, threshold=0.5), reaction, **gains)
    with pytest.raises(al.InputError, match="dt is missing: expected the sample time, which Guarded needs"):
        al.export_c(law, tmp_path)
    c = Controller(al.export_c(law, tmp_path, dt=1e-3), COMPILERS[0])
    push: dict[str, Any] = {"force": [8.0, -6.0, 0.0], "force_frame": PLANAR.frame_names[-1]}
    run = al.simulate(al.RigidArm(PLANAR), law, np.zeros(PLANAR.n), t_end=0.3, dt=1e-3, sample_time=1e-3, check_limits=False, **push)
    assert run.estimate is not None and run.tau is not None and (run.contact is None) == (reaction is None)
    for k in range(len(run.t) - 1):
        np.testing.assert_array_equal(c(run.t[k], run.q[k], run.v[k]), run.tau[k], err_msg=f"sample {k}")
        np.testing.assert_array_equal(c.state, run.estimate[k], err_msg=f"sample {k}")


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("arm", ["tree", "six axes"])
def test_a_loop_closed_by_c_is_the_loop_of_armlet(arm: str, compiler: str, tmp_path: Path) -> None:
    """A loop in numpy advances the plant, and the C is the controller."""
    plant, dt, n = al.RigidArm(CHAINS[arm]), 1e-3, CHAINS[arm].n
    law = al.Adaptive(CHAINS[arm], MOTIONS["Sinusoid"](CHAINS[arm]), kp=40.0, kd=20.0, gamma=0.05)
    c = Controller(al.export_c(law, tmp_path, dt=dt), compiler)
    q0 = np.linspace(0.1, -0.2, n)
    run = al.simulate(plant, law, q0, t_end=0.1, dt=dt, sample_time=dt, check_limits=False)
    sim = al.Simulator(plant, None, q0, dt=dt, check_limits=False)
    for k in range(100):
        np.testing.assert_array_equal(np.append(sim.q, sim.v), np.append(run.q[k], run.v[k]), err_msg=f"sample {k}")
        sim.step(c(k * dt, sim.q, sim.v))


def test_without_a_step_the_state_advances_by_the_time_between_calls(tmp_path: Path) -> None:
    law = al.PID(PLANAR, target(PLANAR), kp=60.0, ki=40.0, kd=15.0)
    c = Controller(al.export_c(law, tmp_path, method="euler"), COMPILERS[0])
    q, v, w = np.array([0.1, 0.0, -0.1]), np.zeros(3), np.zeros(3)
    for before, t in ((None, 0.5), (0.5, 0.625), (0.625, 1.0)):
        if before is not None:
            w = w + (t - before) * (40.0 * (target(PLANAR) - q))
        tau = c(t, q, v)
        # The tolerance covers sums of two terms, one of which is fused.
        np.testing.assert_allclose(c.state, w, rtol=1e-15)
        np.testing.assert_array_equal(tau, law(t, q, v, state=c.state))


def test_off_its_grid_the_state_advances_by_the_time_between_calls(tmp_path: Path) -> None:
    law = al.PID(PLANAR, target(PLANAR), kp=60.0, ki=40.0, kd=15.0)
    c = Controller(al.export_c(law, tmp_path, dt=1e-3), COMPILERS[0])
    rate = 40.0 * (target(PLANAR) - np.zeros(3))
    for t in (0.0, 0.0004, 0.0021, 0.002105, 50.0, 50.1):
        c(t, np.zeros(3), np.zeros(3))
        np.testing.assert_allclose(c.state, t * rate, rtol=1e-12)


def test_a_sample_that_fails_has_a_status_and_the_last_answer(tmp_path: Path) -> None:
    law = al.PID(PLANAR, target(PLANAR), kp=60.0, ki=40.0, kd=15.0)
    c = Controller(al.export_c(law, tmp_path, dt=1e-3), COMPILERS[0])
    zeros = np.zeros(3)
    status, tau = c.status(0.0, [np.nan, 0.0, 0.0], zeros)
    assert status == 1
    np.testing.assert_array_equal(tau, zeros)
    first = c(0.0, [0.1, 0.2, 0.3], zeros)
    calls: list[tuple[float, Any, int]] = [(np.inf, zeros, 1), (0.001, [0.0, np.inf, 0.0], 1), (0.001, [2e6, 0.0, 0.0], 2)]
    for t, q, expected in [*calls, (0.001, [0.0, 0.0, 1e5], 0), (0.0, zeros, 5)]:
        status, tau = c.status(t, q, zeros)
        assert status == expected
        if status:
            np.testing.assert_array_equal(tau, first)
        else:
            first = tau
    status, tau = c.status(0.002, zeros, [0.0, 1e308, 1e308])
    assert status in (0, 4)
    again = Controller(al.export_c(law, tmp_path / "again", dt=1e-3), COMPILERS[0])
    np.testing.assert_array_equal(again(0.0, [0.1, 0.2, 0.3], zeros), law(0.0, [0.1, 0.2, 0.3], zeros))


METHODS = ("exact", "clamp", "damped", "chiaverini")


def tasks(arm: al.Arm) -> list[al.Task]:
    frame = str(arm.tip_frame)
    motion = al.Sinusoid([0.3, 0.2], np.array([[0.1], [0.1]]), [[2.0], [3.0]], [[0.0], [1.0]])
    return [al.Task(frame, "xy", motion=motion, gain=4.0), al.Task(frame, "z", target=[0.4], gain=2.0)]


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("arm", ["six axes", "seven axes"])
def test_priority_by_the_regular_route(arm: str, method: str, compiler: str, tmp_path: Path) -> None:
    """Away from singularities, the C has the results of the compiled loop. Close to a singularity it returns a status."""
    law = al.PriorityVelocity(CHAINS[arm], tasks(CHAINS[arm]), method=method)
    c = Controller(al.export_c(law, tmp_path), compiler)
    n = CHAINS[arm].n
    plant, dt = al.VelocityArm(CHAINS[arm]), 1e-3
    rng = np.random.default_rng(14)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "simulate: commands pass the arm's speed limits")
        run = al.simulate(plant, law, rng.uniform(0.3, 1.2, n), t_end=0.5, dt=dt, sample_time=dt, check_limits=False)
    assert run.stats["engine"] == al.build_info()["programs"]
    answered = [c.status(t, q, np.zeros(n)) for t, q in zip(run.t[:-1], run.q, strict=False)]
    for k, (status, u) in enumerate(answered):
        assert status in (0, 3)
        if status == 0:
            np.testing.assert_array_equal(u, run.tau[k], err_msg=f"sample {k}")
    assert sum(status == 0 for status, _ in answered) > 450
    # In 1,000 random states, the C is compared with the algorithm that armlet also uses at singularities.
    regular = 0
    for q in rng.uniform(-2.0, 2.0, (1000, n)):
        before = c.memory[:n].copy()
        status, u = c.status(0.1, q, np.zeros(n))
        if status == 0:
            regular += 1
            expected = law(0.1, q, np.zeros(n))
            # Near singularities velocities are large, and the two algorithms round differently.
            np.testing.assert_allclose(u, expected, rtol=1e-7, atol=1e-9)
        else:
            assert status == 3
            np.testing.assert_array_equal(u, before)
    assert regular > 300


def test_at_a_singularity_priority_holds_the_last_answer(tmp_path: Path) -> None:
    law = al.PriorityVelocity(SIX, tasks(SIX), method="exact")
    c = Controller(al.export_c(law, tmp_path), COMPILERS[0])
    u = c(0.0, np.full(6, 0.7), np.zeros(6))
    status, held = c.status(0.0, np.zeros(6), np.zeros(6))
    assert status == 3
    np.testing.assert_array_equal(held, u)


def test_priority_of_accelerations(tmp_path: Path) -> None:
    law = al.PriorityAcceleration(SEVEN, tasks(SEVEN))
    c = Controller(al.export_c(law, tmp_path), COMPILERS[0])
    run = al.simulate(al.RigidArm(SEVEN), law, np.full(7, 0.6), t_end=0.3, dt=1e-3, sample_time=1e-3, check_limits=False)
    answered = [c.status(*at) for at in zip(run.t[:-1], run.q, run.v, strict=False)]
    assert [status for status, _ in answered] == [0] * len(answered)
    np.testing.assert_array_equal([u for _, u in answered], run.tau[:-1])


def test_laws_that_cannot_be_exported_are_refused_by_name(tmp_path: Path) -> None:
    bounded = al.PriorityVelocity(SIX, tasks(SIX), method="sns", v_max=1.0)
    refused: list[tuple[Any, dict[str, Any], str]] = [
        (bounded, {}, "law has no C: .*got PriorityVelocity with a map that branches on its data"),
        (lambda t, q, v: -q, {}, "law cannot be exported: .*got a function in Python, which has no C"),
        (3, {}, "law cannot be exported: expected an arm or a law of armlet such as Adaptive, got 3"),
        (RIGID["PID"](SIX), {"dt": 0.0}, "dt is not positive"),
        (RIGID["PID"](SIX), {"dt": "1"}, "dt is not a number"),
        (RIGID["PID"](SIX), {"method": "dopri5"}, "method is unknown: expected one of euler, semi_implicit, rk4"),
        (RIGID["PID"](SIX), {"functions": ["gravity"]}, "functions is not used"),
        (RIGID["PID"](SIX), {"friction": True}, "friction is not used"),
    ]
    for law, arguments, message in refused:
        with pytest.raises(al.InputError, match=rf"^export_c: {message}"):
            al.export_c(law, tmp_path / "out", **arguments)
    assert not (tmp_path / "out").exists()
    long = al.ComputedTorque(PLANAR, al.Table(1e-3, *np.zeros((3, 150_000, 3))), kp=100.0, kd=20.0)
    with pytest.raises(al.InputError, match="motion is too long to be printed"):
        al.export_c(long, tmp_path / "out")


def test_a_library_with_the_options_of_its_cmake_file(tmp_path: Path) -> None:
    """With the options of the CMake file, which include fused instructions, the bits are equal."""
    law = RIGID["Adaptive"](SIX)
    files = al.export_c(law, tmp_path)
    options = re.findall(r"PRIVATE (.*)\)", files[2].read_text())
    assert options[1] == "-O3 -ffp-contract=off -fno-math-errno"
    assert options[2:] == ["-march=native", *(["-mfma"] if "fma(" in files[1].read_text() else [])]
    plain = Controller(files, COMPILERS[0])
    given = " ".join(option for option in options if option.startswith("-")).split()
    fast = Controller(files, COMPILERS[0], *given)
    for x in np.random.default_rng(15).uniform(-2.0, 2.0, (200, 2, 6)):
        np.testing.assert_array_equal(plain(0.1, *x), fast(0.1, *x))
        plain.init()
        fast.init()
