//! Computed torque (inverse-dynamics control):
//!
//! `tau = M(q) (a_d + Kd e_dot + Kp e) + C(q, v) v + g(q)`, so that `e_ddot + Kd e_dot + Kp e = 0` for the error `e = q_d - q` of a plant
//! that equals the law's model. `Kp` is in 1/s^2 and `Kd` in 1/s.

use super::definition::{Definition, JointReference, Shape, facts};
use super::equations::{Answer, Equations, Loop};
use super::sizes::{require_same_dof, require_size};
use crate::dynamics::Model;
use crate::error::Result;
use crate::linalg::Gain;
use crate::motion::Motion;
use crate::plant::Parameters;

/// The computed-torque law of an arm, with validated parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{ComputedTorqueSpec, Gain, LawEvaluator, LawSpec};
///
/// // The pendulum 2 a + 5 sin(q) = tau.
/// let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// let (kp, kd) = (Gain::scalar("kp", 1, 100.0)?, Gain::scalar("kd", 1, 20.0)?);
/// let law = LawSpec::from(ComputedTorqueSpec::new(model, Motion::hold(vec![0.5])?, kp, kd)?);
/// let mut tau = [0.0];
/// LawEvaluator::new(&law).input(0.0, &[&[0.3], &[0.1]], None, &mut tau);
/// assert!((tau[0] - (2.0 * (100.0 * 0.2 - 20.0 * 0.1) + 5.0 * 0.3f64.sin())).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ComputedTorqueSpec {
    pub(crate) model: Model,
    /// Desired motion.
    pub motion: Motion,
    /// Position gain, of size `n`, 1/s^2.
    pub kp: Gain,
    /// Velocity gain, of size `n`, 1/s.
    pub kd: Gain,
}

impl ComputedTorqueSpec {
    /// Create the law for a desired motion of `n` joints. Both gains have the size `n`. Errors: `WrongShape` for a wrong size.
    pub fn new(model: Model, motion: Motion, kp: Gain, kd: Gain) -> Result<Self> {
        let n = model.n();
        require_same_dof(n, &motion)?;
        require_size("kp", &kp, n)?;
        require_size("kd", &kd, n)?;
        Ok(ComputedTorqueSpec { model, motion, kp, kd })
    }
}

impl Definition for ComputedTorqueSpec {
    facts!("ComputedTorque", Rigid, motion);

    fn joint_reference(&self) -> Option<JointReference> {
        Some(JointReference::Motion)
    }
}

impl Shape for ComputedTorqueSpec {}

impl Equations for ComputedTorqueSpec {
    fn parameters(&self, _: Option<f64>) -> Parameters {
        Parameters::of_arm(&self.model).gain("kp", &self.kp).gain("kd", &self.kd)
    }

    fn equations(&self, at: &Loop) -> Answer {
        let [q_d, v_d, a_d] = at.desired_terms(0, &["q_d", "v_d", "a_d"]);
        let e = at.term("e", q_d - &at.q);
        let e_dot = at.term("e_dot", v_d - &at.v);
        let a = at.term("a", a_d + at.gain("kd") * &e_dot + at.gain("kp") * &e);
        Answer::new(at.arm().inverse_dynamics(&at.v, &a))
    }
}
