//! The arguments `events` and `dense` of `simulate`, and their results: event times, and polynomials between the steps.

use crate::arrays::{adopted, items, number, text, vector};
use crate::errors::{Failure, input_error};
use crate::force::{self, Raised};
use armlet_core::dynamics::Model;
use armlet_core::integrate::solve::node;
use armlet_core::memory;
use armlet_core::plant::{PlantSpec, Stop};
use armlet_core::simulate::{Crossings, Event, EventFunction, Polynomials, RunObserver};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::Arc;

const NAME: &str = "simulate";
/// The largest number of entries of the argument `events`. The number of recorded crossings has no such limit.
const MOST_EVENTS: usize = 4096;

fn refuse(value: &Bound<'_, PyAny>, problem: String) -> Failure {
    input_error(value.py(), NAME, "events", problem).into()
}

/// Read a joint, which is an index or a name, and return its index.
fn joint(plant: &PlantSpec, value: &Bound<'_, PyAny>) -> Result<usize, Failure> {
    let n = plant.n();
    if let Ok(name) = value.extract::<String>() {
        let names: Vec<&str> = match plant.model() {
            Model::Tree(arm) => arm.joint_names().collect(),
            Model::PlanarPr(_) => Vec::new(),
        };
        let unknown = || refuse(value, format!("name an unknown joint: expected one of ({}), got {name:?}", names.join(", ")));
        return names.iter().position(|known| *known == name).ok_or_else(unknown);
    }
    match value.extract::<usize>() {
        Ok(i) if i < n => Ok(i),
        _ => Err(refuse(value, format!("name an unknown joint: expected an index from 0 to {} or a name, got {value}", n - 1))),
    }
}

/// The event function of a Python callable `g(t, q, v, ..)`. It has the same arguments as a law in Python.
fn function(plant: &PlantSpec, call: &Bound<'_, PyAny>, raised: &Raised) -> EventFunction {
    let (call, raised, n, states) = (call.clone().unbind(), raised.clone(), plant.n(), plant.seen());
    EventFunction::Function(Arc::new(move |t: f64, x: &[f64]| {
        Python::attach(|py| {
            let call = || -> Result<f64, Failure> {
                let mut arguments = vec![t.into_pyobject(py).map_err(PyErr::from)?.into_any()];
                for part in x[..states].chunks_exact(n) {
                    arguments.push(PyArray1::from_slice(py, part).into_any());
                }
                number(NAME, "events", &call.bind(py).call1(PyTuple::new(py, arguments)?)?)
            };
            call().map_err(|failure| force::store_error(&raised, py, NAME, failure)).ok()
        })
    }))
}

/// The function whose zeros are the events of this `kind` of `armlet.Event`.
fn event_function(plant: &PlantSpec, kind: &str, arguments: &Bound<'_, PyAny>, raised: &Raised) -> Result<EventFunction, Failure> {
    let n = plant.n();
    let argument = |i: usize| arguments.get_item(i);
    let three = |i: usize| -> Result<[f64; 3], Failure> {
        let v = vector(NAME, "events", &argument(i)?, 3)?;
        Ok([v[0], v[1], v[2]])
    };
    Ok(match kind {
        "joint" => {
            EventFunction::Joint { joint: joint(plant, &argument(0)?)?, value: number(NAME, "events", &argument(1)?)?, below: false }
        }
        "speed" => {
            if !plant.kind().has_speeds() {
                let name = plant.kind().name();
                return Err(refuse(arguments, format!("have a speed: expected a plant with speeds among its states, got {name}")));
            }
            EventFunction::Speed { at: n + joint(plant, &argument(0)?)?, value: number(NAME, "events", &argument(1)?)? }
        }
        "plane" => {
            let name = text(NAME, "events", &argument(0)?)?;
            let frame = plant.model().tree("events")?.frame_index(&name).map_err(|error| error.of_argument("events"))?;
            EventFunction::Plane { frame, point: three(1)?, normal: three(2)? }
        }
        "contact" => match plant.wall() {
            Some(wall) => EventFunction::Plane { frame: wall.frame, point: wall.point, normal: wall.normal.map(|x| -x) },
            None => return Err(refuse(arguments, "have a contact: expected a plant with a wall, got one without".into())),
        },
        "joint_stop" => {
            let stop = Stop { joint: joint(plant, &argument(0)?)?, upper: text(NAME, "events", &argument(1)?)? == "upper" };
            match plant.stops().filter(|stops| stops.all().any(|known| known == stop)) {
                Some(stops) => EventFunction::Joint { joint: stop.joint, value: stops.limit(stop), below: !stop.upper },
                None => return Err(refuse(arguments, "have a joint stop: expected one that the plant has, got another".into())),
            }
        }
        _ => function(plant, &argument(0)?, raised),
    })
}

/// Read the options `events` and `dense`. The result is `None` if neither is used.
pub fn observer(plant: &PlantSpec, events: Option<Bound<'_, PyAny>>, dense: bool, raised: &Raised) -> Result<Option<RunObserver>, Failure> {
    let mut observer = RunObserver { polynomials: dense.then(Polynomials::default), ..RunObserver::default() };
    let events =
        events.map(|events| items(NAME, "events", "a list: expected events", &events, MOST_EVENTS)).transpose()?.unwrap_or_default();
    for (i, event) in events.into_iter().enumerate() {
        let (direction, stop) = (number(NAME, "direction", &event.getattr("direction")?)?, event.getattr("stop")?.extract::<usize>());
        let stop_after = stop.map_err(|_| refuse(&event, format!("have a bad stop: expected a count >= 0 (first bad index {i})")))?;
        let function = event_function(plant, &text(NAME, "events", &event.getattr("kind")?)?, &event.getattr("arguments")?, raised)?;
        observer.events.push(Event { function, direction, stop_after });
    }
    Ok((dense || !observer.events.is_empty()).then_some(observer))
}

/// Split the first `seen` columns of `values`, `(rows, states)`, into fields of `n` columns each: `q`, then `v`, `theta` and `theta_dot` if
/// the plant has them.
fn put_parts(fields: &Bound<'_, PyDict>, rows: usize, n: usize, (seen, states): (usize, usize), values: &[f64]) -> Result<(), Failure> {
    for (k, name) in ["q", "v", "theta", "theta_dot"].iter().enumerate().take(seen / n) {
        let part = memory::collected((0..rows * n).map(|i| values[i / n * states + k * n + i % n]))?;
        fields.set_item(name, adopted(fields.py(), &[rows, n], part)?)?;
    }
    Ok(())
}

/// Add the fields `events` and `dense` to the fields of a run, if they were requested. `p` is the number of states of the law.
pub fn answer(fields: &Bound<'_, PyDict>, plant: &PlantSpec, p: usize, observer: RunObserver) -> Result<(), Failure> {
    let (py, n, states) = (fields.py(), plant.n(), plant.states());
    if !observer.events.is_empty() {
        let Crossings { index, t, x } = observer.crossings;
        let events = PyDict::new(py);
        put_parts(&events, t.len(), n, (plant.seen(), states), &x)?;
        events.set_item("which", adopted(py, &[t.len()], memory::collected(index.iter().map(|&i| i as i64))?)?)?;
        events.set_item("t", adopted(py, &[t.len()], t)?)?;
        fields.set_item("events", events)?;
    }
    if let Some(Polynomials { degree, ends, nodes }) = observer.polynomials {
        // The result has the plant's state and the law's state. It omits the bristles of LuGre friction, which are between the two.
        let (seen, all) = (plant.seen(), states + p);
        let width = seen + p;
        let place = |i: usize| i / width * all + if i % width < seen { i % width } else { i % width + states - seen };
        let count = nodes.len() / all * width;
        let nodes = if seen == states { nodes } else { memory::collected((0..count).map(|i| nodes[place(i)]))? };
        let shape = [ends.len(), degree + 1, width];
        let positions = adopted(py, &[degree + 1], (0..=degree).map(|k| node(k, degree)).collect())?;
        let dense = (seen, adopted(py, &[ends.len()], ends)?, positions, adopted(py, &shape, nodes)?);
        fields.set_item("dense", dense)?;
    }
    Ok(())
}
