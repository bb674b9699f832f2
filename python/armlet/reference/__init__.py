"""The same robotics in plain numpy, each result derived by another route than the core takes; imports numpy only.

It exists to be compared with: dynamics from energies by complex step instead of recursions, an extrapolation method
instead of Runge-Kutta pairs, sampling and event simulation instead of closed forms. Slow, and never a fallback.
"""

from . import integrate
from .arm import Arm, planar_arm
from .elastic import Equilibrium, equilibrium
from .impedance import CartesianImpedance, ElasticImpedance
from .lagrange import Mechanism
from .law import Adaptive, ComputedTorque, Law, PDGravity
from .mintime import bang_bang_time, torque_optimal_time
from .motion import BangBang, Hold, Quintic, Sinusoid
from .plant import ElasticArm, RigidArm
from .pr import Pendulum, PlanarPR, pendulum, planar_pr
from .priority import diagnose_priority, solve_priority
from .simulate import simulate
from .velocity import PriorityVelocity, Task, VelocityArm

__all__ = [
    "Adaptive",
    "Arm",
    "BangBang",
    "CartesianImpedance",
    "ComputedTorque",
    "ElasticArm",
    "ElasticImpedance",
    "Equilibrium",
    "Hold",
    "Law",
    "Mechanism",
    "PDGravity",
    "Pendulum",
    "PlanarPR",
    "PriorityVelocity",
    "Quintic",
    "RigidArm",
    "Sinusoid",
    "Task",
    "VelocityArm",
    "bang_bang_time",
    "diagnose_priority",
    "equilibrium",
    "integrate",
    "pendulum",
    "planar_arm",
    "planar_pr",
    "simulate",
    "solve_priority",
    "torque_optimal_time",
]
