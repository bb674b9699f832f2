//! A path `s -> q(s)` of `n` joints, without time. It has one polynomial of at most degree five per piece. A path made by `spline`,
//! `waypoints` or `table` is twice continuously differentiable.
//!
//! ```text
//! q(s) = sum_k c_k x^k,   x = (s - s_p) / h_p in piece p,   s_p <= s <= s_p + h_p
//! spline of waypoints, slopes d (de Boor 2001):
//!   h_k d_(k-1) + 2 (h_(k-1) + h_k) d_k + h_(k-1) d_(k+1) = 3 (h_k D_(k-1)/h_(k-1) + h_(k-1) D_k/h_k),   D_k = q_(k+1) - q_k
//! ```
//!
//! The ends of a spline are natural (`q'' = 0`), clamped (`q' = 0`) or not-a-knot (`q'''` is continuous at the second and the last but one
//! waypoint). The knots are at the path positions `s_k`. `h_k = s_(k+1) - s_k` is the length of piece `k`, and `'` is `d/ds`. A table of
//! `q, q', q''` is interpolated by the quintic that has all three values at both ends of a piece.

use super::polynomial::{TERMS, hermite, polynomial, scaled};
use crate::error::{Error, Result, finite};
use crate::interrupt;
use crate::memory;
use crate::scalar::Real;

/// Number of knots between two checks for an interrupt.
const CHECK_INTERVAL: usize = 1 << 10;

/// Consecutive waypoints that are closer together than this fraction of the path's length are the same point.
const SAME: f64 = 1e-12;

/// The end conditions of a spline.
///
/// ```
/// use armlet_core::motion::{Ends, Path};
///
/// let slopes = |ends| Path::slopes(&[0.0, 1.0, 2.0], &[0.0, 1.0, 0.0], 1, ends);
/// assert_eq!(slopes(Ends::Clamped)?, [0.0, 0.0, 0.0]);
/// assert!((slopes(Ends::Natural)?[0] - 1.5).abs() < 1e-15);
/// // With three waypoints, the not-a-knot condition gives one parabola.
/// assert_eq!(slopes(Ends::NotAKnot)?, [2.0, 0.0, -2.0]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// Zero second derivative at both ends.
    Natural,
    /// Zero first derivative at both ends.
    Clamped,
    /// The third derivative is continuous at the first and last inner knot.
    NotAKnot,
}

/// A path of `n` joints: one polynomial per piece. [`Path::waypoints`] makes a cubic spline.
///
/// ```
/// use armlet_core::motion::{Ends, Path};
///
/// let (path, knots) = Path::waypoints(&[0.0, 0.0, 1.0, 0.5, 2.0, 0.0], 2, None, Ends::Natural)?;
/// assert_eq!((path.dof(), path.knots().len(), knots), (2, 3, vec![0, 1, 2]));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    n: usize,
    /// Path positions of the knots, `(P + 1,)`, increasing.
    knots: Vec<f64>,
    /// Coefficients `c_k` of the polynomials `q(x) = sum c_k x^k`, `(P, TERMS, n)`.
    coefficients: Vec<f64>,
    /// Start and end of the path, `(n,)` each, exactly as they were passed.
    ends: [Vec<f64>; 2],
}

fn increasing(s: &[f64]) -> Result<()> {
    finite("knots", s)?;
    match s.windows(2).position(|w| !(w[0] < w[1])) {
        None => Ok(()),
        Some(k) => {
            Err(Error::input("knots", format!("is not increasing: expected rising numbers, got {} after {}", s[k + 1], s[k])).at([k + 1]))
        }
    }
}

/// Compute the slopes `dq/ds`, `(K, n)`, of the spline through `q`, `(K, n)`, at the path positions `s`, `(K,)`.
fn slopes(s: &[f64], q: &[f64], n: usize, ends: Ends) -> Vec<f64> {
    let k = s.len();
    let h = |i: usize| s[i + 1] - s[i];
    let secant = |i: usize, j: usize| (q[(i + 1) * n + j] - q[i * n + j]) / h(i);
    let mut d = vec![0.0; k * n];
    if k == 3 && ends == Ends::NotAKnot {
        for j in 0..n {
            let (a, b) = (secant(0, j), secant(1, j));
            let c = (b - a) / (h(0) + h(1));
            (d[j], d[n + j], d[2 * n + j]) = (a - c * h(0), a + c * h(0), b + c * h(1));
        }
        return d;
    }
    if k == 2 && ends != Ends::Clamped {
        for j in 0..n {
            (d[j], d[n + j]) = (secant(0, j), secant(0, j));
        }
        return d;
    }
    // Tridiagonal elimination. Each row has a lower, a diagonal and an upper entry, and every pivot is positive.
    let last = k - 1;
    let mut upper = vec![0.0; k];
    for i in 0..k {
        if i % CHECK_INTERVAL == 0 {
            interrupt::check();
        }
        let (low, diagonal, up) = match (i, ends) {
            (0, Ends::Clamped) => (0.0, 1.0, 0.0),
            (0, Ends::Natural) => (0.0, 2.0, 1.0),
            (0, Ends::NotAKnot) => (0.0, h(1), h(0) + h(1)),
            (i, Ends::Clamped) if i == last => (0.0, 1.0, 0.0),
            (i, Ends::Natural) if i == last => (1.0, 2.0, 0.0),
            (i, Ends::NotAKnot) if i == last => (h(i - 1) + h(i - 2), h(i - 2), 0.0),
            (i, _) => (h(i), 2.0 * (h(i - 1) + h(i)), h(i - 1)),
        };
        let pivot = if i == 0 { diagonal } else { diagonal - low * upper[i - 1] };
        upper[i] = up / pivot;
        for j in 0..n {
            let right = match (i, ends) {
                (0, Ends::Clamped) => 0.0,
                (0, Ends::Natural) => 3.0 * secant(0, j),
                (0, Ends::NotAKnot) => {
                    let (a, b) = (h(0), h(1));
                    ((a + 2.0 * (a + b)) * b * secant(0, j) + a * a * secant(1, j)) / (a + b)
                }
                (i, Ends::Clamped) if i == last => 0.0,
                (i, Ends::Natural) if i == last => 3.0 * secant(i - 1, j),
                (i, Ends::NotAKnot) if i == last => {
                    let (a, b) = (h(i - 1), h(i - 2));
                    ((a + 2.0 * (a + b)) * b * secant(i - 1, j) + a * a * secant(i - 2, j)) / (a + b)
                }
                (i, _) => 3.0 * (h(i) * secant(i - 1, j) + h(i - 1) * secant(i, j)),
            };
            let before = if i == 0 { 0.0 } else { d[(i - 1) * n + j] };
            d[i * n + j] = (right - low * before) / pivot;
        }
    }
    for i in (0..last).rev() {
        for j in 0..n {
            d[i * n + j] -= upper[i] * d[(i + 1) * n + j];
        }
    }
    d
}

/// The path through `q`, `(K, n)`, at the path positions `s`, `(K,)`. `piece(i, k, h)` has the coefficients of one joint on a piece of
/// length `h`, from entry `i` to entry `k` of `q`.
fn pieces(s: &[f64], q: &[f64], n: usize, piece: impl Fn(usize, usize, f64) -> [f64; TERMS]) -> Path {
    let mut c = vec![0.0; (s.len() - 1) * TERMS * n];
    for p in 0..s.len() - 1 {
        if p % CHECK_INTERVAL == 0 {
            interrupt::check();
        }
        let h = s[p + 1] - s[p];
        for j in 0..n {
            for (term, coefficient) in piece(p * n + j, (p + 1) * n + j, h).into_iter().enumerate() {
                c[(p * TERMS + term) * n + j] = coefficient;
            }
        }
    }
    Path { n, knots: s.to_vec(), coefficients: c, ends: [q[..n].to_vec(), q[(s.len() - 1) * n..].to_vec()] }
}

/// The cubic Hermite path through `q`, `(K, n)`, with the slopes `d`, `(K, n)`, at the path positions `s`, `(K,)`.
fn cubic(s: &[f64], q: &[f64], d: &[f64], n: usize) -> Path {
    pieces(s, q, n, |i, k, h| {
        let (step, d0, d1) = (q[k] - q[i], h * d[i], h * d[k]);
        [q[i], d0, 3.0 * step - 2.0 * d0 - d1, d0 + d1 - 2.0 * step, 0.0, 0.0]
    })
}

impl Path {
    /// Compute the slopes `dq/ds`, `(K, n)`, of the C2 cubic spline through `q`, `(K, n)`, at the path positions `s`, `(K,)`.
    ///
    /// Errors: `Input` for positions that do not increase or numbers that are not finite, `WrongShape` for a wrong length or `K < 2`, and
    /// `Memory`.
    pub fn slopes(s: &[f64], q: &[f64], n: usize, ends: Ends) -> Result<Vec<f64>> {
        increasing(s)?;
        finite("path", q)?;
        if s.len() < 2 || q.len() != s.len() * n {
            return Err(Error::wrong("path", "shape", format!("two or more rows of {n}"), format!("{} numbers", q.len())));
        }
        memory::require((s.len() * 8).saturating_mul(n + 1))?;
        let d = slopes(s, q, n, ends);
        finite("path", &d)?;
        Ok(d)
    }

    /// Create the C2 cubic spline through `q`, `(K, n)`, rad or m, at the path positions `s`, `(K,)`. Errors: as for [`Path::slopes`].
    pub fn spline(s: &[f64], q: &[f64], n: usize, ends: Ends) -> Result<Path> {
        memory::require((s.len() * 8).saturating_mul((TERMS + 4) * n + 4))?;
        Ok(cubic(s, q, &Path::slopes(s, q, n, ends)?, n))
    }

    /// Create the cubic Hermite path through `q`, `(K, n)`, rad or m, with the slopes `d = dq/ds`, `(K, n)`, at the path positions `s`,
    /// `(K,)`.
    ///
    /// Errors: `Input` for positions that do not increase, or numbers that are not finite; `WrongShape` for a wrong length or `K < 2`.
    pub fn cubic(s: &[f64], q: &[f64], d: &[f64], n: usize) -> Result<Path> {
        increasing(s)?;
        for values in [q, d] {
            finite("path", values)?;
            if s.len() < 2 || n == 0 || values.len() != s.len() * n {
                return Err(Error::wrong("path", "shape", format!("two or more rows of {n}"), format!("{} numbers", values.len())));
            }
        }
        Ok(cubic(s, q, d, n))
    }

    /// Create the C2 cubic spline through waypoints `q`, `(K, n)`, rad or m. Also return the index of the knot of each waypoint.
    ///
    /// Without positions `s`, `(K,)`, the path positions are the sums of distances between waypoints, scaled to 0 .. 1. Consecutive equal
    /// waypoints share a knot. If all waypoints are equal, the path is a point, with knots 0 and 1.
    ///
    /// Errors: `Input` for fewer than two waypoints, or waypoints whose distances overflow; also as for [`Path::slopes`].
    pub fn waypoints(q: &[f64], n: usize, s: Option<&[f64]>, ends: Ends) -> Result<(Path, Vec<usize>)> {
        finite("path", q)?;
        let count = q.len() / n.max(1);
        if n == 0 || count < 2 || count * n != q.len() {
            return Err(Error::input("path", format!("has too few waypoints: expected at least two rows, got {count}")));
        }
        if let Some(s) = s {
            increasing(s)?;
            if s.len() != count {
                return Err(Error::wrong_shape("knots", &[count], &[s.len()]));
            }
            return Ok((Path::spline(s, q, n, ends)?, (0..count).collect()));
        }
        let row = |k: usize| &q[k * n..(k + 1) * n];
        let largest = q.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let distance = |a: usize, b: usize| {
            // The differences are divided by the largest one, so that their squares neither overflow nor all underflow.
            let size = (0..n).map(|j| (row(a)[j] - row(b)[j]).abs()).fold(0.0, f64::max);
            if size == 0.0 { 0.0 } else { size * (0..n).map(|j| ((row(a)[j] - row(b)[j]) / size).powi(2)).sum::<f64>().sqrt() }
        };
        let total: f64 = (1..count).map(|k| distance(k - 1, k)).sum();
        if !total.is_finite() {
            return Err(Error::input("path", format!("is too large: expected waypoints whose distances add up, got up to {largest:e}")));
        }
        let (mut distinct, mut knot): (Vec<usize>, Vec<usize>) = (vec![0], vec![0]);
        for k in 1..count {
            if distance(distinct[distinct.len() - 1], k) > SAME * total {
                distinct.push(k);
            } else if k == count - 1 && distinct.len() > 1 {
                // The last waypoint replaces the previous one, so that the end is exact.
                let last = distinct.len() - 1;
                distinct[last] = k;
            }
            knot.push(distinct.len() - 1);
        }
        if distinct.len() == 1 {
            let still: Vec<f64> = row(0).iter().chain(row(0)).copied().collect();
            return Ok((Path::spline(&[0.0, 1.0], &still, n, Ends::Natural)?, knot));
        }
        let mut at = vec![0.0; distinct.len()];
        for k in 1..distinct.len() {
            at[k] = at[k - 1] + distance(distinct[k - 1], distinct[k]);
        }
        let length = at[at.len() - 1];
        at.iter_mut().for_each(|s| *s /= length);
        let chosen: Vec<f64> = distinct.iter().flat_map(|&k| row(k)).copied().collect();
        Ok((Path::spline(&at, &chosen, n, ends)?, knot))
    }

    /// Create the quintic Hermite path through `q`, `(K, n)`, with `dq = dq/ds` and `ddq = d^2 q/ds^2`, at the path positions `s`, `(K,)`.
    ///
    /// Errors: `Input` for positions that do not increase, or numbers that are not finite; `WrongShape` for a wrong length or `K < 2`.
    pub fn table(s: &[f64], q: &[f64], dq: &[f64], ddq: &[f64], n: usize) -> Result<Path> {
        increasing(s)?;
        if s.len() < 2 {
            return Err(Error::wrong("knots", "length", "two or more", s.len()));
        }
        for (name, values) in [("q", q), ("dq", dq), ("ddq", ddq)] {
            if n == 0 || values.len() != s.len().saturating_mul(n) {
                return Err(Error::wrong(
                    name,
                    "shape",
                    format!("({}, n) with n = {n} joints", s.len()),
                    format!("{} numbers", values.len()),
                ));
            }
            finite("path", values)?;
        }
        let path = pieces(s, q, n, |i, k, h| hermite([q[i], dq[i], ddq[i]], [q[k], dq[k], ddq[k]], h));
        finite("path", &path.coefficients)?;
        Ok(path)
    }

    /// Create a path of `P` polynomials from its `knots`, `(P + 1,)`, `coefficients`, `(P, TERMS, n)`, and `end`, `(n,)`, rad or m.
    ///
    /// Errors: `Input` for knots that do not increase, numbers that are not finite, or a wrong length.
    pub fn from_parts(knots: Vec<f64>, coefficients: Vec<f64>, end: Vec<f64>) -> Result<Path> {
        let n = end.len();
        increasing(&knots)?;
        finite("coefficients", &coefficients)?;
        finite("end", &end)?;
        if n == 0 || knots.len() < 2 || coefficients.len() != (knots.len() - 1) * TERMS * n {
            return Err(Error::input("coefficients", "has the wrong length: expected six per piece and joint"));
        }
        Ok(Path { n, ends: [coefficients[..n].to_vec(), end], knots, coefficients })
    }

    /// Number of joints `n`.
    pub fn dof(&self) -> usize {
        self.n
    }

    /// Path positions of the knots, `(P + 1,)`, including both ends of the path.
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// Coefficients of the polynomials of the pieces, `(P, TERMS, n)`, row-major.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Start and end of the path, `(n,)`.
    pub fn ends(&self) -> (&[f64], &[f64]) {
        (&self.ends[0], &self.ends[1])
    }

    /// Whether the path is one point.
    pub fn is_point(&self) -> bool {
        let n = self.n;
        self.coefficients
            .chunks_exact(n)
            .enumerate()
            .all(|(k, c)| if k % TERMS == 0 { c == &self.ends[0][..] } else { c.iter().all(|x| *x == 0.0) })
    }

    /// The index of the piece that contains `s`; at a knot, the later piece.
    pub fn piece(&self, s: f64) -> usize {
        self.knots.partition_point(|&knot| knot <= s).clamp(1, self.knots.len() - 1) - 1
    }

    /// Evaluate the path at `s` in piece `p`, and call `put(joint, [q, q', q'', ..])` for each joint, where `'` is `d/ds`.
    ///
    /// ```
    /// use armlet_core::motion::{Ends, Path};
    ///
    /// let (path, _) = Path::waypoints(&[0.0, 1.0, 0.0], 1, None, Ends::NotAKnot)?;
    /// // The path is the parabola 4 s (1 - s).
    /// path.evaluate(path.piece(0.5), 0.5, |_, values| assert_eq!(values, [1.0, 0.0, -8.0, 0.0]));
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    #[inline(always)]
    pub fn evaluate<const K: usize>(&self, p: usize, s: f64, put: impl FnMut(usize, [f64; K])) {
        let c = &self.coefficients[p * TERMS * self.n..(p + 1) * TERMS * self.n];
        on_piece(self.n, [self.knots[p], self.knots[p + 1]], c, s, put);
    }
}

/// Call `put(joint, [q, q', ..])` for each of `n` joints at `s`, on the piece between two `knots` with the coefficients `c`, `(TERMS, n)`.
#[inline(always)]
pub(crate) fn on_piece<S: Real, const K: usize>(n: usize, knots: [S; 2], c: &[S], s: S, mut put: impl FnMut(usize, [S; K])) {
    let rate = S::splat(1.0) / (knots[1] - knots[0]);
    let x = (s - knots[0]) * rate;
    let part = |k: usize| &c[k * n..(k + 1) * n];
    let (c0, c1, c2, c3, c4, c5) = (part(0), part(1), part(2), part(3), part(4), part(5));
    for j in 0..n {
        put(j, scaled(polynomial([c0[j], c1[j], c2[j], c3[j], c4[j], c5[j]], x), rate));
    }
}
