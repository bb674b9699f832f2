"""Events in a run of an adaptive method, and their crossings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..arguments import choice, count, instance, number, shown, text
from ..border import bordered
from ..errors import InputError
from ..pickling import sealed

__all__ = ["Event", "Events", "JointStops", "State"]

Array: TypeAlias = NDArray[np.float64]
# The most events of a run.
MOST_EVENTS = 4096


@bordered
@sealed
@dataclass(frozen=True)
class JointStops:
    """Joint stops of a plant: a spring and a damper beyond each limit, `tau = max(0, k d + c d_dot)` away from it.

    `d` is the depth beyond the limit. A stop only pushes. It never pulls a joint back.

    Args:
        stiffness: `k` > 0, N m/rad or N/m, scalar or (n,).
        damping: `c` >= 0, N m s/rad or N s/m, scalar or (n,).
        lower, upper: the limits, scalar or (n,), rad or m, infinite for none; None: those of the arm.

    Raises:
        InputError: raised by the plant: a number has the wrong sign, lower is not below upper, or there is no limit at all.

    Source: docs/plants_and_laws.md.

    >>> import armlet as al
    >>> plant = al.RigidArm(al.planar_arm([0.5, 0.4]), stops=al.JointStops(1e4, 20.0, lower=-2.0, upper=2.0))
    """

    stiffness: float | Sequence[float]
    damping: float | Sequence[float] = 0.0
    lower: float | Sequence[float] | None = None
    upper: float | Sequence[float] | None = None

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping", "lower", "upper"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _plain("JointStops", name, value))


def _plain(function: str, name: str, value: ArrayLike) -> Any:
    """Numbers and tuples of numbers, which can be compared, printed and pickled."""
    values = _core.numbers(function, name, value, (), ("n",)).tolist()
    return tuple(values) if isinstance(values, list) else values


def _argument(i: int, value: Any) -> Any:
    """An argument of an event in a form that can be compared, printed and pickled: a name, a number, numbers or a function."""
    if isinstance(value, str) or callable(value):
        return value
    plain = _plain("Event", f"arguments[{i}]", value)
    # Joints are counted: 1.0 is none.
    return value if isinstance(value, int | np.integer) else plain


@bordered
@sealed
@dataclass(frozen=True)
class Event:
    """A zero crossing that a run locates: `simulate(..., events=[al.Event.joint(0, 0.5, stop=True)])`.

    Named kinds are evaluated natively. `function` is Python inside the loop, and slow. The event function is evaluated at
    four points of every step. So two crossings within a quarter of a step are missed.

    Args:
        kind, arguments: the monitored quantity; the methods below make them.
        direction: > 0: rising crossings only; < 0: falling ones only; 0: both.
        stop: end the run at this many crossings (True is 1); 0 only records them.
        name: name in `Run.events`.

    Raises:
        InputError: the kind is unknown, or a number is not valid; raised by `simulate`.

    Source: docs/plants_and_laws.md; the root search is that of [Chandrupatla1997].

    >>> import armlet as al
    >>> al.Event.plane("link2", [0.6, 0.0, 0.0], [1.0, 0.0, 0.0], direction=1).name
    'plane(link2)'
    """

    kind: str
    arguments: tuple[Any, ...]
    direction: float = 0.0
    stop: int = 0
    name: str = ""

    def __post_init__(self) -> None:
        text("Event", "kind", self.kind), text("Event", "name", self.name)
        instance("Event", "arguments", self.arguments, tuple, "a tuple")
        object.__setattr__(self, "arguments", tuple(_argument(i, each) for i, each in enumerate(self.arguments)))
        if not self.name:
            first = ", ".join(a if isinstance(a, str) else shown(a) for a in self.arguments[:1])
            object.__setattr__(self, "name", f"{self.kind}({first})")
        if not np.isfinite(number("Event", "direction", self.direction)):
            raise InputError(f"Event: direction is not finite: expected a number, got {shown(self.direction)}")
        object.__setattr__(self, "stop", count("Event", "stop", self.stop))

    @classmethod
    def joint(cls, joint: int | str, value: float, **keywords: Any) -> Event:
        """The event that a joint crosses a position: `q_i - value`.

        Args:
            joint: index or name of the joint.
            value: the position, rad or m.
            **keywords: `direction`, `stop` and `name` of the event.

        Returns:
            The event.
        """
        return cls("joint", (joint, value), **keywords)

    @classmethod
    def speed(cls, joint: int | str, value: float = 0.0, **keywords: Any) -> Event:
        """The event that the speed of a joint crosses a value: `v_i - value`. At zero the joint reverses.

        Args:
            joint: index or name of the joint.
            value: the speed, rad/s or m/s.
            **keywords: `direction`, `stop` and `name` of the event.

        Returns:
            The event.
        """
        return cls("speed", (joint, value), **keywords)

    @classmethod
    def plane(cls, frame: str, point: ArrayLike, normal: ArrayLike, **keywords: Any) -> Event:
        """The event that the origin of a frame crosses a plane: `normal . (p - point)`, rising along the normal.

        Args:
            frame: name of the frame.
            point: a point of the plane, (3,), world axes, m.
            normal: normal of the plane, (3,), world axes.
            **keywords: `direction`, `stop` and `name` of the event.

        Returns:
            The event.
        """
        return cls("plane", (frame, _plain("Event.plane", "point", point), _plain("Event.plane", "normal", normal)), **keywords)

    @classmethod
    def contact(cls, **keywords: Any) -> Event:
        """The event of a frame that touches the plant's wall (rising) or leaves it (falling), by its depth in the wall, m.

        Args:
            **keywords: `direction`, `stop` and `name` of the event.

        Returns:
            The event.
        """
        return cls("contact", (), **keywords)

    @classmethod
    def joint_stop(cls, joint: int | str, side: Literal["lower", "upper"], **keywords: Any) -> Event:
        """The event of a joint that touches the plant's stop (rising) or leaves it (falling), by its depth beyond the limit, rad or m.

        Args:
            joint: index or name of the joint.
            side: "lower" or "upper".
            **keywords: `direction`, `stop` and `name` of the event.

        Returns:
            The event.

        Raises:
            InputError: `side` has another value.
        """
        return cls("joint_stop", (joint, choice("Event.joint_stop", "side", side, ("lower", "upper"))), **keywords)

    @classmethod
    def function(cls, g: Callable[..., float], **keywords: Any) -> Event:
        """The event that a Python function changes its sign.

        Args:
            g: the function, called like a law in Python: `g(t, q, v)`, `g(t, q)` for a VelocityArm. For an ElasticArm `theta, theta_dot`
                follow.
            **keywords: `direction`, `stop` and `name` of the event; the default name is that of the function.

        Returns:
            The event.

        Raises:
            InputError: `g` is not callable.
        """
        if not callable(g):
            raise InputError(f"Event.function: g is not callable: expected a function, got {type(g).__name__}")
        keywords.setdefault("name", getattr(g, "__name__", "function"))
        return cls("function", (g,), **keywords)


def watched(events: Event | Callable[..., float] | Sequence[Event | Callable[..., float]] | None) -> list[Event]:
    """The events as `Event`s; a function may carry `direction` and `terminal`, as scipy's events do."""
    if events is None:
        return []
    if isinstance(events, Sequence) and len(events) > MOST_EVENTS:
        raise InputError(f"simulate: events is too long: expected at most {MOST_EVENTS}, got {len(events)}")
    given = list(events) if isinstance(events, Sequence) else [events]
    for i, event in enumerate(given):
        if isinstance(event, Event):
            continue
        if not callable(event):
            got = f"got {type(event).__name__} (first bad index {i})"
            raise InputError(f"simulate: events is of the wrong type: expected Events or functions g(t, q, v), {got}")
        given[i] = Event.function(event, direction=getattr(event, "direction", 0.0), stop=getattr(event, "terminal", 0))
    return given  # type: ignore[return-value]  # each is an Event by now


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class Events:
    """The crossings found in a run, in order of time.

    Attributes:
        t: when, (m,), s.
        which: index of the event, (m,), in the argument `events`.
        names: of the events.
        q, v, theta, theta_dot: the state there, (m, n) each; None if the plant does not have them.
    """

    t: Array
    which: NDArray[np.int64]
    names: tuple[str, ...]
    q: Array
    v: Array | None = None
    theta: Array | None = None
    theta_dot: Array | None = None

    def __len__(self) -> int:
        return len(self.t)

    def of(self, event: int | str) -> Events:
        """Select the crossings of one event.

        Args:
            event: index or name of the event.

        Returns:
            Its crossings.

        Raises:
            InputError: there is no such event.
        """
        if isinstance(event, str) and event in self.names:
            event = self.names.index(event)
        if not isinstance(event, int) or not 0 <= event < len(self.names):
            raise InputError(f"Events.of: event is unknown: expected an index or one of {', '.join(self.names)}, got {shown(event)}")
        rows = self.which == event
        parts = (None if part is None else part[rows] for part in (self.q, self.v, self.theta, self.theta_dot))
        return Events(self.t[rows], self.which[rows], self.names, *parts)  # type: ignore[arg-type]  # the first is an array


@bordered
@sealed
class State(NamedTuple):
    """The state of a run, (n,) each at one time, (K, n) at K times. A part that the plant does not have is None."""

    q: Array
    v: Array | None
    theta: Array | None
    theta_dot: Array | None
    estimate: Array | None
