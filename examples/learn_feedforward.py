"""A feed-forward term, learned
============================

A PD law with gravity compensation follows a fast motion with a large error, because its model of the arm is wrong. A Fourier series
corrects its reference. Gauss-Newton steps learn the coefficients from the tangents, the derivatives of the run.

Run: ``python examples/learn_feedforward.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0])
robot = al.RigidArm(al.planar_arm([0.5, 0.4], masses=[3.3, 2.6]))  # the robot has other masses than the model of the law
wanted = al.Sinusoid([0.2, 0.4], [0.5, 0.4], [3.0, 3.0], [0.0, 0.6])
frequencies = np.tile([3.0, 6.0, 9.0], (2, 1))  # rad/s
options = {"t_end": 4.0, "dt": 4e-3, "v0": wanted(0.0)[1], "monitors": False}
q0 = wanted(0.0)[0]


def loop(offset: np.ndarray, sines: np.ndarray, cosines: np.ndarray) -> al.PID:
    """The law with a corrected reference: the desired motion plus a series of sines and cosines, rad."""
    amplitude = np.concatenate([[[0.5], [0.4]], sines, cosines], axis=1)
    phase = np.concatenate([[[0.0], [0.6]], np.zeros((2, 3)), np.full((2, 3), np.pi / 2)], axis=1)
    motion = al.Sinusoid(offset, amplitude, np.concatenate([np.full((2, 1), 3.0), frequencies, frequencies], axis=1), phase)
    return al.PID(arm, motion, kp=[60.0, 30.0], ki=None, kd=[8.0, 4.0])


def run_of(law: al.PID, names: list[str] | None = None) -> al.Run:
    return al.simulate(robot, law, q0, sensitivity=names, **options)


numbers = (np.array([0.2, 0.4]), np.zeros((2, 3)), np.zeros((2, 3)))
errors = []
for _ in range(4):
    run = run_of(loop(*numbers), ["law.target.offset", "law.target.amplitude"])
    desired = np.array([wanted(t)[0] for t in run.t])
    error = run.q - desired
    errors.append(np.sqrt((error**2).mean()))
    # Tangents with respect to the offsets and the amplitudes of the series. The first amplitude belongs to the desired motion and does not
    # change.
    offset = run.sensitivity["law.target.offset"].q
    amplitude = run.sensitivity["law.target.amplitude"].q.reshape(*run.q.shape, 2, 7)[..., 1:]
    tangents = np.concatenate([offset, amplitude.reshape(*run.q.shape, 12)], axis=-1).reshape(-1, 14)
    step = np.linalg.lstsq(tangents, -error.ravel(), rcond=1e-8)[0]
    series = step[2:].reshape(2, 6)
    numbers = (numbers[0] + step[:2], numbers[1] + series[:, :3], numbers[2] + series[:, 3:])
run = run_of(loop(*numbers))
desired = np.array([wanted(t)[0] for t in run.t])
errors.append(np.sqrt(((run.q - desired) ** 2).mean()))
print("rms error (mrad): " + ", ".join(f"{1e3 * error:.2f}" for error in errors))
assert errors[-1] < 0.1 * errors[0]

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    before = run_of(loop(np.array([0.2, 0.4]), np.zeros((2, 3)), np.zeros((2, 3))))
    figure = plt.figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    # After learning, the errors of both joints are near zero. The dashed line makes both curves visible.
    for each, label, styles in ((before, "before", (":", ":")), (run, "learned", ("-", "--"))):
        for k in range(2):
            color = ("#0072B2", "#D55E00")[k]
            left.plot(each.t, 1e3 * (each.q - desired)[:, k], styles[k], color=color, linewidth=1.4, label=f"joint {k + 1}, {label}")
    left.set(xlabel="time (s)", ylabel="error (mrad)", title="Joint errors", ylim=(-125.0, 62.0))
    right.semilogy(np.arange(len(errors)), 1e3 * np.array(errors), "o-", color="#009E73", markersize=4)
    right.set(xlabel="iteration", ylabel="rms error (mrad)", title="Learning", xticks=range(len(errors)))
    left.legend(fontsize=8, loc="upper center", ncols=2)
    for ax in (left, right):
        ax.grid(alpha=0.3)
    figure.savefig(sys.argv[1], dpi=150)
