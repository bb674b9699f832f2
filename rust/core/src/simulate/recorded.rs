//! Recorded closed loops. For each structure, the programs (the compiled recordings) of a step of its method and of its law are made once.
//!
//! A frame, the memory of these programs, has the following slots in order:
//! - the loop parameters (masses, gains, targets, limits);
//! - the exogenous input at each instant of the step;
//! - the state and the stored numbers of the metrics, which a step updates, and the step size `h`;
//! - the input of the plant, the rate of the law's state, and the values that one part of a step passes to a later part;
//! - the largest angle so far, and the numbers of a record without the state.
//!
//! Runs share programs if they have the same structure. Their plants and laws have the same shape. The loop parameters with the values 0, 1
//! and -1 are at the same positions. If equal loop parameters of one run share a slot, they are also equal in the other runs.
//!
//! A small loop is recorded as a whole step. Its program computes consecutive steps from a stream of exogenous inputs. In a large loop, the
//! rates are a separate program, which runs in every stage. The code of a whole step might exceed the processor's instruction cache.

use super::assembly::assemble;
use super::closed_loop::ClosedLoop;
use super::gauge::Start;
use super::key::{Common, Key, MOST_NUMBERS};
use super::loop_programs::{self, Noting, Programs, Summing, Tracing, Watch};
use super::notes::Notes;
use super::problem::Problem;
use super::slots::{Instant, RatesSlots, StepSlots};
use super::sums::Sums;
use super::world::Exogenous;
use crate::integrate::{Advance, ExplicitSteps, MethodKind, System, WithExplicitSteps};
use crate::linalg::Pairs;
use crate::scalar::Real;
use crate::trace::cache::Cache;
use crate::trace::label::Label;
use crate::trace::tape::Op;
use crate::trace::{ByEngine, Cut, Engine, Signature, Sym, engine, sym};
use std::sync::Arc;

/// Rates with at most this number of operations are part of the program of a step.
const LARGE: u32 = 700;

/// The recorded loop of all runs with one structure.
pub struct Recorded {
    pub slots: StepSlots,
    pub programs: ByEngine<Programs>,
    /// The number of states of the plant, which are the first states.
    pub plant_states: usize,
    /// Whether programs compute one run per lane.
    pub lanes: bool,
    ops: Vec<Op>,
    tracing: Tracing,
}

/// The loop parameters of a run, and the indices of their operations in the recording. Runs with different indices have different
/// structures.
pub struct LoopParameters {
    pub values: Vec<f64>,
    pub structure: Vec<u32>,
    pub labels: Vec<Label>,
}

impl Recorded {
    /// Return the programs for an engine. They are made on first use.
    pub fn programs_for(&self, engine: Engine) -> Arc<Programs> {
        self.programs.get(engine, || self.make(engine, &mut |_, _, _, _, _| ()))
    }

    fn make(&self, engine: Engine, watch: Watch) -> Programs {
        loop_programs::make(&self.ops, &self.slots, &self.tracing, (self.lanes, engine), watch)
    }
}

/// Whether the loops of a problem can be programs of whole steps. These programs require fixed explicit steps, a law that can be recorded,
/// and a plant without stick-slip friction.
pub fn is_recordable(problem: &Problem) -> bool {
    matches!(problem.options.method.kind(), MethodKind::ExplicitSteps(_))
        && problem.laws.iter().all(|law| law.route().is_recordable())
        && !problem.plants.iter().any(|plant| plant.sticks())
}

/// Return the loop parameters of run `run`.
pub fn loop_parameters(problem: &Problem, run: usize, common: Common) -> LoopParameters {
    sym::begin();
    drop(set_up(problem, run, common));
    let recording = sym::finish();
    LoopParameters { values: recording.values, structure: recording.structure, labels: recording.labels }
}

/// The metrics and records that the programs of a loop compute in addition to steps.
pub struct MetricsAndRecords {
    sums: Option<Sums>,
    pub notes: Option<Notes>,
}

/// Return the loop of run `run`, and its metrics and records.
pub fn set_up(problem: &Problem, run: usize, common: Common) -> (ClosedLoop, MetricsAndRecords) {
    let closed = assemble(problem, run, common.monitored.storage);
    let sums = common.plan(problem, run).map(|plan| Sums::new(problem, run, &plan, common.monitored.storage));
    let notes = common.notes.map(|monitors| Notes::new(problem, run, monitors, common.monitored));
    (closed, MetricsAndRecords { sums, notes })
}

/// The recording of loops with one structure, as an entry of a cache. `tag` distinguishes several recordings of one loop.
pub struct Seen<R, T> {
    key: Key,
    tag: T,
    /// For each loop parameter, in the order of recording: the index of its operation in the recording. Loops of one structure have equal
    /// lists.
    structure: Vec<u32>,
    pub recorded: Arc<R>,
}

impl<R, T: PartialEq> Seen<R, T> {
    /// Whether run `run` of a problem has this structure. `parameters` are its loop parameters.
    pub fn fits(&self, problem: &Problem, run: usize, common: Common, parameters: &LoopParameters) -> bool {
        self.structure == parameters.structure && self.key.is_of(problem, run, common)
    }

    /// Return the structure of run `run` if it is stored.
    pub fn known(
        cache: &Cache<Arc<Self>>,
        (problem, run, common): (&Problem, usize, Common),
        parameters: &LoopParameters,
        tag: &T,
    ) -> Option<Arc<Self>> {
        cache.find(|seen| seen.tag == *tag && seen.fits(problem, run, common, parameters))
    }

    /// Return the stored structure of run `run`, or record a new one.
    pub fn of_run(
        cache: &Cache<Arc<Self>>,
        of: (&Problem, usize, Common),
        parameters: &LoopParameters,
        tag: T,
        record: impl FnOnce() -> R,
    ) -> Arc<Self> {
        if let Some(seen) = Self::known(cache, of, parameters, &tag) {
            return seen;
        }
        let (problem, run, common) = of;
        let (key, structure) = (Key::of(problem, run, common), parameters.structure.clone());
        let seen = Arc::new(Seen { key, tag, structure, recorded: Arc::new(record()) });
        if seen.key.numbers() <= MOST_NUMBERS {
            cache.keep(seen.clone(), |all| all.iter().map(|seen| seen.key.numbers()).sum::<usize>() <= MOST_NUMBERS);
        }
        seen
    }
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

fn record(problem: &Problem, run: usize, common: Common, plain: Option<bool>) -> Recorded {
    sym::begin_that(plain.is_none());
    let (closed, extras) = set_up(problem, run, common);
    let given = sym::end_set_up();
    let metrics = extras.sums.as_ref().map_or((0, 0), Sums::sizes);
    let (monitors, reference) = extras.notes.as_ref().map_or((0, 0), Notes::sizes);
    let noted = extras.notes.as_ref().map_or(0, |_| closed.tau.len() + monitors);
    let MethodKind::ExplicitSteps(method) = problem.options.method.kind() else { unreachable!("the steps are explicit") };
    let context = (if problem.forces.is_empty() { 0 } else { 6 }, method.instants(), common.shared);
    let mut slots = StepSlots::new(Signature::new(given), &closed, context, (metrics, reference));
    let tracing = trace(closed, extras, (method, problem.law(run).route().is_recordable(), plain), &slots);
    slots.end(tracing.cuts.len(), noted);
    debug_assert_eq!(sym::recorded().1 as usize, slots.signature.angle(), "all inputs have slots");
    let recording = sym::finish();
    assert!(!recording.failed, "a recorded law or plant does not branch on data");
    Recorded {
        slots,
        programs: ByEngine::default(),
        plant_states: problem.plant(run).states(),
        lanes: common.lanes,
        ops: recording.ops,
        tracing,
    }
}

/// Make the modes of contacts and joints inputs of a recorded loop.
pub fn modes_as_inputs(closed: &mut ClosedLoop, slots: &RatesSlots) {
    closed.hold_modes(&inputs(slots.contacts.count));
    closed.hold_sides(&inputs(slots.sides.count));
}

/// Declare `count` new inputs of a program.
pub fn inputs(count: usize) -> Vec<Sym> {
    (0..count).map(|_| sym::input()).collect()
}

/// Declare new inputs for the exogenous input at one instant: the desired motions, then the wrench.
pub fn instant([desired, wrench]: [usize; 2]) -> Exogenous<Sym> {
    let mut instant = Exogenous { t: 0.0, desired: inputs(desired), wrench: [Sym::zero(); 6] };
    instant.wrench[..wrench].copy_from_slice(&inputs(wrench));
    instant
}

/// Record the rates and the step, and the law if `with_law` is true. `in_parts` selects whether the step is divided into parts. If it is
/// `None`, the size of the rates decides.
fn trace(
    closed: ClosedLoop,
    extras: MetricsAndRecords,
    (method, with_law, in_parts): (ExplicitSteps, bool, Option<bool>),
    slots: &StepSlots,
) -> Tracing {
    let one = || instant(slots.exogenous.sizes());
    let u: Vec<Exogenous<Sym>> = slots.instants.iter().map(|_| one()).collect();
    let (x, stored, h) = (slots.state.declare(), slots.metrics.declare(), sym::input());
    let (tau, dz, firsts) = (slots.tau.declare(), slots.law_rate.declare(), slots.reference.declare());
    let (stage, stage_input, mut rates) = (slots.stage.declare(), one(), slots.rates.declare());
    let mut closed = RecordedLoop { closed, slots, cuts: None };
    if with_law {
        closed.closed.turn_to(&x);
        closed.closed.answer(&u[0], &x);
    }
    let law: Vec<Sym> = closed.closed.tau.iter().chain(closed.closed.law_rate()).copied().collect();
    let mut acting = closed.closed.tau.clone();
    if closed.closed.is_held() {
        closed.closed.hold_input(&tau, &dz);
        acting.clone_from(&tau);
    }
    // The metrics are recorded at this point, so that they share the law's result at this state with the step.
    let sums = extras.sums.map(|mut sums| {
        let mut sum_up = |tau: &[Sym], start: Start| {
            let mut stored = stored.clone();
            sums.add(&u[0].desired, &x, tau, h, start, &mut stored);
            entries(stored)
        };
        let [along, stage] = [&acting, &tau].map(|tau| sum_up(tau, Start::Known));
        Summing { along, stage, alone: sum_up(&tau, Start::Requested) }
    });
    let notes = extras.notes.map(|mut notes| [&acting, &tau].map(|tau| notes.take(&u[0], &x, tau, &firsts)));
    let before = sym::recorded().0;
    closed.rhs(&stage_input, &stage, &mut rates);
    let stage_tau = if closed.closed.is_held() { Vec::new() } else { entries(closed.closed.tau.clone()) };
    if in_parts.unwrap_or(sym::recorded().0 - before > LARGE) {
        closed.cuts = Some(Vec::new());
    }
    let first = u[0].clone();
    let Ok((next, cuts)) = method.apply(closed, x, first, OneStep { u, h }) else { unreachable!("plants without velocities were refused") };
    let rates = cuts.is_some().then(|| (entries(rates), stage_tau));
    let notes =
        notes.map(|[along, alone]| Noting { along: entries(along.numbers), alone: entries(alone.numbers), firsts: entries(alone.firsts) });
    Tracing { law: entries(law), rates, cuts: cuts.unwrap_or_default(), next: entries(next), sums, notes }
}

/// Return the indices of the operations that compute `values`.
pub fn entries(values: Vec<Sym>) -> Vec<u32> {
    values.into_iter().map(Sym::index).collect()
}

/// Records a step of size `h` with the exogenous inputs `u`.
struct OneStep {
    u: Vec<Exogenous<Sym>>,
    h: Sym,
}

impl<'a> WithExplicitSteps<Sym, RecordedLoop<'a>> for OneStep {
    /// The next state, and the cuts of a step that is divided into parts.
    type Output = (Vec<Sym>, Option<Vec<Cut>>);

    fn with_explicit<M>(self, mut closed: RecordedLoop<'a>, mut x: Vec<Sym>, mut method: M) -> Self::Output
    where
        M: Advance<Sym, RecordedLoop<'a>, Vec<Sym>>,
    {
        for (k, u) in self.u.into_iter().enumerate() {
            *method.input(k) = u;
        }
        method.advance(&mut closed, self.h, &mut x);
        (x, closed.cuts)
    }
}

/// A loop that records its evaluations.
struct RecordedLoop<'a> {
    closed: ClosedLoop,
    slots: &'a StepSlots,
    /// The cuts before each evaluation of the rates. `None` if the step is not divided.
    cuts: Option<Vec<Cut>>,
}

impl System<Sym> for RecordedLoop<'_> {
    type Input = Exogenous<Sym>;
    /// Does nothing, because the inputs are already set.
    fn input(&mut self, _: f64, _: &mut Exogenous<Sym>) {}
    fn rhs(&mut self, u: &Exogenous<Sym>, x: &[Sym], dx: &mut [Sym]) {
        let Some(cuts) = &mut self.cuts else {
            self.closed.turn_to(x);
            self.closed.rates(u, x, dx);
            return;
        };
        let StepSlots { stage, stage_input: Instant { slots, .. }, .. } = self.slots;
        let input = u.desired.iter().chain(&u.wrench).take(slots.count).copied();
        let mut outputs = stage.outputs(&entries(x.to_vec()));
        outputs.extend(slots.outputs(&entries(input.collect())));
        cuts.push(Cut { end: sym::recorded().0, outputs });
        dx.fill_with(sym::input);
    }
    fn pairs(&self) -> Pairs {
        self.closed.pairs()
    }
}
