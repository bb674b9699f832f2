"""Contacts, losses and events of plants against `armlet.reference`, with the same names and numbers in both libraries.

The reference computes contact torques from complex steps of the depth. It locates events by integrating again from the previous check.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from loops import close, law_pair, pair

import armlet as al
from armlet import reference

# Rounding errors of the accelerations, and of the complex-step derivatives of the reference, grow over the steps.
ROUNDING = 1e-9


def contacts(library: Any, rng: np.random.Generator, frame: str, at: Any, q0: Any) -> dict[str, Any]:
    """Return a wall, whose surface is beyond the frame's position `at`, and joint stops that some joints exceed at the start."""
    n, normal = q0.size, rng.standard_normal(3)
    lower, upper = q0 - rng.uniform(-0.02, 0.3, n), q0 + rng.uniform(0.05, 0.3, n)
    lower[0] = q0[0] + 0.01
    return {
        "wall": library.Wall(frame, at + 0.01 * normal, normal, stiffness=900.0, damping=20.0),
        "stops": library.JointStops(rng.uniform(500.0, 900.0, n), 15.0, lower=lower, upper=upper),
    }


def elastic(library: Any, arm: Any, frame: str, at: Any, **keywords: Any) -> tuple[Any, Any]:
    """Return plant and law. The law reduces the motor inertia to a tenth."""
    K, B = np.linspace(900.0, 400.0, arm.n), np.linspace(0.5, 0.3, arm.n)
    law = library.ElasticImpedance(arm, at, [90.0, 70.0, 50.0], [9.0, 8.0, 7.0], K, B, 0.1 * B, frame=frame, axes="xyz")
    return library.ElasticArm(arm, K, B, **keywords), law


@pytest.mark.parametrize("n", [1, 2, 4, 6])
def test_contacts_of_rigid_arms(n: int) -> None:
    rng = np.random.default_rng(40 + n)
    arms = pair(rng, n)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    laws = law_pair(rng, "PDGravity", arms)
    frame = arms[0].frame_names[-1]
    ours, theirs = (contacts(library, np.random.default_rng(n), frame, arms[0].position(q0, frame), q0) for library in (al, reference))
    options: dict[str, Any] = {"t_end": 0.03, "dt": 1e-3, "v0": v0}
    run = al.simulate(al.RigidArm(arms[0], **ours), laws[0], q0, **options)
    expected = reference.simulate(reference.RigidArm(arms[1], **theirs), laws[1], q0, **options)
    for name in ("q", "v", "tau"):
        close(getattr(run, name), expected[name], ROUNDING)
    for name in ("energy", "energy_balance"):
        close(run.monitors[name], expected[name], ROUNDING)
    # Wall and stops both change the run.
    for each in ("wall", "stops"):
        alone = al.simulate(al.RigidArm(arms[0], **{each: ours[each]}), laws[0], q0, **options)
        assert np.abs(alone.q - run.q).max() > 1e-6


def test_stops_stand_at_the_limits_of_the_arm() -> None:
    joint = {"type": "R", "axis": [0, 0, 1], "lower": -0.1, "upper": 0.2, "phi": [1, 0.3, 0, 0, 0.1, 0, 0.2, 0, 0, 0.2]}
    runs = []
    for library in (al, reference):
        arm: Any = library.Arm.from_chain([joint])
        if library is reference:
            arm.limits = {"lower": np.array([-0.1]), "upper": np.array([0.2])}
        plant = library.RigidArm(arm, stops=library.JointStops(300.0))
        # The target, 0.5 rad, is beyond the stop at 0.2 rad.
        beyond = {"check_limits": False} if library is al else {}
        runs.append(library.simulate(plant, library.PDGravity(arm, [0.5], 30.0, 1.0), [0.0], t_end=0.5, dt=5e-3, **beyond))
    close(runs[0].q, runs[1]["q"], ROUNDING)
    assert runs[0].q.max() > 0.2


@pytest.mark.parametrize("n", [3, 5])
def test_losses_and_contacts_of_elastic_arms(n: int) -> None:
    rng = np.random.default_rng(50 + n)
    arms = pair(rng, n)
    q0, v0, motors, slip = rng.uniform(-0.3, 0.3, (4, n))
    frame = arms[0].frame_names[-1]
    at = arms[0].position(q0, frame)
    lost = {"joint_damping": rng.uniform(0.5, 2.0, n), "motor_friction": rng.uniform(0.5, 2.0, n)}
    options: dict[str, Any] = {"t_end": 0.03, "dt": 1e-3, "v0": v0, "theta0": q0 + 0.1 * motors, "theta_dot0": v0 + slip}
    runs = []
    for library, arm in zip((al, reference), arms, strict=True):
        plant, law = elastic(library, arm, frame, at, **lost, **contacts(library, np.random.default_rng(n), frame, at, q0))
        runs.append(library.simulate(plant, law, q0, **options))
    run, expected = runs
    for name in ("q", "v", "theta", "theta_dot", "tau"):
        close(getattr(run, name), expected[name], ROUNDING)
    for each in lost:
        plant, law = elastic(al, arms[0], frame, at, **lost | {each: None}, **contacts(al, np.random.default_rng(n), frame, at, q0))
        assert np.abs(al.simulate(plant, law, q0, **options).q - run.q).max() > 1e-6


def test_the_energy_of_an_elastic_arm_with_losses_is_balanced() -> None:
    """With a saturated torque, the energy of the plant is balanced in both libraries.

    It includes springs, motors and contacts, and their losses.
    """
    rng = np.random.default_rng(9)
    arms = pair(rng, 3)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, 3))
    frame = arms[0].frame_names[-1]
    at = arms[0].position(q0, frame)
    runs = []
    for library, arm in zip((al, reference), arms, strict=True):
        lost = {"joint_damping": [0.5, 1.0, 2.0], "motor_friction": 0.7 * np.ones(3)}
        plant, law = elastic(library, arm, frame, at, **lost, **contacts(library, np.random.default_rng(1), frame, at, q0))
        runs.append(library.simulate(plant, law, q0, v0=v0, t_end=0.02, dt=1e-3, tau_max=[4.0, 3.0, 2.0], force=[3.0, 0.0, -1.0]))
    for name in ("energy", "energy_balance"):
        close(runs[0].monitors[name], runs[1][name], ROUNDING)


def test_a_force_acts_at_its_frame() -> None:
    rng = np.random.default_rng(12)
    arms = pair(rng, 4)
    laws = law_pair(rng, "PDGravity", arms)
    q0, frame = rng.uniform(-0.3, 0.3, 4), arms[0].frame_names[2]
    for force in ([3.0, -1.0, 2.0], [3.0, -1.0, 2.0, 0.4, 0.2, -0.3]):
        options: dict[str, Any] = {"t_end": 0.02, "dt": 1e-3, "force": force, "force_frame": frame}
        run = al.simulate(al.RigidArm(arms[0]), laws[0], q0, **options)
        expected = reference.simulate(reference.RigidArm(arms[1]), laws[1], q0, **options)
        close(run.q, expected["q"], ROUNDING)
        close(run.monitors["energy_balance"], expected["energy_balance"], ROUNDING)


def fall(library: Any, stop: int = 0, **options: Any) -> Any:
    """Run a planar arm that falls onto a wall and a joint stop, with events of each kind."""
    arm, make = library.planar_arm([0.5, 0.4]), library.Event
    wall = library.Wall("link2", [0.0, -0.7, 0.0], [0.0, 1.0, 0.0], stiffness=400.0)
    plant = library.RigidArm(arm, wall=wall, stops=library.JointStops(30.0, lower=-0.4, upper=2.0))
    law = library.PDGravity(arm, [-1.2, 0.0], [4.0, 1.0], [0.1, 0.05])
    events = [
        make.joint(0, -0.6, direction=-1),
        make.speed(1, value=0.0),
        make.plane("link2", [0.0, -0.5, 0.0], [0.0, 1.0, 0.0]),
        make.contact(direction=1, stop=stop),
        make.joint_stop(1, "lower"),
        make.function(lambda t, q, v: float(q[0] + q[1] + 0.7 - t)),
        # This event needs a rising angle and never occurs.
        make.joint(0, -0.6, direction=1),
    ]
    options |= {"rtol": 1e-9, "atol": 1e-9, "v0": [-4.0, -3.0], "t_end": 0.1, "t_eval": [0.1], "events": events}
    return library.simulate(plant, law, [-0.5, -0.1], **options)


@pytest.mark.slow
def test_events() -> None:
    """DOP853 and Gragg-Bulirsch-Stoer at 1e-9 locate the same events within 1e-6 s.

    The contact forces have corners, which cause this difference.
    """
    run, found = fall(al, method="dop853"), fall(reference, method="gbs", looks=10)["events"]
    assert run.events.which.tolist() == [index for _, index, _ in found]
    assert {*run.events.which.tolist()} == {0, 1, 2, 3, 4, 5}
    np.testing.assert_allclose(run.events.t, [t for t, _, _ in found], rtol=0.0, atol=1e-6)
    for k, (_, _, x) in enumerate(found):
        close(run.events.q[k], x[:2], 1e-5)
        close(run.events.v[k], x[2:], 1e-5)
    (touched,) = (t for t, index, _ in found if index == 3)
    ended = fall(al, stop=1, method="dop853")
    assert ended.status == al.Status.EVENT and abs(ended.events.t[-1] - touched) < 1e-6
