"""A reference implementation of armlet in numpy, with other derivations than the core. Tests compare the core with it.

The dynamics are derivatives of energies by complex steps, where the core has recursions. The adaptive integration is an extrapolation
method, where the core has Runge-Kutta and Rosenbrock methods. The reference is slow, and armlet never uses it in place of the core. Besides
the standard library, it imports only numpy.

The folder is flat, because each file has the equations of one law, plant or method.
"""

from . import integrate
from .adaptive import Adaptive
from .arm import Arm, planar_arm
from .bristles import LuGre
from .cartesian_path import cartesian_path
from .cartesian_path import curve as cartesian_curve
from .contact import JointStops, Wall
from .diagnosis import diagnose_priority
from .distance_task import DistanceTask
from .edit import from_dh, locked, with_frame, with_payload
from .elastic import ElasticLimits, damping_from_ratio, elastic_limits, smallest_reduced_inertia, stiffness_limit
from .events import Event
from .excitation import Excitation, excitation
from .gradient import fit, gradient, sensitivity
from .guarded import Guarded
from .identification import BaseParameters, Identification, base_parameters, identify
from .impedance import CartesianImpedance, ElasticImpedance, ElasticTracking, JointImpedance
from .inertia import ParameterReport, check_parameters, project_parameters
from .inverse_kinematics import InverseKinematics, inverse_kinematics
from .joint_tracking import JointTracking
from .lagrange import Mechanism
from .law import ComputedTorque, Law, PDGravity
from .mintime import torque_optimal_time
from .motion import BangBang, Hold, Quintic, Sinusoid, Table
from .null_space import NullSpace
from .observer import MomentumObserver
from .pid import PID
from .plant import ElasticArm, RigidArm
from .pr import Pendulum, PlanarPR, pendulum, planar_pr
from .priority import solve_priority
from .profiles import bang_bang_time, minimum_jerk_time, trapezoid_time
from .regulation import MotorPD, StateFeedback
from .rest_to_rest import point_to_point
from .samples import sample_rows, window_rows
from .samples import select as select_samples
from .sampling import Sampling, TorqueSensor
from .saturation import velocity_bounds
from .simulate import simulate
from .slopes import forward_dynamics_derivatives, inverse_dynamics_derivatives, linearize
from .spline import Spline
from .static_equilibrium import Equilibrium, equilibrium
from .stick_slip import StickSlip, stick_slip_run
from .suggested_gains import SuggestedGains, suggest_gains
from .tasks import AxisTask, CentreOfMassTask, JointLimitTask, PostureTask, RelativeTask, Task
from .time_path import Timing, time_path
from .timed_path import TimedPath
from .velocity import PriorityAcceleration, PriorityVelocity, VelocityArm

__all__ = [
    "PID",
    "Adaptive",
    "Arm",
    "AxisTask",
    "BangBang",
    "BaseParameters",
    "CartesianImpedance",
    "CentreOfMassTask",
    "ComputedTorque",
    "DistanceTask",
    "ElasticArm",
    "ElasticImpedance",
    "ElasticLimits",
    "ElasticTracking",
    "Equilibrium",
    "Event",
    "Excitation",
    "Guarded",
    "Hold",
    "Identification",
    "InverseKinematics",
    "JointImpedance",
    "JointLimitTask",
    "JointStops",
    "JointTracking",
    "Law",
    "LuGre",
    "Mechanism",
    "MomentumObserver",
    "MotorPD",
    "NullSpace",
    "PDGravity",
    "ParameterReport",
    "Pendulum",
    "PlanarPR",
    "PostureTask",
    "PriorityAcceleration",
    "PriorityVelocity",
    "Quintic",
    "RelativeTask",
    "RigidArm",
    "Sampling",
    "Sinusoid",
    "Spline",
    "StateFeedback",
    "StickSlip",
    "SuggestedGains",
    "Table",
    "Task",
    "TimedPath",
    "Timing",
    "TorqueSensor",
    "VelocityArm",
    "Wall",
    "bang_bang_time",
    "base_parameters",
    "cartesian_curve",
    "cartesian_path",
    "check_parameters",
    "damping_from_ratio",
    "diagnose_priority",
    "elastic_limits",
    "equilibrium",
    "excitation",
    "fit",
    "forward_dynamics_derivatives",
    "from_dh",
    "gradient",
    "identify",
    "integrate",
    "inverse_dynamics_derivatives",
    "inverse_kinematics",
    "linearize",
    "locked",
    "minimum_jerk_time",
    "pendulum",
    "planar_arm",
    "planar_pr",
    "point_to_point",
    "project_parameters",
    "sample_rows",
    "select_samples",
    "sensitivity",
    "simulate",
    "smallest_reduced_inertia",
    "solve_priority",
    "stick_slip_run",
    "stiffness_limit",
    "suggest_gains",
    "time_path",
    "torque_optimal_time",
    "trapezoid_time",
    "velocity_bounds",
    "window_rows",
    "with_frame",
    "with_payload",
]
