//! Whole turns of joints: positions of continuous joints that differ by whole turns are the same pose, and their difference is not zero.
//!
//! ```text
//! nearest target = target + 2 pi round((q - target) / (2 pi))
//! ```

use super::{Arm, JointKind};
use std::f64::consts::TAU;

impl Arm {
    /// Whether each coordinate may turn without end, so that a whole turn of it does not change the pose, `(n,)`. Such a coordinate belongs
    /// to a joint that rotates without position limits. Each joint that follows it rotates by a whole number of turns, without limits.
    pub fn turns_freely(&self) -> Vec<bool> {
        let endless = |k: usize| {
            let (joint, limits) = (&self.joints[k], &self.joints[k].limits);
            let unlimited = limits.lower == f64::NEG_INFINITY && limits.upper == f64::INFINITY;
            joint.kind == JointKind::Continuous || joint.kind == JointKind::Revolute && unlimited
        };
        let coordinates = (0..self.joints.len()).filter(|&k| self.mimics.iter().all(|mimic| mimic.joint != k));
        let follows = |k: usize| self.mimics.iter().filter(move |mimic| mimic.leader == k);
        coordinates.map(|k| endless(k) && follows(k).all(|mimic| endless(mimic.joint) && mimic.multiplier.fract() == 0.0)).collect()
    }
}

/// Write the position that differs from `target` by whole turns and is nearest to `q` to `out`, `(n,)` each, rad or m. Coordinates that do
/// not turn freely keep the target.
///
/// ```
/// use armlet_core::arm::{Arm, nearest_turn};
///
/// let arm = Arm::pendulum(2.0, 5.0)?;
/// let mut near = [0.0];
/// nearest_turn(&arm.turns_freely(), &[-3.0], &[3.0], &mut near);
/// assert!((near[0] - 3.283).abs() < 1e-3);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn nearest_turn(free: &[bool], target: &[f64], q: &[f64], out: &mut [f64]) {
    for (i, near) in out.iter_mut().enumerate() {
        let turns = if free[i] { ((q[i] - target[i]) / TAU).round() } else { 0.0 };
        *near = target[i] + TAU * turns;
    }
}
