//! The null space of an impedance law, and the coupling between its motion and the frame (Khatib 1987; Ott 2008):
//!
//! The torque `tau_0 = K_n (q_n - q) + D_n (q_n_dot - v)` acts as `N' tau_0`, with `N' = I - J' L J W^-1` and `L = (J W^-1 J')^-1`. `J` is
//! the Jacobian of the controlled rows, `W` a metric, and `'` the transpose:
//!
//! - dynamically consistent, `W = M`: `J M^-1 N' = 0`, so `tau_0` does not accelerate the controlled rows;
//! - static, `W = I`: `N' = I - J' (J')#`.
//!
//! Compensation of the coupling adds the torque `C v` and the wrench `L (x_d_ddot - J_dot v)` with `W = M`. Then
//! `L (x_ddot - x_d_ddot) = F` for every motion in the consistent null space, where `F` is the sum of the other wrenches of the law. This
//! requires an exact model, and a pose that is not near a singularity.
//!
//! Near singularities, `L` is clamped. First, the rows of `J W^-1/2` are scaled: the rows of position by one factor, the rows of
//! orientation by another one. In each group, the norms then have the root mean square 1. Second, eigenvalues of the scaled `J W^-1 J'`
//! below `eps^2` are replaced by `eps^2`. Third, this matrix is inverted, and the scaling is undone. The projector `N'` should remove the
//! controlled directions from `tau_0`. In the direction of a singular value `sigma` of the scaled matrix, the fraction
//! `1 - min(1, (sigma/eps)^2)` of `tau_0` remains. The largest of these fractions is the loss.

use crate::error::{Error, Result};
use crate::law::equations::Loop;
use crate::law::sizes::{require_rows, require_size};
use crate::linalg::{Cholesky, Gain, clamped_inverse};
use crate::motion::Motion;
use crate::plant::Parameters;
use crate::scalar::Real;
use crate::trace::expression::constant;
use crate::trace::{E, M, V};

/// The default `eps` of the clamp, equal to the default threshold of task priority.
pub const NULL_SPACE_EPS: f64 = 0.02;

/// The metric in which a joint torque is projected into the null space.
///
/// ```
/// use armlet_core::law::NullProjection;
///
/// assert_eq!(NullProjection::of_name("consistent")?, NullProjection::Consistent);
/// assert_eq!(NullProjection::of_name("static")?, NullProjection::Static);
/// assert!(NullProjection::of_name("dynamic").is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NullProjection {
    /// The metric of the mass matrix. The projected torque does not accelerate the controlled rows.
    Consistent,
    /// The metric of the joint coordinates.
    Static,
}

impl NullProjection {
    /// Return the projection with the name `consistent` or `static`. Errors: `Input` for another name.
    pub fn of_name(name: &str) -> Result<Self> {
        match name {
            "consistent" => Ok(NullProjection::Consistent),
            "static" => Ok(NullProjection::Static),
            _ => Err(Error::input("projection", format!("is unknown: expected consistent or static, got {name}"))),
        }
    }
}

/// A spring and a damper of the joints in the null space of an impedance law, with validated parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{CartesianImpedanceSpec, Gain, ImpedanceOptions, LawSpec, NullProjection, NullSpaceSpec};
/// # let model = Model::from(Arm::planar(&[0.5, 0.4, 0.3], None, None, None, [0.0, 0.0])?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let law = CartesianImpedanceSpec::new(model, Motion::hold(vec![0.7, 0.6])?, gain(2, 200.0)?, gain(2, 20.0)?, "link3", "xy")?;
///
/// let posture = Motion::hold(vec![0.2, 0.6, 0.4])?;
/// let null_space = NullSpaceSpec::new(3, posture, gain(3, 10.0)?, gain(3, 2.0)?, NullProjection::Static)?;
/// let law = LawSpec::from(law.with(ImpedanceOptions { null_space: Some(null_space), ..ImpedanceOptions::default() })?);
/// let terms = law.terms_at(0.0, &[0.3, 0.4, 0.5, 0.0, 0.0, 0.0], &[]);
/// let term = |name: &str| terms.iter().find(|term| term.0 == name).map_or(vec![], |term| term.2.clone());
/// let (j, torque) = (term("J"), term("null_torque"));
/// // With the static projection, J times the projected torque is zero.
/// assert!(torque.iter().any(|x| x.abs() > 0.1));
/// assert!(j.chunks(3).all(|row| row.iter().zip(&torque).map(|(j, x)| j * x).sum::<f64>().abs() < 1e-12));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct NullSpaceSpec {
    /// Desired posture `q_n`, `(n,)`, rad or m. For a fixed posture, use a motion with constant position.
    pub posture: Motion,
    /// Stiffness `K_n`, of size `n`, N m/rad or N/m.
    pub stiffness: Gain,
    /// Damping `D_n`, of size `n`, N m s/rad or N s/m.
    pub damping: Gain,
    /// The metric of the projection.
    pub projection: NullProjection,
}

impl NullSpaceSpec {
    /// Create a null space for an arm of `n` joints. Errors: `WrongShape` for a wrong size.
    pub fn new(n: usize, posture: Motion, stiffness: Gain, damping: Gain, projection: NullProjection) -> Result<Self> {
        require_rows("nullspace.q_d", n, posture.dof())?;
        require_size("nullspace.stiffness", &stiffness, n)?;
        require_size("nullspace.damping", &damping, n)?;
        Ok(NullSpaceSpec { posture, stiffness, damping, projection })
    }
}

/// The clamped inverse `L = (J W^-1 J')^-1`.
pub(super) struct TaskInertia {
    /// The matrix `G = J W^-1/2`, `(m, n)`.
    pub g: M,
    /// The clamped inverse `L`, `(m, m)`.
    pub l: M,
    /// The loss `1 - min(1, (sigma/eps)^2)` for the smallest singular value `sigma`.
    pub loss: E,
}

impl TaskInertia {
    /// The clamped inverse of `G G'`. `rows` are the indices of the controlled rows in a pose, and `floor` is `eps^2`.
    pub fn new(g: M, rows: &[usize], floor: E) -> Self {
        let one = constant(1.0);
        let square = &g * g.transpose();
        // Rows of position, and rows of orientation, are scaled to a root mean square of 1.
        let scale = |turns: bool| {
            let own: Vec<usize> = (0..rows.len()).filter(|&k| (rows[k] > 2) == turns).collect();
            let mean = own.iter().fold(E::zero(), |sum, &k| sum + square[(k, k)]) * constant(1.0 / own.len().max(1) as f64);
            // Rows that no joint moves are not scaled.
            let moved = constant(f64::MIN_POSITIVE).lt(mean);
            E::select(moved, one / E::select(moved, mean, one).sqrt(), one)
        };
        let (position, orientation) = (scale(false), scale(true));
        let s = V::from_iterator(rows.len(), rows.iter().map(|&row| if row > 2 { orientation } else { position }));
        let scales = &s * s.transpose();
        let (l, least) = clamped_inverse(&square.component_mul(&scales), floor);
        TaskInertia { g, l: l.component_mul(&scales), loss: one - (least.max(E::zero()) / floor).min(one) }
    }

    /// The clamped inverse in the metric of the mass matrix, whose factorisation is `mass`.
    pub fn consistent(mass: &Cholesky<E>, j: &M, rows: &[usize], floor: E) -> Self {
        TaskInertia::new(mass.solve_lower(&j.transpose()).transpose(), rows, floor)
    }
}

impl NullSpaceSpec {
    pub(super) fn parameters(&self) -> Parameters {
        Parameters::default().gain("null_stiffness", &self.stiffness).gain("null_damping", &self.damping)
    }

    /// The torque `tau_0` of spring and damper, before the projection.
    pub(super) fn spring_torque(&self, at: &Loop) -> V {
        let [q_n, v_n, _] = at.desired(1);
        at.gain("null_stiffness") * &(q_n - &at.q) + at.gain("null_damping") * &(v_n - &at.v)
    }
}
