//! `armlet.CartesianImpedance`, and the common arguments of the impedance laws: targets and options.

use super::{Arguments, Law};
use crate::arguments::require_partner;
use crate::arrays::{Axis, Form, SCALAR, copied, numbers, owned, require_finite, spread, text};
use crate::errors::{Failure, input_error};
use crate::motion::Motion as PyMotion;
use armlet_core::kinematics::coordinates::{parse_axes, rows_of_pose};
use armlet_core::law::{CartesianImpedanceSpec, ImpedanceOptions, NullProjection, NullSpaceSpec};
use armlet_core::linalg::gain::Gain;
use armlet_core::motion::Motion;
use armlet_macros::entered;
use pyo3::prelude::*;

/// Read a gain that may be zero: a scalar, `(n,)`, or a positive definite matrix `(n, n)`.
fn gain_or_zero<'py>(function: &str, name: &'static str, value: &Bound<'py, PyAny>, n: usize) -> Result<Gain, Failure> {
    let forms = [SCALAR, Form(&[Axis::Is(n)]), Form(&[Axis::Is(n), Axis::Is(n)])];
    let (shape, values) = numbers(function, name, value, &forms)?;
    require_finite(value.py(), function, name, &shape, &values)?;
    match shape.len() {
        2 => Ok(Gain::full(name, n, owned(values)?)?),
        _ => Ok(Gain::not_negative(name, spread(&shape, values, n)?)?),
    }
}

/// The Python arguments of the options of an impedance law.
#[derive(Default)]
pub(super) struct OptionArguments<'a, 'py> {
    pub nullspace: Option<&'a Bound<'py, PyAny>>,
    pub feedforward: Option<&'a Bound<'py, PyAny>>,
    pub compensate_coupling: Option<&'a Bound<'py, PyAny>>,
    pub eps: Option<&'a Bound<'py, PyAny>>,
    pub integral_gain: Option<&'a Bound<'py, PyAny>>,
    pub wrench_max: Option<&'a Bound<'py, PyAny>>,
    pub tau_max: Option<&'a Bound<'py, PyAny>>,
}

impl<'py> OptionArguments<'_, 'py> {
    /// Read the options of a law of `m` coordinates.
    pub fn read(&self, given: &mut Arguments<'py>, m: usize) -> Result<ImpedanceOptions, Failure> {
        let n = given.model().n();
        let mut options = ImpedanceOptions::default();
        if let Some(value) = self.nullspace {
            options.null_space = Some(null_space(given.function(), value, n)?);
            given.store("nullspace", value);
        }
        if let Some(value) = self.feedforward {
            options.feedforward = Some(given.vector("feedforward", value, m)?);
        }
        options.compensate_coupling = given.flag("compensate_coupling", self.compensate_coupling)?;
        if let Some(value) = self.eps {
            options.eps = given.number("eps", value)?;
            // The core refuses an invalid threshold.
            let (inverts, valid) =
                (options.null_space.is_some() || options.compensate_coupling, (ImpedanceOptions::LEAST_EPS..1.0).contains(&options.eps));
            require_partner(given.function(), "eps", Some(value), "nullspace or compensate_coupling", inverts || !valid)?;
        }
        if let Some(value) = self.integral_gain {
            options.integral_gain = Some(gain_or_zero(given.function(), "integral_gain", value, m)?);
            given.store_copy("integral_gain", value)?;
        }
        for (name, value, count) in [("wrench_max", self.wrench_max, m), ("tau_max", self.tau_max, n)] {
            let Some(value) = value else { continue };
            let (shape, values) = numbers(given.function(), name, value, &[SCALAR, Form(&[Axis::Is(count)])])?;
            let limits = Some(spread(&shape, values, count)?);
            if name == "tau_max" {
                options.tau_max = limits;
            } else {
                options.wrench_max = limits;
            }
            given.store_copy(name, value)?;
        }
        Ok(options)
    }
}

/// Read an `armlet.NullSpace`.
fn null_space(function: &'static str, value: &Bound<'_, PyAny>, n: usize) -> Result<NullSpaceSpec, Failure> {
    let field = |name: &str| {
        let refused = |_| input_error(value.py(), function, "nullspace", "is of the wrong type: expected a NullSpace or None");
        value.getattr(name).map_err(refused)
    };
    let q_d = field("q_d")?;
    let posture = match q_d.cast::<PyMotion>() {
        Ok(motion) => motion.get().core.clone(),
        Err(_) => {
            let (shape, values) = numbers(function, "nullspace.q_d", &q_d, &[Form(&[Axis::Is(n)])])?;
            require_finite(value.py(), function, "nullspace.q_d", &shape, &values)?;
            Motion::Hold(owned(values)?)
        }
    };
    let stiffness = gain_or_zero(function, "nullspace.stiffness", &field("stiffness")?, n)?;
    let damping = gain_or_zero(function, "nullspace.damping", &field("damping")?, n)?;
    let projection = NullProjection::of_name(&text(function, "nullspace.projection", &field("projection")?)?)?;
    Ok(NullSpaceSpec::new(n, posture, stiffness, damping, projection)?)
}

/// Read the target of an impedance law: a motion of the coordinates `axes`, a constant position `(m,)`, or a pose `(4, 4)`.
pub(super) fn target<'py>(given: &mut Arguments<'py>, value: &Bound<'py, PyAny>, axes: &str) -> Result<Motion, Failure> {
    let rows = parse_axes(axes)?;
    let Ok((shape, pose)) = numbers(given.function(), "target", value, &[Form(&[Axis::Is(4), Axis::Is(4)])]) else {
        return given.motion_or_hold("target", value, rows.len());
    };
    require_finite(value.py(), given.function(), "target", &shape, &pose)?;
    let values = rows_of_pose(&pose, &rows)?;
    let stored = copied(value.py(), &[values.len()], &values)?;
    given.store("target", &stored);
    Ok(Motion::Hold(values))
}

/// Cartesian impedance: a spring and a damper between a frame and its target, `tau = J'(K e + D (x_d_dot - J v)) + g(q)` with
/// `e = x_d - x`.
///
/// `axes` selects the m controlled coordinates in order. The letters of "xyz" are positions, and "rx ry rz" are orientations. The
/// orientation error in `e` is `log(R_d R')`, with the rotation `R` of the frame and the rotation `R_d` of the target's rotation vector.
/// Without options the law uses no inverse of `J`, and it is defined at singularities. With options,
///
///     F = K e + D (x_d_dot - J v) + F_ff + w,  w_dot = K_i e    within wrench_max
///     tau = J' F + N' tau_0 + g(q)                              within tau_max
///
/// `N' tau_0` is the torque of a `NullSpace`. With `compensate_coupling` the law adds `C v` to the torque and `L (x_d_ddot - J_dot v)` to
/// the wrench, with `L = (J M^-1 J')^-1`. At full rank, without an external force and within the limits, every motion then satisfies
/// `L (x_ddot - x_d_ddot) = F`. This requires the projection "consistent" of a `NullSpace`. Near singularities, singular values of
/// `J M^-1/2` (of `J` for the projection "static") below `eps` count as `eps`. For this comparison, the rows of positions are divided by
/// the root mean square of their norms, and likewise the rows of orientations.
///
/// The integral wrench `w` `(m,)` is the law's state. It starts at zero, and `run.estimate` records it. While `F` or a torque exceeds a
/// limit, the entries of `w` do not change in directions that increase the excess.
///
/// Args:
///     arm: the model, for kinematics and gravity, and for the mass matrix in some options.
///     target: `x_d`, `(m,)`, m or rad; a pose `(4, 4)`; or a motion of the m coordinates, which may include the rotation vector.
///         For the axes "xyz rx ry rz", `arm.pose_vector(q, frame)` is the target at the joint positions `q`.
///     stiffness, damping: `K` and `D`, positive definite, N/m and N s/m (N m/rad, N m s/rad): scalar, `(m,)` or `(m, m)`.
///     frame: name of the controlled frame (keyword only).
///     axes: the m coordinates in world axes, such as "xy" or "xyz rx ry rz"; "xyz" if None, also for a pose `(4, 4)` (keyword only).
///     nullspace: a `NullSpace`, for arms with more joints than m (keyword only).
///     tau_max: the largest commanded torque, N m or N, scalar or `(n,)`; no limit if None (keyword only).
///
/// Other Args:
///     feedforward: `F_ff`, a wrench in the m coordinates, `(m,)`, N and N m (keyword only).
///     compensate_coupling: compensate the coupling between null-space motion and the frame (keyword only).
///     eps: the smallest singular value in `L` and in the null-space projector, 1e-7 <= `eps` < 1; 0.02 if None (keyword only).
///         It requires `nullspace` or `compensate_coupling`.
///     integral_gain: `K_i`, N/(m s) and N m/(rad s), at least zero: scalar, `(m,)`, or positive definite `(m, m)` (keyword only).
///     wrench_max: the largest magnitude of each entry of `F`, N and N m, scalar or `(m,)`; no limit if None (keyword only).
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a matrix is not positive definite, or a name is unknown. It is also raised for
///         a limit that is not positive, and for a target `(4, 4)` that is not a pose.
///
/// Source: Hogan, Impedance control: an approach to manipulation, J. Dyn. Sys. Meas. Control 107, 1985. Khatib, A unified approach for
/// motion and force control of robot manipulators: the operational space formulation, IEEE J. Robotics and Automation 3(1), 1987.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4])
/// >>> law = al.CartesianImpedance(arm, [0.4, 0.5], [300.0, 200.0], [40.0, 30.0], frame="link2", axes="xy")
/// >>> run = al.simulate(al.RigidArm(arm), law, [0.3, 1.0], t_end=3.0, method="dop853", t_eval=[0.0, 3.0])
/// >>> arm.position(run.q[-1], "link2").round(3)
/// array([0.4, 0.5, 0. ])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct CartesianImpedance;

#[entered]
#[pymethods]
impl CartesianImpedance {
    #[new]
    #[arguments(
        arm, target, stiffness, damping, *, frame, axes=None, nullspace=None, feedforward=None, compensate_coupling=false, eps=None,
        integral_gain=None, wrench_max=None, tau_max=None
    )]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let (frame, axes, m) = given.frame_and_axes(frame, axes)?;
        let target = self::target(&mut given, target, &axes)?;
        let (stiffness, damping) = (given.gain("stiffness", stiffness, m)?, given.gain("damping", damping, m)?);
        let spec = CartesianImpedanceSpec::new(given.model(), target, stiffness, damping, &frame, &axes)?;
        let options = OptionArguments { nullspace, feedforward, compensate_coupling, eps, integral_gain, wrench_max, tau_max };
        let spec = spec.with(options.read(&mut given, m)?)?;
        Ok(given.law(spec).add_subclass(CartesianImpedance))
    }
}
