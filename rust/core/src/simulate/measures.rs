//! The metrics of a run, and the index of each quantity among their numbers.

use super::problem::Problem;
use crate::dynamics::Model;
use crate::error::{Error, Result, finite};
use crate::law::{Aim, JointReference};
use std::ops::Range;

/// The metrics that the caller requests.
#[derive(Clone, Debug, PartialEq)]
pub struct Measures {
    /// The band of the settling time as a fraction of the largest error so far of the joints of the same unit.
    pub settle: f64,
    /// The band of each joint, `(n,)`, instead of `settle`.
    pub band: Option<Vec<f64>>,
    /// The relative tolerance of the monitors.
    pub tolerance: f64,
    /// The reference of the joints, `(n,)`, in place of that of the law.
    pub reference: Option<Vec<f64>>,
    /// Measure the distance of this frame from its position at the joints' reference, instead of the law's tasks.
    pub frame: Option<String>,
}

impl Default for Measures {
    fn default() -> Self {
        Measures { settle: 0.02, band: None, tolerance: 1e-6, reference: None, frame: None }
    }
}

/// The source of the joints' reference.
#[derive(Clone, Debug, PartialEq)]
pub enum Wanted {
    Nothing,
    /// The law's desired motion of the joints, which comes first among its desired motions.
    Motion,
    Target(Vec<f64>),
}

/// Limits of each joint, `(n,)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub speed: Vec<f64>,
    pub effort: Vec<f64>,
}

/// The numbers that metrics keep between records, by name. The numbers of the last record are at the end.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeasureLayout {
    /// The time since the last record, and the number of records.
    pub since: usize,
    pub count: usize,
    /// The error: twice the integral of its square, its peak, then the largest and least position and reference.
    pub error: Range<usize>,
    pub error_peak: Range<usize>,
    pub upper: Range<usize>,
    pub lower: Range<usize>,
    pub wanted_upper: Range<usize>,
    pub wanted_lower: Range<usize>,
    /// The number of the last record outside of the band, and the peak of each unit.
    pub outside: usize,
    pub unit_peak: Range<usize>,
    /// The squared distances of frames.
    pub distance: Range<usize>,
    pub distance_peak: Range<usize>,
    pub tau: Range<usize>,
    pub tau_peak: Range<usize>,
    /// Twice the time outside of the limits.
    pub beyond: usize,
    /// Energy at the first record, then the largest energy, power put in and balance.
    pub energy: Range<usize>,
    /// The Lyapunov function at the first record, the largest so far, the last, and the largest balance.
    pub lyapunov: Range<usize>,
    pub violations: usize,
    /// The sum of all monitors. It is not finite if one of them was not finite.
    pub sum: usize,
    pub error_final: Range<usize>,
    pub distance_final: Range<usize>,
    /// Their number, and how many of them every record updates.
    pub all: usize,
    pub lasting: usize,
}

/// The metrics of runs of one structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    pub n: usize,
    pub wanted: Wanted,
    pub aims: Vec<Aim>,
    /// The frame that is measured against the joints' reference.
    pub frame: Option<usize>,
    /// The joints of each unit.
    pub units: Vec<Vec<usize>>,
    pub band: Option<Vec<f64>>,
    pub settle: f64,
    pub tolerance: f64,
    pub bounds: Option<Bounds>,
    /// Whether energy and skewness are monitored, and the Lyapunov function.
    pub energy: bool,
    pub lyapunov: bool,
    /// The input is the velocity.
    pub velocity: bool,
    pub places: MeasureLayout,
}

impl Plan {
    /// The metrics of each run of a problem: one plan for all, or one per run.
    pub fn all(problem: &Problem, measures: &Measures) -> Result<Vec<Self>> {
        let aims = same_aims(problem);
        (0..problem.plants.len().max(problem.laws.len())).map(|run| Plan::of(problem, run, measures, aims)).collect()
    }

    /// Whether both measure the same, apart from numbers.
    pub fn same_shape(&self, other: &Plan) -> bool {
        self.places == other.places
            && std::mem::discriminant(&self.wanted) == std::mem::discriminant(&other.wanted)
            && (&self.aims, self.frame, self.lyapunov) == (&other.aims, other.frame, other.lyapunov)
            && (&self.units, &self.bounds, self.velocity) == (&other.units, &other.bounds, other.velocity)
    }

    /// The metrics of run `run` of a problem; `aims`: the law's tasks are the same, see [`same_aims`].
    pub fn of(problem: &Problem, run: usize, measures: &Measures, aims: bool) -> Result<Self> {
        let (plant, law) = (problem.plant(run), problem.law(run));
        let n = plant.n();
        finite("settle", &[measures.settle])?;
        finite("tolerance", &[measures.tolerance])?;
        let wanted = match (&measures.reference, law.joint_reference()) {
            (Some(reference), _) => Wanted::Target(reference.clone()),
            (None, Some(JointReference::Motion)) => Wanted::Motion,
            (None, Some(JointReference::Target(target))) => Wanted::Target(target),
            (None, None) => Wanted::Nothing,
        };
        let frame = match &measures.frame {
            None => None,
            Some(_) if wanted == Wanted::Nothing => {
                return Err(Error::input("frame", "is given for a run with no reference of joints: expected None"));
            }
            Some(name) => Some(plant.model().tree("frame")?.frame_index(name)?),
        };
        let aims = if frame.is_none() && aims { law.aims() } else { Vec::new() };
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
            // A band that is NaN contains no error, like a negative one.
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

    /// Frames whose distance is measured.
    pub fn distances(&self) -> usize {
        self.aims.len() + usize::from(self.frame.is_some())
    }

    fn place(&self) -> MeasureLayout {
        let mut at = 0;
        let mut next = |count: usize| {
            at += count;
            at - count..at
        };
        let n = if self.wanted == Wanted::Nothing { 0 } else { self.n };
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

    /// The numbers before the first record. All are finite, since a state that is not ends its run.
    pub fn start(&self) -> Vec<f64> {
        let mut kept = vec![0.0; self.places.all];
        for range in [&self.places.upper, &self.places.wanted_upper] {
            kept[range.clone()].fill(f64::MIN);
        }
        for range in [&self.places.lower, &self.places.wanted_lower] {
            kept[range.clone()].fill(f64::MAX);
        }
        if !self.places.error.is_empty() {
            kept[self.places.outside] = -1.0;
        }
        if let Some(largest) = self.places.lyapunov.clone().nth(1) {
            (kept[largest], kept[largest + 1]) = (f64::MIN, f64::MAX);
        }
        kept
    }
}

/// Whether all laws have the same number of tasks with frames, and all arms have frames.
pub fn same_aims(problem: &Problem) -> bool {
    let count = problem.law(0).aims().len();
    problem.laws.iter().all(|law| law.aims().len() == count) && problem.plants.iter().all(|plant| matches!(plant.model(), Model::Tree(_)))
}

/// The limits that the model states; `None` for a model that states none.
fn bounds(model: &Model, velocity: bool) -> Option<Bounds> {
    let Model::Tree(arm) = model else { return None };
    let of = |get: &dyn Fn(&crate::arm::Joint) -> f64| arm.independent().map(get).collect::<Vec<f64>>();
    let speed = of(&|joint| joint.limits.velocity);
    // The input of an arm under velocity control is compared with its speed limit.
    let effort = if velocity { speed.clone() } else { of(&|joint| joint.limits.effort) };
    Some(Bounds { lower: of(&|joint| joint.limits.lower), upper: of(&|joint| joint.limits.upper), speed, effort })
}
