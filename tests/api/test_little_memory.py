"""If memory is scarce, a large request raises a `MemoryError`, and the process continues."""

from __future__ import annotations

import subprocess
import sys

import pytest

LINKS = "arm = al.planar_arm(np.ones({n})); z = np.zeros({n})"
# For each case: the code that runs before the memory limit is set, and the call under the limit. Sizes exceed the remaining memory.
CASES = {
    "a view of many configurations": ("q = np.broadcast_to(np.zeros(2), (10**7, 2))", "arm.mass_matrix(q)"),
    "many links": ("lengths = np.ones(10**5)", "al.planar_arm(lengths)"),
    "many joints": ("joints = [{'type': 'R'}] * 10**5", "al.Arm.from_chain(joints)"),
    "many rows of a fit": ("x = np.zeros((3 * 10**6, 2))", "arm.identify(x, x, x, x)"),
    "many observed arms": ("obs = al.MomentumObserver(arm, 50.0); q = np.broadcast_to(np.zeros(2), (10**7, 2))", "obs.reset(q, q)"),
    "many wrenches": (
        "obs = al.MomentumObserver(arm, 50.0); obs.reset([0.1, 0.2], [0.0, 0.0]); q = np.broadcast_to(np.zeros(2), (10**7, 2))",
        "obs.wrench(q, 'link2')",
    ),
    "many steps": ("f = lambda t, y: y", "al.integrate(f, (0.0, 1.0), np.zeros(512), method='rk4', dt=2.0**-15)"),
    "many problems": ("x = np.broadcast_to(1.0, 10**8)", "al.bang_bang_time(0.0, x, 1.0, 1.0, 3.0)"),
    "a long motion": ("q = np.zeros(2 * 10**7)", "al.Hold(q)"),
    "many states": ("q0 = np.broadcast_to(np.zeros(2), (10**7, 2))", "al.simulate_batch(plant, law, q0, t_end=0.1, dt=1e-3)"),
    "many records": ("", "al.simulate(plant, law, [0.0, 0.0], t_end=1e3, dt=1e-4)"),
    "many stacks": ("J = np.broadcast_to(np.eye(2), (10**7, 2, 2))", "al.solve_priority([J], [[1.0, 1.0]])"),
    "a long list": ("q = [[0.0, 0.0]] * (10**7)", "arm.gravity(q)"),
    "a long quintic": ("q = np.zeros(5 * 10**6)", "al.Quintic(q, q, 1.0)"),
    "a long sinusoid": ("q = np.zeros(4 * 10**6)", "al.Sinusoid(q, 1.0, 1.0, 0.0)"),
    "a long bang-bang motion": ("q = np.zeros(5 * 10**6)", "al.BangBang(q, q, 1.0)"),
    "a long table": ("x = np.zeros((2 * 10**6, 2))", "al.Table(0.1, x, x, x)"),
    "a long motion at a time": ("hold = al.Hold(np.zeros(8 * 10**6))", "hold(0.0)"),
    "many times of a path": ("p = al.time_path(arm, [[0.0, 0.0], [1.0, 1.0]], tau_max=99.0); t = np.zeros(10**7)", "p(t)"),
    "many limits": ("x = np.broadcast_to(1.0, 10**8)", "al.stiffness_limit(1.0, 800.0, x, 20.0)"),
    "many reasons": ("b = al.bang_bang_time(0.0, np.ones(10**6), 1.0, 9.0, 1.0)", "b.reason"),
    "many levels of many rows": ("J = [np.broadcast_to(np.eye(2), (2 * 10**6, 2, 2))] * 2", "al.solve_priority(J, [[1.0, 1.0]] * 2)"),
    "many rows for an arm": (
        "s = al.PrioritySolver.for_arm(arm, [al.Task('link2', 'xy')]); q = np.broadcast_to(np.zeros(2), (10**7, 2))",
        "s.solve(q, [[1.0, 1.0]])",
    ),
    "many links of a model": (
        "text = '<robot name=\"r\">' + ''.join(f'<link name=\"l{i}\"/>' for i in range(4 * 10**5)) + '</robot>'",
        "al.load_urdf(text)",
    ),
    "many times to record": ("t = np.linspace(0.0, 1.0, 4 * 10**6)", "al.simulate(plant, law, [0.0, 0.0], t_end=1.0, dt=1e-3, t_eval=t)"),
    "many inverses": ("tau = np.broadcast_to(np.zeros(2), (10**7, 2))", "arm.forward_dynamics(tau, tau, tau)"),
    "many derivatives": ("q = np.broadcast_to(np.zeros(2), (2 * 10**6, 2))", "arm.forward_dynamics_derivatives(q, q, q)"),
    "many poses": ("q = np.broadcast_to(np.zeros(2), (2 * 10**6, 2))", "arm.pose(q, 'link2')"),
    "many Fortran rows": ("q = np.zeros((10**7, 2), order='F')", "arm.gravity(q)"),
    "many states of an equation": ("f = lambda t, y: -y; y = np.zeros(4 * 10**6)", "al.integrate(f, (0.0, 1e-3), y, method='dopri5')"),
    "many states and stages": (
        "f = lambda t, y: -y; y = np.zeros(2 * 10**6)",
        "al.integrate(f, (0.0, 1e-3), y, method='dop853', dense_output=True)",
    ),
    "many positions": (
        "f = lambda t, y: -y; y = np.zeros(4 * 10**6)",
        "al.integrate(f, (0.0, 1e-3), y, method='semi_implicit', positions=2 * 10**6, dt=1e-3)",
    ),
    "many states under scipy": (
        "from scipy.integrate import solve_ivp; f = lambda t, y: -y; y = np.zeros(2 * 10**6); method = al.scipy_method('dop853')",
        "solve_ivp(f, (0.0, 1e-3), y, method=method)",
    ),
    "a table that is copied": ("x = np.zeros((12 * 10**5, 2))", "al.Table(0.1, x, x, x)"),
    "many terms of a sinusoid": ("o, f = np.zeros(1000), np.ones((1000, 10**4))", "al.Sinusoid(o, 1.0, f, 0.0)"),
    "a loop of many links": (LINKS.format(n=5000), "al.simulate(al.RigidArm(arm), al.PDGravity(arm, z, 1.0, 1.0), z, t_end=1e-3, dt=1e-3)"),
    "loops of many links": (
        LINKS.format(n=3000) + "; q0 = np.zeros((4, 3000)); law = al.ComputedTorque(arm, al.Hold(z), 1.0, 1.0)",
        "al.simulate_batch(al.RigidArm(arm), law, q0, t_end=1e-3, dt=1e-3)",
    ),
    "steps of many links": (LINKS.format(n=5000), "al.Simulator(al.RigidArm(arm), al.PDGravity(arm, z, 1.0, 1.0), z, dt=1e-3)"),
    "a solver for many joints": ("", "al.PrioritySolver(4000, [4000])"),
    "a stack of many joints": ("J, v = np.eye(1500), np.zeros(1500)", "al.solve_priority([J], [v])"),
    "a diagnosis of many joints": ("J = np.eye(1500)", "al.diagnose_priority([J])"),
    "a search with many joints": (LINKS.format(n=3000), "al.inverse_kinematics(arm, [al.Task('link3000', 'xy', [0.1, 0.1])], z)"),
    "a law of tasks with many joints": (
        LINKS.format(n=3000),
        "al.PriorityAcceleration(arm, [al.Task('link3000', 'xy', [0.1, 0.1], 1.0)])",
    ),
    "an equilibrium of many links": (LINKS.format(n=3000), "al.equilibrium(al.RigidArm(arm), al.PDGravity(arm, z, 1.0, 1.0), q0=z)"),
    "many waypoints": ("w = np.random.default_rng(0).random((10**5, 2))", "al.time_path(arm, w, tau_max=99.0)"),
    "many last states": (
        "q0 = np.broadcast_to(np.zeros(2), (10**6, 2))",
        "al.simulate_batch(plant, law, q0, t_end=1e-3, dt=1e-3, keep='final')",
    ),
    "many adaptive runs": (
        "q0 = np.broadcast_to(np.zeros(2), (10**6, 2))",
        "al.simulate_batch(plant, law, q0, t_end=1e-3, method='dopri5', t_eval=[1e-3])",
    ),
    "a long index": ("b = al.bang_bang_time(0.0, [1.0, 2.0], 1.0, 1.0, 3.0)", "b[range(10**15)]"),
    "a long list of levels": ("", "al.PrioritySolver(4, range(10**15))"),
}

SCRIPT = """
import resource
import numpy as np
import armlet as al

arm = al.planar_arm([1.0, 1.0])
law, plant = al.PDGravity(arm, [0.5, 0.5], 1.0, 1.0), al.RigidArm(arm)
al.solve_priority([[[1.0, 0.0]]], [[1.0]])
arm.mass_matrix(np.zeros((1000, 2)))
{before}
size = next(int(line.split()[1]) * 1024 for line in open("/proc/self/status") if line.startswith("VmSize"))
resource.setrlimit(resource.RLIMIT_AS, (size + 96 * 2**20, -1))
try:
    {call}
except (MemoryError, al.InputError, TypeError) as error:
    print(type(error).__name__)
"""


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_large_request_is_an_error(case: str) -> None:
    before, call = CASES[case]
    script = SCRIPT.format(before=before, call=call)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip() == ("InputError" if "range" in call else "MemoryError")


@pytest.mark.parametrize("parent", ["k - 1", "0"], ids=["chain", "star"])
def test_twenty_thousand_joints_load(parent: str) -> None:
    """The memory for n^2 numbers, 3.2 GB, is allocated only when they are requested."""
    joint = '<link name="l{k}"/><joint name="j{k}" type="continuous"><parent link="l{parent}"/><child link="l{k}"/></joint>'
    links = f"links = ''.join('{joint}'.format(k=k, parent={parent}) for k in range(1, 20001))"
    text = f"{links}; text = '<robot><link name=\"l0\"/>' + links + '</robot>'"
    call = "arm = al.load_urdf(text); print(arm.n, np.abs(arm.gravity(np.zeros(arm.n))).max(), arm.position(np.zeros(arm.n), 'l20000'))"
    script = SCRIPT.format(before=text, call=call).replace("96 * 2**20", "512 * 2**20")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip() == "20000 0.0 [0. 0. 0.]"


def test_without_room_for_a_thread_the_caller_works() -> None:
    """Without memory for the stacks of eight threads, the caller's thread computes the same rows."""
    q0 = "q0 = np.linspace(0.0, 1.0, 128).reshape(64, 2)"
    run = "run = lambda **k: al.simulate_batch(plant, law, q0, t_end=0.1, dt=1e-2, **k).q"
    call = "print(np.array_equal(run(threads=8), once))"
    script = SCRIPT.format(before=f"{q0}; {run}; once = run(threads=1)", call=call).replace("96 * 2**20", "6 * 2**20")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip() == "True"
