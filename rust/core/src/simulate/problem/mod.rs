//! A problem is a set of runs with one set of options. This file also validates it.

pub mod bound;
pub mod force;
pub mod joint_limits;
pub mod same_structure;
pub mod sticking_plants;
pub mod time_scale;
pub mod timed_functions;
pub mod typed;

use crate::dynamics::Model;
use crate::error::{Error, Result, finite, positive};
use crate::integrate::Method;
use crate::law::{LawSpec, Route};
use crate::memory;
use crate::plant::{PlantKind, PlantSpec};
use crate::simulate::adaptive::segments::{Clock, Outcome, Segments};
use crate::simulate::fixed::schedule::{Schedule, Times};
use crate::simulate::fixed::steps::Faults;
use crate::simulate::metrics::options::Measures;
use crate::simulate::sampled::sampling::Sampling;
use bound::Bound;
use force::Force;

/// The options of a run.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Method, Options, Problem};
///
/// // The joint oscillates with q = cos t.
/// let tight = Options { method: Method::Dop853, rtol: 1e-12, atol: 1e-12, ..Options::adaptive(1.0) };
/// for (options, error) in [(Options::fixed(1.0, 0.1), 1e-5), (tight, 1e-10)] {
///     let run = Problem::from_rest(&plant, &law, &dvector![1.0], options)?.run()?;
///     assert!((run.q[run.q.len() - 1] - 1f64.cos()).abs() < error);
/// }
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Options {
    /// End time of the run, s. The run starts at time 0.
    pub t_end: f64,
    /// Step size of a fixed-step method, s. `None` means the sample period.
    pub dt: Option<f64>,
    /// The integration method.
    pub method: Method,
    /// Relative tolerance of an adaptive method, dimensionless.
    pub rtol: f64,
    /// Absolute tolerance of an adaptive method, in the units of the state.
    pub atol: f64,
    /// Largest step of an adaptive method, s. `None` and infinity mean no limit. With infinity, a force that is a function of time does not
    /// limit the steps either.
    pub max_step: Option<f64>,
    /// `None`: the law is evaluated in every stage. Otherwise it is evaluated at samples, and its output is held.
    pub sampling: Option<Sampling>,
    /// The times of the records.
    pub times: Times,
    /// The saturation of the input: the largest `|tau|` per joint, shape `(n,)`, in the unit of [`Run::tau`](crate::simulate::Run::tau).
    pub tau_max: Option<Vec<f64>>,
    /// Whether to compute and record the monitors, such as the energy balance.
    pub monitors: bool,
    /// A run ends if the magnitude of a state of the plant exceeds this limit. The states are positions (rad, m), velocities (rad/s, m/s)
    /// and bristle deflections (rad, m). Infinity means no limit.
    pub state_limit: f64,
}

impl Options {
    /// The step size of a fixed-step method, s. It is zero for an adaptive method.
    pub fn grid(&self) -> f64 {
        if self.method.is_adaptive() { 0.0 } else { self.dt.or(self.sampling.as_ref().map(|s| s.period)).unwrap_or(0.0) }
    }
}

/// Runs with the same options. They differ in their initial states, and may differ in plants, laws and forces.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Problem};
///
/// let mut problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::fixed(0.1, 0.01))?;
/// assert_eq!((problem.runs(), problem.run()?.t.len()), (1, 11));
/// // Each row of `x0` is the initial state of one run.
/// problem.x0 = vec![1.0, 0.0, 2.0, 0.0];
/// assert_eq!(problem.runs(), 2);
/// // A step must be positive.
/// problem.options.dt = Some(-0.01);
/// assert!(problem.validate().is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    /// The plants: one for all runs, or one per run.
    pub plants: Vec<&'a PlantSpec>,
    /// The laws: one for all runs, or one per run.
    pub laws: Vec<&'a LawSpec>,
    /// Initial states of the plants, shape `(B, states)`, row-major.
    pub x0: Vec<f64>,
    /// The external forces: none, one for all runs, or one per run.
    pub forces: Vec<&'a Force>,
    /// The frame at which a force acts. `None` means the frame of the law.
    pub force_frame: Option<usize>,
    /// The options of all runs.
    pub options: Options,
    /// The metrics that are computed during the runs, if any.
    pub measures: Option<Measures>,
}

/// The prepared time grid of a run: fixed steps, or segments of an adaptive method.
pub enum Division {
    Fixed(Fixed),
    Adaptive(Segments),
}

/// The end of the runs of a group, for each kind of time grid.
pub enum Ended {
    Fixed(Faults),
    Adaptive(Outcome),
}

/// The time grid of a method with fixed steps.
pub struct Fixed {
    pub schedule: Schedule,
    /// The number of steps between two calls of the sampled controller. It is 1 if the controller does more than hold the law's output, and
    /// 0 without sampling.
    pub hold: usize,
}

impl<'a> Problem<'a> {
    /// The number of runs `B`.
    pub fn runs(&self) -> usize {
        self.x0.len() / self.plants[0].states()
    }

    /// The plant of run `run`.
    pub fn plant(&self, run: usize) -> &'a PlantSpec {
        self.plants[if self.plants.len() == 1 { 0 } else { run }]
    }

    /// The law of run `run`.
    pub fn law(&self, run: usize) -> &'a LawSpec {
        self.laws[if self.laws.len() == 1 { 0 } else { run }]
    }

    /// The external force of run `run`, if there is one.
    pub fn force(&self, run: usize) -> Option<&'a Force> {
        match self.forces.as_slice() {
            [] => None,
            [force] => Some(force),
            forces => Some(forces[run]),
        }
    }

    /// Whether all runs have the same desired motions and forces.
    pub fn shares_exogenous(&self) -> bool {
        let first = self.laws[0].motions();
        let same = |law: &&LawSpec| {
            let motions = law.motions();
            motions.len() == first.len() && motions.iter().zip(&first).all(|(motion, first)| motion.is_same(first))
        };
        self.forces.len() <= 1 && self.laws.iter().all(same)
    }

    /// The frame at which the forces of this problem act. `None` without forces.
    pub fn force_frame(&self) -> Option<usize> {
        if self.forces.is_empty() {
            return None;
        }
        self.force_frame.or_else(|| self.laws[0].coordinates().map(|coordinates| coordinates.frame))
    }

    /// Whether the monitored energy is the law's storage function.
    pub fn watches_storage(&self) -> bool {
        let o = &self.options;
        let runs = self.plants.len().max(self.laws.len());
        o.monitors
            && o.sampling.is_none()
            && o.tau_max.is_none()
            && (0..runs).all(|run| self.law(run).storage().is_some_and(|law| law.has_storage(self.plant(run))))
    }

    /// Whether the target model of an impedance law is monitored. This requires a law that acts at every instant, without limits. Only the
    /// law, gravity and the external force may act on the links.
    pub fn watches_target(&self) -> bool {
        let o = &self.options;
        let alone =
            |plant: &PlantSpec| plant.kind() == PlantKind::Rigid && !plant.has_friction() && plant.friction().is_none() && plant.is_free();
        let all = self.laws.iter().all(|law| law.impedance().is_some_and(|law| !law.options().have_limits()))
            && self.plants.iter().all(|plant| alone(plant));
        o.monitors && o.sampling.is_none() && o.tau_max.is_none() && all
    }

    /// Whether the projection loss of a law is monitored. This requires a law with a projector or a compensated coupling, and without a
    /// guard.
    pub fn watches_loss(&self) -> bool {
        let impedance = self.law(0).coordinates().is_some() && !matches!(self.law(0), LawSpec::Guarded(_));
        self.options.monitors && impedance && self.laws.iter().any(|law| law.has_projection_loss())
    }

    /// Refuse a law that requires a sample period if the problem has none.
    fn require_period(&self, law: &LawSpec) -> Result<()> {
        let problem = match law {
            _ if self.options.sampling.is_some() => return Ok(()),
            law if law.route() == Route::Outside => "expected the sample period of a law outside of the loop, got None".to_string(),
            law if law.switches() => format!("expected the period at which {} looks for contact, got None", law.name()),
            _ => return Ok(()),
        };
        Err(Error::input("sample_time", format!("is missing: {problem}")))
    }

    /// Refuse plants and laws that do not match.
    fn validate_pairs(&self) -> Result<()> {
        self.require_same_structure()?;
        let (plant, law) = (self.plants[0], self.laws[0]);
        if law.plant() != plant.kind() {
            let problem = format!(
                "is made for another plant: expected a law for {}, got {}, a law for {}",
                plant.kind().name(),
                law.name(),
                law.plant().name()
            );
            return Err(Error::input("law", problem));
        }
        if self.options.method == Method::SemiImplicit && !plant.kind().has_speeds() {
            let name = plant.kind().name();
            let problem = format!("needs velocities among the states: expected such as rk4 for {name}, got semi_implicit");
            return Err(Error::input("method", problem));
        }
        if let Some(law) = self.laws.iter().find(|law| law.route().is_scalar())
            && self.options.sampling.is_none()
            && self.options.method.is_implicit()
        {
            let (name, method) = (law.name(), self.options.method.name());
            let problem =
                format!("needs derivatives, which {name} has not: expected such as rk4 or dop853, or a sample_time, got {method}");
            return Err(Error::input("method", problem));
        }
        self.laws.iter().try_for_each(|law| self.require_period(law))?;
        if !self.forces.is_empty() {
            if !plant.kind().has_speeds() {
                let problem = format!("takes effect only on a plant whose input is a torque: expected None for {}", plant.kind().name());
                return Err(Error::input("force", problem));
            }
            let Model::Tree(arm) = plant.model() else {
                return Err(Error::input("force", "has no frame to act at: expected a plant with links, got planar_pr"));
            };
            match self.force_frame() {
                None => {
                    return Err(Error::input(
                        "force_frame",
                        format!("is missing: expected a frame for the force, since {} has none", law.name()),
                    ));
                }
                Some(frame) if frame >= arm.frames.len() => {
                    return Err(Error::input("force_frame", format!("is out of range: expected below {}, got {frame}", arm.frames.len())));
                }
                Some(frame) => self.require_same_force_frame(frame)?,
            }
        }
        Ok(())
    }

    /// Refuse arms that are too large for the memory, before the workspaces of `at_once` runs are allocated. Errors: [`Error::Memory`].
    pub fn require_memory(&self, at_once: usize) -> Result<()> {
        // Estimates of the memory of one run: the number of matrices of the dynamics and the law, of Jacobians with their decompositions,
        // and of vectors.
        const MATRICES: usize = 6;
        const JACOBIANS: usize = 8;
        const VECTORS: usize = 64;
        let (n, states) = (self.plants[0].n(), self.plants[0].states() + self.laws[0].initial_state().len());
        let jacobians = if self.options.method.is_implicit() { JACOBIANS * states * states } else { 0 };
        memory::require((MATRICES * n * n + jacobians + VECTORS * states).saturating_mul(8 * at_once))
    }

    /// Refuse a loop that is invalid regardless of its times and its initial state.
    pub(in crate::simulate) fn validate_loop(&self) -> Result<()> {
        let o = &self.options;
        self.validate_pairs()?;
        let limit = o.tau_max.as_deref().unwrap_or_default();
        let n = self.plants[0].n();
        if o.tau_max.is_some() && limit.len() != n {
            return Err(Error::wrong("tau_max", "length", n, limit.len()));
        }
        if let Some(i) = limit.iter().position(|&x| !(x > 0.0)) {
            let error = Error::input("tau_max", format!("is not positive: expected > 0, got {}", limit[i])).at([i]);
            return Err(self.plants[0].model().name_limit(error));
        }
        if let Some(sampling) = &o.sampling {
            sampling.validate()?;
            self.validate_motor_loops(sampling.period)?;
            self.validate_sensors(sampling)?;
        }
        Ok(())
    }

    /// Return the times at which a desired motion or a force jumps, s, increasing. Errors: [`Error::Memory`].
    pub fn breaks(&self) -> Result<Vec<f64>> {
        let mut breaks: Vec<f64> = self.laws.iter().flat_map(|law| law.breaks()).collect();
        for force in &self.forces {
            memory::append(&mut breaks, force.breaks())?;
        }
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        Ok(breaks)
    }

    /// Validate the problem and return its time grid. Errors: [`Error::Input`] or [`Error::WrongShape`] for an invalid argument,
    /// [`Error::Memory`] if the records exceed the memory.
    pub fn validate(&self) -> Result<Division> {
        let o = &self.options;
        if !(o.t_end >= 0.0 && o.t_end.is_finite()) {
            return Err(Error::input("t_end", format!("is not a duration: expected a finite number >= 0, got {}", o.t_end)));
        }
        finite("initial state", &self.x0)?;
        self.validate_loop()?;
        if !(o.state_limit > 0.0) {
            return Err(Error::input("state_limit", format!("is not positive: expected > 0, got {}", o.state_limit)));
        }
        let bound = Bound::new(self.plants[0].states(), o.state_limit);
        let breaks = self.breaks()?;
        // Arguments that the method does not use are also checked.
        o.dt.map_or(Ok(()), |dt| positive("dt", dt))?;
        positive("rtol", o.rtol)?;
        if let Some(step) = o.max_step.filter(|step| !(*step > 0.0)) {
            return Err(Error::input("max_step", format!("is not positive: expected > 0, got {step}")));
        }
        if o.rtol < 1e-15 {
            return Err(Error::input("rtol", format!("is below what a double resolves: expected at least 1e-15, got {}", o.rtol)));
        }
        if !(o.atol >= 0.0 && o.atol.is_finite()) {
            return Err(Error::input("atol", format!("is negative or not finite: expected a number >= 0, got {}", o.atol)));
        }
        if o.method.is_adaptive() {
            if let Some(sampling) = &o.sampling {
                sampling.require_memory(o.t_end)?;
            }
            let clock = match &o.sampling {
                None => Clock::None,
                Some(sampling) if sampling.is_plain() => Clock::Every(sampling.period),
                Some(_) => Clock::Breaks,
            };
            let segments = Segments::new(o.t_end, o.times.clone(), &breaks, clock, bound)?;
            return Ok(Division::Adaptive(Segments { max_step: o.max_step.unwrap_or(f64::INFINITY), ..segments }));
        }
        let Some(dt) = o.dt.or(o.sampling.as_ref().map(|sampling| sampling.period)) else {
            return Err(Error::input("dt", "is missing: expected a step in seconds for a fixed-step method, got None"));
        };
        let schedule = Schedule::new(dt, o.t_end, &o.times, &breaks, bound)?;
        let steps = |name: &str, duration: f64, least: f64| {
            let ratio = duration / dt;
            if ratio.round() < least || (ratio - ratio.round()).abs() > 1e-9 * ratio.max(1.0) {
                return Err(Error::input(name, format!("is not a multiple of dt: expected k * {dt}, got {duration}")));
            }
            Ok(ratio.round() as usize)
        };
        let hold = match &o.sampling {
            None => 0,
            Some(sampling) => {
                let period = steps("sample_time", sampling.period, 1.0)?;
                steps("delay", sampling.delay, 0.0)?;
                // A controller that does more than hold the law's output, such as delay it, is called at every step.
                if sampling.is_plain() { period } else { 1 }
            }
        };
        Ok(Division::Fixed(Fixed { schedule, hold }))
    }
}
