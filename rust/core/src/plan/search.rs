//! The fastest swing of one kind, back-swing or overshoot: a one-dimensional search over the turning point.
//!
//! ```text
//! minimise T(e),   e > 0 the distance of the turn behind the start, in the intervals where the swing is feasible
//! dT/de = r(l2) + r(l3),   r(l) = (1 + dy/dx)/v at the distance y = l from the turn at x, at the speed v
//! dT/de -> -infinity   at the lower edge of an interval, where a push barely passes a maximum of gravity or reaches x1
//! dT/de -> +infinity   at the upper edge, where the link turns on a maximum of gravity, or where a brake ends
//! dT/de -> +infinity   as e -> 0, which is an edge only if the monotone motion is feasible
//! ```
//!
//! `l2` and `l3` are the distances from the turn to the two switches, `dy/dx` is the derivative at fixed time, and `x1` is the goal. A
//! *maximum of gravity* is an angle where the kinetic energy has a local minimum. `r` decreases along a phase, from +infinity at the turn
//! to -infinity at the next rest. The reason is that its numerator and the speed solve the same linear equation.
//!
//! So T has a minimum in every interval that does not begin with `e = 0`. The test `a_window_has_one_minimum` (`swing.rs`) finds no second
//! minimum in such intervals. In an interval that begins with `e = 0`, T rises at first. If the interval contains a swing that is faster
//! than the monotone motion, T then falls to a minimum and rises again. Such intervals, and those without a maximum of gravity, are
//! searched by a sweep for changes of sign of the derivative. The search first uses coarse values of `dT/de` with few digits (`phase.rs`).
//! Its last steps use accurate values.

use crate::interrupt;

/// A motion with one reversal. Its angles are `x = direction theta`, where `direction` is 1 or -1. Times are in units of `sqrt(I/2)`
/// seconds without friction, else in seconds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Swing {
    pub time: f64,
    pub x_switches: [f64; 2],
    pub t_switches: [f64; 2],
    pub x_turn: f64,
    pub t_turn: f64,
}

impl Swing {
    /// Create a swing from the angles of its turn and switches, and the times of its four phases; `None` if the duration is not finite.
    pub fn new(x_turn: f64, x_switches: [f64; 2], [t1, t2, t3, t4]: [f64; 4]) -> Option<Self> {
        let swing = Swing { time: t1 + t2 + t3 + t4, x_switches, t_switches: [t1, t1 + t2 + t3], x_turn, t_turn: t1 + t2 };
        swing.time.is_finite().then_some(swing)
    }

    /// The motion mirrored and run backwards: a back-swing becomes an overshoot.
    pub fn reversed(self) -> Self {
        let s = self;
        Swing {
            time: s.time,
            x_switches: [-s.x_switches[1], -s.x_switches[0]],
            t_switches: [s.time - s.t_switches[1], s.time - s.t_switches[0]],
            x_turn: -s.x_turn,
            t_turn: s.time - s.t_turn,
        }
    }
}

/// An open interval of turning points, as distances `e` behind the start, rad.
pub(super) type Window = (f64, f64);

/// The back-swings of a problem, as functions of the distance `e` of the turn behind the start.
pub(super) trait BackSwings {
    /// A scaled derivative of the duration, `d/(|d| + c)`, with `d = dT/de`. `c` is the sum of the reciprocal speeds at the switches.
    /// `None` if rounding errors dominate, or if the swing is not feasible. With `accurate`, the derivative has many digits.
    fn slope(&self, e: f64, accurate: bool) -> Option<f64>;
    /// The swing at `e`; `None` if it is not feasible.
    fn swing(&self, e: f64) -> Option<Swing>;
    /// The intervals of feasible swings, the nearest interval first. Intervals that begin beyond `farthest` may be missing.
    fn windows(&self, farthest: f64) -> impl Iterator<Item = Window>;
    /// The smallest `e` at which a swing may be faster than the monotone motion; `None` if that motion is not feasible.
    fn nearest(&self) -> Option<f64>;
    /// An upper bound of `e`: no swing with a larger `e` takes less time than `limit`.
    fn farthest(&self, limit: f64) -> f64;
}

/// A turning point `e`, rad, and the scaled derivative at `e`. At an edge of an interval, the second number is the limit of the derivative.
type Point = (f64, f64);

/// The search ends when the product of the scaled derivative and the last step is at most this fraction of `e`.
const FLAT: f64 = 1e-10;
/// A search with coarse derivatives ends after a step below this fraction of the distance from `e` to the nearer end of the first bracket.
const NEAR: f64 = 2e-3;
/// A search may end only where the absolute scaled derivative is below this number.
const LEVEL: f64 = 0.3;
/// A root of the coarse derivative is used only if the absolute accurate derivative at this root is at most this number.
const ROUGH: f64 = 0.02;
/// The farthest turning point of the search, rad: two revolutions.
pub(super) const FARTHEST: f64 = 4.0 * std::f64::consts::PI;
/// The largest length of an interval with a maximum of gravity, rad. A longer interval has no maximum of gravity. There T may have a
/// minimum in every revolution.
const ONE_TURN: f64 = 6.5;
/// The first step of a sweep through an interval longer than `ONE_TURN`, rad.
const FIRST: f64 = 0.2;
/// The longest step of a sweep, rad.
const LONGEST: f64 = 1.0;

struct TurnSearch<'a, B> {
    swings: &'a B,
    best: Option<Swing>,
    /// The duration that the next swing must beat, in the unit of the times of the swings.
    limit: f64,
    /// The turning point beyond which no swing is faster than `limit`, rad.
    farthest: f64,
}

impl<B: BackSwings> TurnSearch<'_, B> {
    fn run(mut self) -> Option<Swing> {
        if self.swings.nearest().is_some_and(|nearest| nearest > self.farthest) {
            return None;
        }
        for window in self.swings.windows(self.farthest) {
            interrupt::check();
            if !(window.0 < self.farthest) {
                break;
            }
            match self.swings.nearest().filter(|&nearest| window.0 < nearest) {
                Some(nearest) => self.sweep(window, 1.0, nearest),
                None if window.1 - window.0 > ONE_TURN => self.sweep(window, -1.0, FIRST),
                None => self.dip(window),
            }
        }
        self.best
    }

    fn consider(&mut self, e: f64) {
        if let Some(swing) = self.swings.swing(e).filter(|s| s.time < self.limit * (1.0 - 1e-12)) {
            (self.limit, self.farthest) = (swing.time, self.swings.farthest(swing.time));
            self.best = Some(swing);
        }
    }

    /// The scaled derivative at `e` within an interval. If rounding errors dominate near an edge, the result is the limit of the derivative
    /// at this edge.
    fn point(&self, e: f64, (low, high): Window, accurate: bool) -> Point {
        interrupt::check();
        (e, self.swings.slope(e, accurate).unwrap_or(if e - low < high - e { -1.0 } else { 1.0 }))
    }

    /// Search an interval in which T falls, has one minimum and rises.
    fn dip(&mut self, window: Window) {
        let (low, high) = window;
        // If no motion is known yet, every swing is an improvement. Then search the whole interval.
        let within = self.farthest < high && self.limit < f64::INFINITY;
        let end = if within { self.point(self.farthest, window, false) } else { (high, 1.0) };
        if end.1 >= 0.0 {
            self.consider(self.minimum((low, -1.0), end, window));
        }
    }

    /// Search an interval for minima of T, in growing steps. `slope` is the scaled derivative at its lower edge. The first point is `step`
    /// from this edge.
    fn sweep(&mut self, window: Window, slope: f64, mut step: f64) {
        let mut low = (window.0, slope);
        while low.0 < self.farthest.min(window.1) {
            let e = low.0 + step;
            let now = if e < window.1 { self.point(e, window, false) } else { (window.1, 1.0) };
            if low.1 < 0.0 && now.1 >= 0.0 {
                self.consider(self.minimum(low, now, window));
            }
            (low, step) = (now, (3.0 * step).min(LONGEST));
        }
    }

    /// The turning point with minimal T between `low`, where T falls, and `high`, where T rises.
    fn minimum(&self, low: Point, high: Point, window: Window) -> f64 {
        let (e, rate) = self.root(low, high, window, false);
        self.secants(e, rate, window).unwrap_or_else(|| self.root(low, high, window, true).0)
    }

    /// Improve a nearby root by the secant method with accurate derivatives; `None` if it does not converge. The bracket of the coarse
    /// derivatives is not used, because the root of the accurate derivatives may be outside.
    fn secants(&self, e: f64, mut rate: f64, window: Window) -> Option<f64> {
        let mut at = self.point(e, window, true);
        if at.1.abs() > ROUGH {
            return None;
        }
        loop {
            let e = at.0 - at.1 / rate;
            if !(rate > 0.0 && e > window.0 && e < window.1) {
                return None;
            }
            if (at.1 * (e - at.0)).abs() <= FLAT * e {
                return Some(e);
            }
            let now = self.point(e, window, true);
            if !(now.1.abs() < 0.5 * at.1.abs()) {
                return None;
            }
            rate = (now.1 - at.1) / (e - at.0);
            at = now;
        }
    }

    /// Find a root of the scaled derivative between `low` and `high`. Return it with the rate of change of the scaled derivative there.
    /// Chandrupatla's method chooses inverse quadratic interpolation or bisection for each step.
    fn root(&self, low: Point, high: Point, window: Window, accurate: bool) -> (f64, f64) {
        // `a` is the last point, `b` a point on the other side of the root, and `c` the point that was replaced.
        let (mut a, mut b) = (low, high);
        let (mut e, mut rate) = (low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1), 0.0);
        for _ in 0..100 {
            let now = self.point(e, window, accurate);
            rate = (now.1 - a.1) / (now.0 - a.0);
            let c;
            (a, b, c) = if (now.1 < 0.0) == (a.1 < 0.0) { (now, b, a) } else { (now, a, b) };
            let (xi, phi) = ((a.0 - b.0) / (c.0 - b.0), (a.1 - b.1) / (c.1 - b.1));
            let smooth = phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi;
            let part = if smooth {
                a.1 / (b.1 - a.1) * c.1 / (b.1 - c.1) + (c.0 - a.0) / (b.0 - a.0) * a.1 / (c.1 - a.1) * b.1 / (c.1 - b.1)
            } else {
                0.5
            };
            let width = b.0 - a.0;
            e = a.0 + part * width;
            let step = (e - a.0).abs();
            let near = if accurate { step * a.1.abs() <= FLAT * e } else { step <= NEAR * (e - low.0).min(high.0 - e) };
            if a.1.abs() < LEVEL && near || width.abs() <= 1e-15 * e {
                // If the next step is a bisection, the last point is at least as good as the middle of the bracket.
                return (if smooth { e } else { a.0 }, rate);
            }
        }
        (a.0, rate)
    }
}

/// The fastest back-swing with a duration below `bound`.
pub(super) fn fastest(swings: &impl BackSwings, bound: f64) -> Option<Swing> {
    TurnSearch { swings, best: None, limit: bound, farthest: swings.farthest(bound) }.run()
}

/// Check that swings are feasible exactly within their intervals. Check at the distance `offset` on both sides of each edge, and at
/// multiples of `spacing`. Return the numbers of feasible and of infeasible swings.
#[cfg(test)]
pub(super) fn check_windows(swings: &impl BackSwings, offset: f64, spacing: f64) -> [usize; 2] {
    let windows: Vec<_> = swings.windows(FARTHEST).take_while(|&(low, _)| low < FARTHEST).collect();
    let edges = windows.iter().flat_map(|&(low, high)| [low - offset, low + offset, high - offset, high + offset]);
    let even = (1..).map(|k| spacing * f64::from(k)).take_while(|&e| e < FARTHEST);
    let known = |e: &f64| windows.iter().all(|(low, high)| (e - low).abs().min((e - high).abs()) > 0.1 * offset);
    let mut counts = [0; 2];
    for e in edges.chain(even).filter(|&e| offset < e && e < FARTHEST).filter(known) {
        let within = windows.iter().any(|&(low, high)| low < e && e < high);
        assert_eq!(swings.swing(e).is_some(), within, "{e} {windows:?}");
        counts[usize::from(!within)] += 1;
    }
    counts
}
