//! Physical consistency of inertial parameters: the pseudo-inertia `P` of every body must be positive definite (`wensing2018linear`). For
//! inconsistent parameters, the nearest consistent parameters are computed.
//!
//! The distance is the Frobenius norm of `D P D`, with `D = diag(1/l, 1/l, 1/l, 1)`. The length `l` makes second moment, first moment and
//! mass comparable, in kg. The nearest matrix whose eigenvalues are at least a floor has the eigenvectors of `D P D`. Smaller eigenvalues
//! are raised to the floor (`higham1988nearest`).

use crate::error::{Error, Result, finite, positive};
use crate::linalg::symmetric_eigen;
use crate::spatial::pseudo_inertia::{Pseudo, is_positive_definite, parameters_of, pseudo_inertia};
use crate::spatial::{Inertia, PARAMETERS, Vector, Vector3};

/// The result of the check of one body's inertial parameters.
///
/// ```
/// use armlet_core::analysis::consistency::check_parameters;
///
/// // A body of 1 kg. Each moment of inertia is at most the sum of the other two.
/// let body = |izz: f64| [1.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, izz];
/// let report = check_parameters(&body(0.1))?.remove(0);
/// assert!(report.problem.is_empty());
/// assert!(report.eigenvalues.iter().zip([0.05, 0.05, 0.05, 1.0]).all(|(l, expected)| (l - expected).abs() < 1e-12));
/// assert!(!check_parameters(&body(0.3))?[0].problem.is_empty());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct BodyReport {
    /// The four eigenvalues of the pseudo-inertia, ascending, in SI units.
    pub eigenvalues: [f64; 4],
    /// The reason why the body is impossible; empty if it is physically possible.
    pub problem: String,
}

fn bodies(pi: &[f64]) -> Result<&[[f64; PARAMETERS]]> {
    finite("pi", pi)?;
    match pi.as_chunks::<PARAMETERS>() {
        (bodies, []) => Ok(bodies),
        _ => Err(Error::wrong("pi", "length", format!("a multiple of {PARAMETERS}"), pi.len())),
    }
}

fn eigen(p: &Pseudo<f64>) -> Result<(Vec<f64>, Vec<f64>)> {
    symmetric_eigen(p.as_flattened(), 4)
}

/// Compute the eigenvalues of each body's pseudo-inertia, and the reason why a body is impossible.
///
/// `pi`, `(10 b,)`, has ten parameters for each of `b` bodies, in SI units. Errors: `WrongShape` for another length, `Input` for numbers
/// that are not finite.
pub fn check_parameters(pi: &[f64]) -> Result<Vec<BodyReport>> {
    let report = |body: &[f64; PARAMETERS]| {
        let (values, _) = eigen(&pseudo_inertia(body))?;
        let eigenvalues: [f64; 4] = std::array::from_fn(|k| values[k]);
        let problem = if is_positive_definite(body) { String::new() } else { problem(body) };
        Ok(BodyReport { eigenvalues, problem })
    };
    bodies(pi)?.iter().map(report).collect()
}

/// The reason why a pseudo-inertia is not positive definite, in terms of mass and inertia about the centre of mass.
fn problem(body: &[f64; PARAMETERS]) -> String {
    let inertia = Inertia::from_parameters(body);
    if inertia.mass <= 0.0 {
        return format!("mass {} is not positive", body[0]);
    }
    let com = Vector3::from(inertia.moment.array().map(|h| h / inertia.mass));
    let [xx, xy, yy, xz, yz, zz] = inertia.shifted(-com).inertia.0;
    let Ok((moments, _)) = symmetric_eigen(&[xx, xy, xz, xy, yy, yz, xz, yz, zz], 3) else {
        return "inertia about the centre of mass overflows".into();
    };
    let shown = format!("principal moments about the centre of mass {:.6e}, {:.6e}, {:.6e}", moments[0], moments[1], moments[2]);
    if moments[0] <= 0.0 {
        format!("{shown}: the smallest is not positive")
    } else {
        format!("{shown}: the largest is not below the sum of the others (triangle inequality)")
    }
}

/// Replace each physically impossible body by the nearest possible one, in the Frobenius norm of the scaled pseudo-inertia. Possible bodies
/// do not change.
///
/// `pi`, `(10 b,)`, has ten parameters for each of `b` bodies, in SI units. `length`, m, is the unit of length of the pseudo-inertias, and
/// so weights moments against masses. The eigenvalues of a projected pseudo-inertia are at least `floor` times the largest eigenvalue of
/// all bodies.
///
/// Errors: `WrongShape` for a wrong length of `pi`. `Input` for numbers that are not finite, or a `length` or `floor` that is not positive.
/// Also `Input` if no body has a positive eigenvalue.
pub fn project_parameters(pi: &[f64], length: f64, floor: f64) -> Result<Vec<f64>> {
    positive("length", length)?;
    positive("floor", floor)?;
    let bodies = bodies(pi)?;
    let scaled = |body: &[f64; PARAMETERS], by: f64| {
        let mut p = pseudo_inertia(body);
        for (i, row) in p.iter_mut().enumerate() {
            for (j, x) in row.iter_mut().enumerate() {
                *x *= if i < 3 { by } else { 1.0 } * if j < 3 { by } else { 1.0 };
            }
        }
        p
    };
    let spectra = bodies.iter().map(|body| eigen(&scaled(body, 1.0 / length))).collect::<Result<Vec<_>>>()?;
    let largest = spectra.iter().fold(0.0f64, |most, (values, _)| most.max(values[3]));
    let mut out = Vec::with_capacity(pi.len());
    for (body, (values, vectors)) in bodies.iter().zip(&spectra) {
        if is_positive_definite(body) {
            out.extend_from_slice(body);
            continue;
        }
        if largest <= 0.0 {
            return Err(Error::input("pi", "has no body to scale by: expected a positive eigenvalue in some pseudo-inertia, got none"));
        }
        let mut p = [[0.0; 4]; 4];
        for (value, vector) in values.iter().zip(vectors.chunks_exact(4)) {
            let value = value.max(floor * largest);
            for i in 0..4 {
                for j in 0..4 {
                    p[i][j] += value * vector[i] * vector[j];
                }
            }
        }
        out.extend_from_slice(&parameters_of(&scaled(&parameters_of(&p), length)));
    }
    Ok(out)
}
