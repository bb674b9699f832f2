//! The tasks of a law in order of priority at one instant, and what laws with such tasks have in common.

use crate::arm::Arm;
use crate::error::{Error, Result};
use crate::kinematics::TaskStack;
use crate::law::equations::Loop;
use crate::law::level::Level;
use crate::plant::{K, Parameters};
use crate::priority::{PriorityOptions, StackFormula};
use crate::scalar::Real;
use crate::trace::expression::{by_rows, constant, stacked, vector, zeros};
use crate::trace::{E, M, V};

/// Implement the common functions of laws with the fields `model`, `levels` and `options`.
macro_rules! prioritised {
    ($name:literal, $plant:ident) => {
        fn name(&self) -> &'static str {
            $name
        }
        fn plant(&self) -> PlantKind {
            PlantKind::$plant
        }
        fn model(&self) -> &Model {
            &self.model
        }
        fn motions(&self) -> Vec<&Motion> {
            self.levels.iter().map(|level| &level.target).collect()
        }
        fn route(&self) -> Route {
            let bounded = self.limits.is_some() || !self.limit_rows().is_empty() || self.levels.iter().any(|level| level.bounds.is_some());
            match bounded {
                true if self.options.scales_commands() => Route::Deciding,
                true => Route::Bounded,
                false => Route::Guarded,
            }
        }
        fn samples(&self) -> bool {
            self.limits.as_ref().is_some_and(|limits| limits.sampled)
        }
        fn levels(&self) -> &[Level] {
            &self.levels
        }
    };
}
pub(super) use prioritised;

/// Create the tasks of `levels` for the arm.
pub(crate) fn stack<S: Real>(arm: &Arm, levels: &[Level]) -> TaskStack<S> {
    TaskStack::new(arm, levels.iter().map(|level| level.function.clone()).collect())
}

/// For each level of priority, whether a task of it has bounds. Empty if no task has bounds.
pub(super) fn intervals(levels: &[Level]) -> Vec<bool> {
    let mut intervals: Vec<bool> = Vec::new();
    for task in levels {
        match intervals.last_mut() {
            Some(last) if task.joins => *last |= task.bounds.is_some(),
            _ => intervals.push(task.bounds.is_some()),
        }
    }
    if intervals.contains(&true) { intervals } else { Vec::new() }
}

pub(crate) fn require_levels(levels: &[Level]) -> Result<()> {
    if levels.is_empty() { Err(Error::input("tasks", "is empty: expected at least one task, got 0")) } else { Ok(()) }
}

/// The tasks of a law at one instant.
pub(super) struct Tasks {
    /// Errors of all tasks, stacked.
    pub e: V,
    /// Feed-forward velocities `x_d'` of all tasks, stacked, less the rate `J v` in a moving stack.
    pub e_dot: V,
    /// Feed-forward accelerations `x_d'' - dJ/dt v` of all tasks, stacked; zeros in a stack without velocities.
    pub acceleration: V,
    /// Stacked Jacobians, `(sum rows, n)`.
    pub j: M,
    /// Rates of the Jacobians, `(sum rows, n)`; empty in a stack without velocities.
    pub j_dot: M,
    /// Assumed relative error of the entries of the Jacobians.
    pub rounding: E,
}

impl Tasks {
    /// The tasks `stack` at an instant. If `moves` is true, the rates include the velocity of the joints.
    pub fn of(stack: &TaskStack<E>, at: &Loop, moves: bool) -> Self {
        let mut stack = stack.clone();
        E::as_written(|| {
            stack.place(at.q.as_slice());
            if moves {
                stack.set_moving(at.v.as_slice());
            }
            let (j, j_dot) =
                (stack.jacobian_matrix(false), if moves { stack.jacobian_matrix(true) } else { M::from_element(0, 0, E::zero()) });
            let total = j.nrows();
            let [mut e, mut e_dot, mut acceleration] = [0; 3].map(|_| zeros(total));
            let mut first = 0;
            for (k, sample) in at.all_desired().iter().enumerate() {
                let rows = first..first + stack.rows()[k];
                let desired = stacked(sample);
                let second = if moves { Some(&mut acceleration.as_mut_slice()[rows.clone()]) } else { None };
                let (own, rate) = (&mut e.as_mut_slice()[rows.clone()], &mut e_dot.as_mut_slice()[rows.clone()]);
                stack.error(k, desired.as_slice(), own, rate, second);
                first = rows.end;
            }
            Tasks { e, e_dot, acceleration, j, j_dot, rounding: stack.rounding() }
        })
    }
}

/// The rows of a stack: Jacobian, commands, and for each row the distances from the command to its lower and upper bound. The distances are
/// zero for tasks, and empty if no task has bounds.
pub(super) struct Rows {
    pub j: M,
    pub command: V,
    pub distances: [V; 2],
}

/// The bounds of all tasks as numbers of a law, lower and upper bounds, `(sum rows,)` each: zeros for tasks without bounds.
pub(super) fn bound_numbers(levels: &[Level]) -> Option<[Vec<f64>; 2]> {
    let side = |k: usize| {
        let of_task = |task: &Level| task.bounds.as_ref().map_or_else(|| vec![0.0; task.function.rows()], |bounds| bounds[k].clone());
        levels.iter().flat_map(of_task).collect()
    };
    levels.iter().any(|task| task.bounds.is_some()).then(|| [side(0), side(1)])
}

/// Add the bounds of tasks to the numbers of a law.
pub(super) fn with_bounds(numbers: Parameters, [lower, upper]: [Vec<f64>; 2]) -> Parameters {
    numbers.numbers("lower", &lower).numbers("upper", &upper)
}

/// The number of rows of each task.
pub(super) fn rows_of_tasks(levels: &[Level]) -> Vec<usize> {
    levels.iter().map(|level| level.function.rows()).collect()
}

/// The errors of tasks, where the error of a task with bounds is its distance from them. Also the distances `K lower` and `K upper` from the
/// commands to the bounds.
pub(super) fn bounded_errors(levels: &[Level], numbers: &Parameters, rows: &[usize], e: &V) -> (V, [V; 2]) {
    if levels.iter().all(|level| level.bounds.is_none()) {
        return (e.clone(), [zeros(0), zeros(0)]);
    }
    let bounds = ["lower", "upper"].map(|name| numbers.get_numbers(name));
    (errors_to_bounds(levels, e, bounds), bounds.map(|bound| gained(numbers.get_gains("gain"), rows, bound)))
}

/// The stacked errors `e` to targets, in which the errors of tasks with bounds are replaced by the distances to their bounds.
fn errors_to_bounds(levels: &[Level], e: &V, bounds: [&V; 2]) -> V {
    let mut errors = e.clone();
    let mut i = 0;
    for task in levels {
        for _ in 0..task.function.rows() {
            if task.bounds.is_some() {
                errors[i] = (bounds[0][i] + e[i]).max(E::zero()) + (bounds[1][i] + e[i]).min(E::zero());
            }
            i += 1;
        }
    }
    errors
}

/// The factors of the rows: 1 for rows of limits, then the square root of the weight of each task that shares its level.
fn row_factors(levels: &[Level], limits: usize) -> Option<Vec<f64>> {
    let shares = |i: usize| levels[i].joins || levels.get(i + 1).is_some_and(|next| next.joins);
    let factor = |i: usize| if shares(i) { levels[i].weight.sqrt() } else { 1.0 };
    let of_tasks = (0..levels.len()).flat_map(|i| std::iter::repeat_n(factor(i), levels[i].function.rows()));
    let factors: Vec<f64> = std::iter::repeat_n(1.0, limits).chain(of_tasks).collect();
    factors.iter().any(|factor| *factor != 1.0).then_some(factors)
}

/// The solution of a stack within `[lower, upper]` bounds of the joint rates, with a number of rows of limits above the tasks. In a recording
/// of terms, a solution with bounds has a certificate. The second result are the violations with the opposite sign, stacked: the residuals of
/// tasks.
pub(super) fn solution(
    at: &Loop,
    formula: &StackFormula,
    (levels, rounding, limits): (&[Level], E, usize),
    Rows { j, command, distances }: Rows,
    bounds: Option<[V; 2]>,
) -> (StackFormula, V) {
    let mut solution = formula.clone();
    let factors = row_factors(levels, limits);
    let scaled = |x: &V| match &factors {
        Some(factors) => V::from_fn(x.len(), |i, _| factors.get(i).map_or(x[i], |&factor| x[i] * constant(factor))),
        None => x.clone(),
    };
    let is_bounded = bounds.is_some() || !distances[0].is_empty();
    let [lower, upper] = if distances[0].is_empty() { [command, zeros(0)] } else { distances.map(|distance| &command + distance) };
    let rows = match &factors {
        Some(factors) => M::from_fn(j.nrows(), j.ncols(), |i, k| factors.get(i).map_or(j[(i, k)], |&factor| j[(i, k)] * constant(factor))),
        None => j.clone(),
    };
    let (low, high) = (scaled(&lower), scaled(&upper));
    solution.upper_mut().copy_from_slice(high.as_slice());
    if is_bounded {
        if let Some(bounds) = bounds {
            at.term("lower", bounds[0].clone());
            at.term("upper", bounds[1].clone());
            *solution.bounds_mut() = bounds.map(|bound| bound.as_slice().to_vec());
        }
        if at.collects_terms() {
            solution.certify();
        }
        // The stack as the solver reads it: its Jacobian, the commands or lower bounds, and the upper bounds.
        let mut stack = rows.clone().insert_columns(j.ncols(), 2, E::zero());
        stack.set_column(j.ncols(), &low);
        stack.set_column(j.ncols() + 1, if upper.is_empty() { &low } else { &high });
        at.matrix_term("stack", stack);
        E::term("rounding", &[], || vec![rounding]);
    }
    E::as_written(|| solution.solve(rounding, &by_rows(&rows), low.as_slice()));
    if is_bounded {
        E::term("certificate", &[], || vec![solution.certificate()]);
    }
    let residuals = if factors.is_none() && upper.is_empty() {
        vector(solution.residuals())
    } else {
        let value = &j * vector(solution.v());
        V::from_fn(value.len(), |i, _| if upper.is_empty() { lower[i] } else { value[i].max(lower[i]).min(upper[i]) } - value[i])
    };
    (solution, residuals)
}

/// The products of the gains of all levels and their parts of `x`, stacked.
pub(super) fn gained(gains: &[K], rows: &[usize], x: &V) -> V {
    let mut first = 0;
    let parts: Vec<V> = gains
        .iter()
        .zip(rows)
        .map(|(gain, &m)| {
            let part = x.rows(first, m).into_owned();
            first += m;
            gain * &part
        })
        .collect();
    stacked(&parts)
}

/// The norms of error `e` and residual of each level, one level after another. `rows` has the number of rows of each level.
pub(crate) fn norms(rows: &[usize], e: &[E], residuals: &[E]) -> Vec<E> {
    let mut first = 0;
    let of_level = |&m: &usize| {
        let norm = |x: &[E]| x[first..first + m].iter().fold(E::zero(), |sum, &x| sum + x * x).sqrt();
        let both = [norm(e), norm(residuals)];
        first += m;
        both
    };
    rows.iter().flat_map(of_level).collect()
}

/// Whether both laws solve the same tasks with the same algorithm. Targets, gains and thresholds may differ.
pub(super) fn same_tasks((levels, options): (&[Level], &PriorityOptions), (others, other): (&[Level], &PriorityOptions)) -> bool {
    let given = |options: &PriorityOptions| (options.method, options.eps.is_some(), options.weight.is_some());
    let same = levels.len() == others.len() && levels.iter().zip(others).all(|(level, other)| level.same_rows(other));
    same && given(options) == given(other)
}
