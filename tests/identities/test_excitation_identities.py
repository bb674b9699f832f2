"""Exciting motions are within their limits at every time, their gradient is correct, and they are more informative than random sines."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al
from armlet import excitation

Array = NDArray[np.float64]

LIMITS: dict[str, Any] = {"q_min": -1.5, "q_max": 1.5, "v_max": 3.0, "a_max": 10.0}
ARMS = {
    "pr": models.PR,
    "1R": al.planar_arm([0.5]),
    "2R": models.TWO_LINKS,
    "4R": al.planar_arm([1.0, 1.0, 0.25, 0.25]),
    "slide": al.Arm.from_chain(
        [
            {"type": "R", "axis": [0, 0, 1], "xyz": [0, 0, 0.1], "rpy": [0.3, 0, 0], "phi": [2, 0.1, 0.2, 0.3, 0.2, 0, 0, 0.3, 0, 0.3]},
            {"type": "P", "axis": [1, 0, 0], "xyz": [0.2, 0, 0.1], "rpy": [0, 0.4, 0], "phi": [1, 0.1, 0.0, 0.1, 0.1, 0, 0, 0.2, 0, 0.2]},
        ]
    ),
}


def problem(arm: al.Arm, limits: dict[str, Any], samples: int = 40, drives: bool = False) -> Any:
    return excitation._Problem(arm, excitation._limits(arm, limits), excitation._series(5.0, 3, samples), np.ones(arm.n), drives, drives)


@pytest.mark.parametrize("drives", [False, True])
@pytest.mark.parametrize("name", ARMS)
def test_the_gradient_is_that_of_the_cost(name: str, drives: bool) -> None:
    if name == "pr" and drives:
        with pytest.raises(al.InputError, match="friction"):
            al.exciting_motion(ARMS[name], 5.0, limits=LIMITS, friction=True)
        return
    arm = ARMS[name]
    # Some torques exceed their limit, so the gradient includes the penalty.
    of = problem(arm, LIMITS | {"effort": 3.0}, drives=drives)
    c = np.random.default_rng(1).normal(size=arm.n * 7)
    _, gradient = of.cost(c)
    h = 1e-6
    numeric = np.array([(of.cost(c + h * unit)[0] - of.cost(c - h * unit)[0]) / (2.0 * h) for unit in np.eye(c.size)])
    # The tolerance covers the rounding error of the cost divided by h, and the error of central differences, about h^2.
    np.testing.assert_allclose(gradient, numeric, rtol=1e-6, atol=1e-6 * np.abs(gradient).max())


@pytest.mark.parametrize("name", ARMS)
def test_limits_hold_at_every_time(name: str) -> None:
    arm = ARMS[name]
    effort = 3.0 if name == "pr" else 1.05 * np.abs(arm.inverse_dynamics(np.zeros(arm.n), np.zeros(arm.n), np.zeros(arm.n))) + 1.0
    m = al.exciting_motion(arm, 5.0, limits=LIMITS | {"effort": effort}, harmonics=3, iterations=20)
    q, v, a = (np.array(x) for x in zip(*(m(t) for t in np.linspace(0.0, 5.0, 7001)), strict=True))
    tau = arm.inverse_dynamics(q, v, a)
    shares = [np.abs(x).max(axis=0) / limit for x, limit in ((q, 1.5), (v, 3.0), (a, 10.0), (tau, effort))]
    assert np.max(shares) <= 1.0
    # Either each joint reaches one of its limits, or a torque limit stops the scaling of all joints.
    assert np.max(shares[3]) > 0.9 or np.min(np.max(shares[:3], axis=0)) > 0.99
    assert np.allclose(m(0.0), m(5.0), rtol=0.0, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in ARMS if name != "1R"])
def test_deviations_are_smaller_than_with_random_sines(name: str) -> None:
    """The geometric mean of the deviations is at most half of that of one random sine per joint (median of 20)."""
    arm = ARMS[name]
    of = problem(arm, LIMITS)
    sines = [random_sines(of, np.random.default_rng(k)) for k in range(20)]
    typical = np.median([geometric(excitation._motion(of, c, 5.0, 3).deviations) for c in sines])
    m = al.exciting_motion(arm, 5.0, limits=LIMITS, harmonics=3, samples=40, iterations=60)
    assert geometric(m.deviations) <= 0.5 * typical


def random_sines(of: Any, rng: np.random.Generator) -> Array:
    """One sine per joint with random harmonic and phase. The amplitude is a random fraction of the largest one within the limits."""
    n = len(of.limits.half)
    c, at, phase = np.zeros((n, 7)), rng.integers(1, 4, n), rng.uniform(0.0, 2.0 * np.pi, n)
    c[np.arange(n), at], c[np.arange(n), 3 + at] = np.cos(phase), np.sin(phase)
    fitted: Array = of.fitted(c, 5.0, 3)
    return rng.uniform(0.1, 1.0, (n, 1)) * fitted


def geometric(x: Array) -> float:
    return float(np.exp(np.mean(np.log(x))))
