"""Elastic joints of the reference (system 3) against vector files, the energy identity and the stability limits."""

import json
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

from armlet import reference as ref
from armlet.reference import elastic, impedance

FILE = json.loads((Path(__file__).parents[1] / "vectors" / "oracle_ex3_elastic_public.json").read_text())
CASES: dict[str, list[dict[str, Any]]] = {}
for _case in FILE["cases"]:
    CASES.setdefault(_case["kind"], []).append(_case)


def floats(value: Any) -> np.ndarray:
    return np.array(value, dtype=np.float64)


def loop_of(given: dict[str, Any]) -> tuple[Any, Any, Any]:
    r = {key: float(value) for key, value in given["robot"].items()}
    arm = ref.planar_arm([r["l1"], r["l2"]], [r["m1"], r["m2"]], [r["d1"], r["d2"]], [r["I1"], r["I2"]], gravity=(0.0, -r["g0"]))
    K_J, B, B0, K_m, D_m = (floats(given[key]) for key in ("K_J", "B", "B0", "K_m", "D_m"))
    assert given["D0"] == "critical"
    law = ref.ElasticImpedance(arm, floats(given["x_d"]), K_m, D_m, K_J, B, B0, frame="link2", axes="xy")
    return arm, ref.ElasticArm(arm, K_J, B), law


def test_the_vector_file_is_whole() -> None:
    counts = {kind: len(cases) for kind, cases in CASES.items()}
    assert counts == {"static": 6, "trajectory": 3, "equilibrium": 4, "spurious_equilibrium": 1}


@pytest.mark.parametrize("case", CASES["static"], ids=lambda case: case["id"])
def test_law(case: dict[str, Any]) -> None:
    given, rel = case["input"], case["tolerance"]["rel"]
    arm, _, law = loop_of(given)
    q, v, theta, theta_dot = (floats(given[key]) for key in ("q", "qd", "theta", "thetad"))
    J, Jdot = arm.jacobian(q, "link2")[:2], arm.jacobian_dot(q, v, "link2")[:2]
    M, S = arm.mass_matrix(q), arm.coriolis_matrix(q, v)
    M_x = np.linalg.inv(J @ np.linalg.solve(M, J.T))
    S_x = np.linalg.solve(J.T, S) @ np.linalg.inv(J) - M_x @ Jdot @ np.linalg.inv(J)
    parts = law.terms(0.0, q, v, theta, theta_dot)
    got = {"M": M, "S": S, "g": arm.gravity(q), "J": J, "Jdot": Jdot, "x": arm.position(q, "link2")[:2]}
    got |= {"M_x": M_x, "S_x": S_x, "u": parts["u"], "D0": law.motor_damping, "tau": law(0.0, q, v, theta, theta_dot)}
    assert set(got) == set(case["expected"])
    for key, value in got.items():
        wanted = floats(case["expected"][key])
        assert np.abs(value.ravel() - wanted).max() <= rel * np.abs(wanted).max(), key


@pytest.mark.parametrize("case", CASES["trajectory"], ids=lambda case: case["id"])
def test_trajectory(case: dict[str, Any]) -> None:
    given, expected, atol = case["input"], case["expected"], case["tolerance"]["state_abs"]
    _, plant, law = loop_of(given)
    times = floats(given["times"])
    force = [(float(t), floats(F)) for t, F in given["force"]]
    options: dict[str, Any] = {"method": "gbs", "rtol": 1e-10, "atol": 1e-10, "force": force, "v0": given.get("qd0")}
    run = ref.simulate(plant, law, floats(given["q0"]), t_end=times[-1], t_eval=times, **options)
    names = {"q": "q", "qd": "v", "theta": "theta", "thetad": "theta_dot"}
    for row, sample in enumerate(expected["samples"]):
        for theirs, ours in names.items():
            np.testing.assert_allclose(run[ours][row], floats(sample[theirs]), rtol=0.0, atol=atol, err_msg=f"{theirs} at t = {times[row]}")
        # A state error of 1e-8 changes the torque by up to B/B0 K_J = 40 000 times that error.
        np.testing.assert_allclose(run["tau"][row], floats(sample["tau"]), rtol=0.0, atol=4e4 * atol)
        np.testing.assert_allclose(run["energy"][row], sample["E"], rtol=1e-7, atol=atol)
        np.testing.assert_allclose(run["energy"][row] - expected["E0"], sample["E_minus_E0"], rtol=1e-7, atol=10 * atol)
    # The energy balance is an identity. Its error is at most 3e-12 of the largest energy.
    assert np.abs(run["energy_balance"]).max() <= 1e-8 * np.abs(run["energy"]).max()


@pytest.mark.parametrize("case", CASES["equilibrium"] + CASES["spurious_equilibrium"], ids=lambda case: case["id"])
def test_equilibrium(case: dict[str, Any]) -> None:
    given, expected, tolerance = case["input"], case["expected"], case["tolerance"]
    _, plant, law = loop_of(given)
    F = floats(given.get("F", ["0", "0"]))
    found = ref.equilibrium(plant, law, F, q0=floats(given["q0"]))
    for key, value in {"q_E": found.q, "x_E": found.x, "theta_E": found.theta, "tau_E": found.tau, "u_E": found.tau}.items():
        wanted = floats(expected[key])
        assert np.abs(value - wanted).max() <= tolerance["rel"] * np.abs(wanted).max(), key
    assert abs(found.eigenvalues.real.max() - expected["max_real_eig"]) <= tolerance["eig_rel"] * abs(expected["max_real_eig"])
    if "eig_sorted" in expected:
        # The file gives both eigenvalues of a conjugate pair the same sign of the imaginary part, so the test compares absolute values.
        folded = found.eigenvalues.real + 1j * np.abs(found.eigenvalues.imag)
        wanted = floats(expected["eig_sorted"]) @ [1.0, 1.0j]
        atol = tolerance["eig_rel"] * np.abs(wanted).max()
        np.testing.assert_allclose(np.sort_complex(np.round(folded, 9)), np.sort_complex(np.round(wanted, 9)), rtol=0.0, atol=atol)
    spurious = case["kind"] == "spurious_equilibrium"
    boundary = expected.get("kind") == "boundary"
    assert found.spurious == (spurious or boundary)
    assert found.reachable == (not boundary)
    assert found.stable == (not spurious)


@pytest.mark.parametrize("entry", FILE["analysis"]["zoh_limit"], ids=lambda entry: f"{entry['B']}_{entry['dt']}")
def test_sampled_limit(entry: dict[str, float]) -> None:
    found = elastic.smallest_reduced_inertia(entry["B"], entry["K_J"], entry["dt"])
    # At the limit, the relative change of the spectral radius is 1.3 times that of B0. The root agrees to 3e-12.
    assert abs(found / entry["B0_min"] - 1.0) <= 1e-7


@pytest.mark.parametrize("entry", FILE["analysis"]["routh_1dof"], ids=lambda entry: f"{entry['M']}_{entry['d']}_{entry['B0']}")
def test_stiffness_limit(entry: dict[str, float]) -> None:
    found = elastic.stiffness_limit(entry["M"], entry["K_J"], entry["B0"], entry["d"], motor_damping=entry["D0"])
    if entry["k_max"] <= 0.0:
        assert np.isnan(found)
    else:
        assert abs(found / entry["k_max"] - 1.0) <= 1e-9


def test_full_matrices_keep_the_reduced_motor() -> None:
    """With full matrices, the torque gives motors with the reduced inertia B0: B0 theta_ddot + D0 theta_dot + tau_J = u."""
    rng = np.random.default_rng(7)

    def positive(scale: float) -> np.ndarray:
        half = rng.normal(size=(2, 2))
        return scale * (half @ half.T + np.eye(2))

    arm = models.REFERENCE_TWO_LINKS
    K_J, B, B0, K_m, D_m = positive(500.0), positive(0.3), positive(0.02), positive(200.0), positive(20.0)
    law = ref.ElasticImpedance(arm, [0.5, 0.3], K_m, D_m, K_J, B, B0, frame="link2", axes="xy", damping_ratio=0.7)
    q, v, theta, theta_dot = rng.normal(size=(4, 2))
    tau, u = law(0.0, q, v, theta, theta_dot), law.terms(0.0, q, v, theta, theta_dot)["u"]
    spring = K_J @ (theta - q)
    theta_ddot = np.linalg.solve(B, tau - spring)
    np.testing.assert_allclose(B0 @ theta_ddot + law.motor_damping @ theta_dot + spring, u, rtol=1e-9)
    mix = B @ np.linalg.inv(B0)
    np.testing.assert_allclose(tau, (np.eye(2) - mix) @ spring + mix @ (u - law.motor_damping @ theta_dot), rtol=1e-9)
    # D0 gives every mode the damping ratio 0.7: B0^-1/2 D0 B0^-1/2 = 1.4 sqrt(B0^-1/2 K_J B0^-1/2).
    inverse = impedance.power(B0, -0.5)
    scaled = inverse @ law.motor_damping @ inverse / 1.4
    np.testing.assert_allclose(scaled @ scaled, inverse @ K_J @ inverse, rtol=1e-9, atol=1e-6)


def test_relative_damping_balances_too() -> None:
    arm = models.REFERENCE_TWO_LINKS
    law = ref.ElasticImpedance(
        arm, [0.5, 0.3], 200.0, 20.0, [800.0, 500.0], [0.4, 0.25], [0.04, 0.025], frame="link2", axes="xy", relative_damping=True
    )
    run = ref.simulate(ref.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25]), law, [0.3, 1.2], t_end=0.2, dt=1e-4, force=[5.0, -3.0])
    # The error of RK4 with a step of 1e-4 s is at most 3e-10 of the largest energy.
    assert np.abs(run["energy_balance"]).max() <= 1e-7 * run["energy"].max()
    assert np.ptp(run["energy"]) > 1e-3


def test_rotation_vector_is_the_logarithm() -> None:
    from armlet.reference import task

    for angle in (0.0, 1e-12, 1e-8, 0.3, 3.0, np.pi - 1e-9):
        vector = angle * np.array([2.0, -1.0, 2.0]) / 3.0
        np.testing.assert_allclose(task.rotation_vector(task.rotation_matrix(vector)), vector, atol=2e-8 if angle > 3.1 else 1e-14)


def test_indefinite_matrices_are_refused() -> None:
    arm = models.REFERENCE_TWO_LINKS
    with pytest.raises(ValueError, match="positive definite"):
        ref.ElasticImpedance(arm, [0.5, 0.3], 200.0, 20.0, 800.0, 0.4, [0.04, -0.01], frame="link2", axes="xy")
    with pytest.raises(ValueError, match="axes"):
        ref.CartesianImpedance(arm, [0.5, 0.3], 200.0, 20.0, frame="link2", axes="xw")
