//! The swings of one link without friction.
//!
//! ```text
//! back-swing (-, +, -): x0 -> xt = x0 - e -> x1, each stretch a monotone optimum; no torque change at the turn, so two switches
//! T(e) = sqrt(I/2) [ F(-x0, l1; u-) + F(xt, l2; u+) + F(xt, l3; u+) + F(-x1, l4; u-) ],   l1 + l2 = e,  l3 + l4 = e + D
//! dT/de = sqrt(I/2) [ 1/sqrt(K_12) + 1/sqrt(K_34) - dF/dx(xt, l2) - dF/dx(xt, l3) ]
//! ```
//!
//! Only the middle phase enters the derivative: the outer phases start from fixed points, and the switches move along curves of equal
//! energy. An overshoot is the back-swing of the motion mirrored and run backwards in time.

use super::phase::Phase;
use super::search::{BackSwings, FARTHEST, Swing, fastest};
use super::sine::{crest_inside, sin_cos, sine, trough_inside};
use super::torque_optimal::{Monotone, drop};
use std::cell::OnceCell;

/// Accuracy of the last slopes.
const FINE: f64 = 1e-8;
/// The least torque bound in parts of gravity below which T changes fast beside the edges of what is possible.
const WEAK: f64 = 0.03;

/// The problem of the back-swing.
struct Search {
    x0: f64,
    x1: f64,
    g: f64,
    up: f64,
    down: f64,
    /// The outer phases, and the middle one at some place.
    leaves: Phase,
    arrives: Phase,
    turns: Phase,
    /// Sine and cosine of `x0`, of half way, and of half the distance.
    start: (f64, f64),
    middle: (f64, f64),
    half: (f64, f64),
    /// `F(-x1, D; u-)`, zero where that brake stalls.
    brake: OnceCell<f64>,
}

/// Sine and cosine of the angle less another one.
#[inline(always)]
fn back((sin, cos): (f64, f64), (less_sin, less_cos): (f64, f64)) -> (f64, f64) {
    (sin * less_cos - cos * less_sin, cos * less_cos + sin * less_sin)
}

/// Two monotone stretches that meet at the turning point.
struct Trial {
    away: Monotone,
    towards: Monotone,
    turn: f64,
}

impl Trial {
    /// The energies at the two switches, if the swing is possible.
    #[inline]
    fn peaks(&self) -> Option<(f64, f64)> {
        self.away.peak().zip(self.towards.peak())
    }

    /// Positive where the swing is possible.
    fn margin(&self) -> f64 {
        self.away.margin().min(self.towards.margin())
    }
}

impl Search {
    fn trial(&self, e: f64) -> Trial {
        let turn = self.x0 - e;
        let half = sin_cos(0.5 * e);
        let between = back(self.start, half);
        let turns = self.turns.moved(turn, back(between, half));
        let out = drop(-between.0, half.0);
        let into = drop(back(self.middle, half).0, self.half.0 * half.1 + self.half.1 * half.0);
        Trial { away: Monotone::between(self.leaves, turns, out), towards: Monotone::between(turns, self.arrives, into), turn }
    }

    /// The least and the largest torque of gravity between two angles.
    fn torques(&self, a: f64, b: f64) -> (f64, f64) {
        let (from, to) = (sine(a), sine(b));
        let low = if trough_inside(&from, &to) { -1.0 } else { from.sin.min(to.sin) };
        let high = if crest_inside(&from, &to) { 1.0 } else { from.sin.max(to.sin) };
        ((self.g * low).min(self.g * high), (self.g * low).max(self.g * high))
    }
}

impl BackSwings for Search {
    fn slope(&self, e: f64, fine: bool) -> Option<f64> {
        let trial = self.trial(e);
        let (first, second) = trial.peaks()?;
        let (first, second) = (first.sqrt().recip(), second.sqrt().recip());
        let turns = &trial.towards.push;
        let gradient = |length: f64| if fine { turns.time_gradient(length, FINE) } else { turns.rough_gradient(length) };
        let last = second - gradient(trial.towards.push_length);
        // The other one is not less: no need of it for the sign, which is all that a rough slope is for.
        let rate = if last >= 0.0 && !fine { 2.0 * last } else { first - gradient(trial.away.brake_length) + last };
        let slope = rate / (rate.abs() + first + second);
        slope.is_finite().then_some(slope)
    }

    fn margin(&self, e: f64, _least: f64) -> f64 {
        self.trial(e).margin()
    }

    fn possible(&self, e: f64) -> bool {
        self.trial(e).peaks().is_some()
    }

    fn swing(&self, e: f64) -> Option<Swing> {
        let trial = self.trial(e);
        trial.peaks()?;
        let ((t1, t2), (t3, t4)) = (trial.away.time_factors(), trial.towards.time_factors());
        let time = t1 + t2 + t3 + t4;
        time.is_finite().then_some(Swing {
            time,
            x_switches: [trial.turn + trial.away.brake_length, trial.turn + trial.towards.push_length],
            t_switches: [t1, t1 + t2 + t3],
            x_turn: trial.turn,
            t_turn: t1 + t2,
        })
    }

    /// Below it the field is constant, and in a constant field no swing helps.
    fn nearest(&self) -> f64 {
        let push = self.turns;
        let distance = self.x1 - self.x0;
        let scale = distance.min(1.0);
        let monotone = Monotone::new(self.x0, self.x1, self.g, self.up, self.down);
        let constant = monotone.peak().is_some() && push.hump(monotone.push_length).is_none();
        let e = if constant {
            let g = self.g.abs();
            (0.05 * push.net() / (g * self.x0.cos().abs() + (g * push.net()).sqrt())).min(0.05)
        } else {
            1e-3 * scale
        };
        e.max(1e-13 * self.x0.abs().max(1.0))
    }

    /// With `p_+`, `p_-` the largest net torques up and down,
    ///
    /// ```text
    /// T > 2 sqrt(e (p_+ + p_-)/(p_+ p_-)) + 2 sqrt(e / p_+) + F(-x1, D; u-)      out, back to x0, and on, at no moment faster than the last brake
    /// ```
    fn farthest(&self, limit: f64) -> f64 {
        if limit == f64::INFINITY {
            return FARTHEST;
        }
        let brake = *self.brake.get_or_init(|| {
            let (brake, distance) = (&self.arrives, self.x1 - self.x0);
            if brake.clears(distance) && brake.energy(distance) > 0.0 { brake.time_factor(distance) } else { 0.0 }
        });
        let mut most = FARTHEST;
        for _ in 0..3 {
            let (low, high) = self.torques(self.x0 - most, self.x0);
            let (up, down) = (self.up - low, self.down + high);
            let out = 2.0 * ((up + down) / (up * down)).sqrt();
            let most_now = ((limit - brake).max(0.0) / (out + 2.0 / up.sqrt())).powi(2);
            if !(most_now < most) {
                break;
            }
            most = most_now;
        }
        most
    }

    fn steepest(&self, e: f64) -> f64 {
        10.0 * (self.up + self.down + self.g.abs()) * (1.0 / e).max(1.0)
    }

    fn weak(&self) -> bool {
        self.up.min(self.down) < WEAK * self.g.abs()
    }
}

/// The best (-, +, -) motion `x0 -> x1 > x0` faster than `bound` (a time over `sqrt(I/2)`).
pub(super) fn back_swing(x0: f64, x1: f64, g: f64, up: f64, down: f64, bound: f64) -> Option<Swing> {
    let (leaves, arrives, turns) = (Phase::new(-x0, down, g), Phase::new(-x1, down, g), Phase::new(x0, up, g));
    if leaves.net() <= 0.0 || arrives.net() <= 0.0 {
        return None;
    }
    let distance = x1 - x0;
    let (start, middle, half) = (sin_cos(x0), sin_cos(0.5 * x0 + 0.5 * x1), sin_cos(0.5 * distance));
    fastest(&Search { x0, x1, g, up, down, leaves, arrives, turns, start, middle, half, brake: OnceCell::new() }, bound)
}

/// The best (+, -, +) motion `x0 -> x1 > x0` faster than `bound`.
pub(super) fn overshoot(x0: f64, x1: f64, g: f64, up: f64, down: f64, bound: f64) -> Option<Swing> {
    back_swing(-x1, -x0, g, down, up, bound).map(Swing::reversed)
}
