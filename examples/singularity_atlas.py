"""A singularity atlas
===================

The figure has the singularities of a planar arm with four revolute joints (4R) and two tasks. It also has the joint speeds of five methods
of task priority on a path through them.

The level sets over the angles of joints 2 and 4 are those of three functions. They are det J_E = L^4/16 sin q2 sin q4, and the smallest
singular values of J1 and of J2 P1. J1 and J2 are the Jacobians of the tasks, J_E has the rows of both, P1 projects on the null space of J1,
and the links have the lengths L, L, L/4 and L/4. The path is that of a closed loop through q4 = 0, where the two tasks conflict
(algorithmic singularity).

Run: ``python examples/singularity_atlas.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

L, EPS = 1.0, [0.05, 0.02]
arm = al.planar_arm([L, L, L / 4, L / 4])
frames = ["link4", "link2"]
tasks = [al.Task(frame, "xy") for frame in frames]
solver = al.PrioritySolver.for_arm(arm, tasks, method="exact")


def smallest(q):
    """det J_E, and the smallest singular values of J1 and of J2 P1, for `q` (..., 4)."""
    J1, J2 = (arm.jacobian(q, frame)[..., :2, :] for frame in frames)
    determinant = np.linalg.det(np.concatenate([J1, J2], axis=-2))
    null = np.linalg.svd(J1)[2][..., 2:, :]  # rows: an orthonormal basis of the null space of J1
    projected = np.linalg.svd(J2 @ null.swapaxes(-1, -2), compute_uv=False)
    return determinant, np.linalg.svd(J1, compute_uv=False)[..., -1], projected[..., -1]


angles = np.linspace(-np.pi, np.pi, 121)
q2, q4 = np.meshgrid(angles, angles, indexing="ij")
grid = np.stack([0 * q2, q2, 0 * q2 + np.pi / 2, q4], axis=-1)
determinant, sigma1, sigma2 = smallest(grid)
print("det J_E against L^4/16 sin q2 sin q4, largest difference:", f"{np.abs(determinant - L**4 / 16 * np.sin(q2) * np.sin(q4)).max():.1e}")
for q in ([0, np.pi / 2, np.pi / 2, 0.3], [0, np.pi / 2, np.pi / 2, 0], [0, 0, np.pi / 2, 0.3], [0, 0, np.pi / 2, 0]):
    print(f"q = {np.round(q, 3)}: {solver.diagnose(q)}")

# A straight line in joint space through q4 = 0 defines the desired motion of both tips.
middle, half = np.array([0.2, 1.2, 1.4, 0.0]), np.array([0.3, 0.4, 0.2, 0.7])
rate, shares = 2 * half / 2.0, np.linspace(-1, 1, 401)
line = middle + shares[:, None] * half


def tip(frame):
    J, J_dot = arm.jacobian(line, frame)[:, :2], arm.jacobian_dot(line, np.broadcast_to(rate, line.shape), frame)[:, :2]
    # The target of the second task is shifted by 5 cm, so that both tasks conflict at the singularity.
    shift = 0.05 if frame == "link2" else 0.0
    return al.Table(2.0 / 400, arm.position(line, frame)[:, :2] + shift, J @ rate, J_dot @ rate)


follow = [al.Task(frame, "xy", tip(frame), 10.0) for frame in frames]
runs = {}
print("\nalong the path     largest |u|   largest step of u   largest primary residual   last |e1|    last |e2|")
for method, options in {
    "exact": {},
    "clamp": {"eps": EPS},
    "damped": {"eps": EPS},
    "chiaverini": {"eps": EPS},
    "sns": {"v_max": 8.0},
}.items():
    law = al.PriorityVelocity(arm, follow, method, **options)
    run = al.simulate(al.VelocityArm(arm), law, line[0], t_end=2.0, dt=2e-3, sample_time=2e-3, throw=False)
    runs[method] = run
    speed, step = np.linalg.norm(run.v, axis=1), np.linalg.norm(np.diff(run.v, axis=0), axis=1)
    residual = np.abs(run.monitors["residual_1"]).max()
    print(f"{method:>14}  {speed.max():14.3g}  {step.max():18.3g}  {residual:25.1e}", end="")
    print(f"  {run.monitors['error_1'][-1]:10.1e}  {run.monitors['error_2'][-1]:11.1e}")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    from armlet.figures import COLOURS

    fig, axes = plt.subplots(2, 2, figsize=(10, 8), layout="constrained")
    maps = [
        (r"$\det J_E$ (m$^4$)", determinant),
        (r"smallest $\sigma$ of $J_1$ (m)", sigma1),
        (r"smallest $\sigma$ of $J_2 P_1$ (m)", sigma2),
    ]
    for ax, (title, values) in zip(axes.flat, maps, strict=False):
        drawn = ax.contourf(q2, q4, values, 14, cmap="RdBu" if values.min() < 0 else "viridis")
        fig.colorbar(drawn, ax=ax)
        ax.plot(runs["clamp"].q[:, 1], runs["clamp"].q[:, 3], "w-", linewidth=2.5)
        ax.plot(runs["clamp"].q[:, 1], runs["clamp"].q[:, 3], "k--", linewidth=1.2)
        ax.set(title=title, xlabel="q2 (rad)", ylabel="q4 (rad)")
    for method, run, color, line in zip(runs, runs.values(), COLOURS[:5], ("-", "-", "--", "-", ":"), strict=True):
        axes[1, 1].semilogy(run.t, np.linalg.norm(run.v, axis=1), line, color=color, label=method)
    axes[1, 1].set(title="Joint speed of five methods along the path", xlabel="time (s)", ylabel="joint speed |v| (rad/s)")
    axes[1, 1].legend(loc="upper left", ncols=2, fontsize=8)
    axes[1, 1].set_ylim(top=1e5)
    fig.savefig(sys.argv[1], dpi=120)
