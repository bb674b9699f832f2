//! Tracking of a joint motion `q_d(t)` on elastic joints, with the feed-forward of motors and links (De Luca and Book 2016). The feed-forward
//! is the torque of full-state feedback linearisation (Spong 1987) on the desired motion.
//!
//! ```text
//! tau_J,d = M(q_d) a_d + C(q_d, v_d) v_d + g(q_d),   theta_d = q_d + K_J^-1 tau_J,d
//! tau = B theta_d_ddot + tau_J,d + Kp (theta_d - theta) + Kd (theta_d_dot - theta_dot)
//! ```
//!
//! `theta_d_dot` and `theta_d_ddot` are total derivatives with respect to time, with jerk and snap of `q_d`. `theta` are the motor positions.
//! Units are those of revolute joints; for a prismatic joint, replace rad by m and N m by N.

use crate::dynamics::Model;
use crate::error::Result;
use crate::law::definition::{Definition, JointReference, Shape};
use crate::law::equations::{Answer, Equations, Loop};
use crate::law::sizes::{require_same_dof, require_size};
use crate::linalg::Gain;
use crate::motion::Motion;
use crate::plant::{Parameters, PlantKind};
use crate::trace::expression::time_derivative;

/// Tracking of a joint motion on elastic joints, with validated parameters.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, JointTrackingSpec, LawEvaluator, LawSpec};
/// use armlet_core::motion::{Motion, Sinusoid};
///
/// // A link of 2 kg m^2 without gravity moves as q_d = 0.1 sin 3 t. The spring has 100 N m/rad, and the motor 0.5 kg m^2.
/// let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// let motion = Motion::from(Sinusoid::new(vec![0.0], 1, vec![0.1], vec![3.0], vec![0.0])?);
/// let gain = |k: f64| Gain::scalar("gain", 1, k);
/// let law = LawSpec::from(JointTrackingSpec::new(model, motion, [gain(50.0)?, gain(5.0)?], gain(100.0)?, gain(0.5)?)?);
/// // theta_d = q_d + 2 a_d / 100 = 0.82 q_d. On the desired motion, tau = 0.5 theta_d_ddot + 2 a_d.
/// let (t, w) = (0.3_f64, 3.0_f64);
/// let (q, v) = (0.1 * (w * t).sin(), 0.3 * (w * t).cos());
/// let mut tau = [0.0];
/// LawEvaluator::new(&law).input(t, &[&[q], &[v], &[0.82 * q], &[0.82 * v]], None, &mut tau);
/// assert!((tau[0] + 9.0 * (0.5 * 0.82 + 2.0) * q).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct JointTrackingSpec {
    model: Model,
    motion: Motion,
    /// The acceleration of `motion`, with jerk and snap.
    acceleration: Motion,
    /// Position gain `Kp` of the motors, of size `n`, N m/rad.
    pub kp: Gain,
    /// Velocity gain `Kd` of the motors, of size `n`, N m s/rad.
    pub kd: Gain,
    joint_stiffness: Gain,
    motor_inertia: Gain,
}

impl JointTrackingSpec {
    /// Create the law for a desired motion of `n` joints. `gains` are `Kp` and `Kd`. All gains have the size `n`.
    ///
    /// Errors: `WrongShape` for a wrong size, `Input` for a motion without jerk and snap ([`Motion::acceleration_of`]).
    pub fn new(model: Model, motion: Motion, [kp, kd]: [Gain; 2], joint_stiffness: Gain, motor_inertia: Gain) -> Result<Self> {
        let n = model.n();
        require_same_dof(n, &motion)?;
        for (name, gain) in [("kp", &kp), ("kd", &kd), ("joint_stiffness", &joint_stiffness), ("motor_inertia", &motor_inertia)] {
            require_size(name, gain, n)?;
        }
        let acceleration = Motion::acceleration_of(&motion)?;
        Ok(JointTrackingSpec { model, motion, acceleration, kp, kd, joint_stiffness, motor_inertia })
    }
}

impl Definition for JointTrackingSpec {
    fn name(&self) -> &'static str {
        "JointTracking"
    }
    fn plant(&self) -> PlantKind {
        PlantKind::Elastic
    }
    fn model(&self) -> &Model {
        &self.model
    }
    fn motions(&self) -> Vec<&Motion> {
        vec![&self.motion, &self.acceleration]
    }
    fn joint_reference(&self) -> Option<JointReference> {
        Some(JointReference::Motion)
    }
    fn joint_stiffness(&self) -> Option<&Gain> {
        Some(&self.joint_stiffness)
    }
}

impl Shape for JointTrackingSpec {}

impl Equations for JointTrackingSpec {
    fn parameters(&self, _: Option<f64>) -> Parameters {
        Parameters::of_arm(&self.model)
            .gain("kp", &self.kp)
            .gain("kd", &self.kd)
            .gain("law_joint_stiffness", &self.joint_stiffness)
            .gain("law_joint_compliance", &self.joint_stiffness.inverse())
            .gain("law_motor_inertia", &self.motor_inertia)
    }

    fn equations(&self, at: &Loop) -> Answer {
        let [q_d, v_d, _] = at.desired_terms(0, &["q_d", "v_d"]);
        let [a_d, jerk, snap] = at.desired_terms(1, &["a_d"]);
        let tau_d = at.arm().at(&q_d).inverse_dynamics(&v_d, &a_d);
        let tau_d_dot = time_derivative(&tau_d, [&q_d, &v_d, &a_d], [&v_d, &a_d, &jerk]);
        let tau_d_ddot = time_derivative(&tau_d_dot, [&q_d, &v_d, &a_d, &jerk], [&v_d, &a_d, &jerk, &snap]);
        let compliance = at.gain("law_joint_compliance");
        let theta_d = at.term("theta_d", q_d + compliance * &tau_d);
        let theta_d_dot = at.term("theta_d_dot", v_d + compliance * &tau_d_dot);
        let theta_d_ddot = a_d + compliance * &tau_d_ddot;
        let e = at.term("e", theta_d - &at.theta);
        at.term("tau_J", at.gain("law_joint_stiffness") * &(&at.theta - &at.q));
        let feedforward = at.term("feedforward", at.gain("law_motor_inertia") * &theta_d_ddot + tau_d);
        Answer::new(feedforward + at.gain("kp") * &e + at.gain("kd") * &(theta_d_dot - &at.theta_dot))
    }
}
