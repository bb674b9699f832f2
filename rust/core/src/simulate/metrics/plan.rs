//! The metrics of a run, and the layout of the numbers that they store between records.

use crate::dynamics::Model;
use crate::error::{Error, Result, finite};
use crate::law::{Aim, JointReference};
use crate::simulate::problem::Problem;
use crate::simulate::problem::measures::Measures;
use std::ops::Range;

/// The reference position of the joints, from which their errors are measured.
#[derive(Clone, Debug, PartialEq)]
pub enum ErrorReference {
    Nothing,
    /// The law's desired joint motion, which is the first of its desired motions.
    Motion,
    Target(Vec<f64>),
}

/// The limits of all joints, shape `(n,)` each.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub speed: Vec<f64>,
    pub effort: Vec<f64>,
}

/// The indices of the values that metrics store between records. The last of these values describe only the last record. Integrals are
/// stored as twice their value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeasureLayout {
    /// The time from the last record to the next one, s.
    pub since: usize,
    /// The number of records.
    pub count: usize,
    /// Twice the integral of the squared error of each joint, rad^2 s or m^2 s.
    pub error: Range<usize>,
    /// The largest absolute error of each joint, rad or m.
    pub error_peak: Range<usize>,
    /// The largest position of each joint, rad or m.
    pub upper: Range<usize>,
    /// The smallest position of each joint, rad or m.
    pub lower: Range<usize>,
    /// The largest reference position of each joint, rad or m.
    pub wanted_upper: Range<usize>,
    /// The smallest reference position of each joint, rad or m.
    pub wanted_lower: Range<usize>,
    /// The index of the last record outside of the settling band.
    pub outside: usize,
    /// The largest error of all joints with the same unit: rad, then m.
    pub unit_peak: Range<usize>,
    /// Twice the integral of the squared distance of each frame, m^2 s.
    pub distance: Range<usize>,
    /// The largest squared distance of each frame, m^2.
    pub distance_peak: Range<usize>,
    /// Twice the integral of the squared input of each joint, in the squared unit of [`Run::tau`](crate::simulate::Run::tau) times s.
    pub tau: Range<usize>,
    /// The largest absolute input of each joint, in the unit of [`Run::tau`](crate::simulate::Run::tau).
    pub tau_peak: Range<usize>,
    /// Twice the time outside of the limits, s.
    pub beyond: usize,
    /// Four numbers: the energy minus the supplied energy at the first record; the largest magnitudes of energy, supplied energy and
    /// balance, J.
    pub energy: Range<usize>,
    /// Four numbers: the Lyapunov function plus the dissipation integral at the first record; its largest and last value; the largest
    /// magnitude of its balance, J.
    pub lyapunov: Range<usize>,
    pub violations: usize,
    /// The sum of the skewness of `dM/dt - 2 C` and of the balances over all records. It is not finite if one of them was not finite.
    pub sum: usize,
    pub error_final: Range<usize>,
    pub distance_final: Range<usize>,
    /// The number of stored values.
    pub all: usize,
    /// The number of these values that every record updates. The other values describe only the last record.
    pub lasting: usize,
}

/// The metrics of one run or of all runs of a problem, with the settings that they need.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    pub n: usize,
    pub wanted: ErrorReference,
    pub aims: Vec<Aim>,
    /// The frame whose position error is measured. This error is the distance between the frame's position and its position at the
    /// reference of the joints.
    pub frame: Option<usize>,
    /// The joints with the same unit: those in rad, then those in m.
    pub units: Vec<Vec<usize>>,
    pub band: Option<Vec<f64>>,
    pub settle: f64,
    pub tolerance: f64,
    pub bounds: Option<Bounds>,
    /// Whether the energy and the skewness of `dM/dt - 2 C` are monitored.
    pub energy: bool,
    /// Whether the Lyapunov function is monitored.
    pub lyapunov: bool,
    /// Whether the input is a velocity.
    pub velocity: bool,
    pub places: MeasureLayout,
}

impl Problem<'_> {
    /// Return the plans of the metrics: none, one for all runs, or one per run. Errors: [`Error::Input`] if a setting is not finite, or if
    /// a frame is given without a reference of the joints. [`Error::Unknown`] for an unknown frame.
    pub fn plans(&self) -> Result<Vec<Plan>> {
        self.measures.as_ref().map_or(Ok(Vec::new()), |measures| Plan::all(self, measures))
    }
}

impl Plan {
    /// Return the metrics of the runs of a problem: one plan for all runs, or one per run.
    pub fn all(problem: &Problem, measures: &Measures) -> Result<Vec<Self>> {
        (0..problem.plants.len().max(problem.laws.len())).map(|run| Plan::of(problem, run, measures)).collect()
    }

    /// Whether both plans have the same metrics and the same joint limits. Targets, settling bands and tolerances may differ.
    pub fn same_shape(&self, other: &Plan) -> bool {
        self.places == other.places
            && std::mem::discriminant(&self.wanted) == std::mem::discriminant(&other.wanted)
            && (&self.aims, self.frame, self.lyapunov) == (&other.aims, other.frame, other.lyapunov)
            && (&self.units, &self.bounds, self.velocity) == (&other.units, &other.bounds, other.velocity)
    }

    /// Return the metrics of run `run` of a problem.
    pub fn of(problem: &Problem, run: usize, measures: &Measures) -> Result<Self> {
        let (plant, law) = (problem.plant(run), problem.law(run));
        let n = plant.n();
        finite("settle", &[measures.settle])?;
        finite("tolerance", &[measures.tolerance])?;
        let wanted = match (&measures.reference, law.joint_reference()) {
            (Some(reference), _) => ErrorReference::Target(reference.clone()),
            (None, Some(JointReference::Motion)) => ErrorReference::Motion,
            (None, Some(JointReference::Target(target))) => ErrorReference::Target(target),
            (None, None) => ErrorReference::Nothing,
        };
        let frame = match &measures.frame {
            None => None,
            Some(_) if wanted == ErrorReference::Nothing => {
                return Err(Error::input("frame", "is given for a run with no reference of joints: expected None"));
            }
            Some(name) => Some(plant.model().tree("frame")?.frame_index(name)?),
        };
        let aims = if frame.is_none() && matches!(plant.model(), Model::Tree(_)) { law.aims() } else { Vec::new() };
        let angles = plant.model().angles();
        let of_unit = |angle: bool| (0..n).filter(|&i| angles[i] == angle).collect::<Vec<_>>();
        let units = [of_unit(true), of_unit(false)].into_iter().filter(|joints| !joints.is_empty()).collect();
        let velocity = !plant.kind().has_speeds();
        let mut plan = Plan {
            n,
            wanted,
            aims,
            frame,
            units,
            // No error is within a band that is NaN. The metrics test `band < |error|`, which is always false for NaN. So -1 replaces NaN,
            // because every error exceeds -1.
            band: measures.band.as_ref().map(|band| band.iter().map(|&band| if band >= 0.0 { band } else { -1.0 }).collect()),
            settle: measures.settle,
            tolerance: measures.tolerance,
            bounds: bounds(plant.model(), velocity),
            energy: problem.options.monitors && !velocity,
            lyapunov: problem.options.monitors && law.adaptive().is_some(),
            velocity,
            places: MeasureLayout::default(),
        };
        plan.places = plan.place();
        Ok(plan)
    }

    /// The number of frames whose distance is measured.
    pub fn distances(&self) -> usize {
        self.aims.len() + usize::from(self.frame.is_some())
    }

    fn place(&self) -> MeasureLayout {
        let mut at = 0;
        let mut next = |count: usize| {
            at += count;
            at - count..at
        };
        let n = if self.wanted == ErrorReference::Nothing { 0 } else { self.n };
        let (energy, lyapunov) = (usize::from(self.energy), usize::from(self.lyapunov));
        let mut places = MeasureLayout {
            since: next(1).start,
            count: next(1).start,
            error: next(n),
            error_peak: next(n),
            upper: next(n),
            lower: next(n),
            wanted_upper: next(n),
            wanted_lower: next(n),
            outside: next(n.min(1)).start,
            unit_peak: next(if n > 0 && self.band.is_none() { self.units.len() } else { 0 }),
            distance: next(self.distances()),
            distance_peak: next(self.distances()),
            tau: next(self.n),
            tau_peak: next(self.n),
            beyond: next(usize::from(self.bounds.is_some())).start,
            energy: next(4 * energy),
            lyapunov: next(4 * lyapunov),
            violations: next(energy).start,
            sum: next(energy).start,
            ..MeasureLayout::default()
        };
        places.error_final = next(n);
        places.distance_final = next(self.distances());
        places.all = places.distance_final.end;
        places.lasting = places.error_final.start;
        places
    }

    /// Return the stored numbers before the first record. All are finite, because they are part of the state of a loop, and a run ends if
    /// its state is not finite.
    pub fn start(&self) -> Vec<f64> {
        let mut stored = vec![0.0; self.places.all];
        for range in [&self.places.upper, &self.places.wanted_upper] {
            stored[range.clone()].fill(f64::MIN);
        }
        for range in [&self.places.lower, &self.places.wanted_lower] {
            stored[range.clone()].fill(f64::MAX);
        }
        if !self.places.error.is_empty() {
            stored[self.places.outside] = -1.0;
        }
        if let Some(largest) = self.places.lyapunov.clone().nth(1) {
            (stored[largest], stored[largest + 1]) = (f64::MIN, f64::MAX);
        }
        stored
    }
}

/// Return the limits of the model's joints. `None` for a model without limits.
fn bounds(model: &Model, velocity: bool) -> Option<Bounds> {
    let Model::Tree(arm) = model else { return None };
    let of = |get: &dyn Fn(&crate::arm::Joint) -> f64| arm.independent().map(get).collect::<Vec<f64>>();
    let speed = of(&|joint| joint.limits.velocity);
    // For a velocity-controlled arm, the input is compared with the speed limit.
    let effort = if velocity { speed.clone() } else { of(&|joint| joint.limits.effort) };
    Some(Bounds { lower: of(&|joint| joint.limits.lower), upper: of(&|joint| joint.limits.upper), speed, effort })
}
