//! The solution of a stack (equation (5) in `mod.rs`) away from singularities. The stack is factored as `J_E = [J1; J2; ..] = L Q` (LQ
//! factorisation by Householder reflections). The prioritised solution is `v = Q' y` with the transpose `Q'`, where forward substitution
//! solves `L y = [v1; v2; ..]`. This holds because the diagonal block `T_i` of `L` is `J_i N_{i-1}` in an orthonormal basis of the null
//! space of the levels above.
//!
//! The result is valid only if it provably equals the result of the recursion in `levels`. The number `1/|T_i^-1|_F` is a lower bound of
//! the smallest singular value of `J_i N_{i-1}`. For `clamp` and `damped`, it must reach `eps_i`. For the other methods, it must reach
//! `1e-6 |J_i|_F` and satisfy the rank rule of `levels`. Otherwise the result is not valid, and another algorithm solves the stack.
//!
//! For `sns`, zero velocity must be within the bounds. For every `i`, the solution of levels 1 to `i` must also be within them. The result
//! then equals the solution of `exact`. For `chiaverini`, the result is the sum of `P_{i-1} J_i# v_i` with the ranks of `exact`. `P_{i-1}`
//! removes the coordinates of the levels above, and `1/|J_i#|_F` must reach `eps_i`.
//!
//! Direct solves and recordings use the same code, which never branches on numbers. So a program (the recorded and compiled code) and a
//! direct solve with the same instruction set have the same bits.

use super::lq::{Factor, product, tall};
use super::method::{DEFAULT_EPS, PriorityMethod, TAME};
use super::metric::Metric;
use super::own::Own;
use crate::scalar::Real;
use crate::trace::Evaluation;

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
    /// The squares of the thresholds in the options.
    eps2: Option<Vec<S>>,
    metric: Option<Metric<S>>,
    /// The lower and upper velocity bounds of `sns`.
    bounds: [Vec<S>; 2],
    /// The solver of single levels for `chiaverini`.
    own: Option<Own<S>>,
    factor: Factor<S>,
    /// The rows of the first level with more rows than free directions.
    tall: Vec<S>,
    /// For each level, the square of its largest row norm.
    most2: Vec<S>,
    /// For each level, the square of its Frobenius norm.
    norm2: Vec<S>,
    r: Vec<S>,
    z: Vec<S>,
    /// The joint velocities, shape `(n,)`, rad/s or m/s.
    pub v: Vec<S>,
    /// The residuals, shape `(sum rows,)`, in the units of the tasks.
    pub residual: Vec<S>,
}

impl<S: Real> Regular<S> {
    /// Create the algorithm for levels of these sizes, thresholds and metric. The bounds of `sns` are set later.
    pub fn new(n: usize, rows: &[usize], method: PriorityMethod, eps: Option<&[f64]>, metric: Option<&Metric>) -> Self {
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
            method,
            eps2: None,
            metric: metric.map(Metric::lift),
            bounds: [f64::NEG_INFINITY, f64::INFINITY].map(|bound| vec![S::splat(bound); n]),
            own: (method == PriorityMethod::Chiaverini).then(|| Own::new(n, rows)),
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
        route
    }

    /// Set the velocity bounds of `sns`, shape `(n,)` each, rad/s or m/s.
    pub fn set_bounds(&mut self, v_min: &[f64], v_max: &[f64]) {
        for (own, given) in self.bounds.iter_mut().zip([v_min, v_max]) {
            own.iter_mut().zip(given).for_each(|(own, &bound)| *own = S::varying(bound));
        }
    }

    /// The lower and upper velocity bounds of `sns`, shape `(n,)` each, rad/s or m/s.
    pub fn bounds_mut(&mut self) -> &mut [Vec<S>; 2] {
        &mut self.bounds
    }

    pub(super) fn metric(&self) -> Option<&Metric<S>> {
        self.metric.as_ref()
    }

    /// The numbers that differ between runs: the squares of the thresholds, the factor of the metric, and the bounds of `sns`.
    pub(super) fn parameters(&self) -> impl Iterator<Item = &S> {
        let bounds = if self.method.has_bounds() { &self.bounds[..] } else { &[] };
        self.eps2.iter().flatten().chain(self.metric.iter().flat_map(Metric::factor)).chain(bounds.iter().flatten())
    }

    /// Set the thresholds of the levels, shape `(levels,)`.
    pub fn set_eps(&mut self, eps: &[f64]) {
        // The existing memory is reused, because some searches set thresholds in every step.
        let own = self.eps2.get_or_insert_with(|| vec![S::zero(); eps.len()]);
        own.iter_mut().zip(eps).for_each(|(own, eps)| *own = S::varying(eps * eps));
    }

    /// Solve the stack `jacobian`, shape `(sum rows, n)`, and write the results to `v` and `residual`. Return one if the result is valid.
    /// Return zero if a level is not provably regular, if a bound of `sns` may be met, or if a number is extreme.
    pub fn solve(&mut self, rounding: S, jacobian: &[S], command: &[S]) -> S {
        self.load(jacobian);
        self.factor.y.fill(S::zero());
        let fit = self.rows[..self.fitting].iter().sum::<usize>();
        for at in 0..fit {
            self.factor.eliminate(at, command[at]);
        }
        let mut stands = self.judge(rounding, command);
        match self.method {
            PriorityMethod::Exact | PriorityMethod::Clamp | PriorityMethod::Damped => {}
            PriorityMethod::Chiaverini => stands = self.sum_up(stands, jacobian, command),
            PriorityMethod::Sns => stands = self.stay_within(stands),
        }
        self.joint_velocities(self.n);
        let Regular { n, v, residual, .. } = self;
        // `|residual| < infinity` is false for NaN, so that NaN makes the result invalid.
        let (zero, infinity) = (S::zero(), S::splat(f64::INFINITY));
        residual.iter_mut().zip(jacobian.chunks_exact(*n)).zip(command).fold(stands, |stands, ((residual, row), &command)| {
            *residual = command - product(row, v);
            S::select(residual.abs().lt(infinity), stands, zero)
        })
    }

    /// Compute the joint velocities `v` from the first `used` coordinates.
    fn joint_velocities(&mut self, used: usize) {
        self.factor.turn_back_first(used, &mut self.v);
        if let Some(metric) = &self.metric {
            metric.velocity(&mut self.v);
        }
    }

    /// Return `stands`, which is one for a valid result. Return zero instead if zero velocity, or the solution of levels 1 to `i` for some
    /// `i`, is out of bounds.
    fn stay_within(&mut self, stands: S) -> S {
        let (mut stands, mut used) = (stands, 0);
        self.v.fill(S::zero());
        for i in 0..self.rows.len() {
            stands = self.within(stands);
            used = self.n.min(used + self.rows[i]);
            self.joint_velocities(used);
        }
        self.within(stands)
    }

    /// Return `stands` if `v` is within the bounds, otherwise zero. `stands` is one for a valid result.
    fn within(&self, stands: S) -> S {
        let [lower, upper] = &self.bounds;
        let bounds = lower.iter().zip(upper);
        self.v
            .iter()
            .zip(bounds)
            .fold(stands, |stands, (&v, (&lower, &upper))| S::select(v.lt(lower), S::zero(), S::select(upper.lt(v), S::zero(), stands)))
    }

    /// Compute the coordinates of `sum P_{i-1} J_i# v_i`. Return `stands`, or zero if a level alone is close to a singularity.
    fn sum_up(&mut self, mut stands: S, jacobian: &[S], command: &[S]) -> S {
        let Regular { n, rows, eps2, metric, factor, own, .. } = self;
        let (Some(own), mut start) = (own, 0) else { return S::zero() };
        factor.y.fill(S::zero());
        for (i, &m) in rows.iter().enumerate().filter(|(_, m)| **m > 0) {
            // As for the other methods, a level without free directions has no effect.
            if start >= *n {
                break;
            }
            let level = start..start + m;
            let [inverse2, most2] = own.solve(i, &jacobian[level.start * *n..level.end * *n], metric.as_ref(), &command[level.clone()]);
            factor.turn(&mut own.v);
            for c in start..*n {
                factor.y[c] += own.v[c];
            }
            let excess = inverse2 * threshold2(eps2.as_deref(), i, most2);
            stands = S::select(S::splat(1.0).lt(excess), S::zero(), S::select(excess.lt(S::splat(2.0)), stands, S::zero()));
            start = level.end;
        }
        stands
    }

    /// For each level with free directions, write its rows in metric coordinates, and compute its norms.
    fn load(&mut self, jacobian: &[S]) {
        let Regular { n, rows, fitting, metric, factor, tall, most2, norm2, .. } = self;
        let (n, fit) = (*n, factor.l.len());
        let mut at = 0;
        for (i, &m) in rows.iter().enumerate().take(*fitting + 1) {
            let level = if i < *fitting { &mut factor.l[at..at + m * n] } else { &mut tall[..] };
            debug_assert!(i < *fitting || at == fit, "the level that does not fit comes behind those that do");
            [most2[i], norm2[i]] = super::metric::load(&jacobian[at..], metric.as_ref(), level, n);
            at += m * n;
        }
    }

    /// Return one if every level is regular, otherwise zero. Also compute the coordinates of the first level that has more rows than free
    /// directions.
    fn judge(&mut self, rounding: S, command: &[S]) -> S {
        let Regular { n, rows, fitting, method, eps2, factor, tall: behind, most2, norm2, r, z, .. } = self;
        let (one, zero) = (S::splat(1.0), S::zero());
        let (mut stands, mut used, mut condition) = (one, 0, one);
        for (i, &m) in rows.iter().enumerate() {
            let p = m.min(*n - used);
            // A level without rows or free directions has no effect.
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
            let excess = if !method.damps() {
                let relative2 = inverse2 * norm2;
                let floor = S::splat(EXACT_FLOOR).max(rounding * condition);
                condition *= relative2.sqrt();
                relative2 * floor * floor
            } else {
                inverse2 * threshold2(eps2.as_deref(), i, most2[i])
            };
            // If `excess` is NaN, `excess < 2` is false, so that the result is invalid.
            stands = S::select(one.lt(excess), zero, S::select(excess.lt(S::splat(2.0)), stands, zero));
        }
        stands
    }
}

/// Return the square of the threshold of level `i`. `most2` is the square of the level's largest row norm.
pub(super) fn threshold2<S: Real>(eps2: Option<&[S]>, i: usize, most2: S) -> S {
    eps2.map_or(S::splat(DEFAULT_EPS * DEFAULT_EPS) * most2, |eps2| eps2[i])
}

/// Return the number of realised directions of every level, for a stack that the algorithm `regular` solves.
pub(super) fn regular_ranks(n: usize, rows: &[usize]) -> impl Iterator<Item = usize> {
    rows.iter().scan(n, |free, &m| {
        let p = m.min(*free);
        *free -= p;
        Some(p)
    })
}

/// The algorithm `regular` for single stacks.
#[derive(Debug, Clone)]
pub(super) struct Single {
    direct: Regular<f64>,
    /// The program of the algorithm, after it has been made. It has the same bits as `direct`.
    program: Option<Evaluation>,
}

impl Single {
    /// Create the algorithm with [`Regular::new`].
    pub fn new(n: usize, rows: &[usize], method: PriorityMethod, eps: Option<&[f64]>, metric: Option<&Metric>) -> Self {
        Single { direct: Regular::new(n, rows, method, eps, metric), program: None }
    }

    /// From now on, use a program made with [`PrioritySolver::of_stacks`](super::PrioritySolver).
    pub fn take(&mut self, program: Option<Evaluation>) {
        self.program = program;
    }

    /// Set the thresholds, and discard the program, which contains the old thresholds.
    pub fn set_eps(&mut self, eps: &[f64]) {
        self.program = None;
        self.direct.set_eps(eps);
    }

    /// Set the bounds, and discard the program, which contains the old bounds.
    pub fn set_bounds(&mut self, v_min: &[f64], v_max: &[f64]) {
        self.program = None;
        self.direct.set_bounds(v_min, v_max);
    }

    /// Solve a stack, and write the results to `v` and `residual`. Return false if the result is not valid.
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
        let stands = self.direct.solve(rounding, jacobian, command);
        v.copy_from_slice(&self.direct.v);
        residual.copy_from_slice(&self.direct.residual);
        stands == 1.0
    }
}
