"""Types of the integration of a Python callable `f(t, y)`."""

from collections.abc import Callable, Sequence
from typing import Any, Self, final

from numpy.typing import ArrayLike

from ._types import _Array

@final
class Stepper:
    """An initial-value problem during its integration."""
    def __new__(
        cls,
        f: Callable[..., ArrayLike],
        t0: float,
        y0: ArrayLike,
        t_bound: float,
        method: str,
        rtol: ArrayLike,
        atol: ArrayLike,
        max_step: float | None,
        first_step: float | None,
        jac: Callable[..., Any] | ArrayLike | None,
        jac_sparsity: ArrayLike | None,
        vectorized: bool,
    ) -> Self: ...
    def step(self) -> int:
        """Advance by one accepted step, and return the code of its status."""
    def nodes(self) -> _Array:
        """The polynomial of the last step: its values at its nodes, `(degree + 1, n)`."""
    @property
    def t(self) -> float: ...
    @property
    def y(self) -> _Array: ...
    @property
    def evaluations(self) -> int:
        """The number of evaluations of `f`. As in scipy, it excludes evaluations for difference quotients."""
    @property
    def jacobians(self) -> int: ...
    @property
    def factorisations(self) -> int: ...

def integrate(
    f: Callable[..., ArrayLike],
    t0: float,
    t1: float,
    y0: ArrayLike,
    method: str,
    rtol: ArrayLike,
    atol: ArrayLike,
    dt: float | None,
    t_eval: ArrayLike | None,
    dense: bool,
    events: Sequence[tuple[Callable[..., Any], float, int]],
    jac: Callable[..., Any] | ArrayLike | None,
    jac_sparsity: ArrayLike | None,
    args: tuple[Any, ...],
    max_step: float | None,
    first_step: float | None,
    positions: int,
    lists: bool,
    vectorized: bool,
) -> dict[str, Any]:
    """Integrate `dy/dt = f(t, y)`, and return a dict with the fields of the result."""
