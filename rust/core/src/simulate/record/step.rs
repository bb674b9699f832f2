//! Recorded closed loops. For each structure, the programs (the compiled recordings) of a step of its method and of its law are made once.
//!
//! A frame, the memory of these programs, has the following slots in order:
//! - the loop parameters (masses, gains, targets, limits);
//! - the exogenous input at each instant of the step;
//! - the state and the stored numbers of the metrics, which a step updates, and the step size `h`;
//! - the input of the plant, the rate of the law's state, and the values that one part of a step passes to a later part;
//! - the largest angle so far, and the numbers of a record without the state.
//!
//! A small loop is recorded as a whole step. Its program computes consecutive steps from a stream of exogenous inputs. In a large loop, the
//! rates are a separate program, which runs in every stage. The code of a whole step might exceed the processor's instruction cache.

use super::key::Common;
use super::metrics::Sums;
use super::records::{Noted, Notes};
use super::slots::{Instant, StepSlots};
use super::step_programs::{self, Modes, Noting, Programs, Stages, StepResults, Summing, Tracing, Watch};
use super::structure::{LoopParameters, MetricsAndRecords, Seen, entries, instant, set_up};
use crate::integrate::{Advance, ExplicitSteps, MethodKind, System, WithExplicitSteps};
use crate::linalg::Pairs;
use crate::scalar::Real;
use crate::simulate::closed_loop::ClosedLoop;
use crate::simulate::metrics::gauge::Start;
use crate::simulate::problem::Problem;
use crate::simulate::problem::sampling::{Parts, Sampling};
use crate::simulate::sampled::recorded_controller::Controller;
use crate::simulate::world::Exogenous;
use crate::trace::cache::Cache;
use crate::trace::tape::{Moving, Op};
use crate::trace::{ByEngine, Cut, Engine, Signature, Slots, Sym, engine, sym};
use std::sync::Arc;

/// Rates with at most this number of operations are part of the program of a step.
const LARGE: u32 = 700;
/// The same limit for many steps in lanes. Their programs are faster, and repay a longer compilation.
const LARGE_IN_LANES: u32 = 3000;

/// The recorded loop of all runs with one structure.
pub struct Recorded {
    pub slots: StepSlots,
    pub programs: ByEngine<Programs>,
    /// Whether programs compute one run per lane.
    pub lanes: bool,
    ops: Vec<Op>,
    pub(super) tracing: Tracing,
}

impl Recorded {
    /// Return the programs for an engine. They are made on first use.
    pub fn programs_for(&self, engine: Engine) -> Arc<Programs> {
        self.programs.get(engine, || self.make(engine, &mut |_, _, _, _, _| ()))
    }

    fn make(&self, engine: Engine, watch: Watch) -> Programs {
        step_programs::make(&self.ops, &self.slots, &self.tracing, (self.lanes, engine), watch)
    }
}

/// Whether the loops of a problem can be programs of whole steps. These programs require fixed explicit steps, a law that can be recorded,
/// and a plant without stick-slip friction. The modes of joints with this friction are inputs of a recorded step, which only a web page
/// uses.
pub fn is_recordable(problem: &Problem) -> bool {
    matches!(problem.options.method.kind(), MethodKind::ExplicitSteps(_))
        && problem.laws.iter().all(|law| law.route().is_recordable())
        && !problem.plants.iter().any(|plant| plant.sticks())
}

/// A stored structure of loops with fixed steps.
pub type SeenLoop = Seen<Recorded, ()>;

static KNOWN: Cache<Arc<SeenLoop>> = Cache::new();

/// Return the stored structure of run `run`, or record a new one.
pub fn of_run(problem: &Problem, run: usize, common: Common, parameters: &LoopParameters) -> Arc<SeenLoop> {
    let seen = Seen::of_run(&KNOWN, (problem, run, common), parameters, (), || record(problem, run, common, None));
    #[cfg(debug_assertions)]
    assert!(record(problem, run, common, None).ops == seen.recorded.ops, "two loops of one key differ");
    seen
}

/// Record the loop of run `run` for a listing, and pass its programs to `watch`. If `plain` is `None`, the operations are simplified. If it
/// is `Some(in_parts)`, every operation remains, and `in_parts` selects whether the step is divided into parts.
pub fn record_watched(problem: &Problem, run: usize, common: Common, plain: Option<bool>, watch: Watch) -> Recorded {
    let recorded = record(problem, run, common, plain);
    recorded.make(engine(), watch);
    recorded
}

/// Record the loop of run `run` with the varying set-up parameters `moving`, and pass its programs to `watch`.
pub fn record_moving(problem: &Problem, run: usize, common: Common, moving: Moving, watch: Watch) -> Recorded {
    sym::begin_moving(moving);
    let recorded = recorded(problem, run, common, None);
    recorded.make(Engine::Interpreter, watch);
    recorded
}

fn record(problem: &Problem, run: usize, common: Common, plain: Option<bool>) -> Recorded {
    sym::begin_that(plain.is_none());
    recorded(problem, run, common, plain)
}

/// Continue the recording of this thread with the loop of run `run`, and end it.
fn recorded(problem: &Problem, run: usize, common: Common, plain: Option<bool>) -> Recorded {
    let (closed, extras) = set_up(problem, run, common);
    let given = sym::end_set_up();
    let metrics = extras.sums.as_ref().map_or((0, 0), Sums::sizes);
    let (monitors, reference) = extras.notes.as_ref().map_or((0, 0), Notes::sizes);
    let noted = extras.notes.as_ref().map_or(0, |_| closed.tau.len() + monitors);
    let MethodKind::ExplicitSteps(method) = problem.options.method.kind() else { unreachable!("the steps are explicit") };
    let context = (if problem.forces.is_empty() { 0 } else { 6 }, method.instants(), common.shared);
    let (parts, law) = (problem.options.sampling.as_ref().map_or(Parts::default(), Sampling::parts), problem.law(run));
    let torque_states = law.torque_states().filter(|_| parts.delays || parts.limits_rate);
    let plant = problem.plant(run);
    let controlled = (plant.seen(), parts, torque_states, Slots { first: plant.first_sliding_speed(), count: plant.sticking_joints() });
    let mut slots = StepSlots::new(Signature::new(given), &closed, context, controlled, (metrics, reference));
    let most = if common.long { LARGE_IN_LANES } else { LARGE };
    let tracing = trace(closed, extras, (method, law.route().is_recordable(), plain, most), &slots);
    slots.end(tracing.cuts.len(), noted);
    debug_assert_eq!(sym::recorded().1 as usize, slots.signature.angle(), "all inputs have slots");
    let recording = sym::finish();
    assert!(!recording.failed, "a recorded law or plant does not branch on data");
    Recorded { slots, programs: ByEngine::default(), lanes: common.lanes, ops: recording.ops, tracing }
}

/// Record the rates and the step, and the law if `with_law` is true. `in_parts` selects whether the step is divided into parts. If it is
/// `None`, the step is divided if the rates have more than `most` operations.
fn trace(
    mut closed: ClosedLoop,
    extras: MetricsAndRecords,
    (method, with_law, in_parts, most): (ExplicitSteps, bool, Option<bool>, u32),
    slots: &StepSlots,
) -> Tracing {
    let one = || instant(slots.exogenous.sizes());
    let u: Vec<Exogenous<Sym>> = slots.instants.iter().map(|_| one()).collect();
    let (x, stored, h) = (slots.state.declare(), slots.metrics.declare(), sym::input());
    let held = [slots.tau.declare(), slots.law_rate.declare()];
    let controller = Controller::declare(&slots.controller, &held[0], slots.torque_states);
    let modes = slots.modes.declare();
    let firsts = slots.reference.declare();
    let (stage, stage_input) = (slots.stage.declare(), one());
    slots.rates.declare();
    let is_sampled = closed.is_held() && with_law;
    closed.hold_sides(&modes[..slots.sliding.count]);
    let law = if with_law { controller.sample(&mut closed, &u[0], &x) } else { held.clone() };
    if closed.is_held() {
        controller.hold(&mut closed, &held);
    }
    let modes = closed.deciding_modes(&u[0], &x).map(Modes::from);
    // The metrics and records are recorded at this point, so that they share the law's result at this state with the step.
    let mut start = StepStart { extras, u: &u[0], x: &x, h, stored: &stored, firsts: &firsts };
    let (sums, notes) = (start.summing(&held[0]), start.noting(&held[0]));
    let (along, sampled) = (start.along(&closed.tau), is_sampled.then(|| start.along(controller.acting(&law))));
    let before = sym::recorded().0;
    let all = stage_outputs(&mut closed, &stage_input, &stage, slots);
    let stages = in_parts.unwrap_or(sym::recorded().0 - before > most).then(|| {
        let sampled = is_sampled.then(|| {
            // The first stage is at the state of the step, to which no segment copies the states of the law.
            let first = [&stage[..closed.law_states().start], &x[closed.law_states().start..]].concat();
            let law = controller.sample(&mut closed, &stage_input, &first);
            controller.hold(&mut closed, &law);
            [stage_outputs(&mut closed, &stage_input, &stage, slots), slots.law_outputs(&entries(law.concat()))].concat()
        });
        if is_sampled {
            controller.hold(&mut closed, &held);
        }
        let kept = if closed.is_held() { closed.law_states() } else { 0..0 };
        let moving = [0..kept.start, kept.end..x.len()].map(|part| slots.rates.part(part.start, part.len()));
        Stages { all, sampled, moving }
    });
    let step = |closed: &mut ClosedLoop, along: StepResults| {
        let system = RecordedLoop { closed, slots, cuts: stages.as_ref().map(|_| Vec::new()) };
        let task = OneStep { u: u.clone(), h };
        let Ok((next, cuts)) = method.apply(system, x.clone(), u[0].clone(), task) else {
            unreachable!("plants without velocities were refused")
        };
        (StepResults { next: entries(next), ..along }, cuts)
    };
    let (held, cuts) = step(&mut closed, along);
    let sampled = sampled.filter(|_| stages.is_none()).map(|along| {
        controller.hold(&mut closed, &law);
        step(&mut closed, along).0
    });
    Tracing { law: entries(law.concat()), stages, cuts: cuts.unwrap_or_default(), step: held, sampled, sums, notes, modes }
}

/// Record the rates of a stage. Return the slots and operations of the rates that depend on the stage, and of the plant's input if the law is
/// in every stage. Rates of a held law are the same in all stages.
fn stage_outputs(closed: &mut ClosedLoop, u: &Exogenous<Sym>, x: &[Sym], slots: &StepSlots) -> Vec<(u32, u32)> {
    let mut rates = vec![Sym::zero(); x.len()];
    closed.rhs(u, x, &mut rates);
    let mut outputs = slots.rates.outputs(&entries(rates));
    if closed.is_held() {
        outputs.drain(closed.law_states());
    } else {
        outputs.extend(slots.tau.outputs(&entries(closed.tau.clone())));
    }
    outputs
}

/// Records the metrics and records at the start of a step.
struct StepStart<'a> {
    extras: MetricsAndRecords<'a>,
    u: &'a Exogenous<Sym>,
    x: &'a [Sym],
    h: Sym,
    /// The stored numbers of the metrics, and the reference values of the monitors.
    stored: &'a [Sym],
    firsts: &'a [Sym],
}

impl StepStart<'_> {
    /// Record the updates of the metrics with the plant's input `tau`.
    fn sum_up(&mut self, tau: &[Sym], start: Start) -> Option<Vec<u32>> {
        let mut stored = self.stored.to_vec();
        self.extras.sums.as_mut()?.add(&self.u.desired, self.x, tau, self.h, start, &mut stored);
        Some(entries(stored))
    }

    /// Record the numbers of a record with the plant's input `tau`.
    fn note(&self, tau: &[Sym]) -> Option<Noted> {
        Some(self.extras.notes.as_ref()?.take(self.u, self.x, tau, self.firsts))
    }

    fn summing(&mut self, tau: &[Sym]) -> Option<Summing> {
        Some(Summing { stage: self.sum_up(tau, Start::Known)?, alone: self.sum_up(tau, Start::Requested)? })
    }

    fn noting(&self, tau: &[Sym]) -> Option<Noting> {
        self.note(tau).map(|noted| Noting { alone: entries(noted.numbers), firsts: entries(noted.firsts) })
    }

    /// Record what a step with the plant's input `tau` computes in addition to the next state.
    fn along(&mut self, tau: &[Sym]) -> StepResults {
        StepResults { next: Vec::new(), sums: self.sum_up(tau, Start::Known), notes: self.note(tau).map(|noted| entries(noted.numbers)) }
    }
}

/// Records a step of size `h` with the exogenous inputs `u`.
struct OneStep {
    u: Vec<Exogenous<Sym>>,
    h: Sym,
}

impl<'a, 'b> WithExplicitSteps<Sym, RecordedLoop<'a, 'b>> for OneStep {
    /// The next state, and the cuts of a step that is divided into parts.
    type Output = (Vec<Sym>, Option<Vec<Cut>>);

    fn with_explicit<M>(self, mut system: RecordedLoop<'a, 'b>, mut x: Vec<Sym>, mut method: M) -> Self::Output
    where
        M: Advance<Sym, RecordedLoop<'a, 'b>, Vec<Sym>>,
    {
        for (k, u) in self.u.into_iter().enumerate() {
            *method.input(k) = u;
        }
        method.advance(&mut system, self.h, &mut x);
        (x, system.cuts)
    }
}

/// A loop that records its evaluations.
struct RecordedLoop<'a, 'b> {
    closed: &'b mut ClosedLoop<'a>,
    slots: &'b StepSlots,
    /// The cuts before each evaluation of the rates. `None` if the step is not divided.
    cuts: Option<Vec<Cut>>,
}

impl System<Sym> for RecordedLoop<'_, '_> {
    type Input = Exogenous<Sym>;
    /// Does nothing, because the inputs are already set.
    fn input(&mut self, _: f64, _: &mut Exogenous<Sym>) {}
    fn rhs(&mut self, u: &Exogenous<Sym>, x: &[Sym], dx: &mut [Sym]) {
        let Some(cuts) = &mut self.cuts else {
            self.closed.rhs(u, x, dx);
            return;
        };
        let StepSlots { stage, stage_input: Instant { slots, desired }, .. } = *self.slots;
        let input = entries(u.desired.iter().chain(&u.wrench).take(slots.count).copied().collect());
        let (mut outputs, mut given) = (stage.outputs(&entries(x.to_vec())), slots.outputs(&input));
        if self.closed.is_held() {
            // The plant reads no state of the law. Only a sample at the start of the step reads the desired motions.
            outputs.drain(self.closed.law_states());
            given.drain(..if cuts.is_empty() { 0 } else { desired });
        }
        cuts.push(Cut { end: sym::recorded().0, outputs: [outputs, given].concat() });
        dx.fill_with(sym::input);
        if self.closed.is_held() {
            let law = self.closed.law_states();
            dx[law.clone()].copy_from_slice(&self.closed.law_rate()[..law.len()]);
        }
    }
    fn pairs(&self) -> Pairs {
        self.closed.pairs()
    }
}
