//! Stick-slip friction in a loop: when joints stop and slip.
//!
//! Adaptive methods locate the instants at which the torque of a stuck joint leaves its limits, or a sliding joint comes to rest. There the
//! velocity is set to zero and the problem at rest is solved. Methods of fixed steps do the same where steps begin and end.

use super::closed_loop::ClosedLoop;
use crate::scalar::Real;

impl<S: Real> ClosedLoop<'_, S> {
    /// Write the loads at time `t` and state `x` into the plant's friction model.
    fn load_friction(&mut self, t: f64, x: &[S]) {
        if self.is_held() {
            self.look(t, x);
        } else {
            self.observe(t, x);
        }
        self.load_plant(x);
    }

    /// Decide which joints stick at time `t` and state `x`; the joint `leaving` slips. Returns whether the mode of a joint changes.
    pub fn settle(&mut self, t: f64, x: &[S], leaving: Option<usize>) -> bool {
        if self.plant_mut().stick_slip().is_none() {
            return false;
        }
        self.load_friction(t, x);
        let n = self.tau.len();
        self.plant_mut().stick_slip().is_some_and(|(friction, first)| friction.settle(&x[first..first + n], leaving))
    }

    /// For each joint with stick-slip friction, at time `t` and state `x`, the number whose change to negative ends its mode.
    pub fn margins(&mut self, t: f64, x: &[S], out: &mut [f64]) {
        if self.plant_mut().stick_slip().is_some_and(|(friction, _)| friction.holds()) {
            self.load_friction(t, x);
        }
        if let Some((friction, first)) = self.plant_mut().stick_slip() {
            friction.margins(&x[first..first + out.len()], out);
        }
    }

    /// Joint `joint` changes its mode at time `t` and state `x`: a stuck joint slips, and a sliding one comes to rest. `None`: check all
    /// joints.
    pub fn switch_joint(&mut self, t: f64, x: &mut [S], joint: Option<usize>) {
        let Some((friction, first)) = self.plant_mut().stick_slip() else { return };
        let leaving = joint.filter(|&joint| friction.sides()[joint] == 0);
        if let (Some(joint), None) = (joint, leaving) {
            x[first + joint] = S::zero();
        }
        self.arrest(x);
        self.settle(t, x, leaving);
    }

    /// Stop the joints whose velocity is opposite to their direction of slip. Returns whether there are any.
    pub fn arrest(&mut self, x: &mut [S]) -> bool {
        let n = self.tau.len();
        self.plant_mut().stick_slip().is_some_and(|(friction, first)| friction.arrest(&mut x[first..first + n]))
    }

    /// Set the velocities of stuck joints to zero. Implicit methods leave rounding errors in them.
    pub fn still(&mut self, x: &mut [S]) {
        if let Some((friction, first)) = self.plant_mut().stick_slip() {
            for (side, v) in friction.sides().iter().zip(&mut x[first..]) {
                if *side == 0 {
                    *v = S::zero();
                }
            }
        }
    }

    /// The directions in which joints slide, zero for a stuck one; empty without stick-slip friction.
    pub fn sides(&mut self) -> &[i8] {
        self.plant_mut().stick_slip().map_or(&[], |(friction, _)| friction.sides())
    }

    /// Let joints stick and slide as in another loop.
    pub fn follow(&mut self, sides: &[i8]) {
        if let Some((friction, _)) = self.plant_mut().stick_slip() {
            friction.follow(sides);
        }
    }
}
