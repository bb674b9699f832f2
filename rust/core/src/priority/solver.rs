//! The solver of stacks: `v = sum v_i`, where each level minimises `|v_i - J_i v|` without a change for the levels above.
//!
//! Its construction allocates all memory, and solves do not allocate. A solve tries the branch-free algorithms first, which receive the
//! original numbers. If these are not finite, too large or too small, their result is not valid. Then `hierarchy` solves the stack level by
//! level, with finite numbers of moderate magnitude. For each level, it projects the Jacobian on the null space of the levels above, and
//! decomposes it. It decides the rank, takes the step of the method, and updates the null space.

use super::branch_free::{BranchFree, Compiled, Regular, TwoRowLevels, WithinBounds, regular_ranks};
use super::hierarchy::{Conditions, Hierarchy};
use super::inequality::{Inequalities, Slopes};
use super::method::{PriorityMethod, PriorityOptions};
use super::settings::Settings;
use super::solution::{Bounded, LevelSolution, Solution};
use super::stack::{ScaledStack, Stack, level_ranges};
use crate::error::{Error, Result};
use crate::linalg::dot;
use crate::memory;
use crate::scalar::Real;
use crate::status::Status;
use crate::trace::Sym;

/// Prioritised inverse kinematics for `n` joints and levels of fixed sizes. [`PrioritySolver::solve`] does not allocate.
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, PrioritySolver, SingularityKind, diagnose};
/// use armlet_core::status::Status;
///
/// let mut solver = PrioritySolver::new(2, &[1, 1], &PriorityOptions::new(PriorityMethod::Clamp))?;
/// let (first, second) = ([1.0, 0.0], [0.0, 2.0]);
/// let solution = solver.solve(&[&first, &second], &[&[0.5], &[1.0]])?;
/// assert_eq!((solution.status, solution.ranks()), (Status::Success, vec![1, 1]));
/// assert!(solution.v.iter().all(|v| (v - 0.5).abs() < 1e-15));
/// // Both tasks use the same joint.
/// assert_eq!(diagnose(2, &[1, 1], &[&first, &first], None, None)?.kind, SingularityKind::Algorithmic);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct PrioritySolver {
    pub(super) settings: Settings,
    pub(super) given: Stack,
    /// The algorithm away from singularities and bounds.
    regular: Compiled<WithinBounds<f64>>,
    /// The closed-form algorithm for levels of at most two rows, if it applies. A stack with bounds does not use it.
    two_rows: Option<Compiled<TwoRowLevels<f64>>>,
    pub(super) scaled: ScaledStack,
    pub(super) hierarchy: Hierarchy,
    /// The solver of stacks with bounds, if the stack has bounds.
    inequalities: Option<Box<Inequalities>>,
    /// The conditions for the certificates of solutions that no bound restricts, if these are wanted.
    conditions: Option<Box<Conditions>>,
    solution: Solution,
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
        // The memory contains the Jacobians twice, two decompositions with their bases, and the memory of the algorithm `regular`.
        let (total, most) = rows.iter().fold((0, n), |(total, most): (usize, usize), &m| (total.saturating_add(m), most.max(m)));
        memory::require((18_usize.saturating_mul(most)).saturating_add(8_usize.saturating_mul(total)).saturating_mul(8 * most))?;
        let settings = Settings::new(n, rows.len(), options)?;
        let given = Stack::with_intervals(n, rows, &options.intervals);
        let bounded = !given.upper.is_empty() || settings.bounds.is_some() || settings.scales;
        let mut solution = Solution::new(n, rows);
        if bounded {
            solution.bounded = Some(Bounded::new(settings.bounds.as_ref().map_or(0, |_| n), given.command.len()));
        }
        Ok(PrioritySolver {
            regular: Compiled::new(&given, &settings),
            two_rows: (!bounded && TwoRowLevels::<f64>::applies(rows, settings.method)).then(|| Compiled::new(&given, &settings)),
            scaled: ScaledStack::new(&given),
            hierarchy: Hierarchy::new(&given),
            inequalities: bounded.then(|| Box::new(Inequalities::new(&given, &settings))),
            conditions: None,
            solution,
            settings,
            given,
        })
    }

    /// The number of joints.
    pub fn n(&self) -> usize {
        self.given.n
    }

    /// The number of rows of each level.
    pub fn rows(&self) -> &[usize] {
        &self.given.rows
    }

    /// The method that inverts the levels.
    pub fn method(&self) -> PriorityMethod {
        self.settings.method
    }

    /// The threshold of each level, shape `(levels,)`, if the options have thresholds. It has the unit of the level's Jacobian.
    pub fn eps(&self) -> Option<&[f64]> {
        self.settings.eps.as_deref()
    }

    /// The lower and upper bounds of the joint velocities, shape `(n,)` each, rad/s or m/s, if there are any.
    pub fn bounds(&self) -> Option<&(Vec<f64>, Vec<f64>)> {
        self.settings.bounds.as_ref()
    }

    /// Return the algorithm for stacks away from singularities, with another number type. Its code does not branch on numbers.
    pub fn regular<S: Real>(&self) -> Regular<S> {
        Regular::new(self.n(), self.rows(), &self.settings)
    }

    /// Set the relative error of the entries of the next Jacobians. For the Jacobian of an arm it is `DEFAULT_ROUNDING (1 + sum|q|)`, at
    /// most 0.5. Errors: `Input` outside of `[0, 1)`.
    pub fn set_rounding(&mut self, rounding: f64) -> Result<()> {
        self.settings.set_rounding(rounding)
    }

    /// Set the relative error of an arm's Jacobians, which is at most 0.5.
    pub(crate) fn set_arm_rounding(&mut self, rounding: f64) {
        self.settings.rounding = rounding;
    }

    /// Set the threshold on the singular values of each level for the next solves, in the unit of the level's Jacobian.
    /// Errors: `WrongShape` for a wrong length, `Input` for a threshold that is not positive.
    pub fn set_eps(&mut self, eps: &[f64]) -> Result<()> {
        self.settings.set_eps(self.given.rows.len(), eps)?;
        self.regular.change().parameters().set_eps(eps);
        self.two_rows.iter_mut().for_each(|two_rows| two_rows.change().parameters().set_eps(eps));
        Ok(())
    }

    /// Replace the Cholesky factor of the metric, for a solver that has a metric.
    pub(super) fn set_metric(&mut self, factor: &[f64]) {
        let two_rows = self.two_rows.iter_mut().filter_map(|two_rows| two_rows.change().parameters().metric.as_mut());
        let metrics = self.settings.metric.iter_mut().chain(&mut self.regular.change().parameters().metric).chain(two_rows);
        metrics.for_each(|metric| metric.set_factor(factor));
    }

    /// Set the joint velocity bounds for the next solves, shape `(n,)` each, rad/s or m/s. Infinite bounds are allowed.
    ///
    /// Errors: `WrongShape` for a wrong length; `Input` for NaN, `v_min > v_max`, bounds that allow no finite velocity, or a solver that was
    /// created without bounds.
    pub fn set_bounds(&mut self, v_min: &[f64], v_max: &[f64]) -> Result<()> {
        self.settings.set_bounds(v_min, v_max)?;
        self.regular.change().set_bounds(v_min, v_max);
        Ok(())
    }

    /// The memory that the caller fills before `run`: the stacked Jacobians, shape `(sum rows, n)`, row-major, and the stacked task
    /// velocities.
    pub fn inputs(&mut self) -> (&mut [f64], &mut [f64]) {
        (&mut self.given.jacobian, &mut self.given.command)
    }

    /// The stacked Jacobians, shape `(sum rows, n)`, row-major, the stacked task velocities or lower bounds, and the upper bounds. The last
    /// are empty if no level has bounds.
    pub fn stack(&self) -> [&[f64]; 3] {
        [&self.given.jacobian, &self.given.command, &self.given.upper]
    }

    /// The memory of the upper bounds of levels with bounds, shape `(sum rows,)`. Their lower bounds are in the place of task velocities.
    pub fn upper(&mut self) -> &mut [f64] {
        &mut self.given.upper
    }

    /// Start each solve of a stack with bounds with the active set of the last solve. Its result then depends on earlier solves, but only by
    /// rounding errors.
    pub fn keep_active_set(&mut self) {
        // The solution of `sns` does not depend on earlier solves, not even by rounding errors.
        if !self.settings.method.has_bounds() {
            self.inequalities.iter_mut().for_each(|inequalities| inequalities.keep_active_set());
        }
    }

    /// Compute the certificates of the next solutions of `sns` that meet no bound, too.
    pub fn certify(&mut self) {
        self.conditions = self.inequalities.as_ref().map(|_| Box::new(Conditions::new(&self.given)));
    }

    /// Whether the last solve of a stack with bounds damped a direction.
    pub(super) fn damps_a_direction(&self) -> bool {
        self.inequalities.as_ref().is_some_and(|inequalities| inequalities.damps_a_direction())
    }

    /// Forget the active set of the last solve, so that the next result does not depend on earlier solves.
    pub fn clear_active_set(&mut self) {
        self.inequalities.iter_mut().for_each(|inequalities| inequalities.clear_active_set());
    }

    /// Return the derivative of the last solution of a stack with bounds, and the solution in the coordinates of the metric. The third result
    /// is the sign of the bound that acts in each row. The result is `None` if the solution has no derivative.
    pub(super) fn slopes(&self) -> Option<(Slopes, &[f64], Vec<i8>)> {
        let inequalities = self.inequalities.as_ref()?;
        let slopes = inequalities.slopes(&self.settings)?;
        let sides = (0..slopes.by_bound.ncols()).map(|i| inequalities.acting_side(i)).collect();
        Some((slopes, inequalities.coordinates(), sides))
    }

    /// The solution of a failed solve: all numbers are NaN.
    pub(super) fn failed(&self) -> Solution {
        let mut failed = Solution::new(self.n(), self.rows());
        if let Some(bounded) = &self.solution.bounded {
            failed.bounded = Some(Bounded::new(bounded.limits, self.given.command.len()));
        }
        failed
    }

    /// Whether the joint velocities or a level have bounds, or commands are scaled.
    pub fn is_bounded(&self) -> bool {
        self.inequalities.is_some()
    }

    /// Whether the algorithm `regular` solves the stacks whose solution meets no bound.
    pub(super) fn has_regular_stacks(&self) -> bool {
        let settings = &self.settings;
        let sns = settings.method.has_bounds() && self.given.upper.is_empty();
        self.inequalities.is_none() || sns || (settings.certifies() && !settings.scales)
    }

    /// Solve for one Jacobian per level, shape `(rows_i, n)`, row-major, and one task velocity per level, shape `(rows_i,)`.
    ///
    /// Errors: `WrongShape` for wrong sizes, `Input` for numbers that are not finite, `Solve` if the result overflows.
    pub fn solve(&mut self, jacobians: &[&[f64]], velocities: &[&[f64]]) -> Result<&Solution> {
        self.given.load(jacobians, velocities)?;
        self.run()
    }

    /// Prepare for repeated calls. After a number of solves, the branch-free algorithms are recorded and compiled as programs, unless these
    /// would be too long. Later solves use the programs, with the same bits.
    #[inline]
    pub fn used(&mut self) {
        let PrioritySolver { settings, given, regular, two_rows, .. } = self;
        regular.compile::<WithinBounds<Sym>>(given, settings);
        two_rows.iter_mut().for_each(|two_rows| two_rows.compile::<TwoRowLevels<Sym>>(given, settings));
    }

    /// Solve for the numbers in [`PrioritySolver::inputs`]. Errors: `Input` for numbers that are not finite, `Solve` if the result
    /// overflows.
    pub fn run(&mut self) -> Result<&Solution> {
        if !self.has_regular_stacks() {
            return self.run_hierarchy();
        }
        let PrioritySolver { settings, given, regular, conditions, solution, .. } = self;
        let Some([v, residuals, .., certificate]) = regular.solve(settings.rounding, given) else { return self.run_declined() };
        solution.v.copy_from_slice(v);
        solution.residuals.copy_from_slice(residuals);
        let ranks = regular_ranks(given.n, &given.rows, &given.intervals);
        solution.levels.iter_mut().zip(ranks).for_each(|(level, rank)| *level = LevelSolution::new(rank, rank));
        solution.status = Status::Success;
        if let Some(bounded) = &mut solution.bounded {
            let certificate = certificate.first().copied().unwrap_or(f64::NAN);
            bounded.set_free(&solution.v, &solution.residuals, settings.bounds.as_ref(), certificate);
            if let Some(conditions) = conditions.as_mut().filter(|_| certificate.is_nan()) {
                bounded.certificate = conditions.certificate(given, settings, &solution.v)?;
            }
        }
        Ok(&self.solution)
    }

    /// Solve a stack for which the result of the algorithm `regular` is not valid. Errors: as for [`PrioritySolver::run`].
    pub fn run_declined(&mut self) -> Result<&Solution> {
        let PrioritySolver { settings, given, two_rows, solution, .. } = self;
        let results = two_rows.as_mut().and_then(|two_rows| two_rows.solve(settings.rounding, given));
        let Some([v, residuals, ranks, singular, _]) = results else { return self.run_hierarchy() };
        solution.v.copy_from_slice(v);
        solution.residuals.copy_from_slice(residuals);
        for ((level, rank), singular) in solution.levels.iter_mut().zip(ranks).zip(singular) {
            *level = LevelSolution { rank: *rank as usize, singular: *singular > 0.0, scale: 1.0 };
        }
        solution.conclude();
        Ok(&self.solution)
    }

    /// Solve level by level: with singular values, or by the active-set method if there are bounds. Errors: as for [`PrioritySolver::run`].
    pub fn run_hierarchy(&mut self) -> Result<&Solution> {
        if self.inequalities.is_some() {
            return self.run_bounded();
        }
        let PrioritySolver { settings, given, scaled, hierarchy, solution, .. } = self;
        scaled.load(given, settings)?;
        hierarchy.start(settings);
        for (level, solution) in scaled.levels().zip(&mut solution.levels) {
            hierarchy.project(&level)?;
            *solution = match settings.method {
                PriorityMethod::Exact | PriorityMethod::Sns => hierarchy.exact_step(&level),
                PriorityMethod::Clamp => hierarchy.clamped_step(&level),
                PriorityMethod::Damped => hierarchy.damped_step(&level),
                PriorityMethod::Chiaverini => hierarchy.chiaverini_step(&level),
            }?;
        }
        self.finish()
    }

    /// Solve a stack with bounds. Errors: as for [`PrioritySolver::run`], and `Input` for bounds out of order.
    fn run_bounded(&mut self) -> Result<&Solution> {
        let PrioritySolver { settings, given, inequalities, solution, .. } = self;
        if let Some(inequalities) = inequalities {
            inequalities.solve(given, settings, solution)?;
        }
        for (i, rows) in level_ranges(&given.rows).enumerate() {
            for i in rows.filter(|_| !given.is_interval(i)) {
                let residual = given.command[i] - dot(&given.jacobian[i * given.n..(i + 1) * given.n], &solution.v);
                solution.residuals[i] = residual;
                if let Some(bounded) = &mut solution.bounded {
                    bounded.violations[bounded.limits + i] = -residual;
                }
            }
        }
        if solution.v.iter().any(|v| !v.is_finite()) {
            return Err(overflow());
        }
        Ok(&self.solution)
    }

    /// Compute the joint velocities from the metric coordinates, and residuals and status.
    fn finish(&mut self) -> Result<&Solution> {
        let PrioritySolver { settings, given, hierarchy, solution, .. } = self;
        let Solution { v, residuals, .. } = solution;
        v.copy_from_slice(&hierarchy.y);
        settings.metric.iter().for_each(|metric| metric.velocity(v));
        let mut sound = v.iter().map(|v| v * 0.0).sum::<f64>();
        for ((r, row), c) in residuals.iter_mut().zip(given.jacobian.chunks_exact(given.n)).zip(&given.command) {
            *r = c - dot(row, v);
            sound += *r * 0.0;
        }
        if sound != 0.0 {
            return Err(overflow());
        }
        solution.conclude();
        Ok(&self.solution)
    }

    /// The solution of the last solve.
    pub fn solution(&self) -> &Solution {
        &self.solution
    }
}

fn overflow() -> Error {
    let problem = "the joint velocities that the task asks for overflow: scale the task or use method \"clamp\"";
    Error::Solve { status: Status::Diverged, t: 0.0, problem: problem.into() }
}
