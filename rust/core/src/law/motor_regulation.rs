//! Regulation of an arm with elastic joints by feedback of the motors, with the desired motor positions `theta_d = q_d + K_J^-1 g(q_d)`:
//!
//! `tau = g + Kp (theta_d - theta) - Kd theta_dot` (Tomei 1991). Here `g` is `g(q_d)`, or it is computed online, `g(theta - K_J^-1 g(q_d))`
//! (De Luca, Siciliano and Zollo 2005). Feedback of the joint torque `tau_J = K_J (theta - q)` adds `Kt (g(q_d) - tau_J) - Ks tau_J_dot`
//! (Albu-Schaeffer and Hirzinger 2001). `theta` are the motor positions. Units are those of revolute joints; for a prismatic joint, replace
//! rad by m and N m by N.

use super::definition::{Definition, JointReference, Law, Shape, facts};
use super::sizes::{require_rows, require_size};
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::Result;
use crate::linalg::gain::{AnyGain, Gain};
use crate::motion::Motion;
use crate::scalar::Real;
use crate::trace::Sym;

/// Regulation by feedback of the motors, with validated parameters. With `TORQUE`, the joint torque and its rate are fed back too.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, LawSpec, MotorPdSpec, StateFeedbackSpec};
/// use armlet_core::plant::{ElasticSpec, PlantSpec};
/// use armlet_core::simulate::{Options, Problem};
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let (stiffness, motors) = (Gain::scalar("stiffness", 2, 2000.0)?, Gain::scalar("motor_inertia", 2, 0.2)?);
/// let plant = PlantSpec::from(ElasticSpec::new(model.clone(), stiffness.clone(), motors.clone(), None, None, None)?);
/// let gain = |k: f64| Gain::scalar("gain", 2, k);
/// let motor = MotorPdSpec::new(model.clone(), &[0.4, 0.1], gain(150.0)?, gain(30.0)?, stiffness.clone(), false)?;
/// let full = StateFeedbackSpec::new(model, &[0.4, 0.1], [gain(150.0)?, gain(30.0)?, gain(1.0)?, gain(0.01)?], stiffness)?;
/// for law in [LawSpec::from(motor), LawSpec::from(full)] {
///     let run = Problem::from_rest(&plant, &law, &dvector![0.0, 0.0], Options::fixed(5.0, 1e-3))?.run()?;
///     assert!((run.positions().column(run.t.len() - 1) - dvector![0.4, 0.1]).norm() < 1e-2, "{}", law.name());
/// }
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MotorRegulationSpec<const TORQUE: bool> {
    model: Model,
    /// Desired motor positions `theta_d`, as a motion at rest.
    target: Motion,
    /// Position gain `Kp` of the motors, of size `n`, N m/rad.
    pub kp: Gain,
    /// Velocity gain `Kd` of the motors, of size `n`, N m s/rad.
    pub kd: Gain,
    /// Gain `Kt` of the joint torque; the identity, unused, without torque feedback.
    kt: Gain,
    /// Gain `Ks` of the rate of the joint torque, s; the identity, unused, without torque feedback.
    ks: Gain,
    joint_stiffness: Gain,
    /// Whether gravity is computed from the motor positions, instead of at the target.
    online: bool,
    /// Gravity torque `g(q_d)` at the target, `(n,)`, N m.
    load: Vec<f64>,
    /// Deflection of the joints at rest, `K_J^-1 g(q_d)`, `(n,)`, rad.
    sag: Vec<f64>,
}

/// PD control of the motors with gravity compensation.
pub type MotorPdSpec = MotorRegulationSpec<false>;
/// PD control of the motors with gravity compensation, and feedback of the joint torque.
pub type StateFeedbackSpec = MotorRegulationSpec<true>;

impl<const TORQUE: bool> MotorRegulationSpec<TORQUE> {
    fn regulation(model: Model, target: &[f64], [kp, kd, kt, ks]: [Gain; 4], joint_stiffness: Gain, online: bool) -> Result<Self> {
        let n = model.n();
        require_rows("target", n, target.len())?;
        crate::error::finite("target", target)?;
        for (name, gain) in [("kp", &kp), ("kd", &kd), ("kt", &kt), ("ks", &ks), ("joint_stiffness", &joint_stiffness)] {
            require_size(name, gain, n)?;
        }
        let mut load = vec![0.0; n];
        model.at(target).gravity(&mut load);
        let sag = joint_stiffness.inverse().times(&load);
        let theta = target.iter().zip(&sag).map(|(q, s)| q + s).collect();
        Ok(MotorRegulationSpec { model, target: Motion::Hold(theta), kp, kd, kt, ks, joint_stiffness, online, load, sag })
    }
}

impl MotorPdSpec {
    /// Create the law. `target` is the position `q_d` of the links, `(n,)`, rad. Gains have the size `n`.
    ///
    /// Errors: `WrongShape` for a wrong size, `Input` for a target that is not finite.
    pub fn new(model: Model, target: &[f64], kp: Gain, kd: Gain, joint_stiffness: Gain, online: bool) -> Result<Self> {
        let one = Gain::scalar("kt", model.n(), 1.0)?;
        Self::regulation(model, target, [kp, kd, one.clone(), one], joint_stiffness, online)
    }
}

impl StateFeedbackSpec {
    /// Create the law. `gains` are `Kp, Kd, Kt, Ks`, of size `n`. `target` is the position `q_d` of the links, `(n,)`, rad. Errors: as for
    /// `MotorPdSpec::new`.
    pub fn new(model: Model, target: &[f64], gains: [Gain; 4], joint_stiffness: Gain) -> Result<Self> {
        Self::regulation(model, target, gains, joint_stiffness, false)
    }
}

impl<const TORQUE: bool> Definition for MotorRegulationSpec<TORQUE> {
    facts!(if TORQUE { "StateFeedback" } else { "MotorPD" }, Elastic, target);

    fn joint_reference(&self) -> Option<JointReference> {
        self.link_target().map(JointReference::Target)
    }
    fn joint_stiffness(&self) -> Option<&Gain> {
        Some(&self.joint_stiffness)
    }
    /// The matrix `(I + Kt)^-1`; the identity without torque feedback.
    fn torque_share(&self) -> Option<Gain> {
        let n = self.model.n();
        let fed = |k: usize| if TORQUE { self.kt.at(k / n, k % n) } else { 0.0 };
        let sum = (0..n * n).map(|k| fed(k) + f64::from(u8::from(k / n == k % n))).collect();
        Some(Gain::unchecked(n, sum).inverse())
    }
    fn link_target(&self) -> Option<Vec<f64>> {
        let mut sample = vec![0.0; 3 * self.sag.len()];
        self.target.sample(0.0, &mut sample);
        Some(sample.iter().zip(&self.sag).map(|(theta, sag)| theta - sag).collect())
    }
}

impl<const TORQUE: bool> Shape for MotorRegulationSpec<TORQUE> {
    fn same_shape(&self, other: &Self) -> bool {
        self.online == other.online
    }
}

impl<const TORQUE: bool> MotorRegulationSpec<TORQUE> {
    pub(super) fn build(&self) -> MotorRegulation<TORQUE> {
        let arm = AnyArm::new(&self.model);
        let n = self.model.n();
        let zeros = vec![Sym::zero(); n];
        MotorRegulation {
            workspace: arm.workspace(),
            arm,
            gains: [
                AnyGain::labelled("kp", &self.kp),
                AnyGain::labelled("kd", &self.kd),
                AnyGain::labelled("kt", &self.kt),
                AnyGain::labelled("ks", &self.ks),
            ],
            joint_stiffness: AnyGain::labelled("law_joint_stiffness", &self.joint_stiffness),
            online: self.online,
            load: self.load.iter().map(|&x| Sym::varying(x)).collect(),
            sag: self.sag.iter().map(|&x| Sym::varying(x)).collect(),
            trig: vec![(Sym::zero(), Sym::zero()); n],
            spring: zeros.clone(),
            part: zeros.clone(),
            work: zeros,
        }
    }
}

/// Regulation by feedback of the motors in a control loop.
pub struct MotorRegulation<const TORQUE: bool> {
    arm: AnyArm<Sym>,
    workspace: Workspace<Sym>,
    gains: [AnyGain<Sym>; 4],
    joint_stiffness: AnyGain<Sym>,
    online: bool,
    load: Vec<Sym>,
    sag: Vec<Sym>,
    trig: Vec<(Sym, Sym)>,
    spring: Vec<Sym>,
    part: Vec<Sym>,
    work: Vec<Sym>,
}

impl<const TORQUE: bool> MotorRegulation<TORQUE> {
    /// Write the compensated gravity torque to `self.part`.
    fn compensate(&mut self, theta: &[Sym]) {
        if !self.online {
            self.part.copy_from_slice(&self.load);
            return;
        }
        for i in 0..theta.len() {
            self.work[i] = theta[i] - self.sag[i];
            self.trig[i] = self.work[i].sin_cos();
        }
        self.arm.gravity(&mut self.workspace, &self.trig, &self.work, &mut self.part);
        for i in 0..theta.len() {
            // The difference to the load at the target comes first, because this order rounds the torque.
            self.part[i] = self.part[i] - self.load[i] + self.load[i];
        }
    }
}

impl<const TORQUE: bool> MotorRegulation<TORQUE> {
    /// Name the target, the error, the torque of the springs, and the compensated gravity torque `g`.
    fn name_terms(&self, desired: &[Sym], [q, theta]: [&[Sym]; 2], g: &[Sym]) {
        let n = q.len();
        Sym::term("theta_d", &[n], || desired[..n].to_vec());
        Sym::term("e", &[n], || self.work.clone());
        Sym::term("tau_J", &[n], || {
            let (stretch, mut spring): (Vec<Sym>, _) = ((0..n).map(|i| theta[i] - q[i]).collect(), vec![Sym::zero(); n]);
            self.joint_stiffness.multiply(&stretch, &mut spring);
            spring
        });
        Sym::term("g", &[n], || g.to_vec());
    }
}

impl<const TORQUE: bool> Law for MotorRegulation<TORQUE> {
    fn evaluate(&mut self, desired: &[Sym], _: &[(Sym, Sym)], x: &[Sym], _: &[Sym], tau: &mut [Sym], _: &mut [Sym]) {
        let n = tau.len();
        let (q, v, theta, theta_dot) = (&x[..n], &x[n..2 * n], &x[2 * n..3 * n], &x[3 * n..4 * n]);
        self.compensate(theta);
        tau.copy_from_slice(&self.part);
        for i in 0..n {
            self.work[i] = desired[i] - theta[i];
            self.part[i] = -theta_dot[i];
        }
        self.name_terms(desired, [q, theta], tau);
        self.gains[0].add_to(&self.work, tau);
        self.gains[1].add_to(&self.part, tau);
        if TORQUE {
            for i in 0..n {
                self.work[i] = theta[i] - q[i];
            }
            self.joint_stiffness.multiply(&self.work, &mut self.spring);
            for i in 0..n {
                self.work[i] = self.load[i] - self.spring[i];
                self.part[i] = v[i] - theta_dot[i];
            }
            self.gains[2].add_to(&self.work, tau);
            self.joint_stiffness.multiply(&self.part, &mut self.spring);
            self.gains[3].add_to(&self.spring, tau);
        }
    }
}
