//! Levels of at most two rows in closed form, also at singularities. One rotation makes the rows of a projected level orthogonal (one step
//! of one-sided Jacobi; Golub and Van Loan, Matrix Computations, 8.6). The norms of these rows are the singular values:
//!
//! `G = R J_i P`,  `v += G' diag(h) R (v_i - J_i v)`,  `P <- P - G' diag(q) G`,  `q = 1 / max(s^2, eps^2)`.
//!
//! `R` is the rotation, `s` the norm of a row of `G`, and `P` the projector on the free directions, at first `P = I`. For `clamp`, `h = q`.
//! For `damped`, `h = 1 / (s^2 + lambda^2)`. The result equals the result of `levels` if `P` is a projector before every level that has a
//! following level. So only the last two levels may use a direction partially. Otherwise the algorithm reports that its result is not
//! valid. The result is also not valid if a threshold is so small that one rotation is not accurate enough.
//!
//! The code does not branch on numbers, so that a program (the recorded and compiled code) and a direct solve have the same bits.

use super::lq::product;
use super::method::{PriorityMethod, TAME};
use super::metric::{Metric, load};
use super::regular::threshold2;
use crate::scalar::Real;
use crate::trace::function::Evaluation;

/// The algorithm is valid only if the square of the threshold exceeds this fraction of the squared Frobenius norm of the level. The
/// rounding error divided by the threshold is then about 1e-13 at most.
const LEAST: f64 = 1e-6;

/// If the square of a singular value is below this fraction of the squared threshold, its direction counts as unused.
const UNUSED: f64 = 1e-16;

/// The number of direct solves after which a program is made.
pub(super) const CALLS_BEFORE_PROGRAM: u64 = 16;

/// The closed-form algorithm for stacks of one size, with its memory.
#[derive(Debug, Clone)]
pub(super) struct PairRoute<S> {
    n: usize,
    rows: Vec<usize>,
    damped: bool,
    /// The squares of the thresholds in the options.
    eps2: Option<Vec<S>>,
    metric: Option<Metric<S>>,
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
    /// For each level, one if a direction is lost, otherwise zero.
    pub lost: Vec<S>,
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

impl<S: Real> PairRoute<S> {
    /// Return the closed-form algorithm for levels of these sizes, thresholds and metric. The result is `None` if a level has more than two
    /// rows, and for other methods than `clamp` and `damped`.
    pub fn new(n: usize, rows: &[usize], method: PriorityMethod, eps: Option<&[f64]>, metric: Option<&Metric>) -> Option<Self> {
        if !method.damps() || rows.iter().any(|&m| m > 2) {
            return None;
        }
        let (zeros, total) = (|k: usize| vec![S::zero(); k], rows.iter().sum::<usize>());
        Some(PairRoute {
            n,
            rows: rows.to_vec(),
            damped: method == PriorityMethod::Damped,
            eps2: eps.map(|eps| eps.iter().map(|eps| S::varying(eps * eps)).collect()),
            metric: metric.map(Metric::lift),
            j: zeros(total * n),
            projected: zeros(total * n),
            y: zeros(n),
            full: zeros(total),
            threshold2: zeros(rows.len()),
            v: zeros(n),
            residual: zeros(total),
            ranks: zeros(rows.len()),
            lost: zeros(rows.len()),
        })
    }

    fn set_eps(&mut self, eps: &[f64]) {
        let own = self.eps2.get_or_insert_with(|| vec![S::zero(); eps.len()]);
        own.iter_mut().zip(eps).for_each(|(own, eps)| *own = S::varying(eps * eps));
    }

    /// Solve the stack `jacobian`, shape `(sum rows, n)`, for the command `command`. Return one if the result is valid, otherwise zero.
    pub fn solve(&mut self, jacobian: &[S], command: &[S]) -> S {
        let (zero, one) = (S::zero(), S::splat(1.0));
        let PairRoute { n, rows, j, projected, metric, y, eps2, threshold2: thresholds, .. } = self;
        let (n, total) = (*n, j.len() / *n);
        y.fill(zero);
        let (mut at, mut stands) = (0, one);
        for (i, &m) in rows.iter().enumerate() {
            let level = at * n..(at + m) * n;
            at += m;
            let [most2, norm2] = load(&jacobian[level.clone()], metric.as_ref(), &mut j[level], n);
            let threshold2 = threshold2(eps2.as_deref(), i, most2);
            thresholds[i] = threshold2;
            if m > 0 {
                let bounds = [(S::splat(TAME.start), norm2), (norm2, S::splat(TAME.end)), (S::splat(LEAST) * norm2, threshold2)];
                let bounds = bounds.into_iter().chain([(threshold2, S::splat(TAME.end))]);
                stands = bounds.fold(stands, |stands, (low, high)| S::select(low.lt(high), stands, zero));
            }
        }
        projected.copy_from_slice(j);
        let (mut at, mut used, mut whole) = (0, zero, one);
        for i in 0..self.rows.len() {
            let m = self.rows[i];
            (self.ranks[i], self.lost[i]) = (zero, zero);
            if m == 0 {
                continue;
            }
            if at + m < total {
                stands = S::select(zero.lt(whole), stands, zero);
            }
            whole = self.level(i, at, command, used) * whole;
            used += self.ranks[i];
            at += m;
        }
        let PairRoute { v, y, metric, residual, .. } = self;
        v.copy_from_slice(y);
        if let Some(metric) = metric {
            metric.velocity(v);
        }
        let infinity = S::splat(f64::INFINITY);
        residual.iter_mut().zip(jacobian.chunks_exact(n)).zip(command).fold(stands, |stands, ((residual, row), &command)| {
            *residual = command - product(row, v);
            S::select(residual.abs().lt(infinity), stands, zero)
        })
    }

    /// Solve level `i`, whose rows begin at `at`, when `used` directions are already used. Return one if `P` is still a projector,
    /// otherwise zero.
    fn level(&mut self, i: usize, at: usize, command: &[S], used: S) -> S {
        let PairRoute { n, rows, j, projected, y, full, damped, threshold2, ranks, lost, .. } = self;
        let (n, m, threshold2, zero, one) = (*n, rows[i], threshold2[i], S::zero(), S::splat(1.0));
        let (above, below) = projected.split_at_mut((at + m) * n);
        let mut rest = [zero; 2];
        let rows = j[at * n..(at + m) * n].chunks_exact(n);
        rest.iter_mut().zip(&command[at..]).zip(rows).for_each(|((rest, &command), row)| *rest = command - product(row, y));
        let (turned, own) = above.split_at_mut(at * n);
        // The projection is repeated, because rounding errors along used directions would be divided by the square of the threshold.
        for row in own.chunks_exact_mut(n) {
            turned.chunks_exact(n).zip(&*full).for_each(|(g, &share)| remove(row, [(g, share)]));
        }
        let (first, second) = own.split_at_mut(n);
        if m == 2 {
            rotate(first, second, &mut rest);
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
        let of = |k: usize, g| Direction { g, s2: squares[k], command: rest[k], open: open[k] };
        let directions = [of(0, &*first), of(1, &*second)];
        let directions = &directions[..m];
        let lambda2 = if *damped { lambda2(directions, threshold2) } else { zero };
        let (mut whole, mut shares) = (one, [zero; 2]);
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
            whole = S::select(there, leaves * whole, whole);
        }
        let most = S::splat(m as f64).min(free) - S::splat(0.5);
        lost[i] = S::select(ranks[i].lt(most), one, zero);
        for row in below.chunks_exact_mut(n) {
            match directions {
                [one] => remove(row, [(one.g, shares[0])]),
                [one, other] => remove(row, [(one.g, shares[0]), (other.g, shares[1])]),
                _ => {}
            }
        }
        whole
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
fn rotate<S: Real>(a: &mut [S], b: &mut [S], rest: &mut [S; 2]) {
    let (one, both) = (S::splat(1.0), product(a, b));
    let (d, w) = (product(b, b) - product(a, a), both + both);
    let root = d.mul_add(d, w.mul_add(w, S::splat(f64::MIN_POSITIVE))).sqrt();
    let t = w / S::select(d.lt(S::zero()), d - root, d + root);
    let c = one / t.mul_add(t, one).sqrt();
    let s = t * c;
    let turn = |a: S, b: S| (s.neg_mul_add(b, c * a), s.mul_add(a, c * b));
    a.iter_mut().zip(b).for_each(|(a, b)| (*a, *b) = turn(*a, *b));
    let [r0, r1] = *rest;
    (rest[0], rest[1]) = turn(r0, r1);
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

/// The closed-form algorithm for single stacks.
#[derive(Debug, Clone)]
pub(super) struct SinglePairs {
    direct: PairRoute<f64>,
    /// The program of the algorithm, after it has been made. It has the same bits as `direct`.
    program: Option<Evaluation>,
    solves: u64,
}

/// The results: joint velocities, residuals, numbers of realised directions, and whether a direction is lost.
pub(super) struct Answer<'a> {
    pub v: &'a mut [f64],
    pub residual: &'a mut [f64],
    pub ranks: &'a mut [usize],
    pub lost: &'a mut [bool],
}

impl SinglePairs {
    /// Create the algorithm with [`PairRoute::new`].
    pub fn new(n: usize, rows: &[usize], method: PriorityMethod, eps: Option<&[f64]>, metric: Option<&Metric>) -> Option<Self> {
        PairRoute::new(n, rows, method, eps, metric).map(|direct| SinglePairs { direct, program: None, solves: 0 })
    }

    /// Set the thresholds, and discard the program, which contains the old thresholds.
    pub fn set_eps(&mut self, eps: &[f64]) {
        (self.program, self.solves) = (None, 0);
        self.direct.set_eps(eps);
    }

    /// Replace the factor of the metric, and discard the program, which contains the old factor.
    pub fn set_metric(&mut self, factor: &[f64]) {
        (self.program, self.solves) = (None, 0);
        if let Some(metric) = &mut self.direct.metric {
            metric.set_factor(factor);
        }
    }

    /// Whether a program should be made now, because of repeated calls.
    pub fn wants_program(&self) -> bool {
        self.program.is_none() && self.solves == CALLS_BEFORE_PROGRAM
    }

    /// From now on, use a program made with `PrioritySolver::of_pairs`.
    pub fn take(&mut self, program: Option<Evaluation>) {
        self.solves += 1;
        self.program = program;
    }

    /// Solve a stack. Return false if the result is not valid.
    pub fn solve(&mut self, jacobian: &[f64], command: &[f64], answer: Answer) -> bool {
        let Answer { v, residual, ranks, lost } = answer;
        let (n, total, levels) = (v.len(), residual.len(), ranks.len());
        if let Some(program) = &mut self.program {
            let (given, rest) = program.inputs(0, jacobian.len() + command.len()).split_at_mut(jacobian.len());
            given.copy_from_slice(jacobian);
            rest.copy_from_slice(command);
            program.run();
            v.copy_from_slice(program.outputs(1, n));
            residual.copy_from_slice(program.outputs(1 + n, total));
            ranks.iter_mut().zip(program.outputs(1 + n + total, levels)).for_each(|(to, &rank)| *to = rank as usize);
            lost.iter_mut().zip(program.outputs(1 + n + total + levels, levels)).for_each(|(to, &lost)| *to = lost > 0.0);
            return program.output(0) == [1.0];
        }
        self.solves += u64::from(self.solves < CALLS_BEFORE_PROGRAM);
        let stands = self.direct.solve(jacobian, command);
        v.copy_from_slice(&self.direct.v);
        residual.copy_from_slice(&self.direct.residual);
        ranks.iter_mut().zip(&self.direct.ranks).for_each(|(to, rank)| *to = *rank as usize);
        lost.iter_mut().zip(&self.direct.lost).for_each(|(to, lost)| *to = *lost > 0.0);
        stands == 1.0
    }
}
