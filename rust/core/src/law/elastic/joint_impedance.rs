//! Joint impedance through elastic joints, with the two loops of Ott, Albu-Schaeffer, Kugi and Hirzinger (2008). The outer loop is PD control
//! of the links with gravity compensation (`pd_gravity`). The inner loop is motor-inertia reduction (`inertia_reduction`):
//!
//! ```text
//! u = K (q_d - q) + D (v_d - v) + g(q)
//! tau = (I - B B0^-1) tau_J + B B0^-1 (u - D0 w),   tau_J = K_J (theta - q),   w = theta_dot or theta_dot - v
//! ```
//!
//! `v_d` is the velocity of the target `q_d`, zero for a constant target. `K` and `D` are the gains `kp` and `kd` of the outer loop. `theta`
//! are the motor positions, and `K_J` is the joint stiffness. `B` is the motor inertia, `B0` its reduced value and `D0` its damping.

use crate::law::PdGravitySpec;
use crate::law::definition::{Definition, JointReference, Shape};
use crate::law::equations::{Answer, Equations, Loop};
use crate::law::inertia_reduction::{ReductionSpec, reduced_facts};
use crate::plant::Parameters;

/// Joint impedance of an arm with elastic joints, with validated parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, JointImpedanceSpec, LawEvaluator, LawSpec, PdGravitySpec, ReductionSpec};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
///
/// let outer = PdGravitySpec::new(model, vec![std::f64::consts::FRAC_PI_2], gain(60.0)?, gain(12.0)?)?;
/// let inner = ReductionSpec::new(1, gain(100.0)?, gain(0.2)?, gain(0.05)?, None, 0.7, false)?;
/// let law = LawSpec::from(JointImpedanceSpec { outer, inner });
/// // At rest at the target, the spring of 100 N m/rad carries 5 N m. The motor has the same torque.
/// let mut tau = [0.0];
/// let (q, theta) = (std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2 + 0.05);
/// LawEvaluator::new(&law).input(0.0, &[&[q], &[0.0], &[theta], &[0.0]], None, &mut tau);
/// assert!((tau[0] - 5.0).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct JointImpedanceSpec {
    /// The outer loop: PD control of the links with gravity compensation.
    pub outer: PdGravitySpec,
    /// The inner loop: the reduction of motor inertia.
    pub inner: ReductionSpec,
}

impl Definition for JointImpedanceSpec {
    reduced_facts!("JointImpedance");

    fn joint_reference(&self) -> Option<JointReference> {
        self.outer.joint_reference()
    }
}

impl Shape for JointImpedanceSpec {
    fn same_shape(&self, other: &Self) -> bool {
        self.outer.same_shape(&other.outer) && self.inner.same_shape(&other.inner)
    }
}

impl Equations for JointImpedanceSpec {
    fn parameters(&self, period: Option<f64>) -> Parameters {
        self.outer.parameters(period).and(self.inner.parameters())
    }

    fn equations(&self, at: &Loop) -> Answer {
        let u = self.outer.equations(at).tau;
        Answer::new(self.inner.torque(at, &u).tau)
    }
}
