//! A motion sampled at the times `start + k dt`, its knots. It is exact at the knots, and constant before the first and after the last
//! knot.
//!
//! Between two knots, the motion is the quintic polynomial in `x = (t - t_k)/dt` with the values `q, v, a` at both ends.

use super::polynomial::{hermite, polynomial, scaled};
use super::rows::{hold, put};
use crate::error::{Error, Result, finite, positive};
use crate::interrupt;
use crate::memory;
use crate::scalar::Real;
use std::sync::Arc;

/// Number of knots that are read between two checks for an interrupt.
const CHECK_INTERVAL: usize = 1 << 10;
/// The largest distance from a knot, in intervals, at which a time counts as this knot.
pub(super) const ON_KNOT: f64 = 1e-9;

/// The side of a knot on which a table is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Before,
    After,
    /// The side of the first and of the last knot on which the motion moves. At other knots, the side after the knot.
    Moving,
}

/// The part of a table or of a spline that contains a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Piece {
    /// The constant position before the first knot.
    First,
    /// The polynomial between knot `k` and the next knot.
    Between(usize),
    /// The constant position after the last knot.
    Last,
}

impl Piece {
    /// The piece on this side of knot `knot`. `last` is the index of the last knot.
    pub(super) fn at_knot(knot: usize, last: usize, side: Side) -> Piece {
        match side {
            Side::Before if knot == 0 => Piece::First,
            Side::Before => Piece::Between(knot - 1),
            Side::After if knot == last => Piece::Last,
            Side::After => Piece::Between(knot),
            Side::Moving if last == 0 => Piece::First,
            Side::Moving => Piece::Between(knot.min(last - 1)),
        }
    }
}

/// A motion sampled at equal intervals.
///
/// ```
/// use armlet_core::motion::{Motion, Table};
///
/// // One joint, two samples a second apart: position, velocity, acceleration.
/// let motion = Motion::from(Table::new(0.0, 1.0, 1, vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0])?);
/// assert_eq!((motion.at(0.5).q[0], motion.at(9.0).q[0]), (0.5, 1.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    start: f64,
    dt: f64,
    rate: f64,
    dof: usize,
    knots: usize,
    /// One row `[q, v, a]` per knot, `(K, 3 n)`. The rows are shared, because every law and loop has a copy of its motion.
    rows: Arc<Vec<f64>>,
}

impl Table {
    pub(super) fn is_same(&self, other: &Table) -> bool {
        Arc::ptr_eq(&self.rows, &other.rows) && (self.start, self.dt) == (other.start, other.dt)
    }

    pub(super) fn numbers(&self) -> usize {
        self.rows.len()
    }

    /// Create a table. `rows` is `(K, 3 n)`, row-major, `K >= 1`: `[q, v, a]` per knot. `start` and `dt` are in s.
    ///
    /// Errors: `Input` for numbers that are not finite, a `dt` that is not positive, or `rows` that are empty or incomplete.
    pub fn new(start: f64, dt: f64, dof: usize, rows: Vec<f64>) -> Result<Self> {
        positive("dt", dt)?;
        finite("start", &[start])?;
        finite("q, v, a", &rows)?;
        if dof == 0 || rows.is_empty() || !rows.len().is_multiple_of(3 * dof) {
            return Err(Error::input("q", "is empty: expected at least one knot and one joint"));
        }
        Ok(Table { start, dt, rate: 1.0 / dt, dof, knots: rows.len() / (3 * dof), rows: rows.into() })
    }

    /// Create a table from the columns `q, v, a`, `(K, n)` each. `start` and `dt` are in s.
    ///
    /// Errors: as for [`Table::new`]; also `WrongShape` for unequal lengths, and `Memory`.
    pub fn of_columns(start: f64, dt: f64, dof: usize, columns: [&[f64]; 3]) -> Result<Self> {
        for (name, column) in ["q", "v", "a"].into_iter().zip(columns) {
            finite(name, column)?;
            if column.len() != columns[0].len() {
                return Err(Error::wrong(name, "size", columns[0].len(), column.len()));
            }
        }
        positive("dt", dt)?;
        finite("start", &[start])?;
        if dof == 0 || columns[0].is_empty() || !columns[0].len().is_multiple_of(dof) {
            return Err(Error::input("q", "is empty: expected at least one knot and one joint"));
        }
        let knots = columns[0].len() / dof;
        let (mut knot, mut at) = (0, 0);
        let mut next = |_| {
            let x = columns[at / dof][knot * dof + at % dof];
            at += 1;
            if at == 3 * dof {
                (knot, at) = (knot + 1, 0);
                if knot % CHECK_INTERVAL == 0 {
                    interrupt::check();
                }
            }
            x
        };
        Ok(Table { start, dt, rate: 1.0 / dt, dof, knots, rows: memory::collected((0..3 * dof * knots).map(&mut next))?.into() })
    }

    /// Number of joints `n`.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// Time of the first sample, s.
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Time between samples, s.
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// One row `[q, v, a]` per sample, `(K, 3 n)`, row-major.
    pub fn rows(&self) -> &[f64] {
        &self.rows
    }

    fn row(&self, k: usize) -> &[f64] {
        &self.rows[3 * self.dof * k..3 * self.dof * (k + 1)]
    }

    /// The index in `rows` at which the values at the first of `times` begin. `None` if `times` are not consecutive knots.
    pub fn along(&self, times: &[f64]) -> Option<usize> {
        let at = |t: f64| (t - self.start) * self.rate;
        let first = at(*times.first()?).round();
        // For NaN, the comparison with `ON_KNOT` is false. So the times are not knots.
        let on = times.iter().enumerate().fold(true, |on, (k, &t)| on & ((at(t) - (first + k as f64)).abs() < ON_KNOT));
        let inside = first >= 0.0 && first + times.len() as f64 <= self.knots as f64;
        (on && inside).then(|| 3 * self.dof * first as usize)
    }

    /// Write the position and its derivatives at time `t`, s, to `out`, as [`put`] does. At a knot, derivatives of the third and
    /// higher orders are those after the knot. At the last knot they are those before it.
    #[inline]
    pub(crate) fn evaluate<const K: usize, const FROM: usize>(&self, t: f64, out: &mut [f64]) {
        let u = (t - self.start) * self.rate;
        let knot = self.knot(u);
        if K > 3 || knot.is_none() {
            self.on_piece::<K, FROM>(self.piece(u, knot, Side::Moving), u, out);
        }
        if let Some(k) = knot {
            let exact = &self.row(k)[FROM * self.dof..K.min(3) * self.dof];
            out[..exact.len()].copy_from_slice(exact);
        }
    }

    /// Write the position and its derivatives at time `t`, s, to `out`, as [`put`] does. The piece is that of the table `base` at this
    /// time. If `base` is at a knot, `side` selects the piece. So the result is a smooth function of the numbers of this table.
    pub(super) fn evaluate_with<const K: usize, const FROM: usize>(&self, base: &Table, t: f64, side: Side, out: &mut [f64]) {
        let u = (t - base.start) * base.rate;
        self.on_piece::<K, FROM>(base.piece(u, base.knot(u), side), (t - self.start) * self.rate, out);
    }

    /// The times of the first and the last knot, s, if velocity or acceleration jump there.
    pub(super) fn jumps(&self) -> Vec<f64> {
        let moves = |k: usize| self.row(k)[self.dof..].iter().any(|&rate| rate != 0.0);
        let last = self.knots - 1;
        [0, last].into_iter().filter(|&k| moves(k)).map(|k| self.start + k as f64 * self.dt).collect()
    }

    /// The times of the knots, s.
    pub(super) fn knot_times(&self) -> Vec<f64> {
        (0..self.knots).map(|k| self.start + k as f64 * self.dt).collect()
    }

    /// The knot at `u` intervals after the first knot, if there is one.
    #[inline]
    fn knot(&self, u: f64) -> Option<usize> {
        // A cast saturates, so NaN, negative and huge times give the index of a knot, never one out of bounds.
        let k = ((u + 0.5) as usize).min(self.knots - 1);
        ((u - k as f64).abs() < ON_KNOT).then_some(k)
    }

    /// The piece at `u` intervals after the first knot. If there is a `knot`, `side` selects the piece.
    #[inline]
    fn piece(&self, u: f64, knot: Option<usize>, side: Side) -> Piece {
        let last = self.knots - 1;
        match knot {
            Some(k) => Piece::at_knot(k, last, side),
            None if u > 0.0 && u < last as f64 => Piece::Between(u as usize),
            None if u > 0.0 => Piece::Last,
            None => Piece::First,
        }
    }

    /// Write the position and its derivatives at `u` intervals after the first knot to `out`, as [`put`] does, with the formula of `piece`.
    #[inline(never)]
    fn on_piece<const K: usize, const FROM: usize>(&self, piece: Piece, u: f64, out: &mut [f64]) {
        match piece {
            Piece::Between(k) => between::<_, K, FROM>(self.dof, u - k as f64, [self.row(k), self.row(k + 1)], [self.dt, self.rate], out),
            Piece::First => hold::<_, K, FROM>(&self.row(0)[..self.dof], out),
            Piece::Last => hold::<_, K, FROM>(&self.row(self.knots - 1)[..self.dof], out),
        }
    }
}

/// Write the position of `n` joints and its derivatives to `out`, as [`put`] does. The polynomial in `x` has the rows `[q, v, a]` at its
/// ends. The interval of the polynomial takes `h` seconds, and `rate` is `1 / h`.
#[inline(always)]
pub(crate) fn between<S: Real, const K: usize, const FROM: usize>(n: usize, x: S, [p, r]: [&[S]; 2], [h, rate]: [f64; 2], out: &mut [S]) {
    for i in 0..n {
        let (start, end) = ([p[i], p[n + i], p[2 * n + i]], [r[i], r[n + i], r[2 * n + i]]);
        put::<_, K, FROM>(n, out, i, scaled(polynomial(hermite(start, end, S::splat(h)), x), S::splat(rate)));
    }
}
