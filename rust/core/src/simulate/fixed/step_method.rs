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
use crate::simulate::record::step_programs::Programs;
use crate::simulate::world::World;
use crate::trace::Frame;
use std::marker::PhantomData;

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
        if slots.shared {
            return world.sample_each(0, times, width, self.streams[0].numbers_mut());
        }
        for lane in 0..S::LANES {
            world.sample_each(lane, times, width, &mut self.lane);
            let lanes = self.streams[0].lanes();
            let to = self.streams[lane / lanes].numbers_mut()[lane % lanes..].iter_mut().step_by(lanes);
            to.zip(&self.lane[..times.len() * width]).for_each(|(to, &from)| *to = from);
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

impl<S: Real> StepMethod<S> {
    /// Compute several steps in parts, while the state remains in the frames.
    fn stride_in_parts(&mut self, system: &mut StepLoop<'_, S>, first: usize, count: usize, h: f64, x: &mut [S]) {
        let (recorded, all) = (system.recorded.clone(), system.programs.clone());
        let slots = &recorded.slots;
        for from in (first..first + count).step_by(STREAM_STEPS) {
            let turns = STREAM_STEPS.min(first + count - from);
            self.sample(slots, &system.world, equal(from, from + turns, h));
            let mut log = system.log.take();
            system.advance(h, x, |frame, k| {
                for turn in 0..turns {
                    self.place(slots, frame, k, turn);
                    let step = from + turn;
                    let mut due = log.as_mut().filter(|log| step.is_multiple_of(log.every));
                    all.advance(frame, |programs, frame| match &mut due {
                        Some(log) => {
                            let i = step / log.every;
                            programs.note(frame);
                            log.note_state(i, k, frame);
                            log.note_rest(i, k, frame);
                        }
                        None => programs.sum_up_later(frame),
                    });
                }
            });
            system.log = log;
        }
    }
}

/// Compute whole steps of frame `k` from step `from` on, with the records that are due.
fn run_noting(
    programs: &Programs,
    width: usize,
    log: &mut Log,
    (frame, k): (&mut Frame, usize),
    stream: &[f64],
    (from, turns): (usize, usize),
) {
    let (Some(plain), Some(noting)) = (programs.whole_step(), programs.noted_step()) else { unreachable!("the steps are whole and noted") };
    let mut turn = 0;
    while turn < turns {
        let since = (from + turn) % log.every;
        if since > 0 {
            let count = (log.every - since).min(turns - turn);
            plain.run_along(frame, &stream[turn * width..], count);
            turn += count;
            continue;
        }
        let i = (from + turn) / log.every;
        log.note_state(i, k, frame);
        noting.run_along(frame, &stream[turn * width..], 1);
        log.note_rest(i, k, frame);
        turn += 1;
    }
}

/// Evaluate the exogenous inputs of all steps of a run. The result is `None` if runs have different inputs, if the step is
/// in parts, or if the table would be too large.
pub fn tabulate(slots: &StepSlots, programs: &Programs, world: &World, schedule: &Schedule) -> Option<Vec<f64>> {
    let (steps, h) = (schedule.steps, schedule.dt);
    let (width, new) = (slots.exogenous.slots.count, slots.new_instants());
    let numbers = width.checked_mul(new)?.checked_mul(steps)?.checked_add(width)?;
    if !slots.shared || programs.whole_step().is_none() || numbers > LARGEST_TABLE {
        return None;
    }
    let (mut table, mut times) = (memory::zeros(numbers).ok()?, Vec::new());
    for first in (0..steps).step_by(STREAM_STEPS).filter(|_| width > 0) {
        interrupt::check();
        instants(slots, equal(first, (first + STREAM_STEPS).min(steps), h), &mut times);
        world.sample_each(0, &times, width, &mut table[first * new * width..]);
    }
    Some(table)
}

impl<S: Real> FixedStep<S, StepLoop<'_, S>, Vec<S>> for StepMethod<S> {
    fn step(&mut self, system: &mut StepLoop<'_, S>, t: f64, h: f64, end: f64, x: &mut Vec<S>) {
        let (recorded, programs) = (system.recorded.clone(), system.programs.clone());
        self.sample(&recorded.slots, &system.world, std::iter::once([t, h, end]));
        let slots = &recorded.slots;
        system.advance(h, x, |frame, k| match programs.whole_step() {
            Some(program) => program.run_along(frame, self.stream(k), 1),
            None => {
                self.place(slots, frame, k, 0);
                programs.advance(frame, |_, _| ());
            }
        });
    }

    fn stride(&mut self, system: &mut StepLoop<'_, S>, first: usize, count: usize, h: f64, x: &mut Vec<S>) -> bool {
        let (recorded, programs) = (system.recorded.clone(), system.programs.clone());
        let Some(program) = programs.repeated() else {
            self.stride_in_parts(system, first, count, h, x);
            return true;
        };
        let (table, mut done) = (system.table, 0);
        let most = if table.is_some() { count } else { STREAM_STEPS };
        while done < count {
            let (turns, from) = ((count - done).min(most), first + done);
            if table.is_none() {
                self.sample(&recorded.slots, &system.world, equal(from, from + turns, h));
            }
            let width = recorded.slots.new_instants() * recorded.slots.exogenous.slots.count;
            let mut log = system.log.take();
            system.advance(h, x, |frame, k| {
                let stream = table.map_or_else(|| self.stream(k), |table| &table[from * width..]);
                let lanes = if recorded.slots.shared { 1 } else { frame.lanes() };
                match &mut log {
                    Some(log) => run_noting(&programs, width * lanes, log, (frame, k), stream, (from, turns)),
                    None => program.run_along(frame, stream, turns),
                }
            });
            system.log = log;
            done += turns;
        }
        true
    }

    fn restart(&mut self) {}
}
