"""Implicit methods in closed loops: steps and errors follow the tolerance for laws of rigid and elastic arms.

This includes stiff springs and small tolerances. A tolerance below rounding ends with a status that names a feasible tolerance.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import armlet as al

METHODS = ("radau5", "rodas4")
TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8)


def rows(arm: al.Arm, q: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Position and rotation vector of the flange, (6,)."""
    pose = arm.pose(q, "flange")
    return np.concatenate([pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_rotvec()])


def six_axis(turn: float) -> tuple[al.Plant, al.Law, dict[str, Any]]:
    """Cartesian impedance with six rows. The joint angles of the target differ by `turn` from those of the start."""
    arm = models.SIX_AXES
    q_d = np.array([0.3, -0.5, 0.8, 0.2, 0.6, -0.4])
    k = [800.0] * 3 + [40.0] * 3
    law = al.CartesianImpedance(arm, rows(arm, q_d), k, [x / 10 for x in k], frame="flange", axes="xyz rx ry rz")
    return al.RigidArm(arm), law, {"q0": q_d + turn}


def planar() -> al.Arm:
    return al.planar_arm([0.5, 0.4, 0.3], masses=[2.0, 1.5, 1.0], inertias=[0.05, 0.03, 0.02], gravity=(0.0, -9.81))


def motion() -> al.Motion:
    return al.Sinusoid([0.3, 0.5, -0.4], [0.3, 0.2, 0.4], [3.0, 4.0, 5.0], [0.0, 1.0, 2.0])


def rigid(law: Callable[[al.Arm], al.Law], **more: Any) -> tuple[al.Plant, al.Law, dict[str, Any]]:
    arm = planar()
    return al.RigidArm(arm), law(arm), {"q0": [0.1, 0.6, -0.2], **more}


def elastic(law: Callable[[al.Arm], al.Law], **more: Any) -> tuple[al.Plant, al.Law, dict[str, Any]]:
    arm = planar()
    q0 = [0.1, 0.6, -0.2]
    return al.ElasticArm(arm, SPRINGS, MOTORS), law(arm), {"q0": q0, "theta0": q0, **more}


SPRINGS, MOTORS, REDUCED = [1e4] * 3, [0.3] * 3, [0.01] * 3

LOOPS: dict[str, Callable[[], tuple[al.Plant, al.Law, dict[str, Any]]]] = {
    "CartesianImpedance": lambda: six_axis(0.05),
    "CartesianImpedance, half a turn off": lambda: six_axis(1.2),
    "PDGravity": lambda: rigid(lambda arm: al.PDGravity(arm, [0.5, 0.2, 0.3], kp=100.0, kd=20.0)),
    "PDGravity, pushed": lambda: rigid(
        lambda arm: al.PDGravity(arm, [0.5, 0.2, 0.3], kp=100.0, kd=20.0),
        force=lambda t: np.array([5.0 * np.sin(9.0 * t), 2.0, 0.0]),
        force_frame="link3",
    ),
    "ComputedTorque": lambda: rigid(lambda arm: al.ComputedTorque(arm, motion(), kp=100.0, kd=20.0)),
    "Adaptive": lambda: rigid(lambda arm: al.Adaptive(arm, motion(), kp=60.0, kd=20.0, gamma=0.5)),
    "ElasticImpedance": lambda: elastic(
        lambda arm: al.ElasticImpedance(
            arm, [0.6, 0.5, 0.7], [400.0, 400.0, 40.0], [40.0, 40.0, 4.0], SPRINGS, MOTORS, REDUCED, frame="link3", axes="x y rz"
        )
    ),
    "ElasticTracking": lambda: elastic(
        lambda arm: al.ElasticTracking(
            arm, motion(), [400.0, 400.0, 40.0], [40.0, 40.0, 4.0], SPRINGS, MOTORS, REDUCED, frame="link3", axes="x y rz"
        )
    ),
    "JointImpedance": lambda: elastic(lambda arm: al.JointImpedance(arm, [0.5, 0.2, 0.3], 100.0, 10.0, SPRINGS, MOTORS, REDUCED)),
    "JointTracking": lambda: elastic(lambda arm: al.JointTracking(arm, motion(), 300.0, 20.0, SPRINGS, MOTORS)),
    "MotorPD": lambda: elastic(lambda arm: al.MotorPD(arm, [0.5, 0.2, 0.3], 300.0, 20.0, SPRINGS)),
    "StateFeedback": lambda: elastic(lambda arm: al.StateFeedback(arm, [0.5, 0.2, 0.3], 300.0, 20.0, 2.0, 0.01, SPRINGS)),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", LOOPS)
def test_steps_and_errors_follow_the_tolerance(name: str, method: str) -> None:
    plant, law, start = LOOPS[name]()

    def run(method: str, rtol: float) -> al.Run:
        return al.simulate(plant, law, **start, t_end=0.1, method=method, rtol=rtol, atol=rtol * 1e-2, t_eval=[0.03, 0.1], monitors=False)

    # The reference is an explicit method without Jacobians, 100 times more accurate than the smallest tolerance.
    truth = run("dop853", 1e-10).q
    runs = [run(method, rtol) for rtol in TOLERANCES]
    steps = [r.stats["steps"] for r in runs]
    errors = [float(np.abs(r.q - truth).max()) for r in runs]
    # Error estimates have order 3, so a decade of tolerance takes 10^(1/4) = 1.8 times the steps. 50 % more are allowed. A Rosenbrock
    # method with a wrong Jacobian takes 3.2 times the steps per decade.
    assert steps[3] < 1.5 * 10**0.75 * steps[0] + 20, (steps, errors)
    # The error per step is below the tolerance, and damped loops do not amplify it.
    assert all(error < 10.0 * rtol for error, rtol in zip(errors, TOLERANCES, strict=True)), (steps, errors)
    # Three decades of tolerance reduce the error by at least two decades, unless it is as small as the error of the reference.
    assert errors[3] < max(errors[0] / 100.0, 2e-10), (steps, errors)


# For each level: stiffness, N m/rad, and reduced motor inertia, kg m^2. The motors have natural frequencies of 3e4 and 3e5 rad/s.
STIFF = {"stiff": (1e5, 1e-4), "very": (1e6, 1e-5)}


def motors(level: str, method: str, rtol: float, **more: Any) -> al.Run:
    """A run of an elastic 2R arm under gravity and a force. An impedance law moves it to a point; the springs are relaxed at the start."""
    k, b0 = STIFF[level]
    arm = al.planar_arm([0.5, 0.5], masses=[2.0, 2.0], coms=[0.25, 0.25], inertias=[0.05, 0.05], gravity=(0.0, -9.81))
    law = al.ElasticImpedance(
        arm, [0.6, 0.3], [400.0] * 2, [4.0] * 2, [k] * 2, [0.5] * 2, [b0] * 2, frame="link2", axes="xy", damping_ratio=0.7
    )
    q0 = [-0.5, 1.6]
    keywords = {"t_end": 2.0, "t_eval": [0.2, 2.0], "monitors": False, "force": [5.0, -3.0], "atol": rtol * 1e-3, **more}
    return al.simulate(al.ElasticArm(arm, [k] * 2, [0.5] * 2), law, q0, theta0=q0, method=method, rtol=rtol, **keywords)


# Largest numbers of steps at rtol 1e-8. With radau5, a decade of tolerance takes 1.8 times as many steps.
@pytest.mark.parametrize(("method", "steps"), [("radau5", 1500), ("rodas4", 2500)])
@pytest.mark.parametrize("level", STIFF)
def test_tight_tolerances_are_met_where_springs_are_stiff(level: str, method: str, steps: int) -> None:
    truth = motors(level, "radau5", 1e-11).q
    for decade, rtol in ((0, 1e-8), (1, 1e-9), (2, 1e-10)):
        run = motors(level, method, rtol)
        # RODAS loses an order in the transient of motors: a decade takes 2.6 to 3.4 times as many steps.
        assert run.stats["steps"] < steps * 3.0**decade, rtol
        assert run.stats["rejections"] < 0.05 * run.stats["steps"], rtol
        assert np.abs(run.q - truth).max() < 100.0 * rtol, rtol


@pytest.mark.parametrize("method", METHODS)
def test_a_tolerance_below_rounding_is_refused_with_one_that_can_be_met(method: str) -> None:
    with pytest.raises(al.SolveError, match="excess_accuracy: the tolerances are below the rounding error") as caught:
        motors("stiff", method, 1e-14, t_end=0.5, t_eval=[0.5])
    error = caught.value
    assert error.status is al.Status.EXCESS_ACCURACY
    named = re.search(r"expected at least rtol = (\S+) and atol = (\S+), got 1e-14 and 1e-17", str(error))
    assert named
    rtol, atol = map(float, named.groups())
    # The tolerance in the message lies between the refused tolerance and 1e-9. With this tolerance the run succeeds.
    assert 1e-14 < rtol < 1e-9
    run = motors("stiff", method, rtol, atol=atol, t_end=0.5, t_eval=[0.5])
    assert run.status is al.Status.SUCCESS


def test_advice_fits_the_method() -> None:
    """At a switching surface no method proceeds. Only explicit methods receive the advice to use a stiff one."""

    def switch(t: float, y: Any) -> Any:
        return [-1.0 if y[0] > 0.0 else 1.0]

    for method in ("dopri5", "radau5", "rodas4"):
        with pytest.raises(al.SolveError) as caught:
            al.integrate(switch, (0.0, 10.0), [1.0], method=method, rtol=1e-10, atol=1e-12)
        assert caught.value.status in (al.Status.STALLED, al.Status.STEP_UNDERFLOW, al.Status.MAX_STEPS)
        assert "stiff" not in caught.value.status.advice
        assert ("radau5" in str(caught.value)) == (method == "dopri5")
