//! Computed torque (inverse-dynamics control):
//!
//! `tau = M(q) (a_d + Kd e_dot + Kp e) + C(q, v) v + g(q)`, so that `e_ddot + Kd e_dot + Kp e = 0` for the error `e = q_d - q` of a plant
//! that equals the law's model. `Kp` is in 1/s^2 and `Kd` in 1/s.

use super::definition::{Definition, JointReference, Law, Shape, facts};
use super::sizes::{require_same_dof, require_size};
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::Result;
use crate::linalg::gain::{AnyGain, Gain};
use crate::motion::Motion;
use crate::scalar::Real;
use crate::trace::Sym;

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

impl ComputedTorqueSpec {
    pub(super) fn build(&self) -> ComputedTorque {
        let (arm, zeros) = (AnyArm::new(&self.model), vec![Sym::zero(); self.model.n()]);
        ComputedTorque {
            workspace: arm.workspace(),
            arm,
            kp: AnyGain::labelled("kp", &self.kp),
            kd: AnyGain::labelled("kd", &self.kd),
            e: zeros.clone(),
            e_dot: zeros.clone(),
            kp_e: zeros.clone(),
            command: zeros,
        }
    }
}

/// The computed-torque law in a control loop.
pub struct ComputedTorque {
    arm: AnyArm<Sym>,
    workspace: Workspace<Sym>,
    kp: AnyGain<Sym>,
    kd: AnyGain<Sym>,
    e: Vec<Sym>,
    e_dot: Vec<Sym>,
    kp_e: Vec<Sym>,
    command: Vec<Sym>,
}

impl Law for ComputedTorque {
    fn evaluate(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], _: &[Sym], tau: &mut [Sym], _: &mut [Sym]) {
        let n = tau.len();
        let (q, v) = (&x[..n], &x[n..2 * n]);
        let ComputedTorque { e, e_dot, kp_e, command, .. } = self;
        for i in 0..n {
            e[i] = desired[i] - q[i];
            e_dot[i] = desired[n + i] - v[i];
        }
        self.kp.multiply(e, kp_e);
        self.kd.multiply(e_dot, command);
        for i in 0..n {
            command[i] += kp_e[i] + desired[2 * n + i];
        }
        Sym::term("q_d", &[n], || desired[..n].to_vec());
        Sym::term("v_d", &[n], || desired[n..2 * n].to_vec());
        Sym::term("a_d", &[n], || desired[2 * n..].to_vec());
        Sym::term("e", &[n], || e.clone());
        Sym::term("e_dot", &[n], || e_dot.clone());
        Sym::term("a", &[n], || command.clone());
        self.arm.inverse_dynamics(&mut self.workspace, trig, q, v, command, tau);
    }
}
