//! `simulate` and `simulate_batch`: arguments to a problem, records to a dictionary of arrays.

use crate::arrays::{
    any_vector, count, flag, number, numbers, object, optional_number, require_finite, shown, text, vector, written_array,
};
use crate::elastic::warn_of_sampling;
use crate::errors::{Failure, entry, input_error};
use crate::event;
use crate::force::{self, Raised};
use crate::law::Law;
use crate::motion::Motion;
use crate::plant::Plant;
use armlet_core::error::Result as CoreResult;
use armlet_core::law::{ExternalSpec, LawSpec};
use armlet_core::parallel;
use armlet_core::plant::sensors::TorqueSensor;
use armlet_core::plant::{PlantKind, PlantSpec};
use armlet_core::simulate::{self as core, Force, Keep, Method, Options, Problem, Sampling, Times};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple, PyType};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const A_PLANT: &str = "a plant such as RigidArm";
const A_LAW: &str = "a law such as Adaptive";
/// Numbers that are sooner copied into an array than given to one.
const FEW: usize = 1024;

/// One object, or a list of them.
fn several<'py, T: pyo3::PyClass>(
    function: &str,
    name: &str,
    expected: &str,
    value: &Bound<'py, PyAny>,
) -> Result<Vec<Bound<'py, T>>, Failure> {
    let items: Vec<Bound<'py, PyAny>> = if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        value.try_iter()?.collect::<PyResult<_>>()?
    } else {
        vec![value.clone()]
    };
    if items.is_empty() {
        return Err(input_error(value.py(), function, name, format!("is empty: expected {expected}, got []")).into());
    }
    let wrong = |item: &Bound<'py, PyAny>, i: usize| -> Failure {
        let problem = format!(
            "is of the wrong type: expected {expected}, got {} (first bad index {i})",
            item.get_type().name().map(|name| name.to_string()).unwrap_or_default()
        );
        input_error(value.py(), function, name, problem).into()
    };
    items.iter().enumerate().map(|(i, item)| item.cast::<T>().cloned().map_err(|_| wrong(item, i))).collect()
}

/// How to run it, as Python gives it: keyword by keyword.
pub struct Given<'py> {
    pub function: &'static str,
    pub keywords: Bound<'py, PyDict>,
}

impl<'py> Given<'py> {
    /// A keyword; `None` where it is missing or None.
    fn get(&self, name: &str) -> Result<Option<Bound<'py, PyAny>>, Failure> {
        Ok(self.keywords.get_item(name)?.filter(|value| !value.is_none()))
    }

    pub fn required(&self, name: &str) -> Result<Bound<'py, PyAny>, Failure> {
        let missing = || input_error(self.keywords.py(), self.function, name, "is missing: expected a value, got None");
        Ok(self.get(name)?.ok_or_else(missing)?)
    }

    fn number(&self, name: &str) -> Result<f64, Failure> {
        number(self.function, name, &self.required(name)?)
    }

    fn optional_number(&self, name: &str) -> Result<Option<f64>, Failure> {
        optional_number(self.function, name, self.get(name)?.as_ref())
    }

    /// A period in s, or an `armlet.Sampling`.
    fn sampling(&self, n: usize) -> Result<Option<Sampling>, Failure> {
        let Some(value) = self.get("sample_time")? else { return Ok(None) };
        let function = self.function;
        let Ok(period) = value.getattr("period") else {
            return Ok(Some(Sampling::every(number(function, "sample_time", &value)?)));
        };
        let field = |name: &str| -> Result<f64, Failure> { number(function, name, &value.getattr(name)?) };
        let channels = |name: &str| -> Result<[f64; 4], Failure> {
            let given = value.getattr(name)?;
            let mut all = [0.0; 4];
            for (to, channel) in all.iter_mut().zip(core::CHANNELS) {
                if let Ok(x) = given.get_item(channel) {
                    *to = number(function, &format!("{name}[{channel:?}]"), &x)?;
                }
            }
            Ok(all)
        };
        Ok(Some(Sampling {
            period: number(function, "period", &period)?,
            delay: field("delay")?,
            jitter: field("jitter")?,
            sensor_delay: index(function, "sensor_delay", &value.getattr("sensor_delay")?)?,
            noise: channels("noise")?,
            resolution: channels("resolution")?,
            rate_limit: field("rate_limit")?,
            torque_sensor: torque_sensor(function, &value.getattr("torque_sensor")?, n)?,
            seed: index(function, "seed", &value.getattr("seed")?)? as u64,
        }))
    }

    /// One number for all, or one per joint.
    fn per_joint(&self, name: &str, n: usize) -> Result<Option<Vec<f64>>, Failure> {
        let Some(value) = self.get(name)? else { return Ok(None) };
        let (shape, values) = numbers(self.function, name, &value)?;
        match shape.as_slice() {
            [] => Ok(Some(vec![values[0]; n])),
            [rows] if *rows == n => Ok(Some(values.into_owned())),
            _ => {
                let problem = format!("has the wrong shape: expected a scalar or ({n},), got {}", shown(&shape));
                Err(input_error(value.py(), self.function, name, problem).into())
            }
        }
    }

    pub fn options(&self, n: usize) -> Result<Options, Failure> {
        let function = self.function;
        let every = count(function, "record_every", &self.required("record_every")?)?;
        let times = match self.get("t_eval")? {
            Some(t_eval) => Times::At(any_vector(function, "t_eval", &t_eval)?),
            None => Times::Every(every),
        };
        Ok(Options {
            method: Method::from_name(&text(function, "method", &self.required("method")?)?)?,
            t_end: self.number("t_end")?,
            dt: self.optional_number("dt")?,
            rtol: self.number("rtol")?,
            atol: self.number("atol")?,
            sampling: self.sampling(n)?,
            times,
            tau_max: self.per_joint("tau_max", n)?,
            monitors: flag(self.function, "monitors", &self.required("monitors")?)?,
        })
    }

    /// Initial states of the plants, `(rows, states)`: `q0, v0, theta0, theta_dot0` are `(n,)` for one run, `(B, n)` for a batch.
    pub fn initial_states(&self, plants: &[&PlantSpec], q0: &Bound<'py, PyAny>, batch: bool) -> Result<(usize, Vec<f64>), Failure> {
        let n = plants[0].n();
        let read = |name: &str, value: &Bound<'py, PyAny>| -> Result<(usize, Vec<f64>), Failure> {
            if batch { batch_rows(self.function, name, value, n) } else { Ok((1, vector(self.function, name, value, n)?)) }
        };
        let (rows, q) = read("q0", q0)?;
        let mut rest = [const { None }; 3];
        for (part, name) in rest.iter_mut().zip(["v0", "theta0", "theta_dot0"]) {
            let Some(value) = self.get(name)? else { continue };
            if name != "v0" && plants[0].kind() != PlantKind::Elastic {
                let problem = format!("is not used: expected None for {}", plants[0].kind().name());
                return Err(input_error(value.py(), self.function, name, problem).into());
            }
            let (given, values) = read(name, &value)?;
            if given != rows {
                let problem = format!("has the wrong shape: expected ({rows}, {n}), got ({given}, {n})");
                return Err(input_error(value.py(), self.function, name, problem).into());
            }
            *part = Some(values);
        }
        let [v, theta, theta_dot] = &rest;
        let zero = vec![0.0; n];
        let part = |values: &'_ Option<Vec<f64>>, row: usize| values.as_ref().map(|values| values[row * n..(row + 1) * n].to_vec());
        let mut x0 = Vec::with_capacity(rows * plants[0].states());
        for row in 0..rows {
            let plant = plants[if plants.len() == 1 { 0 } else { row.min(plants.len() - 1) }];
            let v = part(v, row).unwrap_or_else(|| zero.clone());
            x0.extend(plant.initial_state(&q[row * n..(row + 1) * n], &v, part(theta, row).as_deref(), part(theta_dot, row).as_deref()));
        }
        Ok((rows, x0))
    }

    /// The force and the frame it acts at; the callables' errors go to `raised`.
    pub fn force(&self, plant: &PlantSpec, law: &LawSpec, raised: &Raised) -> Result<(Option<Force>, Option<usize>), Failure> {
        let (mut forces, frame) = self.forces(plant, law, raised)?;
        Ok((forces.pop(), frame))
    }

    /// None, one, or as `[[(t_start, F), ...], ...]` one per run; and the frame.
    pub fn forces(&self, plant: &PlantSpec, law: &LawSpec, raised: &Raised) -> Result<(Vec<Force>, Option<usize>), Failure> {
        let frame = match self.get("force_frame")? {
            None => None,
            Some(frame) => Some(plant.model().tree("force_frame")?.frame_index(&text(self.function, "force_frame", &frame)?)?),
        };
        let Some(value) = self.get("force")? else { return Ok((Vec::new(), frame)) };
        let rows = if frame.is_some() { None } else { law.coordinates().map(|coordinates| coordinates.rows.as_slice()) };
        // A step is (t, F): the first thing in a list of lists of steps is no number.
        let inner = value.cast::<PyList>().ok().and_then(|list| list.get_item(0).ok()?.get_item(0).ok());
        let nested = inner.is_some_and(|first| first.is_instance_of::<PyTuple>() || first.is_instance_of::<PyList>());
        let each = if nested { value.try_iter()?.collect::<PyResult<Vec<_>>>()? } else { vec![value] };
        let forces = each.iter().map(|value| force::force(self.function, value, rows, raised)).collect::<Result<_, _>>()?;
        Ok((forces, frame))
    }
}

fn put<'py>(fields: &Bound<'py, PyDict>, name: &str, values: Vec<f64>, shape: &[usize]) -> Result<(), Failure> {
    use numpy::PyArrayMethods;
    if values.len() <= FEW {
        let copy = |out: &mut [f64]| -> Result<(), Failure> {
            out.copy_from_slice(&values);
            Ok(())
        };
        return Ok(fields.set_item(name, written_array(fields.py(), shape, copy)?)?);
    }
    let array = PyArray1::from_vec(fields.py(), values).reshape(shape.to_vec())?;
    Ok(fields.set_item(name, array)?)
}

/// The recorded quantities of one run (`lead` empty) or of a batch (`lead` its rows) over `k` times.
fn put_series(
    fields: &Bound<'_, PyDict>,
    lead: &[usize],
    k: usize,
    n: usize,
    p: usize,
    series: [(&str, Vec<f64>); 6],
) -> Result<(), Failure> {
    for (name, values) in series {
        let width = if name == "estimate" { p } else { n };
        // A plant without motors has no theta, a law without state no estimate.
        if (name.starts_with("theta") && values.is_empty() && k > 0) || width == 0 {
            continue;
        }
        let shape: Vec<usize> = lead.iter().copied().chain([k, width]).collect();
        if values.len() == shape.iter().product::<usize>() {
            put(fields, name, values, &shape)?;
        }
    }
    Ok(())
}

/// An `armlet.TorqueSensor` of `n` joints, or None.
fn torque_sensor(function: &'static str, value: &Bound<'_, PyAny>, n: usize) -> Result<Option<TorqueSensor>, Failure> {
    if value.is_none() {
        return Ok(None);
    }
    let field = |name: &str| -> Result<f64, Failure> { number(function, name, &value.getattr(name)?) };
    let given = value.getattr("bias")?;
    let (shape, bias) = numbers(function, "bias", &given)?;
    let bias = if shape.is_empty() { vec![bias[0]; n] } else { bias.into_owned() };
    Ok(Some(TorqueSensor::new(field("noise")?, bias, field("resolution")?, field("bandwidth")?)?))
}

/// An integer >= 0.
fn index(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<usize, Failure> {
    let refused = || input_error(value.py(), function, name, "is not an integer >= 0: expected such as 0");
    Ok(value.extract::<usize>().map_err(|_| refused())?)
}

/// The law as it is, or the callable that stands for one.
pub fn law_of(function: &'static str, law: &Bound<'_, PyAny>, plant: &PlantSpec, raised: &Raised) -> Result<LawSpec, Failure> {
    if let Ok(law) = law.cast::<Law>() {
        return Ok(law.get().spec.clone());
    }
    // A motion can be called too, and so can a class: neither is a law.
    if !law.is_callable() || law.is_instance_of::<Motion>() || law.is_instance_of::<PyType>() {
        object::<Law>(function, "law", A_LAW, law)?;
    }
    let (call, raised, n) = (law.clone().unbind(), raised.clone(), plant.n());
    let answer = move |t: f64, x: &[f64], tau: &mut [f64]| {
        if force::failed(&raised) {
            return false;
        }
        Python::attach(|py| {
            let mut ask = || -> Result<(), Failure> {
                // t, then q, v, theta, theta_dot as far as the plant has them.
                let mut arguments = vec![t.into_pyobject(py).map_err(PyErr::from)?.into_any()];
                for part in x.chunks_exact(n) {
                    arguments.push(PyArray1::from_slice(py, part).into_any());
                }
                let answer = call.bind(py).call1(PyTuple::new(py, arguments)?)?;
                tau.copy_from_slice(&vector(function, "law", &answer, n)?);
                Ok(py.check_signals()?)
            };
            ask().map_err(|failure| force::keep(&raised, py, function, failure)).is_ok()
        })
    };
    Ok(LawSpec::External(ExternalSpec { model: plant.model().clone(), plant: plant.kind(), call: Arc::new(answer) }))
}

/// What was raised inside a run, or by Ctrl-C.
pub fn raise(signal: Option<PyErr>, raised: &Raised) -> Result<(), Failure> {
    let inside = raised.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take();
    signal.or(inside).map_or(Ok(()), |error| Err(Failure::Python(error)))
}

/// One run as a dictionary of its fields; keywords as `armlet.simulate` documents them.
#[pyfunction]
pub fn simulate<'py>(
    py: Python<'py>,
    plant: &Bound<'py, PyAny>,
    law: &Bound<'py, PyAny>,
    q0: &Bound<'py, PyAny>,
    keywords: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyDict>> {
    const NAME: &str = "simulate";
    entry(py, NAME, || {
        let plant = object::<Plant>(NAME, "plant", A_PLANT, plant)?;
        let plant = &plant.get().spec;
        let raised = Raised::default();
        let law = &law_of(NAME, law, plant, &raised)?;
        let given = Given { function: NAME, keywords: keywords.clone() };
        let n = plant.n();
        let options = given.options(n)?;
        let (_, x0) = given.initial_states(&[plant], q0, false)?;
        let (force, force_frame) = given.force(plant, law, &raised)?;
        let problem = Problem { plants: vec![plant], laws: vec![law], x0, forces: force.iter().collect(), force_frame, options };
        warn_of_sampling(py, NAME, &problem)?;
        let dense = given.get("dense")?.map_or(Ok(false), |dense| flag(NAME, "dense", &dense))?;
        let mut asked = event::asked(plant, given.get("events")?, dense, &raised)?;
        let mut signal = None;
        let run = {
            let mut interrupted = listen(&mut signal);
            let mut poll = || force::failed(&raised) || interrupted();
            py.detach(|| core::simulate_asked(&problem, &core::Poller::new(&mut poll), asked.as_mut()))?
        };
        raise(signal, &raised)?;
        let (k, p) = (run.t.len(), law.initial_state().len());
        let fields = PyDict::new(py);
        put(&fields, "t", run.t, &[k])?;
        let series =
            [("q", run.q), ("v", run.v), ("tau", run.tau), ("theta", run.theta), ("theta_dot", run.theta_dot), ("estimate", run.z)];
        put_series(&fields, &[], k, n, p, series)?;
        let series = PyDict::new(py);
        for (name, values) in run.monitors {
            put(&series, name, values, &[k])?;
        }
        fields.set_item("monitors", series)?;
        fields.set_item("status", run.status.code())?;
        fields.set_item("ended", run.ended)?;
        let stats = PyDict::new(py);
        stats.set_item("evaluations", run.evaluations)?;
        stats.set_item("steps", run.steps)?;
        stats.set_item("rejections", run.rejections)?;
        fields.set_item("stats", stats)?;
        if let Some(asked) = asked {
            event::answer(&fields, plant, p, asked)?;
        }
        Ok(fields)
    })
}

/// Look for Ctrl-C: what it raised is kept, and the work is told to stop.
pub fn listen(signal: &mut Option<PyErr>) -> impl FnMut() -> bool + '_ {
    move || {
        if signal.is_none() {
            *signal = Python::attach(|py| py.check_signals()).err();
        }
        signal.is_some()
    }
}

/// Work without the GIL, on a thread of its own while this one listens for Ctrl-C, which sets what `work` is given.
pub fn listening<T: Send>(py: Python<'_>, work: impl FnOnce(&Arc<AtomicBool>) -> CoreResult<T> + Send) -> Result<T, Failure> {
    let (mut signal, stop) = (None, Arc::new(AtomicBool::new(false)));
    let result = {
        let mut interrupted = listen(&mut signal);
        let mut poll = || stop.fetch_or(interrupted(), Ordering::Relaxed);
        py.detach(|| parallel::on_worker(&mut poll, |_| work(&stop)))
    };
    match signal {
        Some(signal) => Err(Failure::Python(signal)),
        None => Ok(result?),
    }
}

/// A batch as a dictionary of its fields; keywords as `armlet.simulate_batch` documents them.
#[pyfunction]
pub fn simulate_batch<'py>(
    py: Python<'py>,
    plant: &Bound<'py, PyAny>,
    law: &Bound<'py, PyAny>,
    q0: &Bound<'py, PyAny>,
    keywords: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyDict>> {
    const NAME: &str = "simulate_batch";
    entry(py, NAME, || {
        let plants = several::<Plant>(NAME, "plant", "a plant such as RigidArm, or a list of them", plant)?;
        let laws = several::<Law>(NAME, "law", "a law such as Adaptive, or a list of them", law)?;
        let given = Given { function: NAME, keywords: keywords.clone() };
        let keep = match text(NAME, "keep", &given.required("keep")?)?.as_str() {
            "all" => Keep::All,
            "final" => Keep::Final,
            other => {
                let problem = format!("is unknown: expected one of all, final, metrics, got {other}");
                return Err(input_error(py, NAME, "keep", problem).into());
            }
        };
        let threads = match given.get("threads")? {
            Some(threads) => count(NAME, "threads", &threads)?,
            None => core::default_threads(),
        };
        let plants: Vec<&PlantSpec> = plants.iter().map(|plant| &plant.get().spec).collect();
        let laws: Vec<&LawSpec> = laws.iter().map(|law| &law.get().spec).collect();
        let n = plants[0].n();
        let options = given.options(n)?;
        let (rows, x0) = given.initial_states(&plants, q0, true)?;
        let raised = Raised::default();
        let (forces, force_frame) = given.forces(plants[0], laws[0], &raised)?;
        if forces.iter().any(|force| matches!(force, Force::Signal(_))) {
            let problem = "is a function: expected None, a constant or [(t_start, F), ...] in a batch, which runs without Python inside";
            return Err(input_error(py, NAME, "force", problem).into());
        }
        let p = laws[0].initial_state().len();
        let problem = Problem { plants, laws, x0, forces: forces.iter().collect(), force_frame, options };
        warn_of_sampling(py, NAME, &problem)?;
        let mut signal = None;
        let batch = {
            let mut poll = listen(&mut signal);
            py.detach(|| core::simulate_batch(&problem, keep, threads, &mut poll))?
        };
        raise(signal, &raised)?;
        let k = batch.t.len();
        let fields = PyDict::new(py);
        put(&fields, "t", batch.t, &[k])?;
        let series = [
            ("q", batch.q),
            ("v", batch.v),
            ("tau", batch.tau),
            ("theta", batch.theta),
            ("theta_dot", batch.theta_dot),
            ("estimate", batch.z),
        ];
        put_series(&fields, &[rows], k, n, p, series)?;
        let series = PyDict::new(py);
        for (name, values) in batch.monitors {
            put(&series, name, values, &[rows, k])?;
        }
        fields.set_item("monitors", series)?;
        let status: Vec<i64> = batch.status.iter().map(|s| i64::from(s.code())).collect();
        fields.set_item("status", PyArray1::from_vec(py, status))?;
        put(&fields, "ended", batch.ended, &[rows])?;
        Ok(fields)
    })
}

/// `(B, n)` initial states, copied; too many to hold is a `MemoryError` at once.
fn batch_rows(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<(usize, Vec<f64>), Failure> {
    let py = value.py();
    if let Ok(shape) = value.getattr("shape").and_then(|shape| shape.extract::<Vec<usize>>())
        && let [rows, _] = shape.as_slice()
        && *rows as u128 * n as u128 * 8 > isize::MAX as u128 / 64
    {
        return Err(armlet_core::error::Error::Memory { bytes: *rows as u128 * n as u128 * 8 }.into());
    }
    let (shape, values) = numbers(function, name, value)?;
    if shape.len() != 2 || shape[1] != n {
        return Err(input_error(py, function, name, format!("has the wrong shape: expected (B, {n}), got {}", shown(&shape))).into());
    }
    require_finite(py, function, name, &shape, &values)?;
    Ok((shape[0], values.into_owned()))
}

/// How the extension was built and what it chose at run time.
#[pyfunction]
pub fn build_info(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    use armlet_core::scalar;
    let info = PyDict::new(py);
    info.set_item("version", env!("CARGO_PKG_VERSION"))?;
    info.set_item("profile", if cfg!(debug_assertions) { "debug" } else { "release" })?;
    info.set_item("instruction_set", scalar::isa().name())?;
    info.set_item("best_instruction_set", scalar::Isa::best().name())?;
    info.set_item("lanes", core::lanes())?;
    info.set_item("threads", core::default_threads())?;
    Ok(info)
}

/// Code, name and advice of every status.
#[pyfunction]
pub fn statuses(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    use armlet_core::status::Status;
    PyList::new(py, Status::ALL.map(|s| (s.code(), s.name(), s.advice())))
}
