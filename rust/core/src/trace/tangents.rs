//! A recorded computation with its derivatives along several directions (forward mode, Griewank and Walther 2008, section 3.1).
//!
//! For `y = f(x)` with the Jacobian `J = dy/dx`, and directions `x_dot` of the inputs, the result is `y` and `J x_dot`. The derivatives of
//! each operation follow the operation immediately. All directions use the same values.

use super::differentiate::{needed, rate};
use super::tape::{Op, Tape};

/// A recording with its derivatives.
pub struct Tangents {
    pub ops: Vec<Op>,
    /// The indices of the outputs in `ops`.
    pub values: Vec<u32>,
    /// The indices in `ops` of the derivatives of the first `moved` outputs. All derivatives along the first direction come first, then all
    /// along the next direction.
    pub rates: Vec<u32>,
}

/// Record `ops`, which has `inputs` inputs, with the derivatives of the first `moved` outputs along `directions` directions. The new inputs
/// are the rates of the inputs `moving`: all rates along the first direction, then all along the next.
pub fn tangents(ops: &[Op], inputs: usize, outputs: &[u32], moved: usize, moving: &[u32], directions: usize) -> Tangents {
    let mut tape = Tape::resume(Tape::new().ops, inputs as u32);
    let given: Vec<Vec<u32>> = (0..directions).map(|_| moving.iter().map(|_| tape.new_input()).collect()).collect();
    let needed = needed(ops, outputs);
    // The new index of each value, and for each direction the index of the value's rate.
    let (mut values, mut rates) = (vec![0; ops.len()], vec![Vec::new(); directions]);
    for i in (0..ops.len()).filter(|&i| needed[i]) {
        let op = ops[i].on(|a| values[a as usize]);
        let value = tape.push(op);
        values[i] = value;
        for (rates, given) in rates.iter_mut().zip(&given) {
            let rate = match op {
                Op::Input(input) => moving.iter().position(|&moves| moves == input).map_or(0, |k| given[k]),
                _ => rate(&mut tape, op, value, |a| rates[a as usize]),
            };
            rates.resize(tape.ops.len(), 0);
            rates[value as usize] = rate;
        }
    }
    let values: Vec<u32> = outputs.iter().map(|&output| values[output as usize]).collect();
    let rates = rates.iter().flat_map(|rates| values[..moved].iter().map(|&value| rates[value as usize])).collect();
    Tangents { ops: tape.ops, values, rates }
}
