//! The active torque limit, its place, and the reason why a motion is impossible. A plan stores these as data, and `Display` makes the
//! text.

use std::fmt;

/// A torque limit of the link.
///
/// ```
/// use armlet_core::plan::{Limit, bang_bang_time};
///
/// // Braking downwards, at the hanging position, needs the upper limit.
/// let report = bang_bang_time(1.0, 0.0, 1.0, 2.0, -5.0, 5.0)?;
/// assert_eq!(report.active_upper().limit, Limit::TauMax);
/// assert_eq!(Limit::TauMax.to_string(), "tau_max");
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// The lower torque limit `tau_min`.
    TauMin,
    /// The upper torque limit `tau_max`.
    TauMax,
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Limit::TauMin => "tau_min",
            Limit::TauMax => "tau_max",
        })
    }
}

/// The place in a phase of the motion where a limit binds.
///
/// ```
/// use armlet_core::plan::{Place, bang_bang_time};
/// use std::f64::consts::{FRAC_PI_2, PI};
///
/// // Gravity is largest at the switch of the first motion, and inside the first phase of the second motion.
/// let place = |goal| bang_bang_time(0.0, goal, 1.0, 2.0, -5.0, 5.0).map(|report| report.active_upper().place);
/// assert_eq!((place(FRAC_PI_2)?, place(1.5 * PI)?), (Place::Switch, Place::Interior));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The first instant of the phase.
    Start,
    /// Strictly inside the phase, where the gravity torque has an extreme.
    Interior,
    /// The boundary between this phase and the next or the previous one.
    Switch,
    /// The last instant of the phase.
    End,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Place::Start => "start",
            Place::Interior => "interior",
            Place::Switch => "switch",
            Place::End => "end",
        })
    }
}

/// A torque limit that determines the shortest or the longest duration. `Display` writes the phase and the place, for example
/// `phase1:switch`.
///
/// ```
/// use armlet_core::plan::{Limit, bang_bang_time};
/// use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
///
/// let report = bang_bang_time(0.0, FRAC_PI_2, 1.0, 2.0, -5.0, 5.0)?;
/// let bind = report.active_upper();
/// assert_eq!((bind.limit, bind.theta, bind.time), (Limit::TauMax, FRAC_PI_4, 0.5 * report.t_min));
/// assert_eq!(bind.to_string(), "phase1:switch");
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bind {
    /// The torque limit.
    pub limit: Limit,
    /// Number of the phase: phase 1 accelerates and phase 2 brakes.
    pub phase: u8,
    /// The place in the phase where the limit binds.
    pub place: Place,
    /// Angle where the limit is reached, rad.
    pub theta: f64,
    /// Time since the start at which the limit is reached, s; NaN if the motion is impossible or has no duration.
    pub time: f64,
    /// Whether the other phase reaches its limit at the same duration, up to a rounding error.
    pub tie: bool,
}

impl fmt::Display for Bind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "phase{}:{}", self.phase, self.place)
    }
}

/// Whether a profile is possible, or the reason why not. `Display` makes the text.
///
/// ```
/// use armlet_core::plan::{Reason, bang_bang_time};
/// use std::f64::consts::FRAC_PI_2;
///
/// assert_eq!(bang_bang_time(0.0, 1.0, 1.0, 2.0, -5.0, 5.0)?.reason(), Reason::Feasible);
/// // A torque of 1 N m cannot move a link with a gravity moment of 2 N m beyond the level position.
/// let reason = bang_bang_time(0.8, 4.7, 1.0, 2.0, -1.0, 1.0)?.reason();
/// let Reason::Blocked { upper, missing } = reason else { panic!("{reason}") };
/// assert!((upper.theta - FRAC_PI_2).abs() < 1e-15 && (missing - 1.0).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reason {
    /// The profile is possible.
    Feasible,
    /// The motion has equal ends, and the torque cannot hold the link at this angle. `missing` is the torque by which the limit must be
    /// wider, N m.
    CannotHold {
        /// The torque limit.
        limit: Limit,
        /// Angle of the link, rad.
        theta: f64,
        /// Missing torque, N m.
        missing: f64,
    },
    /// Gravity leaves no torque to accelerate or to brake: no duration is feasible.
    Blocked {
        /// The torque limit that bounds the acceleration from above.
        upper: Bind,
        /// Missing torque, N m.
        missing: f64,
    },
    /// One limit requires a slower motion, the other limit a faster motion. `missing` is the torque by which both limits must be wider, N
    /// m.
    Conflict {
        /// The torque limit that bounds the acceleration from above.
        upper: Bind,
        /// The torque limit that bounds the acceleration from below.
        lower: Bind,
        /// Missing torque, N m.
        missing: f64,
    },
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::Feasible => f.write_str("feasible"),
            Reason::CannotHold { limit, theta, missing } => {
                write!(f, "{limit} cannot hold the link at theta = {theta:.6} rad: {missing:.6e} N m are missing")
            }
            Reason::Blocked { upper, missing } => {
                write!(
                    f,
                    "{} leaves no acceleration at theta = {:.6} rad ({upper}): {missing:.6e} N m are missing",
                    upper.limit, upper.theta
                )
            }
            Reason::Conflict { upper, lower, missing } => write!(
                f,
                "{} at theta = {:.6} rad ({upper}) needs a slower motion and {} at theta = {:.6} rad ({lower}) a faster one: {missing:.6e} N m \
                 are missing",
                upper.limit, upper.theta, lower.limit, lower.theta
            ),
        }
    }
}

/// Whether the monotone motion under full torque exists, or the reason why not. `missing` is in N m.
///
/// ```
/// use armlet_core::plan::{MonotoneReason, torque_optimal_time};
/// use std::f64::consts::PI;
///
/// // The link gains 4 J, and the torque of 1 N m does the work of pi J.
/// let reason = torque_optimal_time(0.0, PI, 1.0, 2.0, -1.0, 1.0)?.reason;
/// let MonotoneReason::Work { missing } = reason else { panic!("{reason}") };
/// assert!((missing - (4.0 / PI - 1.0)).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MonotoneReason {
    /// The motion is possible.
    Feasible,
    /// The motion has equal ends, and the torque limit cannot hold the link at this angle.
    CannotHold {
        /// The torque limit.
        limit: Limit,
        /// Angle of the link, rad.
        theta: f64,
        /// The missing torque, N m.
        missing: f64,
    },
    /// The pushing torque cannot move the link away from the start.
    StartBlocked {
        /// Missing torque, N m.
        missing: f64,
    },
    /// The braking torque cannot bring the link to rest at the end.
    EndBlocked {
        /// Missing torque, N m.
        missing: f64,
    },
    /// The difference of potential energy between the ends exceeds the work of the torque.
    Work {
        /// Missing torque, N m.
        missing: f64,
    },
    /// The link cannot pass `x`, because gravity exceeds the torque in an interval of the motion.
    Hump {
        /// Angle, rad. In a result it is `theta`. Within the planner it is `direction theta`. The `direction` is 1 if the motion increases
        /// `theta`, else -1.
        x: f64,
        /// Missing torque, N m.
        missing: f64,
    },
    /// With friction: push and brake have no point of equal speeds. The push ends at `push`, and the brake can begin at `brake`. In a
    /// result both angles are `theta`. Within the planner they are `direction theta`, as in `Hump`.
    Apart {
        /// Angle where the push ends, rad.
        push: f64,
        /// Angle where the brake can begin, rad.
        brake: f64,
        /// Missing torque, N m.
        missing: f64,
    },
}

impl MonotoneReason {
    /// Convert angles `direction theta` to `theta`: multiply them by the direction `sign`, which is 1 or -1.
    pub(super) fn along(self, sign: f64) -> Self {
        match self {
            MonotoneReason::Hump { x, missing } => MonotoneReason::Hump { x: sign * x, missing },
            MonotoneReason::Apart { push, brake, missing } => MonotoneReason::Apart { push: sign * push, brake: sign * brake, missing },
            other => other,
        }
    }
}

impl fmt::Display for MonotoneReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MonotoneReason::Feasible => f.write_str("feasible"),
            &MonotoneReason::CannotHold { limit, theta, missing } => Reason::CannotHold { limit, theta, missing }.fmt(f),
            MonotoneReason::StartBlocked { missing } => {
                write!(f, "the torque towards the goal cannot leave the start: more than {missing:.6e} N m are missing")
            }
            MonotoneReason::EndBlocked { missing } => {
                write!(f, "the torque against the motion cannot stop at the end: more than {missing:.6e} N m are missing")
            }
            MonotoneReason::Work { missing } => {
                write!(f, "the potential difference exceeds the work of the torque over the path: more than {missing:.6e} N m are missing")
            }
            MonotoneReason::Hump { x, missing } => {
                write!(f, "the motion stalls before theta = {x:.6} rad: more than {missing:.6e} N m are missing on average")
            }
            MonotoneReason::Apart { push, brake, missing } => write!(
                f,
                "the push ends at theta = {push:.6} rad and the brake can begin at theta = {brake:.6} rad. Their speeds differ: \
                 {missing:.6e} N m are missing in both torques"
            ),
        }
    }
}
