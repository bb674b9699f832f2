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
        # A state error of 1e-8 changes the torque by up to B/B0 K_J = 40 000 times that error.
        np.testing.assert_allclose(run.tau[row], numbers(sample["tau"]), rtol=0.0, atol=4e4 * atol)
        np.testing.assert_allclose(energy[row], sample["E"], rtol=1e-7, atol=atol)
        np.testing.assert_allclose(energy[row] - expected["E0"], sample["E_minus_E0"], rtol=1e-7, atol=10 * atol)
    np.testing.assert_allclose(energy[0], expected["E0"], rtol=1e-12)
    # The energy balance is an identity. Its error is at most 5e-14 of the largest energy.
    assert np.abs(run.monitors["energy_balance"]).max() <= 1e-8 * energy.max()


@pytest.mark.parametrize("case", KINDS["equilibrium"] + KINDS["spurious_equilibrium"])
def test_equilibrium(case: dict[str, Any]) -> None:
    given, expected, tolerance = case["input"], case["expected"], case["tolerance"]
    plant, law = loop(given)
    rest = al.equilibrium(plant, law, numbers(given.get("F", ["0", "0"])), q0=numbers(given["q0"]))
    assert rest.theta is not None
    for name, got in {"q_E": rest.q, "x_E": rest.x, "theta_E": rest.theta, "tau_E": rest.tau, "u_E": rest.tau}.items():
        wanted = numbers(expected[name])
        assert np.abs(got - wanted).max() <= tolerance["rel"] * np.abs(wanted).max(), name
    assert abs(rest.eigenvalues.real.max() - expected["max_real_eig"]) <= tolerance["eig_rel"] * abs(expected["max_real_eig"])
    if "eig_sorted" in expected:
        # The file gives both eigenvalues of a conjugate pair the same sign of the imaginary part, so the test compares absolute values.
        folded = rest.eigenvalues.real + 1j * np.abs(rest.eigenvalues.imag)
        wanted = numbers(expected["eig_sorted"]) @ [1.0, 1.0j]
        atol = tolerance["eig_rel"] * np.abs(wanted).max()
        np.testing.assert_allclose(np.sort_complex(np.round(folded, 9)), np.sort_complex(np.round(wanted, 9)), rtol=0.0, atol=atol)
    spurious, boundary = case["kind"] == "spurious_equilibrium", expected.get("kind") == "boundary"
    assert (rest.spurious, rest.reachable, rest.stable) == (spurious or boundary, not boundary, not spurious)


def test_sampled_limit() -> None:
    entries = FILE["analysis"]["zoh_limit"]
    assert len(entries) == 10
    B, K_J, dt, B0_min = (numbers([entry[name] for entry in entries]) for name in ("B", "K_J", "dt", "B0_min"))
    # At the limit, the relative change of the spectral radius is 1.3 times that of B0. The root agrees to 3e-12.
    np.testing.assert_allclose(al.smallest_reduced_inertia(B, K_J, dt), B0_min, rtol=1e-7)


def test_stiffness_limit() -> None:
    entries = FILE["analysis"]["routh_1dof"]
    assert len(entries) == 5
    M, K_J, B0, d, D0, k_max = (numbers([entry[name] for entry in entries]) for name in ("M", "K_J", "B0", "d", "D0", "k_max"))
    np.testing.assert_allclose(al.stiffness_limit(M, K_J, B0, d), k_max, rtol=1e-13)
    np.testing.assert_allclose(al.stiffness_limit(M, K_J, B0, d, motor_damping=D0), k_max, rtol=1e-13)


def test_stiffness_scale() -> None:
    """The largest factor kappa of the stiffness K_m agrees, at the equilibrium of the case `ex3_force_step` without its force.

    The damping is D_m, 0.2 D_m or almost none.
    """
    (case,) = (case.values[0] for case in KINDS["trajectory"] if case.id == "ex3_force_step")
    given = case["input"]
    plant, _ = loop(given)
    K_J, B, K_m, D_m = (numbers(given[name]) for name in ("K_J", "B", "K_m", "D_m"))
    entries = FILE["analysis"]["km_scaling_limit"]
    assert len(entries) == 6
    for entry in entries:
        # The law requires positive definite damping, so the test replaces zero by 1e-9 D_m.
        for name, share in (("Dm_x1", 1.0), ("Dm_x02", 0.2), ("Dm_0", 1e-9)):
            B0 = entry["B0_over_B"] * B
            law = al.ElasticImpedance(plant.arm, numbers(given["x_d"]), K_m, share * D_m, K_J, B, B0, frame="link2", axes="xy")
            limits = al.elastic_limits(plant, law, q0=numbers(given["q0"]))
            assert abs(limits.stiffness_scale_max / entry["kappa_max"][name] - 1.0) <= 1e-6, (entry["B0_over_B"], name)
