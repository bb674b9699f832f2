"""Minimum time of one link (system 4) against the 50-digit vectors, with the tolerances that the file states for each case."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armlet as al

FILE = json.loads((Path(__file__).parents[1] / "vectors" / "oracle_ex4_bangbang_public.json").read_text())
CASES = {case["id"]: case for case in FILE["cases"]}
each = pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))


def number(text: str) -> float:
    """Parse products and quotients of decimals and pi, such as `-pi/2` and `9.81*0.3`."""
    value, sign, operation = 1.0, 1.0, "*"
    word = ""
    for character in (text + "*").lstrip():
        if character == "-" and not word:
            sign = -sign
        elif character in "*/":
            factor = math.pi if word == "pi" else float(word)
            value, operation, word = (value * factor if operation == "*" else value / factor), character, ""
        else:
            word += character
    return sign * value


def problem(case: dict[str, Any]) -> list[float]:
    return [number(case["input"][name]) for name in ("theta0", "thetaf", "I", "G", "tau_max")]


def test_the_file_is_whole() -> None:
    assert len(CASES) == FILE["n_cases"] == 16 and len(FILE["seed_ratio_table"]) == 12
    assert number("-pi/2") == -math.pi / 2 and number("2*pi/4") == math.pi / 2


@each
def test_profile(case: dict[str, Any]) -> None:
    expected, tolerance, given = case["expected"]["profile"], case["tolerance"], problem(case)
    scale = max(1.0, given[-1])
    r = al.bang_bang_time(*given)
    assert (r.feasible, r.hold_start, r.hold_end) == (expected["feasible"], expected["hold_start"], expected["hold_end"])
    assert abs(r.a_min - expected["a_lo"]) <= tolerance["a_abs"] * scale
    assert abs(r.a_max - expected["a_hi"]) <= tolerance["a_abs"] * scale
    assert str(r.active_upper) == expected["active_upper"] or (r.active_upper.tie and expected["active_upper_tie"])
    assert r.active_upper.tie == expected["active_upper_tie"]
    # In a tie, the angle may be that of either phase.
    assert r.active_upper.tie or abs(r.active_upper.theta - expected["active_upper_theta"]) <= 1e-12
    assert (None if r.active_lower is None else str(r.active_lower)) == expected["active_lower"]
    assert (r.reason == "") == r.feasible
    if not r.feasible:
        assert math.isnan(r.t_min) and math.isnan(r.t_max) and "missing" in r.reason
        return
    assert r.t_min == pytest.approx(float(expected["T_min_str"]), rel=tolerance["T_rel"])
    assert r.t_max == pytest.approx(float(expected["T_max"]), rel=tolerance["T_rel"])
    wanted = [expected["tau_at_Tmin"][key] for key in ("t0", "Thalf_minus", "Thalf_plus", "T")]
    # The error of the torque is the sum of the errors of the acceleration and of G sin(theta).
    np.testing.assert_allclose(r.torques(r.t_min), wanted, rtol=0.0, atol=10.0 * tolerance["a_abs"] * scale)


def test_profiles_in_one_batch() -> None:
    """One call with all sixteen cases returns the same bits as sixteen calls."""
    problems = [problem(case) for case in CASES.values()]
    batch = al.bang_bang_time(*np.array(problems).T)
    for i, given in enumerate(problems):
        single = al.bang_bang_time(*given)
        for name in ("feasible", "t_min", "t_max", "a_min", "a_max", "hold_start", "hold_end"):
            np.testing.assert_array_equal(getattr(batch, name)[i], getattr(single, name))
        assert batch.reason[i] == single.reason and batch[i] == single


@each
def test_monotone_optimum(case: dict[str, Any]) -> None:
    expected, tolerance, given = case["expected"]["optimal_monotone"], case["tolerance"], problem(case)
    o = al.torque_optimal_time(*given)
    assert o.feasible == expected["feasible"] and (o.reason == "") == o.feasible
    if not o.feasible:
        assert math.isnan(o.t) and not o.certified_global and "missing" in o.reason
        return
    assert o.t == pytest.approx(float(expected["T_str"]), rel=tolerance["T_rel"])
    assert o.t_switch == pytest.approx(expected["t_switch"], rel=tolerance["T_rel"])
    assert abs(o.theta_switch - expected["theta_switch"]) <= 1e-12
    # Peak speed and Sturm bound have the same relative tolerance as the duration T.
    assert o.v_peak == pytest.approx(expected["omega_peak"], rel=tolerance["T_rel"])
    bound = expected["sturm_bound"]
    assert o.sturm_bound == (math.inf if bound in (None, "inf") else pytest.approx(bound, rel=tolerance["T_rel"]))
    assert o.certified_global == expected["globally_optimal_certified"]
    assert not (o.certified_global and o.best.kind != "monotone") and o.best.t <= o.t
    if "ratio_profile_over_optimal" in case["expected"]:
        ratio = al.bang_bang_time(*given).t_min / o.t
        assert ratio == pytest.approx(case["expected"]["ratio_profile_over_optimal"], rel=tolerance["ratio_rel"])


def test_back_swing() -> None:
    (case,) = [case for case in CASES.values() if "optimal_with_backswing" in case["expected"]]
    expected, best = case["expected"]["optimal_with_backswing"], al.torque_optimal_time(*problem(case)).best
    assert best.kind == "back-swing" and len(best.switches) == len(best.t_switches) == 2
    assert best.t == pytest.approx(expected["T"], rel=case["tolerance"]["backswing_T_rel"])
    # T has a flat minimum, so the switching angle is less accurate than T. The angle agrees to 6e-11 rad, and T to 3e-16 of its value.
    assert best.switches[0] == pytest.approx(expected["theta_first_switch"], abs=1e-4)


@pytest.mark.parametrize("entry", FILE["seed_ratio_table"], ids=lambda entry: str(entry["gamma"]))
def test_ratio_table(entry: dict[str, Any]) -> None:
    given = (-math.pi / 2, math.pi / 2, 1.0, entry["gamma"], 1.0)
    r, o = al.bang_bang_time(*given), al.torque_optimal_time(*given)
    assert o.t == pytest.approx(entry["T_optimal"], rel=1e-12) and o.certified_global == entry["certified"]
    assert r.feasible == (entry["T_profile"] is not None)
    if r.feasible:
        assert r.t_min == pytest.approx(entry["T_profile"], rel=1e-12)
        assert r.t_min / o.t == pytest.approx(entry["ratio"], rel=1e-11)
