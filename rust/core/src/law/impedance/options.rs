//! Options of a Cartesian impedance law: a feed-forward wrench `F_ff`, integral action `w`, limits, a null space, and compensation of the
//! coupling ([`super::NullSpaceSpec`]).
//!
//! `F = K_m e + D_m (x_d_dot - x_dot) + F_ff + w` within `+-wrench_max`, `w_dot = K_i e`, `tau = J' F + g(q) + tau_n` within `+-tau_max`,
//! where `tau_n` is the torque of null space and coupling.
//!
//! Conditional integration (Astrom and Hagglund, Advanced PID Control, 3.5) stops row `k` of `w` in two cases. In the first, `F_k` exceeds
//! its limit, and the rate of `w_k` would increase the excess. In the second, a torque `tau_i` exceeds its limit, and the rate times `J_ki`
//! would increase the excess.

use super::null_space::{NULL_SPACE_EPS, NullSpaceSpec};
use crate::error::{Error, Result, finite, positive};
use crate::law::equations::Loop;
use crate::law::sizes::require_size;
use crate::linalg::Gain;
use crate::plant::Parameters;
use crate::scalar::Real;
use crate::trace::expression::{clamp, zeros};
use crate::trace::{E, V};

/// Options of a Cartesian impedance law, validated by [`super::CartesianImpedanceSpec::with`].
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{CartesianImpedanceSpec, Gain, ImpedanceOptions, LawEvaluator, LawSpec};
/// # let model = Model::from(Arm::planar(&[0.5], None, None, None, [0.0, 0.0])?);
/// # let gain = |k: f64| Gain::scalar("gain", 2, k);
/// # let law = CartesianImpedanceSpec::new(model, Motion::hold(vec![0.5, 0.0])?, gain(200.0)?, gain(20.0)?, "link1", "xy")?;
///
/// // The law presses with 3 N along y. At most 2 N are permitted.
/// let options = ImpedanceOptions { feedforward: Some(vec![0.0, 3.0]), wrench_max: Some(vec![2.0, 2.0]), ..ImpedanceOptions::default() };
/// let law = LawSpec::from(law.with(options)?);
/// let mut tau = [0.0];
/// LawEvaluator::new(&law).input(0.0, &[&[0.0], &[0.0]], None, &mut tau);
/// assert!((tau[0] - 0.5 * 2.0).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ImpedanceOptions {
    /// The posture control in the null space; `None` without it.
    pub null_space: Option<NullSpaceSpec>,
    /// Whether to add the torque `C v` and the wrench `L (x_d_ddot - J_dot v)`, with the Cartesian inertia `L` of the rows.
    pub compensate_coupling: bool,
    /// The threshold `eps`, from 1e-7 to below 1. In the inverse `L`, singular values below `eps` are clamped. Before that, the rows of
    /// position of `J W^-1/2` are scaled so that their norms have the root mean square 1. The rows of orientation are scaled likewise.
    pub eps: f64,
    /// Feed-forward wrench `F_ff`, `(m,)`, N and N m.
    pub feedforward: Option<Vec<f64>>,
    /// Integral gain `K_i`, of size `m`, N/(m s) and N m/(rad s).
    pub integral_gain: Option<Gain>,
    /// The largest wrench of each row, `(m,)`, N and N m; infinity means no limit.
    pub wrench_max: Option<Vec<f64>>,
    /// The largest torque of each joint, `(n,)`, N m or N; infinity means no limit.
    pub tau_max: Option<Vec<f64>>,
}

impl Default for ImpedanceOptions {
    fn default() -> Self {
        ImpedanceOptions {
            null_space: None,
            compensate_coupling: false,
            eps: NULL_SPACE_EPS,
            feedforward: None,
            integral_gain: None,
            wrench_max: None,
            tau_max: None,
        }
    }
}

fn require_limits(argument: &str, n: usize, limits: Option<&Vec<f64>>) -> Result<()> {
    let Some(limits) = limits else { return Ok(()) };
    require_length(argument, n, limits.len())?;
    match limits.iter().position(|&limit| !(limit > 0.0)) {
        Some(i) => Err(Error::input(argument, format!("is not positive: expected numbers > 0, got {}", limits[i])).at([i])),
        None => Ok(()),
    }
}

fn require_length(argument: &str, n: usize, got: usize) -> Result<()> {
    if got == n {
        return Ok(());
    }
    Err(Error::wrong_shape(argument, &[n], &[got]))
}

impl ImpedanceOptions {
    /// The smallest permitted `eps`. Its square is above the relative rounding error of `J M^-1 J'`.
    pub const LEAST_EPS: f64 = 1e-7;

    /// Refuse options that do not fit a law of `m` rows and `n` joints.
    pub(super) fn validate(&self, m: usize, n: usize) -> Result<()> {
        positive("eps", self.eps)?;
        if !(Self::LEAST_EPS..1.0).contains(&self.eps) {
            return Err(Error::input(
                "eps",
                format!("is out of range: expected at least {:e} and below 1, got {:e}", Self::LEAST_EPS, self.eps),
            ));
        }
        if let Some(null_space) = &self.null_space {
            require_length("nullspace", n, null_space.posture.dof())?;
            require_size("nullspace", &null_space.stiffness, n)?;
            require_size("nullspace", &null_space.damping, n)?;
        }
        if let Some(feedforward) = &self.feedforward {
            require_length("feedforward", m, feedforward.len())?;
            finite("feedforward", feedforward)?;
        }
        if let Some(gain) = &self.integral_gain {
            require_size("integral_gain", gain, m)?;
        }
        require_limits("wrench_max", m, self.wrench_max.as_ref())?;
        require_limits("tau_max", n, self.tau_max.as_ref())
    }

    /// Whether the wrench or the torque has limits. Beyond a limit, the wrench is not the wrench of a spring and a damper.
    pub fn have_limits(&self) -> bool {
        self.wrench_max.is_some() || self.tau_max.is_some()
    }

    /// Whether the torque at rest is `J' F + g`, where `F` comes from a potential and a constant wrench.
    pub fn has_potential(&self) -> bool {
        self.null_space.is_none() && self.integral_gain.is_none() && self.wrench_max.is_none() && self.tau_max.is_none()
    }

    /// Whether both options have the same terms.
    pub(super) fn same_shape(&self, other: &Self) -> bool {
        let shape = |o: &Self| {
            let projection = o.null_space.as_ref().map(|null_space| null_space.projection);
            let given = [o.feedforward.is_some(), o.integral_gain.is_some(), o.wrench_max.is_some(), o.tau_max.is_some()];
            (projection, o.compensate_coupling, given)
        };
        shape(self) == shape(other)
    }
}

impl ImpedanceOptions {
    /// The numbers of the options.
    pub(super) fn parameters(&self) -> Parameters {
        let numbers = Parameters::default();
        let numbers = if self.null_space.is_some() || self.compensate_coupling {
            let null_space = self.null_space.as_ref().map_or_else(Parameters::default, NullSpaceSpec::parameters);
            numbers.and(null_space).number("null_eps_squared", self.eps * self.eps)
        } else {
            numbers
        };
        numbers
            .option(self.feedforward.as_ref(), |numbers, x| numbers.numbers("feedforward", x))
            .option(self.integral_gain.as_ref(), |numbers, gain| numbers.gain("integral_gain", gain))
            .option(self.wrench_max.as_ref(), |numbers, x| numbers.numbers("law_wrench_max", x))
            .option(self.tau_max.as_ref(), |numbers, x| numbers.numbers("law_tau_max", x))
    }

    /// Limit the torque `tau` of an impedance law. The rate `z_dot` of the integral becomes zero where it would move a torque further beyond
    /// its limit. `spread(F)` is the torque of a wrench `F`.
    pub(in crate::law) fn limited(&self, at: &Loop, tau: V, mut z_dot: V, spread: impl Fn(&V) -> V) -> [V; 2] {
        if self.tau_max.is_none() {
            return [tau, z_dot];
        }
        let limit = at.vector("law_tau_max");
        for k in 0..z_dot.len() {
            let mut along = zeros(z_dot.len());
            along[k] = z_dot[k];
            let push = spread(&along);
            z_dot[k] = (0..tau.len()).fold(z_dot[k], |rate, i| held(tau[i], limit[i], push[i], rate));
        }
        [clamp(&tau, limit), z_dot]
    }
}

/// Return the rate of an integral, or zero if it increases the excess over a limit. `free` is the unlimited value, and the sign of `push`
/// is the direction in which `rate` moves it.
pub(in crate::law) fn held(free: E, limit: E, push: E, rate: E) -> E {
    let zero = E::zero();
    let down = E::select(free.lt(-limit), E::select(push.lt(zero), zero, rate), rate);
    E::select(limit.lt(free), E::select(zero.lt(push), zero, rate), down)
}
