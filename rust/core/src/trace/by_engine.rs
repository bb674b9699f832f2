//! The choice of the engine of a recording. The interpreter computes the first evaluations. After some of them, machine code repays its
//! compilation. Both have the same bits.

use super::cache::MadeOnce;
use super::function::{Evaluation, Recorded};
use super::program::{Engine, engine};
use super::rows::Rows;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The number of evaluations by the interpreter after which machine code repays its compilation. Both times are proportional to the number
/// of operations.
pub const REPAYS: usize = 256;

/// The programs of one recording for each engine, made on first use, and the number of evaluations so far. All users of the recording
/// share them.
pub struct ByEngine<T> {
    interpreter: MadeOnce<T>,
    machine: MadeOnce<T>,
    evaluations: AtomicUsize,
}

impl<T> Default for ByEngine<T> {
    fn default() -> Self {
        ByEngine { interpreter: MadeOnce::default(), machine: MadeOnce::default(), evaluations: AtomicUsize::new(0) }
    }
}

impl<T> ByEngine<T> {
    /// Return the programs for `engine`. `make` makes them on first use.
    pub fn get(&self, engine: Engine, make: impl FnOnce() -> T) -> Arc<T> {
        match engine {
            Engine::Machine => self.machine.get(make),
            Engine::Interpreter => self.interpreter.get(make),
        }
    }

    /// Count some evaluations, and return whether machine code repays.
    pub fn count(&self, evaluations: usize) -> bool {
        self.evaluations.fetch_add(evaluations, Ordering::Relaxed) + evaluations >= REPAYS
    }

    /// Whether machine code repays: it exists already, or there were many evaluations.
    pub fn repays(&self) -> bool {
        self.count(0) || self.machine.known().is_some()
    }
}

/// A recorded function with its programs for each engine. Evaluators of recordings with equal operations share it.
pub struct SharedFunction {
    pub recorded: Recorded,
    /// Whether there is one row of inputs per lane.
    lanes: bool,
    /// The largest number of operations for which machine code is made. It limits the time of the evaluation that makes it.
    most: usize,
    programs: ByEngine<Evaluation>,
}

impl SharedFunction {
    pub fn new(recorded: Recorded, lanes: bool) -> Self {
        SharedFunction { recorded, lanes, most: usize::MAX, programs: ByEngine::default() }
    }

    /// Leave a function of more than `most` operations to the interpreter.
    pub fn up_to(self, most: usize) -> Self {
        SharedFunction { most, ..self }
    }

    /// Return the function for an engine, with these set-up parameters.
    fn evaluation(&self, engine: Engine, values: &[f64]) -> Evaluation {
        let recorded = || self.recorded.clone();
        let made = self.programs.get(engine, || match engine {
            Engine::Machine => recorded().program(self.lanes),
            Engine::Interpreter => recorded().interpreted(self.lanes),
        });
        let mut evaluation = (*made).clone();
        evaluation.set_up(values);
        evaluation
    }
}

/// A recorded function that the interpreter evaluates until machine code repays. The interpreter also evaluates it at angles for which
/// machine code is not valid.
///
/// ```
/// use armlet_core::scalar::Real;
/// use armlet_core::trace::by_engine::{Evaluator, SharedFunction};
/// use armlet_core::trace::{Sym, function::recorded};
/// use std::sync::Arc;
///
/// // `f(x) = k sin x`, with the set-up parameter `k`.
/// let f = recorded(1, || Sym::varying(0.5), |k, x| vec![k * x[0].sin_cos().0]).unwrap();
/// let mut f = Evaluator::new(Arc::new(SharedFunction::new(f, false)), &[0.25]);
/// for x in (0..300).map(f64::from).chain([1e7, 1.0]) {
///     f.inputs().copy_from_slice(&[x]);
///     f.run();
///     assert!((f.outputs(0, 1)[0] - 0.25 * x.sin()).abs() < 1e-15);
/// }
/// ```
#[derive(Clone)]
pub struct Evaluator {
    function: Arc<SharedFunction>,
    values: Vec<f64>,
    /// The evaluation by the engine in use.
    present: Evaluation,
    engine: Engine,
    /// The evaluation by the interpreter after the first angle that is too large for machine code.
    fallback: Option<Evaluation>,
    /// Whether the last angles were too large.
    far: bool,
}

impl Evaluator {
    /// Return an evaluator of a function with the set-up parameters `values`.
    pub fn new(function: Arc<SharedFunction>, values: &[f64]) -> Self {
        let engine =
            if function.programs.repays() && function.recorded.ops.len() <= function.most { engine() } else { Engine::Interpreter };
        let present = function.evaluation(engine, values);
        Evaluator { function, values: values.to_vec(), present, engine, fallback: None, far: false }
    }

    /// Return this evaluator for `evaluations` evaluations. If they repay machine code, it is made now.
    pub fn expecting(mut self, evaluations: usize) -> Self {
        self.count(evaluations);
        self
    }

    pub fn lanes(&self) -> usize {
        self.present.lanes()
    }

    /// The memory of all inputs, with all lanes.
    pub fn inputs(&mut self) -> &mut [f64] {
        self.present.all_inputs()
    }

    /// Copy rows of the first inputs: see [`Evaluation::read`].
    pub fn read(&mut self, inputs: &[Rows], at: usize) {
        self.present.read(inputs, at);
    }

    /// Count evaluations by the interpreter. If machine code repays, use it from now on.
    fn count(&mut self, evaluations: usize) {
        let repays = self.engine == Engine::Interpreter && self.function.programs.count(evaluations);
        if repays && engine() == Engine::Machine && self.function.recorded.ops.len() <= self.function.most {
            self.engine = Engine::Machine;
            let mut machine = self.function.evaluation(self.engine, &self.values);
            machine.all_inputs().copy_from_slice(self.present.all_inputs());
            self.fallback = Some(std::mem::replace(&mut self.present, machine));
        }
    }

    /// Evaluate the function for the present inputs.
    pub fn run(&mut self) {
        self.count(1);
        self.present.run();
        self.far = self.engine == Engine::Machine && !self.present.is_valid();
        if self.far {
            let Evaluator { function, values, present, .. } = self;
            let fallback = self.fallback.get_or_insert_with(|| function.evaluation(Engine::Interpreter, values));
            fallback.all_inputs().copy_from_slice(present.all_inputs());
            fallback.run();
        }
    }

    /// The evaluation with the last results.
    pub fn last(&self) -> &Evaluation {
        self.fallback.as_ref().filter(|_| self.far).unwrap_or(&self.present)
    }

    /// The `count` results from `first` on, with all lanes.
    pub fn outputs(&self, first: usize, count: usize) -> &[f64] {
        self.last().outputs(first, count)
    }
}
