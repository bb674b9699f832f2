"""Distances, joint limits and torque limits
==========================================

An arm with seven axes moves its tip past a post and along a wall, with targets behind both. The law keeps the distance of the forearm and
of the tip from the post, and the tip on its side of the wall. Above these levels are the limits of torque, position, speed and
acceleration. The figure has the distances, and the largest torque and speed as fractions of their limits.

Run: ``python examples/distances.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.load_urdf(al.example_urdf("seven_axis"))
tip = arm.tip_frame
post = [[0.45, 0.0, 0.0], [0.45, 0.0, 1.5]]  # m: the ends of the axis of a capsule
tau_max = 0.5 * arm.limits["effort"]  # N m
q0 = np.array([-0.7, 0.5, 0.0, -1.6, 0.0, 1.2, 0.0])
start = arm.position(q0, tip)
goal = start + np.array([0.1, 0.75, 0.0])  # m: the straight way there passes through the post

keep = {"lower": 0.05, "gain": 100.0, "damping": 25.0, "other_points": post, "other_radius": 0.05}  # m, 1/s^2, 1/s, m
tasks = [
    [
        al.DistanceTask(tip, None, radius=0.04, **keep),
        al.DistanceTask("link4", None, radius=0.06, **keep),
        al.Task(tip, "y", gain=100.0, damping=25.0, upper=goal[1] - 0.1),  # the wall
    ],
    al.Task(tip, "xyz", al.Quintic(start, goal, 3.0), 60.0),
    al.PostureTask(q0, 4.0),
]
law = al.PriorityAcceleration(arm, tasks, limits=True, a_max=20.0, tau_max=tau_max)
run = al.simulate(al.RigidArm(arm), law, q0, t_end=4.0, dt=1e-3, sample_time=1e-3, record_every=10)

gaps = {
    name: np.hypot(*(arm.position(run.q, frame)[:, :2] - post[0][:2]).T) - radius - 0.05
    for name, frame, radius in (("tip to post", tip, 0.04), ("link 4 to post", "link4", 0.06))
}
gaps["tip to wall"] = goal[1] - 0.1 - arm.position(run.q, tip)[:, 1]
torque, speed = (np.abs(run.tau) / tau_max).max(axis=1), (np.abs(run.v) / arm.limits["v_max"]).max(axis=1)
for name, gap in gaps.items():
    print(f"{name}: at least {gap.min():.4f} m")
print(f"largest torque {torque.max():.2f} and speed {speed.max():.2f} of their limits")
for hold in run.active[:5]:
    print(f"{hold.name} at its {hold.side} bound holds level {hold.level} from {hold.start:.2f} s to {hold.end:.2f} s")
# A torque that is held for a sample changes the acceleration by about 1e-3 of its rate.
assert gaps["tip to post"].min() > 0.049 and gaps["link 4 to post"].min() > 0.049 and gaps["tip to wall"].min() > -1e-3
assert torque.max() <= 1.0 + 1e-9 and speed.max() < 1.001

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure, (top, bottom) = plt.subplots(2, 1, figsize=(8.0, 6.0), sharex=True, layout="constrained")
    for name, gap in gaps.items():
        top.plot(run.t, gap, label=name)
    top.axhline(0.05, color="0.5", linestyle=":")
    top.set(ylabel="distance, m")
    bottom.plot(run.t, torque, label="torque")
    bottom.plot(run.t, speed, label="speed")
    bottom.axhline(1.0, color="0.5", linestyle=":")
    bottom.set(xlabel="t, s", ylabel="largest fraction of the limit")
    for axes in (top, bottom):
        axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    figure.savefig(sys.argv[1])
