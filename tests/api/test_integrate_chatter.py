"""Right-hand sides that chatter: `integrate` and `solve_ivp` have the same limit of work and the same result."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armlet as al

ADAPTIVE = ("dopri5", "dop853", "radau5", "rodas4")


class Switch:
    """Two states that slide along the switching surfaces `y_0 = 0` and `y_1 = 0.3`. The object counts its calls."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, t: float, y: Any) -> list[float]:
        self.calls += 1
        return [-np.sign(y[0]), -2 * np.sign(y[1] - 0.3)]


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("tolerances", [{"rtol": 1e-8, "atol": 1e-10}, {"rtol": 1e-6, "atol": 1e-8}, {"rtol": 1e-3, "atol": 1e-6}])
def test_one_budget_and_one_outcome(method: str, tolerances: dict[str, float]) -> None:
    ours, theirs = Switch(), Switch()
    began = time.perf_counter()
    run = al.integrate(ours, (0.0, 5.0), [1.0, 1.0], method=method, throw=False, **tolerances)
    solution = solve_ivp(theirs, (0.0, 5.0), [1.0, 1.0], method=al.scipy_method(method), **tolerances)
    # An optimised build takes a tenth of this time.
    assert time.perf_counter() - began < 20.0
    assert run.status in (al.Status.STALLED, al.Status.STEP_UNDERFLOW)
    assert not solution.success and solution.message.endswith(run.status.advice)
    assert solution.t[-1] == run.ended and np.array_equal(solution.y[:, -1], run.y[-1])
    # The runs make at most 5,000 attempts along the surface and 1,000 before it. Each attempt has at most 20 evaluations.
    assert run.stats["steps"] + run.stats["rejections"] < 6_000
    assert ours.calls < 120_000 and abs(ours.calls - theirs.calls) < 10


def test_the_defaults_of_both_agree() -> None:
    for method in ADAPTIVE:
        run = al.integrate(Switch(), (0.0, 5.0), [1.0, 1.0], method=method, throw=False)
        solution = solve_ivp(Switch(), (0.0, 5.0), [1.0, 1.0], method=al.scipy_method(method))
        assert not run.success and not solution.success


# Only explicit methods are tested. Implicit methods take many more steps during the slide.
@pytest.mark.parametrize("method", ["dopri5", "dop853"])
def test_a_short_slide_is_no_fault(method: str) -> None:
    """A state is at rest by friction for 1 ms, until the driving force exceeds the friction. This short slide must not end the run."""
    run = al.integrate(
        lambda t, y: [-np.sign(y[0]) + (20 * t if t > 0.051 else 0.0)], (0.0, 0.2), [0.05], method=method, rtol=1e-3, atol=1e-6
    )
    # From 0.051 s on, 20 t > 1, so y' = 20 t - 1.
    assert run.y[-1, 0] == pytest.approx(10 * (0.04 - 0.051**2) - 0.149, abs=1e-4)
