"""Gains by gradient descent
=========================

The adjoint of a run gives the gradient of a loss with respect to all gains of a closed loop. Gradient descent reduces the loss.

Run: ``python examples/gradients.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0])
plant, target, q0 = al.RigidArm(arm), np.array([0.4, 0.9]), [0.0, 0.0]
loss = {"error_rms": 1.0, "tau_rms": 1e-4}


def law(gains: np.ndarray) -> al.PDGravity:
    kp, kd = np.exp(gains).reshape(2, 2)
    return al.PDGravity(arm, target, kp=kp, kd=kd)


# The variables are logarithms of kp and kd. So gains stay positive, and one step size suits all of them.
gains, values = np.log([8.0, 6.0, 6.0, 4.0]), []
for _ in range(25):
    value, slopes = al.gradient(loss, plant, law(gains), q0, ["law.kp", "law.kd"], t_end=2.0, dt=2e-3)
    along = np.exp(gains) * np.concatenate([slopes["law.kp"], slopes["law.kd"]])
    values.append(value)
    gains = gains - 0.15 * along / np.abs(along).max()
print(f"loss {values[0]:.4f} -> {min(values):.4f}, kp {np.exp(gains[:2]).round(1)}, kd {np.exp(gains[2:]).round(1)}")
assert min(values) < 0.9 * values[0]

# Tangents of the run give the derivatives of q with respect to kp.
run = al.simulate(plant, law(gains), q0, t_end=2.0, dt=2e-3, sensitivity=["law.kp"])
print(f"largest |dq/dkp| {np.abs(run.sensitivity['law.kp'].q).max():.2e} rad per N m/rad")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 3.6), layout="constrained")
    errors, descent = figure.subplots(1, 2)
    before = al.simulate(plant, law(np.log([8.0, 6.0, 6.0, 4.0])), q0, t_end=2.0, dt=2e-3)
    for each, label, style in ((before, "initial gains", ":"), (run, "final gains", "-")):
        for k in range(2):
            color = ("#0072B2", "#D55E00")[k]
            errors.plot(each.t, target[k] - each.q[:, k], style, color=color, linewidth=1.4, label=f"joint {k + 1}, {label}")
    errors.set(xlabel="time (s)", ylabel="error (rad)", title="Joint errors before and after the search")
    descent.plot(np.arange(len(values)), values, "o-", color="#009E73", markersize=3)
    descent.set(xlabel="iteration", ylabel="loss (rad\u00b2)", title="Gradient descent")
    errors.legend(fontsize=8)
    for ax in (errors, descent):
        ax.grid(alpha=0.3)
    figure.savefig(sys.argv[1], dpi=150)
