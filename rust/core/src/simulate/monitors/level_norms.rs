//! Norms of error and residual for each level of a law with task priorities. The law is evaluated again at the records. A *stack* is the
//! list of the tasks of all levels. It is *regular* if no level is near a singularity.

use crate::law::{Law, LawSpec, PriorityAcceleration, PriorityVelocity, Solve};
use crate::scalar::Real;

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

/// Computes the norms of error and residual of each level. With plain numbers, the solver has all its algorithms. With recorded values, it
/// has only the algorithm for regular stacks.
pub struct LevelNorms<P: Solve> {
    law: PriorityLaw<P>,
    u: Vec<P::Number>,
}

enum PriorityLaw<P: Solve> {
    Velocity(Box<PriorityVelocity<P>>),
    Acceleration(Box<PriorityAcceleration<P>>),
}

impl<P: Solve> LevelNorms<P> {
    /// Return the computation of the norms of error and residual of a law's levels. The result is `None` without levels, or if the solver
    /// of type `P` does not exist for this law.
    pub fn of(law: &LawSpec) -> Option<Self> {
        let engine = match law {
            LawSpec::PriorityVelocity(spec) => PriorityLaw::Velocity(Box::new(spec.engine()?)),
            LawSpec::PriorityAcceleration(spec) => PriorityLaw::Acceleration(Box::new(spec.engine()?)),
            _ => return None,
        };
        Some(LevelNorms { law: engine, u: vec![P::Number::zero(); law.model().n()] })
    }

    /// Compute as many norms as `out` has elements, at plant state `x` with the sines and cosines `trig`. The result is one if the norms
    /// are valid, and zero if the solver requires another algorithm. It is `None` if the norms are always valid.
    pub fn evaluate(
        &mut self,
        desired: &[P::Number],
        trig: &[(P::Number, P::Number)],
        x: &[P::Number],
        out: &mut [P::Number],
    ) -> Option<P::Number> {
        let LevelNorms { law, u } = self;
        match law {
            PriorityLaw::Velocity(law) => {
                law.evaluate(desired, trig, x, &[], u, &mut []);
                law.norms(out);
                law.stands()
            }
            PriorityLaw::Acceleration(law) => {
                law.evaluate(desired, trig, x, &[], u, &mut []);
                law.norms(out);
                law.stands()
            }
        }
    }
}
