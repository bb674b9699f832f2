//! The rotation vector `log R` of a rotation matrix: the axis multiplied with the angle, rad, in [0, pi].
//!
//! Of four formulas for the unit quaternion `(w, u)`, the code selects the one with the largest square root (Shepperd 1978). Then
//! `log R = 2 atan2(|u|, |w|) sign(w) u / |u|`, which is accurate at every angle. Near the identity, the factor of `sign(w) u` is
//! `2 / |w| (1 - |u|^2/(3 w^2))`.

use super::{Matrix3, Vector3};
use crate::scalar::Real;

/// If `|u|^2` is below this limit, the series of the logarithm is exact up to rounding. Its next term is `|u|^4 / 5`. The exponential has
/// the same limit, for the squared angle.
const SMALL: f64 = 1e-8;

/// Return the rotation vector `log R`, rad, of `r`.
#[inline]
pub fn rotation_log<S: Real>(r: &Matrix3<S>) -> Vector3<S> {
    let at = |row: usize, column: usize| r[(row, column)];
    let one = S::splat(1.0);
    let (x, y, z) = (at(0, 0), at(1, 1), at(2, 2));
    // Four times the squares of the four components of the quaternion. The largest is at least 1.
    let squares = [one + x + y + z, one + x - y - z, one - x + y - z, one - x - y + z];
    let differences = [at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1)];
    let sums = [at(0, 1) + at(1, 0), at(0, 2) + at(2, 0), at(1, 2) + at(2, 1)];
    let [dx, dy, dz] = differences;
    let [xy, xz, yz] = sums;
    // Candidate k is the quaternion, multiplied with twice the square root of squares[k].
    let candidates = [[squares[0], dx, dy, dz], [dx, squares[1], xy, xz], [dy, xy, squares[2], yz], [dz, xz, yz, squares[3]]];
    let (mut best, mut quaternion) = (squares[0], candidates[0]);
    for k in 1..4 {
        let better = best.lt(squares[k]);
        best = S::select(better, squares[k], best);
        for i in 0..4 {
            quaternion[i] = S::select(better, candidates[k][i], quaternion[i]);
        }
    }
    let scale = S::splat(0.5) / best.sqrt();
    let [w, ux, uy, uz] = quaternion.map(|c| c * scale);
    let negative = w.lt(S::zero());
    let (w, sign) = (w.abs(), S::select(negative, -one, one));
    let square = ux * ux + uy * uy + uz * uz;
    let small = square.lt(S::splat(SMALL));
    // The square root of zero has no derivative. If the series is selected, the root of another number is computed, and its value is not
    // used.
    let length = S::select(small, one, square).sqrt();
    let far = S::splat(2.0) * length.atan2(w) / length;
    let near_w = S::select(small, w, one);
    let near = S::splat(2.0) / near_w * (one - square / (S::splat(3.0) * near_w * near_w));
    let factor = sign * S::select(small, near, far);
    Vector3::from([ux * factor, uy * factor, uz * factor])
}

/// Return the rotation matrix of the rotation vector `r = vector`, rad (Rodrigues): `cos t 1 + sin t / t [r]x + (1 - cos t) / t^2 r r'`
/// with `t = |r|`, the cross-product matrix `[r]x` and the transpose `r'`.
#[inline]
pub fn rotation_exp<S: Real>(vector: [S; 3]) -> Matrix3<S> {
    let [x, y, z] = vector;
    let one = S::splat(1.0);
    let square = x * x + y * y + z * z;
    let small = square.lt(S::splat(SMALL));
    // The square root of zero has no derivative. If the series is selected, the root of another number is computed, and its value is not
    // used.
    let angle = S::select(small, one, square).sqrt();
    let (sin, cos) = angle.sin_cos();
    // The omitted terms are below the rounding error: `t^4 / 120`, `t^4 / 720`.
    let a = S::select(small, one - square / S::splat(6.0), sin / angle);
    let b = S::select(small, S::splat(0.5) - square / S::splat(24.0), (one - cos) / (angle * angle));
    let c = S::select(small, one - b * square, cos);
    let ([ax, ay, az], [bx, by, bz]) = ([a * x, a * y, a * z], [b * x, b * y, b * z]);
    Matrix3::from_columns(&[
        Vector3::from([c + bx * x, bx * y + az, bx * z - ay]),
        Vector3::from([bx * y - az, c + by * y, by * z + ax]),
        Vector3::from([bx * z + ay, by * z - ax, c + bz * z]),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::Vector;

    #[test]
    fn log_undoes_exp_at_every_angle() {
        let axis = [2.0 / 7.0, -3.0 / 7.0, 6.0 / 7.0];
        let pi = std::f64::consts::PI;
        for angle in [0.0, 1e-12, 1e-5, 9.9e-5, 2e-4, 1e-2, 1.0, 2.0, 3.0, pi - 1e-4, pi - 1e-9] {
            let vector = axis.map(|a| a * angle);
            let back = rotation_log(&rotation_exp(vector));
            // The matrix has an error of 2e-16, and near pi the angle has the same error.
            for k in 0..3 {
                assert!((back[k] - vector[k]).abs() < 5e-16 * (1.0 + angle), "{angle}: {:?} against {vector:?}", back.array());
            }
        }
        // At the angle pi, both signs of the axis are correct.
        let half_turn = rotation_log(&rotation_exp([pi, 0.0, 0.0])).array();
        assert!((half_turn[0].abs() - pi).abs() < 1e-15 && half_turn[1].abs() < 1e-15 && half_turn[2].abs() < 1e-15);
    }
}
