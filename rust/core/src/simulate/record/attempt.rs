//! Programs of attempts of adaptive explicit methods. An *attempt* is one trial of a step, which the step-size controller accepts or
//! rejects. A *program* is a recorded and compiled computation.
//!
//! The program of an attempt computes all stages of a step. Only small loops have such a program.

use super::key::Common;
use super::slots::{Instant, RatesSlots};
use super::structure::{entries, inputs, instant, modes_as_inputs};
use crate::integrate::{Attempt, Buffer, MethodKind, Scheme, WithScheme};
use crate::scalar::Real;
use crate::scalar::trig::REDUCTION_LIMIT;
use crate::simulate::assembly::assemble;
use crate::simulate::closed_loop::ClosedLoop;
use crate::simulate::problem::Problem;
use crate::simulate::world::Exogenous;
use crate::trace::{Frame, Part, Program, Signature, SlotTable, Slots, Sym, engine, form, sym};

/// An attempt has no program if the rates of all its stages have more operations than this limit. The code of a larger attempt might exceed
/// the instruction cache.
pub const LARGE: usize = 3000;

/// The program of an attempt, for loops with the same structure.
pub struct AttemptProgram {
    program: Program,
    slots: AttemptSlots,
    stages: usize,
}

/// The slots of an attempt.
struct AttemptSlots {
    signature: Signature,
    /// The exogenous input of the first stage. The other stages follow.
    exogenous: Instant,
    state: Slots,
    /// The state rates at the start of the step.
    slope: Slots,
    step: Slots,
    /// The held results of the law, and the modes of contacts and joints.
    held: Slots,
    /// The new state, the slopes of the stages, the error estimates.
    results: Slots,
}

impl AttemptSlots {
    /// Return the slots of an attempt with `stages` stages and `estimates` error estimates of a loop whose rates have the slots `rates`.
    fn new(rates: &RatesSlots, stages: usize, estimates: usize) -> Self {
        let mut signature = Signature::new(rates.exogenous.slots.first);
        let mut instant = || Instant::add(&mut signature, ["desired", "force"], rates.exogenous.sizes());
        let exogenous = instant();
        (1..stages).for_each(|_| _ = instant());
        let mut input = |name, count| signature.input(name, count);
        let (state, slope) = (input("state", rates.state.count), input("slope", rates.state.count));
        let (step, held) = (input("h", 1), input("held", rates.held().count));
        let results = signature.output("results", (1 + stages + estimates) * rates.state.count);
        AttemptSlots { signature, exogenous, state, slope, step, held, results }
    }
}

/// Records an attempt for run `run` of a problem. The result is `None` if the loop is too large.
struct Attempts<'a> {
    problem: &'a Problem<'a>,
    run: usize,
    common: Common,
    held: bool,
    slots: &'a RatesSlots,
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

/// Compute all stages of an attempt of size `h` from the state `x`, whose slope is `first`. `instants` are the exogenous inputs of all
/// stages but the first. Return the new state, the slopes of these stages, and the error estimates, one after another.
pub fn record_stages<C: Scheme>(mut closed: ClosedLoop, instants: &[Exogenous<Sym>], (x, first, h): (&[Sym], &[Sym], Sym)) -> Vec<Sym> {
    let zeros = vec![Sym::zero(); x.len()];
    let (mut slopes, mut y, mut estimates) = (vec![zeros.clone(); C::STAGES + 1], zeros.clone(), vec![zeros; C::E.len()]);
    slopes[0] = first.to_vec();
    let mut attempt = Attempt { h, times: &[], x, slopes: &mut slopes, y: &mut y, estimates: &mut estimates };
    C::stages(&mut attempt, |k, y, dx| closed.rhs(&instants[k], y, dx));
    y.into_iter().chain(slopes.into_iter().skip(1).flatten()).chain(estimates.into_iter().flatten()).collect()
}

impl AttemptProgram {
    /// Return the program for the method of the problem. The result is `None` if the method is not explicit and adaptive. It is also `None`
    /// if the loop has too many `operations`, or if its code branches on data.
    pub fn of(problem: &Problem, run: usize, common: Common, held: bool, (slots, operations): (&RatesSlots, usize)) -> Option<Self> {
        match problem.options.method.kind() {
            MethodKind::ExplicitAdaptive(method) => method.scheme(Attempts { problem, run, common, held, slots, operations }),
            MethodKind::ExplicitSteps(_) | MethodKind::ImplicitSteps(_) | MethodKind::ImplicitAdaptive(_) => None,
        }
    }

    fn record<C: Scheme>(problem: &Problem, run: usize, common: Common, held: bool, rates: &RatesSlots) -> Option<Self> {
        sym::begin();
        let mut closed = assemble(problem, run, common.monitored.storage);
        assert_eq!(sym::end_set_up(), rates.exogenous.slots.first, "another structure");
        let slots = AttemptSlots::new(rates, C::STAGES, C::E.len());
        let instants: Vec<Exogenous<Sym>> = (0..C::STAGES).map(|_| instant(rates.exogenous.sizes())).collect();
        let (x, first, h) = (slots.state.declare(), slots.slope.declare(), slots.step.declare()[0]);
        let (tau, answer) = (inputs(rates.tau.count), inputs(rates.law_rate.count));
        if held {
            closed.hold_input(&tau, &answer);
        }
        modes_as_inputs(&mut closed, rates);
        let results = record_stages::<C>(closed, &instants, (&x, &first, h));
        let recording = sym::finish();
        if recording.failed {
            return None;
        }
        let outputs = slots.results.outputs(&entries(results));
        let part = Part { ops: &recording.ops, start: 0, outputs: &outputs, places: &SlotTable::default() };
        let program = Program::new(part, None, slots.signature.scratch(slots.signature.slots()), form(false), engine());
        Some(AttemptProgram { program, slots, stages: C::STAGES })
    }

    /// Return a frame of the program with the parameters, held results and modes of a frame of the rates, whose slots are `rates`.
    pub fn frame(&self, rates: &RatesSlots, from: &Frame) -> Frame {
        let mut frame = Frame::new(self.program.slots(), 1);
        self.program.prepare(&mut frame);
        let parameters = rates.exogenous.slots.first;
        frame.numbers_mut()[..parameters].copy_from_slice(&from.numbers()[..parameters]);
        self.hold(&mut frame, 0, from.group(rates.held()));
        frame
    }

    /// Write numbers to the held results and modes, from number `first` of them on.
    pub fn hold(&self, frame: &mut Frame, first: usize, numbers: &[f64]) {
        frame.write(self.slots.held.part(first, numbers.len()), numbers);
    }

    /// Compute an attempt. Return whether all angles are in the range of the program's sines; otherwise the results are not valid.
    /// `input(t, u)` writes the exogenous input at time `t` to `u`.
    pub fn run<B: Buffer<f64>>(
        &self,
        frame: &mut Frame,
        attempt: &mut Attempt<f64, B>,
        (u, mut input): (&mut Exogenous<f64>, impl FnMut(f64, &mut Exogenous<f64>)),
    ) -> bool {
        let AttemptSlots { signature, exogenous: Instant { slots: first, desired }, .. } = &self.slots;
        for (k, &t) in attempt.times.iter().enumerate().filter(|_| first.count > 0) {
            let at = first.part(k * first.count, first.count);
            if k > 0 && attempt.times[k - 1] == t {
                frame.numbers_mut().copy_within(at.first - at.count..at.first, at.first);
                continue;
            }
            input(t, u);
            frame.write(at, &u.desired);
            frame.write(at.part(*desired, 0), &u.wrench[..at.count - desired]);
        }
        frame.write(self.slots.state, attempt.x);
        frame.write(self.slots.slope, attempt.slopes[0].as_ref());
        frame.write(self.slots.step, &[attempt.h]);
        frame.fill(signature.angle(), 0.0);
        self.program.run(frame);
        let mut results = frame.group(self.slots.results).chunks_exact(attempt.x.len());
        let mut next = |to: &mut [f64]| to.copy_from_slice(results.next().unwrap_or_default());
        next(attempt.y);
        attempt.slopes[1..=self.stages].iter_mut().for_each(|slope| next(slope.as_mut()));
        attempt.estimates.iter_mut().for_each(|estimate| next(estimate.as_mut()));
        frame.numbers()[signature.angle()] < REDUCTION_LIMIT
    }
}
