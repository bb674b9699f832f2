"""Guarded laws against `armlet.reference`.

The reference's observer uses M_dot v - C v for C'v, and solves (I + K T) r = K (p - w) with the momentum p and the integral w.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from loops import close, law_pair, pair

import armlet as al
from armlet import reference as ref

# Rounding errors of the accelerations, and of the complex-step derivatives of the reference, grow over the steps.
ROUNDING = 1e-8
PERIOD = 2e-3
REACTIONS: dict[str, dict[str, Any]] = {
    "none": {},
    "stop": {"reaction": "stop", "stiffness": 40.0, "damping": [6.0, 5.0]},
    "float": {"reaction": "float"},
    "float with damping": {"reaction": "float", "damping": 3.0},
    "retract": {"reaction": "retract", "stiffness": [[40.0, 5.0], [5.0, 30.0]], "damping": 6.0, "speed": 0.5, "duration": 0.0153},
}
SAMPLINGS: dict[str, dict[str, Any]] = {
    "plain": {},
    "delay": {"delay": 1e-3},
    "delay of two periods": {"delay": 5e-3},
    "noise and jitter": {"noise": {"q": 1e-5, "v": 1e-3}, "jitter": 1e-3, "seed": 4},
}


def guarded(seed: int, inner: str, options: dict[str, Any], threshold: float = 4.0) -> tuple[Any, Any, Any]:
    """Return both arms, armlet's law and the reference's law."""
    rng = np.random.default_rng(seed)
    arms = pair(rng, 2)
    laws = law_pair(rng, inner, arms)
    root = rng.standard_normal((2, 2))
    gain = 30.0 * (root @ root.T + np.eye(2)) if seed % 2 else rng.uniform(30.0, 80.0, 2)
    observers = [library.MomentumObserver(arm, gain, threshold=threshold) for library, arm in zip((al, ref), arms, strict=True)]
    made = [library.Guarded(law, watch, **options) for library, law, watch in zip((al, ref), laws, observers, strict=True)]
    return arms, made[0], made[1]


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("reaction", REACTIONS)
def test_sampled_runs_with_a_force(reaction: str, sampling: str) -> None:
    arms, ours, theirs = guarded(5, "PDGravity", REACTIONS[reaction])
    run, expected = runs(arms, ours, theirs, SAMPLINGS[sampling])
    for name in ("q", "v", "tau", "estimate"):
        close(getattr(run, name), expected[name], ROUNDING)
    assert run.residual is not None and np.abs(run.residual).max() > 4.0
    if reaction != "none":
        assert run.contact is not None and 0.01 < run.contact.time < 0.05


def runs(arms: Any, ours: Any, theirs: Any, sampling: dict[str, Any], **more: Any) -> tuple[al.Run, dict[str, Any]]:
    options: dict[str, Any] = {"t_end": 0.06, "dt": 1e-3, "force": [(0.0, [0.0, 0.0, 0.0]), (0.01, [60.0, -40.0, 30.0])]}
    options |= {"force_frame": arms[0].frame_names[-1], "v0": [0.2, -0.1], **more}
    found = [
        library.simulate(library.RigidArm(arm), law, [0.1, 0.2], sample_time=library.Sampling(PERIOD, **sampling), **options)
        for library, arm, law in zip((al, ref), arms, (ours, theirs), strict=True)
    ]
    return found[0], found[1]


@pytest.mark.parametrize("inner", ["Adaptive", "PID with all options"])
def test_the_state_of_the_law_inside_rests_after_contact(inner: str) -> None:
    arms, ours, theirs = guarded(8, inner, REACTIONS["stop"], threshold=5.0)
    run, expected = runs(arms, ours, theirs, {}, tau_max=[60.0, 50.0])
    for name in ("q", "v", "tau", "estimate"):
        close(getattr(run, name), expected[name], ROUNDING)
    assert run.contact is not None and run.estimate is not None
    after = run.estimate[run.t > run.contact.time + 1e-3, : ours._first]
    assert len(after) > 5 and np.all(after == after[0])


def test_a_continuous_loop_is_observed() -> None:
    arms, ours, theirs = guarded(9, "ComputedTorque", {})
    options: dict[str, Any] = {"t_end": 0.05, "dt": 1e-3, "force": [30.0, -20.0, 10.0], "force_frame": arms[0].frame_names[-1]}
    run = al.simulate(al.RigidArm(arms[0]), ours, [0.1, 0.2], **options)
    expected = ref.simulate(ref.RigidArm(arms[1]), theirs, [0.1, 0.2], **options)
    close(run.estimate, expected["estimate"], ROUNDING)
    for t, q, v, z, r in zip(run.t, run.q, run.v, run.estimate, run.residual, strict=True):
        np.testing.assert_allclose(theirs.terms(t, q, v, state=z)["residual"], r, rtol=0, atol=1e-9)
        np.testing.assert_allclose(ours.terms(t, q, v, state=z)["residual"], r, rtol=0, atol=1e-9)


@pytest.mark.parametrize("reaction", ["stop", "float with damping", "retract"])
def test_elastic_joints(reaction: str) -> None:
    rng = np.random.default_rng(14)
    arms = pair(rng, 2)
    stiffness, motors = np.array([900.0, 700.0]), np.array([0.4, 0.3])
    options: dict[str, Any] = {"t_end": 0.06, "dt": 5e-4, "force": [(0.0, [0.0, 0.0, 0.0]), (0.01, [60.0, -40.0, 30.0])]}
    options |= {"force_frame": arms[0].frame_names[-1]}
    found = []
    for library, arm in zip((al, ref), arms, strict=True):
        inner = library.JointImpedance(arm, [0.2, 0.1], 60.0, 8.0, stiffness, motors, 0.5 * motors)
        law = library.Guarded(inner, library.MomentumObserver(arm, 60.0, threshold=4.0), **REACTIONS[reaction])
        plant = library.ElasticArm(arm, stiffness, motors)
        found.append(library.simulate(plant, law, [0.1, 0.2], sample_time=library.Sampling(PERIOD), **options))
    run, expected = found
    for name in ("q", "v", "theta", "theta_dot", "tau", "estimate"):
        close(getattr(run, name), expected[name], ROUNDING)
    assert run.contact is not None and run.contact.time > 0.01


def test_a_call_is_the_references() -> None:
    """A call with a given state returns the reference's torque before, at and after contact."""
    for reaction, options in REACTIONS.items():
        _, ours, theirs = guarded(6, "PDGravity", options)
        rng = np.random.default_rng(3)
        for count in (0.0, 0.002):
            for scale in (0.0, 1.0):
                q, v = rng.uniform(-1.0, 1.0, (2, 2))
                state = theirs.start(q, v) + scale * rng.uniform(-1.0, 1.0, theirs.state0.size)
                if reaction != "none":
                    state[4:6], state[-2:] = [count, 2.0 * count], [0.3 * count, -0.5 * count]
                np.testing.assert_allclose(ours(0.1, q, v, state=state), theirs(0.1, q, v, state=state), rtol=1e-9, atol=1e-9)
                parts, expected = ours.terms(0.1, q, v, state=state), theirs.terms(0.1, q, v, state=state)
                assert parts["reacting"] == expected["reacting"]


def test_the_touched_joint_of_residuals() -> None:
    _, ours, theirs = guarded(7, "PDGravity", {})
    residuals = np.random.default_rng(1).uniform(-8.0, 8.0, (40, 2))
    expected = []
    for r in residuals:
        theirs.observer.residual = r
        expected.append(theirs.observer.contact())
    assert ours.touched(residuals).tolist() == expected
    assert [ours.touched(r) for r in residuals] == expected
    assert set(expected) == {-1, 0, 1}
