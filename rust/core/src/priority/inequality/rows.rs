//! The rows `l <= a x <= u` of a solve, level by level. Level 0 bounds the joint velocities. `x` are joint velocities in the coordinates of
//! the metric. The rows of a level are multiplied by a power of two, so that the longest has a norm of about one.
//!
//! If commands are scaled (`scale`), entry 0 of every row belongs to the length `t` of the present level, and the last row bounds `t`.

use super::columns::Columns;
use crate::error::{Error, Result, finite};
use crate::linalg::{dot, largest};
use crate::priority::method::DEFAULT_EPS;
use crate::priority::settings::Settings;
use crate::priority::stack::{Stack, factors, level_ranges};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

#[derive(Debug, Clone)]
pub struct Rows {
    /// The rows `a`, one per column, shape `(offset + n, rows)`. The rows of level 0 come first.
    a: DMatrix<f64>,
    /// The same rows, coordinate by coordinate.
    pub columns: Columns,
    /// The bounds `l` and `u`. Both are the command for a row of a task.
    pub lower: DVector<f64>,
    pub upper: DVector<f64>,
    /// The norm of each row, then of the penalty rows.
    pub size: DVector<f64>,
    /// The rows of each level. Level 0 is empty without bounds of the joint velocities.
    pub levels: Vec<Range<usize>>,
    /// The threshold on singular values, and the Frobenius norm, of each level.
    pub eps: DVector<f64>,
    pub frobenius: DVector<f64>,
    /// The number of entries of a row before those of the joints: 1 if commands are scaled, otherwise 0.
    pub offset: usize,
    /// The rows of a level are those of the caller, multiplied by this power of two.
    exponents: Vec<i32>,
}

impl Rows {
    /// Allocate memory for a stack, with bounds of the joint velocities if `limited`, and with scaled commands if `scaled`.
    pub fn new(stack: &Stack, limited: bool, scaled: bool) -> Self {
        let (first, offset) = (if limited { stack.n } else { 0 }, usize::from(scaled));
        let levels: Vec<_> = std::iter::once(0..first).chain(level_ranges(&stack.rows).map(|r| r.start + first..r.end + first)).collect();
        let (rows, count) = (first + stack.command.len() + offset, levels.len());
        let zeros = |size| DVector::zeros(size);
        Rows {
            a: DMatrix::zeros(offset + stack.n, rows),
            columns: Columns::new(offset + stack.n, rows),
            lower: zeros(rows),
            upper: zeros(rows),
            size: zeros(rows + stack.n),
            eps: zeros(count),
            frobenius: zeros(count),
            exponents: vec![0; count],
            offset,
            levels,
        }
    }

    /// The number of rows of all levels, with the row that bounds `t`.
    pub fn len(&self) -> usize {
        self.a.ncols()
    }

    /// Row `i`, shape `(offset + n,)`.
    pub fn row(&self, i: usize) -> &[f64] {
        let n = self.a.nrows();
        &self.a.as_slice()[i * n..(i + 1) * n]
    }

    /// Set the entry of row `i` that belongs to the length `t`.
    pub fn set_length_entry(&mut self, i: usize, entry: f64) {
        (self.a[(0, i)], self.columns[(0, i)]) = (entry, entry);
    }

    /// Whether row `i` is a task, `l = u`.
    pub fn is_task(&self, i: usize) -> bool {
        self.lower[i] == self.upper[i]
    }

    /// Read a stack. Errors: `Input` for numbers that are not finite, and for bounds out of order.
    pub fn load(&mut self, given: &Stack, settings: &Settings) -> Result<()> {
        self.load_limits(settings);
        let (n, width) = (given.n, self.a.nrows());
        if self.offset > 0 {
            let last = self.len() - 1;
            self.a.column_mut(last).fill(0.0);
            (self.a[(0, last)], self.size[last]) = (1.0, 1.0);
        }
        for (i, rows) in level_ranges(&given.rows).enumerate() {
            let (level, entries) = (self.levels[i + 1].clone(), rows.start * n..rows.end * n);
            let jacobian = &mut self.a.as_mut_slice()[level.start * width..level.end * width];
            for (row, given) in jacobian.chunks_exact_mut(width).zip(given.jacobian[entries.clone()].chunks_exact(n)) {
                let (length, row) = row.split_at_mut(width - n);
                length.fill(0.0);
                row.copy_from_slice(given);
                settings.metric.iter().for_each(|metric| metric.row(row));
            }
            let biggest = largest(jacobian);
            if !biggest.is_finite() {
                finite(&format!("jacobians[{i}]"), &given.jacobian[entries])?;
                finite(&format!("jacobians[{i}] in the metric of the weight"), jacobian)?;
            }
            self.exponents[i + 1] = if biggest > 0.0 { -(biggest.log2().floor() as i32) } else { 0 };
            let [f, g] = factors(self.exponents[i + 1]);
            jacobian.iter_mut().for_each(|x| *x = *x * f * g);
            let command = &given.command[rows.clone()];
            let (lower, upper) = if given.is_interval(i) { (command, &given.upper[rows]) } else { (command, command) };
            check_bounds(i, lower, upper, given.is_interval(i))?;
            for (at, (l, u)) in level.clone().zip(lower.iter().zip(upper)) {
                (self.lower[at], self.upper[at]) = (l * f * g, u * f * g);
            }
            let longest = self.measure(i + 1);
            self.eps[i + 1] = settings.eps.as_ref().map_or(DEFAULT_EPS * longest, |eps| eps[i] * f * g);
        }
        for (i, row) in self.a.as_slice().chunks_exact(width).enumerate() {
            row.iter().enumerate().for_each(|(j, x)| self.columns[(j, i)] = *x);
        }
        Ok(())
    }

    /// Write the bounds of the joint velocities, in the coordinates of the metric.
    fn load_limits(&mut self, settings: &Settings) {
        let Some((lower, upper)) = settings.bounds.as_ref().filter(|_| !self.levels[0].is_empty()) else { return };
        let (n, offset) = (self.levels[0].len(), self.offset);
        for i in 0..n {
            let mut row = self.a.column_mut(i);
            row.fill(0.0);
            row[offset + i] = 1.0;
            settings.metric.iter().for_each(|metric| metric.row(&mut row.as_mut_slice()[offset..]));
        }
        self.lower.as_mut_slice()[..n].copy_from_slice(lower);
        self.upper.as_mut_slice()[..n].copy_from_slice(upper);
        self.measure(0);
    }

    /// Compute the norms of the rows of a level. Return the largest.
    fn measure(&mut self, level: usize) -> f64 {
        let (mut longest, mut sum) = (0.0f64, 0.0);
        for i in self.levels[level].clone() {
            let square = dot(self.row(i), self.row(i));
            self.size[i] = square.sqrt();
            (longest, sum) = (longest.max(self.size[i]), sum + square);
        }
        self.frobenius[level] = sum.sqrt();
        longest
    }

    /// Return a number of a level in the unit of the caller. The number has the unit of the rows to the power of `power`.
    pub fn unscaled(&self, level: usize, x: f64, power: i32) -> f64 {
        let [f, g] = factors(-self.exponents[level] * power);
        x * f * g
    }
}

/// Refuse a command that is not finite, and bounds that are NaN or out of order.
fn check_bounds(level: usize, lower: &[f64], upper: &[f64], interval: bool) -> Result<()> {
    if !interval {
        return if largest(lower).is_finite() { Ok(()) } else { finite(&format!("velocities[{level}]"), lower) };
    }
    let ordered = |(l, u): (&f64, &f64)| l <= u && *l < f64::INFINITY && *u > f64::NEG_INFINITY;
    match lower.iter().zip(upper).position(|pair| !ordered(pair)) {
        Some(i) => Err(Error::input(
            format!("velocities[{level}]"),
            format!("is out of order: expected lower <= upper in every row, got {} and {}", lower[i], upper[i]),
        )
        .at([i])),
        None => Ok(()),
    }
}
