//! The native code of a stack at a cut of a program ([`crate::trace::decision`]): numbers in, the solution of the solver out.

use super::method::{PriorityMethod, PriorityOptions};
use super::solution::Solution;
use super::solver::PrioritySolver;
use crate::error::Result;
use crate::trace::decision::Decision;

/// The native code of a stack.
#[derive(Debug)]
pub(super) struct NativeStack {
    pub solver: PrioritySolver,
    pub eps: Vec<f64>,
}

impl NativeStack {
    /// Allocate the memory for `sizes`. These are `n`, the method, and whether there are thresholds, a metric and bounds of the joint
    /// velocities. The numbers of limit levels and of all levels, and the rows of the levels, follow. If a level has bounds, a flag for each
    /// level is at the end.
    pub fn new(sizes: &[usize]) -> Self {
        let &[n, method, has_eps, has_metric, has_bounds, limit_levels, levels, ref others @ ..] = sizes else {
            unreachable!("the sizes of `StackFormula::of`")
        };
        let (rows, intervals) = others.split_at(levels);
        let method = PriorityMethod::ALL[method];
        let options = PriorityOptions {
            eps: (has_eps > 0).then(|| vec![1.0]),
            weight: (has_metric > 0).then(|| (0..n * n).map(|k| if k % (n + 1) == 0 { 1.0 } else { 0.0 }).collect()),
            v_max: (has_bounds > 0).then(|| vec![f64::INFINITY; n]),
            intervals: intervals.iter().map(|interval| *interval > 0).collect(),
            limit_levels,
            ..PriorityOptions::new(method)
        };
        let Ok(mut solver) = PrioritySolver::new(n, rows, &options) else { unreachable!("the sizes are those of a solver") };
        solver.certify();
        NativeStack { solver, eps: vec![1.0; has_eps * rows.len()] }
    }

    pub fn solve(&mut self, arguments: &[f64]) -> Result<&Solution> {
        let (n, total) = (self.solver.n(), self.solver.rows().iter().sum::<usize>());
        let (stack, parameters) = arguments[2..].split_at(total * (n + 1));
        let (jacobian, command) = self.solver.inputs();
        jacobian.copy_from_slice(&stack[..total * n]);
        command.copy_from_slice(&stack[total * n..]);
        let (upper, parameters) = parameters.split_at(self.solver.upper().len());
        self.solver.upper().copy_from_slice(upper);
        let (eps2, parameters) = parameters.split_at(self.eps.len());
        if !self.eps.is_empty() {
            self.eps.iter_mut().zip(eps2).for_each(|(eps, eps2)| *eps = eps2.sqrt());
            self.solver.set_eps(&self.eps)?;
        }
        let (factor, bounds) = parameters.split_at(self.solver.settings.metric.iter().map(|metric| metric.factor().len()).sum());
        self.solver.set_metric(factor);
        if !bounds.is_empty() {
            self.solver.set_bounds(&bounds[..n], &bounds[n..])?;
        }
        self.solver.set_rounding(arguments[1])?;
        match self.solver.is_bounded() {
            true if self.solver.settings.certifies() => self.solver.run_hierarchy(),
            true => self.solver.run(),
            false => self.solver.run_declined(),
        }
    }
}

impl Decision for NativeStack {
    fn decide(&mut self, arguments: &[f64], results: &mut [f64]) {
        let Ok(Solution { v, residuals, levels, bounded, .. }) = self.solve(arguments) else { return results.fill(f64::NAN) };
        let ranks = levels.iter().map(|level| level.rank as f64);
        let certificate = bounded.as_ref().map_or(f64::NAN, |bounded| bounded.certificate);
        let found = v.iter().chain(residuals).copied().chain(ranks).chain([certificate]);
        results.iter_mut().zip(found).for_each(|(to, found)| *to = found);
    }
}
