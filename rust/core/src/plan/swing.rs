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

use super::detour::{Push, detour, torques};
use super::grid::AHEAD;
use super::monotone::{Energies, Monotone, Straight, drop};
use super::phase::Phase;
use super::search::{BackSwings, FARTHEST, Swing, fastest};
use super::sine::sin_cos_lanes;
use crate::scalar::{Real, Task, run_lanes};
use std::cell::OnceCell;

/// Accuracy of the last slopes.
const FINE: f64 = 1e-8;
/// The least torque bound in parts of gravity below which T changes fast beside the edges of what is possible.
const WEAK: f64 = 0.03;

/// The problem of the back-swing.
struct Search {
    /// Its push is the middle phase at another place, its brake the last one.
    straight: Straight,
    /// The first phase.
    leaves: Phase,
    /// The push of the monotone motion, if that is possible.
    push: Option<Push>,
    nearest: f64,
    /// `F(-x1, D; u-)`, zero where that brake stalls.
    brake: OnceCell<f64>,
}

/// Sine and cosine of the angle less another one.
#[inline(always)]
fn back<S: Real>((sin, cos): (S, S), (less_sin, less_cos): (S, S)) -> (S, S) {
    (sin * less_cos - cos * less_sin, cos * less_cos + sin * less_sin)
}

/// Two monotone stretches that meet at the turning point.
struct Trial<S = f64> {
    away: Monotone<S>,
    towards: Monotone<S>,
    turn: S,
}

impl Trial {
    /// The energies of the two stretches, if the swing is possible.
    #[inline]
    fn energies(&self) -> Option<(Energies, Energies)> {
        let towards = self.towards.energies()?;
        Some((self.away.energies()?, towards))
    }
}

impl<S: Real> Trial<S> {
    /// Positive where the swing is possible.
    #[inline(always)]
    fn margin(&self, least: f64) -> S {
        let least = S::splat(least);
        let towards = self.towards.margin(least);
        if S::any(least.lt(towards)) { towards.min(self.away.margin(least)) } else { towards }
    }
}

/// The margins of several swings, in lanes.
struct Margins<'a> {
    search: &'a Search,
    e: [f64; AHEAD],
    least: f64,
}

impl Task for Margins<'_> {
    type Output = [f64; AHEAD];
    #[inline(always)]
    fn run<S: Real>(self) -> [f64; AHEAD] {
        let mut margins = [0.0; AHEAD];
        for first in (0..AHEAD).step_by(S::LANES) {
            self.search.trial(S::load(&self.e[first..])).margin(self.least).store(&mut margins[first..]);
        }
        margins
    }
}

impl Search {
    /// None where the start can't be left backwards, or nothing comes to rest at the end.
    fn new(straight: &Straight) -> Option<Self> {
        let monotone = &straight.monotone;
        let Monotone { push: turns, brake: arrives, .. } = monotone;
        let (x0, g, (sin, cos)) = (turns.x, turns.g.abs(), turns.angle());
        let leaves = arrives.moved(-x0, (-sin, cos));
        if leaves.net() <= 0.0 || arrives.net() <= 0.0 {
            return None;
        }
        let energies = monotone.energies();
        // Below that the field is constant, and in a constant field no swing helps; nor does it much to the push where that is slowest.
        let constant = if energies.is_some_and(|energies| energies.push_hump == f64::INFINITY) {
            (0.05 * turns.net() / (g * cos.abs() + (g * turns.net()).sqrt())).min(0.05)
        } else {
            1e-3 * straight.distance().min(1.0)
        };
        let slow = energies.map_or(f64::INFINITY, |energies| 0.3 * energies.peak.min(energies.push_hump) / turns.net());
        let nearest = constant.min(slow).max(1e-13 * x0.abs().max(1.0));
        let push = energies.map(|energies| Push::new(monotone, &energies));
        Some(Search { straight: *straight, leaves, push, nearest, brake: OnceCell::new() })
    }

    #[inline(always)]
    fn trial<S: Real>(&self, e: S) -> Trial<S> {
        let both = |(sin, cos): (f64, f64)| (S::splat(sin), S::splat(cos));
        let Straight { monotone: Monotone { push, brake, .. }, middle, half } = &self.straight;
        let way = both(*half);
        let turn = S::splat(push.x) - e;
        let half = sin_cos_lanes(S::splat(0.5) * e);
        let between = back(both(push.angle()), half);
        let turns = push.splat().moved(turn, back(between, half));
        let out = drop(-between.0, half.0);
        let into = drop(back(both(*middle), half).0, way.0 * half.1 + way.1 * half.0);
        Trial { away: Monotone::between(self.leaves.splat(), turns, out), towards: Monotone::between(turns, brake.splat(), into), turn }
    }

    /// Of both torque bounds and of gravity.
    fn sizes(&self) -> [f64; 3] {
        let Monotone { push, brake, .. } = &self.straight.monotone;
        [push.push, brake.push, push.g.abs()]
    }

    /// No larger `e` is worth trying, if none above `most` is, nor above the `bound` for the largest net torques up and down.
    fn within(&self, mut most: f64, bound: impl Fn(f64, f64) -> f64) -> f64 {
        let turns = &self.straight.monotone.push;
        for _ in 0..3 {
            let (low, high) = torques(turns.g, turns.x - most, turns.x);
            let bound = bound(turns.push - low, self.leaves.push + high);
            if !(bound < most) {
                break;
            }
            most = bound;
        }
        most
    }
}

impl BackSwings for Search {
    fn slope(&self, e: f64, fine: bool) -> Option<f64> {
        let trial = self.trial(e);
        let (away, towards) = trial.energies()?;
        let (first, second) = (away.peak.sqrt().recip(), towards.peak.sqrt().recip());
        let turns = &trial.towards.push;
        let gradient = |length: f64, energies: [f64; 2]| {
            if fine { turns.time_gradient(length, FINE) } else { turns.rough_gradient(length, energies) }
        };
        let last = second - gradient(trial.towards.push_length, [towards.peak, towards.push_hump]);
        // The other one is not less: no need of it for the sign, which is all that a rough slope is for.
        let rate =
            if last >= 0.0 && !fine { 2.0 * last } else { first - gradient(trial.away.brake_length, [away.peak, away.brake_hump]) + last };
        let slope = rate / (rate.abs() + first + second);
        slope.is_finite().then_some(slope)
    }

    fn margin(&self, e: f64) -> f64 {
        self.trial(e).margin(f64::NEG_INFINITY)
    }

    fn screened(&self) -> bool {
        self.push.is_none()
    }

    fn margins(&self, some: &[f64], least: f64) -> [f64; AHEAD] {
        let mut e = [some[0]; AHEAD];
        e[..some.len()].copy_from_slice(some);
        run_lanes(Margins { search: self, e, least })
    }

    fn possible(&self, e: f64) -> bool {
        self.trial(e).energies().is_some()
    }

    fn swing(&self, e: f64) -> Option<Swing> {
        let trial = self.trial(e);
        trial.energies()?;
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

    fn nearest(&self) -> f64 {
        self.nearest
    }

    /// A swing takes more than its detour and, once back at `x0`, than the brake `F(-x1, D; u-)`, at no moment slower; and it has to be
    /// faster than the monotone motion.
    fn farthest(&self, limit: f64) -> f64 {
        if limit == f64::INFINITY {
            return FARTHEST;
        }
        let most = self.push.as_ref().map_or(FARTHEST, |push| self.within(FARTHEST, |up, down| push.gains(up, down)));
        if most < self.nearest {
            return most;
        }
        let brake = *self.brake.get_or_init(|| {
            let (brake, distance) = (&self.straight.monotone.brake, self.straight.distance());
            if brake.clears(distance) && brake.energy(distance) > 0.0 { brake.time_factor(distance) } else { 0.0 }
        });
        let left = 0.5 * (limit - brake).max(0.0);
        self.within(most, |up, down| (left / detour(up, down)).powi(2))
    }

    fn steepest(&self, e: f64) -> f64 {
        let [up, down, g] = self.sizes();
        10.0 * (up + down + g) * (1.0 / e).max(1.0)
    }

    fn weak(&self) -> bool {
        let [up, down, g] = self.sizes();
        up.min(down) < WEAK * g
    }
}

/// The best (-, +, -) motion faster than `bound` (a time over `sqrt(I/2)`).
pub(super) fn back_swing(straight: &Straight, bound: f64) -> Option<Swing> {
    fastest(&Search::new(straight)?, bound)
}

/// The best (+, -, +) motion faster than `bound`.
pub(super) fn overshoot(straight: &Straight, bound: f64) -> Option<Swing> {
    back_swing(&straight.reversed(), bound).map(Swing::reversed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::Array8;
    use std::f64::consts::PI;

    /// Ends, gravity and bounds, each from little to much.
    fn searches() -> impl Iterator<Item = Search> {
        let bounds = [0.3, 0.9, 1.0, 1.1, 4.0];
        let ends =
            (-4..4).flat_map(|k| [0.05, 0.7, 2.0, 1.75 * PI].map(|distance| (0.25 * PI * k as f64, 0.25 * PI * k as f64 + distance)));
        let limits = bounds.map(|up| bounds.map(|down| (up, down))).concat();
        ends.flat_map(move |(x0, x1)| {
            limits.clone().into_iter().flat_map(move |(up, down)| Search::new(&Straight::new(x0, x1, 1.0, up, down)))
        })
    }

    #[test]
    fn lanes_give_the_margins_of_one_number() {
        let e: [f64; AHEAD] = std::array::from_fn(|k| 0.01 * 2.2f64.powi(k as i32));
        let mut possible = 0;
        for search in searches() {
            let single = e.map(|e| search.margin(e));
            let least = f64::NEG_INFINITY;
            assert_eq!(search.margins(&e, least), single);
            assert_eq!(Margins { search: &search, e, least }.run::<Array8<false>>(), single);
            for (k, &margin) in search.margins(&e, 0.0).iter().enumerate() {
                assert!(margin == single[k] || margin.max(single[k]) <= 0.0, "{margin} {}", single[k]);
                assert_eq!(margin > 0.0, search.possible(e[k]));
                possible += usize::from(margin > 0.0);
            }
        }
        assert!(possible > 100, "{possible}");
    }

    #[test]
    fn no_swing_beyond_the_farthest_is_faster() {
        let (mut compared, mut near) = (0, f64::INFINITY);
        for search in searches() {
            if search.push.is_none() {
                continue;
            }
            let (push, brake) = search.straight.monotone.time_factors();
            let limit = push + brake;
            let farthest = search.farthest(limit).max(1e-3);
            for k in 0..25 {
                let swing = search.swing(farthest * 1.4f64.powi(k));
                let Some(swing) = swing else { continue };
                assert!(swing.time > limit * (1.0 - 1e-12), "{} {limit} {farthest}", swing.time);
                compared += 1;
                near = near.min(swing.time / limit - 1.0);
            }
        }
        assert!(compared > 1000 && near < 0.02, "{compared} {near}");
    }
}
