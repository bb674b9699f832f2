//! Which back-swings are possible: open intervals of the way `e` that they back up, exactly.
//!
//! Over the angle, energy under a constant torque is a straight line, `E = V(xt) + u (x - xt)` from rest at `xt`, and the phase lasts
//! while that is above the potential `V = -G cos x`. The line of `u+` rises and those of `u-` fall, so they cross once, and
//!
//! ```text
//! the back-swing to xt is possible iff
//!     both lines of u-, from x0 and from x1 to the left, stay above V as far as xt, and
//!     the line of u+ from xt stays above V as far as x1:   W(xt) > W(x) for xt < x <= x1,   W(x) = V(x) - u+ x
//! ```
//!
//! Seen from `x1` to the left, the last are the angles where `W` is higher than ever before: it rises from its level at `x1` to a crest, and then
//! from the level of each crest to another crest, `W(x - 2 pi) = W(x) + 2 pi u+`: one interval a turn, down to where a line of `u-` ends.
//! With friction the curves of the phase plane take the place of lines: those of one torque do not cross, and those of two cross once.

use super::monotone::{Monotone, Straight};
use super::phase::Phase;
use std::f64::consts::TAU;

/// The intervals, the nearest first.
pub(super) struct Windows<F> {
    low: f64,
    /// Of `W`, infinite if it has none.
    crest: f64,
    most: f64,
    rise: F,
    risen: Option<f64>,
}

impl<F: Fn() -> f64> Windows<F> {
    /// `W` is as high as at `x1` first at `low` and then comes to a crest; it is as high as on a crest again a `rise` beyond. The lines of
    /// `u-` end at `most`.
    pub fn new(low: f64, crest: f64, most: f64, rise: F) -> Self {
        let mut windows = Windows { low, crest, most, rise, risen: None };
        if crest <= 0.0 && most > 0.0 {
            // On to the last crest between x1 and x0.
            let turn = windows.turn();
            windows.crest += turn * (-crest / turn).floor();
            windows.climb();
        }
        windows
    }

    fn risen(&mut self) -> f64 {
        *self.risen.get_or_insert_with(&self.rise)
    }

    /// From a crest to the first one beyond its rise.
    fn turn(&mut self) -> f64 {
        TAU * ((self.risen() / TAU).floor() + 1.0)
    }

    fn climb(&mut self) {
        self.low = self.crest + if self.crest < self.most { self.risen() } else { 0.0 };
        self.crest += if self.low < self.most { self.turn() } else { 0.0 };
    }
}

impl<F: Fn() -> f64> Iterator for Windows<F> {
    type Item = (f64, f64);
    fn next(&mut self) -> Option<(f64, f64)> {
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

/// Without friction: those that begin before `farthest`, and some beyond. `leaves`: the phase from `x0` backwards.
pub(super) fn windows(straight: &Straight, leaves: &Phase, farthest: f64) -> impl Iterator<Item = (f64, f64)> {
    let Monotone { push, brake, .. } = &straight.monotone;
    let distance = straight.distance();
    // From x1 under -u+, mirrored: its energy is W(x1) - W.
    let against = Phase::new(brake.x, -push.push, push.g);
    let (low, crest) = if push.push < push.g.abs() { against.descent() } else { (0.0, f64::INFINITY) };
    let most = if low - distance < farthest { leaves.reach().min(brake.reach() - distance) } else { 0.0 };
    Windows::new(low - distance, crest - distance, most, move || against.recovery())
}
