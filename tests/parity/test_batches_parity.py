"""Rows of `simulate_batch` against single runs of `armlet.reference`, for every argument that `simulate` has too."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from loops import close, law_pair, pair

import armlet as al
from armlet import reference

ROWS = 3
# Rounding errors of the accelerations, and of the complex-step derivatives of the reference, grow over the steps.
ROUNDING = 1e-9


def elastic(library: Any, arm: Any, frame: str, target: Any) -> tuple[Any, Any]:
    K, B = np.array([900.0, 700.0, 500.0]), np.array([0.5, 0.4, 0.3])
    law = library.ElasticImpedance(arm, target, [90.0, 70.0, 50.0], [9.0, 8.0, 7.0], K, B, 0.2 * B, frame=frame, axes="xyz")
    return library.ElasticArm(arm, K, B), law


@pytest.mark.parametrize(
    "options",
    [
        {"dt": 1e-3, "record_every": 7},
        {"dt": 1e-3, "t_eval": [0.0, 0.0105, 0.03], "tau_max": [4.0, 3.0, 2.0], "monitors": True},
        {"dt": 1e-3, "sample_time": 3e-3, "force": [2.0, -1.0, 3.0]},
        {"dt": 5e-4, "method": "semi_implicit", "force": [(0.0, [2.0, 0.0, 1.0]), (0.0113, [0.0, -3.0, 0.0])], "force_frame": "link2"},
    ],
    ids=["records", "limits", "samples", "forces"],
)
def test_rows_of_elastic_arms(options: dict[str, Any]) -> None:
    rng = np.random.default_rng(71)
    arms = pair(rng, 3)
    q0, v0, stretch, slip = rng.uniform(-0.3, 0.3, (4, ROWS, 3))
    state = {"v0": v0, "theta0": q0 + 0.1 * stretch, "theta_dot0": v0 + slip}
    frame = arms[0].frame_names[-1]
    target = arms[0].position(np.full(3, 0.1), frame)
    plant, law = elastic(al, arms[0], frame, target)
    their_plant, their_law = elastic(reference, arms[1], frame, target)
    batch = al.simulate_batch(plant, law, q0, t_end=0.03, **state, **options)
    monitored = {name: value for name, value in options.items() if name != "monitors"}
    for row in range(ROWS):
        own = {name: value[row] for name, value in state.items()}
        expected = reference.simulate(their_plant, their_law, q0[row], t_end=0.03, **own, **monitored)
        for name in ("q", "v", "theta", "theta_dot", "tau"):
            close(getattr(batch, name)[row], expected[name], ROUNDING)
        close(batch.monitors["energy_balance"][row], expected["energy_balance"], ROUNDING)


def test_rows_of_an_adaptive_method() -> None:
    """Rows of DOP853 at a tolerance of 1e-11 agree to 1e-9 with runs of Gragg-Bulirsch-Stoer at 1e-12."""
    rng = np.random.default_rng(72)
    arms = pair(rng, 2)
    laws = law_pair(rng, "ComputedTorque", arms)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, ROWS, 2))
    options: dict[str, Any] = {"t_end": 0.05, "t_eval": [0.02, 0.05], "rtol": 1e-11, "atol": 1e-11}
    batch = al.simulate_batch(al.RigidArm(arms[0]), laws[0], q0, v0=v0, method="dop853", **options)
    for row in range(ROWS):
        plant = reference.RigidArm(arms[1])
        expected = reference.simulate(plant, laws[1], q0[row], v0=v0[row], method="gbs", t_end=0.05, t_eval=[0.02, 0.05])
        for name in ("q", "v", "tau"):
            close(getattr(batch, name)[row], expected[name], 1e-9)


def test_forces_of_rows_and_what_is_kept() -> None:
    """Each row of a batch has its own force. With `keep="final"` the result is the last record only."""
    rng = np.random.default_rng(73)
    arms = pair(rng, 3)
    laws = law_pair(rng, "CartesianImpedance", arms)
    q0, force = rng.uniform(-0.3, 0.3, (ROWS, 3)), rng.uniform(-5.0, 5.0, (ROWS, 3))
    options: dict[str, Any] = {"t_end": 0.03, "dt": 1e-3, "force": force, "keep": "final"}
    batch = al.simulate_batch(al.RigidArm(arms[0]), laws[0], q0, **options)
    for row in range(ROWS):
        expected = reference.simulate(reference.RigidArm(arms[1]), laws[1], q0[row], t_end=0.03, dt=1e-3, force=force[row])
        close(batch.q[row, -1], expected["q"][-1], ROUNDING)


def test_a_polynomial_of_a_step_is_the_run() -> None:
    """Dense output of DOP853 agrees with the reference to 1e-8.

    The tolerance is 1e-10, and dense output is of order 7 where the steps are of order 8.
    """
    rng = np.random.default_rng(74)
    arms = pair(rng, 2)
    laws = law_pair(rng, "ComputedTorque", arms)
    q0 = rng.uniform(-0.3, 0.3, 2)
    run = al.simulate(al.RigidArm(arms[0]), laws[0], q0, t_end=0.1, method="dop853", rtol=1e-10, atol=1e-10, dense=True)
    times = np.array([0.013, 0.041, 0.0987])
    expected = reference.simulate(reference.RigidArm(arms[1]), laws[1], q0, t_end=0.1, method="gbs", t_eval=times)
    state = run.sample(times)
    close(state.q, expected["q"], 1e-8)
    assert state.v is not None
    close(state.v, expected["v"], 1e-8)
