//! Cartesian impedance (Hogan 1985): a spring and a damper between a frame and its target, with gravity compensation:
//!
//! `tau = J' (K_m e + D_m (x_d_dot - J v)) + g(q)`, `e = x_d - x` (orientation: `log(R_d R')`). The law controls any selection of the rows
//! of position and orientation. `x` and `R` are position and rotation matrix of the frame, `J` is the Jacobian of the controlled rows, and
//! `'` the transpose. The law uses no inverse of `J`, so it is defined at singularities. Two options ([`ImpedanceOptions`]) do use an
//! inverse: the null space and the compensation of the coupling. They clamp its singular values.
//!
//! The orientation of a moving target is a rotation vector. Its components in rows that are not controlled are zero. In the rows of
//! orientation, `x_d_dot` and `x_d_ddot` are the angular velocity and the angular acceleration of the target.

use super::options::{ImpedanceOptions, held};
use crate::dynamics::Model;
use crate::error::{Error, Result};
use crate::kinematics::Coordinates;
use crate::law::definition::{Definition, Shape};
use crate::law::equations::{Answer, Equations, Loop};
use crate::law::sizes::require_size;
use crate::linalg::Gain;
use crate::motion::Motion;
use crate::plant::{Parameters, PlantKind};
use crate::spatial::{Vector, Vector3, rotation_rate};
use crate::trace::expression::{clamp, zeros};
use crate::trace::{E, M, V};

/// The Cartesian impedance law of an arm, with validated parameters.
///
/// ```
/// use armlet_core::analysis::equilibrium::equilibrium;
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{CartesianImpedanceSpec, Gain, LawSpec};
/// use armlet_core::motion::Motion;
/// use armlet_core::plant::{PlantSpec, RigidSpec};
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let (stiffness, damping) = (Gain::scalar("stiffness", 2, 200.0)?, Gain::scalar("damping", 2, 20.0)?);
/// let target = Motion::hold(dvector![0.6, 0.3])?;
/// let law = LawSpec::from(CartesianImpedanceSpec::new(model.clone(), target, stiffness, damping, "link2", "xy")?);
/// let tip = Some(model.tree("arm")?.frame_index("link2")?);
/// let plant = PlantSpec::from(RigidSpec::new(model));
/// // A force of 10 N along x moves the equilibrium of the tip by F / K = 0.05 m.
/// let rest = equilibrium(&plant, &law, &[10.0, 0.0, 0.0, 0.0, 0.0, 0.0], tip, &[0.9, -1.2])?;
/// assert!(rest.reachable && rest.stable);
/// assert!((rest.x[0] - 0.65).abs() < 1e-6 && (rest.x[1] - 0.3).abs() < 1e-6);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CartesianImpedanceSpec {
    /// The model of the arm.
    pub model: Model,
    /// The controlled rows: the frame and its `m` axes.
    pub coordinates: Coordinates,
    /// Target motion of the rows, `(m,)`, m and rad. For a fixed pose, use a motion with constant position.
    pub target: Motion,
    /// Stiffness `K_m`, of size `m`, N/m and N m/rad.
    pub stiffness: Gain,
    /// Damping `D_m`, of size `m`, N s/m and N m s/rad.
    pub damping: Gain,
    pub(in crate::law) options: ImpedanceOptions,
    /// The integral at the start of a run: zeros, `(m,)`; empty without an integral.
    start: Vec<f64>,
}

impl CartesianImpedanceSpec {
    /// Create the law for the rows `axes` of `frame`. `target`, `stiffness` and `damping` have one row per axis.
    ///
    /// Errors: `Unknown` for the name of the frame, `WrongShape` for a wrong size, `Input` for invalid axes or the planar PR arm.
    pub fn new(model: Model, target: Motion, stiffness: Gain, damping: Gain, frame: &str, axes: &str) -> Result<Self> {
        let coordinates = Coordinates::new(model.tree("arm")?, frame, axes)?;
        let m = coordinates.m();
        if target.dof() != m {
            return Err(Error::wrong("target", "shape", format!("({m},) for axes {axes:?}"), format!("({},)", target.dof())));
        }
        require_size("stiffness", &stiffness, m)?;
        require_size("damping", &damping, m)?;
        Ok(CartesianImpedanceSpec {
            model,
            coordinates,
            target,
            stiffness,
            damping,
            options: ImpedanceOptions::default(),
            start: Vec::new(),
        })
    }

    /// Replace the options of the law. Errors: `WrongShape` for a wrong size; `Input` for an `eps` or a limit out of range, or numbers that
    /// are not finite.
    pub fn with(self, options: ImpedanceOptions) -> Result<Self> {
        let m = self.coordinates.m();
        options.validate(m, self.model.n()).map_err(|error| self.model.name_limit(error))?;
        let start = vec![0.0; if options.integral_gain.is_some() { m } else { 0 }];
        Ok(CartesianImpedanceSpec { options, start, ..self })
    }

    /// The options of the law.
    pub fn options(&self) -> &ImpedanceOptions {
        &self.options
    }

    pub(in crate::law) fn without_torque_limits(mut self) -> Self {
        self.options.tau_max = None;
        self
    }

    /// Whether the target has a rotation vector that changes with time.
    pub fn turns_target(&self) -> bool {
        self.coordinates.turns() && self.target.moves()
    }
}

impl Definition for CartesianImpedanceSpec {
    fn name(&self) -> &'static str {
        "CartesianImpedance"
    }
    fn plant(&self) -> PlantKind {
        PlantKind::Rigid
    }
    fn model(&self) -> &Model {
        &self.model
    }
    fn motions(&self) -> Vec<&Motion> {
        std::iter::once(&self.target).chain(self.options.null_space.as_ref().map(|null_space| &null_space.posture)).collect()
    }
    fn initial_state(&self) -> &[f64] {
        &self.start
    }

    fn coordinates(&self) -> Option<&Coordinates> {
        Some(&self.coordinates)
    }
    fn outer_stiffness(&mut self) -> Option<&mut Gain> {
        Some(&mut self.stiffness)
    }
}

impl Shape for CartesianImpedanceSpec {
    fn same_shape(&self, other: &Self) -> bool {
        self.options.same_shape(&other.options) && self.turns_target() == other.turns_target()
    }
}

impl Equations for CartesianImpedanceSpec {
    fn parameters(&self, _: Option<f64>) -> Parameters {
        Parameters::of_arm(&self.model).gain("stiffness", &self.stiffness).gain("damping", &self.damping).and(self.options.parameters())
    }

    fn equations(&self, at: &Loop) -> Answer {
        let Impedance { tau, z_dot, j, .. } = self.impedance(at);
        let [tau, z_dot] = self.options.limited(at, tau, z_dot, |wrench| j.tr_mul(wrench));
        Answer::with_rate(at.term("u", tau), self.name_integral(at, z_dot))
    }
}

/// The result of an impedance law, before the limits of the torque.
pub(in crate::law) struct Impedance {
    /// Torque, `(n,)`, N m or N.
    pub tau: V,
    /// Rate of the integral wrench, `(m,)` or empty, N/s and N m/s.
    pub z_dot: V,
    /// Jacobian of the controlled rows, `(m, n)`.
    pub j: M,
    /// The power `x_dot.(force) + (x_d_dot - x_dot).K_m e + v.tau_n`, W. Its first and last term are the power of the wrench on the frame and
    /// of the torque `tau_n` of null space and coupling. The other one is the rate of the spring's energy. For a target at rest and without
    /// options it is `-x_dot' D_m x_dot`.
    pub power: E,
}

impl CartesianImpedanceSpec {
    /// The torque `J' F + g + tau_n` of the law.
    pub(in crate::law) fn impedance(&self, at: &Loop) -> Impedance {
        let arm = at.arm();
        let [x_d, mut x_d_dot, mut x_d_ddot] = at.desired(0);
        if self.turns_target() {
            [x_d_dot, x_d_ddot] = turn_rates(&self.coordinates.rows, [&x_d, &x_d_dot, &x_d_ddot]);
        }
        let (e, j) = arm.error_and_jacobian(&self.coordinates, &x_d);
        let x_dot = &j * &at.v;
        if at.collects_terms() {
            at.term("x", arm.coordinates(&self.coordinates));
            at.term("x_d", x_d);
            at.term("x_dot", x_dot.clone());
        }
        let (e, j) = (at.term("e", e), at.matrix_term("J", j));

        let (spring, slip) = (at.gain("stiffness") * &e, x_d_dot - &x_dot);
        let mut force = &spring + at.gain("damping") * &slip;
        let mut z_dot = zeros(at.z.len());
        if self.options.feedforward.is_some() {
            force += at.vector("feedforward");
        }
        if self.options.integral_gain.is_some() {
            force += &at.z;
            z_dot = at.gain("integral_gain") * &e;
        }
        if self.options.wrench_max.is_some() {
            let limit = at.vector("law_wrench_max");
            z_dot = V::from_fn(z_dot.len(), |k, _| held(force[k], limit[k], z_dot[k], z_dot[k]));
            force = clamp(&force, limit);
        }
        let [tau_n, coupling] = self.null_space(at, &j, &x_d_ddot);
        let force = at.term("force", force + coupling);
        Impedance {
            tau: arm.gravity() + j.tr_mul(&force) + &tau_n,
            z_dot,
            power: x_dot.dot(&force) + slip.dot(&spring) + at.v.dot(&tau_n),
            j,
        }
    }

    /// Name the integral wrench and its rate, if the law has one, and return the rate.
    pub(in crate::law) fn name_integral(&self, at: &Loop, z_dot: V) -> V {
        if self.options.integral_gain.is_none() {
            return z_dot;
        }
        at.term("integral", at.z.clone());
        at.term("integral_rate", z_dot)
    }
}

/// The angular velocity and the angular acceleration of a target in the rows of orientation. The other rows keep their rates. `desired` is a
/// sample whose rows of orientation are a rotation vector that changes with time.
pub(crate) fn turn_rates(rows: &[usize], desired: [&V; 3]) -> [V; 2] {
    let turning = || rows.iter().enumerate().filter(|(_, row)| **row > 2);
    let [turn, rate, second] = desired.map(|x| {
        let mut vector = Vector3::zero();
        turning().for_each(|(at, row)| vector[row - 3] = x[at]);
        vector
    });
    let (velocity, acceleration) = rotation_rate(turn, rate, second);
    let (mut rate, mut second) = (desired[1].clone(), desired[2].clone());
    turning().for_each(|(at, row)| (rate[at], second[at]) = (velocity[row - 3], acceleration[row - 3]));
    [rate, second]
}
