"""Elastic joints against a wall
=============================

A seven-axis arm with elastic joints presses against a wall under Cartesian impedance control. The figure has the tip and its target, the
contact force and the joint torques. The script also prints limits of the controller.

Run: ``python examples/elastic_wall.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.load_urdf(al.example_urdf("seven_axis"))
frame = arm.tip_frame
q0 = np.array([0.0, 0.6, 0.0, -1.4, 0.0, 0.9, 0.0])
tip = arm.position(q0, frame)  # m

joint_stiffness = np.array([12e3, 12e3, 10e3, 8e3, 6e3, 4e3, 3e3])  # N m/rad
motor_inertia = np.array([2.0, 2.0, 1.5, 1.2, 0.8, 0.5, 0.4])  # kg m^2, after the gears
reduced_inertia = motor_inertia / 5

# The wall is 5 cm in front of the tip. In 2 s the target moves 13 cm, so 8 cm into the wall, and stops there.
wall = al.Wall(frame, tip + np.array([0.05, 0.0, 0.0]), [-1.0, 0.0, 0.0], stiffness=20e3, damping=50.0)
plant = al.ElasticArm(arm, joint_stiffness, motor_inertia, wall=wall)
stiffness, damping = np.array([800.0, 1500.0, 1500.0]), np.array([90.0, 120.0, 120.0])  # N/m, N s/m
target = al.Quintic(tip, tip + np.array([0.13, 0.0, 0.0]), 2.0)
law = al.ElasticImpedance(
    arm, target, stiffness, damping, joint_stiffness, motor_inertia, reduced_inertia, frame=frame, relative_damping=True
)
run = al.simulate(plant, law, q0, t_end=4.0, method="dop853", rtol=1e-9, atol=1e-10, t_eval=np.linspace(0.0, 4.0, 801))

x = np.asarray(arm.position(run.q, frame))
depth = x[:, 0] - tip[0] - 0.05
x_dot = np.einsum("kij,kj->ki", np.asarray(arm.jacobian(run.q, frame))[:, :3], run.v)
force = np.where(depth > 0.0, np.maximum(0.0, 20e3 * depth + 50.0 * x_dot[:, 0]), 0.0)
# At equilibrium the impedance and the wall are two springs in series: F = (0.13 - 0.05) / (1/800 + 1/20000).
expected = 0.08 / (1 / 800 + 1 / 20e3)
print(f"contact from {run.t[np.argmax(depth > 0)]:.2f} s on, largest force {force.max():.1f} N, at the end {force[-1]:.2f} N")
print(f"  two springs in series: {expected:.2f} N")
print(f"energy balance: {np.abs(run.monitors['energy_balance']).max():.1e} J of {run.monitors['energy'].max():.1f} J")
print(f"tau_J follows u within {run.monitors['torque_error'].max():.2f} N m; motor torques up to {np.abs(run.tau).max():.0f} N m")

held = al.ElasticImpedance(arm, tip, stiffness, damping, joint_stiffness, motor_inertia, reduced_inertia, frame=frame)
limits = al.elastic_limits(al.ElasticArm(arm, joint_stiffness, motor_inertia), held, q0=q0, sample_time=1e-3)
print(f"a sampled controller must be faster than {1e3 * limits.sample_time_max:.2f} ms; at 1 ms B0 may fall to")
print("  ", np.round(limits.reduced_inertia_min, 4), "kg m^2, of", motor_inertia)

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    from armlet.figures import COLOURS

    figure = plt.figure(figsize=(9.0, 7.0), layout="constrained")
    (way, push), (torque, error) = figure.subplots(2, 2)
    way.plot(run.t, [target(t)[0][0] - tip[0] for t in run.t], "--", color=COLOURS[1], label="target")
    way.plot(run.t, x[:, 0] - tip[0], color=COLOURS[0], label="tip")
    way.axhline(0.05, color="0.5", linewidth=1.0, label="wall")
    way.set_ylabel("x, relative to the start (m)")
    push.plot(run.t, force, color=COLOURS[0], label="force on the wall")
    push.axhline(expected, color="0.5", linestyle=":", linewidth=1.0, label="expected: two springs in series")
    push.set_ylabel("contact force (N)")
    torque.plot(run.t, joint_stiffness * (run.theta - run.q), label=[f"joint {i + 1}" for i in range(7)])
    torque.set_ylabel("joint torques (N m)")
    error.plot(run.t, run.monitors["torque_error"], color=COLOURS[0], label=r"largest $|\tau_J - u|$")
    error.set_ylabel("torque error (N m)")
    for line, color in zip(torque.lines, COLOURS, strict=False):
        line.set_color(color)
    for ax in (way, push, torque, error):
        ax.set_xlabel("time (s)")
        ax.grid(alpha=0.3)
        ax.legend(fontsize=8, **({"loc": (0.1, 0.25), "ncols": 3} if ax is torque else {}))
    figure.savefig(sys.argv[1], dpi=150)
