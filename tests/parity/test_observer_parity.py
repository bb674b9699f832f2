"""The momentum observer against the reference, which computes M_dot v with complex steps and the wrench from eigenvectors."""

from __future__ import annotations

import numpy as np
import pytest
from loops import pair
from numpy.typing import NDArray
from trees import close, definite, driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]


@pytest.mark.parametrize("full", [False, True], ids=["diagonal", "full"])
@pytest.mark.parametrize("friction", [False, True])
@pytest.mark.parametrize("n", range(1, 9))
def test_samples(n: int, friction: bool, full: bool) -> None:
    """Residuals agree for random samples with several sample times, after `reset` and without it."""
    rng = np.random.default_rng([n, friction, full])
    arm, theirs = driven_tree(n, 4)
    K = definite(rng, n, 30.0) if full else rng.uniform(10.0, 60.0, n)
    for start in (True, False):
        ours, other = al.MomentumObserver(arm, K, friction=friction), ref.MomentumObserver(theirs, K, friction=friction)
        if start:
            q, v = rng.normal(size=(2, n))
            ours.reset(q, v)
            other.reset(q, v)
        for dt in (1e-3, 1e-3, 5e-3, 0.02, 1e-3):
            q, v, tau = rng.normal(size=(3, n))
            # The momenta are random, so their differences are not small.
            close(ours.update(q, v, tau, dt), other.update(q, v, tau, dt), tolerance=1e-11)
        assert ours.residual is not None and other.residual is not None
        close(ours.residual, other.residual, tolerance=1e-11)


@pytest.mark.parametrize("n", range(1, 9))
def test_wrenches(n: int) -> None:
    """Contact wrenches agree with and without a large bound on the singular values, for fewer and more than six joints."""
    rng = np.random.default_rng(n)
    arm, theirs = pair(rng, n)
    ours, other = al.MomentumObserver(arm, 40.0), ref.MomentumObserver(theirs, 40.0)
    q, v, tau = rng.normal(size=(3, n))
    for observer in (ours, other):
        observer.update(q, v, tau, 0.01)
        observer.update(q, 0.5 * v, tau, 0.01)
    frame = arm.frame_names[-1]
    for eps in (None, 0.5):
        # No singular value is near the bound, so both methods agree up to rounding.
        close(ours.wrench(q, frame, eps=eps), other.wrench(q, frame, eps), tolerance=1e-7)
        close(ours.unexplained(q, frame, eps=eps), other.unexplained(q, frame, eps), tolerance=1e-7)


@pytest.mark.parametrize("n", [1, 3, 6])
def test_motors_and_rows(n: int) -> None:
    """Residuals agree for motors of elastic joints, and for five arms in one observer."""
    rng = np.random.default_rng(n)
    arm, theirs = pair(rng, n)
    B = definite(rng, n, 0.5)
    ours, other = al.MomentumObserver(arm, 25.0, motor_inertia=B), ref.MomentumObserver(theirs, 25.0, motor_inertia=B)
    for _ in range(4):
        theta, rate, tau = rng.normal(size=(3, 5, n))
        close(ours.update(theta, rate, tau, 2e-3), other.update(theta, rate, tau, 2e-3), tolerance=1e-11)


def test_thresholds_and_contact() -> None:
    rng = np.random.default_rng(3)
    arm, theirs = pair(rng, 4)
    ours, other = al.MomentumObserver(arm, 30.0, threshold=0.5), ref.MomentumObserver(theirs, 30.0, threshold=0.5)
    noise = rng.normal(size=(200, 4)) * [0.1, 0.2, 0.3, 0.4]
    for _ in range(20):
        q = rng.normal(size=4)
        tau = rng.normal(size=4) * rng.choice([0.0, 30.0], 4)
        for observer in (ours, other):
            observer.reset(q, np.zeros(4))
            observer.update(q, np.zeros(4), theirs.gravity(q) - tau, 0.02)
        assert ours.contact() == other.contact()
        ours.calibrate(noise, sigmas=4.0)
        other.calibrate(noise, sigmas=4.0)
        assert ours.threshold is not None and other.threshold is not None
        close(ours.threshold, np.asarray(other.threshold))


def test_friction_goes_with_no_motor_inertia() -> None:
    """Both libraries refuse `friction` together with `motor_inertia`: the model's friction is that of the joints, not of the motors."""
    arm, theirs = driven_tree(2, 4)
    for make in (lambda: al.MomentumObserver(arm, 40.0, friction=True, motor_inertia=0.1),
                 lambda: ref.MomentumObserver(theirs, 40.0, friction=True, motor_inertia=0.1)):  # fmt: skip
        with pytest.raises(ValueError, match="friction goes with no motor_inertia"):
            make()
