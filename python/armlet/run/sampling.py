"""A controller on a clock that is late, sees badly or moves slowly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from types import NoneType

from .. import _core
from ..arguments import instance, integer, number, shown
from ..border import bordered
from ..errors import InputError
from ..pickling import sealed

__all__ = ["Sampling", "TorqueSensor"]

CHANNELS = ("q", "v", "theta", "theta_dot")


@bordered
@sealed
@dataclass(frozen=True, kw_only=True)
class TorqueSensor:
    """The joint-torque sensors of an elastic arm in a sampled loop, `Sampling(torque_sensor=...)`.

    `tau_f' = w_c (tau_J - tau_f)`, `reading = round((tau_f + bias + noise)/resolution) resolution`, with `tau_J = K (theta - q)`. The law
    knows the links through it and the motors' encoders, as on light-weight arms: it sees `q = theta - K^-1 reading`, `K` its own joint
    stiffness, so that its `tau_J` is the reading. The filters begin at rest; between samples the torque is taken to move in a straight
    line, for which they are exact.

    Args:
        noise: standard deviation, N m.
        bias: constant error, N m, scalar or (n,).
        resolution: step of the reading, N m; none if 0.
        bandwidth: `w_c` of the first-order filter, rad/s; none if infinite.

    Raises:
        InputError: an argument is no number; where it is used: a number is of the wrong sign or not finite, the plant has no elastic
            joints.

    >>> import armlet as al
    >>> al.Sampling(1e-3, torque_sensor=al.TorqueSensor(noise=0.1, bandwidth=2000.0)).torque_sensor.noise
    0.1
    """

    noise: float = 0.0
    bias: float | Sequence[float] = 0.0
    resolution: float = 0.0
    bandwidth: float = inf

    def __post_init__(self) -> None:
        for name in ("noise", "resolution", "bandwidth"):
            object.__setattr__(self, name, number("TorqueSensor", name, getattr(self, name)))
        bias = _core.numbers("TorqueSensor", "bias", self.bias, (), ("n",)).tolist()
        object.__setattr__(self, "bias", tuple(bias) if isinstance(bias, list) else bias)


@dataclass(frozen=True, kw_only=True)
class _Effects:
    delay: float = 0.0
    jitter: float = 0.0
    sensor_delay: int = 0
    noise: Mapping[str, float] = field(default_factory=dict)
    resolution: Mapping[str, float] = field(default_factory=dict)
    rate_limit: float = inf
    torque_sensor: TorqueSensor | None = None
    seed: int = 0


@bordered
@sealed
@dataclass(frozen=True)
class Sampling(_Effects):
    """How a law is sampled, in place of a plain `sample_time`.

    Sample `k` is taken at `k period + j`, `j` uniform in [0, jitter]; the law sees what was measured `sensor_delay` samples before, with
    noise and in steps of the resolution; its answer acts `delay` later and is then held. Random numbers depend on the seed, the sample
    and the channel alone: the same seed gives the same run, and row i of a batch is the run with seed + i.

    Args:
        period: time between samples, s.
        delay: from a sample to the moment its answer acts, s; a fixed-step method needs a multiple of its step.
        jitter: largest lateness of a sample, s, below the period; a fixed-step method rounds it down to its steps.
        sensor_delay: samples between what is measured and what the law sees.
        noise: standard deviation of a measured quantity, by name: "q", "v", "theta", "theta_dot".
        resolution: step of a measured quantity, by name, such as 2 pi / 2**14 of an encoder.
        rate_limit: largest change of the input per second, N m/s, from no input before the first sample.
        torque_sensor: `TorqueSensor` of an elastic arm, in place of encoders of the links.
        seed: integer >= 0.

    Raises:
        InputError: an argument is no number, a quantity's name is unknown; the rest is checked where it is used.

    >>> import armlet as al
    >>> al.Sampling(1e-3, delay=5e-4, noise={"v": 0.01}, seed=3).delay
    0.0005
    """

    period: float

    def __post_init__(self) -> None:
        instance("Sampling", "torque_sensor", self.torque_sensor, (TorqueSensor, NoneType), "a TorqueSensor or None")
        for name in ("period", "delay", "jitter", "rate_limit"):
            object.__setattr__(self, name, number("Sampling", name, getattr(self, name)))
        for name in ("sensor_delay", "seed"):
            object.__setattr__(self, name, integer("Sampling", name, getattr(self, name)))
        for name in ("noise", "resolution"):
            given = instance("Sampling", name, getattr(self, name), Mapping, "numbers by quantity, such as {'q': 1e-3}")
            unknown = [key for key in given if not isinstance(key, str) or key not in CHANNELS]
            if unknown:
                names = ", ".join(CHANNELS)
                raise InputError(f"Sampling: {name} has an unknown quantity: expected some of {names}, got {shown(unknown[0])}")
            object.__setattr__(self, name, {key: number("Sampling", f"{name}[{key!r}]", x) for key, x in given.items()})
