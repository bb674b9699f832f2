//! Restraints of the estimate of an adaptive law: leakage and a dead zone.
//!
//! ```text
//! pi_hat_dot = Gamma w,   w = y - l  where |s| >= s_0,   w = 0 where |s| < s_0 (dead zone),   y = Y' s
//! l = sigma (pi_hat - pi_0)        leakage (sigma modification, IoannouKokotovic1984)
//! l = sigma |s| (pi_hat - pi_0)    e-modification (NarendraAnnaswamy1987)
//! V1_dot = -s' Kd s + (pi - pi_hat)' (y - w):  with leakage -s' Kd s + (pi - pi_hat)' l,  in the dead zone -s' Kd s + (pi - pi_hat)' y
//! ```
//!
//! `Y` is the regressor, `s` the sliding variable, `pi_hat` the estimate of the parameters `pi`, `V1` the Lyapunov function, and `'` the
//! transpose. Leakage keeps the estimate bounded under bounded disturbances. A dead zone does so if `s_0` exceeds the `|s|` that the
//! disturbances cause. Both leave an error of the estimate, of the order of `sigma` or `s_0`.

/// The factor of `sigma` in the leakage.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec, LeakageForm};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.0])?, Adaptation::Euclidean(gain(10, 2.0)?));
/// # let law = AdaptiveSpec::new(model, motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
///
/// // The rate of the first parameter at rest at the target, where s = 0, for an estimate of ones.
/// let rate = |form| -> armlet_core::error::Result<f64> {
///     let law = LawSpec::from(law.clone().leaking(0.1, form, None)?);
///     let terms = law.terms_at(0.0, &[0.0, 0.0], &[1.0; 10]);
///     Ok(terms.iter().find(|term| term.0 == "estimate_rate").map_or(f64::NAN, |term| term.2[0]))
/// };
/// assert_eq!((rate(LeakageForm::Sigma)?, rate(LeakageForm::Error)?), (-2.0 * 0.1, 0.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeakageForm {
    /// The factor is one: sigma modification.
    Sigma,
    /// The factor is `|s|`: e-modification.
    Error,
}

/// Leakage and dead zone of an adaptation.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec, LeakageForm, Restraint};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.0])?, Adaptation::Euclidean(gain(10, 2.0)?));
///
/// let law = AdaptiveSpec::new(model, motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
/// assert_eq!(law.restraint, Restraint::none());
/// let law = law.leaking(0.1, LeakageForm::Sigma, None)?.resting_below(0.02)?;
/// assert_eq!((law.restraint.leakage, law.restraint.dead_zone), (0.1, 0.02));
/// // Within the dead zone, at |s| = 0.01 rad/s, the estimate does not change.
/// let terms = LawSpec::from(law).terms_at(0.0, &[0.0, 0.01], &[1.0; 10]);
/// assert!(terms.iter().any(|(name, _, rate)| *name == "estimate_rate" && rate.iter().all(|&x| x == 0.0)));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Restraint {
    /// Leakage `sigma >= 0`; zero without leakage. `Gamma sigma` is in 1/s, and with `LeakageForm::Error` in 1/s per unit of `|s|`.
    pub leakage: f64,
    /// The factor of `sigma`: one, or the norm of `s`.
    pub form: LeakageForm,
    /// The centre `pi_0` of the leakage, `(p,)`, in the units of the parameters.
    pub centre: Vec<f64>,
    /// Dead zone `s_0 >= 0`, rad/s or m/s; zero without a dead zone.
    pub dead_zone: f64,
}

impl Restraint {
    /// Create a restraint without leakage and without a dead zone.
    pub fn none() -> Self {
        Restraint { leakage: 0.0, form: LeakageForm::Sigma, centre: Vec::new(), dead_zone: 0.0 }
    }

    /// Whether there is neither leakage nor a dead zone.
    pub fn is_none(&self) -> bool {
        self.leakage == 0.0 && self.dead_zone == 0.0
    }

    pub(super) fn same_shape(&self, other: &Self) -> bool {
        (self.leakage > 0.0, self.dead_zone > 0.0, self.form) == (other.leakage > 0.0, other.dead_zone > 0.0, other.form)
    }
}
