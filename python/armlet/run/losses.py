"""Losses of a run and their slopes. *Slopes* are the derivatives of a loss with respect to each recorded number.

A loss is the name of a term, a table of named terms with weights, or a function. A function returns a value and its slopes, or only a
value.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any, TypeAlias

import numpy as np
from numpy.exceptions import ComplexWarning

from .. import _core
from ..arguments import number, shown
from ..errors import InputError
from .metrics import _weights
from .recorded import SERIES, Array
from .records import Run

__all__ = ["TERMS", "Loss", "along_tangents", "evaluated"]

Loss: TypeAlias = str | Mapping[str, float] | Callable[[Any], Any]

#: Named terms of a loss. Each term is the sum over the joints of the squared metric with this name.
TERMS = ("error_rms", "error_final", "tau_rms")
COMPLEX_STEP = 1e-30
# Largest relative difference between a complex step and a central difference of an analytic loss.
ANALYTIC = 1e-5


def evaluated(loss: Loss, run: Run) -> tuple[float, dict[str, Array] | None]:
    """Return the value of a loss, and its slopes by series. The slopes are None if the function returns only a number.

    Raises:
        InputError: the loss is neither a name, a table of names nor a function, or the function returns another type.
    """
    if isinstance(loss, str):
        loss = {loss: 1.0}
    if isinstance(loss, Mapping):
        return _named(loss, run)
    if not callable(loss):
        raise InputError(f"gradient: loss is of the wrong type: expected names of {list(TERMS)} or a function, got {shown(loss)}")
    found = loss(run)
    if not isinstance(found, tuple):
        return _finite("loss", found), None
    if len(found) != 2 or not isinstance(found[1], Mapping):
        raise InputError(f"gradient: loss returned something else: expected a number or (value, slopes by name), got {shown(found)}")
    value, given = found
    there = [name for name in SERIES if getattr(run, name) is not None]
    slopes = {}
    for name, slope in given.items():
        if name not in there:
            raise InputError(f"gradient: loss returned slopes of an unknown series: expected names of {there}, got {shown(name)}")
        slopes[name] = _core.numbers("gradient", f"slopes[{name!r}]", slope, getattr(run, name).shape)
        if not np.isfinite(slopes[name]).all():
            raise InputError(f"gradient: slopes[{name!r}] are not finite: expected finite numbers")
    return _finite("loss", value), slopes


def _finite(name: str, value: object) -> float:
    found = number("gradient", name, value)
    if not math.isfinite(found):
        raise InputError(f"gradient: {name} is not finite: expected a finite number, got {found}")
    return found


def _named(weights: Mapping[str, float], run: Run) -> tuple[float, dict[str, Array]]:
    value, slopes = 0.0, {"q": np.zeros_like(run.q), "tau": np.zeros_like(run.q)}
    times = _weights(run.t)[:, None]
    for name, given in weights.items():
        if name not in TERMS:
            raise InputError(f"gradient: loss has an unknown name: expected names of {list(TERMS)}, got {shown(name)}")
        weight = _finite(f"loss[{name!r}]", given)
        if name == "tau_rms":
            series, values = "tau", run.tau
            assert values is not None, "a run of simulate has recorded inputs"
        else:
            reference = run.reference()
            if reference is None:
                raise InputError(f"gradient: loss names {name}, which {run.law_name} has not: expected a law with a reference of joints")
            series, values = "q", run.q - np.broadcast_to(reference[0], run.q.shape)
        if name == "error_final":
            value += weight * float((values[-1] ** 2).sum())
            slopes[series][-1] += 2.0 * weight * values[-1]
        else:
            value += weight * float((times * values**2).sum())
            slopes[series] += 2.0 * weight * times * values
    return value, slopes


def along_tangents(loss: Callable[[Any], Any], run: Run, rates: Mapping[str, Array]) -> Array:
    """Compute the derivatives of a loss along the P tangents of the series, by one complex step per tangent.

    Args:
        loss: the loss, a function of a run.
        run: the run.
        rates: the tangents by series, (K, .., P) each.

    Returns:
        The derivatives, (P,).

    Raises:
        InputError: the loss is not analytic: a central difference along the sum of the scaled tangents has another value.
    """
    at = {name: getattr(run, name) for name in SERIES}

    def moved(direction: Mapping[str, Array], step: complex) -> Any:
        series = {name: x if name not in direction else x + step * direction[name] for name, x in at.items()}
        with warnings.catch_warnings():
            warnings.simplefilter("error", ComplexWarning)
            try:
                return loss(SimpleNamespace(t=run.t, **series))
            except (TypeError, ComplexWarning) as error:
                if np.imag(step) == 0.0 or not (isinstance(error, ComplexWarning) or "complex" in str(error)):
                    raise
                problem = "makes real numbers of complex ones, as float() and int() do"
                raise InputError(f"gradient: loss {problem}: expected numpy functions only, or (value, slopes): {error}") from None

    count = rates["q"].shape[-1]
    derivatives = np.empty(count)
    for p in range(count):
        value = moved({name: rate[..., p] for name, rate in rates.items()}, 1j * COMPLEX_STEP)
        derivatives[p] = np.imag(value) / COMPLEX_STEP
    # One central difference along the sum of all tangents checks the complex steps. Each tangent is scaled so that its largest entry is 1.
    sizes = np.max([np.abs(rate).reshape(-1, count).max(axis=0) for rate in rates.values()], axis=0)
    scales = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
    together = {name: rate @ scales for name, rate in rates.items()}
    step = 1e-6
    central = (_finite("loss", moved(together, step)) - _finite("loss", moved(together, -step))) / (2.0 * step)
    expected, size = float(derivatives @ scales), float(np.abs(derivatives) @ scales)
    if not abs(central - expected) <= ANALYTIC * max(size, abs(central)) + 1e-9 * abs(_finite("loss", moved({}, 0.0))):
        problem = f"the derivative is {central:.6g} by difference, {expected:.6g} by complex step"
        raise InputError(f"gradient: loss is not analytic: expected no abs, norm or conj, or (value, slopes); {problem}")
    return derivatives
