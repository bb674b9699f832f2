//! True parameters and friction of the plant in the Lyapunov function of an adaptive law. The law does not know them.
//!
//! `tau_f(v)` is the friction torque of the plant. The law models friction as `Y_f pi_hat_f` in its joint columns, and `pi_f` are the
//! plant's values of these parameters. Rotors that are not estimated have the inertia `B` in the plant and `B_0` in the law's model. Let
//! `pi` be the true parameters, `pi_hat` their estimate, `Y` the regressor, `s` the sliding variable, and `'` the transpose. Then the
//! Lyapunov function `V1` has the rate
//!
//! `V1_dot = -s' Kd s + s' (tau_f(v) - Y_f pi_f + (B - B_0) a_r) + (pi - pi_hat)' (y - w)`,
//!
//! with `y = Y' s` and `pi_hat_dot = Gamma w`. If viscous friction `D` is estimated, its part of the second term is `-s' D s`. If Coulomb
//! friction `F` is estimated, its part is `s' F (sign v - tanh(v_r / v_s))`.

use super::{AdaptiveSpec, JointColumn};
use crate::law::equations::{Adapting, Answer};
use crate::plant::PlantSpec;
use crate::scalar::{labelled_numbers, sign};
use crate::trace::expression::{constant, stacked, vector};
use crate::trace::{E, V};

impl AdaptiveSpec {
    /// The plant's values of the estimated parameters, `(p,)`.
    pub(super) fn truth(&self, plant: &PlantSpec) -> Vec<f64> {
        let parameters = plant.model().parameters();
        let mut truth = self.base.as_ref().map_or(parameters.clone(), |base| base.project(&parameters));
        truth.extend(self.columns.truth(plant.model(), plant.has_friction()));
        truth
    }
}

/// The true parameters of a plant, for the derivative of the Lyapunov function.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// # use armlet_core::plant::{PlantSpec, RigidSpec};
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec, LeakageForm, RecordedLaw, Truth};
/// use armlet_core::trace::expression::vector;
/// use armlet_core::trace::function::recorded;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.0])?, Adaptation::Euclidean(gain(10, 2.0)?));
/// # let plant = PlantSpec::from(RigidSpec::new(model.clone()));
/// # let law = AdaptiveSpec::new(model.clone(), motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
///
/// let law = law.leaking(0.1, LeakageForm::Sigma, None)?;
/// let law = LawSpec::from(law);
/// let set_up = || (law.adaptive().and_then(|law| Truth::new(law, &plant)), RecordedLaw::continuous(&law));
/// let recording = recorded(12, set_up, |(truth, control), inputs| {
///     let (x, z) = inputs.split_at(2);
///     let answer = control.answer(&law.desired(0.0), x, z);
///     truth.map(|truth| truth.dissipation(&answer, None, &vector(&x[1..]), z)).into_iter().collect()
/// });
/// let mut dissipation = recording.expect("a law does not branch on its numbers").interpreted(false);
/// dissipation.all_inputs().copy_from_slice(&[&[0.0, 0.2], &model.parameters()[..]].concat());
/// dissipation.run();
/// // With the true parameters as estimate, the leakage adds nothing to the dissipation s Kd s.
/// assert!((dissipation.output(0)[0] - 10.0 * 0.2 * 0.2).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Truth {
    /// True values `pi` of the estimated parameters, `(p,)`.
    parameters: V,
    /// True values `pi_f` of the estimated friction, one number per joint column, and zero for armature.
    joint_columns: V,
    /// Viscous friction of the plant, `(n,)`.
    viscous: V,
    /// Coulomb friction of the plant, `(n,)`.
    coulomb: V,
    /// The difference `B - B_0` of the rotor inertias, `(n,)`; zeros if they are estimated.
    rotors: V,
}

impl Truth {
    /// The true parameters of `plant`; `None` if the dissipation of the law does not depend on them.
    pub fn new(law: &AdaptiveSpec, plant: &PlantSpec) -> Option<Self> {
        if law.is_plain() {
            return None;
        }
        let parameters = V::from_vec(labelled_numbers("plant", &law.truth(plant)));
        let (model, n) = (plant.model(), plant.n());
        let fixed = |values: Vec<f64>| V::from_iterator(values.len(), values.into_iter().map(constant));
        let [viscous, coulomb] = model.friction(plant.has_friction()).map(fixed);
        let mut joint_columns = law.columns.truth(model, plant.has_friction());
        let rotors = if law.columns.has(JointColumn::Armature) {
            joint_columns[..n].fill(0.0);
            vec![0.0; n]
        } else {
            model.armature().iter().zip(law.model.armature()).map(|(there, known)| there - known).collect()
        };
        Some(Truth { parameters, joint_columns: fixed(joint_columns), viscous, coulomb, rotors: fixed(rotors) })
    }

    /// The rate at which the Lyapunov function decreases on the plant, without the effect of a projection, W. `answer` is that of the law
    /// at the velocity `v` and the law's state `z`. `friction` are the torques of the plant's stick-slip friction, if there is one.
    pub fn dissipation(&self, answer: &Answer, friction: Option<&V>, v: &V, z: &[E]) -> E {
        let Some(Adapting { s, a_r, columns, withheld }) = &answer.adaptation else { return answer.dissipation };
        let tau_f = || self.viscous.component_mul(v) + self.coulomb.component_mul(&v.map(sign));
        let torque = friction.cloned().unwrap_or_else(tau_f) + self.rotors.component_mul(a_r);
        let modelled = stacked(columns).component_mul(&self.joint_columns);
        let unknown = (0..columns.len()).fold(torque, |torque, k| torque - modelled.rows(k * s.len(), s.len()));
        let pi_hat = vector(&z[..self.parameters.len()]);
        answer.dissipation - s.dot(&unknown) - (&self.parameters - pi_hat).dot(withheld)
    }
}
