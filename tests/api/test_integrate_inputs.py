"""`integrate` and `scipy_method`: refused arguments, statuses, and failure of every run that meets NaN."""

from __future__ import annotations

import time
import traceback
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armlet as al

ADAPTIVE = ("dopri5", "dop853", "radau5", "rodas4")
FIXED = ("euler", "semi_implicit", "rk4", "ros2")
METHODS = FIXED + ADAPTIVE


def oscillator(t: float, y: Any) -> list[float]:
    return [y[1], -y[0]]


def options(method: str, dt: float = 1e-2) -> dict[str, Any]:
    if method == "semi_implicit":
        return {"method": method, "dt": dt, "positions": 1}
    return {"method": method, "dt": dt} if method in FIXED else {"method": method}


def fails(f: Any, method: str, y0: Any = (1.0, 0.0), span: tuple[float, float] = (0.0, 1.0)) -> al.SolveError:
    """Return the error of a run that must fail within a second of processor time. The values that it recorded must be finite."""
    began = time.process_time()
    with pytest.raises(al.SolveError) as caught:
        al.integrate(f, span, y0, **options(method))
    assert time.process_time() - began < 1.0
    error = caught.value
    assert error.status in (al.Status.DIVERGED, al.Status.STEP_UNDERFLOW)
    assert np.isfinite(error.partial.y).all() and np.isfinite(error.partial.t).all()
    return error


@pytest.mark.parametrize("method", METHODS)
class TestNotFinite:
    def test_slope_at_the_start(self, method: str) -> None:
        error = fails(lambda t, y: [np.nan, 0.0], method)
        assert error.t == 0.0 and error.status is al.Status.DIVERGED

    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    @pytest.mark.parametrize("end", [1.0, -1.0])
    def test_slope_later(self, method: str, bad: float, end: float) -> None:
        error = fails(lambda t, y: [y[1], bad if abs(t) > 0.5 else -y[0]], method, span=(0.0, end))
        # With fixed steps, the reported time is accurate to one step. Adaptive methods report the last time that they reached.
        assert abs(error.t) == pytest.approx(0.5, abs=2e-2)

    def test_blow_up(self, method: str) -> None:
        # x = 1/(1 - t) has a pole. The rate is infinite shortly before it, because a linearly implicit step of fixed length could jump over
        # the pole.
        fails(lambda t, y: [x**2 if abs(x) < 50 else np.inf for x in y], method, (1.0, 1.0), (0.0, 2.0))

    def test_status_without_raising(self, method: str) -> None:
        run = al.integrate(lambda t, y: [np.nan, 0.0], (0.0, 1.0), [1.0, 0.0], throw=False, **options(method))
        assert run.status is al.Status.DIVERGED and not run.success and run.t.size == 0


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5", "rodas4"])
@pytest.mark.parametrize("rate", [1e20, 1e154, 1e300])
def test_growth_whose_squares_overflow(method: str, rate: float) -> None:
    # If the first step were as long as the span, an L-stable method would damp the growing solution.
    error = fails(lambda t, y: [rate * float(y[0])], method, (1.0,))
    # exp(rate t) overflows at rate t = 709.8.
    assert 0.0 <= error.t <= 720.0 / rate


@pytest.mark.parametrize("method", ["radau5", "rodas4", "ros2"])
def test_ctrl_c_in_a_decomposition(method: str, interrupted: Callable[[str], tuple[list[str], float]]) -> None:
    """With n = 2,500 one matrix decomposition takes seconds, during which f is not called. Ctrl-C must still be answered."""
    words, seconds = interrupted(f"""
        import numpy as np, armlet as al
        a = np.random.default_rng(1).standard_normal((2500, 2500))
        print("ready", flush=True)
        try:
            al.integrate(lambda t, y: a @ y, (0.0, 1.0), np.ones(2500), jac=a, **{options(method)!r})
        except KeyboardInterrupt:
            print("interrupted", flush=True)
    """)
    # The aim of armlet is 0.1 s. The limit is larger because other processes run on a test machine.
    assert words == ["interrupted"] and seconds < 0.5


@pytest.mark.parametrize("method", METHODS)
class TestRuns:
    def test_exceptions_of_the_caller_keep_their_traceback(self, method: str) -> None:
        class Mine(Exception):
            pass

        def raises(t: float, y: Any) -> list[float]:
            if abs(t) > 0.3:
                raise Mine("here")
            return [y[1], -y[0]]

        for end in (1.0, -1.0):
            with pytest.raises(Mine, match="here") as caught:
                al.integrate(raises, (0.0, end), [1.0, 0.0], **options(method))
            assert "raises" in "".join(traceback.format_tb(caught.value.__traceback__))

    def test_no_span(self, method: str) -> None:
        run = al.integrate(oscillator, (3.0, 3.0), [1.0, 2.0], dense_output=True, **options(method))
        assert run.status is al.Status.SUCCESS and run.stats["steps"] == 0
        assert run.t.tolist() == [3.0] and run.y.tolist() == [[1.0, 2.0]]

    def test_forward_and_backward_integration(self, method: str) -> None:
        # Integration forward and backward has the error of the method twice, which is largest at first order.
        forth = al.integrate(oscillator, (0.0, 2.0), [1.0, 0.5], **options(method, 1e-3))
        back = al.integrate(oscillator, (2.0, 0.0), forth.y[-1], **options(method, 1e-3))
        assert forth.t[-1] == 2.0 and back.t[-1] == 0.0 and (np.diff(back.t) < 0).all()
        assert np.abs(back.y[-1] - [1.0, 0.5]).max() < (5e-3 if method in ("euler", "semi_implicit") else 1e-6)

    @pytest.mark.parametrize("end", [2.0, -2.0])
    def test_recorded_times(self, method: str, end: float) -> None:
        times = np.array([0.0, 0.1, 0.1, 0.77, 1.0]) * end
        run = al.integrate(oscillator, (0.0, end), [1.0, 0.0], t_eval=times, **options(method, 1e-3))
        assert np.array_equal(run.t, times)
        assert np.abs(run.y[:, 0] - np.cos(times)).max() < (5e-3 if method in ("euler", "semi_implicit") else 1e-6)
        assert al.integrate(oscillator, (0.0, end), [1.0, 0.0], t_eval=[], **options(method)).y.shape == (0, 2)

    @pytest.mark.parametrize("end", [8.0, -8.0])
    def test_events(self, method: str, end: float) -> None:
        def zero(t: float, y: Any) -> float:
            return float(y[0])

        def falling(t: float, y: Any) -> float:
            return float(y[0])

        falling.direction = -1  # type: ignore[attr-defined]
        falling.terminal = 2  # type: ignore[attr-defined]
        run = al.integrate(oscillator, (0.0, end), [1.0, 0.0], events=[zero, falling], **options(method, 1e-3))
        # cos crosses zero downwards at pi/2 and 5 pi/2, in both directions of time.
        expected = np.sign(end) * np.pi * np.array([0.5, 1.5, 2.5])
        tolerance = 1e-2 if method in ("euler", "semi_implicit") else 1e-5
        assert run.status is al.Status.EVENT and run.success
        assert np.abs(run.t_events[0] - expected).max() < tolerance
        assert np.array_equal(run.t_events[1], run.t_events[0][::2])
        assert run.t[-1] == run.t_events[1][-1] == run.ended
        # The event is located to rounding on the dense output, so the state there is zero up to rounding times the slope.
        assert np.abs(run.y_events[0][:, 0]).max() < 1e-14

    @pytest.mark.parametrize("end", [3.0, -3.0])
    def test_dense_output(self, method: str, end: float) -> None:
        run = al.integrate(oscillator, (0.0, end), [1.0, 0.0], dense_output=True, **options(method, 1e-2))
        assert run.dense is not None
        np.testing.assert_allclose(run.dense(run.t), run.y, rtol=0, atol=1e-14)
        times = np.linspace(0.0, end, 97)
        asked = al.integrate(oscillator, (0.0, end), [1.0, 0.0], t_eval=times, **options(method, 1e-2))
        # Both evaluate the same polynomials by different formulas, so they differ by rounding.
        np.testing.assert_allclose(run.dense(times), asked.y, rtol=0, atol=1e-13)
        assert run.dense(times[5]).shape == (2,)
        with pytest.raises(al.InputError, match="not in the run"):
            run.dense(1.1 * end)

    def test_arguments_and_kinds_of_answers(self, method: str) -> None:
        expected = al.integrate(oscillator, (0.0, 1.0), [1.0, 0.0], **options(method)).y
        for f in (
            lambda t, y, k: (y[1], -k * y[0]),
            lambda t, y, k: np.array([y[1], -k * y[0]]),
            lambda t, y, k: np.array([0.0, y[1], 0.0, -k * y[0]])[1::2],
            lambda t, y, k: [float(y[1]), -k * float(y[0])],
        ):
            for lists in (False, True):
                run = al.integrate(f, (0.0, 1.0), [1, 0], args=(1,), lists=lists, **options(method))
                assert np.array_equal(run.y, expected)

    def test_the_callable_may_keep_its_states(self, method: str) -> None:
        kept: list[Any] = []

        def f(t: float, y: Any) -> Any:
            kept.append((y, y.copy()))
            return -y

        opts = options(method) | ({"positions": 1} if method == "semi_implicit" else {})
        al.integrate(f, (0.0, 0.1), [1.0, 2.0], **opts)
        assert all(np.array_equal(a, b) for a, b in kept)

    def test_a_jacobian_is_used(self, method: str) -> None:
        for jac in ([[0.0, 1.0], [-1.0, 0.0]], lambda t, y: np.array([[0.0, 1.0], [-1.0, 0.0]])):
            for end in (1.0, -1.0):
                run = al.integrate(oscillator, (0.0, end), [1.0, 0.0], jac=jac, **options(method, 1e-3))
                plain = al.integrate(oscillator, (0.0, end), [1.0, 0.0], **options(method, 1e-3))
                assert run.stats["evaluations"] <= plain.stats["evaluations"]
                assert abs(run.y[-1, 0] - np.cos(1.0)) < (5e-3 if method in ("euler", "semi_implicit") else 1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"f": 3}, "integrate: f is not callable: expected f"),
        ({"t_span": 3.0}, "integrate: t_span is not a pair"),
        ({"t_span": (0.0, np.nan)}, "integrate: t_span is not finite"),
        ({"t_span": (0.0, np.inf)}, "integrate: t_span is not finite"),
        ({"y0": [1.0, np.nan]}, r"integrate: y0 is not finite: expected finite numbers, got NaN \(first bad index 1\)"),
        ({"y0": 1.0}, "integrate: y0 has the wrong shape"),
        ({"y0": [[]]}, "integrate: y0 has the wrong shape"),
        ({"y0": [1.0, 2j]}, "integrate: y0 is not an array of real numbers"),
        ({"method": "RK45"}, "integrate: method is unknown: expected one of euler, semi_implicit, rk4"),
        ({"method": "rk4"}, "integrate: dt is missing"),
        ({"dt": 0.1}, "integrate: dt is given"),
        ({"method": "rk4", "dt": 0.0}, "integrate: dt is not positive"),
        ({"method": "rk4", "dt": np.nan}, "integrate: dt is not positive"),
        ({"method": "semi_implicit", "dt": 0.1}, "integrate: positions is 0 of 2 components"),
        ({"method": "semi_implicit", "dt": 0.1, "positions": 2}, "integrate: positions is 2 of 2 components"),
        ({"positions": -1}, "integrate: positions is not a count"),
        ({"rtol": 0.0}, "integrate: rtol is too small"),
        ({"rtol": np.nan}, "integrate: rtol is not finite"),
        ({"atol": -1.0}, "integrate: atol is negative"),
        ({"atol": [1.0, 1.0, 1.0]}, "integrate: atol has the wrong shape"),
        ({"max_step": 0.0}, "integrate: max_step is not positive"),
        ({"first_step": np.inf}, "integrate: first_step is not positive"),
        ({"t_eval": [0.5, 0.2]}, r"integrate: t_eval is not in the order of the span.*\(first bad index 1\)"),
        ({"t_eval": [1.5]}, "integrate: t_eval is not in the order of the span"),
        ({"t_eval": [[0.5]]}, "integrate: t_eval has the wrong shape"),
        ({"events": [3]}, "integrate: events is not callable"),
        ({"jac": [[1.0]], "method": "radau5"}, r"integrate: jac has the wrong shape: expected \(2, 2\)"),
        ({"f": lambda t, y: [1.0]}, r"integrate: f\(t, y\) has the wrong shape: expected \(2,\), got \(1,\)"),
        ({"f": lambda t, y: "no"}, r"integrate: f\(t, y\) is not an array of real numbers"),
        ({"events": lambda t, y: y}, r"integrate: event\(t, y\) is not a number"),
    ],
)
def test_refusals(change: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"f": oscillator, "t_span": (0.0, 1.0), "y0": [1.0, 0.0]} | change
    with pytest.raises(al.InputError, match=message):
        al.integrate(given.pop("f"), given.pop("t_span"), given.pop("y0"), **given)


def test_an_event_that_raises_or_is_nan() -> None:
    def raises(t: float, y: Any) -> float:
        raise KeyError("event")

    with pytest.raises(KeyError, match="event"):
        al.integrate(oscillator, (0.0, 1.0), [1.0, 0.0], events=raises)
    with pytest.raises(al.SolveError) as caught:
        al.integrate(oscillator, (0.0, 1.0), [1.0, 0.0], events=lambda t, y: np.nan)
    assert caught.value.status is al.Status.DIVERGED


@pytest.mark.parametrize("method", ADAPTIVE)
class TestScipyMethod:
    def test_same_steps_as_our_own_loop(self, method: str) -> None:
        for end in (5.0, -5.0):
            theirs = solve_ivp(oscillator, (0.0, end), [1.0, 0.0], method=al.scipy_method(method), rtol=1e-7, atol=1e-9, dense_output=True)
            ours = al.integrate(oscillator, (0.0, end), [1.0, 0.0], method=method, rtol=1e-7, atol=1e-9, dense_output=True)
            assert theirs.success and np.array_equal(theirs.t, ours.t) and np.array_equal(theirs.y.T, ours.y)
            times = np.linspace(0.0, end, 41)
            assert ours.dense is not None
            np.testing.assert_allclose(theirs.sol(times).T, ours.dense(times), rtol=0, atol=1e-13)
            # Counts of scipy may be smaller. It counts no evaluations for differences, and locates the end of a dense output only once.
            assert theirs.nfev <= ours.stats["evaluations"] and theirs.nlu == ours.stats["factorisations"]
            assert theirs.njev == ours.stats["jacobians"]

    def test_events_and_options(self, method: str) -> None:
        solution = solve_ivp(oscillator, (0.0, 5.0), [1.0, 0.0], method=al.scipy_method(method), events=lambda t, y: y[0], max_step=0.1)
        assert np.abs(solution.t_events[0] - np.pi * np.array([0.5, 1.5])).max() < 1e-4
        assert solution.t.size > 50

    def test_failures(self, method: str) -> None:
        solution = solve_ivp(lambda t, y: [np.nan if t > 0.5 else 1.0], (0.0, 1.0), [0.0], method=al.scipy_method(method))
        assert not solution.success and solution.status == -1 and np.isfinite(solution.y).all()
        with pytest.raises(al.InputError, match="is unknown"):
            solve_ivp(oscillator, (0.0, 1.0), [1.0, 0.0], method=al.scipy_method(method), nonsense=1)
        with pytest.raises(ZeroDivisionError):
            solve_ivp(lambda t, y: [1 / 0], (0.0, 1.0), [0.0], method=al.scipy_method(method))


def test_scipy_method_refuses_other_names() -> None:
    with pytest.raises(al.InputError, match="expected one of dopri5, dop853, radau5, rodas4, got 'rk4'"):
        al.scipy_method("rk4")


KEEP: dict[str, Any] = {
    "the array": lambda y: y,
    "a view": lambda y: y[:1],
    "a memoryview": memoryview,
    "a tuple of it": lambda y: (y,),
}


@pytest.mark.parametrize("keep", KEEP.values(), ids=KEEP.keys())
def test_arrays_that_were_kept_do_not_change(keep: Any) -> None:
    kept: list[Any] = []

    def f(t: float, y: Any) -> Any:
        kept.append((float(y[0]), keep(y) if len(kept) % 3 else None))
        return [y[1], -y[0]]

    al.integrate(f, (0.0, 1.0), [1.0, 0.0], method="dopri5")
    there = [(x, held) for x, held in kept if held is not None]
    assert len(there) > 20
    for x, held in there:
        assert np.asarray(held).reshape(-1)[0] == x


def test_an_array_that_is_gone_stays_gone() -> None:
    seen: list[Any] = []

    def f(t: float, y: Any) -> Any:
        assert all(reference() is None for reference in seen)
        seen.append(weakref.ref(y))
        return [y[1], -y[0]]

    al.integrate(f, (0.0, 1.0), [1.0, 0.0], method="dop853")
    assert len(seen) > 20


def test_an_array_that_was_changed_is_not_given_again() -> None:
    changes: list[Any] = [
        lambda y: setattr(y, "shape", (2, 1)),
        lambda y: y.setflags(write=False),
        lambda y: setattr(y, "dtype", np.int64),
        lambda y: y.resize(1, refcheck=False),
        lambda y: y.fill(np.nan),
    ]
    calls = 0

    def f(t: float, y: Any) -> Any:
        nonlocal calls
        assert y.shape == (2,) and y.dtype == np.float64 and y.flags.writeable and np.all(np.isfinite(y))
        slope = [float(y[1]), -float(y[0])]
        changes[calls % len(changes)](y)
        calls += 1
        return slope

    run = al.integrate(f, (0.0, 1.0), [1.0, 0.0], method="dopri5", rtol=1e-9)
    assert calls > 50
    np.testing.assert_allclose(run.y[-1], [np.cos(1.0), -np.sin(1.0)], atol=1e-7)
