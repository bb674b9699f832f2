"""Closed loops under PD control for heyoka.py, whose Taylor method runs in lanes.

Two right-hand sides: from the matrices of `arm.symbolic()`, and from the recursive expressions of `generated_model.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import heyoka as hy
import numpy as np
import sympy
from generated_model import Expressions
from generated_tree import Tree
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

BINARY = {ca.OP_ADD: "__add__", ca.OP_SUB: "__sub__", ca.OP_MUL: "__mul__", ca.OP_DIV: "__truediv__"}
UNARY: dict[int, Callable[[Any], Any]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_NEG: lambda a: -a,
    ca.OP_SQ: lambda a: a * a,
    ca.OP_TWICE: lambda a: 2.0 * a,
    ca.OP_INV: lambda a: 1.0 / a,
    ca.OP_SIN: hy.sin,
    ca.OP_COS: hy.cos,
    ca.OP_SQRT: hy.sqrt,
}


class Loop:
    """An arm under PD control with gravity compensation, with gains in proportion to the inertia of each joint."""

    def __init__(self, arm: al.Arm, target: float = 0.3) -> None:
        self.arm, self.target = arm, np.full(arm.n, target)
        inertia = np.diag(arm.mass_matrix(self.target))
        self.kp, self.kd = 50.0 * inertia, 10.0 * inertia  # N m/rad, N m s/rad
        self.plant, self.law = al.RigidArm(arm), al.PDGravity(arm, self.target, kp=self.kp, kd=self.kd)

    def generated(self) -> list[tuple[Any, Any]]:
        """States and rates of heyoka.py, from the Newton-Euler recursion and composite bodies, with common terms removed."""
        n = self.arm.n
        x, still = ca.SX.sym("x", 2 * n), ca.SX(n, 1)
        q, v = x[:n], x[n:]
        arm = Expressions(Tree(self.arm), q)
        tau = ca.DM(self.kp) * (ca.DM(self.target) - q) - ca.DM(self.kd) * v + arm.inverse_dynamics(still, still)
        return converted(x, ca.vertcat(v, arm.forward_dynamics(v, tau)))

    def symbolic(self) -> list[tuple[Any, Any]]:
        """States and rates of heyoka.py, from the matrices M and C of `arm.symbolic()`. Gravity is compensated."""
        n, model = self.arm.n, self.arm.symbolic()
        q, v = hy.make_vars(*(f"q{i}" for i in range(n))), hy.make_vars(*(f"v{i}" for i in range(n)))
        known = {symbol: sympy.Symbol(str(state)) for symbol, state in zip([*model.q, *model.v], [*q, *v], strict=True)}
        known |= {symbol: sympy.Float(value, 17) for symbol, value in model.values.items()}
        mass, coriolis = (
            [[hy.from_sympy(matrix[i, j].xreplace(known)) for j in range(n)] for i in range(n)] for matrix in (model.M, model.C)
        )
        torque = [
            self.kp[i] * (self.target[i] - q[i]) - self.kd[i] * v[i] - hy.sum([coriolis[i][j] * v[j] for j in range(n)]) for i in range(n)
        ]
        return list(zip([*q, *v], [*v, *solved(mass, torque)], strict=True))


def solved(mass: list[list[Any]], torque: list[Any]) -> list[Any]:
    """The solution a of M a = torque, by Gaussian elimination of expressions."""
    n, m, a = len(torque), [list(row) for row in mass], list(torque)
    for k in range(n):
        for i in range(k + 1, n):
            factor = m[i][k] / m[k][k]
            m[i] = [m[i][j] if j <= k else m[i][j] - factor * m[k][j] for j in range(n)]
            a[i] = a[i] - factor * a[k]
    for k in reversed(range(n)):
        for j in range(k + 1, n):
            a[k] = a[k] - m[k][j] * a[j]
        a[k] = a[k] / m[k][k]
    return a


def converted(x: Any, rate: Any) -> list[tuple[Any, Any]]:
    """States and rates as expressions of heyoka.py, from a state vector and its rate in CasADi."""
    function = ca.Function("rate", [x], [rate])
    states = [hy.expression(f"x{i}") for i in range(x.numel())]
    rates: list[Any] = [hy.expression(0.0)] * rate.numel()
    work: dict[int, Any] = {}
    for k in range(function.n_instructions()):
        operation, to, of = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if operation == ca.OP_CONST:
            work[to[0]] = hy.expression(function.instruction_constant(k))
        elif operation == ca.OP_INPUT:
            work[to[0]] = states[of[1]]
        elif operation == ca.OP_OUTPUT:
            rates[to[1]] = work[of[0]]
        elif operation in UNARY:
            work[to[0]] = UNARY[operation](work[of[0]])
        else:
            work[to[0]] = getattr(work[of[0]], BINARY[operation])(work[of[1]])
    return list(zip(states, rates, strict=True))


class Taylor:
    """Final states of many runs by the Taylor method of heyoka.py, one run per lane."""

    def __init__(self, system: list[tuple[Any, Any]], tolerance: float, t_end: float) -> None:
        self.lanes, self.t_end = hy.recommended_simd_size(), t_end
        # Without this mode, the compilation of large right-hand sides takes minutes.
        large = len(system) > 8
        self.method = hy.taylor_adaptive_batch(system, np.zeros((len(system), self.lanes)), tol=tolerance, compact_mode=large)

    def run(self, starts: Array) -> Array:
        """Final states (runs, size) from the initial states (runs, size). The number of runs is a multiple of the number of lanes."""
        out, method = np.empty_like(starts), self.method
        for first in range(0, len(starts), self.lanes):
            method.set_time(0.0)
            method.state[:] = starts[first : first + self.lanes].T
            method.propagate_until(self.t_end)
            out[first : first + self.lanes] = method.state.T
        return out
