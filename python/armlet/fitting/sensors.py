"""Errors of sensors that a fit can correct: factors of the torques, offsets of the encoders, and the delay between both.

    tau(t) = c tau_recorded(t - d),   q = q_recorded - o

The residual `tau - f(q)` of the model `f` has these derivatives with the opposite sign. They have the model's torque, because the noise of
the recorded torque is in the residual too, and would bias the values:

    c_j: -f_j / c_j,   o_j: -df/dq_j,   d: df/dt
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import InputError
from .samples import NAME, Samples

__all__ = ["SENSORS", "TIMES", "Sensors", "one_time", "torque_rate"]

Array = NDArray[np.float64]

TIMES = ("delay", "clock_offset")
#: The kinds of this file. Those of joints have the part of a name before the joint.
SENSORS = {"torque_constants": "torque_constant", "encoder_offsets": "encoder_offset"} | {time: time for time in TIMES}
#: Smallest torque constant.
LEAST = 0.05


def one_time(kinds: Sequence[str]) -> None:
    """Refuse both kinds of `TIMES` at once."""
    if set(TIMES) <= set(kinds):
        raise InputError(f"{NAME}: names have delay and clock_offset, whose effects are equal: expected one of them")


@dataclass(frozen=True)
class Sensors:
    """Torque constants (n,), encoder offsets (n,) and the delay, s; and which of them the fit varies."""

    kinds: tuple[str, ...]
    constants: Array
    offsets: Array
    delay: float

    @classmethod
    def start(cls, kinds: Sequence[str], n: int, delay: float) -> Sensors:
        """Sensors without errors but the delay."""
        return cls(tuple(kind for kind in SENSORS if kind in kinds), np.ones(n), np.zeros(n), delay)

    @property
    def moves(self) -> bool:
        """Whether the fit varies the delay."""
        return any(kind in TIMES for kind in self.kinds)

    @property
    def values(self) -> Array:
        """The values that the fit varies, in the order of `names`."""
        each = {"torque_constants": self.constants, "encoder_offsets": self.offsets, "delay": [self.delay], "clock_offset": [-self.delay]}
        return np.concatenate([np.zeros(0), *(each[kind] for kind in self.kinds)])

    @property
    def replaced(self) -> tuple[str, ...]:
        """The assumptions that the fit replaces by values."""
        return ("torque_constant",) * ("torque_constants" in self.kinds) + ("delay",) * self.moves

    def names(self, joints: Sequence[str]) -> tuple[str, ...]:
        """The names of the values."""
        return tuple(
            name for kind in self.kinds for name in ([kind] if kind in TIMES else [f"{SENSORS[kind]}[{joint}]" for joint in joints])
        )

    def moved(self, change: Array) -> Sensors:
        """The sensors whose values have changed by `change`."""
        made, begin = self, 0
        for kind in self.kinds:
            part = change[begin : begin + (1 if kind in TIMES else len(self.offsets))]
            begin += len(part)
            if kind == "torque_constants":
                made = replace(made, constants=np.maximum(self.constants + part, LEAST))
            elif kind == "encoder_offsets":
                made = replace(made, offsets=self.offsets + part)
            else:
                made = replace(made, delay=self.delay + float(part[0]) * (1.0 if kind == "delay" else -1.0))
        return made

    def corrected(self, samples: Samples) -> Samples:
        """The samples of a log with this delay, with the true torques and positions. The filter is linear, so they need no new filter."""
        q, v, a = samples.motion
        return replace(samples, q=samples.q - self.offsets, tau=self.constants * samples.tau, motion=(q - self.offsets, v, a))

    def columns(self, model: _core.Arm, samples: Samples, kinds: Sequence[str], explained: Array) -> Array:
        """The columns of the values, (K, n, s). `explained` is the torque of the model, (K, n)."""
        count, n = explained.shape
        made = [np.zeros((count, n, 0))]
        for kind in self.kinds:
            if kind == "torque_constants":
                made.append(-np.eye(n) * (explained / self.constants)[:, None, :])
            elif kind == "encoder_offsets":
                made.append(-np.asarray(model.inverse_dynamics_derivatives(samples.q, samples.v, samples.a)[0]))
            else:
                rate = torque_rate(model, samples, kinds)
                made.append((rate if kind == "delay" else -rate)[:, :, None])
        return np.concatenate(made, axis=2)


def torque_rate(model: _core.Arm, samples: Samples, kinds: Sequence[str]) -> Array:
    """The derivative in time of the torque of the model, (K, n)."""
    limits: Any = model.limits
    bare = model.with_drives(armature=np.zeros(model.n))

    def bodies_after(step: int) -> Array:
        return np.asarray(samples.sampled(bare.inverse_dynamics, *(np.roll(each, -step, axis=0) for each in samples.motion)))

    def difference(series: Array) -> Array:
        return np.asarray((np.roll(series, -1, axis=0) - np.roll(series, 1, axis=0)) / (2.0 * samples.period))

    rate = (bodies_after(1) - bodies_after(-1)) / (2.0 * samples.period)
    rate = rate + limits["armature"] * samples.sampled(np.asarray, difference(samples.motion[2]))
    if "viscous" in kinds:
        rate = rate + limits["damping"] * samples.a
    if "coulomb" in kinds:
        rate = rate + limits["friction"] * samples.filtered(difference(np.sign(samples.motion[1])))
    return np.asarray(rate)
