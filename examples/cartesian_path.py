"""Path of poses
=============

From three poses of a tool, the script computes a timed motion. The tool follows straight lines with a rounded corner. The motion is as fast
as its limits allow: those of torque and joint speed, and those of the tool's speed and acceleration.

Run: ``python examples/cartesian_path.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.load_urdf(al.example_urdf("seven_axis"))
tool = arm.frame_names[-1]
q0 = np.array([0.0, -0.4, 0.0, -1.8, 0.0, 1.6, 0.0])

# Three poses make two straight lines. On the second line the tool also rotates by 0.5 rad about its axis.
poses = np.tile(arm.pose(q0, tool), (3, 1, 1))
poses[1:, :3, 3] += [0.1, 0.2, -0.1]
poses[2, :3, 3] += [-0.2, 0.1, 0.0]
c, s = np.cos(0.5), np.sin(0.5)
poses[2, :3, :3] = poses[2, :3, :3] @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

path = al.cartesian_path(arm, poses, q0, frame=tool, tolerance=1e-4, blend=0.05)
print(path)

tau_max = np.array([174.0, 174.0, 174.0, 174.0, 24.0, 24.0, 24.0])  # N m
limits = {"tip_speed": 0.5, "tip_acceleration": 3.0, "frame": tool}  # m/s, m/s^2
p = al.time_path(arm, path, tau_max=tau_max, v_max=2.2, **limits)
print(f"{p.duration:.4f} s; smallest margin {p.margin:.1e}")

t = np.linspace(0.0, p.duration, 2001)
q, v, a = p(t)
jacobian, change = arm.jacobian(q, tool)[:, :3], arm.jacobian_dot(q, v, tool)[:, :3]
speed = np.linalg.norm(np.einsum("kij,kj->ki", jacobian, v), axis=1)
acceleration = np.linalg.norm(np.einsum("kij,kj->ki", jacobian, a) + np.einsum("kij,kj->ki", change, v), axis=1)
print(f"largest speed of the tool {speed.max():.6f} m/s, largest acceleration {acceleration.max():.6f} m/s^2")

far = poses.copy()
far[2, :3, 3] += [2.0, 0.0, 0.0]
print(al.cartesian_path(arm, far, q0, frame=tool).reason)

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    from armlet.figures import COLOURS

    figure, (left, above) = plt.subplots(1, 2, figsize=(8.0, 3.6), layout="constrained")
    tip = arm.position(q, tool)
    left.plot(tip[:, 1], tip[:, 2], color=COLOURS[0], label="path of the tool")
    left.plot(poses[:, 1, 3], poses[:, 2, 3], "o", color="0.3", label="given poses")
    left.set(xlabel="y (m)", ylabel="z (m)", aspect="equal")
    left.legend(frameon=False)
    above.plot(t, speed / 0.5, color=COLOURS[0], label="tool speed")
    above.plot(t, acceleration / 3.0, color=COLOURS[1], label="tool acceleration")
    above.axhline(1.0, color="0.4", linestyle="--", linewidth=0.8)
    above.set(xlabel="time (s)", ylabel="fraction of the limit", ylim=(0.0, None))
    above.legend(frameon=False)
    for ax in (left, above):
        ax.grid(alpha=0.3)
    figure.savefig(sys.argv[1], dpi=150)
