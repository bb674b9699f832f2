//! A quantity of an arm as a recorded function, compiled to a *program*. It maps configurations in lanes to results in lanes, for any
//! number of threads.
//!
//! Arms with the same placements can share a program, if the values 0, 1 and -1 occur at the same places among their inertial parameters.

use super::Query;
use super::buffered_tree::BufferedTree;
use crate::arm::Arm;
use crate::error::Result;
use crate::scalar::Real;
use crate::scalar::rows::{read_one, write_one};
use crate::trace::Sym;
use crate::trace::cache::free;
use crate::trace::function::{self, Evaluation, Recorded, record};
use crate::trace::rows::Rows;
use std::sync::Mutex;

/// Number of groups of lanes after which the results of the program are checked.
const BLOCK: usize = 16;

pub(super) struct ArmFunction {
    /// Lengths of the inputs.
    widths: Vec<usize>,
    /// Length of a result.
    length: usize,
    first: Evaluation,
    /// Evaluations that no thread uses now.
    others: Mutex<Vec<Evaluation>>,
}

fn widths(query: &Query, n: usize) -> Vec<usize> {
    (0..query.inputs().len()).map(|k| query.input_length(k, n)).collect()
}

/// Evaluate a query for its inputs, which follow one another in `inputs`. Errors: `Memory`.
fn answer_of<S: Real>(mut engine: BufferedTree<S>, mut inputs: &[S], query: &Query, widths: &[usize]) -> Result<Vec<S>> {
    for (input, &width) in engine.inputs.iter_mut().zip(widths) {
        let (own, rest) = inputs.split_at(width);
        input[..width].copy_from_slice(own);
        inputs = rest;
    }
    engine.answer(query).map(<[_]>::to_vec)
}

/// Record the operations of a query.
pub(super) fn recording(arm: &Arm, query: &Query) -> Result<Recorded> {
    let widths = widths(query, arm.n());
    recorded_by(arm, query, &widths, |inputs, set_up, answer| function::recorded(inputs, set_up, answer))
}

/// Record a query and make its program, for one configuration or for one per lane.
pub(super) fn recorded(arm: &Arm, query: &Query, lanes: bool) -> Result<Evaluation> {
    let widths = widths(query, arm.n());
    recorded_by(arm, query, &widths, |inputs, set_up, answer| record(lanes, inputs, set_up, answer))
}

/// Record a query with the function `record`. The arguments of `record` are the number of inputs, a function that creates the buffers, and
/// a function that evaluates the query.
fn recorded_by<T>(
    arm: &Arm,
    query: &Query,
    widths: &[usize],
    record: impl FnOnce(usize, &dyn Fn() -> BufferedTree<Sym>, &mut dyn FnMut(BufferedTree<Sym>, &[Sym]) -> Vec<Sym>) -> Option<T>,
) -> Result<T> {
    let mut answered = Ok(());
    let mut answer = |engine: BufferedTree<Sym>, inputs: &[Sym]| {
        answer_of(engine, inputs, query, widths).unwrap_or_else(|error| {
            answered = Err(error);
            Vec::new()
        })
    };
    let Some(made) = record(widths.iter().sum(), &|| BufferedTree::new(arm, false), &mut answer) else {
        unreachable!("the code of a quantity does not branch on data")
    };
    answered.map(|()| made)
}

/// A recorded quantity at one configuration after another.
pub(super) struct ArmCall {
    /// Lengths of the inputs.
    widths: Vec<usize>,
    /// Length of a result.
    length: usize,
    evaluation: Evaluation,
}

impl ArmCall {
    pub fn new(arm: &Arm, query: &Query) -> Result<Self> {
        Ok(ArmCall { widths: widths(query, arm.n()), length: query.length(arm.size()), evaluation: recorded(arm, query, false)? })
    }

    /// Compute one configuration. Return false if the program has no valid result. The caller then evaluates the query directly.
    pub fn answer(&mut self, inputs: &[&[f64]], out: &mut [f64]) -> bool {
        if inputs.len() != self.widths.len() || out.len() != self.length {
            return false;
        }
        let (mut rest, mut sound) = (self.evaluation.all_inputs(), true);
        for (given, &width) in inputs.iter().zip(&self.widths) {
            let (own, others) = rest.split_at_mut(width);
            sound &= given.len() == width && read_one(given, own);
            rest = others;
        }
        if !sound {
            return false;
        }
        self.evaluation.run();
        self.evaluation.is_near(0) && write_one(self.evaluation.outputs(0, self.length), out)
    }
}

impl ArmFunction {
    pub fn new(arm: &Arm, query: &Query) -> Result<Self> {
        let first = recorded(arm, query, true)?;
        Ok(ArmFunction { others: Mutex::new(vec![first.clone()]), first, widths: widths(query, arm.n()), length: query.length(arm.size()) })
    }

    /// Run the program for all rows of the inputs. `direct` computes a row without the program if the magnitude of an angle is not below
    /// `REDUCTION_LIMIT`, or if the result is not finite.
    pub fn rows(&self, inputs: &[&[f64]], out: &mut [f64], mut direct: impl FnMut(usize, &mut [f64]) -> Result<()>) -> Result<()> {
        let mut evaluation = free(&self.others).and_then(|mut others| others.pop()).unwrap_or_else(|| self.first.clone());
        let (lanes, length) = (evaluation.lanes(), self.length);
        let mut all = [Rows::default(); 4];
        for (rows, (numbers, &width)) in all.iter_mut().zip(inputs.iter().zip(&self.widths)) {
            *rows = Rows { numbers, width };
        }
        let inputs = &all[..inputs.len()];
        for (block, out) in out.chunks_mut(BLOCK * lanes * length).enumerate() {
            let start = block * BLOCK * lanes;
            let mut sound = true;
            evaluation.reset_angle();
            for (group, out) in out.chunks_mut(lanes * length).enumerate() {
                evaluation.read(inputs, start + group * lanes);
                evaluation.run_on();
                sound &= evaluation.write(0, length, out);
            }
            if sound && (0..lanes).all(|lane| evaluation.is_near(lane)) {
                continue;
            }
            // Find the rows that the program cannot compute, group by group.
            for (group, out) in out.chunks_mut(lanes * length).enumerate() {
                let at = start + group * lanes;
                evaluation.read(inputs, at);
                evaluation.run();
                for (lane, row) in out.chunks_exact_mut(length).enumerate() {
                    if !evaluation.is_near(lane) || row.iter().any(|x| !x.is_finite()) {
                        direct(at + lane, row)?;
                    }
                }
            }
        }
        if let Some(mut others) = free(&self.others) {
            others.push(evaluation);
        }
        Ok(())
    }
}
