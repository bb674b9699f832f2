//! The dynamics of all kinds of arms, for control: `M(q) a + C(q, v) v + g(q) = tau`.
//!
//! `C` is the Christoffel factorisation: `C(q, x) y = C(q, y) x`, and `dM/dt - 2 C` is skew-symmetric. Matrices are row-major slices. All
//! units are SI: rad and N m for revolute joints, m and N for prismatic joints. `trig[i]` is (sin, cos) of coordinate `i`; it is never read
//! if the coordinate is not an angle. A plant and a law at the same `q` share `trig`.
//!
//! A joint that *follows* another joint, its *leader*, is a mimic joint. An *ancestor* of a joint is any joint between it and the base.
//!
//! The folder is flat, because each algorithm of rigid-body dynamics has one file, and all of them read the same tree.

#[doc(hidden)]
pub mod aba;
mod at;
mod body_derivatives;
mod buffered_tree;
mod closed_form;
#[doc(hidden)]
pub mod coriolis;
#[doc(hidden)]
pub mod crba;
#[cfg(feature = "urdf")]
mod definite;
#[doc(hidden)]
pub mod derivatives;
#[doc(hidden)]
pub mod energy;
mod evaluate;
#[doc(hidden)]
pub mod forward;
mod functions;
mod hinge;
mod joined;
#[cfg(test)]
mod large_tests;
mod model;
mod named_limit;
#[doc(hidden)]
pub mod newton_euler;
mod planar_pr;
mod printed;
mod quantities;
mod query;
#[doc(hidden)]
mod recorded;
#[doc(hidden)]
pub mod regressor;
mod single;
mod tree;
#[cfg(feature = "urdf")]
mod urdf;
mod vectors;
#[doc(hidden)]
pub mod workspace;

pub use at::At;
pub use evaluate::Evaluator;
pub use functions::Functions;
pub use model::{AnyArm, Model};
pub use planar_pr::PlanarPr;
pub use printed::CFunction;
pub(crate) use printed::given;
pub use query::{JointTerms, Quantity, Query, Size};
pub use workspace::Workspace;

use crate::scalar::Real;

/// The dynamics of an arm with `n` joints and `p` inertial parameters.
///
/// ```
/// use armlet_core::dynamics::{Dynamics, PlanarPr};
///
/// /// The kinetic energy of any arm.
/// fn kinetic<D: Dynamics<f64>>(arm: &D, q: &[f64], v: &[f64]) -> f64 {
///     let trig: Vec<_> = q.iter().map(|q| q.sin_cos()).collect();
///     arm.energy(&mut arm.workspace(), &trig, q, v).0
/// }
/// // `A v1^2 / 2 + B v1 v2 + C v2^2 / 2` at q2 = 0.
/// let arm = PlanarPr::new(3.0, 0.5, 0.2)?;
/// assert!((kinetic(&arm, &[0.7, 0.0], &[1.0, 2.0]) - 2.9).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub trait Dynamics<S: Real> {
    /// Buffers of the algorithms. They are created once, so that a control step allocates nothing.
    type Workspace;
    /// Create the buffers for this arm.
    fn workspace(&self) -> Self::Workspace;

    /// Number of coordinates `n`: the number of joints that are not mimic joints.
    fn dof(&self) -> usize;
    /// Number of inertial parameters `p`.
    fn parameter_count(&self) -> usize;
    /// Whether coordinate `joint` is an angle, which enters through its sine and cosine.
    fn is_angle(&self, joint: usize) -> bool;
    /// Write the inertial parameters, `(p,)`, in SI units, to `pi`.
    fn parameters(&self, pi: &mut [S]);

    /// Compute the mass matrix `M(q)`, `(n, n)`.
    fn mass_matrix(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], m: &mut [S]);
    /// Compute the Coriolis matrix `C(q, v)`, `(n, n)`, in the Christoffel factorisation.
    fn coriolis_matrix(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S], c: &mut [S]);
    /// Compute the gravity torque `g(q)`, `(n,)`.
    fn gravity(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], g: &mut [S]);
    /// Compute the bias torque `C(q, v) v + g(q)`, `(n,)`.
    fn bias(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S], out: &mut [S]);
    /// Compute the inverse dynamics `tau = M a + C v + g`, `(n,)`.
    fn inverse_dynamics(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S], a: &[S], tau: &mut [S]);
    /// Compute the forward dynamics `a = M^-1 (tau - C v - g)`, `(n,)`.
    fn forward_dynamics(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S], tau: &[S], a: &mut [S]);
    /// Compute the Slotine-Li regressor, `(n, p)`: `Y(q, v, v_r, a_r) pi = M a_r + C(q, v) v_r + g`. `rates`
    /// is `[v, v_r, a_r]`.
    fn regressor(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], rates: [&[S]; 3], y: &mut [S]);
    /// Add `Y pi`, `(n,)`, to `y_pi`, and write `Y' s`, `(p,)`, to `yt_s`, for the regressor `Y`, any parameters `pi` and any joint rates
    /// `s`. The matrix `Y` is not formed. `rates` is `[v, v_r, a_r]`, `by_parameters` is `(pi, y_pi)`, and `by_rates` is `(s, yt_s)`.
    fn regressor_products(
        &self,
        ws: &mut Self::Workspace,
        trig: &[(S, S)],
        q: &[S],
        rates: [&[S]; 3],
        by_parameters: (&[S], &mut [S]),
        by_rates: (&[S], &mut [S]),
    );
    /// Compute the kinetic and the potential energy, J.
    fn energy(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S]) -> (S, S);
}
