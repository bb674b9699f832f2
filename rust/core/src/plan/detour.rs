//! Lower bounds of the time of a swing without friction, and upper bounds of the time that it saves over the monotone motion. The swing
//! starts at `x0`, and turns at the distance `e` behind `x0`.

use super::monotone::{Energies, Monotone};
use super::sine::{gravity_range, sine};

/// A lower bound of the time from `x0` to the turn and back to `x0`, divided by `2 sqrt(e)`. The unit of the time is `sqrt(I/2)` seconds:
///
/// ```text
/// T >= 2 sqrt(e) [ sqrt((p_+ + p_-)/(p_+ p_-)) + sqrt(1/p_+) ]        (to the turn, and back to x0)
/// ```
///
/// `up` and `down` are the largest net torques `p_+` towards the goal and `p_-` away from it, N m.
pub(super) fn detour(up: f64, down: f64) -> f64 {
    (((up + down) / down).sqrt() + 1.0) / up.sqrt()
}

/// The push of a monotone motion.
pub(super) struct Push {
    length: f64,
    /// A lower bound of the mean net torque from the start of the push to any of its points, N m.
    mean: f64,
}

impl Push {
    pub fn new(monotone: &Monotone, energies: &Energies) -> Self {
        let Monotone { push, push_length: length, .. } = *monotone;
        let mean = if push.push >= push.g.abs() {
            push.push - gravity_range(push.g, &sine(push.x), &sine(push.x + length)).1
        } else {
            // Before the first minimum of the kinetic energy, the net torque has at most one maximum. So its mean is smallest at the start
            // or at this minimum. Beyond the minimum, the energy is at least the smaller of `peak` and `push_hump`. The mean is the energy
            // divided by the distance.
            push.net().min(energies.peak.min(energies.push_hump) / length)
        };
        Push { length, mean }
    }

    /// The distance `e` beyond which the detour of a swing costs more time than the swing gains, rad. `up` and `down` are the largest net
    /// torques `p_+` and `p_-`, N m. In a swing, the push of length `L` starts with the kinetic energy `K0 < p_+ e` instead of at rest. `w`
    /// is a lower bound of the mean net torque of the push:
    ///
    /// ```text
    /// K(y) >= w y:   int_0^L [ 1/sqrt(K) - 1/sqrt(K + K0) ] dy <= (2/w) [ sqrt(w L) + sqrt(K0) - sqrt(w L + K0) ]
    /// equal to 2 sqrt(e) detour at K0 = p_+ e:   1 + rho - sqrt(1 + rho^2) = c rho,   rho = sqrt(K0/(w L)),   c = w detour/sqrt(p_+)
    /// rho = 2 (1 - c)/(c (2 - c)),   e = rho^2 w L/p_+
    /// ```
    pub fn gains(&self, up: f64, down: f64) -> f64 {
        let c = self.mean * detour(up, down) / up.sqrt();
        let rho = 2.0 * (1.0 - c).max(0.0) / (c * (2.0 - c));
        rho * rho * (self.mean * self.length / up)
    }
}
