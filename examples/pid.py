"""An unknown tool under PID
=========================

A two-joint arm lifts a tool that its controller does not know. Three controllers run at 1 kHz and measure only positions.

PD with gravity compensation has a steady-state error. An integral term removes the error slowly. A disturbance observer estimates the
torque of the tool within a fraction of a second. The lower panel compares the estimate with the gravity torque of the tool. The estimate
also includes the torque of the tool's inertia.

Run: ``python examples/pid.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.planar_arm([0.5, 0.4])
loaded = arm.with_payload("link2", 1.5, [0.0, 0.0, 0.0], np.zeros((3, 3)))
clock = al.Sampling(1e-3, resolution={"q": 2 * np.pi / 2**20})  # s, rad
lift = al.Quintic([-0.8, 0.4], [0.4, 0.6], 1.5)  # rad, s
filtered = {"derivative_filter": 200.0}  # 1/s

laws = {
    "PD": al.PID(arm, lift, 120.0, None, 25.0, **filtered),
    "PID": al.PID(arm, lift, 120.0, 200.0, 25.0, **filtered),
    "PD with observer": al.PID(arm, lift, 120.0, None, 25.0, observer_bandwidth=20.0, **filtered),
}
runs, errors = {}, {}
for name, law in laws.items():
    runs[name] = run = al.simulate(al.RigidArm(loaded), law, [-0.8, 0.4], t_end=4.0, dt=1e-3, sample_time=clock, monitors=False)
    errors[name] = np.abs(run.q - [lift(t)[0] for t in run.t]).max(axis=1)
    print(f"{name:17} largest error {errors[name].max():.3f} rad, at the end {errors[name][-1]:.1e} rad")
assert errors["PD with observer"][-1] < 1e-4 < errors["PD"][-1]

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    fig, (above, below) = plt.subplots(2, 1, figsize=(7, 6), sharex=True, layout="constrained")
    for name, error in errors.items():
        above.semilogy(run.t, np.maximum(error, 1e-6), label=name)
    above.set(title="Largest joint error", ylabel="error (rad)")
    above.legend()
    # The law subtracts its disturbance estimate. The torque of the tool has the opposite sign.
    terms = [law.terms(t, q, v, state=z) for t, q, v, z in zip(run.t, run.q, run.v, run.estimate, strict=True)]
    found = -np.array([each["disturbance"] for each in terms])
    weight = loaded.gravity(run.q) - arm.gravity(run.q)
    for joint, colour in enumerate(("C0", "C1")):
        below.plot(run.t, weight[:, joint], color=colour, label=f"joint {joint + 1}: gravity torque")
        below.plot(run.t, found[:, joint], color=colour, linestyle="--", label=f"joint {joint + 1}: estimate of the observer")
    below.set(title="Gravity torque of the unknown tool", xlabel="time (s)", ylabel="torque (N m)")
    below.legend(ncols=2)
    fig.savefig(sys.argv[1], dpi=120)
