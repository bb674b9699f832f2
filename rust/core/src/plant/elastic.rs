//! An arm with elastic joints (Spong 1987). Springs couple links and motors:
//!
//! `M(q) a + C(q, v) v + g(q) = tau_J + J' W`, `B theta_ddot + F theta_dot + tau_f + tau_J = tau`,
//! `tau_J = K (theta - q) + D (theta_dot - v)`.
//!
//! `theta` are the motor positions, and `tau_f` is the dry friction of the motors. `W` is an external wrench, and `J'` the transposed
//! Jacobian of its frame. A wall and stops add their forces to the links. Units are those of revolute joints; for a prismatic joint,
//! replace rad by m, N m by N and kg m^2 by kg.
//!
//! The state is `x = [q, v, theta, theta_dot]`. The deflections of the bristles follow, if the motors have LuGre friction. The load `L` of
//! dry friction is the joint torque `tau_J`.

use super::definition::fields;
use super::equations::{PlantAt, PlantEquations, PlantRates, PlantState, Power};
use super::lugre::LoopLuGre;
use super::rigid::bristles;
use super::stick_slip::LoopStickSlip;
use super::stops::Stops;
use super::{Definition, JointFriction, Parameters, Wall};
use crate::dynamics::Model;
use crate::error::{Error, Result, finite};
use crate::linalg::Gain;
use crate::trace::expression::{stacked, zeros};
use crate::trace::{E, V};

/// An arm with elastic joints, with validated parameters.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::Gain;
/// use armlet_core::plant::ElasticSpec;
///
/// let model = Model::from(Arm::pendulum(1.0, 5.0)?);
/// let plant = ElasticSpec::new(model, Gain::scalar("stiffness", 1, 100.0)?, Gain::scalar("inertia", 1, 0.1)?, None, None, None)?;
/// let theta = plant.resting_motor(&[0.3]);
/// assert!((100.0 * (theta[0] - 0.3) - 5.0 * 0.3f64.sin()).abs() < 1e-13);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ElasticSpec {
    /// The model of the links.
    pub model: Model,
    /// Joint stiffness `K`, of size `n`, N m/rad.
    pub stiffness: Gain,
    /// Motor inertia `B`, of size `n`, kg m^2.
    pub motor_inertia: Gain,
    /// Damping `D` parallel to the springs, N m s/rad, `(n,)`, >= 0.
    pub joint_damping: Vec<f64>,
    /// Viscous friction `F` of the motors, N m s/rad, `(n,)`, >= 0.
    pub motor_friction: Vec<f64>,
    /// Dry friction of the motors; `None` without it.
    pub dry: Option<JointFriction>,
    /// A wall that a frame may touch; `None` without a wall.
    pub wall: Option<Wall>,
    /// Joint stops of the links; `None` without stops.
    pub stops: Option<Stops>,
    inverse_inertia: Gain,
}

impl ElasticSpec {
    /// Create an arm with these links, joint stiffness and motor inertia. If damping or friction is `None`, it is zero.
    ///
    /// Errors: `WrongShape` for a size that is not `n`, `Input` for negative or infinite damping or friction.
    pub fn new(
        model: Model,
        stiffness: Gain,
        motor_inertia: Gain,
        joint_damping: Option<Vec<f64>>,
        motor_friction: Option<Vec<f64>>,
        wall: Option<Wall>,
    ) -> Result<Self> {
        let n = model.n();
        for (name, gain) in [("stiffness", &stiffness), ("motor_inertia", &motor_inertia)] {
            if gain.n() != n {
                return Err(Error::wrong(name, "size", n, gain.n()));
            }
        }
        let dissipative = |name: &str, values: Option<Vec<f64>>| -> Result<Vec<f64>> {
            let values = values.unwrap_or_else(|| vec![0.0; n]);
            if values.len() != n {
                return Err(Error::wrong_shape(name, &[n], &[values.len()]));
            }
            finite(name, &values)?;
            match values.iter().position(|&d| d < 0.0) {
                Some(i) => Err(Error::input(name, format!("is negative: expected >= 0, got {}", values[i])).at([i])),
                None => Ok(values),
            }
        };
        let (joint_damping, motor_friction) =
            (dissipative("joint_damping", joint_damping)?, dissipative("motor_friction", motor_friction)?);
        let inverse_inertia = motor_inertia.inverse();
        Ok(ElasticSpec { model, stiffness, motor_inertia, joint_damping, motor_friction, dry: None, wall, stops: None, inverse_inertia })
    }

    /// Set the joint stops of the links.
    pub fn with_stops(self, stops: Option<Stops>) -> Self {
        ElasticSpec { stops, ..self }
    }

    /// Set the dry friction of the motors. Errors: `WrongShape` for a wrong number of joints.
    pub fn with_friction(self, friction: Option<JointFriction>) -> Result<Self> {
        friction.iter().try_for_each(|friction| friction.require_joints("motor_friction", self.model.n()))?;
        Ok(ElasticSpec { dry: friction, ..self })
    }

    /// The motor positions at which the springs carry the gravity load: `theta = q + K^-1 g(q)`, `(n,)`, rad.
    pub fn resting_motor(&self, q: &[f64]) -> Vec<f64> {
        let deflection = self.stiffness.inverse().times(self.model.at(q).gravity().as_slice());
        q.iter().zip(&deflection).map(|(q, d)| q + d).collect()
    }
}

impl Definition for ElasticSpec {
    fields!();

    fn initial_state(&self, q0: &[f64], v0: &[f64], theta0: Option<&[f64]>, theta_dot0: Option<&[f64]>) -> Vec<f64> {
        let resting = || self.resting_motor(q0);
        let theta = theta0.map_or_else(resting, <[f64]>::to_vec);
        let mut x = [q0, v0, &theta, theta_dot0.unwrap_or(v0)].concat();
        x.resize(x.len() + bristles(self.dry.as_ref()), 0.0);
        x
    }
}

impl PlantEquations for ElasticSpec {
    fn parameters(&self) -> Parameters {
        Parameters::of_arm(&self.model)
            .contacts(self.wall.as_ref(), self.stops.as_ref())
            .gain("joint_stiffness", &self.stiffness)
            .gain("inverse_motor_inertia", &self.inverse_inertia)
            .numbers("joint_damping", &self.joint_damping)
            .numbers("motor_friction", &self.motor_friction)
            .dry_friction(self.dry.as_ref(), false)
            .option(self.dry.as_ref().filter(|dry| dry.stick_slip().is_some()), |numbers, _| {
                numbers.matrix("motor_inertia", self.model.n(), &self.motor_inertia.matrix())
            })
    }

    fn equations(&self, at: &PlantAt) -> PlantRates {
        let PlantState { v, theta_dot, bristles: z, .. } = &at.x;
        let Torques { tau_j, mut motor, lost } = self.torques(at);
        let (torque, mut outside) = at.outside();
        outside -= lost;
        let (mut z_dot, mut friction) = (zeros(0), None);
        if self.dry.as_ref().is_some_and(|dry| dry.bristles().is_some()) {
            let rubbing = at.numbers().get_made::<LoopLuGre>("bristles").rub(theta_dot, z, &tau_j);
            motor -= &rubbing.torque;
            outside -= rubbing.lost;
            z_dot = rubbing.z_dot;
            friction = Some(rubbing.torque);
        }
        let theta_ddot = match self.stick_slip(at) {
            None => at.numbers().get_gain("inverse_motor_inertia") * &motor,
            Some(mut sticking) => {
                let (theta_ddot, tau_f) = sticking.motion(theta_dot);
                outside -= tau_f.dot(theta_dot);
                friction = Some(tau_f);
                theta_ddot
            }
        };
        let a = at.arm().forward_dynamics(v, &(tau_j + torque));
        let x_dot = stacked([v, &a, theta_dot, &theta_ddot, &z_dot]);
        PlantRates { x_dot, power: Power { input: at.tau.dot(theta_dot), outside }, friction }
    }

    /// The friction with `A = B`, the torques on the motors, and the loads `tau_J`.
    fn stick_slip(&self, at: &PlantAt) -> Option<LoopStickSlip<E>> {
        let mut sticking = at.held_friction()?;
        let Torques { tau_j, motor, .. } = self.torques(at);
        sticking.load(at.numbers().get_matrix("motor_inertia"), &motor, &tau_j);
        Some(sticking)
    }
}

/// The torques of joints and motors without dry friction.
struct Torques {
    /// Joint torque `tau_J`, `(n,)`, N m.
    tau_j: V,
    /// The torque `tau - tau_J - F theta_dot` that accelerates the motors, `(n,)`, N m.
    motor: V,
    /// The power lost in joints and motors, W.
    lost: E,
}

impl ElasticSpec {
    fn torques(&self, at: &PlantAt) -> Torques {
        let slip = &at.x.theta_dot - &at.x.v;
        let damped = at.numbers().get_numbers("joint_damping").component_mul(&slip);
        let rubbed = at.numbers().get_numbers("motor_friction").component_mul(&at.x.theta_dot);
        let tau_j = self.spring_torque(at) + &damped;
        Torques { motor: &at.tau - &tau_j - &rubbed, lost: damped.dot(&slip) + rubbed.dot(&at.x.theta_dot), tau_j }
    }

    fn spring_torque(&self, at: &PlantAt) -> V {
        at.numbers().get_gain("joint_stiffness") * &(&at.x.theta - &at.x.q)
    }
}
