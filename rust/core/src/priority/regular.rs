//! Equation (5) away from singularities: with the stack `J_E = [J1; J2; ..] = L Q` (LQ factorisation by Householder reflections),
//! the prioritised solution is `v = Q' y` with `L y = [v1; v2; ..]` by forward substitution, because the diagonal block
//! `T_i` of `L` is `J_i N_{i-1}` in an orthonormal basis of the null space of the levels above.
//!
//! The route is taken only where it is provably the same map as the recursion over singular values: `1/|T_i^-1|_F` bounds the
//! smallest singular value of `J_i N_{i-1}` from below, and must reach `eps_i` (`clamp`, `damped`) or pass the rank rule with
//! six digits to spare (`exact`). Otherwise it declines, having decided nothing, and `levels` takes over.
//!
//! One source for a single stack and for a recording: nothing here branches on the numbers, so that the program of a recording and a
//! direct solve of the same instruction set agree to the bit.

use super::lq::{Factor, product, tall};
use super::method::{DEFAULT_EPS, PriorityMethod};
use super::metric::Metric;
use super::workspace::TAME;
use crate::scalar::{Float, Real};
use crate::trace::Evaluation;

/// `exact` takes this route only for relative singular values above it, where forward substitution loses no digits that count.
const EXACT_FLOOR: f64 = 1e-6;

/// The route for stacks of one size, with its buffers.
#[derive(Debug, Clone)]
pub struct Regular<S> {
    n: usize,
    rows: Vec<usize>,
    /// Levels that fit into the freedom left: their rows come first and are rows of `L`.
    fitting: usize,
    exact: bool,
    /// Squares of the thresholds, where they are given.
    eps2: Option<Vec<S>>,
    metric: Option<Metric<S>>,
    factor: Factor<S>,
    /// The rows of the level that does not fit, where freedom is left for it.
    tall: Vec<S>,
    /// Squares of the largest row norm and of the Frobenius norm of each level.
    most2: Vec<S>,
    norm2: Vec<S>,
    r: Vec<S>,
    z: Vec<S>,
    /// The answer: joint velocities `(n,)` and residuals `(sum rows,)`.
    pub v: Vec<S>,
    pub residual: Vec<S>,
}

impl<S: Real> Regular<S> {
    /// For levels of these sizes, thresholds and metric; `None` for a method that does not take this route.
    pub fn new(n: usize, rows: &[usize], method: PriorityMethod, eps: Option<&[f64]>, metric: Option<&Metric>) -> Option<Self> {
        if !method.has_regular_route() {
            return None;
        }
        let (mut fit, mut fitting) = (0, 0);
        while fitting < rows.len() && fit + rows[fitting] <= n {
            fit += rows[fitting];
            fitting += 1;
        }
        let behind = if fit < n { rows.get(fitting).copied().unwrap_or(0) } else { 0 };
        let most = rows.iter().copied().max().unwrap_or(0).max(n);
        let zeros = |k: usize| vec![S::zero(); k];
        let mut route = Regular {
            n,
            rows: rows.to_vec(),
            fitting,
            exact: method == PriorityMethod::Exact,
            eps2: None,
            metric: metric.map(Metric::lift),
            factor: Factor::new(n, fit),
            tall: zeros(behind * n),
            most2: zeros(rows.len()),
            norm2: zeros(rows.len()),
            r: zeros(most),
            z: zeros(most),
            v: zeros(n),
            residual: zeros(rows.iter().sum()),
        };
        if let Some(eps) = eps {
            route.set_eps(eps);
        }
        Some(route)
    }

    pub fn set_eps(&mut self, eps: &[f64]) {
        self.eps2 = Some(eps.iter().map(|eps| S::from_lanes(|_| eps * eps)).collect());
    }

    /// Solve into `v` and `residual` for the stack `(sum rows, n)` and its command; one where the route stands, zero where some level is
    /// not provably regular or some number is not tame.
    pub fn solve(&mut self, rounding: S, jacobian: &[S], command: &[S]) -> S {
        self.load(jacobian);
        self.factor.y.fill(S::zero());
        let fit = self.rows[..self.fitting].iter().sum::<usize>();
        for at in 0..fit {
            self.factor.eliminate(at, command[at]);
        }
        let stands = self.judge(rounding, command);
        let Regular { n, metric, factor, v, residual, .. } = self;
        factor.turn_back(v);
        if let Some(metric) = metric {
            metric.velocity(v);
        }
        // What is not finite compares with nothing.
        let (zero, infinity) = (S::zero(), S::splat(f64::INFINITY));
        residual.iter_mut().zip(jacobian.chunks_exact(*n)).zip(command).fold(stands, |stands, ((residual, row), &command)| {
            *residual = command - product(row, v);
            S::select(residual.abs().lt(infinity), stands, zero)
        })
    }

    /// The stack in the coordinates of the metric, and the norms of its levels.
    fn load(&mut self, jacobian: &[S]) {
        let Regular { n, rows, fitting, metric, factor, tall, most2, norm2, .. } = self;
        let (n, fit) = (*n, factor.l.len());
        let mut at = 0;
        for (i, &m) in rows.iter().enumerate().take(*fitting + 1) {
            let level = if i < *fitting { &mut factor.l[at..at + m * n] } else { &mut tall[..] };
            debug_assert!(i < *fitting || at == fit, "the level that does not fit comes behind those that do");
            let (mut most, mut sum) = (S::zero(), S::zero());
            for (row, given) in level.chunks_exact_mut(n).zip(jacobian[at..].chunks_exact(n)) {
                row.copy_from_slice(given);
                if let Some(metric) = metric {
                    metric.row(row);
                }
                let row2 = product(row, row);
                most = S::select(most.lt(row2), row2, most);
                sum += row2;
            }
            (most2[i], norm2[i]) = (most, sum);
            at += m * n;
        }
    }

    /// Whether every level is regular, with the coordinates of the level that does not fit.
    fn judge(&mut self, rounding: S, command: &[S]) -> S {
        let Regular { n, rows, fitting, exact, eps2, factor, tall: behind, most2, norm2, r, z, .. } = self;
        let (one, zero) = (S::splat(1.0), S::zero());
        let (mut stands, mut used, mut condition) = (one, 0, one);
        for (i, &m) in rows.iter().enumerate() {
            let p = m.min(*n - used);
            // A level without rows or freedom decides nothing, so that it cannot change the route of the levels above it.
            if p == 0 {
                continue;
            }
            let norm2 = norm2[i];
            stands = S::select(S::splat(TAME.start).lt(norm2), S::select(norm2.lt(S::splat(TAME.end)), stands, zero), zero);
            let inverse2 = if i < *fitting {
                factor.inverse_norm2(used, m, z)
            } else {
                behind.chunks_exact_mut(*n).for_each(|row| factor.turn(row));
                tall(behind, &command[used..used + m], used, &mut factor.y, r, z)
            };
            used += p;
            let excess = if *exact {
                let relative2 = inverse2 * norm2;
                let floor = S::splat(EXACT_FLOOR).max(rounding * condition);
                condition *= relative2.sqrt();
                relative2 * floor * floor
            } else {
                inverse2 * eps2.as_ref().map_or(S::splat(DEFAULT_EPS * DEFAULT_EPS) * most2[i], |eps2| eps2[i])
            };
            // NaN fails every comparison and declines.
            stands = S::select(one.lt(excess), zero, S::select(excess.lt(S::splat(2.0)), stands, zero));
        }
        stands
    }
}

/// Directions of every level that are realised where the route stands.
pub(super) fn regular_ranks(n: usize, rows: &[usize]) -> impl Iterator<Item = usize> {
    rows.iter().scan(n, |free, &m| {
        let p = m.min(*free);
        *free -= p;
        Some(p)
    })
}

/// The route for single stacks.
#[derive(Debug, Clone)]
pub(super) struct Single {
    direct: Regular<Float>,
    /// With the same bits, once somebody made it.
    program: Option<Evaluation>,
}

impl Single {
    /// As [`Regular::new`].
    pub fn new(n: usize, rows: &[usize], method: PriorityMethod, eps: Option<&[f64]>, metric: Option<&Metric>) -> Option<Self> {
        let direct = Regular::new(n, rows, method, eps, metric)?;
        Some(Single { direct, program: None })
    }

    /// Take this program, of [`PrioritySolver::of_stacks`](super::PrioritySolver), from now on.
    pub fn take(&mut self, program: Option<Evaluation>) {
        self.program = program;
    }

    /// The program is of other thresholds.
    pub fn set_eps(&mut self, eps: &[f64]) {
        self.program = None;
        self.direct.set_eps(eps);
    }

    /// Solve into `v` and `residual`; false where the route declines.
    pub fn solve(&mut self, rounding: f64, jacobian: &[f64], command: &[f64], v: &mut [f64], residual: &mut [f64]) -> bool {
        if let Some(program) = &mut self.program {
            let (given, rest) = program.inputs(0, jacobian.len() + command.len() + 1).split_at_mut(jacobian.len());
            given.copy_from_slice(jacobian);
            rest[..command.len()].copy_from_slice(command);
            rest[command.len()] = rounding;
            program.run();
            v.copy_from_slice(program.outputs(1, v.len()));
            residual.copy_from_slice(program.outputs(1 + v.len(), residual.len()));
            return program.output(0) == [1.0];
        }
        let stands = self.direct.solve(Float(rounding), Float::of(jacobian), Float::of(command));
        Float::of_mut(v).copy_from_slice(&self.direct.v);
        Float::of_mut(residual).copy_from_slice(&self.direct.residual);
        stands == Float(1.0)
    }
}
