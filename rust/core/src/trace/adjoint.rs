//! The adjoint of a recorded computation (reverse mode, Griewank and Walther 2008, section 3.2).
//!
//! For `y = f(x)` with the Jacobian `J = dy/dx`, and weights `y_bar` of the outputs, the adjoint computes `x_bar = J' y_bar`. Its
//! operations follow the operations of `y`. An *entry* is the index of a recorded operation. Entry 0 is the constant zero. An entry adds no
//! operation if it has no effect on an output, or if it does not depend on a differentiated input. At a corner (such as `|x|` at zero), the
//! result is the derivative of the selected branch. The other branch has the weight zero. Its numbers may be infinite, and zero times
//! infinity is NaN. Therefore, a product with the weight zero is set to zero.

use super::tape::{Op, Tape};

/// The state of an adjoint computation.
struct Reversal {
    tape: Tape,
    /// For each entry, the entry that contains its weight.
    bars: Vec<u32>,
    /// Whether each entry depends on a differentiated input.
    moves: Vec<bool>,
}

/// Append the adjoint to the recording `ops`, which has `inputs` inputs. The new inputs are the weights of `outputs`, in this order. Return
/// the operations, and the entries with the weights of the inputs `moving`.
pub fn adjoint(ops: Vec<Op>, inputs: usize, outputs: &[u32], moving: &[u32]) -> (Vec<Op>, Vec<u32>) {
    let length = ops.len();
    let (moves, finite) = (moves(&ops, moving), finite(&ops, outputs));
    let mut work = Reversal { tape: Tape::resume(ops, inputs as u32), bars: vec![0; length], moves };
    for &output in outputs {
        let weight = work.tape.new_input();
        work.add(output, weight);
    }
    for i in (0..length).rev() {
        if work.moves[i] && work.bars[i] != 0 {
            work.pass_on(i as u32, finite[i]);
        }
    }
    let bar = |&input: &u32| {
        let entry = work.tape.push(Op::Input(input)) as usize;
        if entry < length { work.bars[entry] } else { 0 }
    };
    let bars = moving.iter().map(bar).collect();
    (work.tape.ops, bars)
}

/// For each entry, whether it depends differentiably on one of the inputs `moving`.
fn moves(ops: &[Op], moving: &[u32]) -> Vec<bool> {
    let inputs: std::collections::HashSet<u32> = moving.iter().copied().collect();
    let mut moves = vec![false; ops.len()];
    for (i, op) in ops.iter().enumerate() {
        moves[i] = match op {
            Op::Input(k) => inputs.contains(k),
            // A mask and a list of arguments have no derivative.
            Op::Less(..) | Op::Argument(..) | Op::Decide(..) => false,
            _ => op.operands().any(|a| moves[a as usize]),
        };
    }
    moves
}

/// For each entry, whether it counts as finite if the outputs are finite. These are the operands of comparisons, and the entries on which
/// the outputs depend for every selection of branches.
fn finite(ops: &[Op], outputs: &[u32]) -> Vec<bool> {
    let mut needed = vec![false; ops.len()];
    outputs.iter().for_each(|&output| needed[output as usize] = true);
    for i in (0..ops.len()).rev() {
        match ops[i] {
            Op::Less(a, b) => [a, b].iter().for_each(|&a| needed[a as usize] = true),
            Op::Select(mask, ..) if needed[i] => needed[mask as usize] = true,
            Op::Select(..) => {}
            // Native code may read infinite arguments.
            Op::Decided(_, given, _) if needed[i] => needed[given as usize] = true,
            op if needed[i] => op.operands().for_each(|a| needed[a as usize] = true),
            _ => {}
        }
    }
    needed
}

impl Reversal {
    /// Add `bar` to the weight of entry `a`.
    fn add(&mut self, a: u32, bar: u32) {
        if self.moves[a as usize] {
            self.bars[a as usize] = self.tape.add(self.bars[a as usize], bar);
        }
    }

    /// Add `factor bar` to the weight of entry `a`. `finite`: whether `factor` is finite if the outputs are.
    fn add_product(&mut self, a: u32, factor: u32, bar: u32, finite: bool) {
        if !self.moves[a as usize] {
            return;
        }
        if finite {
            self.bars[a as usize] = self.tape.fma(factor, bar, self.bars[a as usize]);
        } else {
            let product = self.tape.mul(factor, bar);
            let product = self.unless_zero(bar, product);
            self.add(a, product);
        }
    }

    /// Return `then` where `bar` is not zero, otherwise zero. Subnormal numbers count as zero.
    fn unless_zero(&mut self, bar: u32, then: u32) -> u32 {
        let (least, size) = (self.tape.constant(f64::MIN_POSITIVE), self.tape.unary(bar, f64::abs, Op::Abs));
        let nothing = self.tape.less(size, least);
        self.tape.select(nothing, 0, then)
    }

    /// Add the weight of entry `i`, multiplied with the partial derivatives, to the weights of its operands.
    fn pass_on(&mut self, i: u32, finite: bool) {
        let bar = self.bars[i as usize];
        match self.tape.ops[i as usize] {
            Op::Const(_) | Op::Input(_) | Op::Less(..) | Op::Argument(..) | Op::Decide(..) => {}
            Op::Decided(_, given, _) => self.add(given, bar),
            Op::Add(a, b) => {
                self.add(a, bar);
                self.add(b, bar);
            }
            Op::Sub(a, b) => {
                self.add(a, bar);
                let negated = self.tape.neg(bar);
                self.add(b, negated);
            }
            Op::Neg(a) => {
                let negated = self.tape.neg(bar);
                self.add(a, negated);
            }
            Op::Mul(a, b) => {
                self.add_product(a, b, bar, finite);
                self.add_product(b, a, bar, finite);
            }
            Op::Fma(a, b, c) => {
                self.add_product(a, b, bar, finite);
                self.add_product(b, a, bar, finite);
                self.add(c, bar);
            }
            Op::Fnma(a, b, c) => {
                let negated = self.tape.neg(bar);
                self.add_product(a, b, negated, finite);
                self.add_product(b, a, negated, finite);
                self.add(c, bar);
            }
            Op::Div(a, b) => {
                let one = self.tape.constant(1.0);
                let (inverse, negated) = (self.tape.div(one, b), self.tape.neg(bar));
                let quotient = self.tape.mul(negated, inverse);
                self.add_product(a, inverse, bar, finite);
                let quotient = if finite { quotient } else { self.unless_zero(bar, quotient) };
                self.add_product(b, i, quotient, finite);
            }
            Op::Sqrt(a) => {
                // At zero, the slope of the square root is infinite. It is set to zero, because a sum of squares has the derivative zero
                // there.
                let (half, least) = (self.tape.constant(0.5), self.tape.constant(f64::MIN_POSITIVE));
                let (slope, nothing) = (self.tape.div(half, i), self.tape.less(i, least));
                let slope = self.tape.select(nothing, 0, slope);
                self.add_product(a, slope, bar, finite);
            }
            Op::Abs(a) => {
                let (below, negated) = (self.tape.less(a, 0), self.tape.neg(bar));
                let bar = self.tape.select(below, negated, bar);
                self.add(a, bar);
            }
            Op::Max(a, b) => {
                let below = self.tape.less(a, b);
                self.choose(below, b, a, bar);
            }
            Op::Min(a, b) => {
                let below = self.tape.less(b, a);
                self.choose(below, b, a, bar);
            }
            Op::Sin(a) => {
                let cosine = self.tape.push(Op::Cos(a));
                self.add_product(a, cosine, bar, finite);
            }
            Op::Cos(a) => {
                let (sine, negated) = (self.tape.push(Op::Sin(a)), self.tape.neg(bar));
                self.add_product(a, sine, negated, finite);
            }
            Op::Select(mask, yes, no) => self.choose(mask, yes, no, bar),
        }
    }

    /// Add `bar` to the weight of `yes` where the mask is true, otherwise to the weight of `no`.
    fn choose(&mut self, mask: u32, yes: u32, no: u32, bar: u32) {
        let (to_yes, to_no) = (self.tape.select(mask, bar, 0), self.tape.select(mask, 0, bar));
        self.add(yes, to_yes);
        self.add(no, to_no);
    }
}
