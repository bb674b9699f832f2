"""The numbers of a plant that a prediction fit varies.

All numbers are one vector: the inertial parameters, then numbers of the joints, then the delay. The fit varies P values `beta`:

    numbers = start + D (beta - beta_0)

A base parameter is a sum of several numbers. Its column of `D` is the shortest vector that changes this sum by one and no other sum.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...errors import InputError
from ...friction_models import StickSlip
from ..samples import NAME
from ..sensors import TIMES, one_time

__all__ = ["KINDS", "PlantNumbers"]

Array = NDArray[np.float64]

#: The kinds of numbers of joints, with the part of a name before the joint, in their order in the vector.
JOINTS = {
    "rotors": "armature", "viscous": "damping", "coulomb": "friction", "offsets": "offset", "torque_constants": "torque_constant",
    "stiffness": "stiffness", "joint_damping": "joint_damping", "encoder_offsets": "encoder_offset",
}  # fmt: skip
#: The kinds of numbers of joints that belong to the drives of an arm.
DRIVES = ("rotors", "viscous", "coulomb")
KINDS = ("inertia", *JOINTS, *TIMES)
#: Kinds that only elastic joints have.
ELASTIC = ("stiffness", "joint_damping")
#: Smallest torque constant, and smallest stiffness and rotor of elastic joints as a fraction of the start.
LEAST = 0.05


class PlantNumbers:
    """The numbers of a plant, and those that the fit varies."""

    def __init__(self, plant: Any, kinds: Sequence[str], delay: float) -> None:
        self.plant, self.kinds = plant, tuple(kinds)
        #: The kind of the delay that the fit varies: "delay", "clock_offset" or None.
        self.time = next((kind for kind in TIMES if kind in self.kinds), None)
        self.arm: _core.Arm = plant.arm
        self.elastic = isinstance(plant, _core.ElasticArm)
        self.n, self.p = self.arm.n, self.arm.parameters.size
        self.arguments: Mapping[str, Any] = plant.__getnewargs_ex__()[1]
        self._require_known()
        given = self._given()
        self.places = {name: slice(self.p + i * self.n, self.p + (i + 1) * self.n) for i, name in enumerate(JOINTS)}
        self.late = self.p + len(JOINTS) * self.n
        self.start: Array = np.concatenate([self.arm.parameters, *(given[name] for name in JOINTS), [delay]])
        self.names, self.D = self._directions()
        self.first: Array = np.array([self._value(name) for name in self.names])
        if self.groups is not None:
            self.first[: len(self.groups)] = self.groups @ self.start
        self.low = np.array([self._lowest(name, value) for name, value in zip(self.names, self.first, strict=True)])

    def _require_known(self) -> None:
        """Refuse a plant with parts that the transitions of the fit do not have, and kinds without such numbers in the plant."""
        kind = type(self.plant).__name__
        if not isinstance(self.plant, _core.RigidArm | _core.ElasticArm):
            raise InputError(f"{NAME}: model has the wrong plant: expected a RigidArm or an ElasticArm, got {kind}")
        for part in ("wall", "stops"):
            if self.arguments.get(part) is not None:
                raise InputError(f"{NAME}: model has {part}: expected a plant without {part}; cut contacts out of the log")
        friction = self.arguments.get("motor_friction" if self.elastic else "friction")
        simple = not isinstance(friction, StickSlip) or not (np.any(friction.load_ratio) or friction.static is not None)
        if not simple or type(friction).__name__ == "LuGre":
            raise InputError(f"{NAME}: model has other friction than viscous and Coulomb friction, got {friction!r}")
        if self.elastic:
            for name in ("stiffness", "motor_inertia"):
                value = np.asarray(self.arguments[name])
                if value.ndim == 2 and np.any(value - np.diag(np.diag(value))):
                    raise InputError(f"{NAME}: model has a {name} that is not diagonal: expected one number per joint")
        for i, name in enumerate(self.kinds):
            if name in ELASTIC and not self.elastic:
                raise InputError(f"{NAME}: names[{i}] is {name!r}: expected an ElasticArm for this name, got {kind}")
        one_time(self.kinds)

    def _given(self) -> dict[str, Array]:
        """The numbers of the joints in the plant."""
        limits: Mapping[str, Any] = self.arm.limits
        friction = self.arguments.get("motor_friction" if self.elastic else "friction", False)
        given: dict[str, Any] = dict.fromkeys(JOINTS, 0.0)
        given["torque_constants"] = 1.0
        if isinstance(friction, StickSlip):
            given |= {"viscous": friction.viscous, "coulomb": friction.coulomb}
        elif self.elastic and friction is not None:
            given["viscous"] = friction
        elif not self.elastic and friction:
            given |= {"viscous": limits["damping"], "coulomb": limits["friction"]}
        if self.elastic:
            given |= {name: self.arguments.get(name, 0.0) for name in ELASTIC} | {"rotors": self.arguments["motor_inertia"]}
        else:
            given["rotors"] = limits["armature"]
        arrays = {name: np.asarray(0.0 if value is None else value, dtype=np.float64) for name, value in given.items()}
        return {name: np.array(np.broadcast_to(np.diag(x) if x.ndim == 2 else x, (self.n,))) for name, x in arrays.items()}

    def _directions(self) -> tuple[tuple[str, ...], Array]:
        """The names of the P values, and `D`."""
        grouped = [] if self.elastic else [name for name in ("rotors", "viscous", "coulomb", "offsets") if name in self.kinds]
        names: list[str] = []
        columns: list[Array] = []
        self.groups: Array | None = None
        if "inertia" in self.kinds:
            rubs = "viscous" in grouped or "coulomb" in grouped
            base = self.arm.base_parameters(armature="rotors" in grouped, friction=rubs, offset="offsets" in grouped)
            joints = ["rotors"] * base.armature + ["viscous", "coulomb"] * base.friction + ["offsets"] * base.offset
            where = np.concatenate([np.arange(self.p), *(np.arange(self.n) + self.places[name].start for name in joints)]).astype(int)
            kinds = [*["inertia"] * self.p, *(name for name in joints for _ in range(self.n))]
            chosen = [k for k, column in enumerate(base.columns) if kinds[column] in self.kinds]
            free = np.array([kind in self.kinds for kind in kinds])
            rows = base.projection[chosen] * free
            self.groups = np.zeros((len(chosen), self.start.size))
            self.groups[:, where] = rows
            names += [base.grouping[k] for k in chosen]
            columns += list(np.linalg.pinv(self.groups).T)
        else:
            grouped = []
        for kind, label in JOINTS.items():
            if kind in self.kinds and kind not in grouped:
                names += [f"{label}[{joint}]" for joint in self.arm.joint_names]
                columns += list(np.eye(self.start.size)[self.places[kind]])
        for kind, sign in zip(TIMES, (1.0, -1.0), strict=True):
            if kind in self.kinds:
                names.append(kind)
                columns.append(sign * np.eye(self.start.size)[self.late])
        return tuple(names), np.array(columns).reshape(len(names), self.start.size).T

    def _value(self, name: str) -> float:
        """The value of a number with one place in the vector."""
        if name in TIMES:
            return float(self.start[self.late]) * (1.0 if name == "delay" else -1.0)
        label, _, joint = name.rstrip("]").partition("[")
        kind = next((kind for kind, each in JOINTS.items() if each == label), None)
        return 0.0 if kind is None or joint not in self.arm.joint_names else self._of(kind, joint)

    def _of(self, kind: str, joint: str) -> float:
        return float(self.start[self.places[kind]][self.arm.joint_names.index(joint)])

    def _lowest(self, name: str, value: float) -> float:
        label = name.partition("[")[0]
        if label == "torque_constant":
            return LEAST
        if label == "stiffness" or (label == "armature" and self.elastic):
            return LEAST * value
        return 0.0 if label == "joint_damping" else -np.inf

    def all_of(self, beta: Array) -> Array:
        """All numbers at the values `beta`."""
        return np.asarray(self.start + self.D @ (beta - self.first))

    def beta_of(self, arm: _core.Arm, offsets: Array) -> Array:
        """The values of the fit that the arm with its drives and the torque offsets have. Other values are those of the start."""
        numbers = self.start.copy()
        numbers[: self.p] = arm.parameters
        for kind in DRIVES:
            if kind in self.kinds:
                numbers[self.places[kind]] = arm.limits[JOINTS[kind]]
        if "offsets" in self.kinds:
            numbers[self.places["offsets"]] = offsets
        # The directions are independent, so their pseudo-inverse returns the values.
        change: Array = np.asarray(np.linalg.lstsq(self.D, numbers - self.start, rcond=None)[0], dtype=np.float64)
        if self.groups is not None:
            change[: len(self.groups)] = self.groups @ (numbers - self.start)
        return np.asarray(self.first + change)

    def arm_of(self, numbers: Array) -> _core.Arm:
        """The arm with the bodies and, if it is rigid, the drives of `numbers`."""
        arm = self.arm if np.array_equal(numbers[: self.p], self.arm.parameters) else self.arm.with_parameters(numbers[: self.p])
        fitted = [kind for kind in DRIVES if kind in self.kinds]
        if self.elastic or not fitted:
            return arm
        return arm.with_drives(**{JOINTS[kind]: numbers[self.places[kind]] for kind in fitted})

    def plant_of(self, numbers: Array) -> _core.Plant:
        """The plant with `numbers`. Negative friction, which noise can cause, becomes zero in the models that refuse it."""
        changed: dict[str, Any] = {"arm": self.arm_of(numbers)}
        viscous, coulomb = (numbers[self.places[kind]] for kind in ("viscous", "coulomb"))
        rubs = bool({"viscous", "coulomb"} & set(self.kinds))
        dry = StickSlip(coulomb=np.maximum(coulomb, 0.0).tolist(), viscous=np.maximum(viscous, 0.0).tolist())
        if self.elastic:
            changed |= {name: numbers[self.places[name]] for name in ELASTIC if name in self.kinds}
            if "rotors" in self.kinds:
                changed["motor_inertia"] = numbers[self.places["rotors"]]
            if rubs:
                changed["motor_friction"] = dry if np.any(coulomb) else np.maximum(viscous, 0.0)
        elif rubs:
            friction = self.arguments.get("friction", False)
            changed["friction"] = dry if isinstance(friction, StickSlip) else friction or True
        made: _core.Plant = type(self.plant)(**{**self.arguments, **changed})
        return made
