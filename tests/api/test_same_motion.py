"""What a batch keeps, and whether it monitors its runs, does not change the bits of the motion: every method, plant and law."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import armlet as al

ARM = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], inertias=[0.3, 0.2])
RUBBED = ARM.with_drives(damping=[0.5, 0.3], friction=[0.2, 0.1], armature=[0.1, 0.05])
Q0, V0 = np.array([[0.12, 0.21], [0.1, 0.15]]), np.array([[0.3, 0.2], [-0.2, 0.4]])
SWING = al.Sinusoid([0.1, 0.0], [0.4, 0.3], [1.0, 2.0], [0.1, 0.3])
GAINS: dict[str, Any] = {"kp": [60.0, 40.0], "kd": [8.0, 5.0]}
K, B, REDUCED = [300.0, 200.0], [0.2, 0.1], [0.1, 0.06]
TIP: dict[str, Any] = {"frame": "link2", "axes": "xy"}
HOLD = al.PDGravity(ARM, [0.5, -0.3], **GAINS)
RIGID, ELASTIC = al.RigidArm(ARM), al.ElasticArm(ARM, K, B)
STOPS = al.JointStops(1e4, 20.0, lower=-0.1, upper=0.1)
WALL = al.Wall("link2", [0.8, 0.0, 0.0], [-1.0, 0.2, 0.0], stiffness=1e4, damping=50.0)
BRISTLES = al.LuGre(coulomb=1.0, stiffness=1e4, damping=50.0)
STIFFNESS, DAMPING = [300.0, 200.0], [40.0, 30.0]

Loop = tuple[Any, Any, dict[str, Any]]
LOOPS: dict[str, Callable[[], Loop]] = {
    "PDGravity": lambda: (RIGID, HOLD, {}),
    "saturated and pushed": lambda: (RIGID, HOLD, {"tau_max": [12.0, 4.0], "force": [5.0, -3.0, 0.0], "force_frame": "link2"}),
    "stops": lambda: (al.RigidArm(ARM, stops=STOPS), HOLD, {}),
    "wall": lambda: (al.RigidArm(ARM, wall=WALL), HOLD, {}),
    "Coulomb": lambda: (al.RigidArm(RUBBED, friction=True), HOLD, {}),
    "LuGre": lambda: (al.RigidArm(ARM, friction=BRISTLES), HOLD, {}),
    "StickSlip": lambda: (al.RigidArm(ARM, friction=al.StickSlip(coulomb=1.0)), HOLD, {}),
    "PID": lambda: (RIGID, al.PID(ARM, SWING, ki=20.0, derivative_filter=90.0, tau_max=[90.0, 50.0], **GAINS), {}),
    "ComputedTorque": lambda: (RIGID, al.ComputedTorque(ARM, SWING, **GAINS), {}),
    "Adaptive": lambda: (RIGID, al.Adaptive(ARM, SWING, gamma=0.3, **GAINS), {}),
    "CartesianImpedance": lambda: (RIGID, al.CartesianImpedance(ARM, [0.7, 0.1], STIFFNESS, DAMPING, **TIP), {}),
    "CartesianImpedance with a null space": lambda: (
        RIGID,
        al.CartesianImpedance(ARM, [0.6], 300.0, 40.0, frame="link2", axes="x", nullspace=al.NullSpace([0.3, 0.5], 1.0, 1.0)),
        {},
    ),
    "Guarded": lambda: (RIGID, al.Guarded(HOLD, al.MomentumObserver(ARM, 20.0, threshold=5.0), "stop", stiffness=200.0, damping=30.0), {}),
    "PriorityAcceleration": lambda: (RIGID, al.PriorityAcceleration(ARM, [al.Task("link2", "xy", [0.6, 0.2], 9.0)]), {}),
    "MotorPD": lambda: (ELASTIC, al.MotorPD(ARM, [0.4, 0.3], joint_stiffness=K, **GAINS), {}),
    "MotorPD, stops": lambda: (al.ElasticArm(ARM, K, B, stops=STOPS), al.MotorPD(ARM, [0.4, 0.3], joint_stiffness=K, **GAINS), {}),
    "MotorPD, LuGre": lambda: (
        al.ElasticArm(ARM, K, B, motor_friction=BRISTLES),
        al.MotorPD(ARM, [0.4, 0.3], joint_stiffness=K, **GAINS),
        {},
    ),
    "MotorPD, moving": lambda: (ELASTIC, al.MotorPD(ARM, SWING, joint_stiffness=K, online=True, **GAINS), {}),
    "StateFeedback, moving": lambda: (ELASTIC, al.StateFeedback(ARM, SWING, joint_stiffness=K, kt=0.5, ks=0.01, **GAINS), {}),
    "JointImpedance, moving": lambda: (ELASTIC, al.JointImpedance(ARM, SWING, 60.0, 8.0, K, B, REDUCED), {}),
    "JointImpedance": lambda: (ELASTIC, al.JointImpedance(ARM, [0.4, 0.3], 60.0, 8.0, K, B, REDUCED), {}),
    "JointTracking": lambda: (ELASTIC, al.JointTracking(ARM, SWING, joint_stiffness=K, motor_inertia=B, **GAINS), {}),
    "ElasticImpedance": lambda: (ELASTIC, al.ElasticImpedance(ARM, [0.7, 0.1], STIFFNESS, DAMPING, K, B, REDUCED, **TIP), {}),
    "PriorityVelocity": lambda: (al.VelocityArm(ARM), al.PriorityVelocity(ARM, [al.Task("link2", "xy", [0.6, 0.2], 3.0)]), {}),
}
METHODS = ("euler", "semi_implicit", "rk4", "ros2", "dopri5", "dop853", "radau5", "rodas4")
ADAPTIVE, IMPLICIT = METHODS[4:], ("ros2", "radau5", "rodas4")
SERIES = ("q", "v", "tau", "estimate", "theta", "theta_dot", "friction", "bristles")


def last(run: Any) -> dict[str, bytes]:
    """The bits of the last record. All NaN have the same bits here."""
    records = {name: getattr(run, name) for name in SERIES if getattr(run, name) is not None}
    return {name: np.where(np.isnan(x), np.nan, x)[..., -1, :].tobytes() for name, x in records.items()}


def clocks(name: str, method: str) -> list[Any]:
    """The values of `sample_time` with which the loop runs."""
    if method == "semi_implicit" and name == "PriorityVelocity":
        return []
    held = [2e-3, al.Sampling(2e-3, delay=1e-3, noise={"q": 1e-4}, seed=1)]
    continuous = name != "Guarded" and not (name.startswith("Priority") and method in IMPLICIT)
    return [None, *held] if continuous else held


@pytest.mark.filterwarnings("ignore")  # some of these loops have too long steps for their method, so that their energy drifts
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", LOOPS)
def test_the_motion_does_not_depend_on_what_is_kept(name: str, method: str) -> None:
    plant, law, more = LOOPS[name]()
    starts = {} if name == "PriorityVelocity" else {"v0": V0}
    # A single run of fewer than 20 steps has no program, so this run has 24.
    given = more | {"method": method, "t_end": 0.024, "check_limits": False}
    given |= {"t_eval": [0.01, 0.024]} if method in ADAPTIVE else {"dt": 1e-3}
    for clock in clocks(name, method):
        given["sample_time"] = clock
        expected = last(al.simulate_batch(plant, law, Q0, **starts, **given))
        for keep in ("all", "metrics", "final"):
            for monitors in (True, False):
                other = al.simulate_batch(plant, law, Q0, keep=keep, monitors=monitors, **starts, **given)
                assert last(other) == expected, (clock, keep, monitors)
        one = {part: rows[0] for part, rows in starts.items()}
        both = [last(al.simulate(plant, law, Q0[0], monitors=monitors, throw=False, **one, **given)) for monitors in (True, False)]
        assert both[0] == both[1], clock


def test_the_metrics_of_an_implicit_method_are_those_of_its_records() -> None:
    """The peaks are taken from the records with numpy. The sums of the metrics are added in another order, which changes rounding."""
    plant, law, _ = LOOPS["stops"]()
    given: dict[str, Any] = {"v0": V0, "t_end": 0.2, "dt": 1e-3, "method": "ros2", "check_limits": False}
    records, found = al.simulate_batch(plant, law, Q0, **given), al.simulate_batch(plant, law, Q0, keep="metrics", **given).metrics()
    np.testing.assert_array_equal(found["tau_peak"], np.abs(records.tau).max(axis=1))
    np.testing.assert_allclose(found["error_rms"], records.metrics()["error_rms"], rtol=1e-12, atol=0.0)


@pytest.mark.filterwarnings("ignore:simulate. the energy balance")  # at these stiff stops with 1 ms
def test_a_sweep_has_the_metrics_of_its_runs() -> None:
    """A row of a sweep and a single run may differ by rounding, which this contracting loop does not amplify."""
    scenario = al.Scenario(
        {
            "arm": {"kind": "planar_arm", "lengths": [0.5, 0.4]},
            "plant": {"kind": "RigidArm", "stops": {"stiffness": 1e4, "damping": 20.0, "lower": -0.1, "upper": 0.1}},
            "law": {"kind": "PDGravity", "target": [0.5, -0.3], "kp": 60.0, "kd": 8.0},
            "run": {"q0": [0.12, 0.21], "v0": [0.3, 0.2], "t_end": 0.1, "dt": 1e-3, "method": "ros2", "check_limits": False},
        }
    )
    swept = al.sweep(scenario, {"law.kp": [40.0, 60.0]})
    for i, kp in enumerate((40.0, 60.0)):
        for name, value in scenario.replace({"law.kp": kp}).run().metrics().columns().items():
            np.testing.assert_allclose(swept[name][i], value, rtol=1e-9, atol=1e-12, err_msg=name)
