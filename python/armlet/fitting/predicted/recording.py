"""A log as the prediction fit uses it: measurements, torques between the samples, filtered velocities, and the noise of the encoders."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...logs.filters import interpolated, low_pass_rates
from ...logs.log import Log
from ..samples import CUTOFF, ORDER, SHARE
from .innovations import Noise, kalman_gain, memory_of
from .inputs import Piece, pieces_of, without_gaps
from .plant_numbers import PlantNumbers
from .transitions import Motion, transitions

__all__ = ["PredictedLog", "predicted_log"]

Array = NDArray[np.float64]

#: Intervals longer than this number of periods end the prediction, and the observer starts again.
LONG = 5.5
#: Standard deviation of torques on elastic links relative to those of the motors.
LINKS = 0.1
#: A joint may stick below this fraction of the root mean square of its velocity.
STUCK = 0.03


@dataclass(frozen=True)
class PredictedLog:
    """A log of K samples: times, measurements (K, y) with the rows `C`, and filtered states, (K, d).

    `acceleration` is that of the driven sides of the joints, (K, n), from filtered positions.
    `sign` are the mean signs of the velocities in the intervals, (K - 1, n), and `encoder` the deviations of the measurements, (y,).
    `slow` marks the samples at which a joint may stick, (K,): the friction of such a joint is unknown.
    """

    log: Log
    t: Array
    y: Array
    C: Array
    states: Array
    acceleration: Array
    sign: Array
    encoder: Array
    records: tuple[Array, Array]
    restarts: NDArray[np.intp]
    slow: NDArray[np.bool_]
    period: float
    held: bool

    def pieces(self, delay: float, moving: bool) -> list[Piece]:
        """The constant torques between the samples."""
        return pieces_of(self.t, self.records, delay, self.held, moving)

    def smooth_piece(self, motion: Motion) -> Piece:
        """The torque of the filtered motion in each interval, without the noise of the recorded torque."""
        torque = motion.torque(self.states, self.acceleration, np.concatenate([self.sign, self.sign[-1:]]))
        length = np.diff(self.t)
        return Piece(length, 0.5 * (torque[1:] + torque[:-1]), None, -np.diff(torque, axis=0) / length[:, None])

    def begin(self, count: int) -> PredictedLog:
        """The first `count` samples."""
        if count >= len(self.t):
            return self
        restarts = self.restarts[self.restarts < count - 1]
        return replace(
            self, t=self.t[:count], y=self.y[:count], states=self.states[:count], acceleration=self.acceleration[:count],
            sign=self.sign[: count - 1], slow=self.slow[:count], restarts=restarts,
        )  # fmt: skip

    def smooth(self, margin: float) -> NDArray[np.bool_]:
        """The samples at least `margin`, s, from the ends of the log and from gaps, so that their filtered motion is exact: (K,)."""
        smooth: NDArray[np.bool_] = (self.t >= self.t[0] + margin) & (self.t <= self.t[-1] - margin)
        for gap in self.restarts:
            smooth &= (self.t <= self.t[gap] - margin) | (self.t >= self.t[gap + 1] + margin)
        return smooth

    def used(self, memory: float) -> NDArray[np.bool_]:
        """The samples at which the observer has forgotten its start and what happened while a joint was slow: (K,)."""
        wait = int(np.ceil(7.0 * memory))
        after = min(int(np.ceil(2.0 * memory)), 50)
        reached = np.cumsum(np.concatenate([np.zeros(after + 1), self.slow]))
        used: NDArray[np.bool_] = reached[after + 1 :] == reached[: -after - 1]
        for begin in [0, *(self.restarts + 1).tolist()]:
            used[begin : begin + wait] = False
        return used


def predicted_log(log: Log, numbers: PlantNumbers, cutoff: float | None, held: bool) -> PredictedLog:
    """Prepare a log. `cutoff`, Hz, belongs to the filter of the velocities whose sign is that of Coulomb friction."""
    assert log.tau is not None
    period = log.report.period
    even = log.resample(period)
    frequency = min(CUTOFF, SHARE / period) if cutoff is None else cutoff
    n = numbers.n

    def rates(values: Array) -> tuple[Array, Array, Array]:
        q, v, a = (interpolated(log.t, even.t, each) for each in low_pass_rates(values, period, frequency, ORDER))
        return q, v, a

    q, v, a = rates(even.q)
    states, y = [q, v], [log.q]
    if numbers.elastic:
        if even.theta is not None and log.theta is not None:
            theta, theta_dot, a_motor = rates(even.theta)
            y.append(log.theta)
        else:
            stiffness = numbers.start[numbers.places["stiffness"]]
            theta = q + numbers.arm.inverse_dynamics(q, v, a) / stiffness
            theta_dot = np.gradient(theta, log.t, axis=0)
            a_motor = np.gradient(theta_dot, log.t, axis=0)
        states += [theta, theta_dot]
        a = a_motor
    measured = np.concatenate(y, axis=1)
    size = sum(each.shape[1] for each in states)
    C = np.zeros((measured.shape[1], size))
    C[:n, :n] = np.eye(n)
    if len(y) > 1:
        C[n:, 2 * n : 3 * n] = np.eye(n)
    # Third differences of white noise have 20 times its variance. Their median is robust to jumps.
    differences = np.abs(np.diff(measured, 3, axis=0))
    spread = np.maximum(np.median(differences, axis=0) / 0.6745 / np.sqrt(20.0), 1e-9 * (1.0 + np.ptp(measured, axis=0)))
    restarts = np.flatnonzero(np.diff(log.t) > LONG * period)
    rubs = "coulomb" in numbers.kinds or np.any(numbers.start[numbers.places["coulomb"]])
    speed = states[-1]
    slow = np.any(np.abs(speed) < STUCK * np.sqrt(np.mean(speed**2, axis=0)), axis=1) & bool(rubs)
    return PredictedLog(
        log, log.t, measured, C, np.concatenate(states, axis=1), a, _signs(speed), spread, without_gaps(log.t, log.tau, period),
        restarts, slow, period, held,
    )  # fmt: skip


def _signs(speed: Array) -> Array:
    """The mean sign of velocities that are linear between samples, (K - 1, n)."""
    before, after = speed[:-1], speed[1:]
    change = after - before
    same = np.sign(before) == np.sign(after)
    return np.where(same, np.sign(before), (np.abs(after) - np.abs(before)) / np.where(change == 0.0, 1.0, change))


class Observer:
    """The mean linear system of a log and its gain, which depends on one number per joint.

    The number is the tracking index `s T^2 / (m r)`. `s` and `r` are the deviations of the noise of the torque and of the encoder, and `m`
    is the inertia of the joint.
    """

    def __init__(self, log: PredictedLog, motion: Motion, beta_delay: float) -> None:
        some = np.linspace(0, len(log.t) - 2, 200).astype(int)
        x = log.states[:-1][some]
        period = np.full(len(some), log.period)
        torque = log.pieces(beta_delay, False)[-1].torque[some]
        self.Phi: Array = transitions(motion, x, [Piece(period, torque)], log.sign[some]).Phi.mean(axis=0)
        J = motion.slopes(x, torque, log.sign[some])[1]
        motors, links = (log.period * (each + 0.5 * log.period * (J @ each)) for each in motion.inputs(x))
        self.B: Array = motors.mean(axis=0)
        self.links: Array = links.mean(axis=0)
        self.log, self.C, n = log, log.C, motion.n
        row = 2 * n if motion.numbers.elastic else 0
        #: Change of each joint's position in a sample by a unit torque.
        self.reach = np.maximum(np.abs(np.diag(self.B[row : row + n])), 1e-300)
        self.elastic = motion.numbers.elastic

    def gain(self, index: Array) -> Array:
        """The gain for the tracking indices of the joints, (n,)."""
        encoder = self.log.encoder
        n = len(index)
        strength = index * encoder[-n:] / (2.0 * self.reach)
        Q = (self.B * strength**2) @ self.B.T
        if self.elastic:
            Q += (self.links * (LINKS * strength) ** 2) @ self.links.T
        return kalman_gain(self.Phi, self.C, Noise(Q, np.diag(encoder**2)))

    def memory(self, L: Array) -> float:
        """The memory of the observer, in samples."""
        return memory_of(self.Phi, self.C, L)
