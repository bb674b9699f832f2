"""The options of laws, plants and tasks, for the walk over optional arguments."""

from __future__ import annotations

from functools import partial
from typing import Any

import models
import numpy as np
from walked_options import Case

import armlet as al

ARM = models.TWO_LINKS
REAL = al.Arm.from_chain(
    [
        {"type": "R", "axis": [0, 0, 1], "phi": [1, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1], "armature": 0.3, "damping": 0.4, "friction": 0.5}
        | {"lower": -2.0, "upper": 2.0, "velocity": 3.0, "effort": 50.0, "xyz": [0.5 * k, 0, 0]}
        for k in range(3)
    ],
    gravity=[0.0, -9.81, 0.0],
)
THREE = models.THREE_LINKS
Q3, V3 = [0.3, 0.7, -0.5], [0.2, -0.1, 0.3]
Q2, V2 = [0.3, 0.9], [0.2, -0.1]
MOVING = al.Sinusoid([0.2, 0.5], 0.4, 3.0, 0.3)
RNG = np.random.default_rng(5)
K_J, B, B0 = [800.0, 500.0], [0.4, 0.25], [0.02, 0.0125]


def of_run(plant: al.Plant, law: Any, q: Any, v: Any, **keywords: Any) -> Any:
    """The series of a short run, with everything that a law may change."""
    run = al.simulate(plant, law, q, v0=v, **({"t_end": 4e-3, "dt": 1e-3, "monitors": False} | keywords))
    v = [0.0] * len(q) if v is None else v
    terms = law.terms(0.0, q, v, theta=q, theta_dot=v) if isinstance(plant, al.ElasticArm) else law.terms(0.0, q, v)
    return run, {name: np.asarray(value, dtype=object) if isinstance(value, list) else value for name, value in terms.items()}


def adaptive(**options: Any) -> Any:
    law = al.Adaptive(REAL, al.Sinusoid([0.2, 0.5, 0.1], 0.4, 3.0, 0.3), 40.0, 20.0, 0.05, **options)
    return of_run(al.RigidArm(REAL), law, Q3, V3)


def pid(**options: Any) -> Any:
    return of_run(al.RigidArm(REAL), al.PID(REAL, al.Sinusoid([0.2, 0.5, 0.1], 0.4, 3.0, 0.3), 40.0, 10.0, 20.0, **options), Q3, V3)


def impedance(**options: Any) -> Any:
    axes = options.pop("axes", "xy")
    law = al.CartesianImpedance(THREE, [0.7, 0.5][: len(axes)], 300.0, 40.0, **({"frame": "link3", "axes": axes} | options))
    return of_run(al.RigidArm(THREE), law, Q3, V3)


def elastic_impedance(**options: Any) -> Any:
    axes = options.pop("axes", "xy")
    law = al.ElasticImpedance(THREE, [0.7, 0.5][: len(axes)], 300.0, 40.0, 800.0, 0.4, 0.02, **({"frame": "link3", "axes": axes} | options))
    return of_run(al.ElasticArm(THREE, 800.0, 0.4), law, Q3, V3)


def elastic_tracking(**options: Any) -> Any:
    axes = options.pop("axes", "xy")
    target = al.Sinusoid([0.4, 0.5] + [0.3] * (axes != "xy"), 0.1, 2.0, 0.3)
    law = al.ElasticTracking(ARM, target, 300.0, 40.0, K_J, B, B0, **({"frame": "link2", "axes": axes} | options))
    return of_run(al.ElasticArm(ARM, K_J, B), law, Q2, V2)


def joint_impedance(**options: Any) -> Any:
    return of_run(al.ElasticArm(ARM, K_J, B), al.JointImpedance(ARM, [0.5, 0.2], 50.0, 5.0, K_J, B, B0, **options), Q2, V2)


def motor_pd(**options: Any) -> Any:
    return of_run(al.ElasticArm(ARM, K_J, B), al.MotorPD(ARM, [0.5, 0.2], 50.0, 5.0, K_J, **options), Q2, V2)


def tasks(**damping: Any) -> list[Any]:
    return [al.Task("link3", "x", [0.8], 2.0, **damping), al.Task("link2", "y", [0.3], 3.0, **damping)]


def priority_velocity(chosen: str, **options: Any) -> Any:
    if chosen == "sns":
        options = {"v_max": [5.0, 5.0, 5.0], "q_min": -3.0, "q_max": 3.0, **options}
    return of_run(al.VelocityArm(THREE), al.PriorityVelocity(THREE, tasks(), **({"method": chosen} | options)), Q3, None)


def priority_acceleration(chosen: str, **options: Any) -> Any:
    if chosen == "sns":
        options = {"v_max": [5.0, 5.0, 5.0], "q_min": -3.0, "q_max": 3.0, **options}
    law = al.PriorityAcceleration(THREE, tasks(damping=4.0), **({"method": chosen} | options))
    return of_run(al.RigidArm(THREE), law, Q3, V3)


def limited(kind: Any, plant: Any, **options: Any) -> Any:
    """A law of task priority for an arm with limits."""
    link = {"type": "R", "axis": [0, 0, 1], "phi": [1, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1], "xyz": [0.4, 0.0, 0.0]}
    arm = al.Arm.from_chain([link | {"lower": -1.0, "upper": 0.7, "velocity": 0.1}] * 3)
    law = kind(arm, [al.Task("link3", "x", [0.1], 20.0)], **options)
    return of_run(plant(arm), law, Q3, V3 if plant is al.RigidArm else None)


def guarded(chosen: str | None, elastic: bool = False, **options: Any) -> Any:
    inner = al.PDGravity(ARM, [0.5, 0.2], 50.0, 5.0)
    law: Any = al.MotorPD(ARM, [0.5, 0.2], 50.0, 5.0, K_J) if elastic else inner
    observer = al.MomentumObserver(ARM, 50.0, threshold=1e-3)
    given = {} if chosen is None else {"reaction": chosen, "damping": 8.0} | ({"stiffness": 30.0} if chosen != "float" else {})
    guard = al.Guarded(law, observer, **given | options)
    plant = al.ElasticArm(ARM, K_J, B) if elastic else al.RigidArm(ARM)
    run = al.simulate(
        plant, guard, Q2, v0=V2, t_end=0.02, dt=1e-3, sample_time=1e-3, monitors=False, force=[5.0, 3.0, 0.0], force_frame="link2"
    )
    return run


def velocity_task(kind: Any, *place: Any, velocity: bool = True, **options: Any) -> Any:
    """A law with one task, for a `VelocityArm` or a rigid arm."""
    options = {"gain": 2.0} | ({} if velocity else {"damping": 5.0}) | options
    if "motion" not in options and kind is not al.JointLimitTask:
        options = {"target": TARGETS[kind]} | options
    if "joints" in options:
        few = {"motion": al.Sinusoid([0.3], 0.1, 2.0, 0.3)} if "motion" in options else {"target": options["target"][:1]}
        options = options | few
    task = kind(*place, **options)
    if velocity:
        return of_run(al.VelocityArm(THREE), al.PriorityVelocity(THREE, [task]), Q3, None)
    return of_run(al.RigidArm(THREE), al.PriorityAcceleration(THREE, [task]), Q3, V3)


def distance(velocity: bool, **options: Any) -> Any:
    """A law with the distance of the tip from a point, which is below its bound."""
    task = al.DistanceTask("link3", **({"lower": 1.0, "other_points": [0.7, 0.6, 0.1]} | options))
    if velocity:
        return of_run(al.VelocityArm(THREE), al.PriorityVelocity(THREE, [task]), Q3, None)
    return of_run(al.RigidArm(THREE), al.PriorityAcceleration(THREE, [task]), Q3, V3)


TARGETS = {
    al.Task: [0.6],
    al.PostureTask: [0.4, 1.2, 0.8],
    al.AxisTask: [0.0, 1.0, 0.0],
    al.CentreOfMassTask: [0.4],
    al.RelativeTask: [0.1],
}
NULL = al.NullSpace([0.2, 0.3, 0.4], 10.0, 2.0)
FILTERED = al.ElasticImpedance(ARM, [0.7, 0.5], 300.0, 40.0, K_J, B, B0, frame="link2", axes="xy", integral_gain=5.0)
BASE = ARM.base_parameters()
#: Pairs without an effect of each method.
ONE_LIMIT = "of two limits, only the tighter one is active"
SATURATED = {"sns": {"*+*": ONE_LIMIT}}
LIMITS = {"v_min": -0.01, "v_max": 0.05, "q_min": -0.3, "q_max": 0.65, "a_max": 1.0, "horizon": 2.0}


def samples() -> al.Samples:
    law = al.Adaptive(REAL, al.Hold([0.0, 0.0, 0.0]), 40.0, 20.0, 0.05)
    q, v, a = (RNG.normal(size=(200, 3)) for _ in range(3))
    return al.select_samples(law, q, v, REAL.inverse_dynamics(q, v, a), 20, a=a)


def null_space(**options: Any) -> Any:
    return impedance(nullspace=al.NullSpace([0.2, 0.3, 0.4], 10.0, 2.0, **options))


def rigid_arm(**options: Any) -> Any:
    return of_run(al.RigidArm(REAL, **options), al.PDGravity(REAL, [0.5, 0.2, 0.1], 50.0, 5.0), Q3, V3)


def elastic_arm(**options: Any) -> Any:
    law = al.MotorPD(ARM, [0.5, 0.2], 50.0, 5.0, K_J)
    return of_run(al.ElasticArm(ARM, K_J, B, **options), law, Q2, V2, theta0=[0.32, 0.9], theta_dot0=[0.3, 0.5])


def friction(model: Any, fixed: Any, **options: Any) -> Any:
    plant = al.RigidArm(REAL, friction=model(**fixed | options))
    return [of_run(plant, al.PDGravity(REAL, [0.5, 0.7, -0.5], 15.0, 5.0), Q3, v) for v in ([0.0] * 3, V3)]


WALL = al.Wall("link2", [0.0, 2.0, 0.0], [0.0, 1.0, 0.0], stiffness=1e4)
STOPS = al.JointStops(1e3, lower=-0.2, upper=0.2)

CASES = {
    "Law.terms": Case(
        lambda **o: FILTERED.terms(0.0, Q2, V2, **{"theta": Q2, "theta_dot": V2} | o),
        {"theta": [0.31, 0.92], "theta_dot": [0.5, 0.3], "state": [3.0, 4.0]},
    ),
    "Law.terms sampled": Case(
        lambda **o: al.PriorityAcceleration(THREE, tasks(), v_max=1.0).terms(0.0, Q3, V3, **o), {"sample_time": 0.05}
    ),
    "Adaptive": Case(
        adaptive,
        {
            "estimate": 0.01 * REAL.parameters,
            "base": REAL.base_parameters(),
            "natural": True,
            "projection": 0.1,
            "friction": True,
            "armature": True,
            "offset": True,
            "friction_speed": 0.3,
            "leakage": 0.5,
            "leakage_form": "e",
            "leakage_centre": np.full(30, 0.3),
            "dead_zone": 100.0,
            "composite": 2.0,
            "composite_rate": 4.0,
            "concurrent": samples(),
            "concurrent_weight": 3.0,
        },
        {"leakage+dead_zone": "the estimate is constant in the dead zone"},
    ),
    "PID": Case(
        pid,
        {"tau_max": 0.5, "derivative_filter": 50.0, "friction": True, "friction_speed": 0.3, "observer_bandwidth": 20.0}
        | {"nominal_inertia": 0.4},
    ),
    "CartesianImpedance": Case(
        impedance,
        {"axes": "x", "nullspace": NULL, "feedforward": [300.0, 2.0], "compensate_coupling": True, "eps": 0.9, "integral_gain": 500.0}
        | {"wrench_max": [20.0, 30.0], "tau_max": 0.5},
    ),
    "ElasticImpedance": Case(
        elastic_impedance,
        {"axes": "x", "nullspace": NULL, "feedforward": [300.0, 2.0], "compensate_coupling": True, "eps": 0.9, "integral_gain": 500.0}
        | {"wrench_max": [20.0, 30.0], "tau_max": 0.5, "motor_damping": 2.0, "damping_ratio": 0.7, "relative_damping": True},
    ),
    "ElasticTracking": Case(elastic_tracking, {"axes": "x y rz", "motor_damping": 2.0, "damping_ratio": 0.7, "relative_damping": True}),
    "JointImpedance": Case(joint_impedance, {"motor_damping": 2.0, "damping_ratio": 0.7, "relative_damping": True}),
    "MotorPD": Case(motor_pd, {"online": True}),
    "NullSpace": Case(null_space, {"projection": "static"}),
    **{
        f"PriorityVelocity {method}": Case(
            partial(priority_velocity, method),
            {"eps": 0.9, **LIMITS} | ({"method": "chiaverini"} if method == "clamp" else {}),
            SATURATED.get(method, {}),
        )
        for method in ("clamp", "exact", "damped", "chiaverini", "sns")
    },
    **{
        f"PriorityAcceleration {method}": Case(
            partial(priority_acceleration, method),
            {"eps": 0.9, "joint_damping": 2.0, **LIMITS} | ({"method": "chiaverini"} if method == "clamp" else {}),
            SATURATED.get(method, {"joint_damping+*": ONE_LIMIT, "horizon+a_max": ONE_LIMIT}),
        )
        for method in ("clamp", "exact", "damped", "chiaverini", "sns")
    },
    **{
        f"{kind.__name__} limits": Case(partial(limited, kind, plant), {"limits": True, "q_max": 0.65} | more)
        for kind, plant, more in (
            (al.PriorityVelocity, al.VelocityArm, {}),
            (al.PriorityAcceleration, al.RigidArm, {"tau_max": [2.5, 1.5, 0.5]}),
        )
    },
    **{
        f"Guarded {reaction} {elastic}": Case(
            partial(guarded, reaction, elastic),
            {"stiffness": 60.0, "damping": 3.0, "speed": 0.7, "duration": 0.01, "joint_stiffness": 700.0}
            | ({"reaction": "float"} if reaction is None else {}),
        )
        for reaction in (None, "stop", "float", "retract")
        for elastic in (False, True)
    },
    **{
        f"{kind.__name__} {'velocity' if velocity else 'acceleration'}": Case(
            partial(velocity_task, kind, *place, velocity=velocity),
            options | {"gain": 3.0, "damping": 7.0, "lower": -0.1, "upper": 0.1},
            {"upper+lower": "of two bounds, only one is active"},
        )
        for kind, place, options in (
            (al.Task, ("link3", "x"), {"target": [0.3], "motion": al.Sinusoid([0.3], 0.1, 2.0, 0.3)}),
            (al.PostureTask, (), {"target": [0.3, 0.4, 0.5], "motion": al.Sinusoid([0.3] * 3, 0.1, 2.0, 0.3), "joints": ["joint1"]}),
            (al.AxisTask, ("link3", [1.0, 0.0, 0.0]), {"target": [0.6, 0.8, 0.0], "motion": al.Sinusoid([0.6, 0.8, 0.0], 0.1, 2.0, 0.3)}),
            (al.CentreOfMassTask, ("x",), {"target": [0.3], "motion": al.Sinusoid([0.3], 0.1, 2.0, 0.3)}),
            (al.RelativeTask, ("link3", "link1", "x"), {"target": [0.3], "motion": al.Sinusoid([0.3], 0.1, 2.0, 0.3)}),
        )
        for velocity in (True, False)
    },
    **{
        f"DistanceTask {'velocity' if velocity else 'acceleration'}": Case(
            partial(distance, velocity),
            {
                "other": "link1",
                "lower": 0.9,
                "upper": 0.2,
                "gain": 3.0,
                "damping": 7.0,
                "points": [[0.0, 0.1, 0.0], [-0.1, 0.0, 0.1]],
                "radius": 0.1,
                "other_points": [0.3, 0.7, 0.0],
                "other_radius": 0.05,
            },
        )
        for velocity in (True, False)
    },
    "RigidArm": Case(rigid_arm, {"friction": True, "wall": WALL, "stops": STOPS}),
    "ElasticArm": Case(elastic_arm, {"joint_damping": 3.0, "motor_friction": 0.4, "wall": WALL, "stops": STOPS}),
    "LuGre": Case(
        partial(friction, al.LuGre, {"coulomb": 2.0, "stiffness": 1e3}),
        {"damping": 5.0, "static": 4.0, "stribeck_speed": 0.05, "viscous": 0.4, "load_ratio": 0.1},
    ),
    "StickSlip": Case(
        partial(friction, al.StickSlip, {"coulomb": 2.0}),
        {"static": 4.0, "stribeck_speed": 0.3, "viscous": 0.4, "load_ratio": 0.1},
        {"static+load_ratio": "the joints slip in both cases"},
    ),
}
