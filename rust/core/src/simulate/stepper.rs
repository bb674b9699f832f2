//! A loop that computes one step of fixed size per call. The law or the caller provides the input.

use super::assembly::{Watched, close};
use super::bound::Bound;
use super::force::Wrench;
use super::problem::Problem;
use super::rates_loop::{RatesLoop, recorded_loop};
use super::sampling::Sampling;
use crate::error::{Error, Result};
use crate::integrate::{FixedStep, Method, MethodKind, WithSteps};
use crate::law::Route;
use crate::scalar::{Float, Real};
use crate::status::Status;

/// A loop with one step per call, for every number type.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}, status::Status};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Problem, stepper};
///
/// // The joint oscillates with q = cos t.
/// let options = Options { monitors: false, ..Options::fixed(1.0, 0.01) };
/// let mut stepping = stepper(&Problem::from_rest(&plant, &law, &dvector![1.0], options)?)?;
/// for _ in 0..100 {
///     assert_eq!(stepping.step(None, None), Status::Success);
/// }
/// let (mut x, mut tau) = ([0.0; 2], [0.0]);
/// stepping.read(&mut x, &mut tau);
/// assert!(stepping.steps() == 100 && (x[0] - 1f64.cos()).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub trait Stepping: Send {
    /// Advance by one step. `tau`: the input of the plant, shape `(n,)`, in the unit of [`Run::tau`](super::Run::tau). If it is `None`, the
    /// law computes the input. `push`: a wrench that replaces the force of the problem. A step that diverges changes neither state nor
    /// input. All later steps then have the same status, until the caller sets a new state.
    fn step(&mut self, tau: Option<&[f64]>, push: Option<&Wrench>) -> Status;
    /// Write the states of the plant and of the law to `x`, shape `(states + p,)`. Write the saturated input of the last step to `tau`,
    /// shape `(n,)`.
    fn read(&self, x: &mut [f64], tau: &mut [f64]);
    /// Restart at `t = 0` from `x`, the states of plant and law, shape `(states + p,)`.
    fn reset(&mut self, x: &[f64]);
    /// Continue at the present time from `x`, the states of plant and law, shape `(states + p,)`.
    fn put(&mut self, x: &[f64]);
    /// The status: `Success`, or `Diverged`.
    fn status(&self) -> Status;
    /// The number of steps since the start.
    fn steps(&self) -> u64;
    /// Whether [`Stepping::resume`] can reproduce the bits of the next steps. Between two samples, state and input may be insufficient.
    fn resumable(&self) -> bool;
    /// Continue after `steps` steps from the state `x`, shape `(states + p,)`, and the input `tau`, shape `(n,)`, of [`Stepping::read`].
    /// `diverged`: whether the last step diverged.
    fn resume(&mut self, steps: u64, x: &[f64], tau: &[f64], diverged: bool);
}

/// A loop with its method and its state.
struct Stepper<S, F, M> {
    closed: F,
    method: M,
    x: Vec<S>,
    tau: Vec<S>,
    dt: f64,
    /// The number of steps between two calls of the sampled controller. It is 1 if the controller does more than hold the law's output, and
    /// 0 for a law that is evaluated in every stage.
    hold: u64,
    /// Whether the law is continuous, or sampled with a controller that only holds its output.
    plain: bool,
    /// Whether `plain` is true, the law has no state, and the law is not a function of the caller.
    simple: bool,
    steps: u64,
    /// The state at the start of the last step, and the input of the previous step.
    before: (Vec<S>, Vec<S>),
    bound: Bound,
    status: Status,
    pushed: bool,
}

impl<S, F, M> Stepping for Stepper<S, F, M>
where
    S: Real,
    F: Watched<S> + Send,
    M: FixedStep<S, F, Vec<S>> + Send,
{
    fn step(&mut self, tau: Option<&[f64]>, push: Option<&Wrench>) -> Status {
        if self.status != Status::Success {
            return self.status;
        }
        self.before.0.copy_from_slice(&self.x);
        self.before.1.copy_from_slice(&self.tau);
        if push.is_some() || self.pushed {
            // The force jumps, so that the method must not use values of the previous step.
            self.closed.push(push);
            self.method.restart();
            self.pushed = push.is_some();
        }
        let (t, end) = (self.steps as f64 * self.dt, (self.steps + 1) as f64 * self.dt);
        match tau {
            Some(tau) => {
                for (to, &from) in self.tau.iter_mut().zip(tau) {
                    *to = S::splat(from);
                }
                self.closed.drive(Some(&self.tau), false);
            }
            None => {
                self.closed.drive(None, self.hold != 0);
                if self.hold != 0 && self.steps.is_multiple_of(self.hold) {
                    self.closed.sample(t, &self.x);
                    self.method.restart();
                }
            }
        }
        self.tau.copy_from_slice(self.closed.input_at(t, &self.x));
        if self.closed.enter_step(t, &self.x) {
            self.method.restart();
        }
        self.method.step(&mut self.closed, t, self.dt, end, &mut self.x);
        if self.closed.leave_step(&mut self.x) {
            self.method.restart();
        }
        if self.bound.holds(&self.x) {
            self.steps += 1;
        } else {
            self.x.copy_from_slice(&self.before.0);
            self.tau.copy_from_slice(&self.before.1);
            if tau.is_some() {
                self.closed.drive(Some(&self.tau), false);
            }
            self.method.restart();
            self.status = Status::Diverged;
        }
        self.status
    }

    fn read(&self, x: &mut [f64], tau: &mut [f64]) {
        for (to, from) in x.iter_mut().zip(&self.x) {
            *to = from.lane(0);
        }
        for (to, from) in tau.iter_mut().zip(&self.tau) {
            *to = from.lane(0);
        }
    }

    fn reset(&mut self, x: &[f64]) {
        self.put(x);
        self.tau.fill(S::zero());
        self.steps = 0;
        self.closed.rewind();
    }

    fn put(&mut self, x: &[f64]) {
        for (to, &from) in self.x.iter_mut().zip(x) {
            *to = S::splat(from);
        }
        self.method.restart();
        self.status = if self.bound.holds(&self.x) { Status::Success } else { Status::Diverged };
    }

    fn status(&self) -> Status {
        self.status
    }

    fn steps(&self) -> u64 {
        self.steps
    }

    fn resumable(&self) -> bool {
        self.steps == 0 || self.hold == 0 || self.simple || self.plain && self.steps.is_multiple_of(self.hold)
    }

    fn resume(&mut self, steps: u64, x: &[f64], tau: &[f64], diverged: bool) {
        self.reset(x);
        for (to, &from) in self.tau.iter_mut().zip(tau) {
            *to = S::splat(from);
        }
        self.closed.drive(Some(&self.tau), false);
        self.steps = steps;
        if diverged {
            self.status = Status::Diverged;
        }
    }
}

/// Refuse a method without fixed steps. Errors: [`Error::Input`].
pub fn require_fixed_steps(method: Method) -> Result<()> {
    if method.is_adaptive() {
        let fixed: Vec<&str> = Method::ALL.iter().filter(|method| !method.is_adaptive()).map(|method| method.name()).collect();
        let problem = format!("chooses its own steps: expected one of {}, got {}", fixed.join(", "), method.name());
        return Err(Error::input("method", problem));
    }
    Ok(())
}

/// Return the stepper of the one run of a problem. The problem must have no monitors, because their integrals would be part of the state.
/// Errors: [`Error::Input`] for an adaptive method, those of [`Problem::validate`], and [`Error::Memory`] for an arm that is too large.
pub fn stepper(problem: &Problem) -> Result<Box<dyn Stepping>> {
    let o = &problem.options;
    require_fixed_steps(o.method)?;
    problem.validate()?;
    problem.require_memory(1)?;
    match o.method.kind() {
        MethodKind::ExplicitSteps(method) => {
            let (closed, x) = close::<Float>(problem, 0);
            let u = closed.instant();
            method.apply(RatesLoop::stepped(closed.into_owned(), problem), x, u, Boxed(problem))
        }
        MethodKind::ImplicitSteps(method) => {
            let (closed, x) = recorded_loop(problem);
            let u = closed.instant();
            Ok(method.apply(closed, x, u, Boxed(problem)))
        }
        MethodKind::ExplicitAdaptive(_) | MethodKind::ImplicitAdaptive(_) => unreachable!("refused above"),
    }
}

/// Creates a stepper for any method of fixed steps.
struct Boxed<'a>(&'a Problem<'a>);

impl<S: Real, F: Watched<S> + Send + 'static> WithSteps<S, F> for Boxed<'_> {
    type Output = Box<dyn Stepping>;

    fn with<M: FixedStep<S, F, Vec<S>> + Send + 'static>(self, closed: F, x: Vec<S>, method: M) -> Box<dyn Stepping> {
        boxed(self.0, closed, x, method)
    }
}

fn boxed<S, F, M>(problem: &Problem, closed: F, x: Vec<S>, method: M) -> Box<dyn Stepping>
where
    S: Real,
    F: Watched<S> + Send + 'static,
    M: FixedStep<S, F, Vec<S>> + Send + 'static,
{
    let o = &problem.options;
    let bound = Bound::new(problem.plant(0).states(), o.state_limit);
    let status = if bound.holds(&x) { Status::Success } else { Status::Diverged };
    let hold = o.sampling.as_ref().map_or(0, |sampling| if sampling.is_plain() { (sampling.period / o.grid()).round() as u64 } else { 1 });
    let tau = vec![S::zero(); problem.plant(0).n()];
    let plain = o.sampling.as_ref().is_none_or(Sampling::is_plain);
    let simple = plain && problem.law(0).initial_state().is_empty() && problem.law(0).route() != Route::Outside;
    Box::new(Stepper::<S, F, M> {
        closed,
        method,
        before: (x.clone(), tau.clone()),
        bound,
        status,
        pushed: false,
        x,
        tau,
        dt: o.grid(),
        hold,
        plain,
        simple,
        steps: 0,
    })
}
