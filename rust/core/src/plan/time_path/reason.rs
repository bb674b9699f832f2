//! The reason why a path has no timing: the joint, the path position, the limit, and the missing amount.
//!
//! If a static torque exceeds its limit, its excess is the missing amount. Else, if no path speed is feasible, every limit is widened by
//! `w` times its size. The missing amount is the smallest `w` for which a feasible speed exists. Bisection finds `w`.

use super::check::LimitCheck;
use super::reach::{Profile, Stuck, widened};
use super::setup::PathProblem;
use std::fmt;

/// The kind of a limit.
///
/// ```
/// use armlet_core::plan::{Bound, Mover, PathLimits, TimePathOptions, time_path};
/// # use armlet_core::dynamics::PlanarPr;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = Mover::PlanarPr(PlanarPr::new(3.0, 0.5, 0.2)?);
/// # let path = Arc::new(Path::waypoints(&[0.0, 0.0, 1.0, 1.0], 2, None, Ends::Natural)?.0);
/// // The path ends at 1 rad, and the second joint has the limit 0.75 rad.
/// let position = Some((vec![-2.0, -2.0], vec![2.0, 0.75]));
/// let limits = PathLimits { acceleration: Some(vec![4.0, 4.0]), position, ..PathLimits::default() };
/// let reason = time_path(arm, path, &limits, &TimePathOptions::default())?.reason.expect("beyond a limit");
/// assert_eq!((reason.limit, reason.joint, reason.position), (Bound::PositionMax, Some(1), 1.0));
/// assert_eq!(Bound::PositionMax.name(), "q_max");
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// Upper torque limit.
    TorqueMax,
    /// Lower torque limit.
    TorqueMin,
    /// Acceleration limit.
    Acceleration,
    /// Speed limit.
    Velocity,
    /// Limit of the torque rate.
    TorqueRate,
    /// Limit of the speed of the frame's origin.
    TipSpeed,
    /// Limit of the acceleration of the frame's origin.
    TipAcceleration,
    /// Upper position limit.
    PositionMax,
    /// Lower position limit.
    PositionMin,
}

impl Bound {
    /// The name used in Python.
    pub fn name(self) -> &'static str {
        match self {
            Bound::TorqueMax => "tau_max",
            Bound::TorqueMin => "tau_min",
            Bound::Acceleration => "a_max",
            Bound::Velocity => "v_max",
            Bound::TorqueRate => "torque_rate",
            Bound::TipSpeed => "tip_speed",
            Bound::TipAcceleration => "tip_acceleration",
            Bound::PositionMax => "q_max",
            Bound::PositionMin => "q_min",
        }
    }
}

/// The condition that a path or its timing violates.
///
/// ```
/// use armlet_core::plan::{Mover, PathLimits, Shortfall, TimePathOptions, time_path};
/// # use armlet_core::dynamics::PlanarPr;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = Mover::PlanarPr(PlanarPr::new(3.0, 0.5, 0.2)?);
/// # let path = Arc::new(Path::waypoints(&[0.0, 0.0, 1.0, 1.0], 2, None, Ends::Natural)?.0);
/// # let limits = PathLimits { acceleration: Some(vec![4.0, 4.0]), ..PathLimits::default() };
/// // From a very high speed, the arm cannot come to rest within the path.
/// let options = TimePathOptions { start_speed: 100.0, ..TimePathOptions::default() };
/// let reason = time_path(arm, path, &limits, &options)?.reason.expect("too fast");
/// assert_eq!(reason.what, Shortfall::StartSpeed);
/// assert!(reason.speed < 100.0);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shortfall {
    /// The limits allow no path speed here, or none from which the motion can continue.
    NoSpeed,
    /// The start speed is infeasible.
    StartSpeed,
    /// The end speed is infeasible.
    EndSpeed,
    /// The path speed is zero on a whole segment.
    Standstill,
    /// A limit is exceeded between grid points on every grid.
    Unresolved,
    /// No timing satisfies the limits of the torque rate.
    Slow,
    /// The path itself leaves the position limits.
    Position,
}

/// The reason why a path has no timing.
///
/// ```
/// use armlet_core::plan::{Bound, Mover, PathLimits, Shortfall, TimePathOptions, time_path};
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Functions;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = Functions::new(Arc::new(Arm::planar(&[1.0], None, None, None, [0.0, -9.81])?));
/// # let path = Arc::new(Path::waypoints(&[-1.5, 0.0], 1, None, Ends::Natural)?.0);
/// // A rod of 1 kg and 1 m, lifted slowly from -1.5 rad to the level. There it needs 4.905 N m, and has 3 N m.
/// let limits = PathLimits { torque: Some((vec![-3.0], vec![3.0])), velocity: Some(vec![0.01]), ..PathLimits::default() };
/// let reason = time_path(Mover::Tree(&arm), path, &limits, &TimePathOptions::default())?.reason.expect("too weak");
/// assert_eq!((reason.what, reason.limit, reason.joint_name.as_str()), (Shortfall::NoSpeed, Bound::TorqueMax, "joint1"));
/// assert!(reason.s > 0.99 && (reason.missing_units - 1.905).abs() < 0.01);
/// assert!(reason.to_string().starts_with("the limits leave no path speed: tau_max of joint 0 (joint1)"));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PathReason {
    /// The violated condition.
    pub what: Shortfall,
    /// Index of the joint; `None` for a limit of a frame's origin.
    pub joint: Option<usize>,
    /// Name of the joint, or of the frame.
    pub joint_name: String,
    /// Path position `s`, in the unit of the path's parameter.
    pub s: f64,
    /// The violated limit.
    pub limit: Bound,
    /// The missing amount, as a fraction of the limit; for a position, as a fraction of `q_max - q_min` if finite.
    pub missing: f64,
    /// The missing amount in the unit of the limit.
    pub missing_units: f64,
    /// The feasible path speed `ds/dt` nearest to an infeasible start or end speed, in the unit of `s` per second; else NaN.
    pub speed: f64,
    /// The joint position that exceeds its limit, rad or m; else NaN.
    pub position: f64,
}

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
            0 if upper => Bound::TorqueMax,
            0 => Bound::TorqueMin,
            1 => Bound::Acceleration,
            2 => Bound::Velocity,
            3 => Bound::TipAcceleration,
            _ => Bound::TipSpeed,
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

    /// The row with the largest relative excess at grid point `i` with `(u, x)`. Returns its index, whether its upper limit is the nearer
    /// one, and the excess.
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
}

impl PathReason {
    pub(super) fn find(problem: &PathProblem, profile: &Profile, stuck: Stuck) -> PathReason {
        let s = &problem.rows.s;
        match stuck {
            Stuck::Start(low, high) => {
                let wanted = problem.rows.x_start;
                let nearest = if wanted > high { high } else { low };
                let (row, upper, _) = problem.tightest(0, 0.0, wanted);
                let missing = (wanted / nearest.max(f64::MIN_POSITIVE)).sqrt() - 1.0;
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

impl fmt::Display for PathReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PathReason { joint, joint_name, s, limit, missing, missing_units, speed, position, .. } = self;
        let limited = match joint {
            Some(joint) => format!("{} of joint {joint} ({joint_name})", limit.name()),
            None => format!("{} of frame {joint_name}", limit.name()),
        };
        let short = format!("{limited} is {missing_units:.6e} short ({:.3e} of it) at s = {s:.9}", missing);
        match self.what {
            Shortfall::NoSpeed => write!(f, "the limits leave no path speed: {short}"),
            Shortfall::StartSpeed => write!(f, "start_speed is not possible: expected at most {speed:.9e} (the nearest that is): {short}"),
            Shortfall::EndSpeed => write!(f, "end_speed is not possible: expected at most {speed:.9e}: {short}"),
            Shortfall::Standstill => {
                write!(f, "the limits allow no motion from s = {s:.9}: {limited} holds the arm there")
            }
            Shortfall::Position => {
                write!(f, "the path leaves the position limits: q = {position:.9} is {missing_units:.6e} beyond {limited} at s = {s:.9}")
            }
            Shortfall::Slow => write!(f, "no timing keeps the torque rate, however slow: {short}"),
            Shortfall::Unresolved => write!(f, "no grid resolves the limits: {short}"),
        }
    }
}
