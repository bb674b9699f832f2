//! A path with a timing: `q(s(t))`, where the path acceleration `u` is linear in `s` between the points of a grid.
//!
//! ```text
//! r = ds/dt,   u = d^2 s/dt^2 = u_0 + b (s - s_i),   r^2 = x_i + 2 u_0 (s - s_i) + b (s - s_i)^2
//! r(d) = r_i cosh(w d) + u_0/w sinh(w d),   s(d) = s_i + (r_i + r(d)) tanh(w d/2) / w,   d = t - t_i,  w^2 = b
//! t_(i+1) - t_i = 2/w atanh(w h / (r_i + r_(i+1)))                            (b < 0: cos, sin, tan, atan with w^2 = -b)
//! v = q' r,   a = q' u + q'' r^2
//! ```
//!
//! Here `x_i` is the squared path speed at the grid point `s_i`, `r_i = sqrt(x_i)`, and `h = s_(i+1) - s_i`. In the segment from `s_i`, `u`
//! begins at `u_0` and has the slope `b`. `v` and `a` are joint velocities and accelerations, with `q' = dq/ds`.
//!
//! [`TimedPath::cubic`] makes `u` linear in time between the points, so that `s(t)` is a C2 cubic spline. The acceleration is
//! right-continuous. Before time zero, the motion rests at the start of the path, and after `duration` at the end. At `duration` itself, it
//! has the path speed of the last grid point.

use super::Path;
use super::polynomial::chain;
use super::rows::{hold, put};
use crate::error::{Error, Result, finite};
use crate::memory;
use crate::scalar::Real;
use std::sync::Arc;

/// A path with a timing: the time at which each path position is reached.
///
/// ```
/// use armlet_core::motion::{Ends, Motion, Path, TimedPath};
/// use std::sync::Arc;
///
/// let (line, _) = Path::waypoints(&[0.0, 2.0], 1, None, Ends::Natural)?;
/// // The path speed ds/dt is 0.5 at both ends, and constant between them.
/// let timed = TimedPath::new(Arc::new(line), vec![0.0, 1.0], vec![0.25, 0.25], vec![0.0])?;
/// assert_eq!(timed.duration(), 2.0);
/// let middle = Motion::from(timed).at(1.0);
/// assert_eq!((middle.q[0], middle.v[0], middle.a[0]), (1.0, 1.0, 0.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct TimedPath {
    path: Arc<Path>,
    /// `(N + 1,)`: path positions of the grid.
    s: Arc<Vec<f64>>,
    /// `(N + 1,)`: squared path speeds `(ds/dt)^2` at the grid points.
    x: Arc<Vec<f64>>,
    /// `(N + 1,)`: times of the grid points, s.
    t: Arc<Vec<f64>>,
    /// `(N,)`: the slope `b = du/ds` of the path acceleration `u` in each segment.
    u_slope: Arc<Vec<f64>>,
    /// `(N,)`: the index of the piece of the path that contains each segment. Empty if segments may extend over several pieces.
    piece: Arc<Vec<usize>>,
    /// `(N + 1,)`: the path acceleration `u` at the grid points if `u` is linear in time; otherwise empty.
    u: Arc<Vec<f64>>,
}

impl PartialEq for TimedPath {
    fn eq(&self, other: &Self) -> bool {
        // Without a timing, x is NaN, which does not equal itself. So the comparison is by bits.
        let same = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
        self.path == other.path
            && same(&self.s, &other.s)
            && same(&self.x, &other.x)
            && same(&self.u_slope, &other.u_slope)
            && same(&self.u, &other.u)
            && same(&self.t, &other.t)
    }
}

/// `atanh(w)/w` with `w^2 = z`; for `z < 0`, `atan(w)/w` with `w^2 = -z`.
fn arc(z: f64) -> f64 {
    if z.abs() < 1e-3 {
        // The first omitted term, z^6/13, is below one unit in the last place.
        1.0 + z * (1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * (1.0 / 9.0 + z / 11.0))))
    } else if z > 0.0 {
        z.sqrt().atanh() / z.sqrt()
    } else {
        (-z).sqrt().atan() / (-z).sqrt()
    }
}

/// `cosh(w)`, `sinh(w)/w` and `tanh(w/2)/w` with `w^2 = z`. For `z < 0`: `cos(w)`, `sin(w)/w` and `tan(w/2)/w` with `w^2 = -z`.
fn waves(z: f64) -> [f64; 3] {
    if z.abs() < 1e-3 {
        let cosh = 1.0 + z * (1.0 / 2.0 + z * (1.0 / 24.0 + z * (1.0 / 720.0 + z * (1.0 / 40320.0 + z / 3628800.0))));
        let sinh = 1.0 + z * (1.0 / 6.0 + z * (1.0 / 120.0 + z * (1.0 / 5040.0 + z / 362880.0)));
        [cosh, sinh, sinh / (1.0 + cosh)]
    } else if z > 0.0 {
        let w = z.sqrt();
        [w.cosh(), w.sinh() / w, (0.5 * w).tanh() / w]
    } else {
        let w = (-z).sqrt();
        [w.cos(), w.sin() / w, (0.5 * w).tan() / w]
    }
}

/// Path position and its derivatives at `d` seconds after `[s_i, r_i, u_0, b]`, for a path acceleration linear in `s`. `waves` is that of
/// `b d^2`, and `end` is the end of the segment.
#[inline(always)]
pub(crate) fn linear_in_position<S: Real>(d: S, [s, rate, u, b]: [S; 4], waves: [S; 3], end: S) -> [S; 5] {
    let [cosh, sinh, tanh] = waves;
    let speed = (rate * cosh + u * d * sinh).max(S::zero());
    let advance = (rate + speed) * d * tanh;
    let u = u + b * advance;
    [(s + advance).clamped(s, end), speed, u, b * speed, b * u]
}

/// Path position and its derivatives at `d` seconds after `[s_i, r_i, u_i, du/dt]`, for a path acceleration linear in time. The path
/// position remains between `ends`.
#[inline(always)]
pub(crate) fn linear_in_time<S: Real>(d: S, [s, rate, u, jolt]: [S; 4], ends: [S; 2]) -> [S; 5] {
    let advance = d * (rate + d * (u / S::splat(2.0) + d * jolt / S::splat(6.0)));
    let speed = (rate + d * (u + d * jolt / S::splat(2.0))).max(S::zero());
    [(s + advance).clamped(ends[0], ends[1]), speed, u + d * jolt, jolt, S::zero()]
}

impl TimedPath {
    pub(super) fn is_same(&self, other: &TimedPath) -> bool {
        Arc::ptr_eq(&self.path, &other.path) && Arc::ptr_eq(&self.x, &other.x)
    }

    pub(super) fn numbers(&self) -> usize {
        10 * self.x.len()
    }

    /// Create a timed path from the squared speeds `x = (ds/dt)^2` at the path positions `s`, `(N + 1,)` each. `u_slope`, `(N,)`, has the
    /// slopes `b = du/ds` of the path acceleration `u`.
    ///
    /// Every knot of the path must be one of the positions. A path without a feasible timing has NaN in `x`.
    ///
    /// Errors: `Input` for positions that do not increase, wrong lengths, or a number in `s` or `u_slope` that is not finite; `Memory`.
    pub fn new(path: Arc<Path>, s: Vec<f64>, x: Vec<f64>, u_slope: Vec<f64>) -> Result<Self> {
        finite("s", &s)?;
        finite("u_slope", &u_slope)?;
        if s.len() < 2 || s.len() != x.len() || s.len() != u_slope.len() + 1 || s.windows(2).any(|w| !(w[0] < w[1])) {
            return Err(Error::input("s", "is not a grid: expected rising path positions, one per squared speed"));
        }
        let mut t = memory::zeros(s.len())?;
        for i in 0..s.len() - 1 {
            let (h, rates) = (s[i + 1] - s[i], x[i].sqrt() + x[i + 1].sqrt());
            t[i + 1] = t[i] + 2.0 * (h / rates) * arc(u_slope[i] * (h / rates) * (h / rates));
        }
        let piece = memory::collected(s.windows(2).map(|w| path.piece(0.5 * (w[0] + w[1]))))?;
        Ok(TimedPath { path, s: s.into(), x: x.into(), t: t.into(), u_slope: u_slope.into(), piece: piece.into(), u: Arc::default() })
    }

    /// Create a timed path whose path acceleration `u = d^2 s/dt^2` is linear in time between the times `t`, s. At these times, `s` has the
    /// path positions, `x` the squared path speeds `(ds/dt)^2`, and `u` the path accelerations, `(N + 1,)` each.
    ///
    /// Errors: `WrongShape` for unequal lengths or fewer than two times. `Input` for times that do not increase from zero, a negative `x`,
    /// or numbers that are not finite. `Memory`.
    pub fn cubic(path: Arc<Path>, t: Vec<f64>, s: Vec<f64>, x: Vec<f64>, u: Vec<f64>) -> Result<Self> {
        for (name, values) in [("t", &t), ("s", &s), ("x", &x), ("u", &u)] {
            finite(name, values)?;
            if values.len() != t.len() || t.len() < 2 {
                return Err(Error::wrong_shape(name, &[t.len().max(2)], &[values.len()]));
            }
        }
        if t[0] != 0.0 || t.windows(2).any(|w| !(w[0] < w[1])) || x.iter().any(|x| *x < 0.0) {
            return Err(Error::input("t", "is not a grid: expected times that rise from zero"));
        }
        let u_slope = memory::zeros(t.len() - 1)?.into();
        Ok(TimedPath { path, s: s.into(), x: x.into(), t: t.into(), u_slope, piece: Arc::default(), u: u.into() })
    }

    /// Number of joints `n`.
    pub fn dof(&self) -> usize {
        self.path.dof()
    }

    /// The path of the motion.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A motion of duration zero, which holds the position of a path that is one point.
    pub fn still(path: Arc<Path>) -> Self {
        let ends = vec![path.knots()[0], path.knots()[path.knots().len() - 1]];
        let piece = vec![0].into();
        TimedPath {
            path,
            s: ends.into(),
            x: vec![f64::INFINITY; 2].into(),
            t: vec![0.0; 2].into(),
            u_slope: vec![0.0].into(),
            piece,
            u: Arc::default(),
        }
    }

    /// Duration, s.
    pub fn duration(&self) -> f64 {
        self.t[self.t.len() - 1]
    }

    /// Path positions of the grid points, `(N + 1,)`.
    pub fn grid(&self) -> &[f64] {
        &self.s
    }

    /// Squared path speeds `(ds/dt)^2` at the grid points, `(N + 1,)`.
    pub fn squared_speeds(&self) -> &[f64] {
        &self.x
    }

    /// Times of the grid points, s, `(N + 1,)`.
    pub fn times(&self) -> &[f64] {
        &self.t
    }

    /// Path acceleration at the start and at the end of segment `i`, if it is linear in `s`.
    pub(crate) fn end_accelerations(&self, i: usize) -> (f64, f64) {
        let h = self.s[i + 1] - self.s[i];
        let (mean, turn) = (0.5 * (self.x[i + 1] - self.x[i]) / h, 0.5 * h * self.u_slope[i]);
        (mean - turn, mean + turn)
    }

    /// The state at time `t`: index of the segment, and path position with its derivatives with respect to time. The result is `None` before
    /// the start, after the end, and for a motion of duration zero.
    #[inline]
    pub fn phase(&self, t: f64) -> Option<(usize, [f64; 5])> {
        let last = self.s.len() - 1;
        if !(t >= 0.0 && t <= self.t[last]) || self.t[last] == 0.0 {
            return None;
        }
        if t == self.t[last] {
            let (rate, u, b) = (self.x[last].sqrt(), self.end_acceleration(), self.u_slope[last - 1]);
            return Some((last - 1, [self.s[last], rate, u, b * rate, b * u]));
        }
        let i = self.t.partition_point(|&at| at <= t).clamp(1, last) - 1;
        let (d, rate) = (t - self.t[i], self.x[i].sqrt());
        if !self.u.is_empty() {
            let jolt = (self.u[i + 1] - self.u[i]) / (self.t[i + 1] - self.t[i]);
            return Some((i, linear_in_time(d, [self.s[i], rate, self.u[i], jolt], [self.s[0], self.s[last]])));
        }
        let ((u, _), b) = (self.end_accelerations(i), self.u_slope[i]);
        Some((i, linear_in_position(d, [self.s[i], rate, u, b], waves(b * d * d), self.s[i + 1])))
    }

    /// Path acceleration at the end of the motion.
    pub(crate) fn end_acceleration(&self) -> f64 {
        let last = self.s.len() - 1;
        if self.x[last] == 0.0 || !self.u.is_empty() { 0.0 } else { self.end_accelerations(last - 1).1 }
    }

    /// Write `[q_d, v_d, a_d]` at time `t`, s, to `out`, `(3 n,)`.
    pub fn sample(&self, t: f64, out: &mut [f64]) {
        self.evaluate::<3, 0>(t, out);
    }

    /// Write the position and its derivatives at time `t`, s, to `out`, as [`put`] does.
    #[inline(never)]
    pub(crate) fn evaluate<const K: usize, const FROM: usize>(&self, t: f64, out: &mut [f64]) {
        let (start, end) = self.path.ends();
        let phase = if t.is_nan() || self.duration().is_nan() { Some((0, [f64::NAN; 5])) } else { self.phase(t) };
        let Some((i, s)) = phase else {
            return hold::<_, K, FROM>(if t > 0.0 { end } else { start }, out);
        };
        let piece = if self.piece.is_empty() { self.path.piece(s[0]) } else { self.piece[i] };
        let n = end.len();
        self.path.evaluate(piece, s[0], |j, q| put::<_, K, FROM>(n, out, j, chain(q, s)));
        if FROM == 0 && s[0] == self.s[self.s.len() - 1] {
            out[..n].copy_from_slice(end);
        }
    }

    /// The start and the end, s, and between them the times at which the path acceleration jumps by more than 1 % of its largest magnitude.
    /// If the path acceleration is linear in time, it has no jumps between the ends.
    pub fn breaks(&self) -> Vec<f64> {
        let last = self.s.len() - 1;
        let inner = self.inner_jumps().map(|i| self.t[i]);
        std::iter::once(0.0).chain(inner).chain([self.t[last]]).filter(|t| t.is_finite()).collect()
    }

    /// The grid points between start and end at which the path acceleration jumps by more than 1 % of its largest magnitude.
    pub(super) fn inner_jumps(&self) -> impl Iterator<Item = usize> {
        let last = if self.u.is_empty() { self.s.len() - 1 } else { 0 };
        let largest = (0..last).map(|i| self.end_accelerations(i)).fold(0.0_f64, |most, (a, b)| most.max(a.abs()).max(b.abs()));
        (1..last).filter(move |&i| (self.end_accelerations(i).0 - self.end_accelerations(i - 1).1).abs() > 0.01 * largest)
    }

    /// The slope `b = du/ds` of the path acceleration `u` in each segment, `(N,)`.
    pub fn acceleration_slopes(&self) -> &[f64] {
        &self.u_slope
    }

    /// The index of the piece of the path that contains each segment. Empty if segments may extend over several pieces.
    pub(crate) fn pieces(&self) -> &[usize] {
        &self.piece
    }

    /// The path acceleration `u` at the grid points, `(N + 1,)`, if `u` is linear in time; otherwise empty.
    pub fn node_accelerations(&self) -> &[f64] {
        &self.u
    }
}
