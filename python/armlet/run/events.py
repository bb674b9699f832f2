"""Events that a run of an adaptive method locates, and the crossings that it found.

An *event* is a function of time and state. A *crossing* is a time at which the function changes its sign.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..arguments import brief, choice, count, instance, number, shown, text
from ..border import bordered
from ..errors import InputError
from ..pickling import sealed

__all__ = ["Event", "Events", "JointStops", "State"]

Array: TypeAlias = NDArray[np.float64]
# The largest number of entries of the argument `events`.
MOST_EVENTS = 4096


@bordered
@sealed
@dataclass(frozen=True)
class JointStops:
    """Joint stops of a plant: a spring and a damper beyond each limit, `tau = max(0, k d + c d_dot)`, towards the allowed range.

    `d` is the distance of the joint beyond the limit, rad or m. A stop only pushes. It never pulls a joint towards the limit.

    Args:
        stiffness: `k` > 0, N m/rad or N/m, scalar or (n,).
        damping: `c` >= 0, N m s/rad or N s/m, scalar or (n,).
        lower, upper: the limits, scalar or (n,), rad or m. An infinite value means that the joint has no stop there. None means the
            limits of the arm.

    Raises:
        InputError: an argument is not numeric. The plant also raises it for a wrong sign, a lower limit that is not below the upper one, or
            no finite limit.

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
    """Return `value` as a number or as tuples of numbers, which can be compared, printed and pickled."""
    values = _core.numbers(function, name, value, (), ("n",)).tolist()
    return tuple(values) if isinstance(values, list) else values


def _argument(i: int, value: Any) -> Any:
    """Return argument `i` of an event in a form that can be compared, printed and pickled: a name, a number, numbers or a function."""
    if isinstance(value, str) or callable(value):
        return value
    plain = _plain("Event", f"arguments[{i}]", value)
    # An integer stays an integer, because it can be the index of a joint. The float 1.0 is not an index.
    return value if isinstance(value, int | np.integer) else plain


@bordered
@sealed
@dataclass(frozen=True)
class Event:
    """A zero crossing that a run locates: `simulate(..., events=[al.Event.joint(0, 0.5, stop=True)])`.

    Compiled code evaluates all kinds except `function`, which calls Python inside the loop and is slow. The event function is evaluated at
    four points of every step. So the run can miss two crossings within a quarter of a step.

    Args:
        kind, arguments: the kind of the event function, such as "joint", and its arguments. Use the class methods below, which set both.
        direction: > 0 locates rising crossings only, < 0 falling crossings only, and 0 both.
        stop: number of crossings after which the run ends (True is 1). 0 records the crossings, and the run continues.
        name: name of the event in `Run.events`.

    Raises:
        InputError: an argument has a wrong type or value. `simulate` also raises it for an unknown kind, or arguments that do not fit it.

    Source: docs/plants_and_laws.md; [Chandrupatla1997] for the root search.

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
        """Make the event in which a joint crosses a position. The event function is `q_i - value`.

        Args:
            joint: index or name of the joint.
            value: the position, rad or m.
            **keywords: `direction`, `stop` and `name` of the event.

        Returns:
            The event.

        Raises:
            InputError: `value` is not numeric, or a keyword has an invalid value. `simulate` also raises it for an unknown joint.
        """
        return cls("joint", (joint, value), **keywords)

    @classmethod
    def speed(cls, joint: int | str, value: float = 0.0, **keywords: Any) -> Event:
        """Make the event in which the velocity of a joint crosses a value. The event function is `v_i - value`.

        With the value zero the joint reverses at the crossing.

        Args:
            joint: index or name of the joint.
            value: the velocity, rad/s or m/s.
            **keywords: `direction`, `stop` and `name` of the event.

        Returns:
            The event.

        Raises:
            InputError: `value` is not numeric, or a keyword has an invalid value. `simulate` also raises it for an unknown joint, and for a
                plant whose state has no velocities.
        """
        return cls("speed", (joint, value), **keywords)

    @classmethod
    def plane(cls, frame: str, point: ArrayLike, normal: ArrayLike, **keywords: Any) -> Event:
        """Make the event in which the origin `p` of a frame crosses a plane.

        The event function is `normal . (p - point)`. It rises if the frame moves along the normal.

        Args:
            frame: name of the frame.
            point: a point of the plane, (3,), world axes, m.
            normal: normal vector of the plane, (3,), world axes.
            **keywords: `direction`, `stop` and `name` of the event.

        Returns:
            The event.

        Raises:
            InputError: `point` or `normal` is not numeric, or a keyword has an invalid value. `simulate` also raises it for an unknown
                frame or a wrong shape.
        """
        return cls("plane", (frame, _plain("Event.plane", "point", point), _plain("Event.plane", "normal", normal)), **keywords)

    @classmethod
    def contact(cls, **keywords: Any) -> Event:
        """Make the event in which the frame touches the plant's wall (rising) or leaves it (falling).

        The event function is the depth of the frame in the wall, m.

        Args:
            **keywords: `direction`, `stop` and `name` of the event.

        Returns:
            The event.

        Raises:
            InputError: a keyword has an invalid value. `simulate` also raises it for a plant without a wall.
        """
        return cls("contact", (), **keywords)

    @classmethod
    def joint_stop(cls, joint: int | str, side: Literal["lower", "upper"], **keywords: Any) -> Event:
        """Make the event in which a joint touches the plant's joint stop (rising) or leaves it (falling).

        The event function is the distance of the joint beyond the limit, rad or m.

        Args:
            joint: index or name of the joint.
            side: the stop at the "lower" or at the "upper" limit.
            **keywords: `direction`, `stop` and `name` of the event.

        Returns:
            The event.

        Raises:
            InputError: `side` has another value, or a keyword has an invalid value. `simulate` also raises it for an unknown joint, and for
                a stop that the plant does not have.
        """
        return cls("joint_stop", (joint, choice("Event.joint_stop", "side", side, ("lower", "upper"))), **keywords)

    @classmethod
    def function(cls, g: Callable[..., float], **keywords: Any) -> Event:
        """Make the event in which a Python function changes its sign.

        Args:
            g: the event function `g(t, q, v) -> float`. It is `g(t, q)` for a VelocityArm, and `g(t, q, v, theta, theta_dot)` for an
                ElasticArm.
            **keywords: `direction`, `stop` and `name` of the event. The default name is the name of the function.

        Returns:
            The event.

        Raises:
            InputError: `g` is not callable, or a keyword has an invalid value.
        """
        if not callable(g):
            raise InputError(f"Event.function: g is not callable: expected a function, got {type(g).__name__}")
        keywords.setdefault("name", getattr(g, "__name__", "function"))
        return cls("function", (g,), **keywords)


def watched(events: Event | Callable[..., float] | Sequence[Event | Callable[..., float]] | None) -> list[Event]:
    """Return the argument `events` as a list of `Event`s. The attributes `direction` and `terminal` of a function are used, as in scipy."""
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
    return given  # type: ignore[return-value]  # the loop replaced each function by an Event


@bordered
@sealed
@dataclass(frozen=True, eq=False, repr=False)
class Events:
    """The m crossings that a run found, in order of time.

    Attributes:
        t: times of the crossings, (m,), s.
        which: index of each crossing's event in the argument `events`, (m,).
        names: names of the events.
        q, v, theta, theta_dot: state at each crossing, (m, n) each, rad or m, rad/s or m/s; None if the plant does not have it.
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

    def __repr__(self) -> str:
        return brief(self)

    def of(self, event: int | str) -> Events:
        """Select the crossings of one event.

        Args:
            event: index or name of the event.

        Returns:
            The crossings of this event.

        Raises:
            InputError: the run has no event with this index or name.
        """
        if isinstance(event, str) and event in self.names:
            event = self.names.index(event)
        if not isinstance(event, int) or not 0 <= event < len(self.names):
            raise InputError(f"Events.of: event is unknown: expected an index or one of {', '.join(self.names)}, got {shown(event)}")
        rows = self.which == event
        parts = (None if part is None else part[rows] for part in (self.q, self.v, self.theta, self.theta_dot))
        return Events(self.t[rows], self.which[rows], self.names, *parts)  # type: ignore[arg-type]  # `q`, the first part, is an array


@bordered
@sealed
class State(NamedTuple):
    """The state of a run: arrays (n,) at one time, or (K, n) at K times, rad or m, rad/s or m/s.

    A part that the plant or the law does not have is None.
    """

    q: Array
    v: Array | None
    theta: Array | None
    theta_dot: Array | None
    estimate: Array | None
