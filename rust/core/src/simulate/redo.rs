//! A program declines a step if its results are not valid. Such a step is computed again without the program.
//!
//! Programs of a law that decides ranks contain only the algorithm for regular stacks of tasks. This algorithm reports whether its result
//! is valid. A declined step is repeated with all algorithms of the solver, from the state before the step. So the bits of a run depend
//! only on this run.

use super::assembly::assemble;
use super::closed_loop::ClosedLoop;
use super::layout::Layout;
use super::log::MOST_LANES;
use super::monitors::Monitors;
use super::problem::Problem;
use super::program_loop::ProgramLoop;
use crate::integrate::{Advance, MethodKind, System, WithExplicitSteps};
use crate::scalar::{Float, Real};

/// One run on plain numbers, without programs.
pub trait Direct {
    /// Compute the law's results at time `t`, s, and state `x`: the plant's input `tau`, and the rate `dz` of the law's state.
    fn answer(&mut self, t: f64, x: &[f64], tau: &mut [f64], dz: &mut [f64]);
    /// Advance `x` by the step `[t, end]` of size `h`. `held`: the held input and rate of the law, if the law is sampled.
    fn step(&mut self, t: f64, h: f64, end: f64, held: Option<(&[f64], &[f64])>, x: &mut [f64]);
    /// Compute the norms of levels at time `t` and state `x`.
    fn norms(&mut self, t: f64, x: &[f64], out: &mut [f64]);
}

/// Return run `run` of a problem without programs. `norms`: whether records have the norms of its levels.
pub fn direct<'a>(problem: &'a Problem<'a>, run: usize, norms: bool) -> Box<dyn Direct + 'a> {
    let closed = assemble::<Float>(problem, |_| run, problem.watches_storage());
    let (x, u) = (vec![Float(0.0); closed.size()], closed.instant());
    let MethodKind::ExplicitSteps(method) = problem.options.method.kind() else { unreachable!("only explicit steps are recorded") };
    match method.apply(closed, x, u, RepeatedSteps { problem, run, norms }) {
        Ok(steps) => steps,
        Err(_) => unreachable!("plants without velocities were refused"),
    }
}

/// Creates the repeated steps for any method.
struct RepeatedSteps<'a> {
    problem: &'a Problem<'a>,
    run: usize,
    norms: bool,
}

impl<'a> WithExplicitSteps<Float, ClosedLoop<'a, Float>> for RepeatedSteps<'a> {
    type Output = Box<dyn Direct + 'a>;

    fn with_explicit<M: Advance<Float, ClosedLoop<'a, Float>, Vec<Float>> + 'static>(
        self,
        closed: ClosedLoop<'a, Float>,
        x: Vec<Float>,
        method: M,
    ) -> Box<dyn Direct + 'a> {
        let monitor = self.norms.then(|| Monitors::new(self.problem, self.run));
        let (tau, dz) = (closed.tau.clone(), closed.law_rate().to_vec());
        Box::new(DirectSteps { monitor, closed, method, x, tau, dz })
    }
}

struct DirectSteps<'a, S: Real, M> {
    monitor: Option<Monitors<'a>>,
    closed: ClosedLoop<'a, S>,
    method: M,
    x: Vec<S>,
    tau: Vec<S>,
    dz: Vec<S>,
}

fn load<S: Real>(to: &mut [S], from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(to, &from)| *to = S::splat(from));
}

fn store<S: Real>(to: &mut [f64], from: &[S]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = from.lane(0));
}

impl<'a, S: Real, M: Advance<S, ClosedLoop<'a, S>, Vec<S>>> Direct for DirectSteps<'a, S, M> {
    fn answer(&mut self, t: f64, x: &[f64], tau: &mut [f64], dz: &mut [f64]) {
        load(&mut self.x, x);
        self.closed.observe(t, &self.x);
        store(tau, &self.closed.tau);
        store(dz, self.closed.law_rate());
    }

    fn step(&mut self, t: f64, h: f64, end: f64, held: Option<(&[f64], &[f64])>, x: &mut [f64]) {
        load(&mut self.x, x);
        if let Some((tau, dz)) = held {
            load(&mut self.tau, tau);
            load(&mut self.dz, dz);
            self.closed.hold_input(&self.tau, &self.dz);
        }
        self.closed.enter_step(t, &self.x);
        self.method.advance_anew(&mut self.closed, t, h, end, &mut self.x);
        self.closed.leave_step(&mut self.x);
        store(x, &self.x);
    }

    fn norms(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        match &mut self.monitor {
            Some(monitor) => monitor.evaluate_norms(t, x, out),
            None => unreachable!("made without norms"),
        }
    }
}

/// The loops without programs that repeat declined steps, with their memory.
pub struct Redo<'a, S> {
    /// One loop for each lane. The list is empty if the programs decline no step.
    direct: Vec<Box<dyn Direct + 'a>>,
    /// The state before a step that may be declined.
    before: Vec<S>,
    /// The largest angle of each lane before this step, rad.
    reach: [f64; MOST_LANES],
    /// Memory for one lane: the state, the plant's input, and the rate of the law's state.
    row: (Vec<f64>, Vec<f64>, Vec<f64>),
    /// Memory for the norms of levels of one lane.
    norms: Vec<f64>,
}

impl<S: Real> Redo<'_, S> {
    /// Return an instance without loops.
    pub fn new(layout: &Layout) -> Self {
        let row = (vec![0.0; layout.states], vec![0.0; layout.inputs], vec![0.0; layout.answer]);
        Redo {
            direct: Vec::new(),
            before: vec![S::zero(); layout.carried()],
            reach: [0.0; MOST_LANES],
            row,
            norms: vec![0.0; layout.norms],
        }
    }

    pub fn is_empty(&self) -> bool {
        self.direct.is_empty()
    }

    pub fn before(&self) -> &[S] {
        &self.before
    }
}

impl<'a, S: Real> ProgramLoop<'a, S> {
    /// Set the loops that repeat declined steps, one per lane.
    pub(super) fn redo_by(&mut self, direct: Vec<Box<dyn Direct + 'a>>) {
        self.redo.direct = direct;
    }

    /// Store the state before a step that may be declined.
    pub(super) fn remember(&mut self, x: &[S]) {
        if self.redo.direct.is_empty() {
            return;
        }
        self.redo.before.copy_from_slice(x);
        for lane in 0..S::LANES {
            self.redo.reach[lane] = self.number(self.recorded.layout.reach(), lane);
            self.set_number(self.recorded.layout.stands(), lane, 1.0);
        }
    }

    /// Whether the programs declined the step of a lane. A state that is NaN is never declined.
    pub(super) fn declined(&self, lane: usize) -> bool {
        !self.redo.direct.is_empty()
            && self.number(self.recorded.layout.stands(), lane) != 1.0
            && self.redo.before.iter().all(|x| x.lane(lane).is_finite())
    }

    /// Restore two quantities of the lane from before the step: its state, and the largest angle of its run.
    pub(super) fn back(&mut self, lane: usize) {
        self.redo.row.0.iter_mut().zip(&self.redo.before).for_each(|(to, from)| *to = from.lane(lane));
        self.set_number(self.recorded.layout.reach(), lane, self.redo.reach[lane]);
    }

    /// Repeat the step `[t, end]` of size `h` in the lanes in which it was declined.
    pub(super) fn step_again(&mut self, t: f64, h: f64, end: f64, x: &mut [S]) {
        for lane in 0..S::LANES {
            if !self.declined(lane) {
                continue;
            }
            self.back(lane);
            let (state, tau, dz) = &mut self.redo.row;
            tau.iter_mut().zip(&self.tau).for_each(|(to, from)| *to = from.lane(lane));
            dz.iter_mut().zip(&self.dz).for_each(|(to, from)| *to = from.lane(lane));
            self.redo.direct[lane].step(t, h, end, self.held.then_some((&*tau, &*dz)), state);
            for (x, &new) in x.iter_mut().zip(&self.redo.row.0) {
                let others = *x;
                *x = S::from_lanes(|i| if i == lane { new } else { others.lane(i) });
            }
        }
    }

    /// Compute the norms of levels at state `x` again in lanes whose record is not valid. A state that is NaN is ignored.
    pub(super) fn norms_again(&mut self, t: f64, x: &[S]) {
        let (stands, first) = (self.recorded.layout.noted_stands(), self.recorded.layout.own_firsts() - self.redo.norms.len());
        let lanes = if self.redo.norms.is_empty() { 0 } else { S::LANES };
        for lane in 0..lanes {
            if self.number(stands, lane) == 1.0 || !x.iter().all(|x| x.lane(lane).is_finite()) {
                continue;
            }
            let (state, norms) = (&mut self.redo.row.0, &mut self.redo.norms);
            state.iter_mut().zip(x).for_each(|(to, from)| *to = from.lane(lane));
            self.redo.direct[lane].norms(t, state, norms);
            for k in 0..self.redo.norms.len() {
                self.set_number(first + k, lane, self.redo.norms[k]);
            }
        }
    }

    /// Evaluate the law again in the lanes in which the program declined its result.
    pub(super) fn answer_again(&mut self, t: f64) {
        let (first, rate) = (self.recorded.layout.tau(), self.recorded.layout.law_rate());
        for lane in 0..S::LANES {
            if !self.declined(lane) {
                continue;
            }
            self.back(lane);
            let (state, tau, dz) = &mut self.redo.row;
            self.redo.direct[lane].answer(t, state, tau, dz);
            for k in 0..self.redo.row.1.len() {
                self.set_number(first + k, lane, self.redo.row.1[k]);
            }
            for k in 0..self.redo.row.2.len() {
                self.set_number(rate + k, lane, self.redo.row.2[k]);
            }
        }
    }
}
