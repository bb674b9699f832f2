"""Types of the extension module `armlet._core`, one file per concept. `stubtest` compares them with the compiled module."""

from .arms import Arm as Arm
from .arms import _restore as _restore
from .arms import _restore_arm as _restore_arm
from .arms import _restore_array as _restore_array
from .arms import _restore_planar_pr as _restore_planar_pr
from .arms import _restore_tree as _restore_tree
from .arms import _seal as _seal
from .arms import _share as _share
from .arms import _stored_array as _stored_array
from .arms import _urdf_joints as _urdf_joints
from .arms import example_urdf as example_urdf
from .arms import load_urdf as load_urdf
from .arms import pendulum as pendulum
from .arms import planar_arm as planar_arm
from .arms import planar_pr as planar_pr
from .arms import project_parameters as project_parameters
from .arrays import numbers as numbers
from .elastic import damping_from_ratio as damping_from_ratio
from .elastic import elastic_limits as elastic_limits
from .elastic import equilibrium as equilibrium
from .elastic import smallest_reduced_inertia as smallest_reduced_inertia
from .elastic import stiffness_limit as stiffness_limit
from .integration import Stepper as Stepper
from .integration import integrate as integrate
from .laws import PID as PID
from .laws import Adaptive as Adaptive
from .laws import CartesianImpedance as CartesianImpedance
from .laws import ComputedTorque as ComputedTorque
from .laws import ElasticImpedance as ElasticImpedance
from .laws import ElasticTracking as ElasticTracking
from .laws import Guarded as Guarded
from .laws import JointImpedance as JointImpedance
from .laws import JointTracking as JointTracking
from .laws import Law as Law
from .laws import MotorPD as MotorPD
from .laws import PDGravity as PDGravity
from .laws import StateFeedback as StateFeedback
from .laws import _select_samples as _select_samples
from .motions import BangBang as BangBang
from .motions import Hold as Hold
from .motions import Motion as Motion
from .motions import Quintic as Quintic
from .motions import Sinusoid as Sinusoid
from .motions import Spline as Spline
from .motions import Table as Table
from .motions import TimedPath as TimedPath
from .motions import _restore_time_path as _restore_time_path
from .motions import _spline_slopes as _spline_slopes
from .motions import time_path as time_path
from .plans import BangBangBatch as BangBangBatch
from .plans import BangBangReport as BangBangReport
from .plans import Best as Best
from .plans import Bind as Bind
from .plans import ProfileReport as ProfileReport
from .plans import TorqueOptimum as TorqueOptimum
from .plans import _restore_plan as _restore_plan
from .plans import bang_bang_time as bang_bang_time
from .plans import minimum_jerk_time as minimum_jerk_time
from .plans import torque_optimal_time as torque_optimal_time
from .plans import trapezoid_time as trapezoid_time
from .plants import ElasticArm as ElasticArm
from .plants import Plant as Plant
from .plants import RigidArm as RigidArm
from .plants import VelocityArm as VelocityArm
from .plants import Wall as Wall
from .printing import _c_of_arm as _c_of_arm
from .printing import _c_of_law as _c_of_law
from .printing import _c_of_observer as _c_of_observer
from .printing import _wasm_of_operations as _wasm_of_operations
from .printing import _web_loop as _web_loop
from .priority import PrioritySolution as PrioritySolution
from .priority import PrioritySolver as PrioritySolver
from .priority import Within as Within
from .priority import _priority_reasons as _priority_reasons
from .priority import diagnose_priority as diagnose_priority
from .priority import solve_priority as solve_priority
from .priority import velocity_bounds as velocity_bounds
from .simulation import MomentumObserver as MomentumObserver
from .simulation import Simulator as Simulator
from .simulation import _adjoint as _adjoint
from .simulation import _adjoint_of_rows as _adjoint_of_rows
from .simulation import _BatchStepper as _BatchStepper
from .simulation import _restore_observer as _restore_observer
from .simulation import _restore_simulator as _restore_simulator
from .simulation import _sensitivities as _sensitivities
from .simulation import _sensitivities_of_rows as _sensitivities_of_rows
from .simulation import build_info as build_info
from .simulation import loop_program as loop_program
from .simulation import simulate as simulate
from .simulation import simulate_batch as simulate_batch
from .simulation import statuses as statuses
from .suggested_gains import SuggestedGains as SuggestedGains
from .suggested_gains import suggest_gains as suggest_gains
from .tasks import ArmPrioritySolver as ArmPrioritySolver
from .tasks import AxisTask as AxisTask
from .tasks import CentreOfMassTask as CentreOfMassTask
from .tasks import DistanceTask as DistanceTask
from .tasks import InverseKinematics as InverseKinematics
from .tasks import JointLimitTask as JointLimitTask
from .tasks import PostureTask as PostureTask
from .tasks import PriorityAcceleration as PriorityAcceleration
from .tasks import PriorityVelocity as PriorityVelocity
from .tasks import RelativeTask as RelativeTask
from .tasks import Task as Task
from .tasks import _restore_arm_solver as _restore_arm_solver
from .tasks import inverse_kinematics as inverse_kinematics

__all__ = [
    "ADAPTIVE_METHODS",
    "METHODS",
    "PID",
    "Adaptive",
    "Arm",
    "ArmPrioritySolver",
    "AxisTask",
    "BangBang",
    "BangBangBatch",
    "BangBangReport",
    "Best",
    "Bind",
    "CartesianImpedance",
    "CentreOfMassTask",
    "ComputedTorque",
    "DistanceTask",
    "ElasticArm",
    "ElasticImpedance",
    "ElasticTracking",
    "Guarded",
    "Hold",
    "InverseKinematics",
    "JointImpedance",
    "JointLimitTask",
    "JointTracking",
    "Law",
    "MomentumObserver",
    "Motion",
    "MotorPD",
    "PDGravity",
    "Plant",
    "PostureTask",
    "PriorityAcceleration",
    "PrioritySolution",
    "PrioritySolver",
    "PriorityVelocity",
    "ProfileReport",
    "Quintic",
    "RelativeTask",
    "RigidArm",
    "Simulator",
    "Sinusoid",
    "Spline",
    "StateFeedback",
    "Stepper",
    "SuggestedGains",
    "Table",
    "Task",
    "TimedPath",
    "TorqueOptimum",
    "VelocityArm",
    "Wall",
    "Within",
    "_BatchStepper",
    "__version__",
    "_adjoint",
    "_adjoint_of_rows",
    "_c_of_arm",
    "_c_of_law",
    "_c_of_observer",
    "_priority_reasons",
    "_restore",
    "_restore_arm",
    "_restore_arm_solver",
    "_restore_array",
    "_restore_observer",
    "_restore_plan",
    "_restore_planar_pr",
    "_restore_simulator",
    "_restore_time_path",
    "_restore_tree",
    "_seal",
    "_select_samples",
    "_sensitivities",
    "_sensitivities_of_rows",
    "_share",
    "_spline_slopes",
    "_stored_array",
    "_urdf_joints",
    "_wasm_of_operations",
    "_web_loop",
    "bang_bang_time",
    "build_info",
    "damping_from_ratio",
    "diagnose_priority",
    "elastic_limits",
    "equilibrium",
    "example_urdf",
    "integrate",
    "inverse_kinematics",
    "load_urdf",
    "loop_program",
    "minimum_jerk_time",
    "numbers",
    "pendulum",
    "planar_arm",
    "planar_pr",
    "project_parameters",
    "simulate",
    "simulate_batch",
    "smallest_reduced_inertia",
    "solve_priority",
    "statuses",
    "stiffness_limit",
    "suggest_gains",
    "time_path",
    "torque_optimal_time",
    "trapezoid_time",
    "velocity_bounds",
]

METHODS: tuple[str, ...]
ADAPTIVE_METHODS: tuple[str, ...]
__version__: str
