"""Priorities with inequalities
============================

The macro-micro arm of the exam with a limit of the speed of joint 2. The tip is the first task, and the end of link 2 the second. The
script prints which limit stops which task along a motion. The figure has the joint velocities with and without the limit.

Run: ``python examples/inequalities.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.planar_arm([1.0, 1.0, 0.25, 0.25])  # m
limits = np.array([9.0, 0.5, 9.0, 9.0])  # rad/s
solver = al.PrioritySolver(4, [2, 2, 1], method="clamp", v_max=limits)

q4 = np.linspace(0.2, 1.2, 101)
bounded, free, changes = [], [], 0
for angle in q4:
    q = np.array([0.0, np.pi / 2, np.pi / 2, angle])
    tip, elbow = (arm.jacobian(q, frame)[:2] for frame in ("link4", "link2"))
    targets = [[1.0, 1.0], [1.0, 1.0], al.Within([-0.2], [0.2])]  # m/s, and rad/s for joint 4
    stack = [tip, elbow, np.eye(4)[3:]]
    bounded.append(solver.solve(stack, targets))
    free.append(al.solve_priority(stack[:2], targets[:2]).v)
    changes += solver.solution.changes > 0
    if angle == q4[0]:
        for k in (1, 2, 3):
            print(solver.solution.why(k))
bounded, free = np.array(bounded), np.array(free)
print(f"largest speed of joint 2: {np.abs(free[:, 1]).max():.2f} rad/s without the limit, {np.abs(bounded[:, 1]).max():.2f} with it")
print(f"the active set changed in {changes} of {len(q4)} configurations")
assert np.abs(bounded[:, 1]).max() <= 0.5

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8.0, 4.5), layout="constrained")
    for joint in range(4):
        axes.plot(q4, free[:, joint], "--", color=f"C{joint}", label=f"joint {joint + 1}, no limit")
        axes.plot(q4, bounded[:, joint], color=f"C{joint}", label=f"joint {joint + 1}, limit")
    axes.set(xlabel="q4, rad", ylabel="joint velocity, rad/s")
    axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    figure.savefig(sys.argv[1])
