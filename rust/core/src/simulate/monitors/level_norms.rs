//! Norms of error and residual for each level of a law with task priorities, from the terms of the law.

use crate::law::{self, LawSpec, Terms};
use crate::trace::E;

/// The names of the norms. Levels after the eighth have no norms.
const NAMES: [&str; 16] = [
    "error_1",
    "residual_1",
    "error_2",
    "residual_2",
    "error_3",
    "residual_3",
    "error_4",
    "residual_4",
    "error_5",
    "residual_5",
    "error_6",
    "residual_6",
    "error_7",
    "residual_7",
    "error_8",
    "residual_8",
];

/// Return the names of the norms of a law's levels. A guarded law has no norms, because its levels change at contact.
pub fn names(law: &LawSpec) -> &'static [&'static str] {
    match law {
        LawSpec::PriorityVelocity(_) | LawSpec::PriorityAcceleration(_) => &NAMES[..NAMES.len().min(2 * law.levels().len())],
        _ => &[],
    }
}

/// The norms of error and residual of each level of `law`, from its terms.
pub fn norms(law: &LawSpec, terms: &Terms) -> Vec<E> {
    law::norms(&law.level_rows(), terms.get("e").as_slice(), terms.get("residuals").as_slice())
}
