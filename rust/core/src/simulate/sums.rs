//! The sums of the metrics as operations on the state at a record, for the recording of a loop.

use super::columns::Columns;
use super::gauge::{Gauge, Identities, Seen, Start};
use super::measures::Plan;
use super::monitors::identities::Theory;
use super::problem::Problem;
use super::schedule::Times;
use crate::scalar::Real;

/// The metrics of one run or of several side by side.
pub struct Sums<S: Real> {
    columns: Columns,
    gauge: Gauge<S>,
    theory: Option<Theory<S>>,
}

impl Problem<'_> {
    /// Whether the programs of its loops can compute metrics, at every step.
    pub fn sums_in_programs(&self) -> bool {
        self.measures.is_some() && self.options.times == Times::Every(1)
    }
}

impl<S: Real> Sums<S> {
    /// The sums of run `run` of a problem, for the metrics of `plan`.
    pub fn new(problem: &Problem, run: usize, plan: &Plan, storage: bool) -> Self {
        let (plant, law) = (problem.plant(run), problem.law(run));
        Sums {
            columns: Columns::of(problem),
            gauge: Gauge::new(|_| plan, |_| plant.model()),
            theory: plan.energy.then(|| Theory::new(|_| plant, |_| law, storage)),
        }
    }

    /// The number of stored numbers, and how many of them every record updates.
    pub fn sizes(&self) -> (usize, usize) {
        (self.gauge.plan.places.all, self.gauge.plan.places.lasting)
    }

    /// Add the state `x` under the desired motions and the input `tau`; `h`: the time to the next one.
    pub fn add(&mut self, desired: &[S], x: &[S], tau: &[S], h: S, start: Start, kept: &mut [S]) {
        let parts = self.columns.split(x, tau);
        let identities = self.theory.as_mut().map_or_else(Identities::default, |theory| {
            theory.arm.move_to(parts.q);
            theory.identities(desired, x)
        });
        self.gauge.add(&Seen { desired, q: parts.q, v: parts.v, tau, identities }, h, start, kept);
    }
}
