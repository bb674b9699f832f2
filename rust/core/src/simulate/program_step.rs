//! Steps of a recorded loop behind the interface of a method. The exogenous inputs of some steps are sampled in advance into a stream, along
//! which the program of a small loop repeats itself; the parts of a large step read them from their frame.

use super::layout::Layout;
use super::log::Log;
use super::loop_programs::Programs;
use super::program_loop::{ProgramLoop, write_instant};
use super::recorded::Recorded;
use super::world::{Exogenous, World};
use crate::integrate::{FixedStep, System};
use crate::interrupt::look;
use crate::scalar::Real;
use crate::trace::Frame;

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
    /// Whether nothing moves, and how many steps of the streams are there for good then.
    still: bool,
    filled: usize,
}

impl<S: Real> ProgramStep<S> {
    pub fn new(closed: &ProgramLoop<S>) -> Self {
        let layout = &closed.recorded.layout;
        let lanes = if layout.shared { vec![1] } else { closed.frames.iter().map(Frame::lanes).collect() };
        ProgramStep::with_room(layout, &closed.world, &lanes, TURNS)
    }

    fn with_room(layout: &Layout, world: &World, lanes: &[usize], turns: usize) -> Self {
        let slots = layout.exogenous() * (layout.new_instants() * turns + layout.instants.len());
        let streams = lanes.iter().map(|&lanes| Frame::new(slots, lanes)).collect();
        ProgramStep { now: world.instant(), streams, end_time: f64::NAN, end: 0, still: world.is_still(), filled: 0 }
    }

    /// The exogenous inputs of the step `[t, end]` of size `h` as the step `turn` of the streams.
    fn fill(&mut self, layout: &Layout, world: &mut World, turn: usize, t: f64, h: f64, end: f64) {
        if turn < self.filled {
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
                write_instant(&mut self.streams, layout, at, &self.now);
            }
        }
        if self.still {
            self.filled = turn + 1;
        }
        (self.end_time, self.end) = (if layout.ends_at_last() { end } else { f64::NAN }, first + layout.instants.len() - 1);
    }

    /// One instant of the streams to another place.
    fn copy(&mut self, layout: &Layout, from: usize, to: usize) {
        for stream in self.streams.iter_mut().filter(|_| from != to) {
            let size = layout.exogenous() * stream.lanes();
            stream.numbers_mut().copy_within(from * size..(from + 1) * size, to * size);
        }
    }

    /// The stream of frame `k`.
    fn stream(&self, k: usize) -> &Frame {
        &self.streams[k.min(self.streams.len() - 1)]
    }

    /// The instants of the step `turn` to where the parts of a step read them.
    fn place(&self, layout: &Layout, frame: &mut Frame, k: usize, turn: usize) {
        let stream = self.stream(k);
        let first = turn * layout.new_instants() * layout.exogenous();
        for slot in 0..layout.instants.len() * layout.exogenous() {
            let from = &stream.numbers()[(first + slot) * stream.lanes()..][..stream.lanes()];
            let to = frame.slot_mut(layout.instant(0) + slot);
            if layout.shared { to.fill(from[0]) } else { to.copy_from_slice(from) }
        }
    }
}

impl<S: Real> ProgramStep<S> {
    /// As `stride`, of steps in parts: the state stays in the frames. Steps that a program may decline are taken one by one.
    fn stride_in_parts(&mut self, system: &mut ProgramLoop<'_, S>, first: usize, count: usize, h: f64, x: &mut [S]) -> bool {
        if !system.redo.is_empty() {
            return false;
        }
        let recorded = system.recorded.clone();
        let layout = &recorded.layout;
        for from in (first..first + count).step_by(TURNS) {
            let turns = TURNS.min(first + count - from);
            for turn in 0..turns {
                let (t, end) = ((from + turn) as f64 * h, (from + turn + 1) as f64 * h);
                self.fill(layout, &mut system.world, turn, t, h, end);
            }
            let mut log = system.log.take();
            system.advance(h, x, |frame, k| {
                for turn in 0..turns {
                    self.place(layout, frame, k, turn);
                    let step = from + turn;
                    let mut due = log.as_mut().filter(|log| step.is_multiple_of(log.every));
                    recorded.programs.advance(frame, |programs, frame| match &mut due {
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
        true
    }
}

/// Whole steps of frame `k` from step `from` on, and the records that are due among them.
fn run_noting(
    programs: &Programs,
    width: usize,
    log: &mut Log,
    (frame, k): (&mut Frame, usize),
    stream: &[f64],
    (from, turns): (usize, usize),
) {
    let (Some(plain), Some(noting)) = (programs.whole(), programs.noted_step()) else { unreachable!("the steps are whole and noted") };
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

/// The exogenous inputs of `steps` whole steps of `h`, the same for all runs of a problem: sampled once where many runs share them.
pub fn tabulate(recorded: &Recorded, mut world: World, steps: usize, h: f64) -> Option<Vec<f64>> {
    let layout = &recorded.layout;
    let numbers = layout.exogenous().checked_mul(layout.new_instants())?.checked_mul(steps)?;
    if !layout.shared || recorded.programs.whole().is_none() || numbers > LARGEST_TABLE {
        return None;
    }
    let mut table = ProgramStep::<f64>::with_room(layout, &world, &[1], steps);
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
        let layout = &recorded.layout;
        system.advance(h, x, |frame, k| match recorded.programs.whole() {
            Some(program) => program.run_along(frame, self.stream(k).numbers(), 1),
            None => {
                self.place(layout, frame, k, 0);
                recorded.programs.advance(frame, |_, _| ());
            }
        });
        system.step_again(t, h, end, x);
    }

    fn stride(&mut self, system: &mut ProgramLoop<'_, S>, first: usize, count: usize, h: f64, x: &mut Vec<S>) -> bool {
        let recorded = system.recorded.clone();
        let Some(program) = recorded.programs.repeated() else { return self.stride_in_parts(system, first, count, h, x) };
        let (table, mut done) = (system.table, 0);
        let most = if table.is_some() && system.redo.is_empty() { count } else { TURNS };
        while done < count {
            let (turns, from) = ((count - done).min(most), first + done);
            system.remember(x);
            if table.is_none() {
                for turn in 0..turns {
                    let (t, end) = ((from + turn) as f64 * h, (from + turn + 1) as f64 * h);
                    self.fill(&recorded.layout, &mut system.world, turn, t, h, end);
                }
            }
            let width = recorded.layout.new_instants() * recorded.layout.exogenous();
            let mut log = system.log.take();
            system.advance(h, x, |frame, k| {
                let (stream, lanes) = match table {
                    Some(table) => (&table[from * width..], 1),
                    None => (self.stream(k).numbers(), self.stream(k).lanes()),
                };
                match &mut log {
                    Some(log) => run_noting(&recorded.programs, width * lanes, log, (frame, k), stream, (from, turns)),
                    None => program.run_along(frame, stream, turns),
                }
            });
            system.log = log;
            if (0..S::LANES).any(|lane| system.declined(lane)) {
                // One by one from the start: the other lanes take the same steps again.
                (0..S::LANES).for_each(|lane| system.back(lane));
                x.copy_from_slice(system.redo.before());
                self.restart();
                for step in from..from + turns {
                    let t = step as f64 * h;
                    system.sum_up(t, h, x);
                    system.note_if_due(step, t, x);
                    self.step(system, t, h, (step + 1) as f64 * h, x);
                }
            }
            done += turns;
        }
        true
    }

    fn restart(&mut self) {
        self.end_time = f64::NAN;
    }
}
