//! The planar PR arm: a prismatic and a revolute joint on a horizontal plane (Robotics 2 exam, Sapienza, 10 June 2022, exercise 1):
//!
//! `M = [[A, B cos q2], [B cos q2, C]]`, `C(q, v) = [[0, -B sin(q2) v2], [0, 0]]`, `g = 0`, with
//! `A > 0`, `C > 0`, `A C > B^2`. The regressor in the parameters `(A, B, C)` is
//! `Y = [[a_r1, a_r2 cos q2 - v2 v_r2 sin q2, 0], [0, a_r1 cos q2, a_r2]]`.

use super::Dynamics;
use crate::error::{Error, Result, finite, positive};
use crate::scalar::Real;

/// The planar PR arm.
///
/// ```
/// use armlet_core::dynamics::{Dynamics, PlanarPr};
///
/// let arm = PlanarPr::new(3.0, 0.5, 0.2)?;
/// let trig = [(0.0, 1.0), 0.9f64.sin_cos()];
/// let mut tau = [0.0; 2];
/// arm.inverse_dynamics(&mut (), &trig, &[0.0, 0.9], &[0.0, 2.0], &[1.0, -1.0], &mut tau);
/// let (sin, cos) = trig[1];
/// assert!((tau[0] - (3.0 - 0.5 * cos - 0.5 * sin * 4.0)).abs() < 1e-15);
/// assert!((tau[1] - (0.5 * cos - 0.2)).abs() < 1e-15);
/// // The mass matrix must be positive definite: A C > B^2.
/// assert!(PlanarPr::new(1.0, 0.5, 0.2).is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlanarPr<S> {
    a: S,
    b: S,
    c: S,
    /// The product `A C`, the first term of the determinant `A C - (B cos q2)^2`.
    ac: S,
}

impl PlanarPr<f64> {
    /// Create an arm with `A` in kg, `B` in kg m and `C` in kg m^2. Errors: `Input` if a number is not finite, or if the mass matrix is not
    /// positive definite at every `q`.
    pub fn new(a: f64, b: f64, c: f64) -> Result<Self> {
        positive("A", a)?;
        finite("B", &[b])?;
        positive("C", c)?;
        if a * c <= b * b {
            return Err(Error::input(
                "B",
                format!("makes the mass matrix indefinite: expected A C > B^2, got A C = {}, B^2 = {}", a * c, b * b),
            ));
        }
        Ok(PlanarPr { a, b, c, ac: a * c })
    }

    /// Create an arm with any finite parameters, because an estimate may be physically impossible.
    pub fn with_parameters(pi: [f64; 3]) -> Self {
        PlanarPr { a: pi[0], b: pi[1], c: pi[2], ac: pi[0] * pi[2] }
    }

    /// The parameters `(A, B, C)`.
    pub fn parameter_array(&self) -> [f64; 3] {
        [self.a, self.b, self.c]
    }

    /// Return the arm on another number type.
    pub fn lift<S: Real>(&self) -> PlanarPr<S> {
        let number = |name, x: f64| S::labelled(name, 0, || S::parameter(x));
        PlanarPr { a: number("A", self.a), b: number("B", self.b), c: number("C", self.c), ac: number("AC", self.ac) }
    }

    /// Compute the Christoffel symbols, `(2, 2, 2)`. Only one is not zero: `c[0, 1, 1] = -B sin q2`.
    pub fn christoffel(&self, (sin, _): (f64, f64), c: &mut [f64]) {
        c.fill(0.0);
        c[3] = -(self.b * sin);
    }

    /// Compute `[d tau/d q; d tau/d v; M]`, `(6, 2)`, row-major, of `tau = M a + C v`.
    pub fn inverse_dynamics_slopes(&self, (sin, cos): (f64, f64), v: &[f64], a: &[f64], out: &mut [f64]) {
        let (bs, bc) = (self.b * sin, self.b * cos);
        let by_q = [0.0, -(bs * a[1] + bc * v[1] * v[1]), 0.0, -bs * a[0]];
        let by_v = [0.0, -2.0 * bs * v[1], 0.0, 0.0];
        out.copy_from_slice([by_q, by_v, [self.a, bc, bc, self.c]].as_flattened());
    }

    /// Compute `[d a/d q; d a/d v; M^-1]`, `(6, 2)`, of the acceleration `a = M^-1 (tau - C v)`. The first two blocks are `-M^-1` times the
    /// derivatives of `tau` at `a`.
    pub fn forward_dynamics_slopes(&self, trig: (f64, f64), v: &[f64], a: &[f64], out: &mut [f64]) {
        self.inverse_dynamics_slopes(trig, v, a, out);
        let bc = self.b * trig.1;
        let inverse = [self.c, -bc, -bc, self.a].map(|x| x / (self.ac - bc * bc));
        for rows in out[..8].chunks_exact_mut(4) {
            let of = |i: usize, j: usize| -(inverse[2 * i] * rows[j] + inverse[2 * i + 1] * rows[2 + j]);
            rows.copy_from_slice(&[of(0, 0), of(0, 1), of(1, 0), of(1, 1)]);
        }
        out[8..].copy_from_slice(&inverse);
    }
}

impl<S: Real> Dynamics<S> for PlanarPr<S> {
    type Workspace = ();
    fn workspace(&self) {}
    fn dof(&self) -> usize {
        2
    }
    fn parameter_count(&self) -> usize {
        3
    }
    fn is_angle(&self, joint: usize) -> bool {
        joint == 1
    }
    fn parameters(&self, pi: &mut [S]) {
        (pi[0], pi[1], pi[2]) = (self.a, self.b, self.c);
    }

    fn mass_matrix(&self, _: &mut (), trig: &[(S, S)], _: &[S], m: &mut [S]) {
        let bc = self.b * trig[1].1;
        (m[0], m[1], m[2], m[3]) = (self.a, bc, bc, self.c);
    }

    fn coriolis_matrix(&self, _: &mut (), trig: &[(S, S)], _: &[S], v: &[S], c: &mut [S]) {
        (c[0], c[2], c[3]) = (S::zero(), S::zero(), S::zero());
        c[1] = -(self.b * trig[1].0) * v[1];
    }

    fn gravity(&self, _: &mut (), _: &[(S, S)], _: &[S], g: &mut [S]) {
        (g[0], g[1]) = (S::zero(), S::zero());
    }

    fn bias(&self, _: &mut (), trig: &[(S, S)], _: &[S], v: &[S], out: &mut [S]) {
        out[0] = -(self.b * trig[1].0) * (v[1] * v[1]);
        out[1] = S::zero();
    }

    fn inverse_dynamics(&self, _: &mut (), trig: &[(S, S)], _: &[S], v: &[S], a: &[S], tau: &mut [S]) {
        let (sin, cos) = trig[1];
        let bc = self.b * cos;
        tau[0] = (self.b * sin).neg_mul_add(v[1] * v[1], self.a.mul_add(a[0], bc * a[1]));
        tau[1] = bc.mul_add(a[0], self.c * a[1]);
    }

    fn forward_dynamics(&self, _: &mut (), trig: &[(S, S)], _: &[S], v: &[S], tau: &[S], a: &mut [S]) {
        let (sin, cos) = trig[1];
        let bc = self.b * cos;
        let f1 = (self.b * sin).mul_add(v[1] * v[1], tau[0]);
        let inverse_det = bc.neg_mul_add(bc, self.ac).recip();
        a[0] = bc.neg_mul_add(tau[1], self.c * f1) * inverse_det;
        a[1] = bc.neg_mul_add(f1, self.a * tau[1]) * inverse_det;
    }

    fn regressor(&self, _: &mut (), trig: &[(S, S)], _: &[S], [v, v_r, a_r]: [&[S]; 3], y: &mut [S]) {
        let (y12, y22) = columns(trig[1], v, v_r, a_r);
        (y[0], y[1], y[2]) = (a_r[0], y12, S::zero());
        (y[3], y[4], y[5]) = (S::zero(), y22, a_r[1]);
    }

    fn regressor_products(
        &self,
        _: &mut (),
        trig: &[(S, S)],
        _: &[S],
        [v, v_r, a_r]: [&[S]; 3],
        (pi, y_pi): (&[S], &mut [S]),
        (s, yt_s): (&[S], &mut [S]),
    ) {
        let (y12, y22) = columns(trig[1], v, v_r, a_r);
        // In these sums, the values that are computed last are added last, so that the longest chain of dependent operations is shorter.
        y_pi[0] = y12.mul_add(pi[1], a_r[0].mul_add(pi[0], y_pi[0]));
        y_pi[1] = y22.mul_add(pi[1], a_r[1].mul_add(pi[2], y_pi[1]));
        yt_s[0] = a_r[0] * s[0];
        yt_s[1] = y12.mul_add(s[0], y22 * s[1]);
        yt_s[2] = a_r[1] * s[1];
    }

    fn energy(&self, _: &mut (), trig: &[(S, S)], _: &[S], v: &[S]) -> (S, S) {
        let bc = self.b * trig[1].1;
        let twice = self.a.mul_add(v[0] * v[0], self.c * (v[1] * v[1])) + (bc + bc) * (v[0] * v[1]);
        (S::splat(0.5) * twice, S::zero())
    }
}

/// The two entries of the regressor's middle column, which belongs to the parameter `B`.
fn columns<S: Real>((sin, cos): (S, S), v: &[S], v_r: &[S], a_r: &[S]) -> (S, S) {
    (a_r[1].mul_add(cos, -(v[1] * v_r[1] * sin)), a_r[0] * cos)
}
