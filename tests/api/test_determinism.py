"""Equal inputs give equal bits for every number of threads and order of rows. Runs stop on Ctrl-C and work after a fork."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

ARM = models.PR
PLANT = al.RigidArm(ARM)
MOTION = al.Sinusoid([0.0, 0.3], [0.5, 0.8], [1.0, 1.7], [0.0, 0.4])
LAW = al.Adaptive(ARM, MOTION, [40.0, 20.0], [20.0, 10.0], 5.0)
OPTIONS: dict[str, Any] = {"t_end": 0.5, "dt": 1e-3, "record_every": 100}
FIELDS = ("q", "v", "tau", "estimate")


def states(rows: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(31)
    q0, v0 = rng.uniform(-1.0, 1.0, (2, rows, 2))
    return q0, v0


def same(a: Any, b: Any, rows: Any = slice(None), others: Any = slice(None)) -> None:
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(a, name)[rows], getattr(b, name)[others])
    assert a.monitors.keys() == b.monitors.keys()
    for name in a.monitors:
        np.testing.assert_array_equal(a.monitors[name][rows], b.monitors[name][others])


METHODS: dict[str, dict[str, Any]] = {
    "rk4": OPTIONS,
    "sampled": OPTIONS | {"sample_time": 5e-3},
    "saturated": OPTIONS | {"tau_max": [6.0, 3.0]},
    "dop853": {"t_end": 0.5, "method": "dop853", "t_eval": np.linspace(0.0, 0.5, 6)},
}


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS.keys())
def test_threads_do_not_matter(options: dict[str, Any]) -> None:
    """With 61 rows, every division of the work has an incomplete last group of lanes."""
    q0, v0 = states(61)
    one = al.simulate_batch(PLANT, LAW, q0, v0=v0, threads=1, **options)
    assert np.all(one.status == al.Status.SUCCESS) and np.all(np.isfinite(one.q))
    for threads in (2, 3, 5, 8, None):
        same(al.simulate_batch(PLANT, LAW, q0, v0=v0, threads=threads, **options), one)


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS.keys())
def test_order_and_company_do_not_matter(options: dict[str, Any]) -> None:
    q0, v0 = states(37)
    whole = al.simulate_batch(PLANT, LAW, q0, v0=v0, **options)
    order = np.random.default_rng(32).permutation(37)
    same(al.simulate_batch(PLANT, LAW, q0[order], v0=v0[order], **options), whole, others=order)
    for rows in (slice(0, 1), slice(5, 14), slice(36, 37)):
        same(al.simulate_batch(PLANT, LAW, q0[rows], v0=v0[rows], **options), whole, others=rows)


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS.keys())
def test_a_row_is_a_run(options: dict[str, Any]) -> None:
    """A batch and a single run may round differently. The loop is contracting, so the difference does not grow."""
    q0, v0 = states(11)
    rows = al.simulate_batch(PLANT, LAW, q0, v0=v0, **options)
    for i in range(11):
        run = al.simulate(PLANT, LAW, q0[i], v0=v0[i], **options)
        np.testing.assert_array_equal(run.t, rows.t)
        for name in FIELDS:
            np.testing.assert_allclose(getattr(run, name), getattr(rows, name)[i], rtol=1e-12, atol=1e-12 * 40)


def test_own_plants_and_laws_per_row() -> None:
    """A batch with a list of B plants and laws equals B batches with one row, to the last bit."""
    rng = np.random.default_rng(33)
    plants = [al.RigidArm(al.planar_pr(a, 0.3, c)) for a, c in rng.uniform(1.0, 3.0, (10, 2))]
    laws = [
        al.Adaptive(ARM, al.Quintic([0.0, 0.0], q, 0.4), np.diag([30.0, 20.0]) + 1.0, 10.0 + i, 2.0)
        for i, q in enumerate(rng.uniform(-1, 1, (10, 2)))
    ]
    q0, _ = states(10)
    whole = al.simulate_batch(plants, laws, q0, **OPTIONS)
    for i in range(10):
        same(al.simulate_batch(plants[i], laws[i], q0[i : i + 1], **OPTIONS), whole, others=slice(i, i + 1))


@pytest.mark.parametrize("cause", ["law", "state"])
@pytest.mark.parametrize("bad", [0, 7, 8, 12])
def test_a_row_that_diverges_does_not_change_the_others(bad: int, cause: str) -> None:
    """One row has an adaptation gain too large for the step, or an initial speed too large for any step.

    This row is at the edge or inside of a group of rows that the lanes of SIMD registers compute together.
    """
    q0, v0 = states(13)
    wild_v0 = v0.copy()
    # Without a state limit the state grows until it is not finite.
    options = OPTIONS | {"t_end": 2.0, "dt": 0.01, "record_every": 1, "state_limit": np.inf}
    laws: Any = LAW
    wild_laws: Any = LAW
    if cause == "state":
        wild_v0[bad] = 1e60
    else:
        laws, wild_laws = [LAW] * 13, [LAW] * 13
        laws[bad] = al.Adaptive(ARM, MOTION, [41.0, 20.0], [20.0, 10.0], 5.0)
        wild_laws[bad] = al.Adaptive(ARM, MOTION, [4000.0, 2000.0], [2000.0, 1000.0], 1e6)
    calm = al.simulate_batch(PLANT, laws, q0, v0=v0, **options)
    assert np.all(calm.status == al.Status.SUCCESS)
    batch = al.simulate_batch(PLANT, wild_laws, q0, v0=wild_v0, **options)
    others = np.arange(13) != bad
    assert batch.status[bad] == al.Status.DIVERGED and np.all(batch.status[others] == al.Status.SUCCESS)
    same(batch, calm, rows=others, others=others)
    ended = batch.stats["ended"][bad]
    assert 0.0 <= ended < 2.0
    after = batch.t > ended + 1e-12
    assert np.any(after)
    for name in FIELDS:
        assert np.all(np.isnan(getattr(batch, name)[bad][after]))
        assert np.all(np.isfinite(getattr(batch, name)[bad][0]))
    assert np.all(np.isnan(batch.monitors["lyapunov"][bad][after]))


SCRIPT = """
import sys
import numpy as np
import armlet as al
arm = al.planar_pr(2.0, 0.5, 0.5)
law = al.Adaptive(arm, al.Sinusoid([0.0, 0.3], [0.5, 0.8], [1.0, 1.7], [0.0, 0.4]), [40.0, 20.0], [20.0, 10.0], 5.0)
q0 = np.random.default_rng(7).uniform(-1.0, 1.0, (19, 2))
batch = al.simulate_batch(al.RigidArm(arm), law, q0, t_end=2.0, dt=1e-3, record_every=50)
run = al.simulate(al.RigidArm(arm), law, q0[0], t_end=2.0, dt=1e-3, record_every=50)
np.savez(sys.stdout.buffer, q=batch.q, v=batch.v, estimate=batch.estimate, single=run.q, isa=al.build_info()["instruction_set"])
"""


def in_process(code: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, env=os.environ | environment, timeout=60)


def test_instruction_sets_agree() -> None:
    import io

    best = al.build_info()["best_instruction_set"]
    names = ["baseline", "avx2", "avx512"]
    answers = {}
    for name in names[: names.index(best) + 1]:
        done = in_process(SCRIPT, ARMLET_ISA=name)
        assert done.returncode == 0, done.stderr.decode()
        answers[name] = dict(np.load(io.BytesIO(done.stdout)))
        assert answers[name].pop("isa") == name
    for name, answer in answers.items():
        for field, values in answer.items():
            assert np.all(np.isfinite(values))
            # The loop is contracting, so differences of rounding do not grow.
            np.testing.assert_allclose(values, answers["baseline"][field], rtol=1e-12, atol=1e-12, err_msg=f"{name} {field}")


@pytest.mark.parametrize("name", ["sse9", "AVX2 ", "0"])
def test_an_unknown_instruction_set_is_an_import_error(name: str) -> None:
    done = in_process("import armlet", ARMLET_ISA=name)
    message = done.stderr.decode()
    assert done.returncode == 1 and "ImportError" in message.splitlines()[-1], message
    assert "ARMLET_ISA" in message and "baseline" in message and "avx2" in message and "avx512" in message


LONG = """
import signal, sys, time
import numpy as np
import armlet as al
arm = al.planar_pr(2.0, 0.5, 0.5)
plant = al.RigidArm(arm)
law = al.Adaptive(arm, al.Sinusoid([0.0, 0.3], [0.5, 0.8], [1.0, 1.7], [0.0, 0.4]), 40.0, 20.0, 5.0)
when = []
def stamp(number, frame):
    when.append(time.perf_counter())
    signal.default_int_handler(number, frame)
signal.signal(signal.SIGINT, stamp)
al.simulate_batch(plant, law, np.zeros((16, 2)), t_end=0.1, dt=1e-3)
print("ready", flush=True)
try:
    {call}
except KeyboardInterrupt:
    late = time.perf_counter() - when[0]
    after = al.simulate_batch(plant, law, np.zeros((16, 2)), t_end=0.1, dt=1e-3)
    print("interrupted", late, int(after.status.sum()), flush=True)
else:
    print("finished", flush=True)
"""
CALLS = {
    "simulate": "al.simulate(plant, law, [0.0, 0.0], t_end=1e6, dt=1e-3, record_every=10**8)",
    "simulate_batch": "al.simulate_batch(plant, law, np.zeros((512, 2)), t_end=1e5, dt=1e-3, record_every=10**7)",
    "batch of adaptive runs": "al.simulate_batch(plant, law, np.zeros((64, 2)), t_end=1e6, method='dop853', rtol=1e-12, t_eval=[1e6])",
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS.keys())
def test_ctrl_c(call: str, interrupted: Callable[[str], tuple[list[str], float]]) -> None:
    """The caller checks for signals every 20 ms. The limit of 0.5 s is a margin for a busy machine."""
    words, waited = interrupted(LONG.replace("{call}", call))
    assert words and words[0] == "interrupted", words
    print(f"{call}: KeyboardInterrupt {1e3 * float(words[1]):.1f} ms after the handler, {1e3 * waited:.1f} ms in all with a new batch")
    assert float(words[1]) <= 0.5
    assert words[2] == "0"


FORK = """
import os, sys
import numpy as np
import armlet as al
arm = al.planar_pr(2.0, 0.5, 0.5)
law = al.Adaptive(arm, al.Hold([1.0, 0.0]), 40.0, 20.0, 5.0)
def work():
    return al.simulate_batch(al.RigidArm(arm), law, np.full((40, 2), 0.1), t_end=0.1, dt=1e-3, threads=2).q
before = work()
child = os.fork()
if child == 0:
    os._exit(0 if np.array_equal(work(), before) else 3)
_, status = os.waitpid(child, 0)
print(os.waitstatus_to_exitcode(status), np.array_equal(work(), before))
"""


def test_a_forked_child_has_its_own_pool() -> None:
    done = in_process(FORK)
    assert done.stdout.decode() == "0 True\n", done.stderr.decode()


def test_batches_from_several_threads() -> None:
    """Two Python threads use the pool of worker threads at the same time. Each must get the correct results."""
    q0, v0 = states(40)
    expected = al.simulate_batch(PLANT, LAW, q0, v0=v0, **OPTIONS)
    results: list[Any] = [None] * 4

    def work(i: int) -> None:
        results[i] = al.simulate_batch(PLANT, LAW, q0, v0=v0, threads=2, **OPTIONS)

    workers = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(timeout=30.0)
    for result in results:
        same(result, expected)


def rk4(motion: al.Motion, q0: Any, v0: Any, steps: int, h: float) -> Array:
    """Simulate `PLANT` under a law with the gains of `LAW` in numpy. Return (q, v, estimate) at the end."""
    a, b, c = PLANT.arm.parameters
    kp, kd = np.array([40.0, 20.0]), np.array([20.0, 10.0])

    def f(t: float, x: Array) -> Array:
        q, v, estimate = x[:2], x[2:4], x[4:]
        q_d, v_d, a_d = motion(t)
        s = v_d - v + kp / kd * (q_d - q)
        v_r, a_r = s + v, a_d + kp / kd * (v_d - v)
        sin, cos = np.sin(q[1]), np.cos(q[1])
        y = np.array([[a_r[0], a_r[1] * cos - v[1] * v_r[1] * sin, 0.0], [0.0, a_r[0] * cos, a_r[1]]])
        force = y @ estimate + kd * s + np.array([b * sin * v[1] ** 2, 0.0])
        return np.concatenate([v, np.linalg.solve([[a, b * cos], [b * cos, c]], force), 5.0 * y.T @ s])

    x = np.concatenate([q0, v0, np.zeros(3)])
    for k in range(steps):
        t = k * h
        k1 = f(t, x)
        k2 = f(t + h / 2, x + h / 2 * k1)
        k3 = f(t + h / 2, x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(t + h, x + h * k3))
    return x


FAR = al.Sinusoid([0.0, 3e8], [0.5, 0.8], [1.0, 1.7], [0.0, 0.4])


# In the case "spins", joint 2 of the rows `odd` starts with up to 12 rad/s, and rotates by up to 0.16 rad per step.
@pytest.mark.filterwarnings("ignore:.*balance does not close:UserWarning")
@pytest.mark.parametrize("monitors", [False, True])
@pytest.mark.parametrize(("motion", "v2", "dt"), [(MOTION, 12.0, 0.02), (FAR, 0.5, 1e-3)], ids=["spins", "far"])
def test_fast_rows_and_large_angles_do_not_change_other_rows(motion: al.Motion, v2: float, dt: float, monitors: bool) -> None:
    """Some rows cannot use the fast algorithm for the sine. They must not change other rows.

    A step of these rows rotates a joint by over 1/32 rad, or starts beyond 1e6 rad.
    """
    law = al.Adaptive(ARM, motion, [40.0, 20.0], [20.0, 10.0], 5.0)
    q0, v0 = states(24)
    q0[:, 1] += motion(0.0)[0][1]
    odd = [3, 9, 17]
    v0[odd, 1] = v2 * np.array([1.0, -1.0, 0.8])
    options: dict[str, Any] = {"t_end": 20 * dt, "dt": dt, "monitors": monitors, "record_every": 5, "state_limit": np.inf}
    mixed = al.simulate_batch(PLANT, law, q0, v0=v0, **options)
    rest = [row for row in range(24) if row not in odd]
    same(al.simulate_batch(PLANT, law, q0[rest], v0=v0[rest], **options), mixed, slice(None), rest)
    for row in odd:
        same(al.simulate_batch(PLANT, law, q0[[row]], v0=v0[[row]], **options), mixed, slice(None), [row])
        run = al.simulate(PLANT, law, q0[row], v0=v0[row], **options)
        end = rk4(motion, q0[row], v0[row], 20, dt)
        for got in (run, mixed[row]):
            x = np.concatenate([got.q[-1], got.v[-1], got.estimate[-1]])
            if motion is FAR:
                # An angle of 3e8 rad has a rounding error of 3e-8 rad, which the gains multiply.
                np.testing.assert_allclose(x, end, rtol=1e-9, atol=3e-6)
            else:
                # armlet and the loop in numpy differ by rounding.
                np.testing.assert_allclose(x, end, rtol=5e-14, atol=5e-14)
