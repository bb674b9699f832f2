//! Checks of the sizes of a law's parameters.

use crate::error::{Error, Result};
use crate::linalg::Gain;
use crate::motion::Motion;

pub(super) fn require_same_dof(n: usize, motion: &Motion) -> Result<()> {
    require_rows("motion", n, motion.dof())
}

pub(super) fn require_rows(argument: &str, n: usize, got: usize) -> Result<()> {
    if got == n {
        return Ok(());
    }
    Err(Error::wrong(argument, "number of joints", n, got))
}

pub(super) fn require_size(argument: &str, gain: &Gain, n: usize) -> Result<()> {
    if gain.n() == n {
        return Ok(());
    }
    Err(Error::wrong(argument, "size", n, gain.n()))
}
