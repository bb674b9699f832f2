//! The base parameters of an arm: the smallest set of combinations of inertial parameters that determines its joint torques
//! (`gautier1991numerical`).
//!
//! The torque is `Y pi`, with the regressor `Y` and the `p` parameters `pi`. Over all states, `b <= p` columns of `Y` are linearly
//! independent. Let `Y_b` be these columns. Every other column is a combination of them: `Y = Y_b P`, so that `Y pi = Y_b (P pi)` at every
//! state.
//!
//! The columns of `Y(q, v, v_r, a_r)` are stacked over pseudo-random states. They are examined in the order of the parameters, from base to
//! tip. A column is dependent if its distance from the span of the earlier columns, relative to its length, is a rounding error. So a
//! dependent parameter is always grouped with earlier parameters.

use super::uniform::uniform;
use crate::dynamics::{JointTerms, Model};
use crate::error::Result;
use crate::interrupt;
use crate::linalg::{axpy, dot};
use crate::memory;
use crate::spatial::{PARAMETERS, parameter};

/// A column is dependent if its distance from the span of the earlier columns, divided by its norm, is below this limit. Rounding errors
/// are about 1e-13 for well spread states. For models of real arms, the smallest distance of an independent column is above 1e-4.
const DEPENDENT: f64 = 1e-8;
/// A column whose norm is below this fraction of the largest norm counts as zero.
const ZERO_COLUMN: f64 = 1e-12;
/// Number of rows per column of the stacked regressor. Rows at random states in this number give the regressor its full rank.
const ROWS: usize = 3;
/// Number of states whose regressors are computed together.
const BLOCK: usize = 16;

/// The independent columns `W_b` of a matrix `W`, and the combinations of them that give all columns.
///
/// ```
/// use armlet_core::analysis::base_parameters::independent_columns;
///
/// // The third column is the sum of the first two.
/// let found = independent_columns(&mut [vec![1.0, 0.0], vec![0.0, 2.0], vec![1.0, 2.0]]);
/// assert_eq!(found.columns, [0, 1]);
/// assert!(found.projection.iter().zip([1.0, 0.0, 1.0, 0.0, 1.0, 1.0]).all(|(p, expected)| (p - expected).abs() < 1e-12));
/// assert!(found.smallest_kept > 0.9 && found.largest_dropped < 1e-12);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Independent {
    /// Indices of the independent columns, ascending.
    pub columns: Vec<usize>,
    /// The projection `P`, `(b, p)`, row-major: the matrix is `W = W_b P`, where `W_b` has the independent columns of `W`.
    pub projection: Vec<f64>,
    /// The smallest relative distance of an independent column from the span of the earlier columns; 1 if there is no such column.
    pub smallest_kept: f64,
    /// The largest relative distance of a dependent column from the span of the earlier columns; 0 if there is no such column.
    pub largest_dropped: f64,
}

/// Find the columns of a matrix that are independent of the earlier columns. `columns[j]` is column `j`, and is overwritten.
pub fn independent_columns(columns: &mut [Vec<f64>]) -> Independent {
    let p = columns.len();
    let norms: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt()).collect();
    let largest = norms.iter().fold(0.0f64, |a, &b| a.max(b));
    let mut out = Independent { columns: Vec::new(), projection: Vec::new(), smallest_kept: 1.0, largest_dropped: 0.0 };
    // Column j of R: the coefficients in the orthonormal basis of the independent columns so far.
    let mut r: Vec<Vec<f64>> = Vec::with_capacity(p);
    for j in 0..p {
        let (basis, later) = columns.split_at_mut(j);
        let column = &mut later[0];
        let mut coefficients = Vec::new();
        interrupt::check();
        if norms[j] > ZERO_COLUMN * largest {
            coefficients = vec![0.0; out.columns.len()];
            // Two passes of orthogonalisation are sufficient (Parlett 1980): the second pass removes the rounding error of the first.
            for _ in 0..2 {
                for (k, &i) in out.columns.iter().enumerate() {
                    interrupt::check();
                    let along = dot(&basis[i], column);
                    axpy(-along, &basis[i], column);
                    coefficients[k] += along;
                }
            }
            let left = dot(column, column).sqrt();
            if left > DEPENDENT * norms[j] {
                out.smallest_kept = out.smallest_kept.min(left / norms[j]);
                column.iter_mut().for_each(|x| *x /= left);
                coefficients.push(left);
                out.columns.push(j);
            } else {
                out.largest_dropped = out.largest_dropped.max(left / norms[j]);
            }
        }
        r.push(coefficients);
    }
    let b = out.columns.len();
    out.projection = vec![0.0; b * p];
    for (j, coefficients) in r.iter().enumerate() {
        // Solve `R_b x = column j of R`, where `R_b` is the triangular factor of the independent columns.
        let mut x = coefficients.clone();
        x.resize(b, 0.0);
        for k in (0..b).rev() {
            x[k] /= r[out.columns[k]][k];
            for i in 0..k {
                x[i] -= r[out.columns[k]][i] * x[k];
            }
        }
        // The norm of one term in the combination that gives column `j`. Terms below 1e-10 of the largest term are rounding errors.
        let part = |k: usize| x[k].abs() * norms[out.columns[k]];
        let scale = (0..b).fold(0.0f64, |a, k| a.max(part(k)));
        for k in 0..b {
            out.projection[k * p + j] = if part(k) <= 1e-10 * scale { 0.0 } else { snapped(x[k]) };
        }
    }
    out
}

/// Round a coefficient near 1 or -1 to this number: most groupings have only these coefficients.
fn snapped(x: f64) -> f64 {
    if (x.abs() - 1.0).abs() < 1e-11 { x.signum() } else { x }
}

/// The base parameters of an arm: the independent columns of its regressor, and the names of all parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// use armlet_core::analysis::base_parameters::base_parameters;
/// use armlet_core::dynamics::JointTerms;
///
/// // Of the ten parameters of a pendulum, three determine its motion.
/// let base = base_parameters(&Arm::pendulum(2.0, 5.0)?.into(), JointTerms::default())?;
/// assert_eq!((base.names.len(), base.count(), base.grouping().len()), (10, 3, 3));
/// // The mass alone has no effect.
/// assert!(base.unseen().contains(&base.names[0].as_str()));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct BaseParameters {
    /// The independent columns, and the projection onto them.
    pub independent: Independent,
    /// Names of all parameters, for example `Izz[joint]`.
    pub names: Vec<String>,
}

/// Fill `x` with uniform numbers in [-scale, scale).
fn fill(state: &mut u64, scale: f64, x: &mut [f64]) {
    x.iter_mut().for_each(|x| *x = scale * (2.0 * uniform(state) - 1.0));
}

/// Compute the base parameters of `arm` under the gravity of the model. `terms` adds parameters of the joints. Errors: `Memory` if the
/// memory does not suffice, and `Input` for joint terms of a planar PR arm.
pub fn base_parameters(arm: &Model, terms: JointTerms) -> Result<BaseParameters> {
    let n = arm.n();
    let query = terms.regressor();
    let names = arm.column_names(terms);
    let p = names.len();
    let states = if n == 0 { 0 } else { (ROWS * p).div_ceil(n) };
    memory::require(8 * p.saturating_mul(states * n + 3 * p + BLOCK * n))?;
    let mut columns: Vec<Vec<f64>> = (0..p).map(|_| memory::reserved(states * n)).collect::<Result<_>>()?;
    let mut state = 2022;
    let mut y = vec![0.0; BLOCK * n * p];
    for first in (0..states).step_by(BLOCK) {
        interrupt::check();
        let count = BLOCK.min(states - first);
        let [mut q, mut v, mut v_r, mut a_r] = [const { Vec::new() }; 4].map(|mut x: Vec<f64>| {
            x.resize(count * n, 0.0);
            x
        });
        for k in 0..count {
            for (scale, x) in [(3.0, &mut q), (3.0, &mut v), (3.0, &mut v_r), (9.0, &mut a_r)] {
                fill(&mut state, scale, &mut x[k * n..(k + 1) * n]);
            }
        }
        let y = &mut y[..count * n * p];
        arm.regressors(&query, [&q, &v, &v_r, &a_r], y)?;
        for row in y.chunks_exact(p.max(1)) {
            for (column, x) in columns.iter_mut().zip(row) {
                column.push(*x);
            }
        }
    }
    Ok(BaseParameters { independent: independent_columns(&mut columns), names })
}

impl BaseParameters {
    /// Number of base parameters.
    pub fn count(&self) -> usize {
        self.independent.columns.len()
    }

    /// Each base parameter as the text of a sum, for example `Izz[a] + Izz[b] + 0.25 m[b]`.
    pub fn grouping(&self) -> Vec<String> {
        let p = self.names.len();
        self.independent
            .columns
            .iter()
            .enumerate()
            .map(|(k, &own)| {
                let mut text = self.names[own].clone();
                for j in (0..p).filter(|&j| j != own) {
                    let c = self.independent.projection[k * p + j];
                    if c != 0.0 {
                        let sign = if c < 0.0 { "-" } else { "+" };
                        let size = if c.abs() == 1.0 { String::new() } else { format!("{} ", short(c.abs())) };
                        text += &format!(" {sign} {size}{}", self.names[j]);
                    }
                }
                text
            })
            .collect()
    }

    /// Names of the parameters that do not affect the torque at any state.
    pub fn unseen(&self) -> Vec<&str> {
        let p = self.names.len();
        let seen = |j: usize| (0..self.count()).any(|k| self.independent.projection[k * p + j] != 0.0);
        (0..p).filter(|&j| !seen(j)).map(|j| self.names[j].as_str()).collect()
    }
}

/// The text of a number, with four digits.
fn short(x: f64) -> String {
    if (1e-3..1e4).contains(&x) {
        let digits = (3 - x.log10().floor() as i32).max(0) as usize;
        let text = format!("{x:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
    } else {
        format!("{x:.3e}")
    }
}

/// The names are in the order of the parameters: parameter 0 is the mass.
const _: () = assert!(parameter::NAMES.len() == PARAMETERS && parameter::MASS == 0);
