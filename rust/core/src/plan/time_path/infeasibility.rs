//! The search for the reason why a path has no timing.
//!
//! If a static torque exceeds its limit, its excess is the missing amount. Else, if no path speed is feasible, every limit of torque and
//! acceleration is widened by `w` times its size. The missing amount is the smallest `w` for which a feasible speed exists. Bisection finds
//! `w`.

use super::check::{LimitCheck, TOLERANCE};
use super::reach::{Profile, Stuck, widened};
use super::reason::{LimitKind, PathReason, Shortfall};
use super::setup::PathProblem;
use super::timing::TimePath;
use crate::error::Result;
use crate::motion::TimedPath;

impl PathProblem<'_> {
    /// The kind and the joint of a row. The kinds are 0 torque, 1 acceleration, 2 speed of a joint; 3 acceleration, 4 speed of the frame's
    /// origin.
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
        self.reason_of(what, self.kind(row), upper, s, missing)
    }

    /// The reason for a violated limit, from its kind and joint.
    pub(super) fn reason_of(&self, what: Shortfall, (kind, joint): (usize, usize), upper: bool, s: f64, missing: f64) -> PathReason {
        let limit = match kind {
            0 if upper => LimitKind::TorqueMax,
            0 => LimitKind::TorqueMin,
            1 => LimitKind::Acceleration,
            2 => LimitKind::Velocity,
            3 => LimitKind::TipAcceleration,
            _ => LimitKind::TipSpeed,
        };
        let (speed, position) = (f64::NAN, f64::NAN);
        if let (3.., Some(tip)) = (kind, &self.tip) {
            let varying = self.along.of_tip(&self.path, self.path.piece(s), s)[kind.min(4) - 3];
            let size = varying * if kind == 3 { tip.acceleration } else { tip.speed }.unwrap_or(0.0);
            let joint_name = self.mover.frame_name(tip.frame);
            return PathReason { what, joint: None, joint_name, s, limit, missing, missing_units: missing * size, speed, position };
        }
        let varying = self.along.limit(&self.path, kind, joint, self.path.piece(s), s);
        let (lo, hi) = (varying * self.lo[kind * self.n + joint].abs(), varying * self.hi[kind * self.n + joint].abs());
        let (near, far) = if upper { (hi, lo) } else { (lo, hi) };
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
            let over = (value - self.rows.hi[k]) / self.rows.scale_hi[k];
            let under = (self.rows.lo[k] - value) / self.rows.scale_lo[k];
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
            return self.refuse(PathReason::holding(self, row, upper, beyond));
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

impl PathReason {
    pub(super) fn find(problem: &PathProblem, profile: &Profile, stuck: Stuck) -> PathReason {
        let s = &problem.rows.s;
        match stuck {
            Stuck::Start(low, high) => {
                let wanted = problem.rows.x_start;
                let nearest = if wanted > high { high } else { low };
                // A speed limit that the start speed exceeds is the simplest reason.
                let (fastest, cap) = problem.widest[0];
                let (row, upper, allowed) = if wanted > cap {
                    (fastest, true, cap)
                } else {
                    let (row, upper, _) = problem.tightest(0, 0.0, wanted);
                    (row, upper, nearest)
                };
                let missing = (wanted / allowed.max(f64::MIN_POSITIVE)).sqrt() - 1.0;
                let reason = problem.reason(Shortfall::StartSpeed, row, upper, s[0], missing);
                PathReason { speed: nearest.sqrt(), ..reason }
            }
            Stuck::End(cap) => {
                let (row, _) = problem.fastest(problem.rows.s.len() - 1);
                let missing = (problem.rows.x_end / cap.max(f64::MIN_POSITIVE)).sqrt() - 1.0;
                let reason = problem.reason(Shortfall::EndSpeed, row, true, s[s.len() - 1], missing);
                PathReason { speed: cap.sqrt(), ..reason }
            }
            Stuck::Empty(i) => {
                let next = [profile.low[i + 1], profile.high[i + 1]];
                // Test static torques first: a limit that cannot hold the arm's weight is the simplest reason.
                for at in [i, i + 1] {
                    let (row, upper, beyond) = problem.tightest(at, 0.0, 0.0);
                    if beyond > 0.0 {
                        return problem.reason(Shortfall::NoSpeed, row, upper, s[at], beyond);
                    }
                }
                let (mut few, mut many) = (0.0, 1.0);
                while widened(&problem.rows, i, many, next).is_none() && many < 1e12 {
                    (few, many) = (many, many * 4.0);
                }
                for _ in 0..60 {
                    let middle = 0.5 * (few + many);
                    if widened(&problem.rows, i, middle, next).is_some() { many = middle } else { few = middle }
                }
                let x = widened(&problem.rows, i, many, next).map_or(0.0, |(_, high)| high);
                let u = (next[1].min(next[0].max(x)) - x) / (2.0 * (s[i + 1] - s[i]));
                let (row, upper, _) = problem.tightest(i, u, x);
                problem.reason(Shortfall::NoSpeed, row, upper, s[i], many)
            }
        }
    }

    pub(super) fn holding(problem: &PathProblem, row: usize, upper: bool, beyond: f64) -> PathReason {
        problem.reason(Shortfall::NoSpeed, row, upper, problem.rows.s[0], beyond)
    }

    pub(super) fn standstill(problem: &PathProblem, profile: &Profile) -> PathReason {
        let i = (0..problem.rows.s.len() - 1).find(|&i| profile.x[i] == 0.0 && profile.x[i + 1] == 0.0).unwrap_or(0);
        let (row, upper, _) = problem.tightest(i, 0.0, 0.0);
        problem.reason(Shortfall::Standstill, row, upper, problem.rows.s[i], 0.0)
    }

    pub(super) fn unresolved(problem: &PathProblem, found: &LimitCheck) -> PathReason {
        let (i, row) = found.at;
        problem.reason(Shortfall::Unresolved, row, true, problem.rows.s[i], found.excess)
    }
}
