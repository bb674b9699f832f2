"""The interface between the laboratory and a system: its controls, its arm, and a loop that starts from any state.

    constants + state at t  ->  al.Simulator

A loop has constants for gains, targets and forces. When the user changes one of them, a new loop starts from the present state.
`loop` builds it in tens of microseconds, so that a slider or the mouse can start one in every frame.
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

DT = 1e-3  # s, the step of every loop
# From the axes of a planar arm to those of the scene, which has z upwards: y of the arm becomes the vertical.
UPRIGHT: Array = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class Slider:
    """A number between `low` and `high`; `powers` slides over its logarithm of base 10."""

    name: str
    label: str
    low: float
    high: float
    value: float
    powers: bool = False

    def read(self, value: float | str) -> float:
        """`value` as a number inside the range."""
        number = float(value)
        if not np.isfinite(number):
            raise al.InputError(f"lab: {self.name} is not finite: expected a number in [{self.low:g}, {self.high:g}], got {number}")
        return min(max(number, self.low), self.high)


@dataclass(frozen=True)
class Choice:
    """One of several words."""

    name: str
    label: str
    options: tuple[str, ...]
    value: str

    def read(self, value: float | str) -> str:
        """`value`, which must be one of the options."""
        if value not in self.options:
            raise al.InputError(f"lab: {self.name} is unknown: expected one of {', '.join(self.options)}, got {value}")
        return str(value)


Control: TypeAlias = Slider | Choice


@dataclass(frozen=True)
class Plot:
    """Curves over time in one panel; the title ends with their unit. The last `dashed` curves are true or desired values of the first."""

    title: str
    curves: tuple[str, ...]
    dashed: int = 0


@dataclass(frozen=True)
class State:
    """The state of a loop at time `t`, in s. A part is None if a system does not have it, or initialises it."""

    t: float
    q: Array
    v: Array
    theta: Array | None = None
    theta_dot: Array | None = None
    bristles: Array | None = None
    estimate: Array | None = None

    @staticmethod
    def of(sim: al.Simulator, since: float) -> State:
        """The state of a loop that was started at time `since`."""
        parts = sim.state
        return State(since + parts.pop("t"), **{name: value for name, value in parts.items() if name != "tau"})


@dataclass(frozen=True)
class Force:
    """A wrench [f; m] in N and N m at the origin of `frame`, in world axes."""

    frame: str
    wrench: Array


class System(ABC):
    """One system of the laboratory."""

    title: str
    arm: al.Arm  # what is drawn: it has frames
    frame: str  # its tip
    shapes: list[Shape]  # what is drawn at its frames
    q0: Array
    controls: tuple[Control, ...]
    targets: dict[str, Array]  # where the handles of the targets start, m, in the axes of the arm
    plots: tuple[Plot, Plot, Plot]
    rotation: Array = np.eye(3)  # from the axes of the arm to those of the scene
    planar: bool = True  # targets stay in the x-y plane of the arm
    takes_force: bool = True
    missing: tuple[str, ...] = ()  # meshes of the robot's file that are not drawn
    note: str = ""  # what the system has to say about its present plan

    @abstractmethod
    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        """The closed loop with these constants, from `state` on; InputError if they are not valid."""

    @abstractmethod
    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        """The present values of the curves, one list per plot."""

    def step(self, sim: al.Simulator) -> None:
        """One step of the loop."""
        sim.step()

    def due(self, state: State, values: Values, targets: Targets) -> bool:
        """Whether a new loop should start without a change by the user."""
        return False

    def desired(self, t: float, values: Values, targets: Targets) -> Array | None:
        """The desired position of the tip at `t`, m, if it is not one of the targets."""
        return None

    def start(self) -> State:
        """The state at reset; a plan is discarded."""
        return State(0.0, self.q0, np.zeros(self.arm.n))

    def defaults(self) -> dict[str, float | str]:
        """The values of the controls at the start."""
        return {control.name: control.value for control in self.controls}


def number(values: Values, name: str) -> float:
    return float(values[name])


def pushed(force: Force | None) -> dict[str, Any]:
    """The keywords of a loop for this force."""
    return {} if force is None else {"force": force.wrench, "force_frame": force.frame}
