"""The laboratory without a page: it converts values of sliders to poses and curves, by a compiled loop at 1 kHz.

    x(t + 1 ms) = RK4(f(x; gains, targets, force)),   for LuGre friction the Rosenbrock method ROS2 instead of RK4

Any thread may set a slider; one thread calls `advance`. A loop that diverges is not an error. The laboratory then keeps the last finite
state, shows a message, and waits for a reset.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

import armlet as al

from .shapes import Array
from .systems import Force, State, System
from .systems.system import DT

__all__ = ["Lab"]

WINDOW = 8.0  # length of the curves, s
FRAME = 0.016  # time between two frames, and between two points of a curve, s
# Largest number of steps per frame. If the time between two frames is longer, simulated time is slower than the clock.
MOST_STEPS = 200


def _point(given: ArrayLike) -> Array:
    """Check a point of the page, (3,), m."""
    return al._core.numbers("lab", "point", given, (3,))


class Lab:
    """A list of systems, of which one runs.

    Attributes:
        systems: all systems, by title.
        system: the chosen system.
        values: the values of its controls, by name.
        targets: the positions of its targets, by name, (3,), m, in the axes of the arm's base.
        status: the status of the loop, `SUCCESS` while it runs.
        message: the explanation of the status, in one line.
        paused: whether the simulated time is paused.
        speed: desired simulated seconds per second of the clock.
        resets: the number of resets. When it changes, a page moves the handles of the targets back.
    """

    def __init__(self, systems: Sequence[System], *, clock: Callable[[], float] = time.perf_counter) -> None:
        self.systems = {system.title: system for system in systems}
        self.paused, self.speed, self.resets = False, 1.0, 0
        self._clock = clock
        self._lock = threading.RLock()
        self.choose(next(iter(self.systems)))

    def choose(self, title: str) -> None:
        """Change to another system. Its controls have their initial values."""
        with self._lock:
            if title not in self.systems:
                raise al.InputError(f"lab: system is unknown: expected one of {', '.join(self.systems)}, got {title}")
            self.system = self.systems[title]
            self.values = self.system.defaults()
            self.reset()

    def reset(self) -> None:
        """Reset the time, the state and the targets, but not the controls."""
        with self._lock:
            self.resets += 1
            self.targets = {name: point.copy() for name, point in self.system.targets.items()}
            self._state = self.system.start()
            self._sim: al.Simulator | None = None
            self._since = 0.0  # time at which the present loop started, s
            self._grip: tuple[str, Array, Array, float] | None = None
            self.status, self.message = al.Status.SUCCESS, ""
            self.curves: deque[list[float]] = deque(maxlen=int(WINDOW / FRAME))
            self._paces: deque[tuple[float, float]] = deque(maxlen=64)
            self._owed = 0.0
            self._changed = True

    def set(self, name: str, value: float | str) -> None:
        """Set a control. The loop continues from its present state."""
        with self._lock:
            controls = {control.name: control for control in self.system.controls}
            if name not in controls:
                raise al.InputError(f"lab: control is unknown: expected one of {', '.join(controls)}, got {name}")
            self.values[name] = controls[name].read(value)
            self._changed = True

    def drag(self, name: str, point: ArrayLike) -> None:
        """Move a target to `point`, (3,), m, in the axes of the arm's base.

        A point that is not finite is ignored, because a handle seen from its edge may return such a point.
        """
        with self._lock:
            moved = _point(point).copy()
            if name in self.targets and np.all(np.isfinite(moved)):
                if self.system.planar:
                    moved[2] = 0.0
                self.targets[name] = moved
                self._changed = True

    def grip(self, frame: str, point: ArrayLike) -> None:
        """Grip the body of `frame` at `point`, (3,), m, in the axes of the arm's base."""
        with self._lock:
            # The mouse may still grip a body that was removed from the page.
            if frame not in self.system.arm.frame_names:
                return
            pose, at = self.system.arm.pose(self._state.q, frame), _point(point)
            held = pose[:3, :3].T @ (at - pose[:3, 3])
            if self.system.takes_force and np.all(np.isfinite(held)):
                self._grip = frame, held, at, 0.0

    def pull(self, point: ArrayLike, stiffness: float) -> None:
        """Pull the gripped body towards `point`, (3,), m, by a spring of `stiffness` N/m."""
        with self._lock:
            to = _point(point)
            if self._grip is not None and np.all(np.isfinite(to)):
                self._grip = (*self._grip[:2], to, float(stiffness))
                self._changed = True

    def release(self) -> None:
        """Release the gripped body."""
        with self._lock:
            self._grip = None
            self._changed = True

    @property
    def t(self) -> float:
        """Simulated time, s."""
        return self._state.t

    @property
    def q(self) -> Array:
        """Joint positions of the last finite state, (n,), rad or m."""
        return self._state.q

    def spring(self) -> tuple[Array, Array] | None:
        """The ends of the mouse's spring: at the body and at the mouse, (3,), m, in the axes of the arm's base.

        None if no body is gripped.
        """
        with self._lock:
            if self._grip is None:
                return None
            frame, held, to, _ = self._grip
            pose = np.asarray(self.system.arm.pose(self._state.q, frame))
            return pose[:3, :3] @ held + pose[:3, 3], to

    @property
    def force(self) -> Array:
        """The force of the mouse, (3,), N: a spring of stiffness k and a damper.

        The force is constant during a frame of T s. This delay acts like a negative damping, so the damper has the coefficient k T.
        """
        with self._lock:
            ends = self.spring()
            if ends is None or self._grip is None:
                return np.zeros(3)
            frame, _, _, stiffness = self._grip
            arm, q = self.system.arm, self._state.q
            v, w = np.split(np.asarray(arm.jacobian(q, frame)) @ self._state.v, 2)
            slip = v + np.cross(w, ends[0] - np.asarray(arm.position(q, frame)))
            return stiffness * (ends[1] - ends[0] - FRAME * slip)

    def _wrench(self) -> Force | None:
        ends = self.spring()
        if ends is None or self._grip is None or self._grip[3] == 0.0:
            return None
        f = self.force
        lever = ends[0] - np.asarray(self.system.arm.position(self._state.q, self._grip[0]))
        return Force(self._grip[0], np.concatenate([f, np.cross(lever, f)]))

    def advance(self, seconds: float = FRAME) -> int:
        """Simulate `speed` times `seconds`, but at most MOST_STEPS steps. Return the number of steps.

        A fraction of a step is kept for the next call. If the loop diverges in this call, the number includes steps that were not done.
        The number is zero while the laboratory is paused, and after the loop has diverged.
        """
        with self._lock:
            self._paces.append((self._clock(), self._state.t))
            if self.paused or self.status is not al.Status.SUCCESS:
                return 0
            self._owed = min(self._owed + self.speed * seconds / DT, float(MOST_STEPS))
            steps = int(self._owed)
            self._owed -= steps
            # The pull depends on the state of the arm, so it is updated in every frame.
            if self._changed or self._grip is not None or self.system.due(self._state, self.values, self.targets):
                self._begin()
            sim = self._sim
            if sim is None:
                return 0
            try:
                for _ in range(steps):
                    self.system.step(sim)
            except al.SolveError as error:
                self.status = error.status or al.Status.DIVERGED
                why = "the loop is unstable, or its gains are too high for a step of 1 ms"
                self.message = f"diverged after t = {self._state.t:.2f} s: {why}; turn them back and reset"
                return steps
            state = self._state = State.of(sim, self._since)
            points = self.system.sample(sim, state, self.values, self.targets)
            self.curves.append([state.t, *(value for panel in points for value in panel)])
            while self.curves[0][0] < state.t - WINDOW:
                self.curves.popleft()
            return steps

    def _begin(self) -> None:
        """Start a new loop from the present state. After an error the previous loop continues, and the message states the reason."""
        try:
            sim = self.system.loop(self.values, self.targets, self._wrench(), self._state)
        except al.ArmletError as error:
            self.message = f"refused: {error}"
        else:
            self._sim, self._since, self.message = sim, self._state.t, self.system.note
        self._changed = False

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per second of the clock, over about the last second."""
        with self._lock:
            if len(self._paces) < 2:
                return 0.0
            (clock0, t0), (clock1, t1) = self._paces[0], self._paces[-1]
            return (t1 - t0) / (clock1 - clock0) if clock1 > clock0 else 0.0

    def panels(self) -> list[tuple[Array, ...]]:
        """For every plot of the system: the times and the curves, (points,) each."""
        with self._lock:
            width = 1 + sum(len(plot.curves) for plot in self.system.plots)
            table = np.array(self.curves, dtype=np.float64).reshape(-1, width).T
            found, column = [], 1
            for plot in self.system.plots:
                found.append((table[0], *table[column : column + len(plot.curves)]))
                column += len(plot.curves)
            return found

    def poses(self) -> dict[str, Array]:
        """The pose of every drawn frame, (4, 4), in the axes of the arm's base."""
        with self._lock:
            q, arm = self._state.q, self.system.arm
            frames = dict.fromkeys([shape.frame for shape in self.system.shapes if shape.frame is not None])
            return {frame: np.asarray(arm.pose(q, frame)) for frame in frames}
