"""Arms and closed loops as systems of python-control: nonlinear systems, and linear systems about a state.

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
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from .._core import Arm, ElasticArm, Law, Plant, RigidArm
from ..arguments import finite, number, require_partner
from ..border import border
from ..errors import InputError
from ..extras import extra
from ..friction_models import LuGre, StickSlip
from ..run.simulation import simulate

__all__ = ["to_control"]

Array: TypeAlias = NDArray[np.float64]

#: Step h of the five-point difference, for numbers of magnitude 1. The truncation error h^4 is 1e-12, and the rounding error eps / h is
#: about 2e-13.
STEP = 1e-3


@border
def to_control(
    plant: Plant | Arm, law: Law | None = None, x0: ArrayLike | None = None, *, t: float = 0.0, u0: ArrayLike | None = None
) -> Any:
    """Convert an arm, or the closed loop of an arm and a law, to a system of python-control (extra `control`).

    The inputs of an arm are `tau1..`, N m or N (`u1..` of a velocity-controlled arm, rad/s or m/s). The inputs of a loop are disturbances
    `d1..`, which are added to the arm's inputs. The states are `q1..`, `v1..`, `theta1..`, `theta_dot1..`, `estimate1..`. The outputs are
    the states and, of a loop, also the law's outputs `tau1..` or `u1..`. The states `estimate1..` are the state of the law, in the order of
    `Run.estimate`: adaptive estimates, integrals, and states of filters and observers.

    Args:
        plant: the plant, without a wall and without joint stops; an arm means `RigidArm(arm)`.
        law: the law of the loop; None: only the arm.
        x0: None: return the nonlinear system. Otherwise linearise about this state: q, (n,), or all states. With q alone, the arm is at
            rest, the springs support gravity, and the law has the state of the start of a run. The states of the linear system are
            deviations from this state.
        t: time of the law for the linearisation, s. It requires a law and `x0`.
        u0: input about which an arm is linearised, (n,). None: the input with which a rigid arm has zero acceleration; zero for a
            velocity-controlled arm. With a law, the law determines it.

    Returns:
        A `control.NonlinearIOSystem`; with `x0` a `control.StateSpace`.

    Raises:
        InputError: an argument has a wrong type, shape or value, or the plant has a wall, joint stops, `LuGre`
            or `StickSlip` friction.
        ImportError: python-control is not installed.

    Source: Carpentier and Mansard 2018.

    >>> import armlet as al
    >>> arm = al.pendulum(1.0, 4.0)
    >>> sorted(al.to_control(arm, x0=[0.0]).poles().imag.round(9).tolist())
    [-2.0, 2.0]
    >>> law = al.ComputedTorque(arm, al.Hold([0.5]), kp=8.0, kd=6.0)
    >>> sorted(al.to_control(arm, law, [0.5]).poles().real.round(6).tolist())
    [-4.0, -2.0]
    >>> al.to_control(arm, law).state_labels
    ['q1', 'v1']
    """
    control = extra("to_control", "control", "control", "python-control")
    loop = _Loop(plant if isinstance(plant, Plant) else RigidArm(_arm(plant)), law)
    names = {"inputs": loop.inputs, "outputs": loop.outputs, "states": loop.states}
    t = number("to_control", "t", t)
    require_partner("to_control", "t", t, "law and x0", law is not None and x0 is not None, 0.0)
    if x0 is None:
        if u0 is not None:
            raise InputError("to_control: u0 is given without x0: expected the state to linearise about")
        return control.nlsys(
            lambda t, x, u, params: loop.rates(t, np.asarray(x, dtype=np.float64), np.asarray(u, dtype=np.float64)),
            lambda t, x, u, params: loop.output(t, np.asarray(x, dtype=np.float64)),
            **names,
            name=loop.name,
        )
    if law is not None and u0 is not None:
        raise InputError("to_control: u0 is given with a law: expected None, since the law has the input")
    return control.StateSpace(*loop.linear(t, loop.state(x0), u0), **names, name=f"{loop.name}, linear")


def _arm(value: Any) -> Arm:
    if not isinstance(value, Arm):
        raise InputError(f"to_control: plant is of the wrong type: expected a plant or an arm, got {type(value).__name__}")
    return value


class _Loop:
    def __init__(self, plant: Plant, law: Law | None) -> None:
        if law is not None and not isinstance(law, Law):
            raise InputError(f"to_control: law is of the wrong type: expected a law or None, got {type(law).__name__}")
        made = plant.__getnewargs_ex__()[1]
        if made.get("wall") is not None:
            raise InputError("to_control: plant has a wall: expected a plant without a wall, because the force of a wall is not smooth")
        if made.get("stops") is not None:
            raise InputError("to_control: plant has joint stops: expected a plant without stops, because their torques are not smooth")
        for name in ("friction", "motor_friction"):
            if isinstance(made.get(name), LuGre | StickSlip):
                raise InputError(
                    f"to_control: plant has dry friction: expected {name} without a {type(made[name]).__name__}, which is not smooth"
                )
        self.plant, self.law, self.arm, self.n = plant, law, plant.arm, plant.arm.n
        n, self.friction = self.n, bool(made.get("friction"))
        parts = plant._parts
        self.elastic, self.velocity = "theta" in parts, "v" not in parts
        if law is not None:
            try:
                # If plant and law cannot form a loop, this call raises the error of `simulate`.
                simulate(plant, law, np.zeros(n), t_end=0.0, dt=1e-3, check_limits=False)
            except InputError as error:
                raise InputError(f"to_control: {str(error).partition(': ')[2]}") from None
        if isinstance(plant, ElasticArm):
            self.K, self.B = (_matrix(made[name], n) for name in ("stiffness", "motor_inertia"))
            self.D, self.F = (_matrix(0.0 if made.get(name) is None else made[name], n) for name in ("joint_damping", "motor_friction"))
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
        given = finite("to_control", "x0", _core.numbers("to_control", "x0", x0, *dict.fromkeys([(n,), (self.m + self.p,)])))
        if len(given) == self.m + self.p:
            return given
        x = np.zeros(self.m + self.p)
        x[:n] = given
        if self.elastic:
            x[2 * n : 3 * n] = given + np.linalg.solve(self.K, self.arm.gravity(given))
        x[self.m :] = self._start(x)
        return x

    def linear(self, t: float, x: Array, u0: ArrayLike | None) -> tuple[Array, Array, Array, Array]:
        n, m = self.n, self.m
        u = np.zeros(n) if u0 is None else finite("to_control", "u0", _core.numbers("to_control", "u0", u0, (n,)))
        if self.law is not None:
            u = self._law(t, x)[0]
        elif u0 is None and not self.velocity:
            u = self.arm.bias(x[:n], x[n : 2 * n], friction=self.friction)
        A, B = np.zeros((len(x), len(x))), np.zeros((len(x), n))
        A[:m, :m], B[:m] = self._open(x, u)
        if self.law is None:
            return A, B, np.eye(len(x)), np.zeros((len(x), n))
        state, others = self._given(x)
        exact = self.law._slope(t, *state, **others)
        slope = _slope(lambda x: np.concatenate(self._law(t, x)), x) if exact is None else exact
        A += B @ slope[:n]
        A[m:] += slope[n:]
        return A, B, np.concatenate([np.eye(len(x)), slope[:n]]), np.zeros((len(x) + n, n))

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
            return self.arm.linearize(q, v, tau, friction=self.friction)
        # A closed-form arm has no method `linearize`, so its derivatives are differences.
        slope = _slope(lambda x: self.arm.forward_dynamics(*np.split(x, 3)), np.concatenate([q, v, tau]))
        whole = np.concatenate([np.eye(self.n, 3 * self.n, self.n), slope])
        return whole[:, : 2 * self.n], whole[:, 2 * self.n :]


def _matrix(value: ArrayLike, n: int) -> Array:
    given = _core.numbers("to_control", "plant", value)
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
