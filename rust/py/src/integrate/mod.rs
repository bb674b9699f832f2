//! `integrate` and the stepper under `scipy_method`: Python callables under the core's methods.

mod field;
mod stepper;

pub use stepper::Stepper;

use crate::arrays::{
    Axis, Form, SCALAR, any_vector, flag, items, new_array, number, numbers, optional_number, require_finite, spread, text,
};
use crate::errors::{Failure, entry, input_error};
use armlet_core::integrate::events::Event;
use armlet_core::integrate::solve::{Recorder, Request, node, solve};
use armlet_core::integrate::{
    Adaptive, Dop853, Dopri5, Euler, FixedStep, Radau5, Rk4, Rodas4, Ros2, SemiImplicit, Steps, Tolerances, Work,
};
use armlet_macros::entered;
use field::{Field, Jacobian};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

type Method = Box<dyn Adaptive<f64, Field, Vec<f64>> + Send + Sync>;

const ADAPTIVE: [&str; 4] = ["dopri5", "dop853", "radau5", "rodas4"];
const FIXED: [&str; 4] = ["euler", "semi_implicit", "rk4", "ros2"];
const IMPLICIT: [&str; 3] = ["radau5", "rodas4", "ros2"];
/// More steps than this is a mistake in the arguments, not a run.
const MOST_STEPS: f64 = 1e12;
/// Matrices of an implicit method: the Jacobian, and the largest decomposition, which is complex with its copies.
const MATRICES: u128 = 8;

/// How a method is to run, as Python gives it.
struct Settings {
    name: String,
    tolerances: Tolerances,
    dt: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
}

impl Settings {
    fn new<'py>(
        function: &str,
        n: usize,
        method: &Bound<'py, PyAny>,
        rtol: &Bound<'py, PyAny>,
        atol: &Bound<'py, PyAny>,
        dt: Option<&Bound<'py, PyAny>>,
        max_step: Option<&Bound<'py, PyAny>>,
        first_step: Option<&Bound<'py, PyAny>>,
    ) -> Result<Self, Failure> {
        let py = method.py();
        let refuse = |name: &str, problem: String| Failure::from(input_error(py, function, name, problem));
        let name = text(function, "method", method)?;
        let known = [FIXED, ADAPTIVE].concat();
        if !known.contains(&name.as_str()) {
            return Err(refuse("method", format!("is unknown: expected one of {}, got {name}", known.join(", "))));
        }
        let positive = |argument: &str, value: Option<&Bound<'py, PyAny>>| match optional_number(function, argument, value)? {
            // No limit, as scipy writes it.
            Some(x) if x == f64::INFINITY && argument == "max_step" => Ok(None),
            Some(x) if !(x > 0.0 && x.is_finite()) => {
                Err(refuse(argument, format!("is not positive: expected a finite number > 0, got {x}")))
            }
            other => Ok(other),
        };
        let (dt, max_step, first_step) = (positive("dt", dt)?, positive("max_step", max_step)?, positive("first_step", first_step)?);
        if dt.is_none() && FIXED.contains(&name.as_str()) {
            return Err(refuse("dt", format!("is missing: expected a step for {name}, got None")));
        }
        if dt.is_some() && ADAPTIVE.contains(&name.as_str()) {
            return Err(refuse("dt", format!("is given: expected None, as {name} chooses its steps (max_step limits them), got a number")));
        }
        let rtol = number(function, "rtol", rtol)?;
        // Below this the error of a step is rounding.
        let least = 100.0 * f64::EPSILON;
        if !(rtol >= least && rtol < f64::INFINITY) {
            return Err(refuse("rtol", format!("is too small: expected a finite number >= {least:.2e}, got {rtol}")));
        }
        let (shape, values) = numbers(function, "atol", atol, &[SCALAR, Form(&[Axis::Is(n)])])?;
        require_finite(py, function, "atol", &shape, &values)?;
        let atol = spread(&shape, values, n)?;
        if let Some(i) = atol.iter().position(|&x| !(x >= 0.0)) {
            return Err(refuse("atol", format!("is negative: expected numbers >= 0, got {} (first bad index {i})", atol[i])));
        }
        Ok(Settings { name, tolerances: Tolerances { rtol, atol }, dt, max_step, first_step })
    }

    /// Refuse steps too short for the span, and matrices too large for the memory, before anything is made.
    fn require_room(&self, py: Python<'_>, function: &str, span: f64, n: usize) -> Result<(), Failure> {
        if let Some(dt) = self.dt.filter(|dt| span / dt > MOST_STEPS) {
            let problem = format!("is too small for the span: expected at least {}, got {dt}", span / MOST_STEPS);
            return Err(input_error(py, function, "dt", problem).into());
        }
        let bytes = if IMPLICIT.contains(&self.name.as_str()) { MATRICES * 8 * (n as u128).pow(2) } else { 0 };
        let fits = usize::try_from(bytes).is_ok_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok());
        if fits { Ok(()) } else { Err(armlet_core::error::Error::Memory { bytes }.into()) }
    }

    /// Whether the method's order rests on its derivatives.
    fn central(&self) -> bool {
        self.name == "rodas4"
    }

    fn method(&self, function: &str, py: Python<'_>, field: &Field, y: Vec<f64>, positions: usize) -> Result<Method, Failure> {
        let (n, matrix) = (y.len(), vec![0.0; y.len() * y.len()]);
        let pivots = vec![0; n];
        let tolerances = self.tolerances.clone();
        let h = self.dt.unwrap_or(1.0);
        let mut method: Method = match self.name.as_str() {
            "dopri5" => Box::new(Dopri5::new(tolerances, y, 0.0)),
            "dop853" => Box::new(Dop853::new(tolerances, y, 0.0)),
            "radau5" => Box::new(Radau5::new(tolerances, y, 0.0)),
            "rodas4" => Box::new(Rodas4::new(tolerances, y, matrix, pivots, 0.0)),
            "euler" => fixed(Euler::new(y.clone(), 0.0), h, y),
            "rk4" => fixed(Rk4::new(y.clone(), 0.0), h, y),
            "ros2" => fixed(Ros2::new(y.clone(), matrix, pivots, 0.0), h, y),
            _ => {
                if positions == 0 || 2 * positions > n {
                    let problem = format!(
                        "is {positions} of {n} components: expected the number p of positions, y = [q (p,), v (p,), rest], for semi_implicit"
                    );
                    return Err(input_error(py, function, "positions", problem).into());
                }
                let method = SemiImplicit::new::<f64, Field>(field, y.clone(), 0.0)?;
                fixed(if field.direction < 0.0 { method.backwards() } else { method }, h, y)
            }
        };
        if let Some(h) = self.max_step {
            method.limit_step(h);
        }
        if let Some(h) = self.first_step {
            method.first_step(h);
        }
        Ok(method)
    }
}

fn fixed<M: FixedStep<f64, Field, Vec<f64>> + Send + Sync + 'static>(method: M, h: f64, y: Vec<f64>) -> Method {
    // The field itself counts its evaluations.
    Box::new(Steps::new(method, h, Work::default(), y, 0.0))
}

/// The most events of a run.
const MOST_EVENTS: usize = 4096;

/// `y0`: a finite vector, at least one number.
fn initial_state(function: &str, name: &str, y0: &Bound<'_, PyAny>) -> Result<Vec<f64>, Failure> {
    let py = y0.py();
    let y0 = any_vector(function, name, y0)?;
    if y0.is_empty() {
        return Err(input_error(py, function, name, "has the wrong shape: expected (n,) with n >= 1, got (0,)").into());
    }
    Ok(y0)
}

/// What `jac=` is: None, a matrix or a callable.
fn jacobian(function: &str, jac: Option<&Bound<'_, PyAny>>, n: usize, central: bool) -> Result<Jacobian, Failure> {
    match jac {
        None => Ok(Jacobian::Differences { central }),
        Some(jac) if jac.is_callable() => Ok(Jacobian::Callable(jac.clone().unbind())),
        Some(jac) => {
            let mut matrix = vec![0.0; n * n];
            field::matrix(jac.py(), function, jac, &mut matrix, n)?;
            require_finite(jac.py(), function, "jac", &[n, n], &matrix)?;
            Ok(Jacobian::Constant(matrix))
        }
    }
}

/// The times of `t_eval`, in the span and in its order, on the time that runs forward.
fn times(function: &str, t_eval: &Bound<'_, PyAny>, (s0, s1): (f64, f64), direction: f64) -> Result<Vec<f64>, Failure> {
    let mut times = crate::arrays::any_vector(function, "t_eval", t_eval)?;
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

/// What a run handed out, on the caller's own time.
struct Rows<'a, 'py> {
    py: Python<'py>,
    direction: f64,
    t: Vec<f64>,
    y: Vec<f64>,
    crossings: Vec<(Vec<f64>, Vec<f64>)>,
    nodes: Vec<f64>,
    ends: Vec<f64>,
    stop: &'a mut Option<PyErr>,
}

impl Recorder for Rows<'_, '_> {
    fn state(&mut self, t: f64, x: &[f64]) {
        self.t.push(self.direction * t);
        self.y.extend_from_slice(x);
    }
    fn event(&mut self, index: usize, t: f64, x: &[f64]) {
        let (times, states) = &mut self.crossings[index];
        times.push(self.direction * t);
        states.extend_from_slice(x);
    }
    fn node(&mut self, t: f64, x: &[f64]) {
        let t = self.direction * t;
        if self.ends.last() != Some(&t) {
            self.ends.push(t);
        }
        self.nodes.extend_from_slice(x);
    }
    fn interrupted(&mut self) -> bool {
        *self.stop = self.py.check_signals().err();
        self.stop.is_some()
    }
}

fn filled<'py>(py: Python<'py>, shape: &[usize], values: &[f64]) -> Result<Bound<'py, PyAny>, Failure> {
    new_array(py, shape, |out| {
        out.copy_from_slice(values);
        Ok(())
    })
}

/// One run of `f` as a dictionary of its fields.
#[entered]
#[pyfunction]
#[pyo3(signature = (f, t0, t1, y0, method, rtol, atol, dt, t_eval, dense, events, jac, args, max_step, first_step, positions, lists))]
pub fn integrate<'py>(
    py: Python<'py>,
    f: &Bound<'py, PyAny>,
    t0: &Bound<'py, PyAny>,
    t1: &Bound<'py, PyAny>,
    y0: &Bound<'py, PyAny>,
    method: &Bound<'py, PyAny>,
    rtol: &Bound<'py, PyAny>,
    atol: &Bound<'py, PyAny>,
    dt: Option<&Bound<'py, PyAny>>,
    t_eval: Option<&Bound<'py, PyAny>>,
    dense: &Bound<'py, PyAny>,
    events: &Bound<'py, PyAny>,
    jac: Option<&Bound<'py, PyAny>>,
    args: &Bound<'py, PyTuple>,
    max_step: Option<&Bound<'py, PyAny>>,
    first_step: Option<&Bound<'py, PyAny>>,
    positions: usize,
    lists: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    const NAME: &str = "integrate";
    entry(py, NAME, || {
        let events = items(NAME, "events", "a list: expected tuples (g, direction, stop_after)", events, MOST_EVENTS)?;
        let events = events.iter().map(|event| event.extract()).collect::<PyResult<Vec<(Bound<'py, PyAny>, f64, usize)>>>()?;
        if !f.is_callable() {
            let kind = f.get_type().name()?;
            return Err(input_error(py, NAME, "f", format!("is not callable: expected f(t, y), got {kind}")).into());
        }
        let span = [number(NAME, "t_span", t0)?, number(NAME, "t_span", t1)?];
        require_finite(py, NAME, "t_span", &[2], &span)?;
        let (dense, lists) = (flag(NAME, "dense_output", dense)?, flag(NAME, "lists", lists)?);
        let y0 = initial_state(NAME, "y0", y0)?;
        let n = y0.len();
        let settings = Settings::new(NAME, n, method, rtol, atol, dt, max_step, first_step)?;
        let direction = if span[1] < span[0] { -1.0 } else { 1.0 };
        let (s0, s1) = (direction * span[0], direction * span[1]);
        settings.require_room(py, NAME, s1 - s0, n)?;
        let wanted = t_eval.map(|t_eval| times(NAME, t_eval, (s0, s1), direction)).transpose()?;
        let jacobian = jacobian(NAME, jac, n, settings.central())?;
        let args = (!args.is_empty()).then(|| args.clone().unbind());
        let mut field =
            Field::new(NAME, f.clone().unbind(), args.as_ref().map(|args| args.clone_ref(py)), lists, jacobian, direction, positions, n);
        let mut method = settings.method(NAME, py, &field, y0, positions)?;

        let watched: Vec<Event> =
            events.iter().map(|(_, direction, stop_after)| Event { direction: *direction, stop_after: *stop_after }).collect();
        let (mut raised, mut stop) = (None, None);
        let mut value = |i: usize, s: f64, y: &[f64]| -> f64 {
            if raised.is_some() {
                return f64::NAN;
            }
            let got = field::with(py, &events[i].0, args.as_ref(), lists, direction * s, y)
                .and_then(|value| number(NAME, "event(t, y)", &value).map_err(|failure| field::python(py, NAME, failure)));
            got.unwrap_or_else(|error| {
                raised = Some(error);
                f64::NAN
            })
        };
        let request = Request { times: wanted.as_deref(), dense, events: &watched };
        let mut rows = Rows {
            py,
            direction,
            t: Vec::new(),
            y: Vec::new(),
            crossings: vec![Default::default(); events.len()],
            nodes: Vec::new(),
            ends: Vec::new(),
            stop: &mut stop,
        };
        let ended = solve(&mut field, &mut *method, (s0, s1), &request, &mut value, &mut rows);
        let Rows { t, y, crossings, nodes, ends, .. } = rows;
        if let Some(error) = field.error.take().or(raised).or(stop) {
            return Err(Failure::Python(error));
        }
        let fields = PyDict::new(py);
        fields.set_item("t", filled(py, &[t.len()], &t)?)?;
        fields.set_item("y", filled(py, &[t.len(), n], &y)?)?;
        let lists = [PyList::empty(py), PyList::empty(py)];
        for (times, states) in &crossings {
            lists[0].append(filled(py, &[times.len()], times)?)?;
            lists[1].append(filled(py, &[times.len(), n], states)?)?;
        }
        fields.set_item("t_events", &lists[0])?;
        fields.set_item("y_events", &lists[1])?;
        if dense {
            let degree = method.dense_degree();
            let positions: Vec<f64> = (0..=degree).map(|k| node(k, degree)).collect();
            fields.set_item("node_positions", filled(py, &[degree + 1], &positions)?)?;
            fields.set_item("ends", filled(py, &[ends.len()], &ends)?)?;
            fields.set_item("nodes", filled(py, &[ends.len(), degree + 1, n], &nodes)?)?;
        }
        fields.set_item("status", ended.status.code())?;
        fields.set_item("ended", direction * ended.t)?;
        fields.set_item("stats", stats(py, ended.work, field.evaluations)?)?;
        Ok(fields)
    })
}

fn stats<'py>(py: Python<'py>, work: Work, evaluations: u64) -> PyResult<Bound<'py, PyDict>> {
    let stats = PyDict::new(py);
    stats.set_item("evaluations", evaluations)?;
    stats.set_item("steps", work.steps)?;
    stats.set_item("rejections", work.rejections)?;
    stats.set_item("jacobians", work.jacobians)?;
    stats.set_item("factorisations", work.factorisations)?;
    if work.coarsen > 0.0 {
        stats.set_item("coarsen", work.coarsen)?;
    }
    Ok(stats)
}
