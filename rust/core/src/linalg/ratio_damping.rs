//! The damping matrix `D = 2 zeta M^1/2 (M^-1/2 K M^-1/2)^1/2 M^1/2`, for which every mode of `M x_ddot + D x_dot + K x = 0` has the
//! damping ratio `zeta`. Method: double diagonalisation, `M = Q'Q`, `K = Q' diag(k) Q`, `D = 2 zeta Q' diag(k)^1/2 Q` (Albu-Schaeffer, Ott,
//! Frese and Hirzinger 2003).

use super::{Gain, symmetric_eigen};
use crate::error::{Result, positive};

/// Return the power `A^p` of a symmetric positive definite matrix, shape `(n, n)`, row-major. Errors: as for `symmetric_eigen`.
pub fn symmetric_power(a: &[f64], n: usize, p: f64) -> Result<Vec<f64>> {
    let (values, vectors) = symmetric_eigen(a, n)?;
    let raised: Vec<f64> = values.iter().map(|l| l.powf(p)).collect();
    Ok((0..n * n).map(|at| (0..n).map(|k| vectors[k * n + at / n] * raised[k] * vectors[k * n + at % n]).sum()).collect())
}

/// Return the damping matrix with which every mode of the inertia `M` and the stiffness `K` has the damping ratio `zeta` > 0.
/// Errors: `Input` if `zeta` is not positive and finite, or if the result is not positive definite; `Solve` as for `symmetric_eigen`.
pub fn ratio_damping(inertia: &Gain, stiffness: &Gain, zeta: f64) -> Result<Gain> {
    positive("damping_ratio", zeta)?;
    let n = inertia.n();
    if inertia.is_diagonal() && stiffness.is_diagonal() {
        let d = (0..n).map(|i| 2.0 * zeta * (inertia.at(i, i) * stiffness.at(i, i)).sqrt()).collect();
        return Gain::diagonal("damping", d);
    }
    let times =
        |a: &[f64], b: &[f64]| -> Vec<f64> { (0..n * n).map(|at| (0..n).map(|k| a[at / n * n + k] * b[k * n + at % n]).sum()).collect() };
    let (root, inverse) = (symmetric_power(&inertia.matrix(), n, 0.5)?, symmetric_power(&inertia.matrix(), n, -0.5)?);
    let inner = symmetric_power(&times(&times(&inverse, &stiffness.matrix()), &inverse), n, 0.5)?;
    let d = times(&times(&root, &inner), &root);
    // The mean of the matrix and its transpose is exactly symmetric.
    Gain::full("damping", n, (0..n * n).map(|at| zeta * (d[at] + d[at % n * n + at / n])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mode_has_the_ratio() {
        let m = Gain::full("m", 2, vec![1.1, 0.3, 0.3, 0.4]).expect("positive definite");
        let k = Gain::full("k", 2, vec![300.0, -50.0, -50.0, 200.0]).expect("positive definite");
        let d = ratio_damping(&m, &k, 0.7).expect("finite");
        // The equation D M^-1 D = 4 zeta^2 K also defines D. This check needs no square root of a matrix.
        let left = d.product(&m.inverse()).product(&d);
        for at in 0..4 {
            let (got, want) = (left.matrix()[at], 4.0 * 0.49 * k.matrix()[at]);
            assert!((got - want).abs() < 1e-11, "{got} {want}: numbers of size 600, a dozen roundings");
        }
        let diagonal = ratio_damping(
            &Gain::diagonal("m", vec![0.02, 0.0125]).expect("positive"),
            &Gain::diagonal("k", vec![800.0, 500.0]).expect("positive"),
            1.0,
        )
        .expect("finite");
        assert!((diagonal.at(0, 0) - 8.0).abs() < 1e-14 && (diagonal.at(1, 1) - 5.0).abs() < 1e-14, "2 sqrt(B0 K)");
    }
}
