"""Minimum time
============

One link moves under gravity and a torque limit. The script computes the feasible durations of a symmetric bang-bang profile, and the
fastest motion within the torque limit.

Run: ``python examples/minimum_time.py [figure.png]``
"""

import math
import sys

import numpy as np

import armlet as al
from armlet.figures.minimum_time import MinimumTime

inertia, gravity_moment, tau_max = 0.1, 1.5, 1.0  # kg m^2, N m, N m: the limit cannot hold the link at the horizontal
start, end = -math.pi / 2, math.pi / 2  # rad from the downward vertical

r = al.bang_bang_time(start, end, inertia, gravity_moment, tau_max)
print(f"symmetric profile: {r.t_min:.4f} s at the fastest, {r.t_max:.4f} s at the slowest")
print(f"  the fastest is decided by {r.active_upper.limit} in {r.active_upper}, at {r.active_upper.theta:.4f} rad")
print(f"  the torque holds the link at the start: {r.hold_start}, at the end: {r.hold_end}")

o = al.torque_optimal_time(start, end, inertia, gravity_moment, tau_max)
print(f"optimum: {o.t:.4f} s, {r.t_min / o.t:.4f} times faster; the torque switches at {o.theta_switch:.4f} rad, {o.t_switch:.4f} s")
print(f"  the best of the families is {o.best.kind}; certified as the global optimum: {o.certified_global}")

# One call solves many links: arrays broadcast.
ratios = np.array([0.5, 1.0, 1.5, 2.0, 2.5])
batch = al.bang_bang_time(start, end, inertia, ratios * tau_max, tau_max)
for ratio, feasible, t_min, reason in zip(ratios, batch.feasible, batch.t_min, batch.reason, strict=True):
    print(f"gravity over limit {ratio}:", f"{t_min:.4f} s" if feasible else reason)

# The monotone motion is slow here. A motion that first moves backwards is faster.
o = al.torque_optimal_time(math.pi / 2, 3.0, inertia, gravity_moment, 1.02 * gravity_moment)
print(f"pi/2 -> 3 at 1.02 G: {o.t:.4f} s monotone, {o.best.t:.4f} s with a {o.best.kind} that turns at {o.best.theta_turn:.4f} rad")
q, v, a, tau = o.profile(np.linspace(0.0, o.best.t, 5))
print("  angles on the way:", np.round(q, 4), "rad")

if len(sys.argv) > 1:
    MinimumTime(start, end, inertia, gravity_moment, tau_max).plot()[0, 0].figure.savefig(sys.argv[1], dpi=150)
