"""Standard test problems: errors compared with known solutions and with scipy, decreasing with the tolerance at the method's order."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armlet as al
from armlet.reference import integrate as reference
from armlet.reference.problems import PROBLEMS, Problem, jacobi_elliptic

SCIPY = {"dopri5": "RK45", "dop853": "DOP853", "radau5": "Radau"}
ADAPTIVE = (*SCIPY, "rodas4")


def pairs() -> list[tuple[str, str]]:
    stiff = ("radau5", "rodas4")
    return [(name, method) for name, p in PROBLEMS.items() for method in (stiff if p.stiff else ADAPTIVE)]


def solve(problem: Problem, method: str, tol: float, **more: Any) -> al.Integration:
    return al.integrate(
        problem.f, problem.span, problem.y0, method=method, rtol=tol, atol=tol * problem.scale, jac=problem.jac, lists=True, **more
    )


@pytest.mark.slow
@pytest.mark.parametrize(("name", "method"), pairs())
def test_errors_fall_with_the_tolerance(name: str, method: str) -> None:
    problem = PROBLEMS[name]
    tolerances = (1e-5, 1e-7) if name == "pleiades" and method in ("radau5", "rodas4") else (1e-5, 1e-7, 1e-9)
    runs = [solve(problem, method, tol) for tol in tolerances]
    errors = [problem.error(run.y[-1]) for run in runs]
    # The error is about proportional to the tolerance. A tolerance that is 100 times smaller must reduce it at least by a factor of 8.
    assert all(after < before / 8 for before, after in pairwise(errors)), errors
    # Arenstorf's orbit and the Pleiades amplify errors much more than the other problems.
    limit = 1e5 if name in ("arenstorf", "pleiades") else 10.0
    assert errors[-1] < limit * tolerances[-1], errors


@pytest.mark.parametrize(("name", "method"), [pair for pair in pairs() if pair[1] in SCIPY])
@pytest.mark.parametrize("tol", [1e-4, 1e-6, 1e-8])
def test_no_worse_than_scipy(name: str, method: str, tol: float) -> None:
    problem = PROBLEMS[name]
    if name == "pleiades" and method == "radau5":
        tol = max(tol, 1e-6)
    run = solve(problem, method, tol)
    jac = {"jac": problem.jac} if method == "radau5" and problem.jac else {}
    theirs = solve_ivp(problem.f, problem.span, problem.y0, method=SCIPY[method], rtol=tol, atol=tol * problem.scale, **jac)
    ours, other = problem.error(run.y[-1]), problem.error(theirs.y[:, -1])
    # The project requires at most 1.5 times scipy's error. 1e-13 is the rounding of the known solutions.
    assert ours <= 1.5 * other + 1e-13, (ours, other)
    assert run.stats["steps"] <= 1.02 * (theirs.t.size - 1) + 1


@pytest.mark.parametrize(
    ("method", "order", "tols"), [("dopri5", 5, (1e-6, 1e-9)), ("dop853", 8, (1e-7, 1e-11)), ("rodas4", 4, (1e-6, 1e-9))]
)
def test_work_and_error_follow_the_order(method: str, order: int, tols: tuple[float, float]) -> None:
    """On a smooth problem the number of steps is proportional to error^(-1/order)."""
    problem = PROBLEMS["rigid body"]
    a, b = (solve(problem, method, tol) for tol in tols)
    slope = np.log(problem.error(a.y[-1]) / problem.error(b.y[-1])) / np.log(b.stats["steps"] / a.stats["steps"])
    # The number of steps is an integer, and the tolerances differ by a few decades. So the order is accurate to 12 %.
    assert slope == pytest.approx(order, rel=0.12)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_another_route_gives_the_same_answer(method: str) -> None:
    """The reference uses extrapolation, a method unrelated to those of armlet."""
    problem = PROBLEMS["rigid body"]
    times = np.linspace(0.0, 12.0, 25)
    expected = reference.gbs(lambda t, y: np.array(problem.f(t, y)), 0.0, np.array(problem.y0), times)
    run = solve(problem, method, 1e-9, t_eval=times)
    # The problem is neutrally stable, so the errors of the steps add up. With the error of dense output they are at most 1.2e-8.
    assert np.abs(run.y - expected).max() < 1e-7
    assert np.abs(expected[-1] - jacobi_elliptic(12.0, 0.51)).max() < 1e-11


@pytest.mark.parametrize(("method", "order", "dt"), [("euler", 1, 1e-3), ("semi_implicit", 1, 1e-3), ("rk4", 4, 2e-2), ("ros2", 2, 5e-3)])
def test_fixed_steps_have_their_order(method: str, order: int, dt: float) -> None:
    errors = []
    for h in (dt, dt / 2):
        run = al.integrate(lambda t, y: [y[1], -y[0]], (0.0, 2.0), [1.0, 0.0], method=method, dt=h, positions=1)
        assert run.stats["steps"] == round(2.0 / h)
        errors.append(np.linalg.norm(run.y[-1] - [np.cos(2.0), -np.sin(2.0)]))
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.1


def test_a_jump_in_the_input_is_landed_on_by_the_span() -> None:
    """x'' = 1 before 0.75 s and -3 afterwards, in two runs. Every method of order 2 or higher is exact to rounding."""
    for method in ADAPTIVE:
        y = np.zeros(2)
        for span, force in (((0.0, 0.75), 1.0), ((0.75, 2.0), -3.0)):
            y = al.integrate(lambda t, y, force=force: [y[1], force], span, y, method=method).y[-1]
        np.testing.assert_allclose(y, [0.75**2 / 2 + 0.75 * 1.25 - 1.5 * 1.25**2, 0.75 - 3 * 1.25], atol=1e-12)


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 0, 2)])
def test_events_at_the_very_end_are_seen_with_the_one_that_ends(method: str, order: tuple[int, ...]) -> None:
    """Three functions cross zero at t = 7, and one of them ends the run. All are recorded, in every order of the list."""

    def make(terminal: bool) -> Any:
        def event(t: float, y: Any) -> float:
            return t - 7.0

        event.terminal = terminal  # type: ignore[attr-defined]  # scipy's attribute
        return event

    events = [make(False), make(True), make(False)]
    run = al.integrate(lambda t, y: [y[1], -y[0]], (0.0, 20.0), [1.0, 0.0], method=method, events=[events[k] for k in order])
    assert run.status == al.Status.EVENT and run.t[-1] == 7.0
    assert [list(times) for times in run.t_events] == [[7.0]] * 3
