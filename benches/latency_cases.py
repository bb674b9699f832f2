"""Long calls of armlet that `latency.py` interrupts. `size(n)` is n times `--scale`. `call` is repeated until Ctrl-C."""

from __future__ import annotations

# Code that runs before every setup.
COMMON = """
import pickle
import warnings
import numpy as np
import armlet as al
# Random configurations leave the limits of the joints.
warnings.filterwarnings("ignore", message=".*check_limits")
rng = np.random.default_rng(0)
arm = al.load_urdf(al.example_urdf("seven_axis"))
six = al.load_urdf(al.example_urdf("six_axis"))
two = al.planar_arm([1.0, 1.0])
pr = al.planar_pr(2.0, 0.5, 0.5)
def rows(count, n=7):
    return rng.standard_normal((count, n))
def chain(links):
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    text = "".join(f'<link name="l{k}">{body}</link>' for k in range(links + 1))
    text += "".join(f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/><axis xyz="0 0 1"/></joint>'
                    for k in range(links))
    return f'<robot name="chain">{text}</robot>'
"""

# Each entry is name: (setup, call).
CASES: dict[str, tuple[str, str]] = {
    "time.sleep, without armlet: latency of machine": ("import time", "time.sleep(0.2)"),
    # Functions of an arm.
    "mass_matrix, 1e6 rows": ("q = rows(size(1e6))", "arm.mass_matrix(q)"),
    "forward_dynamics, 1e6 rows": ("q, v, tau = rows(size(1e6)), rows(size(1e6)), rows(size(1e6))", "arm.forward_dynamics(q, v, tau)"),
    "inverse_dynamics, 1e6 rows, Fortran order": ("q = np.asfortranarray(rows(size(1e6)))", "arm.inverse_dynamics(q, q, q)"),
    "inverse_dynamics, one row against 1e6": ("q = rows(size(1e6)); one = np.zeros(7)", "arm.inverse_dynamics(q, one, one)"),
    "mass_matrix, list of 3e5 lists": ("q = rows(size(3e5)).tolist()", "arm.mass_matrix(q)"),
    "pose, 1e6 rows": ("q = rows(size(1e6)); tip = arm.frame_names[-1]", "arm.pose(q, tip)"),
    "regressor, 1e5 rows": ("q = rows(size(1e5))", "arm.regressor(q, q, q, q)"),
    "coriolis_matrix, 1e6 rows": ("q = rows(size(1e6))", "arm.coriolis_matrix(q, q)"),
    "forward_dynamics_derivatives, 3e5 rows": ("q = rows(size(3e5))", "arm.forward_dynamics_derivatives(q, q, q)"),
    "inverse_dynamics_derivatives, 3e5 rows": ("q = rows(size(3e5))", "arm.inverse_dynamics_derivatives(q, q, q)"),
    "linearize, 3e5 rows": ("q = rows(size(3e5))", "arm.linearize(q, q, q)"),
    "energy, 3e6 rows": ("q = rows(size(3e6))", "arm.energy(q, q)"),
    "base_parameters": ("", "arm.base_parameters(armature=True, friction=True)"),
    "base_parameters, 40 joints": ("long = al.planar_arm(np.ones(40))", "long.base_parameters()"),
    "identify, 1e6 samples": ("q = rows(size(1e6)); tau = arm.inverse_dynamics(q, q, q)", "arm.identify(q, q, q, tau)"),
    "inverse_kinematics, out of reach": (
        "task = al.Task(arm.frame_names[-1], 'xyz', [9.0, 0.0, 0.0], 1.0)",
        "al.inverse_kinematics(arm, [task], np.zeros(7), restarts=10**6)",
    ),
    # Models.
    "load_urdf, 20,000 links": ("text = chain(size(2e4))", "al.load_urdf(text)"),
    "to_urdf, 20,000 links": ("big = al.load_urdf(chain(size(2e4)))", "big.to_urdf()"),
    "pickle of an arm of 20,000 joints": ("big = al.load_urdf(chain(size(2e4)))", "pickle.loads(pickle.dumps(big))"),
    "planar_arm, 1e5 links": ("lengths = np.ones(size(1e5))", "al.planar_arm(lengths)"),
    "Arm.from_chain, 1e5 joints": (
        "joints = [dict(type='R', axis=[0, 0, 1], xyz=[1, 0, 0], phi=np.ones(10))] * size(1e5)",
        "al.Arm.from_chain(joints)",
    ),
    "with_parameters, 1e5 joints": ("big = al.planar_arm(np.ones(size(1e5))); pi = big.parameters", "big.with_parameters(pi)"),
    "check_parameters, 1e5 joints": ("big = al.planar_arm(np.ones(size(1e5)))", "big.check_parameters()"),
    "project_parameters, 1e5 bodies": ("pi = np.tile(arm.parameters, size(1e5) // 7)", "al.project_parameters(pi)"),
    "forward_dynamics, 1e5 joints": ("big = al.planar_arm(np.ones(size(1e5))); q = np.zeros(big.n)", "big.forward_dynamics(q, q, q)"),
    "mass_matrix, 3,000 joints": ("big = al.planar_arm(np.ones(size(3e3))); q = np.zeros(big.n)", "big.mass_matrix(q)"),
    # Motions.
    "Hold(2e7)": ("q = np.zeros(size(2e7))", "al.Hold(q)"),
    "Hold(list of 3e6)": ("q = [0.0] * size(3e6)", "al.Hold(q)"),
    "Table, 3e6 rows": ("q = rows(size(3e6), 2)", "al.Table(1e-3, q, q, q)"),
    "Sinusoid, 1e6 joints": ("q = np.ones(size(1e6))", "al.Sinusoid(q, np.ones((len(q), 4)), np.ones((len(q), 4)), np.ones((len(q), 4)))"),
    "pickle of a Table of 3e6 rows": ("q = rows(size(3e6), 2); table = al.Table(1e-3, q, q, q)", "pickle.loads(pickle.dumps(table))"),
    # Plans.
    "time_path, 400 waypoints": ("path = np.cumsum(rows(400) * 0.2, axis=0)", "al.time_path(arm, path, tau_max=150.0, v_max=2.0)"),
    "time_path, 400 waypoints, torque rate": (
        "path = np.cumsum(rows(size(400)) * 0.2, axis=0)",
        "al.time_path(arm, path, tau_max=150.0, v_max=2.0, torque_rate=1e3)",
    ),
    "time_path, grid of 1e5": ("path = rows(20)", "al.time_path(arm, path, tau_max=150.0, v_max=2.0, grid=max(200, size(1e5)))"),
    "TimedPath at 1e6 times": (
        "path = rows(20); p = al.time_path(arm, path, tau_max=150.0, v_max=2.0); t = np.linspace(0, p.duration, size(1e6))",
        "p(t)",
    ),
    "torque_optimal_time, friction, ends 3e5 rad apart": ("", "al.torque_optimal_time(0.0, 3e5, 1.0, 1.0, 1.5, viscous=1e-3, coulomb=0.1)"),
    "torque_optimal_time, ends 1e9 rad apart": ("", "al.torque_optimal_time(0.0, 1e9, 1.0, 1.0, 1.001)"),
    "bang_bang_time, 3e6 problems": ("goal = rng.uniform(0.1, 3.0, size(3e6))", "al.bang_bang_time(0.0, goal, 1.0, 1.0, 3.0)"),
    "bang_bang_time, 1e7 equal problems": ("goal = np.broadcast_to(1.0, size(1e7))", "al.bang_bang_time(0.0, goal, 1.0, 1.0, 3.0)"),
    "pickle of a BangBangBatch of 3e6": (
        "batch = al.bang_bang_time(0.0, rng.uniform(0.1, 3.0, size(3e6)), 1.0, 1.0, 3.0)",
        "pickle.loads(pickle.dumps(batch))",
    ),
    "bang_bang_time, reasons of 1e5": ("batch = al.bang_bang_time(0.0, rng.uniform(0.1, 3.0, size(1e5)), 1.0, 1.0, 0.9)", "batch.reason"),
    "torque profile at 1e6 times": (
        "o = al.torque_optimal_time(0.0, 1.0, 1.0, 1.0, 3.0, viscous=0.1); t = np.linspace(0.0, o.t, size(1e6))",
        "o.profile(t)",
    ),
    # Task priority.
    "solve_priority, 3e5 stacks": (
        "J, v = rng.standard_normal((size(3e5), 3, 7)), rows(size(3e5), 3)",
        "al.solve_priority([J, J], [v, v])",
    ),
    "solve_priority, sns, 3e4 stacks": (
        "J, v = rng.standard_normal((size(3e4), 3, 7)), rows(size(3e4), 3)",
        "al.solve_priority([J, J[::-1].copy()], [v, v], method='sns', v_min=-1.0, v_max=1.0)",
    ),
    "PrioritySolver.for_arm, 3e5 rows": (
        "tip = arm.frame_names[-1]; s = al.PrioritySolver.for_arm(arm, [al.Task(tip, 'xyz')])\nq, v = rows(size(3e5)), rows(size(3e5), 3)",
        "s.solve(q, [v])",
    ),
    # Simulated loops.
    "simulate, rk4, 1e6 records": (
        "law = al.PDGravity(two, [0.5, 0.5], 50.0, 20.0); plant = al.RigidArm(two)",
        "al.simulate(plant, law, [0.0, 0.0], t_end=size(1e6) * 1e-3, dt=1e-3)",
    ),
    "simulate, dop853, tight": (
        "law = al.PDGravity(arm, np.zeros(7), 50.0, 20.0); plant = al.RigidArm(arm)",
        "al.simulate(plant, law, np.ones(7) * 0.3, t_end=1000.0, method='dop853', rtol=1e-12)",
    ),
    "simulate, Python law, 1e7 records": (
        "plant = al.RigidArm(pr)",
        "al.simulate(plant, lambda t, q, v: (0.0, 0.0), [0.0, 0.0], t_end=size(1e7) * 1e-3, dt=1e-3, sample_time=1e-3)",
    ),
    "simulate_batch, 1,024 runs, all kept": (
        "law = al.PDGravity(two, [0.5, 0.5], 50.0, 20.0); plant = al.RigidArm(two); q0 = rows(max(8, size(1024)), 2)",
        "al.simulate_batch(plant, law, q0, t_end=3.0, dt=1e-3)",
    ),
    "simulate_batch, metrics": (
        "law = al.PDGravity(two, [0.5, 0.5], 50.0, 20.0); plant = al.RigidArm(two); q0 = rows(max(8, size(1024)), 2)",
        "al.simulate_batch(plant, law, q0, t_end=3.0, dt=1e-3, keep='metrics')",
    ),
    "metrics of a run of 1e6 records": (
        "law = al.PDGravity(two, [0.5, 0.5], 50.0, 20.0); plant = al.RigidArm(two)\n"
        "run = al.simulate(plant, law, [0.0, 0.0], t_end=size(1e6) * 1e-3, dt=1e-3)",
        "run.metrics()",
    ),
    "integrate, Python function": ("", "al.integrate(lambda t, y: -y, (0.0, 1e4), [1.0], method='dopri5', rtol=1e-10)"),
    "integrate, rk4, 3e6 steps": ("", "al.integrate(lambda t, y: -y, (0.0, size(3e6) * 1e-3), [1.0], method='rk4', dt=1e-3)"),
    "equilibrium": (
        "K = np.full(7, 1e4); plant = al.ElasticArm(arm, K, np.full(7, 0.1)); tip = arm.frame_names[-1]\n"
        "law = al.CartesianImpedance(arm, [9.0, 0.0, 0.0], 500.0, 50.0, frame=tip); rigid = al.RigidArm(arm)",
        "al.equilibrium(rigid, law, q0=np.full(7, 0.3))",
    ),
    "elastic_limits": (
        "K = np.full(7, 1e4); plant = al.ElasticArm(arm, K, np.full(7, 0.1)); tip = arm.frame_names[-1]\n"
        "law = al.ElasticImpedance(arm, [0.3, 0.2, 0.5], 500.0, 50.0, K, np.full(7, 0.1), np.full(7, 0.05), frame=tip)",
        "al.elastic_limits(plant, law, q0=np.full(7, 0.3))",
    ),
    "stiffness_limit, 3e6 numbers": ("d = rng.uniform(1.0, 9.0, size(3e6))", "al.stiffness_limit(1.0, 800.0, 0.02, d)"),
    "smallest_reduced_inertia, 3e4 numbers": ("b = rng.uniform(0.1, 1.0, size(3e4))", "al.smallest_reduced_inertia(b, 1e4, 1e-3)"),
}
