//! A closed loop whose state rates and their derivatives are programs (recorded and compiled computations), with the interface of a closed
//! loop.
//!
//! A run uses programs from the start if an earlier run with the same structure has made them. Otherwise an explicit method starts without
//! programs, and makes them after `WAIT` evaluations of the rates. The bits are the same in both cases. For implicit methods the programs
//! are made before the first step, because the Jacobian from dual numbers rounds differently. If an angle exceeds the range of the
//! programs' sines, the loop continues without programs. A stepper uses them again from a state that the caller sets.
//!
//! The modes of contacts, and of joints that stick and slip, are inputs of the programs. Until the modes of the contacts are known, the loop
//! computes without programs. The modes of the joints are copied before every call of a program.

use super::assembly::{Twins, Watched, twins};
use super::force::Wrench;
use super::problem::Problem;
use super::rates_programs::{Rates, record_both};
use super::running_rates::Running;
use super::world::Exogenous;
use crate::integrate::{Attempt, Buffer, Differentiable, Scheme, System};
use crate::linalg::Pairs;
use crate::plant::Touch;
use crate::scalar::Real;

/// The number of evaluations of the rates after which an explicit method makes programs. A shorter run saves the time of making them.
const WAIT: usize = 500;

/// The data from which the programs of a run are made.
pub struct Source<'a> {
    pub rates: &'a Rates,
    pub problem: &'a Problem<'a>,
    pub run: usize,
}

/// A loop that may use programs. `direct` is the same loop without programs.
pub struct RatesLoop<'a, S: Real, D> {
    pub direct: D,
    source: Option<Source<'a>>,
    /// The number of evaluations so far.
    work: usize,
    /// The number of evaluations after which programs are made.
    wait: usize,
    /// The programs of the rates: the first with the law's output as the input, the second with a held input.
    running: [Option<Running<S>>; 2],
    /// Whether the loop continues without programs.
    left: bool,
    /// The modes of the contacts, two numbers for each contact.
    modes: Vec<f64>,
}

impl<'a, S: Real, D: Watched<S>> RatesLoop<'a, S, D> {
    /// Create the loop of an explicit method. With a `source`, it uses the programs of an earlier run from the start, or makes programs
    /// after `WAIT` evaluations.
    pub fn explicit(direct: D, source: Option<Source<'a>>) -> Self {
        RatesLoop { direct, source, work: 0, wait: WAIT, running: [None, None], left: false, modes: Vec::new() }
    }

    /// Create the loop of an implicit method. With a `source`, it uses programs from the first evaluation on.
    pub fn implicit(direct: D, source: Option<Source<'a>>) -> Self {
        RatesLoop { wait: 0, ..RatesLoop::explicit(direct, source) }
    }

    /// Whether the rates are computed by programs.
    pub fn is_running(&mut self) -> bool {
        self.parts().0.is_some()
    }

    fn which(&self) -> usize {
        usize::from(self.direct.held().is_some())
    }

    /// The programs that compute the rates, and the loop without programs.
    fn parts(&mut self) -> (Option<&mut Running<S>>, &mut D) {
        let (which, known) = (self.which(), self.modes.len());
        // Until the modes of the contacts are known, the loop computes without programs.
        let mut running = self.running[which].as_mut().filter(|running| !self.left && running.contact_modes() <= known);
        if let Some(running) = running.as_mut().filter(|running| running.sticks()) {
            running.hold_sides(self.direct.sides());
        }
        (running, &mut self.direct)
    }

    /// Write the held input and the held rate of the law's state to the frames.
    fn hold(&mut self) {
        if let (Some((tau, dz)), [_, Some(running)]) = (self.direct.held(), &mut self.running) {
            running.hold(tau, dz);
        }
    }

    /// Write the modes of the contacts to the frames.
    fn write_contacts(&mut self) {
        self.running.iter_mut().flatten().for_each(|running| running.hold_contacts(&self.modes));
    }

    /// Use the programs of an earlier run with the same structure. If there are none, make them after `wait` evaluations.
    fn take(&mut self) {
        let worth = self.work >= self.wait;
        if self.left || !worth && self.work > 0 {
            return;
        }
        let which = self.which();
        let Some(Source { rates, problem, run }) = &self.source else { return };
        let found = rates.of_run(problem, *run, worth);
        if worth || found.is_some() {
            self.source = None;
        }
        self.running[which] = found.map(|(recorded, values)| Running::new(recorded, &values));
        self.write_contacts();
        self.hold();
    }

    /// Continue without programs.
    fn leave(&mut self) {
        self.left = true;
    }
}

/// The loop of an implicit method.
pub type Solved<'a> = RatesLoop<'a, f64, Twins<'a>>;

impl<'a, S: Real, D: Watched<S>> RatesLoop<'a, S, D> {
    /// Create the loop of the one run of a problem, for a stepper. It uses programs from the start, if its code does not branch on data.
    pub fn stepped(direct: D, problem: &Problem) -> Self {
        let running = record_both(problem).map(|rates| rates.map(|(recorded, values)| Running::new(recorded, &values)));
        let mut closed = RatesLoop { running, ..RatesLoop::implicit(direct, None) };
        closed.hold();
        closed
    }
}

/// Return the loop of the one run of a problem with an implicit method, for a stepper, and the initial state.
pub fn recorded_loop(problem: &Problem) -> (Solved<'static>, Vec<f64>) {
    let (twins, x) = twins(problem, 0);
    (RatesLoop::stepped(twins.into_owned(), problem), x)
}

impl Solved<'_> {
    /// Continue at time `t`, s, from a state that the caller has set.
    pub fn replace_state(&mut self, t: f64) {
        Watched::replace_state(self, t);
    }

    /// Hold the contacts of the plant in the modes `contacts`.
    pub fn hold_contacts(&mut self, contacts: &[Touch]) {
        Watched::hold_contacts(self, contacts);
    }

    /// Return memory for the exogenous input at one instant.
    pub fn instant(&self) -> Exogenous<f64> {
        self.direct.system.instant()
    }

    /// The number of leading states whose error is controlled.
    pub fn controlled(&self) -> usize {
        self.direct.system.controlled()
    }

    /// Return the times before `t_end` at which the sampler takes samples and at which their outputs act, s. Empty without a sampler.
    pub fn instants(&self, t_end: f64) -> Vec<f64> {
        self.direct.system.instants(t_end)
    }
}

impl<S: Real, D: Watched<S>> System<S> for RatesLoop<'_, S, D> {
    type Input = Exogenous<S>;

    fn input(&mut self, t: f64, u: &mut Exogenous<S>) {
        self.direct.input(t, u);
    }
    fn rhs(&mut self, u: &Exogenous<S>, x: &[S], dx: &mut [S]) {
        self.take();
        if let (Some(running), _) = self.parts() {
            if running.rates(u, x, dx) {
                return;
            }
            self.leave();
        }
        self.work += 1;
        self.direct.rhs(u, x, dx);
    }
    fn attempt<C: Scheme, B: Buffer<S>>(&mut self, attempt: &mut Attempt<S, B>) -> bool {
        let (Some(running), direct) = self.parts() else { return false };
        match running.attempt(attempt, |t, u| direct.input(t, u)) {
            Some(true) => true,
            Some(false) => {
                self.leave();
                false
            }
            None => false,
        }
    }
    fn chatter_budget(&self) -> u64 {
        self.direct.chatter_budget()
    }
    fn sample(&mut self, t: f64, x: &[S]) {
        self.direct.sample(t, x);
        self.hold();
    }
    fn enter_step(&mut self, t: f64, x: &[S]) -> bool {
        let (running, direct) = self.parts();
        let stays = running.is_some_and(|running| running.stays(x, |u| direct.input(t, u)));
        !stays && self.direct.enter_step(t, x)
    }
    fn leave_step(&mut self, x: &mut [S]) -> bool {
        self.direct.leave_step(x)
    }
    fn still(&mut self, x: &mut [S]) {
        self.direct.still(x);
    }
    fn sides(&mut self) -> &[i8] {
        self.direct.sides()
    }
    fn held(&self) -> Option<(&[S], &[S])> {
        self.direct.held()
    }
    fn rate_of(&self, i: usize) -> Option<usize> {
        self.direct.rate_of(i)
    }
    fn pairs(&self) -> Pairs {
        self.direct.pairs()
    }
}

impl<S: Real, D: Watched<S>> Watched<S> for RatesLoop<'_, S, D> {
    fn input_at(&mut self, t: f64, x: &[S]) -> &[S] {
        self.direct.input_at(t, x)
    }
    fn drive(&mut self, tau: Option<&[S]>, held: bool) {
        self.direct.drive(tau, held);
        self.hold();
    }
    fn rewind(&mut self) {
        self.direct.rewind();
    }
    fn undo_step(&mut self, t: f64, sides: &[i8]) {
        self.left = false;
        self.direct.undo_step(t, sides);
    }
    fn replace_state(&mut self, t: f64) {
        self.left = false;
        self.direct.replace_state(t);
    }
    fn contacts(&mut self, x: &[S], out: &mut [f64]) {
        if let (Some(running), _) = self.parts()
            && running.contacts(x, out)
        {
            return;
        }
        self.direct.contacts(x, out);
    }
    fn hold_contacts(&mut self, contacts: &[Touch]) {
        self.modes.clear();
        self.modes.extend(contacts.iter().flat_map(|touch| touch.numbers()));
        self.write_contacts();
        self.direct.hold_contacts(contacts);
    }
    fn push(&mut self, wrench: Option<&Wrench>) {
        self.direct.push(wrench);
    }
    fn settle(&mut self, t: f64, x: &[S]) {
        self.direct.settle(t, x);
    }
    fn switch_joint(&mut self, t: f64, x: &mut [S], joint: Option<usize>) {
        self.direct.switch_joint(t, x, joint);
    }
    fn margins(&mut self, t: f64, x: &[S], out: &mut [f64]) {
        if let (Some(running), direct) = self.parts()
            && running.margins(x, |u| direct.input(t, u), out)
        {
            return;
        }
        self.direct.margins(t, x, out);
    }
}

impl Differentiable<f64> for Solved<'_> {
    fn linearise(&mut self, t: f64, u: &Exogenous<f64>, x: &[f64], dx: &mut [f64], j: &mut [f64]) {
        self.take();
        if let (Some(running), direct) = self.parts() {
            if running.is_moving() {
                let [u, u_dot] = running.instants();
                direct.system.drift(t, u, u_dot);
            }
            if running.linearise(u, x, dx, j) {
                return;
            }
            self.leave();
        }
        self.direct.linearise(t, u, x, dx, j);
    }
    fn time_derivative(&mut self, t: f64, u: &Exogenous<f64>, x: &[f64], dft: &mut [f64]) {
        match self.parts() {
            (Some(running), _) => dft.copy_from_slice(running.time_derivative()),
            (None, direct) => direct.time_derivative(t, u, x, dft),
        }
    }
    fn autonomous(&self) -> bool {
        self.direct.autonomous()
    }
}
