"""Zero crossings of event functions in a run. The state at each trial time comes from an integration, not from interpolation.

    g(t, x) changes its sign in (t_a, t_b):   integrate from the last checked time to the zero of the secant,
        keep the interval with the change, and halve the value of g at an end that is kept twice (Dowell and Jarratt 1971)

joint: q_i - value;  speed: v_i - value;  plane: n . (p - p_0), p a frame's origin;  contact: depth in the wall;
joint_stop: depth beyond a limit;  function: any g(t, q, v), g(t, q) or g(t, q, v, theta, theta_dot)

n is the normal of the plane, and p_0 a point in it.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array
from .plant import Plant


class Event(NamedTuple):
    """An event. With direction > 0 only rising crossings count, with < 0 falling ones. The run ends after `stop` crossings (0: never)."""

    kind: str
    arguments: tuple[Any, ...]
    direction: float = 0.0
    stop: int = 0

    @classmethod
    def joint(cls, joint: int, value: float, **options: Any) -> "Event":
        return cls("joint", (joint, value), **options)

    @classmethod
    def speed(cls, joint: int, value: float = 0.0, **options: Any) -> "Event":
        return cls("speed", (joint, value), **options)

    @classmethod
    def plane(cls, frame: str, point: ArrayLike, normal: ArrayLike, **options: Any) -> "Event":
        return cls("plane", (frame, point, normal), **options)

    @classmethod
    def contact(cls, **options: Any) -> "Event":
        return cls("contact", (), **options)

    @classmethod
    def joint_stop(cls, joint: int, side: str, **options: Any) -> "Event":
        return cls("joint_stop", (joint, side), **options)

    @classmethod
    def function(cls, g: Callable[..., float], **options: Any) -> "Event":
        return cls("function", (g,), **options)


def value(event: Event, plant: Plant, t: float, x: Array) -> float:
    """The value of the event function g at the time t and the plant state x."""
    q, v, theta, theta_dot = plant.split(x)
    match event.kind, event.arguments:
        case "joint", (joint, at):
            return float(q[joint] - at)
        case "speed", (joint, at):
            return float(v[joint] - at)
        case "plane", (frame, point, normal):
            return float(np.asarray(normal) @ (plant.arm.position(q, frame) - np.asarray(point)))
        case "function", (g,):
            return float(g(t, q, v, theta, theta_dot) if plant.elastic else g(t, q, v) if plant.size > q.size else g(t, q))
    name = ("wall",) if event.kind == "contact" else event.arguments[::-1]
    (depth,) = (contact.depth for contact in getattr(plant, "contacts", []) if contact.name == name)
    return float(depth(q))


class Search:
    """The crossings of a run, in order of time: (t, index of the event, plant state)."""

    def __init__(self, events: Sequence[Event], plant: Plant, loop: Any) -> None:
        self.events, self.plant, self.loop = list(events), plant, loop
        self.found: list[tuple[float, int, Array]] = []

    def between(self, t: float, y: Array, end: float, ahead: Array, onward: Callable[[list[float]], Array]) -> tuple[float, Array] | None:
        """Record the crossings from (t, y) to (end, ahead). The result is the point at which an event stops the run, or None."""
        here = []
        for index, event in enumerate(self.events):

            def g(at: float, state: Array, event: Event = event) -> float:
                return value(event, self.plant, at, state[: self.plant.size])

            before, after = g(t, y), g(end, ahead)
            if before * after < 0.0 and before * event.direction <= 0.0:
                here.append((*crossing(g, t, end, before, after, onward), index))
        for at, state, index in sorted(here, key=lambda found: found[0]):
            self.found.append((at, index, state[: self.plant.size].copy()))
            stop = self.events[index].stop
            if stop and sum(which == index for _, which, _ in self.found) >= stop:
                return at, state
        return None


def crossing(
    g: Callable[[float, Array], float], low: float, high: float, below: float, above: float, onward: Callable[[list[float]], Array]
) -> tuple[float, Array]:
    """The time and the state at which g changes its sign between `low` and `high`, where its values are `below` and `above`.

    `onward([t])[0]` is the state at the time t.
    """
    side = 0
    for _ in range(60):
        t = (low * above - high * below) / (above - below)
        state: Array = onward([t])[0]
        here = g(t, state)
        if abs(here) < 1e-11 or not low < t < high:
            break
        if here * below > 0.0:
            low, below, above = t, here, above / 2 if side == 1 else above
            side = 1
        else:
            high, above, below = t, here, below / 2 if side == -1 else below
            side = -1
    return t, state
