//! The minimum time of one link with viscous and Coulomb friction: the monotone motion, and motions with one reversal.
//!
//! ```text
//! I theta_ddot + G sin theta + d theta_dot + c sign(theta_dot) = tau         d: viscous, c: Coulomb friction coefficient
//! back-swing (-, +, -): x0 -> xt = x0 - e -> x1      torque less friction of the middle phase: u+ + c before the turn, u+ - c after it
//! dT/de = (z/v)_2 + (z/v)_3      spread z (`curve.rs`) over speed v at the two switches, 2 before and 3 after the turn
//! ```
//!
//! `I` is the inertia, and `G` the gravity moment. `x0` is the start, `x1` the goal and `xt` the turn. `u+` is the absolute value of the
//! upper torque bound. A shift of a switch does not change `T` to first order, because the two phases have equal speeds there. An overshoot
//! is a back-swing of the mirrored motion, run backwards in time with negative friction coefficients. Coulomb friction alone only shifts
//! the torque bounds of each part of the motion.
//!
//! Let `phi` be `exp(-d t / 2I)` times the adjoint variable, whose zeros are the switches. Then
//! `phi_ddot = (d^2/4I^2 - G cos theta/I) phi`, and Sturm's comparison theorem applies to `phi`. So for an overdamped link, with
//! `d^2 >= 4 I |G|`, the optimal torque switches at most once. This is also true with Coulomb friction. Coulomb friction reduces the
//! acceleration after a reversal, so that `phi_dot/phi` is at most `d/2I` there. After a zero of `phi`, `|phi|` grows, so there is no
//! second zero.
//!
//! For an overdamped link, a motion with one switch is monotone. From rest, such a link never moves beyond the equilibrium of gravity and
//! torque, because `v < 2 N(x)/d` remains true. Here `N(x)` is the torque minus the torques of gravity and Coulomb friction, and is zero at
//! the equilibrium. So only a brake ends at rest.

use super::curve::{Curve, Leg, Meeting};
use super::link::{Link, check_ends};
use super::phase::Phase;
use super::report::MonotoneReason;
use super::search::{BackSwings, FARTHEST, Swing, Window, fastest};
use super::steps::{FrictionLink, Progress};
use super::torque_optimal::{Best, Family, TorqueOptimum};
use super::windows::Windows;
use crate::error::{Error, Result};

/// A motion from an equilibrium is computed from this distance on, rad. The kinetic energy there is as small as a rounding error.
const START_DISTANCE: f64 = 1e-7;

/// The search for the fastest back-swing from `x0` to `x1 >= x0`.
struct FrictionSearch {
    x0: f64,
    x1: f64,
    up: f64,
    down: f64,
    link: FrictionLink,
    /// Whether the monotone motion is feasible.
    straight: bool,
    /// The first phase, which starts at rest at `x0`.
    leaves: Curve,
    /// The last phase, which ends at rest at `x1`, computed backwards.
    arrives: Curve,
    /// The largest distance `e` behind the start that the first and the last phase both cover, rad.
    most: f64,
}

/// The two rest-to-rest parts of a swing. Each part is stored as the point where its two phases have equal speeds.
struct FrictionTrial {
    turn: f64,
    away: Meeting,
    towards: Meeting,
}

impl FrictionSearch {
    /// Create the search. The result is `None` if the link cannot move backwards from `x0`, or cannot brake from a turn before `x0` to rest
    /// at `x1`.
    fn new(x0: f64, x1: f64, up: f64, down: f64, link: FrictionLink, straight: bool, bound: f64) -> Option<Self> {
        let mut search =
            FrictionSearch { x0, x1, up, down, link, straight, leaves: Curve::default(), arrives: Curve::default(), most: 0.0 };
        let (distance, backwards) = (x1 - x0, link.backwards());
        // Integrate a little farther than the search, so that the end of an integration does not count as the edge of an interval.
        let reach = |search: &FrictionSearch| 1.01 * search.farthest(bound);
        search.arrives = Curve::new(-x1, down, &backwards, reach(&search) + distance, None);
        search.leaves = Curve::new(-x0, down, &link, reach(&search), None);
        search.most = search.leaves.reach.min(search.arrives.reach - distance);
        (search.most > 0.0).then_some(search)
    }

    /// The intervals of turning points `e` from which the middle phase reaches `x`. The middle phase has the torque `up` and the friction
    /// of `link`.
    fn windows_to(&self, x: f64, link: FrictionLink) -> Vec<Window> {
        let (push, from) = (self.up - link.coulomb, x - self.x0);
        if push.abs() >= link.g.abs() {
            return if push > 0.0 { vec![(0.0, self.most)] } else { Vec::new() };
        }
        // Integrate backwards in time, from rest at `x` or at a maximum of gravity, with the same torque, until the link stops.
        let recovery = |x: f64| Curve::new(-x, -self.up, &link.backwards(), self.most + from, None).reach;
        let low = recovery(x);
        let (angle, crest) = Phase::new(-x, -push, link.g).least_after(low);
        Windows::new(low - from, crest - from, self.most, || recovery(-angle - START_DISTANCE) + START_DISTANCE).collect()
    }

    /// Find the point where the two phases before the turn have equal speeds. The second of these phases is computed backwards.
    fn away(&self, e: f64) -> Option<Meeting> {
        let to = Curve::new(self.x0 - e, self.up, &self.link.backwards(), e, Some(&self.leaves));
        Leg { push: &self.leaves, brake: &to, distance: e }.meeting()
    }

    /// Find the point where the two phases after the turn have equal speeds. The second of these phases is computed backwards.
    fn towards(&self, e: f64) -> Option<Meeting> {
        let distance = e + self.x1 - self.x0;
        let from = Curve::new(self.x0 - e, self.up, &self.link, distance, Some(&self.arrives));
        Leg { push: &from, brake: &self.arrives, distance }.meeting()
    }

    fn trial(&self, e: f64) -> Option<FrictionTrial> {
        Some(FrictionTrial { turn: self.x0 - e, away: self.away(e)?, towards: self.towards(e)? })
    }
}

impl BackSwings for FrictionSearch {
    fn slope(&self, e: f64, _fine: bool) -> Option<f64> {
        let trial = self.trial(e)?;
        let (first, second) = (trial.away.brake, trial.towards.push);
        let rate = first.spread / first.speed + second.spread / second.speed;
        let slope = rate / (rate.abs() + first.speed.recip() + second.speed.recip());
        slope.is_finite().then_some(slope)
    }

    fn swing(&self, e: f64) -> Option<Swing> {
        let FrictionTrial { turn, away, towards } = self.trial(e)?;
        let times = [away.push.time, away.brake.time, towards.push.time, towards.brake.time];
        Swing::new(turn, [self.x0 - away.at, turn + towards.at], times)
    }

    fn windows(&self, _farthest: f64) -> impl Iterator<Item = Window> {
        // With friction, the phases after the turn are longer than the phases before the turn. So the phases after the turn decide whether
        // a swing is feasible. In a problem run backwards, the friction coefficients are negative, and the phases before the turn may
        // decide too.
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

    /// The largest `e` of a swing that can be faster than `limit`, s. It follows from a lower bound of the duration:
    /// `T > k sqrt(2 I e / p) + T_brake(D)`.
    ///
    /// The first term is the time of `k` parts of length `e`. Each part starts at rest, and its net torque is at most `p`, the largest
    /// torque plus the gravity moment. The second term is the time of the last brake over the distance `D` from `x0` to `x1`. With positive
    /// friction `k = 2`: one part ends at the turn, the other part leads back to `x0`. With negative friction, the motion is computed
    /// backwards. Then the bound is true only for the part before the turn, so `k = 1`.
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

/// Compute the fastest motion of [`torque_optimal_time`](super::torque_optimal_time) with friction torques `viscous * v` and
/// `coulomb * sign(v)`.
///
/// `theta0` and `thetaf` are in rad, `inertia` in kg m^2, `viscous` in N m s/rad; all other arguments are in N m. The last argument is
/// `[viscous, coulomb]`. Errors: `Input` for an invalid argument.
pub fn torque_optimal_time_with_friction(
    theta0: f64,
    thetaf: f64,
    inertia: f64,
    gravity_moment: f64,
    tau_min: f64,
    tau_max: f64,
    [viscous, coulomb]: [f64; 2],
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
        match (FrictionMonotone { x0, x1, up, down, link: optimum.link }).solve() {
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
        let swing = FrictionSearch::new(x0, x1, up, down, link, optimum.feasible, bound).and_then(|search| fastest(&search, bound));
        if let Some(swing) = swing {
            let swing = if kind == Family::Overshoot { swing.reversed() } else { swing };
            optimum.best = Best::swing(kind, &swing, sign, 1.0);
        }
    }
    Ok(optimum)
}

/// The monotone motion from `x0` to `x1 > x0`, rad, with the torques `up` of the push and `down` of the brake.
struct FrictionMonotone {
    x0: f64,
    x1: f64,
    up: f64,
    down: f64,
    link: FrictionLink,
}

impl FrictionMonotone {
    /// Find the point where push and brake have equal speeds if both torques are larger by `more`, N m. Also return the distances that push
    /// and brake cover, rad.
    fn meeting(&self, more: f64) -> (Option<Meeting>, [f64; 2]) {
        let (distance, link) = (self.x1 - self.x0, self.link);
        let push = Curve::new(self.x0, self.up + more, &link, distance, None);
        let brake = Curve::new(-self.x1, self.down + more, &link.backwards(), distance, None);
        (Leg { push: &push, brake: &brake, distance }.meeting(), [push.reach, brake.reach])
    }

    fn solve(&self) -> std::result::Result<Meeting, MonotoneReason> {
        let FrictionMonotone { x0, x1, up, down, link } = *self;
        let net = [Progress::new(x0, up, &link).net(), Progress::new(-x1, down, &link.backwards()).net()];
        if net[0] <= 0.0 {
            return Err(MonotoneReason::StartBlocked { missing: 0.0 - net[0] });
        }
        if net[1] <= 0.0 {
            return Err(MonotoneReason::EndBlocked { missing: 0.0 - net[1] });
        }
        let (meeting, [push, brake]) = self.meeting(0.0);
        meeting.ok_or_else(|| MonotoneReason::Apart { push: x0 + push, brake: x1 - brake, missing: self.missing() })
    }

    /// The amount by which both torques must be larger for a feasible motion, N m, with a relative accuracy of 1e-6. Bisection starts from
    /// the upper bound gravity moment plus Coulomb friction, with which the motion is always feasible.
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
        for number in 0..300 {
            // Every quantity takes values that are spread evenly over (0, 1): the fractional parts of multiples of a square root.
            let [x0, distance, up, down, viscous, coulomb] =
                [2.0, 3.0, 5.0, 7.0, 11.0, 13.0].map(|k: f64| (number as f64 * k.sqrt()).fract());
            let (x0, up, down) = (8.0 * x0 - 4.0, 0.05 + 1.5 * up, 0.05 + 1.5 * down);
            let g = if number % 2 == 0 { 1.0 } else { -1.0 };
            let link = FrictionLink { inertia: 1.0, g, viscous, coulomb: 0.6 * coulomb * up.min(down) };
            for (way, link) in [link, link.backwards()].into_iter().enumerate() {
                let Some(search) = FrictionSearch::new(x0, x0 + 6.0 * distance, up, down, link, false, f64::INFINITY) else { continue };
                let [within, without] = check_windows(&search, 1e-5, 1.0);
                (inside[way], outside[way]) = (inside[way] + within, outside[way] + without);
            }
        }
        assert!(inside.into_iter().chain(outside).all(|count| count > 250), "{inside:?} {outside:?}");
    }
}
