//! Evaluation of a law at single instants, like `law(t, q, v)` and `law.terms(t, q, v)` in Python.
//!
//! The first call records the law. The interpreter runs the recording, and after a number of calls machine code does, with the same bits.

use super::LawSpec;
use super::equations::Answer;
use super::recorded::RecordedLaw;
use super::terms::Term;
use crate::motion::{Motion, sample_all};
use crate::scalar::Real;
use crate::trace::by_engine::{Evaluator, SharedFunction};
use crate::trace::expression::{clamp, stacked, zeros};
use crate::trace::function::{self, Evaluation, Recorded};
use crate::trace::sym::{self, Sym};
use crate::trace::{Jacobian, V};
use std::sync::Arc;

/// The largest number of joints for which this evaluator makes machine code. It limits the time of the call that makes it.
const MOST_JOINTS: usize = 12;

/// The law's answer to one array of inputs. They are the desired motion, the plant's state and the law's state, with the lengths `widths`.
fn answer_to(law: &RecordedLaw, inputs: &[Sym], widths: [usize; 3]) -> Answer {
    let (desired, state) = inputs.split_at(widths[0]);
    let (x, z) = state.split_at(widths[1]);
    law.answer(desired, x, z)
}

/// A law that is evaluated at single instants, with its buffers. A call allocates nothing, except the calls that record the
/// law or make machine code.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, LawEvaluator, LawSpec, PdGravitySpec};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
///
/// let law = PdGravitySpec::new(model, vec![0.5], Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?)?;
/// let mut control = LawEvaluator::new(&LawSpec::from(law));
/// let mut tau = [0.0];
/// // The measured position is 0.3 rad, the velocity 0.1 rad/s.
/// control.input(0.0, &[&[0.3], &[0.1]], None, &mut tau);
/// assert!((tau[0] - (20.0 * 0.2 - 4.0 * 0.1 + 5.0 * 0.3f64.sin())).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct LawEvaluator {
    spec: LawSpec,
    /// The plant's input.
    input: Option<Evaluator>,
    /// The law's state at the start of a run, if it depends on the plant's state.
    restart: Option<Evaluation>,
    /// The terms in a loop with this sample period.
    terms: Option<(Option<f64>, RecordedTerms)>,
    slope: Option<Jacobian>,
    motions: Vec<Motion>,
    /// The desired motion, the plant's state and the law's state, one after another.
    inputs: Vec<f64>,
    /// The lengths of the three parts of `inputs`.
    widths: [usize; 3],
}

/// The named terms of a law: names and shapes, and the function that computes their values.
struct RecordedTerms {
    names: Vec<(&'static str, Vec<usize>)>,
    values: Evaluation,
}

/// The lengths of the desired motion, the plant's state and the law's state.
pub(super) fn widths(spec: &LawSpec) -> [usize; 3] {
    let desired = spec.motions().iter().map(|motion| 3 * motion.dof()).sum();
    [desired, spec.plant().states(spec.model().n()), spec.initial_state().len()]
}

/// Evaluate a function of one row of numbers.
fn call<'a>(function: &'a mut Evaluation, inputs: &[f64], results: usize) -> &'a [f64] {
    function.inputs(0, inputs.len()).copy_from_slice(inputs);
    function.run();
    function.outputs(0, results)
}

impl LawEvaluator {
    /// Prepare the law `spec`.
    pub fn new(spec: &LawSpec) -> Self {
        let widths = widths(spec);
        LawEvaluator {
            spec: spec.clone(),
            input: None,
            restart: None,
            terms: None,
            slope: None,
            motions: spec.motions().into_iter().cloned().collect(),
            inputs: vec![0.0; widths.iter().sum()],
            widths,
        }
    }

    /// Compute the plant's input `tau`, `(n,)`, at time `t`, s.
    ///
    /// `parts` has the parts of the plant's state, one after another. `z` is the law's state; `None` means the state at the start of a run.
    pub fn input(&mut self, t: f64, parts: &[&[f64]], z: Option<&[f64]>, tau: &mut [f64]) {
        self.read(t, parts, z);
        if let LawSpec::External(law) = &self.spec {
            return law.evaluate(t, &self.inputs, tau);
        }
        let LawEvaluator { spec, input, inputs, widths, .. } = self;
        let input = input.get_or_insert_with(|| {
            let most = if spec.model().n() <= MOST_JOINTS { usize::MAX } else { 0 };
            let recorded = law_of(spec, *widths);
            let values = recorded.values.clone();
            Evaluator::new(Arc::new(SharedFunction::new(recorded, false).up_to(most)), &values)
        });
        input.inputs().copy_from_slice(inputs);
        input.run();
        tau.copy_from_slice(input.outputs(0, tau.len()));
    }

    /// Compute the named terms of the law. The arguments are those of [`LawEvaluator::input`]. For a law with a state, the last two terms
    /// are this state and its rate.
    pub fn terms(&mut self, t: f64, parts: &[&[f64]], z: Option<&[f64]>) -> Vec<Term> {
        self.sampled_terms(None, t, parts, z)
    }

    /// The named terms of the law in a loop with the sample period `period`, s; `None` for a continuous loop. The other arguments are those
    /// of [`LawEvaluator::input`].
    pub fn sampled_terms(&mut self, period: Option<f64>, t: f64, parts: &[&[f64]], z: Option<&[f64]>) -> Vec<Term> {
        self.read(t, parts, z);
        if let LawSpec::External(law) = &self.spec {
            let mut tau = vec![0.0; self.spec.model().n()];
            law.evaluate(t, &self.inputs, &mut tau);
            return vec![("tau", vec![tau.len()], tau)];
        }
        let known = self.terms.take_if(|(own, _)| *own == period);
        let (_, RecordedTerms { names, values }) =
            self.terms.insert(known.unwrap_or_else(|| (period, RecordedTerms::of(&self.spec, self.widths, period))));
        let sizes = names.iter().map(|(_, shape)| shape.iter().product::<usize>());
        let mut left = call(values, &self.inputs, sizes.clone().sum());
        let mut all: Vec<Term> = Vec::with_capacity(names.len() + 2);
        for ((name, shape), size) in names.iter().zip(sizes) {
            all.push((name, shape.clone(), left[..size].to_vec()));
            left = &left[size..];
        }
        let z = &self.inputs[self.widths[0] + self.widths[1]..];
        let rate = all.pop_if(|(name, ..)| *name == "state_rate");
        all.extend(self.spec.stored_terms(z));
        if let Some(rate) = rate {
            all.extend([("state", vec![z.len()], z.to_vec()), rate]);
        }
        all
    }

    /// Compute the derivative of `[tau, z_dot]` with respect to `[x, z]`, `(n + p, states + p)`, row-major, at time `t` (s). `tau` is the
    /// output of the law, `z` its state, and `x` the plant's state. The result is `None` if the law branches on its data.
    ///
    /// ```
    /// # use armlet_core::arm::Arm;
    /// # use armlet_core::dynamics::Model;
    /// # use armlet_core::law::{Gain, LawEvaluator, LawSpec, PdGravitySpec};
    /// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
    /// let law = PdGravitySpec::new(model, vec![0.5], Gain::scalar("kp", 1, 20.0)?, Gain::scalar("kd", 1, 4.0)?)?;
    /// let slope = LawEvaluator::new(&LawSpec::from(law)).slope(0.0, &[0.3, 0.1], &[]).unwrap();
    /// // tau = kp (q_d - q) - kd v + 5 sin q
    /// assert!((slope[0] - (5.0 * 0.3f64.cos() - 20.0)).abs() < 1e-12 && slope[1] == -4.0);
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn slope(&mut self, t: f64, x: &[f64], z: &[f64]) -> Option<Vec<f64>> {
        if self.spec.route().is_scalar() {
            return None;
        }
        self.read(t, &[x], Some(z));
        let (rows, columns) = (self.spec.model().n() + z.len(), x.len() + z.len());
        let slope = self.slope.get_or_insert_with(|| Jacobian::with_fixed(rates_of(&self.spec, self.widths), self.widths[0], rows));
        let mut entries = vec![0.0; rows * columns];
        slope.slopes(&self.inputs, |i, j, rate| entries[i * columns + j] = rate);
        Some(entries)
    }

    /// Write the arguments to `inputs`.
    fn read(&mut self, t: f64, parts: &[&[f64]], z: Option<&[f64]>) {
        let (desired, state) = self.inputs.split_at_mut(self.widths[0]);
        sample_all(&self.motions, t, desired);
        let (x, law) = state.split_at_mut(self.widths[1]);
        x.iter_mut().zip(parts.iter().copied().flatten()).for_each(|(to, from)| *to = *from);
        law.copy_from_slice(z.unwrap_or(self.spec.initial_state()));
        if z.is_none() && self.spec.restarts() {
            let restart = self.restart.get_or_insert_with(|| restart_of(&self.spec, self.widths).interpreted(false));
            let started = call(restart, state, self.widths[2]);
            state[self.widths[1]..].copy_from_slice(started);
        }
    }
}

impl LawSpec {
    /// The law's state at the start of a run, if the plant's state is `x0`.
    pub fn start(&self, x0: &[f64]) -> Vec<f64> {
        let mut z = self.initial_state().to_vec();
        self.restart(x0, &mut z);
        z
    }

    /// Initialise the filters in the law's state `z` from the plant's state `x`.
    pub fn restart(&self, x: &[f64], z: &mut [f64]) {
        if self.restarts() {
            let mut restart = restart_of(self, widths(self)).interpreted(false);
            z.copy_from_slice(call(&mut restart, &[x, &*z].concat(), z.len()));
        }
    }

    /// The named terms of the law at time `t`, at the plant's state `x` and the law's state `z`. For a law with a state, the last two are
    /// `z` and its rate.
    pub fn terms_at(&self, t: f64, x: &[f64], z: &[f64]) -> Vec<Term> {
        LawEvaluator::new(self).terms(t, &[x], Some(z))
    }
}

/// Record a function of the law. `set_up` declares its numbers.
fn recorded_law<'a>(
    inputs: usize,
    set_up: impl FnOnce() -> RecordedLaw<'a>,
    results: impl FnOnce(&RecordedLaw, &[Sym]) -> Vec<Sym>,
) -> Recorded {
    let recorded = function::recorded(inputs, set_up, |law, inputs| results(&law, inputs));
    let Some(recorded) = recorded else { unreachable!("no law reads the value of a recorded number") };
    recorded
}

/// Record the law's state after [`LawSpec::restart`] as a function of the plant's state and the law's state.
fn restart_of(spec: &LawSpec, [_, states, p]: [usize; 3]) -> Recorded {
    recorded_law(
        states + p,
        || RecordedLaw::continuous(spec),
        |law, inputs| law.restart(&inputs[..states], &inputs[states..]).as_slice().to_vec(),
    )
}

impl RecordedTerms {
    fn of(spec: &LawSpec, widths: [usize; 3], period: Option<f64>) -> Self {
        let mut names = Vec::new();
        let values = |law: &RecordedLaw, inputs: &[Sym]| {
            sym::collect_terms();
            let Answer { tau, z_dot, .. } = answer_to(law, inputs, widths);
            let mut terms = sym::terms();
            terms.push(("tau", vec![tau.len()], tau.as_slice().to_vec()));
            if !z_dot.is_empty() {
                terms.push(("state_rate", vec![z_dot.len()], z_dot.as_slice().to_vec()));
            }
            names = terms.iter().map(|(name, shape, _)| (*name, shape.clone())).collect();
            terms.into_iter().flat_map(|(.., values)| values).collect()
        };
        let values = recorded_law(widths.iter().sum(), || RecordedLaw::new(spec, period, zeros(0)), values).interpreted(false);
        RecordedTerms { names, values }
    }
}

/// Record the law as a function of the desired motion, the plant's state and the law's state. Its result is the plant's input.
fn law_of(spec: &LawSpec, widths: [usize; 3]) -> Recorded {
    let tau = |law: &RecordedLaw, inputs: &[Sym]| answer_to(law, inputs, widths).tau.as_slice().to_vec();
    recorded_law(widths.iter().sum(), || RecordedLaw::continuous(spec), tau)
}

/// Record the plant's input and the rate of the law's state. The inputs are those of [`law_of`].
fn rates_of(spec: &LawSpec, widths: [usize; 3]) -> Recorded {
    let rates = |law: &RecordedLaw, inputs: &[Sym]| {
        let Answer { tau, z_dot, .. } = answer_to(law, inputs, widths);
        stacked([&tau, &z_dot]).as_slice().to_vec()
    };
    recorded_law(widths.iter().sum(), || RecordedLaw::continuous(spec), rates)
}

/// Record the law as operations.
///
/// The inputs are the desired motion, the plant's state and the law's state, with the lengths `widths`. The results are the plant's input
/// and the rate of the law's state, then whether both are valid, if the law has a decision. `period` is the time between two calls, s, if it
/// is known. `limits` are the limits of the plant's input, `(n,)` or empty.
pub(super) fn recording(spec: &LawSpec, widths: [usize; 3], period: Option<f64>, limits: &[f64]) -> Recorded {
    let limits = || V::from_iterator(limits.len(), limits.iter().map(|&limit| Sym::splat(limit)));
    let answer = |law: &RecordedLaw, inputs: &[Sym]| {
        let Answer { tau, z_dot, .. } = answer_to(law, inputs, widths);
        let mut answer = stacked([&clamp(&tau, &limits()), &z_dot]).as_slice().to_vec();
        answer.extend(sym::validity());
        answer
    };
    recorded_law(widths.iter().sum(), || RecordedLaw::new(spec, period, limits()), answer)
}

/// Record the law's state at the start of a run, as operations on the plant's state. `states` is the length of the plant's state. The
/// result is `None` if the law's state does not depend on the plant's state.
pub(super) fn start_recording(spec: &LawSpec, states: usize) -> Option<Recorded> {
    let start = |law: &RecordedLaw, x: &[Sym]| {
        let z: Vec<Sym> = spec.initial_state().iter().map(|&z| Sym::splat(z)).collect();
        law.restart(x, &z).as_slice().to_vec()
    };
    spec.restarts().then(|| recorded_law(states, || RecordedLaw::continuous(spec), start))
}
