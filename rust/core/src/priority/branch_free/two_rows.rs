//! Levels of at most two rows in closed form, also at singularities. One rotation makes the rows of a projected level orthogonal (one step
//! of one-sided Jacobi; Golub and Van Loan, Matrix Computations, 8.6). The norms of these rows are the singular values:
//!
//! `G = R J_i P`,  `v += G' diag(h) R (v_i - J_i v)`,  `P <- P - G' diag(q) G`,  `q = 1 / max(s^2, eps^2)`.
//!
//! `R` is the rotation, `s` the norm of a row of `G`, and `P` the projector on the free directions, at first `P = I`. For `clamp`, `h = q`.
//! For `damped`, `h = 1 / (s^2 + lambda^2)`. The result equals the result of `hierarchy` if `P` is a projector before every level that has a
//! following level. So only the last two levels may use a direction partially. Otherwise the algorithm reports that its result is not
//! valid. The result is also not valid if a threshold is so small that one rotation is not accurate enough.
//!
//! The code does not branch on numbers, so that a program (the recorded and compiled code) and a direct solve have the same bits.

use super::level_rows::load;
use super::lq::product;
use super::{BranchFree, Parameters};
use crate::priority::method::{PriorityMethod, TAME};
use crate::priority::settings::Settings;
use crate::scalar::Real;

/// The algorithm is valid only if the square of the threshold exceeds this fraction of the squared Frobenius norm of the level. The
/// rounding error divided by the threshold is then about 1e-13 at most.
const LEAST: f64 = 1e-6;

/// If the square of a singular value is below this fraction of the squared threshold, its direction counts as unused.
const UNUSED: f64 = 1e-16;

/// The closed-form algorithm for stacks of one size, with its memory.
#[derive(Debug, Clone)]
pub struct TwoRowLevels<S> {
    n: usize,
    rows: Vec<usize>,
    damped: bool,
    parameters: Parameters<S>,
    /// The stack in the coordinates of the metric.
    j: Vec<S>,
    /// The rows of the stack multiplied with the projectors of the levels above.
    projected: Vec<S>,
    y: Vec<S>,
    /// For each rotated row, `1 / s^2` if the row uses its direction completely, otherwise zero.
    full: Vec<S>,
    /// The squares of the present thresholds.
    threshold2: Vec<S>,
    /// The joint velocities, shape `(n,)`, rad/s or m/s.
    pub v: Vec<S>,
    /// The residuals, shape `(sum rows,)`, in the units of the tasks.
    pub residual: Vec<S>,
    /// The number of realised directions of each level.
    pub ranks: Vec<S>,
    /// For each level, one if it is singular, otherwise zero.
    pub singular: Vec<S>,
}

/// One direction of a level: its row `g`, its command, and whether it is used.
struct Direction<'a, S> {
    g: &'a [S],
    /// The square of the singular value, `s^2 = g g'`.
    s2: S,
    command: S,
    /// One if the direction is still free, otherwise zero.
    open: S,
}

impl<S> TwoRowLevels<S> {
    /// Whether the algorithm applies: no level has more than two rows, and the method is `clamp` or `damped`.
    pub fn applies(rows: &[usize], method: PriorityMethod) -> bool {
        method.damps() && rows.iter().all(|&m| m <= 2)
    }
}

impl<S: Real> BranchFree<S> for TwoRowLevels<S> {
    fn new(n: usize, rows: &[usize], settings: &Settings) -> Self {
        let (zeros, total) = (|k: usize| vec![S::zero(); k], rows.iter().sum::<usize>());
        TwoRowLevels {
            n,
            rows: rows.to_vec(),
            damped: settings.method == PriorityMethod::Damped,
            parameters: Parameters::new(settings),
            j: zeros(total * n),
            projected: zeros(total * n),
            y: zeros(n),
            full: zeros(total),
            threshold2: zeros(rows.len()),
            v: zeros(n),
            residual: zeros(total),
            ranks: zeros(rows.len()),
            singular: zeros(rows.len()),
        }
    }

    fn operations(n: usize, rows: &[usize]) -> usize {
        let total = rows.iter().sum::<usize>();
        n * total * (total + rows.len())
    }

    fn results(&self) -> [&[S]; 5] {
        [&self.v, &self.residual, &self.ranks, &self.singular, &[]]
    }

    fn parameters(&mut self) -> &mut Parameters<S> {
        &mut self.parameters
    }

    fn solve(&mut self, _rounding: S, jacobian: &[S], command: &[S], _upper: &[S]) -> S {
        let (zero, one) = (S::zero(), S::splat(1.0));
        let TwoRowLevels { n, rows, j, projected, parameters, y, threshold2: thresholds, .. } = self;
        let (n, total) = (*n, j.len() / *n);
        y.fill(zero);
        let (mut at, mut valid) = (0, one);
        for (i, &m) in rows.iter().enumerate() {
            let level = at * n..(at + m) * n;
            at += m;
            let [row_norm2, norm2] = load(&jacobian[level.clone()], parameters.metric.as_ref(), &mut j[level], n);
            let threshold2 = parameters.threshold2(i, row_norm2);
            thresholds[i] = threshold2;
            if m > 0 {
                let bounds = [(S::splat(TAME.start), norm2), (norm2, S::splat(TAME.end)), (S::splat(LEAST) * norm2, threshold2)];
                let bounds = bounds.into_iter().chain([(threshold2, S::splat(TAME.end))]);
                valid = bounds.fold(valid, |valid, (low, high)| S::select(low.lt(high), valid, zero));
            }
        }
        projected.copy_from_slice(j);
        let (mut at, mut used, mut is_projector) = (0, zero, one);
        for i in 0..self.rows.len() {
            let m = self.rows[i];
            (self.ranks[i], self.singular[i]) = (zero, zero);
            if m == 0 {
                continue;
            }
            if at + m < total {
                valid = S::select(zero.lt(is_projector), valid, zero);
            }
            is_projector = self.level(i, at, command, used) * is_projector;
            used += self.ranks[i];
            at += m;
        }
        let TwoRowLevels { v, y, parameters, residual, .. } = self;
        v.copy_from_slice(y);
        if let Some(metric) = &parameters.metric {
            metric.velocity(v);
        }
        let infinity = S::splat(f64::INFINITY);
        residual.iter_mut().zip(jacobian.chunks_exact(n)).zip(command).fold(valid, |valid, ((residual, row), &command)| {
            *residual = command - product(row, v);
            S::select(residual.abs().lt(infinity), valid, zero)
        })
    }
}

impl<S: Real> TwoRowLevels<S> {
    /// Solve level `i`, whose rows begin at `at`, when `used` directions are already used. Return one if `P` is still a projector,
    /// otherwise zero.
    fn level(&mut self, i: usize, at: usize, command: &[S], used: S) -> S {
        let TwoRowLevels { n, rows, j, projected, y, full, damped, threshold2, ranks, singular, .. } = self;
        let (n, m, threshold2, zero, one) = (*n, rows[i], threshold2[i], S::zero(), S::splat(1.0));
        let (above, below) = projected.split_at_mut((at + m) * n);
        let mut errors = [zero; 2];
        let rows = j[at * n..(at + m) * n].chunks_exact(n);
        errors.iter_mut().zip(&command[at..]).zip(rows).for_each(|((error, &command), row)| *error = command - product(row, y));
        let (turned, own) = above.split_at_mut(at * n);
        // The projection is repeated, because rounding errors along used directions would be divided by the square of the threshold.
        for row in own.chunks_exact_mut(n) {
            turned.chunks_exact(n).zip(&*full).for_each(|(g, &share)| remove(row, [(g, share)]));
        }
        let (first, second) = own.split_at_mut(n);
        if m == 2 {
            rotate(first, second, &mut errors);
        }
        let free = S::splat(n as f64) - used;
        let squares = [product(first, first), product(second, second)];
        // If only one direction is free, the larger row uses it.
        let (some, both) = (S::select(S::splat(0.5).lt(free), one, zero), S::select(S::splat(1.5).lt(free), one, zero));
        let mut open = [some, zero];
        if m == 2 {
            let lesser = squares[0].lt(squares[1]);
            open = [(both, some), (some, both)].map(|(yes, no)| S::select(lesser, yes, no));
        }
        let of = |k: usize, g| Direction { g, s2: squares[k], command: errors[k], open: open[k] };
        let directions = [of(0, &*first), of(1, &*second)];
        let directions = &directions[..m];
        let lambda2 = if *damped { lambda2(directions, threshold2) } else { zero };
        let (mut is_projector, mut shares) = (one, [zero; 2]);
        for (k, (direction, share)) in directions.iter().zip(&mut shares).enumerate() {
            let &Direction { g, s2, command, open } = direction;
            let (there, partial) = (zero.lt(open), s2.lt(threshold2));
            *share = S::select(there, one / s2.max(threshold2), zero);
            full[at + k] = S::select(partial, zero, *share);
            let gain = if *damped { S::select(there, one / (s2 + lambda2), zero) } else { *share };
            let along = gain * command;
            y.iter_mut().zip(g).for_each(|(y, &g)| *y = along.mul_add(g, *y));
            ranks[i] += S::select(there, S::select(partial, zero, one), zero);
            let leaves = S::select(partial, S::select((S::splat(UNUSED) * threshold2).lt(s2), zero, one), one);
            is_projector = S::select(there, leaves * is_projector, is_projector);
        }
        let most = S::splat(m as f64).min(free) - S::splat(0.5);
        singular[i] = S::select(ranks[i].lt(most), one, zero);
        for row in below.chunks_exact_mut(n) {
            match directions {
                [one] => remove(row, [(one.g, shares[0])]),
                [one, other] => remove(row, [(one.g, shares[0]), (other.g, shares[1])]),
                _ => {}
            }
        }
        is_projector
    }
}

/// Compute `x <- x - x sum share g' g` for the rows `g` with their weights `share`.
fn remove<S: Real, const K: usize>(x: &mut [S], directions: [(&[S], S); K]) {
    let parts = directions.map(|(g, share)| -share * product(x, g));
    for ((g, _), part) in directions.into_iter().zip(parts) {
        x.iter_mut().zip(g).for_each(|(x, &g)| *x = part.mul_add(g, *x));
    }
}

/// Rotate two rows and their commands so that the rows become orthogonal. Of the two possible angles, use the smaller one.
fn rotate<S: Real>(a: &mut [S], b: &mut [S], commands: &mut [S; 2]) {
    let (one, both) = (S::splat(1.0), product(a, b));
    let (d, w) = (product(b, b) - product(a, a), both + both);
    let root = d.mul_add(d, w.mul_add(w, S::splat(f64::MIN_POSITIVE))).sqrt();
    let t = w / S::select(d.lt(S::zero()), d - root, d + root);
    let c = one / t.mul_add(t, one).sqrt();
    let s = t * c;
    let turn = |a: S, b: S| (s.neg_mul_add(b, c * a), s.mul_add(a, c * b));
    a.iter_mut().zip(b).for_each(|(a, b)| (*a, *b) = turn(*a, *b));
    let [c0, c1] = *commands;
    (commands[0], commands[1]) = turn(c0, c1);
}

/// Return the square of `lambda = eps (1 - prod min(1, s / eps))`. The product is over the free directions of the level. `threshold2` is
/// `eps^2`.
fn lambda2<S: Real>(directions: &[Direction<S>], threshold2: S) -> S {
    let one = S::splat(1.0);
    let manipulability = directions.iter().fold(one, |all, direction| {
        let share = S::select(direction.s2.lt(threshold2), (direction.s2 / threshold2).sqrt(), one);
        all * S::select(S::zero().lt(direction.open), share, one)
    });
    let left = one - manipulability;
    threshold2 * left * left
}
