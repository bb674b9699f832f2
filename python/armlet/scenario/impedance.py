"""Tables for moving targets of laws, and for the null space of impedance laws."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from .. import _core
from ..null_space import NullSpace
from .fields import Entries, Field, Flag, Numbers, OneOf, Table, Text

__all__ = ["following", "impedance", "options", "target_of"]

_LIMIT = Numbers(depth=1, low=0.0, strict=True)
_GAIN = Numbers(depth=2, low=0.0)


def options(motions: OneOf) -> dict[str, Field]:
    """Return the options of `CartesianImpedance` and `ElasticImpedance`. The posture `q_d` of a null space may be a table of `motions`."""
    posture = Entries({"plain": Numbers(depth=1, scalar=False), "table": motions})
    fields = {"q_d": posture, "stiffness": _GAIN, "damping": _GAIN, "projection": Text(("consistent", "static"))}
    return {
        "nullspace": Table(fields, ("q_d", "stiffness", "damping")),
        "feedforward": Numbers(depth=1, scalar=False),
        "compensate_coupling": Flag(),
        "eps": Numbers(low=0.0, strict=True),
        "integral_gain": _GAIN,
        "wrench_max": _LIMIT,
        "tau_max": _LIMIT,
    }


def target_of(motions: OneOf) -> dict[str, Field]:
    """Return the field `target` of an impedance law.

    The target is a vector with one number per controlled direction, a pose (4, 4), or a table of `motions` that describes a motion.
    """
    return {"target": Entries({"plain": Numbers(depth=2, scalar=False), "table": motions})}


def impedance(law: Callable[..., _core.Law], motions: OneOf) -> Callable[..., _core.Law]:
    """Return a function that makes the law `law`. Its target and null space may be tables."""

    def make(arm: _core.Arm, target: Any, nullspace: Mapping[str, Any] | None = None, **keywords: Any) -> _core.Law:
        if isinstance(target, Mapping):
            target = motions.make(target)
        if nullspace is not None:
            q_d = nullspace["q_d"]
            posture = motions.make(q_d, arm=arm) if isinstance(q_d, Mapping) else q_d
            keywords["nullspace"] = NullSpace(**{**nullspace, "q_d": posture})
        return law(arm, target, **keywords)

    return make


def following(law: Callable[..., _core.Law], motions: OneOf) -> Callable[..., _core.Law]:
    """Return a function that makes the law `law` of joints. If the law has a target, the target may be a table of `motions`."""

    def make(*, arm: _core.Arm, **others: Any) -> _core.Law:
        if isinstance(others.get("target"), Mapping):
            others["target"] = motions.make(others["target"], arm=arm)
        return law(arm=arm, **others)

    return make
