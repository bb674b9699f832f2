//! A recorded loop with the interface of a closed loop. Its programs are the compiled recordings, and a frame is their memory. The method
//! in [`super::step_method`] advances this loop by fixed steps.

use crate::integrate::System;
use crate::scalar::Real;
use crate::scalar::trig::REDUCTION_LIMIT;
use crate::simulate::loops::log::{Log, MOST_LANES};
use crate::simulate::loops::simulated_loop::SimulatedLoop;
use crate::simulate::loops::sink::Sink;
use crate::simulate::record::slots::{Instant, StepSlots};
use crate::simulate::record::step::Recorded;
use crate::simulate::record::step_programs::Programs;
use crate::simulate::sampled::frame_controller::ControllerSlots;
use crate::simulate::sampled::samples::Samples;
use crate::simulate::world::{Exogenous, World};
use crate::trace::{Engine, Frame, Slots, form};
use std::sync::Arc;

/// The loop of one run (`f64`), or of several runs with the same structure, one per lane.
pub struct StepLoop<'a, S: Real> {
    pub(in crate::simulate) recorded: Arc<Recorded>,
    pub(in crate::simulate) programs: Arc<Programs>,
    pub(in crate::simulate) world: World<'a>,
    /// The frames for all lanes of `S`. The number of lanes of a frame depends on the instruction set.
    pub(in crate::simulate) frames: Vec<Frame>,
    now: Exogenous<S>,
    /// The plant's input: the output of the law at its last evaluation, or the output that a sampled controller holds.
    tau: Vec<S>,
    /// The samples of the law. `None` if the law is in every stage.
    pub(in crate::simulate) samples: Option<Samples>,
    /// The exogenous inputs of all whole steps from step 0 on, if they were evaluated before the run.
    pub(in crate::simulate) table: Option<&'a [f64]>,
    /// The log of the records that programs compute. `None` if programs compute no records.
    pub(in crate::simulate) log: Option<Log>,
}

impl<'a, S: Real> StepLoop<'a, S> {
    /// Create the loop of several runs, one per lane. `given(lane)` are the loop parameters of a lane.
    /// `samples(slots, lanes)` returns the samples for frames with `lanes` lanes.
    pub fn new<'b>(
        (recorded, engine): (Arc<Recorded>, Engine),
        world: World<'a>,
        samples: impl FnOnce(&ControllerSlots, usize) -> Option<Samples>,
        table: Option<&'a [f64]>,
        given: impl Fn(usize) -> &'b [f64],
    ) -> Self {
        let lanes = form(S::LANES > 1).lanes();
        let programs = recorded.programs_for(engine);
        let slots = programs.slots();
        let frame = |first: usize| {
            let mut frame = Frame::new(slots, lanes);
            programs.prepare(&mut frame);
            for lane in 0..lanes {
                for (slot, &x) in given(first + lane).iter().enumerate() {
                    frame.slot_mut(slot)[lane] = x;
                }
            }
            frame
        };
        let frames = (0..S::LANES).step_by(lanes).map(frame).collect();
        let (now, tau) = (world.instant(), vec![S::zero(); recorded.slots.tau.count]);
        let samples = samples(&recorded.slots.controller, lanes);
        StepLoop { frames, now, tau, samples, recorded, programs, world, table, log: None }
    }

    /// Let the programs compute and store a record every `steps` steps.
    pub fn note_every(&mut self, steps: usize) {
        self.log = Some(Log::new(&self.recorded.slots, steps, &self.frames));
    }

    /// Return this loop with its own copies of motions and forces, and without a table of inputs.
    pub fn into_owned(self) -> StepLoop<'static, S> {
        StepLoop { world: self.world.into_owned(), table: None, ..self }
    }

    /// The number of states.
    pub fn states(&self) -> usize {
        self.recorded.slots.state.count
    }

    /// Write the exogenous input at time `t`, s, and the state `x` to the frames.
    fn write_arguments(&mut self, t: f64, x: &[S]) {
        let slots = &self.recorded.slots;
        self.world.sample(t, &mut self.now);
        write_instant(&mut self.frames, slots.exogenous, &self.now);
        write(&mut self.frames, slots.carried(), x);
    }

    /// Write these arguments to the frames. Unless the input is held, also evaluate the law.
    fn answer_in_frames(&mut self, t: f64, x: &[S]) {
        if self.samples.is_some() { self.write_arguments(t, x) } else { self.observe(t, x) }
    }

    /// Whether an angle of lane `lane` exceeded the range of the programs' sines.
    pub fn strayed(&self, lane: usize) -> bool {
        !(self.number(self.recorded.slots.signature.angle(), lane) < REDUCTION_LIMIT)
    }

    /// The number in slot `slot` of lane `lane`.
    fn number(&self, slot: usize, lane: usize) -> f64 {
        let lanes = self.frames[0].lanes();
        self.frames[lane / lanes].numbers()[slot * lanes + lane % lanes]
    }
}

/// Write the exogenous input of one instant to its slots.
fn write_instant<S: Real>(frames: &mut [Frame], instant: Instant, u: &Exogenous<S>) {
    let [desired, wrench] = instant.sizes();
    write(frames, instant.slots, &u.desired);
    write(frames, instant.slots.part(desired, wrench), &u.wrench[..wrench]);
}

/// Write `values` to the first slots of a group.
fn write<S: Real>(frames: &mut [Frame], slots: Slots, values: &[S]) {
    let lanes = frames[0].lanes();
    let mut row = [0.0; MOST_LANES];
    for (k, value) in values.iter().enumerate() {
        value.store(&mut row[..S::LANES]);
        for (frame, row) in frames.iter_mut().zip(row.chunks_exact(lanes)) {
            frame.numbers_mut()[(slots.first + k) * lanes..][..lanes].copy_from_slice(row);
        }
    }
}

/// Read `values` from the first slots of a group.
fn read<S: Real>(frames: &[Frame], slots: Slots, values: &mut [S]) {
    let lanes = frames[0].lanes();
    let mut row = [0.0; MOST_LANES];
    for (k, value) in values.iter_mut().enumerate() {
        for (frame, row) in frames.iter().zip(row.chunks_exact_mut(lanes)) {
            row.copy_from_slice(&frame.numbers()[(slots.first + k) * lanes..][..lanes]);
        }
        *value = S::load(&row[..S::LANES]);
    }
}

impl<S: Real> StepLoop<'_, S> {
    /// Advance the state `x` by some steps of size `h`, s. `run(frame, k)` runs a program in frame `k`.
    pub(in crate::simulate) fn advance(&mut self, h: f64, x: &mut [S], mut run: impl FnMut(&mut Frame, usize)) {
        let slots = &self.recorded.slots;
        let (state, step) = (slots.carried(), slots.step);
        write(&mut self.frames, state, x);
        for (k, frame) in self.frames.iter_mut().enumerate() {
            frame.fill(step, h);
            run(frame, k);
        }
        read(&self.frames, state, x);
        read(&self.frames, slots.tau, &mut self.tau);
    }

    /// Evaluate the law at time `t` and state `x`.
    fn observe(&mut self, t: f64, x: &[S]) {
        self.write_arguments(t, x);
        for frame in &mut self.frames {
            self.programs.answer(frame);
        }
        read(&self.frames, self.recorded.slots.tau, &mut self.tau);
    }
}

/// The held results of one run whose caller may give the input of a step.
impl StepLoop<'_, f64> {
    /// The slots of the plant's input, and of the other results of the law.
    fn results(&self) -> Slots {
        let slots = &self.recorded.slots;
        slots.tau.part(0, slots.tau.count + slots.law_rate.count)
    }

    /// The held results of the law: the plant's input, then the other results.
    pub fn held_results(&self) -> &[f64] {
        self.frames[0].group(self.results())
    }

    /// Hold the results `results`.
    pub fn restore_results(&mut self, results: &[f64]) {
        let (slots, inputs) = (self.results(), self.tau.len());
        self.frames[0].write(slots, results);
        self.tau.copy_from_slice(&results[..inputs]);
    }

    /// Hold the plant's input `tau` and the other results `others` of the law.
    pub fn hold(&mut self, tau: &[f64], others: &[f64]) {
        let StepSlots { tau: input, law_rate, .. } = self.recorded.slots;
        self.frames[0].write(input, tau);
        self.frames[0].write(law_rate, others);
        self.tau.copy_from_slice(tau);
    }

    /// Hold the plant's input `tau`, so that the state of the law does not change.
    pub fn hold_alone(&mut self, tau: &[f64]) {
        let (recorded, frame) = (self.recorded.clone(), &mut self.frames[0]);
        let StepSlots { tau: input, law_rate, torque_states, .. } = recorded.slots;
        frame.write(input, tau);
        let rates = frame.group_mut(law_rate);
        rates.fill(0.0);
        if let Some(first) = torque_states {
            // The programs add the input to these rates.
            rates[first..].iter_mut().zip(tau).for_each(|(rate, &tau)| *rate = -tau);
        }
        self.tau.copy_from_slice(tau);
    }

    /// Continue with the programs for `engine`.
    pub fn use_engine(&mut self, engine: Engine) {
        self.programs = self.recorded.programs_for(engine);
        let inputs = self.recorded.slots.signature.angle();
        let mut frame = Frame::new(self.programs.slots(), 1);
        self.programs.prepare(&mut frame);
        frame.numbers_mut()[..inputs].copy_from_slice(&self.frames[0].numbers()[..inputs]);
        self.frames[0] = frame;
    }

    /// Discard the sample at time `t`, s, if one is due. With `failed`, discard it only if its results are not finite.
    pub fn discard_sample(&mut self, t: f64, failed: bool) {
        if let Some(samples) = &mut self.samples {
            samples.discard(samples.step(t), failed);
        }
    }

    /// Whether the controller stores its outputs.
    pub fn has_queue(&self) -> bool {
        self.samples.as_ref().is_some_and(|samples| !samples.controllers.is_empty())
    }

    /// Discard all samples, because the run restarts.
    pub fn discard_samples(&mut self) {
        if let Some(samples) = &mut self.samples {
            samples.clear();
        }
    }
}

impl<S: Real> System<S> for StepLoop<'_, S> {
    type Input = Exogenous<S>;

    fn input(&mut self, t: f64, u: &mut Exogenous<S>) {
        self.world.sample(t, u);
    }
    fn rhs(&mut self, _: &Exogenous<S>, _: &[S], _: &mut [S]) {
        unreachable!("a recorded loop advances by whole steps")
    }
}

impl<S: Real> SimulatedLoop<S> for StepLoop<'_, S> {
    fn sample(&mut self, t: f64, x: &[S]) {
        let Some(mut samples) = self.samples.take() else { return };
        self.write_arguments(t, x);
        let step = samples.step(t);
        for (k, frame) in self.frames.iter_mut().enumerate() {
            if samples.begin(frame, k, step) {
                self.programs.answer(frame);
                samples.end(frame, k, step);
            }
        }
        read(&self.frames, self.recorded.slots.tau, &mut self.tau);
        self.samples = Some(samples);
    }
    fn input_at(&mut self, t: f64, x: &[S]) -> &[S] {
        if self.samples.is_none() {
            self.observe(t, x);
        }
        &self.tau
    }
    fn sum_up(&mut self, t: f64, h: f64, x: &mut [S]) {
        let recorded = self.recorded.clone();
        let slots = &recorded.slots;
        self.answer_in_frames(t, x);
        for frame in &mut self.frames {
            frame.fill(slots.step, h);
            self.programs.sum_up(frame);
        }
        read(&self.frames, slots.metrics, &mut x[slots.state.count..]);
    }
    fn note(&mut self, i: usize, t: f64, x: &[S]) {
        self.answer_in_frames(t, x);
        let (slots, programs) = (&self.recorded.slots, &self.programs);
        for frame in &mut self.frames {
            programs.note(frame);
            if i == 0 && slots.reference.count > 0 {
                let lanes = frame.lanes();
                frame.numbers_mut().copy_within(slots.own_reference.numbers(lanes), slots.reference.first * lanes);
                programs.note(frame);
            }
        }
        for (k, frame) in self.frames.iter().enumerate() {
            let Some(log) = &mut self.log else { return };
            log.note_state(i, k, frame);
            log.note_rest(i, k, frame);
        }
    }
    fn pass_on(&mut self, time: &dyn Fn(usize) -> f64, sink: &mut dyn Sink) {
        if let Some(log) = &mut self.log {
            log.pass_on(time, |block| sink.block(block));
        }
    }
}
