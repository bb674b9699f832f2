"""The PR robot under Slotine-Li adaptation against 25-digit values (tests/vectors/oracle_ex1_adaptive_public.json).

M = [[A, B cos q2], [B cos q2, C]],  C = S(q, v),  tau = Y pi_hat + Kp e + Kd e_dot,  pi_hat_dot = Gamma Y' s
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

VECTORS = Path(__file__).parents[1] / "vectors" / "oracle_ex1_adaptive_public.json"
CASES = json.loads(VECTORS.read_text())["cases"]
STATIC = [pytest.param(case, id=case["id"]) for case in CASES if case["kind"] == "static"]
TRAJECTORIES = [pytest.param(case, id=case["id"]) for case in CASES if case["kind"] == "trajectory"]


def numbers(value: Any) -> Array:
    return np.array(value, dtype=np.float64)


def close(got: Array, expected: Any, case: dict[str, Any]) -> None:
    """Compare within the tolerance that the file states for this case."""
    tolerance = case["tolerance"]
    np.testing.assert_allclose(got, numbers(expected), rtol=tolerance.get("rel", 0.0), atol=tolerance["abs"])


def motion(reference: dict[str, Any]) -> al.Motion:
    if reference["type"] == "quintic":
        return al.Quintic(numbers(reference["q0"]), numbers(reference["q1"]), float(reference["T"]))
    terms = numbers([joint["terms"] for joint in reference["joints"]])
    offset = numbers([joint["offset"] for joint in reference["joints"]])
    return al.Sinusoid(offset, terms[..., 0], terms[..., 1], terms[..., 2])


def loop(case: dict[str, Any]) -> tuple[al.RigidArm, al.Adaptive]:
    given = case["input"]
    arm = al.planar_pr(*(float(given["plant"][name]) for name in "ABC"))
    gains = (numbers(given[name]) for name in ("K_P", "K_D", "Gamma"))
    return al.RigidArm(arm), al.Adaptive(arm, motion(given["reference"]), *gains, estimate=numbers(given["ahat0"]))


def test_every_case_is_used() -> None:
    assert len(STATIC) == 6 and len(TRAJECTORIES) == 3 and len(STATIC) + len(TRAJECTORIES) == len(CASES)


@pytest.mark.parametrize("case", STATIC)
def test_static(case: dict[str, Any]) -> None:
    given, expected = case["input"], case["expected"]
    arm = al.planar_pr(given["A"], given["B"], given["C"])
    q, v, v_r, a_r = (numbers(given[name]) for name in ("q", "qd", "qd_r", "qdd_r"))
    Y = arm.regressor(q, v, v_r, a_r)
    close(arm.mass_matrix(q), expected["M"], case)
    close(arm.coriolis_matrix(q, v), expected["S"], case)
    close(Y, expected["Y"], case)
    close(Y @ arm.parameters, expected["Y_a"], case)
    close(arm.mass_matrix(q) @ a_r + arm.coriolis_matrix(q, v) @ v_r + arm.gravity(q), expected["Y_a"], case)
    skew = numbers(expected["Mdot"]) - 2.0 * arm.coriolis_matrix(q, v)
    # The vector file states the tolerance 1e-13.
    np.testing.assert_allclose(skew + skew.T, 0.0, atol=1e-13)


@pytest.mark.parametrize("case", TRAJECTORIES)
def test_initial_instant(case: dict[str, Any]) -> None:
    _, law = loop(case)
    q0, v0 = numbers(case["input"]["q0"]), numbers(case["input"]["qd0"])
    expected = case["expected"]["initial"]
    terms = law.terms(0.0, q0, v0)
    # The numbers are at most 32, and the results differ by at most 4e-15. The default `rtol` of 1e-7 also applies.
    np.testing.assert_allclose(terms["s"], numbers(expected["s"]), atol=1e-13)
    np.testing.assert_allclose(terms["tau"], numbers(expected["tau"]), atol=1e-13)
    np.testing.assert_allclose(law(0.0, q0, v0), numbers(expected["tau"]), atol=1e-13)


@pytest.mark.parametrize(
    "method", [{"method": "dop853", "rtol": 1e-12, "atol": 1e-12}, {"method": "rk4", "dt": 2.5e-4}], ids=["dop853", "rk4"]
)
@pytest.mark.parametrize("case", TRAJECTORIES)
def test_trajectory(case: dict[str, Any], method: dict[str, Any]) -> None:
    """The error of RK4 is c dt^4: 2.4e-6 at 4 ms in the most difficult case, and 3.5e-11 at 0.25 ms."""
    given, expected = case["input"], case["expected"]
    plant, law = loop(case)
    times = np.concatenate([[0.0], numbers(given["times"])])
    run = al.simulate(plant, law, numbers(given["q0"]), v0=numbers(given["qd0"]), t_end=times[-1], t_eval=times, **method)
    np.testing.assert_array_equal(run.t, times)
    assert run.tau is not None and run.estimate is not None
    samples = expected["samples"]
    for name, got in (("q", run.q), ("qd", run.v), ("a_hat", run.estimate), ("tau", run.tau)):
        close(got[1:], [sample[name] for sample in samples], case)
    close(run.monitors["lyapunov"][0], expected["initial"]["V1"], case)
    close(run.monitors["lyapunov"][1:], [sample["V1"] for sample in samples], case)
    assert np.max(np.abs(run.monitors["lyapunov_balance"])) <= 1e-9
    # Between any two records V1 does not increase, except for rounding.
    assert np.all(np.diff(run.monitors["lyapunov"]) <= 1e-12)
    assert np.max(run.monitors["skewness"]) <= 1e-13
