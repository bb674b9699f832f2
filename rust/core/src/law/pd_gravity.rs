//! PD control with gravity compensation (Takegaki and Arimoto 1981): `tau = Kp (q_d - q) - Kd v + g(q)`.

use super::definition::{Definition, JointReference, Law, Shape, facts};
use super::sizes::{require_rows, require_size};
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::Result;
use crate::linalg::gain::{AnyGain, Gain};
use crate::motion::Motion;
use crate::scalar::Real;
use crate::trace::Sym;
use nalgebra::DVector;

/// PD control with gravity compensation, with validated parameters.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, LawSpec, PdGravitySpec};
/// use armlet_core::plant::{PlantSpec, RigidSpec};
/// use armlet_core::simulate::{Options, Problem};
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let target = dvector![0.5, -0.2];
/// let law = PdGravitySpec::new(model.clone(), target.clone(), Gain::scalar("kp", 2, 40.0)?, Gain::scalar("kd", 2, 8.0)?)?;
/// let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model)));
/// let run = Problem::from_rest(&plant, &law, &dvector![0.0, 0.0], Options::adaptive(8.0))?.run()?;
/// assert!((run.positions().column(run.t.len() - 1) - target).norm() < 1e-3);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PdGravitySpec {
    model: Model,
    target: Motion,
    /// Position gain, of size `n`, N m/rad or N/m.
    pub kp: Gain,
    /// Velocity gain, of size `n`, N m s/rad or N s/m.
    pub kd: Gain,
}

impl PdGravitySpec {
    /// Create the law for a target position `(n,)`, rad or m. Both gains have the size `n`.
    ///
    /// Errors: `WrongShape` for a wrong size, `Input` for a target that is not finite.
    pub fn new(model: Model, target: impl Into<DVector<f64>>, kp: Gain, kd: Gain) -> Result<Self> {
        let target = Vec::from(target.into().data);
        let n = model.n();
        require_rows("target", n, target.len())?;
        crate::error::finite("target", &target)?;
        require_size("kp", &kp, n)?;
        require_size("kd", &kd, n)?;
        Ok(PdGravitySpec { model, target: Motion::Hold(target), kp, kd })
    }
}

impl Definition for PdGravitySpec {
    facts!("PDGravity", Rigid, target);

    fn joint_reference(&self) -> Option<JointReference> {
        Some(JointReference::held(&self.target))
    }
    fn outer_stiffness(&mut self) -> Option<&mut Gain> {
        Some(&mut self.kp)
    }
}

impl Shape for PdGravitySpec {}

impl PdGravitySpec {
    pub(super) fn build(&self) -> PdGravity {
        let arm = AnyArm::new(&self.model);
        PdGravity {
            workspace: arm.workspace(),
            work: vec![Sym::zero(); self.model.n()],
            arm,
            kp: AnyGain::labelled("kp", &self.kp),
            kd: AnyGain::labelled("kd", &self.kd),
        }
    }
}

/// PD control with gravity compensation in a control loop.
pub struct PdGravity {
    arm: AnyArm<Sym>,
    workspace: Workspace<Sym>,
    kp: AnyGain<Sym>,
    kd: AnyGain<Sym>,
    work: Vec<Sym>,
}

impl Law for PdGravity {
    fn evaluate(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], _: &[Sym], tau: &mut [Sym], _: &mut [Sym]) {
        let n = tau.len();
        let (q, v) = (&x[..n], &x[n..2 * n]);
        self.arm.gravity(&mut self.workspace, trig, q, tau);
        for i in 0..n {
            self.work[i] = desired[i] - q[i];
        }
        Sym::term("q_d", &[n], || desired[..n].to_vec());
        Sym::term("e", &[n], || self.work.clone());
        Sym::term("g", &[n], || tau.to_vec());
        self.kp.add_to(&self.work, tau);
        for i in 0..n {
            self.work[i] = -v[i];
        }
        self.kd.add_to(&self.work, tau);
    }
}
