//! A quantity of an arm as a recorded function: from configurations in lanes to answers in lanes, for any number of threads.
//!
//! Arms with the same placements, and the same zeros and ones among their inertial parameters, share its program.

use super::Query;
use super::evaluate::Engine;
use crate::arm::Arm;
use crate::error::Result;
use crate::trace::function::{Evaluation, record};
use crate::trace::kept::free;
use std::sync::Mutex;

pub(super) struct ArmFunction {
    /// Widths of the inputs, and numbers of an answer.
    widths: Vec<usize>,
    length: usize,
    first: Evaluation,
    /// Those that no thread uses now.
    others: Mutex<Vec<Evaluation>>,
}

impl ArmFunction {
    /// Recorded now, its program made where its structure is new.
    pub fn new(arm: &Arm, query: &Query) -> Result<Self> {
        let (n, mut answered) = (arm.n(), Ok(()));
        let widths: Vec<usize> = (0..query.inputs().len()).map(|k| query.input_length(k, n)).collect();
        let answer = |mut engine: Engine<_>, mut inputs: &[_]| {
            for (input, &width) in engine.inputs.iter_mut().zip(&widths) {
                let (own, rest) = inputs.split_at(width);
                input[..width].copy_from_slice(own);
                inputs = rest;
            }
            engine.answer(query).map(<[_]>::to_vec).unwrap_or_else(|error| {
                answered = Err(error);
                Vec::new()
            })
        };
        let Some(first) = record(true, widths.iter().sum(), || Engine::new(arm, false), answer) else {
            unreachable!("the code of a quantity does not branch on data")
        };
        answered.map(|()| ArmFunction { others: Mutex::new(vec![first.clone()]), first, widths, length: query.length(n) })
    }

    /// All configurations of the inputs, which are what the query asks for. `direct` answers rows that turn by angles for which programs
    /// have no sine, and rows whose answer is not finite.
    pub fn rows(&self, inputs: &[&[f64]], out: &mut [f64], mut direct: impl FnMut(usize, &mut [f64]) -> Result<()>) -> Result<()> {
        let mut evaluation = free(&self.others).and_then(|mut others| others.pop()).unwrap_or_else(|| self.first.clone());
        let (lanes, length) = (evaluation.lanes(), self.length);
        for (group, out) in out.chunks_mut(lanes * length).enumerate() {
            let (at, mut first) = (group * lanes, 0);
            for (given, &width) in inputs.iter().zip(&self.widths) {
                evaluation.read(first, given, width, at);
                first += width;
            }
            evaluation.run();
            let sound = evaluation.write(0, length, out);
            if sound && (0..lanes).all(|lane| evaluation.is_near(lane)) {
                continue;
            }
            for (lane, row) in out.chunks_exact_mut(length).enumerate() {
                if !evaluation.is_near(lane) || row.iter().any(|x| !x.is_finite()) {
                    direct(at + lane, row)?;
                }
            }
        }
        if let Some(mut others) = free(&self.others) {
            others.push(evaluation);
        }
        Ok(())
    }
}
