"""The figure of a path timing: its panels, its infeasible region, and refused arguments."""

from __future__ import annotations

import models
import numpy as np
import pytest
from matplotlib.figure import Figure

import armlet as al
from armlet.figures.time_path import PathTiming

ARM = models.TWO_LINKS
LIMITS = {"tau_max": [20.0, 8.0], "v_max": 4.0}
TIMED = al.time_path(ARM, [[0.0, 0.0], [0.5, 0.8], [1.2, 0.3]], **LIMITS)  # type: ignore[arg-type]


def test_panels() -> None:
    axes = PathTiming(ARM, TIMED, **LIMITS).plot(Figure())  # type: ignore[arg-type]
    assert axes.shape == (2, 3)
    for ax in axes.ravel():
        assert ax.get_xlabel() and ax.get_ylabel() and ax.get_title(loc="left")
    for ax in axes[0, :2]:
        drawn = np.concatenate([line.get_ydata() for line in ax.get_lines()])
        # The curves are relative to the limits.
        assert np.isfinite(drawn).all() and np.abs(drawn).max() <= 1.0 + 1e-6 and np.abs(drawn).max() >= 0.999


def test_joints_over_time() -> None:
    """Positions are in rad, speeds relative to their limits. Accelerations are in rad/s^2, or relative to a limit if there is one."""
    axes = PathTiming(ARM, TIMED, **LIMITS).plot(Figure())  # type: ignore[arg-type]
    labels = ["joint position (rad)", "joint speed, in parts of its limits", "joint acceleration (rad/s²)"]
    assert [ax.get_ylabel() for ax in axes[1]] == labels
    t = axes[1, 2].get_lines()[1].get_xdata()
    np.testing.assert_array_equal(axes[1, 2].get_lines()[1].get_ydata(), TIMED(t)[2][:, 1])
    limited = al.time_path(ARM, [[0.0, 0.0], [0.5, 0.8]], tau_max=99.0, a_max=[4.0, 3.0])
    drawn = PathTiming(ARM, limited, 99.0, a_max=[4.0, 3.0]).plot(Figure())[1, 2]
    shares = np.array([line.get_ydata() for line in drawn.get_lines() if len(line.get_ydata()) > 2])
    # Relative to the limits, joint 2 has the longer way. So its acceleration is at its limit during the whole motion.
    assert np.abs(shares[1]).max() == pytest.approx(1.0, abs=1e-6) and np.abs(shares).max() <= 1.0 + 1e-6


def test_the_timing_lies_in_its_region() -> None:
    """At every grid point the limits allow some path acceleration.

    At much higher path speeds, where torque limits bind, they allow none.
    """
    figure = PathTiming(ARM, TIMED, tau_max=LIMITS["tau_max"])
    margin = np.array([figure.margin(s, r)[0, 0] for s, r in zip(TIMED.s[:, None], TIMED.s_dot[:, None], strict=True)])
    # On the edge of the region the margin is zero, up to the tolerance of the limits and rounding.
    assert np.all(margin >= -1e-6 * np.abs(margin).max())
    # At a speed of 1e3 most margins are negative. The ends are an exception, because the spline has no curvature there.
    assert np.mean(figure.margin(TIMED.s, [1e3]) < 0.0) > 0.5
    free = figure.margin(TIMED.s, [0.0])
    assert np.all(free > 0.0)


def test_refusals() -> None:
    weak = al.time_path(ARM, [[0.0, 0.0], [1.0, 0.5]], tau_max=0.1)
    for motion in (weak, al.time_path(ARM, [[0.1, 0.2]] * 2, tau_max=30.0)):
        with pytest.raises(al.InputError, match=r"^PathTiming\.plot: motion has no timing to draw"):
            PathTiming(ARM, motion, tau_max=0.1).plot(Figure())
    with pytest.raises(al.InputError, match=r"^PathTiming\.plot: tau_max is missing"):
        PathTiming(ARM, TIMED).plot(Figure())
