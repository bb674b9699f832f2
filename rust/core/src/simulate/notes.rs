//! What a record holds beside the state, as operations on the state, for the recording of a loop: the input and the monitors.
//!
//! Monitors round as plain `f64` does, so that a record of a program has the bits of one that is computed directly.

use super::identities::Balances;
use super::monitors;
use super::problem::Problem;
use super::schedule::Times;
use crate::law::LawSpec;
use crate::trace::{Sym, sym};

/// Numbers of the first record from which monitors count.
pub const FIRSTS: usize = 2;

/// The entries of a record.
pub struct Noted {
    pub numbers: Vec<Sym>,
    /// What monitors count from if this is the first record.
    pub firsts: Vec<Sym>,
}

pub struct Notes {
    balances: Option<Balances<Sym>>,
    monitors: usize,
}

impl Problem<'_> {
    /// Whether the programs of its loops can note all that a record needs: at steps, by monitors without a branch on data.
    pub fn notes_in_programs(&self) -> bool {
        let levels = |law: &LawSpec| matches!(law, LawSpec::PriorityVelocity(_) | LawSpec::PriorityAcceleration(_));
        let alone = self.watches_target() || self.laws.iter().any(|law| levels(law));
        self.measures.is_none() && matches!(self.options.times, Times::Every(_)) && !(self.options.monitors && alone)
    }
}

impl Notes {
    /// For the run `run` of a problem.
    pub fn new(problem: &Problem, run: usize, storage: bool) -> Self {
        let (plant, law) = (problem.plant(run), problem.law(run));
        let monitors = monitors::names(problem).len();
        Notes { balances: (monitors > 0).then(|| Balances::new(|_| plant, |_| law, storage)), monitors }
    }

    /// Monitors, and the numbers from which they count.
    pub fn sizes(&self) -> (usize, usize) {
        (self.monitors, if self.monitors > 0 { FIRSTS } else { 0 })
    }

    /// The record of the state `x` under the desired motions and the input `tau`; `firsts`: [`Noted::firsts`] of the first one.
    pub fn take(&mut self, desired: &[Sym], x: &[Sym], tau: &[Sym], firsts: &[Sym]) -> Noted {
        let mut noted = Noted { numbers: tau.to_vec(), firsts: Vec::new() };
        if let (Some(balances), &[energy, lyapunov]) = (&mut self.balances, firsts) {
            let mut values = vec![Sym::default(); self.monitors];
            sym::unfused(|| {
                balances.theory.arm.move_to(&x[..tau.len()]);
                let count_from = |own: [Sym; 2]| {
                    noted.firsts = own.to_vec();
                    [energy, lyapunov]
                };
                balances.evaluate(desired, x, count_from, &mut values);
            });
            noted.numbers.extend(values);
        }
        noted
    }
}
