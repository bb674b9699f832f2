//! The steps of a stepper as programs, which are recorded and compiled loops. A frame is the memory of a program.
//!
//! The program of a step with a sample computes the law once, and holds its results. If the law is in every stage, a step with the input of
//! the caller is a step of the plant alone. The state of the law does not change. Native code calls a law that the caller supplies.

use super::structures::loop_of;
use crate::integrate::{FixedStep, MethodKind, System};
use crate::law::{ExternalSpec, LawSpec, Route};
use crate::simulate::assembly::{sampler, start};
use crate::simulate::fixed::step_loop::StepLoop;
use crate::simulate::fixed::step_method::StepMethod;
use crate::simulate::loops::simulated_loop::SimulatedLoop;
use crate::simulate::loops::stepped_loop::SteppedLoop;
use crate::simulate::problem::Problem;
use crate::simulate::problem::force::Wrench;
use crate::simulate::problem::sampling::Sampling;
use crate::simulate::record::key::Common;
use crate::simulate::record::step;
use crate::simulate::record::structure;
use crate::simulate::sampled::control::saturate;
use crate::simulate::sampled::sampler::Sampler;
use crate::simulate::world::Exogenous;
use crate::trace::{Engine, engine};

/// A law that the caller supplies, its samples, and the number of the plant's states that it reads.
struct Outside {
    law: ExternalSpec,
    sampler: Sampler,
    seen: usize,
}

/// The loops of one run.
pub struct SteppedPrograms {
    /// The loop with the law.
    own: StepLoop<'static, f64>,
    /// The plant with the input of the caller, if the law is in every stage.
    plant: Option<StepLoop<'static, f64>>,
    outside: Option<Outside>,
    /// The saturation limits of the input. Empty if there is no saturation.
    limits: Vec<f64>,
    /// Whether the caller gives the input, and this input after saturation.
    driven: bool,
    tau: Vec<f64>,
    /// Before the step: the held results of the law, and whether the caller gave the input.
    before: (Vec<f64>, bool),
    /// The held results of the law before the caller gave the input.
    selected: Vec<f64>,
    engine: Engine,
}

impl SteppedPrograms {
    /// Return the loops of the one run of a problem, and the initial state. The result is `None` if the problem has no programs of steps.
    pub fn of(problem: &Problem) -> Option<(Self, Vec<f64>)> {
        let law = problem.law(0);
        let explicit = matches!(problem.options.method.kind(), MethodKind::ExplicitSteps(_));
        if !explicit || problem.plant(0).sticks() || !(law.route().is_recordable() || law.route() == Route::Outside) {
            return None;
        }
        let own = owned_loop(problem);
        let idle = LawSpec::External(ExternalSpec::idle(problem.plant(0).model(), problem.plant(0).kind()));
        let plant = problem.options.sampling.is_none().then(|| {
            let mut alone = Problem { laws: vec![&idle], force_frame: problem.force_frame(), ..problem.clone() };
            alone.options.sampling = Some(Sampling::every(problem.options.grid()));
            alone.options.tau_max = None;
            owned_loop(&alone)
        });
        let outside = match (law, sampler(problem, 0)) {
            (LawSpec::External(law), Some(sampler)) => Some(Outside { law: law.clone(), sampler, seen: problem.plant(0).seen() }),
            _ => None,
        };
        let limits = problem.options.tau_max.clone().unwrap_or_default();
        let (selected, tau) = (own.held_results().to_vec(), vec![0.0; problem.plant(0).n()]);
        let before = (selected.clone(), false);
        let loops = SteppedPrograms { own, plant, outside, limits, driven: false, tau, before, selected, engine: engine() };
        Some((loops, start(problem, |_| 0)))
    }

    /// Return the method that advances these loops.
    pub fn method(&self) -> SteppedMethod {
        let states = self.plant.as_ref().map_or(0, StepLoop::states);
        SteppedMethod { own: StepMethod::new(&self.own), plant: self.plant.as_ref().map(StepMethod::new), x: vec![0.0; states] }
    }

    fn loops(&mut self) -> impl Iterator<Item = &mut StepLoop<'static, f64>> {
        [&mut self.own].into_iter().chain(&mut self.plant)
    }

    /// The loop that computes the steps now.
    fn current(&mut self) -> &mut StepLoop<'static, f64> {
        self.plant.as_mut().filter(|_| self.driven).unwrap_or(&mut self.own)
    }

    fn use_engine(&mut self, engine: Engine) {
        self.engine = engine;
        self.loops().for_each(|each| each.use_engine(engine));
    }

    /// Use machine code again.
    fn use_machine_code(&mut self) {
        if self.engine != engine() {
            self.use_engine(engine());
        }
    }

    /// Hold the results of the law as before the step.
    fn go_back(&mut self) {
        self.own.restore_results(&self.before.0);
        self.driven = self.before.1;
    }

    /// Discard the sample at time `t`, s. With `failed`, discard it only if its results are not finite.
    fn discard(&mut self, t: f64, failed: bool) {
        self.own.discard_sample(t, failed);
        if let Some(outside) = &mut self.outside {
            outside.sampler.discard_at(t, failed);
        }
    }
}

/// Return the loop of the one run of a problem, with its own copies of motions and forces.
fn owned_loop(problem: &Problem) -> StepLoop<'static, f64> {
    let common = Common::of(problem, false);
    let parameters = structure::loop_parameters(problem, 0, common);
    let recorded = step::of_run(problem, 0, common, &parameters).recorded.clone();
    loop_of::<f64>(problem, (&recorded, engine()), |_| 0, None, |_| &parameters.values).into_owned()
}

impl System<f64> for SteppedPrograms {
    type Input = Exogenous<f64>;

    fn input(&mut self, t: f64, u: &mut Exogenous<f64>) {
        self.own.input(t, u);
    }
    fn rhs(&mut self, _: &Exogenous<f64>, _: &[f64], _: &mut [f64]) {
        unreachable!("a recorded loop advances by whole steps")
    }
}

impl SimulatedLoop<f64> for SteppedPrograms {
    fn sample(&mut self, t: f64, x: &[f64]) {
        let Some(Outside { law, sampler, seen }) = &mut self.outside else { return self.own.sample(t, x) };
        let limits = &self.limits;
        sampler.run(t, x, |measured, tau, others| {
            law.evaluate(t, &measured[..*seen], tau);
            saturate(tau, limits);
            others.fill(0.0);
        });
        self.own.hold(&sampler.tau, &sampler.dz);
    }
    fn input_at(&mut self, t: f64, x: &[f64]) -> &[f64] {
        if self.driven { &self.tau } else { self.own.input_at(t, x) }
    }
}

impl SteppedLoop for SteppedPrograms {
    fn drive(&mut self, tau: Option<&[f64]>, _: bool) {
        let driven = std::mem::replace(&mut self.driven, tau.is_some());
        let Some(tau) = tau else {
            // A controller with a queue continues with the output that it selected last.
            if driven && self.own.has_queue() {
                self.own.restore_results(&self.selected);
            }
            return;
        };
        if !driven {
            self.selected.copy_from_slice(self.own.held_results());
        }
        self.tau.copy_from_slice(tau);
        saturate(&mut self.tau, &self.limits);
        self.plant.as_mut().unwrap_or(&mut self.own).hold_alone(&self.tau);
    }
    fn push(&mut self, wrench: Option<&Wrench>) {
        self.loops().for_each(|each| each.world.push(wrench));
    }
    fn rewind(&mut self) {
        self.driven = false;
        self.selected.fill(0.0);
        self.own.restore_results(&self.selected);
        self.own.discard_samples();
        if let Some(outside) = &mut self.outside {
            outside.sampler.clear();
        }
    }
    fn begin_step(&mut self) {
        self.before.0.copy_from_slice(self.own.held_results());
        self.before.1 = self.driven;
    }
    fn declines(&mut self) -> bool {
        if self.engine == Engine::Interpreter || !self.current().strayed(0) {
            return false;
        }
        self.use_engine(Engine::Interpreter);
        self.go_back();
        true
    }
    fn undo_step(&mut self, t: f64, _: &[i8]) {
        self.use_machine_code();
        self.go_back();
        self.discard(t, true);
    }
    fn replace_state(&mut self, t: f64) {
        self.use_machine_code();
        self.discard(t, false);
    }
}

/// The method that advances the loops of a stepper.
pub struct SteppedMethod {
    own: StepMethod<f64>,
    plant: Option<StepMethod<f64>>,
    /// Memory for the state of the plant.
    x: Vec<f64>,
}

impl FixedStep<f64, SteppedPrograms, Vec<f64>> for SteppedMethod {
    fn step(&mut self, system: &mut SteppedPrograms, t: f64, h: f64, end: f64, x: &mut Vec<f64>) {
        match (&mut system.plant, &mut self.plant) {
            (Some(plant), Some(method)) if system.driven => {
                let of_plant = 0..self.x.len();
                self.x.copy_from_slice(&x[of_plant.clone()]);
                method.step(plant, t, h, end, &mut self.x);
                x[of_plant].copy_from_slice(&self.x);
            }
            _ => self.own.step(&mut system.own, t, h, end, x),
        }
    }
    fn stride(&mut self, system: &mut SteppedPrograms, first: usize, count: usize, h: f64, x: &mut Vec<f64>) -> bool {
        !system.driven && system.outside.is_none() && self.own.stride(&mut system.own, first, count, h, x)
    }
    fn restart(&mut self) {
        [&mut self.own].into_iter().chain(&mut self.plant).for_each(FixedStep::<f64, StepLoop<f64>, Vec<f64>>::restart);
    }
}
