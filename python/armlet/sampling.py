"""A controller on a clock that is late, sees badly or moves slowly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

from .errors import InputError

__all__ = ["Sampling"]

CHANNELS = ("q", "v", "theta", "theta_dot")


@dataclass(frozen=True, kw_only=True)
class _Effects:
    delay: float = 0.0
    jitter: float = 0.0
    sensor_delay: int = 0
    noise: Mapping[str, float] = field(default_factory=dict)
    resolution: Mapping[str, float] = field(default_factory=dict)
    rate_limit: float = inf
    seed: int = 0


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
        rate_limit: largest change of the input per second, N m/s.
        seed: integer >= 0.

    Raises:
        InputError: a quantity's name is unknown; the rest is checked where it is used.

    >>> import armlet as al
    >>> al.Sampling(1e-3, delay=5e-4, noise={"v": 0.01}, seed=3).delay
    0.0005
    """

    period: float

    def __post_init__(self) -> None:
        for name in ("noise", "resolution"):
            unknown = [key for key in getattr(self, name) if key not in CHANNELS]
            if unknown:
                raise InputError(f"Sampling: {name} has an unknown quantity: expected some of {', '.join(CHANNELS)}, got {unknown[0]!r}")
