//! `armlet.solve_priority`, for one stack or for a batch of stacks.

use super::single::Memory;
use super::solution::PrioritySolution;
use super::stack::{Keywords, Stack, items, method_name};
use super::stacks;
use super::within::{Targets, Within};
use crate::arrays::{of_shape, optional_number};
use crate::errors::Failure;
use armlet_core::error::Error;
use armlet_core::priority::{DEFAULT_ROUNDING, PriorityOptions, PrioritySolver as Core};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use std::cell::RefCell;
use std::sync::Arc;

/// The solver of a single solve, the number of rows of each level, and the options.
struct LastSolver {
    solver: Core,
    rows: Arc<[usize]>,
    options: Arc<PriorityOptions>,
    /// Whether the call set no other keywords than `method` and `rounding`.
    plain: bool,
    memory: Memory,
}

thread_local! {
    /// The solver of the last single solve on this thread. A loop over single stacks of equal sizes with equal options therefore allocates
    /// the solver's buffers once.
    static LAST: RefCell<Option<LastSolver>> = const { RefCell::new(None) };
}

/// Return the last solver, or a new one. The levels `intervals` have bounds.
fn solver(function: &str, n: usize, rows: &[usize], keywords: &Keywords, intervals: &[bool]) -> Result<(Core, PriorityOptions), Failure> {
    let options = PriorityOptions { intervals: intervals.to_vec(), ..keywords.options(function, n, rows.len())? };
    if let Some(LastSolver { solver: last, options: own, .. }) = LAST.take()
        && last.n() == n
        && last.rows() == rows
        && *own == options
    {
        return Ok((last, options));
    }
    Ok((Core::new(n, rows, &options)?, options))
}

/// Copy one stack to the inputs of the solver, and solve it.
fn solve_row(solver: &mut Core, stack: &Stack, upper: Option<&Stack>) -> Result<(), Error> {
    if let Some(upper) = upper {
        let all: Vec<f64> = (0..upper.rows.len()).flat_map(|level| upper.velocity(level, 0)).copied().collect();
        solver.upper().copy_from_slice(&all);
    }
    let (jacobian, command) = solver.inputs();
    let (mut at, mut to) = (0, 0);
    for (level, m) in stack.rows.iter().enumerate() {
        jacobian[at..at + m * stack.n].copy_from_slice(stack.jacobian(level, 0));
        command[to..to + m].copy_from_slice(stack.velocity(level, 0));
        at += m * stack.n;
        to += m;
    }
    solver.run().map(|_| ())
}

/// Compute joint velocities for tasks `J_i v = v_i` with priorities: a task does not disturb the tasks of higher priority.
///
/// `v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1) + ..` with the pseudoinverse `#` and the null-space projector `P1 = I - J1# J1`. Rank decisions
/// compare singular values with the size of the unprojected Jacobians.
///
/// Args:
///     jacobians: one `(..., rows_i, n)` per level, the highest priority first. Zero rows, and more rows than joints, are allowed.
///     velocities: one `(..., rows_i)` per level, in the unit of the task. `Within(lower, upper)` bounds a level instead.
///     method: "exact" is the equation above. "clamp" is continuous and bounded, and equals "exact" where all singular values are at least
///         `eps`. "damped" and "chiaverini" use damped pseudoinverses. "sns" is "exact" with `scale="direction"`, and requires `v_min`
///         or `v_max`. The method and all further arguments are keyword only.
///     eps: threshold on singular values, > 0, one number or one per level; None: 0.02 times each level's largest row norm. "exact" and
///         "sns" do not accept it.
///     rounding: relative error of the entries of the Jacobians; None: 8 times the machine epsilon. For Jacobians that were computed from
///         angles `q`, pass `8 (1 + sum|q|)` times the machine epsilon.
///     weight: joint metric `W`, `(n, n)`, symmetric and positive definite: `v' W v` is minimised; None: the identity.
///     v_min, v_max: bounds of `v` above all levels, a number or `(n,)`, rad/s or m/s. A missing bound is minus the other bound.
///         "chiaverini" accepts no bounds.
///     scale: "direction" keeps the direction of each command. A level whose command is not feasible executes its largest feasible
///         multiple `s v_i`, `0 <= s <= 1`. None minimises `|J_i v - v_i|` instead. Only "exact" and "sns" accept "direction".
///
/// Returns:
///     A `PrioritySolution`. A batch does not raise for one invalid row. A row whose numbers are not finite, or whose result overflows, is
///     NaN with `Status.DIVERGED`.
///
/// Raises:
///     InputError: shapes do not fit, the stack is empty, the method is unknown, "sns" has no bounds, or an option is out of its range. A
///         number that is not finite also raises it in a single stack, and so do bounds out of order, with their level and row.
///     SolveError: the result of a single stack overflows.
///
/// Source: Siciliano and Slotine, A general framework for managing multiple tasks in highly redundant robotic systems, ICAR 1991.
///
/// >>> import armlet as al
/// >>> sol = al.solve_priority([[[1.0, 0.0]], [[1.0, 1.0]]], [[1.0], [3.0]], method="exact")
/// >>> sol.v.round(12)
/// array([1., 2.])
/// >>> sol.status
/// <Status.SUCCESS: 0>
#[entered]
#[pyfunction]
#[arguments(jacobians, velocities, *, method="clamp", eps=None, rounding=None, weight=None, v_min=None, v_max=None, scale=None)]
pub fn solve_priority() -> Result<PrioritySolution, Failure> {
    let (method, rounding) = (method_name(NAME, method)?, optional_number(NAME, "rounding", rounding)?);
    let keywords = Keywords { method, eps, rounding, weight, v_min, v_max, scale };
    if let Some(solution) = solve_with_last(jacobians, velocities, &keywords) {
        return Ok(solution);
    }
    let (jacobians, velocities) = (items(NAME, "jacobians", jacobians)?, items(NAME, "velocities", velocities)?);
    const NAMES: [&str; 2] = ["jacobians", "velocities"];
    let Targets { lower, upper, intervals } = Targets::new(velocities);
    let mut stack = Stack::read_or_lend(py, NAME, NAMES, &jacobians, Some(&lower), intervals.is_empty())?;
    stack.intervals = intervals;
    let upper = if upper.is_empty() { None } else { Some(Stack::read(py, NAME, NAMES, &jacobians, Some(&upper))?) };
    let (solver, options) = solver(NAME, stack.n, &stack.rows, &keywords, &stack.intervals)?;
    if stack.lead.is_empty() {
        return single(py, solver, &stack, upper.as_ref(), options, keywords.plain());
    }
    // If the work is long, the stack is read again into copies.
    let copied = || Stack::read(py, NAME, NAMES, &jacobians, Some(&lower));
    stacks::solve(py, NAME, &solver, stack, upper, &options, copied)
}

/// Entry `i` of a list or a tuple.
#[inline]
fn at<'py>(items: &Bound<'py, PyAny>, i: usize) -> Option<Bound<'py, PyAny>> {
    match items.cast_exact::<PyList>() {
        Ok(list) => list.get_item(i).ok(),
        Err(_) => items.cast_exact::<PyTuple>().ok()?.get_item(i).ok(),
    }
}

/// The length of a list or a tuple.
#[inline]
fn length(items: &Bound<'_, PyAny>) -> Option<usize> {
    items.cast_exact::<PyList>().map(|list| list.len()).or_else(|_| items.cast_exact::<PyTuple>().map(|tuple| tuple.len())).ok()
}

/// Whether options are equal, apart from the list of levels with bounds, which the caller compares.
fn differ_only_in_levels(options: &PriorityOptions, given: &PriorityOptions) -> bool {
    let PriorityOptions { method, eps, rounding, weight, keep_direction, intervals: _, limit_levels, v_min, v_max } = given;
    let own = (options.method, options.rounding, options.keep_direction, options.limit_levels);
    own == (*method, *rounding, *keep_direction, *limit_levels)
        && [(&options.eps, eps), (&options.weight, weight), (&options.v_min, v_min), (&options.v_max, v_max)].iter().all(|(a, b)| a == b)
}

/// Solve a single stack of contiguous arrays with the solver of the last call, if the sizes and the options are equal. The result is `None`
/// for other stacks, and for errors, which the general path reports.
fn solve_with_last(jacobians: &Bound<'_, PyAny>, velocities: &Bound<'_, PyAny>, keywords: &Keywords) -> Option<PrioritySolution> {
    // Reading the keywords may run Python code, which may call `solve_priority`. So it comes first.
    let given = if keywords.plain() {
        None
    } else {
        let n = LAST.with(|last| last.try_borrow().ok()?.as_ref().map(|last| last.solver.n()))?;
        Some(keywords.options("solve_priority", n, length(jacobians)?).ok()?)
    };
    // No Python code runs in this closure, so `LAST` is not borrowed twice.
    LAST.with(|last| {
        let mut last = last.try_borrow_mut().ok()?;
        let LastSolver { solver, rows, options, plain, memory } = last.as_mut()?;
        let same =
            given.as_ref().map_or(*plain && solver.method().name() == keywords.method, |given| differ_only_in_levels(options, given));
        if !same || [length(jacobians)?, length(velocities)?] != [rows.len(); 2] {
            return None;
        }
        solver.set_rounding(keywords.rounding.unwrap_or(DEFAULT_ROUNDING)).ok()?;
        let (n, mut to) = (solver.n(), 0);
        for (i, &m) in rows.iter().enumerate() {
            let (jacobian, target) = (at(jacobians, i)?, at(velocities, i)?);
            let within = if options.intervals.is_empty() { None } else { target.cast_exact::<Within>().ok() };
            if within.is_some() != options.intervals.get(i).is_some_and(|interval| *interval) {
                return None;
            }
            let bounds = within.map(|within| within.get().bounds(target.py()));
            let (lower, upper) = bounds.as_ref().map_or((&target, &target), |[lower, upper]| (lower, upper));
            let jacobian = of_shape(&jacobian, &[m, n])?;
            let (j, v) = solver.inputs();
            j[to * n..(to + m) * n].copy_from_slice(jacobian);
            v[to..to + m].copy_from_slice(of_shape(lower, &[m])?);
            if let Some(u) = solver.upper().get_mut(to..to + m) {
                u.copy_from_slice(of_shape(upper, &[m])?);
            }
            to += m;
        }
        solver.used();
        solver.run().ok()?;
        if options.rounding != keywords.rounding {
            *options = Arc::new(PriorityOptions { rounding: keywords.rounding, ..(**options).clone() });
        }
        Some(PrioritySolution::of(solver, rows.clone(), options.clone(), memory))
    })
}

fn single(
    py: Python<'_>,
    mut solver: Core,
    stack: &Stack,
    upper: Option<&Stack>,
    options: PriorityOptions,
    plain: bool,
) -> Result<PrioritySolution, Failure> {
    if let Err(error) = solve_row(&mut solver, stack, upper) {
        stack.require_finite(py, "solve_priority")?;
        return Err(error.into());
    }
    let rows: Arc<[usize]> = solver.rows().into();
    let options = Arc::new(options);
    let mut memory = Memory::default();
    let solution = PrioritySolution::of(&solver, rows.clone(), options.clone(), &mut memory);
    LAST.set(Some(LastSolver { solver, rows, options, plain, memory }));
    Ok(solution)
}
