//! The active rows of a law of task priority at one instant, and the reasons why its levels are not reached.

use super::single::Memory;
use super::solution::PrioritySolution;
use crate::errors::Failure;
use armlet_core::law::{LawSpec, Term};
use armlet_core::priority::{PriorityOptions, PrioritySolver};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// Replace the terms `stack` and `rounding` of a law with bounds by its active rows and the reasons why levels are not reached. The stack has
/// the Jacobian of all levels, and in its last column their commands.
pub fn put_active_rows(parts: &Bound<'_, PyDict>, spec: &LawSpec, terms: &mut Vec<Term>) -> Result<(), Failure> {
    let options = match spec {
        LawSpec::PriorityVelocity(law) => &law.options,
        LawSpec::PriorityAcceleration(law) => &law.options,
        _ => return Ok(()),
    };
    let mut take = |name: &str| terms.iter().position(|term| term.0 == name).map(|at| terms.remove(at));
    let (Some((_, shape, stack)), Some((_, _, rounding))) = (take("stack"), take("rounding")) else { return Ok(()) };
    let value = |name: &str| terms.iter().find(|term| term.0 == name).map(|term| term.2.clone());
    let (tasks, width) = (spec.level_rows(), shape[1]);
    let others = shape[0] - tasks.iter().sum::<usize>();
    let rows: Vec<usize> = tasks.iter().copied().chain((others > 0).then_some(others)).collect();
    let options = PriorityOptions { rounding: Some(rounding[0]), v_min: value("lower"), v_max: value("upper"), ..options.clone() };
    let mut solver = PrioritySolver::new(width - 1, &rows, &options)?;
    let (jacobian, command) = solver.inputs();
    for (i, row) in stack.chunks_exact(width).enumerate() {
        jacobian[i * (width - 1)..(i + 1) * (width - 1)].copy_from_slice(&row[..width - 1]);
        command[i] = row[width - 1];
    }
    solver.run()?;
    let py = parts.py();
    let solution = Bound::new(py, PrioritySolution::of(&solver, rows.into(), Arc::new(options), &mut Memory::default()))?;
    let why = (1..=tasks.len()).map(|k| solution.call_method1("why", (k,))).collect::<PyResult<Vec<_>>>()?;
    for (name, item) in [("limits", solution.getattr("limits")?), ("active", solution.getattr("active")?), ("why", why.into_pyobject(py)?)]
    {
        parts.set_item(name, item)?;
    }
    Ok(())
}
