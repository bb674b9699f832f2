//! Stacks with bounds whose solution meets none of them. Their solution is that of `regular` for the tasks alone, and needs no search. It is
//! valid if every partial solution, of levels 1 to `i`, is strictly within the bounds of the levels above. Then no level with bounds has a
//! violation or an active row. Zero velocity, the first partial solution, counts too.
//!
//! The certificate is checked as in `inequality`, so that every solution of a stack with bounds has one. `sns` has none.

use super::lq::product;
use super::regular::Regular;
use super::{BranchFree, Parameters};
use crate::priority::settings::Settings;
use crate::scalar::Real;

/// A solution with a larger certificate is left to the search, which repeats a step with a larger residual.
const CERTIFIED: f64 = 1e-12;

/// The algorithm `regular` for the tasks of a stack, with a check of the bounds of levels. Without bounds, it is `regular` itself.
#[derive(Debug, Clone)]
pub struct WithinBounds<S> {
    n: usize,
    /// The number of rows of each level.
    rows: Vec<usize>,
    /// Whether each level has bounds. Empty if none has.
    intervals: Vec<bool>,
    /// The tasks. Levels with bounds have no rows.
    tasks: Regular<S>,
    /// The stack of the tasks.
    jacobian: Vec<S>,
    command: Vec<S>,
    /// The residuals of all levels, which are NaN for levels with bounds.
    residual: Vec<S>,
    /// The certificate, if the solution has one.
    certificate: Vec<S>,
}

impl<S: Real> WithinBounds<S> {
    /// Set the bounds of the joint velocities, shape `(n,)` each, rad/s or m/s.
    pub fn set_bounds(&mut self, v_min: &[f64], v_max: &[f64]) {
        self.tasks.set_bounds(v_min, v_max);
    }

    /// Whether level `i` has bounds in place of a task velocity.
    fn is_interval(&self, i: usize) -> bool {
        self.intervals.get(i).is_some_and(|interval| *interval)
    }

    /// Copy the tasks of the stack.
    fn load_tasks(&mut self, jacobian: &[S], command: &[S]) {
        let (n, mut from, mut to) = (self.n, 0, 0);
        for i in 0..self.rows.len() {
            let m = self.rows[i];
            if !self.is_interval(i) {
                self.jacobian[to * n..(to + m) * n].copy_from_slice(&jacobian[from * n..(from + m) * n]);
                self.command[to..to + m].copy_from_slice(&command[from..from + m]);
                to += m;
            }
            from += m;
        }
    }

    /// Return `valid`, or zero if a partial solution is not strictly within the bounds of the levels above.
    fn validity_of_levels(&mut self, mut valid: S, jacobian: &[S], lower: &[S], upper: &[S]) -> S {
        let (n, zero, mut used) = (self.n, S::zero(), 0);
        for i in 0..self.rows.len() {
            if !self.is_interval(i) {
                used = n.min(used + self.rows[i]);
            }
            let v = self.tasks.velocity_of_first(used);
            let mut at = 0;
            // A level with bounds checks the solution of the levels above it, and each task checks the bounds above it.
            for (k, m) in self.rows[..=i].iter().enumerate() {
                let checks = self.intervals[k] && (k == i || !self.intervals[i]);
                for r in (at..at + m).filter(|_| checks) {
                    let value = product(&jacobian[r * n..(r + 1) * n], v);
                    valid = S::select(lower[r].lt(value), S::select(value.lt(upper[r]), valid, zero), zero);
                }
                at += m;
            }
        }
        self.tasks.velocity_of_first(n);
        valid
    }

    /// Write the residuals of all levels.
    fn write_residuals(&mut self) {
        let (mut at, mut from) = (0, 0);
        for i in 0..self.rows.len() {
            let level = at..at + self.rows[i];
            if self.is_interval(i) {
                self.residual[level.clone()].fill(S::splat(f64::NAN));
            } else {
                self.residual[level.clone()].copy_from_slice(&self.tasks.residual[from..from + level.len()]);
                from += level.len();
            }
            at = level.end;
        }
    }
}

impl<S: Real> BranchFree<S> for WithinBounds<S> {
    fn new(n: usize, rows: &[usize], settings: &Settings) -> Self {
        let task = |(i, m): (usize, &usize)| if settings.intervals.get(i) == Some(&true) { 0 } else { *m };
        let task_rows: Vec<usize> = rows.iter().enumerate().map(task).collect();
        let (zeros, total) = (|k: usize| vec![S::zero(); k], task_rows.iter().sum::<usize>());
        let copied = if settings.intervals.is_empty() { 0 } else { total };
        WithinBounds {
            n,
            rows: rows.to_vec(),
            intervals: settings.intervals.clone(),
            tasks: Regular::new(n, &task_rows, settings),
            jacobian: zeros(copied * n),
            command: zeros(copied),
            residual: if settings.intervals.is_empty() { Vec::new() } else { zeros(rows.iter().sum()) },
            certificate: zeros(usize::from(settings.certifies())),
        }
    }

    fn operations(n: usize, rows: &[usize]) -> usize {
        Regular::<S>::operations(n, rows)
    }

    fn solve(&mut self, rounding: S, jacobian: &[S], command: &[S], upper: &[S]) -> S {
        let mut valid = if self.intervals.is_empty() {
            self.tasks.solve(rounding, jacobian, command)
        } else {
            self.load_tasks(jacobian, command);
            let valid = self.tasks.solve(rounding, &self.jacobian, &self.command);
            self.write_residuals();
            self.validity_of_levels(valid, jacobian, command, upper)
        };
        if !self.certificate.is_empty() {
            let tasks = if self.intervals.is_empty() { jacobian } else { &self.jacobian };
            let certificate = self.tasks.stationarity(tasks);
            valid = S::select(certificate.lt(S::splat(CERTIFIED)), valid, S::zero());
            self.certificate[0] = certificate;
        }
        valid
    }

    fn results(&self) -> [&[S]; 5] {
        let residual = if self.intervals.is_empty() { &self.tasks.residual } else { &self.residual };
        [&self.tasks.v, residual, &[], &[], &self.certificate]
    }

    fn parameters(&mut self) -> &mut Parameters<S> {
        self.tasks.own_parameters()
    }
}
