"""Integration
===========

Integrate a right-hand side of your own: a ball that bounces, and a stiff reaction beside scipy.

Run: ``python examples/integrate_callable.py``
"""

import math
import time

import armlet as al

g, restitution = 9.81, 0.8  # m/s^2, speed after over before


def fall(t: float, y: list[float]) -> list[float]:
    """Height and velocity of a ball."""
    return [y[1], -g]


def floor(t: float, y: list[float]) -> float:
    return y[0]


floor.direction = -1
floor.terminal = 1

# Events end a run; the state jumps; the next run begins there.
t, state, bounces = 0.0, [1.0, 0.0], []
while len(bounces) < 5:
    run = al.integrate(fall, (t, 60.0), state, events=floor, lists=True)
    t, state = run.ended, [0.0, -restitution * run.y[-1, 1]]
    bounces.append(t)
first = math.sqrt(2.0 / g)
exact = [first * (1.0 + 2.0 * sum(restitution**k for k in range(1, n + 1))) for n in range(5)]
print("bounces at", ", ".join(f"{t:.6f}" for t in bounces), "s")
print(f"  largest error {max(abs(a - b) for a, b in zip(bounces, exact, strict=True)):.1e} s")


def robertson(t: float, y: list[float]) -> list[float]:
    a, b, c = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
    return [b - a, a - b - c, c]


for method in ("radau5", "rodas4"):
    began = time.perf_counter()
    run = al.integrate(robertson, (0.0, 1e4), [1.0, 0.0, 0.0], method=method, rtol=1e-6, atol=1e-10, lists=True)
    elapsed = 1e3 * (time.perf_counter() - began)
    mass = abs(run.y[-1].sum() - 1.0)
    print(f"{method}: {run.stats['steps']} steps, {run.stats['jacobians']} Jacobians, mass off by {mass:.0e}, {elapsed:.1f} ms")
