//! A motion sampled at the times `start + k dt`, its knots. It is exact at the knots, and constant before the first and after the last
//! knot.
//!
//! Between two knots, the motion is the quintic polynomial in `x = (t - t_k)/dt` with the values `q, v, a` at both ends.

use crate::error::{Error, Result, finite, positive};
use crate::interrupt;
use crate::memory;
use crate::scalar::Real;
use std::sync::Arc;

/// Number of knots that are read between two checks for an interrupt.
const CHECK_INTERVAL: usize = 1 << 10;
/// The largest distance from a knot, in intervals, at which a time counts as this knot.
const ON_KNOT: f64 = 1e-9;

/// The side of a knot on which a table is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Before,
    After,
    /// The side of the first and of the last knot on which the motion moves. At other knots, the side after the knot.
    Moving,
}

/// The part of a table that contains a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Piece {
    /// The constant position before the first knot.
    First,
    /// The polynomial between knot `k` and the next knot.
    Between(usize),
    /// The constant position after the last knot.
    Last,
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

    /// Write `[q_d, v_d, a_d]` at time `t`, s, to `out`, `(3 n,)`.
    pub fn sample<S: Real>(&self, t: f64, out: &mut [S]) {
        let u = (t - self.start) * self.rate;
        let last = self.knots - 1;
        // A cast saturates, so NaN, negative and huge times give the index of a knot, never one out of bounds.
        let k = ((u + 0.5) as usize).min(last);
        let off = u - k as f64;
        if off.abs() < ON_KNOT {
            let row = self.row(k);
            for i in 0..3 * self.dof {
                out[i] = S::splat(row[i]);
            }
            return;
        }
        self.write_piece(self.piece(u), u, out);
    }

    /// Write the motion at time `t`, s, like [`Table::sample`], but on the piece on which the table `base` is at this time. If `base` is at a
    /// knot, `side` selects the piece. So the result is a smooth function of the numbers of this table.
    pub(super) fn sample_with(&self, base: &Table, t: f64, side: Side, out: &mut [f64]) {
        let (u, last) = ((t - base.start) * base.rate, base.knots - 1);
        let k = ((u + 0.5) as usize).min(last);
        let piece = match side {
            _ if (u - k as f64).abs() >= ON_KNOT => base.piece(u),
            Side::Before if k == 0 => Piece::First,
            Side::After if k == last => Piece::Last,
            Side::Before => Piece::Between(k - 1),
            Side::After => Piece::Between(k),
            Side::Moving if last == 0 => Piece::First,
            Side::Moving => Piece::Between(k.min(last - 1)),
        };
        self.write_piece(piece, (t - self.start) * self.rate, out);
    }

    /// The times of the first and the last knot, s, if velocity or acceleration jump there.
    pub(super) fn jumps(&self) -> Vec<f64> {
        let moves = |k: usize| self.row(k)[self.dof..].iter().any(|&rate| rate != 0.0);
        let last = self.knots - 1;
        [0, last].into_iter().filter(|&k| moves(k)).map(|k| self.start + k as f64 * self.dt).collect()
    }

    /// The piece at `u` intervals after the first knot.
    fn piece(&self, u: f64) -> Piece {
        let last = self.knots - 1;
        match u {
            _ if u > 0.0 && u < last as f64 => Piece::Between(u as usize),
            _ if u > 0.0 => Piece::Last,
            _ => Piece::First,
        }
    }

    #[inline(never)]
    fn write_piece<S: Real>(&self, piece: Piece, u: f64, out: &mut [S]) {
        let n = self.dof;
        let k = match piece {
            Piece::Between(k) => k,
            Piece::First | Piece::Last => {
                let row = self.row(if piece == Piece::Last { self.knots - 1 } else { 0 });
                for i in 0..n {
                    (out[i], out[n + i], out[2 * n + i]) = (S::splat(row[i]), S::zero(), S::zero());
                }
                return;
            }
        };
        let (p, r) = (self.row(k), self.row(k + 1));
        let (x, h, rate) = (u - k as f64, self.dt, self.rate);
        for i in 0..n {
            let (c0, c1, c2) = (p[i], h * p[n + i], 0.5 * h * h * p[2 * n + i]);
            // A quadratic polynomial has the values q, v, a of the first knot. `dq`, `dv` and `da` are its errors at the second knot.
            let dq = r[i] - c0 - c1 - c2;
            let dv = h * r[n + i] - c1 - 2.0 * c2;
            let da = h * h * r[2 * n + i] - 2.0 * c2;
            let c3 = 10.0 * dq - 4.0 * dv + 0.5 * da;
            let c4 = -15.0 * dq + 7.0 * dv - da;
            let c5 = 6.0 * dq - 3.0 * dv + 0.5 * da;
            out[i] = S::splat(c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5)))));
            out[n + i] = S::splat(rate * (c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))));
            out[2 * n + i] = S::splat(rate * rate * (2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))));
        }
    }
}
