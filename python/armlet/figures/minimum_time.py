"""The figure of a minimum-time problem of one link. It compares the symmetric bang-bang profile with the fastest motions under full torque.

    I theta_ddot + G sin theta = tau,   tau_min <= tau <= tau_max

I is the inertia, G the gravity moment, and v = theta_dot. The switching curve contains the states from which a constant torque, one of the
two limits, leads to rest at the goal `thetaf`:

    theta increases:  I v^2/2 = -tau_min (thetaf - theta) + G (cos theta - cos thetaf),  theta < thetaf
    theta decreases:  I v^2/2 =  tau_max (theta - thetaf) + G (cos theta - cos thetaf),  theta > thetaf
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._core import bang_bang_time, torque_optimal_time
from .style import COLOURS, legend_below, require, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["MinimumTime"]

PROFILE, OPTIMUM, SWING, LIMIT = COLOURS[0], COLOURS[1], COLOURS[2], "0.25"
Array = NDArray[Any]


@dataclass(frozen=True)
class MinimumTime:
    """A minimum-time problem of one link, with the arguments of `bang_bang_time`, and its figure.

    Attributes:
        theta0, thetaf: start and end, rad from the downward vertical.
        inertia: inertia about the joint, kg m^2.
        gravity_moment: mass times gravity times distance of the centre of mass, N m.
        tau_max, tau_min: torque limits, N m; `tau_min=None` means `-tau_max`.
    """

    theta0: float
    thetaf: float
    inertia: float
    gravity_moment: float
    tau_max: float
    tau_min: float | None = None

    @property
    def limits(self) -> tuple[float, float]:
        return -self.tau_max if self.tau_min is None else self.tau_min, self.tau_max

    def plot(self, fig: Figure | None = None) -> Array:
        """Draw torque, speed and acceleration over time, torque over angle, the phase plane, and durations over gravity; returns the axes.

        Args:
            fig: a matplotlib figure to draw into; None makes one with pyplot.

        Raises:
            ImportError: matplotlib is not installed.
        """
        require("MinimumTime.plot")
        with sheet(fig, (13.2, 7.0)) as figure:
            axes = figure.subplots(2, 3)
            motions = self._motions()
            self._torques(axes[0, 0], axes[1, 0], motions)
            self._rates(axes[0, 1], axes[0, 2], motions)
            self._phase_plane(axes[1, 1], motions)
            self._durations(axes[1, 2], [float(t[-1]) for _, _, (t, _, _, _) in motions])
            handles = axes[0, 0].get_legend_handles_labels()[0] + axes[1, 0].get_legend_handles_labels()[0][1:]
            legend_below(figure, handles)
        result: Array = axes
        return result

    def _motions(self) -> list[tuple[str, str, tuple[Array, Array, Array, Array]]]:
        """For each drawn motion: its name, its colour, and the arrays (t, theta, theta_dot, tau), in s, rad, rad/s and N m.

        The symmetric bang-bang profile and the monotone optimum are drawn if they are feasible. A back-swing or an overshoot is drawn if
        it is the fastest motion.
        """
        given = (self.theta0, self.thetaf, self.inertia, self.gravity_moment, self.tau_max)
        found = []
        report = bang_bang_time(*given, tau_min=self.tau_min)
        if report.feasible and report.t_min > 0.0:
            u = np.concatenate([np.linspace(0.0, 0.5, 301), np.linspace(0.5, 1.0, 301)])
            first = np.arange(602) < 301
            D, T = self.thetaf - self.theta0, report.t_min
            q = np.where(first, self.theta0 + 2 * D * u**2, self.thetaf - 2 * D * (1 - u) ** 2)
            v = np.where(first, u, 1 - u) * 4 * D / T
            tau = np.where(first, 4, -4) * self.inertia * D / T**2 + self.gravity_moment * np.sin(q)
            found.append((f"symmetric profile, {T:.4g} s", PROFILE, (u * T, q, v, tau)))
        optimum = torque_optimal_time(*given, tau_min=self.tau_min)
        if optimum.feasible and optimum.t > 0.0:
            t = _times(optimum.t, (optimum.t_switch,))
            q, v, _, tau = optimum.monotone_profile(t)
            found.append((f"monotone optimum, {optimum.t:.4g} s", OPTIMUM, (t, q, v, tau)))
        best = optimum.best
        if best.kind in ("back-swing", "overshoot"):
            t = _times(best.t, best.t_switches)
            q, v, _, tau = optimum.profile(t)
            found.append((f"{best.kind}, {best.t:.4g} s", SWING, (t, q, v, tau)))
        return found

    def _torques(self, time: Axes, angle: Axes, motions: list[Any]) -> None:
        low, high = self.limits
        for ax in (time, angle):
            for k, bound in enumerate((low, high)):
                ax.axhline(bound, color=LIMIT, linestyle="--", linewidth=1.0, label="torque limits" if k else None)
            ax.set_ylim(low - 0.12 * (high - low), high + 0.12 * (high - low))
            ax.set_ylabel("torque (N m)")
        for name, colour, (t, q, _, tau) in motions:
            time.plot(t, tau, color=colour, label=name)
            angle.plot(q, tau, color=colour)
        ends = sorted((self.theta0, self.thetaf))
        x = np.linspace(ends[0], ends[1], 400)
        angle.plot(x, self.gravity_moment * np.sin(x), color="0.6", linewidth=1.0, linestyle=":", label=r"gravity $G\,\sin\theta$")
        time.set_xlabel("time (s)")
        time.set_title("Torque against time")
        angle.set_xlabel(r"angle $\theta$ (rad)")
        angle.set_title("Torque against angle")

    def _rates(self, speed: Axes, acceleration: Axes, motions: list[Any]) -> None:
        for _, colour, (t, q, v, tau) in motions:
            speed.plot(t, v, color=colour)
            acceleration.plot(t, (tau - self.gravity_moment * np.sin(q)) / self.inertia, color=colour)
        for ax, symbol, unit in ((speed, r"speed $\dot\theta$", "rad/s"), (acceleration, r"acceleration $\ddot\theta$", "rad/s²")):
            ax.set_xlabel("time (s)")
            ax.set_ylabel(f"{symbol} ({unit})")
        speed.set_title("Speed against time")
        acceleration.set_title("Acceleration against time")

    def _phase_plane(self, ax: Axes, motions: list[Any]) -> None:
        low, high = self.limits
        for name, colour, (_, q, v, _) in motions:
            if name.startswith("monotone"):
                ax.fill_between(q, 0.0, v, color=colour, alpha=0.10, linewidth=0.0, label="monotone motions")
            ax.plot(q, v, color=colour)
        shown = np.concatenate([q for _, _, (_, q, _, _) in motions]) if motions else np.array([self.theta0, self.thetaf])
        speeds = np.concatenate([v for _, _, (_, _, v, _) in motions]) if motions else np.array([-1.0, 1.0])
        margin = 0.25 * float(np.ptp(shown))
        x = np.linspace(shown.min() - margin, shown.max() + margin, 2001)
        right, left = x[x <= self.thetaf][::-1], x[x >= self.thetaf]
        curves = ((right, -low * (self.thetaf - right), 1.0), (left, high * (left - self.thetaf), -1.0))
        for k, (theta, work, side) in enumerate(curves):
            energy = work + self.gravity_moment * (np.cos(theta) - np.cos(self.thetaf))
            # The curve ends at the angle at which the kinetic energy is zero. A motion from further away stops before the goal.
            stalled = np.flatnonzero(energy[1:] <= 0.0)
            stop = int(stalled[0]) + 1 if stalled.size else theta.size
            v = side * np.sqrt(2.0 * np.maximum(energy[:stop], 0.0) / self.inertia)
            ax.plot(theta[:stop], v, color="black", linestyle=(0, (4, 2)), linewidth=1.0, label="switching curve" if k == 0 else None)
        height = float(np.ptp(np.append(speeds, 0.0)))
        ax.set_ylim(min(speeds.min(), 0.0) - 0.25 * height, max(speeds.max(), 0.0) + 0.25 * height)
        ax.plot([self.theta0], [0.0], "o", color="black", markersize=4, clip_on=False)
        ax.plot([self.thetaf], [0.0], "s", color="black", markersize=4, clip_on=False)
        ax.axhline(0.0, color="0.5", linewidth=0.6)
        ax.set_xlabel(r"angle $\theta$ (rad)")
        ax.set_ylabel(r"speed $\dot\theta$ (rad/s)")
        ax.set_title("Phase plane: start (dot), goal (square)")
        ax.legend(loc="best", handlelength=1.8)

    def _durations(self, ax: Axes, here: list[float]) -> None:
        """Draw the durations of the motion for gravity moments from zero to three times the larger torque limit."""
        limit = max(map(abs, self.limits))
        ratio = np.linspace(0.0, 3.0, 601)
        given = (self.theta0, self.thetaf, self.inertia)
        r = bang_bang_time(*given, ratio * limit, self.tau_max, tau_min=self.tau_min)
        optima = [torque_optimal_time(*given, g, self.tau_max, tau_min=self.tau_min) for g in ratio[::6] * limit]
        best = np.array([o.best.t for o in optima])
        shown = np.concatenate([r.t_min[r.feasible], best[np.isfinite(best)], [0.0]])
        # Near infeasible gravity moments the durations go to infinity. The axis shows typical durations, and the durations of this link.
        top = max(1.6 * min(shown.max(), 3.0 * np.median(shown)), *(1.2 * t for t in here), 1e-9)
        area = ax.fill_between(ratio, r.t_min, np.minimum(r.t_max, 10 * top), where=r.feasible, color=PROFILE, alpha=0.12, linewidth=0.0)
        area.set_label("profile feasible")
        ax.plot(ratio, r.t_min, color=PROFILE)
        ax.plot(ratio[::6], [o.t for o in optima], color=OPTIMUM)
        swing = np.array([o.best.kind in ("back-swing", "overshoot") for o in optima])
        if swing.any():
            ax.plot(ratio[::6], np.where(swing, best, np.nan), color=SWING)
        if 0.0 <= self.gravity_moment / limit <= 3.0:
            ax.axvline(self.gravity_moment / limit, color="0.5", linestyle=":", linewidth=1.0, label="this link")
        ax.set_ylim(0.0, top)
        ax.set_xlim(0.0, 3.0)
        ax.set_xlabel(r"gravity over torque limit, $G/\tau_{\max}$ (1)")
        ax.set_ylabel("duration (s)")
        ax.set_title("Duration against gravity")
        ax.legend(loc="upper right", handlelength=1.8)


def _times(duration: float, switches: tuple[float, ...]) -> Array:
    """Times at which a motion is drawn. They include the time of each switch and a time just before it."""
    sides = [t for s in switches for t in (np.nextafter(s, 0.0), s)]
    return np.sort(np.concatenate([np.linspace(0.0, np.nextafter(duration, 0.0), 601), sides]))
