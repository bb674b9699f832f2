//! 3 x 3 matrices: rotations and general blocks (`M3`, by columns), symmetric ones (`Sym3`).

use super::V3;
use crate::scalar::Real;

/// A 3 x 3 matrix as its three columns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct M3<S>(pub [V3<S>; 3]);

impl M3<f64> {
    pub const IDENTITY: M3<f64> = M3([V3([1.0, 0.0, 0.0]), V3([0.0, 1.0, 0.0]), V3([0.0, 0.0, 1.0])]);

    /// `Rz(yaw) Ry(pitch) Rx(roll)`. Sines and cosines at multiples of a right angle, as decimal angles mean
    /// them, come out exact: a placement that is a permutation stays one.
    pub fn from_rpy([roll, pitch, yaw]: [f64; 3]) -> Self {
        let ((sr, cr), (sp, cp), (sy, cy)) = (exact_sin_cos(roll), exact_sin_cos(pitch), exact_sin_cos(yaw));
        M3([
            V3([cy * cp, sy * cp, -sp]),
            V3([cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr]),
            V3([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr]),
        ])
    }

    /// Angles whose [`M3::from_rpy`] is this rotation.
    pub fn to_rpy(self) -> [f64; 3] {
        let m = |r: usize, c: usize| self.0[c][r];
        let cp = m(0, 0).hypot(m(1, 0));
        // Near the singularity of the convention only roll -+ yaw is defined: yaw is set to zero.
        if cp < 1e-12 {
            [(-m(1, 2)).atan2(m(1, 1)), (-m(2, 0)).atan2(cp), 0.0]
        } else {
            [m(2, 1).atan2(m(2, 2)), (-m(2, 0)).atan2(cp), m(1, 0).atan2(m(0, 0))]
        }
    }

    /// The rotation by `angle` about the unit vector `axis` (Rodrigues).
    pub fn from_axis_angle(axis: V3<f64>, angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        let k = 1.0 - c;
        let [x, y, z] = axis.0;
        M3([
            V3([c + x * x * k, x * y * k + z * s, x * z * k - y * s]),
            V3([x * y * k - z * s, c + y * y * k, y * z * k + x * s]),
            V3([x * z * k + y * s, y * z * k - x * s, c + z * z * k]),
        ])
    }

    /// A rotation that takes the z axis to the unit vector `axis`; exact for coordinate axes.
    pub fn taking_z_to(axis: V3<f64>) -> Self {
        // The least component of the axis gives the best conditioned second direction.
        let least = (0..3).min_by(|&i, &j| axis[i].abs().total_cmp(&axis[j].abs())).unwrap_or(0);
        if axis == V3([0.0, 0.0, 1.0]) {
            return M3::IDENTITY;
        }
        let mut e = V3([0.0; 3]);
        e[least] = 1.0;
        let y = axis.cross(e);
        let y = y.scale(1.0 / y.norm());
        M3([y.cross(axis), y, axis])
    }

    #[inline(always)]
    pub fn lift<S: Real>(&self) -> M3<S> {
        M3([self.0[0].lift(), self.0[1].lift(), self.0[2].lift()])
    }
}

/// An angle within 1e-15 relative of a multiple of pi/2 is meant to be that multiple.
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

impl<S: Real> M3<S> {
    #[inline(always)]
    pub fn zero() -> Self {
        M3([V3::zero(); 3])
    }
    /// `self x`.
    #[inline(always)]
    pub fn apply(self, x: V3<S>) -> V3<S> {
        self.0[0].scale_add(x[0], self.0[1].scale_add(x[1], self.0[2].scale(x[2])))
    }
    /// `self x + c`.
    #[inline(always)]
    pub fn apply_add(self, x: V3<S>, c: V3<S>) -> V3<S> {
        self.0[0].scale_add(x[0], self.0[1].scale_add(x[1], self.0[2].scale_add(x[2], c)))
    }
    /// `self' x`.
    #[inline(always)]
    pub fn apply_transposed(self, x: V3<S>) -> V3<S> {
        V3([self.0[0].dot(x), self.0[1].dot(x), self.0[2].dot(x)])
    }
    #[inline(always)]
    pub fn times(self, b: M3<S>) -> M3<S> {
        M3([self.apply(b.0[0]), self.apply(b.0[1]), self.apply(b.0[2])])
    }
    #[inline(always)]
    pub fn transpose(self) -> M3<S> {
        let c = self.0;
        M3([V3([c[0][0], c[1][0], c[2][0]]), V3([c[0][1], c[1][1], c[2][1]]), V3([c[0][2], c[1][2], c[2][2]])])
    }
    /// `self Rz` with the sine and cosine of the angle about z.
    #[inline(always)]
    pub fn rotate_z(self, (s, c): (S, S)) -> M3<S> {
        let [x, y, z] = self.0;
        M3([x.scale_add(c, y.scale(s)), x.scale_sub(s, y.scale(c)), z])
    }
    /// `self' u self` for a general `u`.
    #[inline(always)]
    pub fn congruence_transposed(self, u: M3<S>) -> M3<S> {
        let t = u.times(self);
        M3([self.apply_transposed(t.0[0]), self.apply_transposed(t.0[1]), self.apply_transposed(t.0[2])])
    }
}

/// A symmetric matrix as `xx, xy, yy, xz, yz, zz`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sym3<S>(pub [S; 6]);

impl<S: Real> Sym3<S> {
    #[inline(always)]
    pub fn zero() -> Self {
        Sym3([S::zero(); 6])
    }
    #[inline(always)]
    pub fn column(&self, k: usize) -> V3<S> {
        let [xx, xy, yy, xz, yz, zz] = self.0;
        match k {
            0 => V3([xx, xy, xz]),
            1 => V3([xy, yy, yz]),
            _ => V3([xz, yz, zz]),
        }
    }
    #[inline(always)]
    pub fn apply(&self, x: V3<S>) -> V3<S> {
        self.column(0).scale_add(x[0], self.column(1).scale_add(x[1], self.column(2).scale(x[2])))
    }
    /// `self x + c`.
    #[inline(always)]
    pub fn apply_add(&self, x: V3<S>, c: V3<S>) -> V3<S> {
        self.column(0).scale_add(x[0], self.column(1).scale_add(x[1], self.column(2).scale_add(x[2], c)))
    }
    #[inline(always)]
    pub fn full(&self) -> M3<S> {
        M3([self.column(0), self.column(1), self.column(2)])
    }
    #[inline(always)]
    pub fn plus(&self, b: &Sym3<S>) -> Sym3<S> {
        let mut out = *self;
        for k in 0..6 {
            out.0[k] += b.0[k];
        }
        out
    }
    /// `r self r'`.
    #[inline(always)]
    pub fn rotated(&self, r: M3<S>) -> Sym3<S> {
        // t = r self, then the lower triangle of t r': row i of t with row j of r.
        let t = r.times(self.full());
        let entry = |i: usize, j: usize| t.0[0][i].mul_add(r.0[0][j], t.0[1][i].mul_add(r.0[1][j], t.0[2][i] * r.0[2][j]));
        Sym3([entry(0, 0), entry(1, 0), entry(1, 1), entry(2, 0), entry(2, 1), entry(2, 2)])
    }
    /// `self + k x x'`.
    #[inline(always)]
    pub fn add_outer(&self, x: V3<S>, k: S) -> Sym3<S> {
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
    /// The eigenvalues in increasing order, by cyclic Jacobi rotations: six sweeps reach rounding for 3 x 3.
    pub fn principal(&self) -> [f64; 3] {
        let largest = self.0.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) {
            return [self.0[0], self.0[2], self.0[5]];
        }
        let mut a = Sym3(self.0.map(|x| x / largest)).full();
        for _ in 0..6 {
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                let off = a.0[p][q];
                if off != 0.0 {
                    // The smaller root of t^2 + 2 theta t - 1 = 0, the tangent of the angle that clears the entry.
                    let theta = (a.0[q][q] - a.0[p][p]) / (2.0 * off);
                    let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
                    let c = 1.0 / t.hypot(1.0);
                    let mut j = M3::IDENTITY;
                    (j.0[p][p], j.0[q][q], j.0[q][p], j.0[p][q]) = (c, c, t * c, -t * c);
                    a = j.congruence_transposed(a);
                }
            }
        }
        let mut values = [a.0[0][0] * largest, a.0[1][1] * largest, a.0[2][2] * largest];
        values.sort_by(f64::total_cmp);
        values
    }
}
