//! The torque of dry friction at recorded states.

use super::lugre::LoopLuGre;
use super::rigid::loop_bristles;
use super::{Plant, PlantSpec};
use crate::linalg::gain::AnyGain;
use crate::scalar::Real;

/// States of a plant and its input at `K` records, `(K, n)` each. `theta` and `theta_dot` are empty for a plant without motors, and
/// `bristles` is empty for a plant without bristles.
#[derive(Clone, Copy, Debug)]
pub struct Rubbed<'a> {
    /// Positions of the links, rad or m.
    pub q: &'a [f64],
    /// Velocities of the links, rad/s or m/s.
    pub v: &'a [f64],
    /// Positions of the motors, rad or m.
    pub theta: &'a [f64],
    /// Velocities of the motors, rad/s or m/s.
    pub theta_dot: &'a [f64],
    /// Deflections of the bristles, rad or m.
    pub bristles: &'a [f64],
    /// Inputs of the plant, N m or N.
    pub tau: &'a [f64],
}

/// Springs and dampers of elastic joints, whose torque loads the motors.
struct Joints<'a> {
    stiffness: AnyGain<f64>,
    damping: &'a [f64],
    stretch: Vec<f64>,
}

/// Friction with bristles, whose torque is a function of state and input.
struct Bristles<'a> {
    friction: LoopLuGre<f64>,
    joints: Option<Joints<'a>>,
    load: Vec<f64>,
}

/// Stick-slip friction, whose torque depends on the whole plant.
struct Sticking {
    plant: Box<dyn Plant<f64> + Send>,
    trig: Vec<(f64, f64)>,
    x: Vec<f64>,
    a: Vec<f64>,
}

enum FrictionState<'a> {
    Bristles(Bristles<'a>),
    Sticking(Sticking),
}

/// The computation of the friction torques of one plant.
pub struct FrictionTorque<'a> {
    n: usize,
    kind: FrictionState<'a>,
}

impl<'a> FrictionTorque<'a> {
    /// Create the computation; `None` for a plant without a `JointFriction`. Wrenches act at `force_frame`.
    pub fn of(plant: &'a PlantSpec, force_frame: Option<usize>) -> Option<Self> {
        let n = plant.n();
        plant.friction()?;
        let kind = match loop_bristles(plant.friction()) {
            None => FrictionState::Sticking(Sticking {
                plant: plant.build::<f64>(force_frame),
                trig: vec![(0.0, 1.0); n],
                x: Vec::with_capacity(plant.states()),
                a: vec![0.0; n],
            }),
            Some(friction) => {
                let joints = plant.elastic().map(|elastic| Joints {
                    stiffness: AnyGain::new(&elastic.stiffness),
                    damping: &elastic.joint_damping,
                    stretch: vec![0.0; n],
                });
                FrictionState::Bristles(Bristles { friction, joints, load: vec![0.0; n] })
            }
        };
        Some(FrictionTorque { n, kind })
    }

    /// Compute the friction torques of `K` records, `(K, n)`, N m or N, under the wrenches `wrench(k)`.
    pub fn series(&mut self, records: &Rubbed, wrench: impl Fn(usize) -> [f64; 6], out: &mut [f64]) {
        let n = self.n;
        for (k, out) in out.chunks_exact_mut(n).enumerate() {
            let range = |values: &[f64]| if values.is_empty() { 0..0 } else { k * n..(k + 1) * n };
            let at = Rubbed {
                q: &records.q[range(records.q)],
                v: &records.v[range(records.v)],
                theta: &records.theta[range(records.theta)],
                theta_dot: &records.theta_dot[range(records.theta_dot)],
                bristles: &records.bristles[range(records.bristles)],
                tau: &records.tau[range(records.tau)],
            };
            match &mut self.kind {
                FrictionState::Bristles(bristles) => bristles.evaluate(&at, out),
                FrictionState::Sticking(sticking) => sticking.evaluate(&at, &wrench(k), out),
            }
            // The sum with zero makes negative zeros positive.
            out.iter_mut().for_each(|torque| *torque += 0.0);
        }
    }
}

impl Bristles<'_> {
    fn evaluate(&mut self, at: &Rubbed, out: &mut [f64]) {
        let rates = match &mut self.joints {
            None => {
                for (i, load) in self.load.iter_mut().enumerate() {
                    *load = at.tau[i] - self.friction.spring(i, at.bristles[i]);
                }
                at.v
            }
            Some(Joints { stiffness, damping, stretch }) => {
                stretch.iter_mut().enumerate().for_each(|(i, stretch)| *stretch = at.theta[i] - at.q[i]);
                stiffness.multiply(stretch, &mut self.load);
                for (i, load) in self.load.iter_mut().enumerate() {
                    *load += damping[i] * (at.theta_dot[i] - at.v[i]);
                }
                at.theta_dot
            }
        };
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.friction.rub(i, rates[i], at.bristles[i], self.load[i]).torque;
        }
    }
}

impl Sticking {
    fn evaluate(&mut self, at: &Rubbed, wrench: &[f64; 6], out: &mut [f64]) {
        self.x.clear();
        [at.q, at.v, at.theta, at.theta_dot].into_iter().for_each(|part| self.x.extend_from_slice(part));
        for (trig, &q) in self.trig.iter_mut().zip(at.q) {
            *trig = Real::sin_cos(q);
        }
        self.plant.load_friction(&self.trig, &self.x, at.tau, wrench);
        let Some((friction, first)) = self.plant.stick_slip() else { return };
        let v = &self.x[first..first + out.len()];
        friction.settle(v, None);
        friction.slide(v);
        friction.hold(&mut self.a);
        out.copy_from_slice(friction.torque());
    }
}
