"""Models of dry friction for the joints of a plant: their parameters, per joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np

from . import _core
from .arguments import require_partner
from .border import bordered
from .pickling import sealed

__all__ = ["LuGre", "StickSlip"]

Numbers: TypeAlias = float | Sequence[float]


class _Model:
    """A model as numbers and tuples of numbers. Models can be compared, printed and pickled."""

    static: Numbers | None
    stribeck_speed: Numbers | None

    def __post_init__(self) -> None:
        for name, value in self.__getnewargs_ex__()[1].items():
            if value is not None:
                values = _core.numbers(type(self).__name__, name, value, (), ("n",)).tolist()
                object.__setattr__(self, name, tuple(values) if isinstance(values, list) else values)
        # The plant's constructor refuses negative speeds, and a speed of zero is the default of some models.
        if np.all(np.asarray(self.stribeck_speed or 0.0) > 0.0):
            require_partner(type(self).__name__, "stribeck_speed", self.stribeck_speed, "static", self.static is not None)

    def __getnewargs_ex__(self) -> tuple[tuple[()], Mapping[str, Any]]:
        """The constructor arguments of an equal model, for pickling."""
        return (), {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]  # subclasses are dataclasses


@bordered
@sealed
@dataclass(frozen=True, kw_only=True)
class LuGre(_Model):
    """LuGre friction of the joints of a plant: bristles with deflection `z` that can slip.

    `z' = v - sigma_0 |v| z / h(v)`, `tau_f = sigma_0 z + sigma_1 z' + sigma_2 v`,
    `h(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2) + mu |L|`

    `v` is the velocity of a joint of a `RigidArm`, or of a motor of an `ElasticArm`. `L` is the transmitted torque: `tau - sigma_0 z` of a
    `RigidArm`, the joint torque `tau_J` of an `ElasticArm`. Each `z` is a state of the plant and starts at zero.

    Args:
        coulomb: Coulomb friction `F_c` > 0, N m or N. This and all following arguments are scalars or (n,).
        stiffness: stiffness of the bristles `sigma_0` > 0, N m/rad or N/m.
        damping: damping of the bristles `sigma_1` >= 0, N m s/rad or N s/m.
        static: static friction `F_s` >= `F_c`, N m or N; None: `F_c`.
        stribeck_speed: Stribeck speed `v_s` > 0, rad/s or m/s. It is required if `F_s` exceeds `F_c`, and requires `static`.
        viscous: viscous friction `sigma_2` >= 0, N m s/rad or N s/m.
        load_ratio: friction per transmitted torque `mu`, in [0, 1).

    Raises:
        InputError: an argument is not a number or an array of numbers. Wrong shapes and ranges raise it in the plant's constructor.

    Source: [CanudasDeWit1995]; load-dependent friction as in [Hamon2010]; docs/friction.md.

    >>> import armlet as al
    >>> friction = al.LuGre(coulomb=2.0, static=3.0, stribeck_speed=0.05, stiffness=1e4, damping=50.0, viscous=0.5)
    >>> plant = al.RigidArm(al.planar_arm([0.5, 0.4]), friction=friction)
    """

    coulomb: Numbers
    stiffness: Numbers
    damping: Numbers = 0.0
    static: Numbers | None = None
    stribeck_speed: Numbers | None = None
    viscous: Numbers = 0.0
    load_ratio: Numbers = 0.0


@bordered
@sealed
@dataclass(frozen=True, kw_only=True)
class StickSlip(_Model):
    """Stick-slip friction of the joints of a plant: a joint sticks while static friction can hold it.

    stuck:   `v_i = 0`, `|tau_f,i| <= F_s + mu |L|`
    sliding: `tau_f = sign(v) h(v) + d v`, `h(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2) + mu |L|`

    `v` is the velocity of a joint of a `RigidArm`, or of a motor of an `ElasticArm`. `L` is the transmitted torque: `tau - tau_f` of a
    `RigidArm`, the joint torque `tau_J` of an `ElasticArm`. The velocity of a stuck joint is exactly zero. Adaptive methods locate the
    times at which joints stick and slip. With fixed-step methods, joints stick and slip only between steps.

    Args:
        coulomb: Coulomb friction `F_c` >= 0, N m or N. This and all following arguments are scalars or (n,).
        static: static friction `F_s` >= `F_c`, N m or N; None: `F_c`.
        stribeck_speed: Stribeck speed `v_s` > 0, rad/s or m/s. With None or 0, friction is `F_c` as soon as the joint moves.
            It requires `static`.
        viscous: viscous friction `d` >= 0, N m s/rad or N s/m.
        load_ratio: friction per transmitted torque `mu`, in [0, 1).

    Raises:
        InputError: an argument is not a number or an array of numbers. Wrong shapes and ranges raise it in the plant's constructor.

    Source: [Karnopp1985, Olsson1998]; load-dependent friction as in [Hamon2010]; docs/friction.md.

    >>> import armlet as al
    >>> plant = al.RigidArm(al.planar_arm([0.5, 0.4]), friction=al.StickSlip(coulomb=2.0, static=3.0, stribeck_speed=0.05))
    """

    coulomb: Numbers
    static: Numbers | None = None
    stribeck_speed: Numbers | None = None
    viscous: Numbers = 0.0
    load_ratio: Numbers = 0.0
