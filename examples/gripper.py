"""An arm with a gripper
=====================

An arm with two joints has a parallel gripper. The joint of the right finger follows the joint of the left finger (``<mimic>`` of a URDF),
so both fingers have one degree of freedom. ``q`` has three entries for four joints. A computed-torque law closes the gripper while the arm
moves.

Run: ``python examples/gripper.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al


def link(name: str, mass: float, height: float) -> str:
    inertia = f"<inertia ixx='{mass * height**2 / 3}' iyy='{mass * height**2 / 3}' izz='{mass * height**2 / 20}'/>"
    return f"<link name='{name}'><inertial><origin xyz='0 0 {height / 2}'/><mass value='{mass}'/>{inertia}</inertial></link>"


def joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str, upper: float, more: str = "") -> str:
    ends = f"<parent link='{parent}'/><child link='{child}'/><origin xyz='{xyz}'/><axis xyz='{axis}'/>"
    return f"<joint name='{name}' type='{kind}'>{ends}<limit lower='-{upper}' upper='{upper}' velocity='2' effort='40'/>{more}</joint>"


text = (
    "<robot name='gripper'><link name='base'/>"
    + link("upper", 2.0, 0.4)
    + link("fore", 1.5, 0.3)
    + link("finger_left", 0.1, 0.05)
    + link("finger_right", 0.1, 0.05)
    + joint("shoulder", "revolute", "base", "upper", "0 0 0", "0 1 0", 2.0)
    + joint("elbow", "revolute", "upper", "fore", "0 0 0.4", "0 1 0", 2.0)
    + joint("left", "prismatic", "fore", "finger_left", "0 0.01 0.3", "0 1 0", 0.04)
    + joint("right", "prismatic", "fore", "finger_right", "0 -0.01 0.3", "0 1 0", 0.04, "<mimic joint='left' multiplier='-1'/>")
    + "</robot>"
)
arm = al.load_urdf(text)
print(f"{len(arm.file_joint_names)} joints, {arm.n} degrees of freedom: {', '.join(arm.joint_names)}")
print(arm.report[0])
print(f"both fingers move with the gripper: {arm.mass_matrix(np.zeros(3))[2, 2]:.2f} kg")

start, end = [0.3, 0.8, 0.04], [0.9, -0.4, 0.0]  # rad, rad, m
law = al.ComputedTorque(arm, al.Quintic(start, end, 1.0), kp=400.0, kd=40.0)
run = al.simulate(al.RigidArm(arm), law, q0=start, t_end=1.2, dt=1e-3)
fingers = arm.file_positions(run.q)[:, [arm.file_joint_names.index(name) for name in ("left", "right")]]
gap = arm.position(run.q, "finger_left") - arm.position(run.q, "finger_right")
print(f"gap {np.linalg.norm(gap[0]):.3f} m at first, {np.linalg.norm(gap[-1]):.3f} m at the end; energy balance to", end=" ")
print(f"{np.abs(run.monitors['energy_balance']).max():.0e} J")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure, (angles, sides) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    angles.plot(run.t, run.q[:, :2], label=arm.joint_names[:2])
    angles.set(xlabel="time (s)", ylabel="position (rad)", title="Arm")
    sides.plot(run.t, 1e3 * fingers, label=["left", "right (mimic joint)"])
    sides.set(xlabel="time (s)", ylabel="position (mm)", title="Fingers")
    for axes in (angles, sides):
        axes.legend(frameon=False)
        axes.grid(alpha=0.3)
    figure.savefig(sys.argv[1], dpi=150)
