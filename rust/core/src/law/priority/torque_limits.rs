//! Torque limits of a law of accelerations: a level of rows `-tau_max - h <= M a <= tau_max - h` above all others, with `h = C v + g`.
//!
//! A bound of the accelerations may require a torque beyond its limit, so that both contradict each other. So these bounds are the rows
//! `low <= a <= high` of the second level, which is then missed as little as possible.

use super::tasks::Rows;
use crate::error::{Error, Result};
use crate::law::equations::Loop;
use crate::priority::{DEFAULT_EPS, PriorityMethod, PriorityOptions};
use crate::scalar::Real;
use crate::trace::expression::{stacked, zeros};
use crate::trace::{E, V};

/// The torque limits of a law, and whether its accelerations have bounds.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TorqueLimits {
    tau_max: Vec<f64>,
    bounds_accelerations: bool,
}

impl TorqueLimits {
    /// Create the limits of `n` joints. Errors: `WrongShape` for a wrong length, `Input` for a limit that is not positive, or a method
    /// without bounds.
    pub fn new(tau_max: Vec<f64>, n: usize, bounds_accelerations: bool, method: PriorityMethod) -> Result<Self> {
        if tau_max.len() != n {
            return Err(Error::wrong("tau_max", "length", n, tau_max.len()));
        }
        if let Some(i) = tau_max.iter().position(|limit| !(*limit > 0.0)) {
            return Err(Error::input("tau_max", format!("is not positive: expected tau_max > 0, got {}", tau_max[i])).at([i]));
        }
        method.require_bounds("tau_max")?;
        Ok(TorqueLimits { tau_max, bounds_accelerations })
    }

    /// The limits, `(n,)`, N m or N.
    pub fn tau_max(&self) -> &[f64] {
        &self.tau_max
    }

    /// The number of rows of each level.
    pub fn rows(&self) -> Vec<usize> {
        vec![self.tau_max.len(); 1 + usize::from(self.bounds_accelerations)]
    }

    /// Add the levels to the options of a solver, above its `count` levels.
    pub fn add_levels(&self, options: &mut PriorityOptions, count: usize) {
        let levels = self.rows().len();
        if options.intervals.is_empty() {
            options.intervals = vec![false; count];
        }
        options.intervals.splice(0..0, vec![true; levels]);
        if let Some(eps) = options.eps.as_mut().filter(|eps| eps.len() == count) {
            // Limits are not damped, so that their thresholds have no effect.
            eps.splice(0..0, vec![DEFAULT_EPS; levels]);
        }
        options.limit_levels = levels;
        // The method `Sns` requires bounds, which are infinite.
        if options.method != PriorityMethod::Sns {
            (options.v_min, options.v_max) = (None, None);
        }
    }

    /// Put the rows of the limits above those of the tasks. Return their number, all rows, and the remaining bounds of the accelerations.
    pub fn above(&self, at: &Loop, own: Rows, bounds: Option<[V; 2]>) -> (usize, Rows, Option<[V; 2]>) {
        let (n, total) = (self.tau_max.len(), own.command.len());
        let (tau_max, h) = (at.numbers().get_numbers("tau_max"), at.arm().bias(&at.v));
        let (count, own_distances) = (self.rows().iter().sum(), own.distances);
        let mut j = own.j.insert_rows(0, count, E::zero());
        j.rows_mut(0, n).copy_from(&at.arm().mass_matrix());
        if count > n {
            j.rows_mut(n, n).fill_with_identity();
        }
        let mut torques = [-tau_max - &h, tau_max - &h];
        if let Some(bounds) = bounds {
            bounds.iter().zip(["lower", "upper"]).for_each(|(bound, name)| drop(at.term(name, bound.clone())));
            torques.iter_mut().zip(&bounds).for_each(|(torque, bound)| *torque = stacked([&*torque, bound]));
        }
        let sides = torques.into_iter().zip(own_distances);
        let mut distances = sides.map(|(limit, own)| stacked([&limit, &if own.is_empty() { zeros(total) } else { own }]));
        let mut side = || distances.next().unwrap_or_else(|| zeros(0));
        (count, Rows { j, command: stacked([&zeros(count), &own.command]), distances: [side(), side()] }, None)
    }
}
