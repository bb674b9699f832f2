//! The arguments of the planner, and their validation.

use super::along::Along;
use super::mover::Mover;
use super::rows::Friction;
use super::tip::{Tip, TipLimits};
use super::tuning::{FASTEST, FIRST_GRID, MOST_POINTS};
use crate::error::{Error, Result, finite, positive};
use crate::motion::Path;

/// Limits of every joint, `(n,)` each: `tau_min <= tau <= tau_max`, `|v| <= v_max`, `|a| <= a_max`.
///
/// At least one limit of torque, joint acceleration or frame acceleration is required. Limits of torque, speed and acceleration may vary
/// along the path: `(P + 1, n)`, one row per knot, and linear in `s` between knots. A torque limit that varies must be symmetric,
/// `tau_min = -tau_max`.
///
/// ```
/// use armlet_core::plan::{Mover, PathLimits, TimePathOptions, time_path};
/// # use armlet_core::dynamics::PlanarPr;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = Mover::PlanarPr(PlanarPr::new(3.0, 0.5, 0.2)?);
/// # let path = Arc::new(Path::waypoints(&[0.0, 0.0, 1.0, 1.0], 2, None, Ends::Natural)?.0);
/// // Both joints move by 1, in m and in rad. The first joint accelerates with 4 m/s^2 until its speed is 1 m/s: T = 1 + 1/4.
/// let limits = PathLimits { velocity: Some(vec![1.0, 2.0]), acceleration: Some(vec![4.0, 4.0]), ..PathLimits::default() };
/// let plan = time_path(arm, path, &limits, &TimePathOptions::default())?;
/// assert!((plan.motion.duration() - 1.25).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PathLimits {
    /// Least and largest torques, N m or N.
    pub torque: Option<(Vec<f64>, Vec<f64>)>,
    /// Largest speeds, rad/s or m/s.
    pub velocity: Option<Vec<f64>>,
    /// Largest accelerations, rad/s^2 or m/s^2.
    pub acceleration: Option<Vec<f64>>,
    /// Least and largest positions, rad or m; infinite where there is no limit.
    pub position: Option<(Vec<f64>, Vec<f64>)>,
    /// Limits of the speed and acceleration of a frame's origin.
    pub tip: Option<TipLimits>,
}

/// Options of a timing: grid, speeds at the ends, stops, friction and torque rate.
///
/// ```
/// use armlet_core::plan::{Mover, PathLimits, TimePathOptions, time_path};
/// # use armlet_core::dynamics::PlanarPr;
/// # use armlet_core::motion::{Ends, Path};
/// # use std::sync::Arc;
///
/// # let arm = Mover::PlanarPr(PlanarPr::new(3.0, 0.5, 0.2)?);
/// # let limits = PathLimits { acceleration: Some(vec![4.0, 4.0]), ..PathLimits::default() };
/// // The motion stops at the second waypoint: twice `2 sqrt(0.5 / 4)`.
/// let (path, knots) = Path::waypoints(&[0.0, 0.0, 0.5, 0.5, 1.0, 1.0], 2, None, Ends::Natural)?;
/// let options = TimePathOptions { stops: vec![knots[1]], ..TimePathOptions::default() };
/// let plan = time_path(arm, Arc::new(path), &limits, &options)?;
/// assert!((plan.motion.duration() - 2f64.sqrt()).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct TimePathOptions {
    /// Approximate number of grid points; each piece of the path has at least one segment. `None` refines the grid until the duration
    /// converges.
    pub grid: Option<usize>,
    /// Whether segments are halved where a grid with `grid` points is too coarse for the limits. Without `grid`, this option is not used.
    pub refine: bool,
    /// Path speed `ds/dt` at the start, in the unit of `s` per second.
    pub start_speed: f64,
    /// Path speed `ds/dt` at the end, in the unit of `s` per second.
    pub end_speed: f64,
    /// Indices of the knots where the motion stops.
    pub stops: Vec<usize>,
    /// Joint friction that the torques overcome.
    pub friction: Option<Friction>,
    /// Limits of `|d tau/dt|`, `(n,)`, N m/s or N/s. They require a motion from rest to rest without stops and without Coulomb friction.
    pub torque_rate: Option<Vec<f64>>,
}

impl Default for TimePathOptions {
    fn default() -> Self {
        TimePathOptions { grid: None, refine: true, start_speed: 0.0, end_speed: 0.0, stops: Vec::new(), friction: None, torque_rate: None }
    }
}

impl TimePathOptions {
    /// The approximate number of points of the first grid.
    pub(super) fn points(&self) -> usize {
        self.grid.unwrap_or(FIRST_GRID)
    }
}

fn sized(name: &str, values: &[f64], n: usize) -> Result<()> {
    if values.len() != n {
        return Err(Error::wrong_shape(name, &[n], &[values.len()]));
    }
    finite(name, values)
}

/// Validate `values`: `(rows, n)`, one row per knot, or constant, `(n,)`. Return whether they vary.
fn sized_along(name: &str, values: &[f64], rows: usize, n: usize) -> Result<bool> {
    if values.len() != rows * n {
        sized(name, values, n)?;
        return Ok(false);
    }
    finite(name, values)?;
    Ok(true)
}

fn all_positive(name: &str, values: &[f64], n: usize) -> Result<()> {
    sized(name, values, n)?;
    match values.iter().position(|x| !(*x > 0.0)) {
        None => Ok(()),
        Some(i) => Err(Error::input(name, format!("is not positive: expected numbers > 0, got {}", values[i])).at([i])),
    }
}

/// Refuse torque limits, `(rows, n)` each, unless `lo` equals `-hi`.
fn mirrored(lo: &[f64], hi: &[f64], n: usize) -> Result<()> {
    if lo.len() != hi.len() {
        return Err(Error::wrong_shape("tau_min", &[hi.len() / n, n], &[lo.len()]));
    }
    match lo.iter().zip(hi).position(|(lo, hi)| *lo != -hi) {
        None => Ok(()),
        Some(k) => {
            let problem = format!("is not -tau_max, although the limit varies: expected {}, got {}", -hi[k], lo[k]);
            Err(Error::input("tau_min", problem).at([k / n, k % n]))
        }
    }
}

impl PathLimits {
    /// Bounds of torques, accelerations and speeds, `(3 n,)` each: infinite where there is no limit, -1 and 1 where a limit varies.
    fn bounds(&self, n: usize, rows: usize) -> Result<Checked> {
        let mut bounds = [vec![f64::NEG_INFINITY; 3 * n], vec![f64::INFINITY; 3 * n]];
        let mut along = Along { n, ..Along::default() };
        let torque = self.torque.as_ref().filter(|(_, hi)| hi.len() != rows * n);
        let varying = self.torque.as_ref().filter(|(_, hi)| hi.len() == rows * n);
        if let Some((lo, hi)) = torque {
            sized("tau_max", hi, n)?;
            sized("tau_min", lo, n)?;
            if let Some(i) = (0..n).find(|&i| !(lo[i] < hi[i])) {
                let problem = format!("is empty: expected a lower below an upper limit, got {} and {}", lo[i], hi[i]);
                return Err(Error::input("tau_max", problem).at([i]));
            }
            bounds[0][..n].copy_from_slice(lo);
            bounds[1][..n].copy_from_slice(hi);
        }
        let largest = varying.map(|(_, hi)| hi);
        for (k, name, values) in [(0, "tau_max", largest), (1, "a_max", self.acceleration.as_ref()), (2, "v_max", self.velocity.as_ref())] {
            let Some(values) = values else { continue };
            if sized_along(name, values, rows, n)? {
                all_positive(name, values, values.len())?;
                bounds[0][k * n..(k + 1) * n].fill(-1.0);
                bounds[1][k * n..(k + 1) * n].fill(1.0);
                along.limits[k] = values.clone();
                continue;
            }
            all_positive(name, values, n)?;
            for i in 0..n {
                (bounds[0][k * n + i], bounds[1][k * n + i]) = (-values[i], values[i]);
            }
        }
        if let Some((lo, hi)) = varying {
            mirrored(lo, hi, n)?;
        }
        let [lo, hi] = bounds;
        let tip = self.tip.as_ref().map(|tip| of_tip(tip, rows, &mut along)).transpose()?;
        Ok(Checked { lo, hi, along, tip })
    }

    fn check_positions(&self, n: usize) -> Result<()> {
        let Some((lower, upper)) = &self.position else { return Ok(()) };
        for (name, values) in [("q_min", lower), ("q_max", upper)] {
            if values.len() != n || values.iter().any(|x| x.is_nan()) {
                return Err(Error::input(name, format!("is not a limit: expected ({n},) numbers, got {values:?}")));
            }
        }
        match (0..n).find(|&i| !(lower[i] <= upper[i])) {
            None => Ok(()),
            Some(i) => {
                Err(Error::input("q_min, q_max", format!("are out of order: expected q_min <= q_max, got {} and {}", lower[i], upper[i]))
                    .at([i]))
            }
        }
    }

    fn check_tip(&self, mover: Mover) -> Result<()> {
        let Some(TipLimits { frame, .. }) = &self.tip else { return Ok(()) };
        let frames = match mover {
            Mover::Tree(functions) => functions.arm().frames.len(),
            Mover::PlanarPr(_) => 0,
        };
        if *frame >= frames {
            return Err(Error::input("frame", format!("is out of range: expected the index of one of {frames} frames, got {frame}")));
        }
        Ok(())
    }
}

/// The limits of a frame's origin. Limits that vary are moved to `along`.
fn of_tip(tip: &TipLimits, rows: usize, along: &mut Along) -> Result<Tip> {
    let mut of = |part: usize, name: &str, values: &Option<Vec<f64>>| -> Result<Option<f64>> {
        let Some(values) = values else { return Ok(None) };
        if let [value] = values[..] {
            positive(name, value)?;
            return Ok(Some(value));
        }
        all_positive(name, values, rows)?;
        along.tip[part] = values.clone();
        Ok(Some(1.0))
    };
    let acceleration = of(0, "tip_acceleration", &tip.acceleration)?;
    Ok(Tip { frame: tip.frame, speed: of(1, "tip_speed", &tip.speed)?, acceleration })
}

/// The limits in the form that the planner uses.
pub(super) struct Checked {
    /// `(3 n,)`: lower limits of torques, accelerations and speeds.
    pub lo: Vec<f64>,
    /// `(3 n,)`: upper limits of torques, accelerations and speeds.
    pub hi: Vec<f64>,
    pub along: Along,
    pub tip: Option<Tip>,
}

/// Validate the arguments, and return the limits. Errors: `Input` or `WrongShape`.
pub(super) fn checked(mover: Mover, path: &Path, limits: &PathLimits, options: &TimePathOptions) -> Result<Checked> {
    let n = mover.dof();
    if path.dof() != n {
        return Err(Error::wrong("path", "number of joints", n, path.dof()));
    }
    let tip = limits.tip.as_ref().and_then(|tip| tip.acceleration.as_ref());
    if limits.torque.is_none() && limits.acceleration.is_none() && tip.is_none() {
        return Err(Error::input("tau_max, a_max", "are both missing: expected a limit of torque or of acceleration, got None"));
    }
    limits.check_positions(n)?;
    limits.check_tip(mover)?;
    let points = options.points();
    if !(2..=MOST_POINTS).contains(&points) {
        return Err(Error::input("grid", format!("is out of range: expected 2 to {MOST_POINTS} points, got {points}")));
    }
    let bounds = limits.bounds(n, path.knots().len())?;
    let jumps = options.friction.as_ref().is_some_and(|friction| friction.coulomb.iter().any(|c| *c != 0.0));
    if let Some(rates) = &options.torque_rate {
        all_positive("torque_rate", rates, n)?;
        for (given, what) in [
            (options.start_speed != 0.0 || options.end_speed != 0.0, "start_speed and end_speed 0"),
            (!options.stops.is_empty(), "no stops"),
            (jumps, "no Coulomb friction, whose torque jumps"),
        ] {
            if given {
                return Err(Error::input("torque_rate", format!("is not offered here: expected {what}")));
            }
        }
    }
    if let Some(friction) = &options.friction {
        for values in [&friction.viscous, &friction.coulomb] {
            sized("friction", values, n)?;
            if let Some(i) = values.iter().position(|x| *x < 0.0) {
                return Err(Error::input("friction", format!("is negative: expected numbers >= 0, got {}", values[i])).at([i]));
            }
        }
    }
    let knots = path.knots().len();
    if let Some(k) = options.stops.iter().find(|&&k| k >= knots) {
        return Err(Error::input("stops", format!("is out of range: expected indices below {knots}, got {k}")));
    }
    for (name, speed) in [("start_speed", options.start_speed), ("end_speed", options.end_speed)] {
        if !(speed >= 0.0 && speed.is_finite() && speed * speed < FASTEST) {
            return Err(Error::input(name, format!("is out of range: expected a finite path speed >= 0, got {speed}")));
        }
    }
    Ok(bounds)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(lo: Vec<f64>, hi: Vec<f64>) -> String {
        let limits = PathLimits { torque: Some((lo, hi)), ..PathLimits::default() };
        limits.bounds(2, 3).err().map_or_else(String::new, |error| error.to_string())
    }

    #[test]
    fn errors_of_least_torques_name_them() {
        let wrong = [vec![-1.0], vec![-1.0; 6], vec![f64::NAN, -1.0]];
        for lo in wrong {
            assert!(problem(lo.clone(), vec![1.0; 2]).starts_with("tau_min"), "{lo:?}");
        }
        assert!(problem(vec![-1.0; 2], vec![1.0]).starts_with("tau_max"));
        assert!(problem(vec![-1.0; 2], vec![1.0; 2]).is_empty());
    }

    #[test]
    fn least_torques_that_vary_mirror_the_largest() {
        let hi: Vec<f64> = (1..=6).map(f64::from).collect();
        let lo: Vec<f64> = hi.iter().map(|x| -x).collect();
        assert!(problem(lo.clone(), hi.clone()).is_empty());
        for k in 0..6 {
            let mut other = lo.clone();
            other[k] = -0.5;
            let (got, place) = (problem(other, hi.clone()), format!("first bad index ({}, {})", k / 2, k % 2));
            assert!(got.starts_with("tau_min") && got.contains(&place), "{got}");
        }
        for lo in [vec![], vec![-1.0; 2], vec![f64::NAN; 6]] {
            assert!(problem(lo, hi.clone()).starts_with("tau_min"));
        }
    }
}
