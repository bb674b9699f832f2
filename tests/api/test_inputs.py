"""Misuse is a typed error that names function, argument and first bad index; every honest form of the same numbers gives the same bits."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

ARM = al.planar_pr(2.0, 0.5, 0.5)
PLANT = al.RigidArm(ARM)
HOLD = al.Hold([1.0, -0.5])
LAW = al.Adaptive(ARM, HOLD, 40.0, 20.0, 5.0)
NAN, INF = float("nan"), float("inf")

RUN: dict[str, Any] = {"t_end": 0.01, "dt": 1e-3}


def run(**changes: Any) -> al.Run:
    given = {"plant": PLANT, "law": LAW, "q0": [0.1, 0.2]} | RUN | changes
    return al.simulate(given.pop("plant"), given.pop("law"), given.pop("q0"), **given)


def batch(**changes: Any) -> al.BatchRun:
    given = {"plant": PLANT, "law": LAW, "q0": np.zeros((3, 2))} | RUN | changes
    return al.simulate_batch(given.pop("plant"), given.pop("law"), given.pop("q0"), **given)


def adaptive(**changes: Any) -> al.Adaptive:
    given = {"arm": ARM, "motion": HOLD, "kp": 40.0, "kd": 20.0, "gamma": 5.0} | changes
    return al.Adaptive(**given)


def refused(call: Callable[[], Any], *words: str) -> None:
    """An InputError whose message holds these words."""
    with pytest.raises(al.InputError) as caught:
        call()
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, al.ArmletError)
    message = str(caught.value)
    assert "expected" in message, message
    for word in words:
        assert word in message, (word, message)


# Plants


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
    """A C > B^2 by one part in 1e15 is a plant; equality is none."""
    al.planar_pr(1.0, 1.0, 1.0 + 1e-15)
    refused(lambda: al.planar_pr(1.0, 1.0, 1.0), "planar_pr:")


@pytest.mark.parametrize("value", ["2.0", None, 1j, [2.0], True, object(), np.complex128(1.0), 10**400], ids=lambda x: type(x).__name__)
def test_scalars_of_the_wrong_kind(value: Any) -> None:
    refused(lambda: al.planar_pr(value, 0.5, 0.5), "planar_pr:", "A ")
    refused(lambda: al.Quintic([0.0], [1.0], value), "Quintic:", "duration ")
    refused(lambda: HOLD(value), "Motion:", "t ")
    refused(lambda: LAW(value, [0.0, 0.0], [0.0, 0.0]), "Adaptive:", "t ")
    refused(lambda: run(t_end=value), "simulate:", "t_end ")
    refused(lambda: run(rtol=value), "simulate:", "rtol ")
    refused(lambda: batch(atol=value), "simulate_batch:", "atol ")
    if value is not None:
        refused(lambda: run(dt=value), "simulate:", "dt ")
        refused(lambda: run(sample_time=value), "simulate:", "sample_time ")


def test_scalars_of_any_honest_kind() -> None:
    exact = run(law=calm(), t_end=1.0, dt=0.5).q
    for one, half in ((1, 0.5), (np.float32(1.0), np.float64(0.5)), (np.int64(1), np.array(0.5)), (np.array(1), np.float16(0.5))):
        np.testing.assert_array_equal(run(law=calm(), t_end=one, dt=half).q, exact)


# Gains and shapes


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


# Not finite, with its index


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
    """A singular mass matrix and an overflow are told from finite answers, with the row."""
    singular = ARM.with_parameters([1.0, 1.0, 1.0])
    tau = np.ones((3, 2))
    q = np.array([[1.0, 1.0], [0.0, 2.0], [1.0, 0.0]])
    refused(lambda: singular.forward_dynamics(q, 0.0 * q, tau + q), "forward_dynamics: q, v, tau ", "not finite", "first bad index (2, 0)")
    refused(lambda: ARM.bias([0.0, 1.0], [1e200, 1e200]), "bias: q, v ", "not finite", "first bad index 0")
    refused(lambda: ARM.energy([0.0, 0.0], [1e200, 0.0]), "energy: q, v ", "not finite")


# Kinds of arrays

REFUSED: dict[str, Any] = {
    "complex": np.zeros(2, complex),
    "object": np.array([0.0, None], object),
    "string": np.array(["0", "1"]),
    "bool": np.array([True, False]),
    "ragged": [[0.0, 0.0], [0.0]],
    "dates": np.zeros(2, "datetime64[s]"),
    "records": np.zeros(2, [("a", float)]),
    "mapping": {"a": 1.0},
    "text": "00",
    "none in a list": [0.0, None],
    "huge integers": [10**400, 0],
}


@pytest.mark.parametrize("value", REFUSED.values(), ids=REFUSED.keys())
def test_arrays_of_the_wrong_kind(value: Any) -> None:
    refused(lambda: ARM.mass_matrix(value), "mass_matrix: q ", "real numbers")
    refused(lambda: ARM.bias([0.0, 0.0], value), "bias: v ")
    refused(lambda: LAW(0.0, [0.0, 0.0], value), "Adaptive: v ")
    refused(lambda: LAW(0.0, [0.0, 0.0], [0.0, 0.0], state=value), "Adaptive: state ")
    refused(lambda: al.Hold(value), "Hold: q ")
    refused(lambda: al.Sinusoid([0.0, 0.0], value, 1.0, 0.0), "Sinusoid: amplitude ")
    refused(lambda: adaptive(kp=value), "Adaptive: kp ")
    refused(lambda: adaptive(estimate=value), "Adaptive: estimate ")
    refused(lambda: run(q0=value), "simulate: q0 ")
    refused(lambda: run(t_eval=value), "simulate: t_eval ")
    refused(lambda: run(tau_max=value), "simulate: tau_max ")
    refused(lambda: batch(q0=value), "simulate_batch: q0 ")


def unaligned(array: Array) -> Array:
    raw = np.zeros(array.nbytes + 1, np.uint8)[1:]
    view = raw.view(np.float64).reshape(array.shape)
    view[...] = array
    assert not view.flags.aligned
    return view


def frozen(array: Array) -> Array:
    copy = array.copy()
    copy.flags.writeable = False
    return copy


FORMS: dict[str, Callable[[Array], Any]] = {
    "list": lambda x: x.tolist(),
    "tuples": lambda x: tuple(map(tuple, x.tolist())),
    "integers": lambda x: x.astype(int),
    "small integers": lambda x: x.astype(np.int8),
    "unsigned": lambda x: np.abs(x).astype(np.uint16) if np.all(x >= 0) else x.astype(np.int16),
    "float32": lambda x: x.astype(np.float32),
    "float16": lambda x: x.astype(np.float16),
    "long double": lambda x: x.astype(np.longdouble),
    "big endian": lambda x: x.astype(">f8"),
    "strided": lambda x: np.repeat(np.repeat(x, 2, axis=0), 3, axis=1)[::2, ::3],
    "reversed": lambda x: x[::-1, ::-1].copy()[::-1, ::-1],
    "Fortran": np.asfortranarray,
    "read-only": frozen,
    "unaligned": unaligned,
}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS.keys())
def test_the_same_numbers_give_the_same_bits(form: Callable[[Array], Any]) -> None:
    """Small integers are exact in every one of these forms."""
    rng = np.random.default_rng(5)
    q, v, a = rng.integers(-3, 4, (3, 7, 2)).astype(float)
    for name, values in (("mass_matrix", (q,)), ("bias", (q, v)), ("forward_dynamics", (q, v, a)), ("regressor", (q, v, a, q))):
        expected = getattr(ARM, name)(*values)
        got = getattr(ARM, name)(*[form(x) for x in values])
        np.testing.assert_array_equal(got, expected)
        assert got.dtype == np.float64 and got.flags.c_contiguous and got.flags.owndata and got.flags.writeable
    kp = np.array([[4.0, 1.0], [1.0, 3.0]])
    gamma = np.diag([1.0, 2.0, 3.0])
    law = al.Adaptive(ARM, HOLD, form(kp), form(kp), form(gamma))
    plain = al.Adaptive(ARM, HOLD, kp, kp, gamma)
    expected = al.simulate_batch(PLANT, plain, q, v0=v, **RUN)
    got = al.simulate_batch(PLANT, law, form(q), v0=form(v), **RUN)
    np.testing.assert_array_equal(got.q, expected.q)
    np.testing.assert_array_equal(got.estimate, expected.estimate)  # type: ignore[arg-type]


def test_what_the_caller_changes_later_changes_nothing() -> None:
    q0, kp, estimate = np.zeros(2), np.array([4.0, 4.0]), np.zeros(3)
    law = al.Adaptive(ARM, al.Quintic(q0, q0 + 1.0, 1.0), kp, 2.0, 1.0, estimate=estimate)
    before, shown = law(0.3, [0.1, 0.2], [0.0, 0.0]), repr(law)
    q0 += 5.0
    kp *= -1.0
    estimate += 7.0
    np.testing.assert_array_equal(law(0.3, [0.1, 0.2], [0.0, 0.0]), before)
    assert repr(law) == shown


# out=


def test_out_is_filled() -> None:
    q = np.array([[0.1, 0.2], [0.3, 0.4]])
    out = np.full((2, 2, 2), NAN)
    assert ARM.mass_matrix(q, out=out) is out
    np.testing.assert_array_equal(out, ARM.mass_matrix(q))


def test_out_that_cannot_be_written() -> None:
    q = np.zeros((4, 2))
    refused(lambda: ARM.bias(q, q, out=frozen(q)), "bias: out ", "read-only")
    refused(lambda: ARM.bias(q, q, out=np.zeros((4, 3))), "bias: out ", "shape", "(4, 2)", "(4, 3)")
    refused(lambda: ARM.bias(q, q, out=np.zeros(2)), "bias: out ", "shape")
    refused(lambda: ARM.bias(q, q, out=np.zeros((4, 2), np.float32)), "bias: out ", "float64")
    refused(lambda: ARM.bias(q, q, out=[0.0] * 8), "bias: out ", "float64")
    refused(lambda: ARM.bias(q, q, out=np.zeros((2, 4)).T), "bias: out ", "contiguous")
    refused(lambda: ARM.bias(q, q, out=np.zeros((4, 2), ">f8")), "bias: out ", "float64")
    refused(lambda: ARM.bias(q, q, out=unaligned(q)), "bias: out ")
    # (a broadcast view holds one row four times)
    refused(lambda: ARM.bias(q, q, out=np.broadcast_to(np.zeros(2), (4, 2))), "bias: out ")


def test_out_that_overlaps() -> None:
    memory = np.zeros(20)
    q = memory[:8].reshape(4, 2)
    refused(lambda: ARM.bias(q, np.zeros((4, 2)), out=q), "bias: out ", "overlaps")
    refused(lambda: ARM.bias(np.zeros((4, 2)), q, out=memory[7:15].reshape(4, 2)), "bias: out ", "overlaps")
    refused(lambda: ARM.bias(q[::-1, ::-1], np.zeros((4, 2)), out=q), "bias: out ", "overlaps")
    beside = memory[8:16].reshape(4, 2)
    assert ARM.bias(q, np.zeros((4, 2)), out=beside) is beside


def test_a_refused_call_leaves_out_alone() -> None:
    out = np.full(2, 7.0)
    refused(lambda: ARM.bias([0.0, NAN], [0.0, 0.0], out=out), "q ")
    np.testing.assert_array_equal(out, 7.0)


# Sizes


def test_an_empty_batch_is_empty() -> None:
    empty = np.zeros((0, 2))
    for kind in (float, int, np.float32):
        assert ARM.mass_matrix(empty.astype(kind)).shape == (0, 2, 2)
    assert ARM.bias(np.zeros((3, 0, 2)), np.zeros(2)).shape == (3, 0, 2)
    assert ARM.energy(empty, empty)[0].shape == (0,)
    result = batch(q0=empty)
    assert result.q.shape == (0, 11, 2) and result.status.shape == (0,) and len(result) == 0 and "0 runs" in repr(result)
    assert result.t.shape == (11,)
    assert list(result) == []


def test_a_batch_of_one() -> None:
    result = batch(q0=[[0.1, 0.2]])
    assert result.q.shape == (1, 11, 2)
    np.testing.assert_allclose(result.q[0], run().q, atol=1e-12)
    assert ARM.mass_matrix([[0.1, 0.2]]).shape == (1, 2, 2)


def test_too_much_is_a_memory_error_at_once() -> None:
    many = np.broadcast_to(np.zeros(2), (10**15, 2))
    for call in (lambda: batch(q0=many), lambda: ARM.mass_matrix(many), lambda: ARM.energy(many, many)):
        with pytest.raises(MemoryError):
            call()
    with pytest.raises(MemoryError):
        batch(q0=np.zeros((100_000, 2)), t_end=1e4, dt=1e-3)
    with pytest.raises(MemoryError):
        run(t_end=1e9, dt=1e-3)


def test_an_outer_product_too_large_does_not_end_the_process() -> None:
    """10^12 rows from two small arguments: in a process of its own, because the fault would be an abort."""
    code = """
import numpy as np, armlet as al
arm = al.planar_pr(2.0, 0.5, 0.5)
for function in (arm.bias, arm.energy):
    try:
        function(np.zeros((10**6, 1, 2)), np.zeros((1, 10**6, 2)))
    except MemoryError:
        print("refused")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "refused\nrefused\n"), done.stderr


# Objects and names


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
    for value in (4, None, b"rk4", ["rk4"]):
        refused(lambda value=value: run(method=value), "simulate:", "method ")
        refused(lambda value=value: batch(keep=value), "simulate_batch:", "keep ")


@pytest.mark.parametrize("value", [0, -1, 1.5, "2", 10**30, NAN], ids=repr)
def test_counts(value: Any) -> None:
    refused(lambda: run(record_every=value), "simulate:", "record_every ")
    refused(lambda: batch(threads=value), "simulate_batch:", "threads ")


# Time


def test_a_run_of_no_length() -> None:
    for options in ({"dt": 1e-3}, {"method": "dop853"}, {"dt": 1e-3, "sample_time": 1e-3}, {"dt": 1e-3, "t_eval": [0.0]}):
        result = run(t_end=0.0, **({"dt": None} | options))
        np.testing.assert_array_equal(result.t, [0.0])
        np.testing.assert_array_equal(result.q, [[0.1, 0.2]])
        np.testing.assert_allclose(result.tau, [LAW(0.0, [0.1, 0.2], [0.0, 0.0])], atol=1e-13)
        assert result.status is al.Status.SUCCESS
        # (adaptive batches share the times they are asked for)
        rows = batch(t_end=0.0, **({"dt": None, "t_eval": [0.0]} | options))
        assert rows.q.shape == (3, 1, 2)


def test_a_step_longer_than_the_run() -> None:
    np.testing.assert_array_equal(run(t_end=0.01, dt=5.0).t, [0.0, 0.01])
    # The one step is cut to the run: the same bits as a step of that length.
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


# Outcome is data


def diverging() -> al.Adaptive:
    """An adaptation far too fast for a step of 50 ms."""
    return al.Adaptive(ARM, HOLD, 400.0, 200.0, 1e6)


def calm() -> al.Adaptive:
    """Gains that a step of 50 ms still follows."""
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
    """f(0) is not finite: no step is taken, nothing hangs."""
    for options in ({"dt": 1e-3}, {"dt": None, "method": "dop853"}):
        result = run(v0=[1e200, 1e200], throw=False, **options)
        assert result.status in (al.Status.DIVERGED, al.Status.STEP_UNDERFLOW)
