"""The data of a run: its fields by name, its reference, and the units of its joints.

Time is the first axis of the arrays of a run: `q` is (K, n). In a batch of B runs the axis of the runs comes first: `q` is (B, K, n).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import InputError
from ..integration import DenseOutput
from ..status import Status
from .contacts import contact_forces
from .events import Events
from .guards import Contact, contact_states, residuals, touched_joints
from .task_errors import orientation_errors, position_errors, stacked

__all__ = ["SERIES", "Array", "Recorded"]

Array: TypeAlias = NDArray[np.float64]

# Quantities recorded over time, in the order of the columns in tables and files.
SERIES = ("q", "v", "tau", "estimate", "theta", "theta_dot", "friction", "bristles")
# Optional fields. A run computes a field from its plant and law if the field was not passed to the constructor.
OTHERS = ("parameters", "target", "limits", "position_error", "orientation_error", "contact_force", "residual", "touched", "contact_state")
LIMITS = ("q_min", "q_max", "v_max", "effort")


class Recorded:
    """The arrays of a run or of a batch, with the plants and laws that produced them. `Run` and `BatchRun` add methods."""

    t: Array
    q: Array
    v: Array
    tau: Array | None
    estimate: Array | None
    theta: Array | None
    theta_dot: Array | None
    friction: Array | None
    bristles: Array | None
    monitors: dict[str, Array]
    stats: dict[str, Any]
    #: How the run ended: one `Status`, or one integer per run of a batch.
    status: Any
    #: Class name of the law, such as "Adaptive". It determines the unit of the inputs, and panels of the figure.
    law_name: str
    #: The arm of the plant, or of a batch's first plant; None in a run that was read from a file.
    arm: Any

    def __init__(self, fields: Mapping[str, Any], law: Any = None, motion: Any = None, plant: Any = None) -> None:
        given = dict(fields)
        who = type(self).__name__
        t = _core.numbers(who, "t", given.pop("t"))
        self.t = t if t.ndim else t.reshape(1)
        for name in SERIES:
            value = given.pop(name) if name in ("q", "v") else given.pop(name, None)
            setattr(self, name, None if value is None else _core.numbers(who, name, value))
        self.monitors = {name: _core.numbers(who, name, value) for name, value in (given.pop("monitors", None) or {}).items()}
        self.stats = dict(given.pop("stats", None) or {})
        laws, plants = _rows(law), _rows(plant)
        self.law_name = given.pop("law_name", None) or ("" if law is None else type(laws[0]).__name__)
        self._desired: tuple[Array, ...] | None = given.pop("desired", None)
        motions = _joint_motions(laws) if motion is None else _rows(motion)
        if len(motions) > 1 and all(each == motions[0] for each in motions):
            motions = motions[:1]  # all motions are equal, so one is sampled
        self._motions = motions
        arms: list[Any] = [getattr(each, "arm", None) for each in plants]
        self._laws, self._plants, self._arms, self.arm = laws, plants, arms, arms[0]
        # The sample period, s, or whether the loop was sampled.
        sampled = given.pop("sampled", True)
        self._sampled, self._period = bool(sampled), None if isinstance(sampled, bool) else float(sampled)
        # The limits of the input that the run had, N m or N, for its figure.
        self._tau_max = given.pop("tau_max", None)
        # The first numbers of an adaptive law's state are the parameter estimate. The states of its filters follow.
        self._estimated = len(laws[0].parameter_names) if isinstance(laws[0], _core.Adaptive) else None
        # Fields that were passed replace the cached properties below. Otherwise a property computes its field from the plant and the law
        # at its first use.
        stated = {name: given.pop(name, None) for name in (*OTHERS, "units", "input_units")}
        if stated["parameters"] is not None:
            stated["parameters"] = _core.numbers(who, "parameters", stated["parameters"])
        for name in ("units", "input_units"):
            if stated[name]:
                stated[name] = tuple(stated[name])
        self.__dict__.update((name, value) for name, value in stated.items() if value is not None and len(value))
        self._set_status(given.pop("status", Status.SUCCESS))
        self.events: Events | None = given.pop("events", None)
        self.sensitivity: dict[str, Any] | None = given.pop("sensitivity", None)
        self._dense: tuple[DenseOutput, int] | None = given.pop("dense", None)
        if given:
            raise InputError(f"{type(self).__name__}: fields are unknown: expected fields of a run, got {sorted(given)}")

    @cached_property
    def parameters(self) -> Array | None:
        """The true inertial parameters of the plant's arm, (p,) or (B, p), for comparison with `estimate`; None if unknown.

        Rows of arms with fewer bodies end with NaN.
        """
        if None in self._arms:
            return None
        each = [np.asarray(arm.parameters, dtype=np.float64) for arm in self._arms]
        return stacked(each) if len(each) > 1 else each[0]

    @cached_property
    def target(self) -> Array | None:
        """The joint position that a law in joint space holds, (n,) or (B, n), rad or m; None for other laws.

        It is NaN in rows of a batch whose laws track a motion.
        """
        targets = [getattr(each, "_joint_target", None) for each in self._laws]
        if all(each is None for each in targets):
            return None
        nothing = np.full(self.q.shape[-1], np.nan)
        rows = [nothing if each is None else each for each in targets]
        return np.array(rows if len(rows) > 1 else rows[0], dtype=np.float64)

    @cached_property
    def limits(self) -> dict[str, Array] | None:
        """The arm's `q_min`, `q_max` (rad or m), `v_max` (rad/s or m/s) and `effort` (N m or N), (n,) or (B, n) each; None if unknown."""
        return _limits(self._arms)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint's position, "rad" or "m"."""
        types = getattr(self.arm, "joint_types", None) or ("revolute",) * self.q.shape[-1]
        return tuple("m" if kind in ("prismatic", "P") else "rad" for kind in types)

    def _set_status(self, status: Any) -> None:
        raise NotImplementedError

    def _items(self) -> dict[str, Any]:
        """Return every field by name, in the form that `__init__` accepts."""
        items = {name: getattr(self, name) for name in ("t", *SERIES, *OTHERS) if getattr(self, name) is not None}
        items |= {"monitors": self.monitors, "stats": self.stats, "law_name": self.law_name, "status": self.status}
        items |= {"units": self.units, "input_units": self.input_units}
        desired = self.desired()
        return items if desired is None else items | {"desired": desired}

    def desired(self) -> tuple[Array, Array, Array] | None:
        """Return the desired motion `(q_d, v_d, a_d)` at the times of the run, (K, n) each; None if the law has no motion of the joints.

        The units are rad, rad/s and rad/s^2, or m, m/s and m/s^2. In a batch whose rows differ in motion or times each array is (B, K, n).
        """
        if self._desired is None and self._motions:
            if len(self._motions) == 1 and self.t.ndim == 1:
                self._desired = _sampled(self._motions[0], self.t, self.q.shape[-1])
            else:
                shape = (self.q.shape[0], self.t.shape[-1])
                motions = self._motions * (shape[0] if len(self._motions) == 1 else 1)
                rows = [_sampled(m, t, self.q.shape[-1]) for m, t in zip(motions, np.broadcast_to(self.t, shape), strict=True)]
                self._desired = tuple(np.stack(parts) for parts in zip(*rows, strict=True))
        return self._desired  # type: ignore[return-value]  # the tuple has three arrays

    @cached_property
    def position_error(self) -> Array | None:
        """The distance between the frame of each task and its target, (K, tasks) or (B, K, tasks), m; None for laws without such tasks."""
        return self._of_tasks(position_errors)

    @cached_property
    def orientation_error(self) -> Array | None:
        """The angle between the frame of each task and its target, (K, tasks) or (B, K, tasks), rad; None for laws without such tasks."""
        return self._of_tasks(orientation_errors)

    @cached_property
    def contact_force(self) -> Array | None:
        """The force of the plant's wall on the frame, along the wall's normal, (K,) or (B, K), N; None for plants without a wall.

        It is NaN in rows of a batch whose plants have no wall.
        """
        return None if self.arm is None else contact_forces(self._plants, self.q, self.v)

    @cached_property
    def residual(self) -> Array | None:
        """The residual of the observer of a `Guarded` law, (K, n) or (B, K, n), N m or N.

        It is None for other laws, and for a run with one record.

        In a sampled loop it is the mean residual since the previous record, and row 0 is zero. If each sample is recorded, row `k` is the
        residual of the sample at record `k - 1`. In a continuous loop it is the residual at the time of the record.
        """
        return residuals(self._laws, self.t, self.q, self.v, self.estimate, self._sampled)

    @cached_property
    def touched(self) -> NDArray[np.int64] | None:
        """The index of the touched link's joint at each record, from `residual`, (K,) or (B, K): -1 without contact; None without
        thresholds."""
        return touched_joints(self._laws, self.residual)

    @cached_property
    def contact_state(self) -> Array | None:
        """The fields time, joint and residual of `contact` in one array, (2 + n,) or (B, 2 + n); None for laws without a reaction."""
        return contact_states(self._laws, self.t, self.estimate, not isinstance(self.status, Status))

    @property
    def contact(self) -> Contact | None:
        """The contact to which a `Guarded` law reacted (`armlet.Contact`); None for laws without a reaction.

        It is also None for a single run without contact. For a batch its fields are arrays.
        """
        state = self.contact_state
        if state is None:
            return None
        if state.ndim > 1:
            return Contact(state[:, 0], state[:, 1].astype(np.int64), state[:, 2:])
        return Contact(float(state[0]), int(state[1]), state[2:]) if np.isfinite(state[0]) else None

    def _of_tasks(self, errors: Callable[..., Array | None]) -> Array | None:
        known = self._laws[0] is not None and self.arm is not None
        return errors(self._laws, self._arms, self.t, self.q) if known else None

    def reference(self) -> tuple[Array, Array | None] | None:
        """Return the reference of the joints, `(q_d, v_d)`: the desired motion, or the target of a law in joint space; else None.

        The arrays broadcast to the shape of `q`. For a target `v_d` is None.
        """
        desired = self.desired()
        if desired is not None:
            return desired[0], desired[1]
        return None if self.target is None else (self.target[..., None, :], None)

    @cached_property
    def input_units(self) -> tuple[str, ...]:
        """Unit of each joint's input: "N m" for a torque, "N" for a force, "rad/s" or "m/s" for a commanded velocity."""
        commanded = "v" not in getattr(self._plants[0], "_parts", ("v",))
        if commanded or self.law_name == "PriorityVelocity":
            return tuple(f"{unit}/s" for unit in self.units)
        return tuple("N" if unit == "m" else "N m" for unit in self.units)

    def __reduce__(self) -> tuple[Any, ...]:
        return _core._seal(type(self), (self._items() | {"events": self.events, "dense": self._dense, "sensitivity": self.sensitivity},))

    def _table(self, row: tuple[Any, ...] = ()) -> dict[str, Array]:
        """Return the columns over time: q1.., v1.., tau1.., the other recorded series, and the monitors."""
        columns: dict[str, Array] = {}
        for name in SERIES:
            values = getattr(self, name)
            if values is not None:
                columns |= {f"{name}{i + 1}": values[(*row, slice(None), i)] for i in range(values.shape[-1])}
        return columns | {name: values[row] for name, values in self.monitors.items()}


def _joint_motions(laws: list[Any]) -> list[Any]:
    """Return the motion of the joints that each law tracks.

    The list is empty if no law tracks a motion of the joints, or if a law has no reference of the joints.
    If some laws of a batch track a motion, a constant target of another law counts as a motion at rest.
    """
    motions = [getattr(law, "_joint_motion", None) for law in laws]
    if all(motion is None for motion in motions):
        return []
    targets = [None if motion is not None else getattr(law, "_joint_target", None) for law, motion in zip(laws, motions, strict=True)]
    held = [motion if target is None else _core.Hold(target) for motion, target in zip(motions, targets, strict=True)]
    return held if None not in held else []


def _limits(arms: list[Any]) -> dict[str, Array] | None:
    """Return the limits of the plants' arms, or None if an arm has no limits."""
    stated: list[Any] = [getattr(arm, "limits", None) for arm in (arms if any(arm is not arms[0] for arm in arms) else arms[:1])]
    if not all(stated):
        return None
    return {name: np.array([each[name] for each in stated] if len(stated) > 1 else stated[0][name]) for name in LIMITS}


def _rows(value: Any) -> list[Any]:
    """Return the objects of the rows as a list. An object for all rows becomes a list of length 1."""
    return list(value) if isinstance(value, list | tuple) else [value]


def _sampled(motion: Any, t: Array, n: int) -> tuple[Array, ...]:
    samples = [motion(float(time)) for time in t]
    return tuple(np.array([sample[i] for sample in samples], dtype=np.float64).reshape(len(t), n) for i in range(3))
