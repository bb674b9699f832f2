//! Evaluation of a law at single instants, like `law(t, q, v)` in Python.
//!
//! The first calls evaluate the law directly. Later calls run its program (its recorded and compiled operations) with the same bits, if the
//! law has a program.

use super::{Law, LawSpec, Route};
use crate::motion::{Motion, sample_all};
use crate::scalar::Real;
use crate::trace::function::{self, CALLS, Evaluation, Recorded, record};
use crate::trace::sym::{self, Sym};

/// The largest number of joints for which this evaluator records a law. It limits the time of the recording.
const MOST_JOINTS: usize = 12;

/// A law on one number type, with its buffers.
struct BufferedLaw<S: Real> {
    law: Box<dyn Law<S> + Send>,
    trig: Vec<(S, S)>,
    tau: Vec<S>,
    dz: Vec<S>,
}

impl<S: Real> BufferedLaw<S> {
    fn new(spec: &LawSpec) -> Self {
        let (n, zeros) = (spec.model().n(), |k: usize| vec![S::zero(); k]);
        let trig = vec![(S::zero(), S::zero()); n];
        BufferedLaw { law: spec.build(), trig, tau: zeros(n), dz: zeros(spec.initial_state().len()) }
    }

    fn turn(&mut self, x: &[S]) {
        for (trig, q) in self.trig.iter_mut().zip(x) {
            *trig = q.sin_cos();
        }
    }

    /// Initialise the filters in the law's state `z` from the plant's state `x`.
    fn restart(&mut self, x: &[S], z: &mut [S]) {
        self.turn(x);
        self.law.restart(&self.trig, x, z);
    }

    /// The plant's input for the desired motion, at the plant's state `x` and the law's state `z`.
    fn input(&mut self, desired: &[S], x: &[S], z: &[S]) -> &[S] {
        self.turn(x);
        self.law.evaluate(desired, &self.trig, x, z, &mut self.tau, &mut self.dz);
        &self.tau
    }

    /// The plant's input from one array: the desired motion, the plant's state and the law's state, with the lengths `widths`.
    fn input_of(&mut self, inputs: &[S], widths: [usize; 3]) -> &[S] {
        let (desired, state) = inputs.split_at(widths[0]);
        let (x, z) = state.split_at(widths[1]);
        self.input(desired, x, z)
    }
}

/// A law that is evaluated at single instants, with its buffers. A call allocates nothing, except the call that records the program.
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
    direct: BufferedLaw<f64>,
    spec: LawSpec,
    calls: usize,
    program: Option<Evaluation>,
    motions: Vec<Motion>,
    /// The desired motion, the plant's state and the law's state, one after another.
    inputs: Vec<f64>,
    /// The lengths of the three parts of `inputs`.
    widths: [usize; 3],
}

impl LawEvaluator {
    /// Create the buffers for the law `spec`.
    pub fn new(spec: &LawSpec) -> Self {
        let desired = spec.motions().iter().map(|motion| 3 * motion.dof()).sum();
        let widths = [desired, spec.plant().states(spec.model().n()), spec.initial_state().len()];
        LawEvaluator {
            direct: BufferedLaw::new(spec),
            spec: spec.clone(),
            calls: 0,
            program: None,
            motions: spec.motions().into_iter().cloned().collect(),
            inputs: vec![0.0; widths.iter().sum()],
            widths,
        }
    }

    /// Compute the plant's input `tau`, `(n,)`, at time `t`, s.
    ///
    /// `parts` has the parts of the plant's state, one after another. `z` is the law's state; `None` means the state at the start of a run.
    pub fn input(&mut self, t: f64, parts: &[&[f64]], z: Option<&[f64]>, tau: &mut [f64]) {
        let (desired, state) = self.inputs.split_at_mut(self.widths[0]);
        sample_all(&self.motions, t, desired);
        let (x, law) = state.split_at_mut(self.widths[1]);
        x.iter_mut().zip(parts.iter().copied().flatten()).for_each(|(to, from)| *to = *from);
        law.copy_from_slice(z.unwrap_or(self.spec.initial_state()));
        if z.is_none() {
            self.direct.restart(x, law);
        }
        if let Some(program) = &mut self.program {
            program.inputs(0, self.inputs.len()).copy_from_slice(&self.inputs);
            program.run();
            if program.is_near(0) {
                tau.copy_from_slice(program.outputs(0, tau.len()));
                return;
            }
        }
        if let LawSpec::External(law) = &self.spec {
            return law.evaluate(t, &self.inputs[self.widths[0]..][..self.widths[1]], tau);
        }
        tau.copy_from_slice(self.direct.input_of(&self.inputs, self.widths));
        self.calls += 1;
        if self.calls == CALLS {
            self.program = recorded(&self.spec, self.widths);
        }
    }
}

/// Record the law as a program. The result is `None` for a function of the caller, and for a large arm.
fn recorded(spec: &LawSpec, widths: [usize; 3]) -> Option<Evaluation> {
    if spec.route() == Route::Outside || spec.model().n() > MOST_JOINTS {
        return None;
    }
    record(false, widths.iter().sum(), || BufferedLaw::<Sym>::new(spec), |mut law, inputs| law.input_of(inputs, widths).to_vec())
}

/// Record the law as operations; `None` if the code branches on data.
///
/// The inputs are the desired motion, the plant's state and the law's state, with the lengths `widths`. The results are the plant's input
/// and the rate of the law's state, then whether both are valid, if the law has a decision. `period` is the time between two calls, s, if it
/// is known. `limits` are the limits of the plant's input, `(n,)` or empty.
pub(super) fn recording(spec: &LawSpec, widths: [usize; 3], period: Option<f64>, limits: &[f64]) -> Option<Recorded> {
    let limits_of = || limits.iter().map(|&limit| Sym::splat(limit)).collect::<Vec<Sym>>();
    let set_up = || {
        let mut engine = BufferedLaw::<Sym>::new(spec);
        engine.law.configure(period, &limits_of());
        engine
    };
    function::recorded(widths.iter().sum(), set_up, |mut law, inputs| {
        let mut answer = law.input_of(inputs, widths).to_vec();
        for (tau, limit) in answer.iter_mut().zip(limits_of()) {
            *tau = tau.clamped(-limit, limit);
        }
        answer.extend(&law.dz);
        answer.extend(sym::validity());
        answer
    })
}

/// Record the law's state at the start of a run, as operations on the plant's state. `states` is the length of the plant's state. The
/// result is `None` if the law's state does not depend on the plant's state.
pub(super) fn start_recording(spec: &LawSpec, states: usize) -> Option<Recorded> {
    if !spec.restarts() {
        return None;
    }
    let begin = |mut law: BufferedLaw<Sym>, x: &[Sym]| {
        let mut z: Vec<Sym> = spec.initial_state().iter().map(|&z| Sym::splat(z)).collect();
        law.restart(x, &mut z);
        z
    };
    function::recorded(states, || BufferedLaw::<Sym>::new(spec), begin)
}
