//! Stick-slip friction in a loop: the changes between sticking and sliding. In an elastic plant this friction acts on the motors, and the
//! velocity of a joint means the velocity of its motor.
//!
//! Adaptive methods locate two kinds of instants: the torque of a stuck joint leaves its limits, or a sliding joint comes to rest. The
//! velocity of a joint that comes to rest is set to zero. Then the equations at rest decide which joints stick. Methods of fixed steps make
//! this decision at the start of a step. At the end of a step, they stop the joints whose velocity has changed its sign.
//!
//! The decision is native code on numbers that a program computes: the mass matrix, the torques and the loads. It is omitted if the margins,
//! which another program computes, show that no mode changes.

use super::rates_loop::RatesLoop;
use super::sticking_joints::StickingJoints;

impl RatesLoop<'_> {
    /// For each joint, the direction of sliding, or zero for a stuck joint. Empty without stick-slip friction.
    pub fn modes_of_joints(&self) -> &[i8] {
        self.joints.as_ref().map_or(&[], StickingJoints::sides)
    }

    /// Set the modes of all joints to `sides`.
    pub fn set_modes_of_joints(&mut self, sides: &[i8]) {
        if let Some(joints) = &mut self.joints {
            joints.friction.follow(sides);
        }
        self.write_sides();
    }

    /// Decide which joints stick at time `t` and state `x`. Joint `leaving` must slip. Return whether the mode of a joint changes.
    pub fn settle(&mut self, t: f64, x: &[f64], leaving: Option<usize>) -> bool {
        let Some(mut joints) = self.joints.take() else { return false };
        // A moving joint slides under any load.
        if joints.speeds(x).contains(&0.0) {
            self.compute_at(t, |rates, u| rates.loads(u, x, &mut joints.loads));
            joints.friction.set_loads(&joints.loads);
        }
        let changes = joints.friction.settle(&x[joints.first..][..joints.margins.len()], leaving);
        self.joints = Some(joints);
        self.write_sides();
        changes
    }

    /// Write the margin of each joint to `out`, at time `t` and state `x`. A negative margin means that the joint's present mode ends.
    pub fn margins(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        self.compute_at(t, |rates, u| rates.margins(u, x, out));
    }

    /// Change the mode of joint `joint` at time `t` and state `x`: a stuck joint slips, a sliding joint stops. If `joint` is `None`, check
    /// all joints.
    pub fn switch_joint(&mut self, t: f64, x: &mut [f64], joint: Option<usize>) {
        let Some(joints) = &self.joints else { return };
        let leaving = joint.filter(|&joint| joints.sides()[joint] == 0);
        if let (Some(joint), None) = (joint, leaving) {
            joints.speeds_mut(x)[joint] = 0.0;
        }
        self.arrest(x);
        self.settle(t, x, leaving);
    }

    /// Stop the joints whose velocity is opposite to their direction of sliding. Return whether any velocity changes.
    pub fn arrest(&mut self, x: &mut [f64]) -> bool {
        let Some(joints) = &mut self.joints else { return false };
        let n = joints.margins.len();
        let changes = joints.friction.arrest(&mut x[joints.first..joints.first + n]);
        if changes {
            self.write_sides();
        }
        changes
    }

    /// Set the velocities of stuck joints to zero, and those of sliding joints that are opposite to the direction of sliding. Implicit methods
    /// cause rounding errors in the velocities of stuck joints. At the located time at which a joint comes to rest, the rounding error
    /// determines the sign of its velocity. A record there would have the friction of the other direction.
    pub fn remove_creep(&self, x: &mut [f64]) {
        if let Some(joints) = &self.joints {
            let rests = |side: i8, v: f64| side == 0 || f64::from(side) * v < 0.0;
            joints.sides().iter().zip(joints.speeds_mut(x)).filter(|(side, v)| rests(**side, **v)).for_each(|(_, v)| *v = 0.0);
        }
    }

    /// Whether all joints certainly stay in their modes at time `t` and state `x`. Sliding joints then move to their side, and the torques
    /// of stuck joints are within the static friction.
    pub fn stays(&mut self, t: f64, x: &[f64]) -> bool {
        let Some(mut joints) = self.joints.take() else { return true };
        let moves = |(&side, &v): (&i8, &f64)| if side == 0 { v == 0.0 } else { f64::from(side) * v > 0.0 };
        let mut stays = joints.sides().iter().zip(joints.speeds(x)).all(moves);
        if stays && joints.friction.holds() {
            self.margins(t, x, &mut joints.margins);
            stays = joints.sides().iter().zip(&joints.margins).all(|(&side, &margin)| side != 0 || margin >= 0.0);
        }
        self.joints = Some(joints);
        stays
    }
}
