"""Options and targets of impedance laws: refused arguments, poses and motions as targets, batches, scenarios."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from refusals import refused

import armlet as al
from armlet.scenario import Scenario

ARM = models.THREE_LINKS
NAN, INF = float("nan"), float("inf")
POSTURE = al.NullSpace([0.3, 0.4, 0.5], 20.0, 2.0)
GIVEN: dict[str, Any] = {"arm": ARM, "target": [0.5, 0.3], "stiffness": 300.0, "damping": 30.0, "frame": "link3", "axes": "xy"}


def law(**changes: Any) -> al.CartesianImpedance:
    return al.CartesianImpedance(**(GIVEN | changes))


def posture(*given: Any, **more: Any) -> al.CartesianImpedance:
    return law(nullspace=al.NullSpace(*given, **more))


@pytest.mark.parametrize("made", ["CartesianImpedance", "ElasticImpedance"])
def test_options(made: str) -> None:
    inner = {} if made == "CartesianImpedance" else {"joint_stiffness": 800.0, "motor_inertia": 0.4, "reduced_inertia": 0.1}

    def take(**changes: Any) -> Callable[[], Any]:
        return lambda: getattr(al, made)(**(GIVEN | inner | changes))

    refused(take(nullspace=3.0), f"{made}: nullspace is of the wrong type", "NullSpace")
    refused(take(nullspace=al.NullSpace([0.1, 0.2], 1.0, 1.0)), f"{made}: nullspace.q_d", "(3,)", "(2,)")
    refused(take(nullspace=al.NullSpace([0.1, 0.2, NAN], 1.0, 1.0)), f"{made}: nullspace.q_d is not finite", "index 2")
    refused(take(nullspace=al.NullSpace(al.Hold([0.1, 0.2]), 1.0, 1.0)), "nullspace.q_d", "expected 3, got 2")
    refused(take(nullspace=al.NullSpace([0.1] * 3, -1.0, 1.0)), "nullspace.stiffness is negative")
    refused(lambda: al.NullSpace([0.1] * 3, 1.0, [1.0, 1.0]), "NullSpace: damping has the wrong shape", "(3,)")
    # Only the shape is checked. Converting these numbers would take a minute.
    refused(lambda: al.NullSpace([0.1] * 3, np.broadcast_to(0.1, (10**8, 3)), 1.0), "NullSpace: stiffness has the wrong shape")
    refused(take(nullspace=al.NullSpace([0.1] * 3, np.ones((3, 3)), 1.0)), "nullspace.stiffness is not positive definite")
    refused(take(feedforward=[1.0]), f"{made}: feedforward", "(2,)")
    refused(take(feedforward=[1.0, INF]), f"{made}: feedforward is not finite", "index 1")
    outside = [(eps, "is out of range") for eps in (1.0, 1e-8, 1e-320)]
    for eps, words in ((0.0, "is not positive"), *outside, (NAN, "not finite"), ("x", "eps")):
        refused(take(eps=eps), "eps", words)
    refused(take(compensate_coupling=2.0), "compensate_coupling")


@pytest.mark.parametrize("made", ["CartesianImpedance", "ElasticImpedance"])
def test_integral_and_limits(made: str) -> None:
    inner = {} if made == "CartesianImpedance" else {"joint_stiffness": 800.0, "motor_inertia": 0.4, "reduced_inertia": 0.1}

    def law(**changes: Any) -> Any:
        return getattr(al, made)(**(GIVEN | inner | changes))

    refused(lambda: law(integral_gain=-1.0), f"{made}: integral_gain is negative")
    refused(lambda: law(integral_gain=[1.0]), "integral_gain", "(2,)")
    for name, count in (("wrench_max", 2), ("tau_max", 3)):
        refused(lambda name=name: law(**{name: 0.0}), f"{made}: {name} is not positive")
        refused(lambda name=name: law(**{name: NAN}), f"{name} is not positive")
        refused(lambda name=name: law(**{name: [1.0]}), name, f"({count},)")


def test_infinite_limits() -> None:
    for name in ("wrench_max", "tau_max"):
        assert law(**{name: INF})(0.0, [0.1] * 3, [0.0] * 3) == pytest.approx(law()(0.0, [0.1] * 3, [0.0] * 3), abs=0.0)
    with pytest.raises(al.InputError, match="nullspace is of the wrong type"):
        law(nullspace=[0.1, 0.2, 0.3])


def test_null_spaces() -> None:
    refused(lambda: al.NullSpace([0.1], 1.0, 1.0, projection="dynamic"), "NullSpace: projection is unknown", "consistent, static")
    refused(lambda: al.NullSpace("x", 1.0, 1.0), "NullSpace: q_d")
    refused(lambda: al.NullSpace([0.1], [[[1.0]]], 1.0), "NullSpace: stiffness")
    given = np.array([0.3, 0.4, 0.5])
    made = al.NullSpace(given, 20.0, 2.0)
    given[:] = 9.0
    assert made == POSTURE and pickle.loads(pickle.dumps(made)) == made
    assert repr(made) == "NullSpace(q_d=(0.3, 0.4, 0.5), stiffness=20.0, damping=2.0, projection='consistent')"
    moving = law(nullspace=al.NullSpace(al.Quintic([0.0] * 3, [0.3] * 3, 1.0), 20.0, 0.0))
    again = pickle.loads(pickle.dumps(moving))
    q, v = [0.2, 0.5, 0.4], [0.1, -0.2, 0.3]
    assert np.array_equal(moving(0.5, q, v), again(0.5, q, v)) and repr(again) == repr(moving)
    assert np.abs(moving(0.0, q, v) - moving(1.0, q, v)).max() > 1e-3


def test_a_pose_as_target() -> None:
    six = models.SIX_AXES
    q = np.array([0.3, -0.4, 0.5, 0.2, -0.6, 0.1])
    frame = six.tip_frame
    rows = {"frame": frame, "axes": "xyz rx ry rz"}
    by_pose = al.CartesianImpedance(six, six.pose(q, frame), 300.0, 30.0, **rows)
    by_rows = al.CartesianImpedance(six, six.pose_vector(q, frame), 300.0, 30.0, **rows)
    # The pose has rounding errors, so `e` is not exactly zero.
    np.testing.assert_allclose(by_pose.terms(0.0, q, np.zeros(6))["e"], np.zeros(6), atol=1e-15)
    np.testing.assert_allclose(by_pose(0.0, q + 0.1, q), by_rows(0.0, q + 0.1, q), rtol=0.0, atol=1e-12)
    assert np.array_equal(pickle.loads(pickle.dumps(by_pose))(0.0, q + 0.1, q), by_pose(0.0, q + 0.1, q))
    place = al.CartesianImpedance(six, six.pose(q, frame), 300.0, 30.0, frame=frame)
    np.testing.assert_allclose(place.terms(0.0, q, q)["e"], np.zeros(3), atol=1e-15)
    planar = al.CartesianImpedance(ARM, ARM.pose([0.3, 0.4, 0.5], "link3"), 300.0, 30.0, frame="link3", axes="xy rz")
    np.testing.assert_allclose(planar.terms(0.0, [0.3, 0.4, 0.5], [0.0] * 3)["e"], np.zeros(3), atol=1e-15)
    for broken in (2.0 * np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0]), np.zeros((4, 4)), np.eye(4)[::-1], np.full((4, 4), NAN)):
        refused(lambda broken=broken: al.CartesianImpedance(six, broken, 300.0, 30.0, **rows), "target")
    refused(lambda: al.CartesianImpedance(six, six.pose(q, frame), 300.0, 30.0, frame=frame, axes="xyz rz"), "target turns about rx")
    refused(lambda: law(target=np.eye(3)), "target", "(2,)")
    refused(lambda: law(target=al.Hold([0.5])), "target", "(2,)")


def test_a_wrench_that_is_fed_forward_moves_the_rest() -> None:
    plant = al.RigidArm(ARM)
    pushed = al.equilibrium(plant, law(), [6.0, -3.0], q0=[0.2, 0.5, 0.4])
    fed = al.equilibrium(plant, law(feedforward=[6.0, -3.0]), q0=[0.2, 0.5, 0.4])
    # Both searches find the same equilibrium, from the same start, to 1e-9.
    np.testing.assert_allclose(fed.x, pushed.x, atol=1e-8)
    assert fed.reachable and not fed.spurious and fed.estimate is None


@pytest.mark.parametrize("projection", ["consistent", "static"])
def test_the_rest_of_a_law_with_options_is_where_its_run_ends(projection: Any) -> None:
    plant, force, q0 = al.RigidArm(ARM), [6.0, -3.0], [0.2, 0.5, 0.4]
    posture = al.NullSpace([0.3, 0.4, 0.5], 20.0, 8.0, projection=projection)
    for options in ({}, {"integral_gain": 200.0}, {"compensate_coupling": True}, {"wrench_max": 400.0, "tau_max": 300.0}):
        made = law(nullspace=posture, **options)
        rest = al.equilibrium(plant, made, force, q0=q0)
        run = al.simulate(plant, made, q0, t_end=30.0, dt=5e-4, record_every=1000, force=force)
        # The slowest mode has decayed to less than 1e-10 rad.
        np.testing.assert_allclose(rest.q, run.q[-1], atol=1e-9)
        np.testing.assert_allclose(rest.tau, run.tau[-1], atol=1e-7)
        assert rest.stable and rest.reachable and not rest.spurious
        goal = np.array([0.5, 0.3]) + (0.0 if "integral_gain" in options else np.array(force) / 300.0)
        np.testing.assert_allclose(rest.x, goal, atol=1e-9)
        if "integral_gain" in options:
            np.testing.assert_allclose(rest.estimate, run.estimate[-1], atol=1e-7)
            np.testing.assert_allclose(rest.estimate, [-6.0, 3.0], atol=1e-7)
            assert len(rest.eigenvalues) == 8


def test_a_limit_holds_the_rest_back() -> None:
    plant, q0 = al.RigidArm(ARM), [0.2, 0.5, 0.4]
    posture = al.NullSpace([0.3, 0.4, 0.5], 20.0, 8.0)
    # A spring limited to 12 N opposes 30 N, so the arm stretches along the remaining force.
    pushed = al.equilibrium(plant, law(wrench_max=12.0), [30.0, 0.0], q0=q0)
    assert pushed.spurious and not pushed.reachable and np.linalg.norm(pushed.x) == pytest.approx(1.2, abs=1e-6)
    # The target is out of reach. With `wrench_max` the spring reaches its limit before the arm is stretched.
    free = al.equilibrium(plant, law(target=[2.0, 1.0], nullspace=posture), q0=q0)
    held = al.equilibrium(plant, law(target=[2.0, 1.0], nullspace=posture, wrench_max=20.0), q0=q0)
    for rest in (free, held):
        assert not rest.reachable and rest.spurious
    # Weak motors cannot hold the arm. At equilibrium, gravity equals the torque limit.
    weak = al.equilibrium(plant, law(nullspace=posture, tau_max=[4.0, 30.0, 30.0]), q0=q0)
    assert not weak.reachable and abs(weak.tau[0]) == pytest.approx(4.0, abs=1e-9)


def test_rows_of_a_batch_are_the_runs() -> None:
    """A batch of laws with different postures, limits and wrenches equals single runs. One of the laws has different options."""
    laws = [
        law(nullspace=al.NullSpace([0.3, 0.4, k], 20.0 + k, 2.0), feedforward=[k, -k], integral_gain=5.0, tau_max=20.0 + k, eps=0.1)
        for k in (0.1, 0.5, 0.9)
    ]
    laws.append(law(nullspace=al.NullSpace([0.3, 0.4, 0.2], 20.0, 2.0, projection="static"), integral_gain=5.0, compensate_coupling=True))
    q0: list[float] = [0.2, 0.5, 0.4]
    options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3, "record_every": 20}
    # The fourth law has other monitors, so the batch runs without monitors.
    options["monitors"] = False
    batch = al.simulate_batch(al.RigidArm(ARM), laws, [q0] * 4, **options)
    for row, each in enumerate(laws):
        run = al.simulate(al.RigidArm(ARM), each, q0, **options)
        for name in ("q", "v", "tau", "estimate"):
            # A batch and single runs may differ by rounding.
            np.testing.assert_allclose(getattr(batch, name)[row], getattr(run, name), rtol=1e-9, atol=1e-10)


def test_scenarios() -> None:
    table: dict[str, Any] = {
        "arm": {"kind": "planar_arm", "lengths": [0.5, 0.4, 0.3]},
        "law": {
            "kind": "CartesianImpedance",
            "target": {"kind": "Quintic", "q0": [0.8, 0.5], "q1": [0.5, 0.3], "duration": 0.1},
            "stiffness": 300.0,
            "damping": 30.0,
            "frame": "link3",
            "axes": "xy",
            "nullspace": {"q_d": [0.3, 0.4, 0.5], "stiffness": 20.0, "damping": 2.0, "projection": "static"},
            "feedforward": [1.0, 2.0],
            "compensate_coupling": True,
            "eps": 0.1,
            "integral_gain": 5.0,
            "wrench_max": 80.0,
            "tau_max": [50.0, 40.0, 30.0],
        },
        "run": {"q0": [0.2, 0.5, 0.4], "t_end": 0.1, "dt": 1e-3},
    }
    made = law(
        target=al.Quintic([0.8, 0.5], [0.5, 0.3], 0.1),
        nullspace=al.NullSpace([0.3, 0.4, 0.5], 20.0, 2.0, projection="static"),
        **{name: table["law"][name] for name in ("feedforward", "compensate_coupling", "eps", "integral_gain", "wrench_max", "tau_max")},
    )
    run = Scenario(table).run()
    assert np.array_equal(run.q, al.simulate(al.RigidArm(ARM), made, [0.2, 0.5, 0.4], t_end=0.1, dt=1e-3).q)
    table["law"]["nullspace"]["projection"] = "dynamic"
    refused(lambda: Scenario(table), "$.law.nullspace.projection")
    table["law"]["nullspace"] = {"q_d": [0.3, 0.4], "stiffness": 20.0, "damping": 2.0}
    refused(lambda: Scenario(table).run(), "q_d")
