"""The planar PR arm of the reference (system 1) against the 25-digit vectors and its identities."""

import json
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

from armlet import reference as ref

CASES = json.loads((Path(__file__).parents[1] / "vectors" / "oracle_ex1_adaptive_public.json").read_text())["cases"]
STATIC = [case for case in CASES if case["kind"] == "static"]
RUNS = [case for case in CASES if case["kind"] == "trajectory"]


def floats(value: Any) -> np.ndarray:
    return np.array(value, dtype=np.float64)


def motion_of(reference: dict[str, Any]) -> Any:
    if reference["type"] == "quintic":
        return ref.Quintic(floats(reference["q0"]), floats(reference["q1"]), float(reference["T"]))
    joints = reference["joints"]
    terms = np.array([joint["terms"] for joint in joints], dtype=np.float64)
    return ref.Sinusoid(floats([joint["offset"] for joint in joints]), terms[..., 0], terms[..., 1], terms[..., 2])


def loop_of(given: dict[str, Any]) -> tuple[Any, Any]:
    arm = ref.planar_pr(**{key: float(value) for key, value in given["plant"].items()})
    gains = (floats(given[key]) for key in ("K_P", "K_D", "Gamma"))
    return arm, ref.Adaptive(arm, motion_of(given["reference"]), *gains, estimate=floats(given["ahat0"]))


def test_the_vector_file_has_both_kinds() -> None:
    assert len(STATIC) == 6 and len(RUNS) == 3


@pytest.mark.parametrize("case", STATIC, ids=lambda case: case["id"])
def test_static(case: dict[str, Any]) -> None:
    given, expected, tolerance = case["input"], case["expected"], case["tolerance"]
    arm = ref.planar_pr(given["A"], given["B"], given["C"])
    q, v, v_r, a_r = (floats(given[key]) for key in ("q", "qd", "qd_r", "qdd_r"))
    Y = arm.regressor(q, v, v_r, a_r)
    got = {
        "M": arm.mass_matrix(q),
        "S": arm.coriolis_matrix(q, v),
        "Mdot": arm.mass_matrix_rate(q, v),
        "Y": Y,
        "Y_a": Y @ arm.parameters,
    }
    for key, value in got.items():
        np.testing.assert_allclose(value, floats(expected[key]), rtol=tolerance["rel"], atol=tolerance["abs"], err_msg=key)


@pytest.mark.parametrize("case", RUNS, ids=lambda case: case["id"])
def test_trajectory(case: dict[str, Any]) -> None:
    given, samples, atol = case["input"], case["expected"]["samples"], case["tolerance"]["abs"]
    arm, law = loop_of(given)
    times = floats(given["times"])
    run = ref.simulate(ref.RigidArm(arm), law, floats(given["q0"]), v0=floats(given["qd0"]), t_end=times[-1], t_eval=times, method="gbs")
    names = {"q": "q", "qd": "v", "a_hat": "estimate", "tau": "tau", "s": "s", "V1": "lyapunov", "int_sKDs": "dissipated"}
    for row, sample in enumerate(samples):
        for theirs, ours in names.items():
            np.testing.assert_allclose(run[ours][row], floats(sample[theirs]), rtol=0.0, atol=atol, err_msg=f"{theirs} at t = {times[row]}")
    # The error of the balance is at most 1e-12. V1 does not increase, up to rounding.
    assert np.abs(run["lyapunov_balance"]).max() <= 1e-9
    assert np.diff(run["lyapunov"]).max() <= 1e-9
    start = law.terms(0.0, floats(given["q0"]), floats(given["qd0"]))
    np.testing.assert_allclose(start["tau"], floats(case["expected"]["initial"]["tau"]), rtol=0.0, atol=atol)


def test_fixed_steps_converge_at_their_order() -> None:
    arm, law = loop_of(RUNS[0]["input"])
    q0, v0 = np.array([0.2, -0.3]), np.zeros(2)
    exact = ref.simulate(ref.RigidArm(arm), law, q0, v0=v0, t_end=0.5, t_eval=[0.5], method="gbs")["q"][-1]
    for method, order, dt in (("euler", 1, 1e-3), ("semi_implicit", 1, 1e-3), ("rk4", 4, 1e-2)):
        errors = []
        for h in (dt, dt / 2):
            run = ref.simulate(ref.RigidArm(arm), law, q0, v0=v0, t_end=0.5, dt=h, method=method)
            errors.append(np.abs(run["q"][-1] - exact).max())
        # The tolerance of 0.15 covers the next term of the error expansion.
        assert abs(np.log2(errors[0] / errors[1]) - order) < 0.15, (method, errors)


def test_skewness_and_christoffel_choice() -> None:
    rng = np.random.default_rng(1)
    arm = models.REFERENCE_PR
    q, v = rng.uniform(-3, 3, (2, 50, 2))
    skew = arm.mass_matrix_rate(q, v) - 2 * arm.coriolis_matrix(q, v)
    # M_dot - 2 C is skew-symmetric, up to rounding.
    assert np.abs(skew + np.swapaxes(skew, -1, -2)).max() <= 1e-13
    assert np.abs(skew).max() > 0.1


def test_broadcasting_equals_rows() -> None:
    rng = np.random.default_rng(2)
    arm = models.REFERENCE_PR
    q, v, a, r = rng.normal(size=(4, 3, 5, 2))
    for name, args in (
        ("mass_matrix", (q,)),
        ("coriolis_matrix", (q, v)),
        ("inverse_dynamics", (q, v, a)),
        ("forward_dynamics", (q, v, a)),
        ("regressor", (q, v, a, r)),
    ):
        together = getattr(arm, name)(*args)
        alone = np.array([[getattr(arm, name)(*(x[i, j] for x in args)) for j in range(5)] for i in range(3)])
        # einsum adds the same terms in a different order, which may change rounding.
        np.testing.assert_allclose(together, alone, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("wrong", [(1.0, 1.0, 1.0), (-2.0, 0.5, -0.5), (2.0, 0.5, 0.0), (np.nan, 0.5, 0.5)])
def test_a_plant_without_positive_mass_is_refused(wrong: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="mass matrix"):
        ref.planar_pr(*wrong)


def test_full_gains_keep_the_lyapunov_balance_and_track() -> None:
    rng = np.random.default_rng(3)

    def positive(n: int, scale: float) -> np.ndarray:
        half = rng.normal(size=(n, n))
        return scale * (half @ half.T / n + np.eye(n))

    for _ in range(3):
        A, C = rng.uniform(0.5, 3.0, 2)
        arm = ref.planar_pr(A, 0.9 * np.sqrt(A * C) * rng.uniform(-1, 1), C)
        # kp = kd Lambda with a full matrix Lambda, so kp is not symmetric. The estimate starts at zero.
        kd = positive(2, 15.0)
        motion = ref.Quintic(rng.normal(size=2), rng.normal(size=2), 1.0)
        law = ref.Adaptive(arm, motion, kd @ positive(2, 3.0), kd, positive(3, 3.0))
        times = np.linspace(0.0, 6.0, 13)
        run = ref.simulate(ref.RigidArm(arm), law, rng.normal(size=2), v0=rng.normal(size=2), t_end=6.0, t_eval=times, method="gbs")
        assert np.abs(run["lyapunov_balance"]).max() <= 1e-9 * max(1.0, run["lyapunov"][0])
        assert np.diff(run["lyapunov"]).max() <= 1e-9 and run["lyapunov"][-1] < run["lyapunov"][0]
        # The slowest mode of Lambda is above 3/s. In the 5 s after the motion, an error of a few radians decays by exp(-3 * 5) = 3e-7.
        assert np.abs(run["q"][-1] - motion(6.0)[0]).max() < 1e-2 * np.abs(run["q"][0] - motion(0.0)[0]).max()
        assert np.abs(run["energy_balance"]).max() <= 1e-9 * max(1.0, np.abs(run["energy"]).max())
