//! The control loop around a law that is printed as C.

use crate::error::{Error, Result, positive};
use crate::law::LawSpec;

/// The settings of the sampled loop that the C code reproduces bit by bit.
///
/// ```
/// # use armlet_core::arm::Arm;
/// use armlet_core::law::{CLoop, Gain, LawSpec, PdGravitySpec};
/// use armlet_core::trace::c::COptions;
/// # let arm = Arm::pendulum(2.0, 5.0)?;
///
/// let law = PdGravitySpec::new(arm.into(), vec![0.5], Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?)?;
/// let law = LawSpec::from(law);
/// let files = |timing: &CLoop| law.export_c(&COptions::new("law"), timing);
/// let limits = |tau_max: Vec<f64>| CLoop { tau_max: Some(tau_max), ..CLoop::default() };
/// assert_ne!(files(&limits(vec![8.0]))?[1].text, files(&CLoop::default())?[1].text);
/// // The arm has one joint, not two.
/// assert!(files(&limits(vec![8.0, 8.0])).is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CLoop {
    /// Step of the law's state, s. `None`: one step covers the time between two calls.
    pub dt: Option<f64>,
    /// Sample time, s, for laws that require it. `None` means `dt`.
    pub sample_time: Option<f64>,
    /// Whether a step uses the method rk4; otherwise it uses the method euler.
    pub rk4: bool,
    /// Limits of the plant's input, `(n,)`, N m or N; `None` means no limits.
    pub tau_max: Option<Vec<f64>>,
}

impl Default for CLoop {
    fn default() -> Self {
        CLoop { dt: None, sample_time: None, rk4: true, tau_max: None }
    }
}

impl CLoop {
    /// Validate the loop. Return the sample time, if the law requires it, and the limits.
    pub(super) fn checked(&self, law: &LawSpec) -> Result<(Option<f64>, &[f64])> {
        for (name, value) in [("dt", self.dt), ("sample_time", self.sample_time)] {
            value.map_or(Ok(()), |value| positive(name, value))?;
        }
        let (n, limits) = (law.model().n(), self.tau_max.as_deref().unwrap_or_default());
        if !limits.is_empty() && limits.len() != n {
            return Err(Error::wrong_shape("tau_max", &[n], &[limits.len()]));
        }
        if let Some(i) = limits.iter().position(|&limit| !(limit > 0.0)) {
            let error = Error::input("tau_max", format!("is not positive: expected > 0, got {}", limits[i])).at([i]);
            return Err(law.model().name_limit(error));
        }
        match self.sample_time.or(self.dt) {
            _ if !law.samples() => Ok((None, limits)),
            None if law.initial_state().is_empty() => Err(Error::input(
                "sample_time",
                format!("is missing: expected the time between calls, which {} needs, got None", law.name()),
            )),
            None => Err(Error::input("dt", format!("is missing: expected the sample time, which {} needs, got None", law.name()))),
            period => Ok((period, limits)),
        }
    }
}
