//! A cache of the recorded functions of arms at rest. Repeated analyses with equal arguments record nothing.

use crate::law::LawSpec;
use crate::linalg::Gain;
use crate::plant::PlantSpec;
use crate::trace::Jacobian;
use crate::trace::cache::Cache;
use crate::trace::function::Recorded;
use crate::trace::jacobian::STORED_OPERATIONS;
use std::sync::Arc;

/// A plant at rest, with its law and an external wrench.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// use armlet_core::analysis::equilibrium_problem::EquilibriumProblem;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let plant = PlantSpec::from(RigidSpec::new(model.clone()));
///
/// let law = LawSpec::from(PdGravitySpec::new(model, vec![0.5], Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?)?);
/// let problem = EquilibriumProblem { plant: &plant, law: &law, wrench: [0.0; 6], frame: None };
/// assert!((problem.unbalanced(&[0.3], &[])?.load[0] - 5.0 * 0.3f64.sin()).abs() < 1e-12);
/// let mut q = vec![0.0];
/// problem.descend(&mut q)?;
/// assert!((q[0] - 0.5).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct EquilibriumProblem<'a> {
    /// The plant.
    pub plant: &'a PlantSpec,
    /// A law of the links, or a law of motors.
    pub law: &'a LawSpec,
    /// External wrench `[f; m]`, N and N m, world axes.
    pub wrench: [f64; 6],
    /// Index of the frame at which the wrench acts; `None` for no wrench.
    pub frame: Option<usize>,
}

/// The motor positions in the residual, and the factor of the balance of motor torques.
#[derive(Clone, PartialEq)]
pub(super) enum Motors {
    /// The law does not depend on them.
    Absent,
    /// They are unknowns: the joint stiffness `K`, and the factor `(I + Kt)^-1`.
    Unknown(Gain, Gain),
    /// The springs carry the load: the compliance `K^-1`, and the factor.
    Carrying(Gain, Gain),
}

/// A function of a plant, its law and an external wrench.
#[derive(Clone, PartialEq)]
pub(super) enum Function {
    /// The residual of the arm at rest.
    Residual(Motors),
    /// The rates of the closed loop at this time, s.
    Rates(f64),
}

struct Stored {
    plant: PlantSpec,
    law: LawSpec,
    wrench: [f64; 6],
    frame: Option<usize>,
    function: Function,
    jacobian: Jacobian,
}

static KNOWN: Cache<Arc<Stored>> = Cache::new();

/// Return the stored function with its Jacobian. If it is not stored, record it: `record` returns the function and the number of its results
/// that have derivatives.
pub(super) fn jacobian(
    &EquilibriumProblem { plant, law, wrench, frame }: &EquilibriumProblem,
    function: Function,
    record: impl FnOnce() -> Option<(Recorded, usize)>,
) -> Option<Jacobian> {
    let is = |known: &Arc<Stored>| {
        (known.wrench, known.frame) == (wrench, frame) && known.function == function && known.law == *law && known.plant == *plant
    };
    if let Some(known) = KNOWN.find(is) {
        return Some(known.jacobian.clone());
    }
    let (recorded, moved) = record()?;
    let jacobian = Jacobian::new(recorded, moved);
    let stored = Stored { plant: plant.clone(), law: law.clone(), wrench, frame, function, jacobian: jacobian.clone() };
    KNOWN.store(Arc::new(stored), |all| all.iter().map(|known| known.jacobian.operations()).sum::<usize>() <= STORED_OPERATIONS);
    Some(jacobian)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Arm;
    use crate::dynamics::Model;
    use crate::law::PdGravitySpec;
    use crate::plant::RigidSpec;
    use crate::trace::function::recorded;
    use std::cell::Cell;

    #[test]
    fn equal_arguments_are_recorded_once() {
        let model = Model::from(Arm::pendulum(2.0, 5.0).unwrap());
        let plant = PlantSpec::from(RigidSpec::new(model.clone()));
        let gain = |name: &str, gain: f64| Gain::scalar(name, 1, gain).unwrap();
        let law = |kp: f64| LawSpec::from(PdGravitySpec::new(model.clone(), vec![0.5], gain("kp", kp), gain("kd", 4.0)).unwrap());
        let count = Cell::new(0);
        let record = || {
            count.set(count.get() + 1);
            recorded(1, || (), |(), x| vec![x[0] * x[0]]).map(|recorded| (recorded, 1))
        };
        let recordings = |kp: f64, push: f64, function: Function| {
            let problem = EquilibriumProblem { plant: &plant, law: &law(kp), wrench: [push; 6], frame: Some(0) };
            assert!(jacobian(&problem, function, record).is_some());
            count.get()
        };
        let repeated = Function::Rates(0.125);
        assert_eq!(recordings(20.5, 0.0, repeated.clone()), 1);
        assert_eq!(recordings(20.5, 0.0, repeated.clone()), 1);
        assert_eq!(recordings(20.5, 0.0, Function::Residual(Motors::Absent)), 2);
        assert_eq!(recordings(30.5, 0.0, repeated.clone()), 3, "another gain");
        assert_eq!(recordings(20.5, 1.0, repeated.clone()), 4, "another wrench");
        assert_eq!(recordings(20.5, 0.0, repeated), 4);
    }
}
