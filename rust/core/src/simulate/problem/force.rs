//! External wrenches as functions of time: constant, piecewise constant, or any function.

use crate::error::{Error, Result, finite};
use std::sync::Arc;

/// A wrench `[f; m]` at the frame of the force, in world axes: force, N, and moment, N m.
pub type Wrench = [f64; 6];

/// A wrench as a function of time, s. The result `None` stops the run.
type WrenchSignal = Arc<dyn Fn(f64) -> Option<Wrench> + Send + Sync>;

/// An external force during a run.
///
/// ```
/// use armlet_core::simulate::Force;
/// use std::sync::Arc;
///
/// // 5 N along x from 0.1 s to 0.3 s.
/// let push = [5.0, 0.0, 0.0, 0.0, 0.0, 0.0];
/// let steps = Force::steps(vec![0.1, 0.3], vec![push, [0.0; 6]])?;
/// assert_eq!((steps.at(0.0), steps.at(0.2), steps.at(0.4)), ([0.0; 6], push, [0.0; 6]));
/// assert_eq!(steps.breaks(), [0.1, 0.3]);
/// let signal = Force::Signal(Arc::new(|t| Some([5.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0])));
/// assert_eq!(signal.at(0.5)[0], 2.5);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone)]
pub enum Force {
    /// The wrench is `values[i]` from time `starts[i]` on. Before the first time it is zero.
    Steps {
        /// Times, s, increasing.
        starts: Vec<f64>,
        /// Wrenches, one per time.
        values: Vec<Wrench>,
    },
    /// A function of the user.
    Signal(WrenchSignal),
}

impl std::fmt::Debug for Force {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Force::Steps { starts, values } => write!(f, "Steps({starts:?}, {values:?})"),
            Force::Signal(_) => f.write_str("Signal"),
        }
    }
}

impl Force {
    /// Return a force with the wrenches `values` from the increasing times `starts`, s. Errors: [`Error::Input`] if the numbers of times
    /// and wrenches differ, if times do not increase, or if a number is not finite.
    pub fn steps(starts: Vec<f64>, values: Vec<Wrench>) -> Result<Self> {
        if values.len() != starts.len() {
            let problem = format!("has the wrong number of wrenches: expected {}, one per time, got {}", starts.len(), values.len());
            return Err(Error::input("force", problem));
        }
        finite("force", &starts)?;
        if let Some(i) = (1..starts.len()).find(|&i| starts[i] <= starts[i - 1]) {
            let (last, bad) = (starts[i - 1], starts[i]);
            return Err(Error::input("force", format!("is not in order of time: expected > {last}, got {bad}")).at([i]));
        }
        for (i, value) in values.iter().enumerate() {
            if value.iter().any(|x| !x.is_finite()) {
                return Err(Error::input("force", format!("is not finite: expected finite numbers, got {value:?}")).at([i]));
            }
        }
        Ok(Force::Steps { starts, values })
    }

    /// The times at which the wrench jumps, s.
    pub fn breaks(&self) -> &[f64] {
        match self {
            Force::Steps { starts, .. } => starts,
            Force::Signal(_) => &[],
        }
    }

    /// Return the wrench of a force that is constant from the start of a run.
    pub fn constant(&self) -> Option<Wrench> {
        match self {
            Force::Steps { starts, values } if matches!(starts[..], [start] if start <= 0.0) => values.first().copied(),
            Force::Steps { .. } | Force::Signal(_) => None,
        }
    }

    /// Return the wrench at time `t`, s. It is NaN if the function returned `None`.
    pub fn at(&self, t: f64) -> Wrench {
        match self {
            Force::Steps { starts, values } => match starts.partition_point(|&s| s <= t) {
                0 => [0.0; 6],
                i => values[i - 1],
            },
            Force::Signal(call) => call(t).unwrap_or([f64::NAN; 6]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_require_one_wrench_per_time() {
        for wrenches in [1, 3] {
            let error = Force::steps(vec![0.0, 1.0], vec![[0.0; 6]; wrenches]).unwrap_err().to_string();
            assert_eq!(error, format!("force has the wrong number of wrenches: expected 2, one per time, got {wrenches}"));
        }
        assert!(Force::steps(vec![0.0, 1.0], vec![[0.0; 6]; 2]).is_ok());
    }
}
