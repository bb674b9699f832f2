"""Sweeps on a Dask cluster: equal bits for any number of workers, also if workers are killed."""

from __future__ import annotations

import os
import random
import signal
import sys
from pathlib import Path
from typing import Any

import cloudpickle
import pytest
import sweep_saboteur
from distributed import Client, LocalCluster, Worker, WorkerPlugin
from test_sweep import DRAWS, SCENARIO, same
from test_sweep_faults import VARY, check, tries

import armlet as al

# The workers cannot import this module by its name, so its classes are sent with their code.
cloudpickle.register_pickle_by_value(sys.modules[__name__])

TRIALS = int(os.environ.get("ARMLET_KILL_TRIALS", "20"))
CELLS: dict[str, Any] = {"draws": 240, "seed": 7, "chunk": 8}


@pytest.fixture(scope="module")
def wanted() -> al.SweepTable:
    return al.sweep(SCENARIO, DRAWS, **CELLS)


def cluster(workers: int) -> LocalCluster:
    return LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50)


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_same_bits_on_any_number_of_workers(workers: int, wanted: al.SweepTable) -> None:
    with cluster(workers) as own, Client(own) as client:
        assert len(client.scheduler_info()["workers"]) == workers
        same(wanted, al.sweep(SCENARIO, DRAWS, **CELLS, executor=client.get_executor()))


def test_killed_workers(wanted: al.SweepTable, tmp_path: Path) -> None:
    """In every trial one of two workers is killed at a random time. The sweep continues and gives an equal table."""
    chance = random.Random(5)
    killed = []
    for trial in range(TRIALS):
        moment = chance.randrange(1, 28)
        calls: list[int] = []
        with cluster(2) as own, Client(own) as client:
            workers = list(client.run(os.getpid).values())

            def kill(done: int, total: int, moment: int = moment, calls: list[int] = calls, workers: list[int] = workers) -> None:
                calls.append(done)
                if len(calls) == moment:
                    killed.append(chance.choice(workers))
                    os.kill(killed[-1], signal.SIGKILL)

            table = al.sweep(SCENARIO, DRAWS, **CELLS, out=tmp_path / str(trial), executor=client.get_executor(), progress=kill)
        same(wanted, table)
        assert calls == [8 * (k + 1) for k in range(30)]  # no row is lost or computed twice
    print(f"dask: {TRIALS} sweeps equal bit for bit, a worker of two killed in each")
    assert len(killed) == TRIALS


class Saboteur(WorkerPlugin):
    """A Dask plugin: workers abort at a bad cell, and so do their replacements."""

    def __init__(self, log: str) -> None:
        self.log = log

    def setup(self, worker: Worker) -> None:
        sweep_saboteur.sabotage("abort", self.log)


def test_a_cell_that_aborts(tmp_path: Path) -> None:
    """Dask would start the cell four times, and again with its chunk. armlet starts it at most three times and records its failure."""
    wanted = al.sweep(SCENARIO, VARY)
    log = tmp_path / "log"
    with cluster(2) as own, Client(own) as client:
        client.register_plugin(Saboteur(str(log)))
        table = al.sweep(SCENARIO, VARY, chunk=4, executor=client.get_executor())
    check(table, wanted, "the worker's process died, 3 times")
    assert set(tries(log)) == {"0.3", "0.7"} and max(tries(log).values()) <= 3
