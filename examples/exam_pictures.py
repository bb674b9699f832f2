"""Pictures of the exam
====================

The script draws pictures of a written exam in robotics (docs/exam.md). They are the robot of exercise 1, with a prismatic and a revolute
joint, and figures 2 and 4 of exercise 4. These figures have position, speed and acceleration of the symmetric motion of a link under
gravity, and its inertial torque and gravity torque over time. The two torques have opposite signs.

Run: ``python examples/exam_pictures.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.planar_pr(A=2.0, B=0.5, C=0.5)
q = np.array([0.3, 0.8])
print("C_1 =", (arm.christoffel(q)[0] + 0.0).tolist(), "at q2 = 0.8 rad")

G = 1.5
r = al.bang_bang_time(-np.pi / 2, np.pi / 2, 1.0, G, 1.0)
motion = al.BangBang([-np.pi / 2], [np.pi / 2], r.t_min)
largest = max(motion(t)[2][0] * G * np.sin(motion(t)[0][0]) for t in np.linspace(0.0, 0.999 * r.t_min, 999))
print(f"T = {r.t_min:.3f} s; inertial torque times gravity is at most {largest:.1e}: they oppose each other")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    from armlet.demo import pictures

    figure = plt.figure(figsize=(12.0, 5.0), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[2, 3])
    pictures.pr_robot(left.subplots())
    pictures.exam_figures(right, G)
    figure.savefig(sys.argv[1], dpi=150)
