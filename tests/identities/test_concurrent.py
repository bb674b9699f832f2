"""Concurrent learning: V1_dot = -s'Kd s - sum e_j'R e_j, convergence at rest, windows without accelerations, invalid arguments.

`e_j` is the residual of sample j, and `R` the weight of samples.
"""

from __future__ import annotations

import copy
import pickle
from itertools import combinations
from typing import Any

import models
import numpy as np
import pytest
from adaptation_loops import MOTION, START, TIGHT, robot
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
WEIGHT = np.array([[0.5, 0.1], [0.1, 0.3]])
#: A point-to-point motion followed by rest. It excites almost no parameter.
REACH = al.Quintic([0.3, -0.2], [0.5, 0.1], 1.0)

CASES: dict[str, dict[str, Any]] = {
    "alone": {},
    "viscous": {"friction": ("viscous",)},
    "rotors": {"friction": ("viscous",), "armature": True},
    "leakage": {"leakage": 0.1},
    "e-modification": {"leakage": 0.1, "leakage_form": "e"},
    "dead zone": {"dead_zone": 0.3},
    "natural": {"natural": True},
    "base": {"friction": ("viscous",)},
    "composite": {"composite": 0.2},
}


def record(arm: al.Arm, friction: bool, count: int = 60) -> tuple[Array, Array, Array, Array]:
    q, v, a = np.random.default_rng(2).uniform(-1.5, 1.5, (3, count, arm.n))
    return q, v, a, arm.inverse_dynamics(q, v, a, friction=friction)


def made(name: str, arm: al.Arm, motion: al.Motion = MOTION, samples: al.Samples | None = None, **more: Any) -> al.Adaptive:
    keywords = dict(CASES[name])
    if name == "natural":
        keywords["estimate"] = 0.7 * arm.parameters
    if name == "base":
        keywords["base"] = arm.base_parameters()
    return al.Adaptive(arm, motion, 60.0, 20.0, 0.5, concurrent=samples, **keywords | more)


def chosen(name: str, arm: al.Arm) -> al.Samples:
    q, v, a, tau = record(arm, "friction" in CASES[name])
    return al.select_samples(made(name, arm), q, v, tau, 12, a=a)


def truth(name: str, arm: al.Arm) -> Any:
    inertial = arm.base_parameters().projection @ arm.parameters if name == "base" else arm.parameters
    rotors = [0.2, 0.2] if name == "rotors" else []
    return np.concatenate([inertial, rotors, [0.6, 0.6] if "friction" in CASES[name] else []])


@pytest.mark.parametrize("name", CASES)
def test_the_samples_hold_and_the_balance_closes(name: str) -> None:
    arm, samples = robot(), chosen(name, robot())
    a = truth(name, arm)
    np.testing.assert_allclose(samples.tau, samples.W @ a, rtol=0, atol=1e-12)
    law = made(name, arm, samples=samples, concurrent_weight=0.01 * WEIGHT)
    run = al.simulate(al.RigidArm(arm, friction="friction" in CASES[name]), law, **START, t_end=2.0, **TIGHT)
    assert run.estimate is not None
    z = run.estimate[40]
    parts = law.terms(run.t[40], run.q[40], run.v[40], state=z)
    np.testing.assert_allclose(parts["e_stored"], samples.W @ (a - z[: a.size]), rtol=0, atol=1e-11)
    value = run.monitors["lyapunov"]
    assert np.max(np.abs(run.monitors["lyapunov_balance"])) <= 1e-9 * max(1.0, float(value[0]))
    assert np.ptp(value) > 0.05


def test_the_lyapunov_function_decreases_by_both_sums() -> None:
    """V1 decreases by the integral of s'Kd s + sum e_j'R e_j.

    Simpson's rule with 1 ms has the error 0.3^4/180, since s decays with 300 1/s at first.
    """
    arm, samples = robot(), chosen("alone", robot())
    law = made("alone", arm, samples=samples, concurrent_weight=0.01 * WEIGHT)
    run = al.simulate(al.RigidArm(arm), law, **START, t_end=1.0, t_eval=np.linspace(0.0, 1.0, 1001), **TIGHT)
    assert run.estimate is not None
    fall = []
    for t, q, v, z in zip(run.t, run.q, run.v, run.estimate, strict=True):
        parts = law.terms(t, q, v, state=z)
        e = parts["e_stored"]
        fall.append(20.0 * parts["s"] @ parts["s"] + 0.01 * np.einsum("ji,ik,jk->", e, WEIGHT, e))
    simpson = np.ones(1001)
    simpson[1:-1:2], simpson[2:-1:2] = 4.0, 2.0
    lost = run.monitors["lyapunov"][0] - run.monitors["lyapunov"][-1]
    assert abs(float(simpson @ fall) / 3000.0 - lost) <= 1e-4 * lost
    errors = [law.terms(t, q, v, state=z)["e_stored"] for t, q, v, z in zip(run.t, run.q, run.v, run.estimate, strict=True)]
    assert np.abs(errors[-1]).max() < 0.5 * np.abs(errors[0]).max()


def test_the_estimate_converges_at_rest() -> None:
    """The estimate converges at a constant target, without excitation.

    The slowest direction decays at least with the rate sigma^2 gamma R.
    """
    arm = robot()
    base = arm.base_parameters()
    q, v, a, tau = record(arm, False)
    plain = al.Adaptive(arm, REACH, 60.0, 20.0, 0.5, base=base)
    samples = al.select_samples(plain, q, v, tau, 12, a=a)
    learning = al.Adaptive(arm, REACH, 60.0, 20.0, 0.5, base=base, concurrent=samples, concurrent_weight=0.2)
    ends = []
    for law in (plain, learning):
        run = al.simulate(al.RigidArm(arm), law, [0.3, -0.2], t_end=20.0, dt=2e-3, record_every=100)
        assert run.estimate is not None
        ends.append(np.linalg.norm(run.estimate - base.values, axis=1))
    assert samples.rank == base.count
    assert ends[0][-1] > 0.5 * ends[0][0]
    rate = 0.5 * 0.2 * samples.singular_value**2
    # The terms with s decay within the first second. Afterwards only the samples determine the decay.
    assert ends[1][-1] <= 1.1 * ends[1][10] * np.exp(-rate * 18.0) + 1e-9
    assert ends[1][-1] < 1e-3 * ends[1][0]


def test_windows_need_no_acceleration() -> None:
    """Windows of a run of the plain law satisfy tau_j = W_j a, up to the error of Simpson's rule, (2.5 ms)^4 times fourth derivatives."""
    arm = robot()
    law = made("rotors", arm)
    run = al.simulate(al.RigidArm(arm, friction=True), law, **START, t_end=4.0, t_eval=np.linspace(0.0, 4.0, 1601), **TIGHT)
    assert run.tau is not None
    samples = al.select_samples(law, run.q, run.v, run.tau, 12, t=run.t, window=0.1)
    a = truth("rotors", arm)
    np.testing.assert_allclose(samples.tau, samples.W @ a, rtol=0, atol=1e-6)
    assert np.abs(samples.tau).max() > 0.1
    sampled = al.simulate(al.RigidArm(arm, friction=True), law, **START, t_end=4.0, dt=5e-4, sample_time=2.5e-3, record_every=5)
    assert sampled.tau is not None
    held = al.select_samples(law, sampled.q, sampled.v, sampled.tau, 12, t=sampled.t, window=0.1, held=True)
    smooth = al.select_samples(law, sampled.q, sampled.v, sampled.tau, 12, t=sampled.t, window=0.1)
    errors = [float(np.abs(each.tau - each.W @ a).max()) for each in (held, smooth)]
    assert errors[0] < 1e-3 and errors[1] > 10.0 * errors[0]


def test_the_choice_is_the_best_of_few() -> None:
    """The selection is compared with all sets of three out of ten samples of the PR robot."""
    arm = models.PR
    law = al.Adaptive(arm, al.Hold([0.0, 0.0]), 40.0, 20.0, 5.0)
    for seed in range(5):
        q, v, a = np.random.default_rng(seed).uniform(-2.0, 2.0, (3, 10, 2))
        every = al.select_samples(law, q, v, arm.inverse_dynamics(q, v, a), 10, a=a).W
        best = max(np.linalg.svd(np.vstack(every[list(three)]), compute_uv=False)[-1] for three in combinations(range(10), 3))
        found = al.select_samples(law, q, v, arm.inverse_dynamics(q, v, a), 3, a=a)
        assert found.singular_value >= 0.9 * best
        assert found.singular_value <= best * (1.0 + 1e-12)


def test_a_run_is_a_program_and_rows_of_a_batch_are_runs() -> None:
    arm, samples = robot(), chosen("alone", robot())
    laws = [made("alone", arm, samples=samples, concurrent_weight=weight) for weight in (0.01, 0.03, 0.1)]
    q0 = np.array([[0.3, -0.2], [0.1, 0.2], [-0.4, 0.3]])
    batch = al.simulate_batch(al.RigidArm(arm), laws, q0, t_end=0.2, dt=1e-3)
    assert batch.estimate is not None
    for row, law in enumerate(laws):
        run = al.simulate(al.RigidArm(arm), law, q0[row], t_end=0.2, dt=1e-3)
        assert run.stats["engine"] != "direct" and run.estimate is not None
        np.testing.assert_allclose(batch.q[row], run.q, rtol=0, atol=1e-12)
        np.testing.assert_allclose(batch.estimate[row], run.estimate, rtol=0, atol=1e-12)


def test_copies_have_the_samples() -> None:
    arm, samples = robot(), chosen("alone", robot())
    law = made("alone", arm, samples=samples, concurrent_weight=0.01)
    for again in (pickle.loads(pickle.dumps(law)), copy.deepcopy(law)):
        np.testing.assert_array_equal(again.terms(0.0, [0.1, 0.2], [0.3, 0.4])["e_stored"], samples.tau)
    assert "concurrent=<Samples: 12" in repr(law)


def test_scenarios_have_the_keys() -> None:
    arm = models.PR
    q, v, a = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 8, 2))
    plain = al.Adaptive(arm, al.Hold([1.0, 0.0]), 40.0, 20.0, 5.0)
    samples = al.select_samples(plain, q, v, arm.inverse_dynamics(q, v, a), 4, a=a)
    law = {"kind": "Adaptive", "kp": 40.0, "kd": 20.0, "gamma": 5.0, "concurrent_weight": 0.5}
    law["concurrent"] = {"W": samples.W.tolist(), "tau": samples.tau.tolist()}
    data = {
        "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
        "motion": {"kind": "Hold", "q": [1.0, 0.0]},
        "law": law,
        "run": {"q0": [0.0, 0.0], "t_end": 1.0, "dt": 1e-3},
    }
    run = al.Scenario(data).run()
    own = al.Adaptive(arm, al.Hold([1.0, 0.0]), 40.0, 20.0, 5.0, concurrent=samples, concurrent_weight=0.5)
    np.testing.assert_array_equal(run.q, al.simulate(al.RigidArm(arm), own, [0.0, 0.0], t_end=1.0, dt=1e-3).q)
    with pytest.raises(al.InputError, match=r"\$\.law\.concurrent\.W: is missing"):
        al.Scenario(data | {"law": law | {"concurrent": {"tau": [[0.0, 0.0]]}}})


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"concurrent": 3.0}, "concurrent is no set of samples"),
        ({"concurrent": al.Samples(np.ones((2, 2, 19)), np.ones((2, 2)), np.arange(2), 1.0, 1)}, "concurrent"),
        ({"concurrent": al.Samples(np.ones((2, 2, 20)), np.ones((3, 2)), np.arange(2), 1.0, 1)}, "concurrent"),
        ({"concurrent": al.Samples(np.ones((0, 2, 20)), np.ones((0, 2)), np.arange(0), 1.0, 1)}, "concurrent has the wrong shape"),
        ({"concurrent": al.Samples(np.full((1, 2, 20), np.nan), np.ones((1, 2)), np.arange(1), 1.0, 1)}, "concurrent is not finite"),
        ({"concurrent": al.Samples(np.full((1, 2, 20), 1e200), np.ones((1, 2)), np.arange(1), 1.0, 1)}, "concurrent is too large"),
        ({"concurrent_weight": -1.0}, "concurrent_weight is not positive"),
        ({"concurrent_weight": [1.0, 2.0, 3.0]}, "concurrent_weight"),
    ],
)
def test_bad_arguments(keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        al.Adaptive(robot(), MOTION, 60.0, 20.0, 0.5, **keywords)


GOOD = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2))
EVEN = np.linspace(0.0, 1.9, 20)


@pytest.mark.parametrize(
    ("arguments", "keywords", "message"),
    [
        ((GOOD, GOOD, GOOD, 5), {}, "t is missing"),
        ((GOOD, GOOD, GOOD, 5), {"t": EVEN}, "window is missing"),
        ((GOOD, GOOD, GOOD, 5), {"a": GOOD, "window": 0.2}, "window is not used"),
        ((GOOD, GOOD[:9], GOOD, 5), {"a": GOOD}, r"v has the wrong shape: expected \(20, 2\)"),
        ((GOOD, GOOD, GOOD, 0), {"a": GOOD}, "count is out of range"),
        ((GOOD, GOOD, GOOD, 21), {"a": GOOD}, "count is out of range: expected 1 to 20"),
        ((GOOD, GOOD, GOOD, 1), {"a": GOOD}, "count is too small"),
        ((GOOD, np.full((20, 2), np.inf), GOOD, 5), {"a": GOOD}, r"v is not finite.*\(0, 0\)"),
        ((GOOD, GOOD, GOOD, 5), {"t": EVEN**2, "window": 0.2}, "t is not evenly spaced.*first bad index 0"),
        ((GOOD, GOOD, GOOD, 5), {"t": EVEN, "window": 5.0}, "window is longer than the record"),
        ((GOOD, GOOD, GOOD, 5), {"t": EVEN, "window": -1.0}, "window is not positive"),
        ((GOOD, 1e200 * GOOD, GOOD, 5), {"a": GOOD}, "samples"),
    ],
)
def test_bad_records(arguments: tuple[Any, ...], keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        al.select_samples(made("alone", robot()), *arguments, **keywords)


def test_a_law_that_adapts_nothing_is_refused() -> None:
    other: Any = al.PDGravity(robot(), [0.0, 0.0], 10.0, 5.0)
    with pytest.raises(al.InputError, match="law adapts nothing"):
        al.select_samples(other, GOOD, GOOD, GOOD, 5, a=GOOD)
