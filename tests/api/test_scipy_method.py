"""Features of scipy's solvers: with `solve_ivp`, step by step, and as options of `integrate`. `make test-scipy` runs scipy's tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import DOP853, RK45, OdeSolver, solve_ivp
from scipy.sparse import csc_matrix, csr_array

import armlet as al

ADAPTIVE = ("dopri5", "dop853", "radau5", "rodas4")
IMPLICIT = ("radau5", "rodas4")
METHODS = ("euler", "semi_implicit", "rk4", "ros2", *ADAPTIVE)
MATRIX = np.array([[-1.0, -5.0], [1.0, 1.0]])
N = 24
BAND = np.abs(np.subtract.outer(np.arange(N), np.arange(N))) <= 1


class Counted:
    """A function that counts its calls."""

    def __init__(self, f: Callable[..., Any]) -> None:
        self.f, self.calls = f, 0

    def __call__(self, t: float, y: Any) -> Any:
        self.calls += 1
        return self.f(t, y)


def linear(t: float, y: Any) -> Any:
    return MATRIX @ y


def diffusion(t: float, y: Any) -> Any:
    """Diffusion with a nonlinear sink, discretised at N points; y is (N,) or (N, k)."""
    slope = -2.0 * y - y**3
    slope[1:] += y[:-1]
    slope[:-1] += y[1:]
    return 50.0 * slope


def start() -> Any:
    return np.sin(np.linspace(0.0, 3.0, N)) + 1.0


def both(method: str, f: Any, span: Any, y0: Any, **options: Any) -> tuple[al.Integration, Any]:
    """Solve one problem by `integrate` and by `solve_ivp`. Their steps are equal."""
    tolerances = {"rtol": 1e-6, "atol": 1e-8} | options
    ours = al.integrate(f, span, y0, method=method, **tolerances)
    theirs = solve_ivp(f, span, y0, method=al.scipy_method(method), **tolerances)
    assert theirs.success and np.array_equal(ours.t, theirs.t) and np.array_equal(ours.y.T, theirs.y)
    return ours, theirs


@pytest.mark.parametrize("method", ADAPTIVE)
class TestUnboundedTime:
    @pytest.mark.parametrize("end", [np.inf, -np.inf])
    def test_steps(self, method: str, end: float) -> None:
        solver = al.scipy_method(method)(lambda t, y: -np.sign(end) * y, 1.0, [1.0], end)
        assert solver.status == "running" and solver.step_size is None and solver.nfev > 0 and solver.nlu == 0
        for _ in range(40):
            assert solver.step() is None
        assert solver.status == "running" and abs(solver.t - 1.0) > 1.0
        # The solver has scipy's default tolerances.
        assert solver.y[0] == pytest.approx(np.exp(-abs(solver.t - 1.0)), abs=1e-3)

    def test_an_event_ends_an_infinite_run(self, method: str) -> None:
        def down(t: float, y: Any) -> float:
            return float(y[0]) - 0.25

        down.terminal = True  # type: ignore[attr-defined]
        ours = al.integrate(lambda t, y: -y, (0.0, np.inf), [1.0], method=method, rtol=1e-6, events=down)
        theirs = solve_ivp(lambda t, y: -y, (0.0, np.inf), [1.0], method=al.scipy_method(method), rtol=1e-6, atol=1e-10, events=down)
        assert ours.status is al.Status.EVENT and theirs.status == 1
        # The last time is that of the event, which scipy locates by its own search.
        assert np.array_equal(ours.t[:-1], theirs.t[:-1])
        assert ours.t[-1] == pytest.approx(np.log(4.0), rel=1e-5)

    def test_without_one_it_is_refused(self, method: str) -> None:
        for span in ((0.0, np.inf), (0.0, np.nan), (-np.inf, 0.0)):
            with pytest.raises(al.InputError, match="t_span is not finite"):
                al.integrate(linear, span, [1.0, 0.0], method=method, events=lambda t, y: y[0])


def test_fixed_steps_need_an_end() -> None:
    def down(t: float, y: Any) -> float:
        return float(y[0])

    down.terminal = True  # type: ignore[attr-defined]
    with pytest.raises(al.InputError, match="t_span is not finite"):
        al.integrate(linear, (0.0, np.inf), [1.0, 0.0], method="rk4", dt=0.1, events=down)


@pytest.mark.parametrize("method", IMPLICIT)
class TestJacobians:
    @pytest.mark.parametrize("kind", [csc_matrix, csr_array])
    def test_sparse_ones_give_the_same_bits(self, method: str, kind: Any) -> None:
        plain, counts = both(method, linear, (0.0, 2.0), [0.0, 2.0], jac=MATRIX)
        sparse, _ = both(method, linear, (0.0, 2.0), [0.0, 2.0], jac=kind(MATRIX))
        called, more = both(method, linear, (0.0, 2.0), [0.0, 2.0], jac=lambda t, y: kind(MATRIX))
        assert np.array_equal(plain.y, sparse.y) and np.array_equal(plain.y, called.y)
        # A constant Jacobian is never evaluated.
        assert counts.njev == 0 and plain.stats["jacobians"] == 0 and counts.nlu > 0
        assert more.njev == called.stats["jacobians"] > 0

    def test_jacobians_of_the_wrong_shape_are_refused(self, method: str) -> None:
        huge = csc_matrix((10**6, 10**6))
        for jac, shape in ((csc_matrix((2, 3)), "(2, 3)"), (huge, "(1000000, 1000000)"), (lambda t, y: huge, "(1000000, 1000000)")):
            message = rf"jac has the wrong shape: expected \(2, 2\), got \{shape[:-1]}\)"
            with pytest.raises(al.InputError, match=message):
                al.integrate(linear, (0.0, 1.0), [1.0, 0.0], method=method, jac=jac)
            with pytest.raises(al.InputError, match=message):
                solve_ivp(linear, (0.0, 1.0), [1.0, 0.0], method=al.scipy_method(method), jac=jac)

    @pytest.mark.parametrize("pattern", [BAND, BAND.astype(int), csc_matrix(BAND), BAND.astype(int).tolist()])
    def test_sparsity_gives_the_same_bits_for_fewer_evaluations(self, method: str, pattern: Any) -> None:
        f = Counted(diffusion)
        dense, _ = both(method, diffusion, (0.0, 0.2), start())
        sparse = al.integrate(f, (0.0, 0.2), start(), method=method, rtol=1e-6, atol=1e-8, jac_sparsity=pattern)
        both(method, diffusion, (0.0, 0.2), start(), jac_sparsity=pattern)
        assert np.array_equal(dense.y, sparse.y) and f.calls == sparse.stats["evaluations"]
        # With the sparsity pattern, a Jacobian takes differences along three directions instead of 24.
        per_jacobian = 21 * (2 if method == "rodas4" else 1)
        assert dense.stats["evaluations"] - f.calls == per_jacobian * sparse.stats["jacobians"]

    def test_sparsity_of_the_wrong_shape(self, method: str) -> None:
        for pattern in (np.eye(3), csc_matrix((3, 3)), [1, 1]):
            with pytest.raises(al.InputError, match="jac_sparsity has the wrong shape"):
                al.integrate(linear, (0.0, 1.0), [1.0, 0.0], method=method, jac_sparsity=pattern)
        with pytest.raises(al.InputError, match="jac_sparsity is not an array of real numbers"):
            al.integrate(linear, (0.0, 1.0), [1.0, 0.0], method=method, jac_sparsity=[["a", "b"], ["c", "d"]])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("end", [0.1, -0.1])
def test_vectorised_right_hand_sides_give_the_same_bits(method: str, end: float) -> None:
    options: dict[str, Any] = {"method": method} if method in ADAPTIVE else {"method": method, "dt": 1e-3}
    if method == "semi_implicit":
        options["positions"] = N // 2
    shapes = set()

    def columns(t: float, y: Any) -> Any:
        shapes.add(y.shape)
        return diffusion(t, y) / 50.0

    f = Counted(columns)
    single = al.integrate(lambda t, y: diffusion(t, y) / 50.0, (0.0, end), start(), **options)
    many = al.integrate(f, (0.0, end), start(), vectorized=True, **options)
    assert np.array_equal(single.y, many.y) and single.stats == many.stats
    implicit = method in (*IMPLICIT, "ros2")
    assert shapes == ({(N, 1), (N, N)} if implicit else {(N, 1)})
    assert f.calls < many.stats["evaluations"] if implicit else f.calls == many.stats["evaluations"]
    if method in ADAPTIVE:
        both(method, columns, (0.0, end), start(), vectorized=True)


def test_vectorised_right_hand_sides_that_are_not() -> None:
    with pytest.raises(al.InputError, match=r"f\(t, y\) has the wrong shape: expected \(2, 1\) or \(2,\), got \(2, 2\)"):
        al.integrate(lambda t, y: MATRIX, (0.0, 1.0), [1.0, 0.0], vectorized=True)
    with pytest.raises(al.InputError, match="vectorized is given with lists"):
        al.integrate(linear, (0.0, 1.0), [1.0, 0.0], vectorized=True, lists=True)
    # For one state, f may return (n,).
    assert al.integrate(lambda t, y: (MATRIX @ y)[:, 0], (0.0, 1.0), [1.0, 0.0], vectorized=True).success


@pytest.mark.parametrize("method", ADAPTIVE)
class TestTolerances:
    def test_tolerances_per_component(self, method: str) -> None:
        f = lambda t, y: [-y[0], 30.0 * np.cos(30.0 * t)]  # noqa: E731
        loose, tight = {"rtol": [1e-9, 1e-1], "atol": [1e-12, 10.0]}, {"rtol": 1e-9, "atol": 1e-12}
        one, _ = both(method, f, (0.0, 1.0), [1.0, 0.0], **loose)
        all_of, _ = both(method, f, (0.0, 1.0), [1.0, 0.0], **tight)
        assert one.stats["steps"] < all_of.stats["steps"]
        # The global error is at most the sum of the errors of the steps, each with tolerance 1e-9.
        assert abs(one.y[-1, 0] - np.exp(-1.0)) < 1e-7
        same, _ = both(method, f, (0.0, 1.0), [1.0, 0.0], rtol=[1e-9, 1e-9], atol=[1e-12, 1e-12])
        assert np.array_equal(same.y, all_of.y)

    def test_refused(self, method: str) -> None:
        for name, value, message in (
            ("rtol", [1e-6], r"rtol has the wrong shape: expected a scalar or \(2,\), got \(1,\)"),
            ("rtol", [1e-6, np.nan], "rtol is not finite"),
            ("atol", [1e-6, -1.0], "atol is negative"),
            ("atol", [[1e-6, 1e-6]], "atol has the wrong shape"),
        ):
            with pytest.raises(al.InputError, match=message):
                al.integrate(linear, (0.0, 1.0), [1.0, 0.0], method=method, **{name: value})
            with pytest.raises(al.InputError, match=message):
                al.scipy_method(method)(linear, 0.0, [1.0, 0.0], 1.0, **{name: value})

    def test_too_small_ones_are_raised_with_a_warning_as_scipy_does(self, method: str) -> None:
        with pytest.warns(UserWarning, match=r"At least one element of `rtol` is too small"):
            raised = solve_ivp(linear, (0.0, 0.01), [1.0, 0.0], method=al.scipy_method(method), rtol=[1e-3, 1e-16])
        least = 100 * np.finfo(float).eps
        plain = solve_ivp(linear, (0.0, 0.01), [1.0, 0.0], method=al.scipy_method(method), rtol=[1e-3, least])
        assert np.array_equal(raised.y, plain.y)
        with pytest.raises(al.InputError, match="rtol is too small"):
            al.integrate(linear, (0.0, 0.01), [1.0, 0.0], method=method, rtol=[1e-3, 1e-16])

    @pytest.mark.parametrize("change", [{"first_step": -1}, {"first_step": 0}, {"first_step": 5}, {"max_step": -1}, {"max_step": 0}])
    def test_steps_are_refused_where_scipy_refuses_them(self, method: str, change: dict[str, float]) -> None:
        (name,) = change
        with pytest.raises(ValueError):
            RK45(linear, 0.0, [1.0, 0.0], 4.0, **change)
        for end in (4.0, -4.0):
            with pytest.raises(al.InputError, match=f"{name} is (not positive|longer than the span)"):
                al.scipy_method(method)(linear, 0.0, [1.0, 0.0], end, **change)
            with pytest.raises(al.InputError, match=f"{name} is (not positive|longer than the span)"):
                al.integrate(linear, (0.0, end), [1.0, 0.0], method=method, **change)

    def test_a_step_limit_below_the_resolution_of_time(self, method: str) -> None:
        solver = al.scipy_method(method)(linear, 5.0, [1.0, 0.0], 9.0, max_step=1e-20)
        assert solver.step() is None and solver.step().startswith(OdeSolver.TOO_SMALL_STEP) and solver.status == "failed"
        run = al.integrate(linear, (5.0, 9.0), [1.0, 0.0], method=method, max_step=1e-20, throw=False)
        assert run.status is al.Status.STEP_UNDERFLOW and run.stats["steps"] == 1


@pytest.mark.parametrize("method", [name for name in METHODS if name != "semi_implicit"])
@pytest.mark.parametrize("vectorized", [False, True])
def test_empty_systems(method: str, vectorized: bool) -> None:
    f = lambda t, y: np.zeros_like(y)  # noqa: E731
    options = {} if method in ADAPTIVE else {"dt": 0.5}
    run = al.integrate(f, (0.0, 2.0), [], method=method, dense_output=True, vectorized=vectorized, **options)
    assert run.success and run.t[-1] == 2.0 and run.y.shape == (run.t.size, 0)
    assert run.dense is not None and run.dense([0.5, 1.0]).shape == (2, 0)
    if method in ADAPTIVE:
        for end in (2.0, np.inf):
            solution = solve_ivp(f, (0.0, end), [], method=al.scipy_method(method), dense_output=True, vectorized=vectorized)
            assert solution.success and solution.sol(1.0).shape == (0,)


@pytest.mark.parametrize("method", ADAPTIVE)
class TestAsAClass:
    def test_orders(self, method: str) -> None:
        orders = {"dopri5": (5, 4), "dop853": (8, 7), "radau5": (5, 3), "rodas4": (4, 3)}
        cls = al.scipy_method(method)
        assert issubclass(cls, OdeSolver) and (cls.order, cls.error_estimator_order) == orders[method]
        for theirs, ours in ((RK45, "dopri5"), (DOP853, "dop853")):
            assert theirs.error_estimator_order == orders[ours][1]

    def test_counts_are_scipys(self, method: str) -> None:
        f = Counted(diffusion)
        solution = solve_ivp(f, (0.0, 0.1), start(), method=al.scipy_method(method))
        # Only evaluations for differences are not counted.
        assert solution.nfev < f.calls if method in IMPLICIT else solution.nfev == f.calls
        exact = solve_ivp(Counted(diffusion), (0.0, 0.1), start(), method=al.scipy_method("radau5"), jac_sparsity=BAND)
        assert exact.nfev < 300 and exact.njev > 0
        if method not in IMPLICIT:
            assert solution.njev == solution.nlu == 0

    def test_options_of_others(self, method: str) -> None:
        cls = al.scipy_method(method)
        foreign = {"lband": 1, "min_step": 1e-3} if method in IMPLICIT else {"jac": MATRIX, "jac_sparsity": BAND}
        for key, value in foreign.items():
            with pytest.warns(UserWarning, match=f"The following arguments have no effect for a chosen solver: `{key}`"):
                cls(linear, 0.0, [1.0, 0.0], 1.0, **{key: value})
        with pytest.raises(al.InputError, match="scipy_method: rtoll is unknown"):
            cls(linear, 0.0, [1.0, 0.0], 1.0, rtoll=1e-3)

    def test_complex_states_are_refused_by_name(self, method: str) -> None:
        with pytest.raises(ValueError, match="`y0` is complex"):
            solve_ivp(linear, (0.0, 1.0), [1.0j, 0.0], method=al.scipy_method(method))
        with pytest.raises(al.InputError, match=r"y0 is not an array of real numbers: expected float64, got .*complex"):
            al.integrate(linear, (0.0, 1.0), [1.0j, 0.0], method=method)

    def test_polynomials_go_on_beyond_their_steps(self, method: str) -> None:
        """The parabola of a step is extrapolated over a thousand steps."""
        solver = al.scipy_method(method)(lambda t, y: [y[1], -9.81], 0.0, [0.0, 0.01], 1.0, max_step=1e-5)
        for _ in range(400):
            solver.step()
        dense, t = solver.dense_output(), solver.t + np.array([-0.5e-5, 0.0, 1e-2])
        # The extrapolation multiplies rounding errors of the curvature by the square of the number of steps, 1e6.
        np.testing.assert_allclose(dense(t)[0], 0.01 * t - 9.81 / 2 * t**2, atol=1e-7)
        np.testing.assert_allclose(dense(t)[1], 0.01 - 9.81 * t, atol=1e-7)
        assert dense(t[2]).shape == (2,) and np.array_equal(dense(t[2]), dense(t)[:, 2])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("span", [(1.0, 1.5), (1.5, 1.0), (0.0, 1e-4), (0.0, -1e-4)])
def test_nothing_is_evaluated_outside_of_the_span(method: str, span: tuple[float, float]) -> None:
    options: dict[str, Any] = {"method": method} if method in ADAPTIVE else {"method": method, "dt": abs(span[1] - span[0]) / 7}
    if method == "semi_implicit":
        options["positions"] = 1

    def f(t: float, y: Any) -> Any:
        assert min(span) <= t <= max(span)
        return [y[1], np.cos(t) - y[0]]

    run = al.integrate(f, span, [1.0, 0.0], dense_output=True, **options)
    assert run.success and run.dense is not None
    run.dense(np.linspace(*span, 11))
    if method in ADAPTIVE:
        assert solve_ivp(f, span, [1.0, 0.0], method=al.scipy_method(method), dense_output=True).success


def test_names_that_are_no_names() -> None:
    for name in ([], {}, None, 3):
        with pytest.raises(al.InputError, match="name is unknown"):
            al.scipy_method(name)  # type: ignore[arg-type]


@pytest.mark.parametrize("method", ["dopri5", "dop853", "euler", "rk4"])
def test_explicit_methods_take_systems_whose_jacobian_fits_into_no_memory(method: str) -> None:
    options: dict[str, Any] = {"method": method, "max_step": 1e-3} if method in ADAPTIVE else {"method": method, "dt": 1e-3}
    run = al.integrate(lambda t, y: -y, (0.0, 1e-3), np.ones(10**6), **options)
    assert run.success and run.y.shape == (2, 10**6)
    if method in ADAPTIVE:
        assert al.scipy_method(method)(lambda t, y: -y, 0.0, np.ones(10**6), 1e-3).step() is None
