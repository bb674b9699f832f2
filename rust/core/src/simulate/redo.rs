//! A program declines a step if its results are not valid. Such a step is computed again without the program.
//!
//! Some laws determine the numerical ranks of the projected Jacobians of their tasks. Their programs contain only the algorithm for tasks
//! that are not near a singularity. This algorithm reports whether its result is valid. A declined step is repeated with all algorithms of
//! the solver, from the state before the step. So the bits of a run depend only on this run.

use super::assembly::assemble;
use super::closed_loop::ClosedLoop;
use super::layout::Layout;
use super::log::MOST_LANES;
use super::monitors::Monitors;
use super::problem::Problem;
use crate::integrate::{Advance, MethodKind, System, WithExplicitSteps};
use crate::scalar::Real;

/// One run on plain numbers, without programs.
pub trait Direct {
    /// Compute the law's results at time `t`, s, and state `x`: the plant's input `tau`, and the rate `dz` of the law's state.
    fn answer(&mut self, t: f64, x: &[f64], tau: &mut [f64], dz: &mut [f64]);
    /// Advance `x` by the step `[t, end]` of size `h`. `held`: the held input and the held rate of the law's state, if the law is sampled.
    fn step(&mut self, t: f64, h: f64, end: f64, held: Option<(&[f64], &[f64])>, x: &mut [f64]);
    /// Compute the norms of priority levels at time `t` and state `x`.
    fn norms(&mut self, t: f64, x: &[f64], out: &mut [f64]);
}

/// Return run `run` of a problem without programs. `norms`: whether the records of the run include the norms of priority levels.
pub fn direct<'a>(problem: &'a Problem<'a>, run: usize, norms: bool) -> Box<dyn Direct + 'a> {
    let closed = assemble::<f64>(problem, run, problem.watches_storage());
    let (x, u) = (vec![0.0; closed.size()], closed.instant());
    let MethodKind::ExplicitSteps(method) = problem.options.method.kind() else { unreachable!("only explicit steps are recorded") };
    match method.apply(closed, x, u, RepeatedSteps { problem, run, norms }) {
        Ok(steps) => steps,
        Err(_) => unreachable!("plants without velocities were refused"),
    }
}

/// Creates a run without programs, for any explicit method of fixed steps.
struct RepeatedSteps<'a> {
    problem: &'a Problem<'a>,
    run: usize,
    norms: bool,
}

impl<'a> WithExplicitSteps<f64, ClosedLoop<'a, f64>> for RepeatedSteps<'a> {
    type Output = Box<dyn Direct + 'a>;

    fn with_explicit<M: Advance<f64, ClosedLoop<'a, f64>, Vec<f64>> + 'static>(
        self,
        closed: ClosedLoop<'a, f64>,
        x: Vec<f64>,
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
    pub(super) direct: Vec<Box<dyn Direct + 'a>>,
    /// The state before a step that may be declined.
    pub(super) before: Vec<S>,
    /// The largest angle of each lane before this step, rad.
    pub(super) reach: [f64; MOST_LANES],
    /// Memory for one lane: the state, the plant's input, and the rate of the law's state.
    pub(super) row: (Vec<f64>, Vec<f64>, Vec<f64>),
    /// Memory for the norms of priority levels of one lane.
    pub(super) norms: Vec<f64>,
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
