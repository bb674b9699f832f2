//! The programs of a recorded loop: law, step, rates, metrics and records. A *program* is the compiled code of a recording, and a *frame*
//! is its memory. The *instants* are the times in a step at which the exogenous input is evaluated.

use super::slots::StepSlots;
use crate::trace::tape::Op;
use crate::trace::{Cut, Engine, Frame, Part, Program, Scratch, SlotTable, Slots, Stream, form, segments};

/// The indices of the recorded operations that compute the results of the programs.
pub struct Tracing {
    /// The results of the law: the plant's input and the rate of the law's state.
    pub law: Vec<u32>,
    /// The rates and the plant's input in a stage, if the rates are a separate program.
    pub rates: Option<(Vec<u32>, Vec<u32>)>,
    /// The cuts that divide the recording of a step, one before each evaluation of the rates. Empty if the step is not divided.
    pub cuts: Vec<Cut>,
    /// The next state.
    pub next: Vec<u32>,
    /// The results of the program that updates the metrics.
    pub sums: Option<Summing>,
    /// The results of the program that computes records.
    pub notes: Option<Noting>,
}

/// The results of the program that computes records. A record is the state, the input and the monitors.
pub struct Noting {
    /// The results, with the plant's input that is stored in the program's frame.
    pub alone: Vec<u32>,
    /// The results, with the plant's input that the same step uses.
    pub along: Vec<u32>,
    /// The reference values of the monitors at the first record.
    pub firsts: Vec<u32>,
}

/// The results of an update of the metrics.
pub struct Summing {
    /// The results at any record, with the plant's input that is stored in the program's frame.
    pub alone: Vec<u32>,
    /// The results at records after the first one, with the plant's input that is stored in the program's frame.
    pub stage: Vec<u32>,
    /// The results at records after the first one, with the plant's input that the same step uses.
    pub along: Vec<u32>,
}

/// A callback for each part of a recording that becomes a program. It receives the name of the program, and whether it computes lanes.
pub type Watch<'a> = &'a mut dyn FnMut(String, Part, Option<Stream>, Scratch, bool);

/// The programs of all loops of one structure.
pub struct Programs {
    /// Computes the plant's input and the rate of the law's state, from the state and the exogenous input at the first instant.
    law: Program,
    step: Step,
    /// Updates the metrics from the state, the first instant, the input and the step size.
    sums: Option<Program>,
    /// Updates the metrics at records after the first one. If one program computes a whole step, this program computes the update and the
    /// step. Otherwise it computes only the update, after the first stage of a step.
    along: Option<Program>,
    /// Computes the input and the monitors of a record, from the state, the first instant and the input.
    notes: Option<Program>,
    /// Computes a whole step that begins with a record.
    noted_step: Option<Program>,
}

/// Computes the next state from the state, the exogenous inputs and the step size.
enum Step {
    Single(Program),
    /// The parts of the step before, between and after the stages, and the rates of one stage.
    Stages {
        segments: Vec<Program>,
        rates: Program,
        /// The slots of the rates of a stage. The stored rates of every stage follow.
        slots: Slots,
    },
}

impl Programs {
    fn all(&self) -> impl Iterator<Item = &Program> {
        let (parts, rates) = match &self.step {
            Step::Single(program) => (std::slice::from_ref(program), None),
            Step::Stages { segments, rates, .. } => (segments.as_slice(), Some(rates)),
        };
        parts.iter().chain(rates).chain([&self.law]).chain(&self.sums).chain(&self.along).chain(&self.notes).chain(&self.noted_step)
    }

    /// The number of slots of a frame for all programs.
    pub fn slots(&self) -> usize {
        self.all().map(Program::slots).max().unwrap_or(0)
    }

    /// Write the constants of all programs into a new frame.
    pub fn prepare(&self, frame: &mut Frame) {
        self.all().for_each(|program| program.prepare(frame));
    }

    /// Compute the plant's input and the rate of the law's state, from the state and the exogenous input in the program's frame.
    pub fn answer(&self, frame: &mut Frame) {
        self.law.run(frame);
    }

    /// Update the metrics from the state, the first instant, the input and the step size in the program's frame.
    pub fn sum_up(&self, frame: &mut Frame) {
        if let Some(sums) = &self.sums {
            sums.run(frame);
        }
    }

    /// Update the metrics with a record after the first one, if the step is divided into parts. Requires the plant's input in the program's
    /// frame.
    pub fn sum_up_later(&self, frame: &mut Frame) {
        if let Some(along) = &self.along {
            along.run(frame);
        }
    }

    /// Compute the input and the monitors of a record, from the state, the first instant and the input in the program's frame.
    pub fn note(&self, frame: &mut Frame) {
        if let Some(notes) = &self.notes {
            notes.run(frame);
        }
    }

    /// The program that computes consecutive steps from a stream of exogenous inputs, where each step begins with a record. It is `None` if
    /// the step is divided into parts, or if records are not computed.
    pub fn noted_step(&self) -> Option<&Program> {
        self.noted_step.as_ref()
    }

    /// The program that computes consecutive steps from a stream of exogenous inputs. Each step begins with an update of the metrics, if
    /// the loop has metrics. It is `None` if the step is divided into parts.
    pub fn repeated(&self) -> Option<&Program> {
        Some(self.along.as_ref().unwrap_or(self.whole_step()?))
    }

    /// The program that computes consecutive steps from a stream of exogenous inputs, without metrics and records. It is `None` if the step
    /// is divided into parts.
    pub fn whole_step(&self) -> Option<&Program> {
        if let Step::Single(program) = &self.step { Some(program) } else { None }
    }

    /// Compute one step that is divided into parts, from the state, inputs and step size in the program's frame. Unless the input is held,
    /// the first stage writes the plant's input to this frame. Then `first_stage` is called.
    pub fn advance(&self, frame: &mut Frame, mut first_stage: impl FnMut(&Self, &mut Frame)) {
        let Step::Stages { segments, rates, slots } = &self.step else { unreachable!("the step has no parts") };
        let lanes = frame.lanes();
        for (k, segment) in segments.iter().enumerate() {
            segment.run(frame);
            if k + 1 == segments.len() {
                return;
            }
            rates.run(frame);
            if k == 0 {
                first_stage(self, frame);
            }
            frame.numbers_mut().copy_within(slots.numbers(lanes), slots.part((k + 1) * slots.count, 0).first * lanes);
        }
    }
}

/// Make the programs of a recording for an engine, for one run or for lanes.
pub fn make(ops: &[Op], slots: &StepSlots, tracing: &Tracing, (lanes, engine): (bool, Engine), watch: Watch) -> Programs {
    let mut cuts = tracing.cuts.clone();
    let outputs = slots.state.outputs(&tracing.next);
    let next = outputs.clone();
    cuts.push(Cut { end: ops.len() as u32, outputs });
    let (places, mut free) = segments::join(ops, &mut cuts, slots.signature.slots() as u32);
    let Slots { first, count: width } = slots.exogenous.slots;
    let stream = Stream {
        first: first as u32,
        count: (width * slots.instants.len()) as u32,
        advance: (width * slots.new_instants()) as u32,
        spread: slots.shared,
    };
    let repeats = tracing.rates.is_none();
    let mut program = |name: String, start: u32, outputs: &[(u32, u32)], places: &SlotTable, stream: Option<Stream>| {
        let (part, scratch) = (Part { ops, start, outputs, places }, slots.signature.scratch(free as usize));
        watch(name, part, stream, scratch, lanes);
        let made = Program::new(part, stream, scratch, form(lanes), engine);
        free = made.slots() as u32;
        made
    };
    let none = SlotTable::default();
    let mut starts: Vec<u32> = cuts.iter().map(|cut| cut.end).collect();
    starts.insert(0, 0);
    let name = |k: usize| if repeats { "step".into() } else { format!("segment{}", k + 1) };
    let segments = cuts.iter().zip(&starts).enumerate();
    let mut segments: Vec<Program> =
        segments.map(|(k, (cut, &start))| program(name(k), start, &cut.outputs, &places, repeats.then_some(stream))).collect();
    let law = program("law".into(), 0, &slots.tau.outputs(&tracing.law), &none, None);
    let step = match &tracing.rates {
        Some((rates, tau)) => {
            let outputs = [slots.tau.outputs(tau), slots.rates.outputs(rates)].concat();
            Step::Stages { segments, rates: program("rates".into(), 0, &outputs, &none, None), slots: slots.rates }
        }
        None => Step::Single(segments.remove(0)),
    };
    let (mut sums, mut along) = (None, None);
    if let Some(summing) = &tracing.sums {
        sums = Some(program("sums".into(), 0, &slots.metrics.outputs(&summing.alone), &none, None));
        let lasting = |entries: &[u32]| slots.metrics.outputs(&entries[..slots.lasting]);
        along = Some(match step {
            Step::Single(_) => program("summed_step".into(), 0, &[next.clone(), lasting(&summing.along)].concat(), &none, Some(stream)),
            // The frame already contains the plant's input. The input is held, or the first stage of the step has written it.
            Step::Stages { .. } => program("later_sums".into(), 0, &lasting(&summing.stage), &none, None),
        });
    }
    let (mut notes, mut noted_step) = (None, None);
    if let Some(noting) = &tracing.notes {
        let alone = [slots.record.outputs(&noting.alone), slots.own_reference.outputs(&noting.firsts)].concat();
        notes = Some(program("notes".into(), 0, &alone, &none, None));
        if let Step::Single(_) = step {
            let next = [next, slots.record.outputs(&noting.along)].concat();
            noted_step = Some(program("noted_step".into(), 0, &next, &none, Some(stream)));
        }
    }
    Programs { law, step, sums, along, notes, noted_step }
}
