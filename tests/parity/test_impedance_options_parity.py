"""Options of impedance laws against `armlet.reference`, 1 to 8 joints: null space, coupling, feed-forward, integral and limits.

armlet bounds the eigenvalues of `J M^-1 J'` from below with Jacobi's method, and has a closed form for rates of rotation vectors.
The reference decomposes `J M^-1/2` into singular values, and integrates rotations by quadrature.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from loops import Array, close, pair

import armlet as al
from armlet import reference

AXES = {1: "x", 2: "xy", 3: "xyz", 4: "z ry x", 5: "xyz rz rx", 6: "xyz rx ry rz", 7: "xyz rx ry rz", 8: "rz xyz rx ry"}
# armlet uses eigenvalues, and the reference uses singular values. So rounding errors are divided by
# eps^2, which is 4e-4 with the default of `eps`.
TOLERANCE = 1e-10


def definite(rng: np.random.Generator, n: int, scale: float) -> Array:
    root = rng.normal(size=(n, n))
    return np.asarray(scale * (root @ root.T / n + np.eye(n)))


def options(rng: np.random.Generator, n: int, m: int, *, wide: bool = False) -> dict[str, Any]:
    """Return random keywords of an impedance law, except its null space."""
    return {
        "feedforward": rng.normal(size=m),
        "compensate_coupling": bool(rng.random() < 0.7),
        "eps": [None, 0.1, 0.5][int(rng.integers(3))],
        "integral_gain": definite(rng, m, 20.0) if rng.random() < 0.5 else rng.uniform(0.0, 20.0, m),
        "wrench_max": 1e9 if wide else rng.uniform(5.0, 100.0, m),
        "tau_max": 1e9 if wide else rng.uniform(5.0, 50.0, n),
    }


def laws(rng: np.random.Generator, arms: tuple[al.Arm, Any], n: int, **more: Any) -> tuple[Any, Any]:
    frame, axes = arms[0].frame_names[-1], AXES[n]
    m = len(reference.task.parse_axes(axes))
    posture, gains = rng.uniform(-1.0, 1.0, n), (definite(rng, n, 20.0), rng.uniform(0.0, 4.0, n))
    projection = ["consistent", "static"][int(rng.integers(2))]
    given = options(rng, n, m, **more)
    stiffness, damping = definite(rng, m, 100.0), definite(rng, m, 10.0)
    # In some motions of the target the angle of the rotation vector passes through 1 rad and through half a turn.
    kind = int(rng.integers(3))
    amplitude, frequency, phase = rng.uniform(0.1, 1.5, m), rng.uniform(0.5, 3.0, m), rng.uniform(-1.0, 1.0, m)
    offset = rng.uniform(-1.0, 1.0, m)
    pose = np.asarray(arms[0].pose(rng.uniform(-1.0, 1.0, n), frame))
    if kind == 2 and m == len(set(axes.split()) & {"rx", "ry", "rz"}) + 3 and n >= 6:
        targets: tuple[Any, Any] = (pose, pose)
    elif kind:
        targets = (al.Sinusoid(offset, amplitude, frequency, phase), reference.Sinusoid(offset, amplitude, frequency, phase))
    else:
        targets = (offset, offset)
    return tuple(
        kit.CartesianImpedance(
            arm,
            target,
            stiffness,
            damping,
            frame=frame,
            axes=axes,
            nullspace=kit.NullSpace(posture, *gains, projection=projection),
            **given,
        )
        for kit, arm, target in ((al, arms[0], targets[0]), (reference, arms[1], targets[1]))
    )  # type: ignore[return-value]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("n", range(1, 9))
def test_terms_and_torques(n: int, seed: int) -> None:
    rng = np.random.default_rng([n, seed])
    arms = pair(rng, n)
    law, theirs = laws(rng, arms, n)
    for _ in range(3):
        t, q, v = float(rng.uniform(0.0, 2.0)), rng.uniform(-1.5, 1.5, n), rng.normal(size=n)
        w = 10.0 * rng.normal(size=len(theirs.state0))
        parts, wanted = law.terms(t, q, v, state=w), theirs.terms(t, q, v, state=w)
        for name in ("e", "J", "force", "tau_0", "null_torque", "L", "loss", "tau"):
            close(parts[name], wanted[name], TOLERANCE)
        close(parts["integral_rate"], wanted["state_rate"], TOLERANCE)
        close(law(t, q, v, state=w), wanted["tau"], TOLERANCE)


@pytest.mark.parametrize("projection", ["consistent", "static"])
@pytest.mark.parametrize("bend", [0.0, 1e-300, 1e-9, 1e-3, 0.02, 0.05, np.pi])
def test_terms_at_singularities(bend: float, projection: str) -> None:
    """Terms agree for a planar arm that is stretched out, folded or near these poses.

    The loss is one at a singularity and less than one away from it.
    """
    arms = al.planar_arm([0.5, 0.4, 0.3, 0.2]), reference.planar_arm([0.5, 0.4, 0.3, 0.2])
    q, v = np.array([0.4, bend, bend, bend]), np.array([0.3, -0.2, 0.5, 0.1])
    losses = []
    for axes, target in (("xy", [0.7, 0.4]), ("xyz rz", [0.7, 0.4, 0.0, 0.3]), ("z rx", [0.1, 0.2])):
        law, theirs = (
            kit.CartesianImpedance(
                arm,
                target,
                300.0,
                30.0,
                frame="link4",
                axes=axes,
                compensate_coupling=True,
                nullspace=kit.NullSpace(np.full(4, 0.5), 20.0, 2.0, projection=projection),
            )
            for kit, arm in zip((al, reference), arms, strict=True)
        )
        parts, wanted = law.terms(0.0, q, v), theirs.terms(0.0, q, v)
        for name in ("null_torque", "loss", "tau"):
            close(parts[name], wanted[name], TOLERANCE)
        losses.append(float(parts["loss"]))
    # Rows that no joint can move are lost at every pose.
    assert losses[1] == losses[2] == 1.0
    # The square of a zero singular value is a rounding error, which is divided by eps^2.
    assert (losses[0] > 1.0 - 1e-9) if bend in (0.0, 1e-300, 1e-9, np.pi) else (losses[0] < 1.0 - 1e-6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("n", [2, 4, 7])
def test_runs(n: int, seed: int) -> None:
    rng = np.random.default_rng([n, seed, 5])
    arms = pair(rng, n)
    law, theirs = laws(rng, arms, n)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    settings: dict[str, Any] = {"t_end": 0.012, "dt": 1e-3, "v0": v0}
    run = al.simulate(al.RigidArm(arms[0]), law, q0, **settings)
    wanted = reference.simulate(reference.RigidArm(arms[1]), theirs, q0, **settings)
    # Rounding errors of the accelerations grow over the twelve steps.
    for name in ("q", "v", "tau", "estimate"):
        close(getattr(run, name), wanted[name], 1e-8)
    close(run.monitors["energy_balance"], wanted["energy_balance"], 1e-8)


@pytest.mark.parametrize("compensate", [False, True])
@pytest.mark.parametrize("n", [2, 4, 7])
def test_elastic_runs(n: int, compensate: bool) -> None:
    """Elastic runs with the same options agree in states, torques, storage function and energy balance.

    The balance includes the power of the projected torque.
    """
    rng = np.random.default_rng([n, 9])
    arms = pair(rng, n)
    frame, axes = arms[0].frame_names[-1], {2: "x", 4: "xyz", 7: "xyz"}[n]
    m = len(axes)
    inner = (definite(rng, n, 800.0), rng.uniform(0.3, 0.5, n), rng.uniform(0.1, 0.2, n))
    posture = rng.uniform(-0.5, 0.5, n)
    motion = (rng.uniform(-0.5, 0.5, m), rng.uniform(0.1, 0.2, m), np.full(m, 2.0), np.zeros(m))
    law, theirs = (
        kit.ElasticImpedance(
            arm, kit.Sinusoid(*motion), 100.0, 10.0, *inner, frame=frame, axes=axes, nullspace=kit.NullSpace(posture, 20.0, 2.0),
            feedforward=np.ones(m), compensate_coupling=compensate, eps=0.1,
        )
        for kit, arm in zip((al, reference), arms, strict=True)
    )  # fmt: skip
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    settings: dict[str, Any] = {"t_end": 0.01, "dt": 1e-3, "v0": v0}
    run = al.simulate(al.ElasticArm(arms[0], inner[0], inner[1]), law, q0, **settings)
    wanted = reference.simulate(reference.ElasticArm(arms[1], inner[0], inner[1]), theirs, q0, **settings)
    for name in ("q", "v", "tau", "theta"):
        close(getattr(run, name), wanted[name], 1e-8)
    for name in ("energy", "energy_balance"):
        close(run.monitors[name], wanted[name], 1e-8)


@pytest.mark.parametrize("limits", [False, True])
@pytest.mark.parametrize("n", [2, 4, 7])
def test_elastic_integral_and_limits(n: int, limits: bool) -> None:
    """The torque limit of an elastic law is that of its motors.

    An integral wrench w adds `B B0^-1 J' w` to the motor torques. If this would increase the excess over a limit, the integral stops.
    """
    rng = np.random.default_rng([n, 11])
    arms = pair(rng, n)
    frame, axes = arms[0].frame_names[-1], {2: "x", 4: "xyz", 7: "xyz"}[n]
    m = len(axes)
    inner = (definite(rng, n, 800.0), definite(rng, n, 0.4), definite(rng, n, 0.1))
    target, posture, gain = rng.uniform(-0.5, 0.5, m), rng.uniform(-0.5, 0.5, n), definite(rng, m, 50.0)
    given: dict[str, Any] = {"wrench_max": rng.uniform(5.0, 30.0, m), "tau_max": rng.uniform(5.0, 40.0, n)} if limits else {}
    law, theirs = (
        kit.ElasticImpedance(
            arm, target, 100.0, 10.0, *inner, frame=frame, axes=axes, nullspace=kit.NullSpace(posture, 20.0, 2.0),
            integral_gain=gain, **given,
        )
        for kit, arm in zip((al, reference), arms, strict=True)
    )  # fmt: skip
    held = 0
    for _ in range(20):
        q, v, theta_dot = rng.uniform(-1.0, 1.0, (3, n))
        theta, w = q + 0.02 * rng.normal(size=n), 10.0 * rng.normal(size=m)
        parts, wanted = law.terms(0.0, q, v, theta=theta, theta_dot=theta_dot, state=w), theirs.terms(0.0, q, v, theta, theta_dot, state=w)
        close(parts["integral_rate"], wanted["state_rate"], TOLERANCE)
        for name in ("u", "tau", "force"):
            close(parts[name], wanted[name], TOLERANCE)
        held += int((parts["integral_rate"] == 0.0).any())
    assert (held > 0) == limits
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    settings: dict[str, Any] = {"t_end": 0.01, "dt": 1e-3, "v0": v0}
    run = al.simulate(al.ElasticArm(arms[0], inner[0], inner[1]), law, q0, **settings)
    wanted = reference.simulate(reference.ElasticArm(arms[1], inner[0], inner[1]), theirs, q0, **settings)
    for name in ("q", "v", "tau", "theta", "estimate"):
        close(getattr(run, name), wanted[name], 1e-8)
    for name in ("energy", "energy_balance"):
        close(run.monitors[name], wanted[name], 1e-8)
    batch = al.simulate_batch(al.ElasticArm(arms[0], inner[0], inner[1]), law, [q0, v0], t_end=0.01, dt=1e-3, v0=[v0, v0])
    np.testing.assert_allclose(batch.estimate[0], run.estimate, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("elastic", [False, True])
@pytest.mark.parametrize("options", [{}, {"integral_gain": 150.0}, {"feedforward": [4.0, -2.0], "wrench_max": 300.0}])
@pytest.mark.parametrize("projection", ["consistent", "static"])
def test_rests(projection: str, options: dict[str, Any], elastic: bool) -> None:
    """Laws without a potential have the same rest pose, integral and eigenvalues of the loop in both libraries."""
    found = []
    for kit in (al, reference):
        arm = kit.planar_arm([0.5, 0.4, 0.3])
        given = (arm, [0.5, 0.3], [300.0, 250.0], 60.0)
        posture = kit.NullSpace([0.3, 0.4, 0.5], 20.0, 8.0, projection=projection)
        more = {"frame": "link3", "axes": "xy", "nullspace": posture} | options
        law = kit.ElasticImpedance(*given, 800.0, 0.3, 0.05, **more) if elastic else kit.CartesianImpedance(*given, **more)
        plant = kit.ElasticArm(arm, np.full(3, 800.0), np.full(3, 0.3)) if elastic else kit.RigidArm(arm)
        found.append(kit.equilibrium(plant, law, [6.0, -3.0], q0=[0.2, 0.5, 0.4]))
    ours, theirs = found
    for name in ("q", "tau", "x", *(["theta"] if elastic else []), *(["estimate"] if "integral_gain" in options else [])):
        close(getattr(ours, name), getattr(theirs, name), 1e-8)
    for name in ("reachable", "spurious", "stable"):
        assert getattr(ours, name) == getattr(theirs, name)
    # Derivatives of the reference are differences with Richardson extrapolation. They are less accurate.
    key = np.round(ours.eigenvalues, 4), np.round(theirs.eigenvalues, 4)
    np.testing.assert_allclose(np.sort_complex(key[0]), np.sort_complex(key[1]), atol=2e-3)
