//! The pseudo-inertia of a body (`wensing2018linear`) and its natural metric (`lee2018natural`):
//!
//! ```text
//! P = [[S, h], [h', m]],  S = integral of r r' dm = tr(I)/2 1 - I,  h = m c       (4 x 4, linear in the ten parameters)
//! <A, B>_P = tr(P^-1 A P^-1 B)                                                   (invariant under change of frame and unit)
//! d(P || Q) = log(|Q| / |P|) + tr(Q^-1 P) - 4 >= 0
//! ```
//!
//! Here `h'`, `r'` and `Y'` are transposes, `c` is the centre of mass, and `|P|` is the determinant. A body is physically possible if and
//! only if `P > 0`. Then some mass distribution with these parameters has no negative density and is not on one plane.
//! Let `Y` be the regressor of the body, `s` the sliding variable, and `y = Y' s`. The dual `L` of `y` satisfies `tr(P(pi) L) = pi . y` for
//! every `pi`. The adaptation law `d P_hat / dt = gamma P_hat L P_hat` has the property `d/dt d(P || P_hat) / gamma = (pi_hat - pi) . y`.
//! Slotine and Li's proof requires this property of an adaptation law. `P_hat` remains positive definite.

use super::{PARAMETERS, parameter::INERTIA};
use crate::scalar::Real;
use crate::scalar::log::ln;

/// A symmetric 4 x 4 matrix, as an array of rows. The last row and column contain the first moment and the mass.
pub type Pseudo<S> = [[S; 4]; 4];

/// The row and column of each of the six inertia entries, in the order of the parameters.
const ENTRIES: [(usize, usize); 6] = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)];

/// Return the pseudo-inertia `P` of a body with ten parameters, in the order of [`crate::spatial`].
#[inline]
pub fn pseudo_inertia<S: Real>(pi: &[S; PARAMETERS]) -> Pseudo<S> {
    let [m, hx, hy, hz, xx, xy, yy, xz, yz, zz] = *pi;
    let half = S::splat(0.5) * (xx + yy + zz);
    [[half - xx, -xy, -xz, hx], [-xy, half - yy, -yz, hy], [-xz, -yz, half - zz, hz], [hx, hy, hz, m]]
}

/// Return the ten parameters of a body with the pseudo-inertia `p`. Only the upper triangle of `p` is read.
#[inline]
pub fn parameters_of<S: Real>(p: &Pseudo<S>) -> [S; PARAMETERS] {
    let (x, y, z) = (p[0][0], p[1][1], p[2][2]);
    [p[3][3], p[0][3], p[1][3], p[2][3], y + z, -p[0][1], x + z, -p[0][2], -p[1][2], x + y]
}

/// Return the symmetric matrix `L` with `tr(P(pi) L) = pi . y` for every `pi`, where `P(pi)` is the pseudo-inertia.
#[inline]
pub fn dual<S: Real>(y: &[S; PARAMETERS]) -> Pseudo<S> {
    let half = S::splat(0.5);
    let mut l = [[S::zero(); 4]; 4];
    for (k, (i, j)) in ENTRIES.into_iter().enumerate() {
        if i != j {
            let entry = -(half * y[INERTIA + k]);
            (l[i][j], l[j][i]) = (entry, entry);
        }
    }
    let (xx, yy, zz) = (y[INERTIA], y[INERTIA + 2], y[INERTIA + 5]);
    (l[0][0], l[1][1], l[2][2]) = (yy + zz, xx + zz, xx + yy);
    for i in 0..3 {
        let entry = half * y[1 + i];
        (l[i][3], l[3][i]) = (entry, entry);
    }
    l[3][3] = y[0];
    l
}

/// Return `g` with `g . pi = tr(W P(pi))` for every `pi`. `W` is a symmetric matrix, and `P(pi)` is the pseudo-inertia. This function is
/// the inverse of [`dual`].
#[inline]
pub fn adjoint<S: Real>(w: &Pseudo<S>) -> [S; PARAMETERS] {
    let half = S::splat(0.5);
    let (x, y, z) = (w[0][0], w[1][1], w[2][2]);
    let twice = |i: usize, j: usize| w[i][j] + w[i][j];
    let [xx, yy, zz] = [half * (y + z - x), half * (x + z - y), half * (x + y - z)];
    [w[3][3], twice(0, 3), twice(1, 3), twice(2, 3), xx, -twice(0, 1), yy, -twice(0, 2), -twice(1, 2), zz]
}

/// Return `d pi_hat / dt` of a body's estimate. Its pseudo-inertia follows `d P_hat / dt = gamma P_hat L P_hat`, where `L` is the [`dual`]
/// of `y = Y' s`. This is gradient descent in the natural metric.
#[inline]
pub fn natural_rate<S: Real>(pi_hat: &[S; PARAMETERS], y_t_s: &[S; PARAMETERS], gamma: S) -> [S; PARAMETERS] {
    let (p, l) = (pseudo_inertia(pi_hat), dual(y_t_s));
    let row = |a: &[S; 4], b: &Pseudo<S>, j: usize| a[0].mul_add(b[0][j], a[1].mul_add(b[1][j], a[2].mul_add(b[2][j], a[3] * b[3][j])));
    let mut lp = [[S::zero(); 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            lp[i][j] = row(&l[i], &p, j);
        }
    }
    let mut rate = [[S::zero(); 4]; 4];
    for i in 0..4 {
        for j in i..4 {
            rate[i][j] = gamma * row(&p[i], &lp, j);
        }
    }
    parameters_of(&rate)
}

/// Return the lower factor `L` of `p = L L'`, and one if `p` is positive definite, otherwise zero.
#[inline(always)]
pub fn factor<S: Real>(p: &Pseudo<S>) -> (Pseudo<S>, S) {
    let (zero, infinity) = (S::zero(), S::splat(f64::INFINITY));
    let (mut l, mut possible) = ([[zero; 4]; 4], S::splat(1.0));
    for i in 0..4 {
        for j in 0..=i {
            let sum = (0..j).fold(p[i][j], |sum, k| sum - l[i][k] * l[j][k]);
            if i > j {
                l[i][j] = sum / l[j][j];
            } else {
                possible = S::select(zero.lt(sum), S::select(sum.lt(infinity), possible, zero), zero);
                l[i][i] = sum.sqrt();
            }
        }
    }
    (l, possible)
}

/// Return whether a body with these parameters is physically possible: its pseudo-inertia is positive definite.
pub fn is_positive_definite(pi: &[f64; PARAMETERS]) -> bool {
    factor(&pseudo_inertia(pi)).1 == 1.0
}

/// Return the divergence `d(P || P_hat) = log(|P_hat| / |P|) + tr(P_hat^-1 P) - 4` between the pseudo-inertias of two bodies. It is
/// infinite if at least one matrix is not positive definite.
#[inline(always)]
pub fn divergence<S: Real>(pi: &[S; PARAMETERS], pi_hat: &[S; PARAMETERS]) -> S {
    let ((l, possible), (hat, possible_hat)) = (factor(&pseudo_inertia(pi)), factor(&pseudo_inertia(pi_hat)));
    // `l` and `hat` are the factors of P and P_hat. With X = hat^-1 l, tr(P_hat^-1 P) is the sum of all squared entries of X. For similar
    // bodies the diagonal of X is near one. There `excess` has no cancellation.
    let mut x = [[S::zero(); 4]; 4];
    let mut sum = S::zero();
    for i in 0..4 {
        for j in 0..=i {
            x[i][j] = ((j..i).fold(l[i][j], |sum, k| sum - hat[i][k] * x[k][j])) / hat[i][i];
            sum += if i == j { excess(x[i][i]) } else { x[i][j] * x[i][j] };
        }
    }
    S::select(S::zero().lt(possible * possible_hat), sum, S::splat(f64::INFINITY))
}

/// Return `x^2 - 1 - 2 log x`, without cancellation near one.
#[inline(always)]
fn excess<S: Real>(x: S) -> S {
    let k = S::splat;
    let d = x - k(1.0);
    // The expression is 2 (d - log(1 + d)) + d^2. For |d| < 1e-2, d - log(1 + d) is the series d^2/2 - d^3/3 + .. with eight terms, whose
    // error is below (1e-2)^10.
    let term = |i: u32| k(if i.is_multiple_of(2) { 1.0 } else { -1.0 } / f64::from(i));
    let near = (2..10).rev().fold(S::zero(), |sum, i| d * sum + term(i)) * d * d;
    let difference = S::select(d.abs().lt(k(1e-2)), near, d - ln(x));
    k(2.0) * difference + d * d
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The parameters of a body with a positive definite pseudo-inertia.
    const BODY: [f64; 10] = [3.0, 0.3, -0.2, 0.6, 0.9, 0.05, 0.8, -0.1, 0.07, 0.5];
    const OTHER: [f64; 10] = [2.5, 0.1, 0.3, 0.2, 0.7, -0.03, 0.9, 0.04, -0.02, 0.8];

    fn dot(a: &[f64; 10], b: &[f64; 10]) -> f64 {
        a.iter().zip(b).map(|(x, y)| x * y).sum()
    }

    #[test]
    fn maps_are_inverse_and_dual() {
        for k in 0..10 {
            let mut unit = [0.0; 10];
            unit[k] = 1.0;
            assert_eq!(parameters_of(&pseudo_inertia(&unit)), unit, "sums of halves are exact");
            let (p, l) = (pseudo_inertia(&unit), dual(&OTHER));
            let trace: f64 = (0..4).map(|i| (0..4).map(|j| p[i][j] * l[j][i]).sum::<f64>()).sum();
            assert!((trace - OTHER[k]).abs() < 1e-15, "{k}: a sum of a few numbers below 3");
        }
        let back = adjoint(&dual(&OTHER));
        assert!((0..10).all(|k| (back[k] - OTHER[k]).abs() < 1e-15), "sums and halves of a few numbers below 3");
        let two_sided = pseudo_inertia(&BODY);
        assert!((0..4).all(|i| (0..4).all(|j| two_sided[i][j] == two_sided[j][i])));
    }

    #[test]
    fn the_natural_rate_is_what_the_proof_needs() {
        let y = [0.3, -1.0, 0.4, 0.9, -0.2, 0.6, 0.1, -0.7, 0.5, 0.8];
        let rate = natural_rate(&OTHER, &y, 2.0);
        let at = |h: f64| {
            let moved = std::array::from_fn(|k| OTHER[k] + h * rate[k]);
            divergence(&BODY, &moved)
        };
        // Central differences of step h with one extrapolation have an error of h^4, and a rounding error of 1e-16 / h.
        let (coarse, fine) = ((at(4e-4) - at(-4e-4)) / 8e-4, (at(2e-4) - at(-2e-4)) / 4e-4);
        let slope = (4.0 * fine - coarse) / 3.0;
        let want = 2.0 * (dot(&OTHER, &y) - dot(&BODY, &y));
        assert!((slope - want).abs() < 1e-8 * want.abs(), "{slope} {want}");
        // Lane 3 of eight lanes has the same rate, up to rounding.
        use crate::scalar::Array8;
        let lift = |x: &[f64; 10]| x.map(Array8::splat);
        let lanes = natural_rate(&lift(&OTHER), &lift(&y), Array8::splat(2.0));
        assert!((0..10).all(|k| (lanes[k].lane(3) - rate[k]).abs() < 1e-14), "another order of four products");
    }

    #[test]
    fn the_divergence_is_one() {
        assert_eq!(divergence(&BODY, &BODY), 0.0);
        assert!(divergence(&BODY, &OTHER) > 0.1 && divergence(&OTHER, &BODY) > 0.1);
        // If all parameters of a body are scaled by `1 / x`, the divergence is `4 (x - 1 - log x)`. The argument of `excess` is then
        // `sqrt(x)`. `excess` uses its series for `|sqrt(x) - 1| < 0.01`, that is for `h` from -0.0197 to 0.0203.
        for h in [1e-6, 4e-3, 5e-3, 6e-3, 0.0202, 0.0204, 0.05, 0.2, -5e-3, -0.0196, -0.0198, -0.05, -0.2] {
            let scaled = BODY.map(|x| x * (1.0 + h));
            let x: f64 = 1.0 / (1.0 + h);
            let want = 4.0 * (x - 1.0 - x.ln());
            assert!((divergence(&BODY, &scaled) - want).abs() < 1e-15 + 1e-13 * want, "{h}");
        }
        // The divergence does not change if both bodies are scaled.
        let (a, b) = (BODY.map(|x| 7.0 * x), OTHER.map(|x| 7.0 * x));
        assert!((divergence(&a, &b) - divergence(&BODY, &OTHER)).abs() < 1e-13);
        let mut flat = BODY;
        flat[0] = -1.0;
        assert!(!is_positive_definite(&flat) && divergence(&BODY, &flat) == f64::INFINITY);
        assert!(is_positive_definite(&BODY) && !is_positive_definite(&[0.0; 10]) && !is_positive_definite(&[f64::NAN; 10]));
    }
}
