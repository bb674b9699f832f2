"""A joint that sticks and slips
==============================

PD control, or PID control, moves a link to 1 rad. The friction of the link is higher at rest than in motion.

Under PD the link stops before its target, because friction balances the remaining torque. Under PID the integral grows until the link
slips. The link then passes the target and sticks on the other side. This repeats without end and is called hunting. The LuGre friction
model has no switch between sticking and slipping, and the link hunts with this model too.

Run: ``python examples/stick_slip.py [figure.png]``
"""

import sys

import numpy as np

import armlet as al

link = al.pendulum(0.5, 0.0)  # kg m^2, in a horizontal plane
curve = {"coulomb": 1.0, "static": 2.0, "stribeck_speed": 0.05, "viscous": 0.1}  # N m, rad/s, N m s/rad
sticks = al.RigidArm(link, friction=al.StickSlip(**curve))
bends = al.RigidArm(link, friction=al.LuGre(stiffness=1e4, damping=70.0, **curve))  # N m/rad, N m s/rad
pd, pid = al.PID(link, [1.0], 10.0, None, 3.0), al.PID(link, [1.0], 10.0, 20.0, 3.0)

runs = {
    "PD, stick-slip": al.simulate(sticks, pd, [0.0], t_end=15.0, method="dopri5"),
    "PID, stick-slip": al.simulate(sticks, pid, [0.0], t_end=15.0, method="dopri5"),
    "PID, LuGre": al.simulate(bends, pid, [0.0], t_end=15.0, method="radau5"),
}
for name, run in runs.items():
    late = run.q[run.t > 10.0, 0]
    share = np.mean(np.diff(run.t)[run.v[:-1, 0] == 0.0].sum() / run.t[-1])
    print(
        f"{name:16} between {late.min():.4f} and {late.max():.4f} rad after 10 s, stuck for {share:.0%} of the time, "
        f"{run.stats['steps']} steps, energy balance {np.abs(run.monitors['energy_balance']).max():.0e} J"
    )
assert np.ptp(runs["PD, stick-slip"].q[-5:]) == 0.0 < abs(runs["PD, stick-slip"].q[-1, 0] - 1.0)
assert np.ptp(runs["PID, stick-slip"].q[runs["PID, stick-slip"].t > 10.0]) > 0.1

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    fig, (above, below) = plt.subplots(2, 1, figsize=(7, 6), sharex=True, layout="constrained")
    for name, run in runs.items():
        above.plot(run.t, run.q[:, 0], label=name)
        below.plot(run.t, run.friction[:, 0], label=name, linewidth=0.8)
    above.axhline(1.0, color="0.6", linewidth=0.8, zorder=0)
    above.set(ylabel="angle (rad)", title="Angle of the link (target: 1 rad)", ylim=(0.7, 1.15))
    above.legend()
    below.set(xlabel="time (s)", ylabel="torque (N m)", title="Friction torque")
    fig.savefig(sys.argv[1], dpi=120)
