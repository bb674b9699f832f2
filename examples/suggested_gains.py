"""Gains for a bandwidth
=====================

The script computes gains of a seven-axis arm for a bandwidth of 15 rad/s and a sample time, and prints the largest stable bandwidths.

``suggest_gains`` evaluates the mass matrix at configurations within the joint limits. The script also simulates one link under a sampled
controller with three bandwidths: a fraction of the largest stable one, almost the largest, and 10 % above it. The last response diverges.

Run: ``python examples/suggested_gains.py``.
"""

import warnings

import numpy as np

import armlet as al

arm = al.load_urdf(al.example_urdf("seven_axis"))
print(al.suggest_gains(arm, 15.0, sample_time=1e-4))

link = al.pendulum(0.5, 0.0)
for part in (0.3, 0.9, 1.1):
    h = 1e-2
    w = part * al.suggest_gains(link, 1.0, 1.0, h).computed_torque_limit
    g = al.suggest_gains(link, w)  # without `sample_time`, `suggest_gains` accepts unstable bandwidths
    run = al.simulate(al.RigidArm(link), al.PDGravity(link, [1.0], g.kp, g.kd), [0.0], t_end=1.0, dt=h, sample_time=h, throw=False)
    print(f"{part:.1f} of the limit, {w:5.1f} rad/s: {run.status.name}, last error {abs(run.q[-1, 0] - 1.0):.1e} rad")

with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    g = al.suggest_gains(arm, 15.0, sample_time=5e-2)
print(said[0].message if said else "no warning")
assert np.all(g.kp > 0.0)
