"""Loops as programs: which engine computes a run, and that all engines and structures give the same bits."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

# The gains are too stiff for light joints at this step size. The runs are only compared, so they need not be accurate.
pytestmark = pytest.mark.filterwarnings("ignore:.*balance does not close:UserWarning")

TWO = models.TWO_HEAVY_LINKS
SIX = models.SIX_AXES
OPTIONS: dict[str, Any] = {"t_end": 0.15, "dt": 1e-3, "record_every": 50}


def pd(arm: al.Arm, **gains: Any) -> al.PDGravity:
    return al.PDGravity(arm, np.linspace(0.3, -0.4, arm.n), **({"kp": 60.0, "kd": 15.0} | gains))


def series(run: Any) -> list[np.ndarray]:
    """The recorded series, without the monitors of the target model, which a run with a wall or torque limits does not have."""
    names = [name for name in sorted(run.monitors) if not name.startswith("target")]
    return [run.q, run.v, run.tau, *(run.monitors[name] for name in names)]


def test_stats_name_the_engine_of_a_run() -> None:
    plant, law, q0 = al.RigidArm(SIX), pd(SIX), np.zeros(6)
    programs = al.build_info()["programs"]
    assert programs in ("machine", "interpreter")
    assert al.simulate(plant, law, q0, **OPTIONS).stats["engine"] == programs
    assert al.simulate_batch(plant, law, np.zeros((3, 6)), **OPTIONS).stats["engine"] == programs
    assert al.simulate(plant, law, q0, t_end=2.0, method="dopri5").stats["engine"] == programs
    assert al.simulate_batch(plant, law, np.zeros((3, 6)), t_end=2.0, method="rodas4", t_eval=[2.0]).stats["engine"] == programs
    # The interpreter computes short runs of a new structure. Laws in Python run directly.
    new = al.planar_arm(np.random.default_rng().uniform(0.3, 0.5, 3), masses=[3.0, 3.0, 3.0])
    assert al.simulate(al.RigidArm(new), pd(new), np.zeros(3), t_end=0.015, dt=1e-3).stats["engine"] == "interpreter"
    own = al.simulate(plant, lambda t, q, v: -20.0 * q - 5.0 * v, q0, t_end=0.15, dt=1e-3, sample_time=1e-3)
    assert own.stats["engine"] == "direct"


def test_a_repeated_loop_reuses_its_program() -> None:
    # The lengths are random, because a program contains lengths as constants. So no stored program fits.
    arm = al.planar_arm(np.random.default_rng().uniform(0.3, 0.5, 3), masses=[1.0, 2.0, 3.0])
    plant, law, q0 = al.RigidArm(arm), pd(arm), np.array([0.1, 0.2, -0.3])
    options: dict[str, Any] = {"method": "dopri5", "rtol": 1e-8, "atol": 1e-10}
    first = al.simulate(plant, law, q0, t_end=0.001, **options)
    long = al.simulate(plant, law, q0, t_end=4.0, **options)
    again = al.simulate(plant, law, q0, t_end=0.001, **options)
    programs = al.build_info()["programs"]
    assert [run.stats["engine"] for run in (first, long, again)] == ["interpreter", programs, programs]
    for one, other in zip(series(first), series(again), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("options", [{"t_end": 5e-3, "dt": 1e-3}, {"t_end": 1e-3, "method": "dopri5"}], ids=["rk4", "dopri5"])
def test_many_short_runs_reach_machine_code(options: dict[str, Any]) -> None:
    arm = al.planar_arm(np.random.default_rng().uniform(0.3, 0.5, 3), masses=[1.0, 2.0, 3.0])
    runs = [al.simulate(al.RigidArm(arm), pd(arm), np.array([0.1, 0.2, -0.3]), **options) for _ in range(40)]
    assert [run.stats["engine"] for run in (runs[0], runs[-1])] == ["interpreter", al.build_info()["programs"]]
    for one, other in zip(series(runs[0]), series(runs[-1]), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("method", ["dopri5", "dop853", "rk4"])
@pytest.mark.parametrize("what", ["wall", "stops", "stick-slip", "all"])
def test_modes_are_inputs_of_programs(what: str, method: str) -> None:
    """A joint meets a stop and the tip a wall, or a joint comes to rest, within an interpreted run. Machine code has equal bits."""
    lengths = np.random.default_rng().uniform(0.4, 0.5, 2)
    arm = al.planar_arm(lengths, gravity=(0.0, 0.0)).with_drives(friction=[15.0, 0.5])
    q0, v0 = np.array([0.1, 0.2]), np.array([2.0, -1.0])
    tip = arm.position(q0 + 0.001 * v0, "link2")
    more: dict[str, Any] = {}
    if what in ("wall", "all"):
        more["wall"] = al.Wall("link2", tip, -arm.jacobian(q0, "link2")[:3] @ v0, stiffness=2e3, damping=5.0)
    if what in ("stops", "all"):
        more["stops"] = al.JointStops(500.0, 2.0, lower=-3.0, upper=[0.101, 3.0])
    if what in ("stick-slip", "all"):
        more["friction"] = "stick_slip"
    motion = al.Sinusoid(q0, [0.6, 0.5], 4.0, 0.0)
    plant, law = al.RigidArm(arm, **more), al.ComputedTorque(arm, motion, 100.0, 10.0)
    steps: dict[str, Any] = {"dt": 1e-3} if method == "rk4" else {"rtol": 1e-6, "atol": 1e-8}
    options: dict[str, Any] = {"v0": v0, "method": method, "check_limits": False, **steps}
    short = 0.06 if method == "rk4" else 0.01
    first, long, again = (al.simulate(plant, law, q0, t_end=t, **options) for t in (short, 6.0, short))
    programs = al.build_info()["programs"]
    assert [run.stats["engine"] for run in (first, long, again)] == ["interpreter", programs, programs]
    for one, other in zip(series(first), series(again), strict=True):
        np.testing.assert_array_equal(one, other)
    if "stops" in more:
        assert first.q[:, 0].max() > 0.101
    if "friction" in more:
        assert (long.v[:, 0] == 0.0).any() and (long.v[:, 0] != 0.0).any()


@pytest.mark.parametrize("law", ["pd", "adaptive"])
def test_a_short_run_is_the_start_of_a_long_one(law: str) -> None:
    made = LAWS[law](SIX, 0.1)
    short, long = (al.simulate(al.RigidArm(SIX), made, np.linspace(0.1, -0.2, 6), t_end=t, dt=1e-3) for t in (0.015, 0.15))
    assert short.stats["engine"] in ("interpreter", al.build_info()["programs"]) and long.stats["engine"] == al.build_info()["programs"]
    for one, other in zip(series(short), series(long), strict=True):
        # The last step ends at `t_end` and differs from `dt` by rounding.
        np.testing.assert_array_equal(one[:-1], other[: len(one) - 1])


def quintic(arm: al.Arm, duration: float) -> al.Quintic:
    return al.Quintic(np.zeros(arm.n), np.full(arm.n, 0.4), duration)


def redundant(arm: al.Arm, duration: float, projection: Any, **options: Any) -> al.CartesianImpedance:
    """An impedance law of a moving position (and an orientation if there are enough joints), with all options."""
    rows, start = (1, np.array([0.0])) if arm.n == 2 else (2, np.array([0.1, 0.1]))
    target = al.Quintic(start, start + 0.2, duration)
    posture = al.NullSpace(np.full(arm.n, 0.2), 20.0, 10.0, projection=projection)
    given: dict[str, Any] = {"frame": arm.tip_frame, "axes": ["y", "y rz"][rows - 1], "nullspace": posture, "feedforward": np.ones(rows)}
    return al.CartesianImpedance(arm, target, 100.0, 20.0, eps=0.1, **given, **options)


def pid(arm: al.Arm, motion: al.Motion, **options: Any) -> al.PID:
    """A PID law with all options besides its gains."""
    given: dict[str, Any] = {"derivative_filter": 90.0, "friction": True, "observer_bandwidth": 30.0}
    return al.PID(arm, motion, kp=60.0, ki=40.0, kd=15.0, **given, **options)


LAWS: dict[str, Callable[[al.Arm, float], Any]] = {
    "pd": lambda arm, _: pd(arm),
    "full gain": lambda arm, _: pd(arm, kp=60.0 * np.eye(arm.n) + 1.0),
    "adaptive": lambda arm, duration: al.Adaptive(arm, quintic(arm, duration), kp=40.0, kd=20.0, gamma=0.2),
    "adaptive to joints": lambda arm, duration: al.Adaptive(
        arm, quintic(arm, duration), 40.0, 20.0, 0.2, friction=("viscous", "coulomb", "stribeck"), armature=True, leakage=0.1, dead_zone=0.1
    ),
    "composite adaptive": lambda arm, duration: al.Adaptive(
        arm, quintic(arm, duration), 40.0, 20.0, 0.2, friction=True, armature=True, composite=0.3, composite_rate=8.0
    ),
    "pid": lambda arm, _: al.PID(arm, np.full(arm.n, 0.3), kp=60.0, ki=40.0, kd=15.0),
    "pid within limits": lambda arm, _: al.PID(arm, np.full(arm.n, 0.3), kp=60.0, ki=40.0, kd=15.0, tau_max=5.0),
    "pid with filters": lambda arm, duration: pid(arm, quintic(arm, duration)),
    "pid with filters within limits": lambda arm, duration: pid(arm, quintic(arm, duration), tau_max=5.0, nominal_inertia=0.4),
    "computed torque": lambda arm, duration: al.ComputedTorque(arm, quintic(arm, duration), kp=100.0, kd=20.0),
    "impedance": lambda arm, _: al.CartesianImpedance(arm, [0.5, 0.2], 300.0, 60.0, frame=arm.tip_frame, axes="xy"),
    "null space": lambda arm, duration: redundant(arm, duration, "consistent", compensate_coupling=True, integral_gain=30.0),
    "null space within limits": lambda arm, duration: redundant(arm, duration, "static", integral_gain=30.0, wrench_max=20.0, tau_max=8.0),
}


@pytest.mark.parametrize("held", [False, True], ids=["continuous", "sampled"])
@pytest.mark.parametrize("method", ["euler", "semi_implicit", "rk4"])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("arm", [TWO, SIX], ids=["2R", "six axes"])
def test_a_program_is_the_loop(arm: al.Arm, law: str, method: str, held: bool) -> None:
    """The reference has a force that is a Python function with the value zero, so it has another program."""
    plant, made, q0 = al.RigidArm(arm), LAWS[law](arm, 0.1), np.linspace(0.1, -0.2, arm.n)
    options: dict[str, Any] = {"t_end": 0.3, "dt": 1e-3, "record_every": 30, "method": method, "tau_max": 40.0} | (
        {"sample_time": 5e-3} if held else {}
    )
    program = al.simulate(plant, made, q0, **options)
    pushed = al.simulate(plant, made, q0, **options, force=lambda t: np.zeros(3), force_frame=arm.frame_names[-1])
    assert program.stats["engine"] == pushed.stats["engine"] == al.build_info()["programs"]
    for one, other in zip(series(program), series(pushed), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("law", [*LAWS])
def test_repeated_calls_of_a_law_have_equal_bits(law: str) -> None:
    """From its 17th call on, a law runs as a program, except for angles beyond the range of the program's sine."""
    arm = al.planar_arm([1.0, 0.7, 0.4])
    asked, rng = LAWS[law](arm, 0.5), np.random.default_rng(5)
    states = [(t, rng.normal(size=3), rng.normal(size=3)) for t in np.linspace(0.0, 0.6, 40)]
    states[30] = (0.1, np.array([3e7, 0.1, -0.2]), states[30][2])
    for t, q, v in states:
        np.testing.assert_array_equal(asked(t, q, v), LAWS[law](arm, 0.5)(t, q, v))


@pytest.mark.parametrize("batch", [False, True])
def test_other_limits_or_frames_need_another_program(batch: bool) -> None:
    plant, made, q0 = al.RigidArm(TWO), pd(TWO), np.array([0.9, -0.8])
    frames = TWO.frame_names[-2:]
    assert len(frames) == 2
    runs = []
    for tau_max in (None, 6.0, 2.0):
        for frame in frames:
            span: dict[str, Any] = {"t_end": 0.15, "dt": 1e-3, "tau_max": tau_max, "force_frame": frame, "monitors": False}
            direct = al.simulate(plant, made, q0, **span, force=lambda t: np.array([2.0, -3.0, 0.0]))
            span["force"] = [2.0, -3.0, 0.0]
            q = al.simulate_batch(plant, made, [q0], **span).q[0] if batch else al.simulate(plant, made, q0, **span).q
            np.testing.assert_array_equal(q, direct.q)
            runs.append(direct.q[-1])
    # The runs differ, so limits and frames have an effect.
    assert len({tuple(q) for q in runs}) == 6


# The arm cannot reach this wall. The mode of the contact is an input of the program.
FAR = al.Wall(TWO.frame_names[-1], [-50.0, 0.0, 0.0], [1.0, 0.0, 0.0], stiffness=1e3)
METHODS: dict[str, dict[str, Any]] = {
    "dopri5": {"rtol": 1e-8, "atol": 1e-10},
    "dop853": {"rtol": 1e-12, "atol": 1e-14},
    "rodas4": {"rtol": 1e-6, "atol": 1e-8},
    "radau5": {"rtol": 1e-6, "atol": 1e-8},
    "ros2": {"dt": 1e-3},
}


@pytest.mark.parametrize("held", [False, True], ids=["continuous", "sampled"])
@pytest.mark.parametrize("method", METHODS)
# Where a torque reaches its limit the derivative jumps. There Newton's iteration may find a different result within the tolerance.
@pytest.mark.parametrize("law", [law for law in LAWS if not law.endswith("within limits")])
def test_a_wall_out_of_reach_changes_nothing(law: str, method: str, held: bool) -> None:
    made, q0, times = LAWS[law](TWO, 0.5), np.linspace(0.1, -0.2, 2), np.linspace(0.0, 0.6, 7)
    sampled = {"sample_time": 1e-3} if held else {}
    recorded = {"record_every": 100} if method == "ros2" else {"t_eval": times}
    options = METHODS[method] | sampled | recorded | {"t_end": 0.6, "method": method}
    free = al.simulate(al.RigidArm(TWO), made, q0, **options)
    walled = al.simulate(al.RigidArm(TWO, wall=FAR), made, q0, **options)
    assert free.stats["engine"] == walled.stats["engine"] == al.build_info()["programs"]
    for one, other in zip(series(free), series(walled), strict=True):
        if method in ("dopri5", "dop853"):
            np.testing.assert_array_equal(one, other)
        else:
            # The Jacobians of ros2 round differently, which light joints amplify. Newton's iteration may take another step, which
            # changes the result within its tolerance. Filters multiply the differences by their rates.
            tolerance = 5e-7 if "filters" in law else 1e-8
            np.testing.assert_allclose(one, other, rtol=tolerance, atol=tolerance)


def test_rows_of_adaptive_batches_equal_single_runs() -> None:
    """The rows have gains in several forms (numbers, vectors, matrices) and different parameters. All runs are programs."""
    gains: list[Any] = [60.0, 1.0, [60.0, 1.0], 60.0 * np.eye(2) + 1.0, 61.0]
    arms = [TWO.with_parameters(np.asarray(TWO.parameters) * (1.0 + 0.1 * k)) for k in range(len(gains))]
    laws, plants = [pd(arm, kp=kp) for arm, kp in zip(arms, gains, strict=True)], [al.RigidArm(arm) for arm in arms]
    q0 = np.array([[0.3, -0.4], *np.linspace([0.1, 0.1], [3.0, -4.0], len(gains) - 1)])
    for method in ("dop853", "rodas4"):
        options: dict[str, Any] = {"t_end": 1.5, "method": method, "t_eval": [0.5, 1.0, 1.5]}
        batches = [al.simulate_batch(plants, laws, q0, threads=threads, **options) for threads in (1, 2)]
        runs = [al.simulate(plant, law, q, **options) for plant, law, q in zip(plants, laws, q0, strict=True)]
        assert [run.stats["engine"] for run in runs] == [al.build_info()["programs"]] * len(gains)
        for i, run in enumerate(runs):
            for batch in batches:
                for rows, alone in zip(series(batch), series(run), strict=True):
                    np.testing.assert_array_equal(rows[i], alone)


@pytest.mark.parametrize("driven", [False, True], ids=["law", "driven"])
def test_a_simulator_of_an_implicit_method_runs_programs(driven: bool) -> None:
    made, q0 = pd(TWO), np.linspace(0.1, -0.2, 2)
    steps = [al.Simulator(plant, made, q0, dt=2e-3, method="ros2") for plant in (al.RigidArm(TWO), al.RigidArm(TWO, wall=FAR))]
    for _ in range(200):
        for step in steps:
            step.step(*([[1.0, -0.5]] if driven else []))
    np.testing.assert_allclose(steps[0].q, steps[1].q, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(steps[0].v, steps[1].v, rtol=1e-10, atol=1e-10)


def test_rows_of_other_structure_do_not_touch_one_another() -> None:
    """The rows have gains in several forms, and some have other parameters. Each row equals a single run to the last bit."""
    gains: list[Any] = [60.0, 1.0, [60.0, 1.0], [1.0, 60.0], 60.0 * np.eye(2) + 1.0, np.eye(2), 61.0, [1.0, 1.0], 62.0, [60.0, 61.0]]
    arms = [TWO.with_parameters(np.asarray(TWO.parameters) * (1.0 + 0.1 * k)) if k % 3 == 0 else TWO for k in range(len(gains))]
    laws = [pd(arm, kp=kp) for arm, kp in zip(arms, gains, strict=True)]
    plants = [al.RigidArm(arm) for arm in arms]
    q0 = np.linspace([0.0, 0.1], [0.3, -0.4], len(gains))
    batch = al.simulate_batch(plants, laws, q0, **OPTIONS)
    for i, (plant, law) in enumerate(zip(plants, laws, strict=True)):
        for rows, alone in zip(series(batch), series(al.simulate(plant, law, q0[i], **OPTIONS)), strict=True):
            np.testing.assert_array_equal(rows[i], alone)


def test_more_structures_than_are_kept() -> None:
    """Seventy geometries need more programs than armlet stores. Dropped programs are made again with equal bits."""
    arms = [al.planar_arm([0.5 + 0.001 * k, 0.4]) for k in range(70)]
    runs = [[al.simulate(al.RigidArm(arm), pd(arm), [0.1, 0.2], t_end=0.1, dt=1e-3).q for arm in arms] for _ in range(2)]
    for first, second in zip(*runs, strict=True):
        np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("start", [9.9e5, 1.0e6 + 3.0, 4.0e8])
def test_angles_beyond_the_range_of_the_polynomials(start: float) -> None:
    """A run with an angle beyond the range of the sines of machine code is repeated by the interpreter. Other rows keep their bits."""
    plant, law = al.RigidArm(TWO), al.PDGravity(TWO, [start, 0.0], 50.0, 20.0)
    options = OPTIONS | {"state_limit": 1e12}
    far = al.simulate(plant, law, [start, 0.1], **options)
    short = al.simulate(plant, law, [start, 0.1], **(options | {"t_end": 0.05}))
    np.testing.assert_array_equal(far.q[:2], short.q)
    pushed = al.simulate(plant, law, [start, 0.1], **options, force=lambda t: np.zeros(3), force_frame=TWO.frame_names[-1])
    engine = "interpreter" if max(np.abs(far.q[:, 0])) > 1e6 else al.build_info()["programs"]
    assert far.stats["engine"] == pushed.stats["engine"] == engine
    for one, other in zip(series(far), series(pushed), strict=True):
        np.testing.assert_array_equal(one, other)
    near = al.PDGravity(TWO, [0.3, 0.0], 50.0, 20.0)
    batch = al.simulate_batch(plant, [near, law, near], [[0.0, 0.1], [start, 0.1], [0.2, 0.1]], **options)
    for rows, alone in zip(series(batch), series(far), strict=True):
        np.testing.assert_array_equal(rows[1], alone)
    assert batch.stats["engine"] == al.build_info()["programs"]
    every = options | {"record_every": 1}
    summed = al.simulate_batch(plant, law, [[start, 0.1]], keep="metrics", **every)
    assert summed.stats["engine"] == far.stats["engine"]
    for name, values in al.simulate_batch(plant, law, [[start, 0.1]], **every).metrics().items():
        np.testing.assert_allclose(summed.metrics()[name], values, rtol=1e-9, atol=1e-9, err_msg=name)
    np.testing.assert_array_equal(batch.q[2], al.simulate(plant, near, [0.2, 0.1], **options).q)


@pytest.mark.parametrize("method", ["dop853", "rodas4"])
def test_an_adaptive_run_leaves_the_range_of_the_polynomials(method: str) -> None:
    """When an angle exceeds 1e6 rad, the interpreter continues a run with an adaptive method.

    The run is compared with the same run at angles that are smaller by a multiple of 2 pi. An angle of 1e6 rad has an error of 1e-10 rad.
    """
    limit, less = 1.0e6, 2.0 * np.pi * 159155
    law = al.PDGravity(TWO, [limit + 300.0, 0.0], 50.0, 20.0)
    options: dict[str, Any] = {"t_end": 3.0, "method": method, "t_eval": [1.0, 2.0, 3.0], "state_limit": 1e12, "rtol": 1e-9, "atol": 1e-6}
    far = al.simulate(al.RigidArm(TWO), law, [limit - 300.0, 0.1], **options)
    assert far.q[0, 0] > limit > far.q[0, 0] - 600.0
    law = al.PDGravity(TWO, [limit + 300.0 - less, 0.0], 50.0, 20.0)
    near = al.simulate(al.RigidArm(TWO), law, [limit - 300.0 - less, 0.1], **options)
    assert [run.stats["engine"] for run in (far, near)] == [al.build_info()["programs"]] * 2
    np.testing.assert_allclose(far.q, near.q + np.array([less, 0.0]), rtol=0.0, atol=1e-7 if method == "dop853" else 1e-3)


COMPARED = """
import sys
import numpy as np, armlet as al
arm = al.load_urdf(al.example_urdf("six_axis"))
law = al.ComputedTorque(arm, al.Quintic(np.zeros(6), np.full(6, 0.4), 0.1), 100.0, 20.0)
run = al.simulate(al.RigidArm(arm), law, np.linspace(0.1, -0.2, 6), t_end=0.15, dt=1e-3)
batch = al.simulate_batch(al.RigidArm(arm), law, np.linspace(np.zeros(6), np.full(6, 0.3), 11), t_end=0.15, dt=1e-3)
ordered = al.PriorityAcceleration(arm, [al.Task("flange", "xyz", [0.4, 0.2, 0.5], 40.0), al.Task("flange", "rx ry", [0.3, 1.0], 40.0)])
tasks = al.simulate_batch(al.RigidArm(arm), ordered, np.linspace(np.zeros(6), np.full(6, 0.3), 3), t_end=0.15, dt=1e-3)
q = np.linspace(np.full(6, -0.7), np.full(6, 0.9), 50)
J = arm.jacobian(q, "flange")
v = al.solve_priority([J[:, :3], J[:, 3:5]], [[0.1, 0.2, 0.3], [0.4, 0.5]]).v
w = al.PrioritySolver.for_arm(arm, [al.Task("flange", "xyz"), al.Task("flange", "rx")]).solve(q, [[0.1, 0.2, 0.3], [0.4]])
free = [al.simulate(al.RigidArm(arm), law, np.linspace(0.1, -0.2, 6), t_end=1.0, method=method) for method in ("dopri5", "rodas4")]
print(run.stats["engine"], batch.stats["engine"], free[0].stats["engine"], free[1].stats["engine"], al.build_info()["programs"])
parts = [run.q, run.tau, batch.q, batch.tau, tasks.q, tasks.tau, v, w, *(part for run in free for part in (run.q, run.tau))]
print(b"".join(part.tobytes() for part in parts).hex())
"""


@pytest.mark.slow
@pytest.mark.parametrize("isa", [None, "baseline"])
def test_the_interpreter_gives_the_bits_of_machine_code(isa: str | None) -> None:
    held = {"ARMLET_ISA": isa} if isa else {}
    environment = {name: value for name, value in os.environ.items() if name not in ("ARMLET_PROGRAMS", "ARMLET_ISA")} | held
    found = []
    # "portable" is the name of the interpreter in earlier versions.
    for way in ({}, {"ARMLET_PROGRAMS": "interpreter"}, {"ARMLET_PROGRAMS": "portable"}):
        done = subprocess.run([sys.executable, "-P", "-c", COMPARED], capture_output=True, text=True, env=environment | way, check=True)
        found.append(done.stdout.split())
    assert found[1][:5] == found[2][:5] == ["interpreter"] * 5
    assert found[0][5] == found[1][5] == found[2][5]
