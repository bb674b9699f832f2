//! A loop that computes one step of fixed size per call. The law or the caller provides the input.

use super::stepped_programs::SteppedPrograms;
use crate::error::{Error, Result};
use crate::integrate::{FixedStep, Method, MethodKind, WithSteps};
use crate::law::Route;
use crate::simulate::adaptive::rates_loop::RatesLoop;
use crate::simulate::fixed::schedule::{after_jump, is_end};
use crate::simulate::fixed::steps::divided_step;
use crate::simulate::loops::stepped_loop::SteppedLoop;
use crate::simulate::problem::Problem;
use crate::simulate::problem::bound::Bound;
use crate::simulate::problem::force::Wrench;
use crate::simulate::problem::sampling::Sampling;
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
    /// Advance by one step. `tau`: the input of the plant, shape `(n,)`, in the unit of [`Run::tau`](crate::simulate::Run::tau). If it is `None`, the
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
    /// Undo the last step, because a function of the caller failed in it, and continue from the state before it.
    fn undo(&mut self);
    /// Whether [`Stepping::resume`] can reproduce the bits of the next steps. Between two samples, state and input may be insufficient.
    fn resumable(&self) -> bool;
    /// Continue after `steps` steps from the state `x`, shape `(states + p,)`, and the input `tau`, shape `(n,)`, of [`Stepping::read`].
    /// `diverged`: whether the last step diverged.
    fn resume(&mut self, steps: u64, x: &[f64], tau: &[f64], diverged: bool);
}

/// A loop with its method and its state.
struct Stepper<F, M> {
    closed: F,
    method: M,
    x: Vec<f64>,
    tau: Vec<f64>,
    dt: f64,
    /// The number of steps between two calls of the sampled controller. It is 1 if the controller does more than hold the law's output, and
    /// 0 for a law that is evaluated in every stage.
    hold: u64,
    /// Whether the law is continuous, or sampled with a controller that only holds its output.
    plain: bool,
    /// Whether `plain` is true, the law has no state, and the law is not a function of the caller.
    simple: bool,
    /// The times at which a desired motion or a force jumps, s, increasing, and the number of those passed.
    breaks: Vec<f64>,
    passed: usize,
    steps: u64,
    before: Before,
    bound: Bound,
    status: Status,
    pushed: bool,
}

/// What the last step may have changed: the state, the input, the switches, and the numbers of steps and of jumps passed.
struct Before {
    x: Vec<f64>,
    tau: Vec<f64>,
    sides: Vec<i8>,
    steps: u64,
    passed: usize,
    /// Whether the caller gave the input of the step.
    driven: bool,
}

impl<F: SteppedLoop, M: FixedStep<f64, F, Vec<f64>>> Stepper<F, M> {
    /// The number of jumps that a stepper has passed at time `t`, s.
    fn jumps_until(&self, t: f64) -> usize {
        self.breaks.partition_point(|&jump| jump <= t || t > 0.0 && is_end(self.dt, jump, t))
    }

    fn time(&self) -> f64 {
        self.steps as f64 * self.dt
    }

    /// Restore the state, the input and the times before the last step.
    fn go_back(&mut self) {
        self.x.copy_from_slice(&self.before.x);
        self.tau.copy_from_slice(&self.before.tau);
        (self.steps, self.passed) = (self.before.steps, self.before.passed);
        self.method.restart();
    }

    fn restore(&mut self) {
        self.go_back();
        if self.before.driven {
            self.closed.drive(Some(&self.tau), false);
        }
        let t = after_jump(&self.breaks[..self.passed], self.time());
        self.closed.undo_step(t, &self.before.sides);
    }

    /// Compute a step with the law's input or the input `given`.
    fn advance(&mut self, given: Option<&[f64]>) {
        let (start, end) = (self.time(), (self.steps + 1) as f64 * self.dt);
        let t = after_jump(&self.breaks[..self.passed], start);
        self.closed.drive(given, self.hold != 0);
        if given.is_some() || self.hold == 0 {
            self.tau.copy_from_slice(self.closed.input_at(t, &self.x));
        }
        let is_smooth = t == start && self.breaks.get(self.passed).is_none_or(|&jump| jump > end && !is_end(self.dt, jump, end));
        if is_smooth && given.is_none() && self.method.stride(&mut self.closed, self.steps as usize, 1, self.dt, &mut self.x) {
            if self.hold != 0 {
                self.tau.copy_from_slice(self.closed.input_at(t, &self.x));
            }
            return;
        }
        if given.is_none() && self.hold != 0 {
            if self.steps.is_multiple_of(self.hold) {
                self.closed.sample(t, &self.x);
                self.method.restart();
            }
            self.tau.copy_from_slice(self.closed.input_at(t, &self.x));
        }
        let jumps = (self.breaks.as_slice(), self.dt, &mut self.passed);
        divided_step(&mut self.closed, &mut self.method, jumps, (start, self.dt, end), &mut self.x);
    }
}

impl<F: SteppedLoop + Send, M: FixedStep<f64, F, Vec<f64>> + Send> Stepping for Stepper<F, M> {
    fn step(&mut self, tau: Option<&[f64]>, push: Option<&Wrench>) -> Status {
        if self.status != Status::Success {
            return self.status;
        }
        self.before.x.copy_from_slice(&self.x);
        self.before.tau.copy_from_slice(&self.tau);
        self.before.sides.copy_from_slice(self.closed.sides());
        (self.before.steps, self.before.passed, self.before.driven) = (self.steps, self.passed, tau.is_some());
        if push.is_some() || self.pushed {
            // The force jumps, so that the method must not use values of the previous step.
            self.closed.push(push);
            self.method.restart();
            self.pushed = push.is_some();
        }
        self.closed.begin_step();
        self.advance(tau);
        if self.closed.declines() {
            self.go_back();
            self.advance(tau);
        }
        if self.bound.holds(&self.x) {
            self.steps += 1;
        } else {
            self.restore();
            self.status = Status::Diverged;
        }
        self.status
    }

    fn read(&self, x: &mut [f64], tau: &mut [f64]) {
        x.copy_from_slice(&self.x);
        tau.copy_from_slice(&self.tau);
    }

    fn reset(&mut self, x: &[f64]) {
        self.put(x);
        self.tau.fill(0.0);
        (self.steps, self.passed) = (0, self.jumps_until(0.0));
        self.closed.rewind();
    }

    fn undo(&mut self) {
        self.restore();
        self.status = Status::Success;
    }

    fn put(&mut self, x: &[f64]) {
        self.x.copy_from_slice(x);
        self.method.restart();
        self.closed.replace_state(after_jump(&self.breaks[..self.passed], self.time()));
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
        self.tau.copy_from_slice(tau);
        self.closed.drive(Some(&self.tau), false);
        self.steps = steps;
        self.passed = self.jumps_until(self.time());
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
    let boxed = Boxed(problem, problem.breaks()?);
    if let Some((programs, x)) = SteppedPrograms::of(problem) {
        let method = programs.method();
        return Ok(boxed.with(programs, x, method));
    }
    let (closed, x) = RatesLoop::stepped(problem);
    let u = closed.instant();
    match o.method.kind() {
        MethodKind::ExplicitSteps(method) => method.apply(closed, x, u, boxed),
        MethodKind::ImplicitSteps(method) => Ok(method.apply(closed, x, u, boxed)),
        MethodKind::ExplicitAdaptive(_) | MethodKind::ImplicitAdaptive(_) => unreachable!("refused above"),
    }
}

/// Creates a stepper for any method of fixed steps, from the problem and the jumps of its input.
struct Boxed<'a>(&'a Problem<'a>, Vec<f64>);

impl<F: SteppedLoop + Send + 'static> WithSteps<f64, F> for Boxed<'_> {
    type Output = Box<dyn Stepping>;

    fn with<M: FixedStep<f64, F, Vec<f64>> + Send + 'static>(self, closed: F, x: Vec<f64>, method: M) -> Box<dyn Stepping> {
        let Boxed(problem, breaks) = self;
        let o = &problem.options;
        let bound = Bound::new(problem.plant(0).states(), o.state_limit);
        let status = if bound.holds(&x) { Status::Success } else { Status::Diverged };
        let hold =
            o.sampling.as_ref().map_or(0, |sampling| if sampling.is_plain() { (sampling.period / o.grid()).round() as u64 } else { 1 });
        let tau = vec![0.0; problem.plant(0).n()];
        let plain = o.sampling.as_ref().is_none_or(Sampling::is_plain);
        let simple = plain && problem.law(0).initial_state().is_empty() && problem.law(0).route() != Route::Outside;
        let sides = closed.sides().to_vec();
        let passed = breaks.partition_point(|&jump| jump <= 0.0);
        Box::new(Stepper {
            before: Before { x: x.clone(), tau: tau.clone(), sides, steps: 0, passed, driven: false },
            closed,
            method,
            breaks,
            passed,
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
}
