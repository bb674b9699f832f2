"""The interface between the laboratory and a system: its controls, its arm, and a loop that starts from any state.

    constants + state at t  ->  al.Simulator

Gains, targets and forces are constants of a loop. When the user changes one of them, `System.loop` builds a new loop, which starts from the
present state. A slider or the mouse can start a loop in every frame.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import armlet as al

from ..shapes import Shape

__all__ = ["DT", "UPRIGHT", "Choice", "Control", "Force", "Plot", "Slider", "State", "System", "Targets", "Values"]

Array: TypeAlias = NDArray[np.float64]
Values: TypeAlias = Mapping[str, float | str]
Targets: TypeAlias = Mapping[str, Array]

DT = 1e-3  # step of every loop, s
# Rotation from the axes of a planar arm to the axes of the scene. The scene's z axis, and so the arm's y axis, points up.
UPRIGHT: Array = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class Slider:
    """A control for a number between `low` and `high`. With `powers` the slider shows the logarithm of the number to base 10."""

    name: str
    label: str
    low: float
    high: float
    value: float
    powers: bool = False

    def read(self, value: float | str) -> float:
        """Return `value` as a number, clipped to the range."""
        number = float(value)
        if not np.isfinite(number):
            raise al.InputError(f"lab: {self.name} is not finite: expected a number in [{self.low:g}, {self.high:g}], got {number}")
        return min(max(number, self.low), self.high)


@dataclass(frozen=True)
class Choice:
    """A control for one of several words."""

    name: str
    label: str
    options: tuple[str, ...]
    value: str

    def read(self, value: float | str) -> str:
        """Return `value`, which must be one of the options."""
        if value not in self.options:
            raise al.InputError(f"lab: {self.name} is unknown: expected one of {', '.join(self.options)}, got {value}")
        return str(value)


Control: TypeAlias = Slider | Choice


@dataclass(frozen=True)
class Plot:
    """Curves over time in one panel.

    The title ends with the unit of the curves. The last `dashed` curves are true or desired values, or limits. With `bands`, the space
    between the numbers 1, 2, .. and the curves is filled.
    """

    title: str
    curves: tuple[str, ...]
    dashed: int = 0
    bands: bool = False


@dataclass(frozen=True)
class State:
    """The state of a loop at time `t`, s. A part is None if the system does not have it, or if the loop initialises it."""

    t: float
    q: Array
    v: Array
    theta: Array | None = None
    theta_dot: Array | None = None
    bristles: Array | None = None
    estimate: Array | None = None

    @staticmethod
    def of(sim: al.Simulator, since: float) -> State:
        """The state of the loop `sim`, which started at time `since`, s."""
        parts = sim.state
        return State(since + parts.pop("t"), **{name: value for name, value in parts.items() if name != "tau"})


@dataclass(frozen=True)
class Force:
    """A wrench [f; m] in N and N m at the origin of `frame`, in world axes."""

    frame: str
    wrench: Array


class System(ABC):
    """Base class of the laboratory's systems."""

    title: str
    arm: al.Arm  # the drawn arm, which has frames
    frame: str  # name of the tip's frame
    shapes: list[Shape]  # shapes that are drawn at the frames
    q0: Array
    controls: tuple[Control, ...]
    targets: dict[str, Array]  # initial positions of the target handles, (3,), m, in the axes of the arm's base
    plots: tuple[Plot, Plot, Plot]
    rotation: Array = np.eye(3)  # rotation from the axes of the arm's base to the axes of the scene
    planar: bool = True  # whether targets stay in the x-y plane of the arm's base
    takes_force: bool = True
    missing: tuple[str, ...] = ()  # meshes of the robot file that are not drawn
    note: str = ""  # message about the present plan

    @abstractmethod
    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        """Return the closed loop with these constants, which starts at `state`. Raise InputError if the constants are not valid."""

    @abstractmethod
    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        """The present values of the curves: one list per plot."""

    def step(self, sim: al.Simulator) -> None:
        """Advance the loop by one step."""
        sim.step()

    def due(self, state: State, values: Values, targets: Targets) -> bool:
        """Whether a new loop must start although the user changed nothing."""
        return False

    def desired(self, t: float, values: Values, targets: Targets) -> Array | None:
        """The desired position of the tip at time `t`, (3,), m; None if a target already shows it."""
        return None

    def start(self) -> State:
        """The state after a reset. A system that plans motions discards its plan here."""
        return State(0.0, self.q0, np.zeros(self.arm.n))

    def defaults(self) -> dict[str, float | str]:
        """The initial values of the controls."""
        return {control.name: control.value for control in self.controls}


def number(values: Values, name: str) -> float:
    return float(values[name])


def pushed(force: Force | None) -> dict[str, Any]:
    """The keyword arguments of `al.Simulator` for this force."""
    return {} if force is None else {"force": force.wrench, "force_frame": force.frame}
