"""The elastic 2R arm with the state `(q, v, theta, theta_dot)` under Cartesian impedance: one closed loop in numpy, scipy, numba and C.

    M a = tau_J + J'F - C v - g,   theta_ddot = B0^-1 (u - D0 theta_dot - tau_J),   u = J'(K_m (x_d - x) - D_m J v) + g

In these equations, `x` is the position of the tip, and `J` its Jacobian.

`bench_elastic.py` compares armlet with these implementations, which are written from the equations. There are three levels of stiffness,
with natural frequencies of the motors sqrt(K_J/B0) of 3.2e3, 3.2e4 and 3.2e5 1/s.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from typing import Any

import limits
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEVELS = {"mild": (1e4, 1e-3), "stiff": (1e5, 1e-4), "very stiff": (1e6, 1e-5)}  # K_J (N m/rad), B0 (kg m^2)
A, L = (0.85, 0.25, 0.175, 14.715, 4.905), (0.5, 0.5)
LINKS: dict[str, Any] = {"masses": [2.0, 2.0], "coms": [0.25, 0.25], "inertias": [0.05, 0.05], "gravity": (0.0, -9.81)}
B, K_M, D_M, TARGET, FORCE = 0.5, 400.0, 4.0, (0.6, 0.3), (5.0, -3.0)
Q0 = (-0.5, 1.6)
H, STEPS, T = 2e-4, 10_000, 2.0
RUNS, BATCH_STEPS = 1024, 1000


def damping(level: str) -> float:
    """Motor damping D0 (N m s/rad) for a damping ratio of 0.7."""
    k, b0 = LEVELS[level]
    return 1.4 * math.sqrt(k * b0)


def start(q0: Any = Q0) -> Array:
    q = np.asarray(q0, float)
    still = np.zeros_like(q)
    return np.concatenate([q, still, q, still], axis=-1)


def batch_start() -> Array:
    """Initial positions (RUNS, 2) within 0.1 rad of the nominal."""
    return np.array(Q0) + np.random.default_rng(2022).uniform(-0.1, 0.1, (RUNS, 2))


def components(x: Any, k: Any, b0: Any, d0: Any, sin: Any, cos: Any) -> tuple[Any, ...]:
    """The state derivative, component by component. scipy calls it with `math`, and numba compiles it."""
    q1, q2, v1, v2, t1, t2, w1, w2 = x
    s1, c1, s2, c2 = sin(q1), cos(q1), sin(q2), cos(q2)
    s12, c12 = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
    m11, m12, h = 0.85 + 0.5 * c2, 0.175 + 0.25 * c2, 0.25 * s2
    g1, g2 = 14.715 * c1 + 4.905 * c12, 4.905 * c12
    j12, j22 = -0.5 * s12, 0.5 * c12
    j11, j21 = j12 - 0.5 * s1, j22 + 0.5 * c1
    ex = 400.0 * (0.6 - j21) - 4.0 * (j11 * v1 + j12 * v2)
    ey = 400.0 * (0.3 + j11) - 4.0 * (j21 * v1 + j22 * v2)
    u1, u2 = j11 * ex + j21 * ey + g1, j12 * ex + j22 * ey + g2
    f1, f2 = k * (t1 - q1), k * (t2 - q2)
    n1 = f1 + 5.0 * j11 - 3.0 * j21 + h * v2 * (2.0 * v1 + v2) - g1
    n2 = f2 + 5.0 * j12 - 3.0 * j22 - h * v1 * v1 - g2
    inverse = 1.0 / (m11 * 0.175 - m12 * m12)
    a1, a2 = (0.175 * n1 - m12 * n2) * inverse, (m11 * n2 - m12 * n1) * inverse
    return v1, v2, a1, a2, w1, w2, (u1 - d0 * w1 - f1) / b0, (u2 - d0 * w2 - f2) / b0


def numpy_rhs(level: str) -> Callable[[float, Array], Array]:
    """A function that computes the state derivative with numpy matrices."""
    (k, b0), d0 = LEVELS[level], damping(level)
    a1, a2, a3, a4, a5 = A
    l1, l2 = L
    target, force = np.array(TARGET), np.array(FORCE)

    def f(t: float, x: Array) -> Array:
        q, v, theta, theta_dot = x.reshape(4, 2)
        s1, c1, s2, c2 = np.sin(q[0]), np.cos(q[0]), np.sin(q[1]), np.cos(q[1])
        s12, c12 = np.sin(q[0] + q[1]), np.cos(q[0] + q[1])
        M = np.array([[a1 + 2 * a2 * c2, a3 + a2 * c2], [a3 + a2 * c2, a3]])
        S = a2 * s2 * np.array([[-v[1], -(v[0] + v[1])], [v[0], 0.0]])
        g = np.array([a4 * c1 + a5 * c12, a5 * c12])
        J = np.array([[-l1 * s1 - l2 * s12, -l2 * s12], [l1 * c1 + l2 * c12, l2 * c12]])
        p = np.array([l1 * c1 + l2 * c12, l1 * s1 + l2 * s12])
        u = J.T @ (K_M * (target - p) - D_M * (J @ v)) + g
        spring = k * (theta - q)
        tau = (1 - B / b0) * spring + B / b0 * (u - d0 * theta_dot)
        return np.concatenate([v, np.linalg.solve(M, spring + J.T @ force - S @ v - g), theta_dot, (tau - spring) / B])

    return f


def numpy_rk4(steps: int, x: Array | None = None) -> Array:
    f = numpy_rhs("mild")
    x = start() if x is None else x
    for _ in range(steps):
        k1 = f(0.0, x)
        k2 = f(0.0, x + H / 2 * k1)
        k3 = f(0.0, x + H / 2 * k2)
        x = x + H / 6 * (k1 + 2 * k2 + 2 * k3 + f(0.0, x + H * k3))
    return x


def scipy_run(level: str, method: str, t: float = T, rtol: float = 1e-6, atol: float = 1e-9) -> Array:
    """Final state by scipy. The right-hand side uses Python floats, which are faster here than small arrays."""
    from scipy.integrate import solve_ivp

    (k, b0), d0 = LEVELS[level], damping(level)
    f = lambda t, x: components(x.tolist(), k, b0, d0, math.sin, math.cos)  # noqa: E731
    return np.asarray(solve_ivp(f, (0.0, t), start(), method=method, rtol=rtol, atol=atol).y[:, -1])


def numba_kernels() -> dict[str, Callable[..., Any]]:
    """RK4 compiled by numba from scalars: one run, and a batch."""
    import inspect
    import textwrap

    import numba

    source = textwrap.dedent(inspect.getsource(components)).split("\n", 3)
    body = source[3] if source[1].lstrip().startswith('"""') else "\n".join(source[2:])
    text = "def f(q1, q2, v1, v2, t1, t2, w1, w2, k, b0, d0):\n" + body.replace("    q1, q2, v1, v2, t1, t2, w1, w2 = x\n", "")
    space: dict[str, Any] = {"sin": math.sin, "cos": math.cos}
    exec(text, space)
    f = numba.njit(inline="always")(space["f"])

    @numba.njit
    def single(x0, steps, h, k, b0, d0):  # type: ignore[no-untyped-def]
        a, b, c, d, e, p, r, s = x0[0], x0[1], x0[2], x0[3], x0[4], x0[5], x0[6], x0[7]
        g, w = 0.5 * h, h / 6.0
        for _ in range(steps):
            y = f(a, b, c, d, e, p, r, s, k, b0, d0)
            z = f(a + g * y[0], b + g * y[1], c + g * y[2], d + g * y[3], e + g * y[4], p + g * y[5], r + g * y[6], s + g * y[7], k, b0, d0)
            m = f(a + g * z[0], b + g * z[1], c + g * z[2], d + g * z[3], e + g * z[4], p + g * z[5], r + g * z[6], s + g * z[7], k, b0, d0)
            n = f(a + h * m[0], b + h * m[1], c + h * m[2], d + h * m[3], e + h * m[4], p + h * m[5], r + h * m[6], s + h * m[7], k, b0, d0)
            a += w * (y[0] + 2.0 * (z[0] + m[0]) + n[0])
            b += w * (y[1] + 2.0 * (z[1] + m[1]) + n[1])
            c += w * (y[2] + 2.0 * (z[2] + m[2]) + n[2])
            d += w * (y[3] + 2.0 * (z[3] + m[3]) + n[3])
            e += w * (y[4] + 2.0 * (z[4] + m[4]) + n[4])
            p += w * (y[5] + 2.0 * (z[5] + m[5]) + n[5])
            r += w * (y[6] + 2.0 * (z[6] + m[6]) + n[6])
            s += w * (y[7] + 2.0 * (z[7] + m[7]) + n[7])
        return np.array([a, b, c, d, e, p, r, s])

    @numba.njit
    def batch(x0, steps, h, k, b0, d0):  # type: ignore[no-untyped-def]
        out = np.empty_like(x0)
        for row in range(x0.shape[0]):
            out[row] = single(x0[row], steps, h, k, b0, d0)
        return out

    return {"single": single, "batch": batch}


class LimitKernels(limits.Kernels):
    """C kernels written by hand: `native/p3.cpp`."""

    def __init__(self) -> None:
        super().__init__("p3.cpp")
        self._c.p3_rodas.restype = self._c.p3_rodas8.restype = ctypes.c_long

    @staticmethod
    def _parameters(level: str) -> Array:
        (k, b0), d0 = LEVELS[level], damping(level)
        return np.array([*A, *L, B, B, k, k, b0, b0, d0, d0, K_M, K_M, D_M, D_M, *TARGET, *FORCE])

    def single(self, steps: int = STEPS) -> Array:
        x = start()
        self._c.p3_rk4(self._at(self._parameters("mild")), self._at(x), ctypes.c_long(steps), ctypes.c_double(H))
        return x

    def batch(self, steps: int = BATCH_STEPS) -> Array:
        """Final states (RUNS, 8). One register has eight runs."""
        x = np.ascontiguousarray(start(batch_start()).T)
        self._c.p3_batch(self._at(self._parameters("mild")), self._at(x), ctypes.c_long(steps), ctypes.c_double(H), ctypes.c_long(RUNS))
        return x.T

    def rosenbrock(self, level: str, wide: bool, t: float = T, rtol: float = 1e-6, atol: float = 1e-9) -> Array:
        """The method RODAS with Jacobians by dual numbers. `wide`: one register contains a row's dual numbers, or a row of the inverse."""
        x, rejected = start(), ctypes.c_long(0)
        run = self._c.p3_rodas8 if wide else self._c.p3_rodas
        limits = ctypes.c_double(t), ctypes.c_double(rtol), ctypes.c_double(atol)
        run(self._at(self._parameters(level)), self._at(x), *limits, ctypes.byref(rejected))
        return x
