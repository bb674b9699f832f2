//! The loop of a run and its functions, ready to be differentiated.

use super::directions::{Directions, start_rates};
use super::functions::LoopFunctions;
use super::parameters::Parameters;
use super::set_ups::SetUps;
use super::structure::FunctionStore;
use super::timeline::{AdaptivePath, Timeline};
use crate::error::{Error, Result};
use crate::integrate::Tableau;
use crate::simulate::problem::Problem;
use crate::simulate::problem::times::Times;
use crate::simulate::stop::Stop;
use std::sync::Arc;

/// A run that is ready to be differentiated.
pub struct Prepared<'a> {
    pub single: Problem<'a>,
    pub tableau: Tableau,
    pub directions: Arc<Directions<'a>>,
    pub set_ups: Arc<SetUps>,
    pub functions: Arc<LoopFunctions>,
    pub timeline: Timeline,
    /// The tangents of the state at the start, shape `(states, count)`.
    pub start: Vec<f64>,
}

impl Prepared<'_> {
    /// The loop parameters that are inputs of the functions.
    pub fn given(&self) -> &[f64] {
        &self.set_ups.values
    }
}

/// A run, and the path of an adaptive run whose timeline has no records yet.
pub type Preparation<'a> = (Prepared<'a>, Option<AdaptivePath>);

/// The directions and the set-ups of a loop. All runs of the loop share them.
pub struct Loop<'a> {
    pub tableau: Tableau,
    pub directions: Arc<Directions<'a>>,
    pub set_ups: Arc<SetUps>,
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
    pub fn of(problem: &'a Problem<'a>, parameters: Parameters) -> Result<Self> {
        problem.validate()?;
        let (o, law) = (&problem.options, problem.law(0));
        if o.monitors {
            return Err(Error::input("monitors", "have no derivatives: expected a run without monitors"));
        }
        if !matches!(o.times, Times::At(_)) {
            return Err(Error::input("times", "are not given: expected the times of the results"));
        }
        let Some(tableau) = o.method.tableau() else {
            let problem =
                format!("has no derivatives of runs: expected one of euler, semi_implicit, rk4, dopri5, dop853, got {}", o.method.name());
            return Err(Error::input("method", problem));
        };
        let refused = |argument: &str, expected: &str, got: &str| {
            Err(Error::input(argument, format!("has no derivatives of runs: expected {expected}, got {got}")))
        };
        if !law.route().is_differentiable() {
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

    /// Prepare run 0 of a problem whose loop is `self`. The second result is the path of an adaptive run, whose timeline is not complete:
    /// see [`completed`](super::controlled_steps::completed). `known`: the recorded functions of all loops of the call.
    pub fn prepare(
        &self,
        problem: &Problem<'a>,
        parameters: Parameters,
        known: &FunctionStore,
        stop: &dyn Stop,
    ) -> Result<Preparation<'a>> {
        let (single, start) = (single(problem), start_rates(problem, parameters)?);
        let (timeline, path) = Timeline::of(&single, stop)?;
        let functions = known.functions(problem, &self.directions, &self.set_ups, &timeline.contacts)?;
        let (directions, set_ups) = (self.directions.clone(), self.set_ups.clone());
        Ok((Prepared { single, tableau: self.tableau.clone(), directions, set_ups, functions, timeline, start }, path))
    }
}
