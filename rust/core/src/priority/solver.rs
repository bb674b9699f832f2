//! The solver of stacks. Its construction allocates all memory, and solves do not allocate.
//!
//! It maps levels `(J_i, v_i)` to joint velocities `v`, with residuals `v_i - J_i v`, ranks and a status. The algorithms with singular
//! values receive finite numbers that are scaled to moderate magnitude. The faster algorithms `regular` and `pairs` receive the original
//! numbers. If these are not finite, too large or too small, both algorithms report that their result is not valid.

use super::method::{DEFAULT_EPS, DEFAULT_ROUNDING, PriorityMethod, PriorityOptions, TAME};
use super::metric::Metric;
use super::pairs::{Answer, CALLS_BEFORE_PROGRAM, PairRoute, SinglePairs};
use super::regular::Regular;
use super::sns::Saturation;
use super::workspace::Workspace;
use crate::error::{Error, Result, finite, positive};
use crate::linalg::{dot, largest};
use crate::memory;
use crate::scalar::Real;
use crate::status::Status;

/// Prioritised inverse kinematics for `n` joints and levels of fixed sizes. [`PrioritySolver::solve`] does not allocate.
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, PrioritySolver, SingularityKind, diagnose};
/// use armlet_core::status::Status;
///
/// let mut solver = PrioritySolver::new(2, &[1, 1], &PriorityOptions::new(PriorityMethod::Clamp))?;
/// let (first, second) = ([1.0, 0.0], [0.0, 2.0]);
/// assert_eq!(solver.solve(&[&first, &second], &[&[0.5], &[1.0]])?, Status::Success);
/// assert!((solver.v()[0] - 0.5).abs() < 1e-15 && (solver.v()[1] - 0.5).abs() < 1e-15);
/// // Both tasks use the same joint.
/// assert_eq!(diagnose(2, &[1, 1], &[&first, &first], None, None)?.kind, SingularityKind::Algorithmic);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct PrioritySolver {
    method: PriorityMethod,
    work: Workspace,
    saturation: Option<Saturation>,
    /// The closed-form algorithm for levels of at most two rows, if it applies.
    pub(super) pairs: Option<SinglePairs>,
    status: Status,
    uses: u64,
}

impl PrioritySolver {
    /// Create a solver. `n`: number of joints. `rows`: number of rows of each level, the highest level first. A level may have no row, or
    /// more rows than joints.
    ///
    /// Errors: `WrongShape` for a wrong number of thresholds, weights or bounds. `Input` for `n = 0`, `eps <= 0`, or a `rounding` outside
    /// of `[0, 1)`. Also `Input` for a weight that is not positive definite, invalid bounds, or `sns` without bounds. `Memory` if the
    /// memory does not suffice.
    pub fn new(n: usize, rows: &[usize], options: &PriorityOptions) -> Result<Self> {
        if n == 0 {
            return Err(Error::input("n", "is not positive: expected at least one joint, got 0"));
        }
        let levels = rows.len();
        // The memory contains the Jacobians twice, two decompositions with their bases, and the memory of the algorithm `regular`.
        let (total, most) = rows.iter().fold((0, n), |(total, most): (usize, usize), &m| (total.saturating_add(m), most.max(m)));
        memory::require((16_usize.saturating_mul(most)).saturating_add(8_usize.saturating_mul(total)).saturating_mul(8 * most))?;
        let eps = match options.eps.as_deref() {
            None => None,
            Some([one]) => Some(vec![*one; levels]),
            Some(each) if each.len() == levels => Some(each.to_vec()),
            Some(each) => return Err(Error::wrong("eps", "length", format!("1 or {levels}"), each.len())),
        };
        eps.iter().flatten().try_for_each(|e| positive("eps", *e))?;
        let metric = options.weight.as_ref().map(|weight| Metric::new(weight, n)).transpose()?;
        let pairs = SinglePairs::new(n, rows, options.method, eps.as_deref(), metric.as_ref());
        let work = Workspace::new(n, rows, options.method, eps, metric);
        let saturation = (options.method == PriorityMethod::Sns).then(|| Saturation::new(n));
        let mut solver = PrioritySolver { method: options.method, work, saturation, pairs, status: Status::Success, uses: 0 };
        solver.set_rounding(options.rounding.unwrap_or(DEFAULT_ROUNDING))?;
        match (&options.v_min, &options.v_max) {
            (None, None) if options.method == PriorityMethod::Sns => {
                return Err(Error::input(
                    "v_max",
                    format!("is missing: expected velocity bounds of shape ({n},) for method sns, got None"),
                ));
            }
            (None, None) => {}
            (lower, upper) => {
                // If only one bound exists, its negative is the other bound.
                let mirror = |x: &Vec<f64>| x.iter().map(|b| -b).collect::<Vec<f64>>();
                let low = lower.clone().unwrap_or_else(|| mirror(upper.as_ref().unwrap_or(&Vec::new())));
                let high = upper.clone().unwrap_or_else(|| mirror(lower.as_ref().unwrap_or(&Vec::new())));
                solver.work.bounds = Some((vec![0.0; n], vec![0.0; n]));
                solver.set_bounds(&low, &high)?;
            }
        }
        Ok(solver)
    }

    /// The number of joints.
    pub fn n(&self) -> usize {
        self.work.n
    }

    /// The number of rows of each level.
    pub fn rows(&self) -> &[usize] {
        &self.work.rows
    }

    /// The method that inverts the levels.
    pub fn method(&self) -> PriorityMethod {
        self.method
    }

    pub(super) fn rounding(&self) -> f64 {
        self.work.rounding
    }

    /// The threshold of each level, shape `(levels,)`, if the options have thresholds. It has the unit of the level's Jacobian.
    pub fn eps(&self) -> Option<&[f64]> {
        self.work.eps.as_deref()
    }

    /// The lower and upper bounds of the joint velocities, shape `(n,)` each, rad/s or m/s, if there are any.
    pub fn bounds(&self) -> Option<&(Vec<f64>, Vec<f64>)> {
        self.work.bounds.as_ref()
    }

    /// Return the algorithm for stacks away from singularities, with another number type. Its code does not branch on numbers.
    pub fn regular<S: Real>(&self) -> Regular<S> {
        let mut route = Regular::new(self.work.n, &self.work.rows, self.method, self.work.eps.as_deref(), self.work.metric.as_ref());
        if let Some((v_min, v_max)) = self.bounds() {
            route.set_bounds(v_min, v_max);
        }
        route
    }

    /// Return the closed-form algorithm for levels of at most two rows, with another number type. Return `None` if the algorithm does not
    /// apply to these levels or this method.
    pub(super) fn pairs<S: Real>(&self) -> Option<PairRoute<S>> {
        PairRoute::new(self.work.n, &self.work.rows, self.method, self.work.eps.as_deref(), self.work.metric.as_ref())
    }

    /// Set the relative error of the entries of the next Jacobians. For the Jacobian of an arm it is `DEFAULT_ROUNDING (1 + sum|q|)`, at
    /// most 0.5. Errors: `Input` outside of `[0, 1)`.
    pub fn set_rounding(&mut self, rounding: f64) -> Result<()> {
        if !(0.0..1.0).contains(&rounding) {
            return Err(Error::input("rounding", format!("is not a relative error: expected 0 <= rounding < 1, got {rounding}")));
        }
        self.work.rounding = rounding;
        Ok(())
    }

    /// Set the relative error of an arm's Jacobians, which is at most 0.5.
    pub(crate) fn set_arm_rounding(&mut self, rounding: f64) {
        self.work.rounding = rounding;
    }

    /// Set the threshold on the singular values of each level for the next solves, in the unit of the level's Jacobian.
    /// Errors: `WrongShape` for a wrong length, `Input` for a threshold that is not positive.
    pub fn set_eps(&mut self, eps: &[f64]) -> Result<()> {
        if eps.len() != self.work.rows.len() {
            return Err(Error::wrong("eps", "length", self.work.rows.len(), eps.len()));
        }
        eps.iter().try_for_each(|e| positive("eps", *e))?;
        match &mut self.work.eps {
            Some(own) => own.copy_from_slice(eps),
            None => self.work.eps = Some(eps.to_vec()),
        }
        self.work.regular.set_eps(eps);
        if let Some(pairs) = &mut self.pairs {
            pairs.set_eps(eps);
        }
        Ok(())
    }

    /// Set the joint velocity bounds for the next solves, shape `(n,)` each, rad/s or m/s. Infinite bounds are allowed.
    ///
    /// Errors: `WrongShape` for a wrong length; `Input` for NaN, `v_min > v_max`, bounds that allow no finite velocity, or a solver that was
    /// created without bounds.
    pub fn set_bounds(&mut self, v_min: &[f64], v_max: &[f64]) -> Result<()> {
        let n = self.work.n;
        for (name, x) in [("v_min", v_min), ("v_max", v_max)] {
            if x.len() != n {
                return Err(Error::wrong(name, "length", n, x.len()));
            }
        }
        // The condition is not `v_min > v_max`, because NaN must also be refused. Bounds that allow no finite velocity are refused, too.
        let fine = |l: f64, u: f64| l <= u && l < f64::INFINITY && u > f64::NEG_INFINITY;
        if let Some(i) = (0..n).find(|&i| !fine(v_min[i], v_max[i])) {
            return Err(
                Error::input("v_min", format!("is out of order: expected v_min <= v_max, got {} and {}", v_min[i], v_max[i])).at([i])
            );
        }
        let Some((lower, upper)) = &mut self.work.bounds else {
            return Err(Error::input("v_max", "has no use: expected a solver that was created with bounds"));
        };
        lower.copy_from_slice(v_min);
        upper.copy_from_slice(v_max);
        self.work.regular.set_bounds(v_min, v_max);
        Ok(())
    }

    /// The memory that the caller fills before `run`: the stacked Jacobians, shape `(sum rows, n)`, row-major, and the stacked task
    /// velocities.
    pub fn inputs(&mut self) -> (&mut [f64], &mut [f64]) {
        (&mut self.work.jacobian, &mut self.work.command)
    }

    /// Solve for one Jacobian per level, shape `(rows_i, n)`, row-major, and one task velocity per level, shape `(rows_i,)`.
    ///
    /// Returns `Success`, or `Degraded` if a level lost a direction or was scaled. Errors: `WrongShape` for wrong sizes, `Input` for
    /// numbers that are not finite, `Solve` if the result overflows.
    pub fn solve(&mut self, jacobians: &[&[f64]], velocities: &[&[f64]]) -> Result<Status> {
        self.load(jacobians, velocities)?;
        self.run()
    }

    /// Count a repeated call. After a number of calls, the algorithms `regular` and `pairs` are recorded and compiled as programs, unless
    /// these would be too long. Later solves use the programs, with the same bits.
    #[inline]
    pub fn used(&mut self) {
        self.uses += 1;
        if self.uses == CALLS_BEFORE_PROGRAM {
            let program = self.of_stacks(false);
            self.work.regular.take(program);
        }
        if self.pairs.as_ref().is_some_and(SinglePairs::wants_program) {
            let program = self.of_pairs();
            if let Some(pairs) = &mut self.pairs {
                pairs.take(program);
            }
        }
    }

    pub(super) fn workspace(&mut self) -> &mut Workspace {
        &mut self.work
    }

    /// Check the sizes, and copy the numbers to [`PrioritySolver::inputs`].
    pub(super) fn load(&mut self, jacobians: &[&[f64]], velocities: &[&[f64]]) -> Result<()> {
        let levels = self.work.rows.len();
        for (name, got) in [("jacobians", jacobians.len()), ("velocities", velocities.len())] {
            if got != levels {
                return Err(Error::wrong(name, "number of levels", levels, got));
            }
        }
        let n = self.work.n;
        for i in 0..levels {
            let level = self.work.level(i);
            if jacobians[i].len() != level.len() * n {
                let got = jacobians[i].len();
                return Err(Error::wrong(format!("jacobians[{i}]"), "size", format!("({}, {n})", level.len()), format!("{got} entries")));
            }
            if velocities[i].len() != level.len() {
                let got = velocities[i].len();
                return Err(Error::wrong(format!("velocities[{i}]"), "length", level.len(), got));
            }
            self.work.jacobian[level.start * n..level.end * n].copy_from_slice(jacobians[i]);
            self.work.command[level].copy_from_slice(velocities[i]);
        }
        Ok(())
    }

    /// Solve for the numbers in [`PrioritySolver::inputs`]. Errors: `Input` for numbers that are not finite, `Solve` if the result
    /// overflows.
    pub fn run(&mut self) -> Result<Status> {
        if self.work.solve_regular() {
            self.work.lost.fill(false);
            self.status = Status::Success;
            return Ok(self.status);
        }
        self.run_declined()
    }

    /// Solve a stack for which the result of the algorithm `regular` is not valid. Errors: as for [`PrioritySolver::run`].
    pub fn run_declined(&mut self) -> Result<Status> {
        let PrioritySolver { work: w, pairs, .. } = self;
        let Workspace { jacobian, command, v, residual, ranks, lost, .. } = w;
        if let Some(pairs) = pairs
            && pairs.solve(jacobian, command, Answer { v, residual, ranks, lost })
        {
            w.task_scale.fill(1.0);
            self.status = if w.lost.contains(&true) { Status::Degraded } else { Status::Success };
            return Ok(self.status);
        }
        self.run_singular()
    }

    /// Solve only with the algorithms that use singular values. Errors: as for [`PrioritySolver::run`].
    pub fn run_singular(&mut self) -> Result<Status> {
        self.prepare()?;
        let w = &mut self.work;
        match self.method {
            PriorityMethod::Exact => w.solve_exact()?,
            PriorityMethod::Clamp => w.solve_clamped(false)?,
            PriorityMethod::Damped => w.solve_clamped(true)?,
            PriorityMethod::Chiaverini => w.solve_chiaverini()?,
            PriorityMethod::Sns => w.solve_sns(self.saturation.as_mut().expect("allocated for sns"))?,
        }
        self.finish()
    }

    /// Refuse numbers that are not finite, change to metric coordinates, and scale levels whose squares would overflow or underflow.
    pub(super) fn prepare(&mut self) -> Result<()> {
        let w = &mut self.work;
        let n = w.n;
        w.j.copy_from_slice(&w.jacobian);
        w.c.copy_from_slice(&w.command);
        if let Some(metric) = &w.metric {
            w.j.chunks_exact_mut(n).for_each(|row| metric.row(row));
        }
        for i in 0..w.rows.len() {
            let level = w.level(i);
            let block = &mut w.j[level.start * n..level.end * n];
            let biggest = largest(block) + largest(&w.c[level.clone()]);
            if biggest.is_nan() {
                finite(&format!("jacobians[{i}]"), &w.jacobian[level.start * n..level.end * n])?;
                finite(&format!("velocities[{i}]"), &w.command[level.clone()])?;
                finite(&format!("jacobians[{i}] in the metric of the weight"), block)?;
            }
            let norm2: f64 = block.iter().map(|x| x * x).sum();
            let (mut f, mut g) = (1.0, 1.0);
            w.exponent[i] = 0;
            if !TAME.contains(&norm2) {
                let biggest = block.iter().fold(0.0f64, |b, x| b.max(x.abs()));
                if biggest > 0.0 {
                    // Two factors are used, because a single factor could overflow. Powers of two change no digit.
                    let e = -(biggest.log2().floor() as i32);
                    w.exponent[i] = e;
                    (f, g) = (2f64.powi(e / 2), 2f64.powi(e - e / 2));
                    block.iter_mut().chain(&mut w.c[level]).for_each(|x| *x = *x * f * g);
                }
            }
            w.threshold[i] = match &w.eps {
                Some(eps) => eps[i] * f * g,
                None => DEFAULT_EPS * block.chunks_exact(n).map(|row| dot(row, row)).fold(0.0, f64::max).sqrt(),
            };
        }
        Ok(())
    }

    /// Compute the joint velocities from the metric coordinates, and residuals and status. For `sns`, remove rounding excess over bounds.
    fn finish(&mut self) -> Result<Status> {
        let w = &mut self.work;
        let n = w.n;
        w.v.copy_from_slice(&w.y);
        if let Some(metric) = &w.metric {
            metric.velocity(&mut w.v);
        }
        if self.method == PriorityMethod::Sns
            && let Some((lower, upper)) = &w.bounds
        {
            for ((v, l), u) in w.v.iter_mut().zip(lower).zip(upper) {
                *v = v.max(*l).min(*u);
            }
        }
        let mut sound = w.v.iter().map(|v| v * 0.0).sum::<f64>();
        for ((r, row), c) in w.residual.iter_mut().zip(w.jacobian.chunks_exact(n)).zip(&w.command) {
            *r = c - dot(row, &w.v);
            sound += *r * 0.0;
        }
        if sound != 0.0 {
            let problem = "the joint velocities that the task asks for overflow: scale the task or use method \"clamp\"";
            return Err(Error::Solve { status: Status::Diverged, t: 0.0, problem: problem.into() });
        }
        let degraded = w.lost.iter().any(|l| *l) || w.task_scale.iter().any(|s| *s < 1.0);
        self.status = if degraded { Status::Degraded } else { Status::Success };
        Ok(self.status)
    }

    /// The joint velocities of the last solve, shape `(n,)`, rad/s or m/s.
    pub fn v(&self) -> &[f64] {
        &self.work.v
    }

    /// The residual `v_i - J_i v` of level `i`, shape `(rows_i,)`, in the unit of the task.
    pub fn residual(&self, i: usize) -> &[f64] {
        &self.work.residual[self.work.level(i)]
    }

    /// The stacked residuals of all levels, shape `(sum rows,)`.
    pub fn residuals(&self) -> &[f64] {
        &self.work.residual
    }

    /// The number of realised directions of each level.
    pub fn ranks(&self) -> &[usize] {
        &self.work.ranks
    }

    /// The scale of each level's command. It is 1 except for `sns`.
    pub fn scales(&self) -> &[f64] {
        &self.work.task_scale
    }

    /// For each level, whether it lost a direction that its rows and the free directions would allow.
    pub fn lost(&self) -> &[bool] {
        &self.work.lost
    }

    /// The status of the last solve.
    pub fn status(&self) -> Status {
        self.status
    }
}
