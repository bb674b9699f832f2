"""Elastic joints under Cartesian impedance against 25-digit values (tests/vectors/oracle_ex3_elastic_public.json).

tau = (I - B B0^-1) K_J (theta - q) + B B0^-1 (J'[K_m (x_d - x) - D_m J v] + g(q) - D0 theta_dot)
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

VECTORS = Path(__file__).parents[1] / "vectors" / "oracle_ex3_elastic_public.json"
FILE = json.loads(VECTORS.read_text())
KINDS: dict[str, list[Any]] = {}
for _case in FILE["cases"]:
    KINDS.setdefault(_case["kind"], []).append(pytest.param(_case, id=_case["id"]))


def numbers(value: Any) -> Array:
    return np.array(value, dtype=np.float64)


def loop(given: dict[str, Any]) -> tuple[al.ElasticArm, al.ElasticImpedance]:
    r = {name: float(value) for name, value in given["robot"].items()}
    masses, coms, inertias = ([r[f"{letter}1"], r[f"{letter}2"]] for letter in "mdI")
    arm = al.planar_arm([r["l1"], r["l2"]], masses=masses, coms=coms, inertias=inertias, gravity=(0.0, -r["g0"]))
    K_J, B, B0, K_m, D_m = (numbers(given[name]) for name in ("K_J", "B", "B0", "K_m", "D_m"))
    assert given["D0"] == "critical"
    return al.ElasticArm(arm, K_J, B), al.ElasticImpedance(arm, numbers(given["x_d"]), K_m, D_m, K_J, B, B0, frame="link2", axes="xy")


def test_every_case_is_used() -> None:
    counts = {kind: len(cases) for kind, cases in KINDS.items()}
    assert counts == {"static": 6, "trajectory": 3, "equilibrium": 4, "spurious_equilibrium": 1}


@pytest.mark.parametrize("case", KINDS["static"])
def test_law(case: dict[str, Any]) -> None:
    given = case["input"]
    _, law = loop(given)
    q, v, theta, theta_dot = (numbers(given[name]) for name in ("q", "qd", "theta", "thetad"))
    terms = law.terms(0.0, q, v, theta=theta, theta_dot=theta_dot)
    for name, expected in case["expected"].items():
        wanted = numbers(expected)
        error = np.abs(terms[name].ravel() - wanted).max()
        assert error <= case["tolerance"]["rel"] * np.abs(wanted).max(), name
    np.testing.assert_allclose(law(0.0, q, v, theta=theta, theta_dot=theta_dot), numbers(case["expected"]["tau"]), rtol=1e-10)


@pytest.mark.parametrize("case", KINDS["trajectory"])
def test_trajectory(case: dict[str, Any]) -> None:
    given, expected, atol = case["input"], case["expected"], case["tolerance"]["state_abs"]
    plant, law = loop(given)
    times = np.concatenate([[0.0], numbers(given["times"])])
    force = [(float(t), numbers(F)) for t, F in given["force"]]
    v0 = numbers(given["qd0"]) if "qd0" in given else None
    run = al.simulate(
        plant, law, numbers(given["q0"]), v0=v0, t_end=times[-1], t_eval=times, force=force, method="dop853", rtol=1e-12, atol=1e-12
    )
    assert run.theta is not None and run.theta_dot is not None and run.tau is not None
    energy = run.monitors["energy"]
    samples = {"qd": run.v, "q": run.q, "theta": run.theta, "thetad": run.theta_dot}
    for row, sample in enumerate(expected["samples"], start=1):
        for name, got in samples.items():
            np.testing.assert_allclose(got[row], numbers(sample[name]), rtol=0.0, atol=atol, err_msg=f"{name} at t = {times[row]}")
        # A state error of 1e-8 moves the torque by up to B/B0 K_J = 40 000 of it.
        np.testing.assert_allclose(run.tau[row], numbers(sample["tau"]), rtol=0.0, atol=4e4 * atol)
        np.testing.assert_allclose(energy[row], sample["E"], rtol=1e-7, atol=atol)
        np.testing.assert_allclose(energy[row] - expected["E0"], sample["E_minus_E0"], rtol=1e-7, atol=10 * atol)
    np.testing.assert_allclose(energy[0], expected["E0"], rtol=1e-12)
    # The balance is an identity: 1e-8 of the largest energy.
    assert np.abs(run.monitors["energy_balance"]).max() <= 1e-8 * energy.max()
