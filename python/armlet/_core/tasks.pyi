"""Types of tasks of arms, of the laws for prioritised tasks, and of inverse kinematics."""

from collections.abc import Iterable, Sequence
from typing import Any, Self, TypeAlias, final

from numpy.typing import ArrayLike
from typing_extensions import disjoint_base

from ..priority import PriorityDiagnosis
from ..status import Status
from ._types import _Array
from .arms import Arm
from .laws import Law
from .motions import Motion

_Level: TypeAlias = Task | Sequence[Task | tuple[Task, float]]

@disjoint_base
class Task:
    """A task that moves a frame of an arm to a target. This is also the base class of all tasks.

    Each controlled coordinate is a row of the task. The error `e` is `p_d - p`, m, for x, y, z, and `log(R_d R')`, rad, for rx, ry, rz,
    both in world axes. `p` and `R` are the position and the rotation of the frame, and `p_d` and `R_d` those of the target.

    Args:
        frame: name of the frame.
        axes: the controlled coordinates in world axes, such as "xyz", "xy", "rx ry rz" or "x y rz".
        target: a `Motion` or a constant `(rows,)`, m and rad (rotation vector); None if task velocities are passed at each call. A pose
            `(4, 4)` is a constant too, except for a task of four rows. A batch of constants `(..., rows)` or `(..., 4, 4)` is for
            `inverse_kinematics`, and may contain numbers that are not finite.
        gain: `K` in `v = x_d_dot + K e`, 1/s (1/s^2 in `PriorityAcceleration`): scalar, `(rows,)` or `(rows, rows)`, not negative; 1 if
            None.
        motion: another name of the argument `target` (keyword only).
        damping: gain of the error's derivative in `PriorityAcceleration`, 1/s: scalar, `(rows,)` or `(rows, rows)` (keyword only). None:
            `2 K^1/2`, critical damping.
        lower, upper: bounds of the coordinates in place of a target, a number or `(rows,)`, m and rad (keyword only). None or infinite: no
            bound. A coordinate `x` approaches a bound with the gain, `K (lower - x) <= x_dot <= K (upper - x)`, and moves freely between
            the bounds. For rx, ry, rz the coordinates are those of the rotation vector of the frame. In laws and `inverse_kinematics`.

    Raises:
        InputError: a shape is wrong, a number is not finite, a gain is negative, or a task with bounds has a target.

    Source: [SicilianoEtAl2009], section 3.7; docs/priority.md.

    >>> import armlet as al
    >>> al.Task("link4", "xy", [1.0, 0.5], 10.0)
    Task('link4', 'xy', [1.0, 0.5], 10.0)
    """
    def __new__(
        cls,
        frame: str,
        axes: str,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> Self: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class PostureTask(Task):
    """A task that moves joints to desired positions: `e = q_d - q`, rad or m.

    Args:
        target: `q_d`, a `Motion` or a constant with one number per joint, rad or m; None if task velocities are passed at each call.
        gain: as for `Task`.
        motion: another name of the argument `target` (keyword only).
        joints: names of the joints; None: all (keyword only).
        damping: as for `Task` (keyword only).
        lower, upper: as for `Task` (keyword only).

    Raises:
        InputError: a name is unknown, a shape is wrong, a number is not finite, or a gain is negative.

    Source: [SicilianoEtAl2009], section 3.5; docs/priority.md.

    >>> import armlet as al
    >>> al.PostureTask([0.0, 0.5], 1.0, joints=["joint1", "joint3"])
    PostureTask(joints=['joint1', 'joint3'], target=[0.0, 0.5], gain=1.0)
    """
    def __new__(
        cls,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        joints: Iterable[str] | None = None,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> Self: ...

@final
class CentreOfMassTask(Task):
    """A task that moves the arm's centre of mass to a point: `e = c_d - c`, m, in world axes.

    Args:
        axes: the controlled coordinates, letters of "xyz".
        target: `c_d`, a `Motion` or a constant with one number per letter, m; None if task velocities are passed at each call.
        gain: as for `Task`.
        motion: another name of the argument `target` (keyword only).
        damping: as for `Task` (keyword only).
        lower, upper: as for `Task` (keyword only).

    Raises:
        InputError: a letter is unknown, a shape is wrong, a number is not finite, or a gain is negative.

    Source: [SicilianoEtAl2009], section 3.5; docs/priority.md.

    >>> import armlet as al
    >>> al.CentreOfMassTask("xy", [0.5, 0.0], 2.0)
    CentreOfMassTask(axes='xy', target=[0.5, 0.0], gain=2.0)
    """
    def __new__(
        cls,
        axes: str,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> Self: ...

@final
class AxisTask(Task):
    """A task that turns a direction of a frame to a direction of the world. Rotation about this direction is free.

    The task has two rows: the components along the two directions of the frame that are perpendicular to `axis`. The error is the rotation
    vector from `axis` to `target`, rad. The task velocity is the frame's angular velocity, rad/s.

    Args:
        frame: name of the frame.
        axis: the direction in the frame's axes, `(3,)`, of any length > 0.
        target: the direction in world axes: a `Motion` of 3 numbers, or a constant `(3,)` of any length > 0. None if task velocities are
            passed at each call.
        gain: as for `Task`, with two rows.
        motion: another name of the argument `target` (keyword only).
        damping: as for `Task` (keyword only).
        lower, upper: bounds of the two components of the rotation vector from `target` to the direction, rad, as for `Task` (keyword
            only). The task then has a target and bounds.

    Raises:
        InputError: a shape is wrong, a number is not finite, a direction has no length, or a gain is negative.

    Source: [SicilianoEtAl2009], section 3.7; docs/priority.md.

    >>> import armlet as al
    >>> al.AxisTask("tool", [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], 5.0)
    AxisTask(frame='tool', axis=[0.0, 0.0, 1.0], target=[0.0, 0.0, -1.0], gain=5.0)
    """
    def __new__(
        cls,
        frame: str,
        axis: ArrayLike,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> Self: ...

@final
class RelativeTask(Task):
    """A task that controls the pose of a frame relative to another frame of the arm: `x = R_r'(p - p_r)`, `R = R_r' R_F`.

    Args:
        frame: name of the frame, with the position `p` and the rotation `R_F` in the world.
        reference: name of the other frame, with `p_r` and `R_r`. The relative pose is in the axes of this frame.
        axes: the controlled coordinates, as for `Task`.
        target: a `Motion` or a constant `(rows,)`, m and rad (rotation vector); None if task velocities are passed at each call.
        gain: as for `Task`.
        motion: another name of the argument `target` (keyword only).
        damping: as for `Task` (keyword only).
        lower, upper: as for `Task` (keyword only).

    Raises:
        InputError: a letter is unknown, a shape is wrong, a number is not finite, or a gain is negative.

    Source: [SicilianoEtAl2009], section 3.7; docs/priority.md.

    >>> import armlet as al
    >>> al.RelativeTask("left", "right", "xyz", [0.3, 0.0, 0.0], 5.0)
    RelativeTask(frame='left', reference='right', axes='xyz', target=[0.3, 0.0, 0.0], gain=5.0)
    """
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
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> Self: ...

@final
class DistanceTask(Task):
    """A task that keeps a distance between two spheres or capsules, such as a link and an obstacle.

    A capsule has all points within its radius of a line segment, its axis. The distance `d` is negative if the solids overlap. Between
    `lower` and `upper`, the solids move freely. In `PriorityVelocity`, they approach a bound with the gain, `d_dot >= K (lower - d)`. In
    `PriorityAcceleration`, `d_ddot >= -D d_dot + K (lower - d)`.

    A sphere has one row with any other solid. Two capsules have five rows: the four ends of the axes with the other capsule, and the
    nearest points of both axes. The smallest of them is the distance. So the solution does not jump where the axes are parallel.

    Args:
        frame: name of the frame of the first solid; None: the world.
        other: name of the frame of the second solid; None: the world.
        lower, upper: bounds of the distance, m; at least one of them. None: no bound.
        gain: as for `Task`, a number or one per row.
        points: the centre of the first solid, `(3,)`, m, which is then a sphere; or the ends of the axis of a capsule, `(2, 3)`. They are in
            the axes of its frame (keyword only). None: the origin of the frame.
        radius: radius of the first solid, m, >= 0; 0 if None (keyword only).
        other_points, other_radius: the same for the second solid (keyword only).
        damping: as for `Task` (keyword only).

    Raises:
        InputError: `lower` and `upper` are missing, a shape is wrong, a number is not finite, or a gain is negative. The law of the task
            raises it for an unknown frame, two equal frames, equal ends of an axis, and a negative radius.

    Source: [kanoun2011priority], section VI; docs/methods/inequalities.md.

    >>> import armlet as al
    >>> al.DistanceTask("link5", None, 0.05, points=[[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]], radius=0.06, other_points=[0.5, 0.1, 0.4])
    DistanceTask(frame='link5', points=[[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]], radius=0.06, other_points=[0.5, 0.1, 0.4], lower=0.05)
    """
    def __new__(
        cls,
        frame: str | None,
        other: str | None = None,
        lower: ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        upper: ArrayLike | None = None,
        points: ArrayLike | None = None,
        radius: float | None = None,
        other_points: ArrayLike | None = None,
        other_radius: float | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class JointLimitTask(Task):
    """A task that keeps joints away from their limits.

    The error of a joint is the displacement from its position to the nearest point of the inner part of its range, rad or m. It is zero
    inside this part. As the last level of a stack, the task moves joints that are too near a limit, and commands zero velocity to the other
    joints.

    Args:
        gain: as for `Task`, with one row per joint.
        margin: the fraction of the range at each end that joints avoid, 0 to 0.5; 0.1 if None. With 0.5 the inner part is the centre of
            the range.
        joints: names of the joints; None: all joints with two finite limits (keyword only).
        damping: as for `Task` (keyword only).

    Raises:
        InputError: `margin` is out of range, or a gain is negative. The law or solver of the task raises it for an unknown joint, and for a
            joint without two finite limits.

    Source: [SicilianoEtAl2009], section 3.5; docs/priority.md.

    >>> import armlet as al
    >>> al.JointLimitTask(2.0, 0.2)
    JointLimitTask(margin=0.2, gain=2.0)
    """
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
    """Closed-loop inverse kinematics of tasks with priorities, for an arm whose input `u` is the joint velocities.

    `u` solves `J_i u = x_d_dot,i + K_i e_i` for each task `i`, in the order of priority. `J_i` is the Jacobian of the task, and `x_d_dot,i`
    the velocity of its target. Away from singularities, the error `e_i` decays with the gain `K_i` if tasks of higher priority do not use
    its directions. `terms` returns `e`, `J`, `command` and `residuals`, each a list with one entry per level, and the arrays `ranks` and
    `v`. `run.monitors` has the series `error_i` and `residual_i` of each level. With limits, `terms` also has the bounds `lower` and `upper`
    of `v`. The terms `limits` and `active` are the active rows as in `PrioritySolution`, and `why` is a list of one sentence per level.
    `holds` are the bounds that hold a level, with side, level and share. `run.monitors` also has `violation_i`, and the certificate `kkt`.
    `run.active` lists which bound held which level, and when. The same holds for tasks with bounds.

    Args:
        arm: the model; not `planar_pr`, which has no links.
        tasks: `Task` and other tasks, each with a target or bounds, a gain in 1/s and without `damping`, the highest priority first. A list
            of tasks in place of a task shares one level. Its entries are tasks, or pairs of a task and the weight of its squared error.
        method: "clamp" (default), "exact", "damped", "chiaverini" or "sns", as for `solve_priority`.
        eps: threshold on singular values, one number or one per level; None: 0.02 times each level's largest row norm. "exact" and "sns" do
            not accept it.
        v_min, v_max: velocity bounds, a number or `(n,)`, rad/s or m/s (keyword only). A missing bound is minus the other bound. All limits
            hold above all levels, with every method but "chiaverini".
        q_min, q_max: position limits, a number or `(n,)`, rad or m (keyword only). At the distance `d` from a limit, the velocity towards it
            is at most `a_max h (sqrt(1 + 2 d / (a_max h^2)) - 1)`, which is `d / h` without `a_max`.
        a_max: deceleration before a position limit, a number or `(n,)`, rad/s^2 or m/s^2 (keyword only). None: without this bound.
        horizon: the time `h`, s (keyword only). None: the sample period of a sampled loop, otherwise 0.1; "sns": 0.1. It must be at least the
            step or the sample time. A joint outside of its limits returns within this time, at most with its velocity bound.
        limits: whether the arm's own limits of velocity and position hold where no other limit is given (keyword only). None: only with
            "sns", except limits of zero; with other methods, `simulate` and calls of the law warn if commands pass them. True ignores
            velocity limits that are not positive, and empty ranges of positions, with a warning. False: they do not hold, without a warning.

    Raises:
        InputError: a shape is wrong, a number is out of its range, a task has no target, or a name or the method is unknown. It is also
            raised for "sns" without velocity bounds, for limits with "chiaverini", and for `limits=True` if the arm has no limits.

    Source: Siciliano and Slotine, A general framework for managing multiple tasks in highly redundant robotic systems, ICAR 1991.

    >>> import armlet as al
    >>> arm = al.planar_arm([1.0, 1.0, 0.25, 0.25])
    >>> law = al.PriorityVelocity(arm, [al.Task("link4", "xy", [1.2, 1.0], 5.0), al.Task("link2", "xy", [0.9, 0.8], 5.0)])
    >>> run = al.simulate(al.VelocityArm(arm), law, [0.0, 1.2, 0.4, 0.4], t_end=4.0, dt=0.01)
    >>> arm.position(run.q[-1], "link4").round(6)
    array([1.2, 1. , 0. ])
    """
    def __new__(
        cls,
        arm: Arm,
        tasks: Iterable[_Level],
        method: str = "clamp",
        eps: ArrayLike | None = None,
        *,
        v_min: ArrayLike | None = None,
        v_max: ArrayLike | None = None,
        q_min: ArrayLike | None = None,
        q_max: ArrayLike | None = None,
        a_max: ArrayLike | None = None,
        horizon: float | None = None,
        limits: bool | None = None,
    ) -> Self: ...

@final
class PriorityAcceleration(Law):
    """Computed-torque control of tasks with priorities, for a rigid arm.

    `a` solves `J_i a = x_d_ddot,i + D_i (x_d_dot,i - J_i v) + K_i e_i - dJ_i/dt v` for each task `i`, in the order of priority. In
    directions that no task uses, `a = -c v`. The torque is `tau = M a + C v + g`.

    With `tau_max` and other limits, a bound of the accelerations can require a torque beyond its limit. Then the torque limit holds, the
    other limits are missed as little as possible, and the term `status` is `Status.INFEASIBLE`. The term `limit_violations`, `(n,)`, and the
    monitor `violation_0`, its norm, are the accelerations by which the bounds are missed.

    Args:
        arm, eps: as for `PriorityVelocity`.
        tasks: as for `PriorityVelocity`, each with a target or bounds, a gain `K_i` in 1/s^2 and a damping `D_i` in 1/s, the highest
            priority first.
        method: "clamp" (default), "exact", "damped", "chiaverini" or "sns", as for `solve_priority`.
        joint_damping: `c`, 1/s, >= 0; 5 if None (keyword only).
        a_max: bound of the joint accelerations, a number or `(n,)`, rad/s^2 or m/s^2; None: without bound (keyword only).
        v_min, v_max, q_min, q_max, limits: as for `PriorityVelocity` (keyword only). In a sampled loop, the bounds are the range of
            accelerations after which the joint can still stop within its limits with `a_max`. A joint outside of its
            limits returns as fast as they allow.
        horizon: None for these bounds, except with "sns", whose horizon is 0.1 (keyword only). A time in s, and every continuous loop, have
            the bound `(v_u - v) / horizon` with `v_u = min(v_max, (q_max - q) / (4 horizon), sqrt(a_max (q_max - q)))`.
        tau_max: torque limits, a number or `(n,)`, N m or N, which hold above all other limits (keyword only). None: without limits; with
            `limits=True` the arm's effort limits, of which those that are not positive are ignored with a warning. `inf`: without limits.

    Raises:
        InputError: a shape is wrong, a number is out of its range, a task has no target, or a name or the method is unknown. It is also
            raised for "sns" without velocity bounds, for limits with "chiaverini", and for `limits=True` if the arm has no limits.

    Source: [siciliano1991priority, nakanishi2008operational]; bounds: [delprete2018joint, flacco2015saturation].

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4, 0.3])
    >>> law = al.PriorityAcceleration(arm, [al.Task("link3", "xy", [0.6, 0.5], 100.0)])
    >>> run = al.simulate(al.RigidArm(arm), law, [0.3, 0.8, 0.4], t_end=2.0, dt=2e-3)
    >>> arm.position(run.q[-1], "link3").round(4)
    array([0.6, 0.5, 0. ])
    """
    def __new__(
        cls,
        arm: Arm,
        tasks: Iterable[_Level],
        method: str = "clamp",
        eps: ArrayLike | None = None,
        *,
        joint_damping: float | None = None,
        a_max: ArrayLike | None = None,
        v_min: ArrayLike | None = None,
        v_max: ArrayLike | None = None,
        q_min: ArrayLike | None = None,
        q_max: ArrayLike | None = None,
        horizon: float | None = None,
        limits: bool | None = None,
        tau_max: ArrayLike | None = None,
    ) -> Self: ...

@final
class ArmPrioritySolver:
    """A solver of joint velocities for tasks of one arm with priorities, from `PrioritySolver.for_arm`.

    `v` solves `J_i(q) v = v_i` for each level, in the order of priority. The rank decisions assume a relative error of
    `8 eps (1 + sum|q|)` in the entries of the Jacobians, where `eps` is the machine epsilon.
    """
    @property
    def arm(self) -> Arm:
        """The arm of the tasks."""
    @property
    def tasks(self) -> tuple[Task, ...]:
        """The tasks, the highest priority first."""
    def solve(self, q: ArrayLike, velocities: Sequence[ArrayLike], *, out: _Array | None = None) -> _Array:
        """Compute joint velocities `(..., n)` at `q` `(..., n)`, rad or m, for a list with one task velocity `(..., rows_i)` per level.

        `out`: an array for the result. Leading axes make a batch, in which every row is equal, bit for bit, to a single solve. A row whose
        result overflows is NaN. A batch does not change `residuals`, `ranks` and `status`, which belong to the last single solve.
        """
    def diagnose(self, q: ArrayLike, velocities: Sequence[ArrayLike] | None = None) -> PriorityDiagnosis:
        """Return a `PriorityDiagnosis`: the feasible directions of each task at `q` `(n,)`, and the infeasible part of `velocities`."""
    def _diagnose(self, q: ArrayLike, velocities: Sequence[ArrayLike] | None = None) -> dict[str, Any]: ...
    def jacobians(self, q: ArrayLike) -> list[_Array]:
        """Return a list with the Jacobian `(rows_i, n)` of each task at `q` `(n,)`."""
    def set_bounds(self, v_min: ArrayLike, v_max: ArrayLike) -> None:
        """Set the velocity bounds of the next solves, a number or `(n,)` each, rad/s or m/s. A solver that was made
        without bounds raises `InputError`.
        """
    @property
    def n(self) -> int:
        """Number of joints."""
    @property
    def rows(self) -> tuple[int, ...]:
        """Number of rows of each task."""
    @property
    def method(self) -> str:
        """Name of the method that computes the velocities: "clamp", "exact", "damped", "chiaverini" or "sns", as for `solve_priority`."""
    @property
    def residuals(self) -> list[_Array]:
        """Residuals `v_i - J_i v` of the last single solve, a list of `(rows_i,)` per level."""
    @property
    def ranks(self) -> list[int]:
        """Number of directions of each level that the last single solve realised."""
    @property
    def status(self) -> Status:
        """Status of the last single solve."""
    def __reduce__(self) -> tuple[Any, ...]: ...

def _restore_arm_solver(arm: Arm, tasks: Iterable[Task], keywords: dict[str, Any]) -> ArmPrioritySolver: ...
def inverse_kinematics(
    arm: Arm,
    tasks: Iterable[Task],
    q0: ArrayLike,
    *,
    method: str | None = None,
    eps: ArrayLike | None = None,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    restarts: int | None = None,
    seed: int | None = None,
    step_max: float | None = None,
    limits: bool = True,
    check_limits: bool | None = None,
    solutions: int | None = None,
    threads: int | None = None,
) -> InverseKinematics:
    """Search for joint positions at which the tasks are reached: damped Newton steps within the joint limits.

    `q <- clip(q + s dq)`, where `dq` is a damped least-squares step for all tasks together, and `s <= 1` limits it to `step_max`. If there
    are several tasks and these steps do not reach all of them, steps in the order of priority follow. Such a `dq` solves `J_i dq = e_i` for
    one task after the other. A lower task that conflicts with a higher one is then reached only in part. If the search from `q0` fails,
    searches from random starts within the limits follow. Equal seeds make equal starts.

    Args:
        arm: the arm; not `planar_pr`, which has no links.
        tasks: `Task` and other tasks with constant targets `(rows,)` or `(..., rows)`, m or rad, the highest priority first. The gains of
            the tasks are not used. A task with `lower` or `upper`, such as a `DistanceTask`, is reached within its bounds. Its error is the
            distance to the nearest bound.
        q0: start of the search, `(n,)` or `(..., n)`, rad or m. Leading axes of `q0` and of all targets broadcast.
        limits: keep `q` within the arm's joint limits.
        solutions: number of different solutions of each target, from at most `restarts` random starts. None: one solution, without an axis
            for it. Solutions that reach every task are first, ordered by their distance `|q - q0|`. The others follow, ordered by the error
            of the first task in which they differ. Two solutions are equal if no joint differs by more than 1e-3 rad or m. A difference of
            2 pi does not count if it leaves all bodies in place. If fewer are found, the remaining rows are NaN, with the status
            `INFEASIBLE`.

    Other Args:
        method: the method of `solve_priority` for every step: "clamp", "damped", "exact" or "chiaverini" (keyword only, as all below).
            None: steps for all tasks together, and "clamp" for steps in the order of priority.
        eps: threshold on singular values, for steps in the order of priority: one number, or one per task. With `eps`, all steps are of
            this kind. "exact" does not accept it. None: 0.02 times each task's largest row norm.
        tolerance: a task is reached if the size of every entry of its error is at most this, m or rad; 1e-9 if None.
        max_iterations: largest number of steps from each start; 100 if None.
        restarts: largest number of random starts after `q0`; 50 if None.
        seed: seed of the random starts; 0 if None.
        step_max: largest change of a joint position in one step, rad or m; 0.5 if None.
        check_limits: action for a start outside of the joint limits: None warns, True raises, and False does neither. With `limits=False`
            it must be None.
        threads: number of threads for a batch; None: the environment variable `ARMLET_NUM_THREADS`, otherwise the number of cores.

    Threads share the rows of a batch. Every row is equal, bit for bit, to the result of a separate call, for any number of threads. A row
    whose start or target is not finite, or whose numbers overflow, is NaN with the status `DIVERGED`. The same holds for an invalid target,
    such as a direction of length zero. Such a row does not affect other rows.

    Returns:
        An `InverseKinematics`, which is true if every task is reached. An unreachable target is not an error: its `status` reports it.

    Raises:
        InputError: a shape is wrong, leading axes do not broadcast, a task has no constant target, or the method is unknown. A single
            target or start that is not finite also raises it. With `check_limits=True`, a start outside of the joint limits raises it.

    Warns:
        UserWarning: a start is outside of the joint limits. The search begins at the nearest position inside.

    Source: Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method, IEEE Trans. Robotics 27, 2011; Nakamura
    and Hanafusa, Inverse kinematic solutions with singularity robustness, J. Dyn. Sys. Meas. Control 108, 1986.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4, 0.3])
    >>> found = al.inverse_kinematics(arm, [al.Task("link3", "xy", [0.6, 0.5])], [0.1, 0.2, 0.3])
    >>> found.status, arm.position(found.q, "link3").round(9)
    (<Status.SUCCESS: 0>, array([0.6, 0.5, 0. ]))

    Many targets, and both elbows of each:

    >>> points = [[0.3, 0.5], [0.5, 0.2], [2.0, 0.0]]
    >>> found = al.inverse_kinematics(al.planar_arm([0.5, 0.4]), [al.Task("link2", "xy", points)], [0.1, 0.2], solutions=2)
    >>> found.q.shape, found.reached
    ((3, 2, 2), array([[ True,  True],
           [ True,  True],
           [False, False]]))
    """

@final
class InverseKinematics:
    """The result of `inverse_kinematics`: joint positions, and the outcome of each task.

    - `q`: joint positions, `(n,)`, rad or m.
    - `errors`: a list with the error of each task at `q`, `(rows_i,)`, m or rad.
    - `reached`: a flag for each task.
    - `iterations`: number of steps from all starts together.
    - `restarts`: number of random starts.
    - `status`: `Status.SUCCESS` if every task is reached, and `DEGRADED` if the first task is reached, but not all.

    If the first task is not reached, `status` is `INFEASIBLE` when the best search ended without further progress. It is `MAX_STEPS` when
    `max_iterations` ended this search.

    In a batch the fields are arrays: `q` `(..., n)`, and `errors` a list of `(..., rows_i)`. `reached` (every task of the row is reached),
    `iterations`, `restarts` and `status` (integer codes of `Status`) have the shape `(...)`. With `solutions=k`, `q` is `(..., k, n)`, each
    array of `errors` is `(..., k, rows_i)`, and `reached` and `status` are `(..., k)`.

    The truth value is True if every task of every target is reached. With `solutions=k`, it considers only the best solution of each
    target.
    """
    def __new__(cls, q: _Array, errors: list[_Array], reached: Any, iterations: Any, restarts: Any, status: Any) -> Self: ...
    @property
    def q(self) -> _Array:
        """Joint positions, `(n,)`, rad or m."""
    @property
    def errors(self) -> list[_Array]:
        """A list with the error of each task at `q`, `(rows_i,)`, m or rad."""
    # For one target, the next four properties are a list of flags, two integers and a Status. For a batch they are arrays.
    @property
    def reached(self) -> Any:
        """A flag for each task."""
    @property
    def iterations(self) -> Any:
        """Number of steps from all starts together."""
    @property
    def restarts(self) -> Any:
        """Number of random starts."""
    @property
    def status(self) -> Any:
        """`Status.SUCCESS` if every task is reached, and `DEGRADED` if the first task is reached, but not all."""
    def __bool__(self) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
