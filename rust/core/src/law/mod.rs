//! Control laws: from the desired motion and the measured state to the plant's input.
//!
//! A law is stated once ([`Definition`], gathered in [`LawSpec`]) and made for the number it runs on ([`Law`]).

mod adaptation;
mod adaptive;
mod aims;
#[doc(hidden)]
mod arm_batch;
mod arm_solver;
mod cartesian_impedance;
mod computed_torque;
mod convert;
#[doc(hidden)]
mod decided;
mod elastic_impedance;
#[doc(hidden)]
mod evaluator;
mod external;
mod inertia_reduction;
mod joint_impedance;
mod joint_limits;
mod level;
mod lyapunov;
mod motor_regulation;
mod pd_gravity;
mod priority_acceleration;
mod priority_velocity;
mod projection;
mod sampled_reduction;
mod storage;

pub use crate::linalg::gain::Gain;
pub use adaptation::{Adaptation, AnyAdaptive, Base};
pub use adaptive::{Adaptive, AdaptiveSpec};
pub use aims::{Aim, JointReference};
pub use arm_batch::ArmBatch;
pub use arm_solver::ArmSolver;
pub use cartesian_impedance::{CartesianImpedance, CartesianImpedanceSpec};
pub use computed_torque::{ComputedTorque, ComputedTorqueSpec};
pub use decided::{Decided, RecordedSolver, Solve};
pub use elastic_impedance::{ElasticImpedance, ElasticImpedanceSpec};
pub use evaluator::LawEvaluator;
pub use external::{Call, External, ExternalSpec};
pub use inertia_reduction::{Reduction, ReductionSpec};
pub use joint_impedance::{JointImpedance, JointImpedanceSpec};
pub use joint_limits::{HORIZON, JointLimits, LimitOverrides};
pub use level::Level;
use level::same_tasks;
pub use lyapunov::Lyapunov;
pub use motor_regulation::{MotorPdSpec, MotorRegulation, MotorRegulationSpec, StateFeedbackSpec};
pub use pd_gravity::{PdGravity, PdGravitySpec};
pub use priority_acceleration::{PriorityAcceleration, PriorityAccelerationSpec};
pub use priority_velocity::{PriorityVelocity, PriorityVelocitySpec, with_limits};
pub use projection::Projection;
pub use sampled_reduction::LockedMotors;
pub use storage::Storage;

use crate::dynamics::Model;
use crate::error::{Error, Result};
use crate::motion::{Motion, sample_all};
use crate::plant::{PlantKind, PlantSpec};
use crate::scalar::Real;

/// A law in a loop: its input to the plant and its own rate, from one evaluation.
pub trait Law<S: Real> {
    /// `tau` `(n,)` and the rate `dz` `(p,)` of the law's state `z`, from the desired motions one after another, each
    /// `[x_d, x_d', x_d'']`, the (sin, cos) of the joints and the plant's state `x`.
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]);

    /// The time of the samples that follow: for laws that are a function of time itself, asked at samples alone.
    fn at(&mut self, _t: f64) {}

    /// One where the last evaluation is right, zero where it has to be taken directly; `None` for a law that is always right.
    fn stands(&self) -> Option<S> {
        None
    }

    /// The rate at which the law's Lyapunov function falls, as of the last evaluation; zero without one.
    fn dissipation(&self) -> S {
        S::zero()
    }

    /// The rate of the law's own storage function, as of the last evaluation, when the world outside puts in `outside`.
    fn storage_rate(&self, _x: &[S], outside: S) -> S {
        outside
    }
}

/// A law as the user states it, validated.
pub trait Definition {
    /// The class in Python.
    const NAME: &'static str;
    /// The kind of plant it drives.
    const PLANT: PlantKind;
    /// The law in a loop, on the number `S`.
    type Lanes<S: Real>: Law<S> + Send + 'static;

    /// The arm the law was made for.
    fn model(&self) -> &Model;
    /// The desired motions, in the order in which [`Law::evaluate`] reads them.
    fn motions(&self) -> Vec<&Motion>;
    /// The law's state at the start of a run, `(p,)`.
    fn initial_state(&self) -> &[f64] {
        &[]
    }
    /// The laws of the lanes as one; all have the same shape.
    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self) -> Self::Lanes<S>
    where
        Self: 'a;
    /// The named parts of the law at one instant.
    fn terms(&self, at: &Instant) -> Vec<Term>;
}

/// What a law is asked about: its motions' samples, the plant's state with (sin, cos) of its coordinates, and the law's own.
pub struct Instant<'a> {
    /// Samples of the desired motions.
    pub desired: &'a [f64],
    /// (sin, cos) of the joints.
    pub trig: &'a [(f64, f64)],
    /// State of the plant.
    pub x: &'a [f64],
    /// State of the law.
    pub z: &'a [f64],
}

/// A named part of a law: its values, row-major, in its shape.
pub type Term = (&'static str, Vec<usize>, Vec<f64>);

/// The laws there are.
#[derive(Clone, Debug, PartialEq)]
pub enum LawSpec {
    /// Slotine-Li adaptive control.
    Adaptive(AdaptiveSpec),
    /// Computed torque.
    ComputedTorque(ComputedTorqueSpec),
    /// PD with gravity compensation.
    PdGravity(PdGravitySpec),
    /// Cartesian impedance of a rigid arm.
    CartesianImpedance(CartesianImpedanceSpec),
    /// Cartesian impedance of an elastic arm.
    ElasticImpedance(ElasticImpedanceSpec),
    /// Joint impedance of an elastic arm.
    JointImpedance(JointImpedanceSpec),
    /// PD on motors with gravity compensation.
    MotorPd(MotorPdSpec),
    /// Full state feedback of an elastic arm.
    StateFeedback(StateFeedbackSpec),
    /// Velocities of tasks in priority.
    PriorityVelocity(PriorityVelocitySpec),
    /// Accelerations of tasks in priority.
    PriorityAcceleration(PriorityAccelerationSpec),
    /// A function from outside, asked at samples.
    External(ExternalSpec),
}

/// `$body` with `$law` the definition inside `$spec`, `$other` for a law from outside.
macro_rules! each {
    ($spec:expr, $law:ident => $body:expr, $outside:ident => $other:expr) => {
        match $spec {
            LawSpec::External($outside) => $other,
            LawSpec::Adaptive($law) => $body,
            LawSpec::ComputedTorque($law) => $body,
            LawSpec::PdGravity($law) => $body,
            LawSpec::CartesianImpedance($law) => $body,
            LawSpec::ElasticImpedance($law) => $body,
            LawSpec::JointImpedance($law) => $body,
            LawSpec::MotorPd($law) => $body,
            LawSpec::StateFeedback($law) => $body,
            LawSpec::PriorityVelocity($law) => $body,
            LawSpec::PriorityAcceleration($law) => $body,
        }
    };
}

impl LawSpec {
    /// The class in Python.
    pub fn name(&self) -> &'static str {
        fn of<D: Definition>(_: &D) -> &'static str {
            D::NAME
        }
        each!(self, law => of(law), _outside => "PythonLaw")
    }

    /// The kind of plant it drives.
    pub fn plant(&self) -> PlantKind {
        fn of<D: Definition>(_: &D) -> PlantKind {
            D::PLANT
        }
        each!(self, law => of(law), outside => outside.plant)
    }

    /// The arm it was made for.
    pub fn model(&self) -> &Model {
        each!(self, law => law.model(), outside => &outside.model)
    }

    /// Its desired motions.
    pub fn motions(&self) -> Vec<&Motion> {
        each!(self, law => law.motions(), _outside => Vec::new())
    }

    /// Times at which the desired motion jumps, increasing.
    pub fn breaks(&self) -> Vec<f64> {
        let mut breaks: Vec<f64> = self.motions().iter().flat_map(|motion| motion.breaks()).collect();
        breaks.sort_by(f64::total_cmp);
        breaks
    }

    /// Its state at the start of a run, `(p,)`.
    pub fn initial_state(&self) -> &[f64] {
        each!(self, law => law.initial_state(), _outside => &[])
    }

    /// What the law's motions ask for at time `t`, as [`Law::evaluate`] reads it.
    pub fn desired<S: Real>(&self, t: f64) -> Vec<S> {
        let motions = self.motions();
        let mut desired = vec![S::zero(); motions.iter().map(|motion| 3 * motion.dof()).sum()];
        sample_all(motions, t, &mut desired);
        desired
    }

    /// The named parts of the law at time `t`.
    pub fn terms(&self, t: f64, x: &[f64], z: &[f64]) -> Vec<Term> {
        let desired = self.desired(t);
        let trig: Vec<(f64, f64)> = x[..self.model().n()].iter().map(|q| Real::sin_cos(*q)).collect();
        each!(self, law => law.terms(&Instant { desired: &desired, trig: &trig, x, z }), outside => outside.terms(t, x))
    }

    /// The frame and axes in which the law takes an external force; `None` for a law of joints alone.
    pub fn coordinates(&self) -> Option<&crate::kinematics::Coordinates> {
        match self {
            LawSpec::CartesianImpedance(law) => Some(&law.coordinates),
            LawSpec::ElasticImpedance(law) => Some(&law.outer.coordinates),
            _ => None,
        }
    }

    /// The motor-inertia reduction inside, for a law that has one.
    pub fn reduction(&self) -> Option<&ReductionSpec> {
        match self {
            LawSpec::ElasticImpedance(law) => Some(&law.inner),
            LawSpec::JointImpedance(law) => Some(&law.inner),
            _ => None,
        }
    }

    /// The stiffness of the joints that the law believes in, for a law that reads their torques.
    pub fn joint_stiffness(&self) -> Option<&Gain> {
        match self {
            LawSpec::MotorPd(law) => Some(&law.joint_stiffness),
            LawSpec::StateFeedback(law) => Some(&law.joint_stiffness),
            _ => self.reduction().map(|reduction| &reduction.joint_stiffness),
        }
    }

    /// `(I + Kt)^-1` of a law of motors, by which its answer at rest is the slope of a potential.
    pub fn torque_share(&self) -> Option<Gain> {
        match self {
            LawSpec::MotorPd(law) => Some(law.torque_share()),
            LawSpec::StateFeedback(law) => Some(law.torque_share()),
            _ => None,
        }
    }

    /// Where a law of motors wants the links, `(n,)`.
    pub fn link_target(&self) -> Option<Vec<f64>> {
        match self {
            LawSpec::MotorPd(law) => Some(law.link_target()),
            LawSpec::StateFeedback(law) => Some(law.link_target()),
            _ => None,
        }
    }

    /// The law of links alone that asks for the joint torque: the outer loop, or a law of rigid arms that stands on a spring.
    pub fn outer(&self) -> Option<LawSpec> {
        match self {
            LawSpec::ElasticImpedance(law) => Some(LawSpec::CartesianImpedance(law.outer.clone())),
            LawSpec::JointImpedance(law) => Some(LawSpec::PdGravity(law.outer.clone())),
            LawSpec::CartesianImpedance(_) | LawSpec::PdGravity(_) => Some(self.clone()),
            _ => None,
        }
    }

    /// The same law with the stiffness of its outer spring times `kappa`; `None` for a law without one.
    pub fn with_stiffness(&self, kappa: f64) -> Option<LawSpec> {
        let mut law = self.clone();
        let stiffness = match &mut law {
            LawSpec::ElasticImpedance(law) => &mut law.outer.stiffness,
            LawSpec::JointImpedance(law) => &mut law.outer.kp,
            LawSpec::CartesianImpedance(law) => &mut law.stiffness,
            LawSpec::PdGravity(law) => &mut law.kp,
            _ => return None,
        };
        *stiffness = stiffness.scaled(kappa);
        Some(law)
    }

    /// Whether the law decides on plain numbers, by branches that neither lanes nor dual numbers can take.
    pub fn is_scalar(&self) -> bool {
        matches!(self, LawSpec::External(_) | LawSpec::PriorityVelocity(_) | LawSpec::PriorityAcceleration(_))
    }

    /// Whether the law can be recorded: if it decides, then by a route without a branch that says where it does not stand.
    pub fn is_recordable(&self) -> bool {
        match self {
            LawSpec::External(_) => false,
            LawSpec::PriorityVelocity(law) => !law.options.method.has_bounds(),
            LawSpec::PriorityAcceleration(law) => !law.options.method.has_bounds(),
            _ => true,
        }
    }

    /// Whether it is then asked whether it stands.
    pub fn is_guarded(&self) -> bool {
        self.is_scalar() && self.is_recordable()
    }

    /// Rows of each level of a law of tasks in priority; empty for any other.
    pub fn level_rows(&self) -> Vec<usize> {
        match self {
            LawSpec::PriorityVelocity(law) => law.rows(),
            LawSpec::PriorityAcceleration(law) => law.rows(),
            _ => Vec::new(),
        }
    }

    /// Whether the law has a storage function of its own on this plant.
    pub fn has_storage(&self, plant: &PlantSpec) -> bool {
        match self {
            LawSpec::ElasticImpedance(law) => law.has_storage(plant),
            _ => false,
        }
    }

    /// Whether both can run side by side in lanes.
    pub fn same_shape(&self, other: &LawSpec) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
            && self.model().same_geometry(other.model())
            && self.coordinates() == other.coordinates()
            && self.initial_state().len() == other.initial_state().len()
            && match (self, other) {
                (LawSpec::Adaptive(law), LawSpec::Adaptive(other)) => law.same_shape(other),
                (LawSpec::PriorityVelocity(law), LawSpec::PriorityVelocity(other)) => {
                    same_tasks((&law.levels, &law.options), (&other.levels, &other.options))
                }
                (LawSpec::PriorityAcceleration(law), LawSpec::PriorityAcceleration(other)) => {
                    same_tasks((&law.levels, &law.options), (&other.levels, &other.options))
                }
                _ => true,
            }
    }

    /// The laws of the lanes as one, all of the same shape.
    pub fn build<'a, S: Real>(of: impl Fn(usize) -> &'a LawSpec) -> Box<dyn Law<S> + Send> {
        macro_rules! gather {
            ($($variant:ident)*) => {
                match of(0) {
                    $(LawSpec::$variant(first) => Box::new(Definition::build::<S>(|i| match of(i) {
                        LawSpec::$variant(law) => law,
                        _ => first,
                    })),)*
                    LawSpec::External(outside) => Box::new(External::new(outside)),
                }
            };
        }
        gather!(
            Adaptive ComputedTorque PdGravity CartesianImpedance ElasticImpedance JointImpedance MotorPd StateFeedback PriorityVelocity
            PriorityAcceleration
        )
    }
}

fn require_same_dof(n: usize, motion: &Motion) -> Result<()> {
    require_rows("motion", n, motion.dof())
}

fn require_rows(argument: &str, n: usize, got: usize) -> Result<()> {
    if got == n {
        return Ok(());
    }
    Err(Error::input(argument, format!("has the wrong number of joints: expected {n}, got {got}")))
}

fn require_size(argument: &str, gain: &Gain, n: usize) -> Result<()> {
    if gain.n() == n {
        return Ok(());
    }
    Err(Error::input(argument, format!("has the wrong size: expected {n}, got {}", gain.n())))
}
