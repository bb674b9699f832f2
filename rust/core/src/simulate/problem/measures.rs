//! The metrics that the user requests.

/// The metrics that the user requests.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Keep, Measures, Options, Problem, simulate_batch};
///
/// // The error decays as (1 + 5 t) exp(-5 t). It enters the band of 2 % at 1.167 s.
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::fixed(3.0, 0.01))?;
/// let measures = Measures { settle: 0.02, ..Measures::default() };
/// let runs = simulate_batch(problem, Keep::Metrics(measures), 1, &mut || false)?;
/// let settling = runs.metrics.iter().find(|(name, ..)| *name == "settling_time").map(|(.., values)| values[0]);
/// assert!(settling.is_some_and(|t| (t - 1.167).abs() < 0.02));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Measures {
    /// The settling band, as a fraction of the largest error so far. The largest error is taken over all joints with the same unit.
    pub settle: f64,
    /// The settling band of each joint, shape `(n,)`, rad or m. It replaces `settle`.
    pub band: Option<Vec<f64>>,
    /// The tolerance of the monitors: relative for energy and Lyapunov function, absolute for the skewness, in the unit of `M` per second.
    pub tolerance: f64,
    /// The reference position of the joints, shape `(n,)`, rad or m. It replaces the reference of the law.
    pub reference: Option<Vec<f64>>,
    /// Name of a frame. The metric is the distance of this frame from its position at the reference position of the joints. It replaces the
    /// errors of the law's tasks.
    pub frame: Option<String>,
}

impl Default for Measures {
    fn default() -> Self {
        Measures { settle: 0.02, band: None, tolerance: 1e-6, reference: None, frame: None }
    }
}
