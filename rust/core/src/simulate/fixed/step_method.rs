//! Steps of a recorded loop with the interface of a fixed-step method.
//!
//! A stream has the exogenous inputs of some steps, which are evaluated in advance. The program (the compiled recording) of a small loop
//! computes all steps of a stream in one call. The step of a large loop consists of parts, which read the inputs from the frame, the memory
//! of the programs.

use super::schedule::Schedule;
use super::step_loop::StepLoop;
use crate::integrate::FixedStep;
use crate::interrupt;
use crate::memory;
use crate::motion::Table;
use crate::scalar::Real;
use crate::simulate::loops::log::Log;
use crate::simulate::record::slots::StepSlots;
use crate::simulate::record::step_programs::{Programs, WholeSteps};
use crate::simulate::sampled::samples::Samples;
use crate::simulate::world::World;
use crate::trace::Frame;
use std::marker::PhantomData;
use std::ops::Range;

/// The capacity of a stream, in steps.
const STREAM_STEPS: usize = 32;

/// The largest size of a table of exogenous inputs, in numbers: 8 MiB. Larger inputs are evaluated during the run.
const LARGEST_TABLE: usize = 1 << 20;

/// The fixed-step method of a recorded loop.
pub struct StepMethod<S> {
    /// The times at which some steps need the exogenous inputs, one step after another.
    times: Vec<f64>,
    /// The exogenous inputs at `times`: one stream for all frames, or one stream per frame.
    streams: Vec<Frame>,
    /// Memory for the inputs of one lane, if lanes have different inputs.
    lane: Vec<f64>,
    /// The table of a desired motion. If the knots of the table are `times`, its rows are used as the stream.
    table: Option<Table>,
    /// The index of the first number of the table that is used as the stream.
    at: Option<usize>,
    /// Whether all inputs are constant.
    still: bool,
    /// Whether every step reads all its inputs. Otherwise only samples and records read them, at the starts of their steps.
    every_step: bool,
    /// The number of times for which `streams` already contains the inputs. If all inputs are constant, these need not be evaluated again.
    filled: usize,
    lanes: PhantomData<S>,
}

/// Write to `times` the times at which `steps` need the exogenous inputs. `steps` yields start, step size and end. The last time of a
/// step is omitted if the next step begins with it.
fn instants(slots: &StepSlots, steps: impl Iterator<Item = [f64; 3]>, times: &mut Vec<f64>) {
    times.clear();
    let mut last = None;
    for [t, h, end] in steps {
        times.extend(slots.instants[..slots.new_instants()].iter().map(|&part| if part == 1.0 { end } else { t + part * h }));
        last = Some(end);
    }
    times.extend(last.filter(|_| slots.ends_at_last()));
}

/// Return start, size and end of the equal steps `from..to` of size `h`.
fn equal(from: usize, to: usize, h: f64) -> impl ExactSizeIterator<Item = [f64; 3]> {
    (from..to).map(move |step| [step as f64 * h, h, (step + 1) as f64 * h])
}

impl<S: Real> StepMethod<S> {
    pub fn new(closed: &StepLoop<S>) -> Self {
        let (slots, world) = (&closed.recorded.slots, &closed.world);
        let most = slots.new_instants() * STREAM_STEPS + 1;
        let numbers = slots.exogenous.slots.count * most;
        let lanes = if slots.shared { vec![1] } else { closed.frames.iter().map(Frame::lanes).collect() };
        let covers = |table: &&Table| slots.shared && slots.exogenous.slots.count == 3 * table.dof();
        StepMethod {
            times: Vec::with_capacity(most),
            streams: lanes.iter().map(|&lanes| Frame::new(numbers, lanes)).collect(),
            lane: vec![0.0; if slots.shared { 0 } else { numbers }],
            table: world.only_table().filter(covers).cloned(),
            at: None,
            still: world.is_still(),
            every_step: closed.samples.is_none() || world.has_forces() || slots.metrics.count > 0,
            filled: 0,
            lanes: PhantomData,
        }
    }

    /// Evaluate the exogenous inputs of several steps, and write them to the streams. `steps` yields start, size and end.
    fn sample(&mut self, slots: &StepSlots, world: &World, steps: impl ExactSizeIterator<Item = [f64; 3]>) {
        let (count, width) = (slots.new_instants() * steps.len() + usize::from(slots.ends_at_last()), slots.exogenous.slots.count);
        if width == 0 || self.still && count <= self.filled {
            return;
        }
        instants(slots, steps, &mut self.times);
        let times = &self.times;
        self.filled = count;
        self.at = self.table.as_ref().and_then(|table| table.along(times));
        if self.at.is_some() {
            return;
        }
        self.evaluate(slots.shared, world, [width, width], 0);
    }

    /// Evaluate the exogenous inputs at `self.times`. Write them to rows of the streams, from number `at` of a lane on. A row has `width`
    /// numbers, and rows are `stride` numbers apart.
    fn evaluate(&mut self, shared: bool, world: &World, [width, stride]: [usize; 2], at: usize) {
        if shared {
            return world.sample_each(0, &self.times, [width, stride], &mut self.streams[0].numbers_mut()[at..]);
        }
        for lane in 0..S::LANES {
            world.sample_each(lane, &self.times, [width, stride], &mut self.lane);
            let lanes = self.streams[0].lanes();
            let to = self.streams[lane / lanes].numbers_mut()[at * lanes + lane % lanes..].iter_mut().step_by(lanes);
            to.zip(&self.lane[..self.times.len() * stride]).for_each(|(to, &from)| *to = from);
        }
    }

    /// Evaluate the exogenous inputs that the steps `steps` of size `h`, s, read, and write them to the streams.
    fn sample_all(&mut self, system: &StepLoop<S>, steps: Range<usize>, h: f64) {
        let (slots, world) = (&system.recorded.slots, &system.world);
        let (width, stride) = (slots.exogenous.slots.count, slots.exogenous.slots.count * slots.new_instants());
        let Some(samples) = system.samples.as_ref().filter(|_| !self.every_step && !self.still && self.table.is_none() && width > 0) else {
            return self.sample(slots, world, equal(steps.start, steps.end, h));
        };
        let mut first = steps.start;
        while first < steps.end {
            let count = if samples.clock.is_every_step() { steps.len() } else { 1 };
            if samples.clock.due(first).is_some() || system.log.as_ref().is_some_and(|log| first.is_multiple_of(log.every)) {
                self.times.clear();
                self.times.extend((first..first + count).map(|step| step as f64 * h));
                self.evaluate(slots.shared, world, [width, stride], (first - steps.start) * stride);
            }
            first += count;
        }
    }

    /// The stream of frame `k`.
    fn stream(&self, k: usize) -> &[f64] {
        match (&self.table, self.at) {
            (Some(table), Some(at)) => &table.rows()[at..],
            _ => self.streams[k.min(self.streams.len() - 1)].numbers(),
        }
    }

    /// Copy the exogenous inputs of step `turn` of stream `k` to the slots from which the parts of a step read.
    fn place(&self, slots: &StepSlots, frame: &mut Frame, k: usize, turn: usize) {
        let (width, lanes) = (if slots.shared { 1 } else { frame.lanes() }, frame.lanes());
        let exogenous = slots.exogenous.slots;
        let all = exogenous.part(0, slots.instants.len() * exogenous.count);
        let from = &self.stream(k)[turn * slots.new_instants() * exogenous.count * width..][..all.count * width];
        let to = frame.group_mut(all);
        if width == lanes {
            to.copy_from_slice(from);
        } else {
            to.chunks_exact_mut(lanes).zip(from).for_each(|(to, &from)| to.fill(from));
        }
    }
}

/// The samples and records of a loop, if it has them.
type Events<'a> = (Option<&'a mut Samples>, Option<&'a mut Log>);

/// Compute the whole steps `steps` of frame `k`, with the samples and records that are due. `width` is the size of the inputs of a step in
/// the stream.
fn run_whole(
    programs: &WholeSteps,
    steps: Range<usize>,
    (mut samples, mut log): Events,
    (frame, k): (&mut Frame, usize),
    (stream, width): (&[f64], usize),
) {
    let mut step = steps.start;
    while step < steps.end {
        let is_sampled = samples.as_mut().is_some_and(|samples| samples.begin(frame, k, step));
        let most = log.as_ref().map_or(usize::MAX, |log| if step.is_multiple_of(log.every) { 1 } else { log.every - step % log.every });
        let most = most.min(steps.end - step);
        let count = samples.as_ref().map_or(most, |samples| samples.alike(step, most));
        let mut due = log.as_deref_mut().filter(|log| step.is_multiple_of(log.every));
        if let Some(log) = &mut due {
            log.note_state(step / log.every, k, frame);
        }
        programs.of_run(is_sampled, due.is_some()).run_along(frame, &stream[(step - steps.start) * width..], count);
        if let Some(log) = due {
            log.note_rest(step / log.every, k, frame);
        }
        if let Some(samples) = &mut samples {
            samples.end(frame, k, step);
        }
        step += count;
    }
}

impl<S: Real> StepMethod<S> {
    /// Compute the steps `steps` of frame `k` in parts, with the samples and records that are due.
    fn run_parts(
        &self,
        (slots, programs): (&StepSlots, &Programs),
        steps: Range<usize>,
        (mut samples, mut log): Events,
        (frame, k): (&mut Frame, usize),
    ) {
        for (turn, step) in steps.enumerate() {
            let is_sampled = samples.as_mut().is_some_and(|samples| samples.begin(frame, k, step));
            let mut due = log.as_deref_mut().filter(|log| step.is_multiple_of(log.every));
            if self.every_step || is_sampled || due.is_some() {
                self.place(slots, frame, k, turn);
            }
            programs.advance(frame, is_sampled, |programs, frame| match &mut due {
                Some(log) => {
                    let i = step / log.every;
                    programs.note(frame);
                    log.note_state(i, k, frame);
                    log.note_rest(i, k, frame);
                }
                None => programs.sum_up_later(frame),
            });
            if let Some(samples) = &mut samples {
                samples.end(frame, k, step);
            }
        }
    }
}

/// Evaluate the exogenous inputs of all steps of a run. The result is `None` if runs have different inputs, if the step is
/// in parts, or if the table would be too large.
pub fn tabulate(slots: &StepSlots, programs: &Programs, world: &World, schedule: &Schedule) -> Option<Vec<f64>> {
    let (steps, h) = (schedule.steps, schedule.dt);
    let (width, new) = (slots.exogenous.slots.count, slots.new_instants());
    let numbers = width.checked_mul(new)?.checked_mul(steps)?.checked_add(width)?;
    if !slots.shared || programs.whole_steps().is_none() || numbers > LARGEST_TABLE {
        return None;
    }
    let (mut table, mut times) = (memory::zeros(numbers).ok()?, Vec::new());
    for first in (0..steps).step_by(STREAM_STEPS).filter(|_| width > 0) {
        interrupt::check();
        instants(slots, equal(first, (first + STREAM_STEPS).min(steps), h), &mut times);
        world.sample_each(0, &times, [width, width], &mut table[first * new * width..]);
    }
    Some(table)
}

impl<S: Real> FixedStep<S, StepLoop<'_, S>, Vec<S>> for StepMethod<S> {
    fn step(&mut self, system: &mut StepLoop<'_, S>, t: f64, h: f64, end: f64, x: &mut Vec<S>) {
        let (recorded, programs) = (system.recorded.clone(), system.programs.clone());
        self.sample(&recorded.slots, &system.world, std::iter::once([t, h, end]));
        let slots = &recorded.slots;
        system.advance(h, x, |frame, k| match programs.whole_steps() {
            Some(steps) => steps.plain().run_along(frame, self.stream(k), 1),
            None => {
                self.place(slots, frame, k, 0);
                programs.advance(frame, false, |_, _| ());
            }
        });
    }

    fn stride(&mut self, system: &mut StepLoop<'_, S>, first: usize, count: usize, h: f64, x: &mut Vec<S>) -> bool {
        let (recorded, programs) = (system.recorded.clone(), system.programs.clone());
        let slots = &recorded.slots;
        // The inputs of a step in parts are copied to the frame, so that no table is used.
        let table = system.table.filter(|_| programs.whole_steps().is_some());
        let (most, width) = (if table.is_some() { count } else { STREAM_STEPS }, slots.new_instants() * slots.exogenous.slots.count);
        for from in (first..first + count).step_by(most) {
            let steps = from..(from + most).min(first + count);
            if table.is_none() {
                self.sample_all(system, steps.clone(), h);
            }
            let (mut samples, mut log) = (system.samples.take(), system.log.take());
            system.advance(h, x, |frame, k| {
                let events = (samples.as_mut(), log.as_mut());
                match programs.whole_steps() {
                    Some(whole_steps) => {
                        let stream = table.map_or_else(|| self.stream(k), |table| &table[from * width..]);
                        let width = width * if slots.shared { 1 } else { frame.lanes() };
                        run_whole(whole_steps, steps.clone(), events, (frame, k), (stream, width));
                    }
                    None => self.run_parts((slots, &programs), steps.clone(), events, (frame, k)),
                }
            });
            (system.samples, system.log) = (samples, log);
        }
        true
    }

    fn restart(&mut self) {
        self.filled = 0;
    }
}
