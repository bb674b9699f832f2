//! Python warnings that name the caller's line, and the check of positions against joint limits.

use crate::arrays::flag;
use crate::errors::{Failure, input_error};
use crate::interrupts::long;
use armlet_core::arm::{Arm, Outside};
use armlet_core::simulate::Problem;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;

/// The largest number of call frames that are searched for code outside of armlet.
const MOST_FRAMES: usize = 64;

/// Issue a `UserWarning` with the line of the innermost call frame outside of armlet.
pub fn warn(py: Python<'_>, text: String) -> PyResult<()> {
    let sys = py.import("sys")?;
    let mut level = 0;
    while level < MOST_FRAMES {
        level += 1;
        let Ok(frame) = sys.call_method1("_getframe", (level - 1,)) else { break };
        let name = frame.getattr("f_globals")?.get_item("__name__").map(|name| name.to_string()).unwrap_or_default();
        if name.split('.').next() != Some("armlet") {
            break;
        }
    }
    let text = std::ffi::CString::new(text).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, level as i32)
}

/// The action for a position outside of the joint limits.
#[derive(Clone, Copy, PartialEq)]
pub enum LimitCheck {
    Warn,
    Refuse,
    Ignore,
}

impl LimitCheck {
    /// Read the argument `check_limits`: None warns, True raises an error, and False does neither.
    pub fn of(function: &str, value: Option<&Bound<'_, PyAny>>) -> Result<Self, Failure> {
        let Some(value) = value else { return Ok(LimitCheck::Warn) };
        Ok(if flag(function, "check_limits", value)? { LimitCheck::Refuse } else { LimitCheck::Ignore })
    }

    /// Check the positions `values`, `(.., n)`, of an argument against the joint limits of `arm`. With `of_rows` the message names the row.
    pub fn rows(self, py: Python<'_>, function: &str, argument: &str, arm: &Arm, values: &[f64], of_rows: bool) -> Result<(), Failure> {
        if self == LimitCheck::Ignore {
            return Ok(());
        }
        let found = long(py, || Ok(Outside::first(values.chunks_exact(arm.n().max(1)).map(|row| (arm, row)))))?;
        self.warn(py, function, found.map(|found| (format!("{argument}{}", found.index(of_rows)), found)))
    }

    /// Check the starts of a problem, and the joint targets of its laws, against joint limits.
    pub fn problem(self, py: Python<'_>, function: &str, problem: &Problem<'_>, batch: bool) -> Result<(), Failure> {
        if self == LimitCheck::Ignore {
            return Ok(());
        }
        let found = long(py, || Ok(problem.outside(batch)))?;
        self.warn(py, function, found)
    }

    /// Issue one warning for all positions in `found`, or return an error for the first position.
    fn warn(self, py: Python<'_>, function: &str, found: impl IntoIterator<Item = (String, Outside)>) -> Result<(), Failure> {
        if self == LimitCheck::Ignore {
            return Ok(());
        }
        let mut lines = Vec::new();
        for (name, outside) in found {
            if self == LimitCheck::Refuse {
                return Err(input_error(py, function, &name, outside.problem()).into());
            }
            lines.push(format!("{name} {}", outside.problem()));
        }
        if lines.is_empty() {
            return Ok(());
        }
        Ok(warn(py, format!("{function}: {}; check_limits=True refuses this, False allows it", lines.join("; ")))?)
    }
}
