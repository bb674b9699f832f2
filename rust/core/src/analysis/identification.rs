//! Identification by least squares on recorded motion (`gautier1992exciting`): `W_b beta = tau`. `beta` are the `b` base parameters, `W_b`
//! is their stacked regressor, and `tau` has the measured torques. Each row is divided by the noise of its joint.
//!
//! ```text
//! [W_b tau] = Q [R z; 0 rho],  R = U S V',  beta = V S^-1 U' z,  sigma^2 = rho^2 / (rows - rank),  cov = sigma^2 V S^-2 V'
//! ```
//!
//! If the rank is below `b`, `rho^2` also has the squares of the entries of `U' z` beyond the rank.
//!
//! Rotors that are not identified are known: their torque `armature a` is subtracted from the measured torque. The triangle `[R z; 0 rho]`
//! is updated block by block, so that its memory does not grow with the length of the record. Columns are scaled to length one before the
//! rank decision, so that units have no effect.

use super::base_parameters::{BaseParameters, base_parameters};
use crate::dynamics::{JointTerms, Model, Query};
use crate::error::{Error, Result, finite, positive};
use crate::interrupt;
use crate::linalg::householder::{reflect, reflector};
use crate::linalg::{Svd, dot};
use crate::memory;
use std::borrow::Cow;

/// Number of samples that are added to the triangle together.
const BLOCK: usize = 256;

/// The base parameters of a record, with their accuracy.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model};
/// use armlet_core::analysis::identification::{IdentificationOptions, identify};
///
/// // Recorded samples of the pendulum 2 a + 5 sin(q) = tau. The model has other parameters.
/// let q: Vec<f64> = (0..20).map(|k| (0.3 * f64::from(k)).sin()).collect();
/// let a: Vec<f64> = (0..20).map(|k| (1.1 * f64::from(k)).cos()).collect();
/// let tau: Vec<f64> = q.iter().zip(&a).map(|(q, a)| 2.0 * a + 5.0 * q.sin()).collect();
/// let model = Model::from(Arm::pendulum(1.0, 3.0)?);
/// let options = IdentificationOptions { cutoff: 1e-9, ..IdentificationOptions::default() };
/// let found = identify(&model, [&q, &[0.0; 20], &a, &tau], &options)?;
/// assert!(found.rank == 3 && found.residuals[0] < 1e-12);
/// assert!(found.values.iter().any(|beta| (beta - 2.0).abs() < 1e-9));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// The choice of base parameters.
    pub base: BaseParameters,
    /// Values `beta` of the base parameters, `(b,)`, in SI units.
    pub values: Vec<f64>,
    /// Standard deviations of the values, `(b,)`, in SI units; infinite for parameters that the record does not determine.
    pub deviations: Vec<f64>,
    /// Covariance of the values, `(b, b)`, row-major, in SI units, in the directions that the record determines.
    pub covariance: Vec<f64>,
    /// Numerical rank of the stacked regressor.
    pub rank: usize,
    /// Condition number of the regressor with scaled columns; infinite if the rank is below `b`.
    pub condition: f64,
    /// Singular values of the regressor with scaled columns, descending.
    pub singular_values: Vec<f64>,
    /// Root mean square of `tau - W_b beta` for each joint, `(n,)`, N m or N.
    pub residuals: Vec<f64>,
    /// All parameters, `(p,)`, in SI units. Many parameter vectors have the identified base parameters. This vector is the one nearest to
    /// the arm's parameters, in the Euclidean norm.
    pub parameters: Vec<f64>,
}

/// The parameters to identify, and the weights of the record.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::{JointTerms, Model}};
/// use armlet_core::analysis::identification::{IdentificationOptions, identify};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let q: Vec<f64> = (0..30).map(|k| (0.3 * f64::from(k)).sin()).collect();
/// # let v: Vec<f64> = (0..30).map(|k| (0.3 + 0.7 * f64::from(k)).sin()).collect();
/// # let a: Vec<f64> = (0..30).map(|k| (1.1 * f64::from(k)).cos()).collect();
///
/// // The recorded torque has viscous friction of 0.3 N m s/rad and Coulomb friction of 0.1 N m.
/// let tau: Vec<f64> = (0..30).map(|k| 2.0 * a[k] + 5.0 * q[k].sin() + 0.3 * v[k] + 0.1 * v[k].signum()).collect();
/// let terms = JointTerms { friction: true, ..JointTerms::default() };
/// let options = IdentificationOptions { terms, cutoff: 1e-9, ..IdentificationOptions::default() };
/// let found = identify(&model, [&q, &v, &a, &tau], &options)?;
/// assert!((found.values[3] - 0.3).abs() < 1e-9 && (found.values[4] - 0.1).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct IdentificationOptions<'a> {
    /// The parameters of the joints to identify: rotor inertias, viscous and Coulomb friction, torque offsets.
    pub terms: JointTerms,
    /// Standard deviation of the torque of each joint, `(n,)`, N m or N, as weights; equal weights if `None`.
    pub noise: Option<&'a [f64]>,
    /// A direction is not determined by the record if its singular value is below this fraction of the largest.
    pub cutoff: f64,
}

/// The upper triangle `[R z; 0 rho]` of the least-squares problem, `(b + 1, b + 1)`, and the rows of the next block.
struct Triangle {
    width: usize,
    /// One array per column, with `width + BLOCK n` rows.
    columns: Vec<Vec<f64>>,
}

impl Triangle {
    fn new(width: usize, rows: usize) -> Self {
        Triangle { width, columns: vec![vec![0.0; width + rows]; width] }
    }

    /// Update the triangle with the rows of the block, which are stored below the triangle.
    fn fold(&mut self) {
        for j in 0..self.width {
            let (head, tail) = self.columns.split_at_mut(j + 1);
            let column = &mut head[j];
            let (alpha, beta) = reflector(&mut column[j..]);
            if beta != 0.0 {
                for other in tail {
                    reflect(&column[j..], beta, &mut other[j..]);
                }
            }
            column[j] = alpha;
            column[j + 1..].fill(0.0);
        }
    }
}

/// Identify the parameters of `arm` from recorded positions, velocities, accelerations and torques, each `(samples, n)`. Units: rad, rad/s,
/// rad/s^2 and N m for a revolute joint; m, m/s, m/s^2 and N for a prismatic joint.
///
/// Errors: `WrongShape` for wrong lengths. `Input` for numbers that are not finite, noise that is not positive, or too few samples.
/// `Memory` if the memory does not suffice.
pub fn identify(arm: &Model, [q, v, a, tau]: [&[f64]; 4], options: &IdentificationOptions) -> Result<Identification> {
    let n = arm.n();
    if n == 0 {
        return Err(Error::input("arm", "has no joints: expected at least one"));
    }
    let samples = q.len() / n;
    for (name, x) in [("q", q), ("v", v), ("a", a), ("tau", tau)] {
        if x.len() != samples * n {
            return Err(Error::wrong(name, "length", samples * n, x.len()));
        }
        finite(name, x)?;
    }
    let ones = vec![1.0; n];
    let noise = options.noise.unwrap_or(&ones);
    if noise.len() != n {
        return Err(Error::wrong("noise", "length", n, noise.len()));
    }
    noise.iter().try_for_each(|&x| positive("noise", x))?;
    let base = base_parameters(arm, options.terms)?;
    let (b, p) = (base.count(), base.names.len());
    if samples * n <= b {
        return Err(Error::input("q", format!("has too few samples: expected more than {} for {b} base parameters, got {samples}", b / n)));
    }
    let tau: &[f64] = &without_known_rotors(arm, a, tau, options.terms.armature)?;
    let query = options.terms.regressor();
    memory::require(8 * (b + 1).saturating_mul(8 * b + 2 * BLOCK * n) + 8 * BLOCK * n * p)?;
    let mut triangle = Triangle::new(b + 1, BLOCK * n);
    let mut y = vec![0.0; BLOCK * n * p];
    for first in (0..samples).step_by(BLOCK) {
        interrupt::check();
        let last = (first + BLOCK).min(samples);
        let rows = (last - first) * n;
        arm.regressors(&query, [q, v, v, a].map(|x| &x[first * n..last * n]), &mut y[..rows * p])?;
        for (k, column) in triangle.columns.iter_mut().enumerate() {
            column[b + 1..].fill(0.0);
            for row in 0..rows {
                let value = if k < b { y[row * p + base.independent.columns[k]] } else { tau[first * n + row] };
                column[b + 1 + row] = value / noise[row % n];
            }
        }
        triangle.fold();
    }
    let mut out = solve(&triangle, samples * n, options.cutoff)?;
    out.residuals = residuals(arm, [q, v, a, tau], &query, &base, &out.values, &mut y)?;
    out.parameters = nearest(arm, &base, &out.values, options)?;
    Ok(Identification { base, ..out })
}

/// The measured torque without the torque of known rotors.
fn without_known_rotors<'t>(arm: &Model, a: &[f64], tau: &'t [f64], identified: bool) -> Result<Cow<'t, [f64]>> {
    let armature = arm.armature();
    if identified || armature.iter().all(|&x| x == 0.0) {
        return Ok(Cow::Borrowed(tau));
    }
    let n = armature.len();
    Ok(Cow::Owned(memory::collected((0..tau.len()).map(|k| tau[k] - armature[k % n] * a[k]))?))
}

/// Compute the results that do not require the record again.
fn solve(triangle: &Triangle, rows: usize, cutoff: f64) -> Result<Identification> {
    let b = triangle.width - 1;
    let columns = &triangle.columns;
    let scales: Vec<f64> = (0..b).map(|j| dot(&columns[j][..b], &columns[j][..b]).sqrt()).map(|s| if s > 0.0 { s } else { 1.0 }).collect();
    let mut r = vec![0.0; b * b];
    for j in 0..b {
        for i in 0..=j {
            r[i * b + j] = columns[j][i] / scales[j];
        }
    }
    let mut svd = Svd::new(b, b);
    svd.decompose(&r, b, b)?;
    let s = svd.s().to_vec();
    let rank = s.iter().filter(|&&x| x > cutoff * s[0]).count();
    let z = &columns[b][..b];
    let rho = columns[b][b];
    let mut lost: f64 = rho * rho;
    let mut values = vec![0.0; b];
    for k in 0..b {
        let along = dot(svd.u(k), z);
        if k < rank {
            for j in 0..b {
                values[j] += along / s[k] * svd.v(k)[j] / scales[j];
            }
        } else {
            lost += along * along;
        }
    }
    let variance = lost / (rows - rank) as f64;
    let mut covariance = vec![0.0; b * b];
    let mut hidden = vec![false; b];
    for i in 0..b {
        for j in 0..b {
            let sum: f64 = (0..rank).map(|k| svd.v(k)[i] * svd.v(k)[j] / (s[k] * s[k])).sum();
            covariance[i * b + j] = variance * sum / (scales[i] * scales[j]);
        }
        // A parameter is undetermined if its component in a direction that the record does not determine exceeds a thousandth.
        hidden[i] = (rank..b).any(|k| svd.v(k)[i].abs() > 1e-3);
    }
    let deviations = (0..b).map(|i| if hidden[i] { f64::INFINITY } else { covariance[i * b + i].sqrt() }).collect();
    let condition = if rank == b && b > 0 { s[0] / s[b - 1] } else { f64::INFINITY };
    let base = BaseParameters { independent: super::base_parameters::Independent::default(), names: Vec::new() };
    let (residuals, parameters) = (Vec::new(), Vec::new());
    Ok(Identification { base, values, deviations, covariance, rank, condition, singular_values: s, residuals, parameters })
}

/// Root mean square of the differences between torque and model, for each joint.
fn residuals(
    arm: &Model,
    [q, v, a, tau]: [&[f64]; 4],
    query: &Query,
    base: &BaseParameters,
    values: &[f64],
    y: &mut [f64],
) -> Result<Vec<f64>> {
    let (n, p) = (arm.n(), base.names.len());
    let samples = q.len() / n;
    let mut sums = vec![0.0; n];
    for first in (0..samples).step_by(BLOCK) {
        interrupt::check();
        let last = (first + BLOCK).min(samples);
        let rows = (last - first) * n;
        arm.regressors(query, [q, v, v, a].map(|x| &x[first * n..last * n]), &mut y[..rows * p])?;
        for (row, y) in y[..rows * p].chunks_exact(p).enumerate() {
            let model: f64 = base.independent.columns.iter().zip(values).map(|(&j, x)| y[j] * x).sum();
            sums[row % n] += (tau[first * n + row] - model).powi(2);
        }
    }
    Ok(sums.iter().map(|sum| (sum / samples as f64).sqrt()).collect())
}

/// Compute `pi + P' (P P')^-1 (beta - P pi)`: the parameters with the identified base parameters `beta` that are nearest to the arm's
/// parameters `pi`.
fn nearest(arm: &Model, base: &BaseParameters, values: &[f64], options: &IdentificationOptions) -> Result<Vec<f64>> {
    let (b, p) = (base.count(), base.names.len());
    let projection = &base.independent.projection;
    let mut pi = arm.parameters();
    if let Model::Tree(arm) = arm {
        if options.terms.armature {
            pi.extend(arm.independent().map(|joint| joint.armature));
        }
        if options.terms.friction {
            pi.extend(arm.independent().map(|joint| joint.damping));
            pi.extend(arm.independent().map(|joint| joint.friction));
        }
        if options.terms.offset {
            pi.extend(arm.independent().map(|_| 0.0));
        }
    }
    let row = |k: usize| &projection[k * p..(k + 1) * p];
    let mut gram = vec![0.0; b * b];
    for i in 0..b {
        for j in 0..b {
            gram[i * b + j] = dot(row(i), row(j));
        }
    }
    let mut missing: Vec<f64> = (0..b).map(|k| values[k] - dot(row(k), &pi)).collect();
    let factor = crate::linalg::cholesky::factor(b, &gram).ok_or_else(|| Error::Solve {
        status: crate::status::Status::Diverged,
        t: 0.0,
        problem: "the base parameters are dependent".into(),
    })?;
    crate::linalg::cholesky::solve(b, &factor, &mut missing);
    for k in 0..b {
        for (x, c) in pi.iter_mut().zip(row(k)) {
            *x += c * missing[k];
        }
    }
    Ok(pi)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Arm;

    #[test]
    fn noise_of_a_wrong_length_is_refused() {
        let arm = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81]).unwrap());
        let record: Vec<f64> = (0..80).map(|k| f64::from(k).sin()).collect();
        for noise in [&[][..], &[0.1], &[0.1; 3]] {
            let options = IdentificationOptions { noise: Some(noise), ..IdentificationOptions::default() };
            let refused = identify(&arm, [&record; 4], &options);
            assert!(matches!(&refused, Err(Error::WrongShape { argument, .. }) if argument == "noise"), "{noise:?}: {refused:?}");
        }
    }
}
