"""The Python interface of the minimum-time planners: numbers of every type, errors that name an argument, pickles, texts."""

from __future__ import annotations

import doctest
import math
import pickle
import time
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import armlet as al

NAMES = ("theta0", "thetaf", "inertia", "gravity_moment", "tau_max", "tau_min")
GOOD = {"theta0": -1.0, "thetaf": 1.0, "inertia": 1.0, "gravity_moment": 0.5, "tau_max": 1.0, "tau_min": -1.0}
SCALAR = [al.trapezoid_time, al.minimum_jerk_time, al.torque_optimal_time]
PLANNERS = [al.bang_bang_time, *SCALAR]
BAD = [math.nan, math.inf, -math.inf, True, np.True_, "1", b"1", 1j, None, [1.0, "x"], {}, 10**400]
planners = pytest.mark.parametrize("planner", PLANNERS, ids=lambda p: p.__name__)


@planners
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bad", BAD, ids=lambda bad: repr(bad)[:20])
def test_refused_by_name(planner: Any, name: str, bad: Any) -> None:
    if (name, bad) == ("tau_min", None):
        return  # `tau_min` has a default
    with pytest.raises(al.InputError, match=rf"^{planner.__name__}: {name} is "):
        planner(**{**GOOD, name: bad})


@planners
@pytest.mark.parametrize("name, bad", [("inertia", 0.0), ("inertia", -1.0), ("tau_max", -1.0), ("tau_min", 0.5)])
def test_out_of_range(planner: Any, name: str, bad: float) -> None:
    with pytest.raises(al.InputError, match=rf"^{planner.__name__}: {name} .*expected .*, got {bad:g}"):
        planner(**{**GOOD, name: bad})


@planners
@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_one_limit_for_both_is_named(planner: Any, bad: float) -> None:
    """Without the argument `tau_min`, an error about the limits names `tau_max`."""
    with pytest.raises(al.InputError, match=rf"^{planner.__name__}: tau_max is not positive"):
        planner(-1.0, 1.0, 1.0, 0.5, bad)


@planners
def test_numbers_of_every_type(planner: Any) -> None:
    wanted = planner(0, 2, 1, 0, 1)
    for kind in (float, np.float64, np.float32, np.int64, np.uint8, np.array, lambda x: np.array(x, dtype=np.float32)):
        got = planner(*(kind(x) for x in (0, 2, 1, 0, 1)))
        assert got == wanted and type(got) is type(wanted) and type(got.feasible) is bool
    assert planner(0, 2, 1, 0, 1, tau_min=-1) == wanted


@planners
def test_limits_are_keyword_only_and_all_arguments_have_names(planner: Any) -> None:
    with pytest.raises(TypeError):
        planner(0.0, 1.0, 1.0, 0.0, 1.0, -1.0)
    assert planner(**GOOD).feasible


@pytest.mark.parametrize("planner", SCALAR, ids=lambda p: p.__name__)
def test_arrays_are_refused_where_one_number_is_meant(planner: Any) -> None:
    with pytest.raises(al.InputError, match=r"thetaf is not a number: expected a number, got shape \(2,\)"):
        planner(0.0, np.array([1.0, 2.0]), 1.0, 0.0, 1.0)


def test_fractions_are_not_numbers_of_numpy() -> None:
    with pytest.raises(al.InputError, match="theta0 is not an array of real numbers: expected float64, got object"):
        al.bang_bang_time(Fraction(1, 2), 1.0, 1.0, 0.0, 1.0)  # type: ignore[call-overload]


def test_arrays_of_every_layout() -> None:
    theta0, thetaf = np.linspace(-2.0, 1.0, 6).reshape(2, 3), np.linspace(1.0, 3.0, 3)
    wanted = al.bang_bang_time(theta0, thetaf, 1.0, 0.5, 1.0)
    assert wanted.shape == wanted.t_min.shape == wanted.feasible.shape == wanted.reason.shape == (2, 3)
    assert wanted.feasible.dtype == bool and wanted.t_min.dtype == np.float64
    assert wanted.t_min.flags.c_contiguous and wanted.t_min.flags.writeable
    read_only = theta0.copy()
    read_only.flags.writeable = False
    for same in (np.asfortranarray(theta0), theta0.tolist(), np.repeat(theta0, 2, axis=1)[:, ::2], theta0[::-1][::-1], read_only):
        np.testing.assert_array_equal(al.bang_bang_time(same, thetaf, 1.0, 0.5, 1.0, tau_min=-1.0).t_min, wanted.t_min)
    assert al.bang_bang_time([], 1.0, 1.0, 0.0, 1.0).t_min.shape == (0,)
    assert al.bang_bang_time([0.0], 1.0, 1.0, 0.0, 1.0).t_min.shape == (1,)
    assert al.bang_bang_time(0.0, 1.0, 1.0, 0.0, [1.0, 2.0]).shape == (2,)
    assert al.bang_bang_time(0.0, 1.0, 1.0, 0.0, 1.0, tau_min=[-1.0, -2.0, -3.0]).shape == (3,)


def test_a_bad_row_of_a_batch_is_named() -> None:
    inertia = np.ones((2, 3))
    inertia[1, 2] = -1.0
    with pytest.raises(al.InputError, match=r"bang_bang_time: inertia is not positive: .*got -1 \(first bad index \(1, 2\)\)"):
        al.bang_bang_time(0.0, 1.0, inertia, 0.0, 1.0)
    with pytest.raises(al.InputError, match=r"bang_bang_time: thetaf is not finite: .*got NaN \(first bad index 1\)"):
        al.bang_bang_time(0.0, [1.0, math.nan], 1.0, 0.0, 1.0)
    with pytest.raises(al.InputError, match=r"bang_bang_time: tau_max is not positive"):
        al.bang_bang_time(0.0, 1.0, 1.0, 0.0, [1.0, 0.0])
    with pytest.raises(al.InputError, match=r"do not broadcast: expected shapes that agree, got \(2,\), \(3,\)"):
        al.bang_bang_time([0.0, 1.0], [1.0, 2.0, 3.0], 1.0, 0.0, 1.0)


def test_batch_keeps_its_own_numbers() -> None:
    """Reasons and reports are computed on request, from the original numbers, even if the caller's array has changed."""
    gravity = np.array([0.5, 3.0])
    batch = al.bang_bang_time(-1.5, 1.5, 1.0, gravity, 1.0)
    before = batch.reason.tolist()
    gravity[:] = 0.0
    assert batch.reason.tolist() == before and before[0] == "" and "missing" in before[1]
    assert batch[-1] == batch[1] and not batch[1].feasible
    for index in (2, -3, (0, 0)):
        with pytest.raises(IndexError):
            batch[index]


def test_rest() -> None:
    held = al.bang_bang_time(0.3, 0.3, 1.0, 1.0, 1.0)
    assert (held.feasible, held.t_min, held.t_max, held.reason) == (True, 0.0, 0.0, "")
    fallen = al.bang_bang_time(1.5, 1.5, 1.0, 2.0, 1.0)
    assert not fallen.feasible and "tau_max cannot hold the link at theta = 1.500000 rad" in fallen.reason
    # Without a torque towards the goal the link does not accelerate. The message has a missing torque of 0, not of -0.
    blocked = al.bang_bang_time(0.0, 1.0, 1.0, 0.0, 0.0, tau_min=-1.0)
    assert not blocked.feasible and "(phase1:switch): 0.000000e0 N m are missing" in blocked.reason


def test_pickles() -> None:
    results = [planner(-1.0, 1.5, 1.0, gravity, 1.0, tau_min=-0.8) for planner in PLANNERS for gravity in (0.5, 3.0)]
    report = al.bang_bang_time(-1.5, 1.5, 1.0, 1.7, 1.0)
    assert report.active_lower is not None
    for result in [*results, report, report.active_upper, report.active_lower]:
        back = pickle.loads(pickle.dumps(result))
        assert back == result and repr(back) == repr(result)
    assert al.bang_bang_time(0, 1, 1, 0, 1) != al.bang_bang_time(0, 1, 1, 0, 2) and report != "report"
    batch = al.bang_bang_time(np.zeros((2, 1)), [1.0, 2.0, 3.0], 1.0, 0.5, 1.0)
    for one in (batch, al.bang_bang_time(0.0, [], 1.0, 0.5, 1.0), al.bang_bang_time(0.0, [[2.0]], 1.0, 0.5, 1.0)):
        back = pickle.loads(pickle.dumps(one))
        assert back.shape == one.shape
        np.testing.assert_array_equal(back.t_min, one.t_min)


def test_texts() -> None:
    r = al.bang_bang_time(-math.pi / 2, math.pi / 2, 1.0, 0.5, 1.0)
    assert repr(r).startswith("BangBangReport(feasible=True, t_min=3.5449") and "t_max=inf" in repr(r)
    assert repr(r.active_upper).startswith("Bind(limit='tau_max', phase=1, place='switch', theta=0.0, time=1.77")
    assert repr(al.bang_bang_time([0.0, 1.0], 1.5, 1.0, 3.0, 1.0)) == "BangBangBatch(2 problems of shape (2,), 0 feasible)"
    for planner in (al.trapezoid_time, al.minimum_jerk_time):
        good, bad = planner(**GOOD), planner(**{**GOOD, "gravity_moment": 5.0})
        assert repr(good).startswith("ProfileReport(feasible=True, t_min=") and good.reason == "" and good.missing == 0.0
        assert bad.missing > 0.0 and "N m are missing" in bad.reason and math.isnan(bad.t_min)
        assert repr(good).endswith('reason="")') and repr(bad).endswith(f'reason="{bad.reason}")')


@pytest.mark.slow
def test_an_infeasible_motion_of_many_turns_takes_similar_time() -> None:
    def spent(gravity_moment: float) -> float:
        begun = time.process_time()
        al.minimum_jerk_time(-1e308, 0.0, 1.0, gravity_moment, 1.0)
        return time.process_time() - begun

    # An infeasible problem also searches for the missing torque, on the grid of the search for the durations. So it takes 16 to 20 times as
    # long as a feasible problem. If each step of this search computed the gravity torque again, it would take 80 times as long.
    exists, not_there = (min(spent(gravity_moment) for _ in range(3)) for gravity_moment in (0.0, 47.0))
    assert not_there < 30.0 * exists


def test_torques_refuse_a_bad_duration() -> None:
    r = al.bang_bang_time(**GOOD)
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(al.InputError, match=r"^BangBangReport\.torques: t is not positive"):
            r.torques(bad)


def test_ramp() -> None:
    for bad in (0.0, 0.6, math.nan, -1.0):
        with pytest.raises(al.InputError, match="trapezoid_time: ramp is not a fraction"):
            al.trapezoid_time(0.0, 1.0, 1.0, 0.0, 1.0, ramp=bad)
    assert al.trapezoid_time(0.0, 1.0, 1.0, 0.0, 1.0) == al.trapezoid_time(0.0, 1.0, 1.0, 0.0, 1.0, ramp=1 / 3)


@planners
def test_docstrings_run(planner: Any) -> None:
    (found,) = doctest.DocTestFinder(recurse=False).find(planner, planner.__name__, globs={})
    assert found.examples
    assert doctest.DocTestRunner().run(found).failed == 0


def test_friction_out_of_range() -> None:
    for name in ("viscous", "coulomb"):
        for bad in (-1.0, math.nan, math.inf):
            with pytest.raises(al.InputError, match=rf"torque_optimal_time: {name} is not a friction coefficient"):
                al.torque_optimal_time(**GOOD, **{name: bad})
        for bad in (True, "1", None.__class__, [1.0]):
            with pytest.raises(al.InputError, match=rf"torque_optimal_time: {name} is not a"):
                al.torque_optimal_time(**GOOD, **{name: bad})


def test_optimum_texts_and_pickles() -> None:
    swing, none = al.torque_optimal_time(math.pi / 2, 3.0, 1.0, 1.0, 1.02), al.torque_optimal_time(0.0, math.pi, 1.0, 50.0, 1.0)
    assert "best=Best(kind='back-swing', t=5.70" in repr(swing) and repr(swing).startswith("TorqueOptimum(feasible=True, t=8.419")
    assert none.best.kind == "none found" and none.best.switches == () and math.isnan(none.best.t) and math.isnan(none.t)
    assert "missing" in none.reason and not none.certified_global
    rough = al.torque_optimal_time(0.0, 1.0, 1.0, 0.2, 1.0, viscous=0.1, coulomb=0.1)
    assert rough.feasible and rough.t > al.torque_optimal_time(0.0, 1.0, 1.0, 0.2, 1.0).t
    stalls = al.torque_optimal_time(0.1, 3.0, 1.0, 1.0, 0.9, viscous=30.0)
    assert "the push ends at theta = 1.1197" in stalls.reason and "1.000000e-1 N m are missing in both torques" in stalls.reason
    with pytest.raises(al.InputError, match="the optimum has no motion"):
        stalls.profile(0.0)
    for start, end, words in ((1.5, 3.0, "cannot leave the start"), (0.1, 4.5, "cannot stop at the end")):
        reason = al.torque_optimal_time(start, end, 1.0, 1.0, 1.1 if start < 1.0 else 0.9, tau_min=-0.5, coulomb=0.1).reason
        assert words in reason and "missing" in reason, reason
    for result in (swing, none, rough, swing.best, none.best, rough.best):
        back = pickle.loads(pickle.dumps(result))
        assert back == result and repr(back) == repr(result)
    assert swing != none and swing.best != none.best


def test_profile_of_an_optimum() -> None:
    o = al.torque_optimal_time(-1.0, 1.0, 1.0, 0.5, 1.0)
    assert o.certified_global and o.best.kind == "monotone" and o.best.switches == (o.theta_switch,)
    t = np.linspace(-1.0, o.t + 1.0, 12).reshape(3, 4)
    arrays = o.profile(t)
    assert isinstance(arrays, tuple) and [x.shape for x in arrays] == [(3, 4)] * 4
    for k in np.ndindex(3, 4):
        single = o.profile(t[k])
        assert all(type(x) is float for x in single) and single == tuple(x[k] for x in arrays)
    # Outside of the motion the link is at rest, held by the torque of gravity.
    assert o.profile(-1.0) == (-1.0, 0.0, 0.0, 0.5 * math.sin(-1.0)) and o.profile(o.t)[:3] == (1.0, 0.0, 0.0)
    assert o.profile(1) == o.monotone_profile(np.float32(1.0)) and o.profile([])[0].shape == (0,)
    for bad in (math.nan, math.inf, True, "1", [math.nan]):
        with pytest.raises(al.InputError, match=r"^TorqueOptimum\.profile: t is not"):
            o.profile(bad)
    none = al.torque_optimal_time(0.0, math.pi, 1.0, 50.0, 1.0)
    with pytest.raises(al.InputError, match=r"^TorqueOptimum\.profile: the optimum has no motion"):
        none.profile(0.0)
    # The Coulomb friction reduces the acceleration at the start: 1.0 - 0.25 = 0.75 rad/s^2.
    rough = al.torque_optimal_time(0.0, 1.0, 1.0, 0.2, 1.0, viscous=0.1, coulomb=0.25)
    assert rough.monotone_profile(0.0) == (0.0, 0.0, 0.75, 1.0) and rough.profile(rough.t)[:3] == (1.0, 0.0, 0.0)


def test_threads_change_no_bit_and_the_first_bad_problem_is_named() -> None:
    rng = np.random.default_rng(6)
    columns = [*rng.uniform(-4.0, 4.0, (2, 40_000)), *rng.uniform(0.1, 2.0, (3, 40_000))]
    batch = al.bang_bang_time(*columns)
    for first in range(0, 40_000, 10_000):
        part = al.bang_bang_time(*(column[first : first + 10_000] for column in columns))
        for field in ("feasible", "t_min", "t_max", "a_min", "a_max", "hold_start", "hold_end"):
            np.testing.assert_array_equal(getattr(batch, field)[first : first + 10_000], getattr(part, field), err_msg=field)
    columns[2][[17_001, 30_000]] = -1.0
    with pytest.raises(al.InputError, match=r"inertia is not positive: .*first bad index 17001\)"):
        al.bang_bang_time(*columns)
