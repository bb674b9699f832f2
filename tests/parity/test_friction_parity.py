"""Dry friction of plants against `armlet.reference`, with the same names and numbers in both libraries.

The reference uses the bristle force as state, where armlet uses the bristle deflection. For stick-slip friction the reference solves a
complementarity problem by repeated sweeps over the joints.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from loops import Array, close, law_pair, pair

import armlet as al
from armlet import reference

# Rounding errors of the accelerations and of the stiff bristles grow over the steps.
ROUNDING = 1e-9
# The reference iterates until the impulses change by less than 1e-15 of the largest. The inertia matrix amplifies this error.
SWEEPS = 1e-9


def curve(rng: np.random.Generator, n: int) -> dict[str, Any]:
    """Return random parameters of a friction curve: arrays (n,) of each joint, and one viscous coefficient for all joints."""
    coulomb = rng.uniform(0.5, 2.0, n)
    return {
        "coulomb": coulomb,
        "static": coulomb * rng.uniform(1.0, 1.5, n),
        "stribeck_speed": rng.uniform(0.05, 0.2, n),
        "viscous": 0.3,
        "load_ratio": rng.uniform(0.0, 0.3, n),
    }


def bristles(library: Any, rng: np.random.Generator, n: int) -> Any:
    return library.LuGre(stiffness=rng.uniform(2e3, 5e3, n), damping=rng.uniform(0.0, 10.0, n), **curve(rng, n))


@pytest.mark.parametrize("n", [1, 2, 4])
@pytest.mark.parametrize("method", ["rk4", "euler"])
def test_bristles_of_joints(n: int, method: str) -> None:
    rng = np.random.default_rng(n)
    arms = pair(rng, n)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    laws = law_pair(rng, "PDGravity", arms)
    ours, theirs = (bristles(library, np.random.default_rng(70 + n), n) for library in (al, reference))
    options: dict[str, Any] = {"t_end": 0.02, "dt": 1e-4, "v0": v0, "method": method}
    run = al.simulate(al.RigidArm(arms[0], friction=ours), laws[0], q0, **options)
    expected = reference.simulate(reference.RigidArm(arms[1], friction=theirs), laws[1], q0, **options)
    for name in ("q", "v", "tau", "friction", "bristles"):
        close(getattr(run, name), expected[name], ROUNDING)
    for name in ("energy", "energy_balance"):
        close(run.monitors[name], expected[name], ROUNDING)
    assert np.abs(run.friction).max() > 0.5
    assert run.stats["engine"] != "direct"


@pytest.mark.parametrize("n", [2, 3])
def test_bristles_of_motors(n: int) -> None:
    rng = np.random.default_rng(10 + n)
    arms = pair(rng, n)
    q0, v0, slip = rng.uniform(-0.3, 0.3, (3, n))
    frame = arms[0].frame_names[-1]
    at = arms[0].position(q0, frame) + 0.05
    runs = []
    for library, arm in zip((al, reference), arms, strict=True):
        K, B = np.linspace(900.0, 400.0, n), np.linspace(0.5, 0.3, n)
        law = library.ElasticImpedance(arm, at, [90.0, 70.0, 50.0], [9.0, 8.0, 7.0], K, B, 0.1 * B, frame=frame, axes="xyz")
        friction = bristles(library, np.random.default_rng(n), n)
        plant = library.ElasticArm(arm, K, B, joint_damping=np.full(n, 2.0), motor_friction=friction)
        options: dict[str, Any] = {"t_end": 0.02, "dt": 1e-4, "v0": v0, "theta_dot0": v0 + slip, "sample_time": 1e-3}
        runs.append(library.simulate(plant, law, q0, **options))
    for name in ("q", "v", "theta", "theta_dot", "tau", "friction", "bristles"):
        close(getattr(runs[0], name), runs[1][name], ROUNDING)
    close(runs[0].monitors["energy_balance"], runs[1]["energy_balance"], ROUNDING)


def stick_slip(library: Any, rng: np.random.Generator, n: int) -> Any:
    return library.StickSlip(**curve(rng, n))


@pytest.mark.parametrize("n", [1, 2, 4])
def test_torques_of_stick_slip(n: int) -> None:
    rng = np.random.default_rng(20 + n)
    arms = pair(rng, n)
    q0 = rng.uniform(-0.3, 0.3, n)
    # With weak damping the joints come to rest in a finite time.
    laws = [library.PDGravity(arm, q0 + 0.3, 20.0, 0.5) for library, arm in zip((al, reference), arms, strict=True)]
    ours, theirs = (stick_slip(library, np.random.default_rng(n), n) for library in (al, reference))
    frame, push = arms[0].frame_names[-1], np.array([1.0, -2.0, 3.0])
    run = al.simulate(al.RigidArm(arms[0], friction=ours), laws[0], q0, t_end=2.0, dt=1e-3, force=push, force_frame=frame)
    plant = reference.RigidArm(arms[1])
    load = reference.loop.frame_load(arms[1], frame)

    def expected(q: Array, v: Array, tau: Array) -> Array:
        torque: Array = reference.stick_slip.friction_torque(plant, theirs, np.concatenate([q, v]), tau, load(q, push))
        return torque

    chosen = slice(None, None, 50)
    assert run.tau is not None
    rows = zip(run.q[chosen], run.v[chosen], run.tau[chosen], strict=True)
    close(run.friction[chosen], np.array([expected(*row) for row in rows]), SWEEPS)
    # Joints stick in some records and slide in others.
    assert 0.02 < np.mean(run.v[1:] == 0.0) < 0.98


@pytest.mark.parametrize("elastic", [False, True])
def test_stick_slip_against_impulses(elastic: bool) -> None:
    """The reference applies friction impulses in each step.

    Its runs converge with first order to armlet's run, which locates the events.
    """
    rng, n = np.random.default_rng(5), 2
    arms = pair(rng, n)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    target = q0 + np.array([0.3, -0.2])
    K, B = np.array([900.0, 600.0]), np.array([0.5, 0.3])
    numbers = curve(rng, n) | {"load_ratio": 0.1}
    laws = [library.PDGravity(arm, target, 20.0, 3.0) for library, arm in zip((al, reference), arms, strict=True)]
    if elastic:
        laws = [library.MotorPD(arm, target, 20.0, 3.0, K) for library, arm in zip((al, reference), arms, strict=True)]
        ours = al.ElasticArm(arms[0], K, B, motor_friction=al.StickSlip(**numbers))
        theirs = reference.ElasticArm(arms[1], K, B)
    else:
        ours, theirs = al.RigidArm(arms[0], friction=al.StickSlip(**numbers)), reference.RigidArm(arms[1])
    run = al.simulate(ours, laws[0], q0, v0=v0, t_end=0.6, t_eval=np.linspace(0.0, 0.6, 7), method="dop853")
    errors = []
    for dt in (2e-3, 1e-3):
        found = reference.stick_slip_run(
            theirs, reference.StickSlip(**numbers), laws[1], q0, v0=v0, t_end=0.6, dt=dt, record_every=round(0.1 / dt)
        )
        errors.append(np.abs(found["q"] - run.q).max())
    assert errors[1] < 5e-3
    # With half the step the error is about halved. The bounds allow for a second-order term.
    assert 0.3 < errors[1] / errors[0] < 0.75
    rubbing = run.theta_dot if elastic else run.v
    assert (rubbing[-1] == 0.0).any() and (rubbing[1] != 0.0).any()
