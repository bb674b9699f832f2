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

use super::definition::{Definition, JointReference, Law, Shape, facts};
use super::sizes::{require_rows, require_same_dof, require_size};
use crate::dynamics::{AnyArm, Dynamics, Model, Workspace};
use crate::error::{Error, Result};
use crate::linalg::gain::{AnyGain, Gain};
use crate::motion::Motion;
use crate::scalar::hyperbolic::tanh;
use crate::scalar::{Real, labelled_numbers};
use crate::trace::Sym;

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

    /// Whether the desired motion changes with time.
    fn moves(&self) -> bool {
        !matches!(self.motion, Motion::Hold(_))
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
    let (mut desired, mut m) = (vec![0.0; 3 * n], vec![0.0; n * n]);
    motion.sample(0.0, &mut desired);
    model.at(&desired[..n]).mass_matrix(&mut m);
    (0..n).map(|i| m[i * n + i]).collect()
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
        Some(if self.moves() { JointReference::Motion } else { JointReference::held(&self.motion) })
    }
}

impl PidSpec {
    pub(super) fn build(&self) -> Pid {
        let (n, options) = (self.model.n(), &self.options);
        let arm = AnyArm::new(&self.model);
        let option = |name, numbers: &Option<Vec<f64>>| numbers.as_ref().map(|numbers| labelled_numbers(name, numbers));
        Pid {
            workspace: arm.workspace(),
            arm,
            kp: AnyGain::labelled("kp", &self.kp),
            ki: self.ki.as_ref().map(|ki| AnyGain::labelled("ki", ki)),
            kd: AnyGain::labelled("kd", &self.kd),
            moves: self.moves(),
            limits: option("law_tau_max", &options.tau_max),
            filter: option("derivative_filter", &options.derivative_filter),
            friction: option("friction_speed", &options.friction_speed).map(|speed| {
                let [damping, friction] = self.model.friction(true);
                [labelled_numbers("damping", &damping), labelled_numbers("friction", &friction), speed]
            }),
            observer: option("observer_bandwidth", &options.observer_bandwidth).zip(option("nominal_inertia", &options.nominal_inertia)),
            e: vec![Sym::zero(); n],
            speed: vec![Sym::zero(); n],
            drag: vec![Sym::zero(); n],
            disturbance: vec![Sym::zero(); n],
            nominal: vec![Sym::zero(); n],
            work: vec![Sym::zero(); n],
            free: vec![Sym::zero(); n],
        }
    }
}

impl Shape for PidSpec {
    fn same_shape(&self, other: &Self) -> bool {
        let shape = |law: &Self| {
            let PidOptions { tau_max, derivative_filter, friction_speed, observer_bandwidth, nominal_inertia: _ } = &law.options;
            let parts = [tau_max, derivative_filter, friction_speed, observer_bandwidth].map(Option::is_some);
            (law.moves(), law.ki.is_some(), parts)
        };
        shape(self) == shape(other)
    }
}

/// PID control with gravity compensation in a control loop.
pub struct Pid {
    arm: AnyArm<Sym>,
    workspace: Workspace<Sym>,
    kp: AnyGain<Sym>,
    ki: Option<AnyGain<Sym>>,
    kd: AnyGain<Sym>,
    /// Whether the desired motion changes with time.
    moves: bool,
    limits: Option<Vec<Sym>>,
    /// Bandwidth `N` of the velocity filter, `(n,)`, 1/s.
    filter: Option<Vec<Sym>>,
    /// Viscous friction, Coulomb friction and the speed `v_s`, `(n,)` each.
    friction: Option<[Vec<Sym>; 3]>,
    /// Bandwidth `h`, 1/s, and nominal inertia `m`, kg m^2 or kg, of the disturbance observer, `(n,)` each.
    observer: Option<(Vec<Sym>, Vec<Sym>)>,
    /// Position error `q_d - q`, `(n,)`, rad or m.
    e: Vec<Sym>,
    /// Filtered velocity `v_f`, `(n,)`, rad/s or m/s.
    speed: Vec<Sym>,
    /// Feed-forward torque of friction, `f(v_d)`, `(n,)`, N m or N.
    drag: Vec<Sym>,
    /// Disturbance torque `d` that the observer estimates, `(n,)`, N m or N.
    disturbance: Vec<Sym>,
    /// The feed-forward torque: `g + f` with an observer, else `g + f + M a_d`, `(n,)`, N m or N.
    nominal: Vec<Sym>,
    work: Vec<Sym>,
    /// Torque `u` before its limits, `(n,)`, N m or N.
    free: Vec<Sym>,
}

impl Pid {
    /// The length of the integral torque `w` in the law's state: zero without an integral gain.
    fn integrals(&self) -> usize {
        if self.ki.is_some() { self.e.len() } else { 0 }
    }

    /// Name the desired motion, the error, the gravity torque, and the terms of the options.
    fn name_terms(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], q: &[Sym]) {
        let n = self.e.len();
        Sym::term("q_d", &[n], || desired[..n].to_vec());
        if self.moves {
            Sym::term("v_d", &[n], || desired[n..2 * n].to_vec());
        }
        Sym::term("e", &[n], || self.e.clone());
        Sym::term("g", &[n], || {
            let mut g = vec![Sym::zero(); n];
            self.arm.gravity(&mut self.workspace, trig, q, &mut g);
            g
        });
        for (name, values, present) in [
            ("v_f", &self.speed, self.filter.is_some()),
            ("friction", &self.drag, self.friction.is_some()),
            ("disturbance", &self.disturbance, self.observer.is_some()),
        ] {
            if present {
                Sym::term(name, &[n], || values.clone());
            }
        }
    }
}

impl Law for Pid {
    /// Set the states of the velocity filter and the observer such that the filter's output and the disturbance `d` start at zero.
    fn restart(&mut self, _: &[(Sym, Sym)], x: &[Sym], z: &mut [Sym]) {
        let n = self.e.len();
        let first = self.integrals();
        if self.filter.is_some() {
            z[first..first + n].copy_from_slice(&x[..n]);
        }
        if let Some((_, inertia)) = &self.observer {
            let before = z.len() - n;
            for (i, s) in z[before..].iter_mut().enumerate() {
                *s = if self.filter.is_some() { Sym::zero() } else { inertia[i] * x[n + i] };
            }
        }
    }

    fn evaluate(&mut self, desired: &[Sym], trig: &[(Sym, Sym)], x: &[Sym], z: &[Sym], tau: &mut [Sym], dz: &mut [Sym]) {
        let n = tau.len();
        let (q, v) = (&x[..n], &x[n..2 * n]);
        let (v_d, a_d) = (&desired[n..2 * n], &desired[2 * n..3 * n]);
        let (w, filters) = z.split_at(self.integrals());
        let (dw, behind) = dz.split_at_mut(w.len());
        for i in 0..n {
            self.e[i] = desired[i] - q[i];
        }
        match &self.filter {
            Some(rate) => (0..n).for_each(|i| self.speed[i] = rate[i] * (q[i] - filters[i])),
            None => self.speed.copy_from_slice(v),
        }

        if self.moves && self.observer.is_none() {
            self.work.fill(Sym::zero());
            self.arm.inverse_dynamics(&mut self.workspace, trig, q, &self.work, a_d, tau);
        } else {
            self.arm.gravity(&mut self.workspace, trig, q, tau);
        }
        if let Some([damping, friction, slow]) = &self.friction {
            for i in 0..n {
                self.drag[i] = damping[i].mul_add(v_d[i], friction[i] * tanh(v_d[i] / slow[i]));
                tau[i] += self.drag[i];
            }
        }
        self.nominal.copy_from_slice(tau);

        self.kp.add_to(&self.e, tau);
        for i in 0..n {
            self.work[i] = if self.moves { v_d[i] - self.speed[i] } else { -self.speed[i] };
        }
        self.kd.add_to(&self.work, tau);
        for (tau, &w) in tau.iter_mut().zip(w) {
            *tau += w;
        }
        if let Some((bandwidth, inertia)) = &self.observer {
            let s = &filters[filters.len() - n..];
            for i in 0..n {
                self.disturbance[i] = bandwidth[i] * inertia[i].mul_add(self.speed[i], -s[i]);
                let ahead = if self.moves { inertia[i] * a_d[i] } else { Sym::zero() };
                tau[i] += ahead - self.disturbance[i];
            }
        }
        self.free.copy_from_slice(tau);
        self.name_terms(desired, trig, q);

        if let Some(ki) = &self.ki {
            ki.multiply(&self.e, dw);
            Sym::term("integral", &[n], || w.to_vec());
        }
        if let Some(limits) = &self.limits {
            for ((rate, &free), &limit) in dw.iter_mut().zip(&self.free).zip(limits) {
                let down = Sym::select(free.lt(-limit), rate.max(Sym::zero()), *rate);
                *rate = Sym::select(limit.lt(free), rate.min(Sym::zero()), down);
            }
            for (tau, &limit) in tau.iter_mut().zip(limits) {
                *tau = tau.clamped(-limit, limit);
            }
        }
        if self.ki.is_some() {
            Sym::term("integral_rate", &[n], || dw.to_vec());
        }
        Sym::term("u", &[n], || self.free.clone());
        let (filtered, observed) = behind.split_at_mut(if self.filter.is_some() { n } else { 0 });
        filtered.copy_from_slice(&self.speed[..filtered.len()]);
        for (i, rate) in observed.iter_mut().enumerate() {
            *rate = tau[i] - self.nominal[i] + self.disturbance[i];
        }
    }
}
