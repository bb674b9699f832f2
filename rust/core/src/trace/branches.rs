//! The branches of a recorded computation. A branch is a comparison `a < b` that selects one of two values. Its *margin* is `a - b`: where
//! the margin changes its sign, the computation changes to the other value, and its results may jump.

use super::differentiate::needed;
use super::tape::{Op, Tape};
use std::ops::Range;

/// A recording with the margins of its branches as outputs, and the same recording with given results of all comparisons.
pub struct Branches {
    /// The recording with the margins.
    pub ops: Vec<Op>,
    /// The indices of the margins in `ops`.
    pub margins: Vec<u32>,
    /// The recording with one more input per branch. The comparison of a branch is true if its input is negative.
    pub held: Vec<Op>,
    /// The indices of the outputs in `held`.
    pub outputs: Vec<u32>,
}

/// Return the branches of `ops` on which `outputs` depend, and whose comparison depends on an input with a number in `moving`. `ops` has
/// `inputs` inputs. The result is `None` without such a branch.
pub fn branches(ops: &[Op], inputs: usize, outputs: &[u32], moving: Range<usize>) -> Option<Branches> {
    let needed = needed(ops, outputs);
    let mut varies = vec![false; ops.len()];
    for (i, op) in ops.iter().enumerate() {
        varies[i] = match *op {
            Op::Input(input) => moving.contains(&(input as usize)),
            _ => op.operands().any(|a| varies[a as usize]),
        };
    }
    let is_branch = |i: usize| needed[i] && varies[i] && matches!(ops[i], Op::Less(..));
    if !(0..ops.len()).any(is_branch) {
        return None;
    }
    let (mut all, mut margins) = (Tape::resume(ops.to_vec(), inputs as u32), Vec::new());
    let mut tape = Tape::resume(Tape::new().ops, inputs as u32);
    let mut values = vec![0; ops.len()];
    for i in (0..ops.len()).filter(|&i| needed[i]) {
        values[i] = match ops[i] {
            Op::Less(a, b) if is_branch(i) => {
                margins.push(all.sub(a, b));
                let given = tape.new_input();
                tape.less(given, 0)
            }
            op => tape.push(op.on(|a| values[a as usize])),
        };
    }
    let outputs = outputs.iter().map(|&output| values[output as usize]).collect();
    Some(Branches { ops: all.ops, margins, held: tape.ops, outputs })
}

#[cfg(test)]
mod tests {
    use super::super::function::{Recorded, recorded};
    use super::*;
    use crate::scalar::Real;
    use crate::trace::sym::Sym;

    /// `y = x k` if `x < 3`, otherwise `y = x + 1`, within 7. The limit 7 is a comparison too, the one of `k` and 2 is a constant.
    #[test]
    fn results_are_those_of_the_given_comparisons() {
        let f = |k: Sym, x: Sym| {
            let y = Sym::select(x.lt(Sym::splat(3.0)), x * k, x + Sym::splat(1.0));
            let high = Sym::splat(7.0);
            Sym::select(k.lt(Sym::splat(2.0)), y, Sym::select(high.lt(y), high, y))
        };
        let Recorded { ops, inputs, answer, values } =
            recorded(1, || Sym::varying(2.5), |k, x| vec![f(k, x[0])]).expect("it does not branch");
        let found = branches(&ops, 1 + inputs, &answer, 1..2).expect("two branches");
        assert_eq!(found.margins.len(), 2);
        let call = |ops: &[Op], answer: &[u32], given: &[f64]| {
            let function = Recorded { ops: ops.to_vec(), values: values.clone(), inputs: given.len(), answer: answer.to_vec() };
            let mut function = function.program(false);
            let lanes = function.lanes();
            function.all_inputs().chunks_exact_mut(lanes).zip(given).for_each(|(to, &x)| to.fill(x));
            function.run();
            (0..answer.len()).map(|k| function.output(k)[0]).collect::<Vec<f64>>()
        };
        assert_eq!(call(&found.ops, &found.margins, &[2.0]), [-1.0, 2.0]);
        assert_eq!(call(&found.ops, &found.margins, &[7.5]), [4.5, -1.5]);
        for (masks, y) in [([-1.0, 1.0], 5.0), ([1.0, 1.0], 3.0), ([1.0, -1.0], 7.0)] {
            assert_eq!(call(&found.held, &found.outputs, &[2.0, masks[0], masks[1]]), [y]);
        }
        assert!(branches(&ops, 1 + inputs, &answer, 2..2).is_none());
    }
}
