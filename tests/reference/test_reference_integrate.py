"""Integrators of the reference without an arm: order of convergence, jumps, and ends of the integration."""

from typing import Any

import numpy as np
import pytest

from armlet.reference import integrate


def circle(t: float, y: np.ndarray) -> np.ndarray:
    return np.array([-y[1], y[0]]) * (1.0 + 0.5 * np.cos(t))


def exact(t: float) -> np.ndarray:
    phase = t + 0.5 * np.sin(t)
    return np.array([np.cos(phase), np.sin(phase)])


@pytest.mark.parametrize("columns", [2, 3, 4, 5])
def test_extrapolated_step_has_order_two_per_column(columns: int) -> None:
    y, errors = exact(0.3), []
    for h in (0.4, 0.2):
        value, _ = integrate._extrapolate(circle, 0.3, y, h, circle(0.3, y), columns)
        errors.append(np.linalg.norm(value - exact(0.3 + h)))
    # The error of one step is of order h^(2 columns + 1). The tolerance of 0.5 covers the next term at these large steps, and rounding
    # forbids smaller steps.
    assert abs(np.log2(errors[0] / errors[1]) - (2 * columns + 1)) < 0.5


@pytest.mark.parametrize(("step", "order"), [(integrate.euler, 1), (integrate.rk4, 4)])
def test_fixed_steps_have_their_order(step: Any, order: int) -> None:
    errors = []
    for n in (40, 80):
        t, y = 0.0, exact(0.0)
        for _ in range(n):
            y = step(circle, t, y, 2.0 / n)
            t += 2.0 / n
        errors.append(np.linalg.norm(y - exact(2.0)))
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.1


def test_symplectic_euler_keeps_the_oscillator_bounded() -> None:
    step = integrate.semi_implicit(slice(0, 1), slice(1, 2))
    y = np.array([1.0, 0.0])
    for k in range(10_000):
        y = step(lambda t, x: np.array([x[1], -x[0]]), 0.1 * k, y, 0.1)
    # The method keeps q^2 + v^2 - h q v constant, up to rounding.
    assert abs(y @ y - 0.1 * y[0] * y[1] - 1.0) < 1e-11


def test_jumps_are_landed_on() -> None:
    """A step ends at the time of a jump.

    The acceleration is +1 before t = 0.75 and -3 after. The exact solution is a polynomial, which the method reproduces to rounding.
    """
    jump, calls = 0.75, 0

    def force(t: float, y: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        return np.array([y[1], 1.0 if t < jump else -3.0])

    (end,) = integrate.gbs(force, 0.0, np.zeros(2), [2.0], breaks=[jump])
    # A step across the jump would be rejected and cost more evaluations. Without rejections, 9 steps need 57 evaluations each.
    assert calls <= 12 * 57
    rest = 2.0 - jump
    np.testing.assert_allclose(end, [jump**2 / 2 + jump * rest - 1.5 * rest**2, jump - 3 * rest], atol=1e-14)


def test_evaluation_times_do_not_move_the_answer() -> None:
    dense = integrate.gbs(circle, 0.0, exact(0.0), np.linspace(0.0, 9.0, 301))
    (once,) = integrate.gbs(circle, 0.0, exact(0.0), [9.0])
    np.testing.assert_allclose(dense[-1], once, atol=1e-11)
    np.testing.assert_allclose(once, exact(9.0), atol=1e-11)
    assert np.array_equal(dense[0], exact(0.0))


def test_a_run_that_cannot_continue_ends_with_the_time() -> None:
    with pytest.raises(integrate.IntegrationError, match="finite") as caught:
        integrate.gbs(lambda t, y: np.array([np.nan]), 0.0, np.zeros(1), [1.0])
    assert caught.value.t == 0.0
    with pytest.raises(integrate.IntegrationError, match="resolution") as caught:
        integrate.gbs(lambda t, y: np.array([np.nan if t > 0.5 else 0.0]), 0.0, np.zeros(1), [1.0])
    assert caught.value.t == pytest.approx(0.5, abs=1e-12)
    with pytest.raises(integrate.IntegrationError) as caught:
        integrate.gbs(lambda t, y: y * y, 0.0, np.ones(1), [2.0], max_steps=20_000)
    assert caught.value.t == pytest.approx(1.0, abs=1e-3)  # the solution is 1/(1 - t)
