//! The active rows of a law of task priority at one instant, and the reasons why its levels are not reached.

use super::single::Memory;
use super::solution::{PrioritySolution, status_member};
use crate::errors::Failure;
use armlet_core::error::Error;
use armlet_core::law::{LawSpec, Term};
use armlet_core::priority::{BoundedRows, PriorityOptions, PrioritySolver, reasons};
use armlet_core::status::Status;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// The smallest share of a bound in what stops a level that is reported.
const LEAST_SHARE: f64 = 0.005;

/// Replace the terms `stack` and `rounding` of a law with bounds by its active rows and the reasons why levels are not reached. The stack has
/// the Jacobian of all levels, and in its last columns the commands or lower bounds, and the upper bounds.
pub fn put_active_rows(parts: &Bound<'_, PyDict>, spec: &LawSpec, terms: &mut Vec<Term>) -> Result<(), Failure> {
    let options = match spec {
        LawSpec::PriorityVelocity(law) => &law.options,
        LawSpec::PriorityAcceleration(law) => &law.options,
        _ => return Ok(()),
    };
    let mut take = |name: &str| terms.iter().position(|term| term.0 == name).map(|at| terms.remove(at));
    let (Some((_, shape, stack)), Some((_, _, rounding))) = (take("stack"), take("rounding")) else { return Ok(()) };
    let value = |name: &str| terms.iter().find(|term| term.0 == name).map(|term| term.2.clone());
    let (limits, tasks, n) = (spec.limit_rows(), spec.level_rows(), shape[1] - 2);
    let others = shape[0] - limits.iter().chain(&tasks).sum::<usize>();
    let rows: Vec<usize> = limits.iter().chain(&tasks).copied().chain((others > 0).then_some(others)).collect();
    let mut options = PriorityOptions { rounding: Some(rounding[0]), ..options.clone() };
    if limits.is_empty() {
        (options.v_min, options.v_max) = (value("lower"), value("upper"));
    }
    let mut solver = PrioritySolver::new(n, &rows, &options)?;
    let is_interval = !solver.upper().is_empty();
    for (i, row) in stack.chunks_exact(n + 2).enumerate() {
        let (jacobian, command) = solver.inputs();
        jacobian[i * n..(i + 1) * n].copy_from_slice(&row[..n]);
        command[i] = row[n];
        if is_interval {
            solver.upper()[i] = row[n + 1];
        }
    }
    solver.run()?;
    parts.set_item("holds", holds(&solver, &options, tasks.len())?)?;
    let py = parts.py();
    let contradicted = solver.solution().bounded.as_ref().is_some_and(|bounded| {
        let first = bounded.limits;
        bounded.violations[first..first + limits.iter().sum::<usize>()].iter().any(|violation| *violation != 0.0)
    });
    parts.set_item("status", status_member(py, if contradicted { Status::Infeasible } else { solver.solution().status })?)?;
    let solution = Bound::new(py, PrioritySolution::of(&solver, rows.into(), Arc::new(options), &mut Memory::default()))?;
    let why = (1..=tasks.len()).map(|k| solution.call_method1("why", (k,))).collect::<PyResult<Vec<_>>>()?;
    for (name, item) in [("limits", solution.getattr("limits")?), ("active", solution.getattr("active")?), ("why", why.into_pyobject(py)?)]
    {
        parts.set_item(name, item)?;
    }
    Ok(())
}

/// The bounds that hold joint limits below torque limits, which are level 0, or one of the first `count` levels of tasks. A bound has the name
/// of the row, its side, the level that it holds, and its share.
fn holds(solver: &PrioritySolver, options: &PriorityOptions, count: usize) -> Result<Vec<(String, &'static str, usize, f64)>, Error> {
    let (n, above, [jacobian, command, upper]) = (solver.n(), options.limit_levels, solver.stack());
    let upper = if upper.is_empty() { command } else { upper };
    let identity: Vec<f64> = (0..n * n).map(|k| if k % (n + 1) == 0 { 1.0 } else { 0.0 }).collect();
    let limits = options.velocity_bounds();
    let mut levels: Vec<BoundedRows> = vec![limits.as_ref().map_or((&[], &[], &[]), |(low, high)| (&identity, low, high))];
    let mut first = 0;
    for m in solver.rows() {
        let rows = first..first + m;
        levels.push((&jacobian[rows.start * n..rows.end * n], &command[rows.clone()], &upper[rows]));
        first += m;
    }
    let mut all = Vec::new();
    for k in above.max(1)..=above + count {
        for reason in reasons(n, &levels, &solver.solution().v, k)?.reasons {
            if reason.side != 0 && reason.share.abs() >= LEAST_SHARE {
                let row = reason.row + 1;
                let name = match reason.level {
                    1 if above > 0 => format!("torque of joint {row}"),
                    level if level <= above => format!("joint {row}"),
                    level => format!("row {row} of level {}", level - above),
                };
                all.push((name, if reason.side > 0 { "upper" } else { "lower" }, k - above, reason.share));
            }
        }
    }
    Ok(all)
}
