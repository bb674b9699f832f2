//! PD control with gravity compensation (Takegaki and Arimoto 1981): `tau = Kp (q_d - q) + Kd (v_d - v) + g(q)`. The desired velocity `v_d`
//! is zero for a constant target `q_d`.

use super::definition::{Definition, JointReference, Shape, facts};
use super::equations::{Answer, Equations, Loop};
use super::sizes::{require_rows, require_size};
use crate::dynamics::Model;
use crate::error::Result;
use crate::linalg::Gain;
use crate::motion::Motion;
use crate::plant::Parameters;
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
        crate::error::finite("target", &target)?;
        Self::following(model, Motion::Hold(target), kp, kd)
    }

    /// Create the law for a target that moves, `n` joints. Errors: `WrongShape` for a wrong size.
    pub fn following(model: Model, target: Motion, kp: Gain, kd: Gain) -> Result<Self> {
        let n = model.n();
        require_rows("target", n, target.dof())?;
        require_size("kp", &kp, n)?;
        require_size("kd", &kd, n)?;
        Ok(PdGravitySpec { model, target, kp, kd })
    }
}

impl Definition for PdGravitySpec {
    facts!("PDGravity", Rigid, target);

    fn joint_reference(&self) -> Option<JointReference> {
        Some(JointReference::of(&self.target))
    }
    fn outer_stiffness(&mut self) -> Option<&mut Gain> {
        Some(&mut self.kp)
    }
}

impl Shape for PdGravitySpec {
    fn same_shape(&self, other: &Self) -> bool {
        self.target.moves() == other.target.moves()
    }
}

impl Equations for PdGravitySpec {
    fn parameters(&self, _: Option<f64>) -> Parameters {
        Parameters::of_arm(&self.model).gain("kp", &self.kp).gain("kd", &self.kd)
    }

    fn equations(&self, at: &Loop) -> Answer {
        let moves = self.target.moves();
        let [q_d, v_d, _] = at.desired_terms(0, if moves { &["q_d", "v_d"] } else { &["q_d"] });
        let e = at.term("e", q_d - &at.q);
        let g = at.term("g", at.arm().gravity());
        let slip = if moves { &at.v - v_d } else { at.v.clone() };
        Answer::new(g + at.gain("kp") * &e - at.gain("kd") * &slip)
    }
}
