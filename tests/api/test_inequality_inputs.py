"""The Python interface of priorities with inequalities: refused arguments, fields of solutions, batches, pickles, reasons."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from models import THREE_LINKS

import armlet as al

J1, J2 = np.array([[1.0, 2.0, 0.0, 1.0], [0.0, 1.0, 1.0, -1.0]]), np.array([[2.0, 0.0, 1.0, 1.0]])
V1, V2 = np.array([1.0, -2.0]), np.array([3.0])
INSIDE = al.Within([-0.5], [0.5])
solve = al.solve_priority
ONE: dict[str, Any] = {"scale": 1.0}
BAD: list[tuple[str, Callable[[], object], str]] = [
    ("order", lambda: solve([J1, J2], [V1, al.Within([1.0], [0.0])]), r"velocities\[1\] is out of order: .* got 1 and 0 .*index 0"),
    ("order, row", lambda: solve([J1], [al.Within([0.0, 2.0], [1.0, 1.0])]), r"velocities\[0\] is out of order: .*\(first bad index 1\)"),
    ("no number", lambda: solve([J2], [al.Within([np.inf], [np.inf])]), r"velocities\[0\] is out of order"),
    ("NaN", lambda: al.Within([0.0, np.nan], [1.0, 1.0]), r"Within: lower is not a number: .* \(first bad index 1\)"),
    ("NaN above", lambda: al.Within(0.0, np.nan), "Within: upper"),
    ("text", lambda: al.Within("a", 1.0), "Within: lower is not an array of real numbers"),
    ("shapes", lambda: al.Within([0.0, 0.0], [1.0, 1.0, 1.0]), "Within: lower, upper do not broadcast"),
    ("rows", lambda: solve([J1], [INSIDE]), r"velocities\[0\] has the wrong shape: expected \(2,\), got \(1,\)"),
    (
        "chiaverini",
        lambda: solve([J2], [INSIDE], method="chiaverini"),
        "method is wrong: expected clamp, damped, exact or sns for a stack with bounds",
    ),
    ("sns", lambda: solve([J2], [INSIDE], method="sns"), "v_max is missing"),
    ("scale", lambda: solve([J2], [V2], method="exact", scale="largest"), "scale is unknown: expected direction or None, got largest"),
    ("scale, type", lambda: solve([J2], [V2], method="exact", **ONE), "scale is not a name"),
    ("scale, clamp", lambda: solve([J2], [V2], scale="direction"), "scale takes effect only with the methods exact and sns"),
    ("scale, solver", lambda: al.PrioritySolver(4, [1], method="damped", scale="direction"), "scale takes effect only with the methods"),
    (
        "scale, arm",
        lambda: al.PrioritySolver.for_arm(THREE_LINKS, [al.Task("link3", "xy")], scale="direction"),
        "PrioritySolver.for_arm: scale takes effect only",
    ),
    ("chiaverini, v_max", lambda: solve([J2], [V2], method="chiaverini", v_max=1.0), "v_max takes effect only with the methods exact"),
    ("v_min", lambda: solve([J2], [V2], v_min=2.0, v_max=1.0), "v_min is out of order"),
    ("task beside bounds", lambda: solve([J1, J2], [[np.inf, 0.0], INSIDE]), r"velocities\[0\] is not finite: .* \(first bad index 0\)"),
    ("Jacobian", lambda: solve([J2 * np.nan], [INSIDE]), r"jacobians\[0\] is not finite"),
    ("solver", lambda: al.PrioritySolver(4, [1]).solve([J2], [al.Within([2.0], [1.0])]), r"velocities\[0\] is out of order"),
    ("why", lambda: solve([J2], [V2]).why(2), "k is not a level: expected 1 to 1, got 2"),
    ("why, zero", lambda: solve([J2], [V2]).why(0), "PrioritySolution.why: k is not a"),
    ("why, batch", lambda: solve([J2[None]], [V2]).why(1), "k has no use in a batch"),
    ("diagnosis", lambda: al.diagnose_priority([J2], v_max=1.0), "rhs is missing"),
]


@pytest.mark.parametrize(("call", "message"), [pytest.param(*rest, id=name) for name, *rest in BAD])
def test_refusals(call: Callable[[], object], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        call()


def test_fields() -> None:
    sol = solve([J1, J2], [V1, INSIDE], method="exact", v_max=[0.5, 9.0, 9.0, 9.0])
    assert isinstance(sol.violations, list) and [w.shape for w in sol.violations] == [(2,), (1,)]
    np.testing.assert_allclose(sol.violations[0], 0.0, atol=1e-14)
    np.testing.assert_array_equal(sol.residuals[0], V1 - J1 @ sol.v)
    assert np.isnan(sol.residuals[1]).all()
    assert sol.active[0] == [] and isinstance(sol.changes, int) and 0 <= sol.certificate <= 1e-14
    assert -0.5 - 1e-12 <= (J2 @ sol.v)[0] <= 0.5 + 1e-12
    far = solve([J2], [al.Within([50.0], [np.inf])], method="exact", v_max=1.0)
    np.testing.assert_array_equal(far.v[[0, 2, 3]], 1.0)
    (row,) = far.active[0]
    assert (row.row, row.side, row.name) == (0, "lower", "row 1") and row.multiplier == far.violations[0][0] == -46.0
    assert {(limit.row, limit.side, limit.name) for limit in far.limits} == {
        (0, "upper", "joint 1"),
        (2, "upper", "joint 3"),
        (3, "upper", "joint 4"),
    }
    # The forces of the bounds balance the gradient of the violation.
    force = np.zeros(4)
    force[[limit.row for limit in far.limits]] = [limit.multiplier for limit in far.limits]
    np.testing.assert_allclose(J2.T @ far.violations[0] + force, 0.0, atol=1e-12)
    assert far.status is al.Status.DEGRADED


@pytest.mark.parametrize("method", ["exact", "clamp", "damped"])
def test_bounds_that_are_not_met_change_nothing(method: str) -> None:
    free = solve([J1, J2], [V1, V2], method=method)
    wide = solve([J1, J2, np.eye(4)], [V1, V2, al.Within(np.full(4, -99.0), np.full(4, 99.0))], method=method, v_max=1e3)
    np.testing.assert_allclose(wide.v, free.v, atol=1e-13)
    assert wide.status is free.status is al.Status.SUCCESS and wide.ranks[:2] == free.ranks
    assert free.certificate <= 1e-13 and free.changes == 0 and free.active == [[], []] and free.limits == []
    np.testing.assert_array_equal(free.violations[0], -free.residuals[0])


def test_the_certificate_of_chiaverini_is_undefined() -> None:
    assert np.isnan(solve([J1, J2], [V1, V2], method="chiaverini").certificate)


def test_batches() -> None:
    rng = np.random.default_rng(0)
    Js, v = rng.normal(size=(2, 50, 2, 4)), rng.normal(size=(2, 50, 2))
    targets: list[Any] = [v, al.Within(np.full(2, -0.2), np.full((2, 50, 2), 0.3))]
    sol = solve([Js, Js[::-1]], targets, method="exact", v_max=0.8)
    assert sol.v.shape == (2, 50, 4) and sol.violations[1].shape == (2, 50, 2) and sol.certificate.max() <= 1e-12
    for index in ((0, 0), (1, 7), (1, 49)):
        one = solve([Js[index], Js[::-1][index]], [v[index], al.Within([-0.2, -0.2], [0.3, 0.3])], method="exact", v_max=0.8)
        np.testing.assert_array_equal(sol.v[index], one.v)
        assert sol.active(index) == one.active and sol.limits(index) == one.limits and sol.changes[index] == one.changes
    bad = Js.copy()
    bad[1, 3] = np.nan
    other = solve([bad, Js[::-1]], targets, method="exact", v_max=0.8)
    assert other.status[1, 3] == al.Status.DIVERGED and np.isnan(other.v[1, 3]).all() and np.isnan(other.certificate[1, 3])
    np.testing.assert_array_equal(other.v[0], sol.v[0])
    free = solve([Js], [v])
    assert np.isnan(free.certificate).all() and (free.changes == 0).all() and free.active((0, 1)) == [[]]


def test_one_solver_for_changing_bounds() -> None:
    solver = al.PrioritySolver(4, [2, 1], method="exact", v_max=1.0)
    cases: list[list[Any]] = [[V1, V2], [V1, INSIDE], [al.Within([-1.0, -1.0], [1.0, 1.0]), V2], [V1, V2]]
    for targets in cases:
        np.testing.assert_allclose(solver.solve([J1, J2], targets), solve([J1, J2], targets, method="exact", v_max=1.0).v, atol=1e-13)
        again = solver.solve([J1.tolist(), J2.tolist()], targets)
        assert solver.solution.changes == 0 and solver.solution.certificate <= 1e-14
        np.testing.assert_allclose(again, solver.solution.v, atol=0)
    solver.set_bounds(-0.1, 0.1)
    assert np.abs(solver.solve([J1, J2], [V1, INSIDE])).max() <= 0.1


def test_solvers_of_arms_keep_bounds() -> None:
    rng = np.random.default_rng(1)
    q, wanted = rng.uniform(-2, 2, size=(40, 3)), rng.normal(size=(40, 2))
    solver = al.PrioritySolver.for_arm(THREE_LINKS, [al.Task("link3", "xy")], method="clamp", v_max=0.6)
    v = solver.solve(q, [wanted])
    assert np.abs(v).max() == 0.6
    for i in range(40):
        np.testing.assert_allclose(solver.solve(q[i], [wanted[i]]), v[i], atol=1e-12)


@pytest.mark.parametrize("options", [{}, {"v_max": 0.5}], ids=str)
def test_pickles(options: dict[str, Any]) -> None:
    cases: list[list[Any]] = [[V1, V2], [V1, INSIDE]]
    for targets in cases:
        sol = solve([J1, J2], targets, **options)
        copy = pickle.loads(pickle.dumps(sol))
        np.testing.assert_array_equal(copy.v, sol.v)
        assert (copy.active, copy.limits, copy.changes, copy.certificate) == (sol.active, sol.limits, sol.changes, sol.certificate)
        assert copy.why(1) == sol.why(1)
    within = pickle.loads(pickle.dumps(INSIDE))
    np.testing.assert_array_equal([within.lower, within.upper], [INSIDE.lower, INSIDE.upper])
    assert repr(within) == repr(INSIDE) == "Within(array([-0.5]), array([0.5]))"


def test_a_solution_without_details_loads() -> None:
    """Pickles that were written before solutions had bounds have five arguments."""
    sol = solve([J1, J2], [V1, V2])
    old = al.PrioritySolution(sol.v, sol.residuals, sol.ranks, sol.scales, sol.status)
    np.testing.assert_array_equal(old.violations[0], -sol.residuals[0])
    assert (old.active, old.limits, old.changes) == ([[], []], [], 0) and np.isnan(old.certificate)


def test_reasons() -> None:
    J = np.array([[1.0, 1.0, 1.0]])
    sol = solve([np.eye(3)[1:2], J], [[0.0], [4.0]], method="exact", v_max=[0.5, 9.0, 0.5])
    # The shares are the squares of the entries of the unit row (1, 1, 1).
    third = "takes 33 %"
    assert sol.why(2) == (
        f"level 2 misses row 1 by 3: joint 1 at its upper bound (level 0) {third}, joint 3 at its upper bound (level 0) {third} and "
        "the tasks of level 1 take 33 %"
    )
    assert sol.why(1) == "level 1 is reached"
    assert "rows conflict" in solve([np.zeros((1, 3))], [[1.0]]).why(1)
    assert "damping near a singularity takes 100 %" in solve([1e-6 * J], [[1.0]], eps=1.0).why(1)
    seen = al.diagnose_priority([J, J], rhs=[[0.2], al.Within([1.0], [2.0])], v_max=1.0)
    assert seen.why is not None and seen.why[0] == "level 1 is reached" and "the tasks of level 1 take 100 %" in seen.why[1]
    assert seen.compatible is False and seen.losses is not None
    np.testing.assert_allclose(seen.losses[1], [0.8])
    assert al.diagnose_priority([J], rhs=[[0.2]], v_max=1.0).compatible is True


def test_rounding_errors_in_place_of_a_row_command_nothing() -> None:
    """A row of the size of a rounding error has no direction, as without bounds."""
    J = np.array([[1.0, 0.0], [0.0, 1e-16]])
    kept: list[dict[str, Any]] = [{}, {"scale": "direction"}]
    for options in kept:
        sol = solve([J, [[0.0, 1.0]]], [[1.0, 1.0], [1.0]], method="exact", v_max=5.0, **options)
        np.testing.assert_allclose(sol.v, [1.0, 1.0], atol=1e-15)
        assert sol.ranks == [1, 1]
    # The command of such a row is far beyond the bounds, and does not change which bounds hold.
    far = solve(
        [np.eye(3)[:1], [[1.0, 1e-16, 0.0], [0.0, 1e-16, 0.0]], [[0.0, 1.0, 1.0]]], [[0.2], [0.5, 2.0], [3.0]], method="exact", v_max=1.0
    )
    np.testing.assert_allclose(far.v, [0.2, 1.0, 1.0], atol=1e-15)
    assert far.certificate <= 1e-13
    # The first row of a level is zero.
    zero = solve([[[0.0, 0.0], [2.0, -1.0], [-2.0, 0.0]]], [[3.0, 2.0, -2.0]], method="exact", scale="direction", v_max=0.5)
    np.testing.assert_allclose(zero.scales, 0.5, rtol=1e-14)


def test_kept_directions() -> None:
    """A level executes the largest multiple of its command. `why` names the bounds that limit the scale."""
    options: dict[str, Any] = {"method": "exact", "scale": "direction", "v_max": [0.5, 9.0, 1.0, 9.0]}
    sol = solve([np.eye(4)[:2], np.eye(4)[[0, 2]]], [[1.0, 1.0], [1.0, 2.0]], **options)
    # Level 2 cannot change joint 1, so that joint 3 has the rest of its command.
    np.testing.assert_allclose(sol.v, [0.5, 0.5, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(sol.scales, [0.5, 0.5], atol=1e-15)
    assert sol.status is al.Status.DEGRADED and sol.certificate <= 1e-14
    assert sol.why(1) == "level 1 is scaled by 0.5: joint 1 at its upper bound (level 0) takes 100 %"
    assert sol.why(2) == "level 2 is scaled by 0.5: joint 3 at its upper bound (level 0) takes 100 %"
    np.testing.assert_allclose(sol.violations[0], -sol.residuals[0])
    # The multiplier is the increase of the scale per unit of the bound.
    assert [(limit.row, round(limit.multiplier, 12)) for limit in sol.limits] == [(0, 1.0), (2, 0.5)]
    assert pickle.loads(pickle.dumps(sol)).why(1) == sol.why(1)
    # A level with bounds is not scaled, and the levels below keep it.
    mixed = solve([J2, J1], [INSIDE, V1], **options)
    assert mixed.scales[0] == 1.0 and -0.5 - 1e-12 <= (J2 @ mixed.v)[0] <= 0.5 + 1e-12
    np.testing.assert_allclose(J1 @ mixed.v, mixed.scales[1] * V1, atol=1e-12)
    sns = solve([J2, J1], [INSIDE, V1], method="sns", v_max=options["v_max"])
    np.testing.assert_array_equal(sns.v, mixed.v)
    # Without a bound, every scale is 1.
    free = solve([J1, J2], [V1, V2], method="exact", scale="direction")
    np.testing.assert_allclose(free.v, solve([J1, J2], [V1, V2], method="exact").v, atol=1e-14)
    assert (free.scales == 1.0).all() and free.why(1) == "level 1 is reached"


def test_kept_directions_in_batches_and_solvers() -> None:
    """Rows of a batch are single solves, and a solver and its pickle are as well."""
    rng = np.random.default_rng(4)
    Js, vs = [rng.normal(size=(40, 2, 4)), rng.normal(size=(40, 1, 4))], [rng.normal(size=(40, 2)), rng.normal(size=(40, 1))]
    for options in ({"method": "sns"}, {"method": "exact", "scale": "direction"}):
        bounds: dict[str, Any] = options | {"v_max": 0.4}
        many = solve(Js, vs, **bounds)
        solver = pickle.loads(pickle.dumps(al.PrioritySolver(4, [2, 1], **bounds)))
        for i in range(40):
            one = solve([J[i] for J in Js], [v[i] for v in vs], **bounds)
            np.testing.assert_array_equal(many.v[i], one.v)
            np.testing.assert_array_equal(many.scales[i], one.scales)
            assert many.limits(i) == one.limits and many.changes[i] == one.changes and one.certificate <= 1e-13
            np.testing.assert_allclose(solver.solve([J[i] for J in Js], [v[i] for v in vs]), one.v, atol=1e-12)
            if many.status[i] == al.Status.SUCCESS and options["method"] == "sns":
                assert np.isnan(many.certificate[i]) or many.changes[i] > 0
        assert 5 <= np.count_nonzero((many.scales < 1).any(axis=1)) <= 38
    arm = al.PrioritySolver.for_arm(THREE_LINKS, [al.Task("link3", "xy")], method="exact", scale="direction", v_max=0.1)
    q = np.array([0.3, 0.8, 0.4])
    v = pickle.loads(pickle.dumps(arm)).solve(q, [[1.0, 0.5]])
    speed = arm.jacobians(q)[0] @ v
    assert np.abs(v).max() == 0.1 and abs(speed[0] * 0.5 - speed[1]) < 1e-14 and 0.0 < speed[0] < 1.0


@pytest.mark.parametrize("method", ["exact", "clamp", "damped"])
def test_rows_of_batches_are_single_calls(method: str) -> None:
    """Stacks that meet no bound are solved in lanes, and the others by a search. All have the bits of a single call."""
    rng = np.random.default_rng(7)
    Js = [rng.normal(size=(70, m, 5)) for m in (2, 2, 4)]
    small = rng.uniform(0.01, 1.0, size=(70, 1))
    lower, upper = -rng.uniform(0.1, 0.3, size=(70, 2)), np.array([0.2, np.inf])
    targets: list[Any] = [small * rng.normal(size=(70, 2)), al.Within(lower, upper), small * rng.normal(size=(70, 4))]
    Js[2][5] = np.nan
    targets[0][6] = np.inf
    Js[0][7] = 0.0
    many = solve(Js, targets, method=method, v_max=0.9)
    searched = 0
    for i in range(70):
        stack = [[J[i] for J in Js], [targets[0][i], al.Within(lower[i], upper), targets[2][i]]]
        if i in (5, 6):
            assert many.status[i] == al.Status.DIVERGED and np.isnan(many.v[i]).all()
            with pytest.raises(al.InputError, match="jacobians\\[2\\]" if i == 5 else "velocities\\[0\\]"):
                solve(*stack, method=method, v_max=0.9)
            continue
        one = solve(*stack, method=method, v_max=0.9)
        np.testing.assert_array_equal(many.v[i], one.v)
        assert (many.certificate[i], many.changes[i], many.status[i]) == (one.certificate, one.changes, one.status)
        assert many.active((i,)) == one.active and many.limits((i,)) == one.limits and one.certificate <= 1e-13
        assert list(many.ranks[i]) == one.ranks
        for batch, single in ((many.residuals, one.residuals), (many.violations, one.violations)):
            for level, part in zip(batch, single, strict=True):
                np.testing.assert_array_equal(level[i], part)
        searched += one.changes > 0
        assert one.changes > 0 or not any(one.active) or i == 7
    assert 20 <= searched <= 60


def test_calls_in_any_order() -> None:
    """A call keeps its solver for the next one, and has the same bits after any other call."""
    stacks: list[tuple[Any, Any, dict[str, Any]]] = [
        ([J1, J2], [V1, V2], {"v_max": 0.4}),
        ([J1, J2], [V1, V2], {"v_max": 0.5}),
        ([J1, J2], [V1, V2], {"v_min": -0.1, "v_max": 0.5}),
        ([J1, J2], [V1, INSIDE], {"v_max": 0.4}),
        ([J1, J2], [V1, INSIDE], {}),
        ([J1, J2], [V1, V2], {}),
        ([J1, J2], [V1, V2], {"method": "clamp", "v_max": 0.4}),
        ([J1, J2], [V1, V2], {"method": "clamp", "v_max": 0.4, "eps": 0.9}),
        ([J1, J2], [V1, V2], {"weight": np.diag([1.0, 2.0, 3.0, 4.0]), "v_max": 0.4}),
        ([J1, J2], [V1, V2], {"scale": "direction", "v_max": 0.4}),
        ([J1, J2], [V1, V2], {"v_max": 0.4, "rounding": 1e-3}),
    ]
    own = [solve(J, v, **{"method": "exact"} | options) for J, v, options in stacks]
    assert len({sol.v.tobytes() for sol in own}) >= 7
    rng = np.random.default_rng(0)
    for i in rng.integers(len(stacks), size=200):
        J, v, options = stacks[i]
        sol = solve(J, v, **{"method": "exact"} | options)
        np.testing.assert_array_equal(sol.v, own[i].v)
        assert (sol.limits, sol.active, sol.why(1)) == (own[i].limits, own[i].active, own[i].why(1))
