"""`fit_log` on logs of a simulator in numpy: coverage of the deviations, faults of the log, and parameters that cannot be identified."""

from __future__ import annotations

import pickle
from typing import Any

import models
import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

LENGTHS, MASSES = [0.5, 0.4], [3.0, 2.0]
ARM = models.TWO_HEAVY_LINKS
VISCOUS, COULOMB, OFFSET = np.array([0.8, 0.5]), np.array([0.6, 0.3]), np.array([0.4, -0.2])
SPEEDS, PHASES = np.array([[1.3, 0.51], [2.1, 0.83]]), np.array([[0.0, 1.0], [2.0, 0.5]])


def motion(t: Array) -> tuple[Array, Array, Array]:
    angle = SPEEDS * t[:, None, None] + PHASES
    size = np.array([0.9, 0.6])
    return tuple((size * x).sum(axis=2) for x in (np.sin(angle), SPEEDS * np.cos(angle), -(SPEEDS**2) * np.sin(angle)))  # type: ignore[return-value]


def recorded(seed: int, *, noise: float = 0.3, duration: float = 20.0, more: Any = 0.0) -> al.Log:
    """A log at 100 Hz: quantised encoders, noisy torques, uneven times, and 1 % of lost samples. `more(v)` is added to the torque."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration, 0.01) + 2e-4 * rng.uniform(-1.0, 1.0, round(duration / 0.01))
    q, v, a = motion(t)
    tau = models.links_torque(LENGTHS, MASSES, q, v, a) + VISCOUS * v + COULOMB * np.sign(v) + OFFSET
    tau = tau + (more(v) if callable(more) else more) + noise * rng.normal(size=q.shape)
    step = 2.0 * np.pi / 2**17
    kept = rng.uniform(size=len(t)) > 0.01
    return al.Log(t[kept], step * np.round(q / step)[kept], tau=tau[kept], names=ARM.joint_names)


def truth(fit: al.LogFit) -> Array:
    base = ARM.base_parameters(friction=True, offset=True)
    known = base.projection @ np.concatenate([ARM.parameters, VISCOUS, COULOMB, OFFSET])
    return np.array([dict(zip(base.grouping, known, strict=True))[name] for name in fit.names])


KINDS = ("inertia", "viscous", "coulomb", "offsets")


def test_deviations_cover_the_errors() -> None:
    """Of 100 logs, 95 % of the errors of each parameter are within two deviations. `coverage_trials.py` repeats this with 1,000 logs."""
    fits = [al.fit_log(ARM, recorded(seed), KINDS, cutoff=5.0) for seed in range(100)]
    within = np.array([np.abs(fit.values - truth(fit)) < 2.0 * fit.deviations for fit in fits])
    assert fits[0].rank == len(fits[0].names) == 12
    assert 0.92 < within.mean() < 0.98
    assert within.mean(axis=0).min() > 0.88
    # The deviations are not too large: the errors have their size.
    errors = np.array([(fit.values - truth(fit)) / fit.deviations for fit in fits])
    assert np.all((errors.std(axis=0) > 0.75) & (errors.std(axis=0) < 1.35))


def test_the_model_of_a_log() -> None:
    log = recorded(0)
    fit = al.fit_log(ARM, log, KINDS, cutoff=5.0)
    q = log.q[::40]
    np.testing.assert_allclose(fit.model.gravity(q) + fit.offsets, ARM.gravity(q) + OFFSET, atol=0.1)
    np.testing.assert_allclose(fit.model.limits["friction"], COULOMB, atol=0.1)
    np.testing.assert_allclose(fit.offsets, OFFSET, atol=0.1)
    assert fit.correlated == () or abs(fit.correlated[0][2]) > 0.95
    # The filter reduces the noise of 0.3 N m by the square root of its share of the band.
    assert np.all(fit.residuals < 0.15)
    assert fit.unidentifiable == ("not distinguishable from the fitted parameters: rotor inertia of joint 'joint1'",)
    assert "viscous" in fit.kinds and "damping[joint1]" in str(fit) and repr(fit).startswith("<LogFit: rank 12 of 12")
    assert fit.plot(Figure()).shape == (2, 1)
    copy = pickle.loads(pickle.dumps(fit))
    np.testing.assert_array_equal(copy.values, fit.values)
    without = al.fit_log(ARM, log, ("inertia", "viscous", "coulomb"), cutoff=5.0)
    assert np.all(without.residuals > 1.3 * fit.residuals)


def test_known_parts_of_the_model_are_subtracted() -> None:
    """Without "inertia" the bodies of the arm are known, and without "rotors" its rotors."""
    fit = al.fit_log(ARM, recorded(1), ("viscous", "coulomb", "offsets"), cutoff=5.0)
    assert fit.names == tuple(f"{kind}[{joint}]" for kind in ("damping", "friction", "offset") for joint in ARM.joint_names)
    assert np.all(np.abs(fit.values - np.concatenate([VISCOUS, COULOMB, OFFSET])) < 4.0 * fit.deviations)
    np.testing.assert_array_equal(fit.model.parameters, ARM.parameters)
    rotors = np.array([0.3, 0.2])
    log = recorded(2)
    heavy = al.Log(log.t, log.q, tau=np.asarray(log.tau) + rotors * motion(log.t)[2], names=log.names)
    known = al.fit_log(ARM.with_drives(armature=rotors), heavy, KINDS, cutoff=5.0)
    assert np.all(np.abs(known.values - truth(known)) < 4.0 * known.deviations)
    found = al.fit_log(ARM, heavy, ("rotors", "viscous", "coulomb", "offsets"), cutoff=5.0)
    np.testing.assert_allclose(found.model.limits["armature"], rotors, atol=0.05)


def test_stribeck_friction() -> None:
    size = np.array([1.5, 1.0])
    log = recorded(3, noise=0.1, more=lambda v: size * np.exp(-((v / 0.3) ** 2)) * np.sign(v))
    fit = al.fit_log(ARM, log, (*KINDS, "stribeck"), cutoff=5.0, stribeck_speed=0.3)
    np.testing.assert_allclose(fit.stribeck, size, atol=0.25)
    assert np.all(al.fit_log(ARM, log, KINDS, cutoff=5.0).residuals > 1.1 * fit.residuals)


def test_joints_that_hardly_move_are_named() -> None:
    t = np.arange(0.0, 20.0, 0.01)
    q, v, a = motion(t)
    q[:, 1], v[:, 1], a[:, 1] = 0.3, 0.0, 0.0
    fit = al.fit_log(ARM, al.Log(t, q, tau=ARM.inverse_dynamics(q, v, a), names=ARM.joint_names), ("inertia", "viscous"), cutoff=5.0)
    assert fit.rank < len(fit.names)
    assert "not identifiable from this log: damping[joint2]" in fit.unidentifiable
    assert fit.unidentifiable[-1] == "joint 'joint2' hardly moves: move it while the other joints move"
    # Of all parameters that fit, those nearest to the arm's are chosen.
    np.testing.assert_allclose(fit.model.inverse_dynamics(q, v, a), ARM.inverse_dynamics(q, v, a), atol=0.02)


def test_gaps_are_omitted() -> None:
    log = recorded(4, noise=0.0)
    hole = (log.t < 5.0) | (log.t > 7.0)
    fit = al.fit_log(ARM, al.Log(log.t[hole], log.q[hole], tau=np.asarray(log.tau)[hole], names=log.names), KINDS, cutoff=5.0)
    assert not np.any((fit.t > 4.7) & (fit.t < 7.3))
    np.testing.assert_allclose(fit.values, truth(fit), atol=0.1)


def test_consistent_parameters() -> None:
    rough = models.TWO_LINKS
    fit = al.fit_log(rough, recorded(5, noise=2.0), KINDS, cutoff=5.0, consistent=True)
    assert fit.model.check_parameters() and fit.before is not None
    assert fit.names == fit.before.names[-6:]
    assert np.all(fit.residuals < 2.5 * fit.before.residuals)
    alone = al.fit_log(ARM, recorded(6), ("inertia",), cutoff=5.0, consistent=True)
    assert alone.model.check_parameters() and alone.residuals.shape == (2,)


def test_bad_arguments() -> None:
    log = recorded(7, duration=3.0)
    bare = al.Log(log.t, log.q, names=log.names)
    for call, message in (
        (lambda: al.fit_log("arm", log), "model is of the wrong type"),
        (lambda: al.fit_log(models.PR, log), "model has no links: expected an arm of joints and links"),
        (lambda: al.fit_log(al.RigidArm(models.PR), log), "model has no links"),
        (lambda: al.fit_log(ARM, log.q), "log is of the wrong type"),
        (lambda: al.fit_log(ARM, bare), "log does not fit the model: expected torques of 2 joints, got no torques"),
        (lambda: al.fit_log(models.THREE_LINKS, log), "log does not fit the model: expected torques of 3 joints, got 2 joints"),
        (lambda: al.fit_log(ARM, log, ()), "names are not different"),
        (lambda: al.fit_log(ARM, log, ("inertia", "inertia")), "names are not different"),
        (lambda: al.fit_log(ARM, log, ("mass",)), "names is unknown: expected one of inertia, rotors, viscous"),
        (lambda: al.fit_log(ARM, log, cutoff=40.0), "cutoff is too high"),
        (lambda: al.fit_log(ARM, log, cutoff=np.nan), "cutoff is out of range"),
        (lambda: al.fit_log(ARM, log, stribeck_speed=0.0), "stribeck_speed is out of range"),
        (lambda: al.fit_log(ARM, log, delay=np.inf), "delay is not finite"),
        (lambda: al.fit_log(ARM, log, delay=10.0), "log is too short"),
        (lambda: al.fit_log(ARM, log, consistent=1), "consistent is of the wrong type"),
        (lambda: al.fit_log(ARM, log.cut(0.0, 0.5)), "log is too short"),
        (lambda: al.fit_log(ARM, log.cut(0.0, 0.005)), "log is too short"),
    ):
        with pytest.raises(al.InputError, match=f"^fit_log: {message}"):
            call()  # type: ignore[no-untyped-call]
