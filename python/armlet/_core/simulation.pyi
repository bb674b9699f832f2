"""Types of the simulation of closed loops, and of observers."""

from collections.abc import Callable, Sequence
from typing import Any, Self, final

from numpy.typing import ArrayLike

from ..run.options import BatchOptions, LoopOptions, ProgramOptions, RunOptions
from ..status import Status
from ._types import _Array
from .arms import Arm
from .laws import Law
from .plants import Plant

def build_info() -> dict[str, Any]:
    """Return the build of the extension, the instruction set in use, and the number of threads.

    Returns:
        A dict: `version`, `profile` of the build ("debug" or "release"), `instruction_set` in use, `best_instruction_set` of the processor.
        It also has `lanes` (runs that a batch computes as one group), and `threads` (default number of threads). `programs` is "machine" if
        armlet compiles control loops to machine code, otherwise "interpreter".

    Raises:
        (nothing): an unknown instruction set raises an error at import.

    Source: docs/performance.md.

    >>> import armlet as al
    >>> al.build_info()["lanes"] >= 1
    True
    """

def statuses() -> list[tuple[int, str, str]]:
    """Return the code, the name and the advice of every status."""

def simulate(plant: Plant, law: Law | Callable[..., ArrayLike], q0: ArrayLike, options: RunOptions) -> dict[str, Any]:
    """Simulate one run, and return a dict of its fields. `armlet.simulate` documents the options."""

def simulate_batch(plant: Plant | Sequence[Plant], law: Law | Sequence[Law], q0: ArrayLike, options: BatchOptions) -> dict[str, Any]:
    """Simulate a batch of runs, and return a dict of its fields. `armlet.simulate_batch` documents the options."""

def _sensitivities(
    plant: Plant | Sequence[Plant],
    law: Law | Sequence[Law],
    q0: ArrayLike,
    weights: ArrayLike,
    names: list[int | tuple[int, list[int]]],
    options: LoopOptions,
) -> dict[str, _Array]: ...
def _adjoint(
    plant: Plant | Sequence[Plant],
    law: Law | Sequence[Law],
    q0: ArrayLike,
    weights: ArrayLike,
    names: list[int | tuple[int, list[int]]],
    slopes: dict[str, Any],
    bytes: int,
    options: LoopOptions,
) -> _Array: ...
def _sensitivities_of_rows(
    plant: Plant | Sequence[Plant],
    law: Law | Sequence[Law],
    q0: ArrayLike,
    weights: ArrayLike,
    names: list[int | tuple[int, list[int]]],
    threads: int | None,
    options: LoopOptions,
) -> dict[str, _Array]: ...
def _adjoint_of_rows(
    plant: Plant | Sequence[Plant],
    law: Law | Sequence[Law],
    q0: ArrayLike,
    weights: ArrayLike,
    names: list[int | tuple[int, list[int]]],
    slopes: dict[str, Any],
    bytes: int,
    threads: int | None,
    options: LoopOptions,
) -> _Array: ...
def loop_program(plant: Plant, law: Law | Callable[..., ArrayLike], options: ProgramOptions) -> dict[str, Any]:
    """Return one program of a closed loop as a dict. `armlet.loop_program` documents the options."""

def _restore_simulator(
    made_of: tuple[Plant, Any, Any, dict[str, Any]], at: tuple[int, Sequence[float], Sequence[float]], diverged: bool = False
) -> Simulator: ...

@final
class _BatchStepper:
    def __new__(cls, plant: Plant, rows: int, dt: float) -> Self: ...
    @property
    def states(self) -> _Array: ...
    @states.setter
    def states(self, states: ArrayLike) -> None: ...
    def step(self, tau: ArrayLike, steps: int) -> tuple[_Array, _Array]: ...
    def put(self, rows: Sequence[int], q: ArrayLike, v: ArrayLike) -> tuple[_Array, _Array]: ...

@final
class Simulator:
    """A closed loop with one step per call: `step()` advances by `dt` with the law's input, and `step(tau)` with the caller's input.

    The state is in the arrays `q` and `v`, `(n,)`, and the input in `tau`, `(n,)`. For a `VelocityArm`, `v` is the input too. Elastic arms
    also have `theta` and `theta_dot`, `LuGre` friction has `bristles`, and a law with a state has `estimate`. Every step overwrites these
    arrays, so copy values to keep them.

    Args:
        plant: the controlled system, such as `RigidArm(arm)`.
        law: the control law; None if every step has an input of the caller.
        q0: initial positions, `(n,)`, rad or m.
        dt: the step, s (keyword only).
        v0, theta0, theta_dot0, method, sample_time, force, force_frame, tau_max, state_limit, check_limits: as for `simulate` (keyword
            only). The method has fixed steps: "euler", "semi_implicit", "rk4" or "ros2". `force_frame` is also the frame of `step(force=)`.

    A step *diverges* if the state after it would not be finite, or would exceed `state_limit`. Such a step raises `SolveError`, and the
    arrays keep the state and the input before it. Then `status` is no longer `Status.SUCCESS`, and every further step raises until
    `set_state` or `reset`. If `force` or the law is a Python function that raises an exception, `step` raises it too. This step has no
    effect, and the next `step` repeats it. `tau` is the input of the last step, after clipping to `tau_max`.

    Raises:
        InputError: an argument has a wrong type, shape or value.
        SolveError: a `step` diverges; `.partial` is the `state` before it.

    Source: [HairerNorsettWanner1993] for the methods; docs/plants_and_laws.md.

    >>> import armlet as al
    >>> arm = al.pendulum(1.0, 5.0)
    >>> sim = al.Simulator(al.RigidArm(arm), None, [0.5], dt=1e-3)
    >>> for _ in range(1000):
    ...     sim.step(5.0 * (0.2 - sim.q) - 2.0 * sim.v + arm.gravity(sim.q))
    >>> round(sim.t, 6), sim.q.shape
    (1.0, (1,))
    """
    def __new__(cls, plant: Plant, law: Law | Callable[..., ArrayLike] | None, q0: ArrayLike, **keywords: Any) -> Self: ...
    @property
    def q(self) -> _Array:
        """Positions, `(n,)`, rad or m. A step overwrites this array."""
    @property
    def v(self) -> _Array:
        """Velocities, `(n,)`, rad/s or m/s. A step overwrites this array."""
    @property
    def tau(self) -> _Array:
        """Input of the last step, `(n,)`, N m or N; rad/s or m/s for a `VelocityArm`. A step overwrites this array."""
    @property
    def theta(self) -> _Array | None:
        """Motor positions of an elastic arm, `(n,)`, rad or m, else None. A step overwrites this array."""
    @property
    def theta_dot(self) -> _Array | None:
        """Motor velocities of an elastic arm, `(n,)`, rad/s or m/s, else None. A step overwrites this array."""
    @property
    def bristles(self) -> _Array | None:
        """Deflections of the bristles of `LuGre` friction, `(n,)`, rad or m, else None. A step overwrites this array."""
    @property
    def estimate(self) -> _Array | None:
        """The state of the law, such as the estimate of an adaptive law, or None. A step overwrites this array."""
    @property
    def t(self) -> float:
        """The time, s: the number of steps times `dt`."""
    @property
    def state(self) -> dict[str, Any]:
        """The state as a dict of copies: `t`, `q`, `v`, `tau`, and the states of motors, bristles and the law if there are any."""
    @property
    def status(self) -> Status:
        """The status: `Status.SUCCESS`, or `Status.DIVERGED` after a step that diverged."""
    def step(self, tau: ArrayLike | None = None, *, force: ArrayLike | None = None) -> None:
        """Advance by `dt` with the law's input, or with the constant input `tau`.

        Args:
            tau: the plant's input, `(n,)`, N m or N (rad/s or m/s for `VelocityArm`); None: the law's input.
            force: external force during this step, N and N m, in place of the constructor's force (keyword only). With a `force_frame` it
                is `(3,)`, or `(6,)` as `[f; m]`, in world axes. Otherwise it is in the law's coordinates, at the law's frame.

        Raises:
            InputError: an argument has a wrong type, shape or value.
            SolveError: the step diverges. The state does not change.
        """
    def set_state(
        self,
        q: ArrayLike,
        v: ArrayLike,
        *,
        theta: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
        bristles: ArrayLike | None = None,
        estimate: ArrayLike | None = None,
    ) -> None:
        """Set the state, and continue from it at the present time.

        Args:
            q, v: positions (rad or m) and velocities (rad/s or m/s) of the links, `(n,)`.
            theta, theta_dot: positions (rad or m) and velocities (rad/s or m/s) of the motors of elastic arms, `(n,)` (keyword only). None:
                as at the start of `simulate`, the springs balance gravity, and the motors move with the links.
            bristles: deflections of the bristles of `LuGre` friction, `(n,)`, rad or m (keyword only). None: zeros.
            estimate: state of the law, such as the integral of a `PID` or the estimate of `Adaptive` (keyword only). It has the form of
                `sim.estimate`. None: no change, but filters and observers start from `q` and `v`.

        Raises:
            InputError: a shape is wrong, or a number is not finite. An argument for a state that the loop does not have also raises it.
        """
    def reset(self, q0: ArrayLike | None = None, v0: ArrayLike | None = None) -> None:
        """Restart the plant and the law at `t = 0`, from the initial state or from `q0` (rad or m) and `v0` (rad/s or m/s), `(n,)`."""
    def __copy__(self) -> Simulator: ...
    def __deepcopy__(self, memo: dict[int, Any]) -> Simulator: ...

def _restore_observer(
    keywords: dict[str, Any], state: tuple[list[float], list[float], list[float]], thresholds: list[float] | None, batched: bool
) -> MomentumObserver: ...

@final
class MomentumObserver:
    """An observer of the external torque: its residual `r` follows `r_dot = K (tau_ext - r)`.

    This holds if the model is exact. The observer uses positions, velocities and torques, but no accelerations. With the momentum `p = M v`
    and the Coriolis matrix `C` of the Christoffel symbols, `r = K [p(t) - p(0) - int (tau - tau_f + C' v - g + r) ds]`. In a step of length
    `dt`, the integrand uses the new `r_k`, and the other terms at the start of the step. So
    `r_k = (I + K dt)^-1 (r_(k-1) + K (p_k - p_(k-1) - (tau - tau_f + C' v - g)_(k-1) dt))`.

    `q`, `v` and `tau` are `(n,)`, or `(B, n)` for B arms of the same model. For elastic joints, `tau` is the torque of the joints on the
    links.

    Args:
        arm: the model.
        gain: `K`, 1/s, positive definite: scalar, `(n,)` or `(n, n)`.
        friction: subtract the model's viscous and Coulomb friction `tau_f`; otherwise `r` includes it (keyword only). It cannot be
            combined with `motor_inertia`.
        motor_inertia: inertia `B` of the motors of elastic joints, kg m^2 or kg, scalar, `(n,)` or `(n, n)` (keyword only). With it, the
            observer observes the motors: `q` and `v` are their positions and velocities, and `tau` is the motor torque minus the joint
            torque. Then `r` estimates the negative friction torque of the motors.
        threshold: `|r_i|` above the threshold is contact, N m or N, > 0: scalar or `(n,)` (keyword only). `calibrate` computes thresholds.

    Raises:
        InputError: a shape is wrong, a number is not finite, or a gain is not positive definite. A threshold that is not positive, and
            `friction` with `motor_inertia`, also raise it.

    Source: De Luca, Albu-Schaeffer, Haddadin and Hirzinger, Collision detection and safe reaction with the DLR-III lightweight
    manipulator arm, IROS 2006.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4], gravity=[0.0, 0.0])
    >>> obs = al.MomentumObserver(arm, 50.0)
    >>> obs.reset([0.3, 0.5], [0.0, 0.0])
    >>> for _ in range(1000):
    ...     r = obs.update([0.3, 0.5], [0.0, 0.0], [-1.0, 0.5], 1e-3)  # at rest: something holds against these torques
    >>> r.round(6)
    array([ 1. , -0.5])
    """
    @property
    def arm(self) -> Arm:
        """The arm of the observer."""
    @property
    def residual(self) -> _Array | None:
        """The last residual `r`, `(n,)` or `(B, n)`, N m or N; None before the first sample or `reset`."""
    @property
    def threshold(self) -> _Array | None:
        """The thresholds of contact `(n,)`, N m or N; None without thresholds."""
    def __new__(
        cls,
        arm: Arm,
        gain: ArrayLike,
        *,
        friction: bool = False,
        motor_inertia: ArrayLike | None = None,
        threshold: ArrayLike | None = None,
    ) -> Self: ...
    def reset(self, q: ArrayLike, v: ArrayLike) -> None:
        """Restart the observer at the positions `q` (rad or m) and velocities `v` (rad/s or m/s), `(n,)` or `(B, n)`, with `r = 0`."""
    def update(self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, dt: float) -> _Array:
        """Process the next sample, and return `r`, N m or N, of the shape of `q`.

        Args:
            q, v: positions (rad or m) and velocities (rad/s or m/s) at the sample, `(n,)` or `(B, n)`.
            tau: the torques since the last sample, N m or N, of the shape of `q`.
            dt: the time since the last sample, s, > 0.

        Without an earlier `reset`, the first sample starts the observer with `r = 0`.

        Raises:
            InputError: a shape is wrong, a number is not finite, `dt` is not positive, or `r` would not be finite. The observer then does
                not change.
        """
    def wrench(self, q: ArrayLike, frame: str, *, eps: float | None = None) -> _Array:
        """Compute the wrench `F = [f; m]` at the origin of `frame` that explains `r` best: `(6,)` or `(B, 6)`, N and N m, world axes.

        `F` is the least-squares solution of `r = J' F` with the smallest norm, if all nonzero singular values of `J'` are at least `eps`. A
        smaller one, `s`, is inverted as `s / eps^2`. The default of `eps` is 0.02 times the largest row norm of `J'`. The
        argument `q` must be the positions of the last sample.
        """
    def unexplained(self, q: ArrayLike, frame: str, *, eps: float | None = None) -> _Array:
        """Compute the part of `r` that the wrench `F` at a frame does not explain: `r - J' F`, N m or N, of the shape of `q`.

        The method has the same arguments as `wrench`.
        """
    def calibrate(self, residuals: ArrayLike, sigmas: float = 5.0) -> None:
        """Set the threshold of each joint to `|mean| + sigmas * deviation` of recorded `residuals`, `(K, n)`, N m or N.

        The record must be without contact, with `K >= 2`. `deviation` is the standard deviation; `sigmas` is 5 if None.
        """
    def contact(self) -> Any:
        """The index of the joint of the touched link, or -1 without contact: an integer, or an array `(B,)`.

        The joint is the outermost one with `|r_i|` above its threshold, because a force on a link loads no joint further out. If several
        branches have such a joint, the result is the one with the largest ratio of `|r_i|` to its threshold.
        """
