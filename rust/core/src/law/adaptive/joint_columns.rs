//! Joint columns: adaptation can also estimate rotor inertia and friction of each joint. The regressor columns of these parameters follow
//! the columns of the bodies:
//!
//! ```text
//! armature (rotors)  diag(a_r)
//! viscous            diag(v_r)
//! Coulomb            diag(tanh(v_r / v_s))
//! Stribeck           diag(exp(-(v_r / v_s)^2) tanh(v_r / v_s))
//! offset             identity matrix: a constant torque, such as an error of the torque sensor or a constant load
//! ```
//!
//! The columns are in this order. `v_r` and `a_r` are the reference velocity and acceleration of the adaptive law. The speed `v_s` smooths
//! the jump of Coulomb friction. Sources: `SlotineLi1987` for parameters that enter linearly, `Armstrong1994` for the Stribeck effect.

use crate::dynamics::Model;
use crate::error::{Error, Result, positive};
use crate::scalar::Real;
use crate::scalar::hyperbolic::{decay, tanh};
use nalgebra::DVector;

/// A kind of joint column. Each kind has one parameter per joint.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::{JointTerms, Model}};
/// use armlet_core::law::{JointColumn, JointColumns};
///
/// let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// let columns = JointColumns::new(1, &[JointColumn::Viscous, JointColumn::Coulomb], vec![0.05])?;
/// assert!(columns.has(JointColumn::Coulomb) && !columns.has(JointColumn::Armature));
/// assert_eq!(columns.names(&model), model.column_names(JointTerms { friction: true, ..JointTerms::default() })[10..]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum JointColumn {
    /// `a_r`: rotor inertia, kg m^2 or kg.
    Armature,
    /// `v_r`: viscous friction, N m s/rad or N s/m.
    Viscous,
    /// `tanh(v_r / v_s)`: Coulomb friction, N m or N.
    Coulomb,
    /// `exp(-(v_r / v_s)^2) tanh(v_r / v_s)`: the additional friction at low speed, N m or N.
    Stribeck,
    /// `1`: torque offset, N m or N.
    Offset,
}

impl JointColumn {
    /// The name of the parameter, as in [`Model::column_names`].
    fn name(self) -> &'static str {
        match self {
            JointColumn::Armature => "armature",
            JointColumn::Viscous => "damping",
            JointColumn::Coulomb => "friction",
            JointColumn::Stribeck => "stribeck",
            JointColumn::Offset => "offset",
        }
    }
}

/// The joint columns that are estimated.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, JointColumn, JointColumns};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
///
/// // Estimate the ten parameters of the body, the rotor inertia and the viscous friction.
/// let columns = JointColumns::new(1, &[JointColumn::Armature, JointColumn::Viscous], vec![0.05])?;
/// let p = model.parameter_count() + columns.count();
/// let (motion, adaptation) = (Motion::hold(vec![0.5])?, Adaptation::Euclidean(gain(p, 2.0)?));
/// let law = AdaptiveSpec::with_columns(model, motion, [gain(1, 50.0)?, gain(1, 10.0)?], adaptation, None, columns, None)?;
/// assert_eq!((law.parameter_sizes(), law.parameter_names().len()), ((1, 12), 12));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Default)]
pub struct JointColumns {
    kinds: Vec<JointColumn>,
    /// The speed `v_s` that smooths Coulomb friction, `(n,)`, rad/s or m/s.
    speeds: Vec<f64>,
}

impl JointColumns {
    /// Create the columns `kinds` for `n` joints, each kind once, in the order of [`JointColumn`]. `speed` is the smoothing speed `v_s` of
    /// each joint, > 0, rad/s or m/s. Errors: `WrongShape` for a wrong number of speeds, `Input` for a speed that is not positive.
    pub fn new(n: usize, kinds: &[JointColumn], speed: Vec<f64>) -> Result<Self> {
        if speed.len() != n {
            return Err(Error::wrong_shape("friction_speed", &[n], &[speed.len()]));
        }
        speed.iter().try_for_each(|&speed| positive("friction_speed", speed))?;
        let mut kinds = kinds.to_vec();
        kinds.sort_unstable();
        kinds.dedup();
        Ok(JointColumns { kinds, speeds: speed })
    }

    /// Whether no column is estimated.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// The number of parameters of all columns.
    pub fn count(&self) -> usize {
        self.kinds.len() * self.speeds.len()
    }

    /// Whether this kind is estimated.
    pub fn has(&self, kind: JointColumn) -> bool {
        self.kinds.contains(&kind)
    }

    /// The smoothing speeds, `(n,)`; empty without columns.
    pub(super) fn speeds(&self) -> &[f64] {
        if self.is_empty() { &[] } else { &self.speeds }
    }

    /// The diagonals of the columns, `(n,)` each, one per kind. `speeds` are the smoothing speeds `v_s`, and `offset` is the factor of the
    /// torque offsets: one, or zero for the momentum.
    pub(super) fn diagonals<S: Real>(&self, speeds: &[S], [v_r, a_r]: [&DVector<S>; 2], offset: f64) -> Vec<DVector<S>> {
        let share = DVector::from_fn(speeds.len(), |i, _| v_r[i] / speeds[i]);
        let of = |kind: &JointColumn| match kind {
            JointColumn::Armature => a_r.clone(),
            JointColumn::Viscous => v_r.clone(),
            JointColumn::Coulomb => share.map(tanh),
            JointColumn::Stribeck => share.map(|r| decay(r * r) * tanh(r)),
            JointColumn::Offset => DVector::from_element(speeds.len(), S::splat(offset)),
        };
        self.kinds.iter().map(of).collect()
    }

    pub(super) fn same_kinds(&self, other: &Self) -> bool {
        self.kinds == other.kinds
    }

    /// The names of the parameters, `armature[joint]` and so on.
    pub fn names(&self, model: &Model) -> Vec<String> {
        let joints: Vec<String> = match model {
            Model::PlanarPr(_) => ["p1", "r2"].map(String::from).to_vec(),
            Model::Tree(arm) => arm.joint_names().map(String::from).collect(),
        };
        self.kinds.iter().flat_map(|kind| joints.iter().map(move |joint| format!("{}[{joint}]", kind.name()))).collect()
    }

    /// The true parameters of the model `plant`, in the order of the columns. `friction` states whether the plant's friction acts.
    pub(super) fn truth(&self, plant: &Model, friction: bool) -> Vec<f64> {
        let n = plant.n();
        let [damping, coulomb] = plant.friction(friction);
        let of = |kind: &JointColumn| match kind {
            JointColumn::Armature => plant.armature(),
            JointColumn::Viscous => damping.clone(),
            JointColumn::Coulomb => coulomb.clone(),
            JointColumn::Stribeck | JointColumn::Offset => vec![0.0; n],
        };
        self.kinds.iter().flat_map(of).collect()
    }
}
