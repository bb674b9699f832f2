//! The time optimum of one link with viscous and Coulomb friction: monotone, and with one reversal.
//!
//! ```text
//! I theta_ddot + G sin theta + d theta_dot + c sign(theta_dot) = tau
//! back-swing (-, +, -): x0 -> xt = x0 - e -> x1, the middle torque u+ less c after the turn, and with c before it
//! dT/de = (z/v)_2 + (z/v)_3                     spread and speed (`curve.rs`) at the two switches, before and after the turn
//! ```
//!
//! The switches do not contribute to the derivative, because the speeds agree there. An overshoot is the back-swing of the mirrored motion,
//! run backwards in time with both frictions negative. Coulomb friction alone only shifts the bounds. A test uses this as an
//! independent check.
//!
//! Let `phi` be `exp(-d t / 2I)` times the adjoint, whose zeros are the switches: `phi_ddot = (d^2/4I^2 - G cos theta/I) phi`. Sturm's comparison
//! holds for `phi`. So an overdamped link, `d^2 >= 4 I |G|`, switches at most once. This includes Coulomb friction. Where the motion reverses,
//! Coulomb friction reduces the acceleration, and with it `phi_dot/phi - d/2I`. After a zero, `|phi|` only grows.
//!
//! With one switch the motion is monotone. From rest, such a link never swings beyond the equilibrium of gravity and torque, because
//! `v < 2 K_dot(x)/d` remains true. So only a brake ends at rest.

use super::curve::{Curve, Leg, Meeting};
use super::link::{Link, check_ends};
use super::phase::Phase;
use super::report::MonotoneReason;
use super::search::{BackSwings, FARTHEST, Swing, Window, fastest};
use super::steps::{Progress, Rough};
use super::torque_optimal::{Best, Family, TorqueOptimum};
use super::windows::Windows;
use crate::error::{Error, Result};

/// The offset, in rad, at which a motion from an equilibrium begins. Its energy there is a rounding error.
const BESIDE: f64 = 1e-7;

/// The back-swings of `x0 -> x1 > x0`.
struct Search {
    x0: f64,
    x1: f64,
    up: f64,
    down: f64,
    link: Rough,
    /// Whether the monotone motion is possible.
    straight: bool,
    /// The outer phases, and the largest distance back that both cover.
    leaves: Curve,
    arrives: Curve,
    most: f64,
}

/// The two rest-to-rest parts of a swing, each as the point where its phases meet.
struct Trial {
    turn: f64,
    away: Meeting,
    towards: Meeting,
}

impl Search {
    /// None if the link cannot move backwards from the start, or cannot come to rest at the end.
    fn new(x0: f64, x1: f64, up: f64, down: f64, link: Rough, straight: bool, bound: f64) -> Option<Self> {
        let mut search = Search { x0, x1, up, down, link, straight, leaves: Curve::default(), arrives: Curve::default(), most: 0.0 };
        let (distance, back) = (x1 - x0, link.backwards());
        // A little farther than the search, so that the end of an integration does not count as an edge.
        let reach = |search: &Search| 1.01 * search.farthest(bound);
        search.arrives = Curve::new(-x1, down, &back, reach(&search) + distance, None);
        search.leaves = Curve::new(-x0, down, &link, reach(&search), None);
        search.most = search.leaves.reach.min(search.arrives.reach - distance);
        (search.most > 0.0).then_some(search)
    }

    /// The distances `e` from which the middle phase reaches `x`, with its torque and the friction of `link`.
    fn windows_to(&self, x: f64, link: Rough) -> Vec<Window> {
        let (push, from) = (self.up - link.coulomb, x - self.x0);
        if push.abs() >= link.g.abs() {
            return if push > 0.0 { vec![(0.0, self.most)] } else { Vec::new() };
        }
        // Integrate backwards from rest, at x or at a maximum of gravity, to the start of the same torque.
        let recovery = |x: f64| Curve::new(-x, -self.up, &link.backwards(), self.most + from, None).reach;
        let low = recovery(x);
        let (angle, crest) = Phase::new(-x, -push, link.g).least_after(low);
        Windows::new(low - from, crest - from, self.most, || recovery(-angle - BESIDE) + BESIDE).collect()
    }

    /// The meeting of the phases before the turn. The second of them runs backwards.
    fn away(&self, e: f64) -> Option<Meeting> {
        let to = Curve::new(self.x0 - e, self.up, &self.link.backwards(), e, Some(&self.leaves));
        Leg { push: &self.leaves, brake: &to, distance: e }.meeting()
    }

    /// The meeting of the phases after the turn.
    fn towards(&self, e: f64) -> Option<Meeting> {
        let distance = e + self.x1 - self.x0;
        let from = Curve::new(self.x0 - e, self.up, &self.link, distance, Some(&self.arrives));
        Leg { push: &from, brake: &self.arrives, distance }.meeting()
    }

    fn trial(&self, e: f64) -> Option<Trial> {
        Some(Trial { turn: self.x0 - e, away: self.away(e)?, towards: self.towards(e)? })
    }
}

impl BackSwings for Search {
    fn slope(&self, e: f64, _fine: bool) -> Option<f64> {
        let trial = self.trial(e)?;
        let (first, second) = (trial.away.brake, trial.towards.push);
        let rate = first.spread / first.speed + second.spread / second.speed;
        let slope = rate / (rate.abs() + first.speed.recip() + second.speed.recip());
        slope.is_finite().then_some(slope)
    }

    fn swing(&self, e: f64) -> Option<Swing> {
        let Trial { turn, away, towards } = self.trial(e)?;
        let times = [away.push.time, away.brake.time, towards.push.time, towards.brake.time];
        Swing::new(turn, [self.x0 - away.at, turn + towards.at], times)
    }

    fn windows(&self, _farthest: f64) -> impl Iterator<Item = Window> {
        // With friction the phases after the turn are the critical ones: they are longer. In a reversed problem it may be those before the
        // turn.
        let mut windows = self.windows_to(self.x1, self.link);
        if self.link.viscous < 0.0 || self.link.coulomb < 0.0 {
            let out = self.windows_to(self.x0, self.link.backwards());
            let both = |a: Window| out.iter().map(move |b| (a.0.max(b.0), a.1.min(b.1)));
            windows = windows.into_iter().flat_map(both).filter(|(low, high)| low < high).collect();
        }
        windows.into_iter()
    }

    fn nearest(&self) -> Option<f64> {
        self.straight.then(|| (1e-3 * (self.x1 - self.x0).min(1.0)).max(1e-6))
    }

    /// A lower bound of the duration: `T > k sqrt(2 I e / p) + T_brake(D)`.
    ///
    /// The first term is for stretches from rest with the full torque and gravity. Afterwards the motion is never faster than the last
    /// brake. `k = 2` for the stretches to the turn and back to `x0`. Backwards, only the first stretch begins at rest.
    fn farthest(&self, limit: f64) -> f64 {
        if limit == f64::INFINITY {
            return FARTHEST;
        }
        let (distance, p) = (self.x1 - self.x0, self.up.max(self.down) + self.link.g.abs());
        let brake = if distance > 0.0 && distance <= self.arrives.reach { self.arrives.at(distance).time } else { 0.0 };
        let stretches = if self.link.viscous < 0.0 || self.link.coulomb < 0.0 { 1.0 } else { 2.0 };
        (((limit - brake).max(0.0) / stretches).powi(2) * 0.5 * p / self.link.inertia).min(FARTHEST)
    }
}

/// The fastest `theta0 -> thetaf` (rad), rest to rest, as `torque_optimal_time`, with friction torques `viscous * v` (N m s) and
/// `coulomb * sign(v)` (N m).
pub fn torque_optimal_time_with_friction(
    theta0: f64,
    thetaf: f64,
    inertia: f64,
    gravity_moment: f64,
    tau_min: f64,
    tau_max: f64,
    viscous: f64,
    coulomb: f64,
) -> Result<TorqueOptimum> {
    check_ends(theta0, thetaf)?;
    let link = Link::new(inertia, gravity_moment, tau_min, tau_max)?;
    for (name, x) in [("viscous", viscous), ("coulomb", coulomb)] {
        if !(x >= 0.0 && x.is_finite()) {
            return Err(Error::input(name, format!("is not a friction coefficient: expected a finite number >= 0, got {x}")));
        }
    }
    let mut optimum = TorqueOptimum::new(theta0, thetaf, &link, [viscous, coulomb]);
    if theta0 == thetaf && optimum.set_still(&link) {
        return Ok(optimum);
    }
    let sign = if link.is_ahead(theta0, thetaf) { 1.0 } else { -1.0 };
    let along = link.along(sign > 0.0);
    let (x0, x1, up, down) = (sign * theta0, sign * thetaf, along.tau_max, -along.tau_min);
    if x0 != x1 {
        match (Straight { x0, x1, up, down, link: optimum.link }).solve() {
            Ok(Meeting { at, push, brake }) => optimum.set_monotone(push.time + brake.time, sign * (x0 + at), push.time, sign * push.speed),
            Err(reason) => optimum.reason = reason.along(sign),
        }
    }
    let overdamped = optimum.sturm_bound == f64::INFINITY;
    optimum.certified_global =
        optimum.feasible && (overdamped || coulomb == 0.0 && up.min(down) >= gravity_moment.abs() && optimum.t <= optimum.sturm_bound);
    if optimum.certified_global || overdamped {
        return Ok(optimum);
    }
    let link = optimum.link;
    for (kind, (x0, x1), (up, down), link) in
        [(Family::BackSwing, (x0, x1), (up, down), link), (Family::Overshoot, (-x1, -x0), (down, up), link.backwards())]
    {
        let bound = if optimum.best.t.is_nan() { f64::INFINITY } else { optimum.best.t };
        let swing = Search::new(x0, x1, up, down, link, optimum.feasible, bound).and_then(|search| fastest(&search, bound));
        if let Some(swing) = swing {
            let swing = if kind == Family::Overshoot { swing.reversed() } else { swing };
            optimum.best = Best::swing(kind, &swing, sign, 1.0);
        }
    }
    Ok(optimum)
}

/// The monotone motion `x0 -> x1 > x0`.
struct Straight {
    x0: f64,
    x1: f64,
    up: f64,
    down: f64,
    link: Rough,
}

impl Straight {
    /// The point where push and brake meet with both torques larger by `more`, and the ends of both.
    fn meeting(&self, more: f64) -> (Option<Meeting>, [f64; 2]) {
        let (distance, link) = (self.x1 - self.x0, self.link);
        let push = Curve::new(self.x0, self.up + more, &link, distance, None);
        let brake = Curve::new(-self.x1, self.down + more, &link.backwards(), distance, None);
        (Leg { push: &push, brake: &brake, distance }.meeting(), [push.reach, brake.reach])
    }

    fn solve(&self) -> std::result::Result<Meeting, MonotoneReason> {
        let Straight { x0, x1, up, down, link } = *self;
        let net = [Progress::new(x0, up, &link).net(), Progress::new(-x1, down, &link.backwards()).net()];
        if net[0] <= 0.0 {
            return Err(MonotoneReason::StartBlocked { missing: -net[0] });
        }
        if net[1] <= 0.0 {
            return Err(MonotoneReason::EndBlocked { missing: -net[1] });
        }
        let (meeting, [push, brake]) = self.meeting(0.0);
        meeting.ok_or_else(|| MonotoneReason::Apart { push: x0 + push, brake: x1 - brake, missing: self.missing() })
    }

    /// The missing amount of both torques, to six digits. Both are sufficient if they are larger by gravity and friction, which bounds the
    /// search.
    fn missing(&self) -> f64 {
        let (mut less, mut more) = (0.0, self.link.g.abs() + self.link.coulomb);
        while more - less > 1e-6 * more && more > 1e-12 * self.up.max(self.down) {
            let middle = 0.5 * (less + more);
            if self.meeting(middle).0.is_some() { more = middle } else { less = middle }
        }
        more
    }
}

#[cfg(test)]
mod tests {
    use super::super::search::check_windows;
    use super::*;

    #[test]
    fn swings_are_possible_in_their_windows_and_nowhere_else() {
        let (mut inside, mut outside) = ([0; 2], [0; 2]);
        for number in 0..600 {
            // Numbers spread evenly over their ranges: multiples of square roots.
            let [x0, distance, up, down, viscous, coulomb] =
                [2.0, 3.0, 5.0, 7.0, 11.0, 13.0].map(|k: f64| (number as f64 * k.sqrt()).fract());
            let (x0, up, down) = (8.0 * x0 - 4.0, 0.05 + 1.5 * up, 0.05 + 1.5 * down);
            let g = if number % 2 == 0 { 1.0 } else { -1.0 };
            let link = Rough { inertia: 1.0, g, viscous, coulomb: 0.6 * coulomb * up.min(down) };
            for (way, link) in [link, link.backwards()].into_iter().enumerate() {
                let Some(search) = Search::new(x0, x0 + 6.0 * distance, up, down, link, false, f64::INFINITY) else { continue };
                let [within, without] = check_windows(&search, 1e-5, 1.0);
                (inside[way], outside[way]) = (inside[way] + within, outside[way] + without);
            }
        }
        assert!(inside.into_iter().chain(outside).all(|count| count > 500), "{inside:?} {outside:?}");
    }
}
