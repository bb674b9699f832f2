"""Quantities of an arm
====================

The figure has a planar arm in four poses, with two quantities of its tip. One is the ellipse of tip velocities for joint velocities of
norm one. The other is the effective mass of the tip by direction. The script also checks identities of the mass matrix, the Coriolis
matrix and inverse dynamics.

Run: ``python examples/arm_quantities.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0])  # m, kg
poses = np.array([[2.6, -0.3], [1.7, -0.9], [0.9, -1.5], [0.1, -2.3]])  # rad
J = arm.jacobian(poses, "link2")[:, :2]  # (4, 2, 2): one call for all poses
M = arm.mass_matrix(poses)
mobility = J @ np.linalg.solve(M, np.swapaxes(J, 1, 2))  # (4, 2, 2), 1/kg: the inverse of the tip's inertia

for q, jacobian, inverse in zip(poses, J, mobility, strict=True):
    sigma = np.linalg.svd(jacobian, compute_uv=False)
    heavy = 1.0 / np.linalg.eigvalsh(inverse)
    print(f"q = {q}: J stretches by {sigma[0]:.2f} and {sigma[1]:.2f} m, the tip weighs {heavy.min():.2f} to {heavy.max():.1f} kg")

rng = np.random.default_rng(1)
q, v, a, v_r = rng.uniform(-2.0, 2.0, (4, 1000, 2))
C, g, tau = arm.coriolis_matrix(q, v), arm.gravity(q), arm.inverse_dynamics(q, v, a)
rebuilt = np.einsum("kij,kj->ki", arm.mass_matrix(q), a) + np.einsum("kij,kj->ki", C, v) + g
symmetric = np.einsum("kij,kj->ki", C, v_r) - np.einsum("kij,kj->ki", arm.coriolis_matrix(q, v_r), v)
print(f"at 1,000 states: M a + C v + g is the torque to {np.abs(rebuilt - tau).max():.0e} N m,")
print(f"  C(q, v) v_r = C(q, v_r) v to {np.abs(symmetric).max():.0e}, and Y pi is the torque to", end=" ")
print(f"{np.abs(arm.regressor(q, v, v, a) @ arm.parameters - tau).max():.0e} N m")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 4.4), layout="constrained")
    drawn, weight = figure.subplots(1, 2)
    phi = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = np.stack([np.cos(phi), np.sin(phi)])
    colours = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
    for i, (pose, colour) in enumerate(zip(poses, colours, strict=True)):
        points = np.stack([np.zeros(2), *(arm.position(pose, frame)[:2] for frame in ("link1", "link2"))])
        drawn.plot(*points.T, "o-", color=colour, linewidth=2.0, markersize=4, label=f"pose {i + 1}")
        drawn.plot(*(points[-1][:, None] + 0.25 * J[i] @ circle), color=colour, linewidth=1.0)
        weight.plot(np.degrees(phi), 1.0 / np.einsum("ik,ij,jk->k", circle, mobility[i], circle), color=colour, label=f"pose {i + 1}")
    drawn.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    drawn.set_title("Ellipses: tip velocities for $|v| = 1$ rad/s, times 0.25 s", loc="left", fontsize=9)
    weight.set(xlabel="direction of the push (deg)", ylabel="effective mass at the tip (kg)", xticks=np.arange(0, 361, 60), yscale="log")
    weight.set_title("Effective mass of the tip by direction", loc="left", fontsize=9)
    for ax in (drawn, weight):
        ax.grid(alpha=0.3)
        ax.legend(fontsize=8)
    figure.savefig(sys.argv[1], dpi=150)
