"""Reactions to a collision
========================

An arm hits a wall that its law does not know. A momentum observer in the sampled loop detects the contact. The arm then continues, stops,
floats (its gravity is compensated) or retracts. The script prints the peak force for each reaction, and the delay of the detection in
10,000 noisy runs.

Run: ``python examples/collision_reactions.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], gravity=[0.0, -9.81])
motion = al.Quintic([1.2, -1.8], [0.4, -0.3], 1.5)
tip = arm.position(motion(0.75)[0], "link2")  # position of the tip halfway along the motion; the wall is there
wall = al.Wall("link2", tip, [-1.0, 0.0, 0.0], stiffness=2e4, damping=50.0)
plant = al.RigidArm(arm, wall=wall)
tracking = al.ComputedTorque(arm, motion, kp=400.0, kd=40.0)

# The thresholds are the absolute mean plus six standard deviations of the observer's residual, in a free motion with sensor noise.
noise = {"v": 2e-3}  # rad/s, standard deviation of each sample
sampled = al.Sampling(1e-3, noise=noise, seed=1)
observer = al.MomentumObserver(arm, 60.0)
free = al.simulate(al.RigidArm(arm), al.Guarded(tracking, observer), motion(0.0)[0], t_end=2.0, sample_time=sampled)
observer.calibrate(free.residual[100:], sigmas=6.0)
print(f"thresholds {np.round(observer.threshold, 2)} N m")

reactions = {
    "no reaction": None,
    "stop": {"reaction": "stop", "stiffness": 400.0, "damping": 30.0},
    "float": {"reaction": "float", "damping": 4.0},
    "retract": {"reaction": "retract", "stiffness": 400.0, "damping": 30.0, "speed": 1.0, "duration": 0.3},
}
runs = {}
print(f"{'reaction':12} {'detected':>9} {'joint':>5} {'peak force':>11} {'last force':>11} {'impulse':>9}")
for name, keywords in reactions.items():
    law = al.Guarded(tracking, observer, **(keywords or {}))
    run = runs[name] = al.simulate(plant, law, motion(0.0)[0], t_end=2.0, dt=1e-4, sample_time=sampled, record_every=10)
    force = run.contact_force
    touch = run.t[np.argmax(force > 0.0)]
    found = "" if run.contact is None else f"{1e3 * (run.contact.time - touch):6.0f} ms"
    joint = "" if run.contact is None else run.contact.joint + 1
    impulse = np.trapezoid(force, run.t)
    print(f"{name:12} {found:>9} {joint:>5} {force.max():9.1f} N {force[-1]:9.1f} N {impulse:6.1f} N s")

# The sampled loop runs 10,000 times with different noise. The script counts false alarms before the contact and measures the delay of the
# detection.
rows = 10_000
law = al.Guarded(tracking, observer, "stop", stiffness=400.0, damping=30.0)
start = np.tile(motion(0.0)[0], (rows, 1))
batch = al.simulate_batch(plant, law, start, t_end=1.0, dt=5e-4, sample_time=sampled, keep="final")
late = batch.contact.time - touch
alarms = late < 0.0
print(f"10,000 runs: {alarms.sum()} false alarms, delay {1e3 * np.median(late[~alarms]):.1f} ms, all within {1e3 * late.max():.1f} ms")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 6.0), layout="constrained")
    axes = figure.subplots(2, 2)
    for (name, run), colour in zip(runs.items(), ("#666666", "#0072B2", "#009E73", "#D55E00"), strict=True):
        axes[0, 0].plot(run.t, run.contact_force, color=colour, label=name)
        axes[0, 1].plot(run.t, arm.position(run.q, "link2")[:, 0] - tip[0], color=colour)
        axes[1, 0].plot(run.t, run.residual[:, 1], color=colour, linewidth=1.0)
        axes[1, 1].plot(run.t, np.linalg.norm(run.tau, axis=1), color=colour, linewidth=1.0)
    for height, label in ((-1.0, "threshold of detection"), (1.0, None)):
        axes[1, 0].axhline(height * observer.threshold[1], color="k", linestyle=":", linewidth=0.8, label=label)
    labels = ("force of the wall (N)", "tip beyond the wall (m)", "residual of joint 2 (N m)", "norm of the torque (N m)")
    for ax, label in zip(axes.flat, labels, strict=True):
        ax.set(xlabel="time (s)", ylabel=label, xlim=(0.6, 1.4))
        ax.grid(alpha=0.3)
    axes[0, 1].set_ylim(-0.13, 0.02)  # the start of the motion is left of the figure
    axes[0, 0].legend(fontsize=8)
    axes[1, 0].legend(fontsize=8, loc="lower left")
    figure.savefig(sys.argv[1], dpi=150)
