//! Joint limits as bounds of a law's command, computed at every evaluation (Flacco, De Luca, Khatib 2015, `flacco2015saturation`).
//!
//! Velocity commands `u`, with the distance `d = q_max - q`, the braking acceleration `a` and the time `h`:
//!
//! `u <= min(v_max, a h (sqrt(1 + 2 d/(a h^2)) - 1))`; beyond the limit, where `d < 0`, `u <= d/h`.
//!
//! The second term is the velocity that is held for `h`, and from which `a` then stops the joint at its limit. It is `d/h` without `a`. `h` is
//! the sample period of a loop that has one, otherwise the horizon.
//!
//! Acceleration commands: `a <= (w - v)/h` within `+-a_max`, with a bound `w` of the velocity after `h`. In a sampled loop, `w` is the
//! largest velocity up to `v_max` from which the joint can still stop (`braking`). In a continuous loop, or with a horizon, it is
//! `w = min(v_max, d/(4 h), sqrt(a_max d))`. The loop from `w` to `v` is then four times as fast as the loop from `d` to `w`, so that it
//! does not overshoot. It brakes at half of `a_max`, as a reserve for corrections.
//!
//! Lower bounds have the same form. A loop with a sample time or steps of at most `h`, which starts at rest within the limits, remains
//! within them. This requires a plant that follows the command.

use super::braking::last_velocity;
use crate::arm::Limits;
use crate::dynamics::Model;
use crate::error::{Error, Result, positive};
use crate::priority::{PriorityMethod, PriorityOptions, joint_velocity_bounds};
use crate::scalar::{Real, labelled_numbers};
use crate::trace::expression::constant;
use crate::trace::{E, V};

/// The default horizon `h`, s: the shortest time in which a joint may reach its limit.
pub const HORIZON: f64 = 0.1;

/// The limits of a law. A limit that is `None` is the arm's limit, if the arm's own limits hold; an arm has no acceleration limits. If only one
/// of `v_min` and `v_max` is given, the other one is its negative.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, priority::PriorityMethod};
/// use armlet_core::law::{MotionLimits, LimitOverrides};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
///
/// let given = LimitOverrides { v_max: Some(vec![2.0]), ..LimitOverrides::default() };
/// // Positions have no limit, and the lower limit of the velocity is -2 rad/s.
/// assert!(!MotionLimits::new(&model, &given)?.have_positions());
/// assert!(given.resolve(&model, PriorityMethod::Clamp)?.is_some());
/// // Without a limit, only the method `Sns` has the arm's own limits, and this arm has none.
/// assert!(LimitOverrides::default().resolve(&model, PriorityMethod::Clamp)?.is_none());
/// assert!(LimitOverrides::default().resolve(&model, PriorityMethod::Sns).is_err());
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
    /// Horizon `h`, s: the shortest time in which a joint may reach its limit. `None` means the sample period of a sampled loop for methods
    /// other than `Sns`, otherwise [`HORIZON`].
    pub horizon: Option<f64>,
    /// Whether the arm's own limits hold where no other limit is given. With `true`, velocity limits that are not positive and empty ranges
    /// of positions are ignored. `None` means the limits of the arm that do not freeze a joint for `Sns`, and none for other methods.
    pub own: Option<bool>,
}

impl LimitOverrides {
    /// The names of the limits that are not `None`.
    fn names(&self) -> impl Iterator<Item = &'static str> {
        let limits =
            [("q_min", &self.q_min), ("q_max", &self.q_max), ("v_min", &self.v_min), ("v_max", &self.v_max), ("a_max", &self.a_max)];
        limits.into_iter().filter(|(_, limit)| limit.is_some()).map(|(name, _)| name)
    }

    /// Return the limits of a law with this priority method, or `None` without limits. Errors: `Input` for limits with `Chiaverini`, and for
    /// a horizon without limits; also as for [`MotionLimits::new`].
    pub fn resolve(&self, model: &Model, method: PriorityMethod) -> Result<Option<MotionLimits>> {
        let first = self.names().next().or((self.own == Some(true)).then_some("limits"));
        let horizon = self.horizon.map(|_| "horizon");
        if !method.accepts_bounds() {
            return first.or(horizon).map_or(Ok(()), |name| method.require_bounds(name)).map(|()| None);
        }
        if method != PriorityMethod::Sns && first.is_none() {
            return horizon.map_or(Ok(None), |name| {
                Err(Error::input(name, format!("takes effect only with limits: expected limits with {}, got none", method.name())))
            });
        }
        let own = self.own.or((method != PriorityMethod::Sns).then_some(false));
        let mut limits = MotionLimits::new(model, &LimitOverrides { own, ..self.clone() }).map_err(|error| model.name_limit(error))?;
        limits.sampled = self.horizon.is_none() && method != PriorityMethod::Sns;
        Ok(Some(limits))
    }

    /// Return the arm's own limits of torque or force, `(n,)`, if they hold and one is finite and positive. Other limits are infinite. Errors:
    /// `Input` for the planar PR arm.
    pub fn efforts(&self, model: &Model, method: PriorityMethod) -> Result<Option<Vec<f64>>> {
        if self.own != Some(true) || !method.accepts_bounds() {
            return Ok(None);
        }
        let effort = |limits: Limits| if limits.effort > 0.0 { limits.effort } else { f64::INFINITY };
        let efforts: Vec<f64> = model.tree("arm")?.independent().map(|joint| effort(joint.limits)).collect();
        Ok(efforts.iter().any(|effort| effort.is_finite()).then_some(efforts))
    }

    /// Sentences on the arm's own limits that would not let a joint move, which a law ignores. With `own = Some(true)`, also sentences on
    /// limits that are missing. `of_torques`: whether these limits include those of torque or force.
    pub fn ignored(&self, model: &Model, method: PriorityMethod, of_torques: bool) -> Result<Vec<String>> {
        let (all, some) = (self.own == Some(true), self.own.is_none() && method == PriorityMethod::Sns);
        let mut found = Vec::new();
        for joint in model.tree("arm")?.independent().filter(|joint| all || (some && movable(joint.limits) != joint.limits)) {
            let (name, limits) = (&joint.name, joint.limits);
            if self.v_min.is_none() && self.v_max.is_none() {
                if limits.velocity == f64::INFINITY && all {
                    found.push(format!("joint {name} has no velocity limit"));
                } else if limits.velocity != f64::INFINITY && sensible(limits).velocity != limits.velocity {
                    found.push(format!("joint {name} has the velocity limit {}", limits.velocity));
                }
            }
            if self.q_min.is_none()
                && self.q_max.is_none()
                && sensible(limits) != (Limits { velocity: sensible(limits).velocity, ..limits })
            {
                found.push(format!("joint {name} has the position limits {} and {}", limits.lower, limits.upper));
            }
            if all && of_torques && limits.effort == f64::INFINITY {
                found.push(format!("joint {name} has no effort limit"));
            } else if all && of_torques && !(limits.effort > 0.0) {
                found.push(format!("joint {name} has the effort limit {}", limits.effort));
            }
        }
        Ok(found)
    }
}

/// The limits of a joint without those that freeze it: a velocity limit of zero, or a range of positions from zero to zero.
fn movable(limits: Limits) -> Limits {
    let freezes = limits.velocity == 0.0 || (limits.lower == 0.0 && limits.upper == 0.0);
    if freezes && !(limits.velocity < 0.0) { sensible(limits) } else { limits }
}

/// The limits of a joint without a velocity limit that is not positive, and without an empty range of positions.
fn sensible(mut limits: Limits) -> Limits {
    if !(limits.velocity > 0.0) {
        limits.velocity = f64::INFINITY;
    }
    if !(limits.lower < limits.upper) {
        (limits.lower, limits.upper) = (f64::NEG_INFINITY, f64::INFINITY);
    }
    limits
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
    /// Whether the sample period of a loop takes the place of the horizon. For a loop: whether it did.
    pub(super) sampled: bool,
}

impl MotionLimits {
    /// Create the limits: `given` where it has a limit, otherwise the arm's limit if it holds.
    ///
    /// Errors: `WrongShape` for wrong lengths. `Input` for NaN, limits out of order, an `a_max` or `horizon` that is not positive, no
    /// finite limit at all, or the planar PR arm.
    pub fn new(model: &Model, given: &LimitOverrides) -> Result<Self> {
        let own: Vec<Limits> = model
            .tree("arm")?
            .independent()
            .map(|joint| match given.own {
                None => movable(joint.limits),
                Some(true) => sensible(joint.limits),
                Some(false) => Limits::default(),
            })
            .collect();
        let n = own.len();
        let own = |of: fn(&Limits) -> f64| own.iter().map(of).collect::<Vec<f64>>();
        let mirrored = |x: &Vec<f64>| x.iter().map(|x| -x).collect::<Vec<f64>>();
        let limits = MotionLimits {
            q_min: given.q_min.clone().unwrap_or_else(|| own(|limits| limits.lower)),
            q_max: given.q_max.clone().unwrap_or_else(|| own(|limits| limits.upper)),
            // A missing velocity bound is minus the other bound.
            v_min: given.v_min.clone().or(given.v_max.as_ref().map(mirrored)).unwrap_or_else(|| own(|limits| -limits.velocity)),
            v_max: given.v_max.clone().or(given.v_min.as_ref().map(mirrored)).unwrap_or_else(|| own(|limits| limits.velocity)),
            a_max: given.a_max.clone().unwrap_or_else(|| vec![f64::INFINITY; n]),
            horizon: given.horizon.unwrap_or(HORIZON),
            sampled: false,
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
        if !bounded && given.own == Some(true) {
            return Err(Error::input("limits", "has no use: expected an arm with limits, or v_max, q_min, q_max or a_max, got none"));
        }
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

    /// The limits with another number type, for a loop with this sample period.
    pub(crate) fn lift<S: Real>(&self, period: Option<f64>) -> MotionLimits<S> {
        let period = period.filter(|_| self.sampled);
        let horizon = period.unwrap_or(self.horizon);
        MotionLimits {
            q_min: labelled_numbers("q_min", &self.q_min),
            q_max: labelled_numbers("q_max", &self.q_max),
            v_min: labelled_numbers("v_min", &self.v_min),
            v_max: labelled_numbers("v_max", &self.v_max),
            a_max: labelled_numbers("a_max", &self.a_max),
            horizon: S::labelled("horizon", 0, || S::varying(horizon)),
            sampled: period.is_some(),
        }
    }
}

impl MotionLimits<E> {
    /// The bounds of the joint velocities, `(n,)` each, at the joint positions `q`.
    pub fn velocities(&self, q: &V) -> [V; 2] {
        let (h, one, two) = (self.horizon, constant(1.0), constant(2.0));
        // `a h (sqrt(1 + 2 d/(a h^2)) - 1)`, in a form that is exact for `d = 0` and for an infinite `a`.
        self.bounds(q, |i, d, _| {
            let held = two * d / (h * (one + (one + two * d / (self.a_max[i] * h * h)).sqrt()));
            E::select(constant(0.0).lt(d), E::select(d.lt(constant(f64::INFINITY)), held, d), d / h)
        })
    }

    /// The bounds of the joint accelerations, `(n,)` each, at the joint positions `q` and velocities `v`.
    pub fn accelerations(&self, q: &V, v: &V) -> [V; 2] {
        let within = |w: V| V::from_fn(v.len(), |i, _| ((w[i] - v[i]) / self.horizon).clamped(-self.a_max[i], self.a_max[i]));
        let allowed_speed = |i: usize, d: E, side: E| {
            if self.sampled {
                return last_velocity(d, side * v[i], self.a_max[i], self.horizon);
            }
            let speed = E::select(constant(0.0).lt(d), (self.a_max[i] * d).sqrt(), constant(f64::INFINITY));
            (d / (self.horizon * constant(4.0))).min(speed)
        };
        self.bounds(q, allowed_speed).map(within)
    }

    /// The velocity bounds from the velocities that `allowed_speed` allows for a joint at a distance from its limit. Its last argument is 1
    /// for the upper limit and -1 for the lower one.
    fn bounds(&self, q: &V, allowed_speed: impl Fn(usize, E, E) -> E) -> [V; 2] {
        let pairs: Vec<(E, E)> = (0..q.len())
            .map(|i| {
                let (position, velocity) = ((self.q_min[i], self.q_max[i]), (self.v_min[i], self.v_max[i]));
                joint_velocity_bounds(q[i], position, velocity, |d, side| allowed_speed(i, d, side))
            })
            .collect();
        let (lower, upper): (Vec<E>, Vec<E>) = pairs.into_iter().unzip();
        [lower, upper].map(V::from_vec)
    }
}
