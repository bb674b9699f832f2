//! The programs of a recorded loop: law, step, rates, metrics and records. A *program* is the compiled code of a recording, and a *frame*
//! is its memory. The *instants* are the times in a step at which the exogenous input is evaluated.

use super::slots::StepSlots;
use super::structure::entries;
use crate::simulate::closed_loop::DecidingModes;
use crate::trace::tape::Op;
use crate::trace::{Cut, Engine, Frame, Part, Program, Scratch, SlotTable, Slots, Stream, form, segments};

/// The indices of the recorded operations that compute the results of the programs.
pub struct Tracing {
    /// The results of the law: the plant's input and the rate of the law's state.
    pub law: Vec<u32>,
    /// The stages, if their rates are separate programs.
    pub stages: Option<Stages>,
    /// The cuts that divide the recording of a step, one before each evaluation of the rates. Empty if the step is not divided.
    pub cuts: Vec<Cut>,
    /// A step with the law in every stage, or with the held input.
    pub step: StepResults,
    /// A step that begins with a sample of the law and holds its results. `None` if the law is in every stage, and for a divided step.
    pub sampled: Option<StepResults>,
    /// The results of the program that updates the metrics.
    pub sums: Option<Summing>,
    /// The results of the program that computes records.
    pub notes: Option<Noting>,
    /// The results of the programs that decide which joints stick. `None` without stick-slip friction.
    pub modes: Option<Modes>,
}

/// The results of a step.
pub struct StepResults {
    /// The next state.
    pub next: Vec<u32>,
    /// The updates of the metrics at the start of a step, for records after the first one.
    pub sums: Option<Vec<u32>>,
    /// The numbers of a record at the start of the step.
    pub notes: Option<Vec<u32>>,
}

/// The stages of a step that is divided into parts.
pub struct Stages {
    /// The results of a stage, as pairs of a slot and the index of an operation.
    pub all: Vec<(u32, u32)>,
    /// The results of the first stage of a step that begins with a sample. `None` if the law is in every stage.
    pub sampled: Option<Vec<(u32, u32)>>,
    /// The slots of the rates that depend on the stage.
    pub moving: [Slots; 2],
}

/// The results of the program that computes records. A record is the state, the input and the monitors.
pub struct Noting {
    /// The results, with the plant's input that is stored in the program's frame.
    pub alone: Vec<u32>,
    /// The reference values of the monitors at the first record.
    pub firsts: Vec<u32>,
}

/// The results of an update of the metrics, with the plant's input that is stored in the program's frame.
pub struct Summing {
    /// The results at any record.
    pub alone: Vec<u32>,
    /// The results at records after the first one.
    pub stage: Vec<u32>,
}

/// The results of the programs that decide which joints stick, from the state, the first instant, the input and the modes
/// ([`DecidingModes`]).
pub struct Modes {
    begun: Vec<u32>,
    pivoted: Vec<u32>,
    stopped: Vec<u32>,
    speeds: Vec<u32>,
}

impl From<DecidingModes> for Modes {
    fn from(modes: DecidingModes) -> Self {
        let DecidingModes { begun, pivoted, stopped, speeds } = modes;
        let [begun, pivoted, stopped, speeds] = [begun, pivoted, stopped, speeds].map(entries);
        Modes { begun, pivoted, stopped, speeds }
    }
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
    /// Updates the metrics at records after the first one, after the first stage of a step that is divided into parts.
    later_sums: Option<Program>,
    /// Computes the input and the monitors of a record, from the state, the first instant and the input.
    notes: Option<Program>,
}

/// Computes the next state from the state, the exogenous inputs and the step size.
enum Step {
    Single(Box<WholeSteps>),
    /// The parts of the step before, between and after the stages, and the rates of one stage.
    Stages {
        segments: Vec<Program>,
        rates: Program,
        /// The rates of the first stage of a step that begins with a sample.
        sampled: Option<Program>,
        /// The slots of the rates of a stage that depend on the stage. The stored rates of every stage follow, each `stride` slots later.
        moving: [Slots; 2],
        stride: usize,
    },
}

/// Programs of whole steps, which compute consecutive steps from a stream of exogenous inputs.
pub struct WholeSteps {
    /// Steps with the law in every stage, or with the held input.
    held: WholeStep,
    /// Steps that begin with a sample of the law. `None` if the law is in every stage.
    sampled: Option<WholeStep>,
}

/// The programs of one kind of step.
struct WholeStep {
    /// The step alone.
    plain: Program,
    /// A step that begins with an update of the metrics.
    summed: Option<Program>,
    /// A step that begins with a record.
    noted: Option<Program>,
}

impl WholeStep {
    fn all(&self) -> impl Iterator<Item = &Program> {
        [&self.plain].into_iter().chain(&self.summed).chain(&self.noted)
    }
}

impl WholeSteps {
    /// The step alone, with the law in every stage or with the held input.
    pub fn plain(&self) -> &Program {
        &self.held.plain
    }

    /// The program of steps in a run. `sampled`: whether they begin with a sample, if the law is sampled. `noted`: whether they begin with
    /// a record. If the loop has metrics, they begin with an update of the metrics.
    pub fn of_run(&self, sampled: bool, noted: bool) -> &Program {
        let step = self.sampled.as_ref().filter(|_| sampled).unwrap_or(&self.held);
        step.noted.as_ref().filter(|_| noted).or(step.summed.as_ref()).unwrap_or(&step.plain)
    }
}

impl Programs {
    fn all(&self) -> impl Iterator<Item = &Program> {
        let (segments, stages, steps) = match &self.step {
            Step::Single(steps) => (&[][..], None, Some(steps)),
            Step::Stages { segments, rates, sampled, .. } => (&segments[..], Some((rates, sampled)), None),
        };
        let stages = stages.into_iter().flat_map(|(rates, sampled)| [rates].into_iter().chain(sampled));
        let steps = steps.into_iter().flat_map(|steps| [&steps.held].into_iter().chain(&steps.sampled)).flat_map(WholeStep::all);
        segments.iter().chain(stages).chain(steps).chain([&self.law]).chain(&self.sums).chain(&self.later_sums).chain(&self.notes)
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
        if let Some(sums) = &self.later_sums {
            sums.run(frame);
        }
    }

    /// Compute the input and the monitors of a record, from the state, the first instant and the input in the program's frame.
    pub fn note(&self, frame: &mut Frame) {
        if let Some(notes) = &self.notes {
            notes.run(frame);
        }
    }

    /// The programs of whole steps. The result is `None` if the step is divided into parts.
    pub fn whole_steps(&self) -> Option<&WholeSteps> {
        if let Step::Single(steps) = &self.step { Some(steps) } else { None }
    }

    /// Compute one step that is divided into parts, from the state, inputs and step size in the program's frame. `is_sampled`: whether the
    /// step begins with a sample of the law. The first stage then writes the law's results to this frame, as every stage does if the law is
    /// in every stage. After the first stage, `first_stage` is called.
    pub fn advance(&self, frame: &mut Frame, is_sampled: bool, mut first_stage: impl FnMut(&Self, &mut Frame)) {
        let Step::Stages { segments, rates, sampled, moving, stride } = &self.step else { unreachable!("the step has no parts") };
        let lanes = frame.lanes();
        for (k, segment) in segments.iter().enumerate() {
            segment.run(frame);
            if k + 1 == segments.len() {
                return;
            }
            sampled.as_ref().filter(|_| is_sampled && k == 0).unwrap_or(rates).run(frame);
            if k == 0 {
                first_stage(self, frame);
            }
            for slots in moving {
                frame.numbers_mut().copy_within(slots.numbers(lanes), (slots.first + (k + 1) * stride) * lanes);
            }
        }
    }
}

/// Makes the programs of one recording.
struct Making<'a, 'b> {
    ops: &'a [Op],
    slots: &'a StepSlots,
    lanes: bool,
    engine: Engine,
    /// The first slot that no program uses yet.
    free: usize,
    watch: Watch<'b>,
}

impl Making<'_, '_> {
    /// Make a program that computes `outputs` from entry `start` on. `places` are the slots of the values before this entry.
    fn part(&mut self, name: &str, start: u32, outputs: &[(u32, u32)], places: &SlotTable, stream: Option<Stream>) -> Program {
        let (part, scratch) = (Part { ops: self.ops, start, outputs, places }, self.slots.signature.scratch(self.free));
        (self.watch)(name.to_owned(), part, stream, scratch, self.lanes);
        let made = Program::new(part, stream, scratch, form(self.lanes), self.engine);
        self.free = made.slots();
        made
    }

    fn program(&mut self, name: &str, outputs: &[(u32, u32)]) -> Program {
        self.part(name, 0, outputs, &SlotTable::default(), None)
    }

    /// Make the programs of a whole step. A sampled step also writes the results of the law `law`.
    fn whole_step(&mut self, [plain, summed, noted]: [&str; 3], results: &StepResults, law: &[u32]) -> WholeStep {
        let slots = self.slots;
        let next = [slots.state.outputs(&results.next), slots.law_outputs(law)].concat();
        let mut program =
            |name, more: Vec<(u32, u32)>| self.part(name, 0, &[next.clone(), more].concat(), &SlotTable::default(), Some(stream(slots)));
        WholeStep {
            plain: program(plain, Vec::new()),
            summed: results.sums.as_ref().map(|sums| program(summed, slots.metrics.outputs(&sums[..slots.lasting]))),
            noted: results.notes.as_ref().map(|notes| program(noted, slots.record.outputs(notes))),
        }
    }

    /// Make the program of the law.
    fn law(&mut self, law: &[u32]) -> Program {
        self.program("law", &self.slots.law_outputs(law))
    }

    /// Make the programs that decide which joints stick: `begin_modes` starts a decision, `pivot` continues it, and `arrest` ends a step.
    fn modes(&mut self, results: &Modes) {
        let StepSlots { modes, sliding, .. } = *self.slots;
        self.program("begin_modes", &modes.outputs(&results.begun));
        self.program("pivot", &modes.outputs(&results.pivoted));
        self.program("arrest", &[modes.outputs(&results.stopped), sliding.outputs(&results.speeds)].concat());
    }

    /// Make the segments of a step that is divided into parts. `cuts` are their ends.
    fn segments(&mut self, cuts: &[Cut], places: &SlotTable) -> Vec<Program> {
        let starts = std::iter::once(0).chain(cuts.iter().map(|cut| cut.end));
        let all = cuts.iter().zip(starts).enumerate();
        all.map(|(k, (cut, start))| self.part(&format!("segment{}", k + 1), start, &cut.outputs, places, None)).collect()
    }
}

/// Return the stream of the exogenous inputs of whole steps.
fn stream(slots: &StepSlots) -> Stream {
    let Slots { first, count: width } = slots.exogenous.slots;
    Stream {
        first: first as u32,
        count: (width * slots.instants.len()) as u32,
        advance: (width * slots.new_instants()) as u32,
        spread: slots.shared,
    }
}

/// Make the programs of a recording for an engine, for one run or for lanes.
pub fn make(ops: &[Op], slots: &StepSlots, tracing: &Tracing, (lanes, engine): (bool, Engine), watch: Watch) -> Programs {
    let mut cuts = tracing.cuts.clone();
    cuts.push(Cut { end: ops.len() as u32, outputs: slots.state.outputs(&tracing.step.next) });
    let (places, free) = segments::join(ops, &mut cuts, slots.signature.slots() as u32);
    let mut making = Making { ops, slots, lanes, engine, free: free as usize, watch };
    let (step, law) = match &tracing.stages {
        Some(stages) => {
            let (segments, law) = (making.segments(&cuts, &places), making.law(&tracing.law));
            let rates = making.program("rates", &stages.all);
            let sampled = stages.sampled.as_ref().map(|first| making.program("sampled_rates", first));
            (Step::Stages { segments, rates, sampled, moving: stages.moving, stride: slots.rates.count }, law)
        }
        None => {
            let names = ["sampled_step", "summed_sampled_step", "noted_sampled_step"];
            let held = making.whole_step(["step", "summed_step", "noted_step"], &tracing.step, &[]);
            let sampled = tracing.sampled.as_ref().map(|results| making.whole_step(names, results, &tracing.law));
            (Step::Single(Box::new(WholeSteps { held, sampled })), making.law(&tracing.law))
        }
    };
    let (mut sums, mut later_sums) = (None, None);
    if let Some(summing) = &tracing.sums {
        sums = Some(making.program("sums", &slots.metrics.outputs(&summing.alone)));
        // The frame already contains the plant's input. The input is held, or the first stage of the step has written it.
        let later = || slots.metrics.outputs(&summing.stage[..slots.lasting]);
        later_sums = tracing.stages.is_some().then(|| making.program("later_sums", &later()));
    }
    let notes = tracing.notes.as_ref().map(|noting| {
        let outputs = [slots.record.outputs(&noting.alone), slots.own_reference.outputs(&noting.firsts)].concat();
        making.program("notes", &outputs)
    });
    if let Some(modes) = &tracing.modes {
        making.modes(modes);
    }
    Programs { law, step, sums, later_sums, notes }
}
