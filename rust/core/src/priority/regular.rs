//! Equation (5) away from singularities: with the stack `J_E = [J1; J2; ..] = L Q` (LQ factorisation by Householder reflections),
//! the prioritised solution is `v = Q' y` with `L y = [v1; v2; ..]` by forward substitution, because the diagonal block
//! `T_i` of `L` is `J_i N_{i-1}` in an orthonormal basis of the null space of the levels above.
//!
//! The route is taken only where it is provably the same map as the recursion over singular values: `1/|T_i^-1|_F` bounds the
//! smallest singular value of `J_i N_{i-1}` from below, and must reach `eps_i` (`clamp`, `damped`) or pass the rank rule with
//! six digits to spare (`exact`). Otherwise it declines, having decided nothing, and `levels` takes over.
//!
//! One source for a single stack and for one stack per lane: nothing here branches on the numbers, and no sum or quotient is taken in
//! another order, so a lane and a single solve of the same instruction set agree to the bit.

use super::lq::{Factor, product, reflect, tall};
use super::method::DEFAULT_EPS;
use super::metric::Metric;
use super::workspace::TAME;
use crate::scalar::{Kernel, Real};

/// `exact` takes this route only for relative singular values above it, where forward substitution loses no digits that count.
const EXACT_FLOOR: f64 = 1e-6;

/// Joints beyond which the route is not compiled.
pub(super) const MOST_JOINTS: usize = 32;

/// Joints beyond which it is not compiled for lanes: the factor would leave the nearest cache.
pub(super) const MOST_JOINTS_IN_LANES: usize = 8;

/// What a solve is asked besides the stack.
pub(super) struct Asked<'a> {
    pub n: usize,
    pub rows: &'a [usize],
    pub eps: Option<&'a [f64]>,
    pub metric: Option<&'a Metric>,
    pub exact: bool,
}

/// The stack `(sum rows, n)` and its command `(sum rows,)`.
pub(super) trait Given<S> {
    /// Row `r` of the Jacobians, filled up with zeros.
    fn row<const N: usize>(&self, r: usize, n: usize) -> [S; N];
    fn command(&self, r: usize) -> S;
}

/// Plain numbers, the same in every lane.
pub(super) struct Plain<'a> {
    pub jacobian: &'a [f64],
    pub command: &'a [f64],
}

impl<S: Real> Given<S> for Plain<'_> {
    #[inline(always)]
    fn row<const N: usize>(&self, r: usize, n: usize) -> [S; N] {
        padded(&self.jacobian[r * n..(r + 1) * n], S::splat)
    }
    #[inline(always)]
    fn command(&self, r: usize) -> S {
        S::splat(self.command[r])
    }
}

/// One stack per lane.
pub(super) struct Lanewise<'a, S> {
    pub jacobian: &'a [S],
    pub command: &'a [S],
}

impl<S: Real> Given<S> for Lanewise<'_, S> {
    #[inline(always)]
    fn row<const N: usize>(&self, r: usize, n: usize) -> [S; N] {
        padded(&self.jacobian[r * n..(r + 1) * n], |x| x)
    }
    #[inline(always)]
    fn command(&self, r: usize) -> S {
        self.command[r]
    }
}

/// A row of a compiled length. Zero columns up to the next size change nothing.
#[inline(always)]
fn padded<T: Copy, S: Real, const N: usize>(given: &[T], as_real: impl Fn(T) -> S) -> [S; N] {
    if let Ok(given) = <&[T; N]>::try_from(given) {
        return given.map(as_real);
    }
    let mut row = [S::zero(); N];
    row.iter_mut().zip(given).for_each(|(to, &from)| *to = as_real(from));
    row
}

/// Buffers of the route.
#[derive(Debug, Clone)]
pub(super) struct Room<S> {
    /// The answer: joint velocities `(n,)` and residuals `(sum rows,)`.
    pub v: Vec<S>,
    pub residual: Vec<S>,
    /// Squares of the largest row norm and of the Frobenius norm of each level.
    most2: Vec<S>,
    norm2: Vec<S>,
    /// Rows that do not fit into the freedom, padded to a compiled length.
    tail: Vec<S>,
    r: Vec<S>,
    z: Vec<S>,
}

impl<S: Real> Room<S> {
    pub fn new(n: usize, rows: &[usize]) -> Self {
        let (fit, _) = fitting(n, rows);
        let most = rows.iter().copied().max().unwrap_or(0).max(n);
        let zeros = |k: usize| vec![S::zero(); k];
        let behind = rows.iter().sum::<usize>() - fit;
        Room {
            v: zeros(n),
            residual: zeros(rows.iter().sum()),
            most2: zeros(rows.len()),
            norm2: zeros(rows.len()),
            tail: zeros(if n <= MOST_JOINTS { behind * compiled(n) } else { 0 }),
            r: zeros(most),
            z: zeros(most),
        }
    }
}

/// The row length that `n <= MOST_JOINTS` joints are solved at.
fn compiled(n: usize) -> usize {
    [2, 3, 4, 6, 7, 8, 12].into_iter().find(|&size| n <= size).unwrap_or(MOST_JOINTS)
}

/// Rows and number of the levels that fit into the freedom left; their rows come first and are rows of a square `L`.
#[inline(always)]
fn fitting(n: usize, rows: &[usize]) -> (usize, usize) {
    let (mut fit, mut levels) = (0, 0);
    while levels < rows.len() && fit + rows[levels] <= n {
        fit += rows[levels];
        levels += 1;
    }
    (fit, levels)
}

/// Directions that every level realises on this route.
pub(super) fn regular_ranks<'a>(n: usize, rows: &'a [usize]) -> impl Iterator<Item = usize> + 'a {
    rows.iter().scan(n, |free, &m| {
        let p = m.min(*free);
        *free -= p;
        Some(p)
    })
}

/// Solve into the room; false where some level is not provably regular or some number is not tame.
#[inline(always)]
pub(super) fn regular<S: Real, const N: usize>(asked: &Asked, rounding: S, given: &impl Given<S>, room: &mut Room<S>) -> S::Mask {
    let (n, rows) = (asked.n, asked.rows);
    let (fit, levels) = fitting(n, rows);
    let zero = S::zero();
    let mut f = Factor::<S, N>::new();
    let Room { v, residual, most2, norm2, tail, r: rest, z } = room;
    let (tail, _) = tail.as_chunks_mut::<N>();
    let mut at = 0;
    for (i, &m) in rows.iter().enumerate() {
        let (mut most, mut sum) = (zero, zero);
        for r in at..at + m {
            let mut row = given.row::<N>(r, n);
            if let Some(metric) = asked.metric {
                metric.row(&mut row[..n]);
            }
            let row2 = product(0, N, &row, &row);
            most = S::select(most.lt(row2), row2, most);
            sum += row2;
            if r < fit {
                f.l[r] = row;
            } else {
                tail[r - fit] = row;
            }
        }
        (most2[i], norm2[i]) = (most, sum);
        at += m;
    }
    if N == 4 {
        // Written out, so that the indices are constants for the smallest redundant arms.
        f.eliminate(0, fit, given);
        f.eliminate(1, fit, given);
        f.eliminate(2, fit, given);
        f.eliminate(3, fit, given);
    } else {
        (0..fit).for_each(|at| f.eliminate(at, fit, given));
    }
    let behind = rows.iter().sum::<usize>() - fit;
    for at in 0..fit {
        tail[..behind].iter_mut().for_each(|row| reflect(at, &f.h[at], f.beta[at], row));
    }
    // One where the route stands, zero where it does not. NaN fails every comparison and declines.
    let one = S::splat(1.0);
    let (mut stands, mut used, mut condition) = (one, 0, one);
    for (i, &m) in rows.iter().enumerate() {
        let p = m.min(n - used);
        // A level without rows or freedom decides nothing, so that it cannot change the route of the levels above it.
        if p == 0 {
            continue;
        }
        let norm2 = norm2[i];
        stands = S::select(S::splat(TAME.start).lt(norm2), S::select(norm2.lt(S::splat(TAME.end)), stands, zero), zero);
        let inverse2 = if i < levels { f.inverse_norm2(used, m, z) } else { tall(&mut tail[..m], given, fit, p, &mut f.y, rest, z) };
        used += p;
        let excess = if asked.exact {
            let relative2 = inverse2 * norm2;
            let floor = S::splat(EXACT_FLOOR).max(rounding * condition);
            condition *= relative2.sqrt();
            relative2 * floor * floor
        } else {
            let eps2 = asked.eps.map_or(S::splat(DEFAULT_EPS * DEFAULT_EPS) * most2[i], |eps| S::splat(eps[i] * eps[i]));
            inverse2 * eps2
        };
        stands = S::select(one.lt(excess), zero, S::select(excess.lt(S::splat(2.0)), stands, zero));
        if !S::any(zero.lt(stands)) {
            return zero.lt(stands);
        }
    }
    if N == 4 {
        f.back(3, fit);
        f.back(2, fit);
        f.back(1, fit);
        f.back(0, fit);
    } else {
        (0..fit).rev().for_each(|at| f.back(at, fit));
    }
    let mut y = f.y;
    if let Some(metric) = asked.metric {
        metric.velocity(&mut y[..n]);
    }
    match <&mut [S; N]>::try_from(&mut v[..]) {
        Ok(v) => *v = y,
        Err(_) => v.copy_from_slice(&y[..n]),
    }
    let mut sound = zero;
    for (r, residual) in residual.iter_mut().enumerate() {
        *residual = given.command(r) - product(0, N, &given.row::<N>(r, n), &y);
        sound = residual.mul_add(zero, sound);
    }
    S::select(sound.lt(one), zero, one).lt(stands)
}

/// A solve compiled for one row length, in the region of its number.
struct Single<'a, S, const N: usize> {
    asked: Asked<'a>,
    rounding: f64,
    given: Plain<'a>,
    room: &'a mut Room<S>,
}

impl<S: Real, const N: usize> Kernel for Single<'_, S, N> {
    type Output = bool;
    #[inline(always)]
    fn run(self) -> bool {
        S::all(regular::<S, N>(&self.asked, S::splat(self.rounding), &self.given, self.room))
    }
}

/// One stack; false where the route declines.
pub(super) fn single<S: Real>(asked: Asked, rounding: f64, given: Plain, room: &mut Room<S>) -> bool {
    macro_rules! of_length {
        ($($n:literal)*) => {
            match compiled(asked.n) {
                $($n => S::enter(Single::<S, $n> { asked, rounding, given, room }),)*
                _ => S::enter(Single::<S, MOST_JOINTS> { asked, rounding, given, room }),
            }
        };
    }
    of_length!(2 3 4 6 7 8 12)
}
