"""Types of the extension module; checked against it by stubtest."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from typing import Any, Self, SupportsIndex, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

from .priority import PriorityDiagnosis
from .status import Status

__all__ = [
    "Adaptive",
    "Arm",
    "ArmPrioritySolver",
    "AxisTask",
    "BangBang",
    "BangBangBatch",
    "BangBangReport",
    "Best",
    "Bind",
    "CentreOfMassTask",
    "ComputedTorque",
    "Hold",
    "InverseKinematics",
    "JointLimitTask",
    "Law",
    "Motion",
    "PostureTask",
    "PriorityAcceleration",
    "PrioritySolution",
    "PrioritySolver",
    "PriorityVelocity",
    "ProfileReport",
    "Quintic",
    "RelativeTask",
    "RigidArm",
    "Sinusoid",
    "Table",
    "Task",
    "TorqueOptimum",
    "__version__",
    "_restore_arm_solver",
    "_restore_plan",
    "_restore_planar_pr",
    "_restore_tree",
    "bang_bang_time",
    "build_info",
    "diagnose_priority",
    "example_urdf",
    "inverse_kinematics",
    "load_urdf",
    "minimum_jerk_time",
    "pendulum",
    "planar_arm",
    "planar_pr",
    "simulate",
    "simulate_batch",
    "solve_priority",
    "statuses",
    "torque_optimal_time",
    "trapezoid_time",
    "velocity_bounds",
]

_Array = NDArray[np.float64]
_Flags = NDArray[np.bool_]
_Number = float | np.floating[Any] | np.integer[Any]

__version__: str

def build_info() -> dict[str, Any]: ...
def statuses() -> list[tuple[int, str, str]]: ...
def planar_pr(A: float, B: float, C: float) -> Arm: ...
def planar_arm(
    lengths: ArrayLike,
    *,
    masses: ArrayLike | None = None,
    coms: ArrayLike | None = None,
    inertias: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> Arm: ...
def pendulum(inertia: float, gravity_moment: float) -> Arm: ...
def load_urdf(
    path_or_xml: str | PathLike[str], *, gravity: ArrayLike | None = None, root: str | None = None, tip: str | None = None
) -> Arm: ...
def example_urdf(name: str) -> str: ...
def _restore_planar_pr(pi: Sequence[float]) -> Arm: ...
def _restore_tree(state: tuple[Any, ...]) -> Arm: ...
def simulate(plant: Plant, law: Law | Callable[..., ArrayLike], q0: ArrayLike, keywords: dict[str, Any]) -> dict[str, Any]: ...
def simulate_batch(plant: Plant | Sequence[Plant], law: Law | Sequence[Law], q0: ArrayLike, keywords: dict[str, Any]) -> dict[str, Any]: ...
def solve_priority(
    jacobians: Sequence[ArrayLike],
    velocities: Sequence[ArrayLike],
    *,
    method: str = "clamp",
    eps: ArrayLike | None = None,
    rounding: float | None = None,
    weight: ArrayLike | None = None,
    v_min: ArrayLike | None = None,
    v_max: ArrayLike | None = None,
) -> PrioritySolution: ...
def diagnose_priority(jacobians: Sequence[ArrayLike], rhs: Sequence[ArrayLike] | None, rounding: float | None) -> dict[str, Any]: ...
def velocity_bounds(
    q: ArrayLike, q_min: ArrayLike, q_max: ArrayLike, v_max: ArrayLike, *, dt: float, a_max: ArrayLike | None = None
) -> tuple[_Array, _Array]: ...

@final
class PrioritySolution:
    def __new__(cls, v: _Array, residuals: list[_Array], ranks: Any, scales: _Array, status: Any) -> Self: ...
    @property
    def v(self) -> _Array: ...
    @property
    def residuals(self) -> list[_Array]: ...
    @property
    def ranks(self) -> Any: ...  # list[int]; integers (..., levels) in a batch
    @property
    def scales(self) -> _Array: ...
    @property
    def status(self) -> Any: ...  # Status; integers (...) in a batch
    def __getnewargs__(self) -> tuple[Any, ...]: ...

@final
class PrioritySolver:
    def __new__(
        cls,
        n: int,
        rows: Sequence[int],
        *,
        method: str = "clamp",
        eps: ArrayLike | None = None,
        rounding: float | None = None,
        weight: ArrayLike | None = None,
        v_min: ArrayLike | None = None,
        v_max: ArrayLike | None = None,
    ) -> Self: ...
    @staticmethod
    def for_arm(
        arm: Arm,
        tasks: Iterable[Task],
        *,
        method: str = "clamp",
        eps: ArrayLike | None = None,
        weight: ArrayLike | None = None,
        v_min: ArrayLike | None = None,
        v_max: ArrayLike | None = None,
    ) -> ArmPrioritySolver: ...
    def solve(self, jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike], *, out: _Array | None = None) -> _Array: ...
    def set_rounding(self, rounding: float) -> None: ...
    def set_bounds(self, v_min: ArrayLike, v_max: ArrayLike) -> None: ...
    @property
    def n(self) -> int: ...
    @property
    def rows(self) -> tuple[int, ...]: ...
    @property
    def method(self) -> str: ...
    @property
    def residuals(self) -> list[_Array]: ...
    @property
    def ranks(self) -> list[int]: ...
    @property
    def scales(self) -> _Array: ...
    @property
    def status(self) -> Status: ...
    def __getnewargs_ex__(self) -> tuple[tuple[int, list[int]], dict[str, Any]]: ...

@final
class Arm:
    @staticmethod
    def from_chain(joints: Iterable[Mapping[str, Any]], *, gravity: ArrayLike | None = None) -> Arm: ...
    @staticmethod
    def from_dh(rows: Iterable[Any], *, convention: str = "standard", gravity: ArrayLike | None = None) -> Arm: ...
    @property
    def n(self) -> int: ...
    @property
    def joint_names(self) -> tuple[str, ...]: ...
    @property
    def joint_types(self) -> tuple[str, ...]: ...
    @property
    def frame_names(self) -> tuple[str, ...]: ...
    @property
    def parameters(self) -> _Array: ...
    @property
    def limits(self) -> dict[str, _Array]: ...
    @property
    def report(self) -> tuple[str, ...]: ...
    def with_parameters(self, pi: ArrayLike) -> Arm: ...
    def with_gravity(self, gravity: ArrayLike) -> Arm: ...
    def with_frame(self, name: str, parent: str, *, xyz: Sequence[float] = ..., rpy: Sequence[float] = ...) -> Arm: ...
    def with_payload(self, frame: str, mass: float, com: Sequence[float] = ..., inertia: Sequence[Sequence[float]] = ...) -> Arm: ...
    def locked(self, joints: dict[str, float]) -> Arm: ...
    def to_urdf(self) -> tuple[str, list[str]]: ...
    def mass_matrix(self, q: ArrayLike, *, out: _Array | None = None) -> _Array: ...
    def coriolis_matrix(self, q: ArrayLike, v: ArrayLike, *, out: _Array | None = None) -> _Array: ...
    def gravity(self, q: ArrayLike, *, out: _Array | None = None) -> _Array: ...
    def bias(self, q: ArrayLike, v: ArrayLike, *, friction: bool = False, out: _Array | None = None) -> _Array: ...
    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        wrench: ArrayLike | None = None,
        wrench_frame: str | None = None,
        friction: bool = False,
        out: _Array | None = None,
    ) -> _Array: ...
    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        wrench: ArrayLike | None = None,
        wrench_frame: str | None = None,
        friction: bool = False,
        out: _Array | None = None,
    ) -> _Array: ...
    def regressor(
        self,
        q: ArrayLike,
        v: ArrayLike,
        v_r: ArrayLike,
        a_r: ArrayLike,
        *,
        armature: bool = False,
        friction: bool = False,
        out: _Array | None = None,
    ) -> _Array: ...
    def energy(self, q: ArrayLike, v: ArrayLike) -> tuple[_Array, _Array]: ...
    def pose(self, q: ArrayLike, frame: str, *, out: _Array | None = None) -> _Array: ...
    def position(self, q: ArrayLike, frame: str, *, out: _Array | None = None) -> _Array: ...
    def jacobian(self, q: ArrayLike, frame: str, *, out: _Array | None = None) -> _Array: ...
    def jacobian_dot(self, q: ArrayLike, v: ArrayLike, frame: str, *, out: _Array | None = None) -> _Array: ...
    def center_of_mass(self, q: ArrayLike, *, out: _Array | None = None) -> _Array: ...
    def center_of_mass_jacobian(self, q: ArrayLike, *, out: _Array | None = None) -> _Array: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...

@disjoint_base
class Plant:
    @property
    def arm(self) -> Arm: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Wall:
    def __new__(cls, frame: str, point: ArrayLike, normal: ArrayLike, *, stiffness: float, damping: float | None = None) -> Self: ...
    def __getnewargs_ex__(self) -> tuple[tuple[str, list[float], list[float]], dict[str, Any]]: ...

@final
class RigidArm(Plant):
    def __new__(cls, arm: Arm, *, friction: bool = False, wall: Wall | None = None) -> Self: ...

@final
class VelocityArm(Plant):
    def __new__(cls, arm: Arm) -> Self: ...

@final
class ElasticArm(Plant):
    def __new__(
        cls,
        arm: Arm,
        stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        *,
        joint_damping: ArrayLike | None = None,
        motor_friction: ArrayLike | None = None,
        wall: Wall | None = None,
    ) -> Self: ...

@disjoint_base
class Motion:
    @property
    def n(self) -> int: ...
    def __call__(self, /, t: float) -> tuple[_Array, _Array, _Array]: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class Hold(Motion):
    def __new__(cls, q: ArrayLike) -> Self: ...

@final
class Sinusoid(Motion):
    def __new__(cls, offset: ArrayLike, amplitude: ArrayLike, frequency: ArrayLike, phase: ArrayLike) -> Self: ...

@final
class Quintic(Motion):
    def __new__(cls, q0: ArrayLike, q1: ArrayLike, duration: float) -> Self: ...

@final
class BangBang(Motion):
    def __new__(cls, q0: ArrayLike, q1: ArrayLike, duration: float) -> Self: ...

@final
class Table(Motion):
    def __new__(cls, dt: float, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, start: float | None = None) -> Self: ...

@disjoint_base
class Law:
    @property
    def arm(self) -> Arm: ...
    @property
    def motion(self) -> Motion | None: ...
    def __call__(
        self,
        /,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        *,
        theta: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
        state: ArrayLike | None = None,
    ) -> _Array: ...
    def terms(
        self,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        *,
        theta: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
        state: ArrayLike | None = None,
    ) -> dict[str, Any]: ...  # arrays; lists with one entry per level for laws of tasks in priority
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Adaptive(Law):
    @property
    def motion(self) -> Motion: ...
    def __new__(
        cls, arm: Arm, motion: Motion, kp: ArrayLike, kd: ArrayLike, gamma: ArrayLike, *, estimate: ArrayLike | None = None
    ) -> Self: ...

@final
class ComputedTorque(Law):
    @property
    def motion(self) -> Motion: ...
    def __new__(cls, arm: Arm, motion: Motion, kp: ArrayLike, kd: ArrayLike) -> Self: ...

@final
class PDGravity(Law):
    def __new__(cls, arm: Arm, target: ArrayLike, kp: ArrayLike, kd: ArrayLike) -> Self: ...

@final
class CartesianImpedance(Law):
    def __new__(
        cls, arm: Arm, target: ArrayLike, stiffness: ArrayLike, damping: ArrayLike, *, frame: str, axes: str | None = None
    ) -> Self: ...

@overload
def bang_bang_time(  # numbers are arrays without axes: the first form wins
    theta0: _Number, thetaf: _Number, inertia: _Number, gravity_moment: _Number, tau_max: _Number, *, tau_min: _Number | None = None
) -> BangBangReport: ...
@overload
def bang_bang_time(
    theta0: ArrayLike,
    thetaf: ArrayLike,
    inertia: ArrayLike,
    gravity_moment: ArrayLike,
    tau_max: ArrayLike,
    *,
    tau_min: ArrayLike | None = None,
) -> BangBangBatch: ...
def trapezoid_time(
    theta0: _Number,
    thetaf: _Number,
    inertia: _Number,
    gravity_moment: _Number,
    tau_max: _Number,
    *,
    tau_min: _Number | None = None,
    ramp: _Number | None = None,
) -> ProfileReport: ...
def minimum_jerk_time(
    theta0: _Number, thetaf: _Number, inertia: _Number, gravity_moment: _Number, tau_max: _Number, *, tau_min: _Number | None = None
) -> ProfileReport: ...
def torque_optimal_time(
    theta0: _Number,
    thetaf: _Number,
    inertia: _Number,
    gravity_moment: _Number,
    tau_max: _Number,
    *,
    tau_min: _Number | None = None,
    viscous: _Number | None = None,
    coulomb: _Number | None = None,
) -> TorqueOptimum: ...
def _restore_plan(function: str, arguments: tuple[Any, ...]) -> Any: ...

@final
class BangBangReport:
    @property
    def feasible(self) -> bool: ...
    @property
    def t_min(self) -> float: ...
    @property
    def t_max(self) -> float: ...
    @property
    def a_min(self) -> float: ...
    @property
    def a_max(self) -> float: ...
    @property
    def hold_start(self) -> bool: ...
    @property
    def hold_end(self) -> bool: ...
    @property
    def reason(self) -> str: ...
    @property
    def active_upper(self) -> Bind: ...
    @property
    def active_lower(self) -> Bind | None: ...
    def torques(self, t: _Number) -> tuple[float, float, float, float]: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class Bind:
    @property
    def limit(self) -> str: ...
    @property
    def phase(self) -> int: ...
    @property
    def place(self) -> str: ...
    @property
    def theta(self) -> float: ...
    @property
    def time(self) -> float: ...
    @property
    def tie(self) -> bool: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class BangBangBatch:
    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def feasible(self) -> _Flags: ...
    @property
    def t_min(self) -> _Array: ...
    @property
    def t_max(self) -> _Array: ...
    @property
    def a_min(self) -> _Array: ...
    @property
    def a_max(self) -> _Array: ...
    @property
    def hold_start(self) -> _Flags: ...
    @property
    def hold_end(self) -> _Flags: ...
    @property
    def reason(self) -> NDArray[np.str_]: ...
    def __getitem__(self, index: SupportsIndex | tuple[SupportsIndex, ...], /) -> BangBangReport: ...

@final
class ProfileReport:
    @property
    def feasible(self) -> bool: ...
    @property
    def t_min(self) -> float: ...
    @property
    def t_max(self) -> float: ...
    @property
    def k_min(self) -> float: ...
    @property
    def k_max(self) -> float: ...
    @property
    def theta_upper(self) -> float: ...
    @property
    def theta_lower(self) -> float: ...
    @property
    def hold_start(self) -> bool: ...
    @property
    def hold_end(self) -> bool: ...
    @property
    def missing(self) -> float: ...
    @property
    def reason(self) -> str: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class TorqueOptimum:
    @property
    def feasible(self) -> bool: ...
    @property
    def t(self) -> float: ...
    @property
    def theta_switch(self) -> float: ...
    @property
    def t_switch(self) -> float: ...
    @property
    def v_peak(self) -> float: ...
    @property
    def certified_global(self) -> bool: ...
    @property
    def sturm_bound(self) -> float: ...
    @property
    def reason(self) -> str: ...
    @property
    def best(self) -> Best: ...
    @overload
    def profile(self, t: _Number) -> tuple[float, float, float, float]: ...
    @overload
    def profile(self, t: ArrayLike) -> tuple[_Array, _Array, _Array, _Array]: ...
    @overload
    def monotone_profile(self, t: _Number) -> tuple[float, float, float, float]: ...
    @overload
    def monotone_profile(self, t: ArrayLike) -> tuple[_Array, _Array, _Array, _Array]: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class Best:
    @property
    def kind(self) -> str: ...
    @property
    def t(self) -> float: ...
    @property
    def switches(self) -> tuple[float, ...]: ...
    @property
    def t_switches(self) -> tuple[float, ...]: ...
    @property
    def theta_turn(self) -> float: ...
    @property
    def t_turn(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...

# tasks in priority on arms
@disjoint_base
class Task:
    def __new__(
        cls,
        frame: str,
        axes: str,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class PostureTask(Task):
    def __new__(
        cls,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        joints: Iterable[str] | None = None,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class CentreOfMassTask(Task):
    def __new__(
        cls,
        axes: str,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class AxisTask(Task):
    def __new__(
        cls,
        frame: str,
        axis: ArrayLike,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class RelativeTask(Task):
    def __new__(
        cls,
        frame: str,
        reference: str,
        axes: str,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class JointLimitTask(Task):
    def __new__(
        cls,
        gain: ArrayLike | None = None,
        margin: float | None = None,
        *,
        joints: Iterable[str] | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class PriorityVelocity(Law):
    def __new__(
        cls,
        arm: Arm,
        tasks: Iterable[Task],
        method: str = "clamp",
        eps: ArrayLike | None = None,
        *,
        v_min: ArrayLike | None = None,
        v_max: ArrayLike | None = None,
    ) -> Self: ...

@final
class PriorityAcceleration(Law):
    def __new__(
        cls,
        arm: Arm,
        tasks: Iterable[Task],
        method: str = "clamp",
        eps: ArrayLike | None = None,
        *,
        joint_damping: float | None = None,
    ) -> Self: ...

@final
class ArmPrioritySolver:
    @property
    def arm(self) -> Arm: ...
    @property
    def tasks(self) -> tuple[Task, ...]: ...
    def solve(self, q: ArrayLike, velocities: Sequence[ArrayLike], *, out: _Array | None = None) -> _Array: ...
    def diagnose(self, q: ArrayLike, velocities: Sequence[ArrayLike] | None = None) -> PriorityDiagnosis: ...
    def _diagnose(self, q: ArrayLike, velocities: Sequence[ArrayLike] | None = None) -> dict[str, Any]: ...
    def jacobians(self, q: ArrayLike) -> list[_Array]: ...
    def set_bounds(self, v_min: ArrayLike, v_max: ArrayLike) -> None: ...
    @property
    def n(self) -> int: ...
    @property
    def rows(self) -> tuple[int, ...]: ...
    @property
    def method(self) -> str: ...
    @property
    def residuals(self) -> list[_Array]: ...
    @property
    def ranks(self) -> list[int]: ...
    @property
    def status(self) -> Status: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class InverseKinematics:
    def __new__(cls, q: _Array, errors: list[_Array], reached: list[bool], iterations: int, restarts: int, status: Status) -> Self: ...
    @property
    def q(self) -> _Array: ...
    @property
    def errors(self) -> list[_Array]: ...
    @property
    def reached(self) -> list[bool]: ...
    @property
    def iterations(self) -> int: ...
    @property
    def restarts(self) -> int: ...
    @property
    def status(self) -> Status: ...
    def __bool__(self) -> bool: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...

def _restore_arm_solver(arm: Arm, tasks: Iterable[Task], keywords: dict[str, Any]) -> ArmPrioritySolver: ...
def inverse_kinematics(
    arm: Arm,
    tasks: Iterable[Task],
    q0: ArrayLike,
    *,
    method: str = "clamp",
    eps: ArrayLike | None = None,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    restarts: int | None = None,
    seed: int | None = None,
    step_max: float | None = None,
    limits: bool = True,
) -> InverseKinematics: ...
