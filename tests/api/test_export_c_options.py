"""Every law with every option as C: its torque equals armlet's to the last bit in 1,000 states, or `export_c` raises an error.

The error names the law. The table has an entry for each class of laws and for each of its arguments. A class or an argument without an
entry fails a test.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from compiled_c import COMPILERS, Controller

import armlet as al

pytestmark = pytest.mark.compile

ARM = models.TWO_HEAVY_LINKS.with_drives(armature=[0.1, 0.2], damping=[0.7, 0.3], friction=[0.2, 0.4])
SIX = models.SIX_AXES
N, P = ARM.n, len(ARM.parameters)
FULL = np.array([[60.0, 4.0], [4.0, 50.0]])
MOTION = al.Quintic([0.1, 0.9], [0.4, 0.5], 0.3)
WANDERING = al.Quintic([0.5, 0.2], [0.4, 0.3], 0.3)
OBSERVER = al.MomentumObserver(ARM, 50.0, threshold=0.5)
ROWS = np.random.default_rng(5).uniform(-1.0, 1.0, (3, N, P))
SAMPLES = al.Samples(W=ROWS, tau=ROWS @ ARM.parameters, indices=np.arange(3), singular_value=0.1, rank=3)

#: Inertial parameters of two spatial bodies of 3 and 2 kg.
POSSIBLE = np.array([3.0, 0.75, 0.0, 0.0, 0.05, 0.0, 0.24, 0.0, 0.0, 0.24, 2.0, 0.4, 0.0, 0.0, 0.04, 0.0, 0.12, 0.0, 0.0, 0.12])

Case = tuple[str, dict[str, Any]]
TRACKING: dict[str, Any] = {"motion": MOTION, "kp": 40.0, "kd": 20.0, "gamma": 0.2}
SPRING: dict[str, Any] = {"target": [0.5, 0.2], "stiffness": 300.0, "damping": 60.0, "frame": "link2", "axes": "xy"}
JOINTS: dict[str, Any] = {"joint_stiffness": 2000.0, "motor_inertia": 0.3, "reduced_inertia": 0.1}
NULL = al.NullSpace([0.3, -0.4], 20.0, 5.0)


def tasks(*more: al.Task) -> list[al.Task]:
    return [al.Task("link2", "x", motion=al.Sinusoid([0.4], np.array([[0.1]]), [[2.0]], [[0.0]]), gain=4.0), *more]


#: For each class: named cases with options besides the arm.
OPTIONS: dict[str, list[Case]] = {
    "Adaptive": [
        ("full gains", {"motion": MOTION, "kp": FULL, "kd": FULL / 3.0, "gamma": 0.2 * np.eye(P) + 0.01}),
        ("estimate", {**TRACKING, "estimate": 0.9 * ARM.parameters}),
        ("base", {**TRACKING, "base": ARM.base_parameters()}),
        ("natural", {**TRACKING, "natural": True, "estimate": POSSIBLE}),
        ("natural, friction", {**TRACKING, "natural": True, "friction": True, "estimate": [*POSSIBLE, *[0.1] * 4]}),
        ("projection", {**TRACKING, "projection": 0.5, "estimate": POSSIBLE}),
        ("least bodies", {**TRACKING, "projection": 0.3 * POSSIBLE, "armature": True}),
        ("friction", {**TRACKING, "friction": ["viscous", "coulomb", "stribeck"], "friction_speed": 0.3}),
        ("armature", {**TRACKING, "armature": True}),
        ("offset", {**TRACKING, "offset": True}),
        ("leakage", {**TRACKING, "leakage": 0.3, "leakage_centre": 0.8 * ARM.parameters}),
        ("e-modification", {**TRACKING, "leakage": 0.3, "leakage_form": "e"}),
        ("dead zone", {**TRACKING, "dead_zone": 0.5}),
        ("composite", {**TRACKING, "composite": 0.3, "composite_rate": 20.0, "friction": True}),
        ("concurrent", {**TRACKING, "concurrent": SAMPLES, "concurrent_weight": [0.5, 0.7]}),
    ],
    "ComputedTorque": [("full gains", {"motion": MOTION, "kp": FULL, "kd": FULL / 3.0})],
    "PDGravity": [("diagonal", {"target": [0.3, -0.4], "kp": 60.0, "kd": [15.0, 12.0]})],
    "PID": [
        ("PI-D", {"target": [0.3, -0.4], "kp": 60.0, "ki": 40.0, "kd": 15.0}),
        ("PD", {"target": MOTION, "kp": 60.0, "ki": None, "kd": 15.0, "friction": True, "friction_speed": 0.2}),
        ("limits", {"target": MOTION, "kp": FULL, "ki": FULL, "kd": FULL, "tau_max": [5.0, np.inf], "derivative_filter": 90.0}),
        ("disturbance observer", {"target": MOTION, "kp": 60.0, "ki": None, "kd": 15.0, "observer_bandwidth": 30.0}),
        (
            "nominal",
            {"target": MOTION, "kp": 60.0, "ki": 9.0, "kd": 15.0, "observer_bandwidth": [30.0, 20.0], "nominal_inertia": [0.4, 0.2]},
        ),
    ],
    "CartesianImpedance": [
        ("position", SPRING),
        ("all", {**SPRING, "target": WANDERING, "nullspace": NULL, "feedforward": [1.0, 2.0], "compensate_coupling": True, "eps": 0.05}),
        ("integral", {**SPRING, "integral_gain": 50.0, "wrench_max": 80.0, "tau_max": 30.0}),
    ],
    "ElasticImpedance": [
        ("position", {**SPRING, **JOINTS}),
        ("motors", {**SPRING, **JOINTS, "motor_damping": 0.5, "relative_damping": True}),
        ("ratio", {**SPRING, **JOINTS, "damping_ratio": 0.7, "nullspace": NULL, "feedforward": [1.0, 2.0]}),
        ("coupling", {**SPRING, **JOINTS, "target": WANDERING, "nullspace": NULL, "compensate_coupling": True, "eps": 0.05}),
        ("integral", {**SPRING, **JOINTS, "integral_gain": 50.0, "wrench_max": 80.0, "tau_max": 30.0}),
    ],
    "ElasticTracking": [
        ("ratio", {**SPRING, **JOINTS, "target": WANDERING, "damping_ratio": 0.7}),
        ("motors", {**SPRING, **JOINTS, "target": WANDERING, "motor_damping": 0.5, "relative_damping": True}),
    ],
    "JointImpedance": [
        ("ratio", {"target": [0.3, -0.4], "stiffness": 100.0, "damping": 20.0, **JOINTS, "damping_ratio": 0.7}),
        ("motors", {"target": [0.3, -0.4], "stiffness": FULL, "damping": FULL, **JOINTS, "motor_damping": 0.5, "relative_damping": True}),
    ],
    "JointTracking": [("full gains", {"motion": MOTION, "kp": FULL, "kd": FULL / 3.0, "joint_stiffness": 2000.0, "motor_inertia": 0.3})],
    "MotorPD": [
        ("online", {"target": [0.3, -0.4], "kp": 100.0, "kd": 20.0, "joint_stiffness": 2000.0, "online": True}),
        ("moving", {"target": MOTION, "kp": 100.0, "kd": 20.0, "joint_stiffness": 2000.0, "online": True}),
    ],
    "StateFeedback": [("all", {"target": [0.3, -0.4], "kp": 100.0, "kd": 20.0, "kt": 0.5, "ks": 0.01, "joint_stiffness": 2000.0})],
    "PriorityVelocity": [
        ("posture", {"tasks": tasks(al.PostureTask([-0.4], 2.0, joints=ARM.joint_names[1:])), "eps": 0.05}),
        ("centre of mass", {"tasks": tasks(al.CentreOfMassTask("y", [0.2], 3.0)), "method": "damped"}),
        ("axis", {"arm": SIX, "tasks": [al.AxisTask(SIX.tip_frame, [1.0, 0.0, 0.0], [0.0, 0.6, 0.8], 3.0)], "method": "chiaverini"}),
        ("relative", {"tasks": tasks(al.RelativeTask("link2", "link1", "y", [0.1], 3.0)), "method": "exact"}),
        ("limits of the arm", {"tasks": tasks(), "limits": True, "v_max": 1.0}),
        ("limits", {"tasks": tasks(), "v_min": -1.0, "v_max": 2.0, "q_min": -2.0, "q_max": 2.0, "a_max": 9.0, "horizon": 0.1}),
        ("bounds", {"tasks": tasks(al.Task("link2", "y", gain=3.0, upper=0.3))}),
        ("distance", {"tasks": tasks(al.DistanceTask("link2", None, 0.1))}),
    ],
    "PriorityAcceleration": [
        ("limits", {"arm": SIX, "tasks": [al.JointLimitTask(3.0), al.Task(SIX.tip_frame, "z", [0.4], 2.0)], "method": "clamp"}),
        ("posture", {"tasks": tasks(al.PostureTask([0.3, -0.4], 2.0)), "method": "damped", "eps": 0.05, "joint_damping": 3.0}),
        ("limits of the arm", {"tasks": tasks(), "limits": True, "v_max": 1.0, "tau_max": [60.0, 30.0], "horizon": 0.1}),
    ],
    "Guarded": [
        ("observed", {"law": al.Adaptive(ARM, **TRACKING), "observer": OBSERVER}),
        (
            "stop",
            {
                "law": al.ComputedTorque(ARM, MOTION, 99.0, 20.0),
                "observer": OBSERVER,
                "reaction": "stop",
                "stiffness": 60.0,
                "damping": 9.0,
            },
        ),
        ("float", {"law": al.PDGravity(ARM, [0.3, -0.4], 60.0, 9.0), "observer": OBSERVER, "reaction": "float"}),
        (
            "retract, elastic",
            {
                "law": al.MotorPD(ARM, [0.3, -0.4], 100.0, 20.0, 2000.0),
                "observer": OBSERVER,
                "reaction": "retract",
                "stiffness": 60.0,
                "damping": 9.0,
                "speed": 0.2,
                "duration": 0.4,
                "joint_stiffness": 2000.0,
            },
        ),
    ],
}
#: Cases of laws that cannot be exported, with the reason.
REFUSED: dict[str, list[tuple[str, dict[str, Any], str]]] = {
    name: [
        ("sns", {"tasks": tasks(), "method": "sns", "v_min": -1.0, "v_max": 1.0}, "scaled commands"),
        (
            "limits",
            {"tasks": tasks(), "method": "sns", "a_max": 9.0, "v_max": 1.0, "q_min": -2.0, "q_max": 2.0, "horizon": 0.1},
            "scaled commands",
        ),
    ]
    for name in ("PriorityVelocity", "PriorityAcceleration")
}


def leaves(base: type) -> Iterator[type]:
    for cls in base.__subclasses__():
        yield cls
        yield from leaves(cls)


def names(base: type) -> set[str]:
    return {cls.__name__ for cls in leaves(base) if cls.__module__.startswith("armlet")}


def law_of(name: str, options: dict[str, Any]) -> Any:
    made = getattr(al, name)
    return made(**options) if name == "Guarded" else made(**{"arm": ARM, **options})


def test_every_law_and_every_argument_is_in_the_table() -> None:
    assert names(al.Law) == set(OPTIONS)
    for name, cases in OPTIONS.items():
        arguments = set(inspect.signature(getattr(al, name)).parameters) - {"arm"}
        used = {key for _, options in cases for key in options} | {key for _, options, _ in REFUSED.get(name, []) for key in options}
        assert arguments - used == set(), name


def test_every_task_is_in_the_table() -> None:
    cases = [options for entries in (*OPTIONS.values(), *REFUSED.values()) for _, options, *_ in entries]
    used = {type(task).__name__ for options in cases for task in options.get("tasks", [])}
    assert names(al.Task) | {"Task"} == used


def timing(name: str, options: dict[str, Any]) -> dict[str, float]:
    """A guarded law needs a sample time, and limits without a horizon too. A single call of a law has the default horizon."""
    sampled = "v_max" in options and "horizon" not in options
    return {"dt": 1e-3} if name == "Guarded" else {"sample_time": 0.1} if sampled else {}


CASES = [pytest.param(name, options, id=f"{name}, {case}") for name, cases in OPTIONS.items() for case, options in cases]


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize(("name", "options"), CASES)
def test_a_law_has_the_bits_of_armlet(name: str, options: dict[str, Any], compiler: str, tmp_path: Path) -> None:
    law = law_of(name, options)
    c = Controller(
        al.export_c(law, tmp_path, **timing(name, options)),
        compiler,
    )
    elastic = "joint_stiffness" in options
    rng = np.random.default_rng(21)
    start, regular = c.state, 0
    for k in range(1000):
        t, x = rng.uniform(-0.05, 0.4), rng.uniform(-3.0, 3.0, (4, law.arm.n)) * (k > 0)
        if elastic:
            x[2] = x[0] + rng.uniform(-0.05, 0.05, N)
        c.init()
        z = {}
        if c.p:
            # The states are near the initial state, because some estimates must be physically possible.
            state = start * rng.uniform(0.9, 1.1, c.p) + (0.0 if start.any() and k % 2 else rng.uniform(-0.01, 0.01, c.p))
            c.resume(t, state)
            z["state"] = state
        motors = {"theta": x[2], "theta_dot": x[3]} if elastic else {}
        status, tau = c.status(t, *x[: 4 if elastic else 2])
        if name in ("PriorityVelocity", "PriorityAcceleration"):
            # Away from singularities, the C rounds like the compiled loop. A call of the law uses another algorithm.
            regular += status == 0
            if status == 0:
                np.testing.assert_allclose(tau, law(t, *x[:2]), rtol=1e-6, atol=1e-9, err_msg=f"state {k}")
            continue
        assert status == 0
        # At the sample of contact, a retreat uses the direction `r / max |r|`. The C has the gain of a sampled observer, and the call of
        # the law that of a continuous one. The two residuals are proportional, so the directions differ by rounding.
        slack = 1e-14 if options.get("reaction") == "retract" else 0.0
        np.testing.assert_allclose(tau, law(t, x[0], x[1], **motors, **z), rtol=slack, atol=0.0, err_msg=f"state {k}")
        regular += 1
    assert regular > 300


@pytest.mark.parametrize(
    ("name", "options", "reason"),
    [pytest.param(name, options, reason, id=f"{name}, {case}") for name, cases in REFUSED.items() for case, options, reason in cases],
)
def test_a_law_without_c_is_refused_by_name(name: str, options: dict[str, Any], reason: str, tmp_path: Path) -> None:
    with pytest.raises(al.InputError, match=f"^export_c: law has no C: .*, got {name} .*{reason}"):
        al.export_c(law_of(name, options), tmp_path / "out")
    assert not (tmp_path / "out").exists()
