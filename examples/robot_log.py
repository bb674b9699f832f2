"""A robot's log
=============

A log in degrees with wrapped angles and dropped samples is read, and its faults are reported. Then the log is resampled and filtered.

Run: ``python examples/robot_log.py [figure.png]``
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import armlet as al

# %%
# A robot records at 500 Hz. The recording loses one sample in 200, and the angles wrap at 180 degrees.

arm = al.load_urdf(al.example_urdf("planar_2r"))
motion = al.Sinusoid([0.0, 0.5], [[3.9, 0.3], [0.6, 0.4]], [[1.0, 3.0], [2.0, 4.3]], 0.0)
law = al.ComputedTorque(arm, motion, 100.0, 20.0)
run = al.simulate(al.RigidArm(arm), law, motion(0.0)[0], v0=motion(0.0)[1], t_end=10.0, dt=0.002)

rng = np.random.default_rng(3)
received = rng.uniform(size=len(run.t)) > 0.005
received[2000:2150] = False
wrapped = (run.q + np.pi) % (2.0 * np.pi) - np.pi
angles = np.degrees(wrapped) + 0.01 * rng.normal(size=run.q.shape)
torques = run.tau + 0.5 * rng.normal(size=run.q.shape)
desired = np.degrees(motion(run.t)[0])

first, second = arm.joint_names
quantities = ("position [deg]", "effort [N m]", "desired_position [deg]")
columns = ["time [s]", *(f"{joint}/{quantity}" for quantity in quantities for joint in (first, second))]
path = Path(tempfile.mkdtemp()) / "log.csv"
rows = np.column_stack([run.t, angles, torques, desired])[received]
np.savetxt(path, rows, delimiter=";", comments="", header=";".join(columns))

# %%
# The report shows what the file contains.

log = al.read_log(path, arm=arm)
print(log)
print(log.report)

# %%
# The filtered torque is compared with the torque without noise.

ready = log.resample(0.002).filter(10.0)
error = ready.tau[:, 0] - np.interp(ready.t, run.t, run.tau[:, 0])
print(f"noise of the torque: 0.5 N m; after the filter: {error[300:-300].std():.2g} N m, except in the gap")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure()
    axes = log.plot(figure)
    axes.flat[1].plot(ready.t, ready.tau[:, 0], color="black", linewidth=1.0, label="filtered, without gaps")
    axes.flat[1].legend()
    figure.savefig(sys.argv[1], dpi=150)
