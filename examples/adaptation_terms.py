"""Adaptation: rates of convergence
================================

The figure compares how fast the tracking error and the parameter error decay under several adaptive laws. One motion excites all
parameters, the other does not. The laws are plain adaptation, estimated friction, leakage, a dead zone, composite adaptation and
concurrent learning.

Run: ``python examples/adaptation_terms.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

joint = {"type": "R", "axis": [0, 0, 1], "damping": 0.6, "armature": 0.2}
links = [{"phi": [2, 0.4, 0, 0, 0.02, 0, 0.12, 0, 0, 0.12]}, {"phi": [1, 0.2, 0, 0, 0.02, 0, 0.06, 0, 0, 0.06], "xyz": [0.4, 0, 0]}]
arm = al.Arm.from_chain([joint | link for link in links], gravity=[0, -9.81, 0])
plant = al.RigidArm(arm, friction=True)

rich = al.Sinusoid([0.1, 0.2], [[0.5, 0.3], [0.6, 0.3]], [[1.1, 3.1], [1.7, 4.3]], [[0.0, 1.0], [0.5, 0.2]])
poor = al.Quintic([0.1, 0.2], [0.8, -0.5], 3.0)
motions = {"sum of sines": rich, "quintic and hold": poor}

# The inertias of a rotor and of a link that rotate about the same axis cannot be distinguished. So the law knows the rotor inertias. The
# base parameters are all combinations of inertial parameters that affect the motion.
base = arm.base_parameters()
viscous = {"friction": ("viscous",)}

# Concurrent learning requires samples of an earlier motion. Here they are windows of 0.2 s from a run of 8 s without concurrent learning.
# Windows need no measured acceleration.
plain = al.Adaptive(arm, rich, kp=60.0, kd=20.0, gamma=3.0, base=base, **viscous)
earlier = al.simulate(plant, plain, [0.1, 0.2], t_end=8.0, dt=2e-3)
samples = al.select_samples(plain, earlier.q, earlier.v, earlier.tau, 20, t=earlier.t, window=0.2)
print(samples)

laws = {
    "friction not estimated": {},
    "friction estimated": viscous,
    "friction + leakage 0.01": {**viscous, "leakage": 0.01},
    "friction + e-modification 0.01": {**viscous, "leakage": 0.01, "leakage_form": "e"},
    "friction + dead zone 0.02 rad/s": {**viscous, "dead_zone": 0.02},
    "friction + composite, R = 2": {**viscous, "composite": 2.0, "composite_rate": 2.0},
    "friction + concurrent, R = 1": {**viscous, "concurrent": samples, "concurrent_weight": 1.0},
}
t_end = 40.0  # s


def rate(t: np.ndarray, x: np.ndarray) -> float:
    """Mean exponential rate of decay of `x`, 1/s.

    The mean begins at the start and ends when `x` falls below a thousandth of its first value, or at the end of the run.
    """
    below = np.flatnonzero(x < 1e-3 * x[0])
    k = below[0] if len(below) else len(t) - 1
    return float(np.log(x[0] / x[k]) / t[k])


def settled(t: np.ndarray, error: np.ndarray, band: float) -> float:
    """The time after which the error stays below `band`, s; infinity if the error exceeds it in the last twentieth of the run."""
    outside = np.flatnonzero(error > band)
    if not len(outside):
        return 0.0
    return float(t[outside[-1] + 1]) if outside[-1] < 0.95 * len(t) else np.inf


curves: dict[tuple[str, str], tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
print(f"{'law':32} {'motion':18} {'error < 5 mrad, s':>18} {'last error, rad':>16} {'of estimate, 1/s':>17} {'last of estimate':>17}")
for name, keywords in laws.items():
    for motion_name, motion in motions.items():
        law = al.Adaptive(arm, motion, kp=60.0, kd=20.0, gamma=3.0, base=base, **keywords)
        run = al.simulate(plant, law, [0.1, 0.2], t_end=t_end, dt=2e-3, record_every=10)
        error = np.linalg.norm(run.desired()[0] - run.q, axis=1)
        estimate = run.estimate[:, : len(law.parameter_names)]  # omits the filters of composite adaptation
        truth = np.concatenate([base.projection @ arm.parameters, [0.6, 0.6]])[: estimate.shape[1]]
        wrong = np.linalg.norm(estimate - truth, axis=1)
        curves[name, motion_name] = (run.t, error, wrong)
        last = error[-len(run.t) // 5 :].max()
        numbers = f"{settled(run.t, error, 5e-3):18.1f} {last:16.1e} {rate(run.t, wrong):17.3f} {wrong[-1]:17.1e}"
        print(f"{name:32} {motion_name:18} {numbers}")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for ax, motion_name in zip(axes, motions, strict=True):
        # With the quintic, four curves coincide: each is drawn narrower than the one below it.
        for name, width in zip(laws, (1.2, 5.0, 1.2, 3.4, 2.0, 1.0, 1.2), strict=True):
            t, _, wrong = curves[name, motion_name]
            ax.semilogy(t, wrong, linewidth=width, solid_capstyle="butt", label=name)
        ax.set_title(f"motion: {motion_name}")
        ax.set_xlabel("time (s)")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("norm of the parameter error (SI)")
    axes[1].legend(fontsize=8, loc="center right")
    figure.savefig(sys.argv[1], dpi=150)
