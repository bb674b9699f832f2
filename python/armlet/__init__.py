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
    AxisTask,
    BangBang,
    BangBangBatch,
    BangBangReport,
    CartesianImpedance,
    CentreOfMassTask,
    ComputedTorque,
    ElasticArm,
    Hold,
    JointLimitTask,
    Law,
    Motion,
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
    Sinusoid,
    Table,
    Task,
    TorqueOptimum,
    VelocityArm,
    Wall,
    __version__,
    bang_bang_time,
    build_info,
    example_urdf,
    load_urdf,
    minimum_jerk_time,
    pendulum,
    planar_arm,
    planar_pr,
    solve_priority,
    torque_optimal_time,
    trapezoid_time,
    velocity_bounds,
)
from .errors import ArmletError, FormatError, InputError, InternalError, ModelError, SolveError
from .priority import PriorityDiagnosis, diagnose_priority
from .run import BatchRun, Run
from .sampling import Sampling
from .simulation import simulate, simulate_batch
from .status import Status
from .storage import load

__all__ = [
    "Adaptive",
    "Arm",
    "ArmletError",
    "AxisTask",
    "BangBang",
    "BangBangBatch",
    "BangBangReport",
    "BatchRun",
    "CartesianImpedance",
    "CentreOfMassTask",
    "ComputedTorque",
    "ElasticArm",
    "FormatError",
    "Hold",
    "InputError",
    "InternalError",
    "JointLimitTask",
    "Law",
    "ModelError",
    "Motion",
    "PDGravity",
    "Plant",
    "PostureTask",
    "PriorityAcceleration",
    "PriorityDiagnosis",
    "PrioritySolution",
    "PrioritySolver",
    "PriorityVelocity",
    "ProfileReport",
    "Quintic",
    "RelativeTask",
    "RigidArm",
    "Run",
    "Sampling",
    "Sinusoid",
    "SolveError",
    "Status",
    "Table",
    "Task",
    "TorqueOptimum",
    "VelocityArm",
    "Wall",
    "__version__",
    "bang_bang_time",
    "build_info",
    "diagnose_priority",
    "example_urdf",
    "load",
    "load_urdf",
    "minimum_jerk_time",
    "pendulum",
    "planar_arm",
    "planar_pr",
    "simulate",
    "simulate_batch",
    "solve_priority",
    "torque_optimal_time",
    "trapezoid_time",
    "velocity_bounds",
]


def __dir__() -> list[str]:
    return sorted(__all__)
