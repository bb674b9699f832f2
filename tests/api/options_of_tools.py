"""The options of arms, solvers and planners, for the walk over optional arguments."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from options_of_laws import ARM, Q2, Q3, REAL, RNG, THREE, V2, V3
from walked_options import Case

import armlet as al

Q, V, A = (RNG.normal(size=(60, 3)) for _ in range(3))
TAU = REAL.inverse_dynamics(Q, V, A, friction=True) + 0.01 * RNG.normal(size=(60, 3))
EVEN = np.linspace(0.0, 0.59, 60)
LAW = al.Adaptive(REAL, al.Hold([0.0, 0.0, 0.0]), 40.0, 20.0, 0.05)
SINGULAR = [[[1.0, 0.2, 0.1], [1.0, 0.2001, 0.1]], [[0.0, 1.0, 0.3]]]
COMMAND = [[1.0, 3.0], [2.0]]
BAD = REAL.parameters * np.tile([1.0, 5.0, 1.0, 1.0, -0.5, 1.0, 1.0, 1.0, 1.0, 1.0], 3)
WEIGHT = np.diag([1.0, 4.0, 9.0])


def observer(**options: Any) -> Any:
    watching = al.MomentumObserver(REAL, 50.0, **options)
    return [watching.update(Q3, V3, [30.0, 2.0, 1.0], 0.01) for _ in range(3)], watching.contact if "threshold" in options else None


def solver(method: str, **options: Any) -> Any:
    options = ({"v_max": [0.9, 0.8, 0.7]} if method == "sns" else {}) | options
    return al.PrioritySolver(3, [2, 1], **({"method": method} | options)).solve(SINGULAR, COMMAND)


def solve_priority(method: str, **options: Any) -> Any:
    options = ({"v_max": [0.9, 0.8, 0.7]} if method == "sns" else {}) | options
    return al.solve_priority(SINGULAR, COMMAND, **({"method": method} | options)).v


def arm_solver(method: str, **options: Any) -> Any:
    options = ({"v_max": [0.9, 0.8, 0.7]} if method == "sns" else {}) | options
    tasks = [al.Task("link3", "xy"), al.Task("link2", "y")]
    return al.PrioritySolver.for_arm(THREE, tasks, **({"method": method} | options)).solve([0.3, 0.01, 0.01], [[1.0, 3.0], [2.0]])


def kinematics(**options: Any) -> Any:
    tasks = [al.Task("link3", "xy", [0.5, 0.4])]
    ik = al.inverse_kinematics(REAL, tasks, [1.9, 1.9, 1.9], **({"max_iterations": 20, "restarts": 5, "solutions": 3} | options))
    return ik.q, ik.status


def time_path(path: Any, **options: Any) -> Any:
    timed = al.time_path(REAL, path, **({"a_max": 3.0, "v_max": 1.0, "grid": 51} | options))
    return (timed.duration, timed(0.3)) if timed.feasible else timed.reason


def cartesian_path(kind: str, **options: Any) -> Any:
    poses = [[0.9, 0.3], [0.8, 0.6], [0.6, 0.6], [0.5, 0.5]]
    if "axes" in options:
        poses = [[x] for x, _ in poses]
    made = al.cartesian_path(THREE, poses, [0.3, 0.7, -0.5], **({"frame": "link3", "axes": "xy", "kind": kind} | options))
    return made.length, made.feasible, made.reason, [made(s) for s in np.linspace(0, 1, 31)] if made.feasible else None


def exciting(**options: Any) -> Any:
    made = al.exciting_motion(
        REAL, 4.0, **({"limits": {"q_max": 1.0, "q_min": -1.0, "v_max": 2.0}, "harmonics": 2, "iterations": 2} | options)
    )
    return made.condition, made.deviations, made(0.7)


def integrate(method: str, **options: Any) -> Any:
    own: dict[str, Any] = {"dt": 0.1} if method in ("rk4", "ros2", "euler", "semi_implicit") else {}
    own |= {"positions": 1} if method == "semi_implicit" else {}
    made = al.integrate(rate, (0.0, 1.0), [1.0, 0.3], **({"method": method} | own | options))
    return made.t, made.y, made.stats, made.dense(0.35) if made.dense is not None else None, made.t_events


def rate(t: float, y: Any, k: float = 1.0) -> Any:
    return np.asarray([y[1], -k * np.sin(y[0]) * y[0]])


def tip(t: float, y: Any, k: float = 1.0) -> float:
    return float(y[0] - 0.9)


def sparse(**options: Any) -> Any:
    return integrate("radau5", **options)


INTEGRATE = {"rtol": 1e-3, "atol": 1e-2, "dt": 0.2, "t_eval": [0.2, 0.5], "dense_output": True, "events": tip, "max_step": 0.01}
INTEGRATE |= {"jac": [[0.0, 1.0], [-1.3, 0.0]], "jac_sparsity": [[0, 1], [1, 0]], "args": (2.0,), "first_step": 1e-3, "positions": 1}


#: `rounding` describes the Jacobians, for every method.
INEXACT = {"rounding": "describes the Jacobians; clamp and damped do not use it", "v_m*+*": "the tighter bound is active"}
INEXACT |= {"rounding+eps": "the ranks are equal", "weight+rounding": "the ranks are equal", "*+v_m*": "the bounds decide"}
INEXACT |= {"scale": "no bound is met; sns always scales", "*+scale": "no bound is met; sns always scales"}
#: The arm has no limits, and a path of one coordinate has no corners.
STRAIGHT = {"limits": "the arm has no limits", "*+axes": "a path of one coordinate has no corner", "blend+arcs": "the arc has no corner"}
#: Options that describe `f`, which a caller may integrate by several methods.
OF_PROBLEM = dict.fromkeys(("jac", "jac_sparsity", "positions", "jac_sparsity+jac", "jac*+*"), "describes f, for every method")
OF_PROBLEM |= {"*tol+*": "the largest step decides", "*_step+*": "the largest step decides"}


def select(**options: Any) -> Any:
    return al.select_samples(LAW, Q, V, TAU, 10, **options)


def payload(**options: Any) -> Any:
    return REAL.with_payload("link3", 2.0, **options).parameters


def drives(**options: Any) -> Any:
    arm = REAL.with_drives(**options)
    return arm.inverse_dynamics(Q3, V3, V3, friction=True)


CASES: dict[str, Case] = {
    "MomentumObserver": Case(observer, {"friction": True, "motor_inertia": 0.4, "threshold": 0.01}),
    "select_samples a": Case(partial(select, a=A), {"t": EVEN, "window": 0.1, "held": True}),
    "select_samples t": Case(partial(select, t=EVEN, window=0.1), {"a": A, "held": True}),
    "Arm.base_parameters": Case(REAL.base_parameters, {"armature": True, "friction": True, "offset": True}),
    "Arm.identify": Case(
        partial(REAL.identify, Q, V, A, TAU), {"armature": True, "friction": True, "noise": [1.0, 2.0, 3.0], "cutoff": 0.5, "offset": True}
    ),
    "Arm.forward_dynamics": Case(
        partial(REAL.forward_dynamics, Q3, V3, [1.0, 2.0, 3.0]),
        {"wrench": [1.0, 2.0, 0.0, 0.0, 0.0, 1.0], "wrench_frame": "link2", "friction": True},
    ),
    "Arm.inverse_dynamics": Case(
        partial(REAL.inverse_dynamics, Q3, V3, V3), {"wrench": [1.0, 2.0, 0.0, 0.0, 0.0, 1.0], "wrench_frame": "link2", "friction": True}
    ),
    "Arm.forward_dynamics_derivatives": Case(partial(REAL.forward_dynamics_derivatives, Q3, V3, [1.0, 2.0, 3.0]), {"friction": True}),
    "Arm.inverse_dynamics_derivatives": Case(partial(REAL.inverse_dynamics_derivatives, Q3, V3, V3), {"friction": True}),
    "Arm.bias": Case(partial(REAL.bias, Q3, V3), {"friction": True}),
    "Arm.linearize": Case(partial(REAL.linearize, Q3, V3, [1.0, 2.0, 3.0]), {"friction": True}),
    "Arm.regressor": Case(partial(REAL.regressor, Q3, V3, V3, V3), {"armature": True, "friction": True, "offset": True}),
    "Arm.project_parameters": Case(partial(REAL.project_parameters, BAD), {"length": 0.3, "floor": 0.1}),
    "project_parameters": Case(partial(al.project_parameters, BAD[:10]), {"length": 0.3, "floor": 0.1}),
    "Arm.check_parameters": Case(REAL.check_parameters, {"pi": -REAL.parameters}),
    "Arm.with_drives": Case(drives, {"armature": [1.0] * 3, "damping": [2.0] * 3, "friction": [3.0] * 3}),
    "Arm.with_frame": Case(
        lambda **o: REAL.with_frame("tool", "link3", **o).pose(Q3, "tool"), {"xyz": [0.1, 0.2, 0.3], "rpy": [0.1, 0.2, 0.3]}
    ),
    "Arm.with_payload": Case(payload, {"com": [0.1, 0.2, 0.3], "inertia": np.eye(3)}),
    "Arm.symbolic": Case(lambda **o: str(ARM.symbolic(**o).M), {"lengths": True}),
    **{
        f"PrioritySolver {m}": Case(
            partial(solver, m),
            {"eps": 0.9, "rounding": 0.3, "weight": WEIGHT, "v_min": [-0.2] * 3, "v_max": [0.2] * 3, "scale": "direction"},
            INEXACT,
        )
        for m in ("clamp", "exact", "damped", "chiaverini", "sns")
    },
    **{
        f"solve_priority {m}": Case(
            partial(solve_priority, m),
            {"eps": 0.9, "rounding": 0.3, "weight": WEIGHT, "v_min": [-0.2] * 3, "v_max": [0.2] * 3, "scale": "direction"},
            INEXACT,
        )
        for m in ("clamp", "exact", "damped", "chiaverini", "sns")
    },
    **{
        f"PrioritySolver.for_arm {m}": Case(
            partial(arm_solver, m), {"eps": 0.9, "weight": WEIGHT, "v_min": [-0.2] * 3, "v_max": [0.2] * 3, "scale": "direction"}, INEXACT
        )
        for m in ("clamp", "exact", "damped", "chiaverini", "sns")
    },
    "diagnose_priority": Case(partial(al.diagnose_priority, SINGULAR), {"rhs": COMMAND, "rounding": 1e-2}),
    "diagnose_priority with bounds": Case(
        partial(al.diagnose_priority, SINGULAR, rhs=COMMAND, v_max=[0.9, 0.8, 0.7]),
        {"v_min": [-0.2] * 3, "v_max": [0.2] * 3},
        {"v_min*": "the commands are limited by the upper bounds"},
    ),
    "inverse_kinematics": Case(
        kinematics,
        {
            "method": "damped",
            "eps": 0.9,
            "tolerance": 10.0,
            "max_iterations": 2,
            "restarts": 0,
            "seed": 3,
            "step_max": 0.1,
            "limits": False,
            "solutions": 2,
        },
        {"*+tolerance": "the start is accepted", "seed+restarts": "without random starts the seed has no effect"},
    ),
    "inverse_kinematics exact": Case(partial(kinematics, method="exact"), {"eps": 0.9}),
    "time_path": Case(
        partial(time_path, [[0.0, 0.0, 0.0], [0.3, 0.2, 0.1], [0.5, 1.0, -0.5]]),
        {
            "tau_max": 23.0,
            "v_max": 0.2,
            "a_max": 0.5,
            "knots": [0.0, 0.2, 1.0],
            "spline": "clamped",
            "stops": [1],
            "start_speed": 0.1,
            "end_speed": 0.1,
        }
        | {"friction": True, "grid": 30, "refine": False, "samples": 40, "torque_rate": 300.0, "q_min": -0.1, "q_max": 0.1}
        | {"tip_speed": 0.1, "tip_acceleration": 0.1, "frame": "link2"},
        {"*+q_m*": "the path exceeds these limits, so it has no timing"},
    ),
    "time_path torque": Case(
        partial(time_path, [[0.0, 0.0, 0.0], [0.3, 0.2, 0.1], [0.5, 1.0, -0.5]], tau_max=60.0),
        {"friction": True, "torque_rate": 300.0, "a_max": 0.5},
    ),
    "time_path callable": Case(
        partial(time_path, lambda s: np.array([0.5 * s, s * s, -0.5 * s]), grid=6),
        {"samples": 5, "knots": [0.0, 0.2, 1.0], "stops": [1], "spline": "natural"},
    ),
    "time_path without grid": Case(partial(time_path, [[0.0, 0.0, 0.0], [0.3, 0.2, 0.1], [0.5, 1.0, -0.5]], grid=None), {"refine": False}),
    **{
        f"cartesian_path {kind}": Case(
            partial(cartesian_path, kind), {"tolerance": 1e-7, "axes": "x", "blend": 0.02, "arcs": [1], "limits": False}, STRAIGHT
        )
        for kind in ("lines", "spline")
    },
    "exciting_motion": Case(
        exciting,
        {"limits": {"q_max": 0.5, "q_min": -0.5, "v_max": 1.0}, "harmonics": 3, "samples": 50, "noise": [1.0, 2.0, 3.0], "armature": True}
        | {"friction": True, "starts": 2, "iterations": 1, "seed": 3},
        {"starts": "the first start may be the best one"},
    ),
    **{
        f"integrate {m}": Case(partial(integrate, m), INTEGRATE, OF_PROBLEM)
        for m in ("rk4", "ros2", "dopri5", "radau5", "semi_implicit", "rodas4", "euler", "dop853")
    },
    "bang_bang_time": Case(partial(al.bang_bang_time, 0.0, 1.0, 1.0, 1.0, 3.0), {"tau_min": -2.0}),
    "minimum_jerk_time": Case(partial(al.minimum_jerk_time, 0.0, 1.0, 1.0, 1.0, 3.0), {"tau_min": -2.0}),
    "trapezoid_time": Case(partial(al.trapezoid_time, 0.0, 1.0, 1.0, 1.0, 3.0), {"tau_min": -2.0, "ramp": 0.2}),
    "torque_optimal_time": Case(
        partial(al.torque_optimal_time, 0.0, 1.0, 1.0, 1.0, 3.0), {"tau_min": -2.0, "viscous": 0.2, "coulomb": 0.1}
    ),
    "smallest_reduced_inertia": Case(
        partial(al.smallest_reduced_inertia, 0.4, 800.0, 1e-3), {"damping_ratio": 0.5, "sensor_bandwidth": 50.0}
    ),
    "stiffness_limit": Case(partial(al.stiffness_limit, 1.0, 800.0, 0.1, 1.0), {"motor_damping": 3.0}),
    "suggest_gains": Case(partial(al.suggest_gains, THREE, 5.0), {"damping_ratio": 0.5, "sample_time": 1e-3}),
    "velocity_bounds": Case(partial(al.velocity_bounds, [0.5], [-1.0], [1.0], [10.0], dt=0.1), {"a_max": [0.1]}),
    "planar_arm": Case(
        lambda **o: [al.planar_arm([0.5, 0.4], **o).parameters, al.planar_arm([0.5, 0.4], **o).gravity(Q2)],
        {"masses": [1.0, 2.0], "coms": [0.1, 0.1], "inertias": [0.3, 0.4], "gravity": [1.0, 0.0]},
    ),
    "Arm.from_dh": Case(
        lambda **o: (lambda arm: [arm.pose(Q2, "link2"), arm.with_payload("link2", 1.0, com=[0.1, 0.2, 0.3]).gravity(Q2)])(
            al.Arm.from_dh([[0.1, 0.2, 0.3, 0.4], [0.2, 0.1, 0.3, 0.2]], **o)
        ),
        {"convention": "modified", "gravity": [1.0, 0.0, 0.0]},
    ),
    "Arm.from_chain": Case(
        lambda **o: al.Arm.from_chain([{"type": "R", "axis": [0, 1, 0], "phi": [1, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}], **o).gravity(
            [0.3]
        ),
        {"gravity": [1.0, 0.0, 0.0]},
    ),
    "Table": Case(lambda **o: al.Table(0.1, Q2 * np.ones((20, 2)), np.ones((20, 2)), np.ones((20, 2)), **o)(0.35), {"start": 0.1}),
    "Spline": Case(
        lambda **o: al.Spline([0.0, 0.1, 0.3, 0.4], np.outer([1.0, 2.0, 4.0, 3.0], [1.0, 1.0]), **o)(0.35),
        {"v": np.ones((4, 2)), "spline": "natural"},
    ),
    "Spline a": Case(
        lambda **o: al.Spline([0.0, 0.1, 0.3], [[1.0], [2.0], [4.0]], [[0.0], [1.0], [0.0]], **o)(0.25), {"a": np.ones((3, 1))}
    ),
    "Table.at a": Case(
        lambda **o: al.Table.at([0.0, 0.1, 0.3], [[1.0], [2.0], [4.0]], [[0.0], [1.0], [0.0]], **o)(0.25), {"a": np.ones((3, 1))}
    ),
    "Table.at": Case(
        lambda **o: al.Table.at([0.0, 0.1, 0.3, 0.4], np.outer([1.0, 2.0, 4.0, 3.0], [1.0, 1.0]), **o)(0.35),
        {"v": np.ones((4, 2)), "spline": "not-a-knot"},
    ),
    "JointStops": Case(
        lambda **o: (
            al.simulate(
                al.RigidArm(REAL, stops=al.JointStops(1e3, **o)),
                al.PDGravity(REAL, [0.5, 0.2, 0.1], 8.0, 5.0),
                [2.1, -2.1, 0.0],
                v0=V3,
                t_end=0.01,
                dt=1e-3,
                check_limits=False,
            ).q
        ),
        {"damping": 5.0, "lower": -2.05, "upper": 2.05},
    ),
    "Wall": Case(
        lambda **o: (
            al.simulate(
                al.RigidArm(ARM, wall=al.Wall("link2", [0.0, 2.0, 0.0], [0.0, 1.0, 0.0], stiffness=1e3, **o)),
                al.PDGravity(ARM, [0.5, 0.2], 8.0, 5.0),
                Q2,
                v0=V2,
                t_end=0.01,
                dt=1e-3,
            ).q
        ),
        {"damping": 5.0},
    ),
    "load_urdf": Case(
        lambda **o: (lambda arm: [arm.n, arm.gravity([0.3] * arm.n)])(al.load_urdf(al.example_urdf("six_axis"), **o)),
        {"gravity": [1.0, 0.0, 0.0], "root": "link1", "tip": "link4"},
    ),
}
