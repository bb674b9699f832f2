"""Types of control laws."""

from collections.abc import Sequence
from typing import Any, Literal, Self, final

from numpy.typing import ArrayLike
from typing_extensions import disjoint_base

from ..identification import BaseParameters
from ..null_space import NullSpace
from ..samples import Samples
from ._types import _Array
from .arms import Arm
from .motions import Motion
from .simulation import MomentumObserver

@disjoint_base
class Law:
    """A control law: `law(t, q, v)` returns the input of the plant, `(n,)`. This is the base class of all laws."""
    @property
    def arm(self) -> Arm:
        """The arm of the law."""
    @property
    def motion(self) -> Motion | None:
        """The motion that the law tracks, of the joints or of its frame; None for a law with a constant target or with several tasks."""
    @property
    def _state_count(self) -> int: ...
    @property
    def _joint_motion(self) -> Motion | None: ...
    @property
    def _joint_target(self) -> _Array | None: ...
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
        sample_time: float | None = None,
    ) -> dict[str, Any]:
        """Return a dict of the quantities that the law computes at one instant, such as its error. It has the same arguments as a call of the
        law. For a law with a state, `state` is this state, `(p,)`, and `state_rate` its rate, 1/s times its units. `sample_time`, s, is that of
        the loop; None for a continuous loop. Limits of `PriorityVelocity` and `PriorityAcceleration` depend on it.
        """  # values are arrays; for laws of prioritised tasks, also lists with one entry per level of priority
    def replace(self, **changes: Any) -> Self:
        """Make a law with other values of some arguments, such as `law.replace(kp=80.0)`. The other arguments do not change.

        Args:
            changes: arguments of the law's constructor, by name.

        Returns:
            A law of the same class.

        Raises:
            InputError: a value is not valid.
            TypeError: the constructor has no argument of this name.

        >>> import armlet as al
        >>> law = al.PDGravity(al.planar_arm([1.0], gravity=(0.0, 0.0)), [0.5], 50.0, 10.0)
        >>> law(0.0, [0.0], [0.0]), law.replace(kp=80.0)(0.0, [0.0], [0.0])
        (array([25.]), array([40.]))
        """
    def _slope(
        self,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        *,
        theta: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
        state: ArrayLike | None = None,
    ) -> _Array | None: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Adaptive(Law):
    """Adaptive tracking (Slotine and Li): `tau = Y pi_hat + Kp e + Kd e_dot`, `pi_hat_dot = Gamma Y' s`.

    `e = q_d - q`, `Lambda = Kd^-1 Kp`, `v_r = v_d + Lambda e`, `a_r = a_d + Lambda e_dot`, `s = v_r - v`, and `Y(q, v, v_r, a_r)` is the
    arm's regressor. Without leakage and dead zone, the error `e` converges to zero from every initial state and every initial estimate.
    This requires a rigid plant with the structure of the model, without sampling, torque limits and other forces. The estimate `pi_hat`
    converges to the true parameters `pi` only under excitation. Without `armature=True` the rotor inertia is known, and the law adds
    `armature a_r` to the torque.

    The estimate has all inertial parameters, or the base set of inertial parameters. After them it has the requested parameters of joints
    (friction, rotor inertia), each with its column of `Y`. The columns are `a_r` (rotor inertia), `v_r` (damping), `tanh(v_r / v_s)`
    (Coulomb friction) and `exp(-(v_r / v_s)^2) tanh(v_r / v_s)` (Stribeck friction). `parameter_names` lists all parameters.

    With leakage, `pi_hat_dot = Gamma (Y' s - sigma (pi_hat - pi_0))`. With `composite=R`, `pi_hat_dot = Gamma (Y' s + W' R e_W)` with
    `e_W = tau_W - W pi_hat`. `W` is the filtered regressor, and `tau_W` the filtered torque. The filter is `1/(p + lambda)` with the Laplace
    variable `p`, so the equation of motion becomes `tau_W = W pi`, which contains no acceleration. The filter uses the law's output as the
    torque. So composite adaptation does not allow saturation, or other torques on the arm. With `composite`, `terms` has `W`, `tau_W` and
    `e_W`. The law's state is then the estimate, followed by `n b + k + n` states of the filters. Each of b inertial parameters has `n` of
    these states, each of k joint parameters has one, and the torques have `n`.

    Args:
        arm: the arm whose regressor is used. Its inertial parameters are not used.
        motion: the desired motion of the joints.
        kp, kd: positive definite gains, N m/rad and N m s/rad (N/m, N s/m): scalar, `(n,)` or `(n, n)`.
        gamma: positive definite adaptation gain: scalar, `(p,)` or `(p, p)`, where p is the size of the estimate. The unit of entry
            `(i, j)` is the unit of `a_i` times the unit of `a_j`, per N m.
        estimate: initial estimate, `(p,)`, kg, kg m, kg m^2 and units of friction; zero if None (keyword only).
        friction: estimate friction: True for "viscous" and "coulomb", or some of "viscous", "coulomb", "stribeck" (keyword only).
        armature: estimate the rotors' inertia (keyword only).

    Other Args:
        base: the result of `arm.base_parameters()`: the law estimates only this base set (keyword only).
        natural: adapt in the metric of the bodies' pseudo-inertias (keyword only). It requires a physically possible initial estimate,
            which then stays physically possible. `gamma` is a scalar, or one number per body, 1/(N m), and then one per joint parameter, in
            its squared unit per N m. It cannot be combined with `base` or `projection`.
        projection: lower bound that keeps the estimated bodies physically possible (keyword only). In continuous time, the pseudo-inertia
            of each body `k` stays above half of its bound: `P_k >= P_k^min / 2`. The argument is the mass of the bounds of all bodies, kg,
            with a radius of gyration of 0.141 m about each axis. It may also be the inertial parameters of all bounds, in the shape of `arm.parameters`. The
            true bodies must exceed the bounds. An initial estimate below the bounds is replaced by the nearest estimate that satisfies
            them. It cannot be combined with `natural` or `base`.
        offset: estimate a constant torque of each joint, such as the offset of a torque sensor or a constant load (keyword only).
        friction_speed: `v_s` of "coulomb" and "stribeck", rad/s or m/s, > 0: scalar or `(n,)`; 0.1 if None (keyword only).
        leakage: `sigma`, >= 0 (keyword only). Its unit is 1/s divided by the unit of `gamma`. With `leakage_form="e"` the unit is 1/rad or
            1/m divided by the unit of `gamma`.
        leakage_form: "sigma" for the constant `sigma`, "e" for `sigma |s|` in its place (e-modification) (keyword only).
        leakage_centre: `pi_0`, `(p,)`, in the units of the estimate; the initial estimate if None (keyword only).
        dead_zone: `s_0`, >= 0, rad/s or m/s: the estimate is constant while the norm of `s` is below it (keyword only).
        composite: positive definite weight `R` of `e_W`, 1/(N m s^3): scalar, `(n,)` or `(n, n)`; None: no composite adaptation
            (keyword only).
        composite_rate: `lambda` of the filter, 1/s, > 0 (keyword only).
        concurrent: samples of recorded motion and torque, from `al.select_samples` (keyword only). Concurrent learning adds
            `sum_j W_j' R e_j`, `e_j = tau_j - W_j pi_hat`, to `Y' s`. The estimate then converges without excitation, if the samples
            determine the parameters.
        concurrent_weight: positive definite weight `R` of each sample: scalar, `(n,)` or `(n, n)` (keyword only). Its unit is 1/(N m s)
            for samples with accelerations, and 1/(N m s^3) for windows.

    Raises:
        InputError: a shape is wrong, a number is not finite or out of its range, a gain is not positive definite, or a name is unknown. It is
            also raised for `friction_speed`, `leakage_form`, `leakage_centre`, `composite_rate` or `concurrent_weight` without `friction`,
            `leakage`, `composite` or `concurrent`.

    Source: Slotine and Li, On the adaptive control of robot manipulators, IJRR 6(3), 1987.
    Natural metric: Lee, Kwon and Park, A natural adaptive control law for robot manipulators, IROS 2018.
    Projection: Pomet and Praly, Adaptive nonlinear regulation, IEEE TAC 37(6), 1992.
    Leakage: Ioannou and Kokotovic, Instability analysis and improvement of robustness of adaptive control, Automatica 20(5), 1984.
    E-modification: Narendra and Annaswamy, A new adaptive law for robust adaptation without persistent excitation, IEEE TAC 32(2), 1987.
    Composite: Slotine and Li, Composite adaptive control of robot manipulators, Automatica 25(4), 1989.
    Concurrent learning: Chowdhary and Johnson, Concurrent learning for convergence in adaptive control without persistency of excitation,
    CDC 2010.

    >>> import armlet as al
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> law = al.Adaptive(arm, al.Hold([1.0, 0.0]), kp=40.0, kd=20.0, gamma=5.0)
    >>> law(0.0, [0.0, 0.0], [0.0, 0.0])
    array([40.,  0.])
    >>> rubbing = al.Adaptive(arm, al.Hold([1.0, 0.0]), 40.0, 20.0, 5.0, friction=True, leakage=0.01)
    >>> rubbing.parameter_names
    ('A', 'B', 'C', 'damping[p1]', 'damping[r2]', 'friction[p1]', 'friction[r2]')
    """
    @property
    def motion(self) -> Motion:
        """The motion that the law tracks, of the joints or of its frame; None for a law with a constant target or with several tasks."""
    def __new__(
        cls,
        arm: Arm,
        motion: Motion,
        kp: ArrayLike,
        kd: ArrayLike,
        gamma: ArrayLike,
        *,
        estimate: ArrayLike | None = None,
        base: BaseParameters | None = None,
        natural: bool = False,
        projection: ArrayLike | None = None,
        friction: bool | str | Sequence[str] = False,
        armature: bool = False,
        friction_speed: ArrayLike | None = None,
        leakage: float = 0.0,
        leakage_form: str = "sigma",
        leakage_centre: ArrayLike | None = None,
        dead_zone: float = 0.0,
        composite: ArrayLike | None = None,
        composite_rate: float = 10.0,
        concurrent: Samples | None = None,
        concurrent_weight: ArrayLike = 1.0,
        offset: bool = False,
    ) -> Self: ...
    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the `p` estimated parameters, in the order of the estimate."""

@final
class ComputedTorque(Law):
    """Computed torque: `tau = M (a_d + Kd e_dot + Kp e) + C v + g` with `e = q_d - q`.

    If the plant is the rigid arm of the model, without friction, external forces, sampling and torque limits, the error obeys
    `e_ddot + Kd e_dot + Kp e = 0`.

    Args:
        arm: the model of the plant.
        motion: the desired motion of the joints.
        kp, kd: positive definite gains, 1/s^2 and 1/s: scalar, `(n,)` or `(n, n)`.

    Raises:
        InputError: a shape is wrong, a number is not finite, or a gain is not positive definite.

    Source: [SicilianoEtAl2009], section 8.5.

    >>> import armlet as al
    >>> law = al.ComputedTorque(al.planar_pr(2.0, 0.5, 0.5), al.Hold([1.0, 0.0]), kp=100.0, kd=20.0)
    >>> law(0.0, [0.0, 0.0], [0.0, 0.0])
    array([200.,  50.])
    """
    @property
    def motion(self) -> Motion:
        """The motion that the law tracks, of the joints or of its frame; None for a law with a constant target or with several tasks."""
    def __new__(cls, arm: Arm, motion: Motion, kp: ArrayLike, kd: ArrayLike) -> Self: ...

@final
class PDGravity(Law):
    """PD control with gravity compensation: `tau = Kp (q_d - q) - Kd v + g(q)`.

    A rigid arm converges to the target from every state if the model's gravity is exact, and no other forces act. This is proved for a
    loop without sampling and torque limits.

    Args:
        arm: the model whose gravity is compensated.
        target: `q_d`, `(n,)`, rad or m.
        kp, kd: positive definite gains, N m/rad and N m s/rad (N/m, N s/m): scalar, `(n,)` or `(n, n)`.

    Raises:
        InputError: a shape is wrong, a number is not finite, or a gain is not positive definite.

    Source: Takegaki and Arimoto, A new feedback method for dynamic control of manipulators, 1981.

    >>> import armlet as al
    >>> law = al.PDGravity(al.pendulum(1.0, 5.0), [1.0], kp=10.0, kd=4.0)
    >>> law(0.0, [0.0], [0.5])
    array([8.])
    """
    def __new__(cls, arm: Arm, target: ArrayLike, kp: ArrayLike, kd: ArrayLike) -> Self: ...

@final
class PID(Law):
    """PID control with gravity compensation: `u = g(q) + Kp (q_d - q) + Kd (v_d - v) + w` with `w_dot = Ki (q_d - q)`.

    The torque `tau` is `u`, clipped to `tau_max`. With `ki`, the integral torque `w` `(n,)`, N m or N, is the first part of the law's state. It starts
    at zero, and `run.estimate[:, :n]` records it. The integral removes the error that a constant unknown load would cause. While `u_i`
    exceeds the limit of joint `i`, `w_i` does not grow in that direction. For a moving target the law adds `M(q) a_d` to `u`.

    Args:
        arm: the model whose gravity is compensated.
        target: `q_d`, `(n,)`, rad or m, or a motion of the joints.
        kp, ki, kd: positive definite gains, N m/rad, N m/(rad s) and N m s/rad (N/m, N/(m s), N s/m): scalar, `(n,)` or `(n, n)`. The loop
            of a single joint of inertia `m` without filter and observer is stable if `ki < kp kd / m`. `ki=None`: no integral.
        tau_max: the largest commanded torque, N m or N, scalar or `(n,)`; no limit if None.
        derivative_filter: `N`, 1/s, scalar or `(n,)` (keyword only). The law replaces `v` by the filtered derivative of `q`,
            `v_f = N (q - y)` with `y_dot = v_f`. None: the law uses the measured `v`.
        friction: add the friction of the model at the desired velocity, `damping v_d + friction tanh(v_d / v_s)` (keyword only).
        friction_speed: `v_s`, rad/s or m/s, > 0, scalar or `(n,)`; 0.1 if None (keyword only).
        observer_bandwidth: `h`, 1/s, scalar or `(n,)`; None: no disturbance observer (keyword only). The observer estimates
            `d = h/(p + h) (m a - (tau - g - f))`, where `p` is the Laplace variable and `f` the friction above. The law subtracts `d` from
            `u`, and adds `m a_d` instead of `M a_d`.
        nominal_inertia: `m`, kg m^2 or kg, > 0, scalar or `(n,)`; the diagonal of `M` at the first desired position if None (keyword only).

    In `run.estimate`, the state `y` of the filter and then the state `s` of the observer follow `w`. The observer computes
    `d = h (m v - s)`, or `d = h (m v_f - s)` with a filter.

    Raises:
        InputError: a shape is wrong, a number is not finite, a gain is not positive definite, or an option is not positive. It is also
            raised for `friction_speed` without `friction`, and for `nominal_inertia` without `observer_bandwidth`.

    Source: Arimoto and Miyazaki, Stability and robustness of PID feedback control for robot manipulators, 1984; filter and conditional
    integration: Astrom and Hagglund, Advanced PID Control, 2006; observer: Ohnishi, Shibata and Murakami, Motion control for advanced
    mechatronics, 1996.

    >>> import armlet as al
    >>> law = al.PID(al.pendulum(1.0, 5.0), [1.0], kp=10.0, ki=5.0, kd=4.0, tau_max=9.0)
    >>> law(0.0, [0.0], [0.5], state=[0.5])
    array([8.5])
    >>> law(0.0, [0.0], [0.0], state=[0.5])
    array([9.])
    """
    def __new__(
        cls,
        arm: Arm,
        target: ArrayLike | Motion,
        kp: ArrayLike,
        ki: ArrayLike | None,
        kd: ArrayLike,
        tau_max: ArrayLike | None = None,
        *,
        derivative_filter: ArrayLike | None = None,
        friction: bool = False,
        friction_speed: ArrayLike | None = None,
        observer_bandwidth: ArrayLike | None = None,
        nominal_inertia: ArrayLike | None = None,
    ) -> Self: ...

@final
class Guarded(Law):
    """A law with a momentum observer, which detects contact and reacts to it.

    The residual `r` of the observer with the gain `K` follows the external torque `tau_ext`: `r_dot = K (tau_ext - r)`. It is computed from
    measured states and commanded torques. In a sampled loop it is the residual of `MomentumObserver`. With thresholds, contact is the first
    sample at which some `|r_i|` is above its threshold. From that sample on, a reaction `tau = g(q) + K_c (q_c - q) + D_c (q_c_dot - v)`
    replaces the law, and the law's state is constant:

    - "stop": `q_c` is the position at contact;
    - "float": gravity is compensated, `K_c = 0`, and `D_c = damping` or zero;
    - "retract": `q_c` moves from the position at contact in the direction of the residual at contact, for `duration`.

    For elastic joints the observer reads the joint torque `K_J (theta - q)`, and the reaction uses the motor positions `theta` as `q`.
    `run.residual`, `run.contact` and `run.touched` report the results of the observer.

    Args:
        law: the law before contact, of a rigid or elastic arm. It cannot be a Python function, or a law of a `VelocityArm`.
        observer: a `MomentumObserver` of links, for its model, gain, friction and thresholds. The law keeps a copy.
        reaction: "stop", "float" or "retract"; None: only the observer. A reaction requires thresholds, and a run with a `sample_time`.
        stiffness: `K_c` of "stop" and "retract", N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)` (keyword only).
        damping: `D_c`, N m s/rad or N s/m, positive definite: scalar, `(n,)` or `(n, n)`; may be None for "float" (keyword only).
        speed: speed of the fastest joint during "retract", rad/s or m/s, > 0; 0.3 if None (keyword only).
        duration: time for which `q_c` moves, s, > 0; 0.5 if None (keyword only).
        joint_stiffness: `K_J`, N m/rad or N/m, scalar, `(n,)` or `(n, n)` (keyword only). It is required if `law` controls an elastic arm
            and does not itself have `K_J`.

    `run.estimate` records the law's state. It is the state of `law`, then `w` with `r = K (M v - w)`, and the integral of `r`, `(n,)` each.
    A reaction adds `2 + 2 n` numbers, which are zero before the contact: `c`, `s`, and the products of `c` with `y_c` and `r_c`. `c` is the
    duration of the sampling period that begins at the contact, and `s` is the time since the contact, both in s. `y_c` and `r_c` are the
    position and the residual at the contact, `(n,)` each.

    Raises:
        InputError: an argument is of the wrong type or shape, is missing or not used, or a reaction has an observer without thresholds.

    Source: De Luca, Albu-Schaeffer, Haddadin and Hirzinger, Collision detection and safe reaction with the DLR-III lightweight manipulator
    arm, IROS 2006. Haddadin, De Luca and Albu-Schaeffer, Robot collisions: a survey on detection, isolation, and identification, 2017.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> observer = al.MomentumObserver(arm, 50.0, threshold=2.0)
    >>> law = al.Guarded(al.PDGravity(arm, [0.5, 0.3], 60.0, 9.0), observer, "stop", stiffness=60.0, damping=12.0)
    >>> push = [(0.0, [0.0, 0.0, 0.0]), (1.0, [0.0, 20.0, 0.0])]
    >>> run = al.simulate(al.RigidArm(arm), law, [0.5, 0.3], t_end=1.5, sample_time=1e-3, force=push, force_frame="link2")
    >>> round(run.contact.time, 3), run.contact.joint
    (1.004, 0)
    """
    @property
    def law(self) -> Law:
        """The law before contact."""
    @property
    def observer(self) -> MomentumObserver:
        """A copy of the observer, with its thresholds."""
    @property
    def reaction(self) -> Literal["stop", "float", "retract"] | None:
        """The reaction: "stop", "float", "retract", or None."""
    @property
    def motion(self) -> Motion | None:
        """The motion that the law before contact tracks; None for a law with a constant target."""
    @property
    def _gain(self) -> _Array: ...
    @property
    def _first(self) -> int: ...
    def __new__(
        cls,
        law: Law,
        observer: MomentumObserver,
        reaction: Literal["stop", "float", "retract"] | None = None,
        *,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
        speed: float | None = None,
        duration: float | None = None,
        joint_stiffness: ArrayLike | None = None,
    ) -> Self: ...
    def touched(self, residual: ArrayLike) -> Any:
        """The index of the joint of the touched link for residuals `(n,)`, `(K, n)` or `(B, K, n)`, N m or N; -1 without contact.

        The result is one index, or an array of indices `(K,)` or `(B, K)`. The joint is the outermost one with `|r_i|` above its threshold,
        as in `MomentumObserver.contact`.

        Raises:
            InputError: a shape is wrong, a number is not finite, or the observer has no thresholds.
        """  # the index of a joint, or an array of indices
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class CartesianImpedance(Law):
    """Cartesian impedance: a spring and a damper between a frame and its target, `tau = J'(K e + D (x_d_dot - J v)) + g(q)` with
    `e = x_d - x`.

    `axes` selects the m controlled coordinates in order. The letters of "xyz" are positions, and "rx ry rz" are orientations. The
    orientation error in `e` is `log(R_d R')`, with the rotation `R` of the frame and the rotation `R_d` of the target's rotation vector.
    Without options the law uses no inverse of `J`, and it is defined at singularities. With options,

        F = K e + D (x_d_dot - J v) + F_ff + w,  w_dot = K_i e    within wrench_max
        tau = J' F + N' tau_0 + g(q)                              within tau_max

    `N' tau_0` is the torque of a `NullSpace`. With `compensate_coupling` the law adds `C v` to the torque and `L (x_d_ddot - J_dot v)` to
    the wrench, with `L = (J M^-1 J')^-1`. At full rank, without an external force and within the limits, every motion then satisfies
    `L (x_ddot - x_d_ddot) = F`. This requires the projection "consistent" of a `NullSpace`. Near singularities, singular values of
    `J M^-1/2` (of `J` for the projection "static") below `eps` count as `eps`. For this comparison, the rows of positions are divided by
    the root mean square of their norms, and likewise the rows of orientations.

    The integral wrench `w` `(m,)` is the law's state. It starts at zero, and `run.estimate` records it. While `F` or a torque exceeds a
    limit, the entries of `w` do not change in directions that increase the excess.

    Args:
        arm: the model, for kinematics and gravity, and for the mass matrix in some options.
        target: `x_d`, `(m,)`, m or rad; a pose `(4, 4)`; or a motion of the m coordinates, which may include the rotation vector.
            For the axes "xyz rx ry rz", `arm.pose_vector(q, frame)` is the target at the joint positions `q`.
        stiffness, damping: `K` and `D`, positive definite, N/m and N s/m (N m/rad, N m s/rad): scalar, `(m,)` or `(m, m)`.
        frame: name of the controlled frame (keyword only).
        axes: the m coordinates in world axes, such as "xy" or "xyz rx ry rz"; "xyz" if None, also for a pose `(4, 4)` (keyword only).
        nullspace: a `NullSpace`, for arms with more joints than m (keyword only).
        tau_max: the largest commanded torque, N m or N, scalar or `(n,)`; no limit if None (keyword only).

    Other Args:
        feedforward: `F_ff`, a wrench in the m coordinates, `(m,)`, N and N m (keyword only).
        compensate_coupling: compensate the coupling between null-space motion and the frame (keyword only).
        eps: the smallest singular value in `L` and in the null-space projector, 1e-7 <= `eps` < 1; 0.02 if None (keyword only).
            It requires `nullspace` or `compensate_coupling`.
        integral_gain: `K_i`, N/(m s) and N m/(rad s), at least zero: scalar, `(m,)`, or positive definite `(m, m)` (keyword only).
        wrench_max: the largest magnitude of each entry of `F`, N and N m, scalar or `(m,)`; no limit if None (keyword only).

    Raises:
        InputError: a shape is wrong, a number is not finite, a matrix is not positive definite, or a name is unknown. It is also raised for
            a limit that is not positive, and for a target `(4, 4)` that is not a pose.

    Source: Hogan, Impedance control: an approach to manipulation, J. Dyn. Sys. Meas. Control 107, 1985. Khatib, A unified approach for
    motion and force control of robot manipulators: the operational space formulation, IEEE J. Robotics and Automation 3(1), 1987.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> law = al.CartesianImpedance(arm, [0.4, 0.5], [300.0, 200.0], [40.0, 30.0], frame="link2", axes="xy")
    >>> run = al.simulate(al.RigidArm(arm), law, [0.3, 1.0], t_end=3.0, method="dop853", t_eval=[0.0, 3.0])
    >>> arm.position(run.q[-1], "link2").round(3)
    array([0.4, 0.5, 0. ])
    """
    def __new__(
        cls,
        arm: Arm,
        target: ArrayLike | Motion,
        stiffness: ArrayLike,
        damping: ArrayLike,
        *,
        frame: str,
        axes: str | None = None,
        nullspace: NullSpace | None = None,
        feedforward: ArrayLike | None = None,
        compensate_coupling: bool = False,
        eps: float | None = None,
        integral_gain: ArrayLike | None = None,
        wrench_max: ArrayLike | None = None,
        tau_max: ArrayLike | None = None,
    ) -> Self: ...

@final
class ElasticImpedance(Law):
    """Cartesian impedance of an arm with elastic joints: a spring and a damper at a frame, and a reduction of the motors' inertia.

    `tau = (I - B B0^-1) K_J (theta - q) + B B0^-1 (u - D0 theta_dot)` with `u = J'(K (x_d - x) - D J v) + g(q)`. Motors of inertia `B` then
    behave like motors of the smaller inertia `B0`. With an external force `F` and without options, the equilibrium is `x_E = x_d + K^-1 F`
    if that pose is reachable, regular and stable (see `equilibrium`). The joint torque is then `tau_E = g(q_E) - J'F`. Without options the
    law uses no inverse of `J`. For diagnosis, `terms()` returns the mass and Coriolis matrices `M_x`, `S_x` in the coordinates of the
    target, NaN where `J` loses rank.

    Args:
        arm: the model of the links, for kinematics and gravity.
        target: `x_d`, `(m,)`, m or rad; a pose `(4, 4)`; or a motion of the m coordinates.
        stiffness, damping: `K` and `D`, positive definite, N/m and N s/m (N m/rad, N m s/rad): scalar, `(m,)` or `(m, m)`.
        joint_stiffness: `K_J`, N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)`.
        motor_inertia, reduced_inertia: `B` and `B0`, kg m^2 or kg, positive definite: scalar, `(n,)` or `(n, n)`.
        frame: name of the controlled frame (keyword only).
        axes: the m controlled coordinates in world axes, such as "xy" or "xyz rx ry rz"; "xyz" if None (keyword only).

    Other Args:
        motor_damping: `D0`, N m s/rad or N s/m, positive definite: scalar, `(n,)` or `(n, n)`; computed from `damping_ratio` if None
            (keyword only).
        damping_ratio: `zeta` > 0 of `D0 = 2 zeta B0^1/2 (B0^-1/2 K_J B0^-1/2)^1/2 B0^1/2`; 1 if None (keyword only).
        relative_damping: `D0` acts on `theta_dot - v` (keyword only). The motion is then nearer to the motion of a rigid arm with the same
            outer loop.
        nullspace, feedforward, compensate_coupling, eps, integral_gain, wrench_max: options of the outer loop, as for
            `CartesianImpedance` (keyword only).
        tau_max: the largest commanded motor torque, N m or N, scalar or `(n,)`; no limit if None (keyword only). While a motor torque
            exceeds its limit, the integral wrench does not change in directions that increase the excess.

    Raises:
        InputError: a shape is wrong, a number is not finite, a matrix is not positive definite, a name is unknown, or a limit is
            not positive.

    Source: Ott, Albu-Schaeffer, Kugi and Hirzinger, On the passivity-based impedance control of flexible joint robots,
    IEEE Trans. Robotics 24(2), 2008.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> plant = al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25])
    >>> law = al.ElasticImpedance(arm, [0.4, 0.5], [300.0, 200.0], [40.0, 30.0], [800.0, 500.0], [0.4, 0.25], [0.02, 0.0125],
    ...                           frame="link2", axes="xy")
    >>> law.terms(0.0, [0.3, 1.0], [0.0, 0.0], theta=[0.3, 1.0], theta_dot=[0.0, 0.0])["D0"]
    array([[8., 0.],
           [0., 5.]])
    >>> run = al.simulate(plant, law, [0.3, 1.0], t_end=5.0, method="dop853", t_eval=[0.0, 5.0], force=[10.0, -15.0])
    >>> arm.position(run.q[-1], "link2").round(3)
    array([0.433, 0.425, 0.   ])
    """
    def __new__(
        cls,
        arm: Arm,
        target: ArrayLike | Motion,
        stiffness: ArrayLike,
        damping: ArrayLike,
        joint_stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        reduced_inertia: ArrayLike,
        *,
        frame: str,
        axes: str | None = None,
        motor_damping: ArrayLike | None = None,
        damping_ratio: float | None = None,
        relative_damping: bool = False,
        nullspace: NullSpace | None = None,
        feedforward: ArrayLike | None = None,
        compensate_coupling: bool = False,
        eps: float | None = None,
        integral_gain: ArrayLike | None = None,
        wrench_max: ArrayLike | None = None,
        tau_max: ArrayLike | None = None,
    ) -> Self: ...

@final
class ElasticTracking(Law):
    """Deprecated: `ElasticImpedance` with a motion as its target is the same law, with more options. A construction issues a
    `DeprecationWarning`.

    The outer loop is `u = J'(K (x_d(t) - x) + D (x_d_dot(t) - J v)) + g(q)`, and the inner loop is the same as in `ElasticImpedance`. The
    law has no feed-forward of the arm's inertia, so it follows an accelerating target with an error.

    Args:
        target: the motion of the target in the m coordinates of `axes`, m or rad.
        arm, stiffness, damping, joint_stiffness, frame, axes: as for `ElasticImpedance`.
        motor_inertia, reduced_inertia, motor_damping, damping_ratio, relative_damping: as for `ElasticImpedance`.

    Raises:
        InputError: a shape is wrong, a number is not finite or out of its range, a matrix is not positive definite, or a name is unknown.

    Source: [Ott2008]; docs/elastic.md.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> line = al.Quintic([0.6, 0.3], [0.4, 0.5], 2.0)
    >>> law = al.ElasticImpedance(arm, line, 300.0, 40.0, 800.0, 0.4, 0.02, frame="link2", axes="xy", relative_damping=True)
    >>> law.terms(2.0, [0.3, 1.0], [0.0, 0.0], theta=[0.3, 1.0], theta_dot=[0.0, 0.0])["x_d"]
    array([0.4, 0.5])
    """
    def __new__(
        cls,
        arm: Arm,
        target: Motion,
        stiffness: ArrayLike,
        damping: ArrayLike,
        joint_stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        reduced_inertia: ArrayLike,
        *,
        frame: str,
        axes: str | None = None,
        motor_damping: ArrayLike | None = None,
        damping_ratio: float | None = None,
        relative_damping: bool = False,
    ) -> Self: ...

@final
class JointImpedance(Law):
    """Joint impedance of an arm with elastic joints: `u = K (q_d - q) + D (v_d - v) + g(q)`.

    The inner loop, which computes the motor torque from `u`, is the same as in `ElasticImpedance`. The velocity `v_d` of the target is zero
    for a constant target. The law has no feed-forward of inertia, so the links follow an accelerating target with an error. If the target
    has a constant velocity, and mass matrix and gravity are constant, the error vanishes with `relative_damping=True`. Without it, the
    motor damping `D0` causes the error `K^-1 D0 v_d`. `JointTracking` follows every smooth motion without error.

    Args:
        arm: the model whose gravity is compensated.
        target: `q_d`, `(n,)`, rad or m, or a motion of the joints.
        stiffness, damping: `K` and `D`, N m/rad and N m s/rad (N/m, N s/m), positive definite: scalar, `(n,)` or `(n, n)`.
        joint_stiffness, motor_inertia, reduced_inertia, motor_damping, damping_ratio, relative_damping: as for `ElasticImpedance`.

    Raises:
        InputError: a shape is wrong, a number is not finite or out of its range, or a matrix is not positive definite.

    Source: Albu-Schaeffer, Ott and Hirzinger, A unified passivity-based control framework for flexible joint robots,
    IJRR 26(1), 2007.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> law = al.JointImpedance(arm, [0.3, 1.0], 50.0, [4.0, 2.0], [800.0, 500.0], [0.4, 0.25], [0.02, 0.0125])
    >>> run = al.simulate(al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25]), law, [0.0, 0.5], t_end=3.0, method="dop853")
    >>> run.q[-1].round(3)
    array([0.3, 1. ])
    """
    def __new__(
        cls,
        arm: Arm,
        target: ArrayLike,
        stiffness: ArrayLike,
        damping: ArrayLike,
        joint_stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        reduced_inertia: ArrayLike,
        *,
        motor_damping: ArrayLike | None = None,
        damping_ratio: float | None = None,
        relative_damping: bool = False,
    ) -> Self: ...

@final
class JointTracking(Law):
    """Tracking of a joint motion with elastic joints: feed-forward of links and motors, and PD control of the motors.

    `tau = B theta_d_ddot + tau_J,d + Kp (theta_d - theta) + Kd (theta_d_dot - theta_dot)` with the desired joint torque
    `tau_J,d = M(q_d) a_d + C(q_d, v_d) v_d + g(q_d)` and the desired motor position `theta_d = q_d + K_J^-1 tau_J,d`. `theta_d_dot` and
    `theta_d_ddot` contain jerk and snap of the motion. With an exact model, and a start at `theta_d` and `theta_d_dot`, the links follow
    the motion without error.

    Args:
        arm: the model of the links.
        motion: `q_d(t)` of the links, with jerk and snap at every time: no `BangBang`, and no path whose acceleration jumps.
        kp, kd: positive definite gains of the motors, N m/rad and N m s/rad (N/m, N s/m): scalar, `(n,)` or `(n, n)`.
        joint_stiffness: `K_J`, N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)`.
        motor_inertia: `B`, kg m^2 or kg, positive definite: scalar, `(n,)` or `(n, n)`.

    Raises:
        InputError: a shape is wrong, a number is not finite, the acceleration of the motion jumps, or a gain, `joint_stiffness` or
            `motor_inertia` is not positive definite.

    Source: [DeLucaBook2016, Spong1987]; docs/elastic.md.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> motion = al.Sinusoid([0.3, 1.0], 0.4, 3.0, 0.3)
    >>> law = al.JointTracking(arm, motion, 100.0, 10.0, [800.0, 500.0], [0.4, 0.25])
    >>> q, v, _ = motion(0.0)
    >>> start = law.terms(0.0, q, v, theta=q, theta_dot=v)
    >>> run = al.simulate(al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25]), law, q, v0=v, theta0=start["theta_d"],
    ...                   theta_dot0=start["theta_d_dot"], t_end=2.0, method="dop853", rtol=1e-10, atol=1e-12)
    >>> bool(abs(run.q[-1] - motion(2.0)[0]).max() < 1e-7)
    True
    """
    def __new__(
        cls, arm: Arm, motion: Motion, kp: ArrayLike, kd: ArrayLike, joint_stiffness: ArrayLike, motor_inertia: ArrayLike
    ) -> Self: ...

@final
class MotorPD(Law):
    """PD control of the motors of elastic joints with gravity compensation: `tau = Kp (theta_d - theta) + Kd (theta_d_dot - theta_dot) + g`.

    `theta_d = q_d + K_J^-1 g(q_d)`. The compensation is that of the target, `g = g(q_d)`, or online, `g = g(theta - K_J^-1 g(q_d))`. With an
    exact model and no external force, `q_d` is an equilibrium in both cases. If `kp` is too small compared with the derivative of gravity,
    there may be further equilibria (see `equilibrium`).

    For a motion `q_d(t)`, `theta_d` and `g(q_d)` follow the motion, and `theta_d_dot` is the derivative of `theta_d` with respect to time.
    This is the feed-forward of gravity and of the deflection that it causes, without a feed-forward of inertia. The error vanishes where the
    motion rests. It also vanishes at constant velocity if mass matrix and gravity are constant, and the plant has no friction.
    `JointTracking` follows every smooth motion without error.

    Args:
        arm: the model whose gravity is compensated.
        target: `q_d` of the links, `(n,)`, rad or m, or a motion of the joints.
        kp, kd: positive definite gains of the motors, N m/rad and N m s/rad (N/m, N s/m): scalar, `(n,)` or `(n, n)`.
        joint_stiffness: `K_J`, N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)`.
        online: compute the gravity compensation from the motor positions at every instant (keyword only).

    Raises:
        InputError: a shape is wrong, a number is not finite, or a gain or `joint_stiffness` is not positive definite.

    Source: Tomei, A simple PD controller for robots with elastic joints, IEEE Trans. Automatic Control 36(10), 1991; De Luca,
    Siciliano and Zollo, PD control with on-line gravity compensation for robots with elastic joints, Automatica 41, 2005.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> law = al.MotorPD(arm, [0.3, 1.0], 100.0, 20.0, [800.0, 500.0], online=True)
    >>> run = al.simulate(al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25]), law, [0.0, 0.5], t_end=10.0, method="dop853")
    >>> run.q[-1].round(3)
    array([0.3, 1. ])
    """
    def __new__(
        cls, arm: Arm, target: ArrayLike, kp: ArrayLike, kd: ArrayLike, joint_stiffness: ArrayLike, *, online: bool = False
    ) -> Self: ...

@final
class StateFeedback(Law):
    """Regulation of elastic joints by feedback of motor position, motor velocity, joint torque `tau_J` and its time derivative.

    `tau = g_d + Kp (theta_d - theta) + Kd (theta_d_dot - theta_dot) + Kt (g_d - tau_J) + Ks (g_d_dot - tau_J_dot)` with `g_d = g(q_d)`,
    `theta_d = q_d + K_J^-1 g_d` and `tau_J = K_J (theta - q)`.

    For a constant target, `theta_d_dot` and `g_d_dot` are zero. For a motion, they are derivatives with respect to time. As for `MotorPD`,
    this is a feed-forward of gravity and deflection, without a feed-forward of inertia, and the error vanishes under the same conditions.

    Args:
        arm: the model whose gravity is compensated.
        target: `q_d` of the links, `(n,)`, rad or m, or a motion of the joints.
        kp, kd: positive definite gains of the motors, N m/rad and N m s/rad (N/m, N s/m): scalar, `(n,)` or `(n, n)`.
        kt: positive definite gain of the joint torque, without unit: scalar, `(n,)` or `(n, n)`.
        ks: positive definite gain of the derivative of the joint torque, s: scalar, `(n,)` or `(n, n)`.
        joint_stiffness: `K_J`, N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)`.

    Raises:
        InputError: a shape is wrong, a number is not finite, or a gain or `joint_stiffness` is not positive definite.

    Source: Albu-Schaeffer and Hirzinger, A globally stable state feedback controller for flexible joint robots,
    Advanced Robotics 15(8), 2001.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> law = al.StateFeedback(arm, [0.3, 1.0], 200.0, 20.0, 1.0, 0.02, [800.0, 500.0])
    >>> run = al.simulate(al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25]), law, [0.0, 0.5], t_end=10.0, method="dop853")
    >>> run.q[-1].round(3)
    array([0.3, 1. ])
    """
    def __new__(
        cls, arm: Arm, target: ArrayLike, kp: ArrayLike, kd: ArrayLike, kt: ArrayLike, ks: ArrayLike, joint_stiffness: ArrayLike
    ) -> Self: ...

def _select_samples(
    law: Law,
    record: tuple[ArrayLike, ArrayLike, ArrayLike],
    a: ArrayLike | None,
    windows: tuple[ArrayLike | None, float | None, bool],
    count: int,
) -> dict[str, Any]: ...
