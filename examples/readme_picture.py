"""The picture of the README
=========================

The picture has one result of each of four systems: adaptive tracking, task priority, elastic joints and minimum time.

Run: ``python examples/readme_picture.py [figure.png]``
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import armlet as al
from armlet.figures import COLOURS


def adaptive(ax):
    """Adaptive control: the tracking error goes to zero, although the law does not know the parameters of the robot."""
    arm = al.planar_pr(A=2.0, B=0.5, C=0.5)
    motion = al.Sinusoid(offset=[0.0, 0.3], amplitude=[0.5, 0.8], frequency=[3.0, 2.0], phase=[0.0, 0.0])
    law = al.Adaptive(arm, motion, kp=[40.0, 20.0], kd=[20.0, 10.0], gamma=5.0)
    run = al.simulate(al.RigidArm(arm), law, [0.2, -0.3], t_end=8.0, dt=1e-3)
    e = np.array([motion(t)[0] for t in run.t]) - run.q
    ax.plot(run.t, e[:, 0], color=COLOURS[0], label="$e_1$ (m)")
    ax.plot(run.t, e[:, 1], color=COLOURS[1], label="$e_2$ (rad)")
    ax.set(title="Adaptive tracking: parameters unknown", xlabel="time (s)", ylabel="tracking error (m or rad)")
    return f"adaptive: |e| = {np.abs(e[-1]).max():.1e} after 8 s"


def priority(ax):
    """Task priority: joint speeds of a planar arm near a singularity of two tasks at q4 = 0, by the methods "exact" and "clamp"."""
    arm = al.planar_arm([1.0, 1.0, 0.25, 0.25])
    q4 = np.concatenate([-np.geomspace(0.5, 1e-4, 200), np.geomspace(1e-4, 0.5, 200)])
    q = np.stack([0 * q4, 0 * q4 + np.pi / 2, 0 * q4 + np.pi / 2, q4], axis=1)
    J = [arm.jacobian(q, frame)[:, :2] for frame in ("link4", "link2")]
    asked = [np.ones((q4.size, 2)), np.zeros((q4.size, 2))]
    speeds = {}
    for i, (method, options) in enumerate((("exact", {}), ("clamp", {"eps": [0.05, 0.02]}))):
        speeds[method] = np.linalg.norm(al.solve_priority(J, asked, method=method, **options).v, axis=1)
        ax.semilogy(q4, speeds[method], color=COLOURS[i], label=f'method="{method}"')
    ax.set(title="Task priority: through a singularity", xlabel="$q_4$ (rad)", ylabel="joint speed $|v|$ (rad/s)")
    return f"priority: at most {speeds['exact'].max():.0f} rad/s exact, {speeds['clamp'].max():.0f} rad/s clamped"


def elastic(ax):
    """Elastic joints: the controller makes the tip a spring and a damper. A force moves the tip by the deflection of the spring."""
    arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0])
    K_J, B, K = np.array([800.0, 500.0]), np.array([0.4, 0.25]), np.array([300.0, 200.0])
    x_d, F = arm.position([0.3, 1.2], "link2")[:2], np.array([10.0, -15.0])
    law = al.ElasticImpedance(arm, x_d, K, [40.0, 30.0], K_J, B, B / 20, frame="link2", axes="xy")
    push = [(0.0, [0.0, 0.0]), (0.5, F), (4.5, [0.0, 0.0])]
    run = al.simulate(al.ElasticArm(arm, K_J, B), law, [0.3, 1.2], t_end=8.0, dt=5e-4, force=push)
    x = 1e3 * (arm.position(run.q, "link2")[:, :2] - x_d)
    for k, name in enumerate("xy"):
        ax.plot(run.t, x[:, k], color=COLOURS[k], label=f"${name} - {name}_d$")
        ax.plot([0.5, 4.5], [1e3 * F[k] / K[k]] * 2, color="0.3", linestyle="--", linewidth=1.0, label="$F/K$" if k else None)
    ax.set(title="Elastic joints: an impedance at the tip", xlabel="time (s)", ylabel="deflection (mm)")
    return f"elastic: deflection within {np.abs(x[np.searchsorted(run.t, 4.49)] - 1e3 * F / K).max():.2f} mm of F/K"


def minimum_time(ax):
    """Minimum time: one link moves from -90 to 90 degrees under a torque limit, by the symmetric profile and by the optimum."""
    start, end = -np.pi / 2, np.pi / 2
    profile = al.bang_bang_time(start, end, inertia=1.0, gravity_moment=1.0, tau_max=1.0)
    optimum = al.torque_optimal_time(start, end, inertia=1.0, gravity_moment=1.0, tau_max=1.0)
    motion = al.BangBang([start], [end], profile.t_min)
    rows = np.array([(q[0], v[0]) for q, v, _ in map(motion, np.linspace(0.0, profile.t_min, 400))])
    ax.plot(*rows.T, color=COLOURS[1], label=f"symmetric profile, {profile.t_min:.2f} s")
    ax.plot(*optimum.profile(np.linspace(0.0, optimum.t, 400))[:2], color=COLOURS[0], label=f"optimum, {optimum.t:.2f} s")
    ax.set(title="Minimum time: one link under gravity", xlabel=r"$\theta$ (rad)", ylabel=r"$\dot\theta$ (rad/s)")
    return f"minimum time: {profile.t_min:.4f} s by the profile, {optimum.t:.4f} s at best"


def main():
    figure, axes = plt.subplots(2, 2, figsize=(10.0, 6.2), layout="constrained")
    for ax, draw in zip(axes.flat, (adaptive, priority, elastic, minimum_time), strict=True):
        print(draw(ax))
        ax.set_title(ax.get_title(), loc="center", fontsize=11)
        ax.grid(alpha=0.3, linewidth=0.6)
        ax.spines[["top", "right"]].set_visible(False)
        ax.legend(fontsize=9, frameon=False)
    return figure


figure = main()
if len(sys.argv) > 1:
    figure.savefig(sys.argv[1], dpi=150)
