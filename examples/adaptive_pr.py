"""Adaptive tracking
=================

An adaptive law tracks a motion of a robot with a prismatic and a revolute joint (PR). The law does not know the inertial parameters of the
robot. The tracking error goes to zero.

Run: ``python examples/adaptive_pr.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.planar_pr(A=2.0, B=0.5, C=0.5)  # kg, kg m, kg m^2: the plant uses these values, the law does not know them
motion = al.Sinusoid(
    offset=[0.0, 0.3],  # m, rad
    amplitude=[[0.5, 0.2], [0.8, 0.3]],
    frequency=[[1.0, 2.3], [1.7, 0.6]],  # rad/s
    phase=[[0.0, 0.4], [0.0, 1.0]],
)
law = al.Adaptive(arm, motion, kp=[40.0, 20.0], kd=[20.0, 10.0], gamma=5.0)  # the estimate starts at zero
run = al.simulate(al.RigidArm(arm), law, [0.2, -0.3], t_end=40.0, dt=1e-3, method="rk4", record_every=10)

q_d = np.array([motion(t)[0] for t in run.t])
print(run)
print("largest error in the last second:", np.abs(q_d - run.q)[run.t > 39.0].max(axis=0), "(m, rad)")
print("estimate of (A, B, C) at the end:", run.estimate[-1], "true:", arm.parameters)
print("V1 at the start and at the end:  ", run.monitors["lyapunov"][[0, -1]], "J")

if len(sys.argv) > 1:
    axes = run.plot()
    axes[0, 0].figure.savefig(sys.argv[1], dpi=150)
