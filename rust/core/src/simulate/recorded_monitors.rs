//! The monitors of runs whose programs (recorded and compiled loops) do not compute them: one recorded function of a record. The interpreter
//! computes the first records, and machine code the later ones ([`Evaluator`]).

use super::monitors;
use super::problem::Problem;
use super::problem::force::{Force, Wrench};
use super::record::key::Common;
use super::record::structure::{self, Seen, inputs, instant};
use crate::motion::{Motion, sample_all};
use crate::trace::by_engine::{Evaluator, SharedFunction};
use crate::trace::cache::Cache;
use crate::trace::function::Recorded;
use crate::trace::{Sym, sym};
use std::sync::Arc;

/// The recorded monitors of all loops with one structure. The function has the desired motion, the wrench, the state, the plant's input and
/// the reference values as inputs. Its results are the monitors, then the reference values if this record is the first one.
struct MonitorFunction {
    function: Arc<SharedFunction>,
    monitors: usize,
    firsts: usize,
}

static KNOWN: Cache<Arc<Seen<MonitorFunction, ()>>> = Cache::new();

impl MonitorFunction {
    /// Return the function of run `run` of a problem, and its loop parameters.
    fn of_run(problem: &Problem, run: usize) -> (Arc<Self>, Vec<f64>) {
        let common = Common { notes: Some(monitors::names(problem).len()), ..Common::of_functions(problem) };
        let parameters = structure::loop_parameters(problem, run, common);
        let seen = Seen::of_run(&KNOWN, (problem, run, common), &parameters, (), || Self::record(problem, run, common));
        (seen.recorded.clone(), parameters.values)
    }

    fn record(problem: &Problem, run: usize, common: Common) -> Self {
        sym::begin();
        let (closed, extras) = structure::set_up(problem, run, common);
        let Some(notes) = extras.notes else { unreachable!("the set-up has monitors") };
        let given = sym::end_set_up();
        let (monitors, firsts) = notes.sizes();
        let before = sym::recorded().1;
        let u = instant([desired_of(problem, run), if problem.forces.is_empty() { 0 } else { 6 }]);
        let (x, tau, first) = (inputs(closed.size()), inputs(closed.tau.len()), inputs(firsts));
        let inputs = (sym::recorded().1 - before) as usize;
        let noted = notes.take(&u, &x, &tau, &first);
        let numbers = noted.numbers[tau.len()..].iter().chain(&noted.firsts[..firsts]);
        let answer = numbers.map(|value| Sym::index(*value)).collect();
        let recording = sym::finish();
        assert!(!recording.failed, "no monitor reads the value of a recorded number");
        let recorded = Recorded { ops: recording.ops, values: vec![0.0; given], inputs, answer };
        MonitorFunction { function: Arc::new(SharedFunction::new(recorded, false)), monitors, firsts }
    }
}

/// The size of the desired motions of a run, with their rates and accelerations.
fn desired_of(problem: &Problem, run: usize) -> usize {
    problem.law(run).motions().iter().map(|motion| 3 * motion.dof()).sum()
}

/// The monitors of one run with its desired motions and force.
pub struct Monitors<'a> {
    motions: Vec<&'a Motion>,
    force: Option<&'a Force>,
    values: Evaluator,
    /// The number of monitors, and of reference values.
    sizes: [usize; 2],
    /// The desired motion, the wrench, the state, the plant's input, and the reference values.
    row: Vec<f64>,
    /// The length of the desired motion, and of the wrench.
    widths: [usize; 2],
    /// Whether the reference values are known.
    begun: bool,
}

impl<'a> Monitors<'a> {
    /// Create the monitors of run `run` of a problem.
    pub fn new(problem: &Problem<'a>, run: usize) -> Self {
        let law = problem.law(run);
        let (monitors, given) = MonitorFunction::of_run(problem, run);
        Monitors {
            motions: law.motions(),
            force: problem.force(run),
            values: Evaluator::new(monitors.function.clone(), &given),
            sizes: [monitors.monitors, monitors.firsts],
            row: vec![0.0; monitors.function.recorded.inputs],
            widths: [desired_of(problem, run), if problem.forces.is_empty() { 0 } else { 6 }],
            begun: false,
        }
    }

    /// Compute the monitors at time `t`, s, state `x` and input `tau`, and write them to `out`.
    pub fn evaluate(&mut self, t: f64, x: &[f64], tau: &[f64], out: &mut [f64]) {
        let [desired, wrench] = self.widths;
        sample_all(self.motions.iter().copied(), t, &mut self.row[..desired]);
        let force: Wrench = self.force.map_or([0.0; 6], |force| force.at(t));
        let (outside, rest) = self.row[desired..].split_at_mut(wrench);
        outside.copy_from_slice(&force[..wrench]);
        rest[..x.len()].copy_from_slice(x);
        rest[x.len()..x.len() + tau.len()].copy_from_slice(tau);
        self.run();
        let [monitors, firsts] = self.sizes;
        if !self.begun && firsts > 0 {
            let at = self.row.len() - firsts;
            self.row[at..].copy_from_slice(self.values.outputs(monitors, firsts));
            self.run();
        }
        self.begun = true;
        out.copy_from_slice(self.values.outputs(0, monitors));
    }

    fn run(&mut self) {
        self.values.inputs().copy_from_slice(&self.row);
        self.values.run();
    }
}
