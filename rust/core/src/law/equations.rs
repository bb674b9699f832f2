//! The notation of a law: its parameters, its equations at one instant, and its answer.

use crate::dynamics::At;
use crate::plant::{K, Parameters};
use crate::scalar::Real;
use crate::trace::expression::{by_rows, vector, zeros};
use crate::trace::{E, M, V, sym};
use std::rc::Rc;

/// The position `x_d` of a desired motion, its velocity and its acceleration.
pub type Sample = [V; 3];

/// A law as its paper: its parameters and its equations.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{Answer, Gain, LawSpec, Loop, PdGravitySpec};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
///
/// /// PD with gravity compensation: `tau = Kp (q_d - q) - Kd v + g(q)`.
/// fn equations(at: &Loop) -> Answer {
///     let [q_d, ..] = at.desired(0);
///     Answer::new(at.gain("kp") * &(q_d - &at.q) - at.gain("kd") * &at.v + at.arm().gravity())
/// }
/// let law = PdGravitySpec::new(model, vec![0.5], Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?)?;
/// assert_eq!(LawSpec::from(law).terms_at(0.0, &[0.5, 1.0], &[]).last().map(|(name, ..)| *name), Some("tau"));
/// # let _ = equations;
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub trait Equations {
    /// The numbers that differ between runs. `period` is the sample period of the loop, s, if it has one.
    fn parameters(&self, period: Option<f64>) -> Parameters;

    /// The equations of the law at one instant.
    fn equations(&self, at: &Loop) -> Answer;

    /// The law's state at the start of a run: `at.z`, with filters that start at the plant's state.
    fn start_state(&self, at: &Loop) -> V {
        at.z.clone()
    }
}

/// A loop at one instant, as a law reads it.
///
/// ```
/// use armlet_core::law::Loop;
/// use armlet_core::trace::V;
///
/// /// The sliding variable of an adaptive law: `s = v_d - v + Lambda (q_d - q)`.
/// fn sliding_variable(at: &Loop) -> V {
///     let [q_d, v_d, _] = at.desired(0);
///     at.term("s", v_d - &at.v + at.gain("lambda") * &(q_d - &at.q))
/// }
/// # let _ = sliding_variable;
/// ```
#[derive(Clone)]
pub struct Loop<'a> {
    numbers: &'a Parameters,
    arm: Option<Rc<At<E>>>,
    /// Positions of the links, `(n,)`, rad or m.
    pub q: V,
    /// Velocities of the links, `(n,)`, rad/s or m/s; empty for a velocity-controlled plant.
    pub v: V,
    /// Positions of the motors, `(n,)`; empty for a rigid plant.
    pub theta: V,
    /// Velocities of the motors, `(n,)`; empty for a rigid plant.
    pub theta_dot: V,
    /// The law's state, `(p,)`.
    pub z: V,
    desired: &'a [Sample],
    /// The limits of the plant's input, `(n,)`; empty without limits.
    pub tau_max: &'a V,
}

impl<'a> Loop<'a> {
    /// The instant of a loop with the law's numbers `numbers`, the desired motions, the plant's state `x` and the law's state `z`. `n` is the
    /// number of joints.
    pub(super) fn new(numbers: &'a Parameters, (desired, tau_max): (&'a [Sample], &'a V), n: usize, x: &[E], z: &[E]) -> Self {
        let part = |k: usize| x.get(k * n..(k + 1) * n).map_or_else(|| zeros(0), vector);
        let q = part(0);
        let arm = numbers.arm_at(&q);
        Loop { numbers, arm, q, v: part(1), theta: part(2), theta_dot: part(3), z: vector(z), desired, tau_max }
    }
}

impl Loop<'_> {
    /// The desired motion `k`: position, velocity and acceleration.
    pub fn desired(&self, k: usize) -> Sample {
        self.desired[k].clone()
    }

    /// Position, velocity and acceleration of all desired motions.
    pub fn all_desired(&self) -> &[Sample] {
        self.desired
    }

    /// The arm of the law's model at `q`.
    pub fn arm(&self) -> &At<E> {
        let Some(arm) = &self.arm else { unreachable!("a law with an arm has its parameters") };
        arm
    }

    /// This instant for an inner law, whose state is `z`.
    pub fn inner(&self, z: V) -> Self {
        let numbers = self.numbers.get_inner();
        Loop { numbers, arm: numbers.arm_at(&self.q), z, ..self.clone() }
    }

    /// The numbers of the law.
    pub fn numbers(&self) -> &Parameters {
        self.numbers
    }

    /// The gain `name`.
    pub fn gain(&self, name: &str) -> &K {
        self.numbers.get_gain(name)
    }

    /// The number `name`.
    pub fn number(&self, name: &str) -> E {
        self.numbers.get_number(name)
    }

    /// The vector `name`.
    pub fn vector(&self, name: &str) -> &V {
        self.numbers.get_numbers(name)
    }

    /// Name the vector `x`, and return it.
    pub fn term(&self, name: &'static str, x: V) -> V {
        E::term(name, &[x.len()], || x.as_slice().to_vec());
        x
    }

    /// Name the matrix `x`, and return it.
    pub fn matrix_term(&self, name: &'static str, x: M) -> M {
        E::term(name, &[x.nrows(), x.ncols()], || by_rows(&x));
        x
    }

    /// Whether this recording collects terms.
    pub fn collects_terms(&self) -> bool {
        sym::collects_terms()
    }

    /// Name the matrix `x`, which is computed only in a recording of terms.
    pub fn term_on_request(&self, name: &'static str, [rows, columns]: [usize; 2], x: impl FnOnce() -> M) {
        E::term(name, &[rows, columns], || by_rows(&x()));
    }

    /// Name the sample of desired motion `k`.
    pub fn desired_terms(&self, k: usize, names: &[&'static str]) -> Sample {
        let sample = self.desired(k);
        names.iter().zip(&sample).for_each(|(name, x)| _ = self.term(name, x.clone()));
        sample
    }
}

/// What a law answers at one instant.
///
/// ```
/// use armlet_core::law::Answer;
/// use armlet_core::trace::expression::zeros;
///
/// // A law of two joints without a state.
/// let answer = Answer::new(zeros(2));
/// assert_eq!((answer.tau.len(), answer.z_dot.len()), (2, 0));
/// assert!(answer.adaptation.is_none());
/// ```
#[derive(Clone)]
pub struct Answer {
    /// The plant's input, `(n,)`.
    pub tau: V,
    /// The rate of the law's state, `(p,)`.
    pub z_dot: V,
    /// The rate at which the law's Lyapunov function or its storage function decreases, without external forces, W. It assumes a plant that
    /// differs from the law's model only in the estimated parameters. It is zero for a law without such a function.
    pub dissipation: E,
    /// The quantities of an adaptive law that determine the dissipation on another plant.
    pub adaptation: Option<Adapting>,
}

/// The quantities of an adaptive law from which its dissipation on a given plant follows ([`Truth`](super::Truth)).
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, LawSpec, RecordedLaw};
/// use armlet_core::trace::function::recorded;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.0])?, Adaptation::Euclidean(gain(10, 2.0)?));
/// # let law = AdaptiveSpec::new(model, motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
/// # let law = LawSpec::from(law);
///
/// // The sliding variable at the target is minus the velocity.
/// let recording = recorded(12, || RecordedLaw::continuous(&law), |control, inputs| {
///     let answer = control.answer(&law.desired(0.0), &inputs[..2], &inputs[2..]);
///     answer.adaptation.map_or(vec![], |adapting| vec![adapting.s[0]])
/// });
/// let mut s = recording.expect("a law does not branch on its numbers").interpreted(false);
/// s.all_inputs()[1] = 0.3;
/// s.run();
/// assert_eq!(s.output(0), [-0.3]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone)]
pub struct Adapting {
    /// Sliding variable `s`, `(n,)`.
    pub s: V,
    /// Reference acceleration `a_r`, `(n,)`.
    pub a_r: V,
    /// The diagonals of the joint columns of the regressor, `(n,)` each.
    pub columns: Vec<V>,
    /// The difference `Y' s - w` between gradient adaptation and the adaptation with all options, `(p,)`; empty without such options.
    pub withheld: V,
}

impl Answer {
    /// The answer of a law without a state.
    pub fn new(tau: V) -> Self {
        Answer::with_rate(tau, zeros(0))
    }

    /// The answer of a law with a state.
    pub fn with_rate(tau: V, z_dot: V) -> Self {
        Answer { tau, z_dot, dissipation: E::zero(), adaptation: None }
    }
}
