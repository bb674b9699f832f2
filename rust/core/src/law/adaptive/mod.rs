//! Adaptive laws: their declaration. `equations` has the law, and each option has its file.

mod adaptation;
mod composite;
mod concurrent;
mod equations;
mod joint_columns;
mod lyapunov;
mod projection;
mod regressor;
mod restraint;
mod truth;

pub use adaptation::{Adaptation, Base, Composite, Concurrent};
pub use concurrent::{Record, StoredRows, Windows};
pub use joint_columns::{JointColumn, JointColumns};
pub(crate) use lyapunov::Lyapunov;
pub use projection::Projection;
pub use restraint::{LeakageForm, Restraint};
pub use truth::Truth;

use super::definition::{Definition, JointReference, facts};
use super::sizes::{require_same_dof, require_size};
use super::terms::Term;
use crate::dynamics::{JointTerms, Model};
use crate::error::{Error, Result, finite};
use crate::linalg::Gain;
use crate::motion::Motion;

/// The adaptive law of an arm, with validated parameters.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec};
/// use armlet_core::motion::{Motion, Sinusoid};
/// use armlet_core::plant::{PlantSpec, RigidSpec};
/// use armlet_core::simulate::{Options, Problem};
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let (n, p) = (model.n(), model.parameter_count());
/// let motion = Motion::from(Sinusoid::new(vec![0.0; 2], 1, vec![0.5, 0.3], vec![2.0, 3.0], vec![0.0; 2])?);
/// let (kp, kd) = (Gain::scalar("kp", n, 50.0)?, Gain::scalar("kd", n, 10.0)?);
/// let adaptation = Adaptation::Euclidean(Gain::scalar("gamma", p, 2.0)?);
/// let law = LawSpec::from(AdaptiveSpec::new(model.clone(), motion, kp, kd, adaptation, None, None)?);
/// let plant = PlantSpec::from(RigidSpec::new(model));
/// let run = Problem::from_rest(&plant, &law, &dvector![0.0, 0.0], Options::fixed(1.0, 1e-3))?.run()?;
/// // The Lyapunov function V1 never increases.
/// let lyapunov = run.monitor("lyapunov").unwrap_or_default();
/// assert!(lyapunov.windows(2).all(|v| v[1] <= v[0] + 1e-9 * lyapunov[0]));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct AdaptiveSpec {
    pub(in crate::law) model: Model,
    /// Desired motion of the joints, `(n,)`, rad or m.
    pub motion: Motion,
    /// Position gain `Kp = Kd Lambda`, of size `n`, N m/rad or N/m.
    pub kp: Gain,
    /// Gain `Kd` of the sliding variable `s`, of size `n`, N m s/rad or N s/m.
    pub kd: Gain,
    /// Matrix `Lambda = Kd^-1 Kp` of the sliding variable, of size `n`, 1/s.
    pub lambda: Gain,
    /// The adaptation law of the estimate, with its gain.
    pub adaptation: Adaptation,
    /// The base set of parameters that is estimated; `None` if all parameters are estimated.
    pub base: Option<Base>,
    pub(super) estimate: Vec<f64>,
    /// The projection that keeps the estimate physically possible; `None` without a projection.
    pub projection: Option<Projection>,
    /// Rotor inertias and friction that are estimated. Their parameters follow the parameters of the bodies.
    pub columns: JointColumns,
    /// Leakage and dead zone of the adaptation.
    pub restraint: Restraint,
    /// Additional adaptation from the filtered dynamics.
    pub composite: Option<Composite>,
    /// Additional adaptation from stored samples.
    pub concurrent: Option<Concurrent>,
    /// The law's state at the start of a run: the estimate, then filters of zero. [`Equations::start_state`](super::Equations::start_state)
    /// sets the filters from the plant's state.
    pub(super) start: Vec<f64>,
}

impl AdaptiveSpec {
    /// Create the law. `kp` is in N m/rad or N/m, `kd` in N m s/rad or N s/m.
    ///
    /// `estimate`, `(p,)`, is the initial estimate. `None` starts from zero. The natural metric requires an estimate with physically
    /// possible bodies.
    ///
    /// Errors: `WrongShape` for a wrong size. `Input` for numbers that are not finite, or an invalid base set. In the natural metric,
    /// `Input` also for a base set, or an estimate that is not physically possible.
    pub fn new(
        model: Model,
        motion: Motion,
        kp: Gain,
        kd: Gain,
        adaptation: Adaptation,
        base: Option<Base>,
        estimate: Option<Vec<f64>>,
    ) -> Result<Self> {
        Self::with_columns(model, motion, [kp, kd], adaptation, base, JointColumns::default(), estimate)
    }

    /// Create the law with joint columns; `gains` are `[Kp, Kd]`.
    ///
    /// `estimate`, `(p,)`, has the parameters of the bodies, or of the base set, and then the parameters of the joint columns. Errors: as
    /// for [`AdaptiveSpec::new`].
    pub fn with_columns(
        model: Model,
        motion: Motion,
        [kp, kd]: [Gain; 2],
        adaptation: Adaptation,
        base: Option<Base>,
        columns: JointColumns,
        estimate: Option<Vec<f64>>,
    ) -> Result<Self> {
        let (n, all) = (model.n(), model.parameter_count());
        if let Some(base) = &base {
            base.validate(all)?;
        }
        let p = base.as_ref().map_or(all, |base| base.columns.len()) + columns.count();
        require_same_dof(n, &motion)?;
        require_size("kp", &kp, n)?;
        require_size("kd", &kd, n)?;
        let estimate = estimate.unwrap_or_else(|| vec![0.0; p]);
        if estimate.len() != p {
            return Err(Error::wrong_shape("estimate", &[p], &[estimate.len()]));
        }
        finite("estimate", &estimate)?;
        if base.is_some() && matches!(adaptation, Adaptation::Natural(_)) {
            return Err(Error::input("base", "has no natural metric: expected all parameters for natural adaptation"));
        }
        adaptation.validate(&estimate, columns.count())?;
        let lambda = kd.solve(&kp);
        let restraint = Restraint::none();
        let start = estimate.clone();
        let (projection, composite, concurrent) = (None, None, None);
        Ok(AdaptiveSpec {
            model,
            motion,
            kp,
            kd,
            lambda,
            adaptation,
            base,
            estimate,
            projection,
            columns,
            restraint,
            composite,
            concurrent,
            start,
        })
    }

    /// Names of the estimated parameters: of the bodies or the base set, then of the joint columns.
    pub fn parameter_names(&self) -> Vec<String> {
        let all = self.model.column_names(JointTerms::default());
        let mut names = match &self.base {
            None => all,
            Some(base) => base.columns.iter().map(|&column| all[column].clone()).collect(),
        };
        names.extend(self.columns.names(&self.model));
        names
    }

    /// The number of joints `n`, and the number of estimated parameters `p`.
    pub fn parameter_sizes(&self) -> (usize, usize) {
        (self.model.n(), self.estimate.len())
    }

    /// Whether the law estimates only parameters of bodies, without leakage, dead zone, composite and concurrent adaptation.
    pub(super) fn is_plain(&self) -> bool {
        self.columns.is_empty() && self.restraint.is_none() && self.composite.is_none() && self.concurrent.is_none()
    }

    /// Add leakage `sigma` towards `centre`, `(p,)`. `None` means the initial estimate. Errors: `Input` for numbers that are negative
    /// (`sigma`) or not finite, `WrongShape` for a wrong length.
    pub fn leaking(mut self, sigma: f64, form: LeakageForm, centre: Option<Vec<f64>>) -> Result<Self> {
        not_negative("leakage", sigma)?;
        let centre = centre.unwrap_or_else(|| self.estimate.clone());
        if centre.len() != self.estimate.len() {
            return Err(Error::wrong_shape("leakage_centre", &[self.estimate.len()], &[centre.len()]));
        }
        finite("leakage_centre", &centre)?;
        let centre = if sigma > 0.0 { centre } else { Vec::new() };
        self.restraint = Restraint { leakage: sigma, form, centre, ..self.restraint };
        Ok(self)
    }

    /// Stop the adaptation while the norm of the sliding variable `s` is below `s_0`, rad/s or m/s. Errors: `Input` for an `s_0` that is
    /// negative or not finite.
    pub fn resting_below(mut self, s_0: f64) -> Result<Self> {
        not_negative("dead_zone", s_0)?;
        self.restraint.dead_zone = s_0;
        Ok(self)
    }

    /// Add a projection, which keeps the estimates physically possible. An initial estimate below the lower bounds of `projection` is
    /// replaced by the nearest estimate that satisfies them.
    ///
    /// Errors: `Input` for natural adaptation, or a base set.
    pub fn projected(mut self, projection: Projection) -> Result<Self> {
        if matches!(self.adaptation, Adaptation::Natural(_)) {
            return Err(Error::input("projection", "has nothing to do: expected None for natural adaptation, which stays consistent"));
        }
        if self.base.is_some() {
            return Err(Error::input("projection", "needs whole bodies: expected all parameters, got a base set"));
        }
        projection.start(&mut self.estimate);
        self.projection = Some(projection);
        self.lengthen();
        Ok(self)
    }

    /// Set `start` to the estimate, followed by the filters of composite adaptation at zero.
    pub(super) fn lengthen(&mut self) {
        self.start.clone_from(&self.estimate);
        if self.composite.is_some() {
            let (n, joint_parameters) = (self.model.n(), self.columns.count());
            let bodies = self.estimate.len() - joint_parameters;
            self.start.resize(self.estimate.len() + n * bodies + joint_parameters + n, 0.0);
        }
    }
}

fn not_negative(argument: &str, x: f64) -> Result<()> {
    if x >= 0.0 && x.is_finite() {
        return Ok(());
    }
    Err(Error::input(argument, format!("is negative or not finite: expected a finite number >= 0, got {x}")))
}

impl Definition for AdaptiveSpec {
    facts!("Adaptive", Rigid, motion);
    fn initial_state(&self) -> &[f64] {
        &self.start
    }
    fn restarts(&self) -> bool {
        self.composite.is_some()
    }

    /// The errors of the stored samples of concurrent adaptation.
    fn stored_terms(&self, z: &[f64]) -> Vec<Term> {
        let n = self.model.n();
        self.stored_errors(&z[..self.estimate.len()]).map_or(Vec::new(), |errors| vec![("e_stored", vec![errors.len() / n, n], errors)])
    }

    fn joint_reference(&self) -> Option<JointReference> {
        Some(JointReference::Motion)
    }
}
