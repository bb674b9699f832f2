"""Task priority
=============

A planar arm with four revolute joints (4R) has two tasks in an order of priority. The script prints the direction of the second task that
is lost at a singularity. The figure has the joint speeds of five methods on a path through it.

Run: ``python examples/task_priority.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

LINKS = np.array([1.0, 1.0, 0.25, 0.25])  # m


def jacobians(q):
    """Position Jacobians of the tips of links 4 and 2, (2, 4) each."""
    angles = np.cumsum(q)
    columns = LINKS * np.array([-np.sin(angles), np.cos(angles)])
    return [np.stack([columns[:, j:tip].sum(axis=1) for j in range(4)], axis=1) for tip in (4, 2)]


q = np.array([0.0, 0.0, np.pi / 2, 0.0])
rounding = 8 * np.finfo(float).eps * (1 + np.abs(q).sum())  # relative rounding error of the entries of the Jacobians
asked = [np.array([1.0, 1.0]), np.array([1.0, 1.0])]  # m/s: tip of link 4 first, tip of link 2 second

print("stretched arm, q =", q)
print("diagnosis:", al.diagnose_priority(jacobians(q), rhs=asked, rounding=rounding))
sol = al.solve_priority(jacobians(q), asked, method="exact", rounding=rounding)
print("v =", sol.v, "rad/s; primary residual", sol.residuals[0], "secondary", sol.residuals[1], "m/s")

# The path goes through the algorithmic singularity q4 = 0. One call solves all configurations: Jacobians (K, 2, 4), velocities broadcast.
q4 = np.linspace(-0.3, 0.3, 601)
stacks = [jacobians([0.0, np.pi / 2, np.pi / 2, angle]) for angle in q4]
J1, J2 = (np.array(level) for level in zip(*stacks, strict=True))
conflict = [np.array([1.0, 1.0]), np.array([0.0, 0.0])]
maps = {
    "exact": {},
    "clamp": {"eps": [0.05, 0.02]},
    "damped": {"eps": [0.05, 0.02]},
    "chiaverini": {"eps": [0.05, 0.02]},
    "sns": {"v_max": 8.0},
}
paths = {method: al.solve_priority([J1, J2], conflict, method=method, **options) for method, options in maps.items()}
print("\nfor -0.3 <= q4 <= 0.3    largest |v|   largest step   largest primary residual")
for method, path in paths.items():
    speed = np.linalg.norm(path.v, axis=1)
    step = np.linalg.norm(np.diff(path.v, axis=0), axis=1)
    print(f"{method:>22}  {speed.max():12.3g}   {step.max():12.3g}   {np.abs(path.residuals[0]).max():12.1e}")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    from armlet.figures import COLOURS

    fig, ax = plt.subplots(figsize=(7, 4), layout="constrained")
    for method, path, color, line in zip(paths, paths.values(), COLOURS[:5], ("-", "-", "-", "-", "--"), strict=True):
        # The line is thick, because the line of "sns" covers it.
        width = 4.0 if method == "chiaverini" else 1.5
        ax.semilogy(q4, np.linalg.norm(path.v, axis=1), line, color=color, linewidth=width, label=method)
    ax.set(xlabel="q4 (rad)", ylabel="joint speed |v| (rad/s)", title="Five methods near an algorithmic singularity")
    ax.legend()
    fig.savefig(sys.argv[1], dpi=150)
