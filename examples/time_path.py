"""Timing of a path
================

The script computes the fastest motion of a seven-axis arm along a path, within limits of torques and joint speeds.

Run: ``python examples/time_path.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.load_urdf(al.example_urdf("seven_axis"))
waypoints = np.array(
    [
        [0.0, -0.4, 0.0, -1.8, 0.0, 1.6, 0.0],
        [0.6, 0.1, 0.2, -1.2, 0.4, 1.2, 0.5],
        [1.1, -0.2, -0.3, -1.6, -0.2, 1.9, -0.4],
    ]
)
tau_max = np.array([174.0, 174.0, 174.0, 174.0, 24.0, 24.0, 24.0])  # N m
p = al.time_path(arm, waypoints, tau_max=tau_max, v_max=2.2)
print(f"{p.duration:.4f} s on {len(p.s)} grid points; smallest margin {p.margin:.1e}")

t = np.linspace(0.0, p.duration, 2001)
q, v, a = p(t)
load = np.abs(arm.inverse_dynamics(q, v, a)) / tau_max
print("largest torque over its limit, joint by joint:", np.round(load.max(axis=0), 4))
print("largest speed over its limit, joint by joint: ", np.round(np.abs(v).max(axis=0) / 2.2, 4))
print(f"some limit is reached {np.mean(np.maximum(load, np.abs(v) / 2.2).max(axis=1) > 0.999):.0%} of the time")

stopped = al.time_path(arm, waypoints, tau_max=tau_max, v_max=2.2, stops=[1])
print(f"with a stop half way: {stopped.duration:.4f} s")

weak = al.time_path(arm, waypoints, tau_max=tau_max * np.array([1.0, 0.05, 1.0, 1.0, 1.0, 1.0, 1.0]))
print("with a weak shoulder:", weak.reason)

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    from armlet.figures import COLOURS

    figure, (above, middle, below) = plt.subplots(3, 1, figsize=(7.0, 7.0), sharex=True, layout="constrained")
    torque = arm.inverse_dynamics(q, v, a) / tau_max
    for joint, color in enumerate(COLOURS[: arm.n]):
        above.plot(t, torque[:, joint], color=color, label=f"joint {joint + 1}")
        middle.plot(t, v[:, joint] / 2.2, color=color)
    above.set(ylabel="torque / torque limit")
    above.legend(ncols=4, fontsize=8, loc="lower center")
    middle.set(ylabel="joint speed / limit")
    below.plot(p.t, p.s_dot, color=COLOURS[0])
    below.set(xlabel="time (s)", ylabel="path speed (1/s)", ylim=(0.0, None))
    for ax in (above, middle):
        ax.hlines([-1.0, 1.0], 0.0, p.duration, color="0.4", linestyle="--", linewidth=0.8)
    for ax in (above, middle, below):
        ax.grid(alpha=0.3)
    figure.savefig(sys.argv[1], dpi=150)
