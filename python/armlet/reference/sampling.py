"""A sampled law, simulated event by event. The events are samples, and the later times at which their torques begin to act.

    sample k at t_k = k T + j_k,  j_k uniform in [0, jitter];   x_m = round((x + sigma w_k)/step) step
    the law uses x_m of sample k - sensor_delay;  |tau_k - tau_(k-1)| <= rate_limit (t_k - t_(k-1));  tau_k acts from t_k + delay
    torque sensor: dtau_f/dt = w_c (tau_J - tau_f), tau_J linear between samples;  q_m = theta_m - K_law^-1 reading

T is the period. Rates of the law's state act from t_k on. A momentum observer integrates the torque that acts. With fixed steps, j_k is
rounded down to a multiple of the step. x_m is the measurement of a quantity x with the noise sigma and the resolution step, and w_k is a
standard normal number. tau_J is the joint torque, tau_f its filtered value, w_c the bandwidth of the filter, and K_law the joint stiffness
of the law. Random numbers are splitmix64 (Steele, Lea and Flood 2014) of the seed and of the integers k and channel, modulo 2^64. Normal
numbers come from the method of Box and Muller (1958), as a complex exponential. Entry i of q, v, theta, theta_dot has the channels 4 i + 0,
1, 2, 3.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, solve
from .law import Terms

NAMES = ("q", "v", "theta", "theta_dot")
# Two times whose difference, in periods, is smaller than this are the same instant.
ON_TIME = 1e-9
JITTER = 2**64 - 1
TORQUE = 2**32


class TorqueSensor(NamedTuple):
    """A joint-torque sensor: standard deviation, bias (scalar or (n,)) and resolution, N m or N, and bandwidth of its filter, rad/s."""

    noise: float = 0.0
    bias: ArrayLike = 0.0
    resolution: float = 0.0
    bandwidth: float = np.inf


class Sampling(NamedTuple):
    """The sampling of a law: period, delay and jitter, s; noise and resolution by quantity; the largest rate of the input, per s."""

    period: float
    delay: float = 0.0
    jitter: float = 0.0
    sensor_delay: int = 0
    noise: Mapping[str, float] = {}
    resolution: Mapping[str, float] = {}
    rate_limit: float = np.inf
    torque_sensor: TorqueSensor | None = None
    seed: int = 0


def uniform(seed: int, k: int, channel: int) -> float:
    """The random number in [0, 1) for sample k and a channel."""
    z = seed
    for word in (k, channel):
        z = (z + 0x9E3779B97F4A7C15 + word * 0xD1342543DE82EF95) % 2**64
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB % 2**64
        z ^= z >> 31
    return (z >> 11) / 2.0**53


def gaussian(seed: int, k: int, channel: int) -> float:
    """The standard normal random number for sample k and a channel, from two uniform ones."""
    radius, turn = uniform(seed, k, 2 * channel), uniform(seed, k, 2 * channel + 1)
    return float((np.sqrt(-2.0 * np.log1p(-radius)) * np.exp(2j * np.pi * turn)).real)


def rounded(x: Array, step: float) -> Array:
    """Round x to multiples of step, and halves away from zero. With step 0 the result is x."""
    return x if step == 0.0 else np.copysign(np.floor(np.abs(x) / step + 0.5) * step, x)


def lag(state: Array, before: Array, now: Array, turn: float) -> Array:
    """The value y(1) of dy/dx = turn (u - y) with y(0) = state. u changes linearly from `before` at x = 0 to `now` at x = 1.

    y, u and du/dx are a linear system. Scaling and squaring of a Taylor series computes the exponential of its 3 x 3 matrix.
    """
    if not np.isfinite(turn):
        return now
    A = np.array([[-turn, turn, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    halvings = max(0, int(np.ceil(np.log2(turn + 1.0))) + 2)
    total = term = np.eye(3)
    for k in range(1, 20):
        term = term @ A / (k * 2.0**halvings)
        total = total + term
    for _ in range(halvings):
        total = total @ total
    y: Array = total[0] @ np.stack([state, before, now - before])
    return y


class Clock:
    """The samples of one run. `visit` must be called at time 0 and at all `instants`, in the order of time.

    `grid` is the step of a method with fixed steps, s, or 0 for adaptive methods. Jitter is rounded down to a multiple of this step.
    `stiffness` is the joint stiffness of the plant, and `believed` the joint stiffness of the law, for torque sensors.
    `observed` are the components of the law's state that integrate the torque.
    """

    def __init__(
        self, sampling: Sampling, n: int, grid: float, silent: Terms, stiffness: Array, believed: Array, observed: slice | None
    ) -> None:
        self.sampling, self.n, self.grid, self.observed = sampling, n, grid, observed
        self.stiffness, self.believed = stiffness, believed
        self.acting, self.taken = silent, 0
        self.last, self.tau = silent, silent["tau"]
        self.measured: list[Array] = []
        self.pending: list[tuple[float, Array]] = []
        self.tau_before: Array = np.zeros(n)
        self.torque: Array = np.zeros(n)
        self.filtered: Array = np.zeros(n)

    def instant(self, k: int) -> float:
        """The time of sample k."""
        late = self.sampling.jitter * uniform(self.sampling.seed, k, JITTER)
        return k * self.sampling.period + (np.floor(late / self.grid) * self.grid if self.grid else late)

    def instants(self, t_end: float) -> list[float]:
        """All times in (0, t_end) at which a sample is taken or its torque begins to act."""
        samples = [self.instant(k) for k in range(int(np.ceil(t_end / self.sampling.period)) + 1)]
        times = sorted({t for s in samples for t in (s, s + self.sampling.delay) if 0.0 < t < t_end})
        return [t for k, t in enumerate(times) if k == 0 or t - times[k - 1] > ON_TIME * self.sampling.period]

    def visit(self, t: float, x: Array, law: Callable[[Array], Terms]) -> Terms:
        """Take each sample whose time is at most t, of the plant state x. Return the terms of the law that act on the plant at t.

        `law(measured)` evaluates the law at a measured state. It returns the terms of the law, such as `tau`, with `tau` clipped.
        """
        slack = ON_TIME * self.sampling.period
        while self.instant(self.taken) <= t + slack:
            self._take(t, x, law)
        while self.pending and self.pending[0][0] <= t + slack:
            self.tau = self.pending.pop(0)[1]
        rates = self.last["state_rate"].copy()
        if self.observed is not None:
            rates[self.observed] += self.tau - self.last["tau"]
        self.acting = self.last | {"tau": self.tau, "state_rate": rates}
        return self.acting

    def _take(self, t: float, x: Array, law: Callable[[Array], Terms]) -> None:
        s, k = self.sampling, self.taken
        since = self.instant(k) - self.instant(k - 1) if k else s.period
        self.measured.append(self._measure(k, x, since))
        answer = law(self.measured[max(0, k - s.sensor_delay)])
        most = s.rate_limit * since
        self.tau_before = np.clip(answer["tau"], self.tau_before - most, self.tau_before + most)
        self.last = answer
        self.pending.append((self.instant(k) + s.delay, self.tau_before))
        self.taken += 1

    def _measure(self, k: int, x: Array, since: float) -> Array:
        s, parts = self.sampling, x.reshape(-1, self.n).copy()
        # The state of LuGre friction, which is last, is not measured.
        for channel, (name, part) in enumerate(zip(NAMES, parts, strict=False)):
            sigma = s.noise.get(name, 0.0)
            noise = [sigma * gaussian(s.seed, k, 4 * i + channel) for i in range(self.n)] if sigma else 0.0
            part[:] = rounded(part + noise, s.resolution.get(name, 0.0))
        if s.torque_sensor is not None:
            torque = self.stiffness @ (x[2 * self.n : 3 * self.n] - x[: self.n])
            parts[0] = parts[2] - solve(self.believed, self._read(s.torque_sensor, k, torque, since))
        return parts.ravel()

    def _read(self, sensor: TorqueSensor, k: int, torque: Array, since: float) -> Array:
        """A reading of the torque sensors, (n,), N m or N. The filters start in their steady state."""
        self.filtered = lag(self.filtered, self.torque, torque, sensor.bandwidth * since) if k else torque
        self.torque = torque
        noise = np.array([sensor.noise * gaussian(self.sampling.seed, k, TORQUE + i) for i in range(self.n)])
        return rounded(self.filtered + np.asarray(sensor.bias) + noise, sensor.resolution)
