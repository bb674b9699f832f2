"""The Python interface of task priority: refused arguments, equal results for every kind of array, batches, pickling."""

from __future__ import annotations

import doctest
import pickle
from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

J1, J2 = np.array([[1.0, 2.0, 0.0, 1.0], [0.0, 1.0, 1.0, -1.0]]), np.array([[2.0, 0.0, 1.0, 1.0]])
V1, V2 = np.array([1.0, -2.0]), np.array([3.0])
METHODS = ["exact", "clamp", "damped", "chiaverini", "sns"]


def keywords(method: str) -> dict[str, Any]:
    return {"method": method} | ({"v_max": 1.0} if method == "sns" else {})


NAN = np.array([[1.0, 2.0, 0.0, 1.0], [0.0, np.nan, 1.0, -1.0]])
solve, diagnose, solver = al.solve_priority, al.diagnose_priority, al.PrioritySolver
BAD: list[tuple[str, Callable[[], object], str]] = [
    ("empty stack", lambda: solve([], []), "solve_priority: jacobians is empty: expected at least one level, got 0"),
    ("not a list", lambda: solve(3.0, [V1]), r"jacobians is not a list of arrays"),  # type: ignore[arg-type]
    ("one level too few", lambda: solve([J1, J2], [V1]), "velocities has the wrong number of levels: expected 2, got 1"),
    ("a vector for a matrix", lambda: solve([J1[0]], [V1]), r"jacobians\[0\] has the wrong shape: expected .* got \(4,\)"),
    ("columns", lambda: solve([J1, J2[:, :3]], [V1, V2]), r"jacobians\[1\] has the wrong number of columns: expected 4, got 3"),
    ("no joints", lambda: solve([np.zeros((2, 0))], [V1]), r"jacobians\[0\] has no columns"),
    ("velocity length", lambda: solve([J1, J2], [V1, V1]), r"velocities\[1\] has the wrong shape: expected \(1,\), got \(2,\)"),
    ("NaN", lambda: solve([NAN, J2], [V1, V2]), r"jacobians\[0\] is not finite: .* got NaN \(first bad index \(1, 1\)\)"),
    ("infinite", lambda: solve([J1, J2], [V1, [np.inf]]), r"velocities\[1\] is not finite: .* \(first bad index 0\)"),
    ("complex", lambda: solve([J1 + 0j, J2], [V1, V2]), r"jacobians\[0\] is not an array of real numbers"),
    ("ragged", lambda: solve([[[1.0, 2.0], [3.0]]], [V1]), r"jacobians\[0\] is not an array of real numbers"),
    ("method", lambda: solve([J1], [V1], method="pinv"), "method is unknown: expected one of exact, clamp, damped, "),
    ("eps", lambda: solve([J1], [V1], eps=0.0), "eps is not positive"),
    ("eps per level", lambda: solve([J1, J2], [V1, V2], eps=[1.0] * 3), r"eps has the wrong shape: .* \(2,\), got \(3,\)"),
    ("rounding", lambda: solve([J1], [V1], rounding=-1.0), "rounding is not a relative error"),
    ("rounding NaN", lambda: solve([J1], [V1], rounding=float("nan")), "rounding is not a relative error"),
    ("weight shape", lambda: solve([J1], [V1], weight=np.eye(3)), r"weight has the wrong shape: expected \(4, 4\), got \(3, 3\)"),
    ("weight sign", lambda: solve([J1], [V1], weight=-np.eye(4)), "weight is not positive definite"),
    ("no bounds", lambda: solve([J1], [V1], method="sns"), "v_max is missing"),
    ("bounds shape", lambda: solve([J1], [V1], method="sns", v_max=[1.0] * 3), r"v_max has the wrong shape: .* \(4,\), got \(3,\)"),
    ("bounds order", lambda: solve([J1], [V1], method="sns", v_min=2.0, v_max=1.0), "v_min is out of order"),
    ("huge", lambda: solve([np.zeros((1, 5000))], [[0.0]]), "n is too large: expected at most 4096, got 5000"),
    ("batch axes", lambda: solve([np.zeros((3, 1, 4)), np.zeros((2, 1, 4))], [[0.0], [0.0]]), "do not broadcast"),
    ("diagnosis, empty", lambda: diagnose([]), "diagnose_priority: jacobians is empty"),
    ("diagnosis, NaN", lambda: diagnose([J1, [[np.nan] * 4]]), r"jacobians\[1\] is not finite: .* \(first bad index \(0, 0\)\)"),
    ("diagnosis, rhs", lambda: diagnose([J1], rhs=[V2]), r"rhs\[0\] has the wrong shape: expected \(2,\), got \(1,\)"),
    ("diagnosis, batch", lambda: diagnose([np.zeros((3, 1, 4))]), "jacobians has leading axes"),
    ("solver, n", lambda: solver(0, [1]), "PrioritySolver: n is not a positive integer"),
    ("solver, rows", lambda: solver(4, [2, -1]), "PrioritySolver: rows is not a list of sizes"),
    ("solver, method", lambda: solver(4, [2], method="x"), "sns, got x"),
    ("solver, huge", lambda: solver(4, [2**62, 2**62]), "rows is too large"),
    ("solver, levels", lambda: solver(4, [2, 1]).solve([J1], [V1]), "PrioritySolver.solve: jacobians has the wrong number of levels"),
    ("solver, rows", lambda: solver(4, [2, 2]).solve([J1, J2], [V1, V2]), r"jacobians\[1\] has the wrong shape: expected \(2, 4\)"),
    ("solver, columns", lambda: solver(5, [2]).solve([J1], [V1]), r"jacobians\[0\] has the wrong shape: expected \(2, 5\), got \(2, 4\)"),
    ("solver, NaN", lambda: solver(4, [2]).solve([NAN], [V1]), r"jacobians\[0\] is not finite: .* \(first bad index \(1, 1\)\)"),
    ("out shape", lambda: solver(4, [2]).solve([J1], [V1], out=np.zeros(3)), r"out has the wrong shape: expected \(4,\), got \(3,\)"),
    ("bounds of a sample", lambda: al.velocity_bounds([0.0], 1.0, -1.0, 1.0, dt=0.1), "limits is not ordered"),
]


@pytest.mark.parametrize(("call", "message"), [pytest.param(*rest, id=name) for name, *rest in BAD])
def test_refusals(call: Callable[[], object], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        call()


def read_only(x: np.ndarray) -> np.ndarray:
    x = x.copy()
    x.flags.writeable = False
    return x


FORMS: dict[str, Callable[[np.ndarray], Any]] = {
    "list": lambda x: x.tolist(),
    "int": lambda x: x.astype(int),
    "float32": lambda x: x.astype(np.float32),
    "fortran": np.asfortranarray,
    "strided": lambda x: np.repeat(x, 2, axis=-1)[..., ::2],
    "reversed": lambda x: x[..., ::-1].copy()[..., ::-1],
    "read-only": read_only,
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("form", FORMS)
def test_every_sort_of_array_gives_the_same_bits(form: str, method: str) -> None:
    shape = FORMS[form]
    Js, vs = [shape(J1), shape(J2)], [shape(V1), shape(V2)]
    solver = al.PrioritySolver(4, [2, 1], **keywords(method))
    wanted = al.solve_priority([J1, J2], [V1, V2], **keywords(method)).v
    np.testing.assert_array_equal(al.solve_priority(tuple(Js), tuple(vs), **keywords(method)).v, wanted)
    np.testing.assert_array_equal(solver.solve(Js, vs), wanted)
    np.testing.assert_array_equal(solver.solve([J1, J2], [V1, V2]), wanted)


def test_out_is_filled_and_returned() -> None:
    solver, out = al.PrioritySolver(4, [2, 1]), np.full(4, np.nan)
    assert solver.solve([J1, J2], [V1, V2], out=out) is out
    np.testing.assert_array_equal(out, solver.solve([J1, J2], [V1, V2]))
    with pytest.raises(al.InputError, match="out is read-only"):
        solver.solve([J1, J2], [V1, V2], out=read_only(out))
    with pytest.raises(al.InputError, match="out overlaps an argument"):
        al.PrioritySolver(4, [1]).solve([out.reshape(1, 4)], [[1.0]], out=out)


def test_out_may_not_share_memory_in_part_either() -> None:
    memory = np.ones(12)
    one = al.PrioritySolver(4, [1])
    for jacobian in (memory[3:7].reshape(1, 4), memory[1:9:2].reshape(1, 4), memory[::-1][4:8].reshape(1, 4)):
        with pytest.raises(al.InputError, match="out overlaps an argument"):
            one.solve([jacobian], [[1.0]], out=memory[4:8])
    one.solve([memory[8:].reshape(1, 4)], [[1.0]], out=memory[4:8])
    np.testing.assert_allclose(memory[4:8], 0.25, atol=1e-16)


def test_calls_in_a_row_do_not_know_of_each_other() -> None:
    """solve_priority reuses buffers of the last call, but never its options."""
    near = [np.array([[1.0, 0.0]]), np.array([[1.0, 1e-9]])]
    asked = [np.array([1.0]), np.array([2.0])]
    fine = al.solve_priority(near, asked, method="exact")
    assert fine.ranks == [1, 1] and al.solve_priority(near, asked, method="exact", rounding=1e-6).ranks == [1, 0]
    for _ in range(2):
        np.testing.assert_array_equal(al.solve_priority(near, asked, method="exact").v, fine.v)
    clamped = al.solve_priority(near, asked)
    assert np.abs(al.solve_priority(near, asked, eps=1e-10).v - clamped.v).max() > 1.0
    np.testing.assert_array_equal(al.solve_priority(near, asked).v, clamped.v)
    assert al.solve_priority([near[0].T], [asked[0].repeat(2)], method="exact").v.shape == (1,)
    np.testing.assert_array_equal(al.solve_priority(near, asked, method="exact").v, fine.v)


def test_answers_do_not_change_later() -> None:
    solver = al.PrioritySolver(4, [2, 1])
    first = solver.solve([J1, J2], [V1, V2])
    kept, residuals = first.copy(), solver.residuals
    solver.solve([J1, J2], [-V1, 5 * V2])
    np.testing.assert_array_equal(first, kept)
    assert np.abs(residuals[0]).max() < 1e-14 and first.flags.owndata and first.flags.c_contiguous


def test_a_refused_call_leaves_the_solver_usable() -> None:
    solver = al.PrioritySolver(4, [2, 1])
    wanted = solver.solve([J1, J2], [V1, V2])
    with pytest.raises(al.InputError):
        solver.solve([NAN, J2], [V1, V2])
    np.testing.assert_array_equal(solver.solve([J1, J2], [V1, V2]), wanted)
    with pytest.raises(al.InputError):
        al.solve_priority([NAN, J2], [V1, V2])
    np.testing.assert_array_equal(al.solve_priority([J1, J2], [V1, V2]).v, wanted)


def test_zero_rows_and_more_rows_than_joints() -> None:
    tall = np.array([[1.0, 0.0], [0.0, 2.0], [1.0, 1.0]])
    sol = al.solve_priority([np.zeros((0, 2)), tall], [np.zeros(0), tall @ [3.0, -1.0]], method="exact")
    np.testing.assert_allclose(sol.v, [3.0, -1.0], atol=1e-14)
    assert sol.ranks == [0, 2] and [r.shape for r in sol.residuals] == [(0,), (3,)]
    assert al.diagnose_priority([np.zeros((0, 2)), tall]).ranks == [0, 2]
    np.testing.assert_array_equal(al.PrioritySolver(3, []).solve([], []), np.zeros(3))


def test_an_answer_that_overflows_is_an_error() -> None:
    with pytest.raises(al.SolveError) as caught:
        al.solve_priority([[[1e-300]]], [[1e300]], method="exact")
    assert caught.value.status is al.Status.DIVERGED


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("count", [1, 7, 3000])
def test_batches_are_their_rows(method: str, count: int) -> None:
    """Leading axes broadcast, and each row equals a single call to the last bit. Above 512 rows the interpreter lock is released."""
    rng = np.random.default_rng(3)
    first, second, velocities = rng.normal(size=(count, 2, 4)), rng.normal(size=(1, 1, 4)), rng.normal(size=(count, 2))
    sol = al.solve_priority([first, second], [velocities, [0.5]], **keywords(method))
    assert sol.v.shape == (count, 4) and sol.ranks.shape == sol.scales.shape == (count, 2) and sol.status.shape == (count,)
    assert [r.shape for r in sol.residuals] == [(count, 2), (count, 1)]
    for i in {0, count // 2, count - 1}:
        row = al.solve_priority([first[i], second[0]], [velocities[i], [0.5]], **keywords(method))
        np.testing.assert_array_equal(sol.v[i], row.v)
        np.testing.assert_array_equal(sol.residuals[1][i], row.residuals[1])
        assert sol.ranks[i].tolist() == row.ranks and sol.status[i] == row.status


def test_only_the_bad_row_is_nan() -> None:
    rng = np.random.default_rng(4)
    Js, v = rng.normal(size=(2, 3, 2, 4)), rng.normal(size=(2, 3, 2))
    wanted = al.solve_priority([Js], [v])
    broken = Js.copy()
    broken[1, 2, 0, 3] = np.inf
    sol = al.solve_priority([broken], [v])
    good = np.ones((2, 3), dtype=bool)
    good[1, 2] = False
    assert sol.status[1, 2] == al.Status.DIVERGED and np.isnan(sol.v[1, 2]).all() and np.isnan(sol.residuals[0][1, 2]).all()
    np.testing.assert_array_equal(sol.v[good], wanted.v[good])
    np.testing.assert_array_equal(sol.status[good], wanted.status[good])


def test_an_empty_batch() -> None:
    sol = al.solve_priority([np.zeros((0, 2, 4))], [np.zeros((0, 2))])
    assert sol.v.shape == (0, 4) and sol.status.shape == (0,)


def test_a_conflicting_level_gives_the_status_degraded() -> None:
    sol = al.solve_priority([J1, J1], [V1, -V1], method="exact")
    assert sol.status is al.Status.DEGRADED and sol.ranks == [2, 0]
    seen = al.diagnose_priority([J1, J1], rhs=[V1, -V1])
    assert (seen.kind, seen.compatible, seen.overlap) == ("algorithmic", False, 2)
    assert seen.losses is not None
    np.testing.assert_allclose(seen.losses[1], -2 * V1, atol=1e-14)
    assert seen.lost[1].shape == (2, 2) and seen.algorithmic == [False, True] and seen.kinematic == [False, False]
    assert al.diagnose_priority([J1, J1]).compatible is None


def test_bounds_hold_and_can_change() -> None:
    solver = al.PrioritySolver(4, [2, 1], method="sns", v_max=0.5)
    v = solver.solve([J1, J2], [V1, V2])
    assert np.abs(v).max() <= 0.5 and solver.scales[0] < 1.0 and solver.status is al.Status.DEGRADED
    np.testing.assert_allclose(J1 @ v, solver.scales[0] * V1, atol=1e-14)
    solver.set_bounds(-np.inf, np.inf)
    np.testing.assert_allclose(solver.solve([J1, J2], [V1, V2]), al.solve_priority([J1, J2], [V1, V2], method="exact").v, atol=1e-14)


def test_bounds_of_a_solver_without_bounds_are_refused() -> None:
    arm = models.THREE_LINKS
    for solver, n in [(al.PrioritySolver(4, [2, 1]), 4), (al.PrioritySolver.for_arm(arm, [al.Task("link3", "xy")]), 3)]:
        with pytest.raises(al.InputError, match="v_max has no use: expected a solver that was created with bounds"):
            solver.set_bounds(-np.ones(n), np.ones(n))


@pytest.mark.parametrize("method", METHODS)
def test_pickling(method: str) -> None:
    options = keywords(method) | ({} if method in ("exact", "sns") else {"eps": [0.1, 0.2]})
    solver = al.PrioritySolver(4, [2, 1], rounding=1e-12, weight=np.diag([1.0, 2.0, 3.0, 4.0]), **options)
    copy = pickle.loads(pickle.dumps(solver))
    assert repr(copy) == repr(solver) == f"PrioritySolver(4, [2, 1], method={method!r})".replace("'", '"')
    assert (copy.n, copy.rows, copy.method) == (4, (2, 1), method)
    np.testing.assert_array_equal(copy.solve([J1, J2], [V1, V2]), solver.solve([J1, J2], [V1, V2]))
    sol = al.solve_priority([J1, J2], [V1, V2], **keywords(method))
    again = pickle.loads(pickle.dumps(sol))
    np.testing.assert_array_equal(again.v, sol.v)
    assert (again.ranks, again.status) == (sol.ranks, sol.status) and again.status is sol.status
    seen = al.diagnose_priority([J1, J2])
    assert str(pickle.loads(pickle.dumps(seen))) == str(seen)


ENTRIES = [al.solve_priority, al.PrioritySolver, al.diagnose_priority, al.velocity_bounds]


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.__name__)
def test_docstrings_run(entry: Any) -> None:
    assert entry.__doc__ is not None
    test = doctest.DocTestParser().get_doctest(entry.__doc__, {}, entry.__name__, None, None)
    assert test.examples
    assert doctest.DocTestRunner().run(test).failed == 0
