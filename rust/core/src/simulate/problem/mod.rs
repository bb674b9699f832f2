//! A problem is a set of runs with one set of options. The folder `validation` checks it, and the folder `runs` runs it.

pub mod bound;
pub mod force;
pub mod joint_limits;
pub mod measures;
pub mod sampling;
pub mod sticking_plants;
pub mod time_scale;
pub mod times;
pub mod typed;

use crate::error::Result;
use crate::integrate::Method;
use crate::law::LawSpec;
use crate::memory;
use crate::plant::{PlantKind, PlantSpec};
use force::Force;
use measures::Measures;
use sampling::Sampling;
use times::Times;

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

    /// Return the times at which a desired motion or a force jumps, s, increasing. Errors: [`Error::Memory`](crate::error::Error::Memory).
    pub fn breaks(&self) -> Result<Vec<f64>> {
        let mut breaks: Vec<f64> = self.laws.iter().flat_map(|law| law.breaks()).collect();
        for force in &self.forces {
            memory::append(&mut breaks, force.breaks())?;
        }
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        Ok(breaks)
    }
}
