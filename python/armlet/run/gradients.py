"""The gradient of a loss of a run, from the adjoint equations or from the tangents of the run.

A *loss* is one number computed from the records of a run. A *tangent* is the derivative of the recorded series with respect to one number.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from ..arguments import count, instance
from ..border import border
from ..errors import InputError
from ..scenario import Scenario
from ..status import Status, having
from .losses import Loss, along_tangents, evaluated
from .named_numbers import Varied
from .options import BatchOptions, LoopOptions, RunOptions
from .recorded import Array
from .sensitivity import derived, naming, options_at, require_names, split, vary, vary_rows
from .simulation import simulate, simulate_batch

__all__ = ["MOVING", "gradient", "of_loops", "require_still_reference"]


@border
def gradient(
    loss: Loss,
    plant: _core.Plant | Sequence[_core.Plant] | Scenario,
    law: _core.Law | Sequence[_core.Law] | None = None,
    q0: ArrayLike | None = None,
    names: str | Sequence[str] | None = None,
    *,
    memory: int = 1 << 26,
    **keywords: Any,
) -> tuple[Any, dict[str, Array]]:
    """Compute a loss of a closed loop, and its derivatives with respect to named numbers of the loop.

    The loss `L` is a function of the records of one run. The state `x` has the steps `x_(k+1) = Phi(x_k, p)`, with the numbers `p`. The
    discrete adjoint `l_k` is computed backwards through all K steps of the run:

        l_K = L_x(K),   l_k = Phi_x' l_(k+1) + L_x(k),   dL/dp = x0_p' l_0 + sum Phi_p' l_(k+1) + L_p

    A subscript x or p is a derivative, `L_x(k)` the derivative of the loss with respect to `x_k`. `x0` is the initial state, and `'` the
    transpose. The number of steps backwards does not depend on the number of parameters.

    Args:
        loss: one of three forms.
            A name, or a dict of names with weights: each of "error_rms", "error_final", "tau_rms" is the sum over the joints of the
            squared metric.
            A function `loss(run) -> (value, slopes)`: `slopes` is a dict of the derivatives by series, such as `{"q": (K, n)}`.
            A function `loss(run) -> value` that numpy can also compute for complex numbers. It is differentiated by one complex step along
            each tangent of the run, one per parameter, so use it for few parameters. `run` has `t`, `q`, `v`, `tau`, `estimate`, `theta`,
            `theta_dot`, `bristles`.
        plant: the plant, or for a batch also a list with one plant per row. A `Scenario` replaces plant, law, q0 and keywords.
        law: the law, or for a batch also a list with one law per row.
        q0: initial position, (n,), rad or m; (B, n) for a batch. The threads share the rows of a batch.
        names: names of numbers such as `["law.kp", "arm.parameters", "q0"]`, as for `simulate(sensitivity=)`.
        memory: approximate limit of the stored states, bytes. States between two stored states are computed again. The limit holds for
            each thread of a batch.
        keywords: the keywords of `simulate`, including `t_end`. For a batch: the keywords of `simulate_batch` that concern its runs, and
            `threads`.

    Returns:
        The value of the loss, and a dict with one array per name. The array has the shape of the number, and its unit is the unit of the
        loss per unit of the number. For a batch the value is (B,) and the arrays are (B, ..). Both are NaN in a row that did not reach its
        end.

    Raises:
        InputError: an argument has a wrong type, shape or value, or a function without slopes is not analytic.
        SolveError: the run did not reach its end, or the loop is not differentiable along the run.

    Source:
        Griewank and Walther 2008 [GriewankWalther2008], chapters 3 and 12.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> law = al.PDGravity(arm, target=[0.4, 0.9], kp=[8.0, 6.0], kd=[1.6, 1.2])
    >>> names = ["law.kp", "law.kd"]
    >>> value, slopes = al.gradient("error_rms", al.RigidArm(arm), law, [0.0, 0.0], names, t_end=1.0, dt=1e-3)
    >>> slopes["law.kp"].shape
    (2,)
    """
    count("gradient", "memory", memory)
    if isinstance(plant, Scenario):
        built = plant.build()
        if law is not None or q0 is not None:
            raise InputError("gradient: law and q0 are in the scenario: expected None for both")
        plant, law = built.plant, built.law
        keywords = {**built.arguments, **keywords}
        q0 = keywords.pop("q0")
        keywords.pop("sensitivity", None)
    if q0 is not None and _core.numbers("gradient", "q0", q0).ndim == 2:
        return _of_batch(loss, plant, law, q0, require_names("gradient", "names", names), int(memory), keywords)
    instance("gradient", "plant", plant, _core.Plant, "a plant such as RigidArm, or a Scenario")
    chosen = require_names("gradient", "names", names)
    for name in ("sensitivity", "throw"):
        if name in keywords:
            raise InputError(f"gradient: {name} is not used: expected keywords of simulate without {name}")
    options = cast(RunOptions, {"monitors": False, **keywords})
    loops = vary("gradient", plant, law, q0, options, chosen)
    require_still_reference("gradient", loss, chosen)
    value, flat = of_loops("gradient", loss, (plant, law, q0), loops, options, int(memory))
    return value, {named.name: np.array(flat[part]).reshape(named.value.shape) for named, part in split(loops.names)}


def of_loops(function: str, loss: Loss, loop: tuple[Any, Any, Any], loops: Varied, options: RunOptions, memory: int) -> tuple[float, Array]:
    """Return a loss of the loop (plant, law, q0), and its derivatives with respect to the P numbers that differ in `loops`, (P,)."""
    run = simulate(*loop, **options)
    value, slopes = evaluated(loss, run)

    def given(loops: Varied) -> LoopOptions:
        return options_at(options, loops, run.t)

    if slopes is not None:
        return value, derived(function, loops, lambda loops: _core._adjoint(*loops.runs, slopes, memory, given(loops)))
    assert callable(loss), "a loss without slopes is a function"
    rates = derived(function, loops, lambda loops: _core._sensitivities(*loops.runs, given(loops)))
    return value, along_tangents(loss, run, rates)


def _of_batch(
    loss: Loss, plant: Any, law: Any, q0: ArrayLike, names: list[str], memory: int, keywords: dict[str, Any]
) -> tuple[Array, dict[str, Array]]:
    """Return the loss of each row of a batch, (B,), and its derivatives by name, (B, ..)."""
    for name in ("sensitivity", "keep", "metrics", "progress", "out"):
        if name in keywords:
            raise InputError(f"gradient: {name} is not used: expected keywords that concern the runs of a batch")
    options = cast(BatchOptions, {"monitors": False, **keywords})
    loops = vary_rows("gradient", plant, law, q0, options, names)
    require_still_reference("gradient", loss, names)
    batch = simulate_batch(plant, law, q0, **options)
    ended = [int(r) for r in np.flatnonzero(having(batch.status, Status.SUCCESS))]
    found = {r: evaluated(loss, batch[r]) for r in ended}
    values, flat = np.full(len(batch), np.nan), np.full((len(batch), loops.weights.shape[1]), np.nan)
    for r, (value, _) in found.items():
        values[r] = value
    given, threads = options_at(options, loops, batch.t), options.get("threads")
    with naming("gradient", loops):
        if all(slopes is not None for _, slopes in found.values()):
            series = {name for _, slopes in found.values() for name in slopes or ()}
            weights = {name: np.zeros_like(getattr(batch, name)) for name in series}
            for r, (_, slopes) in found.items():
                for name, slope in (slopes or {}).items():
                    weights[name][r] = slope
            rows = {name: values.reshape(-1, values.shape[-1]) for name, values in weights.items()}
            flat[ended] = _core._adjoint_of_rows(*loops.runs, rows, memory, threads, given)[ended]
        else:
            assert callable(loss), "a loss without slopes is a function"
            rates = _core._sensitivities_of_rows(*loops.runs, threads, given)
            for r in ended:
                flat[r] = along_tangents(loss, batch[r], {name: rate[r] for name, rate in rates.items()})
    shaped = {named.name: flat[:, part].reshape(-1, *named.value.shape) for named, part in split(loops.names)}
    return values, shaped


#: Names of numbers that change the reference of the joints, of a law and of the law inside a `Guarded` law.
MOVING = re.compile(r"(law\.)*(motion\.|target\b)")


def require_still_reference(function: str, loss: Any, names: Sequence[str]) -> None:
    """Raise an error if a name changes the reference trajectory and a named term of the loss measures the error from this reference."""
    terms = [loss] if isinstance(loss, str) else list(loss) if isinstance(loss, Mapping) else []
    moving = [name for name in names if MOVING.match(name)]
    if moving and any(str(term).startswith("error") for term in terms):
        problem = f"expected no name that moves the reference, got {moving[0]}; use a function with a fixed reference"
        raise InputError(f"{function}: loss measures the error from the reference of the law: {problem}")
