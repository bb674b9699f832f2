"""Adaptation of friction
======================

The decay of the tracking error and of the parameter error, with a motion that excites all parameters and with one that does not.
The laws are the plain one, one that also estimates friction, and laws with leakage and a dead zone.

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

# Rotors and links that turn about one axis cannot be told apart: rotors are known here, and the base set has every parameter that shows.
base = arm.base_parameters()
laws = {
    "friction not estimated": {},
    "friction estimated": {"friction": ("viscous",)},
    "and sigma = 0.01": {"friction": ("viscous",), "leakage": 0.01},
    "and e-modification, 0.01": {"friction": ("viscous",), "leakage": 0.01, "leakage_form": "e"},
    "and a dead zone of 0.02 rad/s": {"friction": ("viscous",), "dead_zone": 0.02},
}
t_end = 40.0  # s


def rate(t: np.ndarray, x: np.ndarray) -> float:
    """The exponential rate of decay in the second half of a run, 1/s: from the largest value of its first fifth to that of its last."""
    second = x[len(t) // 2 :]
    fifth = len(second) // 5
    return float(np.log(second[:fifth].max() / second[-fifth:].max()) / (0.4 * t_end))


def settled(t: np.ndarray, error: np.ndarray, band: float) -> float:
    """The time from which the error stays below the band, s; infinity if it does not."""
    outside = np.flatnonzero(error > band)
    return float(t[outside[-1] + 1]) if outside[-1] < 0.95 * len(t) else np.inf


curves: dict[tuple[str, str], tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
print(f"{'law':32} {'motion':18} {'error < 5 mrad, s':>18} {'last error, rad':>16} {'of estimate, 1/s':>17}")
for name, keywords in laws.items():
    for motion_name, motion in motions.items():
        law = al.Adaptive(arm, motion, kp=60.0, kd=20.0, gamma=3.0, base=base, **keywords)
        run = al.simulate(plant, law, [0.1, 0.2], t_end=t_end, dt=2e-3, record_every=10)
        error = np.linalg.norm(run.desired()[0] - run.q, axis=1)
        truth = np.concatenate([base.projection @ arm.parameters, [0.6, 0.6]])[: run.estimate.shape[1]]
        wrong = np.linalg.norm(run.estimate - truth, axis=1)
        curves[name, motion_name] = (run.t, error, wrong)
        fifth = len(run.t) // 5
        print(f"{name:32} {motion_name:18} {settled(run.t, error, 5e-3):18.1f} {error[-fifth:].max():16.1e} {rate(run.t, wrong):17.3f}")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for ax, motion_name in zip(axes, motions, strict=True):
        for name in laws:
            t, _, wrong = curves[name, motion_name]
            ax.semilogy(t, wrong, linewidth=1.1, label=name)
        ax.set_title(motion_name)
        ax.set_xlabel("t (s)")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("error of the parameters (SI)")
    axes[1].legend(fontsize=8, loc="center right")
    figure.savefig(sys.argv[1], dpi=150)
