"""tau = Y pi_hat + Kp e + Kd e_dot, pi_hat_dot = Gamma Y' s on M(q) a + S(q, v) v = tau in numpy, scipy, numba and C.

`bench_adaptive.py` compares armlet with these implementations, which are written from the equations. The state is
x = (q1, q2, v1, v2, A_hat, B_hat, C_hat). The method is classical Runge-Kutta with step h, with the law evaluated in every stage.
A table contains (q_d, v_d, a_d) at every half step.
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

PLANT = (2.0, 0.5, 1.0)
LAMBDA, KD, GAMMA = 5.0, 10.0, (2.0, 1.0, 1.0)
KP = KD * LAMBDA
H, T, STEPS = 1e-3, 10.0, 10_000
Q0 = (0.1, -0.2)
RUNS, BATCH_STEPS = 1024, 1000
# Gain matrices whose off-diagonal entries are not zero, so that no product can be omitted.
FULL_KP = np.array([[50.0, 4.0], [4.0, 45.0]])
FULL_KD = np.array([[10.0, 1.0], [1.0, 9.0]])
FULL_GAMMA = np.array([[2.0, 0.3, 0.1], [0.3, 1.0, 0.2], [0.1, 0.2, 1.0]])


def desired(t: Any) -> tuple[Array, Array, Array]:
    """The desired motion q_d = (0.5 sin t, 0.8 sin 2t) and its two derivatives, each (..., 2)."""
    t = np.asarray(t, float)[..., None]
    amplitude, rate = np.array([0.5, 0.8]), np.array([1.0, 2.0])
    s, c = np.sin(rate * t), np.cos(rate * t)
    return amplitude * s, amplitude * rate * c, -amplitude * rate**2 * s


def table(steps: int) -> Array:
    """The table (2 steps + 1, 6) of q_d, v_d, a_d at the half steps."""
    return np.ascontiguousarray(np.concatenate(desired(np.arange(2 * steps + 1) * (H / 2)), axis=1))


def batch_inputs() -> tuple[Array, Array]:
    """Plant parameters (RUNS, 3) within 20 % of the nominal, and initial positions (RUNS, 2) within 0.2 rad or m of the nominal."""
    random = np.random.default_rng(2022)
    return np.array(PLANT) * random.uniform(0.8, 1.2, (RUNS, 3)), np.array(Q0) + random.uniform(-0.2, 0.2, (RUNS, 2))


def start(q0: Any = Q0) -> Array:
    q0 = np.asarray(q0, float)
    return np.concatenate([q0, np.zeros((*q0.shape[:-1], 5))], axis=-1)


def rk4(f: Callable[[Any, Any], Any], x: Any, motion: Any, steps: int) -> Any:
    for k in range(steps):
        k1 = f(x, motion[2 * k])
        k2 = f(x + H / 2 * k1, motion[2 * k + 1])
        k3 = f(x + H / 2 * k2, motion[2 * k + 1])
        k4 = f(x + H * k3, motion[2 * k + 2])
        x = x + H / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def numpy_rhs(kp: Array, kd: Array, gamma: Array) -> Callable[[Array, Array], Array]:
    """A function that computes the state derivative with numpy matrices, for diagonal and full gain matrices."""
    A, B, C = PLANT
    lam = np.linalg.solve(kd, kp)

    def f(x: Array, r: Array) -> Array:
        q, v, estimate = x[:2], x[2:4], x[4:]
        e, e_dot = r[:2] - q, r[2:4] - v
        v_r, a_r = r[2:4] + lam @ e, r[4:] + lam @ e_dot
        c, s = np.cos(q[1]), np.sin(q[1])
        Y = np.array([[a_r[0], a_r[1] * c - v[1] * v_r[1] * s, 0.0], [0.0, a_r[0] * c, a_r[1]]])
        tau = Y @ estimate + kp @ e + kd @ e_dot
        M = np.array([[A, B * c], [B * c, C]])
        coriolis = np.array([-B * s * v[1] ** 2, 0.0])
        return np.concatenate([v, np.linalg.solve(M, tau - coriolis), gamma @ (Y.T @ (v_r - v))])

    return f


def numpy_loop(steps: int, full: bool = False) -> Array:
    gains = (FULL_KP, FULL_KD, FULL_GAMMA) if full else (KP * np.eye(2), KD * np.eye(2), np.diag(GAMMA))
    result: Array = rk4(numpy_rhs(*gains), start(), table(steps), steps)
    return result


def loop_of_scalars(A: Any, B: Any, C: Any, x: Any, r: Any, sin: Any, cos: Any) -> tuple[Any, ...]:
    """The state derivative, component by component. scipy calls it with `math`; numba compiles it; numpy passes columns (RUNS,)."""
    q1, q2, v1, v2, a, b, c = x
    d1, d2 = r[2] - v1, r[3] - v2
    w1, w2 = LAMBDA * (r[0] - q1), LAMBDA * (r[1] - q2)
    s1, s2 = d1 + w1, d2 + w2
    a1, a2 = r[4] + LAMBDA * d1, r[5] + LAMBDA * d2
    sn, cs = sin(q2), cos(q2)
    y12, y22 = a2 * cs - v2 * (r[3] + w2) * sn, a1 * cs
    off = B * cs
    f1 = a1 * a + y12 * b + KD * s1 + B * sn * v2 * v2
    f2 = y22 * b + a2 * c + KD * s2
    det = A * C - off * off
    rates = GAMMA[0] * a1 * s1, GAMMA[1] * (y12 * s1 + y22 * s2), GAMMA[2] * a2 * s2
    return v1, v2, (C * f1 - off * f2) / det, (A * f2 - off * f1) / det, *rates


def numpy_batch(steps: int) -> Array:
    """Final states of a batch, (RUNS, 7): numpy computes all runs together."""
    plants, q0 = batch_inputs()
    A, B, C = plants.T
    out: Array = rk4(lambda x, r: np.stack(loop_of_scalars(A, B, C, x, r, np.sin, np.cos)), start(q0).T, table(steps), steps)
    return out.T


def scipy_dop853(rtol: float, atol: float, arrays: bool = False) -> tuple[Array, int]:
    """Final state (7,) and number of evaluations of scipy's DOP853.

    By default the right-hand side uses Python floats, faster than small arrays.
    """
    from scipy.integrate import solve_ivp

    of_arrays = numpy_rhs(KP * np.eye(2), KD * np.eye(2), np.diag(GAMMA))

    def f_of_arrays(t: float, x: Array) -> Array:
        return of_arrays(x, np.concatenate(desired(t)))

    def f(t: float, x: Array) -> tuple[Any, ...]:
        s1, c1, s2, c2 = math.sin(t), math.cos(t), math.sin(2 * t), math.cos(2 * t)
        return loop_of_scalars(*PLANT, x.tolist(), (0.5 * s1, 0.8 * s2, 0.5 * c1, 1.6 * c2, -0.5 * s1, -3.2 * s2), math.sin, math.cos)

    solution = solve_ivp(f_of_arrays if arrays else f, (0.0, T), start(), method="DOP853", rtol=rtol, atol=atol)
    return solution.y[:, -1], solution.nfev


def numba_rhs() -> Callable[..., Any]:
    import numba

    lam, kd, (g1, g2, g3) = LAMBDA, KD, GAMMA

    @numba.njit(inline="always")
    def f(A, B, C, q1, q2, v1, v2, a, b, c, r):  # type: ignore[no-untyped-def]
        d1, d2 = r[2] - v1, r[3] - v2
        w1, w2 = lam * (r[0] - q1), lam * (r[1] - q2)
        s1, s2 = d1 + w1, d2 + w2
        a1, a2 = r[4] + lam * d1, r[5] + lam * d2
        sn, cs = math.sin(q2), math.cos(q2)
        y12, y22 = a2 * cs - v2 * (r[3] + w2) * sn, a1 * cs
        off = B * cs
        f1 = a1 * a + y12 * b + kd * s1 + B * sn * v2 * v2
        f2 = y22 * b + a2 * c + kd * s2
        inverse = 1.0 / (A * C - off * off)
        return v1, v2, (C * f1 - off * f2) * inverse, (A * f2 - off * f1) * inverse, g1 * a1 * s1, g2 * (y12 * s1 + y22 * s2), g3 * a2 * s2

    return f


def numbalsoda_dop853(rtol: float, atol: float) -> Callable[[], Array]:
    """A function that runs Hairer's Fortran code dop853 on a right-hand side compiled by numba, and returns the final state (7,)."""
    import numba
    import numbalsoda

    if not hasattr(numbalsoda, "dop853"):
        raise ImportError("numbalsoda has no dop853 before 0.3.4")
    f, (A, B, C) = numba_rhs(), PLANT

    @numba.cfunc(numbalsoda.lsoda_sig)
    def rhs(t, x, dx, _):  # type: ignore[no-untyped-def]
        s1, c1, s2, c2 = math.sin(t), math.cos(t), math.sin(2 * t), math.cos(2 * t)
        slope = f(A, B, C, x[0], x[1], x[2], x[3], x[4], x[5], x[6], (0.5 * s1, 0.8 * s2, 0.5 * c1, 1.6 * c2, -0.5 * s1, -3.2 * s2))
        for i, value in enumerate(slope):
            dx[i] = value

    times, address, x0 = np.array([0.0, T]), rhs.address, start()
    # The default argument stores a reference to the compiled function; otherwise it would be freed.
    return lambda _rhs=rhs: numbalsoda.dop853(address, x0, times, rtol=rtol, atol=atol)[0][-1]


def numba_kernels() -> dict[str, Callable[..., Any]]:
    """Loops compiled by numba: `arrays` uses small arrays, `scalars` uses scalars, and `batch` runs many runs on one or several threads."""
    import numba

    f = numba_rhs()

    @numba.njit
    def arrays(plant, x0, motion, steps, h):  # type: ignore[no-untyped-def]
        A, B, C = plant[0], plant[1], plant[2]
        x, y, total = x0.copy(), np.empty(7), np.empty(7)
        for k in range(steps):
            for i in range(7):
                y[i], total[i] = x[i], 0.0
            for stage in range(4):
                slope = f(A, B, C, y[0], y[1], y[2], y[3], y[4], y[5], y[6], motion[2 * k + (stage + 1) // 2])
                weight = 1.0 if stage == 0 or stage == 3 else 2.0
                ahead = h if stage == 2 else 0.5 * h
                for i, value in enumerate(slope):
                    total[i] += weight * value
                    y[i] = x[i] + ahead * value
            for i in range(7):
                x[i] += h / 6 * total[i]
        return x

    @numba.njit
    def scalars(plant, x0, motion, steps, h):  # type: ignore[no-untyped-def]
        A, B, C = plant[0], plant[1], plant[2]
        q, p, v, w, a, b, c = x0[0], x0[1], x0[2], x0[3], x0[4], x0[5], x0[6]
        g, s = 0.5 * h, h / 6
        for k in range(steps):
            middle, end = motion[2 * k + 1], motion[2 * k + 2]
            i = f(A, B, C, q, p, v, w, a, b, c, motion[2 * k])
            j = f(A, B, C, q + g * i[0], p + g * i[1], v + g * i[2], w + g * i[3], a + g * i[4], b + g * i[5], c + g * i[6], middle)
            m = f(A, B, C, q + g * j[0], p + g * j[1], v + g * j[2], w + g * j[3], a + g * j[4], b + g * j[5], c + g * j[6], middle)
            n = f(A, B, C, q + h * m[0], p + h * m[1], v + h * m[2], w + h * m[3], a + h * m[4], b + h * m[5], c + h * m[6], end)
            q += s * (i[0] + 2 * (j[0] + m[0]) + n[0])
            p += s * (i[1] + 2 * (j[1] + m[1]) + n[1])
            v += s * (i[2] + 2 * (j[2] + m[2]) + n[2])
            w += s * (i[3] + 2 * (j[3] + m[3]) + n[3])
            a += s * (i[4] + 2 * (j[4] + m[4]) + n[4])
            b += s * (i[5] + 2 * (j[5] + m[5]) + n[5])
            c += s * (i[6] + 2 * (j[6] + m[6]) + n[6])
        return np.array([q, p, v, w, a, b, c])

    def batch(plants, x0, motion, steps, h):  # type: ignore[no-untyped-def]
        out = np.empty_like(x0)
        for row in numba.prange(x0.shape[0]):
            out[row] = scalars(plants[row], x0[row], motion, steps, h)
        return out

    return {"arrays": arrays, "scalars": scalars, "batch": numba.njit(batch), "parallel": numba.njit(parallel=True)(batch)}


class Gains(ctypes.Structure):
    _fields_ = [("lam", ctypes.c_double * 2), ("kd", ctypes.c_double * 2), ("gamma", ctypes.c_double * 3)]


class LimitKernels(limits.Kernels):
    """C kernels written by hand: `native/p1.cpp`."""

    def __init__(self) -> None:
        super().__init__("p1.cpp", "-lpthread")
        self._gains = Gains((LAMBDA, LAMBDA), (KD, KD), GAMMA)

    def single(self, motion: Array, steps: int) -> Array:
        x, plant = start(), np.array(PLANT)
        rotated = 2  # variant of the kernel: one sine and cosine per step, small-angle rotations in the stages, no log
        length, h = ctypes.c_long(steps), ctypes.c_double(H)
        self._c.p1_scalar(ctypes.byref(self._gains), self._at(plant), self._at(x), self._at(motion), length, h, rotated, None)
        return x

    def batch(self, motion: Array, steps: int, threads: int) -> Array:
        """Final states (RUNS, 7). One register has eight runs, and two registers are computed alternately."""
        plants, q0 = batch_inputs()
        by_column, x = np.ascontiguousarray(plants.T), np.ascontiguousarray(start(q0).T)
        held, rotated, interleaved = 0, 1, 2
        self._c.p1_batch(
            ctypes.byref(self._gains), self._at(by_column), self._at(x), self._at(motion), ctypes.c_long(steps), ctypes.c_double(H),
            ctypes.c_long(RUNS), held, rotated, interleaved, threads, None, ctypes.c_long(1),
        )  # fmt: skip
        return x.T
