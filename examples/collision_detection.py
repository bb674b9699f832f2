"""Collision detection
===================

A momentum observer estimates external torques. A collision is detected when its estimate exceeds a threshold, which sensor noise should not
exceed. For 10,000 noisy runs, the figure has the delay of the detection over the rate of false alarms.

Run: ``python examples/collision_detection.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0])
law = al.PDGravity(arm, [0.9, -0.7], kp=60.0, kd=15.0)
dt, steps, hit = 2e-3, 90, 50  # s; the collision begins at step 50, 0.1 s
force = np.array([1.2, -0.8, 0.0])  # N, at the tip
runs = 10_000
noise = {"v": 2e-3, "tau": 0.1}  # rad/s, N m: standard deviations of each sample

# All runs have the same motion, and each run has different sensor noise.
sim = al.Simulator(al.RigidArm(arm), law, [0.4, -0.2], dt=dt, sample_time=dt, force_frame="link2")
states = [(sim.q.copy(), sim.v.copy(), np.zeros(2))]
for k in range(steps):
    sim.step(force=force if k >= hit else None)
    states.append((sim.q.copy(), sim.v.copy(), sim.tau.copy()))


def seen(k: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Measured q, v and tau at step k, (runs, 2) each."""
    q, v, tau = states[k]
    others = (x + rng.normal(0.0, noise[name], (runs, 2)) for x, name in ((v, "v"), (tau, "tau")))
    return [np.broadcast_to(q, (runs, 2)), *others]


curves = {}
for gain in (25.0, 50.0, 100.0):  # 1/s
    rng = np.random.default_rng(0)
    observer = al.MomentumObserver(arm, gain)
    observer.reset(*seen(0, rng)[:2])
    residuals = np.array([observer.update(*seen(k, rng), dt) for k in range(1, steps + 1)])  # (K, runs, 2)
    # The thresholds are multiples of the residual's standard deviation in free motion, measured after the initial transient.
    free = residuals[hit // 2 : hit]
    centre, spread = free.mean(axis=(0, 1)), free.std(axis=(0, 1))
    height = np.max(np.abs(residuals - centre) / spread, axis=-1)  # (K, runs)
    rows = []
    for sigmas in np.linspace(2.5, 6.0, 15):
        above = height > sigmas
        alarms = above[hit // 2 : hit].any(axis=0).mean()
        first = np.argmax(above[hit:], axis=0) + 1.0
        delay = np.where(above[hit:].any(axis=0), first * dt, np.inf)
        rows.append((sigmas, alarms, np.median(delay), np.quantile(delay, 0.99)))
    curves[gain] = np.array(rows)
    print(f"gain {gain:5.0f} 1/s: noise of r {np.round(spread, 3)} N m")
    for sigmas, alarms, median, late in rows[::2]:
        print(f"  {sigmas:4.2f} sigmas: false alarms {100 * alarms:6.2f} %, delay {1e3 * median:5.1f} ms, 99 % within {1e3 * late:5.1f} ms")

# An observer outside of the loop and the observer of a `Guarded` law are compared. Only the velocities have noise here, because the law
# knows its commanded torque.
gain, sigmas = 50.0, 4.5
rng = np.random.default_rng(1)
observer = al.MomentumObserver(arm, gain)
observer.reset(*(np.broadcast_to(x, (runs, 2)) for x in states[0][:2]))
alone = []
for q, v, tau in states[1:]:
    seen_v = v + rng.normal(0.0, noise["v"], (runs, 2))
    alone.append(observer.update(np.broadcast_to(q, (runs, 2)), seen_v, np.broadcast_to(tau, (runs, 2)), dt))
batch = al.simulate_batch(
    al.RigidArm(arm),
    al.Guarded(law, observer),
    np.tile([0.4, -0.2], (runs, 1)),
    t_end=(steps + 1) * dt,
    sample_time=al.Sampling(dt, noise={"v": noise["v"]}, seed=2),
    force=[(0.0, [0.0, 0.0, 0.0]), (hit * dt, force)],
    force_frame="link2",
    monitors=False,
)
for name, residual in (("alone", np.swapaxes(alone, 0, 1)), ("in the loop", batch.residual[:, 2:])):
    free = residual[:, hit // 2 : hit]
    spread = free.std(axis=(0, 1))
    above = np.any(np.abs(residual - free.mean(axis=(0, 1))) > sigmas * spread, axis=-1)
    late = np.where(above[:, hit:].any(axis=1), (np.argmax(above[:, hit:], axis=1) + 1.0) * dt, np.inf)
    share = 100 * above[:, hit // 2 : hit].any(axis=1).mean()
    print(f"observer {name:12}: noise {np.round(spread, 4)} N m, false alarms {share:.2f} %, delay {1e3 * np.median(late):.1f} ms")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(7.0, 4.0), layout="constrained")
    ax = figure.subplots()
    for (gain, rows), colour in zip(curves.items(), ("#0072B2", "#D55E00", "#009E73"), strict=True):
        found = rows[:, 1] > 0.0
        ax.plot(100 * rows[found, 1], 1e3 * rows[found, 2], "o-", color=colour, markersize=4, label=f"gain {gain:g} 1/s, median")
        ax.plot(100 * rows[found, 1], 1e3 * rows[found, 3], "--", color=colour, linewidth=1.0, label=f"gain {gain:g} 1/s, 99th percentile")
    ax.set(xscale="log", xlabel="runs with a false alarm within 50 ms (%)", ylabel="delay of detection (ms)")
    ax.grid(alpha=0.3)
    ax.legend(fontsize=8)
    figure.savefig(sys.argv[1], dpi=150)
