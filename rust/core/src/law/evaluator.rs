//! A law that is evaluated at single instants, like `law(t, q, v)` in Python. The first calls run directly, later ones by its program, with
//! the same bits.

use super::{Law, LawSpec, Route};
use crate::motion::{Motion, sample_all};
use crate::scalar::{Float, Real};
use crate::trace::function::{self, CALLS, Evaluation, Recorded, record};
use crate::trace::sym::Sym;

/// The largest number of joints for which a law becomes a program here. For larger arms the recording takes longer than the calls save.
const MOST_JOINTS: usize = 12;

/// A law on one number, with its buffers.
struct Engine<S: Real> {
    law: Box<dyn Law<S> + Send>,
    trig: Vec<(S, S)>,
    tau: Vec<S>,
    dz: Vec<S>,
}

impl<S: Real> Engine<S> {
    fn new(spec: &LawSpec) -> Self {
        let (n, zeros) = (spec.model().n(), |k: usize| vec![S::zero(); k]);
        let trig = vec![(S::zero(), S::zero()); n];
        Engine { law: LawSpec::build(|_| spec), trig, tau: zeros(n), dz: zeros(spec.initial_state().len()) }
    }

    fn turn(&mut self, x: &[S]) {
        for (trig, q) in self.trig.iter_mut().zip(x) {
            *trig = q.sin_cos();
        }
    }

    /// Start the filters in the law's state at the state of the plant.
    fn restart(&mut self, x: &[S], z: &mut [S]) {
        self.turn(x);
        self.law.restart(&self.trig, x, z);
    }

    /// The plant's input under the desired motion, at the state of the plant and of the law.
    fn input(&mut self, desired: &[S], x: &[S], z: &[S]) -> &[S] {
        self.turn(x);
        self.law.evaluate(desired, &self.trig, x, z, &mut self.tau, &mut self.dz);
        &self.tau
    }

    /// The plant's input from one array: the desired motion, the state of the plant and that of the law, with these widths.
    fn input_of(&mut self, inputs: &[S], widths: [usize; 3]) -> &[S] {
        let (desired, state) = inputs.split_at(widths[0]);
        let (x, z) = state.split_at(widths[1]);
        self.input(desired, x, z)
    }
}

/// The buffers of one law between calls. A call allocates nothing.
pub struct LawEvaluator {
    direct: Engine<Float>,
    spec: LawSpec,
    calls: usize,
    program: Option<Evaluation>,
    motions: Vec<Motion>,
    /// The desired motion, the state of the plant and that of the law, one after another.
    inputs: Vec<f64>,
    /// The number of numbers of each of the three.
    widths: [usize; 3],
}

impl LawEvaluator {
    pub fn new(spec: &LawSpec) -> Self {
        let desired = spec.motions().iter().map(|motion| 3 * motion.dof()).sum();
        let widths = [desired, spec.plant().states(spec.model().n()), spec.initial_state().len()];
        LawEvaluator {
            direct: Engine::new(spec),
            spec: spec.clone(),
            calls: 0,
            program: None,
            motions: spec.motions().into_iter().cloned().collect(),
            inputs: vec![0.0; widths.iter().sum()],
            widths,
        }
    }

    /// The plant's input `(n,)` at time `t`, for the parts of the plant's state one after another, and the law's state `z`. `None` is the
    /// state at the start of a run.
    pub fn input(&mut self, t: f64, parts: &[&[f64]], z: Option<&[f64]>, tau: &mut [f64]) {
        let (desired, state) = self.inputs.split_at_mut(self.widths[0]);
        sample_all(&self.motions, t, Float::of_mut(desired));
        let (x, law) = state.split_at_mut(self.widths[1]);
        x.iter_mut().zip(parts.iter().copied().flatten()).for_each(|(to, from)| *to = *from);
        law.copy_from_slice(z.unwrap_or(self.spec.initial_state()));
        if z.is_none() {
            self.direct.restart(Float::of(x), Float::of_mut(law));
        }
        if let Some(program) = &mut self.program {
            program.inputs(0, self.inputs.len()).copy_from_slice(&self.inputs);
            program.run();
            if program.is_near(0) {
                tau.copy_from_slice(program.outputs(0, tau.len()));
                return;
            }
        }
        self.direct.law.at(t);
        Float::of_mut(tau).copy_from_slice(self.direct.input_of(Float::of(&self.inputs), self.widths));
        self.calls += 1;
        if self.calls == CALLS {
            self.program = recorded(&self.spec, self.widths);
        }
    }
}

/// The law as a program. `None` for a law of the caller, of a large arm, and for a law that decides ranks, whose program is not always
/// valid.
fn recorded(spec: &LawSpec, widths: [usize; 3]) -> Option<Evaluation> {
    if spec.route() == Route::Outside || spec.model().n() > MOST_JOINTS {
        return None;
    }
    let mut guarded = false;
    let program = record(
        false,
        widths.iter().sum(),
        || Engine::<Sym>::new(spec),
        |mut law, inputs| {
            let tau = law.input_of(inputs, widths).to_vec();
            guarded = law.law.stands().is_some();
            tau
        },
    );
    program.filter(|_| !guarded)
}

/// The law as operations. Its inputs are the desired motion, the state of the plant and that of the law, of these widths. Its results are
/// the plant's input, the rate of the law's state, and whether both are valid if the law reports this. `period` is the time between two
/// calls, if it is known; `limits` are those of the input, `(n,)` or none. `None` if the code branches on data.
pub(super) fn recording(spec: &LawSpec, widths: [usize; 3], period: Option<f64>, limits: &[f64]) -> Option<Recorded> {
    let limits_of = || limits.iter().map(|&limit| Sym::splat(limit)).collect::<Vec<Sym>>();
    let set_up = || {
        let mut engine = Engine::<Sym>::new(spec);
        engine.law.configure(period, &limits_of());
        engine
    };
    function::recorded(widths.iter().sum(), set_up, |mut law, inputs| {
        let mut answer = law.input_of(inputs, widths).to_vec();
        for (tau, limit) in answer.iter_mut().zip(limits_of()) {
            *tau = tau.clamped(-limit, limit);
        }
        answer.extend(&law.dz);
        answer.extend(law.law.stands());
        answer
    })
}

/// The law's state at the start of a run as operations on the plant's state of this width. `None` if it does not depend on that state.
pub(super) fn start_recording(spec: &LawSpec, states: usize) -> Option<Recorded> {
    if !spec.restarts() {
        return None;
    }
    let begin = |mut law: Engine<Sym>, x: &[Sym]| {
        let mut z: Vec<Sym> = spec.initial_state().iter().map(|&z| Sym::splat(z)).collect();
        law.restart(x, &mut z);
        z
    };
    function::recorded(states, || Engine::<Sym>::new(spec), begin)
}
