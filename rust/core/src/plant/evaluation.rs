//! Evaluation of a plant at a single state: its rates are recorded once, and the interpreter computes them.

use super::friction_torque::FrictionTorque;
use super::recorded::function_of;
use super::{PlantRates, PlantSpec};
use crate::trace::E;
use crate::trace::expression::{constant, stacked, vector};

impl PlantSpec {
    /// Compute the rates `dx` of the state `x`, and the power supplied to the stored energy, W.
    ///
    /// `x` and `dx` are `(states,)`. The input `tau` is `(n,)`, N m or N; for a velocity-controlled arm it is the velocity, rad/s or m/s.
    /// The wrench `[f; m]`, N and N m, world axes, acts at the frame with the index `force_frame`. Joints at rest with stick-slip friction
    /// stick or start to slide as the torques on them require.
    ///
    /// ```
    /// use armlet_core::arm::Arm;
    /// use armlet_core::plant::{PlantSpec, RigidSpec};
    ///
    /// // A pendulum: `a = tau - 5 sin q`. The torque of 4 N m at 2 rad/s supplies 8 W.
    /// let plant = PlantSpec::from(RigidSpec::new(Arm::pendulum(1.0, 5.0)?.into()));
    /// let (dx, power) = plant.rates_at(&[0.3, 2.0], &[4.0], &[0.0; 6], None);
    /// assert!(dx[0] == 2.0 && (dx[1] - (4.0 - 5.0 * 0.3f64.sin())).abs() < 1e-14);
    /// assert_eq!(power, 8.0);
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn rates_at(&self, x: &[f64], tau: &[f64], wrench: &[f64; 6], force_frame: Option<usize>) -> (Vec<f64>, f64) {
        let friction = FrictionTorque::of(self, force_frame, 1);
        let sides = friction.and_then(|mut friction| friction.sides(x, tau, wrench)).unwrap_or_default();
        let signs: Vec<E> = sides.iter().map(|&side| constant(f64::from(side))).collect();
        let rates = function_of(self, force_frame, |mut plant, at| {
            plant.hold_joints(&signs);
            let PlantRates { x_dot, power, .. } = plant.rates(at.x, &at.tau, at.wrench);
            stacked([&x_dot, &vector(&[power.input + power.outside])]).as_slice().to_vec()
        });
        let mut rates = rates.interpreted(false);
        rates.all_inputs().copy_from_slice(&[x, tau, wrench].concat());
        rates.run();
        (rates.outputs(0, x.len()).to_vec(), rates.output(x.len())[0])
    }
}
