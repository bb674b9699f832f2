"""Composite adaptation: tau_W = W pi along every run, V1_dot = -s'Kd s - e_W'R e_W, and faster convergence of the estimate.

`W` is the filtered regressor, `tau_W` the filtered torque, `e_W = tau_W - W pi_hat`, and `R` the weight.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from adaptation_loops import MOTION, START, TIGHT, robot

import armlet as al

WEIGHT = np.array([[0.5, 0.1], [0.1, 0.3]])


CASES: dict[str, dict[str, Any]] = {
    "smooth": {},
    "viscous": {"friction": ("viscous",)},
    "rotors": {"friction": ("viscous",), "armature": True},
    "leakage": {"leakage": 0.1},
    "dead zone": {"dead_zone": 0.3},
    "natural": {"natural": True},
    "base": {"friction": ("viscous",)},
}


def made(name: str, arm: al.Arm) -> al.Adaptive:
    keywords = dict(CASES[name])
    if name == "natural":
        keywords["estimate"] = 0.7 * arm.parameters
    if name == "base":
        keywords["base"] = arm.base_parameters()
    return al.Adaptive(arm, MOTION, 60.0, 20.0, 0.5, composite=WEIGHT, composite_rate=6.0, **keywords)


def truth(name: str, arm: al.Arm) -> Any:
    inertial = arm.base_parameters().projection @ arm.parameters if name == "base" else arm.parameters
    rotors = [0.2, 0.2] if name == "rotors" else []
    return np.concatenate([inertial, rotors, [0.6, 0.6] if "friction" in CASES[name] else []])


@pytest.mark.parametrize("name", CASES)
def test_the_filtered_dynamics_hold_and_the_balance_closes(name: str) -> None:
    arm, law = robot(), made(name, robot())
    rubs = "friction" in CASES[name]
    run = al.simulate(al.RigidArm(arm, friction=rubs), law, **START, t_end=2.0, **TIGHT)
    assert run.estimate is not None
    a = truth(name, arm)
    for t, q, v, z in zip(run.t, run.q, run.v, run.estimate, strict=True):
        parts = law.terms(t, q, v, state=z)
        np.testing.assert_allclose(parts["tau_W"], parts["W"] @ a, rtol=0, atol=1e-8)
        np.testing.assert_allclose(parts["e_W"], parts["W"] @ (a - z[: a.size]), rtol=0, atol=1e-8)
    value = run.monitors["lyapunov"]
    assert np.max(np.abs(run.monitors["lyapunov_balance"])) <= 1e-9 * max(1.0, float(value[0]))
    assert np.ptp(value) > 0.05


def test_the_lyapunov_function_decreases_by_both_squares() -> None:
    """V1 decreases by the integral of s'Kd s + e_W'R e_W.

    Simpson's rule with 1 ms has the error 0.3^4/180, since s decays with 300 1/s at first.
    """
    arm, law = robot(), made("smooth", robot())
    run = al.simulate(al.RigidArm(arm), law, **START, t_end=1.0, t_eval=np.linspace(0.0, 1.0, 1001), **TIGHT)
    assert run.estimate is not None
    squares = []
    for t, q, v, z in zip(run.t, run.q, run.v, run.estimate, strict=True):
        parts = law.terms(t, q, v, state=z)
        squares.append([20.0 * parts["s"] @ parts["s"], parts["e_W"] @ WEIGHT @ parts["e_W"]])
    rule = np.where(np.arange(1001) % 2, 4.0, 2.0)
    rule[[0, -1]] = 1.0
    lost = rule @ np.array(squares) / 3000.0
    value = run.monitors["lyapunov"]
    assert lost[1] > 0.01 * lost[0]
    np.testing.assert_allclose(value[0] - value[-1], lost.sum(), rtol=1e-5)
    assert np.all(np.diff(value) <= 1e-12)


def errors(arm: al.Arm, motion: al.Motion, gains: tuple[float, float, float], weights: list[float | None], base: Any = None) -> list[float]:
    """Relative errors of the estimate after 20 s, starting from zero, for each weight."""
    a = arm.parameters if base is None else base.projection @ arm.parameters
    left = []
    for weight in weights:
        law = al.Adaptive(arm, motion, *gains, base=base, composite=weight, composite_rate=None if weight is None else 2.0)
        run = al.simulate(al.RigidArm(arm), law, [0.1, 0.2], t_end=20.0, dt=2e-3, record_every=1000)
        assert run.estimate is not None
        left.append(float(np.linalg.norm(run.estimate[-1, : a.size] - a) / np.linalg.norm(a)))
    return left


def test_the_estimate_converges_where_plain_adaptation_does_not_yet() -> None:
    arm, motion = models.PR, al.Sinusoid([0.0, 0.3], [0.5, 0.8], [1.0, 1.7], [0.0, 0.0])
    plain, composite = errors(arm, motion, (40.0, 20.0, 1.0), [None, 300.0])
    assert plain > 0.3
    assert composite < 1e-3


def test_the_estimate_of_a_tree_converges_sooner() -> None:
    """The tree has eight base parameters under gravity. A larger weight gives faster convergence."""
    arm = robot(damping=0.0, armature=0.0)
    frequencies = [[1.65, 4.65], [2.55, 6.45]]
    rich = al.Sinusoid([0.1, 0.2], [[0.5, 0.5], [0.6, 0.5]], frequencies, [[0.0, 1.0], [0.5, 0.2]])
    plain, light, heavy = errors(arm, rich, (120.0, 40.0, 0.1), [None, 5.0, 20.0], arm.base_parameters())
    assert heavy < 0.7 * light < 0.7 * 0.7 * plain


def test_a_sampled_run_keeps_the_identity_up_to_the_period() -> None:
    arm, law = robot(), made("smooth", robot())
    gaps = []
    for period in (2e-3, 1e-3):
        run = al.simulate(al.RigidArm(arm), law, **START, t_end=0.5, dt=1e-3, sample_time=period)
        assert run.estimate is not None
        parts = law.terms(0.5, run.q[-1], run.v[-1], state=run.estimate[-1])
        gaps.append(np.max(np.abs(parts["tau_W"] - parts["W"] @ arm.parameters)) / np.max(np.abs(parts["tau_W"])))
    assert gaps[1] < 0.7 * gaps[0] < 0.05


def test_rows_of_a_batch_are_runs() -> None:
    arm, law = robot(), made("viscous", robot())
    q0, v0 = np.random.default_rng(3).uniform(-0.5, 0.5, (2, 6, 2))
    options: dict[str, Any] = {"t_end": 0.2, "dt": 2e-3}
    batch = al.simulate_batch(al.RigidArm(arm, friction=True), law, q0, v0=v0, **options)
    for k in range(6):
        one = al.simulate(al.RigidArm(arm, friction=True), law, q0[k], v0=v0[k], **options)
        np.testing.assert_array_equal(one.q, batch.q[k])
        np.testing.assert_array_equal(one.estimate, batch.estimate[k])


def test_a_state_that_is_set_empties_the_filters() -> None:
    arm, law = robot(), made("smooth", robot())
    stepped = al.Simulator(al.RigidArm(arm), law, START["q0"], v0=START["v0"], dt=1e-3)
    for _ in range(50):
        stepped.step()
    stepped.set_state([0.5, 0.4], [-1.0, 0.7])
    assert stepped.estimate is not None
    parts = law.terms(0.05, [0.5, 0.4], [-1.0, 0.7], state=stepped.estimate)
    assert not np.any(parts["W"]) and not np.any(parts["tau_W"]) and np.any(stepped.estimate[:20])
    stepped.reset([0.1, 0.1], [0.2, 0.2])
    parts = law.terms(0.0, [0.1, 0.1], [0.2, 0.2], state=stepped.estimate)
    assert not np.any(parts["W"]) and not np.any(stepped.estimate[:20])


def test_without_the_option_nothing_changes() -> None:
    arm = robot()
    runs = [
        al.simulate(al.RigidArm(arm), al.Adaptive(arm, MOTION, 60.0, 20.0, 0.5, **more), **START, t_end=0.2, dt=1e-3)
        for more in ({}, {"composite": None, "composite_rate": None})
    ]
    with pytest.raises(al.InputError, match="composite_rate takes effect only with composite"):
        al.Adaptive(arm, MOTION, 60.0, 20.0, 0.5, composite_rate=3.0)
    np.testing.assert_array_equal(runs[0].q, runs[1].q)
    assert runs[0].estimate is not None and runs[0].estimate.shape[1] == 20


def test_the_figure_omits_the_filters() -> None:
    pytest.importorskip("matplotlib").use("Agg")
    arm = models.PR
    law = al.Adaptive(arm, al.Hold([0.5, 0.2]), 40.0, 20.0, 5.0, composite=1.0)
    run = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=0.1, dt=1e-3)
    panels = [panel for panel in np.ravel(run.plot()) if panel.get_title(loc="left") == "Parameter estimates"]
    # The panel of estimates has as many curves as the panel of a law without the option.
    law = al.Adaptive(arm, al.Hold([0.5, 0.2]), 40.0, 20.0, 5.0)
    run = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=0.1, dt=1e-3)
    plain = [panel for panel in np.ravel(run.plot()) if panel.get_title(loc="left") == "Parameter estimates"]
    assert len(panels) == len(plain) == 1
    assert len(panels[0].lines) == len(plain[0].lines)


def test_scenarios_have_the_keys() -> None:
    law = {"kind": "Adaptive", "kp": 60.0, "kd": 20.0, "gamma": 0.5, "composite": [[0.5, 0.1], [0.1, 0.3]], "composite_rate": 6.0}
    motion = {"kind": "Hold", "q": [0.1, 0.2]}
    table = {"arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5}, "plant": {"kind": "RigidArm"}, "law": law, "motion": motion}
    table |= {"run": {"q0": [0.0, 0.0], "t_end": 0.1, "dt": 1e-3}}
    run = al.Scenario.from_dict(table).run()
    assert run.estimate is not None and run.estimate.shape == (101, 11)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"composite": -1.0}, "composite is not positive"),
        ({"composite": 0.0}, "composite"),
        ({"composite": np.nan}, "composite"),
        ({"composite": [1.0]}, "composite has the wrong shape"),
        ({"composite": np.array([[1.0, 2.0], [2.0, 1.0]])}, "composite is not positive definite"),
        ({"composite": "much"}, "composite"),
        ({"composite": 1.0, "composite_rate": 0.0}, "composite_rate is not positive"),
        ({"composite": 1.0, "composite_rate": np.inf}, "composite_rate"),
        ({"composite_rate": -1.0}, "composite_rate is not positive"),
        ({"composite": 1.0, "composite_rate": [1.0, 2.0]}, "composite_rate"),
    ],
)
def test_bad_arguments(keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        al.Adaptive(robot(), MOTION, 60.0, 20.0, 0.5, **keywords)
