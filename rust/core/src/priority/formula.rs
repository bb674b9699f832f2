//! The solution of a stack within a formula: the algorithm `regular`, and native code where its result is not valid.
//!
//! Near a singularity, and at a bound, a decomposition must branch on its numbers. So the formula has a decision
//! ([`crate::trace::decision`]): native code with all algorithms of the module replaces the result of `regular`.

use super::bounded_c::stack_in_c;
use super::branch_free::{BranchFree, Regular, TwoRowLevels, regular_ranks};
use super::derivative::{NativeSlopes, SymStack};
use super::native_stack::NativeStack;
use super::solver::PrioritySolver;
use crate::scalar::Real;
use crate::trace::decision::{Print, kind, kind_with_c};
use crate::trace::function::{Recorded, recorded};
use crate::trace::tape::Op;
use crate::trace::{Sym, sym};

/// The solution of stacks of one size as a formula, with its memory.
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, PrioritySolver, StackFormula};
/// use armlet_core::scalar::Real;
/// use armlet_core::trace::{Sym, function::recorded};
///
/// let solver = PrioritySolver::new(2, &[1, 1], &PriorityOptions::new(PriorityMethod::Clamp))?;
/// // The rows of both levels are `[x, 0]`. The second level is singular, and native code solves the stack.
/// let recording = recorded(1, || StackFormula::of(&solver), |mut formula, x| {
///     formula.solve(Sym::splat(1e-15), &[x[0], Sym::zero(), x[0], Sym::zero()], &[0.5, 2.0].map(Sym::splat));
///     [formula.v(), formula.ranks()].concat()
/// });
/// let mut solution = recording.expect("a formula does not branch").interpreted(false);
/// solution.all_inputs().fill(2.0);
/// solution.run();
/// assert_eq!(solution.outputs(0, 4), [0.25, 0.0, 1.0, 0.0]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct StackFormula {
    n: usize,
    rows: Vec<usize>,
    regular: Regular<Sym>,
    /// The upper bounds of the levels with bounds, shape `(sum rows,)`; empty without such levels.
    upper: Vec<Sym>,
    /// Whether native code computes every result.
    always_native: bool,
    /// The number of the kind of native code.
    kind: u32,
    /// The number of the kind of native code with derivatives, if the solution has active bounds.
    kind_of_slopes: Option<u32>,
    arguments: Vec<Sym>,
    /// The joint velocities, the residuals, the ranks, and the certificate.
    results: Vec<Sym>,
}

impl StackFormula {
    /// Create the formula with the sizes and options of `solver`.
    pub fn of(solver: &PrioritySolver) -> Self {
        let (n, rows) = (solver.n(), solver.rows().to_vec());
        let regular: Regular<Sym> = solver.regular();
        let flags = [solver.eps().is_some(), solver.settings.metric.is_some(), solver.bounds().is_some()].map(usize::from);
        let intervals: Vec<usize> = solver.given.intervals.iter().map(|interval| usize::from(*interval)).collect();
        let sizes = [&[n, solver.method() as usize], &flags[..], &[solver.settings.limit_levels, rows.len()], &rows, &intervals].concat();
        let differs = (solver.bounds().is_some() || !intervals.is_empty()) && !solver.settings.scales;
        let kind_of_slopes =
            differs.then(|| kind("slopes of priority", sizes.clone(), |sizes| Box::new(NativeSlopes::new(sizes)), |_| None));
        let print: Option<Print> = if differs && solver.settings.metric.is_none() { Some(stack_in_c) } else { None };
        let kind = kind_with_c("priority", sizes, |sizes| Box::new(NativeStack::new(sizes)), closed_form, print);
        let results = vec![Sym::zero(); n + rows.iter().sum::<usize>() + rows.len() + 1];
        let upper = vec![Sym::zero(); solver.given.upper.len()];
        StackFormula { n, rows, regular, always_native: !intervals.is_empty(), upper, kind, kind_of_slopes, arguments: Vec::new(), results }
    }

    /// Let native code compute every result, so that there is a certificate.
    pub fn certify(&mut self) {
        self.always_native = true;
    }

    /// The upper bounds of the levels with bounds for the next solves, shape `(sum rows,)`, which the caller writes. Their lower bounds are
    /// in the place of commands, and the upper bound of a task is its command.
    pub fn upper_mut(&mut self) -> &mut [Sym] {
        &mut self.upper
    }

    /// The lower and upper bounds of the joint velocities for the next solves, shape `(n,)` each, which the caller writes.
    pub fn bounds_mut(&mut self) -> &mut [Vec<Sym>; 2] {
        self.regular.bounds_mut()
    }

    /// Solve the stack `jacobian`, shape `(sum rows, n)`, for the command `command`. `rounding` is the relative error of the entries of
    /// `jacobian`. The results are NaN if the solver has none.
    pub fn solve(&mut self, rounding: Sym, jacobian: &[Sym], command: &[Sym]) {
        if let Some(kind) = self.kind_of_slopes.filter(|_| sym::differentiates()) {
            return self.solve_with_slopes(kind, rounding, jacobian, command);
        }
        let StackFormula { n, rows, regular, upper, always_native, kind, arguments, results, .. } = self;
        let valid = if *always_native { Sym::zero() } else { regular.solve(rounding, jacobian, command) };
        arguments.clear();
        arguments.extend([valid, rounding]);
        arguments.extend(jacobian.iter().chain(command).chain(&*upper).chain(Regular::parameters(regular)));
        let ranks = regular_ranks(*n, rows, &[]).map(|rank| Sym::splat(rank as f64));
        let given = regular.v.iter().chain(&regular.residual).copied().chain(ranks).chain([Sym::zero()]);
        results.iter_mut().zip(given).for_each(|(to, given)| *to = given);
        sym::decide(*kind, arguments, results);
        if self.kind_of_slopes.is_some() {
            // A certificate is at most 1, and infinite if the C code reaches its limit of changes.
            let found = self.certificate().lt(Sym::splat(2.0));
            sym::require(Sym::select(found, Sym::splat(1.0), Sym::zero()));
        }
    }

    /// Solve a stack by native code, with derivatives at the active set of the solution (`derivative`).
    fn solve_with_slopes(&mut self, kind: u32, rounding: Sym, jacobian: &[Sym], command: &[Sym]) {
        let StackFormula { n, rows, regular, upper, results, .. } = self;
        let arguments = [Sym::zero(), rounding].into_iter().chain([jacobian, command, upper].into_iter().flatten().copied());
        let arguments: Vec<Sym> = arguments.chain(Regular::parameters(regular).copied()).collect();
        let (metric, bounds) = (regular.metric(), regular.bounds());
        let stack = SymStack { n: *n, levels: rows.len(), jacobian, command, upper, metric, bounds };
        *results = stack.solve(kind, &arguments);
    }

    /// The joint velocities, shape `(n,)`, rad/s or m/s.
    pub fn v(&self) -> &[Sym] {
        &self.results[..self.n]
    }

    /// The residuals of all levels, stacked, in the units of the tasks.
    pub fn residuals(&self) -> &[Sym] {
        &self.results[self.n..self.results.len() - self.rows.len() - 1]
    }

    /// The number of realised directions of each level.
    pub fn ranks(&self) -> &[Sym] {
        let end = self.results.len() - 1;
        &self.results[end - self.rows.len()..end]
    }

    /// The certificate of the solution ([`Bounded::certificate`](super::Bounded)) if native code computed it, otherwise zero. It is NaN
    /// without bounds.
    pub fn certificate(&self) -> Sym {
        self.results[self.results.len() - 1]
    }
}

/// Record the closed form of [`TwoRowLevels`] as a formula of the arguments of [`NativeStack`]. Its results are those of native code. They are
/// NaN where only `hierarchy` solves the stack. `None` for a stack with bounds.
fn closed_form(sizes: &[usize]) -> Option<(Vec<Op>, Vec<u32>)> {
    let NativeStack { solver, eps } = NativeStack::new(sizes);
    if solver.is_bounded() {
        return None;
    }
    let (n, rows, settings) = (solver.n(), solver.rows(), &solver.settings);
    let (total, factor) = (rows.iter().sum::<usize>(), settings.metric.iter().map(|metric| metric.factor().len()).sum::<usize>());
    let solve = |(), arguments: &[Sym]| {
        let nan = Sym::splat(f64::NAN);
        if !TwoRowLevels::<Sym>::applies(rows, settings.method) {
            return vec![nan; n + total + rows.len() + 1];
        }
        let mut levels = TwoRowLevels::<Sym>::new(n, rows, settings);
        let (stack, others) = arguments[2..].split_at(total * (n + 1));
        let ((jacobian, command), (eps2, factor)) = (stack.split_at(total * n), others.split_at(eps.len()));
        if !eps2.is_empty() {
            // The native code receives thresholds, and squares them again.
            let squared = |eps2: &Sym| {
                let eps = eps2.sqrt();
                eps * eps
            };
            levels.parameters().set_eps2(eps2.iter().map(squared).collect());
        }
        levels.parameters().metric.iter_mut().for_each(|metric| metric.set_factor(factor));
        let valid = Sym::splat(0.5).lt(levels.solve(arguments[1], jacobian, command, &[]));
        let found = levels.v.iter().chain(&levels.residual).chain(&levels.ranks).map(|&x| Sym::select(valid, x, nan));
        found.chain([nan]).collect()
    };
    let Recorded { ops, answer, .. } = recorded(2 + total * (n + 1) + eps.len() + factor, || (), solve)?;
    Some((ops, answer))
}
