"""Methods and their work
=======================

For eight integration methods, the figure has the error of the state of a pendulum after ten seconds over the number of evaluations of its
equation, on logarithmic axes. For fixed steps the negative slope is the order of the method. For adaptive steps the tolerance determines
the error.

Run: ``python examples/methods.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

ORDERS = {"euler": 1, "semi_implicit": 1, "rk4": 4, "ros2": 2}
ADAPTIVE = ("dopri5", "dop853", "rodas4", "radau5")


def pendulum(t: float, y: list[float]) -> list[float]:
    """Rates of the angle from the downward vertical (rad) and of the angular velocity (rad/s)."""
    return [y[1], -9.81 * np.sin(y[0])]


def jacobian(t: float, y: list[float]) -> list[list[float]]:
    return [[0.0, 1.0], [-9.81 * np.cos(y[0]), 0.0]]


start = [1.0, 0.0]
right = al.integrate(pendulum, (0.0, 10.0), start, method="dop853", rtol=1e-13, atol=1e-14, lists=True).y[-1]


def work(method: str, **options: float) -> tuple[int, float]:
    """Number of evaluations, and largest error of the final state."""
    if method == "semi_implicit":
        options["positions"] = 1  # number of positions: the first component is a position, the other its rate
    jac = jacobian if method in ("ros2", "rodas4", "radau5") else None
    run = al.integrate(pendulum, (0.0, 10.0), start, method=method, jac=jac, lists=True, **options)
    return run.stats["evaluations"], float(np.abs(run.y[-1] - right).max())


steps = [0.02, 0.01, 0.005, 0.0025, 0.00125]
fixed = {method: [work(method, dt=dt) for dt in steps] for method in ORDERS}
tolerances = [1e-3, 1e-5, 1e-7, 1e-9, 1e-11]
adaptive = {method: [work(method, rtol=rtol, atol=rtol) for rtol in tolerances] for method in ADAPTIVE}

for method, order in ORDERS.items():
    (_, coarse), (_, fine) = fixed[method][-2:]
    print(f"{method:>14}: order {order}, seen {np.log2(coarse / fine):.2f}; error {fine:.1e} with steps of 1.25 ms")
for method, points in adaptive.items():
    print(f"{method:>14}: error {points[-1][1]:.1e} after {points[-1][0]} evaluations at a tolerance of 1e-11")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure, ax = plt.subplots(figsize=(7.0, 4.6), layout="constrained")
    colours = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
    for cases, line, marker in ((fixed, "--", "s"), (adaptive, "-", "o")):
        for (method, points), colour in zip(cases.items(), colours, strict=True):
            evaluations, errors = np.array(points).T
            ax.loglog(evaluations, errors, line, marker=marker, markersize=4, color=colour, label=method)
    ax.set(xlabel="evaluations of the right-hand side", ylabel="largest error after 10 s (rad, rad/s)")
    ax.set_title("Errors of eight methods for a pendulum (dashed: fixed steps)", loc="left", fontsize=10)
    ax.grid(alpha=0.3)
    ax.legend(fontsize=8, ncols=2)
    figure.savefig(sys.argv[1], dpi=150)
