"""Adaptation with rotors, friction, leakage and a dead zone: the balance includes every term, and leakage bounds the estimate.

V1_dot = -s'Kd s + s'(tau_f(v) - Y_f pi_f) + (pi - pi_hat)'(y - w),   pi_hat_dot = Gamma w,   y = Y's

`tau_f` is the friction of the plant and `Y_f pi_f` that of the law. Leakage and dead zone change `y` to `w`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from adaptation_loops import MOTION, START, TIGHT, robot

import armlet as al

CASES: dict[str, dict[str, Any]] = {
    "viscous": {"friction": ("viscous",)},
    "friction": {"friction": True},
    "all": {"friction": ("viscous", "coulomb", "stribeck"), "armature": True},
    "armature": {"armature": True},
    "leakage": {"leakage": 0.2},
    "e-modification": {"leakage": 0.2, "leakage_form": "e"},
    "dead zone": {"dead_zone": 0.3},
    "all restrained": {"friction": True, "armature": True, "leakage": 0.1, "dead_zone": 0.2},
    "natural": {"natural": True, "friction": True, "leakage": 0.1},
    "base": {"friction": True, "armature": True},
    "offset": {"offset": True, "friction": ("viscous",)},
}


def made(name: str, arm: al.Arm, **more: Any) -> al.Adaptive:
    keywords = dict(CASES[name]) | more
    if name == "natural":
        kinds = 4
        keywords["estimate"] = np.concatenate([0.7 * arm.parameters, np.zeros(kinds)])
    if name == "base":
        keywords["base"] = arm.base_parameters()
    return al.Adaptive(arm, MOTION, 60.0, 20.0, 0.5, **keywords)


@pytest.mark.parametrize("rubs", [False, True], ids=["smooth", "with friction"])
@pytest.mark.parametrize("name", CASES)
def test_the_balance_closes(name: str, rubs: bool) -> None:
    """The balance is zero with the plant's true friction and rotors, including the jump of Coulomb friction."""
    arm = robot(friction=0.15)
    run = al.simulate(al.RigidArm(arm, friction=rubs), made(name, arm), **START, t_end=2.0, **TIGHT)
    value = run.monitors["lyapunov"]
    assert np.max(np.abs(run.monitors["lyapunov_balance"])) <= 1e-9 * max(1.0, float(value[0]))
    # The arm moved: the loop has dissipated energy.
    assert np.ptp(value) > 0.05


def test_rotors_that_the_law_does_not_know_are_counted() -> None:
    """The rotor inertias of the law's arm differ from those of the plant. The balance includes the work of this difference."""
    law = made("friction", robot(friction=0.15, armature=0.2))
    plant = al.RigidArm(robot(friction=0.15, armature=0.35), friction=True)
    run = al.simulate(plant, law, **START, t_end=1.0, **TIGHT)
    assert np.max(np.abs(run.monitors["lyapunov_balance"])) <= 1e-9


def test_with_viscous_friction_the_lyapunov_function_does_not_increase() -> None:
    arm = robot()
    run = al.simulate(al.RigidArm(arm, friction=True), made("viscous", arm), **START, t_end=3.0, **TIGHT)
    assert np.all(np.diff(run.monitors["lyapunov"]) <= 1e-12)


def test_the_estimate_rests_in_the_dead_zone() -> None:
    arm = robot(friction=0.15)
    law = made("dead zone", arm)
    run = al.simulate(al.RigidArm(arm), law, **START, t_end=3.0, dt=1e-3)
    s = np.array([np.linalg.norm(law.terms(t, q, v)["s"]) for t, q, v in zip(run.t, run.q, run.v, strict=True)])
    inside = np.flatnonzero((s[:-1] < 0.28) & (s[1:] < 0.28))
    assert inside.size > 100 and run.estimate is not None
    np.testing.assert_array_equal(run.estimate[inside], run.estimate[inside + 1])
    assert np.any(np.diff(run.estimate, axis=0))


@pytest.mark.parametrize("form", ["sigma", "e"])
def test_leakage_bounds_an_estimate_that_a_load_would_drive_away(form: str) -> None:
    """A constant force that the model does not contain makes the estimate grow without bound. With leakage the estimate converges."""
    arm, hold = robot(friction=0.15), al.Hold([0.2, 0.3])
    options: dict[str, Any] = {"t_end": 60.0, "dt": 2e-3, "record_every": 500, "force_frame": "link2"}
    load = [(0.5 * k, [0.0, 0.0, (-1.0) ** k * 6.0]) for k in range(120)]
    grown = {}
    for sigma in (0.0, 2.0):
        law = al.Adaptive(arm, hold, 60.0, 20.0, 5.0, leakage=sigma, leakage_form=form)
        run = al.simulate(al.RigidArm(arm), law, [0.2, 0.3], force=load, **options)
        assert run.estimate is not None
        grown[sigma] = np.linalg.norm(run.estimate, axis=1)
    assert grown[2.0][-10:].max() < grown[0.0][-10:].max()
    assert np.ptp(grown[2.0][-20:]) <= 0.2 * grown[2.0].max()


def test_friction_is_found_under_excitation() -> None:
    """If the motion has enough frequencies, the estimate of friction converges to the plant's friction."""
    arm = robot()
    rich = al.Sinusoid([0.1, 0.2], [[0.5, 0.3], [0.6, 0.3]], [[1.1, 3.1], [1.7, 4.3]], [[0.0, 1.0], [0.5, 0.2]])
    law = al.Adaptive(arm, rich, 60.0, 20.0, 3.0, friction=("viscous",), base=arm.base_parameters())
    run = al.simulate(al.RigidArm(arm, friction=True), law, [0.1, 0.2], t_end=60.0, dt=2e-3, record_every=1000)
    assert run.estimate is not None
    np.testing.assert_allclose(run.estimate[-1, -2:], 0.6, rtol=0.02)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"friction": "dry"}, "friction is unknown: expected a flag or some of 'viscous', 'coulomb', 'stribeck', got \"dry\""),
        ({"friction": ("viscous", "viscous")}, r"friction is named twice \(first bad index 1\)"),
        ({"friction": 3.0}, "friction is unknown"),
        ({"friction": [1]}, "friction is unknown"),
        ({"armature": 1.5}, "armature"),
        ({"friction": True, "friction_speed": 0.0}, "friction_speed is not positive"),
        ({"friction": True, "friction_speed": [0.1]}, "friction_speed"),
        ({"leakage": -1.0}, "leakage is negative or not finite"),
        ({"leakage": np.nan}, "leakage"),
        ({"leakage": 0.1, "leakage_form": "tau"}, "leakage_form is unknown: expected 'sigma' or 'e'"),
        ({"leakage": 0.1, "leakage_centre": [0.0]}, "leakage_centre"),
        ({"dead_zone": -0.1}, "dead_zone is negative"),
        ({"dead_zone": np.inf}, "dead_zone"),
        ({"friction": True, "estimate": np.zeros(20)}, "estimate"),
        ({"friction": True, "natural": True, "estimate": np.zeros(24)}, "estimate is not physically possible"),
    ],
)
def test_bad_arguments(keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        al.Adaptive(robot(friction=0.15), MOTION, 60.0, 20.0, 0.5, **keywords)


def test_gamma_takes_the_size_of_the_estimate() -> None:
    arm = robot(friction=0.15)
    law = al.Adaptive(arm, MOTION, 60.0, 20.0, np.full(26, 0.5), friction=True, armature=True)
    assert len(law.parameter_names) == 26
    with pytest.raises(al.InputError, match="gamma"):
        al.Adaptive(arm, MOTION, 60.0, 20.0, np.full(20, 0.5), friction=True)
