"""The loop of all programs in this folder: arm, law, initial state, and the messages between robot and controller.

Messages are datagrams of float64 in the byte order of this machine. Command `k` is `[k, tau (n)]`; its torque acts for one sample. The
answer is the state after this sample, `[k + 1, q (n), v (n)]`. Command -1 has arbitrary torques, and its answer is the initial state.
"""

import numpy as np

import armlet as al

HOST = "127.0.0.1"
START = -1.0

arm = al.load_urdf(al.example_urdf("seven_axis"))
plant = al.RigidArm(arm)
motion = al.Sinusoid([0.3] * arm.n, [0.2] * arm.n, [2.0] * arm.n, [0.0] * arm.n)
law = al.Adaptive(arm, motion, kp=40.0, kd=20.0, gamma=0.1)
q0 = np.full(arm.n, 0.25)
n = arm.n


def expected(rate: float, samples: int) -> np.ndarray:
    """State `[q, v]` after `samples` samples of this loop, simulated by armlet alone."""
    dt = 1.0 / rate
    # The run has one additional step, whose result is not used, because the last step ends at `t_end` and may differ from `dt` by rounding.
    options = {"monitors": False, "check_limits": False}  # the motion leaves the range of the fourth joint
    run = al.simulate(plant, law, q0, t_end=(samples + 1) * dt, dt=dt, sample_time=dt, **options)
    return np.concatenate([run.q[samples], run.v[samples]])
