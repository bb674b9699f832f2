//! An arm with elastic joints (Spong 1987): links and motors coupled by springs,
//!
//! `M(q) a + C(q, v) v + g(q) = tau_J + J' W`, `B theta_ddot + F theta_dot + tau_J = tau`,
//! `tau_J = K (theta - q) + D (theta_dot - v)`, `x = [q, v, theta, theta_dot]`.

use super::rigid::Links;
use super::stops::Stops;
use super::{Build, Definition, Plant, Power, Touch, Wall};
use crate::dynamics::Model;
use crate::error::{Error, Result, finite};
use crate::linalg::gain::{AnyGain, Gain, Multiply};
use crate::scalar::Real;

/// An arm with elastic joints, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct ElasticSpec {
    /// The links.
    pub model: Model,
    /// `K`, N m/rad.
    pub stiffness: Gain,
    /// `B`, kg m^2.
    pub motor_inertia: Gain,
    /// `D` in parallel with the springs, N m s/rad, `(n,)`, >= 0.
    pub joint_damping: Vec<f64>,
    /// Viscous friction `F` of the motors, N m s/rad, `(n,)`, >= 0.
    pub motor_friction: Vec<f64>,
    /// A wall that a frame may touch.
    pub wall: Option<Wall>,
    /// Of the links.
    pub stops: Option<Stops>,
    inverse_inertia: Gain,
}

impl ElasticSpec {
    /// An arm of these links, joint stiffness and motor inertia.
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
                return Err(Error::input(name, format!("has the wrong size: expected {n}, got {}", gain.n())));
            }
        }
        let dissipative = |name: &str, values: Option<Vec<f64>>| -> Result<Vec<f64>> {
            let values = values.unwrap_or_else(|| vec![0.0; n]);
            if values.len() != n {
                return Err(Error::input(name, format!("has the wrong shape: expected ({n},), got ({},)", values.len())));
            }
            finite(name, &values)?;
            match values.iter().position(|&d| d < 0.0) {
                Some(i) => Err(Error::input(name, format!("is negative: expected >= 0, got {} (first bad index {i})", values[i]))),
                None => Ok(values),
            }
        };
        let (joint_damping, motor_friction) =
            (dissipative("joint_damping", joint_damping)?, dissipative("motor_friction", motor_friction)?);
        let inverse_inertia = motor_inertia.inverse();
        Ok(ElasticSpec { model, stiffness, motor_inertia, joint_damping, motor_friction, wall, stops: None, inverse_inertia })
    }

    /// The same plant with joint stops.
    pub fn with_stops(self, stops: Option<Stops>) -> Self {
        ElasticSpec { stops, ..self }
    }

    /// The motor position at which the springs carry gravity: `theta = q + K^-1 g(q)`.
    pub fn resting_motor(&self, q: &[f64]) -> Vec<f64> {
        let mut g = vec![0.0; q.len()];
        self.model.at(q).gravity(&mut g);
        let deflection = self.stiffness.inverse().times(&g);
        q.iter().zip(&deflection).map(|(q, d)| q + d).collect()
    }
}

impl Definition for ElasticSpec {
    fn model(&self) -> &Model {
        &self.model
    }

    fn wall(&self) -> Option<&Wall> {
        self.wall.as_ref()
    }

    fn stops(&self) -> Option<&Stops> {
        self.stops.as_ref()
    }

    fn elastic(&self) -> Option<&ElasticSpec> {
        Some(self)
    }

    fn initial_state(&self, q0: &[f64], v0: &[f64], theta0: Option<&[f64]>, theta_dot0: Option<&[f64]>) -> Vec<f64> {
        let resting = || self.resting_motor(q0);
        let theta = theta0.map_or_else(resting, <[f64]>::to_vec);
        [q0, v0, &theta, theta_dot0.unwrap_or(v0)].concat()
    }
}

/// The plant in a loop.
pub struct Elastic<S: Real> {
    links: Links<S>,
    stiffness: AnyGain<S>,
    inverse_inertia: AnyGain<S>,
    joint_damping: Vec<S>,
    motor_friction: Vec<S>,
    /// `theta - q`, then what is left for the motors.
    work: Vec<S>,
}

impl Build for ElasticSpec {
    type Lanes<S: Real> = Elastic<S>;

    fn build<'a, S: Real>(of: impl Fn(usize) -> &'a Self, force_frame: Option<usize>) -> Elastic<S> {
        let n = of(0).model.n();
        Elastic {
            links: Links::new(|i| &of(i).model, |i| of(i).wall.as_ref(), |i| of(i).stops.as_ref(), force_frame),
            stiffness: AnyGain::labelled("joint_stiffness", |i| &of(i).stiffness),
            inverse_inertia: AnyGain::labelled("inverse_motor_inertia", |i| &of(i).inverse_inertia),
            joint_damping: S::labelled("joint_damping", 1, || (0..n).map(|k| S::from_lanes(|i| of(i).joint_damping[k])).collect()),
            motor_friction: S::labelled("motor_friction", 1, || (0..n).map(|k| S::from_lanes(|i| of(i).motor_friction[k])).collect()),
            work: vec![S::zero(); n],
        }
    }
}

impl<S: Real> Plant<S> for Elastic<S> {
    fn rates(&mut self, trig: &[(S, S)], x: &[S], tau: &[S], wrench: &[S], dx: &mut [S]) -> Power<S> {
        let n = self.links.n;
        let (q, v, theta, theta_dot) = (&x[..n], &x[n..2 * n], &x[2 * n..3 * n], &x[3 * n..4 * n]);
        let (mut input, mut outside) = (S::zero(), S::zero());
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
        self.inverse_inertia.multiply(&self.work, &mut dx[3 * n..4 * n]);
        outside += self.links.add_outside(trig, q, v, wrench);
        self.links.accelerate(trig, q, v, &mut dx[n..2 * n]);
        Power { input, outside }
    }

    fn hold(&mut self, contacts: &[Touch]) {
        self.links.hold(contacts);
    }
}
