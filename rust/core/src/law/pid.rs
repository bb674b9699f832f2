//! PID control with gravity compensation (Arimoto and Miyazaki 1984), with options:
//!
//! ```text
//! u   = g(q) + f(v_d) + M(q) a_d + Kp (q_d - q) + Kd (v_d - v_f) + w - d,   tau = u within the limits
//! w'  = Ki (q_d - q)                                    integral torque
//! v_f = v, or N (q - y) with y' = v_f                   filtered derivative of q, v_f' = N (v - v_f)
//! f   = damping v_d + friction tanh(v_d / v_s)          feed-forward of friction
//! d   = h (m v_f - s),   s' = tau - g - f + d           disturbance observer of bandwidth h, nominal inertia m
//! ```
//!
//! The prime is the time derivative. `v_s` is a speed, and `damping` and `friction` are the viscous and Coulomb friction of the arm's
//! joints. While `u_i` exceeds the limit of joint `i`, `w_i` does not change further in this direction. This is conditional integration
//! (Astrom and Hagglund 2006, section 3.5). So a long saturation does not increase the integral. The observer reads `tau` within the
//! limits, so it does not wind up either. With the observer, motions that are slow compared with `h` follow `m a = tau - g - f` (Ohnishi,
//! Shibata and Murakami 1996). So with the observer, the feed-forward term in `u` is `m a_d` instead of `M a_d`.
//!
//! The law's state is `w` with an integral gain `Ki`, then `y` with a filter, then `s` with an observer, `(n,)` each.

use super::definition::{Definition, JointReference, Shape, facts};
use super::equations::{Answer, Equations, Loop};
use super::impedance::held;
use super::sizes::{require_rows, require_same_dof, require_size};
use crate::dynamics::Model;
use crate::error::{Error, Result};
use crate::linalg::Gain;
use crate::motion::Motion;
use crate::plant::Parameters;
use crate::scalar::hyperbolic::tanh;
use crate::trace::V;
use crate::trace::expression::{clamp, stacked, zeros};

/// PID control with gravity compensation, with validated parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Gain, LawEvaluator, LawSpec, PidSpec};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
///
/// let law = PidSpec::new(model, Motion::hold(vec![0.5])?, gain(20.0)?, Some(gain(3.0)?), gain(4.0)?)?;
/// let mut tau = [0.0];
/// // The integral torque, the state of the law, is 1.5 N m.
/// LawEvaluator::new(&LawSpec::from(law)).input(0.0, &[&[0.3], &[0.1]], Some(&[1.5]), &mut tau);
/// assert!((tau[0] - (20.0 * 0.2 - 4.0 * 0.1 + 1.5 + 5.0 * 0.3f64.sin())).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PidSpec {
    model: Model,
    motion: Motion,
    /// Position gain, of size `n`, N m/rad or N/m.
    pub kp: Gain,
    /// Integral gain, of size `n`, N m/(rad s) or N/(m s); `None` without an integral.
    pub ki: Option<Gain>,
    /// Velocity gain, of size `n`, N m s/rad or N s/m.
    pub kd: Gain,
    options: PidOptions,
    start: Vec<f64>,
}

/// The options of a PID law. Each is `(n,)` and positive, or `None` if it is not used.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Gain, LawSpec, PidOptions, PidSpec};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
///
/// let law = PidSpec::new(model, Motion::hold(vec![0.5])?, gain(20.0)?, Some(gain(3.0)?), gain(4.0)?)?;
/// let law = LawSpec::from(law.with(PidOptions { tau_max: Some(vec![6.0]), ..PidOptions::default() })?);
/// // At q = 0, the law requires 10 N m. While the torque is at its limit, the integral does not change.
/// let terms = law.terms_at(0.0, &[0.0, 0.0], &[0.0]);
/// let term = |name: &str| terms.iter().find(|term| term.0 == name).map_or(f64::NAN, |term| term.2[0]);
/// assert_eq!((term("u"), term("tau"), term("integral_rate")), (10.0, 6.0, 0.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Default)]
pub struct PidOptions {
    /// The largest torques, N m or N; infinity means no limit.
    pub tau_max: Option<Vec<f64>>,
    /// Bandwidth `N` of the velocity filter, 1/s. The law then uses the filtered derivative of the position as velocity.
    pub derivative_filter: Option<Vec<f64>>,
    /// The speed `v_s` of the feed-forward of friction, `damping v_d + friction tanh(v_d / v_s)`, rad/s or m/s. With `None`, the law does
    /// not feed friction forward.
    pub friction_speed: Option<Vec<f64>>,
    /// Bandwidth `h` of the disturbance observer, 1/s.
    pub observer_bandwidth: Option<Vec<f64>>,
    /// Nominal inertia `m` of the disturbance observer, kg m^2 or kg. `None` uses the diagonal of the mass matrix at the first desired
    /// position.
    pub nominal_inertia: Option<Vec<f64>>,
}

impl PidSpec {
    /// Create the law without options, for a desired motion and gains of size `n`. The integral starts at zero. Errors: `WrongShape` for a
    /// wrong size.
    pub fn new(model: Model, motion: Motion, kp: Gain, ki: Option<Gain>, kd: Gain) -> Result<Self> {
        let n = model.n();
        require_same_dof(n, &motion)?;
        require_size("kp", &kp, n)?;
        ki.as_ref().map_or(Ok(()), |ki| require_size("ki", ki, n))?;
        require_size("kd", &kd, n)?;
        let start = vec![0.0; if ki.is_some() { n } else { 0 }];
        Ok(PidSpec { model, motion, kp, ki, kd, options: PidOptions::default(), start })
    }

    /// Replace the options of the law. Errors: `WrongShape` for a wrong length. `Input` for numbers that are not positive or not finite
    /// (`tau_max` may be infinite), or a `nominal_inertia` without an observer.
    pub fn with(mut self, mut options: PidOptions) -> Result<Self> {
        let n = self.model.n();
        positive_rows("tau_max", options.tau_max.as_deref(), n, f64::INFINITY).map_err(|error| self.model.name_limit(error))?;
        positive_rows("derivative_filter", options.derivative_filter.as_deref(), n, f64::MAX)?;
        positive_rows("friction_speed", options.friction_speed.as_deref(), n, f64::MAX)?;
        positive_rows("observer_bandwidth", options.observer_bandwidth.as_deref(), n, f64::MAX)?;
        positive_rows("nominal_inertia", options.nominal_inertia.as_deref(), n, f64::MAX)?;
        if options.observer_bandwidth.is_some() {
            options.nominal_inertia.get_or_insert_with(|| first_inertia(&self.model, &self.motion));
        } else if options.nominal_inertia.is_some() {
            return Err(Error::input("nominal_inertia", "is not used: expected None without observer_bandwidth"));
        }
        let parts = [self.ki.is_some(), options.derivative_filter.is_some(), options.observer_bandwidth.is_some()];
        self.start = vec![0.0; parts.into_iter().filter(|&used| used).count() * n];
        self.options = options;
        Ok(self)
    }
}

/// Require `n` positive numbers, each at most `most`.
fn positive_rows(name: &'static str, numbers: Option<&[f64]>, n: usize, most: f64) -> Result<()> {
    let Some(numbers) = numbers else { return Ok(()) };
    require_rows(name, n, numbers.len())?;
    match numbers.iter().position(|&x| !(x > 0.0 && x <= most)) {
        Some(i) if numbers[i] > 0.0 => Err(Error::input(name, format!("is not finite: got {}", numbers[i])).at([i])),
        Some(i) => Err(Error::input(name, format!("is not positive: expected numbers > 0, got {}", numbers[i])).at([i])),
        None => Ok(()),
    }
}

/// The diagonal of the mass matrix at the start of the desired motion.
fn first_inertia(model: &Model, motion: &Motion) -> Vec<f64> {
    let n = model.n();
    let mut desired = vec![0.0; 3 * n];
    motion.sample(0.0, &mut desired);
    model.at(&desired[..n]).mass_matrix().diagonal().as_slice().to_vec()
}

impl Definition for PidSpec {
    facts!("PID", Rigid, motion);
    fn initial_state(&self) -> &[f64] {
        &self.start
    }

    fn restarts(&self) -> bool {
        self.options.derivative_filter.is_some() || self.options.observer_bandwidth.is_some()
    }

    fn joint_reference(&self) -> Option<JointReference> {
        Some(JointReference::of(&self.motion))
    }
}

impl Shape for PidSpec {
    fn same_shape(&self, other: &Self) -> bool {
        let shape = |law: &Self| {
            let PidOptions { tau_max, derivative_filter, friction_speed, observer_bandwidth, nominal_inertia: _ } = &law.options;
            let parts = [tau_max, derivative_filter, friction_speed, observer_bandwidth].map(Option::is_some);
            (law.motion.moves(), law.ki.is_some(), parts)
        };
        shape(self) == shape(other)
    }
}

impl Equations for PidSpec {
    fn parameters(&self, _: Option<f64>) -> Parameters {
        let PidOptions { tau_max, derivative_filter, friction_speed, observer_bandwidth, nominal_inertia } = &self.options;
        Parameters::of_arm(&self.model)
            .gain("kp", &self.kp)
            .option(self.ki.as_ref(), |numbers, ki| numbers.gain("ki", ki))
            .gain("kd", &self.kd)
            .option(tau_max.as_ref(), |numbers, x| numbers.numbers("law_tau_max", x))
            .option(derivative_filter.as_ref(), |numbers, x| numbers.numbers("derivative_filter", x))
            .option(friction_speed.as_ref(), |numbers, x| {
                let [damping, friction] = self.model.friction(true);
                numbers.numbers("friction_speed", x).numbers("damping", &damping).numbers("friction", &friction)
            })
            .option(observer_bandwidth.as_ref(), |numbers, x| numbers.numbers("observer_bandwidth", x))
            .option(nominal_inertia.as_ref(), |numbers, x| numbers.numbers("nominal_inertia", x))
    }

    fn equations(&self, at: &Loop) -> Answer {
        let State { w, q_f, s } = self.state(&at.z);
        let [q_d, mut v_d, mut a_d] = at.desired_terms(0, if self.motion.moves() { &["q_d", "v_d"] } else { &["q_d"] });
        if !self.motion.moves() {
            (v_d, a_d) = (zeros(v_d.len()), zeros(a_d.len()));
        }
        let e = at.term("e", q_d - &at.q);
        let v_f = match q_f {
            Some(q_f) => at.term("v_f", at.vector("derivative_filter").component_mul(&(&at.q - q_f))),
            None => at.v.clone(),
        };

        // Feed-forward: gravity, or the inverse dynamics at rest for the desired acceleration, and friction at the desired velocity.
        let g = at.term("g", at.arm().gravity());
        let mut ahead = if self.motion.moves() && s.is_none() { at.arm().inverse_dynamics(&zeros(e.len()), &a_d) } else { g };
        if self.options.friction_speed.is_some() {
            let (viscous, coulomb) = (at.vector("damping"), at.vector("friction"));
            let direction = v_d.zip_map(at.vector("friction_speed"), |v, slow| tanh(v / slow));
            ahead += at.term("friction", viscous.component_mul(&v_d) + coulomb.component_mul(&direction));
        }

        let mut u = &ahead + at.gain("kp") * &e + at.gain("kd") * &(v_d - &v_f);
        u += w.as_ref().unwrap_or(&zeros(e.len()));
        let mut d = zeros(e.len());
        if let Some(s) = &s {
            let b = at.vector("nominal_inertia");
            d = at.term("disturbance", at.vector("observer_bandwidth").component_mul(&(b.component_mul(&v_f) - s)));
            u += b.component_mul(&a_d) - &d;
        }

        let (mut tau, mut w_dot) = (u.clone(), zeros(0));
        if let Some(w) = w {
            at.term("integral", w);
            w_dot = at.gain("ki") * &e;
        }
        if self.options.tau_max.is_some() {
            let limit = at.vector("law_tau_max");
            w_dot = V::from_fn(w_dot.len(), |i, _| held(u[i], limit[i], w_dot[i], w_dot[i]));
            tau = clamp(&tau, limit);
        }
        if self.ki.is_some() {
            at.term("integral_rate", w_dot.clone());
        }
        at.term("u", u);
        let q_f_dot = if self.options.derivative_filter.is_some() { v_f } else { zeros(0) };
        let s_dot = if s.is_some() { &tau - ahead + d } else { zeros(0) };
        Answer::with_rate(tau, stacked([&w_dot, &q_f_dot, &s_dot]))
    }

    fn start_state(&self, at: &Loop) -> V {
        let State { w, q_f, s } = self.state(&at.z);
        let filtered = q_f.is_some();
        let momentum = || if filtered { zeros(at.v.len()) } else { at.vector("nominal_inertia").component_mul(&at.v) };
        stacked([&w.unwrap_or(zeros(0)), &q_f.map_or(zeros(0), |_| at.q.clone()), &s.map_or(zeros(0), |_| momentum())])
    }
}

/// The parts of the law's state.
struct State {
    /// Integral `w`.
    w: Option<V>,
    /// Filtered position `q_f`.
    q_f: Option<V>,
    /// State `s` of the disturbance observer.
    s: Option<V>,
}

impl PidSpec {
    fn state(&self, z: &V) -> State {
        let (n, mut first) = (self.model.n(), 0);
        let mut part = |used: bool| {
            let part = used.then(|| z.rows(first, n).into_owned());
            first += if used { n } else { 0 };
            part
        };
        State {
            w: part(self.ki.is_some()),
            q_f: part(self.options.derivative_filter.is_some()),
            s: part(self.options.observer_bandwidth.is_some()),
        }
    }
}
