//! The tasks of a law in order of priority at one instant, and what laws with such tasks have in common.

use crate::arm::Arm;
use crate::error::{Error, Result};
use crate::kinematics::TaskStack;
use crate::law::equations::Loop;
use crate::law::level::Level;
use crate::plant::K;
use crate::priority::{PriorityOptions, StackFormula};
use crate::scalar::Real;
use crate::trace::expression::{by_rows, stacked, zeros};
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
            if self.limits.is_some() { Route::Deciding } else { Route::Guarded }
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

/// The solution of the stack `j` for `command`, within `[lower, upper]` bounds of the joint rates. In a recording of terms, a solution with
/// bounds has a certificate.
pub(super) fn solution(at: &Loop, formula: &StackFormula, rounding: E, (j, command): (&M, &V), bounds: Option<[V; 2]>) -> StackFormula {
    let mut solution = formula.clone();
    if let Some(bounds) = bounds {
        at.term("lower", bounds[0].clone());
        at.term("upper", bounds[1].clone());
        *solution.bounds_mut() = bounds.map(|bound| bound.as_slice().to_vec());
        if at.collects_terms() {
            solution.certify();
        }
        // The stack as the solver reads it: its Jacobian, and the commands in the last column.
        let mut rows = j.clone().insert_column(j.ncols(), E::zero());
        rows.set_column(j.ncols(), command);
        at.matrix_term("stack", rows);
        E::term("rounding", &[], || vec![rounding]);
    }
    E::as_written(|| solution.solve(rounding, &by_rows(j), command.as_slice()));
    solution
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
    levels.iter().map(|level| &level.function).eq(others.iter().map(|level| &level.function)) && given(options) == given(other)
}
