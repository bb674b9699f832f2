//! Updates of metrics as recorded operations on the state at a record.

use crate::simulate::columns::Columns;
use crate::simulate::metrics::gauge::{Gauge, Identities, MetricInput, Start};
use crate::simulate::metrics::plan::Plan;
use crate::simulate::monitors::identities::Theory;
use crate::simulate::problem::Problem;
use crate::simulate::problem::times::Times;
use crate::trace::Sym;

/// The metrics of one run.
pub struct Sums<'a> {
    columns: Columns,
    gauge: Gauge<Sym>,
    theory: Option<Theory<'a>>,
}

impl Problem<'_> {
    /// Whether programs can compute metrics. Metrics in programs require records at every step.
    pub fn sums_in_programs(&self) -> bool {
        self.measures.is_some() && self.options.times == Times::Every(1)
    }
}

impl<'a> Sums<'a> {
    /// Create the metrics `plan` of run `run` of a problem. `storage`: whether the monitored energy is the law's storage function.
    pub fn new(problem: &Problem<'a>, run: usize, plan: &Plan, storage: bool) -> Self {
        let (plant, law) = (problem.plant(run), problem.law(run));
        Sums {
            columns: Columns::of(problem),
            gauge: Gauge::new(plan, plant.model()),
            theory: plan.energy.then(|| Theory::new(plant, law, storage)),
        }
    }

    /// Return the number of stored numbers, and how many of them are updated at every record.
    pub fn sizes(&self) -> (usize, usize) {
        (self.gauge.plan.places.all, self.gauge.plan.places.lasting)
    }

    /// Update the metrics with the state `x`, the desired motions and the input `tau`. `h`: the time to the next record, s.
    pub fn add(&mut self, desired: &[Sym], x: &[Sym], tau: &[Sym], h: Sym, start: Start, stored: &mut [Sym]) {
        let parts = self.columns.split(x, tau);
        let identities = self.theory.as_ref().map_or_else(Identities::default, |theory| theory.identities(&theory.instant(desired, x)));
        self.gauge.add(&MetricInput { desired, q: parts.q, v: parts.v, tau, identities }, h, start, stored);
    }
}
