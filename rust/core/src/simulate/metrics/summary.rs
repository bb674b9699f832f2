//! The summary of a run: its metrics as final numbers, from the stored numbers of a [`Gauge`](super::gauge::Gauge).

use super::plan::{ErrorReference, Plan};
use std::ops::Range;

/// Overshoot is not computed if a joint starts within this distance, rad or m, of its last reference position. It is also not computed if
/// the reference still moves faster than this number, rad/s or m/s, at the last record.
const STILL: f64 = 1e-9;

/// Data of a run for its summary, in addition to the stored numbers.
pub struct Ends<'a> {
    /// The times of the first and of the last record, s.
    pub times: [f64; 2],
    /// The time of the record after the last record outside of the settling band, s. `None` if the last record is outside.
    pub settled: Option<f64>,
    /// The joint positions at the first record, rad or m.
    pub q: &'a [f64],
    /// The law's desired motions at the last record.
    pub desired: &'a [f64],
}

/// A quantity of the summary: its name, and its width if it has one number per joint or frame.
pub type Column = (&'static str, Option<usize>);

impl Plan {
    /// Return the quantities, in the order of [`Plan::summary`].
    pub fn columns(&self) -> Vec<Column> {
        let (n, m) = (Some(self.n), Some(self.distances()).filter(|&m| m > 0));
        let mut columns = vec![("error_rms", n), ("error_peak", n), ("error_final", n), ("overshoot", n), ("tau_rms", n), ("tau_peak", n)];
        if m.is_some() {
            columns.extend(["position_error_rms", "position_error_peak", "position_error_final"].map(|name| (name, m)));
        }
        let of_runs = ["settling_time", "time_outside_limits", "monitor_violations", "energy_error"];
        let balances = ["energy_missing", "lyapunov_rise", "lyapunov_error"];
        columns.extend(of_runs.into_iter().chain(balances).map(|name| (name, None)));
        columns
    }

    /// Return the values of all quantities, one after another.
    pub fn summary(&self, stored: &[f64], ends: &Ends) -> Vec<f64> {
        let places = &self.places;
        let [t0, t1] = ends.times;
        let of = |range: &Range<usize>| stored[range.clone()].iter().copied();
        // If the run has one record, the root mean square is the value of this record.
        let alone = t1 == t0;
        let rms = |sum: f64, only: f64| if alone { only } else { (sum / (2.0 * (t1 - t0))).sqrt() };
        let mut all = Vec::with_capacity(6 * self.n + 3 * self.distances() + 7);
        if self.wanted == ErrorReference::Nothing {
            all.extend(std::iter::repeat_n(f64::NAN, 4 * self.n));
        } else {
            all.extend(of(&places.error).zip(of(&places.error_final)).map(|(sum, only)| rms(sum, only)));
            all.extend(of(&places.error_peak).chain(of(&places.error_final)));
            all.extend((0..self.n).map(|i| self.overshoot(stored, ends, i)));
        }
        all.extend(of(&places.tau).zip(of(&places.tau_peak)).map(|(sum, only)| rms(sum, only)));
        all.extend(of(&places.tau_peak));
        all.extend(of(&places.distance).zip(of(&places.distance_final)).map(|(sum, only)| rms(sum, only.sqrt())));
        all.extend(of(&places.distance_peak).chain(of(&places.distance_final)).map(f64::sqrt));
        let settling = if self.wanted == ErrorReference::Nothing { None } else { ends.settled.map(|t| t - t0) };
        all.push(settling.unwrap_or(f64::NAN));
        all.push(if self.bounds.is_some() { 0.5 * stored[places.beyond] } else { f64::NAN });
        all.push(if self.energy { stored[places.violations] } else { 0.0 });
        let (energy, lyapunov) = (&stored[places.energy.clone()], &stored[places.lyapunov.clone()]);
        all.push(energy_error(energy).unwrap_or(f64::NAN));
        all.push(energy.get(3).copied().unwrap_or(f64::NAN));
        // If the Lyapunov function starts at zero, its relative growth is not defined, and is set to zero.
        all.push(lyapunov.first().map_or(f64::NAN, |&first| if first > 0.0 { lyapunov[1] / first } else { 0.0 }));
        all.push(lyapunov.first().map_or(f64::NAN, |_| lyapunov[3] / lyapunov[1]));
        all
    }

    /// Return the overshoot of joint `i`: its distance beyond the extreme of the reference. It is divided by the distance from the joint's
    /// start to its last reference position.
    fn overshoot(&self, stored: &[f64], ends: &Ends, i: usize) -> f64 {
        let places = &self.places;
        let (end, speed) = match &self.wanted {
            ErrorReference::Target(target) => (target[i], 0.0),
            _ => (ends.desired[i], ends.desired[self.n + i]),
        };
        let travel = end - ends.q[i];
        if !(travel.abs() > STILL) || speed.abs() > STILL {
            return f64::NAN;
        }
        let at = |range: &Range<usize>| stored[range.start + i];
        let beyond = if travel > 0.0 { at(&places.upper) - at(&places.wanted_upper) } else { at(&places.wanted_lower) - at(&places.lower) };
        beyond.max(0.0) / travel.abs()
    }
}

/// The largest balance, divided by the largest energy stored or exchanged. `stored`: see [`super::plan::MeasureLayout::energy`].
fn energy_error(stored: &[f64]) -> Option<f64> {
    let &[_, energy, power, missing] = stored else { return None };
    Some(if missing > 0.0 { missing / energy.max(power) } else { missing })
}
