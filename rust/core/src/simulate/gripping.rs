//! Stick-slip friction in a loop: the changes between sticking and sliding. In an elastic plant this friction acts on the motors, and the
//! velocity of a joint means the velocity of its motor.
//!
//! Adaptive methods locate two kinds of instants: the torque of a stuck joint leaves its limits, or a sliding joint comes to rest. The
//! velocity of a joint that comes to rest is set to zero. Then the equations at rest decide which joints stick. Methods of fixed steps make
//! this decision at the start of a step. At the end of a step, they stop the joints whose velocity has changed its sign. A loop with
//! programs omits the decision if the program of the margins shows that no mode changes (`running_rates::Running::stays`).

use super::closed_loop::ClosedLoop;
use super::world::Exogenous;
use crate::scalar::Real;

impl<S: Real> ClosedLoop<'_, S> {
    /// Decide which joints stick at time `t` and state `x`. Joint `leaving` must slip. Return whether the mode of a joint changes.
    pub fn settle(&mut self, t: f64, x: &[S], leaving: Option<usize>) -> bool {
        let n = self.tau.len();
        let Some((_, first)) = self.plant_mut().stick_slip() else { return false };
        // A moving joint slides under any load.
        if x[first..first + n].iter().any(|v| v.lane(0) == 0.0) {
            self.with_input_at(t, |closed, u| closed.load_friction(u, x));
        }
        self.plant_mut().stick_slip().is_some_and(|(friction, first)| friction.settle(&x[first..first + n], leaving))
    }

    /// For each joint with stick-slip friction, write a number to `out`, at time `t` and state `x`. A negative number means that the
    /// joint's present mode ends.
    pub fn margins(&mut self, t: f64, x: &[S], out: &mut [f64]) {
        if self.plant_mut().stick_slip().is_some_and(|(friction, _)| friction.holds()) {
            self.with_input_at(t, |closed, u| closed.load_friction(u, x));
        }
        if let Some((friction, first)) = self.plant_mut().stick_slip() {
            let margins = friction.margins(&x[first..first + out.len()]);
            out.iter_mut().zip(margins).for_each(|(out, margin)| *out = margin.lane(0));
        }
    }

    /// The numbers of [`ClosedLoop::margins`], under the exogenous input `u`.
    pub fn margins_under(&mut self, u: &Exogenous<S>, x: &[S]) -> Vec<S> {
        self.load_friction(u, x);
        let n = self.tau.len();
        self.plant_mut().stick_slip().map_or(Vec::new(), |(friction, first)| friction.margins(&x[first..first + n]).to_vec())
    }

    /// The index in the state of the first speed that stick-slip friction acts on.
    pub fn first_speed(&mut self) -> usize {
        self.plant_mut().stick_slip().map_or(0, |(_, first)| first)
    }

    /// Set the modes of all joints as numbers: 0 for a stuck joint, else the direction of sliding.
    pub fn hold_sides(&mut self, signs: &[S]) {
        if let Some((friction, _)) = self.plant_mut().stick_slip() {
            friction.follow_signs(signs);
        }
    }

    /// Change the mode of joint `joint` at time `t` and state `x`: a stuck joint slips, a sliding joint stops. If `joint` is `None`, check
    /// all joints.
    pub fn switch_joint(&mut self, t: f64, x: &mut [S], joint: Option<usize>) {
        let Some((friction, first)) = self.plant_mut().stick_slip() else { return };
        let leaving = joint.filter(|&joint| friction.sides()[joint] == 0);
        if let (Some(joint), None) = (joint, leaving) {
            x[first + joint] = S::zero();
        }
        self.arrest(x);
        self.settle(t, x, leaving);
    }

    /// Stop the joints whose velocity is opposite to their direction of sliding. Return whether any velocity changes.
    pub fn arrest(&mut self, x: &mut [S]) -> bool {
        let n = self.tau.len();
        self.plant_mut().stick_slip().is_some_and(|(friction, first)| friction.arrest(&mut x[first..first + n]))
    }

    /// Set the velocities of stuck joints to zero. Implicit methods cause rounding errors in these velocities.
    pub fn still(&mut self, x: &mut [S]) {
        if let Some((friction, first)) = self.plant_mut().stick_slip() {
            for (side, v) in friction.sides().iter().zip(&mut x[first..]) {
                if *side == 0 {
                    *v = S::zero();
                }
            }
        }
    }

    /// For each joint, the direction of sliding, or zero for a stuck joint. Empty without stick-slip friction.
    pub fn sides(&mut self) -> &[i8] {
        self.plant_mut().stick_slip().map_or(&[], |(friction, _)| friction.sides())
    }

    /// Set the modes of all joints to the modes `sides` of another loop.
    pub fn follow(&mut self, sides: &[i8]) {
        if let Some((friction, _)) = self.plant_mut().stick_slip() {
            friction.follow(sides);
        }
    }
}
