"""armlet's adaptive methods as solvers of `scipy.integrate.solve_ivp`."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..arguments import shown
from ..border import border
from ..errors import InputError
from ..extras import extra
from ..status import Status

__all__ = ["scipy_method"]

# For each method: its order, and the order of its error estimate.
ADAPTIVE = {"dopri5": (5, 4), "dop853": (8, 7), "radau5": (5, 3), "rodas4": (4, 3)}
IMPLICIT = ("radau5", "rodas4")
# Options that some of scipy's own solvers have.
FOREIGN = ("jac", "jac_sparsity", "lband", "uband", "min_step")
LEAST_RTOL = 100 * np.finfo(np.float64).eps


@border
def scipy_method(name: str) -> Any:
    """Return a class for `solve_ivp(method=...)`. It uses armlet's steps, interpolation polynomials and Jacobians in scipy's loop.

    Args:
        name: "dopri5", "dop853", "radau5" or "rodas4".

    Returns:
        A subclass of `scipy.integrate.OdeSolver`. It accepts the arguments of scipy's own solvers: rtol and atol (numbers or (n,)),
        max_step, first_step and vectorized. "radau5" and "rodas4" also accept jac (a matrix, a sparse matrix, or a callable) and
        jac_sparsity. The end time may be infinite. The counters follow scipy: nfev does not count evaluations for differences, njev
        does not count constant Jacobians. Options of scipy's other solvers raise scipy's UserWarning, and unknown options raise InputError.
        Complex states raise ValueError. Other errors of the class are InputErrors.

    Raises:
        InputError: the name is unknown.
        ImportError: scipy is not installed.

    Source: [HairerNorsettWanner1993, HairerWanner1996]; docs/integration.md.

    >>> import armlet as al
    >>> from scipy.integrate import solve_ivp
    >>> solution = solve_ivp(lambda t, y: -y, (0.0, 1.0), [1.0], method=al.scipy_method("dop853"), rtol=1e-10, atol=1e-12)
    >>> float(solution.y[0, -1].round(7))
    0.3678794
    """
    if not isinstance(name, str) or name not in ADAPTIVE:
        raise InputError(f"scipy_method: name is unknown: expected one of {', '.join(ADAPTIVE)}, got {shown(name)}")
    return _method(name)


def _others(name: str, options: dict[str, Any]) -> None:
    """Warn of options that only other solvers have, with scipy's warning. Refuse options that no solver has."""
    unknown = [key for key in options if key not in FOREIGN]
    if unknown:
        known = "rtol, atol, max_step, first_step, vectorized, jac, jac_sparsity"
        raise InputError(f"scipy_method: {unknown[0]} is unknown: expected {known}")
    if options:
        given = ", ".join(f"`{key}`" for key in options)
        warnings.warn(f"The following arguments have no effect for a chosen solver: {given}.", stacklevel=4)


def _relative(rtol: Any) -> Any:
    """Return rtol with entries below 100 eps raised to 100 eps. If an entry was raised, warn with scipy's text."""
    try:
        small = np.any(np.less(rtol, LEAST_RTOL))
    except (TypeError, ValueError):
        return rtol  # `rtol` has entries that are not numbers; the core refuses them
    if not small:
        return rtol
    warnings.warn(f"At least one element of `rtol` is too small. Setting `rtol = np.maximum(rtol, {LEAST_RTOL})`.", stacklevel=4)
    return np.maximum(rtol, LEAST_RTOL)


def _scipy() -> Any:
    return extra("scipy_method", "scipy.integrate", "tune")


@cache
def _polynomial() -> Any:
    """The class of dense outputs. It is defined here because it requires scipy."""

    class Polynomial(_scipy().DenseOutput):  # type: ignore[misc]
        """The polynomial of one step, given by its values at the Chebyshev points.

        For times beyond the step, its Chebyshev series is evaluated, without the coefficients that are as small as rounding errors.
        """

        def __init__(self, t_old: float, t: float, nodes: NDArray[np.float64]) -> None:
            super().__init__(t_old, t)
            degree = len(nodes) - 1
            self._at = t_old + 0.5 * (1.0 - np.cos(np.pi * np.arange(degree + 1) / degree)) * (t - t_old)
            self._at[-1] = t
            self._nodes = nodes
            self._weights = (-1.0) ** np.arange(degree + 1)
            self._weights[[0, -1]] *= 0.5

        def _call_impl(self, t: NDArray[np.float64]) -> Any:
            times = np.atleast_1d(t)
            y = self._between(times)
            x = 2.0 * (times - self.t_old) / (self.t - self.t_old) - 1.0
            beyond = np.abs(x) > 1.0
            if beyond.any():
                y[beyond] = np.polynomial.chebyshev.chebval(x[beyond], self._series()).T
            return y[0] if t.ndim == 0 else y.T

        def _series(self) -> NDArray[np.float64]:
            """Coefficients of the Chebyshev series on the step, (degree + 1, n)."""
            degree = len(self._nodes) - 1
            x = -np.cos(np.pi * np.arange(degree + 1) / degree)
            series = np.linalg.solve(np.polynomial.chebyshev.chebvander(x, degree), self._nodes)
            # `noise` estimates the rounding errors of the values, plus the rounding errors of the times multiplied by the slope.
            shift = max(abs(self.t_old), abs(self.t)) / abs(self.t - self.t_old)
            noise = 4.0 * np.finfo(np.float64).eps * (np.abs(self._nodes).max(axis=0) + shift * np.ptp(self._nodes, axis=0))
            return np.where(np.abs(series) > noise, series, 0.0)

        def _between(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
            away = times[:, None] - self._at
            hit = away == 0.0
            terms = self._weights / np.where(hit, 1.0, away)
            terms = np.where(hit.any(axis=1, keepdims=True), hit.astype(np.float64), terms)
            y: NDArray[np.float64] = (terms @ self._nodes) / terms.sum(axis=1, keepdims=True)
            return y

    return Polynomial


@cache
def _method(name: str) -> Any:
    """The class of the method `name` for `solve_ivp`."""

    class Method(_scipy().OdeSolver):  # type: ignore[misc]
        y: NDArray[np.float64]
        order, error_estimator_order = ADAPTIVE[name]

        def __init__(
            self,
            fun: Callable[..., Any],
            t0: float,
            y0: Any,
            t_bound: float,
            max_step: float = np.inf,
            rtol: Any = 1e-3,
            atol: Any = 1e-6,
            vectorized: bool = False,
            first_step: float | None = None,
            **options: Any,
        ) -> None:
            super().__init__(fun, t0, y0, t_bound, vectorized)
            jac, sparsity = (options.pop(key, None) if name in IMPLICIT else None for key in ("jac", "jac_sparsity"))
            _others(name, options)
            self._stepper = _core.Stepper(
                self.fun_vectorized if vectorized else self.fun_single,
                t0,
                self.y,
                t_bound,
                name,
                _relative(rtol),
                atol,
                max_step,
                first_step,
                jac,
                sparsity,
                bool(vectorized),
            )
            self._count()

        def _count(self) -> None:
            self.nfev, self.njev, self.nlu = self._stepper.evaluations, self._stepper.jacobians, self._stepper.factorisations

        def _step_impl(self) -> tuple[bool, str | None]:
            status = Status(self._stepper.step())
            self._count()
            if status is Status.STEP_UNDERFLOW:
                return False, f"{self.TOO_SMALL_STEP} {status.advice}"
            if status is not Status.SUCCESS:
                return False, status.advice
            self.t, self.y = self._stepper.t, self._stepper.y
            return True, None

        def _dense_output_impl(self) -> Any:
            return _polynomial()(self.t_old, self.t, self._stepper.nodes())

    Method.__name__ = Method.__qualname__ = name
    Method.__doc__ = f"armlet's {name} for solve_ivp."
    return Method
