"""Motions of the reference: values at the ends, derivatives against differences, and rest outside the duration."""

from typing import Any

import numpy as np
import pytest

from armlet import reference as ref

Q0, Q1, T = np.array([0.2, -1.0, 3.0]), np.array([1.2, 0.5, 3.0]), 1.7
MOTIONS = {
    "hold": ref.Hold(Q0),
    "sinusoid": ref.Sinusoid(Q0, [[0.5, 0.2], [0.8, 0.0], [0.1, 0.3]], [[1.0, 2.3], [1.7, 0.6], [0.0, 4.0]], 0.4),
    "quintic": ref.Quintic(Q0, Q1, T),
    "bang_bang": ref.BangBang(Q0, Q1, T),
}


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("t", [-0.3, 0.1, 0.5, 1.2, 1.65, 2.5])
def test_rates_are_differences(name: str, t: float) -> None:
    motion: Any = MOTIONS[name]
    h = 1e-5
    before, now, after = (motion(t + d) for d in (-h, 0.0, h))
    # Central differences with h = 1e-5 have a truncation error proportional to h^2, and a rounding error of about 1e-16/h.
    np.testing.assert_allclose((after[0] - before[0]) / (2 * h), now[1], atol=1e-8)
    np.testing.assert_allclose((after[1] - before[1]) / (2 * h), now[2], atol=1e-8)


@pytest.mark.parametrize("name", ["quintic", "bang_bang"])
def test_rest_outside(name: str) -> None:
    motion: Any = MOTIONS[name]
    for t, rest in ((-1.0, Q0), (T, Q1), (T + 5.0, Q1)):
        q, v, a = motion(t)
        assert np.array_equal(q, rest) and not v.any() and not a.any()
    np.testing.assert_allclose(motion(0.0)[0], Q0, atol=1e-15)
    np.testing.assert_allclose(motion(np.nextafter(T, 0.0))[0], Q1, atol=1e-14)


def test_quintic_closed_form() -> None:
    for x in (0.0, 0.25, 0.5, 0.9):
        q, v, _ = ref.Quintic(Q0, Q1, T)(x * T)
        np.testing.assert_allclose(q, Q0 + (Q1 - Q0) * (10 * x**3 - 15 * x**4 + 6 * x**5), atol=1e-14)
        np.testing.assert_allclose(v, (Q1 - Q0) * 30 * x**2 * (1 - x) ** 2 / T, atol=1e-13)


def test_bang_bang_switch_is_right_continuous() -> None:
    motion = MOTIONS["bang_bang"]
    A = 4 * (Q1 - Q0) / T**2
    np.testing.assert_allclose(motion(0.0)[2], A, atol=1e-14)
    np.testing.assert_allclose(motion(np.nextafter(T / 2, 0.0))[2], A, atol=1e-14)
    np.testing.assert_allclose(motion(T / 2)[2], -A, atol=1e-14)
    np.testing.assert_allclose(motion(T / 2)[0], (Q0 + Q1) / 2, atol=1e-14)


def test_sinusoid_shapes_agree() -> None:
    flat = ref.Sinusoid([0.1, 0.2], [1.0, 2.0], [3.0, 0.0], [0.5, 0.7])
    deep = ref.Sinusoid([0.1, 0.2], [[1.0], [2.0]], [[3.0], [0.0]], [[0.5], [0.7]])
    for x, y in zip(flat(0.8), deep(0.8), strict=True):
        assert np.array_equal(x, y)
    np.testing.assert_allclose(flat(0.8)[0], [0.1 + np.sin(2.9), 0.2 + 2 * np.sin(0.7)], atol=1e-15)
    assert flat(0.8)[1][1] == 0.0
