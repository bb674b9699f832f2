//! Derivatives of runs: forward and by the adjoint, of numbers that a wrapper has named.

use crate::arrays::{Axis, Form, adopted, count, numbers, written_array};
use crate::errors::{Failure, entry, input_error};
use crate::force::{self, Raised, raise};
use crate::interrupts::{long, signalled};
use crate::keywords::Keywords;
use crate::law::Law;
use crate::plant::Plant;
use crate::simulate::several;
use armlet_core::law::LawSpec;
use armlet_core::memory;
use armlet_core::plant::PlantSpec;
use armlet_core::simulate::{self as core, Parameter, Parameters, Problem, record_parts};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The runs of each parameter: run 0 is the one to be differentiated, and those of parameter `p` follow in order, as many as it has weights.
fn parameters(function: &str, value: &Bound<'_, PyAny>, runs: usize) -> Result<Vec<Parameter>, Failure> {
    let (shape, weights) = numbers(function, "weights", value, &[Form(&[Axis::Any("P"), Axis::Any("W")])])?;
    let points = shape[1];
    if 1 + shape[0] * points != runs {
        let problem = format!("has the wrong shape: expected a weight for each of {runs} runs but the first, got {shape:?}");
        return Err(input_error(value.py(), function, "weights", problem).into());
    }
    let parameter = |(p, weights): (usize, &[f64])| weights.iter().enumerate().map(|(j, &weight)| (1 + p * points + j, weight)).collect();
    Ok(memory::collected(weights.chunks_exact(points.max(1)).enumerate().map(parameter))?)
}

/// How many of the parameters each name has.
fn sizes(function: &str, value: &Bound<'_, PyAny>, parameters: usize) -> Result<Vec<usize>, Failure> {
    let sizes: Vec<usize> = value.extract()?;
    if sizes.iter().try_fold(0usize, |sum, &size| sum.checked_add(size)) != Some(parameters) {
        return Err(input_error(value.py(), function, "sizes", format!("do not add up: expected {parameters} in all")).into());
    }
    Ok(sizes)
}

/// Do something with the problem of these arguments.
fn with_problem<'py, T>(
    function: &'static str,
    (plant, law, q0): (&Bound<'py, PyAny>, &Bound<'py, PyAny>, &Bound<'py, PyAny>),
    keywords: &Bound<'py, PyDict>,
    work: impl FnOnce(&Problem, usize, &Raised) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let plants = several::<Plant>(function, "plant", "a plant such as RigidArm, or a list of them", plant)?;
    let laws = several::<Law>(function, "law", "a law such as Adaptive, or a list of them", law)?;
    let plants: Vec<&PlantSpec> = memory::collected(plants.iter().map(|plant| &plant.get().spec))?;
    let laws: Vec<&LawSpec> = memory::collected(laws.iter().map(|law| &law.get().spec))?;
    let given = Keywords { function, keywords: keywords.clone() };
    let options = given.options(plants[0].n())?;
    let (rows, x0) = given.initial_states(&plants, q0, true)?;
    let raised = Raised::default();
    let (forces, force_frame) = given.forces(plants[0], laws[0], &raised)?;
    let forces = memory::collected(forces.iter())?;
    let problem = Problem { plants, laws, x0, forces, force_frame, options, measures: None };
    let done = work(&problem, rows, &raised)?;
    raise(&raised)?;
    Ok(done)
}

/// The derivatives of a run's series, `(K, .., P)` by name; `keywords` as of `simulate_batch` with `t_eval`.
#[entered]
#[pyfunction]
pub fn _sensitivities<'py>(
    py: Python<'py>,
    plant: &Bound<'py, PyAny>,
    law: &Bound<'py, PyAny>,
    q0: &Bound<'py, PyAny>,
    weights: &Bound<'py, PyAny>,
    names: &Bound<'py, PyAny>,
    keywords: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyDict>> {
    const NAME: &str = "simulate";
    entry(py, NAME, || {
        with_problem(NAME, (plant, law, q0), keywords, |problem, rows, raised| {
            let parameters = parameters(NAME, weights, rows)?;
            let sizes = sizes(NAME, names, parameters.len())?;
            let all = Parameters { all: &parameters, sizes: &sizes };
            let mut poll = || force::failed(raised) || signalled();
            let rates = long(py, || core::sensitivities(problem, all, &core::Poller::new(&mut poll)))?;
            let (fields, directions) = (PyDict::new(py), parameters.len());
            for ((name, part), values) in record_parts(problem).0.into_iter().zip(rates) {
                let records = values.len() / (part.len() * directions).max(1);
                fields.set_item(name, adopted(py, &[records, part.len(), directions], values)?)?;
            }
            Ok(fields)
        })
    })
}

/// The derivatives of `sum_k slopes_k' record_k`, `(P,)`: `slopes` has `(K, ..)` by name of a series.
#[entered]
#[pyfunction]
pub fn _adjoint<'py>(
    py: Python<'py>,
    plant: &Bound<'py, PyAny>,
    law: &Bound<'py, PyAny>,
    q0: &Bound<'py, PyAny>,
    weights: &Bound<'py, PyAny>,
    names: &Bound<'py, PyAny>,
    slopes: &Bound<'py, PyDict>,
    bytes: &Bound<'py, PyAny>,
    keywords: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    const NAME: &str = "gradient";
    entry(py, NAME, || {
        with_problem(NAME, (plant, law, q0), keywords, |problem, rows, raised| {
            let parameters = parameters(NAME, weights, rows)?;
            let sizes = sizes(NAME, names, parameters.len())?;
            let all = Parameters { all: &parameters, sizes: &sizes };
            let bytes = count(NAME, "memory", bytes)?;
            let (parts, width) = record_parts(problem);
            let core::Times::At(times) = &problem.options.times else {
                return Err(input_error(py, NAME, "t_eval", "is missing: expected the times of the records, got None").into());
            };
            let records = times.len();
            let mut weighed = memory::zeros(records.saturating_mul(width))?;
            for (name, part) in parts {
                let Some(given) = slopes.get_item(name)? else { continue };
                let (_, own) = numbers(NAME, name, &given, &[Form(&[Axis::Is(records), Axis::Is(part.len())])])?;
                for (to, from) in weighed.chunks_exact_mut(width).zip(own.chunks_exact(part.len())) {
                    to[part.clone()].iter_mut().zip(from).for_each(|(to, from)| *to += from);
                }
            }
            let mut poll = || force::failed(raised) || signalled();
            let gradient = long(py, || core::adjoint(problem, all, &weighed, bytes, &core::Poller::new(&mut poll)))?;
            let own = |out: &mut [f64]| -> Result<(), Failure> {
                out.copy_from_slice(&gradient);
                Ok(())
            };
            written_array(py, &[parameters.len()], own)
        })
    })
}
