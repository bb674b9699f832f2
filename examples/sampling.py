"""Effects of sampling
===================

The stability proof of an adaptive law is valid in continuous time. There the Lyapunov balance, the residual of an identity of the proof, is
zero. With a sample time it is not zero, and the tracking error is larger. The figure has both over the sample time, without delay and with
a delay of one sample.

Run: ``python examples/sampling.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.planar_pr(A=2.0, B=0.5, C=0.5)
motion = al.Sinusoid(offset=[0.0, 0.3], amplitude=[0.5, 0.8], frequency=[1.0, 1.7], phase=[0.0, 0.0])
law = al.Adaptive(arm, motion, kp=[40.0, 20.0], kd=[20.0, 10.0], gamma=5.0)
dt, t_end = 2.5e-4, 30.0  # s
periods = np.array([1, 2, 4, 8, 16, 32, 64, 96]) * dt  # s


def cost(sample_time) -> tuple[float, float]:
    """Rms error of joint 2 over the last 10 s, rad, and largest |Lyapunov balance|, J. Both are infinite if the loop fails."""
    run = al.simulate(al.RigidArm(arm), law, [0.2, -0.3], t_end=t_end, dt=dt, sample_time=sample_time, record_every=40, throw=False)
    if run.status != al.Status.SUCCESS:
        return np.inf, np.inf
    e = np.array([motion(t)[0][1] for t in run.t]) - run.q[:, 1]
    return float(np.sqrt(np.mean(e[run.t > t_end - 10.0] ** 2))), float(np.abs(run.monitors["lyapunov_balance"]).max())


continuous = cost(None)
held = np.array([cost(period) for period in periods])
late = np.array([cost(al.Sampling(period, delay=period)) for period in periods])
failed = periods[np.isinf(late[:, 0])][0]  # s
print(f"continuous: rms error {continuous[0]:.1e} rad, balance {continuous[1]:.1e} J")
for period, (e, balance), (e_late, _) in zip(periods, held, late, strict=True):
    print(f"{1e3 * period:6.2f} ms: rms error {e:.1e} rad, balance {balance:.1e} J; a sample late {e_late:.1e} rad")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 3.8), layout="constrained")
    names = ("rms error of joint 2 (rad)", "largest Lyapunov balance (J)")
    for ax, column, what in zip(figure.subplots(1, 2), (0, 1), names, strict=True):
        ax.plot(1e3 * periods, held[:, column], "o-", color="#0072B2", markersize=4, label="sampled, no delay")
        ax.plot(1e3 * periods, late[:, column], "s--", color="#D55E00", markersize=4, label="sampled, delay of one sample")
        ax.axhline(continuous[column], color="0.3", linestyle=":", label="continuous law")
        ax.axvline(1e3 * failed, color="#D55E00", linewidth=0.8, alpha=0.5, label=f"with delay: diverges at {1e3 * failed:g} ms")
        ax.set(xscale="log", yscale=("linear", "log")[column], xlabel="sample time (ms)", ylabel=what)
        ax.grid(alpha=0.3)
        ax.legend(fontsize=8)
    figure.savefig(sys.argv[1], dpi=150)
