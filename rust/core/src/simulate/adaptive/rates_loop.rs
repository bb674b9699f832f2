//! A closed loop whose state rates and their derivatives are programs (recorded computations). The exogenous input, the clock of a sampled
//! controller, the modes of contacts and joints, and laws that the caller supplies are native code.
//!
//! A loop is recorded before its first evaluation. The interpreter computes the recording until machine code repays. For implicit methods
//! and steppers, machine code is made at the start. The bits are the same in both cases. If an angle exceeds the range of the sines of
//! machine code, the interpreter continues. A stepper uses machine code again from a state that the caller sets.

use super::rates_evaluation::RatesEvaluation;
use super::sticking_joints::StickingJoints;
use crate::integrate::{Attempt, Buffer, Differentiable, Scheme, System};
use crate::law::{ExternalSpec, LawSpec};
use crate::linalg::Pairs;
use crate::plant::Touch;
use crate::simulate::assembly::{sampler, start, world};
use crate::simulate::loops::simulated_loop::SimulatedLoop;
use crate::simulate::loops::stepped_loop::SteppedLoop;
use crate::simulate::problem::Problem;
use crate::simulate::problem::force::Wrench;
use crate::simulate::record::key::Common;
use crate::simulate::record::rates::{self, Rates, RatesOfRun};
use crate::simulate::sampled::control::{Control, saturate};
use crate::simulate::sampled::sampler::Sampler;
use crate::simulate::world::{Exogenous, World};
use crate::trace::{Engine, engine};

/// The problem and the run of a loop, with the recorded rates of the problem.
struct Source<'a> {
    rates: &'a Rates,
    problem: &'a Problem<'a>,
    run: usize,
}

/// A loop of one run.
pub struct RatesLoop<'a> {
    pub(in crate::simulate) world: World<'a>,
    pub(in crate::simulate) control: Control,
    /// The clock of a controller that does more than hold the law's output. `None` for other controllers.
    sampler: Option<Sampler>,
    /// The law, if the caller supplies it, and the number of the plant's states that it reads.
    pub(in crate::simulate) law: Option<(ExternalSpec, usize)>,
    /// The joints or motors with stick-slip friction.
    pub(in crate::simulate) joints: Option<StickingJoints>,
    /// The saturation limits of the input. Empty if there is no saturation.
    pub(in crate::simulate) limits: Vec<f64>,
    /// The numbers of states of the plant, and of plant and law together.
    pub(in crate::simulate) states: [usize; 2],
    pairs: Pairs,
    pub(in crate::simulate) now: Exogenous<f64>,
    /// The programs of the rates: the first with the law's output as the input, the second with a held input.
    evaluations: [Option<RatesEvaluation>; 2],
    /// Present while the interpreter computes until machine code repays.
    waiting: Option<Source<'a>>,
    /// Whether an angle has exceeded the range of machine code, so that the interpreter continues.
    strayed: bool,
}

impl<'a> RatesLoop<'a> {
    /// Return the loop of run `run` without programs, and the initial state.
    fn without_programs(problem: &'a Problem, run: usize) -> (Self, Vec<f64>) {
        let (plant, o) = (problem.plant(run), &problem.options);
        let (world, x) = (world(problem, 1, |_| run), start::<f64>(problem, |_| run));
        let (n, states, p) = (plant.n(), plant.states(), problem.law(run).initial_state().len());
        let answer = p + usize::from(o.monitors && !problem.watches_storage());
        let limits = o.tau_max.clone().unwrap_or_default();
        let closed = RatesLoop {
            control: Control::new(o.sampling.is_some(), [n, answer]),
            sampler: sampler(problem, run),
            law: if let LawSpec::External(law) = problem.law(run) { Some((law.clone(), plant.seen())) } else { None },
            joints: StickingJoints::of(problem, run),
            limits,
            states: [states, states + p],
            // The plant's state is [q, v], [q, v, theta, theta_dot], or [q] without rates. The bristle deflections, the states of the law
            // and the integrals of the monitors follow.
            pairs: Pairs { joints: n, count: states / (2 * n), quadratures: x.len() - states - p },
            now: world.instant(),
            world,
            evaluations: [None, None],
            waiting: None,
            strayed: false,
        };
        (closed, x)
    }

    /// Return the loop of run `run` of a problem, and the initial state.
    pub fn new(problem: &'a Problem, run: usize, rates: &'a Rates) -> (Self, Vec<f64>) {
        let (mut closed, x) = Self::without_programs(problem, run);
        let (recorded, values) = rates.of_run(problem, run, closed.which() == 1);
        let settled = problem.options.method.is_implicit() || recorded.programs.repays();
        let engine = if settled { engine() } else { Engine::Interpreter };
        rates.note(engine);
        closed.waiting = Some(Source { rates, problem, run });
        let which = closed.which();
        closed.evaluations[which] = Some(RatesEvaluation::new(recorded, &values, engine));
        if settled {
            closed.stop_waiting();
        }
        (closed, x)
    }

    /// Return the loop of run `run` of a problem with the recorded rates `of_run`, and the initial state. Programs in lanes compute its
    /// attempts, and machine code computes the other evaluations. `memory` is the evaluation of an earlier run of the same structure.
    pub fn in_lane(problem: &'a Problem, run: usize, (recorded, values): &RatesOfRun, memory: Option<RatesEvaluation>) -> (Self, Vec<f64>) {
        let (mut closed, x) = Self::without_programs(problem, run);
        let which = closed.which();
        let mut evaluation = memory.unwrap_or_else(|| RatesEvaluation::new(recorded.clone(), values, engine()));
        evaluation.restart(values);
        closed.evaluations[which] = Some(evaluation);
        (closed, x)
    }

    /// Return the evaluation of the rates for another run. `None` if the interpreter had to continue this run.
    pub fn into_evaluation(mut self) -> Option<RatesEvaluation> {
        let which = self.which();
        if self.strayed { None } else { self.evaluations[which].take() }
    }

    /// The held results of the law, and the modes of contacts and joints.
    pub fn held(&self) -> &[f64] {
        self.evaluations[self.which()].as_ref().map_or(&[], RatesEvaluation::held)
    }

    /// Return the loop of the one run of a problem for a stepper, and the initial state. The caller can replace the input.
    pub fn stepped(problem: &Problem) -> (RatesLoop<'static>, Vec<f64>) {
        let (closed, x) = RatesLoop::without_programs(problem, 0);
        let unheld = closed.which() == 0;
        let evaluations = [false, true].map(|held| {
            (held || unheld).then(|| {
                let (recorded, values) = rates::of_run(problem, 0, Common::of_functions(problem), held);
                RatesEvaluation::new(recorded, &values, engine())
            })
        });
        (RatesLoop { world: closed.world.into_owned(), evaluations, waiting: None, ..closed }, x)
    }

    /// Return memory for the exogenous input at one instant.
    pub fn instant(&self) -> Exogenous<f64> {
        self.world.instant()
    }

    /// The number of leading states whose error is controlled.
    pub fn controlled(&self) -> usize {
        self.states[1]
    }

    /// Return the times before `t_end` at which the sampler takes samples and at which their outputs act, s. Empty without a sampler.
    pub fn instants(&self, t_end: f64) -> Vec<f64> {
        self.sampler.as_ref().map_or(Vec::new(), |sampler| sampler.instants(t_end))
    }

    /// Whether machine code computes the rates, if the system permits it.
    pub fn is_running(&self) -> bool {
        self.waiting.is_none() && !self.strayed
    }

    /// The index of the programs in use.
    fn which(&self) -> usize {
        usize::from(self.control.held)
    }

    /// Use the programs of the process from now on.
    fn stop_waiting(&mut self) {
        let Some(Source { rates, problem, run }) = self.waiting.take() else { return };
        rates.note(engine());
        for evaluation in self.evaluations.iter_mut().flatten() {
            evaluation.use_engine(engine());
            evaluation.use_attempt(evaluation.recorded.attempt(problem, run, rates.common));
        }
    }

    /// Count an evaluation by the interpreter. If machine code repays, use it from now on.
    fn count(&mut self) {
        let which = self.which();
        if self.waiting.is_some() && !self.strayed && self.evaluations[which].as_ref().is_some_and(|rates| rates.recorded.programs.count(1))
        {
            self.stop_waiting();
        }
    }

    fn use_engine(&mut self, engine: Engine) {
        self.evaluations.iter_mut().flatten().for_each(|rates| rates.use_engine(engine));
    }

    /// Compute with the programs. If the result of machine code is not valid, the interpreter computes it again, and continues.
    pub(in crate::simulate) fn compute(&mut self, mut of: impl FnMut(&mut RatesEvaluation, &mut World<'a>) -> bool) {
        let which = self.which();
        let Some(rates) = &mut self.evaluations[which] else { unreachable!("the loop has been recorded") };
        if !of(rates, &mut self.world) && !self.strayed {
            self.stray();
            self.compute(of);
        }
    }

    fn stray(&mut self) {
        self.strayed = true;
        self.use_engine(Engine::Interpreter);
    }

    /// Use machine code again.
    fn use_machine_code(&mut self) {
        if std::mem::take(&mut self.strayed) {
            self.use_engine(engine());
        }
    }

    /// Compute a function of the loop under the exogenous input at time `t`.
    pub(in crate::simulate) fn compute_at(&mut self, t: f64, mut of: impl FnMut(&mut RatesEvaluation, &Exogenous<f64>) -> bool) {
        let mut now = std::mem::replace(&mut self.now, Exogenous { t, desired: Vec::new(), wrench: [0.0; 6] });
        self.world.sample(t, &mut now);
        self.compute(|rates, _| of(rates, &now));
        self.now = now;
    }

    /// Write the modes of the joints to the frames.
    pub(in crate::simulate) fn write_sides(&mut self) {
        if let Some(joints) = &self.joints {
            self.evaluations.iter_mut().flatten().for_each(|rates| rates.hold_sides(joints.sides()));
        }
    }

    /// Hold the contacts of the plant in the modes `contacts`.
    pub fn hold_contacts(&mut self, contacts: &[Touch]) {
        let modes: Vec<f64> = contacts.iter().flat_map(|touch| touch.numbers()).collect();
        self.evaluations.iter_mut().flatten().for_each(|rates| rates.hold_contacts(&modes));
    }

    /// Write the depth and the push of each contact of the plant at state `x` to `out` ([`Plant::contact`](crate::plant::Plant::contact)).
    pub fn contacts(&mut self, x: &[f64], out: &mut [f64]) {
        self.compute(|rates, _| rates.contacts(x, out));
    }
}

impl RatesLoop<'_> {
    /// Evaluate the law at time `t` and state `x`, and write its results to the control.
    fn observe(&mut self, t: f64, x: &[f64]) {
        let mut now = std::mem::replace(&mut self.now, Exogenous { t, desired: Vec::new(), wrench: [0.0; 6] });
        self.world.sample(t, &mut now);
        self.evaluate_law(&now, x);
        self.now = now;
    }

    /// Hold the results of the law in the control from now on.
    fn hold(&mut self) {
        if let [_, Some(rates)] = &mut self.evaluations {
            rates.hold(&self.control.tau, &self.control.dz);
        }
    }
}

impl System<f64> for RatesLoop<'_> {
    type Input = Exogenous<f64>;

    fn input(&mut self, t: f64, u: &mut Exogenous<f64>) {
        self.world.sample(t, u);
    }
    fn rhs(&mut self, u: &Exogenous<f64>, x: &[f64], dx: &mut [f64]) {
        self.count();
        self.compute(|rates, _| rates.rates(u, x, dx));
    }
    fn attempt<C: Scheme, B: Buffer<f64>>(&mut self, attempt: &mut Attempt<f64, B>) -> bool {
        let which = self.which();
        let (Some(rates), world) = (&mut self.evaluations[which], &mut self.world) else { return false };
        if self.strayed {
            return false;
        }
        let valid = rates.attempt(attempt, |t, u| world.sample(t, u));
        if valid == Some(false) {
            self.stray();
        }
        valid == Some(true)
    }
    fn pairs(&self) -> Pairs {
        self.pairs
    }
}

impl SimulatedLoop<f64> for RatesLoop<'_> {
    fn sample(&mut self, t: f64, x: &[f64]) {
        let Some(mut sampler) = self.sampler.take() else {
            if self.control.held {
                self.observe(t, x);
                self.hold();
            }
            return;
        };
        sampler.run(t, x, |measured, tau, dz| {
            self.observe(t, measured);
            tau.copy_from_slice(&self.control.tau);
            dz.copy_from_slice(&self.control.dz);
        });
        self.control.tau.copy_from_slice(&sampler.tau);
        self.control.dz.copy_from_slice(&sampler.dz);
        self.sampler = Some(sampler);
        self.hold();
    }
    fn input_at(&mut self, t: f64, x: &[f64]) -> &[f64] {
        if !self.control.held {
            self.observe(t, x);
        }
        &self.control.tau
    }
    fn enter_step(&mut self, t: f64, x: &[f64]) -> bool {
        !self.stays(t, x) && self.settle(t, x, None)
    }
    fn leave_step(&mut self, x: &mut [f64]) -> bool {
        self.arrest(x)
    }
}

impl SteppedLoop for RatesLoop<'_> {
    fn drive(&mut self, tau: Option<&[f64]>, held: bool) {
        self.control.held = held || tau.is_some();
        if let Some(tau) = tau {
            self.control.tau.copy_from_slice(tau);
            saturate(&mut self.control.tau, &self.limits);
            self.control.dz.fill(0.0);
        }
        self.hold();
    }
    fn push(&mut self, wrench: Option<&Wrench>) {
        self.world.push(wrench);
    }
    fn rewind(&mut self) {
        if let Some(sampler) = &mut self.sampler {
            sampler.clear();
        }
    }
    fn sides(&self) -> &[i8] {
        self.modes_of_joints()
    }
    fn undo_step(&mut self, t: f64, sides: &[i8]) {
        self.use_machine_code();
        if let Some(sampler) = &mut self.sampler {
            sampler.discard_at(t, true);
        }
        self.set_modes_of_joints(sides);
    }
    fn replace_state(&mut self, t: f64) {
        self.use_machine_code();
        if let Some(sampler) = &mut self.sampler {
            sampler.discard_at(t, false);
        }
    }
}

impl Differentiable<f64> for RatesLoop<'_> {
    fn linearise(&mut self, t: f64, u: &Exogenous<f64>, x: &[f64], dx: &mut [f64], j: &mut [f64]) {
        self.compute(|rates, world| {
            if rates.is_moving() {
                let [u, u_dot] = rates.instants();
                world.drift(t, u, u_dot);
            }
            rates.linearise(u, x, dx, j)
        });
    }
    fn time_derivative(&mut self, _: f64, _: &Exogenous<f64>, _: &[f64], dft: &mut [f64]) {
        let which = self.which();
        if let Some(rates) = &self.evaluations[which] {
            dft.copy_from_slice(rates.time_derivative());
        }
    }
    fn autonomous(&self) -> bool {
        (self.control.held || self.world.has_targets()) && !self.world.has_smooth_force()
    }
}
