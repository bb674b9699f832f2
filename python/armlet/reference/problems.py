"""A standard test set of initial-value problems dy/dt = f(t, y), each with its end state.

- Arenstorf's orbit and the Pleiades: Hairer, Norsett and Wanner, Solving ODEs I, sections II.0 and II.10.
- Van der Pol's equation, Robertson's reaction and HIRES: Hairer and Wanner, Solving ODEs II, section IV.10.
  Their end states have 12 digits or more, from the test set of Mazzia and Magherini (2008).
- Euler's free rigid body: the end state is computed from Jacobi's elliptic functions by the arithmetic-geometric mean.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .lagrange import Array


@dataclass(frozen=True)
class Problem:
    """A problem: its right-hand side, which takes floats and returns a list of floats, and its Jacobian if the problem is stiff."""

    name: str
    f: Callable[[float, Array], list[float]]
    span: tuple[float, float]
    y0: tuple[float, ...]
    #: The end state; a component whose digits are unknown is NaN.
    end: tuple[float, ...]
    stiff: bool = False
    #: The absolute tolerance divided by the relative one: the size of the smallest component that matters.
    scale: float = 1.0
    jac: Callable[[float, Array], list[list[float]]] | None = None

    def error(self, y: Array) -> float:
        """The distance to the known end state: the root mean square of (y - end) / max(|end|, scale) over its known components."""
        end = np.array(self.end)
        known = np.isfinite(end)
        ratio = (np.asarray(y) - end)[known] / np.maximum(np.abs(end[known]), self.scale)
        return float(np.sqrt(np.mean(ratio**2)))


def _arenstorf(t: float, y: Array) -> list[float]:
    mu = 0.012277471
    x, z, vx, vz = y
    a, b = ((x + mu) ** 2 + z * z) ** 1.5, ((x - 1 + mu) ** 2 + z * z) ** 1.5
    return [
        vx,
        vz,
        x + 2 * vz - (1 - mu) * (x + mu) / a - mu * (x - 1 + mu) / b,
        z - 2 * vx - (1 - mu) * z / a - mu * z / b,
    ]


def _pleiades(t: float, y: Array) -> list[float]:
    x, z = np.asarray(y[:7]), np.asarray(y[7:14])
    dx, dz = x[None, :] - x[:, None], z[None, :] - z[:, None]
    r3 = (dx**2 + dz**2) ** 1.5 + np.eye(7)
    m = np.arange(1.0, 8.0)
    return [*map(float, y[14:]), *(m * dx / r3).sum(axis=1).tolist(), *(m * dz / r3).sum(axis=1).tolist()]


def _rigid_body(t: float, y: Array) -> list[float]:
    return [y[1] * y[2], -y[0] * y[2], -0.51 * y[0] * y[1]]


def _van_der_pol(t: float, y: Array) -> list[float]:
    return [y[1], ((1 - y[0] ** 2) * y[1] - y[0]) * 1e6]


def _van_der_pol_jac(t: float, y: Array) -> list[list[float]]:
    return [[0.0, 1.0], [(-2 * y[0] * y[1] - 1) * 1e6, (1 - y[0] ** 2) * 1e6]]


def _robertson(t: float, y: Array) -> list[float]:
    a, b, c = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
    return [b - a, a - b - c, c]


def _robertson_jac(t: float, y: Array) -> list[list[float]]:
    return [[-0.04, 1e4 * y[2], 1e4 * y[1]], [0.04, -1e4 * y[2] - 6e7 * y[1], -1e4 * y[1]], [0.0, 6e7 * y[1], 0.0]]


def _hires(t: float, y: Array) -> list[float]:
    r = 280.0 * y[5] * y[7]
    return [
        -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007,
        1.71 * y[0] - 8.75 * y[1],
        -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
        8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
        -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6],
        -r + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
        r - 1.81 * y[6],
        -r + 1.81 * y[6],
    ]


def _hires_jac(t: float, y: Array) -> list[list[float]]:
    j = np.zeros((8, 8))
    j[0, :3] = -1.71, 0.43, 8.32
    j[1, :2] = 1.71, -8.75
    j[2, 2:5] = -10.03, 0.43, 0.035
    j[3, 1:4] = 8.32, 1.71, -1.12
    j[4, 4:7] = -1.745, 0.43, 0.43
    j[5, 3:8] = 0.69, 1.71, -0.43 - 280.0 * y[7], 0.69, -280.0 * y[5]
    j[6, 5:8] = 280.0 * y[7], -1.81, 280.0 * y[5]
    j[7, 5:8] = -280.0 * y[7], 1.81, -280.0 * y[5]
    rows: list[list[float]] = j.tolist()
    return rows


def jacobi_elliptic(u: float, m: float) -> tuple[float, float, float]:
    """sn, cn and dn for the argument u and the parameter m, by the arithmetic-geometric mean (Abramowitz and Stegun 16.4)."""
    a, c = [1.0], [np.sqrt(m)]
    b = np.sqrt(1.0 - m)
    while abs(c[-1]) > 1e-17:
        a.append(0.5 * (a[-1] + b))
        c.append(0.5 * (a[-2] - b))
        b = np.sqrt(a[-2] * b)
    phi = 2.0 ** (len(a) - 1) * a[-1] * u
    for k in range(len(a) - 1, 0, -1):
        phi = 0.5 * (phi + np.arcsin(c[k] / a[k] * np.sin(phi)))
    sn = np.sin(phi)
    return float(sn), float(np.cos(phi)), float(np.sqrt(1.0 - m * sn**2))


PROBLEMS = {
    problem.name: problem
    for problem in (
        Problem(
            "arenstorf",
            _arenstorf,
            (0.0, 17.0652165601579625588917206249),
            (0.994, 0.0, 0.0, -2.00158510637908252240537862224),
            (0.994, 0.0, 0.0, -2.00158510637908252240537862224),
        ),
        Problem(
            "pleiades",
            _pleiades,
            (0.0, 3.0),
            (3, 3, -1, -3, 2, -2, 2, 3, -3, 2, 0, 0, -4, 4, 0, 0, 0, 0, 0, 1.75, -1.5, 0, 0, 0, -1.25, 1, 0, 0),
            (
                *(0.3706139143970502, 3.237284092057233, -3.222559032418324, 0.6597091455775310, 0.3425581707156584),
                *(1.562172101400631, -0.7003092922212495, -3.943437585517392, -3.271380973972550, 5.225081843456543),
                *(-2.590612434977470, 1.198213693392275, -0.2429682344935824, 1.091449240428980),
                *(np.nan,) * 14,
            ),
        ),
        Problem("rigid body", _rigid_body, (0.0, 12.0), (0.0, 1.0, 1.0), jacobi_elliptic(12.0, 0.51)),
        Problem(
            "van der pol",
            _van_der_pol,
            (0.0, 2.0),
            (2.0, 0.0),
            (1.706167732170469, -0.8928097010248125),
            stiff=True,
            jac=_van_der_pol_jac,
        ),
        Problem(
            "robertson",
            _robertson,
            (0.0, 40.0),
            (1.0, 0.0, 0.0),
            (0.7158270687193941, 0.9185534764557338e-5, 0.2841637457458413),
            stiff=True,
            scale=1e-5,
            jac=_robertson_jac,
        ),
        Problem(
            "hires",
            _hires,
            (0.0, 321.8122),
            (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057),
            (
                *(0.7371312573325668e-3, 0.1442485726316185e-3, 0.5888729740967575e-4, 0.1175651343283149e-2),
                *(0.2386356198831331e-2, 0.6238968252742796e-2, 0.2849998395185769e-2, 0.2850001604814231e-2),
            ),
            stiff=True,
            scale=1e-4,
            jac=_hires_jac,
        ),
    )
}
