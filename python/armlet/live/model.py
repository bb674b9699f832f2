"""The laboratory without a page: it turns values of sliders into poses and curves, by a native loop at 1 kHz.

    x(t + 1 ms) = RK4(f(x; gains, targets, force))

Any thread may move a slider; one thread calls `advance`. A loop that diverges is a state of the laboratory, not an error. It keeps its last
finite state, shows a message, and waits for a reset.
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

WINDOW = 8.0  # s of the curves
FRAME = 0.016  # s between two frames, and between two points of the curves
# A frame that comes late is made up for to this many steps; a machine that is slower than that falls behind the clock.
MOST_STEPS = 200


def _point(given: ArrayLike) -> Array:
    """A point of the page, (3,), m."""
    return al._core.numbers("lab", "point", given, (3,))


class Lab:
    """A list of systems, of which one runs.

    Attributes:
        systems: all systems, by title.
        system: the chosen system.
        values: the positions of its controls, by name.
        targets: the positions of its targets, by name, m, in the axes of the arm.
        status: the status of the loop: `SUCCESS` as long as it runs.
        message: the explanation of the status, in one line.
        paused: whether time is stopped.
        speed: target for the seconds of the loop per second of the clock.
        resets: number of resets; a page moves the handles of the targets back when it changes.
    """

    def __init__(self, systems: Sequence[System], *, clock: Callable[[], float] = time.perf_counter) -> None:
        self.systems = {system.title: system for system in systems}
        self.paused, self.speed, self.resets = False, 1.0, 0
        self._clock = clock
        self._lock = threading.RLock()
        self.choose(next(iter(self.systems)))

    def choose(self, title: str) -> None:
        """Change to another system, with the initial values of its controls."""
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
            self._since = 0.0  # when the present loop was started
            self._grip: tuple[str, Array, Array, float] | None = None
            self.status, self.message = al.Status.SUCCESS, ""
            self.curves: deque[list[float]] = deque(maxlen=int(WINDOW / FRAME))
            self._paces: deque[tuple[float, float]] = deque(maxlen=64)
            self._owed = 0.0
            self._changed = True

    def set(self, name: str, value: float | str) -> None:
        """Set a control; the loop continues from its present state."""
        with self._lock:
            controls = {control.name: control for control in self.system.controls}
            if name not in controls:
                raise al.InputError(f"lab: control is unknown: expected one of {', '.join(controls)}, got {name}")
            self.values[name] = controls[name].read(value)
            self._changed = True

    def drag(self, name: str, point: ArrayLike) -> None:
        """Move a target, (3,), m, in the axes of the arm. A point that is not finite is ignored: a handle that is seen edge-on may return
        one."""
        with self._lock:
            moved = _point(point).copy()
            if name in self.targets and np.all(np.isfinite(moved)):
                if self.system.planar:
                    moved[2] = 0.0
                self.targets[name] = moved
                self._changed = True

    def grip(self, frame: str, point: ArrayLike) -> None:
        """Take hold of the body at `frame` at `point`, (3,), m, in the axes of the arm's base."""
        with self._lock:
            # A hand may still hold what has just left the page.
            if frame not in self.system.arm.frame_names:
                return
            pose, at = self.system.arm.pose(self._state.q, frame), _point(point)
            held = pose[:3, :3].T @ (at - pose[:3, 3])
            if self.system.takes_force and np.all(np.isfinite(held)):
                self._grip = frame, held, at, 0.0

    def pull(self, point: ArrayLike, stiffness: float) -> None:
        """Pull the held body towards `point`, (3,), m, by a spring of `stiffness` N/m."""
        with self._lock:
            to = _point(point)
            if self._grip is not None and np.all(np.isfinite(to)):
                self._grip = (*self._grip[:2], to, float(stiffness))
                self._changed = True

    def release(self) -> None:
        """Release the held body."""
        with self._lock:
            self._grip = None
            self._changed = True

    @property
    def t(self) -> float:
        """Time of the loop, s."""
        return self._state.t

    @property
    def q(self) -> Array:
        """Joint positions, (n,), the last ones that were finite."""
        return self._state.q

    def spring(self) -> tuple[Array, Array] | None:
        """The ends of the mouse's spring, at the body and at the mouse: m, in the axes of the arm's base. None if no body is held."""
        with self._lock:
            if self._grip is None:
                return None
            frame, held, to, _ = self._grip
            pose = np.asarray(self.system.arm.pose(self._state.q, frame))
            return pose[:3, :3] @ held + pose[:3, 3], to

    @property
    def force(self) -> Array:
        """The force of the mouse, (3,), N: a spring and a damper. The force is constant for one frame of T s, which acts like a damping of
        -k T; the damper cancels it."""
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
        """Run the loop for `seconds` of the clock, at `speed`; returns the number of steps taken."""
        with self._lock:
            self._paces.append((self._clock(), self._state.t))
            if self.paused or self.status is not al.Status.SUCCESS:
                return 0
            self._owed = min(self._owed + self.speed * seconds / DT, float(MOST_STEPS))
            steps = int(self._owed)
            self._owed -= steps
            # The pull depends on where the arm is: it is constant for a frame at most.
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
                why = "the loop is unstable, or these constants are too fast for a step of 1 ms"
                self.message = f"diverged after t = {self._state.t:.2f} s: {why}; turn them back and reset"
                return steps
            state = self._state = State.of(sim, self._since)
            points = self.system.sample(sim, state, self.values, self.targets)
            self.curves.append([state.t, *(value for panel in points for value in panel)])
            while self.curves[0][0] < state.t - WINDOW:
                self.curves.popleft()
            return steps

    def _begin(self) -> None:
        """Start a loop from the state of the last one. After an error the last one continues, and the message has the reason."""
        try:
            sim = self.system.loop(self.values, self.targets, self._wrench(), self._state)
        except al.ArmletError as error:
            self.message = f"refused: {error}"
        else:
            self._sim, self._since, self.message = sim, self._state.t, self.system.note
        self._changed = False

    @property
    def real_time_factor(self) -> float:
        """The real-time factor: seconds of the loop per second of the clock, over about the last second."""
        with self._lock:
            if len(self._paces) < 2:
                return 0.0
            (clock0, t0), (clock1, t1) = self._paces[0], self._paces[-1]
            return (t1 - t0) / (clock1 - clock0) if clock1 > clock0 else 0.0

    def panels(self) -> list[tuple[Array, ...]]:
        """For every plot of the system the times and the curves, each (points,)."""
        with self._lock:
            width = 1 + sum(len(plot.curves) for plot in self.system.plots)
            table = np.array(self.curves, dtype=np.float64).reshape(-1, width).T
            found, column = [], 1
            for plot in self.system.plots:
                found.append((table[0], *table[column : column + len(plot.curves)]))
                column += len(plot.curves)
            return found

    def poses(self) -> dict[str, Array]:
        """The pose of every frame that is drawn, (4, 4), in the axes of the arm's base."""
        with self._lock:
            q, arm = self._state.q, self.system.arm
            frames = dict.fromkeys([shape.frame for shape in self.system.shapes if shape.frame is not None])
            return {frame: np.asarray(arm.pose(q, frame)) for frame in frames}
