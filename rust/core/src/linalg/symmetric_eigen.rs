//! Eigenvalue decomposition `S = V diag(l) V'` of a symmetric matrix by cyclic Jacobi rotations with a limited number of sweeps (Golub and
//! Van Loan, Matrix Computations, 8.5).

use crate::error::{Error, Result, finite};
use crate::interrupt;
use crate::status::Status;

const MAX_SWEEPS: usize = 60;

/// Return the eigenvalues in ascending order, and the orthonormal eigenvectors as rows of an array, shape `(n, n)`, row-major.
///
/// `a`: shape `(n, n)`, row-major. Its symmetric part `(a + a')/2` is decomposed. Errors: `Input` for entries that are not finite or a
/// wrong length, `Solve` if the rotations do not converge.
pub fn symmetric_eigen(a: &[f64], n: usize) -> Result<(Vec<f64>, Vec<f64>)> {
    if a.len() != n * n {
        return Err(Error::input("matrix", format!("is not square: expected {} entries, got {}", n * n, a.len())));
    }
    finite("matrix", a)?;
    let biggest = a.iter().fold(0.0f64, |b, x| b.max(x.abs()));
    let scale = if biggest == 0.0 || (1e-60..1e60).contains(&biggest) { 1.0 } else { biggest };
    let mut s = vec![0.0; n * n];
    let mut v = vec![0.0; n * n];
    for i in 0..n {
        v[i * n + i] = 1.0;
        for j in 0..n {
            s[i * n + j] = 0.5 * (a[i * n + j] / scale) + 0.5 * (a[j * n + i] / scale);
        }
    }
    let size = s.iter().map(|x| x * x).sum::<f64>().sqrt();
    for _ in 0..MAX_SWEEPS {
        let mut quiet = true;
        for p in 0..n {
            interrupt::check();
            for q in p + 1..n {
                let (app, aqq, apq) = (s[p * n + p], s[q * n + q], s[p * n + q]);
                // Skip an entry that is negligible compared with both diagonal entries, or with the rounding error of the matrix. The first
                // condition preserves the relative accuracy of graded matrices.
                if apq.abs() <= f64::EPSILON * (app.abs() * aqq.abs()).sqrt() || apq.abs() <= 1e-3 * f64::EPSILON * size {
                    continue;
                }
                quiet = false;
                let zeta = (aqq - app) / (2.0 * apq);
                let t = if zeta.abs() > 1e150 { 0.5 / zeta } else { 1.0f64.copysign(zeta) / (zeta.abs() + (1.0 + zeta * zeta).sqrt()) };
                let c = 1.0 / (1.0 + t * t).sqrt();
                let sn = c * t;
                for k in 0..n {
                    let (x, y) = (s[k * n + p], s[k * n + q]);
                    (s[k * n + p], s[k * n + q]) = (c * x - sn * y, sn * x + c * y);
                }
                for k in 0..n {
                    let (x, y) = (s[p * n + k], s[q * n + k]);
                    (s[p * n + k], s[q * n + k]) = (c * x - sn * y, sn * x + c * y);
                    let (x, y) = (v[p * n + k], v[q * n + k]);
                    (v[p * n + k], v[q * n + k]) = (c * x - sn * y, sn * x + c * y);
                }
                (s[p * n + q], s[q * n + p]) = (0.0, 0.0);
            }
        }
        if quiet {
            let mut order: Vec<usize> = (0..n).collect();
            order.sort_by(|&i, &j| s[i * n + i].total_cmp(&s[j * n + j]));
            let values = order.iter().map(|&i| s[i * n + i] * scale).collect();
            let vectors = order.iter().flat_map(|&i| v[i * n..(i + 1) * n].iter().copied()).collect();
            return Ok((values, vectors));
        }
    }
    Err(Error::Solve {
        status: Status::MaxSteps,
        t: MAX_SWEEPS as f64,
        problem: "the symmetric eigenvalue iteration did not converge".into(),
    })
}
