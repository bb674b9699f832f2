"""Priority laws with bounds as C: the active-set method of the C has armlet's solutions, also near singularities."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from compiled_c import COMPILERS, Controller

import armlet as al

pytestmark = pytest.mark.compile

SEVEN = models.SEVEN_AXES
TIP = str(SEVEN.tip_frame)
ELBOW = str(SEVEN.frame_names[4])
FAST = {"v_max": [2.0, 1.0, 1.0, 1.5, 2.0, 2.0, 3.0]}


def tasks() -> list[Any]:
    """A wall, the tip, an interval of the elbow's height, and a posture."""
    return [
        al.Task(TIP, "x", gain=5.0, upper=0.3),
        al.Task(TIP, "xyz", [0.5, 0.2, 0.4], 6.0),
        al.Task(ELBOW, "z", gain=4.0, lower=0.3, upper=0.5),
        al.PostureTask(np.zeros(7), 3.0),
    ]


LAWS: dict[str, Callable[[], Any]] = {
    method: lambda method=method: al.PriorityVelocity(SEVEN, tasks(), method=method, **FAST) for method in ("exact", "clamp", "damped")
} | {
    "limits of the arm": lambda: al.PriorityVelocity(SEVEN, tasks()[1:2], method="exact", limits=True, a_max=10.0, horizon=0.05),
    "clamped limits": lambda: al.PriorityVelocity(SEVEN, tasks()[1:2] + tasks()[3:], limits=True, a_max=10.0, horizon=0.05),
    "thresholds": lambda: al.PriorityVelocity(SEVEN, tasks()[1:], eps=[0.2, 0.1, 0.3], **FAST),
    "tasks alone": lambda: al.PriorityVelocity(SEVEN, tasks(), method="exact"),
    "accelerations": lambda: al.PriorityAcceleration(SEVEN, tasks()[:2], method="exact", a_max=20.0, v_max=2.0, horizon=0.05),
}


def export(law: Any, folder: Path) -> list[Path]:
    """The files of a law. A single call of a law with limits has the period of its default horizon."""
    given = law.__getnewargs_ex__()[1]
    sampled = "horizon" not in given and bool({"limits", "v_max", "a_max"} & given.keys())
    return al.export_c(law, folder, **({"sample_time": 0.1} if sampled else {}))


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", LAWS)
def test_random_states_have_the_solution_of_armlet(name: str, compiler: str, tmp_path: Path) -> None:
    law = LAWS[name]()
    c = Controller(export(law, tmp_path), compiler)
    rng, held, far = np.random.default_rng(5), 0, []
    for k in range(500):
        q, v = rng.uniform(-2.0, 2.0, (2, 7))
        if k < 20:
            # At and near the outstretched posture, where ranks are decided.
            q *= [0.0, 1e-12, 1e-6, 1e-3][k % 4]
        expected, terms = law(0.0, q, v), law.terms(0.0, q, v)
        status, found = c.status(0.0, q, v)
        assert status == 0, f"state {k}"
        held += any(terms["active"]) or len(terms["limits"]) > 0
        far.append(np.abs(found - expected).max() / (1.0 + np.abs(expected).max()))
    # Both solvers have the same steps, but round differently. Near a singularity, `exact` multiplies the rounding errors.
    assert held > 200
    assert np.quantile(far, 0.95) < 1e-11 and np.max(far[20:]) < 1e-7, np.sort(far)[-5:]


def test_a_sampled_loop_has_the_commands_of_the_c(tmp_path: Path) -> None:
    law = al.PriorityVelocity(SEVEN, tasks()[1:2], limits=True, a_max=10.0)
    c = Controller(al.export_c(law, tmp_path, sample_time=0.01), COMPILERS[0])
    q0 = np.array([0.3, -0.5, 0.2, -1.5, 0.1, 1.2, 0.4])
    run = al.simulate(al.VelocityArm(SEVEN), law, q0, t_end=1.0, dt=0.01, sample_time=0.01)
    assert run.active
    for k in range(len(run.t) - 1):
        np.testing.assert_allclose(c(run.t[k], run.q[k], np.zeros(7)), run.tau[k], rtol=0.0, atol=1e-11, err_msg=f"sample {k}")


def test_the_solver_is_in_the_file_and_checks_its_numbers(tmp_path: Path) -> None:
    files = export(LAWS["exact"](), tmp_path)
    text = next(file for file in files if file.suffix == ".c").read_text()
    assert "law_evaluate_stack(" in text and "malloc" not in text
    status, _ = Controller(files, COMPILERS[0]).status(0.0, np.full(7, np.nan), np.zeros(7))
    assert status == 1
