//! What an inner torque loop is judged by: the largest `|tau_J - u|` over the joints, the torque of the springs against
//! what the outer loop asks for.

use crate::law::{Law, LawSpec};
use crate::linalg::Gain;
use crate::motion::sample_all;
use crate::plant::PlantSpec;

pub struct TorqueError {
    outer: LawSpec,
    law: Box<dyn Law<f64> + Send>,
    stiffness: Gain,
    desired: Vec<f64>,
    u: Vec<f64>,
}

impl TorqueError {
    /// For an elastic plant under a law with an inner loop.
    pub fn new(plant: &PlantSpec, law: &LawSpec) -> Option<Self> {
        let PlantSpec::Elastic(plant) = plant else { return None };
        law.reduction()?;
        let outer = law.outer()?;
        let width = outer.motions().iter().map(|motion| 3 * motion.dof()).sum();
        Some(TorqueError {
            law: LawSpec::build::<f64>(|_| &outer),
            outer,
            stiffness: plant.stiffness.clone(),
            desired: vec![0.0; width],
            u: vec![0.0; plant.model.n()],
        })
    }

    /// At time `t`, plant state `x` and its (sin, cos).
    pub fn evaluate(&mut self, t: f64, trig: &[(f64, f64)], x: &[f64]) -> f64 {
        let n = trig.len();
        sample_all(self.outer.motions(), t, &mut self.desired);
        self.law.evaluate(&self.desired, trig, &x[..2 * n], &[], &mut self.u, &mut []);
        let mut worst = 0.0f64;
        for i in 0..n {
            let spring: f64 = (0..n).map(|j| self.stiffness.at(i, j) * (x[2 * n + j] - x[j])).sum();
            let error = (spring - self.u[i]).abs();
            // `max` would swallow a NaN.
            worst = if error <= worst { worst } else { error };
        }
        worst
    }
}
