"""Simulation, control and planning of robot arms, computed in Rust. By default, a run records the residuals of identities such as the
energy balance.

>>> import armlet as al
>>> arm = al.planar_pr(2.0, 0.5, 0.5)
>>> law = al.Adaptive(arm, al.Quintic([0.0, 0.0], [1.0, 1.5], 3.0), kp=40.0, kd=20.0, gamma=5.0)
>>> run = al.simulate(al.RigidArm(arm), law, [0.1, -0.2], t_end=5.0, dt=1e-3)
>>> run.status
<Status.SUCCESS: 0>
"""

# The folder is flat, because each public name without a folder has one file.
from ._core import (
    PID,
    Adaptive,
    Arm,
    ArmPrioritySolver,
    AxisTask,
    BangBang,
    BangBangBatch,
    BangBangReport,
    CartesianImpedance,
    CentreOfMassTask,
    ComputedTorque,
    DistanceTask,
    ElasticArm,
    ElasticImpedance,
    ElasticTracking,
    Guarded,
    Hold,
    InverseKinematics,
    JointImpedance,
    JointLimitTask,
    JointTracking,
    Law,
    MomentumObserver,
    Motion,
    MotorPD,
    PDGravity,
    Plant,
    PostureTask,
    PriorityAcceleration,
    PrioritySolution,
    PrioritySolver,
    PriorityVelocity,
    ProfileReport,
    Quintic,
    RelativeTask,
    RigidArm,
    Simulator,
    Sinusoid,
    Spline,
    StateFeedback,
    SuggestedGains,
    Table,
    Task,
    TimedPath,
    TorqueOptimum,
    VelocityArm,
    Wall,
    Within,
    __version__,
    bang_bang_time,
    build_info,
    damping_from_ratio,
    example_urdf,
    inverse_kinematics,
    load_urdf,
    minimum_jerk_time,
    pendulum,
    planar_arm,
    planar_pr,
    project_parameters,
    smallest_reduced_inertia,
    solve_priority,
    stiffness_limit,
    suggest_gains,
    time_path,
    torque_optimal_time,
    trapezoid_time,
    velocity_bounds,
)
from .active_bounds import Active
from .cartesian import CartesianPath, cartesian_path
from .elastic import ElasticLimits, Equilibrium, elastic_limits, equilibrium
from .errors import ArmletError, FormatError, InputError, InternalError, ModelError, SolveError
from .excitation import ExcitingMotion, exciting_motion
from .figures.comparison import compare
from .fitting import LogFit, Refuted, fit_log
from .friction_models import LuGre, StickSlip
from .identification import BaseParameters, Identification, ParameterReport
from .integration import DenseOutput, Integration, integrate
from .interop import Verification, from_mujoco, from_pinocchio, scipy_method, to_control, verify
from .logs import Log, LogReport, read_log
from .loop_margins import LoopMargins, loop_margins
from .null_space import NullSpace
from .printed import export_c
from .priority import PriorityDiagnosis, diagnose_priority
from .rest_to_rest import point_to_point
from .run import BatchRun, Run, load
from .run.active_limits import LimitHold
from .run.events import Event, Events, JointStops, State
from .run.gradients import gradient
from .run.guards import Contact
from .run.identifying import RunIdentification, identify_from_runs
from .run.metrics import Metrics, metrics
from .run.programs import LoopProgram, loop_program
from .run.sampling import Sampling, TorqueSensor
from .run.sensitivity import Sensitivity
from .run.simulation import simulate, simulate_batch
from .samples import Samples, select_samples
from .scenario import Scenario
from .srdf import Srdf, SrdfGroup, load_srdf
from .status import Status
from .sweeping import SweepTable, Tuning, WorstCase, sweep, tune, worst_case
from .web import export_web

__all__ = [  # noqa: RUF022 - in the order of `dir`
    "Active",
    "Adaptive",
    "Arm",
    "ArmPrioritySolver",
    "ArmletError",
    "AxisTask",
    "BangBang",
    "BangBangBatch",
    "BangBangReport",
    "BaseParameters",
    "BatchRun",
    "CartesianImpedance",
    "CartesianPath",
    "CentreOfMassTask",
    "ComputedTorque",
    "Contact",
    "DenseOutput",
    "DistanceTask",
    "ElasticArm",
    "ElasticImpedance",
    "ElasticLimits",
    "ElasticTracking",
    "Equilibrium",
    "Event",
    "Events",
    "ExcitingMotion",
    "FormatError",
    "Guarded",
    "Hold",
    "Identification",
    "InputError",
    "Integration",
    "InternalError",
    "InverseKinematics",
    "JointImpedance",
    "JointLimitTask",
    "JointStops",
    "JointTracking",
    "Law",
    "LimitHold",
    "Log",
    "LogFit",
    "LogReport",
    "LoopMargins",
    "LoopProgram",
    "LuGre",
    "Metrics",
    "ModelError",
    "MomentumObserver",
    "Motion",
    "MotorPD",
    "NullSpace",
    "PDGravity",
    "PID",
    "ParameterReport",
    "Plant",
    "PostureTask",
    "PriorityAcceleration",
    "PriorityDiagnosis",
    "PrioritySolution",
    "PrioritySolver",
    "PriorityVelocity",
    "ProfileReport",
    "Quintic",
    "Refuted",
    "RelativeTask",
    "RigidArm",
    "Run",
    "RunIdentification",
    "Samples",
    "Sampling",
    "Scenario",
    "Sensitivity",
    "Simulator",
    "Sinusoid",
    "SolveError",
    "Spline",
    "Srdf",
    "SrdfGroup",
    "State",
    "StateFeedback",
    "Status",
    "StickSlip",
    "SuggestedGains",
    "SweepTable",
    "Table",
    "Task",
    "TimedPath",
    "TorqueOptimum",
    "TorqueSensor",
    "Tuning",
    "VelocityArm",
    "Verification",
    "Wall",
    "Within",
    "WorstCase",
    "__version__",
    "bang_bang_time",
    "build_info",
    "cartesian_path",
    "compare",
    "damping_from_ratio",
    "diagnose_priority",
    "elastic_limits",
    "equilibrium",
    "example_urdf",
    "exciting_motion",
    "export_c",
    "export_web",
    "fit_log",
    "from_mujoco",
    "from_pinocchio",
    "gradient",
    "identify_from_runs",
    "integrate",
    "inverse_kinematics",
    "load",
    "load_srdf",
    "load_urdf",
    "loop_margins",
    "loop_program",
    "metrics",
    "minimum_jerk_time",
    "pendulum",
    "planar_arm",
    "planar_pr",
    "point_to_point",
    "project_parameters",
    "read_log",
    "scipy_method",
    "select_samples",
    "simulate",
    "simulate_batch",
    "smallest_reduced_inertia",
    "solve_priority",
    "stiffness_limit",
    "suggest_gains",
    "sweep",
    "time_path",
    "to_control",
    "torque_optimal_time",
    "trapezoid_time",
    "tune",
    "velocity_bounds",
    "verify",
    "worst_case",
]


def __dir__() -> list[str]:
    return sorted(__all__)
