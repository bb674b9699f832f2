//! The search for the reason why a path has no timing.
//!
//! If a static torque exceeds its limit, its excess is the missing amount. Else, if no path speed is feasible, every limit of torque and
//! acceleration is widened by `w` times its size. The missing amount is the smallest `w` for which a feasible speed exists. Bisection finds
//! `w`.

use super::limits::Limits;
use super::passes::{Infeasible, widened};
use super::problem::PathProblem;
use super::reason::{LimitKind, PathReason, Shortfall};
use super::search::{GridState, Search};
use super::timing::TimePath;
use super::tuning::TOLERANCE;
use crate::error::Result;
use crate::motion::TimedPath;

/// The kinds of limits of rows; the lower limits of torques have the same kind as the upper ones.
const KINDS: [LimitKind; 5] =
    [LimitKind::TorqueMax, LimitKind::Acceleration, LimitKind::Velocity, LimitKind::TipAcceleration, LimitKind::TipSpeed];

impl PathProblem<'_> {
    /// The index in `KINDS` and the joint of a row.
    fn kind(&self, row: usize) -> (usize, usize) {
        let n = self.n;
        if let Some(first) = self.norms.filter(|first| row >= *first) {
            return (3 + (row - first).min(1), 0);
        }
        if row >= n * self.kinds.iter().filter(|kind| **kind).count() && row < self.rows.width && self.tip.is_some() {
            return (3, 0);
        }
        if row >= self.rows.width {
            return (2, (row - self.rows.width).min(n - 1));
        }
        let first = if self.kinds[0] { 0 } else { 1 };
        (first + row.min(2 * n - 1) / n, row % n)
    }

    fn reason(&self, what: Shortfall, row: usize, upper: bool, s: f64, missing: f64) -> PathReason {
        let (kind, joint) = self.kind(row);
        let limit = if kind == 0 && !upper { LimitKind::TorqueMin } else { KINDS[kind] };
        self.reason_of(what, (limit, joint), s, missing)
    }

    /// The reason for a violated limit of a joint, or of the frame.
    pub(super) fn reason_of(&self, what: Shortfall, (limit, joint): (LimitKind, usize), s: f64, missing: f64) -> PathReason {
        let kind = KINDS.iter().position(|kind| *kind == limit).unwrap_or(0);
        let (speed, position) = (f64::NAN, f64::NAN);
        if let (3.., Some(tip)) = (kind, &self.tip) {
            let varying = self.along.of_tip(&self.path, self.path.piece(s), s)[kind.min(4) - 3];
            let size = varying * if kind == 3 { tip.acceleration } else { tip.speed }.unwrap_or(0.0);
            let joint_name = self.mover.frame_name(tip.frame);
            return PathReason { what, joint: None, joint_name, s, limit, missing, missing_units: missing * size, speed, position };
        }
        let varying = self.along.limit(&self.path, kind, joint, self.path.piece(s), s);
        let (lo, hi) = (varying * self.lo[kind * self.n + joint].abs(), varying * self.hi[kind * self.n + joint].abs());
        let (near, far) = if limit == LimitKind::TorqueMin { (lo, hi) } else { (hi, lo) };
        let size = if near > 0.0 { near } else { far };
        let joint_name = self.mover.joint_names().get(joint).cloned().unwrap_or_default();
        PathReason { what, joint: Some(joint), joint_name, s, limit, missing, missing_units: missing * size, speed, position }
    }

    /// The row of a torque or an acceleration with the largest relative excess at grid point `i` with `(u, x)`. Returns its index, whether
    /// its upper limit is the nearer one, and the excess.
    pub(super) fn tightest(&self, i: usize, u: f64, x: f64) -> (usize, bool, f64) {
        let w = self.rows.width;
        let c = &self.rows.coefficients[i * 3 * w..];
        let mut worst = (0, true, f64::NEG_INFINITY);
        for k in 0..self.n * (usize::from(self.kinds[0]) + usize::from(self.kinds[1])) {
            let moving = if x > 0.0 { self.rows.moving[0].get(i * w + k).copied().unwrap_or(0.0) } else { 0.0 };
            let value = c[k] * u + c[w + k] * x + c[2 * w + k] + moving;
            let Limits { lo, hi, scale_lo, scale_hi, .. } = &self.rows.limits;
            let (over, under) = ((value - hi[k]) / scale_hi[k], (lo[k] - value) / scale_lo[k]);
            if over.max(under) > worst.2 {
                worst = (k, over >= under, over.max(under));
            }
        }
        if let Some((k, radius)) = self.rows.ball {
            let over = (0..3).map(|axis| (c[k + axis] * u + c[w + k + axis] * x).powi(2)).sum::<f64>().sqrt() / radius - 1.0;
            if over > worst.2 {
                worst = (k, true, over);
            }
        }
        worst
    }

    /// The result for a path that is one point. The duration is zero if the torque limits allow the arm to be held at this point.
    pub fn hold(&self) -> Result<TimePath> {
        let (row, upper, beyond) = self.tightest(0, 0.0, 0.0);
        if beyond > TOLERANCE {
            return self.refuse(self.reason(Shortfall::NoSpeed, row, upper, self.rows.s[0], beyond));
        }
        Ok(TimePath { motion: TimedPath::still(self.path.clone()), margin: -beyond, reason: None })
    }

    /// The result without a timing, with the reason.
    pub fn refuse(&self, reason: PathReason) -> Result<TimePath> {
        let knots = self.path.knots();
        let ends = vec![knots[0], knots[knots.len() - 1]];
        let motion = TimedPath::new(self.path.clone(), ends, vec![f64::NAN; 2], vec![0.0])?;
        Ok(TimePath { motion, margin: f64::NAN, reason: Some(reason) })
    }
}

impl Search<'_> {
    /// Why this grid has no timing.
    pub fn reason(&self, state: &GridState) -> PathReason {
        let Search { problem, profile, .. } = self;
        let (s, x) = (&problem.rows.s, &profile.x);
        match *state {
            GridState::Feasible(_) => {
                let i = (0..s.len() - 1).find(|&i| x[i] == 0.0 && x[i + 1] == 0.0).unwrap_or(0);
                let (row, upper, _) = problem.tightest(i, 0.0, 0.0);
                problem.reason(Shortfall::Standstill, row, upper, s[i], 0.0)
            }
            GridState::Inaccurate(check) | GridState::Exceeding(check) => {
                let (i, row) = check.at;
                problem.reason(Shortfall::Unresolved, row, true, s[i], check.excess)
            }
            GridState::Infeasible(Infeasible::StartSpeed(low, high)) => problem.start_speed_reason(low, high),
            GridState::Infeasible(Infeasible::EndSpeed(cap)) => {
                let (row, _) = problem.strictest_speed_limit(s.len() - 1);
                let missing = (problem.rows.x_end / cap.max(f64::MIN_POSITIVE)).sqrt() - 1.0;
                let reason = problem.reason(Shortfall::EndSpeed, row, true, s[s.len() - 1], missing);
                PathReason { speed: cap.sqrt(), ..reason }
            }
            GridState::Infeasible(Infeasible::EmptySet(i)) => problem.empty_set_reason(i, [profile.low[i + 1], profile.high[i + 1]]),
        }
    }
}

impl PathProblem<'_> {
    /// The limit that excludes the start speed, if `x` at the start is controllable from `low` to `high`.
    fn start_speed_reason(&self, low: f64, high: f64) -> PathReason {
        let wanted = self.rows.x_start;
        let nearest = if wanted > high { high } else { low };
        // A speed limit that the start speed exceeds is the simplest reason.
        let (fastest, cap) = self.speed_caps[0];
        let (row, upper, allowed) = if wanted > cap {
            (fastest, true, cap)
        } else {
            let (row, upper, _) = self.tightest(0, 0.0, wanted);
            (row, upper, nearest)
        };
        let missing = (wanted / allowed.max(f64::MIN_POSITIVE)).sqrt() - 1.0;
        let reason = self.reason(Shortfall::StartSpeed, row, upper, self.rows.s[0], missing);
        PathReason { speed: nearest.sqrt(), ..reason }
    }

    /// The limit that leaves no controllable `x` at the start of segment `i`. `next` is the controllable set at its end.
    fn empty_set_reason(&self, i: usize, next: [f64; 2]) -> PathReason {
        let s = &self.rows.s;
        // Test static torques first: a limit that cannot hold the arm's weight is the simplest reason.
        for at in [i, i + 1] {
            let (row, upper, beyond) = self.tightest(at, 0.0, 0.0);
            if beyond > 0.0 {
                return self.reason(Shortfall::NoSpeed, row, upper, s[at], beyond);
            }
        }
        let controllable = |widen: f64| widened(&self.rows, i, widen, next);
        let (mut few, mut many) = (0.0, 1.0);
        while controllable(many).is_none() && many < 1e12 {
            (few, many) = (many, many * 4.0);
        }
        for _ in 0..60 {
            let middle = 0.5 * (few + many);
            if controllable(middle).is_some() { many = middle } else { few = middle }
        }
        let x = controllable(many).map_or(0.0, |(_, high)| high);
        let u = (next[1].min(next[0].max(x)) - x) / (2.0 * (s[i + 1] - s[i]));
        let (row, upper, _) = self.tightest(i, u, x);
        self.reason(Shortfall::NoSpeed, row, upper, s[i], many)
    }
}
