//! Derivatives of a run with respect to its parameters (Griewank and Walther 2008; Hairer, Norsett and Wanner, section I.14).
//!
//! A run is a list of operations on one state `X`: steps `x_next = x + h sum b_i k_i` with the slopes `k_i`, samples of the law, and
//! records. The forward pass applies the operations to the tangents `X_p`. The backward pass applies the adjoints of the operations, in
//! reverse order. It reads the states before the operations from memory, or computes them again. The state rates and the law are recorded
//! as lists of operations, and these lists are differentiated. With an adaptive method, both passes have steps that are accurate for the
//! tangents too, and the step sizes count as constants. Where a contact changes, or another branch at which the state rates jump, the
//! tangents jump.
//!
//! A parameter `p` is given by runs of the problem that differ in this parameter, and by weights: `dF/dp = sum w_i (F_i - F_0)`. Here `F`
//! is a loop parameter, the initial state or a desired motion, and `F_i` its value in run `i`. The results of runs are not differentiated
//! by finite differences.
//!
//! Terms of this directory:
//!
//! - A loop parameter is a number that is constant in a run, such as a mass, a gain, a target or a limit. It varies if a parameter `p`
//!   changes it.
//! - The exogenous input `u` is the desired motion and the external force.
//! - Loops have the same structure if their recorded functions have the same operations.
//! - The held input is the plant's input and the rate of the law's state between two samples of a sampled law.
//! - A mode of the contacts lists for each contact whether it is apart, pressed or slack ([`Touch`](crate::plant::Touch)).
//! - The tangent of a quantity is its derivative along a direction in the space of the parameters.
//! - The weight of a quantity is the derivative of the weighted sum of the records with respect to it (the adjoint).
//!
//! The folder is flat, because its files are the parts of two passes over the same timeline.

mod backward;
mod branches;
mod combine;
mod controlled_steps;
mod directions;
mod forward;
mod functions;
mod mixture;
mod parameters;
mod prepared;
mod rows;
mod series;
mod set_ups;
mod structure;
mod switch;
mod tangent_call;
mod timeline;
mod walk;

pub use parameters::{Parameter, Parameters, Shared};
pub use rows::{Rows, adjoint_of_rows, sensitivities_of_rows};

use super::columns::Columns;
use super::problem::Problem;
use super::stop::Stop;
use crate::error::Result;
use controlled_steps::completed;
use prepared::{Loop, Prepared};
use series::Series;
use std::ops::Range;
use structure::FunctionStore;

/// The names of the quantities in a record, and the range of each quantity in the record.
pub type RecordParts = Vec<(&'static str, Range<usize>)>;

/// Return the quantities of a record `[x, tau]`, and the number of elements of the record.
pub fn record_parts(problem: &Problem) -> (RecordParts, usize) {
    let columns = Columns::of(problem);
    let size = problem.plant(0).states() + columns.p;
    let names = ["q", "v", "tau", "theta", "theta_dot", "estimate", "bristles"];
    (names.into_iter().zip(columns.series(size, 0)).filter(|(_, range)| !range.is_empty()).collect(), size + columns.n)
}

fn prepare<'a>(problem: &'a Problem<'a>, parameters: Parameters, stop: &dyn Stop) -> Result<Prepared<'a>> {
    completed(Loop::of(problem, parameters)?.prepare(problem, parameters, &FunctionStore::default(), stop)?, parameters.all)
}

/// Return the derivatives of the records of run 0 of `problem`, at the times of its options. Each part that [`record_parts`] names has an
/// array of shape `(records, numbers, parameters)`, in the units of the record per unit of the parameter. The options must have
/// `Times::At`, and no monitors.
///
/// Errors: `Input` for a parameter, method, law or plant without a derivative. `Solve` if the run ends early, grazes a contact, has tasks
/// near a singularity or an angle above 10^6 rad.
pub fn sensitivities(problem: &Problem, parameters: Parameters, stop: &dyn Stop) -> Result<Vec<Vec<f64>>> {
    let prepared = prepare(problem, parameters, stop)?;
    let (parts, _) = record_parts(problem);
    let mut series = Series::zeros(parts.into_iter().map(|(_, range)| range), prepared.timeline.records, parameters.all.len())?;
    forward::run(&prepared, &mut series)?;
    Ok(series.into_rates())
}

/// Return `sum_k w_k' dr_k/dp` for the records `r_k = [x, tau]` of run 0 of `problem`, one number per parameter. `'` is the transpose.
///
/// `weights`: the `w_k`, shape `(records, numbers)`. `memory`: an approximate limit of the stored states, in bytes. Other states are
/// computed again. Errors: as for [`sensitivities`].
pub fn adjoint(problem: &Problem, parameters: Parameters, weights: &[f64], memory: usize, stop: &dyn Stop) -> Result<Vec<f64>> {
    backward::run(&prepare(problem, parameters, stop)?, weights, memory)
}
