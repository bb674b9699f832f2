"""Integration
===========

``al.integrate`` integrates any right-hand side. The examples are a ball that bounces, and a stiff chemical reaction by two methods.

Run: ``python examples/integrate_callable.py [figure.png]``
"""

import math
import sys
import time

import armlet as al

g, restitution = 9.81, 0.8  # m/s^2; ratio of the speeds after and before an impact


def fall(t: float, y: list[float]) -> list[float]:
    """Rates of height (m) and velocity (m/s) of a ball in free fall."""
    return [y[1], -g]


def floor(t: float, y: list[float]) -> float:
    return y[0]


floor.direction = -1
floor.terminal = 1

# Each impact is an event that ends a run. The velocity is reversed, and the next run starts at this state.
t, state, bounces, arcs = 0.0, [1.0, 0.0], [], []
while len(bounces) < 5:
    run = al.integrate(fall, (t, 60.0), state, events=floor, lists=True, dense_output=True)
    arcs.append(run)
    t, state = run.ended, [0.0, -restitution * run.y[-1, 1]]
    bounces.append(t)
first = math.sqrt(2.0 / g)
exact = [first * (1.0 + 2.0 * sum(restitution**k for k in range(1, n + 1))) for n in range(5)]
print("bounces at", ", ".join(f"{t:.6f}" for t in bounces), "s")
print(f"  largest error {max(abs(a - b) for a, b in zip(bounces, exact, strict=True)):.1e} s")


def robertson(t: float, y: list[float]) -> list[float]:
    a, b, c = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
    return [b - a, a - b - c, c]


reactions = {}
for method in ("radau5", "rodas4"):
    began = time.perf_counter()
    run = al.integrate(robertson, (0.0, 1e4), [1.0, 0.0, 0.0], method=method, rtol=1e-6, atol=1e-10, lists=True)
    reactions[method] = run
    elapsed = 1e3 * (time.perf_counter() - began)
    mass = abs(run.y[-1].sum() - 1.0)
    print(f"{method}: {run.stats['steps']} steps, {run.stats['jacobians']} Jacobians, mass off by {mass:.0e}, {elapsed:.1f} ms")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt
    import numpy as np

    figure = plt.figure(figsize=(9.0, 3.6), layout="constrained")
    ball, reaction = figure.subplots(1, 2)
    for arc in arcs:
        at = np.linspace(arc.t[0], arc.ended, 100)
        ball.plot(at, arc.dense(at)[:, 0], color="#0072B2")
    ball.plot(bounces, np.zeros(len(bounces)), "o", color="#D55E00", markersize=5, label="located events")
    ball.set(xlabel="time (s)", ylabel="height (m)")
    ball.legend()
    for i, (scale, colour) in enumerate(((1.0, "#0072B2"), (1e4, "#D55E00"), (1.0, "#009E73"))):
        run = reactions["radau5"]
        reaction.plot(
            run.t[1:], scale * run.y[1:, i], ".-", color=colour, label=f"$y_{i + 1}$" + (r" $\times 10^4$" if scale > 1.0 else "")
        )
    reaction.set(xscale="log", xlabel="time (s)", ylabel="concentration (1)")
    reaction.set_title(f"Robertson's reaction: {reactions['radau5'].stats['steps']} steps over eight decades", loc="left", fontsize=10)
    reaction.legend()
    for ax in (ball, reaction):
        ax.grid(alpha=0.3)
    figure.savefig(sys.argv[1], dpi=150)
