//! A part of a recording that is divided at its cuts. At a cut, native code may replace results of a formula ([`super::decision`]).
//! The pieces between the cuts become straight-line code.
//!
//! Before a cut, a piece writes the arguments and the results of the formula to slots of the frame. The native code replaces the results in
//! these slots, and later pieces read them.

use super::decision;
use super::frame::Frame;
use super::segments::{Cut, join_from};
use super::straight::{Part, SlotTable};
use super::tape::Op;

/// Pairs of a slot and the entry whose value it receives.
pub type Outputs = Vec<(u32, u32)>;

/// A call of native code after a piece.
#[derive(Clone, Debug)]
pub struct Call {
    kind: u32,
    /// The slot of the first argument. The others follow.
    first: usize,
    /// The number of arguments, and the number of results up to the last one that later pieces read.
    sizes: (usize, usize),
    /// The results that later pieces read: their index and their slot.
    results: Vec<(u32, u32)>,
}

/// A piece of a part: the entries from `start` on, its outputs `(slot, entry)`, and the call after it.
pub struct Piece {
    pub start: u32,
    pub outputs: Outputs,
    pub call: Option<Call>,
}

/// The pieces of a part.
pub struct Pieces {
    /// The pieces in their order. The last one has no call.
    pub all: Vec<Piece>,
    /// The slots of values that earlier pieces or parts compute.
    pub places: SlotTable,
    /// The first slot that no piece uses.
    pub free: usize,
}

/// Divide a part at its cuts. Slots of new values begin at `free`. The result is `None` for a part without a cut.
pub fn divide(part: Part, free: usize) -> Option<Pieces> {
    let mut needed = vec![false; part.ops.len()];
    part.outputs.iter().for_each(|&(_, entry)| needed[entry as usize] = true);
    let mut cuts = Vec::new();
    for i in (0..part.ops.len() as u32).rev().filter(|&i| !part.is_before(i)) {
        if needed[i as usize] {
            let op = part.ops[i as usize];
            op.operands().for_each(|a| needed[a as usize] = true);
            if let Op::Decide(list, kind) = op {
                cuts.push((i, list, kind));
            }
        }
    }
    cuts.reverse();
    let lists: Vec<Vec<u32>> = cuts.iter().map(|&(_, list, _)| arguments(part.ops, list)).collect();
    let longest = lists.iter().map(Vec::len).max()?;
    let (mut places, mut next) = (part.places.clone(), (free + longest) as u32);
    let (mut ends, mut calls) = (Vec::new(), Vec::new());
    for (&(cut, _, kind), list) in cuts.iter().zip(&lists) {
        let mut outputs: Vec<(u32, u32)> = (free as u32..).zip(list.iter().copied()).collect();
        let mut results = Vec::new();
        for (i, op) in part.ops.iter().enumerate().filter(|(i, _)| needed[*i]) {
            if let Op::Decided(of, given, k) = *op
                && of == cut
            {
                results.push((k, next));
                outputs.push((next, given));
                places.insert(i as u32, next);
                next += 1;
            }
        }
        let sizes = (list.len(), results.iter().map(|&(k, _)| k as usize + 1).max().unwrap_or(0));
        calls.push(Some(Call { kind, first: free, sizes, results }));
        ends.push(Cut { end: cut + 1, outputs });
    }
    ends.push(Cut { end: part.ops.len() as u32, outputs: part.outputs.to_vec() });
    calls.push(None);
    let (places, free) = join_from(part.ops, part.start, places, &mut ends, next);
    let starts = std::iter::once(part.start).chain(ends.iter().map(|cut| cut.end)).collect::<Vec<_>>();
    let piece = |((start, cut), call): ((u32, Cut), _)| Piece { start, outputs: cut.outputs, call };
    let all = starts.into_iter().zip(ends).zip(calls).map(piece).collect();
    Some(Pieces { all, places, free: free as usize })
}

/// The entries of a list of arguments.
fn arguments(ops: &[Op], mut list: u32) -> Vec<u32> {
    let mut all = Vec::new();
    while let Op::Argument(before, x) = ops[list as usize] {
        all.push(x);
        list = before;
    }
    all.reverse();
    all
}

impl Call {
    /// The slot of the first argument, which is one if the results of the formula are valid.
    pub fn validity(&self) -> usize {
        self.first
    }

    /// Return the operations and the outputs of the native code as a formula on the slots of the frame, if it has one.
    pub fn closed_form(&self) -> Option<(Vec<Op>, Outputs)> {
        let (ops, answer) = decision::closed_form(self.kind)?;
        let read = |op| if let Op::Input(k) = op { Op::Input(self.first as u32 + k) } else { op };
        let outputs = self.results.iter().map(|&(k, slot)| (slot, answer[k as usize])).collect();
        Some((ops.into_iter().map(read).collect(), outputs))
    }

    /// Allocate the memory of the native code in a frame.
    pub fn prepare(&self, frame: &mut Frame) {
        frame.decisions().allocate(self.kind, self.sizes);
    }

    /// Let the native code replace the results in each lane in which the first argument is not one.
    #[inline]
    pub fn run(&self, frame: &mut Frame) {
        if frame.slot_mut(self.first).iter().any(|&valid| valid != 1.0) {
            self.decide(frame);
        }
    }

    #[cold]
    fn decide(&self, frame: &mut Frame) {
        let lanes = frame.lanes();
        let mut decisions = std::mem::take(frame.decisions());
        let at = decisions.allocate(self.kind, self.sizes);
        // The native code reads and writes different slots, through one shared view of the frame.
        let numbers = std::cell::Cell::from_mut(frame.numbers_mut()).as_slice_of_cells();
        let at_slot = |slot: usize, lane: usize| &numbers[slot * lanes + lane];
        for lane in (0..lanes).filter(|&lane| at_slot(self.first, lane).get() != 1.0) {
            let read = |arguments: &mut [f64], given: &mut [f64]| {
                arguments.iter_mut().enumerate().for_each(|(k, to)| *to = at_slot(self.first + k, lane).get());
                self.results.iter().for_each(|&(k, slot)| given[k as usize] = at_slot(slot as usize, lane).get());
            };
            let write = |decided: &[f64]| {
                self.results.iter().for_each(|&(k, slot)| at_slot(slot as usize, lane).set(decided[k as usize]));
            };
            decisions.run(at, self.sizes, read, write);
        }
        *frame.decisions() = decisions;
    }
}

#[cfg(test)]
mod tests {
    use super::super::adjoint::adjoint;
    use super::super::decision::{self, Decision};
    use super::super::frame::Frame;
    use super::super::instruction::Form;
    use super::super::program::{Engine, Program};
    use super::super::straight::{Part, Scratch, SlotTable, Stream};
    use super::super::tangents::tangents;
    use super::super::tests::{Random, forms};
    use super::super::{Recording, Sym, form, sym};
    use crate::scalar::Real;

    /// Returns the negative reciprocal of the sum of its arguments, and twice the result of the formula.
    #[derive(Debug)]
    struct Negative;

    impl Decision for Negative {
        fn decide(&mut self, arguments: &[f64], results: &mut [f64]) {
            results[0] = -1.0 / arguments.iter().sum::<f64>();
            if let [_, second, ..] = results {
                *second *= 2.0;
            }
        }
    }

    /// Return the result of two steps of a recurrence. `decide` replaces its results where `x` is below zero. The constant 1/3 is read before
    /// and after each cut.
    fn steps<S: Real>(x: S, y: S, decide: impl Fn(&[S], &mut [S])) -> [S; 3] {
        let (mut x, mut y, third) = (x, y, S::splat(1.0 / 3.0));
        for _ in 0..2 {
            let valid = S::select(x.lt(S::zero()), S::zero(), S::splat(1.0));
            let early = (x * third).sin_cos().1;
            let mut results = [x * y, y - early];
            decide(&[valid, x, y], &mut results);
            (x, y) = (results[0] * third + early, results[1] + x);
        }
        [x, y, x * y]
    }

    fn kind() -> u32 {
        decision::kind("negative", vec![], |_| Box::new(Negative), |_| None)
    }

    /// The steps on plain numbers.
    fn expected(x: f64, y: f64) -> [f64; 3] {
        steps(x, y, |arguments, results| {
            if arguments[0] != 1.0 {
                Negative.decide(arguments, results);
            }
        })
    }

    fn recorded() -> (Recording, Vec<u32>) {
        sym::begin();
        sym::end_set_up();
        let y = steps(sym::input(), sym::input(), |arguments, results| sym::decide(kind(), arguments, results)).map(Sym::index).to_vec();
        (sym::finish(), y)
    }

    /// Run `turns` steps of the recording along a stream with `x`, with `y` in the frame, and return the results of each lane.
    fn run(form: Form, engine: Engine, turns: usize, mut at: impl FnMut(usize) -> [f64; 2]) -> Vec<Vec<f64>> {
        let (recording, y) = recorded();
        let outputs: Vec<(u32, u32)> = [1, 2, 3].into_iter().zip([y[1], y[0], y[2]]).collect();
        let part = Part { ops: &recording.ops, start: 0, outputs: &outputs, places: &SlotTable::default() };
        let stream = Stream { first: 0, count: 1, advance: 1, spread: false };
        let program = Program::new(part, Some(stream), Scratch { reach: 4, free: 5 }, form, engine);
        let lanes = form.lanes();
        let (mut frame, mut along) = (Frame::new(program.slots(), lanes), Frame::new(turns, lanes));
        program.prepare(&mut frame);
        for lane in 0..lanes {
            let [x, y] = at(lane);
            frame.slot_mut(1)[lane] = y;
            (0..turns).for_each(|turn| along.slot_mut(turn)[lane] = x - turn as f64);
        }
        program.run_along(&mut frame, along.numbers(), turns);
        (0..lanes).map(|lane| [2, 1, 3].map(|slot| frame.slot_mut(slot)[lane]).to_vec()).collect()
    }

    #[test]
    fn native_code_replaces_results_in_its_lanes_only() {
        let mut random = Random(3);
        for form in forms() {
            for _ in 0..200 {
                let given: Vec<[f64; 2]> = (0..form.lanes()).map(|_| [random.number(), random.number()]).collect();
                let programs = [Engine::Machine, Engine::Interpreter].map(|engine| run(form, engine, 3, |lane| given[lane]));
                assert_eq!(programs[0], programs[1], "{form:?}");
                for (&[x, y], got) in given.iter().zip(&programs[0]) {
                    let mut all = [x, y, 0.0];
                    (0..3).for_each(|turn| all = expected(x - f64::from(turn), all[1]));
                    // The loop of plain numbers may round a product and a sum differently.
                    assert!(got.iter().zip(&all).all(|(got, all)| (got - all).abs() <= 1e-12 * (1.0 + all.abs())), "{got:?} {all:?}");
                }
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_formula_where_it_is_valid() {
        let (recording, y) = recorded();
        let f = |x: f64| expected(x, 0.4)[2];
        let expected = (f(0.7 + 1e-6) - f(0.7 - 1e-6)) / 2e-6;
        let function = |ops, inputs, answer| {
            let mut function = super::super::function::Recorded { ops, values: vec![], inputs, answer }.program(false);
            function.all_inputs()[..2].copy_from_slice(&[0.7, 0.4]);
            function.all_inputs()[2..].fill(1.0);
            function.run();
            function.output(0)[0]
        };
        let forward = tangents(&recording.ops, 2, &[y[2]], 1, &[0], 1);
        assert!((function(forward.ops, 3, forward.rates) - expected).abs() < 1e-8);
        let (ops, bars) = adjoint(recording.ops, 2, &[y[2]], &[0]);
        assert!((function(ops, 3, bars) - expected).abs() < 1e-8);
    }

    #[test]
    fn a_result_that_is_always_valid_needs_no_cut() {
        sym::begin();
        let x = sym::input();
        let mut results = [x];
        sym::decide(kind(), &[Sym::splat(1.0), x], &mut results);
        assert!(results == [x] && sym::validity().is_none() && form(false).lanes() == 1);
    }
}
