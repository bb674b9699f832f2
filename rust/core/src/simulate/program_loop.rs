//! A recorded loop behind the interface of a loop, and its step behind that of a method: the driver of fixed steps runs both as any
//! other.

use super::force::Wrench;
use super::general::Watched;
use super::recorded::{Layout, Recorded};
use super::redo::Redo;
use super::sampler::Sampler;
use super::world::{Exogenous, World};
use crate::integrate::{FixedStep, System};
use crate::interrupt::look;
use crate::plant::Touch;
use crate::scalar::Real;
use crate::scalar::trig::REDUCTION_LIMIT;
use crate::trace::{Frame, Program, form};
use std::sync::Arc;

/// Lanes of the widest number that a loop runs on.
pub(super) const MOST_LANES: usize = 8;

/// The loop of one run (`f64`) or of several side by side, of one structure.
pub struct ProgramLoop<'a, S: Real> {
    pub(super) recorded: Arc<Recorded>,
    world: World<'a>,
    /// Side by side the lanes of `S`, as many in each as the code has.
    frames: Vec<Frame>,
    now: Exogenous<S>,
    pub(super) held: bool,
    /// The clock of a controller that is late or sees badly; `None` for a perfect one.
    sampler: Option<Sampler<S>>,
    pub(super) tau: Vec<S>,
    pub(super) dz: Vec<S>,
    /// What acts while another answer is worked out.
    acting: (Vec<S>, Vec<S>),
    /// The state as the controller sees it.
    seen: Vec<S>,
    /// The exogenous inputs of all whole steps from the first one on, where somebody sampled them in advance.
    table: Option<&'a [f64]>,
    /// What takes the steps that the programs decline.
    pub(super) redo: Redo<'a, S>,
}

impl<'a, S: Real> ProgramLoop<'a, S> {
    /// The loop of runs whose set-ups have the numbers `given(lane)`.
    pub fn new<'b>(
        recorded: Arc<Recorded>,
        world: World<'a>,
        held: bool,
        sampler: Option<Sampler<S>>,
        table: Option<&'a [f64]>,
        given: impl Fn(usize) -> &'b [f64],
    ) -> Self {
        let lanes = form(S::LANES > 1).lanes();
        let programs = &recorded.programs;
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
        let (n, p) = (recorded.layout.inputs, recorded.layout.law_states);
        let now = world.instant();
        let answer = (vec![S::zero(); n], vec![S::zero(); p]);
        ProgramLoop {
            frames,
            now,
            held,
            sampler,
            tau: answer.0.clone(),
            dz: answer.1.clone(),
            acting: answer,
            seen: vec![S::zero(); recorded.layout.states],
            redo: Redo::new([recorded.layout.states, n, p]),
            recorded,
            world,
            table,
        }
    }

    /// Whether lane `lane` turned by an angle for which the programs' sines are not made.
    pub fn strayed(&self, lane: usize) -> bool {
        !(self.number(self.recorded.layout.reach(), lane) < REDUCTION_LIMIT)
    }

    /// What a slot holds in a lane.
    pub(super) fn number(&self, slot: usize, lane: usize) -> f64 {
        let lanes = self.frames[0].lanes();
        self.frames[lane / lanes].numbers()[slot * lanes + lane % lanes]
    }

    pub(super) fn set_number(&mut self, slot: usize, lane: usize, x: f64) {
        let lanes = self.frames[0].lanes();
        self.frames[lane / lanes].slot_mut(slot)[lane % lanes] = x;
    }

    /// The law at state `x = [plant, law, ..]` and time `t`, into `self.tau` and the frames.
    fn observe(&mut self, t: f64, x: &[S]) {
        let recorded = self.recorded.clone();
        let layout = &recorded.layout;
        self.world.sample(t, &mut self.now);
        write_instant(&mut self.frames, layout, 0, &self.now);
        write(&mut self.frames, layout.state(), x);
        self.remember(x);
        for frame in &mut self.frames {
            recorded.programs.answer(frame);
        }
        self.answer_again(t);
        read(&self.frames, layout.tau(), &mut self.tau);
        read(&self.frames, layout.law_rate(), &mut self.dz);
    }
}

/// The exogenous input of instant `k`.
fn write_instant<S: Real>(frames: &mut [Frame], layout: &Layout, k: usize, u: &Exogenous<S>) {
    write(frames, layout.instant(k), &u.desired);
    write(frames, layout.instant(k) + layout.desired, &u.wrench[..layout.wrench]);
}

/// `values` into the slots from `first` on.
fn write<S: Real>(frames: &mut [Frame], first: usize, values: &[S]) {
    let lanes = frames[0].lanes();
    let mut row = [0.0; MOST_LANES];
    for (k, value) in values.iter().enumerate() {
        value.store(&mut row[..S::LANES]);
        for (frame, row) in frames.iter_mut().zip(row.chunks_exact(lanes)) {
            frame.numbers_mut()[(first + k) * lanes..][..lanes].copy_from_slice(row);
        }
    }
}

/// The slots from `first` on into `values`.
fn read<S: Real>(frames: &[Frame], first: usize, values: &mut [S]) {
    let lanes = frames[0].lanes();
    let mut row = [0.0; MOST_LANES];
    for (k, value) in values.iter_mut().enumerate() {
        for (frame, row) in frames.iter().zip(row.chunks_exact_mut(lanes)) {
            row.copy_from_slice(&frame.numbers()[(first + k) * lanes..][..lanes]);
        }
        *value = S::load(&row[..S::LANES]);
    }
}

impl<S: Real> ProgramLoop<'_, S> {
    /// A sample of a controller with a clock of its own.
    fn sample_by(&mut self, sampler: &mut Sampler<S>, t: f64, x: &[S]) {
        let (n, p) = (self.tau.len(), self.dz.len());
        let states = self.recorded.plant_states();
        let (mut tau, mut dz) = std::mem::take(&mut self.acting);
        let mut seen = std::mem::take(&mut self.seen);
        seen.copy_from_slice(x);
        let law = |measured: &[S], tau: &mut [S], dz: &mut [S]| {
            seen[..states].copy_from_slice(measured);
            self.observe(t, &seen);
            tau.copy_from_slice(&self.tau);
            dz.copy_from_slice(&self.dz);
        };
        sampler.run(t, &x[..states], n, law, &mut tau, &mut dz);
        self.seen = seen;
        let layout = &self.recorded.layout;
        write(&mut self.frames, layout.tau(), &tau[..n]);
        write(&mut self.frames, layout.law_rate(), &dz[..p]);
        self.tau.copy_from_slice(&tau);
        self.dz.copy_from_slice(&dz);
        self.acting = (tau, dz);
    }
}

impl<S: Real> System<S> for ProgramLoop<'_, S> {
    type Input = Exogenous<S>;

    fn input(&mut self, t: f64, u: &mut Exogenous<S>) {
        self.world.sample(t, u);
    }
    fn sample(&mut self, t: f64, x: &[S]) {
        if let Some(mut sampler) = self.sampler.take() {
            self.sample_by(&mut sampler, t, x);
            self.sampler = Some(sampler);
        } else if self.held {
            self.observe(t, x);
        }
    }
    fn anchor(&mut self, _: &[S]) {}
    fn rhs(&mut self, _: &Exogenous<S>, _: &[S], _: &mut [S]) {
        unreachable!("a recorded loop advances by whole steps")
    }
    fn held(&self) -> Option<(&[S], &[S])> {
        self.held.then_some((&self.tau, &self.dz))
    }
}

impl<S: Real> Watched<S> for ProgramLoop<'_, S> {
    fn input_at(&mut self, t: f64, x: &[S]) -> &[S] {
        if !self.held {
            self.observe(t, x);
        }
        &self.tau
    }
    fn drive(&mut self, _: Option<&[S]>, held: bool) {
        self.held = held;
    }
    fn rewind(&mut self) {
        if let Some(sampler) = &mut self.sampler {
            sampler.forget();
        }
    }
    fn hold_contacts(&mut self, _: &[Touch]) {}
    fn push(&mut self, _: Option<&Wrench>) {}
}

/// Steps that a stream has room for.
const TURNS: usize = 32;

/// Numbers of the largest table: it has to live in the cache to pay.
const LARGEST_TABLE: usize = 1 << 20;

/// Steps as a program.
pub struct ProgramStep<S: Real> {
    now: Exogenous<S>,
    /// The exogenous inputs of some steps: one stream for all frames, or one for each.
    streams: Vec<Frame>,
    /// The time of the last instant that is there, NaN when it is not the next step's first; and its place.
    end_time: f64,
    end: usize,
    /// Steps of the streams that are there for good, since nothing moves.
    still: usize,
}

impl<S: Real> ProgramStep<S> {
    pub fn new(closed: &ProgramLoop<S>) -> Self {
        let layout = &closed.recorded.layout;
        let lanes = if layout.shared { vec![1] } else { closed.frames.iter().map(Frame::lanes).collect() };
        ProgramStep::with_room(layout, closed.now.clone(), &lanes, TURNS)
    }

    fn with_room(layout: &Layout, now: Exogenous<S>, lanes: &[usize], turns: usize) -> Self {
        let slots = layout.exogenous() * (layout.new_instants() * turns + layout.instants.len());
        let streams = lanes.iter().map(|&lanes| Frame::new(slots, lanes)).collect();
        ProgramStep { now, streams, end_time: f64::NAN, end: 0, still: 0 }
    }

    /// The exogenous inputs of the step `[t, end]` of size `h` as the step `turn` of the streams.
    fn fill(&mut self, layout: &Layout, world: &mut World, turn: usize, t: f64, h: f64, end: f64) {
        if turn < self.still {
            return;
        }
        let first = turn * layout.new_instants();
        for (k, &part) in layout.instants.iter().enumerate() {
            if k == 0 && self.end_time == t {
                self.copy(layout, self.end, first);
                continue;
            }
            let (time, at) = (if part == 1.0 { end } else { t + part * h }, (first + k) * layout.exogenous());
            if layout.shared {
                world.sample_shared(time, &mut self.streams[0].numbers_mut()[at..at + layout.exogenous()]);
            } else {
                world.sample(time, &mut self.now);
                write(&mut self.streams, at, &self.now.desired);
                write(&mut self.streams, at + layout.desired, &self.now.wrench[..layout.wrench]);
            }
        }
        self.still = if world.is_still() { turn + 1 } else { 0 };
        (self.end_time, self.end) = (if layout.ends_at_last() { end } else { f64::NAN }, first + layout.instants.len() - 1);
    }

    /// Forget what is there.
    fn restart_stream(&mut self) {
        self.end_time = f64::NAN;
    }

    /// One instant of the streams to another place.
    fn copy(&mut self, layout: &Layout, from: usize, to: usize) {
        for stream in self.streams.iter_mut().filter(|_| from != to) {
            let size = layout.exogenous() * stream.lanes();
            stream.numbers_mut().copy_within(from * size..(from + 1) * size, to * size);
        }
    }

    /// Run `turns` steps of `h` along the streams.
    fn run(&self, system: &mut ProgramLoop<S>, program: &Program, h: f64, turns: usize, x: &mut [S]) {
        system.run_along(program, |k| self.streams[k.min(self.streams.len() - 1)].numbers(), h, turns, x);
    }
}

impl<S: Real> ProgramLoop<'_, S> {
    /// Run `turns` steps of `h`, frame `k` along `stream(k)`.
    fn run_along<'b>(&mut self, program: &Program, stream: impl Fn(usize) -> &'b [f64], h: f64, turns: usize, x: &mut [S]) {
        let (state, step) = (self.recorded.layout.state(), self.recorded.layout.step());
        write(&mut self.frames, state, x);
        for (k, frame) in self.frames.iter_mut().enumerate() {
            frame.fill(step, h);
            program.run_along(frame, stream(k), turns);
        }
        read(&self.frames, state, x);
    }
}

/// The exogenous inputs of `steps` whole steps of `h`, the same for all runs of a problem: sampled once where many runs share them.
pub fn tabulate(recorded: &Recorded, mut world: World, steps: usize, h: f64) -> Option<Vec<f64>> {
    let layout = &recorded.layout;
    let numbers = layout.exogenous().checked_mul(layout.new_instants())?.checked_mul(steps)?;
    if !layout.shared || recorded.programs.whole().is_none() || numbers > LARGEST_TABLE {
        return None;
    }
    let mut table = ProgramStep::<f64>::with_room(layout, world.instant(), &[1], steps);
    for step in 0..steps {
        look();
        table.fill(layout, &mut world, step, step as f64 * h, h, (step + 1) as f64 * h);
    }
    Some(table.streams[0].numbers().to_vec())
}

impl<S: Real> FixedStep<S, ProgramLoop<'_, S>, Vec<S>> for ProgramStep<S> {
    fn step(&mut self, system: &mut ProgramLoop<'_, S>, t: f64, h: f64, end: f64, x: &mut Vec<S>) {
        let recorded = system.recorded.clone();
        self.fill(&recorded.layout, &mut system.world, 0, t, h, end);
        system.remember(x);
        if let Some(program) = recorded.programs.whole() {
            self.run(system, program, h, 1, x);
            return system.step_again(t, h, end, x);
        }
        let layout = &recorded.layout;
        for k in 0..layout.instants.len() {
            for (f, frame) in system.frames.iter_mut().enumerate() {
                let stream = &self.streams[f.min(self.streams.len() - 1)];
                let (first, size) = (layout.instant(k), layout.exogenous());
                for slot in 0..size {
                    let from = &stream.numbers()[(k * size + slot) * stream.lanes()..][..stream.lanes()];
                    let to = frame.slot_mut(first + slot);
                    if layout.shared { to.fill(from[0]) } else { to.copy_from_slice(from) }
                }
            }
        }
        write(&mut system.frames, layout.state(), x);
        for frame in &mut system.frames {
            frame.fill(layout.step(), h);
            recorded.programs.advance(frame);
        }
        read(&system.frames, layout.state(), x);
        system.step_again(t, h, end, x);
    }

    fn stride(&mut self, system: &mut ProgramLoop<'_, S>, first: usize, count: usize, h: f64, x: &mut Vec<S>) -> bool {
        let recorded = system.recorded.clone();
        let Some(program) = recorded.programs.whole() else { return false };
        let (table, mut done) = (system.table, 0);
        let most = if table.is_some() && system.redo.is_empty() { count } else { TURNS };
        while done < count {
            let (turns, from) = ((count - done).min(most), first + done);
            system.remember(x);
            if let Some(table) = table {
                let from = from * recorded.layout.new_instants() * recorded.layout.exogenous();
                system.run_along(program, |_| &table[from..], h, turns, x);
            } else {
                for turn in 0..turns {
                    let (t, end) = ((from + turn) as f64 * h, (from + turn + 1) as f64 * h);
                    self.fill(&recorded.layout, &mut system.world, turn, t, h, end);
                }
                self.run(system, program, h, turns, x);
            }
            if (0..S::LANES).any(|lane| system.declined(lane)) {
                // One by one from the start: the other lanes take the same steps again.
                (0..S::LANES).for_each(|lane| system.back(lane));
                x.copy_from_slice(system.redo.before());
                self.restart_stream();
                for step in from..from + turns {
                    self.step(system, step as f64 * h, h, (step + 1) as f64 * h, x);
                }
            }
            done += turns;
        }
        true
    }

    fn restart(&mut self) {
        self.restart_stream();
    }
}
