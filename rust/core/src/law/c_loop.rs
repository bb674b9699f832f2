//! The loop around a law that is written as C.

use super::LawSpec;
use crate::error::{Error, Result, positive};

/// The sampled loop whose bits a law in C has.
#[derive(Clone, Debug, PartialEq)]
pub struct CLoop {
    /// The step by which the law's own state advances, s; `None`: the time between two calls is one step.
    pub dt: Option<f64>,
    /// The sample time, s, for laws that need it; `None`: `dt`.
    pub sample_time: Option<f64>,
    /// Whether a step is one of rk4; else one of euler.
    pub rk4: bool,
    /// The limits of the input, `(n,)`; `None`: no limits.
    pub tau_max: Option<Vec<f64>>,
}

impl Default for CLoop {
    fn default() -> Self {
        CLoop { dt: None, sample_time: None, rk4: true, tau_max: None }
    }
}

impl CLoop {
    /// The sample time that a law needs, and the limits; refuses those that no loop has.
    pub(super) fn checked(&self, law: &LawSpec) -> Result<(Option<f64>, &[f64])> {
        for (name, value) in [("dt", self.dt), ("sample_time", self.sample_time)] {
            value.map_or(Ok(()), |value| positive(name, value))?;
        }
        let (n, limits) = (law.model().n(), self.tau_max.as_deref().unwrap_or_default());
        if !limits.is_empty() && limits.len() != n {
            return Err(Error::wrong_shape("tau_max", &[n], &[limits.len()]));
        }
        if let Some(i) = limits.iter().position(|&limit| !(limit > 0.0)) {
            return Err(Error::input("tau_max", format!("is not positive: expected > 0, got {}", limits[i])).at([i]));
        }
        match self.sample_time.or(self.dt) {
            _ if !law.samples() => Ok((None, limits)),
            None => Err(Error::input("dt", format!("is missing: expected the sample time, which {} needs, got None", law.name()))),
            period => Ok((period, limits)),
        }
    }
}
