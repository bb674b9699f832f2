//! Desired motions: functions of time `t -> (q_d, v_d, a_d)`. A motion with a start and an end holds its first position before the start,
//! and its last position after the end.
//!
//! The formula of a motion is written once, for every number type [`Real`](crate::scalar::Real). `f64` computes samples and derivatives, and
//! lanes compute several samples. A recording is printed as C (`law::printed`). Native code selects the piece that contains a time.

mod acceleration;
mod derivatives;
pub(crate) mod path;
pub(crate) mod polynomial;
pub(crate) mod rest_to_rest;
pub(crate) mod rows;
mod sample;
mod sinusoid;
pub(crate) mod spline;
pub(crate) mod table;
pub(crate) mod timed_path;

pub use derivatives::DERIVATIVES;
pub use path::{Ends, Path};
pub use polynomial::TERMS;
pub use rest_to_rest::{BangBang, Quintic};
pub use sample::MotionSample;
pub use sinusoid::Sinusoid;
pub use spline::Spline;
pub(crate) use table::Side;
pub use table::Table;
pub use timed_path::TimedPath;

use crate::error::{Error, Result, finite};
use nalgebra::DVector;
use std::sync::Arc;

/// A desired motion of `n` joints. It is an enum, so that loops require neither virtual calls nor a copy of their code per motion.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// A constant position `q_d`, `(n,)`, rad or m.
    Hold(Vec<f64>),
    /// A sum of sinusoids per joint.
    Sinusoid(Sinusoid),
    /// A quintic polynomial from rest to rest.
    Quintic(Quintic),
    /// A constant acceleration, then an equal deceleration, from rest to rest.
    BangBang(BangBang),
    /// Samples at equal time intervals.
    Table(Table),
    /// Knots at their own times.
    Spline(Spline),
    /// A path with a timing.
    TimedPath(TimedPath),
    /// The acceleration of another motion ([`Motion::acceleration_of`]).
    Acceleration(Arc<Motion>),
}

impl Motion {
    /// Create a motion that rests at `q`, `(n,)`, rad or m. Errors: `Input` for an empty `q`, or numbers that are not finite.
    pub fn hold(q: impl Into<DVector<f64>>) -> Result<Self> {
        let q = Vec::from(q.into().data);
        finite("q", &q)?;
        if q.is_empty() {
            return Err(Error::input("q", "is empty: expected at least one joint, got 0"));
        }
        Ok(Motion::Hold(q))
    }

    /// Whether the position can change with time: the motion is not a `Hold`.
    pub fn moves(&self) -> bool {
        !matches!(self, Motion::Hold(_))
    }

    /// Whether both motions are certainly equal. Motions with many numbers are compared by address.
    pub fn is_same(&self, other: &Motion) -> bool {
        match (self, other) {
            (Motion::Table(a), Motion::Table(b)) => a.is_same(b),
            (Motion::Spline(a), Motion::Spline(b)) => a.is_same(b),
            (Motion::TimedPath(a), Motion::TimedPath(b)) => a.is_same(b),
            (Motion::Acceleration(a), Motion::Acceleration(b)) => a.is_same(b),
            _ => std::ptr::eq(self, other) || self == other,
        }
    }

    /// The name of the motion's class.
    pub fn name(&self) -> &'static str {
        match self {
            Motion::Hold(_) => "Hold",
            Motion::Sinusoid(_) => "Sinusoid",
            Motion::Quintic(_) => "Quintic",
            Motion::BangBang(_) => "BangBang",
            Motion::Table(_) => "Table",
            Motion::Spline(_) => "Spline",
            Motion::TimedPath(_) => "TimedPath",
            Motion::Acceleration(_) => "an acceleration",
        }
    }

    /// Approximate number of `f64` values that the motion stores.
    pub fn numbers(&self) -> usize {
        match self {
            Motion::Table(table) => table.numbers(),
            Motion::Spline(spline) => spline.numbers(),
            Motion::TimedPath(path) => path.numbers(),
            Motion::Acceleration(of) => of.numbers(),
            Motion::Sinusoid(m) => 10 * (m.dof() + m.terms()),
            Motion::Hold(_) | Motion::Quintic(_) | Motion::BangBang(_) => 10 * self.dof(),
        }
    }

    /// Number of joints `n`.
    pub fn dof(&self) -> usize {
        match self {
            Motion::Hold(q) => q.len(),
            Motion::Sinusoid(m) => m.dof(),
            Motion::Quintic(m) => m.dof(),
            Motion::BangBang(m) => m.dof(),
            Motion::Table(m) => m.dof(),
            Motion::Spline(m) => m.dof(),
            Motion::TimedPath(m) => m.dof(),
            Motion::Acceleration(of) => of.dof(),
        }
    }

    /// Compute the position and its first `K - 1` derivatives with respect to time at time `t`, s. Write those of order `FROM` and higher to
    /// `out`, `(K - FROM, n)`.
    #[inline(always)]
    fn evaluate<const K: usize, const FROM: usize>(&self, t: f64, out: &mut [f64]) {
        match self {
            Motion::Hold(q) => rows::hold::<_, K, FROM>(q, out),
            Motion::Sinusoid(m) => m.evaluate::<_, K, FROM>(t, out),
            Motion::Quintic(m) => m.evaluate::<K, FROM>(t, out),
            Motion::BangBang(m) => m.evaluate::<K, FROM>(t, out),
            Motion::Table(m) => m.evaluate::<K, FROM>(t, out),
            Motion::Spline(m) => m.evaluate::<K, FROM>(t, out),
            Motion::TimedPath(m) => m.evaluate::<K, FROM>(t, out),
            Motion::Acceleration(of) => of.write_acceleration(t, out),
        }
    }

    /// Write `[q_d, v_d, a_d]` at time `t`, s, to `out`, `(3 n,)`.
    pub fn sample(&self, t: f64, out: &mut [f64]) {
        self.evaluate::<3, 0>(t, out);
    }

    /// Write `[q_d, v_d, a_d]` at each of `times`, s, to one row of `out`, with the same bits as [`Motion::sample`]. Rows of `out` are
    /// `stride` numbers apart.
    pub fn sample_each(&self, times: &[f64], stride: usize, out: &mut [f64]) {
        let rows = times.iter().zip(out.chunks_mut(stride));
        match self {
            Motion::Sinusoid(m) => m.sample_each(times, stride, out),
            Motion::Quintic(m) => rows.for_each(|(&t, row)| m.evaluate::<3, 0>(t, row)),
            Motion::BangBang(m) => rows.for_each(|(&t, row)| m.evaluate::<3, 0>(t, row)),
            Motion::Table(m) => rows.for_each(|(&t, row)| m.evaluate::<3, 0>(t, row)),
            Motion::Hold(_) | Motion::Spline(_) | Motion::TimedPath(_) | Motion::Acceleration(_) => {
                rows.for_each(|(&t, row)| self.sample(t, row))
            }
        }
    }

    /// Write `[q_d, v_d, a_d]` at time `t`, s, to `out`, as a smooth function of the numbers of the motion near those of `base`. A table or
    /// spline uses the polynomial that `base` uses at this time. If this time is a knot, `side` selects the polynomial.
    pub(crate) fn sample_with(&self, base: &Motion, t: f64, side: Side, out: &mut [f64]) {
        match (self, base) {
            (Motion::Table(table), Motion::Table(base)) => table.evaluate_with::<3, 0>(base, t, side, out),
            (Motion::Spline(spline), Motion::Spline(base)) => spline.evaluate_with::<3, 0>(base, t, side, out),
            (Motion::Acceleration(of), Motion::Acceleration(base)) => of.write_acceleration_with(base, t, out),
            _ => self.sample(t, out),
        }
    }

    /// Times, s, at which the velocity or the acceleration jumps. They increase. At a jump of a table, integrators do not restart.
    pub(crate) fn jumps(&self) -> Vec<f64> {
        match self {
            Motion::Table(table) => table.jumps(),
            Motion::Acceleration(of) => of.jerk_jumps(),
            _ => self.breaks(),
        }
    }

    /// Times, s, at which a derivative of the motion jumps, so that integrators restart. They increase. Constant positions, sinusoids and
    /// tables have none.
    pub fn breaks(&self) -> Vec<f64> {
        match self {
            Motion::Hold(_) | Motion::Sinusoid(_) | Motion::Table(_) => Vec::new(),
            Motion::Quintic(m) => m.breaks(),
            Motion::BangBang(m) => m.breaks(),
            Motion::Spline(m) => m.breaks(),
            Motion::TimedPath(m) => m.breaks(),
            Motion::Acceleration(of) => of.breaks(),
        }
    }
}

/// Write the desired position, velocity and acceleration of each motion at time `t`, s, to `out`, one motion after another.
pub fn sample_all<'a>(motions: impl IntoIterator<Item = &'a Motion>, t: f64, out: &mut [f64]) {
    let mut at = 0;
    for motion in motions {
        let width = 3 * motion.dof();
        motion.sample(t, &mut out[at..at + width]);
        at += width;
    }
}

#[cfg(test)]
mod tests;
