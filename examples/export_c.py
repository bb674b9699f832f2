"""A law as C
==========

The script writes an adaptive law of a six-axis arm as C99 code and compiles it. It calls the C function from Python with the states of a
run of armlet at its samples. Torques and estimates have equal bits.

Run: ``python examples/export_c.py [folder]``
"""

import ctypes
import shutil
import subprocess
import sys
import tempfile

import numpy as np

import armlet as al

arm = al.load_urdf(al.example_urdf("six_axis"))
motion = al.Sinusoid([0.3] * 6, [0.2] * 6, [2.0] * 6, [0.0] * 6)
law = al.Adaptive(arm, motion, kp=40.0, kd=20.0, gamma=0.05)

folder = sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp()
files = al.export_c(law, folder, dt=1e-3)
for file in files:
    print(f"{file.name:16} {file.stat().st_size / 1000:6.0f} kB")

# armlet's run of this law, sampled every millisecond.
run = al.simulate(al.RigidArm(arm), law, [0.2] * 6, t_end=0.5, dt=1e-3, sample_time=1e-3)

compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
if compiler is None:
    raise SystemExit("export_c: no C compiler is installed: expected cc, gcc or clang")
library = f"{folder}/law.so"
subprocess.run([compiler, "-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", str(files[1]), "-o", library, "-lm"], check=True)
step, init = ctypes.CDLL(library).law_step, ctypes.CDLL(library).law_init

# The C state has the torque, the estimate, the rate of the estimate, the time, and a flag of earlier calls.
n, p = 6, 60
state, tau = np.zeros(n + 2 * p + 2), np.zeros(n)
pointer = ctypes.POINTER(ctypes.c_double)
init(state.ctypes.data_as(pointer))
differences = 0
for t, q, v, expected, estimate in zip(run.t[:-1], run.q, run.v, run.tau, run.estimate, strict=False):
    status = step(state.ctypes.data_as(pointer), ctypes.c_double(t), *(x.ctypes.data_as(pointer) for x in (q, v, tau)))
    differences += status != 0 or not np.array_equal(tau, expected) or not np.array_equal(state[n : n + p], estimate)
print(f"{len(run.t) - 1} samples, {differences} that differ")
