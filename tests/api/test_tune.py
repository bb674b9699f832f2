"""Tuning: a problem with a known best gain, many conditions, equal bits for any number of threads, and refused arguments."""

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


def test_a_gain_with_a_closed_form() -> None:
    """e'' + kd e' + 100 e = 0 settles to 2 % earliest if its overshoot exp(-pi z / sqrt(1 - z^2)) is 2 %: kd = 20 z = 15.59.

    Times are recorded every 2 ms. So gains within 0.1 of this value have an equal or the next settling time.
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
    """The cost is the maximum or the mean over the conditions. A function of the table is called once per generation."""
    # The model has a wrong mass, and the true mass is one of the conditions.
    data = dict(SCENARIO.data) | {"model": SCENARIO.data["arm"]}
    scenario, over = al.Scenario(data), {"arm.A": [1.0, 2.0, 4.0]}
    shapes = []

    def cost(table: al.SweepTable) -> Any:
        shapes.append(table.rows)
        return table["error_rms1"]

    for by, reduce in (("worst", np.max), ("mean", np.mean)):
        found = al.tune(scenario, DAMPING, cost, over=over, by=by, candidates=8, generations=2)  # type: ignore[arg-type]
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
    """The steps are unstable for large gains. These runs diverge, and their gains are not selected."""
    scenario = SCENARIO.replace({"run.dt": 0.05, "run.t_end": 40.0})
    found = al.tune(scenario, {"law.kd": {"uniform": [5.0, 200.0]}}, "error_rms1", candidates=16, generations=1)
    failed = found.tried["cost"] == 1e30
    assert failed.any() and not failed.all() and found.cost < 1.0
    assert found.tried["law.kd"][failed].min() > 40.0


GAINS = {"law.kp[0]": {"log_uniform": [20.0, 400.0]}, "law.kp[1]": {"log_uniform": [20.0, 400.0]}, "law.kd": {"uniform": [2.0, 80.0]}}
LOSS = {"error_rms": 1.0, "tau_rms": 1e-4}
TWO = SCENARIO.replace({"law.kp": [100.0, 80.0], "run.q0": [0.0, 0.4], "arm.B": 0.3})


def loss_of(scenario: al.Scenario) -> float:
    """The loss, computed from the metrics of a run."""
    found = scenario.run().metrics()
    return float((found["error_rms"] ** 2 + 1e-4 * found["tau_rms"] ** 2).sum())


def test_the_minimum_along_the_gradient() -> None:
    """At the minimum the derivative of the loss is zero, or the minimum is at a bound and the derivative points outwards."""
    found = al.tune(TWO, GAINS, LOSS, method="gradient", starts=2, tolerance=1e-12)
    assert found.method == "gradient" and "iterations" in str(found) and found.converged
    np.testing.assert_allclose(loss_of(found.scenario), found.cost, rtol=1e-9)
    assert found.cost < 0.9 * loss_of(TWO) and found.costs[-1] == found.cost and np.all(np.diff(found.costs) <= 0.0)
    assert found.tried.rows == found.runs and found.tried["cost"].min() == found.cost
    inside = 0
    for path, spec in GAINS.items():
        value = found.best[path]
        ((low, high),) = spec.values()
        moved = [loss_of(found.scenario.replace({path: value * (1.0 + by)})) - found.cost for by in (-0.01, 0.01)]
        inside += low < value < high
        # A change of a gain by 1 % does not reduce the cost. The increase is of second order in the change, so it is small.
        assert moved[0] > -1e-9 or value * 0.99 < low
        assert moved[1] > -1e-9 or value * 1.01 > high
    assert inside >= 1


def test_along_the_gradient_of_any_path() -> None:
    """A mass of the plant is not a parameter of the law, so the scenario is built again. Two conditions count by their mean or maximum."""
    data = dict(TWO.data) | {"model": TWO.data["arm"]}
    scenario, vary = al.Scenario(data), {"law.kd": {"uniform": [2.0, 80.0]}, "model.A": {"uniform": [1.0, 5.0]}}
    over = {"arm.A": [1.5, 3.0]}
    for by, reduce in (("worst", np.max), ("mean", np.mean)):
        found = al.tune(scenario, vary, LOSS, method="gradient", over=over, by=by, starts=1, generations=15)  # type: ignore[arg-type]
        each = [loss_of(found.scenario.replace({"arm.A": a})) for a in over["arm.A"]]
        np.testing.assert_allclose(found.cost, reduce(each), rtol=1e-9)
        first = [loss_of(scenario.replace({"arm.A": a})) for a in over["arm.A"]]
        assert found.cost < reduce(first) and found.best["model.A"] != 2.0
        assert found.runs == 2 * found.tried.rows


def test_the_gradient_needs_few_runs_for_many_values() -> None:
    """For 36 values of an adaptive law, the gradient method reaches the cost of differential evolution in a twentieth of its runs."""
    scenario = al.Scenario(
        {
            "arm": {"kind": "planar_arm", "lengths": [0.5, 0.4, 0.3]},
            "motion": {"kind": "Quintic", "q0": [0.0, 0.0, 0.0], "q1": [0.6, 0.5, -0.4], "duration": 0.5},
            "law": {"kind": "Adaptive", "kp": [5.0, 5.0, 5.0], "kd": [1.0, 1.0, 1.0], "gamma": [0.5] * 30},
            "run": {"q0": [0.1, 0.0, 0.0], "t_end": 1.0, "dt": 2e-3},
        }
    )
    ranges = {"kp": (3, 1.0, 10.0), "kd": (3, 0.4, 2.0), "gamma": (30, 0.05, 2.0)}
    vary = {f"law.{name}[{i}]": {"log_uniform": [low, high]} for name, (size, low, high) in ranges.items() for i in range(size)}

    def cost(table: al.SweepTable) -> Any:
        return sum(table[f"error_rms{i}"] ** 2 for i in (1, 2, 3))

    evolved = al.tune(scenario, vary, cost, candidates=40, generations=20, tolerance=0.0)
    found = al.tune(scenario, vary, "error_rms", method="gradient", starts=1, generations=25)
    enough = int(np.argmax(found.tried["cost"] <= evolved.cost)) + 1
    assert found.cost <= evolved.cost and enough * 20 <= evolved.runs, (found.cost, evolved.cost, enough, evolved.runs)


def test_a_failed_run_along_the_gradient_costs_most() -> None:
    """The steps are unstable for most gains. The search stays among stable gains."""
    scenario = TWO.replace({"run.dt": 0.05, "run.t_end": 40.0})
    vary = {"law.kd": {"uniform": [5.0, 200.0]}}
    found = al.tune(scenario, vary, "error_rms", method="gradient", starts=4, generations=5)
    assert found.cost < 1.0 and (found.tried["cost"] == 1e30).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "descent"}, "method is unknown: expected one of differential_evolution, gradient"),
        ({"method": "gradient", "starts": 0}, "starts is not a count"),
        ({"method": "gradient", "settle": 0.1}, "settle is not used"),
        ({"method": "gradient", "cost": "error_rms1"}, r"cost has no gradient: expected names of \['error_rms'"),
        ({"method": "gradient", "cost": 3.0}, "cost is of the wrong type"),
        ({"method": "gradient", "vary": {"motion.q[0]": {"uniform": [0.0, 1.0]}}}, "no name that moves the reference, got motion"),
        ({"method": "gradient", "cost": lambda run: "much"}, "loss"),
        ({"tolerance": "much"}, "tolerance"),
    ],
)
def test_refusals_along_the_gradient(options: dict[str, Any], message: str) -> None:
    given = {"vary": DAMPING, "cost": "error_rms", "generations": 1} | options
    with pytest.raises(al.InputError, match=message):
        al.tune(TWO, **given)


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


def test_an_exception_in_the_cost_passes_unchanged() -> None:
    def cost(table: al.SweepTable) -> Any:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        al.tune(SCENARIO, DAMPING, cost)


def test_without_scipy_one_line() -> None:
    call = "try:\n al.tune(None, {}, '')\nexcept ImportError as error: print(error)"
    code = f"import sys; sys.modules['scipy.optimize'] = None\nimport armlet as al\n{call}"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "tune: scipy is not installed: pip install '.[tune]' in the folder of armlet's sources\n"
