//! The levels `J_i v = v_i` of a solve, stacked. `Stack` has the numbers of the caller. `ScaledStack` has them in the coordinates of the
//! metric and with moderate magnitude, for the algorithms with singular values.

use super::method::{DEFAULT_EPS, TAME};
use super::settings::Settings;
use crate::error::{Error, Result, finite};
use crate::linalg::{dot, largest};
use std::ops::Range;

/// The Jacobians and task velocities of all levels, the highest priority first.
#[derive(Debug, Clone)]
pub(super) struct Stack {
    /// The number of joints.
    pub n: usize,
    /// The number of rows of each level.
    pub rows: Vec<usize>,
    /// The Jacobians `J_i`, shape `(sum rows, n)`, row-major.
    pub jacobian: Vec<f64>,
    /// The task velocities `v_i`, shape `(sum rows,)`.
    pub command: Vec<f64>,
    /// The upper bounds of the levels with bounds, whose lower bounds are in `command`, shape `(sum rows,)`. Empty without such levels.
    pub upper: Vec<f64>,
    /// For each level, whether it has bounds in place of a task velocity. Empty without such levels.
    pub intervals: Vec<bool>,
}

impl Stack {
    /// Allocate a stack for `n` joints and these numbers of rows.
    pub fn new(n: usize, rows: &[usize]) -> Self {
        let total: usize = rows.iter().sum();
        Stack {
            n,
            rows: rows.to_vec(),
            jacobian: vec![0.0; total * n],
            command: vec![0.0; total],
            upper: Vec::new(),
            intervals: Vec::new(),
        }
    }

    /// Allocate a stack in which some levels have bounds.
    pub fn with_intervals(n: usize, rows: &[usize], intervals: &[bool]) -> Self {
        let mut stack = Stack::new(n, rows);
        if intervals.contains(&true) {
            stack.upper = vec![0.0; stack.command.len()];
            stack.intervals = intervals.to_vec();
        }
        stack
    }

    /// Whether level `i` has bounds in place of a task velocity.
    pub fn is_interval(&self, i: usize) -> bool {
        self.intervals.get(i).is_some_and(|interval| *interval)
    }

    /// Copy the tasks of another stack. Rows with bounds become rows of zeros.
    pub fn load_tasks(&mut self, given: &Stack) {
        let n = self.n;
        self.jacobian.copy_from_slice(&given.jacobian);
        self.command.copy_from_slice(&given.command);
        for (level, rows) in level_ranges(&given.rows).enumerate() {
            for i in rows.filter(|i| given.is_interval(level) && given.upper[*i] != given.command[*i]) {
                self.jacobian[i * n..(i + 1) * n].fill(0.0);
                self.command[i] = 0.0;
            }
        }
    }

    /// Check the sizes, and copy one Jacobian and one task velocity per level. Errors: `WrongShape` for wrong sizes.
    pub fn load(&mut self, jacobians: &[&[f64]], velocities: &[&[f64]]) -> Result<()> {
        let Stack { n, rows, jacobian, command, .. } = self;
        for (name, got) in [("jacobians", jacobians.len()), ("velocities", velocities.len())] {
            if got != rows.len() {
                return Err(Error::wrong(name, "number of levels", rows.len(), got));
            }
        }
        for (i, level) in level_ranges(rows).enumerate() {
            let (m, entries) = (level.len(), jacobians[i].len());
            if entries != m * *n {
                return Err(Error::wrong(format!("jacobians[{i}]"), "size", format!("({m}, {n})"), format!("{entries} entries")));
            }
            if velocities[i].len() != m {
                return Err(Error::wrong(format!("velocities[{i}]"), "length", m, velocities[i].len()));
            }
            jacobian[level.start * *n..level.end * *n].copy_from_slice(jacobians[i]);
            command[level].copy_from_slice(velocities[i]);
        }
        Ok(())
    }
}

/// The rows of each level in a stack.
pub(super) fn level_ranges(rows: &[usize]) -> impl Iterator<Item = Range<usize>> {
    rows.iter().scan(0, |end, m| {
        *end += m;
        Some(*end - m..*end)
    })
}

/// One level of a [`ScaledStack`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Level<'a> {
    pub n: usize,
    /// The Jacobian `J_i`, shape `(m, n)`, row-major.
    pub jacobian: &'a [f64],
    /// The task velocity `v_i`, shape `(m,)`.
    pub command: &'a [f64],
    /// The threshold on the singular values.
    pub eps: f64,
    /// The numbers of the level are those of the caller, multiplied by `2^exponent`.
    exponent: i32,
    /// Whether no level follows, so that no null space is needed below this level.
    pub is_last: bool,
}

impl<'a> Level<'a> {
    /// A level of rows with moderate magnitude, without a threshold on singular values.
    pub fn of_rows(n: usize, jacobian: &'a [f64], command: &'a [f64]) -> Self {
        Level { n, jacobian, command, eps: 0.0, exponent: 0, is_last: false }
    }

    /// The number of rows `m`.
    pub fn rows(&self) -> usize {
        self.command.len()
    }

    /// The rows of the Jacobian.
    pub fn jacobian_rows(&self) -> impl Iterator<Item = &'a [f64]> {
        self.jacobian.chunks_exact(self.n)
    }

    /// Write the residual `v_i - J_i v` to `residual`.
    pub fn residual(&self, v: &[f64], residual: &mut [f64]) {
        for ((to, row), command) in residual.iter_mut().zip(self.jacobian_rows()).zip(self.command) {
            *to = command - dot(row, v);
        }
    }

    /// Return a number of the level in the unit of the caller.
    pub fn unscaled(&self, x: f64) -> f64 {
        let [f, g] = factors(-self.exponent);
        x * f * g
    }
}

/// A stack in the coordinates of the metric. Levels whose squares would overflow or underflow are scaled by a power of two, which changes
/// no digit.
#[derive(Debug, Clone)]
pub(super) struct ScaledStack {
    stack: Stack,
    eps: Vec<f64>,
    exponents: Vec<i32>,
}

impl ScaledStack {
    /// Allocate memory for a stack of this size.
    pub fn new(given: &Stack) -> Self {
        let levels = given.rows.len();
        ScaledStack { stack: given.clone(), eps: vec![0.0; levels], exponents: vec![0; levels] }
    }

    /// Read `given`. Errors: `Input` for numbers that are not finite.
    pub fn load(&mut self, given: &Stack, settings: &Settings) -> Result<()> {
        let ScaledStack { stack, eps, exponents } = self;
        let n = given.n;
        stack.jacobian.copy_from_slice(&given.jacobian);
        stack.command.copy_from_slice(&given.command);
        if let Some(metric) = &settings.metric {
            stack.jacobian.chunks_exact_mut(n).for_each(|row| metric.row(row));
        }
        for (i, rows) in level_ranges(&given.rows).enumerate() {
            let entries = rows.start * n..rows.end * n;
            let (jacobian, command) = (&mut stack.jacobian[entries.clone()], &mut stack.command[rows]);
            if (largest(jacobian) + largest(command)).is_nan() {
                finite(&format!("jacobians[{i}]"), &given.jacobian[entries])?;
                finite(&format!("velocities[{i}]"), command)?;
                finite(&format!("jacobians[{i}] in the metric of the weight"), jacobian)?;
            }
            exponents[i] = moderating_exponent(jacobian);
            let [f, g] = factors(exponents[i]);
            if exponents[i] != 0 {
                jacobian.iter_mut().chain(command).for_each(|x| *x = *x * f * g);
            }
            eps[i] = match &settings.eps {
                Some(eps) => eps[i] * f * g,
                None => DEFAULT_EPS * jacobian.chunks_exact(n).map(|row| dot(row, row)).fold(0.0, f64::max).sqrt(),
            };
        }
        Ok(())
    }

    /// The levels, the highest priority first.
    pub fn levels(&self) -> impl Iterator<Item = Level<'_>> {
        let ScaledStack { stack: Stack { n, rows, jacobian, command, .. }, eps, exponents } = self;
        let (n, count) = (*n, rows.len());
        level_ranges(rows).enumerate().map(move |(i, rows)| {
            let (jacobian, command) = (&jacobian[rows.start * n..rows.end * n], &command[rows]);
            Level { n, jacobian, command, eps: eps[i], exponent: exponents[i], is_last: i + 1 == count }
        })
    }
}

/// Return the exponent `e` for which the entries of `2^e block` are at most 2. Return zero if squares of the entries do not overflow or
/// underflow.
fn moderating_exponent(block: &[f64]) -> i32 {
    if TAME.contains(&block.iter().map(|x| x * x).sum()) {
        return 0;
    }
    let biggest = block.iter().fold(0.0f64, |biggest, x| biggest.max(x.abs()));
    if biggest > 0.0 { -(biggest.log2().floor() as i32) } else { 0 }
}

/// Return two factors with the product `2^exponent`. A single factor could overflow.
pub(super) fn factors(exponent: i32) -> [f64; 2] {
    if exponent == 0 { [1.0; 2] } else { [exponent / 2, exponent - exponent / 2].map(|e| 2f64.powi(e)) }
}
