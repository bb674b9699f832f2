//! Motor-inertia reduction (Ott, Albu-Schaeffer, Kugi and Hirzinger 2008): torque feedback makes motors of inertia `B` behave like motors
//! of inertia `B0`. `theta` are the motor positions, `u` is the torque that an outer loop commands, and `D0` the damping. Units are those
//! of revolute joints; for a prismatic joint, replace rad by m, N m by N and kg m^2 by kg.
//!
//! `tau = (I - B B0^-1) tau_J + B B0^-1 (u - D0 w)` gives `B0 theta_ddot + D0 w + tau_J = u`, `tau_J = K_J (theta - q)`,
//!
//! `w = theta_dot`, or `w = theta_dot - v` with relative damping. The default damping is
//! `D0 = 2 zeta B0^1/2 (B0^-1/2 K_J B0^-1/2)^1/2 B0^1/2`, with the damping ratio `zeta`. For full matrices
//! the order of the product `B B0^-1` matters.

use super::equations::Loop;
use super::sizes::require_size;
use crate::error::Result;
use crate::linalg::{Gain, ratio_damping};
use crate::plant::{ElasticSpec, Parameters, PlantSpec};
use crate::trace::{E, M, V};

/// Implement the common functions of laws with the fields `outer`, a law of the links, and `inner`, a reduction.
macro_rules! reduced_facts {
    ($name:literal) => {
        fn name(&self) -> &'static str {
            $name
        }
        fn plant(&self) -> $crate::plant::PlantKind {
            $crate::plant::PlantKind::Elastic
        }
        fn model(&self) -> &$crate::dynamics::Model {
            self.outer.model()
        }
        fn motions(&self) -> Vec<&$crate::motion::Motion> {
            self.outer.motions()
        }
        fn reduction(&self) -> Option<&$crate::law::ReductionSpec> {
            Some(&self.inner)
        }
        fn outer_stiffness(&mut self) -> Option<&mut $crate::linalg::Gain> {
            self.outer.outer_stiffness()
        }
    };
}
pub(super) use reduced_facts;

/// Torque feedback that reduces the apparent motor inertia, with validated parameters.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{CartesianImpedanceSpec, ElasticImpedanceSpec, Gain, JointImpedanceSpec, LawSpec, PdGravitySpec, ReductionSpec};
/// use armlet_core::motion::Motion;
/// use armlet_core::plant::{ElasticSpec, PlantSpec};
/// use armlet_core::simulate::{Options, Problem};
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let (stiffness, motors) = (Gain::scalar("stiffness", 2, 2000.0)?, Gain::scalar("motor_inertia", 2, 0.2)?);
/// let plant = PlantSpec::from(ElasticSpec::new(model.clone(), stiffness.clone(), motors.clone(), None, None, None)?);
/// // The motors behave as if they had a quarter of their inertia. D0 follows from a damping ratio of 0.7.
/// let inner = ReductionSpec::new(2, stiffness, motors, Gain::scalar("reduced_inertia", 2, 0.05)?, None, 0.7, false)?;
/// let (kp, kd) = (Gain::scalar("kp", 2, 60.0)?, Gain::scalar("kd", 2, 12.0)?);
/// let outer = PdGravitySpec::new(model.clone(), dvector![0.4, 0.1], kp.clone(), kd.clone())?;
/// let joint = LawSpec::from(JointImpedanceSpec { outer, inner: inner.clone() });
/// let outer = CartesianImpedanceSpec::new(model, Motion::hold(dvector![0.7, 0.2])?, kp, kd, "link2", "xy")?;
/// let cartesian = LawSpec::from(ElasticImpedanceSpec { outer, inner });
/// for law in [joint, cartesian] {
///     let run = Problem::from_rest(&plant, &law, &dvector![0.3, 0.4], Options::fixed(0.1, 1e-4))?.run()?;
///     assert_eq!((run.t.len(), run.theta.len()), (1001, 2002));
/// }
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ReductionSpec {
    /// Joint stiffness `K_J`, of size `n`, N m/rad.
    pub joint_stiffness: Gain,
    /// Motor inertia `B`, of size `n`, kg m^2.
    pub motor_inertia: Gain,
    /// Reduced motor inertia `B0`, of size `n`, kg m^2.
    pub reduced_inertia: Gain,
    /// Motor damping `D0`, of size `n`, N m s/rad.
    pub motor_damping: Gain,
    /// Whether damping acts on `theta_dot - v` instead of `theta_dot`.
    pub relative: bool,
    /// Inertia ratio `B B0^-1`.
    ratio: Gain,
}

impl ReductionSpec {
    /// Create the reduction for `n` joints. Gains have the size `n` and the units of their fields.
    ///
    /// `motor_damping = None` computes `D0` from the dimensionless `damping_ratio`.
    ///
    /// Errors: `WrongShape` for a wrong size. `Input` for a `damping_ratio` that is used and not positive.
    pub fn new(
        n: usize,
        joint_stiffness: Gain,
        motor_inertia: Gain,
        reduced_inertia: Gain,
        motor_damping: Option<Gain>,
        damping_ratio: f64,
        relative: bool,
    ) -> Result<Self> {
        require_size("joint_stiffness", &joint_stiffness, n)?;
        require_size("motor_inertia", &motor_inertia, n)?;
        require_size("reduced_inertia", &reduced_inertia, n)?;
        let motor_damping = match motor_damping {
            Some(damping) => {
                require_size("motor_damping", &damping, n)?;
                damping
            }
            None => ratio_damping(&reduced_inertia, &joint_stiffness, damping_ratio)?,
        };
        let ratio = motor_inertia.product(&reduced_inertia.inverse());
        Ok(ReductionSpec { joint_stiffness, motor_inertia, reduced_inertia, motor_damping, relative, ratio })
    }

    /// Whether a plant has the springs and motors of the law's model, and neither joint damping nor viscous friction.
    pub(super) fn matches(&self, plant: &ElasticSpec) -> bool {
        plant.stiffness == self.joint_stiffness
            && plant.motor_inertia == self.motor_inertia
            && plant.joint_damping.iter().chain(&plant.motor_friction).all(|&d| d == 0.0)
    }

    /// Whether both reductions have the same operations.
    pub(super) fn same_shape(&self, other: &Self) -> bool {
        self.relative == other.relative
    }

    /// The numbers of the reduction.
    pub(super) fn parameters(&self) -> Parameters {
        Parameters::default()
            .gain("law_joint_stiffness", &self.joint_stiffness)
            .gain("motor_damping", &self.motor_damping)
            .gain("inertia_ratio", &self.ratio)
    }

    /// The motor torque for the torque `u` that the outer loop commands, and its power.
    pub(super) fn torque(&self, at: &Loop, u: &V) -> ReducedTorque {
        let n = u.len();
        let d_0 = at.gain("motor_damping");
        at.term_on_request("D0", [n, n], || M::from_row_slice(n, n, &d_0.matrix(n)));
        let u = at.term("u", u.clone());
        let tau_j = at.term("tau_J", at.gain("law_joint_stiffness") * &(&at.theta - &at.q));
        let w = if self.relative { &at.theta_dot - &at.v } else { at.theta_dot.clone() };
        let damped = d_0 * &w;
        let power = (&at.theta_dot - &at.v).dot(&u) - at.theta_dot.dot(&damped);
        let tau = &tau_j + at.gain("inertia_ratio") * &(u - damped - &tau_j);
        ReducedTorque { tau, power }
    }
}

/// The result of the motor-inertia reduction.
pub(super) struct ReducedTorque {
    /// Motor torque, `(n,)`, N m.
    pub tau: V,
    /// The power `(theta_dot - v).u - theta_dot.D0 w`, W. It is the rate of the energy in the reduced motors and the springs, minus the power
    /// of the springs on the links.
    pub power: E,
}

/// The elastic plant, if the law's model and inner loop describe it exactly; else `None`.
pub(super) fn described<'a>(plant: &'a PlantSpec, model: &crate::dynamics::Model, reduction: &ReductionSpec) -> Option<&'a ElasticSpec> {
    plant.elastic().filter(|plant| plant.model == *model && plant.dry.is_none() && reduction.matches(plant))
}
