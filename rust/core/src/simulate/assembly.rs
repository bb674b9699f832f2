//! The loops of a problem, made from its plants, laws, motions and forces.

use super::closed_loop::{ClosedLoop, Closing};
use super::monitors;
use super::problem::Problem;
use super::sampled::sampler::Sampler;
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

/// Return the clock of the controllers of the runs `run(lane)`. The result is `None` without sampling. A controller that only holds the
/// law's output has no clock either, unless the law is a function that the caller supplies.
pub fn sampler<S: Real>(problem: &Problem, run: impl Fn(usize) -> usize + Copy) -> Option<Sampler<S>> {
    let (o, plant) = (&problem.options, problem.plant(run(0)));
    // A law that the caller supplies may have internal states. So it is called only once per sample.
    let called_once = problem.law(run(0)).route() == Route::Outside;
    let dissipated = usize::from(o.monitors && !problem.watches_storage());
    let sizes = (plant.states(), plant.n(), problem.law(run(0)).initial_state().len() + dissipated);
    o.sampling.as_ref().filter(|sampling| !sampling.is_plain() || called_once).map(|sampling| {
        let seeds = (0..S::LANES).map(|lane| sampling.seed.wrapping_add(run(lane) as u64)).collect();
        let sensing = TorqueSensing::of(problem, sampling, run);
        Sampler::new(sampling.clone(), seeds, o.grid(), sizes, sensing).with_torque_states(problem.law(run(0)).torque_states())
    })
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
