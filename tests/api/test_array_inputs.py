"""Array arguments: equal numbers give equal bits in every valid form.

The tests also cover the argument `out`, and sizes from empty to larger than the memory.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pr_loops import ARM, HOLD, LAW, NAN, PLANT, RUN, adaptive, batch, run
from refusals import refused

import armlet as al

Array = NDArray[np.float64]

# Refused kinds of arrays.

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
    """Small integers are exact in all of these types, so all results must be equal."""
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


def test_objects_copy_the_arrays_of_the_caller() -> None:
    q0, kp, estimate = np.zeros(2), np.array([4.0, 4.0]), np.zeros(3)
    law = al.Adaptive(ARM, al.Quintic(q0, q0 + 1.0, 1.0), kp, 2.0, 1.0, estimate=estimate)
    before, shown = law(0.3, [0.1, 0.2], [0.0, 0.0]), repr(law)
    q0 += 5.0
    kp *= -1.0
    estimate += 7.0
    np.testing.assert_array_equal(law(0.3, [0.1, 0.2], [0.0, 0.0]), before)
    assert repr(law) == shown


# The argument `out`.


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
    # All rows of a broadcast view share the memory of one row.
    refused(lambda: ARM.bias(q, q, out=np.broadcast_to(np.zeros(2), (4, 2))), "bias: out ")


def test_out_that_overlaps() -> None:
    memory = np.zeros(20)
    q = memory[:8].reshape(4, 2)
    refused(lambda: ARM.bias(q, np.zeros((4, 2)), out=q), "bias: out ", "overlaps")
    refused(lambda: ARM.bias(np.zeros((4, 2)), q, out=memory[7:15].reshape(4, 2)), "bias: out ", "overlaps")
    refused(lambda: ARM.bias(q[::-1, ::-1], np.zeros((4, 2)), out=q), "bias: out ", "overlaps")
    beside = memory[8:16].reshape(4, 2)
    assert ARM.bias(q, np.zeros((4, 2)), out=beside) is beside


def test_a_refused_call_does_not_change_out() -> None:
    out = np.full(2, 7.0)
    refused(lambda: ARM.bias([0.0, NAN], [0.0, 0.0], out=out), "q ")
    np.testing.assert_array_equal(out, 7.0)


# Sizes of arrays.


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
    """Two small arguments give 10^12 rows. The test runs in a separate process, because the error to exclude is an abort of the process."""
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
