//! An external law: a function that the caller supplies. It is a function of time and measured state, and is evaluated at samples.

use super::definition::{Definition, Route, Shape};
use super::equations::{Answer, Equations, Loop};
use crate::dynamics::Model;
use crate::motion::Motion;
use crate::plant::{Parameters, PlantKind};
use crate::trace::expression::{constant, zeros};
use std::sync::Arc;

/// The function `call(t, x, tau)` of the time `t`, s, and the plant's state `x`. It writes the plant's input `tau`, `(n,)`. Its result is
/// `false` if it fails, which ends the run.
pub type Call = Arc<dyn Fn(f64, &[f64], &mut [f64]) -> bool + Send + Sync>;

/// A law that is a function of the caller.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use nalgebra::dvector;
/// # use std::sync::Arc;
/// use armlet_core::law::{ExternalSpec, LawSpec};
/// use armlet_core::plant::PlantKind;
/// # use armlet_core::plant::{PlantSpec, RigidSpec};
/// # use armlet_core::simulate::{Options, Problem, Sampling};
///
/// // An arm of 2 kg m^2 without gravity. The torque is 2 N m up to 0.5 s, then zero.
/// let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// let call = Arc::new(|t: f64, _x: &[f64], tau: &mut [f64]| {
///     tau[0] = if t < 0.495 { 2.0 } else { 0.0 };
///     true
/// });
/// let law = LawSpec::from(ExternalSpec { model: model.clone(), plant: PlantKind::Rigid, call });
/// let plant = PlantSpec::from(RigidSpec::new(model));
/// let options = Options { sampling: Some(Sampling::every(0.01)), ..Options::fixed(1.0, 0.01) };
/// let run = Problem::from_rest(&plant, &law, &dvector![0.0], options)?.run()?;
/// assert!((run.velocities()[100] - 0.5).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone)]
pub struct ExternalSpec {
    /// The model of the arm.
    pub model: Model,
    /// The kind of plant that the law controls.
    pub plant: PlantKind,
    /// The function of the caller.
    pub call: Call,
}

impl std::fmt::Debug for ExternalSpec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ExternalSpec({:?}, {:?})", self.model, self.plant)
    }
}

impl PartialEq for ExternalSpec {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.call, &other.call)
    }
}

impl ExternalSpec {
    /// A placeholder law, for a problem whose inputs all come from the caller.
    pub fn idle(model: &Model, plant: PlantKind) -> Self {
        ExternalSpec { model: model.clone(), plant, call: Arc::new(|_, _, _| false) }
    }

    /// Compute the plant's input `tau`, `(n,)`, at time `t`, s, and the plant's state `x`. It is NaN if the function fails.
    pub(crate) fn evaluate(&self, t: f64, x: &[f64], tau: &mut [f64]) {
        if !(self.call)(t, x, tau) {
            tau.fill(f64::NAN);
        }
    }
}

impl Definition for ExternalSpec {
    fn name(&self) -> &'static str {
        "PythonLaw"
    }
    fn plant(&self) -> PlantKind {
        self.plant
    }
    fn model(&self) -> &Model {
        &self.model
    }
    fn motions(&self) -> Vec<&Motion> {
        Vec::new()
    }
    fn route(&self) -> Route {
        Route::Outside
    }
}

impl Shape for ExternalSpec {}

impl Equations for ExternalSpec {
    fn parameters(&self, _: Option<f64>) -> Parameters {
        Parameters::default()
    }

    /// The input is held, and the loop sets it at the samples.
    fn equations(&self, _: &Loop) -> Answer {
        Answer::new(zeros(self.model.n()).map(|_| constant(f64::NAN)))
    }
}
