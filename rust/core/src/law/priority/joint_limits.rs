//! Joint limits as bounds of a law's command, computed at every evaluation (Flacco, De Luca, Khatib 2015, `flacco2015saturation`).
//!
//! Velocity commands `u`, with the distance `d = q_max - q` and the horizon `h`: `u <= min(v_max, d/h, sqrt(2 a_max d))`; beyond the limit,
//! where `d < 0`, `u <= d/h`.
//!
//! Acceleration commands: `a <= (w - v)/h` within `+-a_max`, with the velocity bound `w = min(v_max, d/(4 h), sqrt(a_max d))`. The loop
//! from `w` to `v` is four times as fast as the loop from `d` to `w`, so that it does not overshoot. It brakes at half of `a_max`, as a
//! reserve for corrections.
//!
//! Lower bounds have the same form. A loop with a sample time or steps of at most `h`, which starts at rest within the limits, remains
//! within them. This requires a plant that follows the command.

use crate::dynamics::Model;
use crate::error::{Error, Result, positive};
use crate::priority::{PriorityMethod, PriorityOptions, joint_velocity_bounds};
use crate::scalar::{Real, labelled_numbers};
use crate::trace::expression::constant;
use crate::trace::{E, V};

/// The default horizon `h`, s: the shortest time in which a joint may reach its limit.
pub const HORIZON: f64 = 0.1;

/// Limits that replace the limits of the arm. `None` uses the arm's limit; an arm has no acceleration limits. If only one of `v_min` and
/// `v_max` is given, the other one is its negative.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, priority::PriorityMethod};
/// use armlet_core::law::{MotionLimits, LimitOverrides};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
///
/// let given = LimitOverrides { v_max: Some(vec![2.0]), ..LimitOverrides::default() };
/// // Positions have no limit, and the lower limit of the velocity is -2 rad/s.
/// assert!(!MotionLimits::new(&model, &given)?.have_positions());
/// // Only the method `Sns` accepts limits.
/// assert!(given.require_sns(PriorityMethod::Sns).is_ok() && given.require_sns(PriorityMethod::Clamp).is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LimitOverrides {
    /// Least positions `(n,)`, rad or m.
    pub q_min: Option<Vec<f64>>,
    /// Largest positions `(n,)`, rad or m.
    pub q_max: Option<Vec<f64>>,
    /// Least velocities `(n,)`, rad/s or m/s.
    pub v_min: Option<Vec<f64>>,
    /// Largest velocities `(n,)`, rad/s or m/s.
    pub v_max: Option<Vec<f64>>,
    /// Largest accelerations `(n,)`, rad/s^2 or m/s^2.
    pub a_max: Option<Vec<f64>>,
    /// Horizon `h`, s: the shortest time in which a joint may reach its limit. `None` means [`HORIZON`].
    pub horizon: Option<f64>,
}

impl LimitOverrides {
    /// Refuse limits for a priority method without bounds. Errors: `Input`.
    pub fn require_sns(&self, method: PriorityMethod) -> Result<()> {
        let given = [
            ("q_min", self.q_min.is_some()),
            ("q_max", self.q_max.is_some()),
            ("v_min", self.v_min.is_some()),
            ("v_max", self.v_max.is_some()),
            ("a_max", self.a_max.is_some()),
            ("horizon", self.horizon.is_some()),
        ];
        match given.iter().find(|(_, given)| *given && method != PriorityMethod::Sns) {
            Some((name, _)) => {
                Err(Error::input(*name, format!("bounds nothing: expected method sns, which keeps bounds, got {}", method.name())))
            }
            None => Ok(()),
        }
    }
}

/// Limits of every joint; infinite where there is no limit.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model};
/// use armlet_core::law::{MotionLimits, LimitOverrides};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
///
/// let given = LimitOverrides { q_max: Some(vec![1.0]), v_max: Some(vec![2.0]), a_max: Some(vec![4.0]), ..LimitOverrides::default() };
/// assert!(MotionLimits::new(&model, &given)?.have_positions());
/// // The lower limit is above the upper one.
/// let wrong = LimitOverrides { q_min: Some(vec![2.0]), ..given };
/// assert!(MotionLimits::new(&model, &wrong).is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MotionLimits<S = f64> {
    q_min: Vec<S>,
    q_max: Vec<S>,
    v_min: Vec<S>,
    v_max: Vec<S>,
    a_max: Vec<S>,
    horizon: S,
}

impl MotionLimits {
    /// Create the limits: `given` where it has a limit, otherwise the arm's limit.
    ///
    /// Errors: `WrongShape` for wrong lengths. `Input` for NaN, limits out of order, an `a_max` or `horizon` that is not positive, no
    /// finite limit at all, or the planar PR arm.
    pub fn new(model: &Model, given: &LimitOverrides) -> Result<Self> {
        let joints: Vec<&crate::arm::Joint> = model.tree("arm")?.independent().collect();
        let n = joints.len();
        let own = |of: fn(&crate::arm::Limits) -> f64| joints.iter().map(|joint| of(&joint.limits)).collect::<Vec<f64>>();
        let mirrored = |x: &Vec<f64>| x.iter().map(|x| -x).collect::<Vec<f64>>();
        let limits = MotionLimits {
            q_min: given.q_min.clone().unwrap_or_else(|| own(|limits| limits.lower)),
            q_max: given.q_max.clone().unwrap_or_else(|| own(|limits| limits.upper)),
            // A missing velocity bound is minus the other bound.
            v_min: given.v_min.clone().or(given.v_max.as_ref().map(mirrored)).unwrap_or_else(|| own(|limits| -limits.velocity)),
            v_max: given.v_max.clone().or(given.v_min.as_ref().map(mirrored)).unwrap_or_else(|| own(|limits| limits.velocity)),
            a_max: given.a_max.clone().unwrap_or_else(|| vec![f64::INFINITY; n]),
            horizon: given.horizon.unwrap_or(HORIZON),
        };
        positive("horizon", limits.horizon)?;
        let MotionLimits { q_min, q_max, v_min, v_max, a_max, .. } = &limits;
        for (name, x) in [("q_min", q_min), ("q_max", q_max), ("v_min", v_min), ("v_max", v_max), ("a_max", a_max)] {
            if x.len() != n {
                return Err(Error::wrong(name, "length", n, x.len()));
            }
        }
        for i in 0..n {
            let refuse = |name: &str, expected: &str, low: f64, high: f64| {
                Err(Error::input(name, format!("is out of order: expected {expected}, got {low} and {high}")).at([i]))
            };
            // The comparisons are negated, because NaN must be refused too.
            if !(q_min[i] <= q_max[i]) {
                return refuse("q_min", "q_min <= q_max", q_min[i], q_max[i]);
            }
            if !(v_min[i] <= v_max[i] && v_min[i] < f64::INFINITY && v_max[i] > f64::NEG_INFINITY) {
                return refuse("v_min", "v_min <= v_max", v_min[i], v_max[i]);
            }
            if !(a_max[i] > 0.0) {
                return Err(Error::input("a_max", format!("is not positive: expected a_max > 0, got {}", a_max[i])).at([i]));
            }
        }
        let bounded = [q_min, q_max, v_min, v_max, a_max].iter().any(|x| x.iter().any(|x| x.is_finite()));
        if !bounded {
            let problem = format!("is missing: expected velocity bounds of shape ({n},) for method sns, or an arm with limits, got None");
            return Err(Error::input("v_max", problem));
        }
        Ok(limits)
    }

    /// Whether a joint has a position limit.
    pub fn have_positions(&self) -> bool {
        [&self.q_min, &self.q_max].iter().any(|limits| limits.iter().any(|limit| limit.is_finite()))
    }

    /// Set infinite bounds in the options of a solver. The bounds themselves change at every evaluation.
    pub fn open(&self, mut options: PriorityOptions) -> PriorityOptions {
        let n = self.q_min.len();
        (options.v_min, options.v_max) = (Some(vec![f64::NEG_INFINITY; n]), Some(vec![f64::INFINITY; n]));
        options
    }

    /// The limits with another number type.
    pub(crate) fn lift<S: Real>(&self) -> MotionLimits<S> {
        MotionLimits {
            q_min: labelled_numbers("q_min", &self.q_min),
            q_max: labelled_numbers("q_max", &self.q_max),
            v_min: labelled_numbers("v_min", &self.v_min),
            v_max: labelled_numbers("v_max", &self.v_max),
            a_max: labelled_numbers("a_max", &self.a_max),
            horizon: S::labelled("horizon", 0, || S::varying(self.horizon)),
        }
    }
}

impl MotionLimits<E> {
    /// The bounds of the joint velocities, `(n,)` each, at the joint positions `q`.
    pub fn velocities(&self, q: &V) -> [V; 2] {
        self.bounds(q, self.horizon, constant(2.0))
    }

    /// The bounds of the joint accelerations, `(n,)` each, at the joint positions `q` and velocities `v`.
    pub fn accelerations(&self, q: &V, v: &V) -> [V; 2] {
        let within = |w: V| V::from_fn(v.len(), |i, _| ((w[i] - v[i]) / self.horizon).clamped(-self.a_max[i], self.a_max[i]));
        self.bounds(q, self.horizon * constant(4.0), constant(1.0)).map(within)
    }

    /// The velocities that reach a limit in `time`, s, and that the acceleration `braking a_max` stops before it.
    fn bounds(&self, q: &V, time: E, braking: E) -> [V; 2] {
        let pairs: Vec<(E, E)> = (0..q.len())
            .map(|i| {
                let (position, velocity) = ((self.q_min[i], self.q_max[i]), (self.v_min[i], self.v_max[i]));
                joint_velocity_bounds(q[i], position, velocity, time, braking * self.a_max[i])
            })
            .collect();
        let (lower, upper): (Vec<E>, Vec<E>) = pairs.into_iter().unzip();
        [lower, upper].map(V::from_vec)
    }
}
