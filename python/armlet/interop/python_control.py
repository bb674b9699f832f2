"""Arms and closed loops as systems of python-control: nonlinear systems, and linear systems about a state, also from sample to sample.

`linear_loop.py` has the equations.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._core import Arm, Law, Plant
from ..arguments import number, require_partner
from ..border import border
from ..errors import InputError
from ..extras import extra
from ..linear_loop import LinearLoop, sampling_of
from ..run.sampling import Sampling

__all__ = ["to_control"]


@border
def to_control(
    plant: Plant | Arm,
    law: Law | None = None,
    x0: ArrayLike | None = None,
    *,
    t: float = 0.0,
    u0: ArrayLike | None = None,
    sample_time: float | Sampling | None = None,
) -> Any:
    """Convert an arm, or the closed loop of an arm and a law, to a system of python-control (extra `control`).

    The inputs of an arm are `tau1..`, N m or N (`u1..` of a velocity-controlled arm, rad/s or m/s). The inputs of a loop are disturbances
    `d1..`, which are added to the arm's inputs. The states are `q1..`, `v1..`, `theta1..`, `theta_dot1..`, `estimate1..`. The outputs are
    the states and, of a loop, also the law's outputs `tau1..` or `u1..`. The states `estimate1..` are the state of the law, in the order of
    `Run.estimate`: adaptive estimates, integrals, and states of filters and observers.

    Args:
        plant: the plant, without a wall and without joint stops; an arm means `RigidArm(arm)`.
        law: the law of the loop; None: only the arm.
        x0: None: return the nonlinear system. Otherwise linearise about this state: q, (n,), or all states. With q alone, the arm is at
            rest, the springs support gravity, and the law has the state of the start of a run. The states of the linear system are
            deviations from this state.
        t: time of the law for the linearisation, s. It requires a law and `x0`.
        u0: input about which an arm is linearised, (n,). None: the input with which a rigid arm has zero acceleration; zero for a
            velocity-controlled arm. With a law, the law determines it.
        sample_time: period of the samples, s, or a `Sampling` whose `delay` and `sensor_delay` count, without jitter, rate limit and torque
            sensor. The linear system then goes from sample to sample, and holds its input for one period. Delays add states, such as
            `tau1_past1`. None: continuous time. It requires `x0`.

    Returns:
        A `control.NonlinearIOSystem`; with `x0` a `control.StateSpace`, in discrete time with `sample_time`.

    Raises:
        InputError: an argument has a wrong type, shape or value, or the plant has a wall, joint stops, `LuGre`
            or `StickSlip` friction.
        ImportError: python-control is not installed.

    Source: Carpentier and Mansard 2018; Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998.

    >>> import armlet as al
    >>> arm = al.pendulum(1.0, 4.0)
    >>> sorted(al.to_control(arm, x0=[0.0]).poles().imag.round(9).tolist())
    [-2.0, 2.0]
    >>> law = al.ComputedTorque(arm, al.Hold([0.5]), kp=8.0, kd=6.0)
    >>> sorted(al.to_control(arm, law, [0.5]).poles().real.round(6).tolist())
    [-4.0, -2.0]
    >>> al.to_control(arm, law).state_labels
    ['q1', 'v1']
    >>> sampled = al.to_control(arm, law, [0.5], sample_time=al.Sampling(0.01, delay=0.01))
    >>> sampled.dt, sampled.state_labels
    (0.01, ['q1', 'v1', 'tau1_past1'])
    """
    control = extra("to_control", "control", "control", "python-control")
    loop = LinearLoop("to_control", plant, law)
    names = {"inputs": loop.inputs, "outputs": loop.outputs, "states": loop.states}
    t = number("to_control", "t", t)
    require_partner("to_control", "t", t, "law and x0", law is not None and x0 is not None, 0.0)
    require_partner("to_control", "sample_time", sample_time, "x0", x0 is not None)
    sampling = sampling_of("to_control", sample_time, law)
    if x0 is None:
        if u0 is not None:
            raise InputError("to_control: u0 is given without x0: expected the state to linearise about")
        return control.nlsys(
            lambda t, x, u, params: loop.rates(t, np.asarray(x, dtype=np.float64), np.asarray(u, dtype=np.float64)),
            lambda t, x, u, params: loop.output(t, np.asarray(x, dtype=np.float64)),
            **names,
            name=loop.name,
        )
    if law is not None and u0 is not None:
        raise InputError("to_control: u0 is given with a law: expected None, since the law has the input")
    names["states"] = loop.states + ([] if sampling is None else loop.past(sampling))
    names["outputs"] = names["states"] + loop.outputs[len(loop.states) :]
    period = 0 if sampling is None else sampling.period
    return control.StateSpace(*loop.linear(t, loop.state(x0), u0, sampling), period, **names, name=f"{loop.name}, linear")
