"""The figure of the timing of a path. It shows where each limit is active.

    tau = A u + B r^2 + g + d q' r,   A = M q',   B = M q'' + C(q, q') q',   r = ds/dt,   u = d^2 s/dt^2

q' and q'' are derivatives with respect to the path position s. M, C and g are mass matrix, Coriolis matrix and gravity torque, and d is the
viscous friction.

At a path position `s` and a path speed `r`, each limit of torque or acceleration allows an interval of `u`. If the intervals have no common
point, no motion is feasible there. The edge of this region is the maximum velocity curve. Limits of joint speed also bound `r`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from .._core import Arm, TimedPath
from ..errors import InputError
from .style import COLOURS, legend_below, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["PathTiming"]

LIMIT = "0.25"
Array = NDArray[Any]
# A jump of the path acceleration is marked as a switch if it exceeds this fraction of the largest path acceleration.
JUMP = 0.1


def _bounds(limit: ArrayLike | None, n: int) -> tuple[Array, Array]:
    """Lower and upper limits `(n,)` from a number, `(n,)` or `(n, 2)`. None makes infinite limits."""
    if limit is None:
        return np.full(n, -np.inf), np.full(n, np.inf)
    values = _core.numbers("PathTiming", "a limit", limit, (), (n,), (n, 2))
    if values.ndim == 2:
        return values[:, 0], values[:, 1]
    upper = np.broadcast_to(values, (n,))
    return -upper, upper


@dataclass(frozen=True)
class PathTiming:
    """A timing from `time_path` with its limits, and its figure.

    Attributes:
        arm: the arm.
        motion: the feasible `TimedPath`.
        tau_max, v_max, a_max: the limits, which were the arguments of `time_path`.
        viscous: viscous friction, N m s/rad or N s/m: number or `(n,)`.
    """

    arm: Arm
    motion: TimedPath
    tau_max: ArrayLike | None = None
    v_max: ArrayLike | None = None
    a_max: ArrayLike | None = None
    viscous: ArrayLike = 0.0

    def plot(self, fig: Figure | None = None) -> Array:
        """Draw torque over time and over path position, the phase plane, and joint positions, speeds and accelerations; returns the axes.

        Args:
            fig: a matplotlib figure to draw into; None makes one with pyplot.

        Raises:
            ImportError: matplotlib is not installed.
            InputError: the motion is not a feasible `TimedPath`, its duration is zero, or `tau_max` is missing.
        """
        require("PathTiming.plot")
        if not (self.motion.feasible and self.motion.duration > 0.0):
            raise InputError("PathTiming.plot: motion has no timing to draw: expected a feasible TimedPath with a duration > 0")
        if self.tau_max is None:
            raise InputError("PathTiming.plot: tau_max is missing: expected the torque limits that were passed to time_path")
        with sheet(fig, (13.2, 7.0)) as figure:
            axes = figure.subplots(2, 3)
            t, s = self._samples()
            q, v, a = self.motion(t)
            tau = self.arm.inverse_dynamics(q, v, a) + _core.numbers("PathTiming", "viscous", self.viscous, (), (v.shape[-1],)) * v
            self._torques(axes[0, 0], axes[0, 1], t, s, tau)
            self._phase_plane(axes[0, 2])
            self._over_time(axes[1, 0], t, q, None, ("position", ""))
            self._over_time(axes[1, 1], t, v, self.v_max, ("speed", "/s"))
            self._over_time(axes[1, 2], t, a, self.a_max, ("acceleration", "/s²"))
            handles = axes[0, 0].get_lines()[: self.arm.n]
            for line, name in zip(handles, self.arm.joint_names, strict=True):
                line.set_label(literal(name))
            legend_below(figure, handles)
        result: Array = axes
        return result

    def _samples(self) -> tuple[Array, Array]:
        """Times at which the motion is drawn, s, and their path positions. They include grid points and times just before them."""
        p = self.motion
        inner = np.linspace(0.0, 1.0, 6)[:, None]
        lengths = np.diff(p.t)
        t = (p.t[:-1] + inner * lengths)[:-1].T.ravel()
        t = np.sort(np.concatenate([t, np.nextafter(p.t[1:], 0.0)]))
        r = p.s_dot
        i = np.clip(np.searchsorted(p.t, t, side="right") - 1, 0, lengths.size - 1)
        d = t - p.t[i]
        # Between grid points the path speed is nearly linear in time, which is accurate enough for a figure.
        s = p.s[i] + d * (r[i] + 0.5 * d * (r[i + 1] - r[i]) / lengths[i])
        return t, s

    def _torques(self, time: Axes, along: Axes, t: Array, s: Array, tau: Array) -> None:
        low, high = _bounds(self.tau_max, self.arm.n)
        share = (2.0 * tau - low - high) / (high - low)
        for ax, x in ((time, t), (along, s)):
            # The lines of the joints are drawn first, because the legend of the figure uses the first lines of the axes.
            for j in range(self.arm.n):
                ax.plot(x, share[:, j], color=COLOURS[j % len(COLOURS)])
            for bound in (-1.0, 1.0):
                ax.axhline(bound, color=LIMIT, linestyle="--", linewidth=1.0)
            ax.set_ylim(-1.15, 1.15)
            ax.set_ylabel("torque, in parts of its limits")
        time.set_xlabel("time (s)")
        time.set_title("Torque against time")
        along.set_xlabel("path position $s$ (1)")
        along.set_title("Torque against path position")

    def margin(self, s: ArrayLike, r: ArrayLike) -> Array:
        """The width of the interval of path accelerations that `tau_max` and `a_max` allow, `(R, S)`, 1/s^2.

        `r`, `(R,)`, are path speeds, and `s`, `(S,)`, are path positions. The width is negative where these limits allow no path
        acceleration. `v_max` is not considered.
        """
        arm, n = self.arm, self.arm.n
        q, slope, curvature = self.motion.path(s)
        g = arm.gravity(q)
        A = arm.inverse_dynamics(q, np.zeros_like(q), slope) - g
        B = arm.inverse_dynamics(q, slope, curvature) - g
        least, most = np.full((np.size(r), np.size(s)), -np.inf), np.full((np.size(r), np.size(s)), np.inf)
        speed = np.asarray(r, dtype=np.float64)[:, None]
        rows = [(A, B, g, _core.numbers("PathTiming", "viscous", self.viscous, (), (n,)) * slope, _bounds(self.tau_max, n))]
        rows.append((slope, curvature, np.zeros_like(q), np.zeros_like(q), _bounds(self.a_max, n)))
        for alpha, beta, rest, rub, (low, high) in rows:
            for j in range(n):
                if not np.isfinite(high[j]):
                    continue
                value = beta[:, j] * speed**2 + rest[:, j] + rub[:, j] * speed
                idle = alpha[:, j] == 0.0
                by = np.where(idle, 1.0, alpha[:, j])
                one, two = (low[j] - value) / by, (high[j] - value) / by
                blocked = idle & ((value < low[j]) | (value > high[j]))
                least = np.maximum(least, np.where(blocked, np.inf, np.where(idle, -np.inf, np.minimum(one, two))))
                most = np.minimum(most, np.where(blocked, -np.inf, np.where(idle, np.inf, np.maximum(one, two))))
        return np.asarray(most - least)

    def switches(self) -> Array:
        """The indices of grid points at which the path acceleration jumps by more than JUMP times the largest path acceleration."""
        p = self.motion
        u = np.diff(p.s_dot**2) / (2.0 * np.diff(p.s))
        jumps = np.abs(np.diff(u))
        # A switch within a segment appears as two jumps. Only the larger jump is marked.
        after, before = np.append(jumps[1:], 0.0), np.append(0.0, jumps[:-1])
        return np.flatnonzero((jumps > JUMP * np.abs(u).max()) & (jumps >= after) & (jumps > before)) + 1

    def _phase_plane(self, ax: Axes) -> None:
        p = self.motion
        s = np.linspace(p.s[0], p.s[-1], 500)
        # The axis ends at 1.35 times the largest path speed. If this range has no infeasible region, it ends at 3 times that speed.
        for height in (1.35, 3.0):
            top = height * float(p.s_dot.max())
            r = np.linspace(0.0, top, 400)
            shut = np.where(self.margin(s, r) < 0.0, 1.0, 0.0)
            if shut.any():
                break
        if shut.any():
            ax.contourf(s, r, shut, levels=[0.5, 1.5], colors=["0.88"])
            ax.contour(s, r, shut, levels=[0.5], colors=["0.35"], linewidths=1.0)
            ax.plot([], [], color="0.35", linewidth=1.0, label="maximum velocity curve")
        if self.v_max is not None:
            slope = np.abs(p.path(s)[1])
            with np.errstate(divide="ignore"):
                bound = (_bounds(self.v_max, self.arm.n)[1] / slope).min(axis=1)
            ax.plot(
                s, np.where(bound < 2.0 * top, bound, np.nan), color=COLOURS[1], linestyle="--", linewidth=1.0, label="joint speed limits"
            )
        ax.plot(p.s, p.s_dot, color=COLOURS[0], label="timing")
        k = self.switches()
        ax.plot(p.s[k], p.s_dot[k], "o", color="black", markersize=3.5, linestyle="none", label="switches")
        ax.set_xlim(p.s[0], p.s[-1])
        ax.set_ylim(0.0, top)
        ax.set_xlabel("path position $s$ (1)")
        ax.set_ylabel(r"path speed $\dot s$ (1/s)")
        ax.set_title("Phase plane (grey: infeasible)" if shut.any() else "Phase plane")
        ax.legend(loc="best", handlelength=1.8)

    def _over_time(self, ax: Axes, t: Array, values: Array, limit: ArrayLike | None, what: tuple[str, str]) -> None:
        """Draw a quantity of the joints over time, as a fraction of its limits if there are any. `what`: its name and unit."""
        name, per = what
        low, high = _bounds(limit, self.arm.n)
        if limit is not None:
            # The upper limit is drawn at 1, and the lower limit at -1. A joint with an infinite limit is drawn at 0.
            with np.errstate(invalid="ignore"):
                values = np.where(np.isfinite(high - low), (2.0 * values - low - high) / (high - low), 0.0)
            for bound in (-1.0, 1.0):
                ax.axhline(bound, color=LIMIT, linestyle="--", linewidth=1.0)
        units = ["m" if kind == "prismatic" else "rad" for kind in self.arm.joint_types]
        # Without limits, lengths have their own axis on the right if there are angles too.
        axes = dict.fromkeys(units, ax)
        if limit is None and len(axes) == 2:
            axes["m"] = ax.twinx()
            axes["m"].spines["right"].set_visible(True)
            axes["m"].grid(False)
        for j, unit in enumerate(units):
            axes[unit].plot(t, values[:, j], color=COLOURS[j % len(COLOURS)])
        for unit, each in axes.items():
            each.set_ylabel(f"joint {name} ({unit}{per})" if limit is None else f"joint {name}, in parts of its limits")
        ax.set_xlabel("time (s)")
        ax.set_title(f"Joint {name}s")
