"""Batches of arm functions: equal bits for every number of threads, release of the GIL, and response to Ctrl-C."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable

import models
import numpy as np
import pytest

import armlet as al

ARM = models.SEVEN_AXES

# Instruction sets that this processor supports.
SETS = ("baseline", "avx2", "avx512")[: 1 + ("baseline", "avx2", "avx512").index(al.build_info()["best_instruction_set"])]

# Each batch takes over a millisecond, and its last group of lanes is not full.
DIGEST = """
    import hashlib, numpy as np, armlet as al
    arm = al.load_urdf(al.example_urdf("seven_axis"))
    q, v, a = np.random.default_rng(1).uniform(-2.0, 2.0, (3, 30011, arm.n))
    frame = arm.frame_names[-1]
    results = [arm.inverse_dynamics(q, v, a), arm.forward_dynamics(q, v, a), arm.mass_matrix(q), arm.coriolis_matrix(q, v),
               arm.jacobian(q, frame), arm.pose(q, frame), arm.regressor(q[:5003], v[:5003], a[:5003], v[:5003]),
               *arm.linearize(q[:3001], v[:3001], a[:3001])]
    print(hashlib.sha256(b"".join(r.tobytes() for r in results)).hexdigest())
"""


def digest(threads: int) -> str:
    environment = os.environ | {"ARMLET_NUM_THREADS": str(threads)}
    command = [sys.executable, "-P", "-c", textwrap.dedent(DIGEST)]
    return subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout


@pytest.mark.slow
def test_every_number_of_threads_gives_the_same_bits() -> None:
    assert len({digest(threads) for threads in (1, 2, 5)}) == 1


def test_a_long_call_gives_the_same_bits_as_short_ones() -> None:
    """A short call keeps the GIL and runs on the calling thread. Its rows equal those of a long call, which uses several threads."""
    q, v, a = np.random.default_rng(2).uniform(-2.0, 2.0, (3, 20003, ARM.n))
    whole = ARM.inverse_dynamics(q, v, a)
    parts = [ARM.inverse_dynamics(q[i : i + 997], v[i : i + 997], a[i : i + 997]) for i in range(0, len(q), 997)]
    np.testing.assert_array_equal(whole, np.concatenate(parts))
    out = np.full_like(whole, np.nan)
    assert ARM.inverse_dynamics(q, v, a, out=out) is out
    np.testing.assert_array_equal(whole, out)


def test_each_argument_broadcasts_along_the_other() -> None:
    q, v = (np.random.default_rng(3).uniform(-1.0, 1.0, (rows, ARM.n)) for rows in (3, 4))
    pairs = ARM.bias(q[:, np.newaxis], v[np.newaxis])
    np.testing.assert_array_equal(pairs, [[ARM.bias(one, other) for other in v] for one in q])
    np.testing.assert_array_equal(pairs, ARM.bias(q[:, np.newaxis], v))
    np.testing.assert_array_equal(ARM.bias(q[0], v), pairs[0])


# A batch that runs as a compiled program is compared with single calls. One angle exceeds the range of the program's sine.
ALONE = """
    import numpy as np, armlet as al
    arm = al.load_urdf(al.example_urdf("six_axis"))
    q, v, a = np.random.default_rng(3).uniform(-2.0, 2.0, (3, 300, arm.n))
    q[17, 2] = 3e6
    frame = arm.frame_names[-1]
    calls = [(arm.mass_matrix, q), (arm.forward_dynamics, q, v, a), (arm.regressor, q, v, a, v), (lambda q: arm.jacobian(q, frame), q),
             (lambda *x: np.stack(arm.inverse_dynamics_derivatives(*x), -3), q, v, a)]
    for call, *x in calls:
        rows = call(*x)
        assert np.array_equal(rows.view(np.uint64), np.stack([call(*row) for row in zip(*x)]).view(np.uint64))
    print(al.build_info()["programs"], al.build_info()["instruction_set"])
"""


@pytest.mark.parametrize("programs", ["machine", "interpreter"])
@pytest.mark.parametrize("isa", ["baseline", "avx2", "avx512"])
def test_a_row_of_a_program_has_the_bits_of_a_single_call(isa: str, programs: str) -> None:
    environment = os.environ | {"ARMLET_ISA": isa, "ARMLET_PROGRAMS": programs}
    command = [sys.executable, "-P", "-c", textwrap.dedent(ALONE)]
    done = subprocess.run(command, env=environment, check=False, capture_output=True, text=True)
    if isa not in SETS:  # a processor without this instruction set reports an error
        assert done.returncode != 0
        assert isa in done.stderr
        return
    assert done.returncode == 0, done.stderr
    used = programs if al.build_info()["programs"] == "machine" else "interpreter"
    assert done.stdout.split() == [used, isa]


def test_a_bad_row_of_a_long_call_is_named() -> None:
    q = np.zeros((40000, ARM.n))
    v = np.zeros_like(q)
    v[31234, 2] = 1e200
    with pytest.raises(al.InputError, match=r"not finite: expected finite numbers, got .* \(first bad index \(31234, "):
        ARM.bias(q, v)


def test_other_threads_run_meanwhile() -> None:
    """A second Python thread counts during half a second of computation. It could not count if armlet kept the GIL."""
    q = np.zeros((400_000, ARM.n))
    busy, ticks = threading.Event(), []

    def count() -> None:
        while not busy.is_set():
            ticks.append(time.perf_counter())
            time.sleep(1e-3)

    counter = threading.Thread(target=count)
    counter.start()
    start = time.perf_counter()
    while time.perf_counter() - start < 0.5:
        before = time.perf_counter()
        ARM.coriolis_matrix(q, q)
        after = time.perf_counter()
    busy.set()
    counter.join()
    # The thread counts about once per millisecond. It must count at least three times during the last call.
    assert sum(before < tick < after for tick in ticks) >= 3


def test_ctrl_c_is_answered(interrupted: Callable[[str], tuple[list[str], float]]) -> None:
    words, waited = interrupted("""
        import numpy as np, armlet as al
        arm = al.load_urdf(al.example_urdf("seven_axis"))
        q = np.zeros((200_000, arm.n))
        print("ready", flush=True)
        try:
            while True:
                arm.inverse_dynamics_derivatives(q, q, q)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
    """)
    assert words == ["interrupted"]
    # The wait is at most 20 ms until the next check and 0.5 ms for a piece of work. The rest is a margin for a busy machine.
    assert waited < 0.5
