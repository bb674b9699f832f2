//! The programs (recorded computations) of the state rates of one run, with their frames, which are their memory.

use crate::integrate::{Attempt, Buffer};
use crate::scalar::trig::REDUCTION_LIMIT;
use crate::simulate::record::attempt::AttemptProgram;
use crate::simulate::record::rates::{FunctionProgram, RatesPrograms, RecordedRates};
use crate::simulate::record::slots::{Instant, RatesSlots};
use crate::simulate::world::Exogenous;
use crate::trace::{Engine, Frame, Program, Slots, form};
use std::sync::Arc;

pub struct RatesEvaluation {
    pub recorded: Arc<RecordedRates>,
    programs: Arc<RatesPrograms>,
    frame: Frame,
    /// The program of whole attempts, with its frame.
    attempt: Option<(Arc<Option<AttemptProgram>>, Frame)>,
    /// The frame of the programs of derivatives.
    lanes: Option<Frame>,
    /// The exogenous input and its time derivative at the time of a linearisation. An attempt uses the first element as memory for the
    /// inputs of its stages.
    instants: [Exogenous<f64>; 2],
    /// The derivative of the rates with respect to time, from the last linearisation.
    dft: Vec<f64>,
}

/// Return a frame of `programs` whose first slots have the numbers `inputs`, with one number per lane.
fn frame<'a>(programs: impl Iterator<Item = &'a Program> + Clone, lanes: usize, inputs: &[f64]) -> Frame {
    let mut frame = Frame::new(programs.clone().map(Program::slots).max().unwrap_or(0), lanes);
    programs.for_each(|program| program.prepare(&mut frame));
    frame.numbers_mut()[..inputs.len()].copy_from_slice(inputs);
    frame
}

impl RatesEvaluation {
    /// Create the frames for a run with the loop parameters `values`.
    pub fn new(recorded: Arc<RecordedRates>, values: &[f64], engine: Engine) -> Self {
        let slots = &recorded.slots;
        let programs = recorded.programs_for(engine);
        let still = Exogenous { t: f64::NAN, desired: vec![0.0; slots.exogenous.desired], wrench: [0.0; 6] };
        let lanes = form(true).lanes();
        let in_lanes: Vec<f64> = values.iter().flat_map(|&value| std::iter::repeat_n(value, lanes)).collect();
        RatesEvaluation {
            frame: frame(programs.of_one_run(), 1, values),
            attempt: None,
            lanes: programs.derivatives.as_ref().map(|all| frame(all.all(), lanes, &in_lanes)),
            instants: [still.clone(), still],
            dft: vec![0.0; slots.state.count],
            programs,
            recorded,
        }
    }

    /// Prepare for a run of the same structure with the loop parameters `values`.
    pub fn restart(&mut self, values: &[f64]) {
        self.frame.numbers_mut()[..values.len()].copy_from_slice(values);
        self.frame.group_mut(self.recorded.slots.held()).fill(0.0);
    }

    /// Continue with the programs for `engine`.
    pub fn use_engine(&mut self, engine: Engine) {
        self.programs = self.recorded.programs_for(engine);
        let inputs = self.recorded.slots.signature.angle();
        self.frame = frame(self.programs.of_one_run(), 1, &self.frame.numbers()[..inputs]);
        if let (Some(all), Some(old)) = (&self.programs.derivatives, &self.lanes) {
            self.lanes = Some(frame(all.all(), old.lanes(), &old.numbers()[..inputs * old.lanes()]));
        }
    }

    /// Compute attempts by a program, if there is one.
    pub fn use_attempt(&mut self, attempt: Arc<Option<AttemptProgram>>) {
        if let Some(program) = &*attempt {
            let frame = program.frame(&self.recorded.slots, &self.frame);
            self.attempt = Some((attempt, frame));
        }
    }

    /// Write numbers to all frames. `slots` are the slots in a frame of the rates, and belong to the held results and the modes.
    fn write_all(&mut self, slots: Slots, numbers: &[f64]) {
        for frame in [&mut self.frame].into_iter().chain(&mut self.lanes) {
            frame.write(slots, numbers);
        }
        if let Some((attempt, frame)) = &mut self.attempt
            && let Some(program) = &**attempt
        {
            program.hold(frame, slots.first - self.recorded.slots.tau.first, numbers);
        }
    }

    /// The held results of the law, and the modes of contacts and joints.
    pub fn held(&self) -> &[f64] {
        self.frame.group(self.recorded.slots.held())
    }

    /// Hold the input `tau` of the plant and the rate `dz` of the law's state.
    pub fn hold(&mut self, tau: &[f64], dz: &[f64]) {
        self.write_all(self.recorded.slots.tau, tau);
        self.write_all(self.recorded.slots.law_rate, dz);
    }

    /// Hold the contacts in the modes of the numbers `modes`, two for each contact.
    pub fn hold_contacts(&mut self, modes: &[f64]) {
        let slots = self.recorded.slots.contacts;
        self.write_all(slots, &modes[..slots.count.min(modes.len())]);
    }

    /// Hold the joints in the modes `sides`: 0 for a stuck joint, else the direction of sliding.
    pub fn hold_sides(&mut self, sides: &[i8]) {
        for (i, &side) in sides.iter().enumerate() {
            self.write_all(self.recorded.slots.sides.part(i, 1), &[f64::from(side)]);
        }
    }

    /// Compute an attempt, which is one trial of a step with all its stages. Return whether the result is valid, or `None` if no program
    /// exists. `input(t, u)` writes the exogenous input.
    pub fn attempt<B: Buffer<f64>>(&mut self, attempt: &mut Attempt<f64, B>, input: impl FnMut(f64, &mut Exogenous<f64>)) -> Option<bool> {
        let (program, frame) = self.attempt.as_mut()?;
        program.as_ref().as_ref().map(|program| program.run(frame, attempt, (&mut self.instants[0], input)))
    }

    /// Compute the rates of state `x`, write them to `dx`, and return whether they are valid.
    pub fn rates(&mut self, u: &Exogenous<f64>, x: &[f64], dx: &mut [f64]) -> bool {
        self.programs.rates.evaluate(&mut self.frame, &self.recorded.slots, (Some(u), x), dx)
    }

    /// Compute the plant's input `tau` at state `x`. If the input is held, also compute the rate `dz` of the law's state. Return whether
    /// they are valid.
    pub fn law(&mut self, u: &Exogenous<f64>, x: &[f64], tau: &mut [f64], dz: &mut [f64]) -> bool {
        let RatesEvaluation { programs, recorded, frame, .. } = self;
        let valid = evaluate(&programs.law, frame, &recorded.slots, (Some(u), x), tau);
        if let (Some(FunctionProgram { results, .. }), true) = (&programs.law, recorded.held) {
            dz.copy_from_slice(frame.group(results.part(tau.len(), dz.len())));
        }
        valid
    }

    /// Write the depth and the push of each contact at state `x` to `out`. Return whether they are valid.
    pub fn contacts(&mut self, x: &[f64], out: &mut [f64]) -> bool {
        evaluate(&self.programs.contacts, &mut self.frame, &self.recorded.slots, (None, x), out)
    }

    /// Write the margin of each joint that sticks and slips at state `x` to `out`. Return whether the margins are valid.
    pub fn margins(&mut self, u: &Exogenous<f64>, x: &[f64], out: &mut [f64]) -> bool {
        evaluate(&self.programs.margins, &mut self.frame, &self.recorded.slots, (Some(u), x), out)
    }

    /// Write the numbers from which the modes of the joints are decided to `out`, at state `x`. Return whether they are valid.
    pub fn loads(&mut self, u: &Exogenous<f64>, x: &[f64], out: &mut [f64]) -> bool {
        evaluate(&self.programs.loads, &mut self.frame, &self.recorded.slots, (Some(u), x), out)
    }

    /// Whether [`RatesEvaluation::linearise`] requires the time derivative of the exogenous input.
    pub fn is_moving(&self) -> bool {
        self.programs.derivatives.as_ref().is_some_and(|derivatives| derivatives.moves)
    }

    /// The memory of the exogenous input and its time derivative.
    pub fn instants(&mut self) -> &mut [Exogenous<f64>; 2] {
        &mut self.instants
    }

    /// Write the rates of state `x` to `dx`, and their Jacobian with respect to `x` to `j`, shape `(n, n)`, row-major. Afterwards,
    /// [`RatesEvaluation::time_derivative`] returns the derivative with respect to time. Return whether the results are valid.
    pub fn linearise(&mut self, u: &Exogenous<f64>, x: &[f64], dx: &mut [f64], j: &mut [f64]) -> bool {
        let slots = &self.recorded.slots;
        let (Some(all), Some(frame)) = (&self.programs.derivatives, &mut self.lanes) else { unreachable!("the method is implicit") };
        write_input(frame, slots.exogenous, u);
        frame.write(slots.state, x);
        frame.fill(all.signature.angle(), 0.0);
        all.values.run(frame);
        frame.read(all.rates, 0, dx.iter_mut());
        let valid = frame.slot_mut(all.signature.angle())[0] < REDUCTION_LIMIT;
        let n = x.len();
        j.fill(0.0);
        let [_, u_dot] = &self.instants;
        let drift = || u_dot.desired.iter().chain(&u_dot.wrench[..slots.exogenous.sizes()[1]]);
        // Each lane has one direction of differentiation. Time is the last direction of the plant's program.
        let mut along = |program: &Program, seeds: Slots, column: usize, count: usize, moves: bool| {
            let directions = count + usize::from(moves);
            for first in (0..directions).step_by(frame.lanes()) {
                let width = frame.lanes().min(directions - first);
                for (lane, k) in (first..first + width).enumerate() {
                    if k < count {
                        frame.slot_mut(seeds.first + k)[lane] = 1.0;
                    } else {
                        drift().enumerate().for_each(|(i, &rate)| frame.slot_mut(seeds.first + count + i)[lane] = rate);
                    }
                }
                program.run(frame);
                for (lane, k) in (first..first + width).enumerate() {
                    if k < count {
                        frame.fill(seeds.first + k, 0.0);
                        frame.read(all.derivatives, lane, j[column + k..].iter_mut().step_by(n));
                    } else {
                        (0..drift().count()).for_each(|i| frame.fill(seeds.first + count + i, 0.0));
                        frame.read(all.derivatives, lane, self.dft.iter_mut());
                    }
                }
            }
        };
        along(&all.plant, all.along_plant, 0, slots.plant, all.moves);
        if let Some(law) = &all.law {
            along(law, all.along_law, slots.plant, slots.law, false);
        }
        valid
    }

    /// The derivative of the rates with respect to time, from the last linearisation.
    pub fn time_derivative(&self) -> &[f64] {
        &self.dft
    }
}

/// Write the exogenous input `u` to a frame.
fn write_input(frame: &mut Frame, instant: Instant, u: &Exogenous<f64>) {
    let [desired, wrench] = instant.sizes();
    frame.write(instant.slots, &u.desired);
    frame.write(instant.slots.part(desired, wrench), &u.wrench[..wrench]);
}

impl FunctionProgram {
    /// Write the results at state `x` to `out`, and return whether they are valid. `u` is the exogenous input that the function reads.
    fn evaluate(&self, frame: &mut Frame, slots: &RatesSlots, (u, x): (Option<&Exogenous<f64>>, &[f64]), out: &mut [f64]) -> bool {
        if let Some(u) = u {
            write_input(frame, slots.exogenous, u);
        }
        frame.write(slots.state, x);
        frame.fill(slots.signature.angle(), 0.0);
        self.program.run(frame);
        out.copy_from_slice(frame.group(self.results.part(0, out.len())));
        frame.numbers()[slots.signature.angle()] < REDUCTION_LIMIT
    }
}

/// Evaluate a function that a loop may have ([`FunctionProgram::evaluate`]).
fn evaluate(
    function: &Option<FunctionProgram>,
    frame: &mut Frame,
    slots: &RatesSlots,
    at: (Option<&Exogenous<f64>>, &[f64]),
    out: &mut [f64],
) -> bool {
    function.as_ref().is_none_or(|function| function.evaluate(frame, slots, at, out))
}
