//! Matrices of size 3 x 3: nalgebra's type for rotations and general blocks, and `Sym3` for symmetric matrices.

use super::{Lift, Vector, Vector3};
use crate::scalar::Real;
use nalgebra::Matrix3;

/// Conversions between rotation matrices and other representations.
///
/// ```
/// use armlet_core::spatial::{Matrix3, RotationMatrix, Vector3};
/// use std::f64::consts::FRAC_PI_2;
///
/// // Right angles are exact.
/// let r = Matrix3::from_rpy([0.0, 0.0, FRAC_PI_2]);
/// assert_eq!(r * Vector3::x(), Vector3::y());
/// assert_eq!(r.to_rpy(), [0.0, 0.0, FRAC_PI_2]);
/// assert!((Matrix3::from_axis_angle(Vector3::z(), FRAC_PI_2) - r).norm() < 1e-15);
/// assert_eq!(Matrix3::taking_z_to(Vector3::x()) * Vector3::z(), Vector3::x());
/// ```
pub trait RotationMatrix: Sized {
    const IDENTITY: Self;
    /// Return `Rz(yaw) Ry(pitch) Rx(roll)`, angles in rad. If an angle is a multiple of a right angle up to rounding (1e-15), its sine and
    /// cosine are exact. So a rotation that permutes the axes is exact.
    fn from_rpy(rpy: [f64; 3]) -> Self;
    /// Return angles, rad, for which [`RotationMatrix::from_rpy`] returns this rotation, up to rounding.
    fn to_rpy(self) -> [f64; 3];
    /// Return the rotation by `angle`, rad, about the unit vector `axis` (Rodrigues).
    fn from_axis_angle(axis: Vector3<f64>, angle: f64) -> Self;
    /// Return a rotation that maps the z axis to the unit vector `axis`. It is exact for coordinate axes.
    fn taking_z_to(axis: Vector3<f64>) -> Self;
}

impl RotationMatrix for Matrix3<f64> {
    const IDENTITY: Matrix3<f64> = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);

    fn from_rpy([roll, pitch, yaw]: [f64; 3]) -> Self {
        let ((sr, cr), (sp, cp), (sy, cy)) = (exact_sin_cos(roll), exact_sin_cos(pitch), exact_sin_cos(yaw));
        Matrix3::from_columns(&[
            Vector3::from([cy * cp, sy * cp, -sp]),
            Vector3::from([cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr]),
            Vector3::from([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr]),
        ])
    }

    fn to_rpy(self) -> [f64; 3] {
        let m = |r: usize, c: usize| self[(r, c)];
        let cp = m(0, 0).hypot(m(1, 0));
        // Near the singularity of the convention, only roll - yaw or roll + yaw is defined, and yaw is set to zero.
        if cp < 1e-12 {
            [(-m(1, 2)).atan2(m(1, 1)), (-m(2, 0)).atan2(cp), 0.0]
        } else {
            [m(2, 1).atan2(m(2, 2)), (-m(2, 0)).atan2(cp), m(1, 0).atan2(m(0, 0))]
        }
    }

    fn from_axis_angle(axis: Vector3<f64>, angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        let k = 1.0 - c;
        let [x, y, z] = axis.array();
        Matrix3::from_columns(&[
            Vector3::from([c + x * x * k, x * y * k + z * s, x * z * k - y * s]),
            Vector3::from([x * y * k - z * s, c + y * y * k, y * z * k + x * s]),
            Vector3::from([x * z * k + y * s, y * z * k - x * s, c + z * z * k]),
        ])
    }

    fn taking_z_to(axis: Vector3<f64>) -> Self {
        // The coordinate axis with the smallest component gives the best conditioned second direction.
        let least = (0..3).min_by(|&i, &j| axis[i].abs().total_cmp(&axis[j].abs())).unwrap_or(0);
        if axis == Vector3::from([0.0, 0.0, 1.0]) {
            return Matrix3::IDENTITY;
        }
        let mut e = Vector3::from([0.0; 3]);
        e[least] = 1.0;
        let y = axis.cross(e);
        let y = y.scale(1.0 / y.norm());
        Matrix3::from_columns(&[y.cross(axis), y, axis])
    }
}

impl Lift for Matrix3<f64> {
    type Of<S: Real> = Matrix3<S>;
    #[inline]
    fn lift<S: Real>(&self) -> Matrix3<S> {
        self.map(S::splat)
    }
}

/// Return sine and cosine of an angle, rad. They are exact if the angle differs from `k pi/2`, `|k| < 1e6`, by at most
/// `1e-15 (1 + |angle|)`.
fn exact_sin_cos(angle: f64) -> (f64, f64) {
    let quarter = (angle / std::f64::consts::FRAC_PI_2).round();
    if quarter.abs() < 1e6 && (angle - quarter * std::f64::consts::FRAC_PI_2).abs() <= 1e-15 * (1.0 + angle.abs()) {
        return match (quarter as i64).rem_euclid(4) {
            0 => (0.0, 1.0),
            1 => (1.0, 0.0),
            2 => (0.0, -1.0),
            _ => (-1.0, 0.0),
        };
    }
    angle.sin_cos()
}

/// Products of [`Matrix3`](nalgebra::Matrix3) over any [`Real`]. Sums of products use [`Real::mul_add`].
///
/// ```
/// use armlet_core::spatial::{Matrix, Matrix3, RotationMatrix, Vector3};
///
/// let r = Matrix3::<f64>::from_rpy([0.1, 0.2, 0.3]);
/// let turned = r.rotate_z(0.4f64.sin_cos());
/// assert!((turned.axis(0) - r.apply(Vector3::new(0.4f64.cos(), 0.4f64.sin(), 0.0))).norm() < 1e-15);
/// assert_eq!(turned.axis(2), r.axis(2));
/// assert!((r.apply_transposed(r.axis(1)) - Vector3::y()).norm() < 1e-15);
/// ```
pub trait Matrix<S: Real>: Copy {
    fn zero() -> Self;
    /// Return the three columns.
    fn axes(self) -> [Vector3<S>; 3];
    fn axis(self, column: usize) -> Vector3<S>;
    /// Return `self x`.
    fn apply(self, x: Vector3<S>) -> Vector3<S>;
    /// Return `self x + c`.
    fn apply_add(self, x: Vector3<S>, c: Vector3<S>) -> Vector3<S>;
    /// Return `self' x`.
    fn apply_transposed(self, x: Vector3<S>) -> Vector3<S>;
    fn times(self, b: Self) -> Self;
    /// Return `self Rz`, where `trig` is the sine and cosine of the angle about z.
    fn rotate_z(self, trig: (S, S)) -> Self;
    /// Return `self' u self` for a general matrix `u`.
    fn congruence_transposed(self, u: Self) -> Self;
}

impl<S: Real> Matrix<S> for Matrix3<S> {
    #[inline]
    fn zero() -> Self {
        Matrix3::from([[S::zero(); 3]; 3])
    }
    #[inline]
    fn axes(self) -> [Vector3<S>; 3] {
        [self.axis(0), self.axis(1), self.axis(2)]
    }
    #[inline]
    fn axis(self, column: usize) -> Vector3<S> {
        Vector3::new(self[(0, column)], self[(1, column)], self[(2, column)])
    }
    #[inline]
    fn apply(self, x: Vector3<S>) -> Vector3<S> {
        let [a, b, c] = self.axes();
        a.scale_add(x[0], b.scale_add(x[1], c.scale(x[2])))
    }
    #[inline]
    fn apply_add(self, x: Vector3<S>, y: Vector3<S>) -> Vector3<S> {
        let [a, b, c] = self.axes();
        a.scale_add(x[0], b.scale_add(x[1], c.scale_add(x[2], y)))
    }
    #[inline]
    fn apply_transposed(self, x: Vector3<S>) -> Vector3<S> {
        Vector3::from(self.axes().map(|axis| axis.dot(x)))
    }
    #[inline]
    fn times(self, b: Matrix3<S>) -> Matrix3<S> {
        Matrix3::from_columns(&b.axes().map(|axis| self.apply(axis)))
    }
    #[inline]
    fn rotate_z(self, (s, c): (S, S)) -> Matrix3<S> {
        let [x, y, z] = self.axes();
        Matrix3::from_columns(&[x.scale_add(c, y.scale(s)), x.scale_sub(s, y.scale(c)), z])
    }
    #[inline]
    fn congruence_transposed(self, u: Matrix3<S>) -> Matrix3<S> {
        Matrix3::from_columns(&u.times(self).axes().map(|axis| self.apply_transposed(axis)))
    }
}

/// A symmetric matrix, stored as `xx, xy, yy, xz, yz, zz`.
///
/// ```
/// use armlet_core::spatial::{Matrix3, RotationMatrix, Sym3, Vector3};
///
/// let inertia = Sym3([2.0, 0.0, 3.0, 0.0, 0.0, 4.0]);
/// assert_eq!(inertia.apply(Vector3::new(1.0, 1.0, 1.0)), Vector3::new(2.0, 3.0, 4.0));
/// // A rotation changes the entries, and not the principal moments.
/// let turned = inertia.rotated(Matrix3::from_rpy([0.3, -0.7, 1.1]));
/// assert!((turned.0[0] - 2.0).abs() > 0.1);
/// assert!(turned.principal().iter().zip([2.0, 3.0, 4.0]).all(|(a, b)| (a - b).abs() < 1e-14));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sym3<S>(pub [S; 6]);

impl<S: Real> Sym3<S> {
    #[inline]
    pub fn zero() -> Self {
        Sym3([S::zero(); 6])
    }
    #[inline]
    pub fn column(&self, k: usize) -> Vector3<S> {
        let [xx, xy, yy, xz, yz, zz] = self.0;
        match k {
            0 => Vector3::from([xx, xy, xz]),
            1 => Vector3::from([xy, yy, yz]),
            _ => Vector3::from([xz, yz, zz]),
        }
    }
    #[inline]
    pub fn apply(&self, x: Vector3<S>) -> Vector3<S> {
        self.column(0).scale_add(x[0], self.column(1).scale_add(x[1], self.column(2).scale(x[2])))
    }
    /// Return `self x + c`.
    #[inline]
    pub fn apply_add(&self, x: Vector3<S>, c: Vector3<S>) -> Vector3<S> {
        self.column(0).scale_add(x[0], self.column(1).scale_add(x[1], self.column(2).scale_add(x[2], c)))
    }
    #[inline]
    pub fn full(&self) -> Matrix3<S> {
        Matrix3::from_columns(&[self.column(0), self.column(1), self.column(2)])
    }
    #[inline]
    pub fn plus(&self, b: &Sym3<S>) -> Sym3<S> {
        let mut out = *self;
        for k in 0..6 {
            out.0[k] += b.0[k];
        }
        out
    }
    /// Return `r self r'`.
    #[inline]
    pub fn rotated(&self, r: Matrix3<S>) -> Sym3<S> {
        // With `t = r self`, the result is the lower triangle of `t r'`. Its entry `(i, j)` is the product of row `i` of `t` and row `j` of
        // `r`.
        let t = r.times(self.full());
        let entry = |i: usize, j: usize| t[(i, 0)].mul_add(r[(j, 0)], t[(i, 1)].mul_add(r[(j, 1)], t[(i, 2)] * r[(j, 2)]));
        Sym3([entry(0, 0), entry(1, 0), entry(1, 1), entry(2, 0), entry(2, 1), entry(2, 2)])
    }
    /// Return `self + k x x'`.
    #[inline]
    pub fn add_outer(&self, x: Vector3<S>, k: S) -> Sym3<S> {
        let y = x.scale(k);
        let [xx, xy, yy, xz, yz, zz] = self.0;
        Sym3([
            x[0].mul_add(y[0], xx),
            x[0].mul_add(y[1], xy),
            x[1].mul_add(y[1], yy),
            x[0].mul_add(y[2], xz),
            x[1].mul_add(y[2], yz),
            x[2].mul_add(y[2], zz),
        ])
    }
}

impl Sym3<f64> {
    /// Return the eigenvalues in increasing order. Six sweeps of cyclic Jacobi rotations reach the rounding error for 3 x 3.
    pub fn principal(&self) -> [f64; 3] {
        let largest = self.0.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) {
            return [self.0[0], self.0[2], self.0[5]];
        }
        let mut a = Sym3(self.0.map(|x| x / largest)).full();
        for _ in 0..6 {
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                let off = a[(q, p)];
                if off != 0.0 {
                    // `t` is the root of smaller magnitude of the equation t^2 + 2 theta t - 1 = 0. It is the tangent of the angle that
                    // makes the entry zero.
                    let theta = (a[(q, q)] - a[(p, p)]) / (2.0 * off);
                    let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                    let c = 1.0 / t.hypot(1.0);
                    let mut j = Matrix3::IDENTITY;
                    (j[(p, p)], j[(q, q)], j[(p, q)], j[(q, p)]) = (c, c, t * c, -t * c);
                    a = j.congruence_transposed(a);
                }
            }
        }
        let mut values = [a[(0, 0)] * largest, a[(1, 1)] * largest, a[(2, 2)] * largest];
        values.sort_by(f64::total_cmp);
        values
    }
}
