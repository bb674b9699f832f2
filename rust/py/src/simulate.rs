//! `simulate` and `simulate_batch`: conversion of the arguments to a problem of the core, and of the records to a dict of arrays.

use crate::arrays::{adopted, flag, object, text, written_array};
use crate::elastic::warn_of_sampling;
use crate::errors::{Failure, input_error};
use crate::event;
use crate::force::{self, Raised, raise};
use crate::interrupts::{long, long_calling, signalled, signalled_in_turn};
use crate::loops::{Loops, threads_of};
use crate::plant::Plant;
use crate::run_options::{RunOptions, law_of};
use armlet_core::law::LawSpec;
use armlet_core::memory;
use armlet_core::simulate::{self as core, Force, Keep, Problem};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyDict;

const A_PLANT: &str = "a plant such as RigidArm";
/// Up to this count, numbers are copied to a new array. More numbers are not copied: the array takes over their memory.
const FEW: usize = 1024;

fn put<'py>(fields: &Bound<'py, PyDict>, name: &str, values: Vec<f64>, shape: &[usize]) -> Result<(), Failure> {
    if values.len() <= FEW {
        let copy = |out: &mut [f64]| -> Result<(), Failure> {
            out.copy_from_slice(&values);
            Ok(())
        };
        return Ok(fields.set_item(name, written_array(fields.py(), shape, copy)?)?);
    }
    Ok(fields.set_item(name, adopted(fields.py(), shape, values)?)?)
}

/// The names of the recorded series.
const SERIES: [&str; 8] = ["q", "v", "tau", "theta", "theta_dot", "estimate", "friction", "bristles"];

/// Add the series [`SERIES`] to the fields, `(lead.., k, n)` each for `k` times. The series `estimate`, the state of the law, is
/// `(lead.., k, p)`. `lead` is empty for one run, and `[B]` for a batch.
fn put_series(fields: &Bound<'_, PyDict>, lead: &[usize], k: usize, n: usize, p: usize, series: [Vec<f64>; 8]) -> Result<(), Failure> {
    for (name, values) in SERIES.into_iter().zip(series) {
        let width = if name == "estimate" { p } else { n };
        // An empty optional series has no field. For example, only a plant with motors has `theta` and `theta_dot`, and only a friction
        // model with bristles has `bristles`.
        let optional = !["q", "v", "tau", "estimate"].contains(&name);
        if (optional && values.is_empty() && k > 0) || width == 0 {
            continue;
        }
        let shape: Vec<usize> = lead.iter().copied().chain([k, width]).collect();
        if values.len() == shape.iter().product::<usize>() {
            put(fields, name, values, &shape)?;
        }
    }
    Ok(())
}

/// Simulate one run, and return a dict of its fields. `armlet.simulate` documents the options.
#[entered]
#[pyfunction]
#[arguments(plant, law, q0, options)]
pub fn simulate<'py>(options: &Bound<'py, PyDict>) -> Result<Bound<'py, PyDict>, Failure> {
    let plant = object::<Plant>(NAME, "plant", A_PLANT, plant)?;
    let plant = &plant.get().spec;
    let raised = Raised::default();
    let law = &law_of(NAME, law, plant, &raised)?;
    let given = RunOptions { function: NAME, entries: options.clone() };
    let n = plant.n();
    let options = given.options(n)?;
    let (_, x0) = given.initial_states(&[plant], q0, false)?;
    given.require_force()?;
    let (force, force_frame) = given.force(plant, law, &raised)?;
    let problem =
        Problem { plants: vec![plant], laws: vec![law], x0, forces: force.iter().collect(), force_frame, options, measures: None };
    warn_of_sampling(py, NAME, &problem)?;
    given.limit_check()?.problem(py, NAME, &problem, false)?;
    let dense = given.get("dense")?.map_or(Ok(false), |dense| flag(NAME, "dense", &dense))?;
    let mut observer = event::observer(plant, given.get("events")?, dense, &raised)?;
    let calls_python = matches!(law, LawSpec::External(_)) || matches!(force, Some(Force::Signal(_)));
    let mut poll = || force::failed(&raised) || if calls_python { signalled_in_turn() } else { signalled() };
    let work = || core::simulate_observed(&problem, &core::Poller::new(&mut poll), observer.as_mut());
    let run = if calls_python { long_calling(work) } else { long(py, work) }?;
    raise(&raised)?;
    let (k, p) = (run.t.len(), law.initial_state().len());
    let fields = PyDict::new(py);
    put(&fields, "t", run.t, &[k])?;
    let series = [run.q, run.v, run.tau, run.theta, run.theta_dot, run.z, run.friction, run.bristles];
    put_series(&fields, &[], k, n, p, series)?;
    let series = PyDict::new(py);
    for (name, values) in run.monitors {
        put(&series, name, values, &[k])?;
    }
    fields.set_item("monitors", series)?;
    fields.set_item("status", run.status.code())?;
    fields.set_item("ended", run.ended)?;
    fields.set_item("unresolved", run.unresolved)?;
    let balances = PyDict::new(py);
    for (name, value) in core::BALANCES.into_iter().zip(run.balances) {
        balances.set_item(name, value)?;
    }
    fields.set_item("balances", balances)?;
    let stats = PyDict::new(py);
    stats.set_item("evaluations", run.evaluations)?;
    stats.set_item("steps", run.steps)?;
    stats.set_item("rejections", run.rejections)?;
    stats.set_item("engine", run.engine)?;
    if run.coarsen > 0.0 {
        stats.set_item("coarsen", run.coarsen)?;
    }
    let o = &problem.options;
    if o.method.is_adaptive() {
        stats.set_item("rtol", o.rtol)?;
        stats.set_item("atol", o.atol)?;
    } else {
        stats.set_item("dt", o.grid())?;
    }
    fields.set_item("stats", stats)?;
    if let Some(observer) = observer {
        event::answer(&fields, plant, p, observer)?;
    }
    Ok(fields)
}

/// Simulate a batch of runs, and return a dict of its fields. `armlet.simulate_batch` documents the options.
#[entered]
#[pyfunction]
#[arguments(plant, law, q0, options)]
pub fn simulate_batch<'py>(options: &Bound<'py, PyDict>) -> Result<Bound<'py, PyDict>, Failure> {
    let loops = Loops::of(NAME, plant, law, options)?;
    let (given, n) = (&loops.given, loops.plant().n());
    let records = match text(NAME, "keep", &given.required("keep")?)?.as_str() {
        "all" => Keep::All,
        "final" => Keep::Final,
        "metrics" => Keep::Metrics(given.measures(n)?),
        other => {
            let problem = format!("is unknown: expected one of all, final, metrics, got {other}");
            return Err(input_error(py, NAME, "keep", problem).into());
        }
    };
    let threads = threads_of(NAME, given.get("threads")?.as_ref())?;
    let (batch, rows, p) = loops.with_problem(q0, |problem, rows, _| {
        if problem.forces.iter().any(|force| matches!(force, Force::Signal(_))) {
            let problem = "is a function: expected None, a constant or [(t_start, F), ...] in a batch, which runs without Python inside";
            return Err(input_error(py, NAME, "force", problem).into());
        }
        let p = problem.laws[0].initial_state().len();
        // A piece of a batch does not warn, because the whole batch was checked before.
        if given.get("check_sampling")?.map_or(Ok(true), |check| flag(NAME, "check_sampling", &check))? {
            warn_of_sampling(py, NAME, &problem)?;
        }
        // The pieces of a batch have the monitors of its first piece.
        if given.get("check_monitors")?.map_or(Ok(false), |check| flag(NAME, "check_monitors", &check))? {
            problem.require_same_monitors()?;
        }
        given.limit_check()?.problem(py, NAME, &problem, true)?;
        Ok((long(py, || core::simulate_batch(problem, records, threads, &mut signalled))?, rows, p))
    })?;
    let k = batch.t.len();
    let fields = PyDict::new(py);
    put(&fields, "t", batch.t, &[k])?;
    let series = [batch.q, batch.v, batch.tau, batch.theta, batch.theta_dot, batch.z, batch.friction, batch.bristles];
    put_series(&fields, &[rows], k, n, p, series)?;
    let series = PyDict::new(py);
    for (name, values) in batch.monitors {
        put(&series, name, values, &[rows, k])?;
    }
    fields.set_item("monitors", series)?;
    let balances = PyDict::new(py);
    for (name, values) in core::BALANCES.into_iter().zip(batch.balances) {
        put(&balances, name, values, &[rows])?;
    }
    fields.set_item("balances", balances)?;
    let metrics = PyDict::new(py);
    for (name, width, values) in batch.metrics {
        let shape: Vec<usize> = std::iter::once(rows).chain(width).collect();
        put(&metrics, name, values, &shape)?;
    }
    fields.set_item("metrics", metrics)?;
    let status = memory::collected(batch.status.iter().map(|s| i64::from(s.code())))?;
    fields.set_item("status", adopted(py, &[status.len()], status)?)?;
    put(&fields, "ended", batch.ended, &[rows])?;
    fields.set_item("engine", batch.engine)?;
    Ok(fields)
}
