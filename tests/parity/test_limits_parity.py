"""Velocities and accelerations of the method "sns" against the reference, with bounds as arguments and from joint limits.

The reference enumerates the joints at their bounds, so that the arms are small.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_task_kinds_parity import levels
from trees import close, driven_tree

import armlet as al
from armlet import reference as ref

SIDES = ("lower", "upper")


@pytest.mark.parametrize("weighted", [False, True])
def test_levels_within_bounds(weighted: bool) -> None:
    """Velocities agree for 1 to 3 levels of 1 to 3 rows and 1 to 4 joints. Some bounds exclude a velocity of zero."""
    rng = np.random.default_rng(7)
    scaled = 0
    for _ in range(6):
        n = int(rng.integers(1, 5))
        Js = [rng.normal(size=(int(rng.integers(1, 4)), n)) for _ in range(int(rng.integers(1, 4)))]
        vs = [rng.normal(size=len(J)) for J in Js]
        root = rng.normal(size=(n, n)) + 3 * np.eye(n)
        options: dict[str, Any] = {"weight": root @ root.T} if weighted else {}
        upper = rng.uniform(0.0, 0.6, n)
        for bounds in (
            {"v_max": 0.4},
            {"v_min": -0.3},
            {"v_min": rng.uniform(-0.5, 0.0, n), "v_max": upper},
            {"v_min": 0.1, "v_max": upper + 0.2},
        ):
            got, want = al.solve_priority(Js, vs, method="sns", **bounds, **options), ref.solve_priority(Js, vs, "sns", **bounds, **options)
            # Without the columns of joints at their bounds, the rows have singular values down to 1e-4.
            close(got.v, want.v, tolerance=1e-9)
            close(got.scales, want.scales, tolerance=1e-9)
            assert list(got.ranks) == want.ranks
            scaled += int(np.any((want.scales > 0.0) & (want.scales < 1.0)))
    assert scaled >= 8


@pytest.mark.parametrize("name", ["PriorityVelocity", "PriorityAcceleration"])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_limits_given(name: str, n: int) -> None:
    """Bounds of each kind agree, alone and together, also for a joint beyond its limit."""
    arm, theirs = driven_tree(n, 3)
    rng = np.random.default_rng(n)
    given = [
        {"v_max": 0.3},
        {"v_min": -0.4, "v_max": rng.uniform(0.1, 0.5, n)},
        {"q_min": -0.3, "q_max": 0.35},
        {"a_max": 0.8},
        {"a_max": rng.uniform(0.5, 2.0, n), "horizon": 0.02, "q_max": 0.3, "v_min": -0.2},
    ]
    saturated = 0
    for limits in given:
        law = getattr(al, name)(arm, levels(al, arm, n, name), "sns", **limits)
        other = getattr(ref, name)(theirs, levels(ref, arm, n, name), "sns", **limits)
        for q, v in rng.uniform(-0.5, 0.5, (4, 2, n)):
            want = other.terms(0.2, q, v)
            close(law(0.2, q, v), want["tau"], tolerance=1e-9)
            bounds = other._limited(q, v)
            saturated += int(np.any((want["u"] == bounds["v_min"]) | (want["u"] == bounds["v_max"])))
    assert saturated >= 4


@pytest.mark.parametrize("name", ["PriorityVelocity", "PriorityAcceleration"])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_limits_with_exact(name: str, n: int) -> None:
    """The method "exact" agrees with an enumeration of active sets, also for a joint beyond its limit, and with own limits."""
    arm, theirs = driven_tree(n, 3)
    given = [{"v_max": 0.3}, {"limits": True}, {"a_max": 0.8, "q_max": 0.3, "q_min": -0.3, "v_min": -0.2, "horizon": 0.05}]
    active = 0
    # The reference has no torque limits.
    own: dict[str, Any] = {"tau_max": np.inf} if name == "PriorityAcceleration" else {}
    for limits in given:
        law = getattr(al, name)(arm, levels(al, arm, n, name)[:2], "exact", **limits, **own)
        other = getattr(ref, name)(theirs, levels(ref, arm, n, name)[:2], "exact", **limits)
        for q, v in np.random.default_rng(n).uniform(-0.5, 0.5, (4, 2, n)):
            want = other.terms(0.2, q, v)
            close(law(0.2, q, v), want["tau"], tolerance=1e-8)
            bounds = other._limited(q, v)
            at_bound = [bool(np.isclose(want["u"], bounds[name], rtol=1e-9, atol=0.0).any()) for name in ("v_min", "v_max")]
            active += any(at_bound)
            sides = {limit.side for limit in law.terms(0.2, q, v)["limits"]}
            # A joint beyond its limit has equal bounds, so that its row is a task.
            assert np.any(bounds["v_min"] == bounds["v_max"]) or sides == {side for side, at in zip(SIDES, at_bound, strict=True) if at}
    assert active >= 3


@pytest.mark.parametrize("n", [1, 2, 3])
def test_accelerations_of_one_sample(n: int) -> None:
    """Bounds after which a joint can still stop agree with a bisection, also for a joint beyond its limits."""
    arm, theirs = driven_tree(n, 3)
    rng = np.random.default_rng(n)
    given = [
        {"q_max": 0.3, "a_max": 2.0},
        {"q_min": -0.3, "q_max": 0.35, "v_max": 0.4},
        {"a_max": rng.uniform(0.5, 4.0, n), "q_min": -0.2, "q_max": 0.3, "v_min": -0.2},
    ]
    active = 0
    for limits in given:
        for h in (0.01, 0.2):
            law = al.PriorityAcceleration(arm, levels(al, arm, n, "PriorityAcceleration")[:1], "exact", **limits)
            other = ref.PriorityAcceleration(theirs, levels(ref, arm, n, "PriorityAcceleration")[:1], "exact", sample_time=h, **limits)
            for q, v in rng.uniform(-0.4, 0.4, (5, 2, n)):
                want, terms = other._limited(q, v), law.terms(0.2, q, v, sample_time=h)
                # The bisection ends at neighbouring numbers, which are divided by h.
                close(terms["lower"], want["v_min"], tolerance=1e-11)
                close(terms["upper"], want["v_max"], tolerance=1e-11)
                close(terms["tau"], other.terms(0.2, q, v)["tau"], tolerance=1e-8)
                active += len(terms["limits"])
    assert active >= 5


@pytest.mark.parametrize("n", [1, 2])
def test_torque_limits(n: int) -> None:
    """Torques within limits, and bounds that contradict them, agree with an enumeration of active sets."""
    arm, theirs = driven_tree(n, 3)
    kind, statuses = "PriorityAcceleration", set()
    for tau_max in (0.3, 2.0):
        for limits in ({}, {"q_max": 0.1, "a_max": 3.0}, {"v_max": 0.2}):
            law = al.PriorityAcceleration(arm, levels(al, arm, n, kind)[:2], "exact", tau_max=tau_max, **limits)
            other = ref.PriorityAcceleration(theirs, levels(ref, arm, n, kind)[:2], "exact", tau_max=tau_max, **limits)
            for q, v in np.random.default_rng(n).uniform(-0.5, 0.5, (3, 2, n)):
                want, terms = other.terms(0.2, q, v), law.terms(0.2, q, v)
                close(law(0.2, q, v), want["tau"], tolerance=1e-8)
                assert np.abs(terms["tau"]).max() <= tau_max * (1 + 1e-9)
                if limits:
                    bounds = other._limited(q, v)
                    missed = want["u"] - np.clip(want["u"], bounds["v_min"], bounds["v_max"])
                    close(terms["limit_violations"], missed, tolerance=1e-8)
                statuses.add(terms["status"])
    assert al.Status.INFEASIBLE in statuses and len(statuses) > 1


@pytest.mark.parametrize("n", [2, 4])
def test_limits_of_the_arm(n: int) -> None:
    """Bounds from the limits of the arm agree, for velocities and for accelerations."""
    arm, theirs = driven_tree(n, 2)
    for name, speed in (("PriorityVelocity", 0.0), ("PriorityAcceleration", 1.0)):
        law = getattr(al, name)(arm, levels(al, arm, n, name), "sns")
        other = getattr(ref, name)(theirs, levels(ref, arm, n, name), "sns")
        for t, (q, v) in zip((0.0, 0.7), np.random.default_rng(n).uniform(-0.4, 0.4, (2, 2, n)), strict=True):
            close(law(t, q, speed * v), other(t, q, speed * v), tolerance=1e-9)


@pytest.mark.parametrize("n", [2, 4])
def test_solvers_within_bounds(n: int) -> None:
    """`PrioritySolver` and `PrioritySolver.for_arm` with bounds return the reference's velocities."""
    arm, theirs = driven_tree(n, 1)
    rng = np.random.default_rng(n)
    tasks, others = levels(al, arm, n)[:2], levels(ref, arm, n)[:2]
    for bounds in ({"v_max": 0.4}, {"v_min": -0.3}, {"v_min": -0.2, "v_max": rng.uniform(0.1, 0.5, n)}):
        of_arm = al.PrioritySolver.for_arm(arm, tasks, method="sns", **bounds)
        for q in rng.uniform(-1.0, 1.0, (5, n)):
            Js = [other.jacobian(theirs, q) for other in others]
            vs = [rng.normal(size=len(J)) for J in Js]
            want = ref.solve_priority(Js, vs, "sns", **bounds)
            plain = al.PrioritySolver(n, [len(J) for J in Js], method="sns", **bounds)
            for got in (of_arm.solve(q, vs), plain.solve(Js, vs)):
                close(got, want.v, tolerance=1e-9)
