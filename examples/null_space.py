"""Null space of an impedance law
==============================

A Cartesian spring holds the tip of a seven-axis arm. Springs of the joints move the arm to another posture; a projector on the null space
removes the part of their torque that moves the tip.

The script compares three laws: the static projector, the dynamically consistent projector, and the consistent projector with compensated
coupling. The torque of the consistent projector does not accelerate the tip. But the motion of the joints still moves the tip through the
Coriolis torque ``C v`` and the term ``J_dot v`` of the Jacobian ``J``, unless the law compensates these terms.

Run: ``python examples/null_space.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

arm = al.load_urdf(al.example_urdf("seven_axis"))
q0 = np.array([0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3])
q_d = q0 + np.array([0.5, -0.2, -0.6, 0.2, 0.3, 0.2, -0.4])
start = arm.position(q0, "tcp")
times = np.linspace(0.0, 4.0, 401)

laws = {
    "static": {"projection": "static"},
    "consistent": {"projection": "consistent"},
    "coupling compensated": {"projection": "consistent", "compensate_coupling": True},
}
runs, moved, kinetic = {}, {}, {}
print("projector              farthest the tip goes   kinetic energy, largest and at 4 s   energy balance")
for name, options in laws.items():
    posture = al.NullSpace(q_d, stiffness=30.0, damping=12.0, projection=options.pop("projection"))
    law = al.CartesianImpedance(arm, start, 400.0, 40.0, frame="tcp", nullspace=posture, **options)
    runs[name] = run = al.simulate(al.RigidArm(arm), law, q0, t_end=4.0, method="dop853", rtol=1e-11, atol=1e-12, t_eval=times)
    moved[name] = np.linalg.norm(arm.position(run.q, "tcp") - start, axis=-1)
    kinetic[name] = arm.energy(run.q, run.v)[0]
    balance = np.abs(run.monitors["energy_balance"]).max()
    print(f"{name:21} {moved[name].max():21.1e} m {kinetic[name].max():22.1e} {kinetic[name][-1]:11.1e} J {balance:15.1e} J")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    from armlet.figures import COLOURS

    fig, axes = plt.subplots(1, 3, figsize=(12, 4), layout="constrained")
    for i, color in enumerate(COLOURS[: arm.n]):
        axes[0].plot(times, runs["coupling compensated"].q[:, i], color=color, label=f"q{i + 1}")
    axes[0].set(title="Joints (coupling compensated)", xlabel="time (s)", ylabel="angle (rad)")
    axes[0].legend(fontsize=8, ncols=4, loc="center", bbox_to_anchor=(0.5, 0.2))
    for name, color in zip(runs, COLOURS[:3], strict=True):
        axes[1].semilogy(times[1:], 1e3 * moved[name][1:], color=color, label=name)
        axes[2].semilogy(times[1:], kinetic[name][1:], color=color, label=name)
    axes[1].set(title="Distance of the tip from its target", xlabel="time (s)", ylabel="distance (mm)")
    axes[2].set(title="Kinetic energy", xlabel="time (s)", ylabel="energy (J)")
    for ax in axes[1:]:
        ax.legend(fontsize=8)
    fig.savefig(sys.argv[1], dpi=120)
