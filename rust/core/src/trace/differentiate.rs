//! Derivatives of a recorded computation along one direction (forward mode, Griewank and Walther 2008, section 3.1).
//!
//! For `y = f(x)` with the Jacobian `J = dy/dx`, and a direction `x_dot` of the inputs, the tangent is `y_dot = J x_dot`. Its operations
//! follow the operations of `y`. An *entry* is the index of a recorded operation. Entry 0 is the constant zero. An entry that does not
//! depend on a differentiated input has the derivative zero, and folding removes all operations on this zero. At a corner (such as `|x|` at
//! zero), the result is the derivative of the selected branch.

use super::tape::{Op, Tape};

/// A recording that is being differentiated.
pub struct Differentiation {
    tape: Tape,
    /// The length of the recording.
    length: usize,
}

impl Differentiation {
    /// Begin with the recording `ops`, which has `inputs` inputs.
    pub fn new(ops: Vec<Op>, inputs: usize) -> Self {
        Differentiation { length: ops.len(), tape: Tape::resume(ops, inputs as u32) }
    }

    /// Append the derivatives of the entries `outputs` along one direction, and return their entries. The new inputs are the rates of the
    /// inputs `moving`, in this order. All other inputs have the rate zero.
    pub fn along(&mut self, moving: &[u32], outputs: &[u32]) -> Vec<u32> {
        let given: Vec<(u32, u32)> = moving
            .iter()
            .map(|&input| {
                let rate = self.tape.new_input();
                (self.tape.push(Op::Input(input)), rate)
            })
            .collect();
        derivative(&mut self.tape, self.length, &given, outputs)
    }

    /// The number of entries, including those of the added derivatives.
    pub fn length(&self) -> u32 {
        self.tape.ops.len() as u32
    }

    /// Return the recording with the added operations.
    pub fn finish(self) -> Vec<Op> {
        self.tape.ops
    }
}

/// Append the derivatives of `outputs`, which are among the first `length` entries, and return their entries. `given` lists entries with
/// their rates, which are also entries. All other inputs have the rate zero.
pub(super) fn derivative(tape: &mut Tape, length: usize, given: &[(u32, u32)], outputs: &[u32]) -> Vec<u32> {
    let (needed, mut rates) = (needed(&tape.ops[..length], outputs), vec![None; length]);
    for &(entry, rate) in given {
        // An input that the recording does not read has a new entry.
        if let Some(to) = rates.get_mut(entry as usize) {
            *to = Some(rate);
        }
    }
    for i in (0..length).filter(|&i| needed[i]) {
        if rates[i].is_none() {
            let op = tape.ops[i];
            rates[i] = Some(rate(tape, op, i as u32, |a| rates[a as usize].unwrap_or(0)));
        }
    }
    outputs.iter().map(|&output| rates[output as usize].unwrap_or(0)).collect()
}

/// For each entry, whether `outputs` depend on it.
pub(super) fn needed(ops: &[Op], outputs: &[u32]) -> Vec<bool> {
    let mut needed = vec![false; ops.len()];
    outputs.iter().for_each(|&output| needed[output as usize] = true);
    for i in (0..ops.len()).rev() {
        if needed[i] {
            ops[i].operands().for_each(|a| needed[a as usize] = true);
        }
    }
    needed
}

/// Record the derivative of entry `i` with operation `op`. `at(operand)` is the entry of the operand's derivative, which is 0 if the
/// derivative is zero.
pub(super) fn rate(tape: &mut Tape, op: Op, i: u32, at: impl Fn(u32) -> u32) -> u32 {
    if op.operands().all(|a| at(a) == 0) {
        return 0;
    }
    match op {
        // A mask and a list of arguments have no derivative.
        Op::Const(_) | Op::Input(_) | Op::Less(..) | Op::Argument(..) | Op::Decide(..) => 0,
        Op::Add(a, b) => tape.add(at(a), at(b)),
        Op::Sub(a, b) => tape.sub(at(a), at(b)),
        Op::Neg(a) => tape.neg(at(a)),
        Op::Mul(a, b) => {
            let second = tape.mul(at(b), a);
            tape.fma(at(a), b, second)
        }
        Op::Fma(a, b, c) => {
            let sum = tape.fma(at(b), a, at(c));
            tape.fma(at(a), b, sum)
        }
        Op::Fnma(a, b, c) => {
            let sum = tape.fnma(at(b), a, at(c));
            tape.fnma(at(a), b, sum)
        }
        Op::Div(a, b) => {
            let one = tape.constant(1.0);
            let inverse = tape.div(one, b);
            let sum = tape.fnma(at(b), i, at(a));
            tape.mul(sum, inverse)
        }
        Op::Sqrt(a) => {
            // Where the square root is zero, its slope is infinite. A zero rate must remain zero there, not become NaN.
            let (half, least) = (tape.constant(0.5), tape.constant(f64::MIN_POSITIVE));
            let slope = tape.div(half, i);
            let size = tape.unary(at(a), f64::abs, Op::Abs);
            let (nothing, rate) = (tape.less(size, least), tape.mul(at(a), slope));
            tape.select(nothing, 0, rate)
        }
        Op::Abs(a) => {
            let (below, other) = (tape.less(a, 0), tape.neg(at(a)));
            tape.select(below, other, at(a))
        }
        Op::Max(a, b) => {
            let below = tape.less(a, b);
            tape.select(below, at(b), at(a))
        }
        Op::Min(a, b) => {
            let below = tape.less(b, a);
            tape.select(below, at(b), at(a))
        }
        Op::Sin(a) => {
            let cosine = tape.push(Op::Cos(a));
            tape.mul(at(a), cosine)
        }
        Op::Cos(a) => {
            let sine = tape.push(Op::Sin(a));
            let rate = tape.mul(at(a), sine);
            tape.neg(rate)
        }
        Op::Select(mask, yes, no) => tape.select(mask, at(yes), at(no)),
        // The derivative is valid where the result of the formula is.
        Op::Decided(_, given, _) => at(given),
    }
}
