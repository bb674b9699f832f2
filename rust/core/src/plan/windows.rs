//! The feasible back-swings: open intervals of the distance `e` of the turn behind the start, whose edges are roots of smooth functions.
//!
//! Under a constant torque `u` from rest at `xt`, the energy is a linear function of the angle, `E = V(xt) + u (x - xt)`. The phase
//! continues while this line is above the potential `V = -G cos x`. `G` is the gravity moment, `x0` the start, `x1` the goal and
//! `xt = x0 - e` the turn. `u+` and `u-` are the absolute values of the upper and the lower torque bound. The line of the torque `u+`
//! rises, and the two lines of the torque `-u-` fall. So the rising line crosses each falling line once:
//!
//! ```text
//! the back-swing to xt is feasible iff
//!     both lines of -u-, from x0 and from x1 to the left, are above V up to xt, and
//!     the line of u+ from xt is above V up to x1:   W(xt) > W(x) for xt < x <= x1,   W(x) = V(x) - u+ x
//! ```
//!
//! Let `xt` decrease from `x1`. The condition on `W` is true where `W(xt)` exceeds all values of `W` between `xt` and `x1`. So the first
//! interval begins where `W` exceeds its value at `x1`, and ends at the next maximum of `W`. Beyond a maximum `W` falls. The next interval
//! begins where `W` exceeds the value of this maximum. It ends at the next maximum, one revolution further, because
//! `W(x - 2 pi) = W(x) + 2 pi u+`. So there is one interval per revolution, as far as both lines of `-u-` reach. If `u+ >= |G|`, `W` has no
//! maximum, and there is only one interval. With friction, curves of the phase plane replace the lines. Two curves of one torque do not
//! cross, and two curves of different torques cross at most once.

use super::search::Window;
use std::cell::LazyCell;
use std::f64::consts::TAU;

/// The intervals of feasible swings, the nearest first, as distances `e` behind `x0`, rad.
pub(super) struct Windows<F> {
    /// The next interval is from `low` to the maximum of `W` at `crest`. `low` is infinite if there is no further interval.
    low: f64,
    crest: f64,
    most: f64,
    recovery: LazyCell<f64, F>,
}

impl<F: FnOnce() -> f64> Windows<F> {
    /// Create the intervals, from distances behind `x0`, rad. The function `W(x) = -G cos x - u+ x` exceeds its value at the goal `x1` from
    /// `low` to its maximum at `crest`. After the distance `recovery` beyond a maximum, `W` exceeds the value of this maximum again.
    /// Motions under the lower torque `-u-` reach at most `most`.
    pub fn new(low: f64, crest: f64, most: f64, recovery: F) -> Self {
        let mut windows = Windows { low, crest, most, recovery: LazyCell::new(recovery) };
        if crest <= 0.0 && most > 0.0 {
            // The first maximum is between x1 and x0. Continue from the last maximum between them.
            let turn = windows.turn();
            if turn < f64::INFINITY {
                windows.crest += turn * (-crest / turn).floor();
            }
            windows.climb();
            // The distance `crest` may have a rounding error of many revolutions.
            if windows.crest < 0.0 {
                windows.low = f64::INFINITY;
            }
        }
        windows
    }

    /// The distance, rad, from a maximum of `W` to the first maximum beyond `recovery`. It is a whole number of revolutions.
    fn turn(&self) -> f64 {
        TAU * ((*self.recovery / TAU).floor() + 1.0)
    }

    /// Move to the next interval.
    fn climb(&mut self) {
        let last = self.crest;
        self.low = last + if last < self.most { *self.recovery } else { 0.0 };
        self.crest += if self.low < self.most { self.turn() } else { 0.0 };
        // If `crest` does not grow, there are two cases. Either it was the last maximum, or a revolution is smaller than the rounding error
        // of `crest`.
        if !(self.crest > last) {
            self.low = f64::INFINITY;
        }
    }
}

impl<F: FnOnce() -> f64> Iterator for Windows<F> {
    type Item = Window;
    fn next(&mut self) -> Option<Window> {
        while self.low < self.most {
            let window = (self.low.max(0.0), self.crest.min(self.most));
            self.climb();
            if window.0 < window.1 {
                return Some(window);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_that_rounding_loses_end() {
        for way in [1e3, 1e15, 1e16, 1e17, 3e33, 1e200, -1e17, -3e33] {
            for most in [10.0, f64::INFINITY] {
                let windows = Windows::new(-way - 1.0, -way, most, || 6.0);
                let low: Vec<_> = windows.take(3).map(|(low, _)| low).collect();
                assert!(low.windows(2).all(|two| two[0] < two[1]) && low.iter().all(|low| *low >= 0.0), "{way} {low:?}");
            }
        }
    }
}
