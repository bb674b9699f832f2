//! The settings of a solver: the options, checked and in the form of the algorithms.

use super::method::{DEFAULT_ROUNDING, PriorityMethod, PriorityOptions};
use super::metric::Metric;
use crate::error::{Error, Result, positive};

#[derive(Debug, Clone)]
pub(super) struct Settings {
    pub method: PriorityMethod,
    /// The threshold of each level, in the unit of the level's Jacobian.
    pub eps: Option<Vec<f64>>,
    /// The relative error of the entries of the Jacobians.
    pub rounding: f64,
    pub metric: Option<Metric>,
    /// Whether each command has a scale, so that its direction is kept.
    pub scales: bool,
    /// For each level, whether it has bounds in place of a task velocity. Empty if no level has.
    pub intervals: Vec<bool>,
    /// The number of first levels whose steps are not damped.
    pub limit_levels: usize,
    /// The lower and upper bounds of the joint velocities.
    pub bounds: Option<(Vec<f64>, Vec<f64>)>,
}

impl Settings {
    /// Check the options for `n` joints and a number of levels. Errors: as for [`PrioritySolver::new`](super::PrioritySolver::new).
    pub fn new(n: usize, levels: usize, options: &PriorityOptions) -> Result<Self> {
        let eps = match options.eps.as_deref() {
            None => None,
            Some([one]) => Some(vec![*one; levels]),
            Some(each) if each.len() == levels => Some(each.to_vec()),
            Some(each) => return Err(Error::wrong("eps", "length", format!("1 or {levels}"), each.len())),
        };
        eps.iter().flatten().try_for_each(|e| positive("eps", *e))?;
        let metric = options.weight.as_ref().map(|weight| Metric::new(weight, n)).transpose()?;
        let limited = options.v_min.is_some() || options.v_max.is_some() || options.intervals.contains(&true);
        if limited && !options.method.accepts_bounds() {
            let problem = format!("is wrong: expected clamp, damped, exact or sns for a stack with bounds, got {}", options.method.name());
            return Err(Error::input("method", problem));
        }
        let scales = options.scales_commands();
        if scales && !options.method.keeps_direction() {
            let problem = format!("has no use: expected the methods exact and sns for a kept direction, got {}", options.method.name());
            return Err(Error::input("scale", problem));
        }
        if ![0, levels].contains(&options.intervals.len()) {
            return Err(Error::wrong("intervals", "length", format!("0 or {levels}"), options.intervals.len()));
        }
        let intervals = if options.intervals.contains(&true) { options.intervals.clone() } else { Vec::new() };
        let mut settings = Settings {
            method: options.method,
            eps,
            rounding: 0.0,
            metric,
            scales,
            intervals,
            limit_levels: options.limit_levels,
            bounds: None,
        };
        settings.set_rounding(options.rounding.unwrap_or(DEFAULT_ROUNDING))?;
        let (low, high) = match options.velocity_bounds() {
            Some(bounds) => bounds,
            None if options.method != PriorityMethod::Sns => return Ok(settings),
            None => {
                return Err(Error::input(
                    "v_max",
                    format!("is missing: expected velocity bounds of shape ({n},) for method sns, got None"),
                ));
            }
        };
        settings.bounds = Some((vec![0.0; n], vec![0.0; n]));
        settings.set_bounds(&low, &high)?;
        Ok(settings)
    }

    /// Whether solutions that meet no bound have a certificate. Without bounds, and for `sns`, they have none.
    pub fn certifies(&self) -> bool {
        !self.method.has_bounds() && (self.bounds.is_some() || !self.intervals.is_empty())
    }

    /// Set the relative error of the entries. Errors: `Input` outside of `[0, 1)`.
    pub fn set_rounding(&mut self, rounding: f64) -> Result<()> {
        if !(0.0..1.0).contains(&rounding) {
            return Err(Error::input("rounding", format!("is not a relative error: expected 0 <= rounding < 1, got {rounding}")));
        }
        self.rounding = rounding;
        Ok(())
    }

    /// Set the thresholds of `levels` levels. Errors: `WrongShape` for a wrong length, `Input` for a threshold that is not positive.
    pub fn set_eps(&mut self, levels: usize, eps: &[f64]) -> Result<()> {
        if eps.len() != levels {
            return Err(Error::wrong("eps", "length", levels, eps.len()));
        }
        eps.iter().try_for_each(|e| positive("eps", *e))?;
        match &mut self.eps {
            Some(own) => own.copy_from_slice(eps),
            None => self.eps = Some(eps.to_vec()),
        }
        Ok(())
    }

    /// Set the bounds. Errors: as for [`PrioritySolver::set_bounds`](super::PrioritySolver::set_bounds).
    pub fn set_bounds(&mut self, v_min: &[f64], v_max: &[f64]) -> Result<()> {
        let Some((lower, upper)) = &mut self.bounds else {
            return Err(Error::input("v_max", "has no use: expected a solver that was created with bounds"));
        };
        let n = lower.len();
        for (name, x) in [("v_min", v_min), ("v_max", v_max)] {
            if x.len() != n {
                return Err(Error::wrong(name, "length", n, x.len()));
            }
        }
        // The condition is not `v_min > v_max`, because NaN must also be refused. Bounds that allow no finite velocity are refused, too.
        let ordered = |l: f64, u: f64| l <= u && l < f64::INFINITY && u > f64::NEG_INFINITY;
        if let Some(i) = (0..n).find(|&i| !ordered(v_min[i], v_max[i])) {
            return Err(
                Error::input("v_min", format!("is out of order: expected v_min <= v_max, got {} and {}", v_min[i], v_max[i])).at([i])
            );
        }
        lower.copy_from_slice(v_min);
        upper.copy_from_slice(v_max);
        Ok(())
    }
}
