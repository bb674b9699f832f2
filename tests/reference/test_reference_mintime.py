"""Minimum time of the reference (system 4) against vector files, and by simulating the computed motions."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armlet import reference as ref
from armlet.reference import integrate

FILE = json.loads((Path(__file__).parents[1] / "vectors" / "oracle_ex4_bangbang_public.json").read_text())
CASES = FILE["cases"]


def number(text: str) -> float:
    """Parse products and quotients of decimals and pi, such as "-pi/2" and "9.81*0.3*2*pi/pi"."""
    sign, value = (-1.0, 1.0) if text.startswith("-") else (1.0, 1.0)
    for factor in text.lstrip("-").split("*"):
        parts = [np.pi if part == "pi" else float(part) for part in factor.split("/")]
        value *= parts[0]
        for part in parts[1:]:
            value /= part
    return float(sign * value)


def problem(case: dict[str, Any]) -> tuple[float, float, float, float, float]:
    given = case["input"]
    theta0, thetaf, I, G, tau_max = (number(given[key]) for key in ("theta0", "thetaf", "I", "G", "tau_max"))
    return theta0, thetaf, I, G, tau_max


def test_the_vector_file_is_whole() -> None:
    assert len(CASES) == 16 and len(FILE["seed_ratio_table"]) == 12
    assert number("-pi/2") == -np.pi / 2 and number("9.81*0.3*2*pi/pi") == pytest.approx(5.886)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["id"])
def test_profile(case: dict[str, Any]) -> None:
    theta0, thetaf, I, G, tau_max = problem(case)
    expected, tolerance = case["expected"]["profile"], case["tolerance"]
    found = ref.bang_bang_time(theta0, thetaf, I, G, tau_max)
    assert (found.feasible, found.hold_start, found.hold_end) == tuple(expected[key] for key in ("feasible", "hold_start", "hold_end"))
    assert abs(found.a_min - expected["a_lo"]) <= tolerance["a_abs"] * max(1.0, tau_max)
    assert abs(found.a_max - expected["a_hi"]) <= tolerance["a_abs"] * max(1.0, tau_max)
    if not found.feasible:
        assert np.isnan(found.t_min) and np.isnan(found.t_max)
        return
    assert abs(found.t_min / expected["T_min"] - 1.0) <= tolerance["T_rel"]
    t_max = float(expected["T_max"])
    assert found.t_max == t_max if np.isinf(t_max) else abs(found.t_max / t_max - 1.0) <= tolerance["T_rel"]
    # With the arm's inverse dynamics, the torque of the motion stays within its limit and reaches it.
    motion, arm = ref.BangBang([theta0], [thetaf], found.t_min), ref.pendulum(I, G)
    torque = np.array([arm.inverse_dynamics(*motion(t))[0] for t in np.linspace(0, found.t_min * (1 - 1e-12), 4001)])
    assert abs(np.abs(torque).max() / tau_max - 1.0) <= 1e-6  # the maximum may lie between two of the 4001 instants
    half = found.t_min / 2
    instants = {"t0": 0.0, "Thalf_minus": half * (1 - 1e-15), "Thalf_plus": half, "T": found.t_min * (1 - 1e-15)}
    for key, t in instants.items():
        assert arm.inverse_dynamics(*motion(t))[0] == pytest.approx(expected["tau_at_Tmin"][key], abs=1e-11 * max(1.0, tau_max)), key


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["id"])
def test_monotone_optimum(case: dict[str, Any]) -> None:
    theta0, thetaf, I, G, tau_max = problem(case)
    expected, tolerance = case["expected"]["optimal_monotone"], case["tolerance"]
    found = ref.torque_optimal_time(theta0, thetaf, I, G, tau_max)
    assert found.feasible == expected["feasible"]
    if not found.feasible:
        assert np.isnan(found.t) and not found.certified_global
        return
    rel = tolerance["T_rel"]
    assert abs(found.t / expected["T"] - 1.0) <= rel
    assert abs(found.t_switch / expected["t_switch"] - 1.0) <= rel
    assert abs(found.theta_switch - expected["theta_switch"]) <= 1e-12
    assert found.certified_global == expected["globally_optimal_certified"]
    if "ratio_profile_over_optimal" in case["expected"]:
        ratio = ref.bang_bang_time(theta0, thetaf, I, G, tau_max).t_min / found.t
        assert abs(ratio / case["expected"]["ratio_profile_over_optimal"] - 1.0) <= tolerance["ratio_rel"]
    assert found.best.t <= found.t


def test_back_swing() -> None:
    (case,) = [case for case in CASES if "optimal_with_backswing" in case["expected"]]
    found, expected = ref.torque_optimal_time(*problem(case)).best, case["expected"]["optimal_with_backswing"]
    assert found.kind == "back-swing"
    assert abs(found.t / expected["T"] - 1.0) <= case["tolerance"]["backswing_T_rel"]
    # T has a flat minimum: an error of 1e-6 in the switching angle changes the time by 1e-12.
    assert abs(found.switches[0] - expected["theta_first_switch"]) <= 1e-6


def test_spec_example_and_its_mirror_in_time() -> None:
    """From pi/2 to 3 rad at tau_max = 1.02 G, the time is 8.419 s monotone and 5.702 s with a back-swing.

    The reverse motion has the same times, with an overshoot for the back-swing.
    """
    found = ref.torque_optimal_time(np.pi / 2, 3.0, 1.0, 1.0, 1.02)
    assert found.t == pytest.approx(8.419, abs=5e-4) and found.best.t == pytest.approx(5.702, abs=5e-4)
    assert found.best.kind == "back-swing"
    mirrored = ref.torque_optimal_time(3.0, np.pi / 2, 1.0, 1.0, 1.02)
    assert mirrored.best.kind == "overshoot"
    assert mirrored.best.t == pytest.approx(found.best.t, rel=1e-9) and mirrored.t == pytest.approx(found.t, rel=1e-11)
    assert mirrored.best.switches == pytest.approx(found.best.switches[::-1], abs=1e-6)


@pytest.mark.parametrize("entry", FILE["seed_ratio_table"], ids=lambda entry: str(entry["gamma"]))
def test_ratio_table(entry: dict[str, Any]) -> None:
    profile = ref.bang_bang_time(-np.pi / 2, np.pi / 2, 1.0, entry["gamma"], 1.0)
    optimum = ref.torque_optimal_time(-np.pi / 2, np.pi / 2, 1.0, entry["gamma"], 1.0)
    assert abs(optimum.t / entry["T_optimal"] - 1.0) <= 1e-12 and optimum.certified_global == entry["certified"]
    assert profile.feasible == (entry["T_profile"] is not None)
    if profile.feasible:
        assert abs(profile.t_min / optimum.t / entry["ratio"] - 1.0) <= 1e-11


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["id"])
def test_the_switches_carry_the_link_there(case: dict[str, Any]) -> None:
    """A simulation with the torques of the optimum reaches the switching angle and then rests at thetaf after the computed time."""
    theta0, thetaf, I, G, tau_max = problem(case)
    found = ref.torque_optimal_time(theta0, thetaf, I, G, tau_max)
    if not found.feasible:
        assert case["id"] == "potential_infeasible"
        return
    sg = 1.0 if thetaf >= theta0 else -1.0
    arm = ref.pendulum(I, G)
    t, y = 0.0, np.array([theta0, 0.0])
    for length, sign in ((found.t_switch, 1.0), (found.t - found.t_switch, -1.0)):
        tau = np.array([sg * sign * tau_max])
        y = integrate.gbs(lambda s, x, tau=tau: np.array([x[1], arm.forward_dynamics(x[:1], x[1:], tau)[0]]), t, y, [t + length])[-1]
        if sign > 0:
            assert abs(y[0] - found.theta_switch) <= 1e-9
        t += length
    # The unstable equilibrium multiplies an error of 1e-12 by exp(sqrt(G/I) T), 4e4 in the slowest case.
    np.testing.assert_allclose(y, [thetaf, 0.0], atol=1e-8)


def test_rest_at_one_angle() -> None:
    held = ref.bang_bang_time(0.3, 0.3, 1.0, 1.0, 1.0)
    assert held.feasible and held.t_min == held.t_max == 0.0
    assert not ref.bang_bang_time(1.5, 1.5, 1.0, 2.0, 1.0).feasible
    assert ref.torque_optimal_time(0.3, 0.3, 1.0, 1.0, 1.0).t == 0.0
