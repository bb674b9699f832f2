"""Invalid arguments raise an error that names the function, the argument and the first bad index. Runs that diverge have a status."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pr_loops import ARM, HOLD, INF, LAW, NAN, PLANT, adaptive, batch, run
from refusals import refused

import armlet as al

Array = NDArray[np.float64]

# Plants.


@pytest.mark.parametrize(
    "pi",
    [
        (1, 1, 1),
        (1, 2, 1),
        (1, -1, 1),
        (0, 0, 1),
        (1, 0, 0),
        (-1, 0, -1),
        (-2, 0.5, 0.5),
        (2, 0.5, -0.5),
        (NAN, 0, 1),
        (1, NAN, 1),
        (1, 0, INF),
        (1, -INF, 1),
    ],
    ids=str,
)
def test_impossible_plants(pi: tuple[float, ...]) -> None:
    refused(lambda: al.planar_pr(*pi), "planar_pr:")


def test_a_barely_possible_plant() -> None:
    """A C > B^2 by one part in 1e15 gives a valid plant; A C = B^2 does not."""
    al.planar_pr(1.0, 1.0, 1.0 + 1e-15)
    refused(lambda: al.planar_pr(1.0, 1.0, 1.0), "planar_pr:")


@pytest.mark.parametrize("value", ["2.0", None, 1j, [2.0], True, object(), np.complex128(1.0), 10**400], ids=lambda x: type(x).__name__)
def test_scalars_of_the_wrong_kind(value: Any) -> None:
    refused(lambda: al.planar_pr(value, 0.5, 0.5), "planar_pr:", "A ")
    refused(lambda: al.Quintic([0.0], [1.0], value), "Quintic:", "duration ")
    if not isinstance(value, list):
        # A list of times is a valid argument of a motion.
        refused(lambda: HOLD(value), "Motion:", "t ")
    refused(lambda: LAW(value, [0.0, 0.0], [0.0, 0.0]), "Adaptive:", "t ")
    refused(lambda: run(t_end=value), "simulate:", "t_end ")
    if value is not None:
        refused(lambda: run(method="dop853", rtol=value), "simulate:", "rtol is not a number")
        refused(lambda: batch(method="dop853", atol=value), "simulate_batch:", "atol is not a number")
        refused(lambda: run(dt=value), "simulate:", "dt ")
        refused(lambda: run(sample_time=value), "simulate:", "sample_time ")


def test_scalars_of_any_honest_kind() -> None:
    exact = run(law=calm(), t_end=1.0, dt=0.5, state_limit=INF, monitors=False).q
    for one, half in ((1, 0.5), (np.float32(1.0), np.float64(0.5)), (np.int64(1), np.array(0.5)), (np.array(1), np.float16(0.5))):
        np.testing.assert_array_equal(run(law=calm(), t_end=one, dt=half, state_limit=INF, monitors=False).q, exact)


# Gains and shapes.


@pytest.mark.parametrize("name, n", [("kp", 2), ("kd", 2), ("gamma", 3)])
def test_gains(name: str, n: int) -> None:
    eye = np.eye(n)
    skewed, nan = eye.copy(), eye.copy()
    skewed[0, 1], nan[1, 0] = 0.5, NAN
    for value in (0.0, -1.0, np.zeros(n), [1.0] * (n - 1) + [-1.0], -eye, np.ones((n, n)), np.diag([1.0] * (n - 1) + [-1e-3]), skewed):
        refused(lambda value=value: adaptive(**{name: value}), "Adaptive:", name)
    refused(lambda: adaptive(**{name: nan}), "Adaptive:", name, "first bad index (1, 0)")
    refused(lambda: adaptive(**{name: [1.0] * (n - 1) + [INF]}), "Adaptive:", name, f"first bad index {n - 1}")
    refused(lambda: adaptive(**{name: NAN}), "Adaptive:", name)
    for shape in ((n + 1,), (1,), (n, 1), (1, n), (n + 1, n + 1), (1, n, n), (0,)):
        refused(lambda shape=shape: adaptive(**{name: np.ones(shape)}), "Adaptive:", name, "shape", str(shape))


def test_wrong_shapes() -> None:
    for shape in ((), (1,), (3,), (4, 3), (2, 1), (0,)):
        refused(lambda shape=shape: ARM.mass_matrix(np.zeros(shape)), "mass_matrix:", "q ", "shape", "(..., 2)")
        refused(lambda shape=shape: ARM.bias([0.0, 0.0], np.zeros(shape)), "bias:", "v ", "shape")
    refused(lambda: ARM.bias(np.zeros((3, 2)), np.zeros((4, 2))), "bias:", "q, v", "broadcast", "(3,)", "(4,)")
    refused(lambda: adaptive(estimate=np.zeros(2)), "estimate", "(3,)", "(2,)")
    refused(lambda: adaptive(motion=al.Hold([0.0, 0.0, 0.0])), "Adaptive:", "motion", "expected 2")
    refused(lambda: al.Quintic([0.0, 0.0], [1.0], 1.0), "Quintic:", "q1", "(2,)")
    refused(lambda: al.Quintic([0.0], [1.0], 0.0), "Quintic:", "duration")
    refused(lambda: al.Hold(1.0), "Hold:", "q ", "(n,)")
    refused(lambda: al.Hold([]), "Hold:", "q ")
    refused(lambda: al.Sinusoid([0.0, 0.0], np.ones((2, 3)), np.ones((2, 2)), 0.0), "Sinusoid:", "frequency", "expected 3")
    refused(lambda: al.Sinusoid([0.0, 0.0], np.ones((3, 2)), 1.0, 0.0), "Sinusoid:", "amplitude")
    refused(lambda: run(q0=[0.0]), "simulate:", "q0", "(2,)", "(1,)")
    refused(lambda: run(v0=np.zeros((1, 2))), "simulate:", "v0", "(1, 2)")
    refused(lambda: batch(q0=np.zeros(2)), "simulate_batch:", "q0", "(B, 2)")
    refused(lambda: batch(q0=np.zeros((2, 3))), "simulate_batch:", "q0", "(B, 2)")
    refused(lambda: batch(v0=np.zeros((2, 2))), "simulate_batch:", "v0", "(3, 2)", "(2, 2)")
    refused(lambda: batch(plant=[PLANT] * 2), "simulate_batch:", "plant", "1 or 3", "got 2")
    refused(lambda: batch(law=[LAW] * 4), "simulate_batch:", "law", "1 or 3", "got 4")
    refused(lambda: batch(law=[]), "simulate_batch:", "law", "empty")
    refused(lambda: batch(law=[LAW, LAW, al.ComputedTorque(ARM, HOLD, 1.0, 1.0)]), "law", "first bad index 2")
    refused(lambda: LAW(0.0, [0.0, 0.0], [0.0, 0.0], state=[0.0]), "Adaptive:", "state", "(3,)")
    refused(lambda: LAW(0.0, [0.0, 0.0], [0.0, 0.0], theta=[0.0, 0.0]), "Adaptive:", "theta")
    refused(lambda: ARM.with_parameters([1.0, 2.0]), "with_parameters:", "pi", "(3,)")


# Numbers that are not finite, with their index.


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
def test_not_finite(bad: float) -> None:
    one, many = np.array([0.0, bad]), np.zeros((4, 3, 2))
    many[2, 1, 0] = bad
    refused(lambda: ARM.mass_matrix(one), "mass_matrix: q ", "first bad index 1")
    refused(lambda: ARM.mass_matrix(many), "mass_matrix: q ", "first bad index (2, 1, 0)")
    refused(lambda: ARM.bias([0.0, 0.0], many), "bias: v ", "first bad index (2, 1, 0)")
    refused(lambda: ARM.regressor(np.ones(2), np.ones(2), np.ones((3, 2)), many), "a_r ", "(2, 1, 0)")
    refused(lambda: LAW(0.0, one, [0.0, 0.0]), "Adaptive: q ", "first bad index 1")
    refused(lambda: LAW.terms(bad, [0.0, 0.0], [0.0, 0.0]), "terms: t ")
    refused(lambda: HOLD(bad), "Motion: t ")
    refused(lambda: al.Hold(one), "Hold: q ", "first bad index 1")
    refused(lambda: al.Quintic([0.0], [1.0], bad), "Quintic: duration ")
    refused(lambda: al.Sinusoid([0.0, 0.0], one, 1.0, 0.0), "Sinusoid: amplitude ", "first bad index 1")
    refused(lambda: al.Table(bad, np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((2, 1))), "Table: dt ")
    refused(lambda: al.Table(0.1, np.zeros((2, 2)), many[2][:2], np.zeros((2, 2))), "Table: v ", "first bad index (1, 0)")
    refused(lambda: adaptive(estimate=[0.0, 0.0, bad]), "Adaptive: estimate ", "first bad index 2")
    refused(lambda: ARM.with_parameters([0.0, bad, 0.0]), "with_parameters: pi ", "first bad index 1")
    refused(lambda: run(q0=one), "simulate: q0 ", "first bad index 1")
    refused(lambda: run(v0=one), "simulate: v0 ", "first bad index 1")
    refused(lambda: batch(q0=many[2]), "simulate_batch: q0 ", "first bad index (1, 0)")
    for name in ("t_end", "dt", "sample_time"):
        refused(lambda name=name: run(**{name: bad}), f"simulate: {name} ")
    for name in ("rtol", "atol"):
        refused(lambda name=name: run(method="dop853", **{name: bad}), f"simulate: {name} ")
    refused(lambda: run(t_eval=[0.0, bad]), "simulate: t_eval ", "first bad index 1")
    if not bad > 0:
        refused(lambda: run(tau_max=[1.0, bad]), "simulate: tau_max ", "first bad index 1")


def test_results_that_are_not_finite() -> None:
    """A singular mass matrix and an overflow raise an error that names the row."""
    singular = ARM.with_parameters([1.0, 1.0, 1.0])
    tau = np.ones((3, 2))
    q = np.array([[1.0, 1.0], [0.0, 2.0], [1.0, 0.0]])
    refused(lambda: singular.forward_dynamics(q, 0.0 * q, tau + q), "forward_dynamics: q, v, tau ", "not finite", "first bad index (2, 0)")
    refused(lambda: ARM.bias([0.0, 1.0], [1e200, 1e200]), "bias: q, v ", "not finite", "first bad index 0")
    refused(lambda: ARM.energy([0.0, 0.0], [1e200, 0.0]), "energy: q, v ", "not finite")


# Objects and names.


def test_objects_of_the_wrong_type() -> None:
    refused(lambda: al.RigidArm(2.0), "RigidArm:", "arm ", "float")
    refused(lambda: al.RigidArm(PLANT), "RigidArm:", "arm ", "RigidArm")
    refused(lambda: adaptive(arm=PLANT), "Adaptive:", "arm ")
    refused(lambda: adaptive(motion=[0.0, 0.0]), "Adaptive:", "motion ", "list")
    refused(lambda: al.ComputedTorque(None, HOLD, 1.0, 1.0), "ComputedTorque:", "arm ")
    refused(lambda: al.ComputedTorque(ARM, LAW, 1.0, 1.0), "ComputedTorque:", "motion ")
    refused(lambda: run(plant=ARM), "simulate:", "plant ", "Arm")
    refused(lambda: run(law=HOLD), "simulate:", "law ", "Hold")
    refused(lambda: run(law=lambda t, q, v: q), "simulate:", "law ")
    refused(lambda: run(plant=LAW, law=PLANT), "simulate:", "plant ")
    refused(lambda: batch(plant=[PLANT, ARM, PLANT]), "simulate_batch:", "plant ", "first bad index 1")
    refused(lambda: batch(law=None), "simulate_batch:", "law ")
    refused(lambda: batch(q0=PLANT), "simulate_batch:", "q0 ")


def test_names_are_listed() -> None:
    refused(lambda: run(method="rk5"), "simulate: method is unknown", "rk4", "dop853", "got rk5")
    refused(lambda: batch(method=""), "simulate_batch: method is unknown", "rk4, ros2, dopri5, dop853")
    refused(lambda: batch(keep="some"), "simulate_batch: keep is unknown", "all, final", "some")
    refused(lambda: ARM.pose([0.0, 0.0], "tip"), "pose: frame is unknown", "tip")
    refused(lambda: ARM.pose_vector([0.0, 0.0], "tip"), "pose_vector: frame is unknown", "tip")
    for value in (4, None, b"rk4", ["rk4"]):
        refused(lambda value=value: run(method=value), "simulate:", "method ")
        refused(lambda value=value: batch(keep=value), "simulate_batch:", "keep ")


@pytest.mark.parametrize("value", [0, -1, 1.5, "2", 10**30, NAN], ids=repr)
def test_counts(value: Any) -> None:
    refused(lambda: run(record_every=value), "simulate:", "record_every ")
    refused(lambda: batch(threads=value), "simulate_batch:", "threads ")


# Times.


def test_a_run_of_no_length() -> None:
    for options in ({"dt": 1e-3}, {"method": "dop853"}, {"dt": 1e-3, "sample_time": 1e-3}, {"dt": 1e-3, "t_eval": [0.0]}):
        result = run(t_end=0.0, **({"dt": None} | options))
        np.testing.assert_array_equal(result.t, [0.0])
        np.testing.assert_array_equal(result.q, [[0.1, 0.2]])
        np.testing.assert_allclose(result.tau, [LAW(0.0, [0.1, 0.2], [0.0, 0.0])], atol=1e-13)
        assert result.status is al.Status.SUCCESS
        # All rows of an adaptive batch have the same recorded times.
        rows = batch(t_end=0.0, **({"dt": None, "t_eval": [0.0]} | options))
        assert rows.q.shape == (3, 1, 2)


def test_a_step_longer_than_the_run() -> None:
    np.testing.assert_array_equal(run(t_end=0.01, dt=5.0).t, [0.0, 0.01])
    # The only step is as long as the run. Its result equals that of `dt=0.01` to the last bit.
    np.testing.assert_array_equal(run(t_end=0.01, dt=5.0).q, run(t_end=0.01, dt=0.01).q)


def test_steps_and_spans() -> None:
    for value in (0.0, -1e-3):
        refused(lambda value=value: run(dt=value), "simulate: dt ")
        refused(lambda value=value: run(sample_time=value), "simulate: sample_time ")
    refused(lambda: run(t_end=-1.0), "simulate: t_end ", "-1")
    refused(lambda: run(dt=None), "simulate: dt is missing")
    refused(lambda: run(sample_time=1.5e-3), "simulate: sample_time ", "multiple")
    refused(lambda: run(dt=1e-300), "simulate: dt ")
    refused(lambda: run(method="dop853", rtol=0.0), "simulate: rtol ")
    refused(lambda: run(method="dop853", rtol=1e-17), "simulate: rtol ")
    refused(lambda: run(method="dop853", atol=-1.0), "simulate: atol ")
    refused(lambda: run(tau_max=0.0), "simulate: tau_max ")
    refused(lambda: run(tau_max=[1.0, -1.0]), "simulate: tau_max ", "first bad index 1")
    refused(lambda: run(tau_max=[1.0, 1.0, 1.0]), "simulate: tau_max ", "(3,)")


@pytest.mark.parametrize("options", [{"dt": 1e-3}, {"dt": None, "method": "dop853"}], ids=["rk4", "dop853"])
def test_wanted_times(options: dict[str, Any]) -> None:
    refused(lambda: run(t_eval=[0.0, 0.005, 0.005], **options), "simulate: t_eval is not increasing", "first bad index 2")
    refused(lambda: run(t_eval=[0.005, 0.001], **options), "simulate: t_eval is not increasing", "first bad index 1")
    refused(lambda: run(t_eval=[0.0, 0.02], **options), "simulate: t_eval leaves the run", "first bad index 1")
    refused(lambda: run(t_eval=[-1e-9, 0.0], **options), "simulate: t_eval leaves the run", "first bad index 0")
    refused(lambda: run(t_eval=[[0.0]], **options), "simulate: t_eval ", "shape")
    refused(lambda: run(t_eval=0.01, **options), "simulate: t_eval ", "shape")
    wanted = [0.001234, 0.005]
    np.testing.assert_array_equal(run(t_eval=wanted, **options).t, wanted)
    nothing = run(t_eval=[], **options)
    assert nothing.t.shape == (0,) and nothing.q.shape == (0, 2) and nothing.status is al.Status.SUCCESS


# Runs that diverge.


def diverging() -> al.Adaptive:
    """A law whose adaptation is unstable at steps of 50 ms."""
    return al.Adaptive(ARM, HOLD, 400.0, 200.0, 1e6)


def calm() -> al.Adaptive:
    """A law that is stable at steps of 50 ms."""
    return al.Adaptive(ARM, HOLD, 4.0, 4.0, 0.5)


@pytest.mark.parametrize("options", [{"dt": 0.05}, {"dt": 0.05, "sample_time": 0.05}], ids=["continuous", "sampled"])
def test_a_run_that_diverges(options: dict[str, Any]) -> None:
    with pytest.raises(al.SolveError, match=r"simulate: the run ended at t = .*: diverged: .*dt") as caught:
        run(law=diverging(), t_end=100.0, **options)
    error = caught.value
    assert isinstance(error, RuntimeError) and error.status is al.Status.DIVERGED
    assert error.t is not None and 0.0 < error.t < 100.0
    partial = error.partial
    assert isinstance(partial, al.Run) and partial.status is al.Status.DIVERGED
    assert partial.t[0] == 0.0 and partial.t[-1] <= error.t and np.all(np.isfinite(partial.q))
    assert "diverged" in repr(partial)
    same = run(law=diverging(), t_end=100.0, throw=False, **options)
    assert same.status is al.Status.DIVERGED
    np.testing.assert_array_equal(same.q, partial.q)


def test_rows_that_diverge_do_not_raise() -> None:
    result = batch(law=[calm(), diverging(), calm()], t_end=10.0, dt=0.05)
    np.testing.assert_array_equal(result.status, [0, 1, 0])
    assert np.isfinite(result.stats["ended"]).all() and result.stats["ended"][1] < 10.0


def test_numbers_that_overflow_end_a_run_at_once() -> None:
    """The initial rate is not finite. The run ends without a step and without hanging."""
    for options in ({"dt": 1e-3}, {"dt": None, "method": "dop853"}):
        result = run(v0=[1e200, 1e200], throw=False, **options)
        assert result.status in (al.Status.DIVERGED, al.Status.STEP_UNDERFLOW)
