//! The parts of a record other than the state, as operations on the state, for the recording of a loop: the input and the monitors.
//!
//! Monitors round like plain `f64`, so that a record of a program has the bits of a record that is computed directly.

use super::monitors::{Checks, Monitored, Scope};
use super::problem::Problem;
use super::schedule::Times;
use super::world::Exogenous;
use crate::law::RecordedSolver;
use crate::trace::{Sym, sym};

/// Numbers of the first record that monitors refer to.
pub const FIRSTS: usize = 2;

/// The entries of a record.
pub struct Noted {
    pub numbers: Vec<Sym>,
    /// The reference values of the monitors, if this is the first record.
    pub firsts: Vec<Sym>,
    /// One if the norms of levels are valid, zero if the regular route is not; `None` without levels.
    pub stands: Option<Sym>,
}

pub struct Notes {
    checks: Option<Checks<RecordedSolver>>,
    monitors: usize,
}

impl Problem<'_> {
    /// Whether the programs of its loops can compute complete records: at steps, with norms of levels by a route without a branch.
    pub fn notes_in_programs(&self) -> bool {
        let branches = self.options.monitors && self.laws.iter().any(|law| !law.route().is_recordable());
        self.measures.is_none() && matches!(self.options.times, Times::Every(_)) && !branches
    }
}

impl Notes {
    /// The notes of run `run` of a problem with `monitors` monitors. For `monitored` see [`Scope`].
    pub fn new(problem: &Problem, run: usize, monitors: usize, monitored: Monitored) -> Self {
        Notes { checks: (monitors > 0).then(|| Checks::new(&Scope { problem, run, monitored })), monitors }
    }

    /// The numbers of monitors, of norms of levels among them, and of reference values.
    pub fn sizes(&self) -> (usize, usize, usize) {
        let norms = self.checks.as_ref().map_or(0, Checks::norms);
        (self.monitors, norms, if self.monitors > norms { FIRSTS } else { 0 })
    }

    /// The record of the state `x` under the exogenous input and the input `tau`; `firsts`: [`Noted::firsts`] of the first one.
    pub fn take(&mut self, u: &Exogenous<Sym>, x: &[Sym], tau: &[Sym], firsts: &[Sym]) -> Noted {
        let mut noted = Noted { numbers: tau.to_vec(), firsts: Vec::new(), stands: None };
        let Some(checks) = &mut self.checks else { return noted };
        let mut values = vec![Sym::default(); self.monitors];
        let count_from = |own: [Sym; 2]| {
            noted.firsts = own.to_vec();
            firsts.try_into().unwrap_or(own)
        };
        noted.stands = sym::unfused(|| checks.evaluate((&u.desired, &u.wrench), (x, tau), count_from, &mut values));
        noted.numbers.extend(values);
        noted
    }
}
