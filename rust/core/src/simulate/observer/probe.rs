//! The position and the velocity of a frame, which an event may depend on.

use crate::dynamics::{AnyArm, Dynamics, Workspace};
use crate::plant::PlantSpec;
use crate::scalar::Real;
use crate::spatial::Vector3;

/// Computes the position and the velocity of a frame.
pub struct Probe {
    arm: AnyArm<f64>,
    ws: Workspace<f64>,
    trig: Vec<(f64, f64)>,
    jacobian: Vec<f64>,
}

impl Probe {
    pub fn new(plant: &PlantSpec) -> Self {
        let (n, arm) = (plant.n(), AnyArm::new(plant.model()));
        Probe { ws: arm.workspace(), arm, trig: vec![(0.0, 1.0); n], jacobian: vec![0.0; 6 * n] }
    }

    /// Return position, m, and velocity, m/s, of the origin of `frame` in world axes. The plant's state is `x = [q, v, ..]`.
    pub fn frame(&mut self, frame: usize, x: &[f64]) -> (Vector3<f64>, Vector3<f64>) {
        let n = self.trig.len();
        for (trig, &q) in self.trig.iter_mut().zip(x) {
            *trig = Real::sin_cos(q);
        }
        let p = self.arm.jacobian(&mut self.ws, &self.trig, &x[..n], frame, &mut self.jacobian);
        let v = x.get(n..2 * n).unwrap_or(&[]);
        (p, Vector3::from(std::array::from_fn::<f64, 3, _>(|k| v.iter().zip(&self.jacobian[k * n..]).map(|(v, j)| j * v).sum())))
    }
}
