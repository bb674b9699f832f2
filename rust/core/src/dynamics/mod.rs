//! `M(q) a + C(q, v) v + g(q) = tau`: the dynamics for control, for every kind of arm.
//!
//! `C` is the Christoffel factorisation: `C(q, x) y = C(q, y) x`, and `dM/dt - 2 C` is skew-symmetric.
//! Matrices are row-major slices. `trig[i]` is (sin, cos) of angular coordinate `i`. It is computed once per stage,
//! and plant and law share it. Entries of joints that are not angular are never read.

#[doc(hidden)]
pub mod aba;
#[doc(hidden)]
mod arm_at;
mod closed_form;
#[doc(hidden)]
pub mod coriolis;
#[doc(hidden)]
pub mod crba;
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
mod tree;
mod vectors;
#[doc(hidden)]
pub mod workspace;

pub use arm_at::ArmAt;
pub use definite::indefinite;
pub use evaluate::Evaluator;
pub use functions::Functions;
pub use model::{AnyArm, Model};
pub use planar_pr::PlanarPr;
pub use printed::CFunction;
pub(crate) use printed::given;
pub use query::{Quantity, Query, Size};
pub use workspace::Workspace;

use crate::scalar::Real;

/// The dynamics of an arm with `n` joints and `p` inertial parameters.
pub trait Dynamics<S: Real> {
    /// Buffers of the algorithms, made once: nothing allocates in a control step.
    type Workspace;
    /// Buffers for this arm.
    fn workspace(&self) -> Self::Workspace;

    /// Number of joints `n`.
    fn dof(&self) -> usize;
    /// Number of inertial parameters `p`.
    fn parameter_count(&self) -> usize;
    /// Whether coordinate `joint` enters through its sine and cosine.
    fn is_angle(&self, joint: usize) -> bool;
    /// The inertial parameters, `(p,)`.
    fn parameters(&self, pi: &mut [S]);

    /// `M(q)`, `(n, n)`.
    fn mass_matrix(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], m: &mut [S]);
    /// `C(q, v)`, `(n, n)`, Christoffel.
    fn coriolis_matrix(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S], c: &mut [S]);
    /// `g(q)`, `(n,)`.
    fn gravity(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], g: &mut [S]);
    /// `C(q, v) v + g(q)`, `(n,)`.
    fn bias(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S], out: &mut [S]);
    /// `tau = M a + C v + g`, `(n,)`.
    fn inverse_dynamics(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S], a: &[S], tau: &mut [S]);
    /// `a = M^-1 (tau - C v - g)`, `(n,)`.
    fn forward_dynamics(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S], tau: &[S], a: &mut [S]);
    /// The Slotine-Li regressor, `(n, p)`: `Y(q, v, v_r, a_r) pi = M a_r + C(q, v) v_r + g`.
    fn regressor(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S], v_r: &[S], a_r: &[S], y: &mut [S]);
    /// `Y pi` added to `y_pi` `(n,)`, and `Y^T s` `(p,)`, for any parameters `pi`, without forming `Y`.
    fn regressor_products(
        &self,
        ws: &mut Self::Workspace,
        trig: &[(S, S)],
        q: &[S],
        v: &[S],
        v_r: &[S],
        a_r: &[S],
        pi: &[S],
        s: &[S],
        y_pi: &mut [S],
        yt_s: &mut [S],
    );
    /// Kinetic and potential energy.
    fn energy(&self, ws: &mut Self::Workspace, trig: &[(S, S)], q: &[S], v: &[S]) -> (S, S);
}
