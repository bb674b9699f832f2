//! The fastest swing of a family: a one-dimensional search over the turning point.
//!
//! ```text
//! minimise T(e), e > 0 the way beyond the start, in the windows where the swing is possible
//! T falls inwards at every edge of a window: dT/de = r(l2) + r(l3) with r(l) = (1 + dy/dx)/v after the stretch l from the turn
//!     falls along a phase (its numerator and its speed solve one linear equation), so r -> -infinity where v -> 0, and the others are stalls
//! dT/de -> +infinity as e -> 0, which is possible where the monotone motion is
//! ```
//!
//! So T has a minimum in every window that does not begin with `e = 0`, and has no other: none was seen in half a million windows of random
//! links. Where it begins there T rises, and where a swing pays it falls to one and rises again: such windows, and those without a crest, are
//! swept for a slope that changes its sign. Slopes are rough at first (see `phase.rs`); the last ones are not.

/// A motion with one reversal, along the motion, in the unit of time of its family.
#[derive(Debug, Clone, Copy)]
pub(super) struct Swing {
    pub time: f64,
    pub x_switches: [f64; 2],
    pub t_switches: [f64; 2],
    pub x_turn: f64,
    pub t_turn: f64,
}

impl Swing {
    /// The motion mirrored and run backwards: a back-swing is then an overshoot.
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

/// The back-swings of a problem, by the way `e` that they back up.
pub(super) trait BackSwings {
    /// `d/(|d| + c)`, `d = dT/de` and `c < T/e` its part from the speeds at the switches; none where the swing is impossible. `fine`: to many digits.
    fn slope(&self, e: f64, fine: bool) -> Option<f64>;
    fn swing(&self, e: f64) -> Option<Swing>;
    /// Where swings are possible, from the nearest window to the last one that begins before `farthest`, and maybe on.
    fn windows(&self, farthest: f64) -> impl Iterator<Item = (f64, f64)>;
    /// Where the monotone motion is possible, the least `e` worth trying.
    fn nearest(&self) -> Option<f64>;
    /// No larger `e` is faster than `limit`.
    fn farthest(&self, limit: f64) -> f64;
}

/// A turning point and the slope there, at the edges of a window what it tends to.
type Point = (f64, f64);

/// What the last step of the turning point changes T by, relative: with it T is far nearer than that. (T is more than `c e`, see `slope`.)
const FLAT: f64 = 1e-10;
/// The last step on rough slopes, in parts of the way to an edge.
const NEAR: f64 = 3e-3;
/// A slope that is near zero: T hardly changes any more.
const LEVEL: f64 = 0.3;
/// The slope at a root of the rough slope above which that is no help.
const ROUGH: f64 = 0.02;
/// Farthest turning point, rad: beyond two turns only a chain of swings could help.
pub(super) const FARTHEST: f64 = 4.0 * std::f64::consts::PI;
/// Longer windows have no crest: there may be a minimum in every turn, and they are more than six radians apart.
const CREST: f64 = 6.5;
/// The first step of a sweep through one, and the longest of any, rad.
const FIRST: f64 = 0.2;
const LONGEST: f64 = 1.0;

struct Search<'a, B> {
    swings: &'a B,
    best: Option<Swing>,
    /// What the next swing has to be faster than, and the farthest turning point that may be.
    limit: f64,
    farthest: f64,
}

impl<B: BackSwings> Search<'_, B> {
    fn run(mut self) -> Option<Swing> {
        if self.swings.nearest().is_some_and(|nearest| nearest > self.farthest) {
            return None;
        }
        for (low, high) in self.swings.windows(self.farthest) {
            if !(low < self.farthest) {
                break;
            }
            match self.swings.nearest().filter(|&nearest| low < nearest) {
                Some(nearest) => self.sweep((0.0, 1.0), nearest, high),
                None if high - low > CREST => self.sweep((low, -1.0), FIRST, high),
                None => self.window(low, high),
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

    /// The slope within a window; rounding at its edges apart, swings are possible there.
    fn point(&self, e: f64, low: f64, high: f64, fine: bool) -> Point {
        (e, self.swings.slope(e, fine).unwrap_or(if e - low < high - e { -1.0 } else { 1.0 }))
    }

    /// T falls at first, has one minimum and rises.
    fn window(&mut self, low: f64, high: f64) {
        let end = if self.farthest < high { self.point(self.farthest, low, high, false) } else { (high, 1.0) };
        if end.1 >= 0.0 {
            self.consider(self.minimum((low, -1.0), end, high));
        }
    }

    /// Every minimum from an edge of a window on; the first point of the grid is a `step` away.
    fn sweep(&mut self, mut low: Point, mut step: f64, high: f64) {
        while low.0 < self.farthest.min(high) {
            let e = low.0 + step;
            let now = if e < high { self.point(e, 0.0, high, false) } else { (high, 1.0) };
            if low.1 < 0.0 && now.1 >= 0.0 {
                self.consider(self.minimum(low, now, high));
            }
            (low, step) = (now, (3.0 * step).min(LONGEST));
        }
    }

    /// The minimum of T between turning points: T falls at `low` and rises at `high`. The window ends at `last`.
    fn minimum(&self, low: Point, high: Point, last: f64) -> f64 {
        let (e, rate) = self.root(low, high, false);
        self.secants(e, rate, last).unwrap_or_else(|| self.root(low, high, true).0)
    }

    /// From near by, by secants of fine slopes, if they come nearer each time.
    fn secants(&self, e: f64, mut rate: f64, last: f64) -> Option<f64> {
        let mut at = self.point(e, 0.0, last, true);
        if at.1.abs() > ROUGH {
            return None;
        }
        loop {
            let e = at.0 - at.1 / rate;
            if !(rate > 0.0 && e > 0.0 && e < last) {
                return None;
            }
            if (at.1 * (e - at.0)).abs() <= FLAT * e {
                return Some(e);
            }
            let now = self.point(e, 0.0, last, true);
            if !(now.1.abs() < 0.5 * at.1.abs()) {
                return None;
            }
            rate = (now.1 - at.1) / (e - at.0);
            at = now;
        }
    }

    /// About where the slope is zero, and its rate there: inverse quadratic interpolation or bisection after Chandrupatla.
    fn root(&self, low: Point, high: Point, fine: bool) -> (f64, f64) {
        // The last point, one on the other side of the root, and the one before.
        let (mut a, mut b) = (low, high);
        let (mut e, mut rate) = (low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1), 0.0);
        for _ in 0..100 {
            let now = self.point(e, low.0, high.0, fine);
            rate = (now.1 - a.1) / (now.0 - a.0);
            let c;
            (a, b, c) = if (now.1 < 0.0) == (a.1 < 0.0) { (now, b, a) } else { (now, a, b) };
            let (xi, phi) = ((a.0 - b.0) / (c.0 - b.0), (a.1 - b.1) / (c.1 - b.1));
            let part = if phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi {
                a.1 / (b.1 - a.1) * c.1 / (b.1 - c.1) + (c.0 - a.0) / (b.0 - a.0) * a.1 / (c.1 - a.1) * b.1 / (c.1 - b.1)
            } else {
                0.5
            };
            let width = b.0 - a.0;
            e = a.0 + part * width;
            let step = (e - a.0).abs();
            let near = if fine { step * a.1.abs() <= FLAT * e } else { step <= NEAR * (e - low.0).min(high.0 - e) };
            if a.1.abs() < LEVEL && near || width.abs() <= 1e-15 * e {
                break;
            }
        }
        (e, rate)
    }
}

/// The fastest back-swing that takes less than `bound`.
pub(super) fn fastest(swings: &impl BackSwings, bound: f64) -> Option<Swing> {
    Search { swings, best: None, limit: bound, farthest: swings.farthest(bound) }.run()
}
