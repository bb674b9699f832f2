//! Programs of attempts of adaptive explicit methods in lanes. Each lane computes an attempt of another run, with its own step size, times
//! and state. A *program* is a recorded and compiled computation, and a *frame* is its memory.
//!
//! One program computes all stages of a small loop. For a large loop, the program of the rates alternates with programs of the arguments
//! of the stages. The dense output of a step needs further stages. Their programs run only if a lane requests a state within its step.

use super::attempt::{LARGE, record_stages};
use super::key::Common;
use super::slots::RatesSlots;
use super::structure::{entries, instant_of, modes_as_inputs};
use crate::integrate::{Scheme, WithScheme};
use crate::scalar::Real;
use crate::scalar::trig::REDUCTION_LIMIT;
use crate::simulate::assembly::assemble;
use crate::simulate::problem::Problem;
use crate::trace::tape::Op;
use crate::trace::{Frame, Part, Program, SlotTable, Slots, Sym, engine, form, sym};

/// The slots of attempts in lanes. The slots of the rates are first, so that the program of the rates uses the same frame. Its state is the
/// argument of the present stage, and after the last stage the new state.
struct LaneSlots {
    rates: RatesSlots,
    /// The exogenous inputs of all stages but the first, one after another.
    instants: Slots,
    /// The state at the start of the step, and the new state. The stages of the dense output replace the argument of the present stage.
    state: Slots,
    new_state: Slots,
    /// The slopes of all stages.
    slopes: Slots,
    step: Slots,
    /// The relative and the absolute tolerance, and a zero.
    tolerance: Slots,
    /// One if the attempt is accepted, otherwise zero.
    accepted: Slots,
    /// The error of the attempt divided by the allowed error, and the largest absolute value of the plant's new states.
    judged: Slots,
    /// The rows of the dense output.
    rows: Slots,
}

impl LaneSlots {
    fn new<C: Scheme>(rates: &RatesSlots) -> Self {
        let (n, mut end) = (rates.state.count, rates.signature.slots());
        let mut add = |count: usize| {
            let slots = Slots { first: end, count };
            end = slots.end();
            slots
        };
        let later = C::A.len() - 1;
        let instants = add(later * rates.exogenous.slots.count);
        let (state, new_state, slopes, step) = (add(n), add(n), add(C::A.len() * n), add(1));
        let (tolerance, accepted, judged, rows) = (add(3), add(1), add(2), add(C::D.len() * n));
        LaneSlots { rates: rates.clone(), instants, state, new_state, slopes, step, tolerance, accepted, judged, rows }
    }

    /// The slots of the exogenous input of stage `stage`, which is not the first one.
    fn instant(&self, stage: usize) -> Slots {
        let count = self.rates.exogenous.slots.count;
        self.instants.part((stage - 1) * count, count)
    }

    fn slope(&self, stage: usize) -> Slots {
        let n = self.state.count;
        self.slopes.part(stage * n, n)
    }

    fn end(&self) -> usize {
        self.rows.end()
    }
}

/// Declare the inputs `slots` after unused inputs for the slots before them.
fn declare(slots: Slots) -> Vec<Sym> {
    (sym::recorded().1..slots.first as u32).for_each(|_| _ = sym::input());
    slots.declare()
}

/// How the stages of an attempt are computed.
enum Stages {
    Single(Program),
    /// The arguments of the stages after the first one.
    Divided(Vec<Program>),
}

/// The programs of all loops with the same structure.
pub struct LanePrograms {
    slots: LaneSlots,
    stages: Stages,
    rates: Program,
    /// The arguments of the stages of the dense output, and its rows.
    dense: Vec<Program>,
    rows: Program,
    /// Computes the error of an attempt from its slopes.
    error: Program,
    /// Makes the end of an accepted attempt the start of the next step.
    accept: Program,
    /// The index of the last stage of an attempt.
    last: usize,
}

/// Makes the programs for run `run` of a problem, with the recorded rates.
pub struct LaneAttempts<'a> {
    pub problem: &'a Problem<'a>,
    pub run: usize,
    pub common: Common,
    /// Whether the input is held.
    pub held: bool,
    pub slots: &'a RatesSlots,
    /// Returns the program of the rates, which may use the slots from its argument on for intermediate values.
    pub rates: &'a dyn Fn(usize) -> Program,
}

/// The numbers of an attempt in a recording.
struct Recorded {
    /// The argument of the last stage.
    y: Vec<Sym>,
    new_state: Vec<Sym>,
    /// The state at the start of the step.
    x: Vec<Sym>,
    slopes: Vec<Vec<Sym>>,
    h: Sym,
    tolerance: Vec<Sym>,
    accepted: Sym,
}

/// A function of the numbers of an attempt. It returns groups of results with their slots.
type OfAttempt<'a> = &'a dyn Fn(&Recorded) -> Vec<(Slots, Vec<Sym>)>;

impl WithScheme for LaneAttempts<'_> {
    type Output = LanePrograms;

    fn with<C: Scheme>(self) -> LanePrograms {
        let slots = LaneSlots::new::<C>(self.slots);
        let rates = (self.rates)(slots.end());
        let mut free = rates.slots();
        let mut program = |ops: &[_], outputs: &[(u32, u32)]| {
            let part = Part { ops, start: 0, outputs, places: &SlotTable::default() };
            let made = Program::new(part, None, slots.rates.signature.scratch(free), form(true), engine());
            free = made.slots();
            made
        };
        let operations = C::STAGES * rates.operations();
        let single = if operations > LARGE { None } else { self.all_stages::<C>(&slots) };
        let single = single.map(|(ops, outputs)| program(&ops, &outputs));
        let mut function = |of: OfAttempt| {
            let results = of(&slots.record()).into_iter();
            let outputs: Vec<_> = results.flat_map(|(slots, values)| slots.outputs(&entries(values))).collect();
            program(&sym::finish().ops, &outputs)
        };
        let mut argument = |stage: usize| {
            function(&|Recorded { x, slopes, h, .. }| {
                let mut y = vec![Sym::zero(); x.len()];
                C::argument(stage, *h, x, slopes, &mut y);
                vec![(slots.rates.state, y)]
            })
        };
        let dense = (C::STAGES + 1..C::A.len()).map(&mut argument).collect();
        let stages = single.map_or_else(|| Stages::Divided((1..=C::STAGES).map(&mut argument).collect()), Stages::Single);
        let rows = function(&|Recorded { x, slopes, h, .. }| {
            let mut rows = vec![vec![Sym::zero(); x.len()]; C::D.len()];
            C::rows(*h, slopes, &mut rows);
            vec![(slots.rows, rows.concat())]
        });
        let error = function(&|recorded| slots.error::<C>(recorded));
        let accept = function(&|Recorded { new_state, x, slopes, accepted, .. }| {
            let chosen = |new: &[Sym], old: &[Sym]| {
                new.iter().zip(old).map(|(&new, &old)| Sym::select(Sym::zero().lt(*accepted), new, old)).collect::<Vec<_>>()
            };
            vec![(slots.state, chosen(new_state, x)), (slots.slope(0), chosen(&slopes[C::STAGES], &slopes[0]))]
        });
        LanePrograms { stages, rates, dense, rows, error, accept, last: C::STAGES, slots }
    }
}

impl LaneSlots {
    /// Begin the recording of a function of an attempt.
    fn record(&self) -> Recorded {
        sym::begin();
        sym::end_set_up();
        let [y, x, new_state, slopes, h, tolerance, accepted] =
            [self.rates.state, self.state, self.new_state, self.slopes, self.step, self.tolerance, self.accepted].map(declare);
        let slopes = slopes.chunks(x.len()).map(<[Sym]>::to_vec).collect();
        Recorded { y, new_state, x, slopes, h: h[0], tolerance, accepted: accepted[0] }
    }

    /// Record the error of an attempt, the new state, and the largest absolute value of its plant's states. The error is NaN if the new state or its
    /// slope is not finite.
    fn error<C: Scheme>(&self, Recorded { y, x, slopes, h, tolerance, .. }: &Recorded) -> Vec<(Slots, Vec<Sym>)> {
        let &[rtol, atol, zero] = tolerance.as_slice() else { unreachable!("the tolerance has three numbers") };
        let mut estimates = vec![vec![Sym::zero(); x.len()]; C::E.len()];
        C::estimates(slopes, &mut estimates);
        let scale = |_, magnitude: Sym| atol + rtol * magnitude;
        let error = C::error((self.rates.plant + self.rates.law, scale), *h, x, y, &estimates);
        // The product of a finite number and zero is zero. The zero is an input, so that the recording contains the products.
        let not_finite = y.iter().chain(&slopes[C::STAGES]).fold(zero, |sum, &value| sum + value * zero);
        let largest = y[..self.rates.plant].iter().fold(zero, |largest, value| largest.max(value.abs()));
        vec![(self.judged, vec![error + not_finite, largest]), (self.new_state, y.clone())]
    }
}

/// Recorded operations, and the slots of their results.
type Operations = (Vec<Op>, Vec<(u32, u32)>);

impl LaneAttempts<'_> {
    /// Record all stages of an attempt. The result is `None` if the code branches on data.
    fn all_stages<C: Scheme>(&self, slots: &LaneSlots) -> Option<Operations> {
        sym::begin();
        let mut closed = assemble(self.problem, self.run, self.common.monitored.storage);
        assert_eq!(sym::end_set_up(), slots.rates.exogenous.slots.first, "another structure");
        let (tau, answer) = (declare(slots.rates.tau), declare(slots.rates.law_rate));
        if self.held {
            closed.hold_input(&tau, &answer);
        }
        modes_as_inputs(&mut closed, &slots.rates);
        let sizes = slots.rates.exogenous.sizes();
        let instants: Vec<_> = (1..=C::STAGES).map(|stage| instant_of(&declare(slots.instant(stage)), sizes)).collect();
        let (x, slopes) = (declare(slots.state), declare(slots.slopes));
        let h = declare(slots.step)[0];
        let results = record_stages::<C>(closed, &instants, (&x, &slopes[..x.len()], h));
        let recording = sym::finish();
        let n = x.len();
        let places = [slots.rates.state, slots.slopes.part(n, C::STAGES * n)];
        let places = places.into_iter().flat_map(|slots| slots.first as u32..slots.end() as u32);
        let outputs = places.zip(entries(results)).collect();
        (!recording.failed).then_some((recording.ops, outputs))
    }
}

impl LanePrograms {
    /// Return a frame of the programs, for runs with the tolerances `rtol` and `atol`.
    pub fn frame(&self, rtol: f64, atol: f64) -> Frame {
        let stages = match &self.stages {
            Stages::Single(program) => std::slice::from_ref(program),
            Stages::Divided(arguments) => arguments,
        };
        let all = || stages.iter().chain([&self.rates, &self.rows, &self.error, &self.accept]).chain(&self.dense);
        let mut frame = Frame::new(all().map(Program::slots).max().unwrap_or(0), form(true).lanes());
        all().for_each(|program| program.prepare(&mut frame));
        frame.write(self.slots.tolerance, &[rtol, atol, 0.0]);
        frame
    }

    /// Write the loop parameters of the run in lane `lane`.
    pub fn set_parameters(&self, frame: &mut Frame, lane: usize, values: &[f64]) {
        frame.write_lane(Slots { first: 0, count: values.len() }, lane, values);
    }

    /// Write the held results of the law, and the modes of contacts and joints.
    pub fn hold(&self, frame: &mut Frame, lane: usize, held: &[f64]) {
        frame.write_lane(self.slots.rates.held(), lane, held);
    }

    /// The size of the exogenous input at one instant: the desired motions, then the wrench.
    pub fn input_size(&self) -> usize {
        self.slots.rates.exogenous.slots.count
    }

    /// Write the exogenous inputs of consecutive stages, from stage `stage` on, which is not the first one. `inputs` has one row per stage.
    pub fn set_inputs(&self, frame: &mut Frame, lane: usize, stage: usize, inputs: &[f64]) {
        frame.write_lane(self.slots.instant(stage).part(0, inputs.len()), lane, inputs);
    }

    /// Write the state at the start of a step, and its slope.
    pub fn set_start(&self, frame: &mut Frame, lane: usize, x: &[f64], slope: &[f64]) {
        frame.write_lane(self.slots.state, lane, x);
        frame.write_lane(self.slots.slope(0), lane, slope);
    }

    /// Write the step size, s.
    pub fn set_step(&self, frame: &mut Frame, lane: usize, h: f64) {
        frame.write_lane(self.slots.step, lane, &[h]);
    }

    /// Compute the rates of the argument of stage `stage`.
    fn slope(&self, frame: &mut Frame, stage: usize) {
        let (lanes, rates) = (frame.lanes(), &self.slots.rates);
        frame.numbers_mut().copy_within(self.slots.instant(stage).numbers(lanes), rates.exogenous.slots.first * lanes);
        self.rates.run(frame);
        frame.numbers_mut().copy_within(rates.results[0].numbers(lanes), self.slots.slope(stage).first * lanes);
    }

    /// Compute an attempt and its error in all lanes.
    pub fn attempt(&self, frame: &mut Frame) {
        frame.fill(self.slots.rates.signature.angle(), 0.0);
        match &self.stages {
            Stages::Single(program) => program.run(frame),
            Stages::Divided(arguments) => {
                for (argument, stage) in arguments.iter().zip(1..) {
                    argument.run(frame);
                    self.slope(frame, stage);
                }
            }
        }
        self.error.run(frame);
    }

    /// The error of the attempt in lane `lane` divided by the allowed error, and the largest absolute value of the plant's new states.
    pub fn judged(&self, frame: &Frame, lane: usize) -> [f64; 2] {
        let (numbers, lanes) = (frame.group(self.slots.judged), frame.lanes());
        [numbers[lane], numbers[lanes + lane]]
    }

    /// Set whether the attempt in lane `lane` is accepted.
    pub fn set_accepted(&self, frame: &mut Frame, lane: usize, accepted: bool) {
        frame.write_lane(self.slots.accepted, lane, &[f64::from(u8::from(accepted))]);
    }

    /// Begin the next step in all lanes whose attempt is accepted.
    pub fn accept(&self, frame: &mut Frame) {
        self.accept.run(frame);
    }

    /// Compute the dense output of the last attempt in all lanes. The step size must be that of the accepted step.
    pub fn dense(&self, frame: &mut Frame) {
        for (argument, stage) in self.dense.iter().zip(self.last + 1..) {
            argument.run(frame);
            self.slope(frame, stage);
        }
        self.rows.run(frame);
    }

    /// Whether all angles of lane `lane` are in the range of the programs' sines. Otherwise its results are not valid.
    pub fn is_near(&self, frame: &Frame, lane: usize) -> bool {
        frame.group(Slots { first: self.slots.rates.signature.angle(), count: 1 })[lane] < REDUCTION_LIMIT
    }

    /// Read the states and the slopes at the start and at the end of the attempt.
    pub fn read_step(&self, frame: &Frame, lane: usize, [start, end]: [(&mut Vec<f64>, &mut Vec<f64>); 2]) {
        frame.read(self.slots.new_state, lane, end.0.iter_mut());
        frame.read(self.slots.slope(self.last), lane, end.1.iter_mut());
        frame.read(self.slots.slope(0), lane, start.1.iter_mut());
        self.read_start(frame, lane, start.0);
    }

    /// Read the state at the start of the step.
    pub fn read_start(&self, frame: &Frame, lane: usize, x: &mut [f64]) {
        frame.read(self.slots.state, lane, x.iter_mut());
    }

    /// Read row `i` of the dense output.
    pub fn read_row(&self, frame: &Frame, lane: usize, i: usize, row: &mut [f64]) {
        frame.read(self.slots.rows.part(i * row.len(), row.len()), lane, row.iter_mut());
    }
}
