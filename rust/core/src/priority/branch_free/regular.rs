//! The solution of a stack (equation (5) in `mod.rs`) away from singularities. The stack is factored as `J_E = [J1; J2; ..] = L Q` (LQ
//! factorisation by Householder reflections). The prioritised solution is `v = Q' y` with the transpose `Q'`, where forward substitution
//! solves `L y = [v1; v2; ..]`. This holds because the diagonal block `T_i` of `L` is `J_i N_{i-1}` in an orthonormal basis of the null
//! space of the levels above.
//!
//! The result is valid only if it provably equals the result of the recursion in `hierarchy`. The number `1/|T_i^-1|_F` is a lower bound of
//! the smallest singular value of `J_i N_{i-1}`. For `clamp` and `damped`, it must reach `eps_i`. For the other methods, it must reach
//! `1e-6 |J_i|_F` and satisfy the rank rule of `hierarchy`. Otherwise the result is not valid, and another algorithm solves the stack.
//!
//! With bounds of the joint velocities, zero velocity must be within them. For every `i`, the solution of levels 1 to `i` must also be within
//! them. The result then equals the solution of `exact`. For `chiaverini`, the result is the sum of `P_{i-1} J_i# v_i` with the ranks of `exact`. `P_{i-1}`
//! removes the coordinates of the levels above, and `1/|J_i#|_F` must reach `eps_i`.
//!
//! Direct solves and recordings use the same code, which never branches on numbers. So a program (the recorded and compiled code) and a
//! direct solve with the same instruction set have the same bits.

use super::Parameters;
use super::level_rows::load;
use super::lq::{Factor, least_squares, product};
use super::single_levels::SingleLevels;
use crate::priority::method::{PriorityMethod, TAME};
use crate::priority::metric::Metric;
use crate::priority::settings::Settings;
use crate::scalar::Real;

/// The methods `exact`, `chiaverini` and `sns` use this algorithm only if all singular values, divided by `|J_i|_F`, are above this limit.
/// Their reciprocals amplify the rounding errors of forward substitution.
const EXACT_FLOOR: f64 = 1e-6;

/// The algorithm `regular` for stacks of one size, with its memory. It computes the prioritised solution away from singularities, by an LQ
/// factorisation of the stacked Jacobians.
///
/// ```
/// use armlet_core::priority::{PriorityOptions, PrioritySolver};
///
/// // `J v = 1` with `J = [2, 0]`: `v = [1/2, 0]`.
/// let mut regular = PrioritySolver::new(2, &[1], &PriorityOptions::default())?.regular::<f64>();
/// assert_eq!(regular.solve(1e-15, &[2.0, 0.0], &[1.0]), 1.0);
/// assert!((regular.v[0] - 0.5).abs() < 1e-15 && regular.v[1] == 0.0);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Regular<S> {
    n: usize,
    rows: Vec<usize>,
    /// The number of levels that fit into the free directions. Their rows are the first rows of the stack, and are the rows of `L`.
    fitting: usize,
    method: PriorityMethod,
    parameters: Parameters<S>,
    /// The lower and upper bounds of the joint velocities, and whether there are any.
    bounds: [Vec<S>; 2],
    is_bounded: bool,
    /// The solver of single levels for `chiaverini`.
    single_levels: Option<SingleLevels<S>>,
    factor: Factor<S>,
    /// The rows of the first level that does not fit.
    tall: Vec<S>,
    /// For each level, the square of its largest row norm.
    row_norm2: Vec<S>,
    /// For each level, the square of its Frobenius norm.
    frobenius2: Vec<S>,
    /// Memory for the residual of a level that does not fit, and for a column of an inverse.
    residual_of_level: Vec<S>,
    column: Vec<S>,
    /// The joint velocities, shape `(n,)`, rad/s or m/s.
    pub v: Vec<S>,
    /// The residuals, shape `(sum rows,)`, in the units of the tasks.
    pub residual: Vec<S>,
}

impl<S: Real> Regular<S> {
    /// Set the bounds of the joint velocities, shape `(n,)` each, rad/s or m/s.
    pub fn set_bounds(&mut self, v_min: &[f64], v_max: &[f64]) {
        for (own, given) in self.bounds.iter_mut().zip([v_min, v_max]) {
            own.iter_mut().zip(given).for_each(|(own, &bound)| *own = S::varying(bound));
        }
    }

    /// The lower and upper bounds of the joint velocities, shape `(n,)` each, rad/s or m/s.
    pub fn bounds_mut(&mut self) -> &mut [Vec<S>; 2] {
        &mut self.bounds
    }

    /// The bounds of the joint velocities; empty without bounds.
    pub(in crate::priority) fn bounds(&self) -> [&[S]; 2] {
        if self.is_bounded { [&self.bounds[0], &self.bounds[1]] } else { [&[], &[]] }
    }

    /// The metric of the joint velocities.
    pub(in crate::priority) fn metric(&self) -> Option<&Metric<S>> {
        self.parameters.metric.as_ref()
    }

    /// The numbers that differ between runs: the squares of the thresholds, the factor of the metric, and the bounds of the joint
    /// velocities.
    pub(in crate::priority) fn parameters(&self) -> impl Iterator<Item = &S> {
        let bounds = if self.is_bounded { &self.bounds[..] } else { &[] };
        self.parameters.eps2.iter().flatten().chain(self.parameters.metric.iter().flat_map(Metric::factor)).chain(bounds.iter().flatten())
    }

    /// Solve the stack `jacobian`, shape `(sum rows, n)`, and write the results to `v` and `residual`. Return one if the result is valid.
    /// Return zero if a level is not provably regular, if a bound may be met, or if a number is extreme.
    pub fn solve(&mut self, rounding: S, jacobian: &[S], command: &[S]) -> S {
        self.load(jacobian);
        self.factor.y.fill(S::zero());
        let fit = self.rows[..self.fitting].iter().sum::<usize>();
        for at in 0..fit {
            self.factor.eliminate(at, command[at]);
        }
        let mut valid = self.validity(rounding, command);
        if self.method == PriorityMethod::Chiaverini {
            valid = self.sum_single_levels(valid, jacobian, command);
        }
        if self.is_bounded {
            valid = self.validity_of_bounds(valid);
        }
        self.joint_velocities(self.n);
        let Regular { n, v, residual, .. } = self;
        // `|residual| < infinity` is false for NaN, so that NaN makes the result invalid.
        let (zero, infinity) = (S::zero(), S::splat(f64::INFINITY));
        residual.iter_mut().zip(jacobian.chunks_exact(*n)).zip(command).fold(valid, |valid, ((residual, row), &command)| {
            *residual = command - product(row, v);
            S::select(residual.abs().lt(infinity), valid, zero)
        })
    }

    /// Compute the joint velocities `v` from the first `used` coordinates.
    fn joint_velocities(&mut self, used: usize) {
        self.factor.velocity_of_first(used, &mut self.v);
        if let Some(metric) = &self.parameters.metric {
            metric.velocity(&mut self.v);
        }
    }

    /// Return `valid`, which is one for a valid result. Return zero instead if zero velocity, or the solution of levels 1 to `i` for some
    /// `i`, is out of bounds.
    fn validity_of_bounds(&mut self, mut valid: S) -> S {
        let mut used = 0;
        self.v.fill(S::zero());
        for i in 0..self.rows.len() {
            valid = self.within(valid);
            used = self.n.min(used + self.rows[i]);
            self.joint_velocities(used);
        }
        self.within(valid)
    }

    /// Return `valid` if `v` is within the bounds, otherwise zero.
    fn within(&self, valid: S) -> S {
        let [lower, upper] = &self.bounds;
        let bounds = lower.iter().zip(upper);
        self.v
            .iter()
            .zip(bounds)
            .fold(valid, |valid, (&v, (&lower, &upper))| S::select(v.lt(lower), S::zero(), S::select(upper.lt(v), S::zero(), valid)))
    }

    /// Compute the coordinates of `sum P_{i-1} J_i# v_i`. Return `valid`, or zero if a level alone is close to a singularity.
    fn sum_single_levels(&mut self, mut valid: S, jacobian: &[S], command: &[S]) -> S {
        let Regular { n, rows, parameters, factor, single_levels, .. } = self;
        let (Some(single), mut start) = (single_levels, 0) else { return S::zero() };
        factor.y.fill(S::zero());
        for (i, &m) in rows.iter().enumerate().filter(|(_, m)| **m > 0) {
            // As for the other methods, a level without free directions has no effect.
            if start >= *n {
                break;
            }
            let level = start..start + m;
            let [inverse2, row_norm2] =
                single.solve(i, &jacobian[level.start * *n..level.end * *n], parameters.metric.as_ref(), &command[level.clone()]);
            factor.transform(&mut single.v);
            for c in start..*n {
                factor.y[c] += single.v[c];
            }
            let excess = inverse2 * parameters.threshold2(i, row_norm2);
            valid = S::select(S::splat(1.0).lt(excess), S::zero(), S::select(excess.lt(S::splat(2.0)), valid, S::zero()));
            start = level.end;
        }
        valid
    }

    /// For each level with free directions, write its rows in metric coordinates, and compute its norms.
    fn load(&mut self, jacobian: &[S]) {
        let Regular { n, rows, fitting, parameters, factor, tall, row_norm2, frobenius2, .. } = self;
        let (n, fit) = (*n, factor.l.len());
        let mut at = 0;
        for (i, &m) in rows.iter().enumerate().take(*fitting + 1) {
            let level = if i < *fitting { &mut factor.l[at..at + m * n] } else { &mut tall[..] };
            debug_assert!(i < *fitting || at == fit, "the level that does not fit comes behind those that do");
            [row_norm2[i], frobenius2[i]] = load(&jacobian[at..], parameters.metric.as_ref(), level, n);
            at += m * n;
        }
    }

    /// Return one if every level is regular, otherwise zero. Also compute the coordinates of the first level that does not fit.
    fn validity(&mut self, rounding: S, command: &[S]) -> S {
        let Regular { n, rows, fitting, method, parameters, factor, tall, row_norm2, frobenius2, residual_of_level, column, .. } = self;
        let (one, zero) = (S::splat(1.0), S::zero());
        let (mut valid, mut used, mut condition) = (one, 0, one);
        for (i, &m) in rows.iter().enumerate() {
            let p = m.min(*n - used);
            // A level without rows or free directions has no effect.
            if p == 0 {
                continue;
            }
            let norm2 = frobenius2[i];
            valid = S::select(S::splat(TAME.start).lt(norm2), S::select(norm2.lt(S::splat(TAME.end)), valid, zero), zero);
            let inverse2 = if i < *fitting {
                factor.inverse_norm2(used, m, column)
            } else {
                tall.chunks_exact_mut(*n).for_each(|row| factor.transform(row));
                least_squares(tall, &command[used..used + m], used, &mut factor.y, residual_of_level, column)
            };
            used += p;
            let excess = if !method.damps() {
                let relative2 = inverse2 * norm2;
                let floor = S::splat(EXACT_FLOOR).max(rounding * condition);
                condition *= relative2.sqrt();
                relative2 * floor * floor
            } else {
                inverse2 * parameters.threshold2(i, row_norm2[i])
            };
            // If `excess` is NaN, `excess < 2` is false, so that the result is invalid.
            valid = S::select(one.lt(excess), zero, S::select(excess.lt(S::splat(2.0)), valid, zero));
        }
        valid
    }
}

impl<S: Real> Regular<S> {
    /// Create the algorithm for `n` joints and levels of these sizes.
    pub(in crate::priority) fn new(n: usize, rows: &[usize], settings: &Settings) -> Self {
        let (mut fit, mut fitting) = (0, 0);
        while fitting < rows.len() && fit + rows[fitting] <= n {
            fit += rows[fitting];
            fitting += 1;
        }
        let tall = if fit < n { rows.get(fitting).copied().unwrap_or(0) } else { 0 };
        let most = rows.iter().copied().max().unwrap_or(0).max(n);
        let zeros = |k: usize| vec![S::zero(); k];
        let mut regular = Regular {
            n,
            rows: rows.to_vec(),
            fitting,
            method: settings.method,
            parameters: Parameters::new(settings),
            bounds: [f64::NEG_INFINITY, f64::INFINITY].map(|bound| vec![S::splat(bound); n]),
            is_bounded: settings.bounds.is_some(),
            single_levels: (settings.method == PriorityMethod::Chiaverini).then(|| SingleLevels::new(n, rows)),
            factor: Factor::new(n, fit),
            tall: zeros(tall * n),
            row_norm2: zeros(rows.len()),
            frobenius2: zeros(rows.len()),
            residual_of_level: zeros(most),
            column: zeros(most),
            v: zeros(n),
            residual: zeros(rows.iter().sum()),
        };
        settings.bounds.iter().for_each(|(v_min, v_max)| regular.set_bounds(v_min, v_max));
        regular
    }

    /// The rough number of operations for stacks of this size.
    pub(super) fn operations(n: usize, rows: &[usize]) -> usize {
        n * n * rows.iter().sum::<usize>()
    }

    /// The thresholds and the metric.
    pub(super) fn own_parameters(&mut self) -> &mut Parameters<S> {
        &mut self.parameters
    }

    /// Return the joint velocities `v` of the last solve, from its first `used` coordinates.
    pub(super) fn velocity_of_first(&mut self, used: usize) -> &[S] {
        self.joint_velocities(used);
        &self.v
    }

    /// Return the certificate of the last solve of the stack `jacobian`, as in `inequality`. It is the largest component of the gradients
    /// `J_i' w_i` along the directions that the levels above leave free. Each is divided by the largest term of its level.
    pub(super) fn stationarity(&mut self, jacobian: &[S]) -> S {
        let Regular { n, rows, parameters, factor, frobenius2, residual, column, .. } = self;
        let (n, reach) = (*n, product(&factor.y, &factor.y).sqrt());
        let (mut certificate, mut start, mut used) = (S::zero(), 0, 0);
        for (i, &m) in rows.iter().enumerate() {
            let (p, level) = (m.min(n - used), start..start + m);
            if p > 0 {
                let g = &mut column[..n];
                g.fill(S::zero());
                for (&w, row) in residual[level.clone()].iter().zip(jacobian[level.start * n..].chunks_exact(n)) {
                    g.iter_mut().zip(row).for_each(|(g, &a)| *g = w.mul_add(a, *g));
                }
                parameters.metric.iter().for_each(|metric| metric.row(g));
                factor.transform(g);
                let rest = g[used..].iter().fold(S::zero(), |most, g| most.max(g.abs()));
                let (size, term) = (frobenius2[i].sqrt(), residual[level.clone()].iter().fold(S::zero(), |most, w| most.max(w.abs())));
                let largest = (size * term.max(size * reach)).max(rest);
                certificate = certificate.max(rest / largest.max(S::splat(f64::MIN_POSITIVE)));
            }
            (start, used) = (level.end, used + p);
        }
        certificate
    }
}

/// Return the number of realised directions of every level, for a stack that the algorithm `regular` solves. A level with bounds has none.
pub fn regular_ranks<'a>(n: usize, rows: &'a [usize], intervals: &'a [bool]) -> impl Iterator<Item = usize> + 'a {
    rows.iter().enumerate().scan(n, move |free, (i, &m)| {
        let m = if intervals.get(i) == Some(&true) { 0 } else { m };
        let p = m.min(*free);
        *free -= p;
        Some(p)
    })
}
