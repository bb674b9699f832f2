"""A MuJoCo model under an armlet law
==================================

A law of armlet controls a MuJoCo model. The script compares this loop with a loop that armlet simulates.

The loop is sampled: MuJoCo calls the law once per step and holds the torque during the step. With MuJoCo's Runge-Kutta method both loops
integrate equal equations by the same method, so they differ only by rounding errors. With MuJoCo's semi-implicit Euler method they differ
by the error of this method, which is proportional to the step.

Run: ``python examples/mujoco_loop.py [figure.png]``; needs mujoco (``pip install '.[mujoco]'`` in the folder of
the sources).
"""

import sys

import numpy as np

import armlet as al

try:
    import mujoco
except ImportError:
    sys.exit("mujoco_loop: mujoco is not installed: pip install '.[mujoco]' in the folder of armlet's sources")

MODEL = """
<mujoco>
  <option timestep="0.001"/>
  <worldbody>
    <body name="column">
      <joint name="turn" axis="0 0 1" armature="0.05"/>
      <geom type="capsule" size=".05" fromto="0 0 0 0 0 .3" mass="4"/>
      <body name="upper" pos="0 0 .3">
        <joint name="shoulder" axis="0 1 0" armature="0.05"/>
        <geom type="capsule" size=".04" fromto="0 0 0 .35 0 0" mass="2"/>
        <body name="fore" pos=".35 0 0">
          <joint name="elbow" axis="0 1 0" armature="0.02"/>
          <geom type="capsule" size=".03" fromto="0 0 0 .3 0 0" mass="1"/>
          <site name="tip" pos=".3 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
model = mujoco.MjModel.from_xml_string(MODEL)
model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT  # neighbouring links touch at their joint
arm = al.from_mujoco(model)
dt, steps, q0 = model.opt.timestep, 3000, np.array([0.1, -0.1, 0.3])
motion = al.Quintic([0.0, 0.0, 0.0], [1.2, -0.6, 1.5], duration=2.0)  # rad, s
law = al.ComputedTorque(arm, motion, kp=100.0, kd=20.0)  # 1/s^2, 1/s


def drive(integrator):
    """Joint angles of MuJoCo's arm under the law, rad, (steps + 1, 3)."""
    model.opt.integrator = integrator
    data = mujoco.MjData(model)
    data.qpos[:] = q0
    angles = [q0]
    for _ in range(steps):
        data.qfrc_applied[:] = law(data.time, data.qpos, data.qvel)
        mujoco.mj_step(model, data)
        angles.append(data.qpos.copy())
    return np.array(angles)


run = al.simulate(al.RigidArm(arm), law, q0, t_end=steps * dt, dt=dt, sample_time=dt, method="rk4")
runge_kutta, euler = drive(mujoco.mjtIntegrator.mjINT_RK4), drive(mujoco.mjtIntegrator.mjINT_EULER)
same, near = np.abs(runge_kutta - run.q).max(), np.abs(euler - run.q).max()
goal = np.abs(runge_kutta[-1] - motion(3.0)[0]).max()
print(f"MuJoCo by Runge-Kutta and armlet: {same:.1e} rad apart at most in {steps} steps")
print(f"MuJoCo by semi-implicit Euler and armlet: {near:.1e} rad")
print(f"distance to the goal after 3 s: {goal:.1e} rad")
# `same`: only rounding errors of the accelerations differ, and the loop does not amplify them. `near`: the error of Euler's method is
# proportional to the step.
assert same < 1e-10 and 1e-6 < near < 10.0 * dt and goal < 1e-4

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(9.0, 3.6), layout="constrained")
    angle, apart = figure.subplots(1, 2)
    for i, colour in enumerate(("#0072B2", "#D55E00", "#009E73")):
        angle.plot(run.t, runge_kutta[:, i], color=colour, label=arm.joint_names[i])
        angle.plot(run.t, run.desired()[0][:, i], "--", color=colour, linewidth=0.9)
    angle.set(xlabel="time (s)", ylabel="angle (rad)")
    angle.set_title("MuJoCo model, controlled by a law of armlet (dashed: desired)", loc="left", fontsize=10)
    angle.legend()
    for values, colour, name in ((euler, "#E69F00", "semi-implicit Euler"), (runge_kutta, "#0072B2", "Runge-Kutta")):
        difference = np.abs(values - run.q).max(axis=1)
        apart.semilogy(run.t, np.where(difference > 0.0, difference, np.nan), color=colour, label=f"MuJoCo with {name}")
    apart.set(xlabel="time (s)", ylabel="largest difference from armlet (rad)")
    apart.set_title("Difference of both simulations", loc="left", fontsize=10)
    apart.legend()
    figure.savefig(sys.argv[1], dpi=150)
