//! The fastest motion with one reversal: a one-dimensional search over the turning point.
//!
//! ```text
//! back-swing (-, +, -): x0 -> xt = x0 - e -> x1, each stretch a monotone optimum; no torque change at the turn, so two switches
//! T(e) = sqrt(I/2) [ F(-x0, l1; u-) + F(xt, l2; u+) + F(xt, l3; u+) + F(-x1, l4; u-) ],   l1 + l2 = e,  l3 + l4 = e + D
//! dT/de = sqrt(I/2) [ 1/sqrt(K_12) + 1/sqrt(K_34) - dF/dx(xt, l2) - dF/dx(xt, l3) ]
//! ```
//!
//! Only the middle phase enters the derivative: the outer phases start from fixed points, and the switches move
//! along curves of equal energy. `dT/de -> +infinity` as `e -> 0`, so a swing that wins is a separate local minimum:
//! it is bracketed on a grid that resolves the scales of the problem, by sign changes of the derivative, and
//! the edges of the feasible set are found by bisection of the margin. An overshoot is the back-swing of the
//! motion mirrored and run backwards in time.

use super::phase::Phase;
use super::report::MonotoneReason;
use super::torque_optimal::Monotone;

/// A motion with one reversal, along the motion; times over `sqrt(I/2)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Swing {
    pub time: f64,
    pub x_switches: [f64; 2],
    pub t_switches: [f64; 2],
    pub x_turn: f64,
    pub t_turn: f64,
}

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
}

/// Two monotone stretches that meet at the turning point.
struct Trial {
    away: Monotone,
    towards: Monotone,
    turn: f64,
}

/// Relative accuracy of the turning point: T is flat there, so its error is of the order of the square.
const PLACE: f64 = 1e-8;
/// Accuracies of the slope: on the grid its sign is enough, at the root it decides the place.
const COARSE: f64 = 1e-3;
const FINE: f64 = 1e-9;
/// Farthest turning point, rad: beyond two turns only a chain of swings could help.
const FARTHEST: f64 = 4.0 * std::f64::consts::PI;

impl Search {
    fn trial(&self, e: f64) -> Trial {
        let turn = self.x0 - e;
        let turns = self.turns.moved(turn);
        Trial { away: Monotone::between(self.leaves, turns), towards: Monotone::between(turns, self.arrives), turn }
    }

    fn possible(&self, e: f64) -> Option<Trial> {
        let trial = self.trial(e);
        (trial.away.reason() == MonotoneReason::Feasible && trial.towards.reason() == MonotoneReason::Feasible).then_some(trial)
    }

    /// `dT/de` over `sqrt(I/2)`, or none where the swing is impossible.
    fn slope(&self, e: f64, accuracy: f64) -> Option<f64> {
        let trial = self.possible(e)?;
        let middle = &trial.towards.push;
        let (away, towards) = (&trial.away, &trial.towards);
        let ends = away.push.energy(away.push_length).sqrt().recip() + towards.push.energy(towards.push_length).sqrt().recip();
        let slope = ends - middle.time_gradient(away.brake_length, accuracy) - middle.time_gradient(towards.push_length, accuracy);
        slope.is_finite().then_some(slope)
    }

    fn margin(&self, e: f64) -> f64 {
        let trial = self.trial(e);
        trial.away.margin().min(trial.towards.margin())
    }

    fn swing(&self, e: f64) -> Option<Swing> {
        let trial = self.possible(e)?;
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

    /// The last possible turning point between a possible and an impossible one, in so many halvings.
    fn edge(&self, mut inside: f64, mut outside: f64, halvings: usize) -> (f64, f64) {
        for _ in 0..halvings {
            let middle = 0.5 * (inside + outside);
            if self.possible(middle).is_some() { inside = middle } else { outside = middle }
        }
        (inside, outside)
    }

    /// The root of the slope between `a` (negative) and `b` (positive): Brent's zero.
    fn root(&self, a: (f64, f64), b: (f64, f64)) -> f64 {
        let (mut a, mut b) = (a, b);
        let mut c = a;
        let (mut step, mut before) = (b.0 - a.0, b.0 - a.0);
        for _ in 0..100 {
            if (b.1 > 0.0) == (c.1 > 0.0) {
                c = a;
                step = b.0 - a.0;
                before = step;
            }
            if c.1.abs() < b.1.abs() {
                (a, b, c) = (b, c, b);
            }
            let tolerance = PLACE * b.0.abs();
            let half = 0.5 * (c.0 - b.0);
            if half.abs() <= tolerance || b.1 == 0.0 {
                break;
            }
            let mut bisect = true;
            if before.abs() >= tolerance && a.1.abs() > b.1.abs() {
                let s = b.1 / a.1;
                let (mut p, mut q) = if a.0 == c.0 {
                    (2.0 * half * s, 1.0 - s)
                } else {
                    let (q, r) = (a.1 / c.1, b.1 / c.1);
                    (s * (2.0 * half * q * (q - r) - (b.0 - a.0) * (r - 1.0)), (q - 1.0) * (r - 1.0) * (s - 1.0))
                };
                if p > 0.0 {
                    q = -q;
                }
                p = p.abs();
                if 2.0 * p < (3.0 * half * q - (tolerance * q).abs()).min((before * q).abs()) {
                    (before, step, bisect) = (step, p / q, false);
                }
            }
            if bisect {
                (step, before) = (half, half);
            }
            a = b;
            b.0 += if step.abs() > tolerance { step } else { tolerance.copysign(half) };
            match self.slope(b.0, FINE) {
                Some(slope) => b.1 = slope,
                None => return a.0,
            }
        }
        b.0
    }

    /// Smallest turn worth trying: below it the field is constant, and in a constant field no swing helps.
    fn nearest(&self) -> f64 {
        let push = self.turns;
        let distance = self.x1 - self.x0;
        let scale = distance.min(1.0);
        let monotone = Monotone::new(self.x0, self.x1, self.g, self.up, self.down);
        let constant = monotone.reason() == MonotoneReason::Feasible && push.hump(monotone.push_length).is_none();
        let e = if constant {
            let g = self.g.abs();
            (0.05 * push.net() / (g * self.x0.cos().abs() + (g * push.net()).sqrt())).min(0.05)
        } else {
            1e-3 * scale
        };
        e.max(1e-13 * self.x0.abs().max(1.0))
    }

    fn run(&self, bound: f64) -> Option<Swing> {
        let trial = self.trial(0.0);
        if trial.away.push.net() <= 0.0 || trial.towards.brake.net() <= 0.0 {
            return None;
        }
        let reach = self.up.max(self.down) + self.g.abs();
        let distance = self.x1 - self.x0;
        let mut best: Option<Swing> = None;
        let mut limit = bound;
        let mut consider = |e: f64, limit: &mut f64| {
            if let Some(swing) = self.swing(e).filter(|s| s.time < *limit * (1.0 - 1e-12)) {
                *limit = swing.time;
                best = Some(swing);
            }
        };
        let mut e = self.nearest();
        let mut previous: Option<(f64, Option<f64>)> = None;
        let mut any = false;
        let mut widest = (f64::NEG_INFINITY, e, e, e);
        while e <= FARTHEST && (8.0 / reach).sqrt() * (e.sqrt() + (e + distance).sqrt()) < limit {
            let slope = self.slope(e, COARSE);
            any |= slope.is_some();
            match (previous, slope) {
                (Some((p, Some(before))), Some(now)) if before < 0.0 && now >= 0.0 => {
                    consider(self.root((p, before), (e, now)), &mut limit)
                }
                (Some((p, None)), Some(now)) => self.edge_minima((e, now), p, &mut limit, &mut consider),
                (Some((p, Some(before))), None) => self.edge_minima((p, before), e, &mut limit, &mut consider),
                _ => {}
            }
            let next = if e < 0.4 { 1.6 * e } else { e + 0.2 };
            if !any {
                let margin = self.margin(e);
                if margin > widest.0 {
                    widest = (margin, previous.map_or(0.5 * e, |p| p.0), e, next);
                }
            }
            previous = Some((e, slope));
            e = next;
        }
        if let Some((p, Some(before))) = previous
            && before < 0.0
        {
            consider(p, &mut limit);
        }
        if !any && widest.0 > f64::NEG_INFINITY {
            // A window narrower than the grid: climb the margin.
            let inside = self.widest(widest.1, widest.3);
            if let Some(slope) = self.slope(inside, COARSE) {
                for outside in [widest.1, widest.3] {
                    self.edge_minima((inside, slope), outside, &mut limit, &mut consider);
                }
            }
        }
        best
    }

    /// The minima between a point inside the feasible set and its edge towards `outside`, where the slope may be infinite of
    /// either sign: T is infinite where the link stalls on a hump, finite where an outer phase shrinks to nothing.
    fn edge_minima(&self, inner: (f64, f64), outside: f64, limit: &mut f64, consider: &mut impl FnMut(f64, &mut f64)) {
        let (edge, beyond) = self.edge(inner.0, outside, 16);
        let mut previous: Option<(f64, f64)> = None;
        for part in [0.0, 3e-3, 0.03, 0.1, 0.22, 0.4, 0.6, 0.8, 1.0] {
            let e = edge + (inner.0 - edge) * part;
            let slope = if part == 1.0 { Some(inner.1) } else { self.slope(e, COARSE) };
            let Some(slope) = slope else { continue };
            match previous {
                None if (slope >= 0.0) == (edge < inner.0) => consider(self.edge(edge, beyond, 30).0, limit),
                None => {}
                Some((p, before)) => {
                    let (low, high) = if p < e { ((p, before), (e, slope)) } else { ((e, slope), (p, before)) };
                    if low.1 < 0.0 && high.1 >= 0.0 {
                        consider(self.root(low, high), limit);
                    }
                }
            }
            previous = Some((e, slope));
        }
    }

    /// Golden-section ascent of the margin.
    fn widest(&self, mut a: f64, mut b: f64) -> f64 {
        const GOLDEN: f64 = 0.618_033_988_749_894_8;
        let (mut c, mut d) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
        let (mut at_c, mut at_d) = (self.margin(c), self.margin(d));
        for _ in 0..60 {
            if at_c > 0.0 || at_d > 0.0 {
                break;
            }
            if at_c > at_d {
                (b, d, at_d) = (d, c, at_c);
                c = b - GOLDEN * (b - a);
                at_c = self.margin(c);
            } else {
                (a, c, at_c) = (c, d, at_d);
                d = a + GOLDEN * (b - a);
                at_d = self.margin(d);
            }
        }
        if at_c > at_d { c } else { d }
    }
}

/// The best (-, +, -) motion `x0 -> x1 > x0` faster than `bound` (a time over `sqrt(I/2)`).
pub(super) fn back_swing(x0: f64, x1: f64, g: f64, up: f64, down: f64, bound: f64) -> Option<Swing> {
    let (leaves, arrives, turns) = (Phase::new(-x0, down, g), Phase::new(-x1, down, g), Phase::new(x0, up, g));
    Search { x0, x1, g, up, down, leaves, arrives, turns }.run(bound)
}

/// The best (+, -, +) motion `x0 -> x1 > x0` faster than `bound`.
pub(super) fn overshoot(x0: f64, x1: f64, g: f64, up: f64, down: f64, bound: f64) -> Option<Swing> {
    back_swing(-x1, -x0, g, down, up, bound).map(|s| Swing {
        time: s.time,
        x_switches: [-s.x_switches[1], -s.x_switches[0]],
        t_switches: [s.time - s.t_switches[1], s.time - s.t_switches[0]],
        x_turn: -s.x_turn,
        t_turn: s.time - s.t_turn,
    })
}
