"""Three loops with a box of values and a criterion, to compare `worst_case` with random draws."""

from __future__ import annotations

from typing import Any

import numpy as np

import armlet as al

ARM = {"kind": "planar_arm", "lengths": [0.5, 0.4], "masses": [3.0, 2.0]}


def _uniform(low: float, high: float) -> dict[str, list[float]]:
    return {"uniform": [low, high]}


def _payload() -> tuple[al.Scenario, dict[str, Any], dict[str, Any]]:
    """A payload, friction and a start that the law does not know: 9 values, all with derivatives."""
    tables = {
        "arm": ARM | {"payload": {"frame": "link2", "mass": 0.5, "com": [0.4, 0.0, 0.0]}},
        "model": ARM,
        "plant": {"kind": "RigidArm", "friction": {"kind": "LuGre", "coulomb": [0.5, 0.3], "stiffness": 50.0, "damping": 2.0}},
        "motion": {"kind": "Quintic", "q0": [0.0, 0.3], "q1": [0.8, 0.9], "duration": 0.7},
        "law": {"kind": "ComputedTorque", "kp": [100.0, 100.0], "kd": [20.0, 20.0]},
        "run": {"q0": [0.0, 0.3], "v0": [0.0, 0.0], "t_end": 1.0, "dt": 2e-3},
    }
    box: dict[str, Any] = {"arm.payload.mass": _uniform(0.0, 1.0)}
    box |= {f"arm.masses[{i}]": {"log_uniform": [0.7 * mass, 1.4 * mass]} for i, mass in enumerate((3.0, 2.0))}
    box |= {f"plant.friction.coulomb[{i}]": _uniform(0.3, 1.0) for i in range(2)}
    box |= {f"run.q0[{i}]": _uniform(at - 0.05, at + 0.05) for i, at in enumerate((0.0, 0.3))}
    box |= {f"run.v0[{i}]": _uniform(-0.2, 0.2) for i in range(2)}
    return al.Scenario(tables), box, {"error_rms": 1.5}


def _samples() -> tuple[al.Scenario, dict[str, Any], dict[str, Any]]:
    """Delay, noise and its seed, and limited torques: values without derivatives besides masses with derivatives."""
    tables = {
        "arm": ARM,
        "model": ARM,
        "motion": {"kind": "Quintic", "q0": [0.0, 0.3], "q1": [0.8, 0.9], "duration": 0.7},
        "law": {"kind": "ComputedTorque", "kp": [100.0, 100.0], "kd": [20.0, 20.0]},
        "run": {
            "q0": [0.0, 0.3],
            "t_end": 1.0,
            "dt": 2e-3,
            "tau_max": [60.0, 30.0],
            "sample_time": {"period": 2e-3, "delay": 2e-3, "noise": {"v": 0.02}, "seed": 5},
        },
    }
    box: dict[str, Any] = {f"arm.masses[{i}]": _uniform(0.7 * mass, 1.4 * mass) for i, mass in enumerate((3.0, 2.0))}
    box |= {f"run.q0[{i}]": _uniform(at - 0.05, at + 0.05) for i, at in enumerate((0.0, 0.3))}
    box |= {"run.sample_time.delay": [0.0, 2e-3, 4e-3, 6e-3], "run.sample_time.seed": {"integers": [0, 10**6]}}
    return al.Scenario(tables), box, {"error_peak": [0.2, 0.3]}


def _limits() -> tuple[al.Scenario, dict[str, Any], dict[str, Any]]:
    """Torques against the limits of a robot file: gains, a target and a payload."""
    tables = {
        "arm": {"kind": "example", "name": "planar_2r", "payload": {"frame": "link2", "mass": 0.5, "com": [0.2, 0.0, 0.0]}},
        "law": {"kind": "PDGravity", "target": [0.8, 0.5], "kp": [60.0, 20.0], "kd": [10.0, 4.0]},
        "run": {"q0": [0.0, 0.0], "v0": [0.0, 0.0], "t_end": 1.0, "dt": 2e-3},
    }
    box: dict[str, Any] = {"arm.payload.mass": _uniform(0.0, 2.0), "law.kd[0]": _uniform(5.0, 15.0), "law.kd[1]": _uniform(2.0, 6.0)}
    box |= {f"law.target[{i}]": _uniform(-1.0, 1.0) for i in range(2)}
    box |= {f"run.v0[{i}]": _uniform(-1.0, 1.0) for i in range(2)}
    return al.Scenario(tables), box, {"input_ratio": 1.0}


LOOPS = {"payload": _payload(), "samples": _samples(), "limits": _limits()}


def margin_of_draws(scenario: al.Scenario, box: dict[str, Any], criterion: dict[str, Any], draws: int) -> float:
    """The smallest margin of random draws, from the metrics of sweeps. Each of the listed values has an equal share of the draws."""
    lists = [{}] if "run.sample_time.delay" not in box else [{"run.sample_time.delay": delay} for delay in box["run.sample_time.delay"]]
    # Each cell of a sweep has its own seed of the noise.
    drawn = {path: spec for path, spec in box.items() if not path.startswith("run.sample_time.")}
    ((name, bound),) = criterion.items()
    lowest = np.inf
    for seed, listed in enumerate(lists):
        table = al.sweep(scenario.replace(listed), drawn, draws=draws // len(lists), seed=seed)
        assert set(table["status"].tolist()) == {0}
        columns = [column for column in table if column.rstrip("0123456789") == name]
        for column, each in zip(columns, np.broadcast_to(bound, len(columns)), strict=True):
            lowest = min(lowest, float((1.0 - table[column] / each).min()))
    return lowest
