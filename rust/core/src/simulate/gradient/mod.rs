//! Derivatives of a run with respect to its parameters (Griewank and Walther 2008; Hairer, Norsett and Wanner, section I.14).
//!
//! A run is a list of operations on one state `X`: steps `x_next = x + h sum b_i k_i` with the slopes `k_i`, samples of the law, and
//! records. The forward pass applies the operations to the tangents `X_p`. The backward pass applies the adjoints of the operations, in
//! reverse order. It reads the states before the operations from memory, or computes them again. The state rates and the law are recorded
//! as lists of operations, and these lists are differentiated. With an adaptive method, both passes repeat the steps of the run, and the
//! step sizes count as constants. Where a contact changes, the tangents jump.
//!
//! A parameter `p` is given by runs of the problem that differ in this parameter, and by weights: `dF/dp = sum w_i F_i`. Here `F` is a loop
//! parameter, the initial state or a desired motion, and `F_i` its value in run `i`. Differences of results of runs are not used.
//!
//! Terms of this directory:
//!
//! - A loop parameter is a number that is constant in a run, such as a mass, a gain, a target or a limit. It varies if a parameter `p`
//!   changes it.
//! - The exogenous input `u` is the desired motion and the external force.
//! - The held input is the plant's input and the rate of the law's state between two samples of a sampled law.
//! - A mode of the contacts lists for each contact whether it is apart, pressed or slack ([`Touch`](crate::plant::Touch)).
//! - The tangent of a quantity is its derivative along a direction in the space of the parameters.
//! - The weight of a quantity is the derivative of the weighted sum of the records with respect to it (the adjoint).

mod backward;
mod combine;
mod directions;
mod forward;
mod functions;
mod rows;
mod series;
mod shared;
mod structure;
mod switch;
mod timeline;
mod walk;

use super::columns::Columns;
use super::problem::Problem;
use super::schedule::Times;
use super::stop::Stop;
use crate::error::{Error, Result};
use crate::integrate::Tableau;
use directions::{Directions, start_rates};
use functions::LoopFunctions;
pub use rows::{Rows, adjoint_of_rows, sensitivities_of_rows};
use series::Series;
pub use shared::Shared;
use std::ops::Range;
use std::sync::Arc;
use structure::{FunctionStore, SetUps};
use timeline::Timeline;

/// One parameter, as pairs `(run, weight)`. The derivative of a loop parameter `F` is `sum weight F(run)`.
pub type Parameter = Vec<(usize, f64)>;

/// The parameters of a run, listed name by name, with the number of parameters of each name.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # use std::sync::atomic::AtomicBool;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Parameters, Problem, Times, sensitivities};
///
/// // The joint oscillates with q = cos w t, with w = sqrt(kp / 2). Two laws, with kp = 2 and kp = 3, give the derivative
/// // of the loop parameters with respect to kp.
/// let stiffer = LawSpec::from(PdGravitySpec::new(model, vec![0.0], Gain::scalar("kp", 1, 3.0)?, Gain::not_negative("kd", vec![0.0])?)?);
/// let options = Options { times: Times::At(vec![1.0]), monitors: false, ..Options::fixed(1.0, 0.01) };
/// let mut problem = Problem::from_rest(&plant, &law, &dvector![1.0], options)?;
/// (problem.laws, problem.x0) = (vec![&law, &stiffer], vec![1.0, 0.0, 1.0, 0.0]);
/// let kp = vec![(0, -1.0), (1, 1.0)];
/// let parameters = Parameters { all: &[kp], sizes: &[1], shared: &[] };
/// let q = &sensitivities(&problem, parameters, &AtomicBool::new(false))?[0];
/// assert!((q[0] + 1f64.sin() / 4.0).abs() < 1e-8);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Parameters<'a> {
    /// The parameters of all names.
    pub all: &'a [Parameter],
    /// The number of parameters of each name.
    pub sizes: &'a [usize],
    /// The groups of parameters that vary in the same runs.
    pub shared: &'a [Shared],
}

/// The names of the series of a record, and the range of each series in the record.
pub type RecordParts = Vec<(&'static str, Range<usize>)>;

/// Return the series of a record `[x, tau]`, and the number of elements of the record.
pub fn record_parts(problem: &Problem) -> (RecordParts, usize) {
    let columns = Columns::of(problem);
    let size = problem.plant(0).states() + columns.p;
    let names = ["q", "v", "tau", "theta", "theta_dot", "estimate", "bristles"];
    (names.into_iter().zip(columns.series(size, 0)).filter(|(_, range)| !range.is_empty()).collect(), size + columns.n)
}

/// A run that is ready to be differentiated.
struct Prepared<'a> {
    single: Problem<'a>,
    tableau: Tableau,
    directions: Arc<Directions<'a>>,
    set_ups: Arc<SetUps>,
    functions: Arc<LoopFunctions>,
    timeline: Timeline,
    /// The tangents of the state at the start, shape `(states, count)`.
    start: Vec<f64>,
}

impl Prepared<'_> {
    /// The loop parameters that are inputs of the functions.
    fn given(&self) -> &[f64] {
        &self.set_ups.values
    }
}

/// The directions and the set-ups of a loop. All runs of the loop share them.
struct Loop<'a> {
    tableau: Tableau,
    directions: Arc<Directions<'a>>,
    set_ups: Arc<SetUps>,
}

/// Return the problem that consists of run 0 of `problem`.
fn single<'a>(problem: &Problem<'a>) -> Problem<'a> {
    let states = problem.plant(0).states();
    Problem {
        plants: vec![problem.plant(0)],
        laws: vec![problem.law(0)],
        x0: problem.x0[..states].to_vec(),
        forces: problem.force(0).into_iter().collect(),
        force_frame: problem.force_frame,
        options: problem.options.clone(),
        measures: None,
    }
}

impl<'a> Loop<'a> {
    fn of(problem: &'a Problem<'a>, parameters: Parameters) -> Result<Self> {
        problem.validate()?;
        let (o, law) = (&problem.options, problem.law(0));
        debug_assert!(
            !o.monitors && matches!(o.times, Times::At(_)),
            "the derivatives are those of a run without monitors, at given times"
        );
        let Some(tableau) = o.method.tableau() else {
            let problem =
                format!("has no derivatives of runs: expected one of euler, semi_implicit, rk4, dopri5, dop853, got {}", o.method.name());
            return Err(Error::input("method", problem));
        };
        let refused = |argument: &str, expected: &str, got: &str| {
            Err(Error::input(argument, format!("has no derivatives of runs: expected {expected}, got {got}")))
        };
        if !law.route().is_recordable() {
            return refused("law", "a law that is recorded as a program", law.name());
        }
        if o.sampling.as_ref().is_some_and(|sampling| sampling.torque_sensor.is_some()) {
            return refused("sample_time", "a Sampling without torque_sensor", "one with it");
        }
        if problem.plants.iter().any(|plant| plant.sticks()) {
            return refused("plant", "a plant without stick-slip friction", "one with it");
        }
        let directions = Arc::new(Directions::of(problem, parameters)?);
        let set_ups = Arc::new(SetUps::of(problem, &directions));
        Ok(Loop { tableau, directions, set_ups })
    }

    /// Prepare run 0 of a problem whose loop is `self`. `known`: the recorded functions of all loops of the call.
    fn prepare(&self, problem: &Problem<'a>, parameters: Parameters, known: &FunctionStore, stop: &dyn Stop) -> Result<Prepared<'a>> {
        let (single, start) = (single(problem), start_rates(problem, parameters)?);
        let timeline = Timeline::of(&single, stop)?;
        let functions = known.functions(problem, &self.directions, &self.set_ups, &timeline.contacts)?;
        let (directions, set_ups) = (self.directions.clone(), self.set_ups.clone());
        Ok(Prepared { single, tableau: self.tableau.clone(), directions, set_ups, functions, timeline, start })
    }
}

fn prepare<'a>(problem: &'a Problem<'a>, parameters: Parameters, stop: &dyn Stop) -> Result<Prepared<'a>> {
    Loop::of(problem, parameters)?.prepare(problem, parameters, &FunctionStore::default(), stop)
}

/// Return the derivatives of the records of run 0 of `problem`, at the times of its options. Each part that [`record_parts`] names has an
/// array of shape `(records, numbers, parameters)`, in the units of the record per unit of the parameter. The options must have
/// `Times::At`, and no monitors.
///
/// Errors: `Input` for a parameter, method, law or plant without a derivative. `Solve` if the run ends early, grazes a contact, has tasks
/// near a singularity or an angle above 10^6 rad.
pub fn sensitivities(problem: &Problem, parameters: Parameters, stop: &dyn Stop) -> Result<Vec<Vec<f64>>> {
    let prepared = prepare(problem, parameters, stop)?;
    let (parts, _) = record_parts(problem);
    let mut series = Series::zeros(parts.into_iter().map(|(_, range)| range), prepared.timeline.records, parameters.all.len())?;
    forward::run(&prepared, &mut series)?;
    Ok(series.into_rates())
}

/// Return `sum_k w_k' dr_k/dp` for the records `r_k = [x, tau]` of run 0 of `problem`, one number per parameter. `'` is the transpose.
///
/// `weights`: the `w_k`, shape `(records, numbers)`. `memory`: an approximate limit of the stored states, in bytes. Other states are
/// computed again. Errors: as for [`sensitivities`].
pub fn adjoint(problem: &Problem, parameters: Parameters, weights: &[f64], memory: usize, stop: &dyn Stop) -> Result<Vec<f64>> {
    backward::run(&prepare(problem, parameters, stop)?, weights, memory)
}
