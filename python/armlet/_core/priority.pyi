"""Types of task priority from matrices."""

from collections.abc import Iterable, Sequence
from typing import Any, Self, final

from numpy.typing import ArrayLike

from ..status import Status
from ._types import _Array
from .arms import Arm
from .tasks import ArmPrioritySolver, Task

def solve_priority(
    jacobians: Sequence[ArrayLike],
    velocities: Sequence[ArrayLike | Within],
    *,
    method: str = "clamp",
    eps: ArrayLike | None = None,
    rounding: float | None = None,
    weight: ArrayLike | None = None,
    v_min: ArrayLike | None = None,
    v_max: ArrayLike | None = None,
    scale: str | None = None,
) -> PrioritySolution:
    """Compute joint velocities for tasks `J_i v = v_i` with priorities: a task does not disturb the tasks of higher priority.

    `v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1) + ..` with the pseudoinverse `#` and the null-space projector `P1 = I - J1# J1`. Rank decisions
    compare singular values with the size of the unprojected Jacobians.

    Args:
        jacobians: one `(..., rows_i, n)` per level, the highest priority first. Zero rows, and more rows than joints, are allowed.
        velocities: one `(..., rows_i)` per level, in the unit of the task. `Within(lower, upper)` bounds a level instead.
        method: "exact" is the equation above. "clamp" is continuous and bounded, and equals "exact" where all singular values are at least
            `eps`. "damped" and "chiaverini" use damped pseudoinverses. "sns" is "exact" with `scale="direction"`, and requires `v_min`
            or `v_max`. The method and all further arguments are keyword only.
        eps: threshold on singular values, > 0, one number or one per level; None: 0.02 times each level's largest row norm. "exact" and
            "sns" do not accept it.
        rounding: relative error of the entries of the Jacobians; None: 8 times the machine epsilon. For Jacobians that were computed from
            angles `q`, pass `8 (1 + sum|q|)` times the machine epsilon.
        weight: joint metric `W`, `(n, n)`, symmetric and positive definite: `v' W v` is minimised; None: the identity.
        v_min, v_max: bounds of `v` above all levels, a number or `(n,)`, rad/s or m/s. A missing bound is minus the other bound.
            "chiaverini" accepts no bounds.
        scale: "direction" keeps the direction of each command. A level whose command is not feasible executes its largest feasible
            multiple `s v_i`, `0 <= s <= 1`. None minimises `|J_i v - v_i|` instead. Only "exact" and "sns" accept "direction".

    Returns:
        A `PrioritySolution`. A batch does not raise for one invalid row. A row whose numbers are not finite, or whose result overflows, is
        NaN with `Status.DIVERGED`.

    Raises:
        InputError: shapes do not fit, the stack is empty, the method is unknown, "sns" has no bounds, or an option is out of its range. A
            number that is not finite also raises it in a single stack, and so do bounds out of order, with their level and row.
        SolveError: the result of a single stack overflows.

    Source: Siciliano and Slotine, A general framework for managing multiple tasks in highly redundant robotic systems, ICAR 1991.

    >>> import armlet as al
    >>> sol = al.solve_priority([[[1.0, 0.0]], [[1.0, 1.0]]], [[1.0], [3.0]], method="exact")
    >>> sol.v.round(12)
    array([1., 2.])
    >>> sol.status
    <Status.SUCCESS: 0>
    """

def _priority_reasons(levels: Sequence[Any], v: _Array, k: int, scaled: bool) -> tuple[_Array, list[tuple[int, int, int, float]]]: ...
def diagnose_priority(jacobians: Sequence[ArrayLike], rhs: Sequence[ArrayLike | Within] | None, rounding: float | None) -> dict[str, Any]:
    """Diagnose a stack of Jacobians, and return a dict with the fields of `armlet.PriorityDiagnosis`."""

def velocity_bounds(
    q: ArrayLike, q_min: ArrayLike, q_max: ArrayLike, v_max: ArrayLike, *, dt: float, a_max: ArrayLike | None = None
) -> tuple[_Array, _Array]:
    """Convert joint limits to velocity bounds for one sample.

    The upper bound is `min((q_max - q)/dt, v_max, sqrt(2 a_max (q_max - q)))`. The lower bound is computed from `q_min` and `-v_max` in the
    same form.

    Args:
        q: joint positions, `(n,)`, rad or m.
        q_min, q_max: position limits, a number or `(n,)`, rad or m; infinite numbers are allowed.
        v_max: velocity limit, a number or `(n,)`, rad/s or m/s.
        dt: the sample time, s, > 0 (keyword only).
        a_max: deceleration before a limit, a number or `(n,)`, rad/s^2 or m/s^2; None: without the square root (keyword only).

    Returns:
        `(v_min, v_max)`, `(n,)` each, rad/s or m/s, for the method "sns". For a joint outside of a limit, both bounds lead back inside.

    Raises:
        InputError: limits are out of order, `dt` is not positive, `v_max` or `a_max` is negative, a shape is wrong, or `q` is not finite.

    Source: Flacco, De Luca and Khatib, Control of redundant robots under hard joint constraints, T-RO 31(3), 2015.

    >>> import armlet as al
    >>> al.velocity_bounds([0.0, 1.0], -1.0, 1.0, 2.0, dt=0.01)
    (array([-2., -2.]), array([2., 0.]))
    """

@final
class Within:
    """Bounds `lower <= J_i v <= upper` of a level, in place of its task velocity `v_i`.

    A row with `lower = upper` is a task.

    Args:
        lower: lower bounds, `(..., rows_i)`, in the unit of the task; `-inf` for none.
        upper: upper bounds, `(..., rows_i)`; `inf` for none.

    Raises:
        InputError: a bound is NaN, or the shapes do not broadcast. Bounds out of order are refused by the solver, which names the level.

    Source: [kanoun2011priority]; docs/inequalities.md.

    >>> import armlet as al
    >>> sol = al.solve_priority([[[1.0, 0.0]], [[1.0, 1.0]]], [al.Within([-0.5], [0.5]), [3.0]], method="exact")
    >>> sol.v.round(12)
    array([0.5, 2.5])
    """
    def __new__(cls, lower: ArrayLike, upper: ArrayLike) -> Self: ...
    @property
    def lower(self) -> _Array:
        """Lower bounds, `(..., rows_i)`, in the unit of the task."""
    @property
    def upper(self) -> _Array:
        """Upper bounds, `(..., rows_i)`, in the unit of the task."""
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class PrioritySolution:
    """The result of `solve_priority`: joint velocities, and the outcome of each level.

    - `v`: joint velocities, `(n,)`, rad/s or m/s.
    - `residuals`: a list of `v_i - J_i v` per level, `(rows_i,)`, in the unit of the task; NaN for a level with bounds.
    - `violations`: a list of `w_i = J_i v - clip(J_i v, lower, upper)` per level, `(rows_i,)`; zero within the bounds.
    - `ranks`: number of directions of each level that were realised.
    - `scales`: scale of each level's command, `(levels,)`; it is 1 except for "sns" and `scale="direction"`.
    - `active`: for each level, a list of its rows at or beyond a bound, as `Active(row, side, multiplier, name)`.
    - `limits`: the same list for `v_min` and `v_max`, which are level 0.
    - `changes`: number of changes of the active set; `certificate`: largest residual of the optimality conditions.
    - `status`: `Status.SUCCESS`, or `Status.DEGRADED` if some level lost a direction, was scaled or was stopped by a bound.

    At the limit of the number of changes, `v` is the last feasible point, and `status` is `Status.MAX_STEPS`.

    In a batch, the fields are arrays with leading axes: `v` is `(..., n)`, `residuals` a list of `(..., rows_i)`, and `ranks` and `scales`
    are `(..., levels)`. `status` `(...)` has integer codes of `Status`. `active(row)` and `limits(row)` are functions of the index of a row.

    >>> import armlet as al
    >>> sol = al.solve_priority([[[1.0, 1.0]]], [[3.0]], v_max=[1.0, 9.0])
    >>> sol.v.round(12), sol.limits[0].name, sol.limits[0].side
    (array([1., 2.]), 'joint 1', 'upper')
    """
    def __new__(
        cls, v: _Array, residuals: list[_Array], ranks: Any, scales: _Array, status: Any, details: dict[str, Any] | None = None
    ) -> Self: ...
    @property
    def v(self) -> _Array:
        """Joint velocities, `(n,)`, rad/s or m/s."""
    @property
    def residuals(self) -> list[_Array]:
        """A list of `v_i - J_i v` per level, `(rows_i,)`, in the unit of the task; NaN for a level with bounds."""
    @property
    def ranks(self) -> Any:
        """Number of directions of each level that were realised."""  # list[int] for one stack; an array of integers (..., levels) for a batch
    @property
    def scales(self) -> _Array:
        """Scale of each level's command, `(levels,)`; it is 1 except for "sns" and `scale="direction"`."""
    @property
    def status(self) -> Any:
        """`Status.SUCCESS`, or `Status.DEGRADED` if some level lost a direction, was scaled or was stopped by a bound."""  # Status for one stack; an array of integers (...) for a batch
    @property
    def violations(self) -> list[_Array]:
        """Violations `w_i = J_i v - clip(J_i v, lower, upper)` per level, a list of `(..., rows_i)`; for a task `J_i v - v_i`."""
    @property
    def active(self) -> Any:
        """For each level, a list of its rows at or beyond a bound, as `Active(row, side, multiplier, name)`. Of a batch, a function of the index
        of a row.
        """  # list[list[Active]] for one stack; a function of the index of a row for a batch
    @property
    def limits(self) -> Any:
        """The joint velocities at `v_min` or `v_max`, a list of `Active(row, side, multiplier, name)`. Of a batch, a function of the index of a
        row.
        """  # list[Active] for one stack; a function of the index of a row for a batch
    @property
    def changes(self) -> Any:
        """Number of changes of the active set: 0 without bounds, and where the active set of the last solve was accepted."""  # int for one stack; an array of integers (...) for a batch
    @property
    def certificate(self) -> Any:
        """Largest residual of the optimality conditions (Karush, Kuhn and Tucker) of all levels, divided by their largest term. It is NaN for
        "chiaverini", and in a batch without bounds. In a batch of "sns" it is NaN for a row that meets no bound.
        """  # float for one stack; an array (...) for a batch
    def why(self, k: int) -> str:
        """Return one sentence: by how much level `k` is missed, and which rows of higher levels stop it. Levels count from 1.

        The share of a row is the part of its force `multiplier * row` along the gradient `J_k' w_k`. A batch raises `InputError`.
        """
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class PrioritySolver:
    """A solver of joint velocities for tasks with priorities, which reuses its buffers for stacks of equal sizes.

    Args:
        n: number of joints.
        rows: number of rows of each level, the highest priority first.
        method, eps, rounding, weight, v_min, v_max, scale: as for `solve_priority` (keyword only).

    Raises:
        InputError: `n` is not positive, a number of rows is negative, a shape does not fit, or the method is unknown. It is also raised
            for "sns" without bounds, and for an option out of its range.

    Source: [siciliano1991priority]; docs/priority.md.

    >>> import armlet as al
    >>> solver = al.PrioritySolver(2, [1, 1], method="exact")
    >>> solver.solve([[[1.0, 0.0]], [[1.0, 1.0]]], [[1.0], [3.0]]).round(12)
    array([1., 2.])
    >>> solver.ranks
    [1, 1]
    """
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
        scale: str | None = None,
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
        scale: str | None = None,
    ) -> ArmPrioritySolver:
        """Make a solver for tasks of an arm. Its `solve(q, velocities)` takes joint positions instead of Jacobians.

        Args:
            arm: the arm; not `planar_pr`, which has no links.
            tasks: `Task` and other tasks, the highest priority first. Their targets and gains are not used.
            method, eps, weight, v_min, v_max, scale: as for `solve_priority` (keyword only). The bounds of "sns" default to the arm's bounds.

        >>> import armlet as al
        >>> arm = al.planar_arm([1.0, 1.0, 0.25, 0.25])
        >>> solver = al.PrioritySolver.for_arm(arm, [al.Task("link4", "xy"), al.Task("link2", "xy")], method="exact")
        >>> solver.solve([0.0, 1.5707963267948966, 1.5707963267948966, 0.0], [[1.0, 1.0], [1.0, 1.0]]).round(12)
        array([ 1. , -2. ,  0.8,  0.4])
        """
    def solve(self, jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike | Within], *, out: _Array | None = None) -> _Array:
        """Compute joint velocities `(n,)`, rad/s or m/s, from lists with one Jacobian `(rows_i, n)` and one task velocity `(rows_i,)` per
        level. `Within(lower, upper)` bounds a level in place of its velocity.

        The active set of the last solve is tried first. `out`: an array for the result.
        """
    def set_rounding(self, rounding: float) -> None:
        """Set the relative error of the entries of the next Jacobians. For Jacobians computed from joint angles, use `8 eps (1 + sum|q|)`.

        Here `eps` is the machine epsilon.
        """
    def set_bounds(self, v_min: ArrayLike, v_max: ArrayLike) -> None:
        """Set the velocity bounds of the next solves, a number or `(n,)` each, rad/s or m/s. A solver that was made
        without bounds raises `InputError`.
        """
    @property
    def n(self) -> int:
        """Number of joints."""
    @property
    def rows(self) -> tuple[int, ...]:
        """Number of rows of each level, the highest priority first."""
    @property
    def method(self) -> str:
        """Name of the method that computes the velocities: "clamp", "exact", "damped", "chiaverini" or "sns", as for `solve_priority`."""
    @property
    def solution(self) -> PrioritySolution:
        """Result of the last solve, a `PrioritySolution`: its violations, active rows, certificate and reasons."""
    @property
    def residuals(self) -> list[_Array]:
        """Residuals `v_i - J_i v` of the last solve, a list of `(rows_i,)` per level."""
    @property
    def ranks(self) -> list[int]:
        """Number of directions of each level that the last solve realised."""
    @property
    def scales(self) -> _Array:
        """Scale of each level's command in the last solve, `(levels,)`; 1 except for "sns" and `scale="direction"`."""
    @property
    def status(self) -> Status:
        """Status of the last solve."""
    def __getnewargs_ex__(self) -> tuple[tuple[int, list[int]], dict[str, Any]]: ...
