"""Velocity bounds of one sample from joint limits against the reference, which finds the largest allowed velocity by bisection."""

from __future__ import annotations

import numpy as np
from trees import close

import armlet as al
from armlet import reference as ref


def test_bounds_of_a_sample() -> None:
    """Bounds agree inside, at and beyond limits, with and without acceleration limits, and for joints without limits."""
    rng = np.random.default_rng(2)
    inf = np.inf
    for n in range(1, 9):
        for _ in range(20):
            q, q_min = rng.uniform(-2.0, 2.0, n), np.where(rng.random(n) < 0.2, -inf, rng.uniform(-1.5, 0.0, n))
            q_max = np.where(rng.random(n) < 0.2, inf, rng.uniform(0.0, 1.5, n))
            q = np.where(rng.random(n) < 0.2, np.clip(q, q_min, q_max), q)
            v_max, a_max = rng.uniform(0.1, 3.0, n), rng.uniform(0.1, 5.0, n)
            for options in ({}, {"a_max": a_max}, {"a_max": 0.5}):
                for dt in (0.01, 1.3):
                    got = al.velocity_bounds(q, q_min, q_max, v_max, dt=dt, **options)
                    want = ref.velocity_bounds(q, q_min, q_max, v_max, dt=dt, **options)
                    for mine, theirs in zip(got, want, strict=True):
                        close(mine, theirs)
        for mine, theirs in zip(al.velocity_bounds(q, -1.0, 1.0, 2.0, dt=0.1), ref.velocity_bounds(q, -1.0, 1.0, 2.0, dt=0.1), strict=True):
            close(mine, theirs)
