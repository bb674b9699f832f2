"""Tuning: a problem whose best gain is known, many conditions, the same bits on any number of threads, and what is refused."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import armlet as al

SCENARIO = al.Scenario(
    {
        "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.0, "C": 0.5},
        "motion": {"kind": "Hold", "q": [1.0, 0.0]},
        "law": {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0},
        "run": {"q0": [0.0, 0.0], "t_end": 1.0, "dt": 2e-3},
    }
)
DAMPING = {"law.kd": {"uniform": [5.0, 40.0]}}


def test_a_gain_that_is_known() -> None:
    """e'' + kd e' + 100 e = 0 settles to 2 % soonest where its overshoot exp(-pi z / sqrt(1 - z^2)) is 2 %: kd = 20 z = 15.59.

    Times are recorded every 2 ms: gains within 0.1 of it have the same or the next settling time.
    """
    log = np.log(50.0) / np.pi
    wanted = 20.0 * log / np.sqrt(1.0 + log * log)
    found = al.tune(SCENARIO, DAMPING, "settling_time", candidates=16, generations=20)
    assert abs(found.best["law.kd"] - wanted) < 0.1
    again = found.scenario.run().metrics()
    np.testing.assert_allclose(again["settling_time"], found.cost, rtol=0.0, atol=1e-12)
    assert found.costs[-1] == found.cost and np.all(np.diff(found.costs) <= 0.0) and len(found.costs) <= 21
    assert found.tried.rows == found.runs == 16 * len(found.costs) and found.tried["cost"].min() == found.cost
    assert np.all((found.tried["law.kd"] >= 5.0) & (found.tried["law.kd"] <= 40.0))
    assert str(found).startswith("cost 0.36") and repr(found) == f"Tuning({found})"
    assert repr(found.tried).startswith(f"{found.runs} rows")


def test_every_condition_counts() -> None:
    """The worst, or the mean, of the conditions; a function of the table is asked once per generation."""
    # A model that is wrong about its mass: the true one is a condition.
    data = dict(SCENARIO.data) | {"model": SCENARIO.data["arm"]}
    scenario, over = al.Scenario(data), {"arm.A": [1.0, 2.0, 4.0]}
    shapes = []

    def cost(table: al.SweepTable) -> Any:
        shapes.append(table.rows)
        return table["error_rms1"]

    for by, reduce in (("worst", np.max), ("mean", np.mean)):
        found = al.tune(scenario, DAMPING, cost, over=over, by=by, candidates=8, generations=2)  # type: ignore[arg-type]  # a text of a list
        each = [found.scenario.replace({"arm.A": a}).run().metrics()["error_rms"][0] for a in over["arm.A"]]
        np.testing.assert_allclose(found.cost, reduce(each), rtol=1e-9)
    assert shapes == [24] * 6 and found.runs == 72


def test_same_seed_same_bits() -> None:
    vary = {"law.kd": {"log_uniform": [5.0, 40.0]}, "law.kp": {"uniform": [50.0, 150.0]}}
    calls: list[tuple[int, float]] = []
    options: dict[str, Any] = {"candidates": 8, "generations": 3, "tolerance": 0.0}
    one = al.tune(SCENARIO, vary, "error_rms1", threads=1, progress=lambda k, cost: calls.append((k, cost)), **options)
    two = al.tune(SCENARIO, vary, "error_rms1", threads=3, **options)
    for name in one.tried:
        assert one.tried[name].tobytes() == two.tried[name].tobytes()
    assert calls == [(k + 1, one.costs[k + 1]) for k in range(3)] and not one.converged
    other = al.tune(SCENARIO, vary, "error_rms1", seed=1, **options)
    assert not np.array_equal(one.tried["law.kp"], other.tried["law.kp"])


def test_failed_runs_cost_most() -> None:
    """Steps too long for the larger gains: those runs diverge, and are not chosen."""
    scenario = SCENARIO.replace({"run.dt": 0.05, "run.t_end": 40.0})
    found = al.tune(scenario, {"law.kd": {"uniform": [5.0, 200.0]}}, "error_rms1", candidates=16, generations=1)
    failed = found.tried["cost"] == 1e30
    assert failed.any() and not failed.all() and found.cost < 1.0
    assert found.tried["law.kd"][failed].min() > 40.0


@pytest.mark.parametrize(
    ("vary", "cost", "options", "message"),
    [
        ({}, "error_rms1", {}, "vary is empty"),
        ({"law.kd": [1.0, 2.0]}, "error_rms1", {}, 'tune: vary."law.kd" is no range'),
        ({"law.kd": {"normal": [1.0, 2.0]}}, "error_rms1", {}, 'tune: vary."law.kd" is no range'),
        ({"law.kd": {"uniform": [2.0, 1.0]}}, "error_rms1", {}, "expected low <= high"),
        ({"law.kx": {"uniform": [1.0, 2.0]}}, "error_rms1", {}, "unknown key 'kx'"),
        (DAMPING, "error_rms3", {}, "tune: cost is no metric: expected one of"),
        (DAMPING, lambda table: 1.0, {}, r"tune: cost has the wrong shape: expected \(8,\), got \(\)"),
        (DAMPING, "error_rms1", {"candidates": 4}, "candidates is not a count: expected an integer >= 5, got 4"),
        (DAMPING, "error_rms1", {"generations": 1.5}, "generations is not a count"),
        (DAMPING, "error_rms1", {"by": "best"}, "by is unknown: expected one of worst, mean"),
        (DAMPING, "error_rms1", {"over": {"arm.A": {"uniform": [1.0, 2.0]}}}, "uniform is random"),
        (DAMPING, "error_rms1", {"seed": -1}, "seed is not a count"),
    ],
)
def test_refusals(vary: Any, cost: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        al.tune(SCENARIO, vary, cost, **({"candidates": 8} | options))


def test_an_exception_in_the_cost_comes_back() -> None:
    def cost(table: al.SweepTable) -> Any:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        al.tune(SCENARIO, DAMPING, cost)


def test_without_scipy_one_line() -> None:
    call = "try:\n al.tune(None, {}, '')\nexcept ImportError as error: print(error)"
    code = f"import sys; sys.modules['scipy.optimize'] = None\nimport armlet as al\n{call}"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "tune: scipy is not installed: pip install 'armlet[tune]'\n"
