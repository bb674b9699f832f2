//! Norms of error and residual for each level of a law with task priorities. The law is evaluated again at the records.

use crate::law::{Law, LawSpec, PriorityAcceleration, PriorityVelocity};
use crate::scalar::Real;
use crate::trace::Sym;

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

/// Computes the norms of error and residual of each level.
pub enum LevelNorms {
    Velocity(Box<PriorityVelocity>, Vec<Sym>),
    Acceleration(Box<PriorityAcceleration>, Vec<Sym>),
}

impl LevelNorms {
    /// Return the computation of the norms of error and residual of a law's levels. The result is `None` without levels.
    pub fn of(law: &LawSpec) -> Option<Self> {
        let u = vec![Sym::zero(); law.model().n()];
        match law {
            LawSpec::PriorityVelocity(spec) => Some(LevelNorms::Velocity(Box::new(spec.build()), u)),
            LawSpec::PriorityAcceleration(spec) => Some(LevelNorms::Acceleration(Box::new(spec.build()), u)),
            _ => None,
        }
    }

    /// Compute as many norms as `out` has elements, at plant state `x` with the sines and cosines `trig`.
    pub fn evaluate(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], out: &mut [Sym]) {
        match self {
            LevelNorms::Velocity(law, u) => {
                law.evaluate(desired, trig, x, &[], u, &mut []);
                law.norms(out);
            }
            LevelNorms::Acceleration(law, u) => {
                law.evaluate(desired, trig, x, &[], u, &mut []);
                law.norms(out);
            }
        }
    }
}
