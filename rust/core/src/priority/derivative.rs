//! The solution of a stack with bounds as a formula with derivatives. Native code computes the solution and its derivative by the rows and
//! bounds, at the active set of the solution (`inequality::slopes`). With the rows `a`, the bounds `b`, and the numbers with bars from native
//! code, whose derivatives are zero, the formula is
//!
//! `x = x_bar + sum B_i (b_i - b_bar_i) + sum E_i (a_i - a_bar_i)`.
//!
//! Its value is that of the native code, and its derivative is exact while the active set remains.

use super::metric::Metric;
use super::native_stack::NativeStack;
use crate::scalar::Real;
use crate::trace::decision::Decision;
use crate::trace::{Sym, sym};

/// A stack of a formula: rows, shape `(total, n)`, commands or lower bounds, upper bounds or nothing, and what the options give.
pub(super) struct SymStack<'a> {
    pub n: usize,
    pub levels: usize,
    pub jacobian: &'a [Sym],
    pub command: &'a [Sym],
    pub upper: &'a [Sym],
    pub metric: Option<&'a Metric<Sym>>,
    /// The bounds of the joint velocities, shape `(n,)` or empty.
    pub bounds: [&'a [Sym]; 2],
}

impl SymStack<'_> {
    /// Return the results of [`super::StackFormula`] by native code of this kind.
    pub fn solve(&self, kind: u32, arguments: &[Sym]) -> Vec<Sym> {
        let SymStack { n, jacobian, command, .. } = *self;
        let sizes = Sizes { n, limits: self.bounds[0].len(), total: command.len(), levels: self.levels };
        let mut results = vec![Sym::zero(); sizes.results()];
        sym::decide(kind, arguments, &mut results);
        let (mut standard, mut decided) = (results[..sizes.standard()].to_vec(), &results[sizes.standard()..]);
        let mut next = |count: usize| decided.split_off(..count).unwrap_or_default();
        let count = sizes.rows();
        sym::require(next(1)[0]);
        let (mut x, rows) = (next(n).to_vec(), next(count * n));
        let sides = [self.bounds_of(0), self.bounds_of(1)].map(|bounds| (bounds, next(count), next(count)));
        let (by_bound, by_row) = (next(count * n), next(count * n * n));
        for (bounds, given, acts) in sides {
            for (i, &bound) in bounds.iter().enumerate().filter(|(_, bound)| !sym::is_constant(**bound)) {
                // A bound that does not act may be infinite.
                let change = Sym::select(Sym::zero().lt(acts[i]), bound - given[i], Sym::zero());
                (0..n).for_each(|c| x[c] = by_bound[i * n + c].mul_add(change, x[c]));
            }
        }
        for (k, (a, &bar)) in self.rows().into_iter().zip(rows).enumerate() {
            if !sym::is_constant(a) {
                (0..n).for_each(|c| x[c] = by_row[k * n + c].mul_add(a - bar, x[c]));
            }
        }
        self.metric.iter().for_each(|metric| metric.velocity(&mut x));
        standard[..n].copy_from_slice(&x);
        for (i, (row, &command)) in jacobian.chunks_exact(n).zip(command).enumerate() {
            standard[n + i] = row.iter().zip(&x).fold(command, |rest, (&a, &x)| a.neg_mul_add(x, rest));
        }
        standard
    }

    /// The rows of all levels in the coordinates of the metric. Those of the joint velocities come first.
    fn rows(&self) -> Vec<Sym> {
        let n = self.n;
        let unit = |i: usize| (0..n).map(move |c| if c == i { Sym::splat(1.0) } else { Sym::zero() });
        let mut rows: Vec<Sym> = (0..self.bounds[0].len()).flat_map(unit).chain(self.jacobian.iter().copied()).collect();
        self.metric.iter().for_each(|metric| rows.chunks_exact_mut(n).for_each(|row| metric.row(row)));
        rows
    }

    /// The lower or upper bounds of all rows. A task has only a lower one, its command.
    fn bounds_of(&self, side: usize) -> Vec<Sym> {
        let own = if side == 0 { self.command } else { self.upper };
        self.bounds[side].iter().chain(own).copied().collect()
    }
}

/// The sizes of a stack.
#[derive(Debug, Clone, Copy)]
struct Sizes {
    n: usize,
    limits: usize,
    total: usize,
    levels: usize,
}

impl Sizes {
    fn rows(&self) -> usize {
        self.limits + self.total
    }

    /// The number of results of a formula without derivatives.
    fn standard(&self) -> usize {
        self.n + self.total + self.levels + 1
    }

    /// The number of results. After the standard ones follow: whether there are derivatives, `x`, and the rows. Then, for each side, the
    /// bounds and whether they act. Derivatives by bounds and rows are at the end.
    fn results(&self) -> usize {
        let (n, rows) = (self.n, self.rows());
        self.standard() + 1 + n + rows * n + 4 * rows + rows * n + rows * n * n
    }
}

/// The native code of a stack with derivatives. It remembers the last stack, because all lanes of a function for derivatives have the same.
#[derive(Debug)]
pub(super) struct NativeSlopes {
    stack: NativeStack,
    arguments: Vec<f64>,
    results: Vec<f64>,
}

impl NativeSlopes {
    /// Allocate the memory for the sizes of [`NativeStack::new`].
    pub fn new(sizes: &[usize]) -> Self {
        NativeSlopes { stack: NativeStack::new(sizes), arguments: Vec::new(), results: Vec::new() }
    }

    fn solve(&mut self, arguments: &[f64]) {
        let NativeSlopes { stack, results, .. } = self;
        let (n, limits) = (stack.solver.n(), stack.solver.bounds().map_or(0, |(lower, _)| lower.len()));
        let (total, levels) = (stack.solver.rows().iter().sum(), stack.solver.rows().len());
        let sizes = Sizes { n, limits, total, levels };
        results.clear();
        stack.decide(arguments, {
            results.resize(sizes.standard(), 0.0);
            results
        });
        let slopes = if results[0].is_nan() { None } else { stack.solver.slopes() };
        let Some((slopes, x, sides)) = slopes else {
            return results.resize(sizes.results(), 0.0);
        };
        results.push(1.0);
        results.extend(x);
        let [jacobian, command, upper] = stack.solver.stack();
        let unit = |i: usize| (0..n).map(move |c| if c == i { 1.0 } else { 0.0 });
        let mut rows: Vec<f64> = (0..limits).flat_map(unit).chain(jacobian.iter().copied()).collect();
        stack.solver.settings.metric.iter().for_each(|metric| rows.chunks_exact_mut(n).for_each(|row| metric.row(row)));
        results.extend(rows);
        let bounds = stack.solver.bounds().map(|(lower, upper)| [lower, upper]);
        for (side, own) in [command, upper].into_iter().enumerate() {
            let end = results.len() + sizes.rows();
            results.extend(bounds.map_or(&[][..], |bounds| bounds[side]).iter().chain(own));
            results.resize(end, 0.0);
            results.extend(sides.iter().map(|acting| f64::from(u8::from(*acting == if side > 0 { 1 } else { -1 }))));
        }
        results.extend(slopes.by_bound.iter());
        results.extend(slopes.by_row.iter());
    }
}

impl Decision for NativeSlopes {
    fn decide(&mut self, arguments: &[f64], results: &mut [f64]) {
        if self.arguments != arguments {
            self.solve(arguments);
            self.arguments.clear();
            self.arguments.extend_from_slice(arguments);
        }
        let found = self.results.iter().copied().chain(std::iter::repeat(f64::NAN));
        results.iter_mut().zip(found).for_each(|(to, found)| *to = found);
    }
}

#[cfg(test)]
mod tests {
    use crate::priority::{PriorityMethod, PriorityOptions, PrioritySolver, StackFormula};
    use crate::scalar::Real;
    use crate::trace::Sym;
    use crate::trace::function::{Recorded, recorded};
    use crate::trace::sym;
    use crate::trace::tangents::tangents;

    /// The rows and commands of two levels at `x`.
    fn stack<S: Real>(x: S) -> (Vec<S>, Vec<S>) {
        let numbers = |of: [f64; 8], by: [f64; 8]| of.iter().zip(by).map(|(a, b)| x.mul_add(S::splat(b), S::splat(*a))).collect::<Vec<S>>();
        let all = numbers([1.0, 0.5, -0.2, 0.3, 1.0, 0.7, 0.8, 0.6], [0.2, -0.1, 0.4, 0.3, 0.5, -0.2, 0.7, 0.1]);
        (all[..6].to_vec(), all[6..].to_vec())
    }

    #[test]
    fn derivatives_with_a_metric_and_an_active_bound_are_those_of_differences() {
        let (v_max, held) = (vec![0.3, 5.0, 5.0], 1);
        let weight = Some(vec![2.0, 0.3, 0.0, 0.3, 1.0, 0.2, 0.0, 0.2, 3.0]);
        let options = PriorityOptions { v_max: Some(v_max), weight, ..PriorityOptions::new(PriorityMethod::Exact) };
        let mut solver = PrioritySolver::new(3, &[1, 1], &options).expect("a solver");
        let mut solve = |x: f64| {
            let (j, command) = stack(x);
            let solution = solver.solve(&[&j[..3], &j[3..]], &[&command[..1], &command[1..]]).expect("a solution");
            let bounded = solution.bounded.as_ref().expect("bounds");
            assert_eq!(bounded.sides[..3].iter().filter(|side| **side != 0).count(), held);
            solution.v.clone()
        };
        let (before, at, after) = (solve(0.5 - 1e-6), solve(0.5), solve(0.5 + 1e-6));
        let set_up = || {
            sym::differentiate();
            StackFormula::of(&solver)
        };
        let formula = |mut formula: StackFormula, x: &[Sym]| {
            let (j, command) = stack(x[0]);
            formula.solve(Sym::splat(1e-15), &j, &command);
            [formula.v(), &[sym::validity().expect("native code")]].concat()
        };
        let Recorded { ops, values, inputs, answer } = recorded(1, set_up, formula).expect("it does not branch");
        let (count, moving) = (values.len() + inputs, [values.len() as u32]);
        let found = tangents(&ops, count, &answer, answer.len(), &moving, 1);
        let answer = [found.values, found.rates].concat();
        let mut function = Recorded { ops: found.ops, values, inputs: inputs + 1, answer }.program(false);
        function.all_inputs().copy_from_slice(&[0.5, 1.0]);
        function.run();
        let all = function.outputs(0, 8);
        assert_eq!(all[3], 1.0);
        for i in 0..3 {
            assert!((all[i] - at[i]).abs() < 1e-14, "{all:?} {at:?}");
            assert!((all[4 + i] - (after[i] - before[i]) / 2e-6).abs() < 1e-8, "{all:?} {before:?} {after:?}");
        }
    }
}
