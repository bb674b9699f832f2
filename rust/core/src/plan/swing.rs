//! Back-swings and overshoots of one link without friction.
//!
//! ```text
//! back-swing (-, +, -): x0 -> xt = x0 - e -> x1, two monotone optima; the torque does not change at the turn, so two switches
//! T(e) = sqrt(I/2) [ F(-x0, l1; u-) + F(xt, l2; u+) + F(xt, l3; u+) + F(-x1, l4; u-) ],   l1 + l2 = e,  l3 + l4 = e + D
//! dT/de = sqrt(I/2) [ 1/sqrt(K_12) + 1/sqrt(K_34) - dF/dx(xt, l2) - dF/dx(xt, l3) ]
//! ```
//!
//! `x0` is the start, `x1` the goal, `xt` the turn, and `D = x1 - x0`. `I` is the inertia, and `l1` to `l4` are the lengths of the phases.
//! `F(x, L; u)` is the time factor of a phase (`phase.rs`) with the torque `u`. `u+` and `u-` are the absolute values of the upper and the
//! lower torque bound, and `K_12`, `K_34` are the kinetic energies at the switches. Only the phases that start at the turn have a term
//! `dF/dx`, because the outer phases start from fixed points. At a switch both phases have the same energy `K`, so only the sum of their
//! lengths counts. An overshoot is the back-swing of the motion mirrored and run backwards in time.

use super::detour::{Push, detour};
use super::monotone::{Monotone, MonotoneMotion, drop};
use super::phase::Phase;
use super::search::{BackSwings, FARTHEST, Swing, Window, fastest};
use super::sine::{gravity_range, sin_cos, sine};
use super::windows::Windows;
use std::cell::OnceCell;
use std::f64::consts::TAU;

/// Relative accuracy of the accurate derivatives, which the search uses for its last steps.
const ACCURACY: f64 = 1e-6;

/// The search for the fastest back-swing.
struct SwingSearch {
    /// The monotone motion. Its push, moved to the turn, is the middle phase. Its brake is the last phase.
    straight: MonotoneMotion,
    /// The first phase, from `x0` to the first switch.
    first_phase: Phase,
    /// The push of the monotone motion; `None` if that motion is not feasible.
    push: Option<Push>,
    /// The smallest `e` at which a swing may be faster than the monotone motion; `None` if that motion is not feasible.
    nearest: Option<f64>,
    /// `F(-x1, D; u-)`, the time factor of the brake over the whole distance `D`; zero if this brake stalls.
    brake: OnceCell<f64>,
}

/// Sine and cosine of the difference of two angles, from their sines and cosines.
fn angle_difference((sin, cos): (f64, f64), (less_sin, less_cos): (f64, f64)) -> (f64, f64) {
    (sin * less_cos - cos * less_sin, cos * less_cos + sin * less_sin)
}

/// Two monotone motions that meet at the turning point.
struct SwingTrial {
    away: Monotone,
    towards: Monotone,
    turn: f64,
}

impl SwingSearch {
    /// Create the search. The result is `None` if the link cannot move backwards from the start, or cannot come to rest at the end.
    fn new(straight: &MonotoneMotion) -> Option<Self> {
        let monotone = &straight.monotone;
        let Monotone { push, brake, .. } = monotone;
        let (x0, (sin, cos)) = (push.x, push.angle());
        let first_phase = brake.moved(-x0, (-sin, cos));
        if first_phase.net() <= 0.0 || brake.net() <= 0.0 {
            return None;
        }
        let energies = monotone.energies();
        let nearest = energies.map(|energies| {
            // For `e` below `constant`, gravity varies little along the motion, and in a constant field no swing is faster. For `e` below
            // `slow`, a swing adds little kinetic energy to the push, even where the push is slowest.
            let g = push.g.abs();
            let constant = if energies.push_hump == f64::INFINITY {
                (0.05 * push.net() / (g * cos.abs() + (g * push.net()).sqrt())).min(0.05)
            } else {
                1e-3 * straight.distance().min(1.0)
            };
            let slow = 0.3 * energies.peak.min(energies.push_hump) / push.net();
            constant.min(slow).max(1e-13 * x0.abs().max(1.0))
        });
        let push = energies.map(|energies| Push::new(monotone, &energies));
        Some(SwingSearch { straight: *straight, first_phase, push, nearest, brake: OnceCell::new() })
    }

    /// The two monotone motions of the swing that turns at `xt = x0 - e`.
    ///
    /// ```text
    /// cos x0 - cos xt = -2 sin(x0 - e/2) sin(e/2),   cos xt - cos x1 = 2 sin((x0 + x1)/2 - e/2) sin(D/2 + e/2)
    /// ```
    #[inline]
    fn trial(&self, e: f64) -> SwingTrial {
        let MonotoneMotion { monotone: Monotone { push, brake, .. }, middle, half: half_d } = self.straight;
        let (turn, half_e) = (push.x - e, sin_cos(0.5 * e));
        let x0_less_half_e = angle_difference(push.angle(), half_e);
        let middle_phase = push.moved(turn, angle_difference(x0_less_half_e, half_e));
        let drop_away = drop(-x0_less_half_e.0, half_e.0);
        let drop_towards = drop(angle_difference(middle, half_e).0, half_d.0 * half_e.1 + half_d.1 * half_e.0);
        let away = Monotone::between(self.first_phase, middle_phase, drop_away);
        SwingTrial { away, towards: Monotone::between(middle_phase, brake, drop_towards), turn }
    }

    /// Reduce the upper bound `most` of `e`, and return it. `bound` computes such a bound from the largest net torques `p_+` and `p_-`
    /// (`detour.rs`). The torques are the largest within the distance `most` behind the start.
    fn reduce_bound(&self, mut most: f64, bound: impl Fn(f64, f64) -> f64) -> f64 {
        let push = &self.straight.monotone.push;
        let start = sine(push.x);
        for _ in 0..3 {
            let revolution = (-push.g.abs(), push.g.abs());
            let (low, high) = if most < TAU { gravity_range(push.g, &sine(push.x - most), &start) } else { revolution };
            let bound = bound(push.push - low, self.first_phase.push + high);
            if !(bound < most) {
                break;
            }
            most = bound;
        }
        most
    }
}

impl BackSwings for SwingSearch {
    fn slope(&self, e: f64, accurate: bool) -> Option<f64> {
        let SwingTrial { away, towards, .. } = self.trial(e);
        let middle_phase = &towards.push;
        // r(l) = 1/sqrt(K) - dF/dx(xt, l), and 1/sqrt(K).
        let r = |l: f64| {
            let energy = middle_phase.energy(l);
            let gradient = if accurate { middle_phase.time_gradient(l, ACCURACY) } else { middle_phase.rough_gradient(l, energy) };
            let inverse = energy.sqrt().recip();
            (inverse - gradient, inverse)
        };
        let (l2, l3) = (away.brake_length, towards.push_length);
        let (r_long, inverse_long) = r(l2.max(l3));
        // dT/de is the sum of `r(l2)` and `r(l3)`. The shorter part of the middle phase has the larger term. So if the term of the longer
        // part is positive, the sum is positive. Then the coarse search requires only this sign, and uses the term of the longer part twice.
        let (r_short, inverse_short) = if r_long >= 0.0 && !accurate { (r_long, inverse_long) } else { r(l2.min(l3)) };
        let sum = r_long + r_short;
        let slope = sum / (sum.abs() + inverse_short + inverse_long);
        slope.is_finite().then_some(slope)
    }

    fn swing(&self, e: f64) -> Option<Swing> {
        let trial = self.trial(e);
        trial.away.energies().and(trial.towards.energies())?;
        let ((t1, t2), (t3, t4)) = (trial.away.time_factors(), trial.towards.time_factors());
        let switches = [trial.turn + trial.away.brake_length, trial.turn + trial.towards.push_length];
        Swing::new(trial.turn, switches, [t1, t2, t3, t4])
    }

    fn windows(&self, farthest: f64) -> impl Iterator<Item = Window> {
        let Monotone { push, brake, .. } = &self.straight.monotone;
        let distance = self.straight.distance();
        // The phase from x1 under the torque -u+, in the mirrored coordinate: its energy is W(x1) - W(x), where W is defined in
        // `windows.rs`.
        let against = Phase::new(brake.x, -push.push, push.g);
        let (low, crest) = if push.push < push.g.abs() { against.descent() } else { (0.0, f64::INFINITY) };
        let most = if low - distance < farthest { self.first_phase.reach().min(brake.reach() - distance) } else { 0.0 };
        Windows::new(low - distance, crest - distance, most, move || against.recovery())
    }

    fn nearest(&self) -> Option<f64> {
        self.nearest
    }

    /// The largest `e` of a swing that can be faster than `limit`. A swing takes at least the time to the turn and back to `x0`, plus the
    /// time of the brake `F(-x1, D; u-)`. From `x0` to `x1` no swing is faster than this brake.
    fn farthest(&self, limit: f64) -> f64 {
        if limit == f64::INFINITY {
            return FARTHEST;
        }
        let most = self.push.as_ref().map_or(FARTHEST, |push| self.reduce_bound(FARTHEST, |up, down| push.gains(up, down)));
        if self.nearest.is_some_and(|nearest| most < nearest) {
            return most;
        }
        let brake = *self.brake.get_or_init(|| {
            let (brake, distance) = (&self.straight.monotone.brake, self.straight.distance());
            if brake.clears(distance) && brake.energy(distance) > 0.0 { brake.time_factor(distance) } else { 0.0 }
        });
        // 2 sqrt(e) detour <= limit - F(-x1, D; u-)
        let half_time = 0.5 * (limit - brake).max(0.0);
        self.reduce_bound(most, |up, down| (half_time / detour(up, down)).powi(2))
    }
}

/// The fastest (-, +, -) motion with a time below `bound`. Times are in units of `sqrt(I/2)` seconds.
pub(super) fn back_swing(straight: &MonotoneMotion, bound: f64) -> Option<Swing> {
    fastest(&SwingSearch::new(straight)?, bound)
}

/// The fastest (+, -, +) motion with a time below `bound`. Times are in units of `sqrt(I/2)` seconds.
pub(super) fn overshoot(straight: &MonotoneMotion, bound: f64) -> Option<Swing> {
    back_swing(&straight.reversed(), bound).map(Swing::reversed)
}

#[cfg(test)]
mod tests {
    use super::super::search::check_windows;
    use super::*;
    use std::f64::consts::PI;

    /// The search problems for many pairs of start and end angles, and of upper and lower torque bounds.
    fn searches() -> impl Iterator<Item = SwingSearch> {
        let bounds = [0.03, 0.3, 0.9, 1.0, 1.1, 4.0];
        let ends =
            (-4..4).flat_map(|k| [0.05, 0.7, 2.0, 1.75 * PI].map(|distance| (0.25 * PI * k as f64, 0.25 * PI * k as f64 + distance)));
        let limits = bounds.map(|up| bounds.map(|down| (up, down))).concat();
        ends.flat_map(move |(x0, x1)| {
            limits.clone().into_iter().flat_map(move |(up, down)| SwingSearch::new(&MonotoneMotion::new(x0, x1, 1.0, up, down)))
        })
    }

    #[test]
    fn swings_are_possible_in_their_windows_and_nowhere_else() {
        let (mut inside, mut outside, mut narrow) = (0, 0, 0);
        for search in searches() {
            let [within, without] = check_windows(&search, 1e-9, 0.3);
            (inside, outside) = (inside + within, outside + without);
            narrow += search.windows(FARTHEST).take_while(|&(low, _)| low < FARTHEST).filter(|(low, high)| high - low < 0.3).count();
        }
        assert!(inside > 10_000 && outside > 10_000 && narrow > 10, "{inside} {outside} {narrow}");
    }

    #[test]
    fn a_window_has_one_minimum() {
        let mut checked = 0;
        for search in searches() {
            let windows = search.windows(FARTHEST).take_while(|&(low, _)| low < FARTHEST);
            for (low, high) in windows.filter(|&(low, high)| low > 0.0 && high - low < TAU) {
                let mut rises = Vec::new();
                for e in (1..50).map(|k| low + (high - low) * k as f64 / 50.0) {
                    let [rough, accurate] = [false, true].map(|accurate| search.slope(e, accurate).unwrap());
                    assert!(rough * accurate > 0.0 || accurate.abs() < 0.05, "{low} {high} {e}: {rough} {accurate}");
                    rises.push(accurate > 0.0);
                }
                let turns = rises.windows(2).filter(|two| two[0] != two[1]).count();
                assert!(turns == 0 || turns == 1 && rises[48], "{low} {high} {turns}");
                checked += turns;
            }
        }
        assert!(checked > 100, "{checked}");
    }

    #[test]
    fn a_minimum_next_to_an_edge_is_found() {
        // The interval is 2e-3 rad wide, and its minimum is 2e-10 rad from its edge. The minimum time in the next interval is 142.7 (unit:
        // `sqrt(I/2)` s).
        let straight = MonotoneMotion::new(6.2831853083864555, 6.28318550293321, -1.0, 1.2068690262570462e-9, 1.9572908712209023e-7);
        let swing = overshoot(&straight, f64::INFINITY).unwrap();
        assert!((swing.time - 79.92567).abs() < 1e-4, "{}", swing.time);
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
            for k in 0..13 {
                let swing = search.swing(farthest * 2.0f64.powi(k));
                let Some(swing) = swing else { continue };
                assert!(swing.time > limit * (1.0 - 1e-12), "{} {limit} {farthest}", swing.time);
                compared += 1;
                near = near.min(swing.time / limit - 1.0);
            }
        }
        assert!(compared > 1000 && near < 0.02, "{compared} {near}");
    }
}
