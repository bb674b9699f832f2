//! True parameters and friction of the plant in the Lyapunov function of an adaptive law. The law does not know them.
//!
//! `tau_f(v)` is the friction torque of the plant. The law models friction as `Y_f a_hat_f` in its joint columns, and `a_f` are the plant's
//! values of these parameters. Rotors that are not estimated have the inertia `B` in the plant and `B_0` in the law's model. Let `a` be the
//! true parameters, `a_hat` their estimate, `Y` the regressor, `s` the sliding variable, and `'` the transpose. Then the Lyapunov function
//! `V1` has the rate
//!
//! `V1_dot = -s' Kd s + s' (tau_f(v) - Y_f a_f + (B - B_0) a_r) + (a - a_hat)' (y - w)`,
//!
//! with `y = Y' s` and `a_hat_dot = Gamma w`. If viscous friction `D` is estimated, its part of the second term is `-s' D s`. If Coulomb
//! friction `F` is estimated, its part is `s' F (sign v - tanh(v_r / v_s))`.

use super::adaptive::AdaptiveSpec;
use super::joint_columns::JointColumn;
use crate::plant::PlantSpec;
use crate::scalar::{Real, labelled_numbers, sign};
use crate::trace::Sym;

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
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec, LeakageForm, Truth};
/// use armlet_core::scalar::Real;
/// use armlet_core::trace::function::recorded;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.0])?, Adaptation::Euclidean(gain(10, 2.0)?));
/// # let plant = PlantSpec::from(RigidSpec::new(model.clone()));
/// # let law = AdaptiveSpec::new(model.clone(), motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
///
/// let law = law.leaking(0.1, LeakageForm::Sigma, None)?;
/// let law = LawSpec::from(law);
/// let set_up = || (law.adaptive().and_then(|law| Truth::new(law, &plant)), law.build());
/// let recording = recorded(12, set_up, |(truth, mut control), inputs| {
///     let ((x, z), mut tau, mut rate) = (inputs.split_at(2), [inputs[0]], [inputs[0]; 10]);
///     control.evaluate(&law.desired(0.0), &[x[0].sin_cos()], x, z, &mut tau, &mut rate);
///     truth.map(|truth| control.dissipation_of(&truth, None, x, z)).into_iter().collect()
/// });
/// let mut dissipation = recording.expect("a law does not branch on its numbers").interpreted(false);
/// dissipation.all_inputs().copy_from_slice(&[&[0.0, 0.2], &model.parameters()[..]].concat());
/// dissipation.run();
/// // With the true parameters as estimate, the leakage adds nothing to the dissipation s Kd s.
/// assert!((dissipation.output(0)[0] - 10.0 * 0.2 * 0.2).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Truth {
    /// True values `a` of the estimated parameters, `(p,)`.
    parameters: Vec<Sym>,
    /// Friction parameters `a_f` of the joint columns; zero for rotors.
    rubbing: Vec<Sym>,
    /// Viscous friction of the plant, `(n,)`.
    viscous: Vec<Sym>,
    /// Coulomb friction of the plant, `(n,)`.
    coulomb: Vec<Sym>,
    /// Difference `B - B_0` of rotor inertias, `(n,)`.
    rotors: Vec<Sym>,
}

impl Truth {
    /// Create the true parameters for a law with joint columns, restraint, composite or concurrent adaptation; `None` for another law.
    pub fn new(law: &AdaptiveSpec, plant: &PlantSpec) -> Option<Self> {
        if law.is_plain() {
            return None;
        }
        let parameters = labelled_numbers("plant", &law.truth(plant));
        let (model, n) = (plant.model(), plant.n());
        let fixed = |values: Vec<f64>| values.into_iter().map(Sym::splat).collect::<Vec<Sym>>();
        let [viscous, coulomb] = model.friction(plant.has_friction()).map(fixed);
        let mut rubbing = law.columns.truth(model, plant.has_friction());
        let rotors = if law.columns.has(JointColumn::Armature) {
            rubbing[..n].fill(0.0);
            vec![0.0; n]
        } else {
            model.armature().iter().zip(law.model.armature()).map(|(there, known)| there - known).collect()
        };
        Some(Truth { parameters, rubbing: fixed(rubbing), viscous, coulomb, rotors: fixed(rotors) })
    }

    /// A part of the rate of the Lyapunov function `V1`: `s' (tau_f - Y_f a_f + (B - B_0) a_r) + (a - a_hat)' (y - w)`. It contains the
    /// effects of the plant's friction, known rotors, restraint (leakage and dead zone), and composite and concurrent adaptation.
    ///
    /// `friction` are the torques of the plant's stick-slip friction, if there is one. `columns` has the entries of the joint columns, and `back` is `y - w`.
    pub(super) fn added(&self, [s, v, a_r]: [&[Sym]; 3], friction: Option<&[Sym]>, columns: &[Sym], estimate: &[Sym], back: &[Sym]) -> Sym {
        let (n, mut sum) = (s.len(), Sym::zero());
        for i in 0..n {
            let torque = friction.map_or_else(|| self.coulomb[i].mul_add(sign(v[i]), self.viscous[i] * v[i]), |torques| torques[i]);
            sum = s[i].mul_add(self.rotors[i].mul_add(a_r[i], torque), sum);
        }
        for (k, (&column, &a)) in columns.iter().zip(&self.rubbing).enumerate() {
            sum = (column * a).neg_mul_add(s[k % n], sum);
        }
        for ((&back, &a), &a_hat) in back.iter().zip(&self.parameters).zip(estimate) {
            sum = (a - a_hat).mul_add(back, sum);
        }
        sum
    }
}
