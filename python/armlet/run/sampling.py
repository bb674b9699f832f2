"""Descriptions of sampled controllers: period, jitter, delay, noise, quantisation, rate limit and joint-torque sensors."""

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

__all__ = ["Sampling", "TorqueSensor", "period_of"]

CHANNELS = ("q", "v", "theta", "theta_dot")


@bordered
@sealed
@dataclass(frozen=True, kw_only=True)
class TorqueSensor:
    """The joint-torque sensors of an elastic arm in a sampled loop, `Sampling(torque_sensor=...)`.

    `dtau_f/dt = w_c (tau_J - tau_f)`, `reading = round((tau_f + bias + noise)/resolution) resolution`, with `tau_J = K (theta - q)` for the
    joint stiffness `K` of the plant. The law computes the link positions from the reading and the motors' encoders, as on light-weight
    arms: `q = theta - K_l^-1 reading`. `K_l` is the joint stiffness of the law, so the joint torque that the law uses is the reading. The
    filters start in their steady state. They are exact for a torque that is linear between samples.

    Args:
        noise: standard deviation of the noise, N m or N.
        bias: constant error of the reading, N m or N, scalar or (n,).
        resolution: resolution of the reading, N m or N; 0 for an exact reading.
        bandwidth: bandwidth `w_c` of the first-order filter, rad/s; infinite for no filter.

    Raises:
        InputError: an argument is not a number. `simulate` also raises it for a wrong sign, a number that is not finite, or a plant
            without elastic joints.

    Source: docs/elastic.md.

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
    """Sampling of a law with delay, jitter, noise, resolution and a rate limit, for the argument `sample_time` of `simulate`.

    The law is sampled at the times `k period + j`, with `j` uniform in [0, jitter]. The law receives the measurement of `sensor_delay`
    samples before, with noise and rounded to the resolution. Its output acts `delay` later, and is then held until the next output acts.
    Random numbers depend only on the seed, the sample, the measured quantity and the joint. So the same seed repeats the run, and row i of
    a batch is the run with `seed + i`.

    Args:
        period: time between samples, s.
        delay: time from a sample until its output acts, s; a multiple of the step for a fixed-step method. The law's state changes at the
            sample.
        jitter: largest lateness of a sample, s, below the period. With a fixed-step method, each lateness is rounded down to a multiple of
            the step.
        sensor_delay: number of samples between the measurement and its use in the law.
        noise: standard deviations by measured quantity: "q" and "theta" in rad or m, "v" and "theta_dot" in rad/s or m/s. The plant
            must have these quantities among its states.
        resolution: resolutions by measured quantity, in its unit, such as 2 pi / 2**14 rad of an encoder.
        rate_limit: largest rate of change of the input, N m/s or N/s, under velocity control rad/s^2 or m/s^2. The rate limiter starts at
            zero input.
        torque_sensor: the `TorqueSensor` of an elastic arm, in place of encoders of the links.
        seed: seed of the random numbers, an integer >= 0.

    Raises:
        InputError: an argument is not a number, or a quantity's name is unknown. `simulate` checks the other conditions.

    Source: docs/plants_and_laws.md.

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


def period_of(sample_time: float | Sampling | None) -> float | bool:
    """The sample period of a loop, s; False for a continuous loop."""
    if sample_time is None:
        return False
    return float(sample_time.period if isinstance(sample_time, Sampling) else sample_time)
