"""The loop of a plant and a law, and its linear model about a state, in continuous time and at samples.

    rigid     x = [q, v]                    q' = v,  v' = M^-1 (u - C v - g - tau_f)
    elastic   x = [q, v, theta, theta_dot]  v' = M^-1 (tau_J - C v - g),  B theta_ddot + F theta_dot + tau_J = u,
                                            tau_J = K (theta - q) + D (theta_dot - v)
    velocity  x = [q]                       q' = u

`'` is the derivative. `tau_f` is the friction of `RigidArm(friction=True)`, otherwise zero. `B` and `F` are inertia and viscous friction of
the motors, `K` and `D` stiffness and damping of the joints. In a closed loop, `u = law(t, x) + d` with a disturbance `d`. The state of
the law is the last part of x: adaptive estimates, integrals, and states of filters and observers.

The linear system about `(x0, u0)` has the derivatives of x' with respect to x and u. For an arm with frames they are exact (Carpentier and
Mansard 2018), and so are the derivatives of a law. Derivatives of a closed-form arm (`pendulum`, `planar_pr`) and of a law
that branches on its data (`PriorityVelocity`, `PriorityAcceleration`) are five-point differences
`f' = (f(-2h) - 8 f(-h) + 8 f(h) - f(2h)) / (12 h)`.

A sampled law holds its output over the period h. Its output acts with a delay of m periods and f seconds, 0 <= f < h:

    x_k+1 = e^(A h) x_k + e^(A (h - f)) G(f) u_k-m-1 + G(h - f) u_k-m,   G(t) = int_0^t e^(A s) ds B,   z_k+1 = z_k + h z'(x_k, z_k)

The past inputs are further states (Franklin, Powell and Workman, Digital Control of Dynamic Systems, section 4.3).
"""

from __future__ import annotations

from collections.abc import Callable
from math import floor, inf, isfinite
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import Arm, ElasticArm, Guarded, Law, Plant, RigidArm
from .arguments import finite, number
from .errors import InputError
from .friction_models import LuGre, StickSlip
from .run.sampling import Sampling
from .run.simulation import simulate

__all__ = ["LinearLoop"]

Array: TypeAlias = NDArray[np.float64]

#: Step h of the five-point difference, for numbers of magnitude 1. The truncation error h^4 is 1e-12, and the rounding error eps / h is
#: about 2e-13.
STEP = 1e-3
#: A delay within this part of a period of a multiple of the period is this multiple.
ON_TIME = 1e-9
#: The largest number of periods of a delay. Each adds n or more states.
MOST_LATE = 1000


class LinearLoop:
    """A plant with a law or without one, for the function of this name in messages."""

    def __init__(self, function: str, plant: Any, law: Any) -> None:
        if not isinstance(plant, Plant | Arm):
            raise InputError(f"{function}: plant is of the wrong type: expected a plant or an arm, got {type(plant).__name__}")
        plant = RigidArm(plant) if isinstance(plant, Arm) else plant
        if law is not None and not isinstance(law, Law):
            raise InputError(f"{function}: law is of the wrong type: expected a law or None, got {type(law).__name__}")
        made = plant.__getnewargs_ex__()[1]
        if made.get("wall") is not None:
            raise InputError(f"{function}: plant has a wall: expected a plant without a wall, because the force of a wall is not smooth")
        if made.get("stops") is not None:
            raise InputError(f"{function}: plant has joint stops: expected a plant without stops, because their torques are not smooth")
        for name in ("friction", "motor_friction"):
            if isinstance(made.get(name), LuGre | StickSlip):
                raise InputError(
                    f"{function}: plant has dry friction: expected {name} without a {type(made[name]).__name__}, which is not smooth"
                )
        self.function, self.plant, self.law, self.arm, self.n = function, plant, law, plant.arm, plant.arm.n
        n, self.friction = self.n, bool(made.get("friction"))
        parts = plant._parts
        self.elastic, self.velocity = "theta" in parts, "v" not in parts
        if law is not None:
            try:
                # If plant and law cannot form a loop, this call raises the error of `simulate`.
                simulate(plant, law, np.zeros(n), t_end=0.0, dt=1e-3, check_limits=False)
            except InputError as error:
                raise InputError(f"{function}: {str(error).partition(': ')[2]}") from None
        if isinstance(plant, ElasticArm):
            self.K, self.B = (_matrix(function, made[name], n) for name in ("stiffness", "motor_inertia"))
            self.D, self.F = (
                _matrix(function, 0.0 if made.get(name) is None else made[name], n) for name in ("joint_damping", "motor_friction")
            )
            self.motor_gain = np.linalg.inv(self.B)
        self.m = len(parts) * n
        self.p = 0
        if law is not None:
            self.p = len(self._start(np.zeros(self.m)))
        self.states = [f"{part}{i + 1}" for part in parts for i in range(n)] + [f"estimate{i + 1}" for i in range(self.p)]
        drive = "u" if self.velocity else "tau"
        self.inputs = [f"{drive if law is None else 'd'}{i + 1}" for i in range(n)]
        self.outputs = self.states + ([] if law is None else [f"{drive}{i + 1}" for i in range(n)])
        self.name = type(plant).__name__ if law is None else f"{type(law).__name__} on {type(plant).__name__}"

    def _given(self, x: Array) -> tuple[tuple[Array, Array], dict[str, Any]]:
        """The positional and keyword arguments of a law for the state x."""
        n = self.n
        motors = {"theta": x[2 * n : 3 * n], "theta_dot": x[3 * n : 4 * n]} if self.elastic else {}
        return (x[:n], np.zeros(n) if self.velocity else x[n : 2 * n]), motors | ({"state": x[self.m :]} if self.p else {})

    def _start(self, x: Array) -> Array:
        """The law's state at the start of a run from the plant's state x."""
        if self.law is None:
            return np.zeros(0)
        state, others = self._given(x[: self.m])
        others.pop("state", None)
        start: Array = self.law.terms(0.0, *state, **others).get("state", np.zeros(0))
        return start

    def _law(self, t: float, x: Array) -> tuple[Array, Array]:
        """The output of the law, which is the plant's input, and the rate of the law's state."""
        if self.law is None:
            return np.zeros(self.n), np.zeros(0)
        state, others = self._given(x)
        rate = self.law.terms(t, *state, **others)["state_rate"] if self.p else np.zeros(0)
        return self.law(t, *state, **others), rate

    def rates(self, t: float, x: Array, u: Array) -> Array:
        n, (tau, rate) = self.n, self._law(t, x)
        tau = tau + u
        if self.velocity:
            return np.concatenate([tau, rate])
        q, v = x[:n], x[n : 2 * n]
        if not self.elastic:
            return np.concatenate([v, self.arm.forward_dynamics(q, v, tau, friction=self.friction), rate])
        theta, theta_dot = x[2 * n : 3 * n], x[3 * n : 4 * n]
        tau_J = self.K @ (theta - q) + self.D @ (theta_dot - v)
        motor = self.motor_gain @ (tau - self.F @ theta_dot - tau_J)
        return np.concatenate([v, self.arm.forward_dynamics(q, v, tau_J), theta_dot, motor, rate])

    def output(self, t: float, x: Array) -> Array:
        return x if self.law is None else np.concatenate([x, self._law(t, x)[0]])

    def state(self, x0: ArrayLike) -> Array:
        """The whole state. If `x0` is only q, add velocities of zero, motor positions at equilibrium, and the law's initial state."""
        n = self.n
        given = finite(self.function, "x0", _core.numbers(self.function, "x0", x0, *dict.fromkeys([(n,), (self.m + self.p,)])))
        if len(given) == self.m + self.p:
            return given
        x = np.zeros(self.m + self.p)
        x[:n] = given
        if self.elastic:
            x[2 * n : 3 * n] = given + np.linalg.solve(self.K, self.arm.gravity(given))
        x[self.m :] = self._start(x)
        return x

    def input(self, t: float, x: Array, u0: ArrayLike | None) -> Array:
        """The plant's input about which the plant is linearised, (n,)."""
        n = self.n
        if self.law is not None:
            return self._law(t, x)[0]
        if u0 is not None:
            return finite(self.function, "u0", _core.numbers(self.function, "u0", u0, (n,)))
        return np.zeros(n) if self.velocity else np.asarray(self.arm.bias(x[:n], x[n : 2 * n], friction=self.friction))

    def slopes(self, t: float, x: Array) -> Array:
        """The derivatives of the law's output and of the rate of its state with respect to x, (n + p, states)."""
        if self.law is None:
            return np.zeros((self.n, len(x)))
        state, others = self._given(x)
        exact = self.law._slope(t, *state, **others)
        return _slope(lambda x: np.concatenate(self._law(t, x)), x) if exact is None else exact

    def cut(self, t: float, x: Array, u0: ArrayLike | None = None) -> tuple[Array, Array, Array]:
        """Matrices of the loop that is cut at the plant's input w: x' = A x + B w, and the law's output C x."""
        m, slope = self.m, self.slopes(t, x)
        A, B = np.zeros((len(x), len(x))), np.zeros((len(x), self.n))
        A[:m, :m], B[:m] = self._open(x, self.input(t, x, u0))
        A[m:] += slope[self.n :]
        return A, B, slope[: self.n]

    def cut_at_samples(self, t: float, x: Array, sampling: Sampling, u0: ArrayLike | None = None) -> tuple[Array, Array, Array]:
        """As `cut`, but from sample to sample: x_k+1 = A x_k + B w_k. The states of delays follow the states of the loop."""
        n, m, h, s = self.n, self.m, sampling.period, sampling.sensor_delay
        slope = self.slopes(t, x)
        plant, drive = self._open(x, self.input(t, x, u0))
        whole, rest = delay_of(sampling)
        onward, now = held(plant, drive, h - rest)  # while the newest input that acts in this period acts
        before = onward @ held(plant, drive, rest)[1]  # of the input before it
        inputs = len(x) + n * (whole + (rest > 0.0))  # the first state after those of past inputs
        count = inputs + s * m
        A, B, C = np.zeros((count, count)), np.zeros((count, n)), np.zeros((n, count))
        A[:m, :m] = held(plant, drive, h)[0]
        for late, part in ((whole, now), (whole + 1, before)):
            if late == 0:
                B[:m] += part
            elif part.any():
                first = len(x) + (late - 1) * n
                A[:m, first : first + n] += part
        measured = slice(0, m) if s == 0 else slice(count - m, count)
        for to, rows, scale in ((A[m : len(x)], slope[n:], h), (C, slope[:n], 1.0)):
            to[:, measured] += scale * rows[:, :m]
            to[:, m : len(x)] += scale * rows[:, m:]
        A[m : len(x), m : len(x)] += np.eye(self.p)
        for first, end, size in ((len(x), inputs, n), (inputs, count, m)):
            A[first + size : end, first : end - size] += np.eye(max(end - first - size, 0))
        B[len(x) : inputs][:n] = np.eye(n) if inputs > len(x) else 0.0
        A[inputs:count][:m, :m] = np.eye(m) if s else 0.0
        if not np.isfinite(A).all():
            raise InputError(f"{self.function}: sample_time gives numbers that are not finite: expected a shorter period, got {h!r}")
        return A, B, C

    def past(self, sampling: Sampling) -> list[str]:
        """The names of the states of delays."""
        drive, (whole, rest) = "u" if self.velocity else "tau", delay_of(sampling)
        late = [f"{drive}{i + 1}_past{k + 1}" for k in range(whole + (rest > 0.0)) for i in range(self.n)]
        return late + [f"{name}_past{k + 1}" for k in range(sampling.sensor_delay) for name in self.states[: self.m]]

    def linear(self, t: float, x: Array, u0: ArrayLike | None, sampling: Sampling | None = None) -> tuple[Array, Array, Array, Array]:
        """Matrices A, B, C, D of the closed loop, or of the plant without a law. The outputs are the states and the law's output."""
        A, B, C = self.cut(t, x, u0) if sampling is None else self.cut_at_samples(t, x, sampling, u0)
        if self.law is None:
            return A, B, np.eye(len(A)), np.zeros((len(A), self.n))
        return A + B @ C, B, np.concatenate([np.eye(len(A)), C]), np.zeros((len(A) + self.n, self.n))

    def _open(self, x: Array, u: Array) -> tuple[Array, Array]:
        """Matrices A, (m, m), and B, (m, n), of the plant alone."""
        n, one = self.n, np.eye(self.n)
        if self.velocity:
            return np.zeros((n, n)), one
        q, v = x[:n], x[n : 2 * n]
        if not self.elastic:
            return self._links(q, v, u)
        theta, theta_dot = x[2 * n : 3 * n], x[3 * n : 4 * n]
        links, push = self._links(q, v, self.K @ (theta - q) + self.D @ (theta_dot - v))
        spring = np.concatenate([-self.K, -self.D, self.K, self.D], axis=1)  # derivative of tau_J with respect to x
        A, B = np.zeros((4 * n, 4 * n)), np.zeros((4 * n, n))
        A[: 2 * n, : 2 * n] = links
        A[: 2 * n] += push @ spring
        A[2 * n : 3 * n, 3 * n :] = one
        A[3 * n :] = -self.motor_gain @ spring
        A[3 * n :, 3 * n :] -= self.motor_gain @ self.F
        B[3 * n :] = self.motor_gain
        return A, B

    def _links(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """Matrices A, (2 n, 2 n), and B, (2 n, n), of the rigid arm."""
        if self.arm.frame_names:
            A, B = self.arm.linearize(q, v, tau, friction=self.friction)
            return A, B
        # A closed-form arm has no method `linearize`, so its derivatives are differences.
        slope = _slope(lambda x: self.arm.forward_dynamics(*np.split(x, 3)), np.concatenate([q, v, tau]))
        whole = np.concatenate([np.eye(self.n, 3 * self.n, self.n), slope])
        return whole[:, : 2 * self.n], whole[:, 2 * self.n :]


def _matrix(function: str, value: ArrayLike, n: int) -> Array:
    given = _core.numbers(function, "plant", value)
    return given if given.ndim == 2 else np.diag(np.broadcast_to(given, (n,)))


def _slope(f: Callable[[Array], Array], x: Array) -> Array:
    """The derivative df/dx by five-point differences, one column per entry of x."""
    columns = []
    for i in range(len(x)):
        h = STEP * max(1.0, abs(float(x[i])))
        step = np.zeros_like(x)
        step[i] = h
        columns.append((f(x - 2 * step) - 8 * f(x - step) + 8 * f(x + step) - f(x + 2 * step)) / (12 * h))
    return np.stack(columns, axis=1)


def sampling_of(function: str, sample_time: Any, law: Any) -> Sampling | None:
    """The sampling with a linear model, from a period in seconds or a `Sampling`; None for a continuous loop."""
    if sample_time is None:
        return None
    sampling = sample_time if isinstance(sample_time, Sampling) else Sampling(number(function, "sample_time", sample_time))
    if not (isfinite(sampling.period) and sampling.period > 0.0 and isfinite(1.0 / sampling.period)):
        raise InputError(f"{function}: sample_time is not positive: expected a period > 0 s, got {sampling.period!r}")
    for name in ("delay", "sensor_delay"):
        value = getattr(sampling, name)
        if not value >= 0.0:
            raise InputError(f"{function}: {name} is negative: expected a number >= 0, got {value!r}")
    late = sampling.delay / sampling.period + sampling.sensor_delay
    if not late <= MOST_LATE:
        raise InputError(f"{function}: delay is too long: expected at most {MOST_LATE} periods, got {late!r}")
    if sampling.jitter != 0.0 or sampling.rate_limit != inf or sampling.torque_sensor is not None:
        without = "jitter, rate_limit and torque_sensor"
        raise InputError(f"{function}: sample_time has no linear model: expected a Sampling without {without}, got {sampling!r}")
    if isinstance(law, Guarded):
        raise InputError(f"{function}: law has an observer that depends on the period: expected the law inside of Guarded")
    return sampling


def delay_of(sampling: Sampling) -> tuple[int, float]:
    """The delay of the output as whole periods, and the rest in s."""
    whole = floor(sampling.delay / sampling.period + ON_TIME)
    rest = sampling.delay - whole * sampling.period
    return whole, rest if rest > ON_TIME * sampling.period else 0.0


def held(A: Array, B: Array, t: float) -> tuple[Array, Array]:
    """e^(A t) and G(t) = int_0^t e^(A s) ds B: the response to a constant input.

    They are blocks of the exponential of [[A, B], [0, 0]] t. A power of two divides this matrix, and the exponential of the quotient is
    squared as often. With a norm of the quotient below 1/4, the term of order 14 of its Taylor series is below 1e-19.
    """
    m, n = B.shape
    whole = np.zeros((m + n, m + n))
    whole[:m] = np.concatenate([A, B], axis=1) * t
    size = np.abs(whole).sum(axis=0).max()
    halvings = max(0, int(np.ceil(np.log2(size * 4.0)))) if 0.0 < size < np.inf else 0
    part, term, result = whole / 2.0**halvings, np.eye(m + n), np.eye(m + n)
    with np.errstate(all="ignore"):  # too long a period: the result is not finite
        for k in range(1, 14):
            term = term @ part / k
            result = result + term
        for _ in range(halvings):
            result = result @ result
    return result[:m, :m], result[:m, m:]
