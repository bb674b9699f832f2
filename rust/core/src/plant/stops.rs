//! Joint stops: at the depth `d` beyond a limit, a spring and a damper push the joint back with `tau_i = max(0, k d + c d_dot)`.

use super::friction_curve::require_rows;
use super::unilateral::{Mode, pressing, push, require_spring, stored};
use crate::error::{Error, Result};
use crate::scalar::Real;
use crate::trace::expression::zeros;
use crate::trace::{E, V};

/// Compliant stops at the joint limits.
///
/// ```
/// use armlet_core::plant::{Stop, Stops};
///
/// let stops = Stops::new(vec![-1.0, f64::NEG_INFINITY], vec![2.0, 2.0], vec![1e3, 1e3], vec![0.0, 0.0])?;
/// assert_eq!(stops.all().count(), 3);
/// assert_eq!(stops.limit(Stop { joint: 0, upper: false }), -1.0);
/// // The first joint is 0.1 rad beyond its upper limit: `k d^2 / 2`.
/// assert!((stops.energy(&[2.1, -5.0]) - 5.0).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Stops {
    /// Lower limits, `(n,)`, rad or m; infinite for no stop.
    pub lower: Vec<f64>,
    /// Upper limits, `(n,)`, rad or m; infinite for no stop.
    pub upper: Vec<f64>,
    /// Stiffness `k`, `(n,)`, N m/rad or N/m.
    pub stiffness: Vec<f64>,
    /// Damping `c`, `(n,)`, N m s/rad or N s/m.
    pub damping: Vec<f64>,
}

/// One joint stop: the index of its joint, and the end of the joint's range.
///
/// ```
/// use armlet_core::plant::Stop;
///
/// let (lower, upper) = (Stop { joint: 0, upper: false }, Stop { joint: 0, upper: true });
/// // The joint is at 1.25 rad, and moves with 2 rad/s. Its limits are -1 and 1 rad.
/// assert_eq!(upper.depth(1.0, 1.25, 2.0), (0.25, 2.0));
/// assert_eq!(lower.depth(-1.0, 1.25, 2.0), (-2.25, -2.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stop {
    /// Index of the joint.
    pub joint: usize,
    /// Whether the stop is at the upper limit.
    pub upper: bool,
}

impl Stop {
    /// Return the depth beyond the limit, rad or m, and the rate of the depth, rad/s or m/s.
    pub fn depth<S: Real>(self, limit: S, q: S, v: S) -> (S, S) {
        if self.upper { (q - limit, v) } else { (limit - q, -v) }
    }
}

impl Stops {
    /// Create stops. Each argument is `(n,)`, in the units of its field.
    ///
    /// Errors: `WrongShape` for unequal lengths; `Input` for a stiffness that is not positive, a negative damping, `lower >= upper`, or no finite limit.
    pub fn new(lower: Vec<f64>, upper: Vec<f64>, stiffness: Vec<f64>, damping: Vec<f64>) -> Result<Self> {
        let n = lower.len();
        for (name, values) in [("upper", &upper), ("stiffness", &stiffness), ("damping", &damping)] {
            require_rows(name, values, n)?;
        }
        for i in 0..n {
            require_spring(stiffness[i], damping[i]).map_err(|error| error.at([i]))?;
            if !(lower[i] < upper[i]) {
                return Err(Error::input("lower", format!("is not below upper: expected < {}, got {}", upper[i], lower[i])).at([i]));
            }
        }
        let stops = Stops { lower, upper, stiffness, damping };
        if stops.all().next().is_none() {
            return Err(Error::input("stops", "has no limit to stop at: expected an arm with limits, or lower and upper, got none"));
        }
        Ok(stops)
    }

    /// The stops at all finite limits.
    pub fn all(&self) -> impl Iterator<Item = Stop> {
        let both = |joint| [false, true].map(|upper| Stop { joint, upper });
        (0..self.lower.len()).flat_map(both).filter(|&stop| self.limit(stop).is_finite())
    }

    /// Position of a stop, rad or m.
    pub fn limit(&self, stop: Stop) -> f64 {
        if stop.upper { self.upper[stop.joint] } else { self.lower[stop.joint] }
    }

    /// Energy stored in the springs, J.
    pub fn energy(&self, q: &[f64]) -> f64 {
        let of = |stop: Stop| stored(self.stiffness[stop.joint], stop.depth(self.limit(stop), q[stop.joint], 0.0).0);
        self.all().map(of).sum()
    }
}

/// The stops of a plant in a control loop.
pub(super) struct LoopStops {
    /// Each stop, with its limit, stiffness `k` and damping `c`.
    stops: Vec<(Stop, E, E, E)>,
}

impl LoopStops {
    pub fn new(stops: &Stops) -> Self {
        let numbers = |stop: Stop| {
            let i = stop.joint;
            let number = |name, x: f64| E::labelled(name, i as u32 + 1, || E::varying(x));
            let limit = number(if stop.upper { "upper_stop" } else { "lower_stop" }, stops.limit(stop));
            (stop, limit, number("stop_stiffness", stops.stiffness[i]), number("stop_damping", stops.damping[i]))
        };
        LoopStops { stops: stops.all().map(numbers).collect() }
    }

    /// Energy stored in the springs, J.
    pub fn energy(&self, q: &V) -> E {
        let of = |&(stop, limit, stiffness, _): &(Stop, E, E, E)| stored(stiffness, stop.depth(limit, q[stop.joint], E::zero()).0);
        self.stops.iter().map(of).fold(E::zero(), |sum, part| sum + part)
    }

    /// Return the depth, rad or m, and the push of spring and damper, N m or N, of the stop with index `k`.
    pub fn contact(&self, k: usize, q: &V, v: &V) -> [E; 2] {
        let (stop, limit, stiffness, damping) = self.stops[k];
        let (depth, rate) = stop.depth(limit, q[stop.joint], v[stop.joint]);
        [depth, pressing(stiffness, damping, depth, rate)]
    }

    /// The torques of the stops on the joints, `(n,)`, and the lost power, W. `held` has the mode of each stop. With `None`, the modes follow
    /// from the state.
    pub fn torque(&self, q: &V, v: &V, held: Option<&[Mode<E>]>) -> (V, E) {
        let (mut torque, mut lost) = (zeros(q.len()), E::zero());
        for (k, &(stop, limit, stiffness, damping)) in self.stops.iter().enumerate() {
            let i = stop.joint;
            let (depth, rate) = stop.depth(limit, q[i], v[i]);
            let (force, loss) = push(stiffness, damping, depth, rate, held.map(|held| held[k]));
            torque[i] += if stop.upper { -force } else { force };
            lost += loss;
        }
        (torque, lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_of_different_lengths_are_refused() {
        for (name, lengths) in [("upper", [2, 1, 2, 2]), ("stiffness", [2, 2, 0, 2]), ("damping", [2, 2, 2, 3]), ("upper", [1, 2, 2, 2])] {
            let of = |k: usize, value: f64| vec![value; lengths[k]];
            let stops = Stops::new(of(0, -1.0), of(1, 1.0), of(2, 100.0), of(3, 1.0));
            assert!(matches!(&stops, Err(Error::WrongShape { argument, .. }) if argument == name), "{lengths:?}: {stops:?}");
        }
    }
}
