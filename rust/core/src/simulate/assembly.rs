//! The loops of a problem, made from its plants, laws, motions and forces.

use super::closed_loop::{ClosedLoop, Closing};
use super::force::Wrench;
use super::monitors;
use super::problem::Problem;
use super::sampler::Sampler;
use super::sink::Sink;
use super::torque_sensing::TorqueSensing;
use super::world::{Exogenous, World};
use crate::integrate::{DualSystem, Linearised, System};
use crate::law::{Route, Truth};
use crate::plant::Touch;
use crate::scalar::{Dual, Real};
use std::borrow::Cow;

/// A loop whose run can be recorded and observed. The caller may replace its input and its external forces.
pub trait Watched<S: Real>: System<S, Input = Exogenous<S>> {
    /// Return the plant's input at time `t` and state `x`.
    fn input_at(&mut self, t: f64, x: &[S]) -> &[S];
    /// Use `tau` as the plant's input instead of the law's output. If `tau` is `None`, the law computes the input, and `held` selects
    /// whether this input is held.
    fn drive(&mut self, tau: Option<&[S]>, held: bool);
    /// Restart at `t = 0`.
    fn rewind(&mut self);
    /// Undo a step from time `t`, s. `sides` are the states of the switches before this step. A sample at `t` remains, unless its output is
    /// not finite.
    fn undo_step(&mut self, _t: f64, _sides: &[i8]) {}
    /// Continue at time `t`, s, from a state that the caller has set. A sample at `t` is taken again.
    fn replace_state(&mut self, _t: f64) {}
    /// Write the depth and the push of each contact of the plant at state `x` to `out` ([`Plant::contact`](crate::plant::Plant::contact)).
    fn contacts(&mut self, _x: &[S], _out: &mut [f64]) {}
    /// Hold the contacts of the plant in the modes `contacts`.
    fn hold_contacts(&mut self, contacts: &[Touch]);
    /// Apply `wrench` instead of the external forces. `None` restores the forces.
    fn push(&mut self, wrench: Option<&Wrench>);
    /// Decide which joints stick at time `t` and state `x`.
    fn settle(&mut self, _t: f64, _x: &[S]) {}
    /// Change the mode of a joint with stick-slip friction, at time `t` and state `x`: a stuck joint slips, a sliding joint stops. `None`:
    /// check all joints.
    fn switch_joint(&mut self, _t: f64, _x: &mut [S], _joint: Option<usize>) {}
    /// For each joint with stick-slip friction, write a number to `out`. A negative number means that the joint's present mode ends.
    fn margins(&mut self, _t: f64, _x: &[S], _out: &mut [f64]) {}
    /// Pass the stored records to the sink. A program stores them if it computes several steps. `time(k)` is the time at the start of step
    /// `k`.
    fn pass_on(&mut self, _time: &dyn Fn(usize) -> f64, _: &mut dyn Sink) {}
}

impl<S: Real> Watched<S> for ClosedLoop<'_, S> {
    fn input_at(&mut self, t: f64, x: &[S]) -> &[S] {
        self.observe_unheld(t, x);
        &self.tau
    }
    fn drive(&mut self, tau: Option<&[S]>, held: bool) {
        self.take_over(tau, held);
    }
    fn rewind(&mut self) {
        ClosedLoop::rewind(self);
    }
    fn undo_step(&mut self, t: f64, sides: &[i8]) {
        self.forget_sample(t, true);
        self.follow(sides);
    }
    fn replace_state(&mut self, t: f64) {
        self.forget_sample(t, false);
    }
    fn contacts(&mut self, x: &[S], out: &mut [f64]) {
        self.turn_to(x);
        for (i, out) in out.as_chunks_mut().0.iter_mut().enumerate() {
            *out = self.contact(i, x).map(|number| number.lane(0));
        }
    }
    fn hold_contacts(&mut self, contacts: &[Touch]) {
        ClosedLoop::hold_contacts(self, contacts);
    }
    fn push(&mut self, wrench: Option<&Wrench>) {
        ClosedLoop::push(self, wrench);
    }
    fn settle(&mut self, t: f64, x: &[S]) {
        ClosedLoop::settle(self, t, x, None);
    }
    fn switch_joint(&mut self, t: f64, x: &mut [S], joint: Option<usize>) {
        ClosedLoop::switch_joint(self, t, x, joint);
    }
    fn margins(&mut self, t: f64, x: &[S], out: &mut [f64]) {
        ClosedLoop::margins(self, t, x, out);
    }
}

/// A loop of plain numbers, and the same loop of dual numbers, from which the Jacobian is computed.
pub type Twins<'a> = Linearised<ClosedLoop<'a, f64>, ClosedLoop<'a, Dual>, f64, Vec<Dual>, Exogenous<Dual>>;

impl Watched<f64> for Twins<'_> {
    fn input_at(&mut self, t: f64, x: &[f64]) -> &[f64] {
        self.system.input_at(t, x)
    }
    fn rewind(&mut self) {
        self.system.rewind();
    }
    fn undo_step(&mut self, t: f64, sides: &[i8]) {
        self.system.undo_step(t, sides);
        self.twin.follow(sides);
    }
    fn replace_state(&mut self, t: f64) {
        self.system.replace_state(t);
    }
    fn contacts(&mut self, x: &[f64], out: &mut [f64]) {
        self.system.contacts(x, out);
    }
    fn hold_contacts(&mut self, contacts: &[Touch]) {
        self.system.hold_contacts(contacts);
        self.twin.hold_contacts(contacts);
    }
    fn push(&mut self, wrench: Option<&Wrench>) {
        self.system.push(wrench);
        self.twin.push(wrench);
    }
    fn settle(&mut self, t: f64, x: &[f64]) {
        Watched::settle(&mut self.system, t, x);
        self.twin.follow(self.system.sides());
    }
    fn switch_joint(&mut self, t: f64, x: &mut [f64], joint: Option<usize>) {
        self.system.switch_joint(t, x, joint);
        self.twin.follow(self.system.sides());
    }
    fn margins(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        self.system.margins(t, x, out);
    }
    fn drive(&mut self, tau: Option<&[f64]>, held: bool) {
        self.system.drive(tau, held);
        self.twin.take_over(None, held || tau.is_some());
        if let Some((input, rate)) = self.system.held() {
            self.twin.hold(input, rate);
        }
    }
}

impl Twins<'_> {
    /// Return the loop with owned copies of its motions, forces and limits.
    pub fn into_owned(self) -> Twins<'static> {
        let (closed, twin) = (self.system.into_owned(), self.twin.into_owned());
        let (state, input) = (vec![Dual::zero(); closed.size()], twin.instant());
        Linearised::new(closed, twin, state, input)
    }
}

/// Return the loop of run `first` on plain and on dual numbers, and the initial state.
pub fn twins<'a>(problem: &'a Problem, first: usize) -> (Twins<'a>, Vec<f64>) {
    let (closed, x) = close::<f64>(problem, first);
    let (twin, moving) = close::<Dual>(problem, first);
    let input = twin.instant();
    (Linearised::new(closed, twin, moving, input), x)
}

/// Return the loop of run `run`, and the initial state.
#[inline(never)]
pub fn close<'a, S: Real>(problem: &'a Problem, run: usize) -> (ClosedLoop<'a, S>, Vec<S>) {
    (assemble(problem, run, problem.watches_storage()), start(problem, |_| run))
}

/// Return the desired motions and forces of the runs `run(lane)`.
pub fn world<'a>(problem: &'a Problem, lanes: usize, run: impl Fn(usize) -> usize) -> World<'a> {
    World::new(lanes, |lane| problem.law(run(lane)).motions(), |lane| problem.force(run(lane)))
}

/// Return the loop of run `run`. `storage`: whether the monitored energy is the law's storage function.
pub fn assemble<'a, S: Real>(problem: &'a Problem, run: usize, storage: bool) -> ClosedLoop<'a, S> {
    let (o, plant, law) = (&problem.options, problem.plant(run), problem.law(run));
    let loop_plant = plant.build::<S>(problem.force_frame());
    let loop_law = law.build::<S>();
    let closing = Closing { tau_max: o.tau_max.as_deref().map(Cow::Borrowed), held: o.sampling.is_some(), monitored: o.monitors, storage };
    let sizes = (plant.states(), plant.seen(), law.initial_state().len(), plant.model().angles());
    let truth = law.adaptive().filter(|_| closing.watches_dissipation()).and_then(|law| Truth::new(law, plant));
    let period = o.sampling.as_ref().map(|sampling| sampling.period);
    let (world, sampler) = (world(problem, 1, |_| run), sampler(problem, |_| run));
    ClosedLoop::new(loop_plant, loop_law, world, closing, sampler, sizes).judged_by(truth).sampled_every(period)
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
