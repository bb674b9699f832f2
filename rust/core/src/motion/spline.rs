//! A motion through knots at their own times `t_k`: one polynomial in time between two knots. Before the first knot and after the last knot,
//! the position is constant.
//!
//! ```text
//! positions q_k                                cubic spline: q, v and a are continuous between the first and the last knot
//! positions and velocities                     cubic Hermite polynomials: q and v are continuous, a jumps at knots
//! positions, velocities and accelerations      quintic Hermite polynomials: q, v and a are continuous
//! ```
//!
//! The velocity of a spline with clamped ends is continuous at all times, because it is zero at the first and the last knot.

use super::path::{Ends, Path};
use super::rows::{hold, put};
use super::table::{ON_KNOT, Piece, Side};
use crate::error::{Error, Result, finite};
use crate::memory;
use std::sync::Arc;

/// The acceleration jumps at a knot if it changes by more than this fraction of its largest magnitude.
const JUMP: f64 = 0.01;
/// A velocity below this fraction of the largest velocity is a rounding error.
const ROUNDING: f64 = 1e-12;

/// A motion through knots at their own times.
///
/// ```
/// use armlet_core::motion::{Ends, Motion, Spline};
///
/// // One joint, three knots with velocities.
/// let motion = Motion::from(Spline::new(&[0.0, 0.5, 2.0], &[0.0, 1.0, 1.0], Some(&[0.0, 1.0, 0.0]), None, 1, Ends::Clamped)?);
/// assert_eq!((motion.at(0.5).q[0], motion.at(0.5).v[0], motion.at(9.0).q[0]), (1.0, 1.0, 1.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    /// The polynomials, whose path position is the time. They are shared, because every law and loop has a copy of its motion.
    path: Arc<Path>,
    /// Times at which the velocity or the acceleration jumps, s.
    breaks: Arc<Vec<f64>>,
    /// Whether the acceleration is continuous between the first and the last knot.
    smooth: bool,
    /// Whether the velocity at the last knot is zero.
    stops: bool,
}

impl Spline {
    /// Create the motion through `q`, `(K, n)`, at the times `t`, `(K,)`, s, with the velocities `v` and the accelerations `a`, `(K, n)`.
    /// `ends` are the end conditions of the spline through positions alone.
    ///
    /// Errors: `Input` for fewer than two knots, times that do not increase, numbers that are not finite, or `a` without `v`. `WrongShape`
    /// for unequal lengths, and `Memory`.
    pub fn new(t: &[f64], q: &[f64], v: Option<&[f64]>, a: Option<&[f64]>, n: usize, ends: Ends) -> Result<Self> {
        finite("t", t)?;
        if t.len() < 2 || n == 0 {
            return Err(Error::input("t", format!("has too few knots: expected at least two, got {}", t.len())));
        }
        if let Some(k) = t.windows(2).position(|w| !(w[0] < w[1])) {
            let problem = format!("does not increase: expected increasing times, got {} after {}", t[k + 1], t[k]);
            return Err(Error::input("t", problem).at([k + 1]));
        }
        for (name, values) in [("q", Some(q)), ("v", v), ("a", a)] {
            let Some(values) = values else { continue };
            if values.len() != t.len().saturating_mul(n) {
                return Err(Error::wrong(name, "size", t.len().saturating_mul(n), values.len()));
            }
            finite(name, values)?;
        }
        memory::require((t.len() * 8).saturating_mul(12 * n + 4))?;
        let path = match (v, a) {
            (None, Some(_)) => return Err(Error::input("a", "requires v: expected velocities with the accelerations, got None")),
            (None, None) => Path::spline(t, q, n, ends)?,
            (Some(v), None) => Path::cubic(t, q, v, n)?,
            (Some(v), Some(a)) => Path::table(t, q, v, a, n)?,
        };
        finite("q", path.coefficients())?;
        let breaks = breaks(&path).into();
        let stops = v.map_or(ends == Ends::Clamped, |v| v[v.len() - n..].iter().all(|&v| v == 0.0));
        Ok(Spline { path: path.into(), breaks, smooth: v.is_none() || a.is_some(), stops })
    }

    pub(super) fn is_same(&self, other: &Spline) -> bool {
        Arc::ptr_eq(&self.path, &other.path)
    }

    pub(super) fn numbers(&self) -> usize {
        self.path.knots().len() + self.path.coefficients().len()
    }

    /// Number of joints `n`.
    pub fn dof(&self) -> usize {
        self.path.dof()
    }

    /// The polynomials. Their path position is the time, s, and their knots are the times of the knots.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the acceleration is continuous between the first and the last knot.
    pub fn is_smooth(&self) -> bool {
        self.smooth
    }

    /// Whether the velocity at the last knot is zero. Then the motion rests from the last knot on; otherwise, after the last knot.
    pub fn stops(&self) -> bool {
        self.stops
    }

    /// Times at which the velocity or the acceleration jumps, s. These are the first and the last knot if the motion does not rest there.
    /// They also are knots at which the acceleration changes by more than 1 % of its largest magnitude.
    pub fn breaks(&self) -> Vec<f64> {
        self.breaks.to_vec()
    }

    /// Write the position and its derivatives at time `t`, s, to `out`, as [`put`] does. At a knot, derivatives that jump are those after
    /// the knot. At a last knot at which the motion does not stop, they are those before it.
    #[inline(never)]
    pub(crate) fn evaluate<const K: usize, const FROM: usize>(&self, t: f64, out: &mut [f64]) {
        let (knots, (_, end)) = (self.path.knots(), self.path.ends());
        let piece = match t {
            t if !(t >= knots[0]) => Piece::First,
            t if t > knots[knots.len() - 1] || self.stops && t == knots[knots.len() - 1] => Piece::Last,
            t => Piece::Between(self.path.piece(t)),
        };
        self.on_piece::<K, FROM>(piece, t, out);
        if FROM == 0 && t == knots[knots.len() - 1] {
            out[..end.len()].copy_from_slice(end);
        }
    }

    /// Write the position and its derivatives at time `t`, s, to `out`, as [`put`] does. The piece is that of the motion `base` at this
    /// time. If `base` has a knot there, `side` selects the piece. So the result is a smooth function of the numbers of this motion.
    pub(super) fn evaluate_with<const K: usize, const FROM: usize>(&self, base: &Spline, t: f64, side: Side, out: &mut [f64]) {
        self.on_piece::<K, FROM>(base.piece(t, side), t, out);
    }

    /// The piece at time `t`, s. If `t` is a knot, `side` selects the piece.
    fn piece(&self, t: f64, side: Side) -> Piece {
        let (knots, k) = (self.path.knots(), self.path.piece(t));
        let (last, length) = (knots.len() - 1, knots[k + 1] - knots[k]);
        match [k, k + 1].into_iter().find(|&knot| (t - knots[knot]).abs() < ON_KNOT * length) {
            Some(knot) if knot == last && side == Side::Moving && self.stops => Piece::Last,
            Some(knot) => Piece::at_knot(knot, last, side),
            None if t < knots[0] => Piece::First,
            None if t > knots[last] => Piece::Last,
            None => Piece::Between(k),
        }
    }

    fn on_piece<const K: usize, const FROM: usize>(&self, piece: Piece, t: f64, out: &mut [f64]) {
        let (n, (start, end)) = (self.dof(), self.path.ends());
        match piece {
            Piece::First => hold::<_, K, FROM>(start, out),
            Piece::Between(k) => self.path.evaluate(k, t, |j, values| put::<_, K, FROM>(n, out, j, values)),
            Piece::Last => hold::<_, K, FROM>(end, out),
        }
    }
}

/// The knots at which the velocity or the acceleration of the path jumps, if the path rests before and after them.
fn breaks(path: &Path) -> Vec<f64> {
    let (n, knots) = (path.dof(), path.knots());
    // Velocity and acceleration at the start and at the end of a piece.
    let rates = |p: usize, s: f64| {
        let mut rates = vec![[0.0; 2]; n];
        path.evaluate(p, s, |j, [_, v, a]: [f64; 3]| rates[j] = [v, a]);
        rates
    };
    let last = knots.len() - 1;
    let mut largest = vec![[0.0_f64; 2]; n];
    for p in 0..last {
        for s in [knots[p], knots[p + 1]] {
            largest.iter_mut().zip(rates(p, s)).for_each(|(most, [v, a])| *most = [most[0].max(v.abs()), most[1].max(a.abs())]);
        }
    }
    let moves = |p: usize, s: f64| {
        let rates = rates(p, s);
        rates.iter().zip(&largest).any(|([v, a], most)| v.abs() > ROUNDING * most[0] || a.abs() > JUMP * most[1])
    };
    let jumps = |k: usize| {
        let (before, after) = (rates(k - 1, knots[k]), rates(k, knots[k]));
        before.iter().zip(&after).zip(&largest).any(|(([_, b], [_, a]), most)| (a - b).abs() > JUMP * most[1])
    };
    let inner = (1..last).filter(|&k| jumps(k)).map(|k| knots[k]);
    let first = moves(0, knots[0]).then_some(knots[0]);
    first.into_iter().chain(inner).chain(moves(last - 1, knots[last]).then_some(knots[last])).collect()
}
