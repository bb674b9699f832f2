"""Sweeps: equal bits for every chunk size and executor; folders that survive killed processes; refused arguments."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import armlet as al
from armlet.sweeping.parameter_space import Cells

SCENARIO = al.Scenario(
    {
        "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
        "motion": {"kind": "Quintic", "q0": [0.0, 0.0], "q1": [0.5, 1.0], "duration": 0.5},
        "law": {"kind": "Adaptive", "kp": [40.0, 20.0], "kd": [20.0, 10.0], "gamma": 5.0},
        "run": {"q0": [0.1, 0.0], "t_end": 0.6, "dt": 2e-3},
    }
)
DRAWS: dict[str, Any] = {
    "law.kd[0]": {"uniform": [10.0, 40.0]},
    "law.gamma": {"log_uniform": [0.5, 50.0]},
    "run.q0[0]": {"normal": [0.0, 0.1]},
    "arm.A": [1.5, 2.0, 3.0],
    "run.method": ["rk4", "euler"],
}
GRID = {"law.gamma": [1.0, 5.0, 25.0], "law.kd": [[10.0, 5.0], [20.0, 10.0]]}


def same(a: al.SweepTable, b: al.SweepTable) -> None:
    assert list(a) == list(b)
    for name in a:
        assert a[name].dtype == b[name].dtype and a[name].tobytes() == b[name].tobytes(), name


def test_a_grid() -> None:
    """The last varied entry changes fastest. A row equals the run of its cell."""
    table = al.sweep(SCENARIO, GRID)
    assert table.rows == 6 and set(table["status"]) == {0}
    np.testing.assert_array_equal(table["law.gamma"], [1.0, 1.0, 5.0, 5.0, 25.0, 25.0])
    np.testing.assert_array_equal(table["law.kd[0]"], [10.0, 20.0] * 3)
    alone = SCENARIO.replace({"law.gamma": 25.0, "law.kd": [10.0, 5.0]}).run().metrics().columns()
    for name, value in alone.items():
        # A row of a batch and a single run may differ by rounding, which contracting runs do not amplify.
        np.testing.assert_allclose(table[name][4], value, rtol=1e-9, atol=1e-12, err_msg=name)
    assert "error_rms1" in str(table) and "6 success" in str(table)


def test_draws_depend_only_on_seed_and_cell() -> None:
    table = al.sweep(SCENARIO, DRAWS, draws=40, seed=3)
    longer = al.sweep(SCENARIO, DRAWS, draws=50, seed=3)
    for name in table:
        assert table[name].tobytes() == longer[name][:40].tobytes()
    assert not np.array_equal(table["law.gamma"], al.sweep(SCENARIO, DRAWS, draws=40, seed=4)["law.gamma"])
    assert 10.0 <= table["law.kd[0]"].min() < 15.0 and 35.0 < table["law.kd[0]"].max() <= 40.0
    assert set(table["arm.A"]) == {1.5, 2.0, 3.0} and set(table["run.method"]) == {"rk4", "euler"}
    assert abs(table["run.q0[0]"].mean()) < 0.1 and 0.05 < table["run.q0[0]"].std() < 0.2  # 40 draws with standard deviation 0.1


def test_same_bits_on_any_number_of_workers() -> None:
    wanted = al.sweep(SCENARIO, DRAWS, draws=40, seed=3)
    for chunk in (1, 7, 40, 1000):
        same(wanted, al.sweep(SCENARIO, DRAWS, draws=40, seed=3, chunk=chunk))
    for workers in (1, 3):
        with ThreadPoolExecutor(workers) as pool:
            same(wanted, al.sweep(SCENARIO, DRAWS, draws=40, seed=3, chunk=9, executor=pool))
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        same(wanted, al.sweep(SCENARIO, DRAWS, draws=40, seed=3, chunk=9, executor=pool))


def test_noise_has_the_seed_of_its_cell() -> None:
    noisy = SCENARIO.replace({"run.sample_time": {"period": 0.01, "noise": {"v": 0.1}, "jitter": 2e-3}})
    wanted = al.sweep(noisy, {"law.kp": [[40.0, 20.0]] * 9}, seed=1)
    assert len(set(wanted["error_rms1"])) == 9
    same(wanted, al.sweep(noisy, {"law.kp": [[40.0, 20.0]] * 9}, seed=1, chunk=2))
    assert not np.array_equal(wanted["error_rms1"], al.sweep(noisy, {"law.kp": [[40.0, 20.0]] * 9}, seed=2)["error_rms1"])


def test_a_failed_run_is_a_row() -> None:
    table = al.sweep(SCENARIO, {"run.dt": [2e-3, 0.3], "law.kd": [[20.0, 10.0], [2e4, 1e4]], "run.t_end": [60.0]}, chunk=3)
    failed = table["status"] == al.Status.DIVERGED
    assert failed.tolist() == [False, True, False, True] or failed.any()
    assert np.isnan(table["error_rms1"][failed]).all() and np.isfinite(table["error_rms1"][~failed]).all()


def test_a_folder_is_gone_on_with(tmp_path: Path) -> None:
    wanted = al.sweep(SCENARIO, DRAWS, draws=40, seed=3)

    class Stop(Exception):
        pass

    def stop(done: int, total: int) -> None:
        if done >= 20:
            raise Stop

    with pytest.raises(Stop):
        al.sweep(SCENARIO, DRAWS, draws=40, seed=3, chunk=10, out=tmp_path, progress=stop)
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == ["chunk-000000.npz", "chunk-000001.npz", "sweep.json"]
    before = {name: (tmp_path / name).stat().st_mtime_ns for name in files}
    calls: list[tuple[int, int]] = []
    # The chunk size of the first call applies, not the argument of a later call.
    same(wanted, al.sweep(SCENARIO, DRAWS, draws=40, seed=3, chunk=7, out=tmp_path, progress=lambda *n: calls.append(n)))
    assert calls == [(30, 40), (40, 40)] and {name: (tmp_path / name).stat().st_mtime_ns for name in files} == before
    same(wanted, al.sweep(SCENARIO, DRAWS, draws=40, seed=3, out=tmp_path))


def test_damaged_chunks_are_computed_again(tmp_path: Path) -> None:
    wanted = al.sweep(SCENARIO, DRAWS, draws=40, seed=3, chunk=10, out=tmp_path)
    whole = (tmp_path / "chunk-000001.npz").read_bytes()
    (tmp_path / "chunk-000000.npz").write_bytes(whole)  # the file of another chunk
    (tmp_path / "chunk-000001.npz").write_bytes(whole[: len(whole) // 2])
    spoiled = bytearray((tmp_path / "chunk-000002.npz").read_bytes())
    spoiled[spoiled.index(b"NUMPY") + 140] ^= 1
    (tmp_path / "chunk-000002.npz").write_bytes(spoiled)
    calls: list[int] = []
    same(wanted, al.sweep(SCENARIO, DRAWS, draws=40, seed=3, out=tmp_path, progress=lambda done, _: calls.append(done)))
    assert calls == [20, 30, 40]
    same(wanted, al.sweep(SCENARIO, DRAWS, draws=40, seed=3, out=tmp_path))


def test_another_sweeps_folder_is_refused(tmp_path: Path) -> None:
    al.sweep(SCENARIO, GRID, out=tmp_path)
    for change in ({"seed": 5}, {"band": 0.1}):
        with pytest.raises(al.InputError, match=r"holds another sweep: .*different (seed|metrics)$"):
            al.sweep(SCENARIO, GRID, out=tmp_path, **change)
    with pytest.raises(al.InputError, match=r"different scenario$"):
        al.sweep(SCENARIO.replace({"run.t_end": 0.5}), GRID, out=tmp_path)
    (tmp_path / "sweep.json").write_text("{")
    with pytest.raises(al.FormatError, match=r"sweep\.json is damaged"):
        al.sweep(SCENARIO, GRID, out=tmp_path)


@pytest.mark.parametrize(
    ("vary", "options", "message"),
    [
        ({}, {}, "vary is empty"),
        (None, {}, "vary is missing"),
        ({"law.gamma": []}, {}, '$.sweep.vary."law.gamma": expected a list of values, got []'),
        ({"law.gamma": 3.0}, {}, "expected a list of values, got 3.0"),
        ({"law.gamma": {"uniform": [0, 1]}}, {}, "uniform is random: expected draws"),
        ({"law.gamma": {"even": [0, 1]}}, {}, "expected a table with one of linspace, geomspace, uniform, log_uniform, normal"),
        ({"law.gamma": {"linspace": [0, 1]}}, {}, "expected linspace = [first, last, count]"),
        ({"law.gamma": {"linspace": [0, float("nan"), 3]}}, {}, "expected linspace"),
        ({"law.gamma": {"linspace": [0, 1, 1e12]}}, {}, "expected at most 10,000,000 values, got {'linspace': [0, 1, 1000000000000.0]}"),
        ({"law.gamma": {"geomspace": [0, 1, 3]}}, {}, "expected geomspace between numbers > 0"),
        ({"law.gamma": {"uniform": [2, 1]}}, {"draws": 3}, "expected low <= high"),
        ({"law.gamma": {"log_uniform": [0, 1]}}, {"draws": 3}, "expected 0 < low <= high"),
        ({"law.gamma": {"normal": [0, -1]}}, {"draws": 3}, "expected a deviation >= 0"),
        (GRID, {"draws": 0}, "draws is not a count: expected an integer >= 1, got 0"),
        (GRID, {"draws": 2.5}, "draws is not a count"),
        (GRID, {"seed": -1}, "seed is not a count: expected an integer >= 0, got -1"),
        (GRID, {"seed": 2**40}, "seed is too large"),
        (GRID, {"chunk": -1}, "chunk is not a count"),
        ({"law.gamma": [1.0, -1.0]}, {}, "cell 1 (law.gamma = -1.0): scenario: $.law.gamma: expected > 0, got -1.0"),
        ({"law.gama": [1.0]}, {}, "cell 0 (law.gama = 1.0): scenario: $.law: unknown key 'gama' (did you mean gamma?)"),
        ({"law.gamma": [1.0, [1.0, 1.0, 1.0]]}, {}, "values of law.gamma are of different kinds"),
    ],
)
def test_refusals(vary: Any, options: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(al.InputError) as caught:
        al.sweep(SCENARIO, vary, out=tmp_path / "out", **options)
    assert message in str(caught.value)
    assert not (tmp_path / "out").exists()  # so the corrected sweep can use this folder


class Recording(ThreadPoolExecutor):
    """An executor that records its jobs."""

    def __init__(self) -> None:
        super().__init__(1)
        self.jobs: list[Any] = []

    def submit(self, fn: Any, /, *args: Any, **keywords: Any) -> Future[Any]:
        self.jobs.append(fn)
        return super().submit(fn, *args, **keywords)


def test_a_job_holds_no_object_that_an_executor_would_look_through() -> None:
    """Dask computes the name of a job from all numbers in it, which is slow. For bytes it only computes a hash."""
    with Recording() as executor:
        same(al.sweep(SCENARIO, GRID), al.sweep(SCENARIO, GRID, chunk=2, executor=executor))
    kinds = {type(part) for job in executor.jobs for part in job.args}
    assert len(executor.jobs) == 3 and kinds == {int, tuple, bytes}


class Broken(Executor):
    """A pool whose workers have ended."""

    def submit(self, *args: Any, **keywords: Any) -> Future[Any]:  # type: ignore[override]
        future: Future[Any] = Future()
        future.set_exception(BrokenProcessPool("a process died"))
        return future


def test_a_dead_worker_gives_an_error_of_one_line(tmp_path: Path) -> None:
    with pytest.raises(al.SolveError, match=r"a worker died: the same call goes on from what is in"):
        al.sweep(SCENARIO, GRID, out=tmp_path, executor=Broken())


CLIENT = """
import os, sys, threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
import armlet as al
from armlet.sweeping.parameter_space import Cells
if __name__ == "__main__":
    threading.Thread(target=lambda: (sys.stdin.read(), os._exit(9)), daemon=True).start()
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        list(pool.map(abs, range(8)))
        print(*pool._processes, flush=True)
        al.sweep(sys.argv[1], out=sys.argv[2], executor=pool)
"""


def gone(pid: int) -> bool:
    """Whether a process has ended, also if no process has waited for it."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


@pytest.mark.slow
@pytest.mark.parametrize("victim", ["worker", "client"])
def test_sigkill(victim: str, tmp_path: Path) -> None:
    """A sweep that is killed repeatedly and then completed equals an undisturbed sweep to the last bit.

    If a worker is killed, the sweep runs its chunk again. If the client is killed, the test starts it again.
    ARMLET_KILL_TRIALS is the number of folders: 1 by default, 20 in `make test-sweep-kill`.
    """
    data = dict(SCENARIO.data) | {"sweep": {"vary": DRAWS, "draws": 480, "seed": 7, "chunk": 8}}
    data["run"] = data["run"] | {"t_end": 3.0}
    scenario = al.Scenario(data)
    file, client = tmp_path / "s.toml", tmp_path / "client.py"
    file.write_text(toml(data))
    client.write_text(CLIENT)
    wanted = al.sweep(scenario)
    chance = random.Random(11)
    interrupted, trials = 0, int(os.environ.get("ARMLET_KILL_TRIALS", "1"))
    for trial in range(trials):
        out = tmp_path / f"out{trial}"
        for _ in range(2):
            command = [sys.executable, "-P", str(client), str(file), str(out)]
            with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
                assert process.stdout is not None
                workers = [int(word) for word in process.stdout.readline().split()]
                target = chance.choice(workers) if victim == "worker" else process.pid
                had = len(list(out.glob("chunk-*")))
                deadline = time.monotonic() + 60.0
                # The process is killed after three more chunks, at a random time.
                while len(list(out.glob("chunk-*"))) < had + 3 and process.poll() is None and time.monotonic() < deadline:
                    time.sleep(0.005)
                time.sleep(chance.random() * 0.05)
                met = process.poll() is None
                try:
                    os.kill(target, signal.SIGKILL)
                except ProcessLookupError:
                    met = False
                code = process.wait(120.0)
                assert code == 0 if victim == "worker" else not met or code != 0
                interrupted += met
            # No worker may wait for a client that has ended.
            deadline = time.monotonic() + 30.0
            while not all(map(gone, workers)) and time.monotonic() < deadline:
                time.sleep(0.02)
            assert all(map(gone, workers))
        left = {path.name for path in out.glob("chunk-*")}
        calls: list[int] = []
        same(wanted, al.sweep(scenario, out=out, progress=lambda done, _, calls=calls: calls.append(done)))  # type: ignore[misc]
        assert len(left) + len(calls) == 60  # finished chunks are kept, and every other chunk is computed once
    print(f"{victim}: {trials} sweeps equal bit for bit, {interrupted} of {2 * trials} kills met a running sweep")
    assert interrupted > 0


def toml(data: Any) -> str:
    """Convert tables to TOML, with the values of each key inline."""

    def inline(value: Any) -> str:
        if isinstance(value, dict):
            return "{ " + ", ".join(f'"{key}" = {inline(item)}' for key, item in value.items()) + " }"
        return "[" + ", ".join(map(inline, value)) + "]" if isinstance(value, list) else json.dumps(value)

    return "".join(f"{key} = {inline(value)}\n" for key, value in data.items())


def test_plot() -> None:
    """The plot has the first metric over the varied values, with suitable scales.

    Rows without a value are marked. Wrong names are refused.
    """
    table = al.sweep(SCENARIO, {"law.kd": [10.0, 20.0, 1e6], "law.gamma": {"geomspace": [0.5, 50.0, 4]}})
    figure = Figure()
    ax = table.plot(fig=figure)
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_xscale(), ax.get_yscale()) == ("law.kd (SI)", "law.gamma (SI)", "log", "log")
    assert [len(points.get_offsets()) for points in ax.collections] == [8, 4]
    assert ax.get_title(loc="left") == "12 runs; grey crosses: 4 without a value"
    single = al.sweep(SCENARIO, {"law.gamma": [1.0, 2.0]}).plot("tau_peak2", fig=Figure())
    assert (single.get_ylabel(), single.get_xscale()) == ("tau_peak2 (N m or N)", "linear")
    with pytest.raises(al.InputError, match=r"quantity is unknown: expected one of error_rms1, .*, got 'error'"):
        table.plot("error", fig=Figure())


def test_every_cell_of_every_seed_draws_its_own_numbers() -> None:
    """In 2,500 pairs of seed and cell with three entries each, all random numbers are different."""
    vary = {name: {"uniform": [0.0, 1.0]} for name in ("a", "b", "c")}
    pairs = [(seed, i) for seed in range(50) for i in range(50)]
    cells = {seed: Cells.of(vary, 50, seed) for seed in range(50)}
    u = np.array([list(cells[seed][i].values()) for seed, i in pairs])
    assert len(np.unique(u)) == u.size
    assert len({cells[seed].sampling_seed(i) for seed, i in pairs}) == len(pairs)
    # Pairs that are far apart also differ: no cell of one seed equals the first cell of another seed.
    far = [(seed, i) for seed in range(300) for i in (0, 1, 10, 100, 2**8, 1000, 10**4, 2**16, 10**6, 2**20, 10**8 - 1)]
    made = [Cells.of(vary, 10**8, seed) for seed in range(300)]
    assert len({tuple(made[seed][i].values()) for seed, i in far}) == len({made[seed].sampling_seed(i) for seed, i in far}) == len(far)
    # The tolerances are five standard deviations: 0.006 for means of 2,500 numbers, and at most 0.02 for correlations of
    # neighbours.
    assert np.abs(u.mean(axis=0) - 0.5).max() < 0.03 and np.abs(u.std(axis=0) - np.sqrt(1 / 12)).max() < 0.03
    grid = u.reshape(50, 50, 3) - 0.5
    for one, other in ((grid[1:], grid[:-1]), (grid[:, 1:], grid[:, :-1]), (grid[1:, :-1], grid[:-1, 1:]), (grid[..., 1:], grid[..., :-1])):
        assert abs((one * other).mean() * 12.0) < 0.1


def test_noise_is_the_cells_own_in_a_chunk_of_several_kinds() -> None:
    """Cells with alternating steps cannot share a batch. The noise of a cell still depends only on its number."""
    noisy = SCENARIO.replace({"run.sample_time": {"period": 0.01, "noise": {"v": 0.1}, "jitter": 2e-3}})
    vary: dict[str, Any] = {"law.kp": [[40.0, 20.0]] * 4, "run.dt": [2e-3, 1e-3]}
    wanted = al.sweep(noisy, vary, chunk=1, seed=1)
    assert len(set(wanted["error_rms1"])) == 8
    same(wanted, al.sweep(noisy, vary, seed=1))
    same(wanted, al.sweep(noisy, vary, seed=1, chunk=3))
