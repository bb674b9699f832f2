//! The loops of a problem, made from its plants, laws, motions and forces.

use super::closed_loop::{ClosedLoop, Closing};
use super::monitors;
use super::problem::Problem;
use super::problem::sampling::Sampling;
use super::sampled::clock::Clock;
use super::sampled::frame_controller::{ControllerSlots, FrameController};
use super::sampled::sampler::Sampler;
use super::sampled::samples::Samples;
use super::sampled::sensors::Sensors;
use super::sampled::torque_sensing::TorqueSensing;
use super::world::World;
use crate::law::Route;
use crate::scalar::Real;

/// Return the desired motions and forces of the runs `run(lane)`.
pub fn world<'a>(problem: &'a Problem, lanes: usize, run: impl Fn(usize) -> usize) -> World<'a> {
    World::new(lanes, |lane| problem.law(run(lane)).motions(), |lane| problem.force(run(lane)))
}

/// Return the loop of run `run`. `storage`: whether the monitored energy is the law's storage function.
pub fn assemble<'a>(problem: &Problem<'a>, run: usize, storage: bool) -> ClosedLoop<'a> {
    let o = &problem.options;
    let closing = Closing { held: o.sampling.is_some(), monitored: o.monitors, storage };
    let period = o.sampling.as_ref().map(|sampling| sampling.period);
    let plant = (problem.plant(run), problem.force_frame());
    ClosedLoop::new(plant, problem.law(run), closing, (o.tau_max.as_deref(), period))
}

/// Return the sensors of the controller of run `run`, for measurements of the first `states` states of the plant.
pub fn sensors(problem: &Problem, sampling: &Sampling, run: usize, states: usize) -> Sensors {
    let seed = sampling.seed.wrapping_add(run as u64);
    Sensors::new((sampling, seed, problem.options.grid()), [states, problem.plant(run).n()], TorqueSensing::of(problem, sampling, run))
}

/// Return the samples of the runs `run(lane)` of `all` lanes, in frames of `lanes` lanes each. The result is `None` without sampling.
pub fn samples(
    problem: &Problem,
    slots: ControllerSlots,
    [all, lanes]: [usize; 2],
    run: impl Fn(usize) -> usize + Copy,
) -> Option<Samples> {
    let (sampling, dt) = (problem.options.sampling.as_ref()?, problem.options.grid());
    // With jitter, the frame has one lane.
    let clock = Clock::new(sampling, dt, sampling.seed.wrapping_add(run(0) as u64));
    let controller = |first: usize| {
        let sensors = (first..first + lanes).map(|lane| sensors(problem, sampling, run(lane), slots.measured.count));
        FrameController::new(slots, sampling, sensors.collect())
    };
    let controllers = if sampling.is_plain() { Vec::new() } else { (0..all).step_by(lanes).map(controller).collect() };
    Some(Samples { clock, dt, controllers })
}

/// Return the clock of the controller of run `run`. The result is `None` without sampling. A controller that only holds the law's output has
/// no clock either, unless the law is a function that the caller supplies.
pub fn sampler(problem: &Problem, run: usize) -> Option<Sampler> {
    let (o, law) = (&problem.options, problem.law(run));
    // A law that the caller supplies may have internal states. So it is called only once per sample.
    let sampling = o.sampling.as_ref().filter(|sampling| !sampling.is_plain() || law.route() == Route::Outside)?;
    let dissipated = usize::from(o.monitors && !problem.watches_storage());
    let sizes = [problem.plant(run).n(), law.initial_state().len() + dissipated, problem.state_size()];
    Some(Sampler::new(sampling, sensors(problem, sampling, run, problem.plant(run).states()), sizes, law.torque_states()))
}

impl Problem<'_> {
    /// The number of states of a loop: plant, law and integrals.
    pub fn state_size(&self) -> usize {
        self.plant(0).states() + self.law(0).initial_state().len() + monitors::integrals(self.options.monitors).count()
    }
}

/// Return the initial state of the runs `run(lane)`.
pub fn start<S: Real>(problem: &Problem, run: impl Fn(usize) -> usize) -> Vec<S> {
    let (states, p) = (problem.plant(0).states(), problem.law(0).initial_state().len());
    let of_plant = (0..states).map(|k| S::from_lanes(|lane| problem.x0[run(lane) * states + k]));
    let laws: Vec<Vec<f64>> =
        (0..S::LANES).map(|lane| problem.law(run(lane)).start(&problem.x0[run(lane) * states..(run(lane) + 1) * states])).collect();
    let of_law = (0..p).map(|k| S::from_lanes(|lane| laws[lane][k]));
    of_plant.chain(of_law).chain(monitors::integrals(problem.options.monitors).map(|_| S::zero())).collect()
}
