"""Identification
==============

From a noisy record of the motion of a six-axis arm, the script identifies the base parameters with their standard deviations. These are the
combinations of inertial parameters that affect the motion. Then it computes a physically possible robot near these parameters.

Run: ``python examples/identification.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

# `drawn` is the nominal model. `built` takes the place of the real arm: each of its parameters differs by up to 20 %.
drawn = al.load_urdf(al.example_urdf("six_axis"))
rng = np.random.default_rng(4)
built = drawn.with_parameters(drawn.parameters * rng.uniform(0.8, 1.2, drawn.parameters.size))

# The record is twenty seconds of sinusoidal motion, with noise on the torque.
t = np.linspace(0.0, 20.0, 2001)[:, None]
w = np.array([0.9, 1.3, 1.7, 2.1, 2.6, 3.1])
q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
noise = np.array([0.5, 0.5, 0.5, 0.1, 0.1, 0.1])
tau = built.inverse_dynamics(q, v, a) + noise * rng.normal(size=q.shape)

found = drawn.identify(q, v, a, tau, noise=noise)  # rotor inertias are known and equal in both models
true = found.base.projection @ built.parameters
print(f"{found.base.count} base parameters of {len(found.base.names)}, condition {found.condition:.0f}")
print(f"{'true':>10} {'found':>10} {'deviation':>10}  parameter")
for k in np.argsort(-np.abs(true))[:8]:
    print(f"{true[k]:10.4f} {found.values[k]:10.4f} {found.deviations[k]:10.1e}  {found.base.grouping[k]}")

# Each error must be below 4.5 standard deviations.
assert np.all(np.abs(found.values - true) < 4.5 * found.deviations)

# The projected parameters are physically possible. They must fit the record better than the nominal model.
possible = drawn.with_parameters(drawn.project_parameters(found.arm.parameters))
assert possible.check_parameters()
residual = {}
for name, arm in (("nominal", drawn), ("identified", found.arm), ("consistent", possible)):
    residual[name] = off = np.sqrt(np.mean((arm.inverse_dynamics(q, v, a) - tau) ** 2, axis=0))
    print(f"{name:>20}: torque off by " + ", ".join(f"{x:.2f}" for x in off) + " N m")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 4.2), layout="constrained")
    values, torques = figure.subplots(1, 2)
    order = np.argsort(-np.abs(true))
    guess = found.base.projection @ drawn.parameters
    k = np.arange(order.size)
    values.plot(k, np.abs(guess - true)[order], "s", color="#D55E00", markersize=4, label="nominal (zeros not shown)")
    values.plot(k, np.abs(found.values - true)[order], "o", color="#0072B2", markersize=4, label="identified")
    values.plot(k, found.deviations[order], color="0.4", drawstyle="steps-mid", linewidth=1.0, label="standard deviation")
    values.set(yscale="log", xlabel="base parameter, the largest first", ylabel="error of the parameter (SI)")
    for i, (name, off) in enumerate(residual.items()):
        style = {"color": ("#D55E00", "#0072B2", "#009E73")[i], "marker": "so^"[i], "markersize": 5, "linestyle": "none"}
        torques.plot(np.arange(1, 7) + 0.2 * (i - 1), off, label=name, **style)
    for joint, level in enumerate(noise, 1):
        torques.plot([joint - 0.45, joint + 0.45], [level, level], color="0.2", linewidth=1.2, label="noise" if joint == 1 else None)
    torques.set(yscale="log", xlabel="joint", ylabel="rms torque error (N m)")
    for ax in (values, torques):
        ax.grid(alpha=0.3)
        ax.legend(fontsize=8)
    figure.savefig(sys.argv[1], dpi=150)
