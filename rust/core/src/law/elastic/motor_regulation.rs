//! Regulation of an arm with elastic joints by feedback of the motors, with the desired motor positions `theta_d = q_d + K_J^-1 g(q_d)`:
//!
//! `tau = g + Kp (theta_d - theta) + Kd (theta_d_dot - theta_dot)` (Tomei 1991). Here `g` is `g(q_d)`, or it is computed online,
//! `g(theta - K_J^-1 g(q_d))` (De Luca, Siciliano and Zollo 2005). Feedback of the joint torque `tau_J = K_J (theta - q)` adds
//! `Kt (g(q_d) - tau_J) + Ks (g_dot(q_d) - tau_J_dot)` (Albu-Schaeffer and Hirzinger 2001). `theta` are the motor positions. For a constant
//! target, `theta_d_dot` and `g_dot(q_d)` are zero. For a motion, they are the total derivatives with respect to time. Units are those of
//! revolute joints; for a prismatic joint, replace rad by m and N m by N.

use crate::dynamics::Model;
use crate::error::Result;
use crate::law::definition::{Definition, JointReference, Shape, facts};
use crate::law::equations::{Answer, Equations, Loop};
use crate::law::sizes::{require_rows, require_size};
use crate::linalg::Gain;
use crate::motion::Motion;
use crate::plant::Parameters;
use crate::trace::V;
use crate::trace::expression::time_derivative;

/// Regulation by feedback of the motors, with validated parameters. With `TORQUE`, the joint torque and its rate are fed back too.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, LawSpec, MotorPdSpec, StateFeedbackSpec};
/// use armlet_core::motion::Motion;
/// use armlet_core::plant::{ElasticSpec, PlantSpec};
/// use armlet_core::simulate::{Options, Problem};
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let (stiffness, motors) = (Gain::scalar("stiffness", 2, 2000.0)?, Gain::scalar("motor_inertia", 2, 0.2)?);
/// let plant = PlantSpec::from(ElasticSpec::new(model.clone(), stiffness.clone(), motors.clone(), None, None, None)?);
/// let gain = |k: f64| Gain::scalar("gain", 2, k);
/// let target = Motion::hold(vec![0.4, 0.1])?;
/// let motor = MotorPdSpec::new(model.clone(), target.clone(), gain(150.0)?, gain(30.0)?, stiffness.clone(), false)?;
/// let full = StateFeedbackSpec::new(model, target, [gain(150.0)?, gain(30.0)?, gain(1.0)?, gain(0.01)?], stiffness)?;
/// for law in [LawSpec::from(motor), LawSpec::from(full)] {
///     let run = Problem::from_rest(&plant, &law, &dvector![0.0, 0.0], Options::fixed(5.0, 1e-3))?.run()?;
///     assert!((run.positions().column(run.t.len() - 1) - dvector![0.4, 0.1]).norm() < 1e-2, "{}", law.name());
/// }
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MotorRegulationSpec<const TORQUE: bool> {
    model: Model,
    /// Desired motor positions `theta_d` at rest, or a motion of the links, `q_d`.
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
    /// Gravity torque `g(q_d)` at a constant target, `(n,)`, N m; empty for a motion.
    load: Vec<f64>,
    /// Deflection of the joints at rest, `K_J^-1 g(q_d)`, `(n,)`, rad; empty for a motion.
    sag: Vec<f64>,
}

/// PD control of the motors with gravity compensation.
pub type MotorPdSpec = MotorRegulationSpec<false>;
/// PD control of the motors with gravity compensation, and feedback of the joint torque.
pub type StateFeedbackSpec = MotorRegulationSpec<true>;

impl<const TORQUE: bool> MotorRegulationSpec<TORQUE> {
    fn regulation(model: Model, target: Motion, [kp, kd, kt, ks]: [Gain; 4], joint_stiffness: Gain, online: bool) -> Result<Self> {
        let n = model.n();
        require_rows("target", n, target.dof())?;
        for (name, gain) in [("kp", &kp), ("kd", &kd), ("kt", &kt), ("ks", &ks), ("joint_stiffness", &joint_stiffness)] {
            require_size(name, gain, n)?;
        }
        let (mut load, mut sag, mut target) = (Vec::new(), Vec::new(), target);
        if let Motion::Hold(q) = &mut target {
            crate::error::finite("target", q)?;
            load = model.at(q).gravity().as_slice().to_vec();
            sag = joint_stiffness.inverse().times(&load);
            q.iter_mut().zip(&sag).for_each(|(q, sag)| *q += sag);
        }
        Ok(MotorRegulationSpec { model, target, kp, kd, kt, ks, joint_stiffness, online, load, sag })
    }
}

impl MotorPdSpec {
    /// Create the law. `target` is the position `q_d` of the links, `n` joints, rad. Gains have the size `n`.
    ///
    /// Errors: `WrongShape` for a wrong size, `Input` for a target that is not finite.
    pub fn new(model: Model, target: Motion, kp: Gain, kd: Gain, joint_stiffness: Gain, online: bool) -> Result<Self> {
        let one = Gain::scalar("kt", model.n(), 1.0)?;
        Self::regulation(model, target, [kp, kd, one.clone(), one], joint_stiffness, online)
    }
}

impl StateFeedbackSpec {
    /// Create the law. `gains` are `Kp, Kd, Kt, Ks`, of size `n`. `target` is the position `q_d` of the links, `n` joints, rad. Errors: as for
    /// `MotorPdSpec::new`.
    pub fn new(model: Model, target: Motion, gains: [Gain; 4], joint_stiffness: Gain) -> Result<Self> {
        Self::regulation(model, target, gains, joint_stiffness, false)
    }
}

impl<const TORQUE: bool> Definition for MotorRegulationSpec<TORQUE> {
    facts!(if TORQUE { "StateFeedback" } else { "MotorPD" }, Elastic, target);

    fn joint_reference(&self) -> Option<JointReference> {
        Some(self.link_target().map_or(JointReference::Motion, JointReference::Target))
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
        let Motion::Hold(theta) = &self.target else { return None };
        Some(theta.iter().zip(&self.sag).map(|(theta, sag)| theta - sag).collect())
    }
}

impl<const TORQUE: bool> Shape for MotorRegulationSpec<TORQUE> {
    fn same_shape(&self, other: &Self) -> bool {
        self.online == other.online && self.target.moves() == other.target.moves()
    }
}

impl<const TORQUE: bool> Equations for MotorRegulationSpec<TORQUE> {
    fn parameters(&self, _: Option<f64>) -> Parameters {
        Parameters::of_arm(&self.model)
            .gain("kp", &self.kp)
            .gain("kd", &self.kd)
            .gain("kt", &self.kt)
            .gain("ks", &self.ks)
            .gain("law_joint_stiffness", &self.joint_stiffness)
            .option(self.target.moves().then(|| self.joint_stiffness.inverse()), |numbers, compliance| {
                numbers.gain("law_joint_compliance", &compliance)
            })
            .numbers("gravity_at_target", &self.load)
            .numbers("deflection_at_target", &self.sag)
    }

    fn equations(&self, at: &Loop) -> Answer {
        let k_j = at.gain("law_joint_stiffness");
        let Target { theta_d, sag, g_d, rates } = self.target(at);
        let e = at.term("e", theta_d - &at.theta);
        let tau_j = at.term("tau_J", k_j * &(&at.theta - &at.q));
        let g = at.term("g", self.gravity(at, &g_d, &sag));
        let slip = rates.as_ref().map_or(at.theta_dot.clone(), |[theta_d_dot, _]| &at.theta_dot - theta_d_dot);
        let mut tau = g + at.gain("kp") * &e - at.gain("kd") * &slip;
        if TORQUE {
            let tau_j_dot = k_j * &(&at.theta_dot - &at.v);
            let slip = rates.map_or(tau_j_dot.clone(), |[_, g_d_dot]| tau_j_dot - g_d_dot);
            tau += at.gain("kt") * &(g_d - tau_j) - at.gain("ks") * &slip;
        }
        Answer::new(tau)
    }
}

/// The target at one instant.
struct Target {
    /// Desired motor positions `q_d + K_J^-1 g(q_d)`.
    theta_d: V,
    /// Deflection of the joints at rest, `K_J^-1 g(q_d)`.
    sag: V,
    /// Gravity torque `g(q_d)`.
    g_d: V,
    /// The rates of `theta_d` and of `g_d` along a motion; `None` for a constant target.
    rates: Option<[V; 2]>,
}

impl<const TORQUE: bool> MotorRegulationSpec<TORQUE> {
    fn target(&self, at: &Loop) -> Target {
        if !self.target.moves() {
            let [theta_d, ..] = at.desired_terms(0, &["theta_d"]);
            let [g_d, sag] = ["gravity_at_target", "deflection_at_target"].map(|name| at.vector(name).clone());
            return Target { theta_d, sag, g_d, rates: None };
        }
        let [q_d, v_d, _] = at.desired_terms(0, &["q_d", "v_d"]);
        let compliance = at.gain("law_joint_compliance");
        let g_d = at.arm().at(&q_d).gravity();
        let g_d_dot = time_derivative(&g_d, [&q_d], [&v_d]);
        let sag = compliance * &g_d;
        let theta_d = at.term("theta_d", q_d + &sag);
        let theta_d_dot = at.term("theta_d_dot", v_d + compliance * &g_d_dot);
        Target { theta_d, sag, g_d, rates: Some([theta_d_dot, g_d_dot]) }
    }

    /// The compensated gravity torque: `g(q_d)`, or `g(theta - K_J^-1 g(q_d))` if it is computed online.
    fn gravity(&self, at: &Loop, g_d: &V, sag: &V) -> V {
        if !self.online {
            return g_d.clone();
        }
        let g = at.arm().at(&(&at.theta - sag)).gravity();
        // The difference to the load at the target comes first, because this order rounds the torque.
        g - g_d + g_d
    }
}
