"""Ctrl-C ends every long call quickly, and other threads run meanwhile. `make test-latency` measures the delay."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import armlet as al

START = """
import numpy as np, armlet as al
rng = np.random.default_rng(0)
arm = al.load_urdf(al.example_urdf("seven_axis"))
tip = arm.frame_names[-1]
law = al.CartesianImpedance(arm, [9.0, 0.0, 0.0], 500.0, 50.0, frame=tip)
{setup}
print("ready", flush=True)
try:
    while True:
        {call}
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
CHAIN = """
body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
text = "".join(f'<link name="l{k}">{body}</link>' for k in range(20_001))
text += "".join(f'<joint name="j{k}" type="fixed"><parent link="l{k}"/><child link="l{k + 1}"/></joint>' for k in range(20_000))
text = f'<robot name="chain">{text}</robot>'
"""
LONG = {
    "time_path": (
        "path = np.cumsum(rng.standard_normal((400, 7)) * 0.2, axis=0)",
        "al.time_path(arm, path, tau_max=150.0, v_max=2.0)",
    ),
    "torque_optimal_time with friction": ("", "al.torque_optimal_time(0.0, 1e6, 1.0, 1.0, 1.5, viscous=1e-3, coulomb=0.1)"),
    "torque_optimal_time": ("", "al.torque_optimal_time(0.0, 1e9, 1.0, 1.0, 1.001)"),
    "load_urdf": (CHAIN, "al.load_urdf(text)"),
    "inverse_kinematics": (
        "task = al.Task(tip, 'xyz', [9.0, 0.0, 0.0], 1.0)",
        "al.inverse_kinematics(arm, [task], np.zeros(7), restarts=10**6)",
    ),
    "inverse_kinematics of many": (
        "task = al.Task(tip, 'xyz', np.full((100, 3), 9.0), 1.0)",
        "al.inverse_kinematics(arm, [task], np.zeros(7), restarts=10**6)",
    ),
    "base_parameters": ("many = al.planar_arm(np.ones(60))", "many.base_parameters()"),
    "equilibrium": ("", "al.equilibrium(al.RigidArm(arm), law, q0=np.full(7, 0.3))"),
    "project_parameters": (
        "pi = np.tile([-1.0, 0, 0, 0, 1, 0, 1, 0, 0, 1], 10**5); pi[:10] = [1, 0, 0, 0, 1, 0, 1, 0, 0, 1]",
        "al.project_parameters(pi)",
    ),
    "file_positions": ("q = np.zeros((3_000_000, 7))", "arm.file_positions(q)"),
    "simulate with a Python law": (
        "plant = al.RigidArm(arm)",
        "al.simulate(plant, lambda t, q, v: -q, np.zeros(7), t_end=1e3, dt=1e-3, sample_time=1e-3, monitors=False, check_limits=False)",
    ),
    "smallest_reduced_inertia": ("b = rng.uniform(0.1, 1.0, 10**5)", "al.smallest_reduced_inertia(b, 1e4, 1e-3)"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_ends_a_long_call(name: str, interrupted: Callable[[str], tuple[list[str], float]]) -> None:
    setup, call = LONG[name]
    words, waited = interrupted(START.replace("{setup}", setup).replace("{call}", call))
    assert words == ["interrupted"]
    # The call checks for signals every 20 ms. The rest is a margin for a busy machine and an unoptimised build.
    assert waited < 1.5


@pytest.mark.parametrize(
    "form",
    [
        lambda x: x,
        np.asfortranarray,
        lambda x: x[::-1].copy()[::-1],
        lambda x: x.astype(np.int64),
        lambda x: x.astype(np.uint8),
        lambda x: x.tolist(),
        lambda x: x[None, :, :].repeat(2, axis=0)[:, ::2, :],
    ],
)
def test_large_arrays_are_read_whole(form: Callable[[np.ndarray], Any]) -> None:
    """armlet reads arrays in pieces. This array is larger than one piece, and its size is not a multiple of a piece."""
    q = np.random.default_rng(1).integers(0, 4, (40_001, 2)).astype(float)
    arm = al.planar_pr(2.0, 0.5, 1.0)
    given = form(q)
    whole = np.ascontiguousarray(np.asarray(given, float))
    M = arm.mass_matrix(given)
    assert M.shape == (*whole.shape, 2)
    np.testing.assert_array_equal(M[..., 0, 1], M[..., 1, 0])
    np.testing.assert_allclose(M[..., 0, 1], 0.5 * np.cos(whole[..., 1]), rtol=1e-15, atol=1e-15)  # rounding of one product and one cosine


def test_an_integer_that_is_not_exact_is_named_in_a_later_piece() -> None:
    q = np.zeros((1, 100_000), np.int64)
    q[0, 70_001] = 2**53 + 1
    with pytest.raises(al.InputError, match=r"first bad index \(0, 70001\)"):
        al.planar_arm(np.ones(100_000)).bias(q, np.zeros((1, 100_000)))


def longest_gap(call: Callable[[], object]) -> tuple[float, float]:
    """Return the seconds of a call, and the longest time during which another thread did not run."""
    turns: list[float] = []
    over = threading.Event()

    def count() -> None:
        while not over.is_set():
            turns.append(time.perf_counter())
            time.sleep(1e-3)

    thread = threading.Thread(target=count)
    thread.start()
    start = time.perf_counter()
    call()
    end = time.perf_counter()
    over.set()
    thread.join()
    inside = [start, *(turn for turn in turns if start < turn < end), end]
    return end - start, float(np.diff(inside).max())


def test_other_threads_run_while_a_model_is_read() -> None:
    space: dict[str, str] = {}
    exec(CHAIN, space)
    took, gap = longest_gap(lambda: al.load_urdf(space["text"]))
    # An optimised build reads the list in less time than a busy machine may need to schedule a thread.
    assert gap < max(0.5 * took, 0.1)


def test_other_threads_run_while_a_list_is_read() -> None:
    """While armlet reads a long list, other threads must be able to run."""
    long = [0.0] * 5_000_000
    took, gap = longest_gap(lambda: al.Hold(long))
    assert gap < max(0.5 * took, 0.1)


LOST = """
import signal, sys
import numpy as np
from armlet.status import Status, having
signal.signal(signal.SIGINT, signal.default_int_handler)
statuses = np.zeros(1000, dtype=np.int64)
for _ in sys.stdin:
    try:
        print("ready", flush=True)
        while True:
            having(statuses, Status.SUCCESS)
    except KeyboardInterrupt:
        pass
    print("interrupted", flush=True)
"""


def test_no_signal_is_lost_in_a_comparison_of_statuses() -> None:
    """A batch compares its statuses after every call.

    numpy ignores exceptions, also KeyboardInterrupt, while it inspects an operand that is not a plain number.
    """
    with subprocess.Popen([sys.executable, "-c", LOST], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdin is not None and child.stdout is not None
        guard = threading.Timer(60.0, child.kill)
        guard.start()
        for _ in range(40):
            child.stdin.write("\n")
            child.stdin.flush()
            assert child.stdout.readline() == "ready\n"
            child.send_signal(signal.SIGINT)
            assert child.stdout.readline() == "interrupted\n"
        guard.cancel()
        child.stdin.close()


def test_memory_of_many_records_is_given_back_without_the_lock() -> None:
    """The system needs 0.1 s to free a gigabyte. The owner must free it without the interpreter lock."""
    arm = al.planar_pr(2.0, 0.5, 1.0)
    law = al.PDGravity(arm, [0.5, 0.5], 50.0, 20.0)
    run = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=2.0, dt=1e-3)
    for array in (run.t, run.q, run.v, run.tau, *run.monitors.values()):
        base = array
        while isinstance(base, np.ndarray) and base.base is not None:
            base = base.base
        assert type(base).__name__ == "_Memory"
        assert array.flags.c_contiguous and array.flags.aligned
    kept = run.q
    q = kept.copy()
    del run
    np.testing.assert_array_equal(kept, q)
