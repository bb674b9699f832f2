//! Integration of Python callables `f(t, y)` with the methods of the core: `integrate`, and the stepper that `scipy_method` uses.

mod field;
mod jacobian;
mod settings;
mod slope;
mod stepper;

pub use stepper::Stepper;

use crate::arrays::{any_vector, copied, flag, items, nonnegative_integer, number, require_finite};
use crate::errors::{Failure, input_error};
use armlet_core::error::Result as CoreResult;
use armlet_core::integrate::Work;
use armlet_core::integrate::events::Event;
use armlet_core::integrate::solve::{Recorder, Request, node, solve};
use armlet_core::memory::append;
use armlet_macros::entered;
use field::Field;
use jacobian::Jacobian;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use settings::Settings;
use slope::{Slope, States};

const NAME: &str = "integrate";
/// The largest number of entries of the argument `events`. The number of recorded crossings has no such limit.
const MOST_EVENTS: usize = 4096;

/// Read the times `t_eval`, which must be in the span, and sorted from its start to its end. The result has the times `s = direction t`,
/// which do not decrease. `direction` is -1 if the span decreases, otherwise 1.
fn times(function: &str, t_eval: &Bound<'_, PyAny>, (s0, s1): (f64, f64), direction: f64) -> Result<Vec<f64>, Failure> {
    let mut times = any_vector(function, "t_eval", t_eval)?;
    let mut last = s0;
    for (i, t) in times.iter_mut().enumerate() {
        let s = direction * *t;
        if !(s >= last && s <= s1) {
            let (a, b) = (direction * s0, direction * s1);
            let problem = format!("is not in the order of the span: expected times from {a} to {b}, got {t} (first bad index {i})");
            return Err(input_error(t_eval.py(), function, "t_eval", problem).into());
        }
        *t = s;
        last = s;
    }
    Ok(times)
}

/// The recorded results of a run, at the times of the caller, `t = direction s`.
struct SolutionRecorder<'a, 'py> {
    py: Python<'py>,
    direction: f64,
    t: Vec<f64>,
    y: Vec<f64>,
    crossings: Vec<(Vec<f64>, Vec<f64>)>,
    nodes: Vec<f64>,
    ends: Vec<f64>,
    stop: &'a mut Option<PyErr>,
    /// The error that ends the recording and the run, if memory is insufficient.
    full: CoreResult<()>,
}

impl Recorder for SolutionRecorder<'_, '_> {
    fn state(&mut self, t: f64, x: &[f64]) {
        if self.full.is_ok() {
            self.full = append(&mut self.t, &[self.direction * t]).and_then(|()| append(&mut self.y, x));
        }
    }
    fn event(&mut self, index: usize, t: f64, x: &[f64]) {
        let (times, states) = &mut self.crossings[index];
        if self.full.is_ok() {
            self.full = append(times, &[self.direction * t]).and_then(|()| append(states, x));
        }
    }
    fn node(&mut self, t: f64, x: &[f64]) {
        let t = self.direction * t;
        if self.full.is_ok() && self.ends.last() != Some(&t) {
            self.full = append(&mut self.ends, &[t]);
        }
        if self.full.is_ok() {
            self.full = append(&mut self.nodes, x);
        }
    }
    fn interrupted(&mut self) -> bool {
        *self.stop = self.py.check_signals().err();
        self.stop.is_some() || self.full.is_err()
    }
}

impl<'a, 'py> SolutionRecorder<'a, 'py> {
    fn new(py: Python<'py>, direction: f64, events: usize, stop: &'a mut Option<PyErr>) -> Self {
        let (t, y, nodes, ends) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        SolutionRecorder { py, direction, t, y, crossings: vec![Default::default(); events], nodes, ends, stop, full: Ok(()) }
    }

    /// A dict of the recorded results, for `n` states. `degree` is the degree of the polynomials of the dense output, if it was requested.
    fn answer(self, n: usize, degree: Option<usize>) -> Result<Bound<'py, PyDict>, Failure> {
        let SolutionRecorder { py, t, y, crossings, nodes, ends, full, .. } = self;
        full?;
        let fields = PyDict::new(py);
        fields.set_item("t", copied(py, &[t.len()], &t)?)?;
        fields.set_item("y", copied(py, &[t.len(), n], &y)?)?;
        let lists = [PyList::empty(py), PyList::empty(py)];
        for (times, states) in &crossings {
            lists[0].append(copied(py, &[times.len()], times)?)?;
            lists[1].append(copied(py, &[times.len(), n], states)?)?;
        }
        fields.set_item("t_events", &lists[0])?;
        fields.set_item("y_events", &lists[1])?;
        if let Some(degree) = degree {
            let positions: Vec<f64> = (0..=degree).map(|k| node(k, degree)).collect();
            fields.set_item("node_positions", copied(py, &[degree + 1], &positions)?)?;
            fields.set_item("ends", copied(py, &[ends.len()], &ends)?)?;
            fields.set_item("nodes", copied(py, &[ends.len(), degree + 1, n], &nodes)?)?;
        }
        Ok(fields)
    }
}

/// Read the events: each has a function, a direction, and the number of crossings after which the run ends (0: never).
fn watched_events<'py>(events: &Bound<'py, PyAny>) -> Result<Vec<(Bound<'py, PyAny>, f64, usize)>, Failure> {
    let events = items(NAME, "events", "a list: expected tuples (g, direction, stop_after)", events, MOST_EVENTS)?;
    let of = |event: &Bound<'py, PyAny>| {
        let (g, direction, stop_after): (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>) = event.extract()?;
        Ok((g, number(NAME, "events", &direction)?, nonnegative_integer(NAME, "events", &stop_after)?))
    };
    events.iter().map(of).collect()
}

/// Read the start and the end of the span. The end may be infinite if an event `ends` the run.
fn span_of(t0: &Bound<'_, PyAny>, t1: &Bound<'_, PyAny>, ends: bool) -> Result<[f64; 2], Failure> {
    let span = [number(NAME, "t_span", t0)?, number(NAME, "t_span", t1)?];
    let finite = span[0].is_finite() && (span[1].is_finite() || (ends && !span[1].is_nan()));
    if !finite {
        require_finite(t0.py(), NAME, "t_span", &[2], &span)?;
    }
    Ok(span)
}

/// Read the flags `lists` and `vectorized`, which select the form in which `f` receives states.
fn states_of(py: Python<'_>, lists: &Bound<'_, PyAny>, vectorized: &Bound<'_, PyAny>) -> Result<States, Failure> {
    match (flag(NAME, "lists", lists)?, flag(NAME, "vectorized", vectorized)?) {
        (true, true) => {
            let problem = "is given with lists: expected one of them, as a vectorised f takes an array, got both";
            Err(input_error(py, NAME, "vectorized", problem).into())
        }
        (true, false) => Ok(States::List),
        (false, true) => Ok(States::Columns),
        (false, false) => Ok(States::Array),
    }
}

/// Integrate `dy/dt = f(t, y)`, and return a dict with the fields of the result.
#[entered]
#[pyfunction]
#[arguments(
    f,
    t0,
    t1,
    y0,
    method,
    rtol,
    atol,
    dt,
    t_eval,
    dense,
    events,
    jac,
    jac_sparsity,
    args,
    max_step,
    first_step,
    positions,
    lists,
    vectorized
)]
pub fn integrate<'py>(
    dt: Option<&Bound<'py, PyAny>>,
    t_eval: Option<&Bound<'py, PyAny>>,
    jac: Option<&Bound<'py, PyAny>>,
    jac_sparsity: Option<&Bound<'py, PyAny>>,
    args: &Bound<'py, PyTuple>,
    max_step: Option<&Bound<'py, PyAny>>,
    first_step: Option<&Bound<'py, PyAny>>,
) -> Result<Bound<'py, PyDict>, Failure> {
    let events = watched_events(events)?;
    if !f.is_callable() {
        let kind = f.get_type().name()?;
        return Err(input_error(py, NAME, "f", format!("is not callable: expected f(t, y), got {kind}")).into());
    }
    let positions = nonnegative_integer(NAME, "positions", positions)?;
    let span = span_of(t0, t1, events.iter().any(|(_, _, stop_after)| *stop_after > 0))?;
    let dense = flag(NAME, "dense_output", dense)?;
    let states = states_of(py, lists, vectorized)?;
    let y0 = any_vector(NAME, "y0", y0)?;
    let n = y0.len();
    let direction = if span[1] < span[0] { -1.0 } else { 1.0 };
    let (s0, s1) = (direction * span[0], direction * span[1]);
    let settings = Settings::new(NAME, n, method, [rtol, atol], [dt, max_step, first_step], s1 - s0)?;
    if !settings.method.is_adaptive() {
        require_finite(py, NAME, "t_span", &[2], &span)?;
    }
    settings.require_memory(py, NAME, s1 - s0, n, states)?;
    let wanted = t_eval.map(|t_eval| times(NAME, t_eval, (s0, s1), direction)).transpose()?;
    let jacobian = Jacobian::new(NAME, jac, jac_sparsity, n, states, settings.method)?;
    let args = (!args.is_empty()).then(|| args.clone().unbind());
    let slope = Slope::new(NAME, f.clone().unbind(), args.as_ref().map(|args| args.clone_ref(py)), states, direction);
    let field = Field::new(slope, jacobian, (s0, s1), positions, n);
    let (mut field, mut method) = settings.stepping(NAME, py, field, y0, positions)?;

    let watched: Vec<Event> =
        events.iter().map(|(_, direction, stop_after)| Event { direction: *direction, stop_after: *stop_after }).collect();
    let (mut raised, mut stop) = (None, None);
    let mut value = |i: usize, s: f64, y: &[f64]| -> f64 {
        if raised.is_some() {
            return f64::NAN;
        }
        let got = slope::with(py, &events[i].0, args.as_ref(), states, direction * s, y)
            .and_then(|value| number(NAME, "event(t, y)", &value).map_err(|failure| failure.into_python(py, NAME)));
        got.unwrap_or_else(|error| {
            raised = Some(error);
            f64::NAN
        })
    };
    let request = Request { times: wanted.as_deref(), dense, events: &watched };
    let mut rows = SolutionRecorder::new(py, direction, events.len(), &mut stop);
    let ended = solve(&mut field, &mut *method, (s0, s1), &request, &mut value, &mut rows);
    let degree = dense.then(|| method.dense_degree());
    let fields = rows.answer(n, degree);
    if let Some(error) = field.slope.error.take().or(raised).or(stop) {
        return Err(Failure::Python(error));
    }
    let fields = fields?;
    fields.set_item("status", ended.status.code())?;
    fields.set_item("ended", direction * ended.t)?;
    fields.set_item("stats", stats(py, ended.work, &field)?)?;
    Ok(fields)
}

fn stats<'py>(py: Python<'py>, work: Work, field: &Field) -> PyResult<Bound<'py, PyDict>> {
    let stats = PyDict::new(py);
    stats.set_item("evaluations", field.slope.evaluations)?;
    stats.set_item("steps", work.steps)?;
    stats.set_item("rejections", work.rejections)?;
    stats.set_item("jacobians", field.jacobians)?;
    stats.set_item("factorisations", work.factorisations)?;
    if work.coarsen > 0.0 {
        stats.set_item("coarsen", work.coarsen)?;
    }
    Ok(stats)
}
