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
use super::lugre::LoopLuGre;
use super::rigid::{Links, bristles, loop_bristles, loop_stick_slip};
use super::stick_slip::{Load, LoopStickSlip};
use super::stops::Stops;
use super::{Definition, JointFriction, Mode, Plant, Power, Wall};
use crate::dynamics::Model;
use crate::error::{Error, Result, finite};
use crate::linalg::gain::{AnyGain, Gain};
use crate::scalar::{Real, labelled_numbers};
use crate::trace::Sym;

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
        let mut g = vec![0.0; q.len()];
        self.model.at(q).gravity(&mut g);
        let deflection = self.stiffness.inverse().times(&g);
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

/// An arm with elastic joints in a control loop.
pub struct Elastic {
    links: Links,
    stiffness: AnyGain<Sym>,
    inverse_inertia: AnyGain<Sym>,
    joint_damping: Vec<Sym>,
    motor_friction: Vec<Sym>,
    bristles: Option<LoopLuGre>,
    sticking: Option<LoopStickSlip<Sym>>,
    /// The deflection `theta - q`, later the torque that accelerates the motors.
    work: Vec<Sym>,
}

impl ElasticSpec {
    pub(super) fn build(&self, force_frame: Option<usize>) -> Elastic {
        let dry = self.dry.as_ref();
        Elastic {
            links: Links::new(&self.model, self.wall.as_ref(), self.stops.as_ref(), force_frame),
            stiffness: AnyGain::labelled("joint_stiffness", &self.stiffness),
            inverse_inertia: AnyGain::labelled("inverse_motor_inertia", &self.inverse_inertia),
            joint_damping: labelled_numbers("joint_damping", &self.joint_damping),
            motor_friction: labelled_numbers("motor_friction", &self.motor_friction),
            bristles: loop_bristles(dry),
            sticking: loop_stick_slip(dry, false).map(|sticking| with_inertia(sticking, &self.motor_inertia)),
            work: vec![Sym::zero(); self.model.n()],
        }
    }
}

/// Copy the motor inertia `B`, which is constant, to the mass matrix of the stick-slip friction.
fn with_inertia(mut sticking: LoopStickSlip<Sym>, inertia: &Gain) -> LoopStickSlip<Sym> {
    let n = inertia.n();
    for (k, entry) in sticking.matrix.iter_mut().enumerate() {
        *entry = Sym::varying(inertia.at(k / n, k % n));
    }
    sticking
}

/// Write the torques on the motors and their loads `tau_J` to the stick-slip friction.
fn load(sticking: &mut LoopStickSlip<Sym>, drive: &[Sym], joint: &[Sym]) {
    sticking.drive.copy_from_slice(drive);
    for (load, &joint) in sticking.loads.iter_mut().zip(joint) {
        *load = Load::Known(joint);
    }
}

impl Plant for Elastic {
    fn rates(&mut self, trig: &[(Sym, Sym)], x: &[Sym], tau: &[Sym], wrench: &[Sym], dx: &mut [Sym]) -> Power {
        let n = self.links.n;
        let (q, v, theta, theta_dot) = (&x[..n], &x[n..2 * n], &x[2 * n..3 * n], &x[3 * n..4 * n]);
        let (mut input, mut outside) = (Sym::zero(), Sym::zero());
        for i in 0..n {
            self.work[i] = theta[i] - q[i];
        }
        self.stiffness.multiply(&self.work, &mut self.links.effort);
        for i in 0..n {
            let slip = theta_dot[i] - v[i];
            let damped = self.joint_damping[i] * slip;
            let rubbed = self.motor_friction[i] * theta_dot[i];
            self.links.effort[i] += damped;
            self.work[i] = tau[i] - self.links.effort[i] - rubbed;
            input = tau[i].mul_add(theta_dot[i], input);
            outside = outside - damped * slip - rubbed * theta_dot[i];
            (dx[i], dx[2 * n + i]) = (v[i], theta_dot[i]);
        }
        if let Some(bristles) = &self.bristles {
            for i in 0..n {
                let rubbing = bristles.rub(i, theta_dot[i], x[4 * n + i], self.links.effort[i]);
                self.work[i] -= rubbing.torque;
                dx[4 * n + i] = rubbing.z_dot;
                outside -= rubbing.lost;
            }
        }
        match &mut self.sticking {
            None => self.inverse_inertia.multiply(&self.work, &mut dx[3 * n..4 * n]),
            Some(sticking) => {
                load(sticking, &self.work, &self.links.effort);
                sticking.slide(theta_dot);
                sticking.hold(&mut dx[3 * n..4 * n]);
                for i in 0..n {
                    outside = sticking.torque()[i].neg_mul_add(theta_dot[i], outside);
                }
            }
        }
        outside += self.links.add_outside(trig, q, v, wrench);
        self.links.accelerate(trig, q, v, &mut dx[n..2 * n]);
        Power { input, outside }
    }

    fn hold(&mut self, contacts: &mut dyn Iterator<Item = Mode<Sym>>) {
        self.links.hold(contacts);
    }

    fn contact(&mut self, i: usize, trig: &[(Sym, Sym)], x: &[Sym]) -> [Sym; 2] {
        let n = self.links.n;
        self.links.contact(i, trig, &x[..n], &x[n..2 * n])
    }

    fn stick_slip(&mut self) -> Option<(&mut LoopStickSlip<Sym>, usize)> {
        Some((self.sticking.as_mut()?, 3 * self.links.n))
    }

    fn load_friction(&mut self, _: &[(Sym, Sym)], x: &[Sym], tau: &[Sym], _: &[Sym]) {
        let (Some(sticking), n) = (&mut self.sticking, self.links.n) else { return };
        for i in 0..n {
            self.work[i] = x[2 * n + i] - x[i];
        }
        self.stiffness.multiply(&self.work, &mut self.links.effort);
        for i in 0..n {
            let (v, theta_dot) = (x[n + i], x[3 * n + i]);
            self.links.effort[i] += self.joint_damping[i] * (theta_dot - v);
            self.work[i] = tau[i] - self.links.effort[i] - self.motor_friction[i] * theta_dot;
        }
        load(sticking, &self.work, &self.links.effort);
    }
}
