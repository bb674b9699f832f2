//! Derivatives of simulated runs with respect to named parameters, by forward sensitivities and by the adjoint method.
//!
//! Run 0 is the run to differentiate. The caller also passes *runs of variations*, in which parameters have other values. A *loop
//! parameter* `F` is a number that the plant or the law computes from the parameters. The derivative of `F` with respect to a parameter is
//! `sum weight (F(run) - F(0))`, where the sum is over the runs of variations of this parameter.
//!
//! A *record* is the state and the input at one time of `t_eval`. A *series* is one quantity of all records, such as `q` or `tau`.

use crate::arrays::{Axis, Form, adopted, count, numbers};
use crate::errors::{Failure, input_error};
use crate::force;
use crate::interrupts::{long, signalled};
use crate::loops::{Loops, threads_of};
use armlet_core::memory;
use armlet_core::simulate::{self as core, Parameter, Parameters, Problem, Rows, Shared, record_parts};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The parameters, the number of parameters of each name, and the groups of parameters that share runs of variations.
struct Named {
    all: Vec<Parameter>,
    sizes: Vec<usize>,
    shared: Vec<Shared>,
}

/// The number of parameters of a name, and their codes if they share runs of variations.
#[derive(FromPyObject)]
enum Name {
    Apart(usize),
    Together(usize, Vec<u64>),
}

impl Named {
    /// Assign runs to the parameters. Run 0 is the run to differentiate, and the runs of each name follow.
    ///
    /// A parameter that varies alone has one run per weight. Parameters that vary together have *probes*, and then one common run per
    /// weight. In probe `b`, only those parameters vary whose code, a binary number, has bit `b`.
    ///
    /// The loop runs as a *program* (recorded machine code), and each input of the program depends on at most one of these parameters.
    /// The probes identify this parameter: bit `b` of its code is set if probe `b` changes the input (see [`Shared`]).
    fn of(function: &str, value: &Bound<'_, PyAny>, names: &Bound<'_, PyAny>, runs: usize) -> Result<Self, Failure> {
        let (shape, weights) = numbers(function, "weights", value, &[Form(&[Axis::Any("P"), Axis::Any("W")])])?;
        let (names, points): (Vec<Name>, usize) = (names.extract()?, shape[1]);
        let (mut named, mut run) = (Named { all: memory::reserved(shape[0])?, sizes: Vec::new(), shared: Vec::new() }, 1);
        let mut rows = weights.chunks_exact(points.max(1));
        for name in names {
            let first = named.all.len();
            let (size, step) = match name {
                Name::Apart(size) => (size, points),
                Name::Together(size, codes) if codes.len() == size => {
                    let probes = codes.iter().map(|code| code.checked_ilog2().map_or(0, |bit| bit as usize + 1)).max().unwrap_or(0);
                    named.shared.push(Shared { first, probes: run..run + probes, codes });
                    run += probes;
                    (size, 0)
                }
                Name::Together(size, codes) => {
                    let problem = format!("has the wrong number of codes: expected {size}, got {}", codes.len());
                    return Err(input_error(value.py(), function, "names", problem).into());
                }
            };
            for row in rows.by_ref().take(size) {
                named.all.push(row.iter().enumerate().map(|(j, &weight)| (run + j, weight)).collect());
                run += step;
            }
            run += points - step;
            named.sizes.push(size);
        }
        if named.all.len() != shape[0] || named.sizes.iter().fold(0, |sum: usize, &size| sum.saturating_add(size)) != shape[0] {
            return Err(input_error(value.py(), function, "sizes", format!("have a wrong sum: expected {} parameters", shape[0])).into());
        }
        require_runs(function, value, run, runs)?;
        Ok(named)
    }

    fn parameters(&self) -> Parameters<'_> {
        Parameters { all: &self.all, sizes: &self.sizes, shared: &self.shared }
    }
}

/// Read the weights `(B, P, W)`: for each of the `P` parameters of a row, `W` runs of variations and their weights.
fn parameters_of_rows(function: &str, value: &Bound<'_, PyAny>, runs: usize) -> Result<Vec<Vec<Parameter>>, Failure> {
    let (shape, weights) = numbers(function, "weights", value, &[Form(&[Axis::Any("B"), Axis::Any("P"), Axis::Any("W")])])?;
    let [rows, count, points] = [shape[0], shape[1], shape[2]];
    require_runs(function, value, rows.saturating_mul(1 + count * points), runs)?;
    let mut all = memory::reserved(rows)?;
    for row in 0..rows {
        all.push(weighed(&weights[row * count * points..(row + 1) * count * points], points)?);
    }
    Ok(all)
}

fn require_runs(function: &str, value: &Bound<'_, PyAny>, weighed: usize, runs: usize) -> Result<(), Failure> {
    if weighed == runs {
        return Ok(());
    }
    let problem = format!("has the wrong shape: expected a weight for each of {runs} runs but the first of each row, got {weighed} runs");
    Err(input_error(value.py(), function, "weights", problem).into())
}

fn weighed(weights: &[f64], points: usize) -> armlet_core::error::Result<Vec<Parameter>> {
    let parameter = |(p, weights): (usize, &[f64])| weights.iter().enumerate().map(|(j, &weight)| (1 + p * points + j, weight)).collect();
    memory::collected(weights.chunks_exact(points.max(1)).enumerate().map(parameter))
}

/// Read the number of parameters of each name. The sum must be `parameters`.
fn sizes(function: &str, value: &Bound<'_, PyAny>, parameters: usize) -> Result<Vec<usize>, Failure> {
    let sizes: Vec<usize> = value.extract()?;
    if sizes.iter().try_fold(0usize, |sum, &size| sum.checked_add(size)) != Some(parameters) {
        return Err(input_error(value.py(), function, "sizes", format!("have a wrong sum: expected {parameters} parameters")).into());
    }
    Ok(sizes)
}

/// Return the derivatives of a loss with respect to the records `[x, tau]` of `rows` runs, record after record. `slopes` has the same
/// derivatives as one array per series.
fn slopes_of(function: &str, problem: &Problem, slopes: &Bound<'_, PyDict>, rows: usize) -> Result<Vec<f64>, Failure> {
    let (parts, width) = record_parts(problem);
    let core::Times::At(times) = &problem.options.times else {
        let expected = "is missing: expected the times of the records, got None";
        return Err(input_error(slopes.py(), function, "t_eval", expected).into());
    };
    let records = rows.saturating_mul(times.len());
    let mut weighed = memory::zeros(records.saturating_mul(width))?;
    for (name, part) in parts {
        let Some(given) = slopes.get_item(name)? else { continue };
        let (_, own) = numbers(function, name, &given, &[Form(&[Axis::Is(records), Axis::Is(part.len())])])?;
        for (to, from) in weighed.chunks_exact_mut(width).zip(own.chunks_exact(part.len())) {
            to[part.clone()].iter_mut().zip(from).for_each(|(to, from)| *to += from);
        }
    }
    Ok(weighed)
}

/// Return a dict with the derivatives of each series, `(lead.., K, .., P)`, for `K` records and `P` parameters.
fn by_series<'py>(
    py: Python<'py>,
    problem: &core::Problem,
    lead: &[usize],
    directions: usize,
    rates: Vec<Vec<f64>>,
) -> Result<Bound<'py, PyDict>, Failure> {
    let (fields, rows) = (PyDict::new(py), lead.iter().product::<usize>());
    for ((name, part), values) in record_parts(problem).0.into_iter().zip(rates) {
        let records = values.len() / (rows * part.len() * directions).max(1);
        fields.set_item(name, adopted(py, &[lead, &[records, part.len(), directions]].concat(), values)?)?;
    }
    Ok(fields)
}

/// Return a dict with the derivatives of each series of a run, `(K, .., P)`. `options` are those of `simulate_batch`, with `t_eval`.
#[entered]
#[pyfunction]
#[arguments(plant, law, q0, weights, names, options)]
pub fn _sensitivities<'py>(options: &Bound<'py, PyDict>) -> Result<Bound<'py, PyDict>, Failure> {
    const NAME: &str = "simulate";
    Loops::of(NAME, plant, law, options)?.with_problem(q0, |problem, rows, raised| {
        let named = Named::of(NAME, weights, names, rows)?;
        let all = named.parameters();
        let mut poll = || force::failed(raised) || signalled();
        let rates = long(py, || core::sensitivities(&problem, all, &core::Poller::new(&mut poll)))?;
        by_series(py, &problem, &[], named.all.len(), rates)
    })
}

/// Return the derivatives of `sum_k slopes_k' record_k`, `(P,)`. `slopes` is a dict with an array `(K, ..)` per series.
#[entered]
#[pyfunction]
#[arguments(plant, law, q0, weights, names, slopes, bytes, options)]
pub fn _adjoint<'py>(slopes: &Bound<'py, PyDict>, options: &Bound<'py, PyDict>) -> Result<Bound<'py, PyAny>, Failure> {
    const NAME: &str = "gradient";
    Loops::of(NAME, plant, law, options)?.with_problem(q0, |problem, rows, raised| {
        let named = Named::of(NAME, weights, names, rows)?;
        let all = named.parameters();
        let bytes = count(NAME, "memory", bytes)?;
        let weighed = slopes_of(NAME, &problem, slopes, 1)?;
        let mut poll = || force::failed(raised) || signalled();
        let gradient = long(py, || core::adjoint(&problem, all, &weighed, bytes, &core::Poller::new(&mut poll)))?;
        Ok(adopted(py, &[named.all.len()], gradient)?.into_any())
    })
}

/// Return a dict with the derivatives of each series of a batch, `(B, K, .., P)`. A row without derivatives is NaN.
#[entered]
#[pyfunction]
#[arguments(plant, law, q0, weights, names, threads, options)]
pub fn _sensitivities_of_rows<'py>(
    threads: Option<&Bound<'py, PyAny>>,
    options: &Bound<'py, PyDict>,
) -> Result<Bound<'py, PyDict>, Failure> {
    const NAME: &str = "simulate_batch";
    let threads = threads_of(NAME, threads)?;
    Loops::of(NAME, plant, law, options)?.with_problem(q0, |problem, runs, _| {
        let parameters = parameters_of_rows(NAME, weights, runs)?;
        let (rows, directions) = (parameters.len(), parameters.first().map_or(0, Vec::len));
        let sizes = sizes(NAME, names, directions)?;
        let rates = long(py, || core::sensitivities_of_rows(&Rows::of(&problem, &parameters, &sizes)?, threads, &mut signalled))?;
        by_series(py, &problem, &[rows], directions, rates)
    })
}

/// Return the derivatives of `sum_k slopes_k' record_k` for each row of a batch, `(B, P)`. `slopes` has an array `(B, K, ..)` per series.
#[entered]
#[pyfunction]
#[arguments(plant, law, q0, weights, names, slopes, bytes, threads, options)]
pub fn _adjoint_of_rows<'py>(
    slopes: &Bound<'py, PyDict>,
    threads: Option<&Bound<'py, PyAny>>,
    options: &Bound<'py, PyDict>,
) -> Result<Bound<'py, PyAny>, Failure> {
    const NAME: &str = "gradient";
    let threads = threads_of(NAME, threads)?;
    Loops::of(NAME, plant, law, options)?.with_problem(q0, |problem, runs, _| {
        let parameters = parameters_of_rows(NAME, weights, runs)?;
        let (rows, directions) = (parameters.len(), parameters.first().map_or(0, Vec::len));
        let sizes = sizes(NAME, names, directions)?;
        let bytes = count(NAME, "memory", bytes)?;
        let weighed = slopes_of(NAME, &problem, slopes, rows)?;
        let gradient =
            long(py, || core::adjoint_of_rows(&Rows::of(&problem, &parameters, &sizes)?, &weighed, bytes, threads, &mut signalled))?;
        Ok(adopted(py, &[rows, directions], gradient)?.into_any())
    })
}
