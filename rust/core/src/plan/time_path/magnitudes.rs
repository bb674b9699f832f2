//! The magnitudes that count as zero and as unlimited.

/// A number larger than every squared path speed: the cap where no speed limit exists.
pub(super) const FASTEST: f64 = 1e60;
/// A coefficient of `u` with a smaller absolute value counts as zero.
pub(super) const NONE: f64 = 1e-140;
/// The value of a bound of `u` that never limits.
pub(super) const FAR: f64 = 1e200;
