//! Eigenvalues of any square matrix by the QR algorithm with a limited number of iterations (Golub and Van Loan, Matrix Computations, 7.5).
//!
//! The matrix is first balanced (Parlett and Reinsch 1969), because its entries can differ by orders of magnitude. In a linearised loop,
//! these are for example the derivatives of positions and of motor speeds.

use crate::error::{Error, Result, finite};
use crate::status::Status;
use nalgebra::DMatrix;

/// Return all eigenvalues of a matrix, shape `(n, n)`, row-major, as `(real, imaginary)`. They are sorted by real part, then by imaginary
/// part. Errors: `Input` for entries that are not finite, `Solve` if the iteration does not converge.
pub fn eigenvalues(a: &[f64], n: usize) -> Result<Vec<(f64, f64)>> {
    finite("matrix", a)?;
    let mut balanced = a.to_vec();
    balance(&mut balanced, n);
    let cap = 100 * n;
    let schur = DMatrix::from_row_slice(n, n, &balanced).try_schur(f64::EPSILON, cap).ok_or_else(|| Error::Solve {
        status: Status::MaxSteps,
        t: cap as f64,
        problem: "the eigenvalue iteration did not converge".into(),
    })?;
    let mut values: Vec<(f64, f64)> = schur.complex_eigenvalues().iter().map(|l| (l.re, l.im)).collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    Ok(values)
}

/// Return the largest magnitude of all eigenvalues of a matrix, shape `(n, n)`, row-major. Errors: as for [`eigenvalues`].
pub fn spectral_radius(a: &[f64], n: usize) -> Result<f64> {
    Ok(eigenvalues(a, n)?.iter().fold(0.0f64, |most, (re, im)| most.max(re.hypot(*im))))
}

/// Scale the matrix with powers of two until rows and columns have similar sizes.
fn balance(a: &mut [f64], n: usize) {
    const SWEEPS: usize = 20;
    for _ in 0..SWEEPS {
        let mut quiet = true;
        for i in 0..n {
            let size = |k: fn(usize, usize, usize) -> usize| (0..n).filter(|&j| j != i).map(|j| a[k(n, i, j)].abs()).sum::<f64>();
            let (row, column) = (size(|n, i, j| i * n + j), size(|n, i, j| j * n + i));
            if row == 0.0 || column == 0.0 {
                continue;
            }
            let exponent = (0.5 * (row / column).log2()).round() as i32;
            if exponent != 0 {
                quiet = false;
                let scale = 2f64.powi(exponent.clamp(-512, 512));
                for j in 0..n {
                    a[i * n + j] /= scale;
                    a[j * n + i] *= scale;
                }
            }
        }
        if quiet {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knows_oscillators() {
        // x_ddot + 2 zeta w x_dot + w^2 x = 0 for two very different frequencies w, rad/s.
        let (slow, fast) = ((0.5, 1.0), (0.1, 1e4));
        let block = |(zeta, w): (f64, f64)| [0.0, 1.0, -w * w, -2.0 * zeta * w];
        let (s, f) = (block(slow), block(fast));
        let mut a = vec![0.0; 16];
        for i in 0..2 {
            for j in 0..2 {
                a[i * 4 + j] = s[i * 2 + j];
                a[(i + 2) * 4 + j + 2] = f[i * 2 + j];
            }
        }
        a[2] = 3.0; // This entry couples the two systems. The matrix is block triangular, so that its eigenvalues do not change.
        let got = eigenvalues(&a, 4).expect("finite");
        let root = |(zeta, w): (f64, f64)| (-zeta * w, w * f64::sqrt(1.0 - zeta * zeta));
        for (value, want) in got.iter().zip([root(fast), root(fast), root(slow), root(slow)]) {
            // The error of a backward stable method is 1e-16 of the balanced norm, which is 1e4.
            assert!((value.0 - want.0).abs() < 1e-10 && (value.1.abs() - want.1).abs() < 1e-10, "{value:?} {want:?}");
        }
        assert!((spectral_radius(&a, 4).expect("finite") - 1e4).abs() < 1e-9);
        assert!(eigenvalues(&[f64::NAN], 1).is_err());
    }
}
