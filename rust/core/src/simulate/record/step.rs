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
use super::records::Notes;
use super::slots::{Instant, StepSlots};
use super::step_programs::{self, Noting, Programs, Summing, Tracing, Watch};
use super::structure::{LoopParameters, MetricsAndRecords, Seen, entries, instant, set_up};
use crate::integrate::{Advance, ExplicitSteps, MethodKind, System, WithExplicitSteps};
use crate::linalg::Pairs;
use crate::simulate::closed_loop::ClosedLoop;
use crate::simulate::metrics::gauge::Start;
use crate::simulate::problem::Problem;
use crate::simulate::world::Exogenous;
use crate::trace::cache::Cache;
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
/// and a plant without stick-slip friction.
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
    let notes = extras.notes.map(|notes| [&acting, &tau].map(|tau| notes.take(&u[0], &x, tau, &firsts)));
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
    closed: ClosedLoop<'a>,
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
            self.closed.rhs(u, x, dx);
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
