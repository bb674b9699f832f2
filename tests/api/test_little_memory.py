"""With little memory a large request is a `MemoryError`, and the process lives on."""

from __future__ import annotations

import subprocess
import sys

import pytest

# What is made before the limit, and what is called under it. Sizes are above the room that is left, MiB.
CASES = {
    "a view of many configurations": ("q = np.broadcast_to(np.zeros(2), (10**7, 2))", "arm.mass_matrix(q)"),
    "many links": ("lengths = np.ones(10**5)", "al.planar_arm(lengths)"),
    "many joints": ("joints = [{'type': 'R'}] * 10**5", "al.Arm.from_chain(joints)"),
    "many rows of a fit": ("x = np.zeros((3 * 10**6, 2))", "arm.identify(x, x, x, x)"),
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


@pytest.mark.parametrize("case", CASES)
def test_a_large_request_is_an_error(case: str) -> None:
    before, call = CASES[case]
    script = SCRIPT.format(before=before, call=call)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip() == ("InputError" if "range" in call else "MemoryError")
