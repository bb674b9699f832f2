//! The fastest swing of a family: a one-dimensional search over the turning point.
//!
//! ```text
//! minimise T(e), e > 0 the way beyond the start:   dT/de = 0,   dT/de -> +infinity as e -> 0
//! T falls inwards at every edge of what is possible: dT/de = r(l2) + r(l3) with r(l) = (1 + dy/dx)/v after the stretch l from the turn
//!     falls along a phase (its numerator and its speed solve one linear equation), so r -> -infinity where v -> 0, and the others are stalls
//! ```
//!
//! So a swing that wins is a local minimum inside, with a slope that changes its sign: it is bracketed on a grid that resolves the
//! scales of the problem, and where a neighbour on the grid is impossible that is one end of the bracket. Slopes are rough at first
//! (see `phase.rs`); the last ones are not.

use super::grid::{AHEAD, Grid, next, next_weak};

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
    /// Positive where the swing is possible, continuous but for jumps where a hump leaves its phase.
    fn margin(&self, e: f64) -> f64;
    /// Whether many are impossible, and several margins cost less than finding that by one slope.
    fn screened(&self) -> bool {
        false
    }
    /// The margins of several `e`, at most eight; where one is at most `least`, any number up to that.
    fn margins(&self, e: &[f64], _least: f64) -> [f64; AHEAD] {
        let mut margins = [f64::NAN; AHEAD];
        for (&e, margin) in e.iter().zip(&mut margins) {
            *margin = self.margin(e);
        }
        margins
    }
    fn possible(&self, e: f64) -> bool;
    fn swing(&self, e: f64) -> Option<Swing>;
    /// The least `e` worth trying.
    fn nearest(&self) -> f64;
    /// No larger `e` is faster than `limit`.
    fn farthest(&self, limit: f64) -> f64;
    /// More than the margin changes by, per radian, from this `e` on.
    fn steepest(&self, e: f64) -> f64;
    /// T may change within a step of the grid, beside the edges of what is possible.
    fn weak(&self) -> bool;
}

/// A turning point and the slope there, none where the swing is impossible.
type Point = (f64, Option<f64>);
/// A turning point and the margin there.
type Margin = (f64, f64);

/// What the last step of the turning point changes T by, relative: with it T is far nearer than that. (T is more than `c e`, see `slope`.)
const FLAT: f64 = 1e-11;
/// The last step on rough slopes, in parts of where it was to be found.
const NEAR: f64 = 1e-3;
/// The slope at a root of the rough slope above which that is no help.
const ROUGH: f64 = 0.02;
/// Farthest turning point, rad: beyond two turns only a chain of swings could help.
pub(super) const FARTHEST: f64 = 4.0 * std::f64::consts::PI;
/// The least turning point, in parts of the least one of the grid.
const LEAST: f64 = 1e-13;
/// How fast the margin rises between the looks at it, in parts of `steepest`, where it does not jump.
const SLOPE: f64 = 0.05;

/// Whether the middle one of three margins is a maximum.
fn highest(three: &&[Margin]) -> bool {
    three[1].1 >= three[0].1.max(three[2].1)
}

struct Search<'a, B> {
    swings: &'a B,
    best: Option<Swing>,
    /// What the next swing has to be faster than, and the farthest turning point that may be.
    limit: f64,
    farthest: f64,
}

impl<B: BackSwings> Search<'_, B> {
    fn consider(&mut self, e: f64) {
        if let Some(swing) = self.swings.swing(e).filter(|s| s.time < self.limit * (1.0 - 1e-12)) {
            (self.limit, self.farthest) = (swing.time, self.swings.farthest(swing.time));
            self.best = Some(swing);
        }
    }

    /// The minimum between two turning points, if they enclose one.
    fn between(&mut self, low: Point, high: Point) {
        if low.1.or(high.1).is_some() && low.1.is_none_or(|slope| slope < 0.0) && high.1.is_none_or(|slope| slope >= 0.0) {
            self.consider(self.minimum(low, high));
        }
    }

    fn point(&self, e: f64) -> Point {
        (e, self.swings.slope(e, false))
    }

    fn run(mut self) -> Option<Swing> {
        let first = self.swings.nearest();
        if self.limit == f64::INFINITY {
            self.inwards(first);
        }
        if !(first <= self.farthest) {
            return self.best;
        }
        let weak = self.swings.weak();
        let mut grid = Grid::new(self.swings.screened().then_some(self.swings), self.following(), first, FARTHEST, 0.0);
        let (mut previous, mut any) = ((first, None), false);
        // One point beyond the farthest: it ends the last minimum.
        while previous.0 <= self.farthest
            && let Some((e, margin)) = grid.next()
        {
            let now = if margin > 0.0 { self.point(e) } else { (e, None) };
            any |= now.1.is_some();
            if e > first && weak && now.1.is_some() != previous.1.is_some() {
                let (inner, outer) = if now.1.is_some() { (now, previous.0) } else { (previous, now.0) };
                self.beside_edge(inner, outer);
            } else if e > first {
                self.between(previous, now);
            }
            previous = now;
        }
        if weak || !any {
            for (low, e, high) in self.windows(first, previous.0.min(self.farthest)) {
                let inner = self.point(e);
                for outer in [low, high] {
                    self.beside_edge(inner, outer);
                }
            }
        }
        if self.following()(previous.0) > FARTHEST && previous.1.is_some_and(|slope| slope < 0.0) {
            self.consider(previous.0);
        }
        self.best
    }

    /// From the first turning point towards none: where the monotone motion fails by little, the best swing backs up by little, too.
    fn inwards(&mut self, first: f64) {
        let mut high = self.point(first);
        while high.1.is_some_and(|slope| slope >= 0.0) {
            if high.0 < LEAST * first {
                return self.consider(high.0);
            }
            let low = self.point(0.2 * high.0);
            self.between(low, high);
            high = low;
        }
    }

    /// Points between a possible turning point and the edge towards an impossible one, close together at the edge.
    fn beside_edge(&mut self, inner: Point, outer: f64) {
        let (mut edge, mut beyond) = (inner.0, outer);
        for _ in 0..20 {
            let middle = 0.5 * (edge + beyond);
            if self.swings.possible(middle) { edge = middle } else { beyond = middle }
        }
        let mut previous = (beyond, None);
        for part in [3e-3, 0.03, 0.1, 0.22, 0.4, 0.6, 0.8, 1.0] {
            let now = if part == 1.0 { inner } else { self.point(edge + (inner.0 - edge) * part) };
            if outer < inner.0 {
                self.between(previous, now)
            } else {
                self.between(now, previous)
            }
            previous = now;
        }
    }

    /// A minimum of T between turning points with their slopes: T falls at `low` and rises at `high`, unless the swing is impossible there.
    fn minimum(&self, low: Point, high: Point) -> f64 {
        let (mut e, mut rate) = self.root(low, high, false);
        let Some(mut slope) = self.swings.slope(e, true) else { return e };
        if slope.abs() > ROUGH || !(rate > 0.0) {
            (e, rate) = self.root(low, high, true);
            slope = self.swings.slope(e, true).unwrap_or(0.0);
        }
        // Secants.
        let most = 0.1 * (high.0 - low.0);
        for _ in 0..30 {
            let next = e - (slope / rate).clamp(-most, most);
            if !(rate > 0.0) || (slope * (next - e)).abs() <= FLAT * e {
                return if rate > 0.0 { next } else { e };
            }
            match self.swings.slope(next, true) {
                Some(new) => {
                    rate = (new - slope) / (next - e);
                    (e, slope) = (next, new);
                }
                None => rate *= 2.0,
            }
        }
        e
    }

    /// About where the slope is zero, and its rate there: regula falsi after Illinois.
    fn root(&self, mut low: Point, mut high: Point, fine: bool) -> (f64, f64) {
        let (first, last) = (low.0, high.0);
        let at_end = |end: Point| end.1.unwrap_or(f64::NAN);
        let (mut at, mut side) = (if high.1.is_some() { (last, at_end(high)) } else { (first, at_end(low)) }, 0);
        let mut rate = (at_end(high) - at_end(low)) / (last - first);
        for _ in 0..100 {
            let width = high.0 - low.0;
            let e = match (low.1, high.1) {
                (Some(a), Some(b)) => low.0 + width * (a / (a - b)),
                _ => low.0 + 0.5 * width,
            };
            if width <= 1e-13 * e {
                // On the side that is possible.
                return (if low.1.is_none() { high.0 } else { low.0 }, rate);
            }
            if at.1.abs() < 0.3 && (e - at.0).abs() <= NEAR * (last - first).min(e) {
                return (e, rate);
            }
            let Some(slope) = self.swings.slope(e, fine) else {
                if low.1.is_none() {
                    low.0 = e;
                } else {
                    high = (e, None);
                }
                continue;
            };
            rate = (slope - at.1) / (e - at.0);
            at = (e, slope);
            if slope < 0.0 {
                low = (e, Some(slope));
                high.1 = high.1.map(|other| if side < 0 { 0.5 * other } else { other });
                side = -1;
            } else {
                high = (e, Some(slope));
                low.1 = low.1.map(|other| if side > 0 { 0.5 * other } else { other });
                side = 1;
            }
        }
        (at.0, rate)
    }

    /// Possible turning points that the grid may have missed, each between two that enclose it, at the maxima of the margin.
    fn windows(&self, first: f64, last: f64) -> Vec<(f64, f64, f64)> {
        let mut points = vec![(0.5 * first, f64::NEG_INFINITY)];
        points.extend(Grid::new(Some(self.swings), self.following(), first, last, f64::NEG_INFINITY));
        points.push((self.following()(points[points.len() - 1].0), f64::NEG_INFINITY));
        let mut found = Vec::new();
        for three in points.windows(3).filter(highest) {
            // The margin jumps where a hump leaves its phase: there may be several maxima in one.
            let row = self.between_margins(three[0], three[2]);
            let reach = SLOPE * self.swings.steepest(three[0].0) * (row[2].0 - row[1].0);
            let near = |point: &Margin| point.1 + reach > 0.0;
            let (Some(from), Some(to)) = (row.iter().position(near), row.iter().rposition(near)) else { continue };
            let row = self.between_margins(row[from.max(1) - 1], row[(to + 1).min(row.len() - 1)]);
            let maxima = row.windows(3).filter(highest).filter_map(|three| self.ascent(three[0].0, three[2].0));
            found.extend(maxima.map(|e| (three[0].0, e, three[2].0)));
        }
        found
    }

    /// The margins at two turning points, and at sixteen between.
    fn between_margins(&self, low: Margin, high: Margin) -> Vec<Margin> {
        let mut row = Vec::with_capacity(2 * AHEAD + 2);
        row.push(low);
        for first in [1, 1 + AHEAD] {
            let between: [f64; AHEAD] = std::array::from_fn(|k| low.0 + (high.0 - low.0) * ((first + k) as f64 / (2 * AHEAD + 1) as f64));
            row.extend(between.into_iter().zip(self.swings.margins(&between, f64::NEG_INFINITY)));
        }
        row.push(high);
        row
    }

    /// The next turning point of the grid.
    fn following(&self) -> fn(f64) -> f64 {
        if self.swings.weak() { next_weak } else { next }
    }

    /// A possible turning point between two: golden sections of the margin.
    fn ascent(&self, low: f64, high: f64) -> Option<f64> {
        const GOLDEN: f64 = 0.618_033_988_749_894_8;
        let (mut a, mut b) = (low, high);
        let steepest = self.swings.steepest(a);
        let (mut c, mut d) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
        let (mut at_c, mut at_d) = (self.swings.margin(c), self.swings.margin(d));
        while at_c <= 0.0 && at_d <= 0.0 {
            if !(b - a > 1e-13 * b) || at_c.max(at_d) + steepest * (b - a) < 0.0 {
                return None;
            }
            if at_c > at_d {
                (b, d, at_d) = (d, c, at_c);
                c = b - GOLDEN * (b - a);
                at_c = self.swings.margin(c);
            } else {
                (a, c, at_c) = (c, d, at_d);
                d = a + GOLDEN * (b - a);
                at_d = self.swings.margin(d);
            }
        }
        Some(if at_c > at_d { c } else { d })
    }
}

/// The fastest back-swing that takes less than `bound`.
pub(super) fn fastest(swings: &impl BackSwings, bound: f64) -> Option<Swing> {
    Search { swings, best: None, limit: bound, farthest: swings.farthest(bound) }.run()
}
