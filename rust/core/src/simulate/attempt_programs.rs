//! Programs of attempts of adaptive explicit methods. An *attempt* is one trial of a step, which the step-size controller accepts or
//! rejects. A *program* is a recorded and compiled computation.
//!
//! The program of an attempt computes all stages of a step. Only small loops have such a program.

use super::assembly::assemble;
use super::key::Common;
use super::layout::Slots;
use super::problem::Problem;
use super::recorded::{inputs, instant, modes_as_inputs};
use super::world::Exogenous;
use crate::integrate::{Attempt, Buffer, MethodKind, Scheme, WithScheme};
use crate::scalar::Real;
use crate::scalar::trig::REDUCTION_LIMIT;
use crate::trace::{Frame, Part, Program, Scratch, SlotTable, Sym, engine, form, sym};

/// An attempt has no program if the rates of all its stages have more operations than this limit. The code of a larger attempt might exceed
/// the instruction cache.
const LARGE: usize = 3000;

/// The program of an attempt, for loops with the same structure.
pub struct AttemptProgram {
    program: Program,
    places: AttemptLayout,
}

/// The slots of an attempt in the frame, which is the memory of its program. The loop parameters are first. The exogenous inputs of the
/// stages follow, then the quantities of the functions below.
struct AttemptLayout {
    slots: Slots,
    stages: usize,
    estimates: usize,
}

impl AttemptLayout {
    fn state(&self) -> usize {
        self.slots.given + self.stages * (self.slots.desired + self.slots.wrench)
    }
    /// The first slot of the state rates at the start of the step.
    fn slope(&self) -> usize {
        self.state() + self.slots.states()
    }
    fn step(&self) -> usize {
        self.slope() + self.slots.states()
    }
    /// The first slot of the held input and of the law's other results.
    fn held(&self) -> usize {
        self.step() + 1
    }
    /// The first slot of the modes of contacts and joints.
    fn modes(&self) -> usize {
        self.held() + self.slots.inputs + self.slots.answer
    }
    /// The first slot of the results: the new state, the slopes of the stages, the error estimates.
    fn results(&self) -> usize {
        self.modes() + self.slots.modes
    }
    fn reach(&self) -> usize {
        self.results() + (1 + self.stages + self.estimates) * self.slots.states()
    }
}

/// Records an attempt for run `run` of a problem. The result is `None` if the loop is too large.
struct Attempts<'a> {
    problem: &'a Problem<'a>,
    run: usize,
    common: Common,
    held: bool,
    slots: &'a Slots,
    /// The number of operations of the rates.
    operations: usize,
}

impl WithScheme for Attempts<'_> {
    type Output = Option<AttemptProgram>;

    fn with<C: Scheme>(self) -> Option<AttemptProgram> {
        if C::STAGES * self.operations > LARGE {
            return None;
        }
        AttemptProgram::record::<C>(self.problem, self.run, self.common, self.held, self.slots)
    }
}

impl AttemptProgram {
    /// Return the program for the method of the problem. The result is `None` if the method is not explicit and adaptive. It is also `None`
    /// if the loop has too many `operations`, or if its code branches on data.
    pub fn of(problem: &Problem, run: usize, common: Common, held: bool, (slots, operations): (&Slots, usize)) -> Option<Self> {
        match problem.options.method.kind() {
            MethodKind::ExplicitAdaptive(method) => method.scheme(Attempts { problem, run, common, held, slots, operations }),
            MethodKind::ExplicitSteps(_) | MethodKind::ImplicitSteps(_) | MethodKind::ImplicitAdaptive(_) => None,
        }
    }

    fn record<C: Scheme>(problem: &Problem, run: usize, common: Common, held: bool, slots: &Slots) -> Option<Self> {
        sym::begin();
        let mut closed = assemble(problem, run, common.monitored.storage);
        assert_eq!(sym::end_set_up(), slots.given, "another structure");
        let instants: Vec<Exogenous<Sym>> = (0..C::STAGES).map(|_| instant(slots.desired, slots.wrench)).collect();
        let (x, first, h) = (inputs(slots.states()), inputs(slots.states()), sym::input());
        let (tau, answer) = (inputs(slots.inputs), inputs(slots.answer));
        if held {
            closed.hold_input(&tau, &answer);
        }
        modes_as_inputs(&mut closed, slots);
        let zeros = vec![Sym::zero(); slots.states()];
        let (mut slopes, mut y, mut estimates) = (vec![zeros.clone(); C::STAGES + 1], zeros.clone(), vec![zeros; C::E.len()]);
        slopes[0] = first;
        let mut attempt = Attempt { h, times: &[], x: &x, slopes: &mut slopes, y: &mut y, estimates: &mut estimates };
        C::stages(&mut attempt, |k, y, dx| closed.rhs(&instants[k], y, dx));
        drop(closed);
        let recording = sym::finish();
        if recording.failed {
            return None;
        }
        let places = AttemptLayout { slots: slots.clone(), stages: C::STAGES, estimates: C::E.len() };
        let results = y.iter().chain(slopes[1..].iter().flatten()).chain(estimates.iter().flatten());
        let outputs: Vec<(u32, u32)> = results.enumerate().map(|(k, value)| ((places.results() + k) as u32, value.index())).collect();
        let part = Part { ops: &recording.ops, start: 0, outputs: &outputs, places: &SlotTable::default() };
        let scratch = Scratch { reach: places.reach() as u32, free: places.reach() + 1 };
        Some(AttemptProgram { program: Program::new(part, None, scratch, form(false), engine()), places })
    }

    /// Return a frame of the program with the inputs `numbers` of a frame of the rates, whose slots are `slots`.
    pub fn frame(&self, slots: &Slots, numbers: &[f64]) -> Frame {
        let mut frame = Frame::new(self.program.slots(), 1);
        self.program.prepare(&mut frame);
        write(&mut frame, 0, &numbers[..slots.given]);
        self.write(&mut frame, 0, &numbers[slots.tau()..slots.rates()]);
        frame
    }

    /// Write numbers to the program's frame. `first` is the distance of their slot to the slot of the held input. The other results of the
    /// law and the modes follow this input.
    pub fn write(&self, frame: &mut Frame, first: usize, numbers: &[f64]) {
        write(frame, self.places.held() + first, numbers);
    }

    /// Compute an attempt. Return whether all angles are in the range of the program's sines; otherwise the results are not valid.
    /// `input(t, u)` writes the exogenous input at time `t` to `u`.
    pub fn run<B: Buffer<f64>>(
        &self,
        frame: &mut Frame,
        attempt: &mut Attempt<f64, B>,
        (u, mut input): (&mut Exogenous<f64>, impl FnMut(f64, &mut Exogenous<f64>)),
    ) -> bool {
        let slots = &self.places.slots;
        let width = slots.desired + slots.wrench;
        for (k, &t) in attempt.times.iter().enumerate().filter(|_| width > 0) {
            let at = slots.given + k * width;
            if k > 0 && attempt.times[k - 1] == t {
                frame.numbers_mut().copy_within(at - width..at, at);
                continue;
            }
            input(t, u);
            write(frame, at, &u.desired);
            write(frame, at + slots.desired, &u.wrench[..slots.wrench]);
        }
        write(frame, self.places.state(), attempt.x);
        write(frame, self.places.slope(), attempt.slopes[0].as_ref());
        write(frame, self.places.step(), &[attempt.h]);
        frame.fill(self.places.reach(), 0.0);
        self.program.run(frame);
        let n = slots.states();
        let mut results = frame.numbers()[self.places.results()..self.places.reach()].chunks_exact(n);
        let mut next = |to: &mut [f64]| to.copy_from_slice(results.next().unwrap_or_default());
        next(attempt.y);
        attempt.slopes[1..=self.places.stages].iter_mut().for_each(|slope| next(slope.as_mut()));
        attempt.estimates.iter_mut().for_each(|estimate| next(estimate.as_mut()));
        frame.numbers()[self.places.reach()] < REDUCTION_LIMIT
    }
}

/// Write `values` to all lanes of the slots from `first` on.
pub fn write(frame: &mut Frame, first: usize, values: &[f64]) {
    let lanes = frame.lanes();
    let slots = &mut frame.numbers_mut()[first * lanes..(first + values.len()) * lanes];
    if lanes == 1 {
        slots.copy_from_slice(values);
    } else {
        slots.chunks_exact_mut(lanes).zip(values).for_each(|(slot, &value)| slot.fill(value));
    }
}
