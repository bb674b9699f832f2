//! Metrics of one run or of several runs at the same time, updated at each record of the run.
//!
//! The error is `e = q_d - q` with the desired position `q_d` and the position `q` of a joint. `w_i = t_{i+1} - t_{i-1}` is twice the
//! trapezoidal weight of record `i`. `p` is the position of a frame, and `p_d` its desired position. `E` is the energy, and `P` the
//! supplied power. The settling band is `|e| <= settle max |e|` with a constant fraction `settle`, or a given band. The metrics are
//!
//! `sum w e^2`, `max |e|`, `max q`, `min q`, the last record with `|e|` outside of the band, `sum w |p_d - p|^2`, `sum w tau^2`,
//! `max |tau|`, the time outside of limits, and `max |E|`. Another metric counts violations of conditions. One of the conditions is
//! `|E(t) - E(0) - int P dt| <= tolerance max |E|`.
//!
//! The maximum in `settle max |e|` includes only the records so far. The last record outside of the band is nevertheless the same as for
//! the maximum of the whole run. The record with the largest error is outside of the band. From this record on, both maxima are equal.

use super::plan::{ErrorReference, Plan};
use crate::dynamics::{At, Model};
use crate::scalar::Real;
use crate::spatial::Vector;

/// The quantities of one record from which metrics are computed.
pub struct MetricInput<'a, S> {
    /// The law's desired motions, one after another.
    pub desired: &'a [S],
    pub q: &'a [S],
    pub v: &'a [S],
    pub tau: &'a [S],
    pub identities: Identities<S>,
}

/// The monitored quantities of a record. Quantities that are not monitored are zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct Identities<S> {
    pub skewness: S,
    pub energy: S,
    pub lyapunov: S,
    /// The integrals of the law's dissipation, and of the power supplied to the stored energy, J: see
    /// [`Exchange`](crate::simulate::monitors::identities::Exchange).
    pub quadratures: [S; 2],
}

/// Whether the stored numbers already contain the values of the first record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The record is not the first one.
    Known,
    /// The program decides at run time whether the record is the first one, from the number of records.
    Requested,
}

/// The metrics of a run with the arms and limits that they need.
pub struct Gauge<S: Real> {
    pub plan: Plan,
    settle: S,
    tolerance: S,
    target: Vec<S>,
    band: Vec<S>,
    /// The arm at the present position, and the arm at the reference position.
    arms: Vec<At<S>>,
    distances: Vec<S>,
}

impl<S: Real> Gauge<S> {
    /// Create the metrics `plan` of a run with the arm `model`.
    pub fn new(plan: &Plan, model: &Model) -> Self {
        let numbers = |values: &[f64]| values.iter().map(|&x| S::varying(x)).collect::<Vec<S>>();
        let target = numbers(if let ErrorReference::Target(target) = &plan.wanted { target } else { &[] });
        let band = numbers(plan.band.as_deref().unwrap_or_default());
        let arms = if plan.frame.is_some() { 2 } else { usize::from(!plan.aims.is_empty()) };
        Gauge {
            settle: S::varying(plan.settle),
            tolerance: S::varying(plan.tolerance),
            target,
            band,
            arms: (0..arms).map(|_| model.at(&vec![S::zero(); model.n()])).collect(),
            distances: vec![S::zero(); plan.distances()],
            plan: plan.clone(),
        }
    }

    /// Update the stored numbers `stored` with one record. `h` is the time to the next record, s, and zero at the last record.
    pub fn add(&mut self, seen: &MetricInput<S>, h: S, start: Start, stored: &mut [S]) {
        let weight = stored[self.plan.places.since] + h;
        let count = stored[self.plan.places.count];
        self.add_errors(seen, weight, count, stored);
        self.add_distances(seen, weight, stored);
        self.add_effort(seen, weight, stored);
        if self.plan.energy {
            self.add_identities(&seen.identities, count, start, stored);
        }
        stored[self.plan.places.since] = h;
        stored[self.plan.places.count] = count + S::splat(1.0);
    }

    fn add_errors(&self, seen: &MetricInput<S>, weight: S, count: S, stored: &mut [S]) {
        let (plan, places) = (&self.plan, &self.plan.places);
        let wanted = match plan.wanted {
            ErrorReference::Nothing => return,
            ErrorReference::Motion => &seen.desired[..plan.n],
            ErrorReference::Target(_) => self.target.as_slice(),
        };
        for i in 0..plan.n {
            let (q, q_d) = (seen.q[i], wanted[i]);
            let error = q_d - q;
            let size = error.abs();
            let at = |range: &std::ops::Range<usize>| range.start + i;
            stored[at(&places.error)] += error * weight * error;
            stored[at(&places.error_peak)] = stored[at(&places.error_peak)].max(size);
            stored[at(&places.error_final)] = size;
            stored[at(&places.upper)] = stored[at(&places.upper)].max(q);
            stored[at(&places.lower)] = stored[at(&places.lower)].min(q);
            stored[at(&places.wanted_upper)] = stored[at(&places.wanted_upper)].max(q_d);
            stored[at(&places.wanted_lower)] = stored[at(&places.wanted_lower)].min(q_d);
        }
        let mut last = stored[places.outside];
        if self.band.is_empty() {
            for (unit, joints) in plan.units.iter().enumerate() {
                let sizes = &stored[places.error_final.clone()];
                let size = joints[1..].iter().fold(sizes[joints[0]], |most, &i| most.max(sizes[i]));
                let peak = stored[places.unit_peak.start + unit].max(size);
                stored[places.unit_peak.start + unit] = peak;
                last = S::select((self.settle * peak).lt(size), count, last);
            }
        } else {
            for (i, &band) in self.band.iter().enumerate() {
                last = S::select(band.lt(stored[places.error_final.start + i]), count, last);
            }
        }
        stored[places.outside] = last;
    }

    fn add_distances(&mut self, seen: &MetricInput<S>, weight: S, stored: &mut [S]) {
        let (plan, places) = (&self.plan, &self.plan.places);
        if plan.distances() == 0 {
            return;
        }
        self.arms[0].move_to(seen.q);
        for (k, aim) in plan.aims.iter().enumerate() {
            let p = self.arms[0].position(aim.frame);
            let mut sum = S::zero();
            for (&row, &place) in aim.rows.iter().zip(&aim.places) {
                let apart = seen.desired[place] - p[row];
                sum += apart * apart;
            }
            self.distances[k] = sum;
        }
        if let Some(frame) = plan.frame {
            let wanted = if plan.wanted == ErrorReference::Motion { &seen.desired[..plan.n] } else { self.target.as_slice() };
            self.arms[1].move_to(wanted);
            let (p, p_d) = (self.arms[0].position(frame), self.arms[1].position(frame));
            let apart = p_d - p;
            self.distances[0] = apart.dot(apart);
        }
        for (k, &square) in self.distances.iter().enumerate() {
            let (sum, peak) = (places.distance.start + k, places.distance_peak.start + k);
            stored[sum] += weight * square;
            stored[peak] = stored[peak].max(square);
            stored[places.distance_final.start + k] = square;
        }
    }

    fn add_effort(&self, seen: &MetricInput<S>, weight: S, stored: &mut [S]) {
        let (plan, places) = (&self.plan, &self.plan.places);
        for (i, &tau) in seen.tau.iter().enumerate() {
            let (sum, peak) = (places.tau.start + i, places.tau_peak.start + i);
            stored[sum] += tau * weight * tau;
            stored[peak] = stored[peak].max(tau.abs());
        }
        let Some(bounds) = &plan.bounds else { return };
        let mut time = S::zero();
        for i in 0..plan.n {
            let mut beyond = |below: S, above: S, limit: f64| {
                if limit.is_finite() {
                    time = S::select(below.lt(above), weight, time);
                }
            };
            let limit = |values: &[f64]| (S::splat(values[i]), values[i]);
            let (lower, upper) = (limit(&bounds.lower), limit(&bounds.upper));
            beyond(seen.q[i], lower.0, lower.1);
            beyond(upper.0, seen.q[i], upper.1);
            let (speed, effort) = (limit(&bounds.speed), limit(&bounds.effort));
            beyond(speed.0, seen.v[i].abs(), speed.1);
            beyond(effort.0, seen.tau[i].abs(), effort.1);
        }
        stored[places.beyond] += time;
    }

    fn add_identities(&self, seen: &Identities<S>, count: S, start: Start, stored: &mut [S]) {
        let places = &self.plan.places;
        let (zero, one) = (S::zero(), S::splat(1.0));
        let [dissipated, put_in] = seen.quadratures;
        let first = |place: usize, value: S, stored: &mut [S]| {
            if start == Start::Requested {
                stored[place] = S::select(count.lt(one), value, stored[place]);
            }
            stored[place]
        };
        let mut violations = stored[places.violations];
        let mut break_beyond = |bound: S, size: S| violations += S::select(bound.lt(size), one, zero);
        let at = places.energy.start;
        let balance = seen.energy - put_in - first(at, seen.energy - put_in, stored);
        let mut sum = stored[places.sum] + balance + seen.skewness;
        stored[at + 1] = stored[at + 1].max(seen.energy.abs());
        stored[at + 2] = stored[at + 2].max(put_in.abs());
        stored[at + 3] = stored[at + 3].max(balance.abs());
        break_beyond(self.tolerance * stored[at + 1], balance.abs());
        break_beyond(self.tolerance, seen.skewness.abs());
        if self.plan.lyapunov {
            let at = places.lyapunov.start;
            let balance = first(at, seen.lyapunov + dissipated, stored) - seen.lyapunov - dissipated;
            stored[at + 1] = stored[at + 1].max(seen.lyapunov);
            break_beyond(self.tolerance * stored[at + 1], balance.abs());
            break_beyond(self.tolerance * stored[at + 1], seen.lyapunov - stored[at + 2]);
            stored[at + 2] = seen.lyapunov;
            stored[at + 3] = stored[at + 3].max(balance.abs());
            sum += balance;
        }
        stored[places.violations] = violations;
        stored[places.sum] = sum;
    }
}
