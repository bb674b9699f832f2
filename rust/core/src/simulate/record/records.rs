//! Records within programs (recorded and compiled loops): the input and the monitors of a record as recorded operations on the state.
//!
//! A record of a program has the same bits as a record that is computed directly.

use crate::simulate::monitors::{Checks, Monitored, Scope};
use crate::simulate::problem::Problem;
use crate::simulate::problem::times::Times;
use crate::simulate::world::Exogenous;
use crate::trace::Sym;

/// The number of reference values: values of the first record that monitors read at later records.
pub const FIRSTS: usize = 2;

/// The recorded operations that compute the numbers of a record.
pub struct Noted {
    pub numbers: Vec<Sym>,
    /// The reference values of the monitors, if this is the first record.
    pub firsts: Vec<Sym>,
}

/// The recorded operations that compute the part of a record that follows the state: the input and the monitors.
pub struct Notes<'a> {
    checks: Option<Checks<'a>>,
    monitors: usize,
}

impl Problem<'_> {
    /// Whether programs can compute complete records. This requires records at the ends of steps, and no metrics.
    pub fn notes_in_programs(&self) -> bool {
        self.measures.is_none() && matches!(self.options.times, Times::Every(_))
    }
}

impl<'a> Notes<'a> {
    /// Create the operations for run `run` of a problem with `monitors` monitors. `monitored`: the properties of the monitors of the
    /// problem.
    pub fn new(problem: &Problem<'a>, run: usize, monitors: usize, monitored: Monitored) -> Self {
        Notes { checks: (monitors > 0).then(|| Checks::new(&Scope { problem, run, monitored })), monitors }
    }

    /// Return the number of monitors, and the number of reference values.
    pub fn sizes(&self) -> (usize, usize) {
        let norms = self.checks.as_ref().map_or(0, Checks::norms);
        (self.monitors, if self.monitors > norms { FIRSTS } else { 0 })
    }

    /// Record the operations for state `x`, exogenous input `u` and input `tau`. `firsts`: the reference values. If `firsts` is empty, this
    /// record determines them.
    pub fn take(&self, u: &Exogenous<Sym>, x: &[Sym], tau: &[Sym], firsts: &[Sym]) -> Noted {
        let mut noted = Noted { numbers: tau.to_vec(), firsts: Vec::new() };
        let Some(checks) = &self.checks else { return noted };
        let mut values = vec![Sym::default(); self.monitors];
        let count_from = |own: [Sym; 2]| {
            noted.firsts = own.to_vec();
            firsts.try_into().unwrap_or(own)
        };
        checks.evaluate((&u.desired, &u.wrench), (x, tau), count_from, &mut values);
        noted.numbers.extend(values);
        noted
    }
}
