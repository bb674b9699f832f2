"""Events, contacts and dense output of runs: times of events to rounding, balances through impacts, states between records."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

ARM = models.TWO_HEAVY_LINKS
WALL = al.Wall("link2", [0.75, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=1e4, damping=50.0)
PRESS = al.CartesianImpedance(ARM, [0.85, 0.1], [300.0, 300.0], [10.0, 10.0], frame="link2", axes="xy")
START = [0.3, 1.0]
ADAPTIVE = ("dopri5", "dop853", "radau5", "rodas4")


def press(**options: Any) -> al.Run:
    return al.simulate(al.RigidArm(ARM, wall=WALL), PRESS, START, **({"t_end": 1.0, "method": "dop853"} | options))


# One link without gravity on a spring and a damper: a'' + 2 a' + 26 a = 0 about 0.4 rad, from rest at 0.
LINK = al.pendulum(1.0, 0.0)
SWING = al.ComputedTorque(LINK, al.Hold([0.4]), 26.0, 2.0)


def swing_exact(t: Array) -> Array:
    return 0.4 - 0.4 * np.exp(-t) * (np.cos(5.0 * t) + 0.2 * np.sin(5.0 * t))


def swing(**options: Any) -> al.Run:
    return al.simulate(al.RigidArm(LINK), SWING, [0.0], **({"t_end": 3.0, "method": "dop853", "rtol": 1e-10, "atol": 1e-12} | options))


@pytest.mark.parametrize("method", ADAPTIVE)
def test_turning_points_are_where_they_are(method: str) -> None:
    run = swing(method=method, events=[al.Event.speed(0)])
    assert run.events is not None
    # v = 2.08 exp(-t) sin 5t is zero at multiples of pi/5; the start does not count. The times agree to 8e-11 s.
    np.testing.assert_allclose(run.events.t, np.pi / 5 * np.arange(1, 5), rtol=0.0, atol=2e-8)
    np.testing.assert_allclose(run.events.q[:, 0], swing_exact(run.events.t), rtol=0.0, atol=1e-8)
    assert run.status is al.Status.SUCCESS and abs(run.t[-1] - 3.0) < 1e-14


def test_directions_names_and_stops() -> None:
    up = al.Event.joint(0, 0.4, direction=1, name="up")
    down = al.Event.joint(0, 0.4, direction=-1)
    run = swing(events=[up, down])
    assert run.events is not None and run.events.names == ("up", "joint(0)") and set(run.events.which) == {0, 1}
    assert np.all(run.events.of("up").v > 0.0) and np.all(run.events.of(1).v < 0.0)
    assert np.all(np.diff(run.events.t) > 0.0) and len(run.events) == len(run.events.of(0)) + len(run.events.of(1))
    second = swing(events=[al.Event.joint(0, 0.4, direction=1, stop=2)])
    assert second.events is not None and second.status is al.Status.EVENT
    # The run ends at the second upward crossing, and its last record is there.
    np.testing.assert_array_equal(second.events.t, run.events.of("up").t[:2])
    assert second.t[-1] == second.events.t[-1] and abs(second.q[-1, 0] - 0.4) < 1e-14
    at = swing(events=[al.Event.joint(0, 0.4, direction=1, stop=True)], t_eval=np.linspace(0.0, 3.0, 301))
    assert at.t[-1] <= run.events.of("up").t[0] < at.t[-1] + 0.01


def test_a_function_of_ones_own_is_the_event_of_its_name() -> None:
    def crosses(t: float, q: Array, v: Array) -> float:
        return float(q[0] - 0.4)

    crosses.direction = -1  # type: ignore[attr-defined]  # scipy's attribute
    run = swing(events=[al.Event.joint(0, 0.4, direction=-1), crosses])
    assert run.events is not None and run.events.names[1] == "crosses"
    np.testing.assert_array_equal(run.events.of(0).t, run.events.of(1).t)

    def broken(t: float, q: Array, v: Array) -> float:
        raise KeyError("no such limit")

    with pytest.raises(KeyError, match="no such limit"):
        swing(events=broken)
    with pytest.raises(al.SolveError, match="diverged"):
        swing(events=lambda t, q, v: np.nan)


def test_a_plane_is_crossed_where_the_frame_is_on_it() -> None:
    run = al.simulate(al.RigidArm(ARM), PRESS, START, t_end=1.0, method="dop853", events=al.Event.plane("link2", [0.75, 0, 0], [1, 0, 0]))
    assert run.events is not None and len(run.events) > 0
    x = ARM.position(run.events.q, "link2")[:, 0]
    # The event is located up to rounding of the time. So x differs by about one rounding error.
    np.testing.assert_allclose(x, 0.75, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("method", "rtol", "allowed"), [("dop853", 1e-8, 1e-8), ("dopri5", 1e-8, 1e-7), ("radau5", 1e-8, 1e-6), ("rodas4", 1e-8, 1e-6)]
)
def test_the_energy_balance_holds_through_a_damped_wall(method: str, rtol: float, allowed: float) -> None:
    run = press(method=method, rtol=rtol, atol=1e-10, events=al.Event.contact())
    assert run.events is not None and len(run.events) >= 2
    energy = run.monitors["energy"]
    # The step-size controller ignores the integrals of the monitors. So their error differs between the methods. It is at most 0.12 times
    # `allowed`, relative to the range of the energy.
    assert np.max(np.abs(run.monitors["energy_balance"])) < allowed * np.ptp(energy), np.max(np.abs(run.monitors["energy_balance"]))


def test_contact_converges_with_the_tolerance() -> None:
    exact = press(rtol=1e-13, atol=1e-14, events=al.Event.contact())
    assert exact.events is not None
    for rtol, error in ((1e-6, 1e-4), (1e-8, 1e-6), (1e-10, 1e-8)):
        run = press(rtol=rtol, atol=rtol, events=al.Event.contact())
        assert run.events is not None and len(run.events) == len(exact.events)
        np.testing.assert_allclose(run.events.t, exact.events.t, rtol=0.0, atol=error)
        np.testing.assert_allclose(run.q[-1], exact.q[-1], rtol=0.0, atol=error)


def test_all_methods_meet_the_same_wall() -> None:
    exact = press(rtol=1e-13, atol=1e-14, t_eval=[0.3, 1.0])
    for method in ADAPTIVE:
        np.testing.assert_allclose(press(method=method, rtol=1e-9, atol=1e-11, t_eval=[0.3, 1.0]).q, exact.q, rtol=0.0, atol=1e-6)
    fine = press(method="rk4", dt=1e-5, t_eval=[0.3, 1.0])
    # Fixed steps do not locate the kink, so their error there is of first order.
    np.testing.assert_allclose(fine.q, exact.q, rtol=0.0, atol=1e-4)


def test_a_stop_throws_back_a_link() -> None:
    # A free link with v0 = 2 rad/s and I = 1 reaches the stop at 0.5 s. It turns at depth v0 sqrt(I/k) and leaves after pi sqrt(I/k).
    stops = al.JointStops(400.0, upper=1.0)
    free = al.ComputedTorque(LINK, al.Hold([0.0]), 1e-12, 1e-12)
    events = [al.Event.joint_stop(0, "upper"), al.Event.speed(0)]
    run = al.simulate(
        al.RigidArm(LINK, stops=stops), free, [0.0], v0=[2.0], t_end=1.0, method="dop853", rtol=1e-12, atol=1e-13, events=events
    )
    assert run.events is not None
    np.testing.assert_allclose(run.events.of(0).t, [0.5, 0.5 + np.pi / 20], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run.events.of(1).q, [[1.1]], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(run.events.of(0).v, [[2.0], [-2.0]], rtol=0.0, atol=1e-9)
    assert np.max(np.abs(run.monitors["energy_balance"])) < 1e-10


@pytest.mark.parametrize("elastic", [False, True])
def test_damped_stops_at_both_ends_keep_the_balance(elastic: bool) -> None:
    stops = al.JointStops([2e3, 1e3], [20.0, 10.0], lower=[-0.5, 0.2], upper=[0.6, 1.4])
    plant: al.Plant = al.RigidArm(ARM, stops=stops)
    law: al.Law = al.PDGravity(ARM, [0.9, 0.0], 60.0, 2.0)
    if elastic:
        plant = al.ElasticArm(ARM, [800.0, 500.0], [0.4, 0.25], stops=stops)
        law = al.JointImpedance(ARM, [0.9, 0.0], 60.0, 2.0, [800.0, 500.0], [0.4, 0.25], [0.1, 0.06])
    events = [al.Event.joint_stop(0, "upper"), al.Event.joint_stop(1, "lower")]
    run = al.simulate(plant, law, START, t_end=2.0, method="dop853", rtol=1e-9, atol=1e-11, events=events)
    assert run.events is not None and set(run.events.which) == {0, 1}
    assert np.max(np.abs(run.monitors["energy_balance"])) < 1e-7 * np.ptp(run.monitors["energy"])
    # Fixed steps have the same stops, also in batches.
    fixed = al.simulate(plant, law, START, t_end=2.0, dt=2e-5)
    np.testing.assert_allclose(fixed.q[-1], run.q[-1], rtol=0.0, atol=1e-4)
    batch = al.simulate_batch(plant, law, np.tile(START, (9, 1)), t_end=0.5, dt=1e-4)
    np.testing.assert_allclose(batch.q[4, -1], al.simulate(plant, law, START, t_end=0.5, dt=1e-4).q[-1], rtol=0.0, atol=1e-12)
    again = pickle.loads(pickle.dumps(plant))
    assert repr(again) == repr(plant) and "JointStops" in repr(plant)


@pytest.mark.parametrize("clock", [5e-3, al.Sampling(5e-3, delay=2e-3, jitter=1e-3, noise={"v": 0.01}, seed=4)])
def test_sampled_loops_are_sampled_once_per_sample(clock: Any) -> None:
    tight = {"rtol": 1e-11, "atol": 1e-12, "t_eval": [0.2, 0.5]}
    watched = press(sample_time=clock, t_end=0.5, events=[al.Event.contact(), al.Event.speed(1)], **tight)
    assert watched.events is not None and len(watched.events.of(0)) >= 1
    steps = press(method="rk4", sample_time=clock, t_end=0.5, dt=1e-5, t_eval=[0.2, 0.5]) if isinstance(clock, float) else None
    plain = press(sample_time=clock, t_end=0.5, **tight)
    np.testing.assert_allclose(watched.q, plain.q, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(watched.tau, plain.tau, rtol=0.0, atol=1e-6)
    if steps is not None:
        np.testing.assert_allclose(watched.q, steps.q, rtol=0.0, atol=1e-5)
    seen: list[float] = []

    def law(t: float, q: Array, v: Array) -> Array:
        seen.append(t)
        return PRESS(t, q, v)

    al.simulate(al.RigidArm(ARM, wall=WALL), law, START, t_end=0.5, method="dop853", sample_time=clock, events=al.Event.contact())
    # The function is evaluated once per sample, also if a step is repeated.
    assert len(seen) == len(set(seen)) and abs(len(seen) - 100) <= 1


def test_rows_of_a_batch_meet_the_wall_as_single_runs_do() -> None:
    q0 = np.array([START, [0.2, 1.2], [0.5, 0.7]])
    batch = al.simulate_batch(al.RigidArm(ARM, wall=WALL), PRESS, q0, t_end=0.5, method="dop853", t_eval=[0.25, 0.5], threads=2)
    for i in range(3):
        alone = al.simulate(al.RigidArm(ARM, wall=WALL), PRESS, q0[i], t_end=0.5, method="dop853", t_eval=[0.25, 0.5])
        np.testing.assert_array_equal(batch.q[i], alone.q)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_dense_output_is_the_run_at_any_time(method: str) -> None:
    t = np.linspace(0.0, 1.0, 77)
    at = press(method=method, t_eval=t)
    dense = press(method=method, dense=True)
    state = dense.sample(t)
    # The same polynomials, evaluated from their values at Chebyshev points, differ by rounding.
    np.testing.assert_allclose(state.q, at.q, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(state.v, at.v, rtol=0.0, atol=1e-11)
    assert state.theta is None and state.estimate is None
    np.testing.assert_array_equal(dense(0.5).q, dense.sample([0.5]).q[0])
    np.testing.assert_allclose(dense.sample(dense.t).q, dense.q, rtol=0.0, atol=1e-13)
    with pytest.raises(al.InputError, match="is not in the run"):
        dense.sample(1.5)
    with pytest.raises(al.InputError, match="kept no polynomials"):
        at.sample(0.5)


def test_dense_output_has_the_laws_state_and_the_motors() -> None:
    pr = models.PR
    law = al.Adaptive(pr, al.Sinusoid([0.0, 0.0], [0.5, 0.4], [1.0, 1.3], [0.0, 0.2]), 40.0, 20.0, 5.0)
    options: dict[str, Any] = {"t_end": 1.0, "method": "dop853", "rtol": 1e-10, "atol": 1e-12}
    run = al.simulate(al.RigidArm(pr), law, [0.1, 0.2], dense=True, **options)
    at = al.simulate(al.RigidArm(pr), law, [0.1, 0.2], t_eval=[0.3, 0.7], **options)
    np.testing.assert_allclose(run.sample([0.3, 0.7]).estimate, at.estimate, rtol=0.0, atol=1e-9)
    elastic = al.ElasticArm(ARM, [800.0, 500.0], [0.4, 0.25])
    spring = al.ElasticImpedance(ARM, [0.5, 0.5], 300.0, 40.0, [800.0, 500.0], [0.4, 0.25], 0.02, frame="link2", axes="xy")
    run = al.simulate(elastic, spring, START, dense=True, monitors=False, **options)
    at = al.simulate(elastic, spring, START, t_eval=[0.3, 0.7], monitors=False, **options)
    np.testing.assert_allclose(run.sample([0.3, 0.7]).theta, at.theta, rtol=0.0, atol=1e-9)
    again = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(again.sample(0.4).q, run.sample(0.4).q)


def test_events_are_saved_with_the_run(tmp_path: Path) -> None:
    run = press(events=[al.Event.contact(), al.Event.speed(0)])
    run.save(tmp_path / "run.npz")
    for other in (al.load(tmp_path / "run.npz"), pickle.loads(pickle.dumps(run))):
        assert isinstance(other, al.Run) and run.events is not None and other.events is not None
        assert other.events.names == run.events.names and other.events.theta is None
        np.testing.assert_array_equal(other.events.t, run.events.t)
        np.testing.assert_array_equal(other.events.v, run.events.v)


def test_a_function_may_carry_direction_and_terminal() -> None:
    """The attributes of a function are those of scipy. The link passes 0.4 rad every pi/5 s, in turn upwards and downwards."""

    def crossing(**marks: Any) -> Any:
        def level(t: float, q: Any, v: Any) -> float:
            return float(q[0] - 0.4)

        vars(level).update(marks)
        return level

    every = swing(events=[crossing()])
    assert every.status is al.Status.SUCCESS and every.events is not None
    times = every.events.t
    assert len(times) >= 4 and np.all(swing_exact(times) - 0.4 < 1e-8)
    for terminal in (True, 1, 2, 3):
        run = swing(events=[crossing(terminal=terminal)])
        assert run.status is al.Status.EVENT and run.events is not None and len(run.events) == int(terminal)
        np.testing.assert_allclose(run.t[-1], times[int(terminal) - 1], rtol=0.0, atol=1e-9)
    for direction, first in ((1.0, 0), (-1.0, 1)):
        run = swing(events=[crossing(direction=direction)])
        assert run.status is al.Status.SUCCESS and run.events is not None
        np.testing.assert_allclose(run.events.t, times[first::2], rtol=0.0, atol=1e-9)
    run = swing(events=[crossing(direction=-1.0, terminal=True)])
    assert run.status is al.Status.EVENT
    np.testing.assert_allclose(run.t[-1], times[1], rtol=0.0, atol=1e-9)
