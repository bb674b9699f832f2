//! The derivative of a solution by the rows and bounds of its stack, with the active set of the solution.
//!
//! Let `J_P` be the tasks and violated rows of a level, and `b` their bounds. `N` is an orthonormal basis of the directions that the rows
//! above and the held rows leave free. The level has `N' (J_P' w + sum lambda_i a_i) = 0`, `w = J_P x - b`. The sum is over the rows above
//! and the held rows. Its derivative, with the decomposition `J_P N = U S V'`, is
//!
//! `dx = sum_j N v_j (u_j'(db - dJ_P x - J_P dx_above) / s_j - v_j' N' sum mu_i da_i / s_j^2)`,  `mu = w` for a row of the level, else `lambda`.
//!
//! A derivative of `N` does not appear, because it only changes the multipliers. Held rows are a level with `w = 0`, and the smallest norm is a
//! level with `J_P = I`. A level fixes the combinations `u_j' J_P` of its rows for the levels below.

use super::Inequalities;
use super::rows::Rows;
use crate::linalg::{Svd, dot};
use crate::priority::method::PriorityMethod;
use crate::priority::settings::Settings;
use nalgebra::{DMatrix, DVector};

/// A singular value below this fraction of the longest row is zero, and its direction is not a direction of the level.
const NO_DIRECTION: f64 = 1e-11;

/// The derivative `dx = by_bound db + sum by_row_i da_i` of the velocities, with all rows of a solve, those of level 0 first.
#[derive(Debug, Clone)]
pub struct Slopes {
    /// The derivative by the active bounds and the commands, shape `(n, rows)`.
    pub by_bound: DMatrix<f64>,
    /// The derivative by entry `c` of row `i` in column `i n + c`, shape `(n, rows n)`.
    pub by_row: DMatrix<f64>,
}

/// The levels so far.
struct Chain<'a> {
    rows: &'a Rows,
    x: DVector<f64>,
    /// An orthonormal basis of the free directions.
    free: DMatrix<f64>,
    /// The fixed combinations of rows: their sums, and the weights of all rows in them.
    sums: DMatrix<f64>,
    weights: DMatrix<f64>,
    /// The direction in which each combination was fixed.
    taken: DMatrix<f64>,
    slopes: Slopes,
}

impl<'a> Chain<'a> {
    fn new(rows: &'a Rows, x: &[f64]) -> Self {
        let (n, count) = (x.len(), rows.len());
        let slopes = Slopes { by_bound: DMatrix::zeros(n, count), by_row: DMatrix::zeros(n, count * n) };
        let [sums, taken] = [0; 2].map(|_| DMatrix::zeros(n, 0));
        let (x, free) = (DVector::from_column_slice(x), DMatrix::identity(n, n));
        Chain { rows, x, free, sums, weights: DMatrix::zeros(count, 0), taken, slopes }
    }

    /// The multipliers of all rows that balance the force `g` along the taken directions.
    fn multipliers(&self, g: &DVector<f64>) -> Option<DVector<f64>> {
        let balance = (self.sums.transpose() * &self.taken).transpose();
        let forces = -(self.taken.transpose() * g);
        if forces.is_empty() { Some(DVector::zeros(self.rows.len())) } else { balance.lu().solve(&forces).map(|of| &self.weights * of) }
    }

    /// Add a level with the rows `list` and their violations `w`. An empty `w` is zero. The result is `None` if a singular value is below
    /// `least`, but not zero.
    fn add(&mut self, list: &[usize], w: &[f64], least: f64) -> Option<()> {
        let (m, k, n) = (list.len(), self.free.ncols(), self.x.len());
        if m == 0 || k == 0 {
            return Some(());
        }
        let a = DMatrix::from_fn(n, m, |c, r| self.rows.row(list[r])[c]);
        let mut svd = Svd::new(m, k);
        svd.decompose((self.free.transpose() * &a).as_slice(), m, k).ok()?;
        let zero = NO_DIRECTION * list.iter().map(|i| self.rows.size[*i]).fold(0.0, f64::max);
        let rank = svd.rank(zero);
        if svd.s()[..rank].iter().any(|s| *s < least) {
            return None;
        }
        let mut forces = DVector::zeros(self.rows.len());
        if rank < m && !w.is_empty() {
            forces = self.multipliers(&(&a * DVector::from_column_slice(w)))?;
            list.iter().zip(w).for_each(|(i, w)| forces[*i] += w);
        }
        let v = DMatrix::from_fn(k, k, |c, j| svd.v(j)[c]);
        let turned = &self.free * v;
        let (old, used) = (self.slopes.clone(), self.sums.ncols());
        for j in 0..rank {
            let (s, along, u) = (svd.s()[j], turned.column(j), DVector::from_column_slice(svd.u(j)));
            let sum = &a * &u;
            let (mut by_bound, mut by_row) = (-(old.by_bound.tr_mul(&sum)) / s, -(old.by_row.tr_mul(&sum)) / s);
            for (u, &i) in u.iter().zip(list) {
                by_bound[i] += u / s;
                by_row.rows_mut(i * n, n).axpy(-u / s, &self.x, 1.0);
            }
            for (i, force) in forces.iter().enumerate().filter(|(_, force)| **force != 0.0) {
                by_row.rows_mut(i * n, n).axpy(-force / (s * s), &along, 1.0);
            }
            self.slopes.by_bound.ger(1.0, &along, &by_bound, 1.0);
            self.slopes.by_row.ger(1.0, &along, &by_row, 1.0);
            for (to, column) in [(&mut self.sums, &sum), (&mut self.taken, &along.into_owned())] {
                *to = std::mem::replace(to, DMatrix::zeros(0, 0)).insert_column(used + j, 0.0);
                to.set_column(used + j, column);
            }
            self.weights = std::mem::replace(&mut self.weights, DMatrix::zeros(0, 0)).insert_column(used + j, 0.0);
            list.iter().zip(u.iter()).for_each(|(i, u)| self.weights[(*i, used + j)] = *u);
        }
        self.free = turned.columns(rank, k - rank).into_owned();
        Some(())
    }

    /// Add held rows, which are independent.
    fn hold(&mut self, list: &[usize]) -> Option<()> {
        let before = self.sums.ncols();
        self.add(list, &[], 0.0)?;
        (self.sums.ncols() == before + list.len()).then_some(())
    }

    /// Add the smallest distance from the preferred velocities, with their derivative.
    fn finish(mut self, preferred: Option<(&[f64], &Slopes)>) -> Option<Slopes> {
        let n = self.x.len();
        let away = preferred.map_or_else(|| self.x.clone(), |(preferred, _)| &self.x - DVector::from_column_slice(preferred));
        let (forces, open) = (self.multipliers(&away)?, &self.free * self.free.transpose());
        for (i, force) in forces.iter().enumerate().filter(|(_, force)| **force != 0.0) {
            let mut own = self.slopes.by_row.columns_mut(i * n, n);
            own -= &open * *force;
        }
        if let Some((_, preferred)) = preferred {
            self.slopes.by_bound += &open * &preferred.by_bound;
            self.slopes.by_row += &open * &preferred.by_row;
        }
        Some(self.slopes)
    }
}

impl Inequalities {
    /// The last solution in the coordinates of the metric.
    pub fn coordinates(&self) -> &[f64] {
        &self.x[self.rows.offset..]
    }

    /// The sign of the bound that may act in a row of the last solution, or zero. It is 1 for the upper bound, and -1 for a task.
    pub fn acting_side(&self, i: usize) -> i8 {
        if self.rows.is_task(i) { -1 } else { self.side[i] }
    }

    /// Return the derivative of the last solution with these settings. The result is `None` if it has none: at the limit of changes, near a
    /// singularity, or with scaled commands.
    pub fn slopes(&self, settings: &Settings) -> Option<Slopes> {
        if self.scaling.is_some() || !self.complete {
            return None;
        }
        let least = |level: usize| if self.damping.is_some() && level > settings.limit_levels { self.rows.eps[level] } else { 0.0 };
        let tasks = |level: usize| self.rows.levels[level].clone().filter(|i| self.rows.is_task(*i));
        let chain = |x| Chain::new(&self.rows, x);
        let mut own = chain(&self.x);
        for level in 0..self.rows.levels.len() {
            let set = &self.last[level];
            let held: Vec<usize> = set.held.iter().map(|(i, _)| *i).collect();
            // A clamped level has the step without a clamp only where its singular values are zero and no bound is active.
            if set.damps && (settings.method == PriorityMethod::Damped || !held.is_empty() || !set.violated.is_empty()) {
                return None;
            }
            own.hold(&held)?;
            let bounds = set.violated.iter().map(|&(i, side)| (i, if side > 0 { self.rows.upper[i] } else { self.rows.lower[i] }));
            let pulled: Vec<(usize, f64)> = tasks(level).map(|i| (i, self.rows.lower[i])).chain(bounds).collect();
            let w: Vec<f64> = pulled.iter().map(|&(i, bound)| dot(self.rows.row(i), &self.x) - bound).collect();
            own.add(&pulled.iter().map(|(i, _)| *i).collect::<Vec<_>>(), &w, least(level))?;
        }
        let preferred = match self.damping.as_ref().filter(|_| self.touched).and_then(|damping| damping.preferred()) {
            None => None,
            Some(x) => {
                let mut free = chain(x);
                for level in 1..self.rows.levels.len() {
                    let list: Vec<usize> = tasks(level).collect();
                    let w: Vec<f64> = list.iter().map(|&i| dot(self.rows.row(i), x) - self.rows.lower[i]).collect();
                    free.add(&list, &w, least(level))?;
                }
                Some((x, free.finish(None)?))
            }
        };
        if self.touched {
            let held: Vec<usize> = self.last[2 * self.rows.levels.len() - 1].held.iter().map(|(i, _)| *i).collect();
            own.hold(&held)?;
        }
        let mut slopes = own.finish(preferred.as_ref().map(|(x, slopes)| (*x, slopes)))?;
        let n = self.x.len();
        for (level, own) in self.rows.levels.iter().enumerate() {
            let factor = self.rows.unscaled(level, 1.0, -1);
            for i in own.clone() {
                slopes.by_bound.column_mut(i).scale_mut(factor);
                slopes.by_row.columns_mut(i * n, n).scale_mut(factor);
            }
        }
        Some(slopes)
    }
}
