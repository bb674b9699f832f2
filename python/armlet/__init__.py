"""Robot-arm control loops closed natively: arm x plant x law x motion x method, run in Rust, audited by theory.

>>> import armlet as al
>>> arm = al.planar_pr(2.0, 0.5, 0.5)
>>> law = al.Adaptive(arm, al.Quintic([0.0, 0.0], [1.0, 1.5], 3.0), kp=40.0, kd=20.0, gamma=5.0)
>>> run = al.simulate(al.RigidArm(arm), law, [0.1, -0.2], t_end=5.0, dt=1e-3)
>>> run.status
<Status.SUCCESS: 0>
"""

from ._core import (
    Adaptive,
    Arm,
    BangBang,
    BangBangBatch,
    BangBangReport,
    CartesianImpedance,
    ComputedTorque,
    ElasticArm,
    ElasticImpedance,
    ElasticTracking,
    Hold,
    JointImpedance,
    Law,
    Motion,
    MotorPD,
    PDGravity,
    Plant,
    PrioritySolution,
    PrioritySolver,
    ProfileReport,
    Quintic,
    RigidArm,
    Simulator,
    Sinusoid,
    StateFeedback,
    Table,
    TimedPath,
    TorqueOptimum,
    VelocityArm,
    Wall,
    __version__,
    bang_bang_time,
    build_info,
    damping_from_ratio,
    example_urdf,
    load_urdf,
    minimum_jerk_time,
    pendulum,
    planar_arm,
    planar_pr,
    project_parameters,
    smallest_reduced_inertia,
    solve_priority,
    stiffness_limit,
    time_path,
    torque_optimal_time,
    trapezoid_time,
    velocity_bounds,
)
from .comparison import compare
from .elastic import ElasticLimits, Equilibrium, elastic_limits, equilibrium
from .errors import ArmletError, FormatError, InputError, InternalError, ModelError, SolveError
from .identification import BaseParameters, Identification, ParameterReport
from .integration import DenseOutput, Integration, integrate
from .interop import Verification, from_mujoco, from_pinocchio, verify
from .priority import PriorityDiagnosis, diagnose_priority
from .run import BatchRun, Run
from .run_metrics import Metrics, metrics
from .sampling import Sampling
from .scenario import Scenario
from .scipy_method import scipy_method
from .simulation import simulate, simulate_batch
from .status import Status
from .storage import load
from .sweeping import SweepTable, sweep

__all__ = [
    "Adaptive",
    "Arm",
    "ArmletError",
    "BangBang",
    "BangBangBatch",
    "BangBangReport",
    "BaseParameters",
    "BatchRun",
    "CartesianImpedance",
    "ComputedTorque",
    "DenseOutput",
    "ElasticArm",
    "ElasticImpedance",
    "ElasticLimits",
    "ElasticTracking",
    "Equilibrium",
    "FormatError",
    "Hold",
    "Identification",
    "InputError",
    "Integration",
    "InternalError",
    "JointImpedance",
    "Law",
    "Metrics",
    "ModelError",
    "Motion",
    "MotorPD",
    "PDGravity",
    "ParameterReport",
    "Plant",
    "PriorityDiagnosis",
    "PrioritySolution",
    "PrioritySolver",
    "ProfileReport",
    "Quintic",
    "RigidArm",
    "Run",
    "Sampling",
    "Scenario",
    "Simulator",
    "Sinusoid",
    "SolveError",
    "StateFeedback",
    "Status",
    "SweepTable",
    "Table",
    "TimedPath",
    "TorqueOptimum",
    "VelocityArm",
    "Verification",
    "Wall",
    "__version__",
    "bang_bang_time",
    "build_info",
    "compare",
    "damping_from_ratio",
    "diagnose_priority",
    "elastic_limits",
    "equilibrium",
    "example_urdf",
    "from_mujoco",
    "from_pinocchio",
    "integrate",
    "load",
    "load_urdf",
    "metrics",
    "minimum_jerk_time",
    "pendulum",
    "planar_arm",
    "planar_pr",
    "project_parameters",
    "scipy_method",
    "simulate",
    "simulate_batch",
    "smallest_reduced_inertia",
    "solve_priority",
    "stiffness_limit",
    "sweep",
    "time_path",
    "torque_optimal_time",
    "trapezoid_time",
    "velocity_bounds",
    "verify",
]


def __dir__() -> list[str]:
    return sorted(__all__)
