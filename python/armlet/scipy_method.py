"""armlet's adaptive methods under `scipy.integrate.solve_ivp`."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from .arguments import shown
from .border import border
from .errors import InputError
from .status import Status

__all__ = ["scipy_method"]

ADAPTIVE = ("dopri5", "dop853", "radau5", "rodas4")


@border
def scipy_method(name: str) -> Any:
    """A class for `solve_ivp(method=...)`: the steps, the polynomials and the Jacobians are armlet's, the loop is scipy's.

    Args:
        name: "dopri5", "dop853", "radau5" or "rodas4".

    Returns:
        A subclass of `scipy.integrate.OdeSolver` with the options rtol, atol, max_step, first_step and jac (a matrix or a callable).

    Raises:
        InputError: the name is unknown.
        ImportError: scipy is not installed.

    >>> import armlet as al
    >>> from scipy.integrate import solve_ivp
    >>> solution = solve_ivp(lambda t, y: -y, (0.0, 1.0), [1.0], method=al.scipy_method("dop853"), rtol=1e-10, atol=1e-12)
    >>> float(solution.y[0, -1].round(7))
    0.3678794
    """
    if not isinstance(name, str) or name not in ADAPTIVE:
        raise InputError(f"scipy_method: name is unknown: expected one of {', '.join(ADAPTIVE)}, got {shown(name)}")
    return _method(name)


@cache
def _method(name: str) -> Any:
    try:
        scipy: Any = importlib.import_module("scipy.integrate")
    except ImportError:
        raise ImportError("scipy_method: scipy is not installed: pip install scipy") from None

    class Polynomial(scipy.DenseOutput):  # type: ignore[misc]
        """The polynomial of one step, by its values at the Chebyshev points."""

        def __init__(self, t_old: float, t: float, nodes: NDArray[np.float64]) -> None:
            super().__init__(t_old, t)
            degree = len(nodes) - 1
            self._at = t_old + 0.5 * (1.0 - np.cos(np.pi * np.arange(degree + 1) / degree)) * (t - t_old)
            self._at[-1] = t
            self._nodes = nodes
            self._weights = (-1.0) ** np.arange(degree + 1)
            self._weights[[0, -1]] *= 0.5

        def _call_impl(self, t: NDArray[np.float64]) -> Any:
            away = np.atleast_1d(t)[:, None] - self._at
            hit = away == 0.0
            terms = self._weights / np.where(hit, 1.0, away)
            terms = np.where(hit.any(axis=1, keepdims=True), hit.astype(np.float64), terms)
            y = (terms @ self._nodes) / terms.sum(axis=1, keepdims=True)
            return y[0] if t.ndim == 0 else y.T

    class Method(scipy.OdeSolver):  # type: ignore[misc]
        y: NDArray[np.float64]

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
            jac: Any = None,
            **extraneous: Any,
        ) -> None:
            super().__init__(fun, t0, y0, t_bound, vectorized)
            if extraneous:
                raise InputError(f"scipy_method: {', '.join(extraneous)} is unknown: expected rtol, atol, max_step, first_step, jac")
            self._stepper = _core.Stepper(self.fun_single, t0, self.y, t_bound, name, rtol, atol, max_step, first_step, jac)

        def _step_impl(self) -> tuple[bool, str | None]:
            code = self._stepper.step()
            self.njev, self.nlu = self._stepper.jacobians, self._stepper.factorisations
            self.nfev = self._stepper.evaluations
            if code:
                return False, Status(code).advice
            self.t, self.y = self._stepper.t, self._stepper.y
            return True, None

        def _dense_output_impl(self) -> Polynomial:
            return Polynomial(self.t_old, self.t, self._stepper.nodes())

    Method.__name__ = Method.__qualname__ = name
    Method.__doc__ = f"armlet's {name} for solve_ivp."
    return Method
