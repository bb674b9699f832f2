//! Norms of error and residual for each level of a law with task priorities, from the terms of the law. With bounds, there are also the norms
//! of the violations, and the residual of the optimality conditions (Karush, Kuhn and Tucker). With torque limits, there is the norm of the
//! violations of joint limits.

use crate::law::{self, LawSpec, Route, Terms};
use crate::scalar::Real;
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

/// The names of the norms of violations.
const VIOLATIONS: [&str; 8] =
    ["violation_1", "violation_2", "violation_3", "violation_4", "violation_5", "violation_6", "violation_7", "violation_8"];

/// Whether a law has a certificate: its stack has bounds.
fn is_certified(law: &LawSpec) -> bool {
    matches!(law, LawSpec::PriorityVelocity(_) | LawSpec::PriorityAcceleration(_))
        && matches!(law.route(), Route::Bounded | Route::Deciding)
}

/// Whether torque limits of a law can contradict its joint limits, which are then violated.
fn has_contradictions(law: &LawSpec) -> bool {
    matches!(law, LawSpec::PriorityAcceleration(law) if law.limit_rows().len() > 1)
}

/// Return the names of the norms of a law's levels. A guarded law has no norms, because its levels change at contact.
pub fn names(law: &LawSpec) -> Vec<&'static str> {
    let levels = match law {
        LawSpec::PriorityVelocity(_) | LawSpec::PriorityAcceleration(_) => law.level_rows().len().min(VIOLATIONS.len()),
        _ => return Vec::new(),
    };
    let mut all = NAMES[..2 * levels].to_vec();
    if is_certified(law) {
        all.extend(&VIOLATIONS[..levels]);
        all.push("kkt");
    }
    if has_contradictions(law) {
        all.push("violation_0");
    }
    all
}

/// The norms of [`names`] for `law`, from its terms.
pub fn norms(law: &LawSpec, terms: &Terms) -> Vec<E> {
    let mut all = law::norms(&law.level_rows(), terms.get("e").as_slice(), terms.get("residuals").as_slice());
    all.truncate(NAMES.len());
    if is_certified(law) {
        // A residual is a violation with the opposite sign.
        let violations: Vec<E> = all.iter().skip(1).step_by(2).copied().collect();
        all.extend(violations);
        all.extend(terms.get("certificate").as_slice());
    }
    if has_contradictions(law) {
        all.push(terms.get("limit_violations").iter().fold(E::zero(), |sum, x| sum + *x * *x).sqrt());
    }
    all
}
