"""Bounds of accelerations in sampled loops: closed loops keep all limits, starts outside return, and torque limits rank first.

The loops of `motion` move the joints exactly with the acceleration of each sample, as a perfect actuator does. So only rounding remains.
ARMLET_LIMIT_MOTIONS is the number of random motions.
"""

from __future__ import annotations

import itertools
import os
import warnings
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
SEVEN: al.Arm = models.SEVEN_AXES
TOOL = SEVEN.frame_names[-1]
LOW, HIGH, SPEED = (SEVEN.limits[name] for name in ("q_min", "q_max", "v_max"))
METHODS = ["exact", "clamp", "damped"]
MOTIONS = int(os.environ.get("ARMLET_LIMIT_MOTIONS", "20"))


def start(rng: np.random.Generator) -> Array:
    return np.asarray(LOW + rng.uniform(0.2, 0.8, 7) * (HIGH - LOW))


def random_law(rng: np.random.Generator, **limits: Any) -> Any:
    """A tip that moves fast along sines, partly out of reach, and a posture partly beyond the limits."""
    tip = al.Sinusoid(rng.uniform(-0.6, 0.6, 3), rng.uniform(0.3, 1.2, 3), rng.uniform(0.5, 6.0, 3), rng.uniform(0.0, 6.0, 3))
    tasks = [al.Task(TOOL, "xyz", tip, 10 ** rng.uniform(1.0, 3.0)), al.PostureTask(rng.uniform(-4.0, 4.0, 7), 10 ** rng.uniform(1.0, 2.5))]
    return al.PriorityAcceleration(SEVEN, tasks, METHODS[int(rng.integers(3))], limits=True, **limits)


def motion(law: Any, q: Array, v: Array, h: float, count: int) -> Any:
    """The states at the samples, `(count + 1, n)` each, and the terms of each sample."""
    positions, speeds, terms = [q], [v], []
    for k in range(count):
        terms.append(law.terms(k * h, q, v, sample_time=h))
        a = terms[-1]["a"]
        q, v = q + v * h + 0.5 * a * h * h, v + a * h
        positions.append(q)
        speeds.append(v)
    return np.array(positions), np.array(speeds), terms


def extremes(q: Array, v: Array, a: Array, h: float) -> tuple[Array, Array]:
    """The least and the largest positions of each sample, also between its ends."""
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.where(v[:-1] * v[1:] < 0.0, q[:-1] - v[:-1] ** 2 / (2.0 * a), q[:-1])
    ends = np.stack([q[:-1], q[1:], turn])
    return ends.min(axis=0), ends.max(axis=0)


def torque_for_all(q: Array, v: Array, a_max: Array) -> Array:
    """The largest torque of each joint over all accelerations within a_max, `(..., n)`."""
    return np.asarray(np.abs(SEVEN.mass_matrix(q)) @ a_max + np.abs(SEVEN.bias(q, v)))


def test_random_motions_keep_all_limits() -> None:
    """Positions, speeds, accelerations and torques at the samples, and positions between them. The torques are sufficient for a_max."""
    limited = 0
    for seed in range(MOTIONS):
        rng = np.random.default_rng(seed)
        h, a_max = 10 ** rng.uniform(-3.0, -1.3), rng.uniform(3.0, 20.0, 7)
        tau_max = 2.0 * torque_for_all(np.array([start(rng) for _ in range(20)]), np.zeros((20, 7)) + SPEED, a_max).max(axis=0) + 50.0
        law = random_law(rng, a_max=a_max, tau_max=tau_max)
        q, v, terms = motion(law, start(rng), np.zeros(7), h, 80)
        # The proof that every acceleration within a_max has a torque within its limit.
        assert (torque_for_all(q, v, a_max) <= tau_max).all()
        a, tau = (np.array([each[name] for each in terms]) for name in ("a", "tau"))
        low, high = extremes(q, v, a, h)
        assert (low >= LOW - 1e-9).all() and (high <= HIGH + 1e-9).all()
        assert (np.abs(v) <= SPEED + 1e-9).all() and (np.abs(a) <= a_max + 1e-9).all() and (np.abs(tau) <= tau_max + 1e-9).all()
        assert all(each["status"] is not al.Status.INFEASIBLE for each in terms)
        limited += any(each["limits"] for each in terms)
    assert limited > 0.9 * MOTIONS


def test_torque_limits_rank_above_all_others() -> None:
    """With weak motors, torques never pass their limits, and other limits only after a sample whose status is INFEASIBLE."""
    contradictions = 0
    for seed in range(max(MOTIONS // 4, 4)):
        rng = np.random.default_rng([seed, 1])
        q0, a_max, h = start(rng), rng.uniform(5.0, 20.0, 7), 5e-3
        tau_max = 1.1 * np.abs(SEVEN.gravity(q0)) + rng.uniform(0.5, 8.0, 7)
        q, v, terms = motion(random_law(rng, a_max=a_max, tau_max=tau_max), q0, np.zeros(7), h, 80)
        infeasible = np.array([each["status"] is al.Status.INFEASIBLE for each in terms])
        missed = np.array([np.abs(each["limit_violations"]).max() for each in terms])
        assert (np.abs([each["tau"] for each in terms]) <= tau_max * (1 + 1e-9)).all()
        assert (missed[~infeasible] < 1e-9).all() and (missed[infeasible] > 0.0).all()
        until = 1 + (int(infeasible.argmax()) if infeasible.any() else len(terms))
        assert (q[:until] >= LOW - 1e-9).all() and (q[:until] <= HIGH + 1e-9).all() and (np.abs(v[:until]) <= SPEED + 1e-9).all()
        contradictions += int(infeasible.any())
    assert contradictions > 0


@pytest.mark.parametrize("method", METHODS)
def test_a_start_outside_of_the_limits_returns(method: str) -> None:
    for seed in range(3):
        rng = np.random.default_rng([seed, 2])
        q0, v0 = start(rng), np.zeros(7)
        q0[1], q0[3], v0[1], v0[5] = HIGH[1] + 0.3, LOW[3] - 0.2, 0.5, 2.0 * SPEED[5]
        law = al.PriorityAcceleration(SEVEN, [al.PostureTask(q0 + 1.0, 30.0)], method, limits=True, a_max=10.0)
        q, v, _ = motion(law, q0, v0, 5e-3, 300)
        outside = np.maximum(np.maximum(LOW - q, q - HIGH), 0.0)
        assert outside[0].max() > 0.15 and outside[-1].max() < 1e-9 and (np.abs(v[-1]) <= SPEED + 1e-9).all()
        # Braking from 0.5 rad/s takes 10 samples, and 0.0125 rad. Then the distances never increase.
        assert (np.diff(outside[11:], axis=0) <= 1e-12).all() and outside.max() <= 0.3 + 0.5**2 / 20.0 + 1e-9


def test_a_joint_brakes_with_its_largest_deceleration_and_rests_at_its_limit() -> None:
    arm = models.PENDULUM
    law = al.PriorityAcceleration(arm, [al.PostureTask([9.0], 100.0)], "exact", q_max=1.0, v_max=2.0, a_max=4.0)
    q, v, terms = motion(law, np.zeros(1), np.zeros(1), 0.01, 250)
    a = np.array([each["a"][0] for each in terms])
    # From rest to 2 rad/s in 0.5 s, then braking for 0.5 s: 0.5 rad each, as in the time-optimal motion. Rounding of v is divided by h.
    assert np.abs(a[:50] - 4.0).max() < 1e-9 and np.abs(a[50:99] + 4.0).max() < 1e-9 and a.min() >= -4.0 - 1e-9
    assert q.max() <= 1.0 + 1e-15 and np.abs(q[101:] - 1.0).max() < 1e-12 and np.abs(v[102:]).max() < 1e-12


def test_the_active_set_is_quiet_at_rest() -> None:
    """An arm that pushes against limits: after it came to rest, each limit changes at most twice per second."""
    for seed, method in enumerate(METHODS):
        rng = np.random.default_rng([seed, 3])
        target = np.where(rng.uniform(size=7) < 0.5, HIGH + 0.5, LOW - 0.5)
        law = al.PriorityAcceleration(SEVEN, [al.PostureTask(target, 40.0)], method, limits=True, a_max=20.0)
        h, count = 5e-3, 800
        _, v, terms = motion(law, start(rng), np.zeros(7), h, count)
        assert np.abs(v[-100:]).max() < 1e-9
        sets = [{(limit.row, limit.side) for limit in each["limits"]} for each in terms[-200:]]
        changes = sum(len(one ^ two) for one, two in itertools.pairwise(sets))
        assert changes <= 2 * 200 * h and any(sets)


def test_runs_report_the_torque_that_contradicts_a_limit() -> None:
    """A heavy link falls towards its limit, and the motor is too weak to stop it."""
    arm = models.PENDULUM
    weight = float(np.abs(arm.gravity([np.pi / 2])[0]))
    law = al.PriorityAcceleration(arm, [al.PostureTask([0.0], 20.0)], "exact", q_min=0.4, a_max=30.0, tau_max=0.3 * weight)
    with pytest.warns(UserWarning, match="simulate: torque limits contradict other limits: at .* records from t = ") as heard:
        run = al.simulate(al.RigidArm(arm), law, [1.2], v0=[-1.0], t_end=0.6, dt=1e-3, sample_time=1e-2, check_limits=False)
    assert len(heard) == 1 and run.status is al.Status.SUCCESS
    assert np.abs(run.tau).max() <= 0.3 * weight * (1 + 1e-12) and run.q.min() < 0.4
    assert run.monitors["violation_0"].max() > 1.0
    held = [hold for hold in run.active if hold.level == 0]
    assert held and {hold.name for hold in held} == {"torque of joint 1"}
    terms = law.terms(0.0, [0.41], [-2.0], sample_time=1e-2)
    assert terms["status"] is al.Status.INFEASIBLE and "torque of joint 1" in {limit.name for limit in terms["limits"]}


def test_weak_torque_limits_explain_a_missed_task() -> None:
    arm = models.PENDULUM
    law = al.PriorityAcceleration(arm, [al.PostureTask([1.0], 100.0)], "exact", tau_max=0.5)
    terms = law.terms(0.0, [0.0], [0.0])
    assert terms["tau"][0] == pytest.approx(0.5, abs=1e-12) and "limit_violations" not in terms
    assert "torque of joint 1 at its upper bound (level 0) takes 100 %" in terms["why"][0]
    # Infinite limits change nothing.
    free, wide = (al.PriorityAcceleration(arm, [al.PostureTask([1.0], 100.0)], "exact", tau_max=limit) for limit in (None, np.inf))
    assert wide(0.0, [0.0], [0.0])[0] == pytest.approx(free(0.0, [0.0], [0.0])[0], abs=1e-12)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tau_max": 0.0}, "tau_max is not positive"),
        ({"tau_max": [1.0, 2.0]}, "tau_max has the wrong shape"),
        ({"tau_max": float("nan")}, "tau_max"),
        ({"tau_max": 1.0, "method": "chiaverini"}, "tau_max bounds nothing: expected clamp, damped, exact or sns"),
    ],
)
def test_wrong_torque_limits_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(al.InputError, match=words):
        al.PriorityAcceleration(SEVEN, [al.Task(TOOL, "x", [0.3])], **options)


def test_limits_of_the_arm_include_its_efforts() -> None:
    """`limits=True` reads the efforts of the file. A zero or a missing effort is named, and `tau_max` replaces all efforts."""
    q, v = np.array([0.3, -0.5, 0.2, -1.5, 0.1, 1.2, 0.4]), np.zeros(7)
    task = al.PostureTask(q + 1.0, 1e6)
    own, given, free = (
        al.PriorityAcceleration(SEVEN, [task], "exact", limits=True, tau_max=tau) for tau in (None, SEVEN.limits["effort"], np.inf)
    )
    torque = own.terms(0.0, q, v, sample_time=0.01)["tau"]
    assert (np.abs(torque) <= SEVEN.limits["effort"] * (1 + 1e-9)).all()
    np.testing.assert_array_equal(torque, given.terms(0.0, q, v, sample_time=0.01)["tau"])
    assert (np.abs(free.terms(0.0, q, v, sample_time=0.01)["tau"]) > SEVEN.limits["effort"]).any()
    # The speeds of a law of velocities have no torque.
    assert "limit_violations" not in al.PriorityVelocity(SEVEN, [al.PostureTask(q, 1.0)], limits=True).terms(0.0, q, v)


@pytest.mark.parametrize(("effort", "text"), [("effort='0'", "joint a has the effort limit 0"), ("", "joint a has no effort limit")])
def test_efforts_that_bound_nothing_are_named(effort: str, text: str, tmp_path: Any) -> None:
    joint = "<joint name='{0}' type='revolute'><parent link='{1}'/><child link='{2}'/><axis xyz='0 1 0'/>{3}</joint>"
    limit = "<limit lower='-1' upper='1' velocity='2' {}/>"
    link = "<link name='{}'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link>"
    parts = [link.format(name) for name in ("base", "one", "two")] + [
        joint.format("a", "base", "one", limit.format(effort)),
        joint.format("b", "one", "two", limit.format("effort='5'")),
    ]
    path = tmp_path / "two.urdf"
    path.write_text(f"<robot name='two'>{''.join(parts)}</robot>")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        arm = al.load_urdf(path)
    with pytest.warns(UserWarning, match=text):
        law = al.PriorityAcceleration(arm, [al.PostureTask([9.0, 9.0], 100.0)], "exact", limits=True)
    tau = law.terms(0.0, [0.0, 0.0], [0.0, 0.0])["tau"]
    assert abs(tau[1]) <= 5.0 * (1 + 1e-12) < abs(tau[0])


def test_batches_warn_of_torques_that_contradict_limits() -> None:
    arm = models.PENDULUM
    weight = float(np.abs(arm.gravity([np.pi / 2])[0]))
    times = {"t_end": 0.6, "dt": 1e-3, "sample_time": 1e-2, "check_limits": False}
    weak, strong = (
        al.PriorityAcceleration(arm, [al.PostureTask([0.8], 20.0)], "exact", q_min=0.4, a_max=30.0, tau_max=k * weight) for k in (0.3, 9.0)
    )
    with pytest.warns(UserWarning, match=r"simulate_batch: torque limits contradict other limits in 1 of 2 runs \(first bad index 1\)"):
        al.simulate_batch(al.RigidArm(arm), [strong, weak], [[1.2]] * 2, v0=[[-1.0]] * 2, **times)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        al.simulate(al.RigidArm(arm), strong, [1.2], v0=[-1.0], **times)
