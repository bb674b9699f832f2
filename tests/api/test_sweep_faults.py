"""A cell that raises or ends its worker fails alone. It has at most three tries and an error in the table; other rows are correct."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sweep_saboteur
from test_sweep import SCENARIO, same

import armlet as al
from armlet.sweeping import chunk as sweep_chunk

#: Cells 3 and 7 fail. With four cells per chunk they are in different chunks.
VARY: dict[str, Any] = {"run.q0[0]": [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]}
BAD = [3, 7]


def check(table: al.SweepTable, wanted: al.SweepTable, error: str, bad: list[int] = BAD) -> None:
    """Failed rows have an error and NaN. Other rows equal an undisturbed sweep to the last bit."""
    good = np.setdiff1d(np.arange(table.rows), bad)
    assert list(table) == [*wanted, "error"]
    assert table["error"][good].tolist() == [""] * len(good) and all(error in text for text in table["error"][bad])
    assert set(table["status"][bad]) == {al.Status.INTERRUPTED} and np.isnan(table["error_rms1"][bad]).all()
    same(al.SweepTable({name: table[name][good] for name in wanted}), al.SweepTable({name: wanted[name][good] for name in wanted}))
    np.testing.assert_array_equal(table["run.q0[0]"], VARY["run.q0[0]"])


def tries(log: Path) -> Counter[str]:
    return Counter(log.read_text().split())


@pytest.mark.parametrize("chunk", [1, 4, 100])
def test_a_cell_that_raises(chunk: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = al.sweep(SCENARIO, VARY)
    monkeypatch.setattr(sweep_chunk, "simulate_batch", sweep_chunk.simulate_batch)  # monkeypatch restores it at the end
    sweep_saboteur.sabotage("raise", str(tmp_path / "log"))
    table = al.sweep(SCENARIO, VARY, chunk=chunk)
    check(table, wanted, "ZeroDivisionError: a law's fault")
    assert tries(tmp_path / "log") == {"0.3": 3, "0.7": 3}
    assert "2 cells have an error; cell 3: ZeroDivisionError" in str(table) and "2 interrupted" in str(table)
    text = table.to_csv(tmp_path / "table.csv").read_text().splitlines()
    assert text[0].endswith(",error") and text[4].endswith(",ZeroDivisionError: a law's fault") and text[5].endswith(",")


def test_a_cell_that_raises_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = al.sweep(SCENARIO, VARY)
    monkeypatch.setattr(sweep_chunk, "simulate_batch", sweep_chunk.simulate_batch)
    sweep_saboteur.sabotage("raise once", str(tmp_path / "log"))
    same(al.sweep(SCENARIO, VARY), wanted)


def test_a_cell_that_is_refused() -> None:
    """The first and the last cell are checked before a sweep begins. Another invalid cell is only a failed row."""
    vary = {"law.gamma": [1.0, -1.0, 5.0]}
    table = al.sweep(SCENARIO, vary)
    message = "InputError: sweep: cell 1 (law.gamma = -1.0): scenario: $.law.gamma: expected > 0, got -1.0"
    assert table["error"].tolist() == ["", message, ""]
    assert table["status"].tolist() == [0, al.Status.INTERRUPTED, 0] and np.isfinite(table["error_rms1"]).tolist() == [True, False, True]
    # In a chunk of one cell, no other row has metrics. The table still has all columns.
    same(al.sweep(SCENARIO, vary, chunk=1), table)


def test_arguments_of_metrics_are_refused() -> None:
    with pytest.raises((al.InputError, TypeError)):
        al.sweep(SCENARIO, VARY, bend=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("chunk", [1, 4, 100])
def test_a_cell_that_aborts(chunk: int, tmp_path: Path) -> None:
    """The worker of an aborting cell ends. The pool is replaced, with the caller's start method and initializer."""
    wanted = al.sweep(SCENARIO, VARY)
    log, out = tmp_path / "log", tmp_path / "out"
    with ProcessPoolExecutor(2, get_context("spawn"), sweep_saboteur.sabotage, ("abort", str(log))) as pool:
        table = al.sweep(SCENARIO, VARY, chunk=chunk, executor=pool, out=out)
    check(table, wanted, "the worker's process died, 3 times")
    assert max(tries(log).values()) <= 3 and set(tries(log)) == {"0.3", "0.7"}
    # The failure is recorded, so a repeated call reads the folder and runs nothing.
    same(al.sweep(SCENARIO, VARY, out=out, progress=lambda done, total: pytest.fail("a chunk was run again")), table)


def test_workers_that_cannot_begin(tmp_path: Path) -> None:
    with ProcessPoolExecutor(2, get_context("spawn"), sweep_saboteur.die) as pool:
        with pytest.raises(al.SolveError, match=r"a worker died: with out= it could have gone on"):
            al.sweep(SCENARIO, VARY, executor=pool)
