"""Exciting motion
===============

The script computes a periodic motion within the joint limits, from which the base parameters can be identified with small errors. These are
the combinations of inertial parameters that affect the motion. It simulates a noisy record of the motion and identifies the arm from it.

Run: ``python examples/exciting_motion.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

drawn = al.load_urdf(al.example_urdf("six_axis"))  # the file contains limits of position, speed and torque
rng = np.random.default_rng(4)
built = drawn.with_parameters(drawn.parameters * rng.uniform(0.8, 1.2, drawn.parameters.size))
noise = np.array([0.5, 0.5, 0.5, 0.1, 0.1, 0.1])  # N m

duration, samples = 10.0, 200
motion = al.exciting_motion(drawn, duration, limits={"a_max": 10.0}, noise=noise, harmonics=3, samples=samples, iterations=60)
print(motion)

# The record has twenty periods and noise on the torque. The periodic motion has a nonzero initial velocity. A real robot would first move
# from rest to this velocity.
t = np.arange(20 * samples) * (duration / samples)
q, v, a = (np.array(x) for x in zip(*(motion(time) for time in t), strict=True))
tau = built.inverse_dynamics(q, v, a) + noise * rng.normal(size=q.shape)

found = drawn.identify(q, v, a, tau, noise=noise)
true = found.base.projection @ built.parameters
guess = found.base.projection @ drawn.parameters
print(f"{found.base.count} base parameters, condition {found.condition:.0f}")
print(f"largest error as drawn {np.abs(guess - true).max():.3f}, as identified {np.abs(found.values - true).max():.4f} (SI)")

# For twenty periods, the standard deviations predicted for one period are divided by the square root of twenty.
assert np.all(np.abs(found.values - true) < 4.5 * found.deviations)
assert np.allclose(found.deviations, motion.deviations / np.sqrt(20.0), rtol=0.1)

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 4.2), layout="constrained")
    joints, values = figure.subplots(1, 2)
    one = t < duration
    for k, name in enumerate(drawn.joint_names):
        joints.plot(t[one], q[one, k], linewidth=1.2, label=name)
    joints.set(xlabel="time (s)", ylabel="joint position (rad)", title="Exciting motion: one period")
    order = np.argsort(-np.abs(guess - true))
    k = np.arange(order.size)
    values.plot(k, np.abs(guess - true)[order], "s", color="#D55E00", markersize=4, label="nominal")
    values.plot(k, np.abs(found.values - true)[order], "o", color="#0072B2", markersize=4, label="identified")
    values.plot(k, found.deviations[order], color="0.4", drawstyle="steps-mid", linewidth=1.0, label="standard deviation")
    values.set(yscale="log", xlabel="base parameter, by nominal error", ylabel="error (SI)", title="Parameters after twenty periods")
    joints.legend(fontsize=8, ncols=6, loc="upper center", bbox_to_anchor=(0.5, -0.14), handlelength=1.0, columnspacing=1.0)
    values.legend(fontsize=8)
    for ax in (joints, values):
        ax.grid(alpha=0.3)
    figure.savefig(sys.argv[1], dpi=150)
