"""Condition number and standard deviations of `exciting_motion` against the reference: 1 to 8 joints.

The reference decomposes the stacked regressor with a dense method.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from trees import driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]

LIMITS: dict[str, Any] = {"q_min": -1.5, "q_max": 1.2, "v_max": 3.0, "a_max": 10.0, "effort": np.inf}


def record(m: al.ExcitingMotion, count: int) -> tuple[Array, Array, Array]:
    q, v, a = (np.array(x) for x in zip(*(m(t) for t in np.arange(count) * (m.duration / count)), strict=True))
    return q, v, a


def same(m: al.ExcitingMotion, theirs: Any, count: int, **options: Any) -> None:
    want = ref.excitation(theirs, *record(m, count), **options)
    # The condition number amplifies the rounding of the samples and of armlet's QR decomposition.
    assert m.condition == pytest.approx(want.condition, rel=1e-8)
    np.testing.assert_allclose(m.deviations, want.deviations, rtol=1e-8)


@pytest.mark.parametrize("n", range(1, 9))
def test_exciting_motion(n: int) -> None:
    arm, theirs = driven_tree(n, 3)
    m = al.exciting_motion(arm, 6.0, limits=LIMITS, harmonics=2, samples=30, iterations=2)
    assert isinstance(m, al.ExcitingMotion) and m.duration == 6.0
    same(m, theirs, 30)


@pytest.mark.parametrize(
    "options",
    [
        {"noise": [0.5, 0.1, 0.2]},
        {"armature": True},
        {"friction": True},
        {"armature": True, "friction": True, "noise": 0.3},
    ],
    ids=str,
)
def test_options_of_the_record(options: dict[str, Any]) -> None:
    arm, theirs = driven_tree(3, 5)
    m = al.exciting_motion(arm, 4.0, limits=LIMITS, harmonics=3, iterations=5, **options)
    same(m, theirs, 60, **options)


def test_options_of_the_search() -> None:
    """More starts or iterations never give a worse motion, and another seed gives a different one.

    The frequencies are multiples of 2 pi / duration.
    """
    arm, theirs = driven_tree(2, 7)

    def logdet(m: al.ExcitingMotion) -> float:
        q, v, a = record(m, 40)
        base = ref.base_parameters(theirs)
        W = theirs.regressor(q, v, v, a)[..., base.columns].reshape(-1, base.columns.size)
        return float(np.linalg.slogdet(W.T @ W)[1])

    first = al.exciting_motion(arm, 5.0, limits=LIMITS, harmonics=2, iterations=3, seed=4)
    again = al.exciting_motion(arm, 5.0, limits=LIMITS, harmonics=2, iterations=3, seed=4)
    assert first == again and first != al.exciting_motion(arm, 5.0, limits=LIMITS, harmonics=2, iterations=3, seed=5)
    assert logdet(al.exciting_motion(arm, 5.0, limits=LIMITS, harmonics=2, iterations=3, seed=4, starts=3)) >= logdet(first)
    assert logdet(al.exciting_motion(arm, 5.0, limits=LIMITS, harmonics=2, iterations=40, seed=4)) > logdet(first)
    keywords = first.__getnewargs_ex__()[1]
    np.testing.assert_allclose(keywords["frequency"], np.broadcast_to(2.0 * np.pi / 5.0 * np.array([1.0, 2.0]), (2, 2)), rtol=1e-15)
    theirs_motion = ref.Sinusoid(*(keywords[name] for name in ("offset", "amplitude", "frequency", "phase")))
    for t in (0.3, 7.9):
        # The motion is a sum of a few sines, so both agree up to rounding.
        np.testing.assert_allclose(np.array(first(t)), np.array(theirs_motion(t)), rtol=0.0, atol=1e-12)
