//! A law in a recording.

use super::LawSpec;
use super::equations::{Answer, Equations, Loop};
use crate::plant::Parameters;
use crate::trace::expression::{vector, zeros};
use crate::trace::sym::NamedTerm;
use crate::trace::{E, V, sym};

/// The named intermediate results of one evaluation of a law.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, LawSpec, PdGravitySpec, RecordedLaw};
/// use armlet_core::trace::function::recorded;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let [kp, kd] = [Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?];
/// # let law = LawSpec::from(PdGravitySpec::new(model, vec![0.5], kp, kd)?);
///
/// let error = |control: RecordedLaw, x: &[_]| control.terms(&law.desired(0.0), x, &[]).get("e").as_slice().to_vec();
/// let mut e = recorded(2, || RecordedLaw::continuous(&law), error).expect("a law does not branch").interpreted(false);
/// e.all_inputs().copy_from_slice(&[0.3, 0.1]);
/// e.run();
/// assert_eq!(e.output(0), [0.5 - 0.3]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Terms(Vec<NamedTerm>);

impl Terms {
    /// The values of the term `name`, row by row; empty if the law has no such term.
    pub fn get(&self, name: &str) -> V {
        self.0.iter().find(|(known, ..)| *known == name).map_or_else(|| zeros(0), |(.., values)| vector(values))
    }
}

/// A law in a recording. Its numbers are inputs, and each evaluation records its equations.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, LawSpec, PdGravitySpec, RecordedLaw};
/// use armlet_core::trace::function::recorded;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let law = PdGravitySpec::new(model, vec![0.5], Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?)?;
/// # let law = LawSpec::from(law);
///
/// // The law as a function of position and velocity.
/// let input = |control: RecordedLaw, x: &[_]| control.answer(&law.desired(0.0), x, &[]).tau.as_slice().to_vec();
/// let mut tau = recorded(2, || RecordedLaw::continuous(&law), input).expect("a law does not branch").interpreted(false);
/// tau.all_inputs().copy_from_slice(&[0.3, 0.1]);
/// tau.run();
/// assert!((tau.output(0)[0] - (20.0 * 0.2 - 4.0 * 0.1 + 5.0 * 0.3f64.sin())).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct RecordedLaw<'a> {
    law: &'a LawSpec,
    numbers: Parameters,
    tau_max: V,
}

impl<'a> RecordedLaw<'a> {
    /// Record the numbers of `law`. `period` is the sample period of the loop, s, if it has one. `tau_max` are the limits of the plant's
    /// input, `(n,)` or empty.
    pub fn new(law: &'a LawSpec, period: Option<f64>, tau_max: V) -> Self {
        RecordedLaw { law, numbers: law.parameters(period), tau_max }
    }

    /// The law with its recorded numbers.
    pub fn with(law: &'a LawSpec, numbers: Parameters, tau_max: V) -> Self {
        RecordedLaw { law, numbers, tau_max }
    }

    /// The law in a continuous loop without limits.
    pub fn continuous(law: &'a LawSpec) -> Self {
        RecordedLaw::new(law, None, zeros(0))
    }

    /// The answer to the desired motions, one after another, at the plant's state `x` and the law's state `z`.
    pub fn answer(&self, desired: &[E], x: &[E], z: &[E]) -> Answer {
        self.at(desired, x, z, |law, at| law.equations(at))
    }

    /// The named intermediate results of [`RecordedLaw::answer`].
    pub fn terms(&self, desired: &[E], x: &[E], z: &[E]) -> Terms {
        sym::collect_terms();
        self.answer(desired, x, z);
        Terms(sym::terms())
    }

    /// The law's state `z` after its filters start at the plant's state `x`.
    pub fn restart(&self, x: &[E], z: &[E]) -> V {
        let nothing = zeros(self.law.motions().iter().map(|motion| 3 * motion.dof()).sum());
        self.at(nothing.as_slice(), x, z, |law, at| law.start_state(at))
    }

    fn at<T>(&self, desired: &[E], x: &[E], z: &[E], f: impl FnOnce(&LawSpec, &Loop) -> T) -> T {
        let samples = self.law.split_samples(desired);
        let at = Loop::new(&self.numbers, (&samples, &self.tau_max), self.law.model().n(), x, z);
        sym::contract(|| f(self.law, &at))
    }
}
