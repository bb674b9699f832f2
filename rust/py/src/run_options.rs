//! The options of runs (`armlet/run/options.py`), converted to options, initial states, forces and laws of the core.

use crate::arguments::require_partner;
use crate::arrays::{
    ArrayArgument, Axis, Form, SCALAR, any_vector, count, flag, items, nonnegative_integer, number, numbers, object, optional_number,
    owned, quoted, require_finite, spread, text, vector,
};
use crate::errors::{Failure, input_error};
use crate::force::{self, Raised, force_frame};
use crate::law::Law;
use crate::motion::Motion;
use crate::warnings::LimitCheck;
use armlet_core::law::{ExternalSpec, LawSpec};
use armlet_core::memory;
use armlet_core::plant::PlantSpec;
use armlet_core::plant::sensors::TorqueSensor;
use armlet_core::simulate::{self as core, Force, Measures, Method, Options, Sampling, Times};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple, PyType};
use std::sync::Arc;

/// The largest number of rows of a batch whose laws, plants or forces are a list.
pub const MOST_ROWS: usize = 1 << 28;
const A_LAW: &str = "a law such as Adaptive";
/// The default relative tolerance of an adaptive method.
const RTOL: f64 = 1e-8;
const ATOL: f64 = 1e-10;

/// The options of a run: a `TypedDict` of `armlet/run/options.py`.
pub struct RunOptions<'py> {
    pub function: &'static str,
    pub entries: Bound<'py, PyDict>,
}

impl<'py> RunOptions<'py> {
    /// The value of an option; `None` if the option is missing or its value is the Python None.
    pub fn get(&self, name: &str) -> Result<Option<Bound<'py, PyAny>>, Failure> {
        Ok(self.entries.get_item(name)?.filter(|value| !value.is_none()))
    }

    pub fn required(&self, name: &str) -> Result<Bound<'py, PyAny>, Failure> {
        let missing = || input_error(self.entries.py(), self.function, name, "is missing: expected a value, got None");
        Ok(self.get(name)?.ok_or_else(missing)?)
    }

    fn number(&self, name: &str) -> Result<f64, Failure> {
        number(self.function, name, &self.required(name)?)
    }

    fn optional_number(&self, name: &str) -> Result<Option<f64>, Failure> {
        optional_number(self.function, name, self.get(name)?.as_ref())
    }

    /// Read `sample_time`: a period in s, or an `armlet.Sampling`.
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
            sensor_delay: nonnegative_integer(function, "sensor_delay", &value.getattr("sensor_delay")?)?,
            noise: channels("noise")?,
            resolution: channels("resolution")?,
            rate_limit: field("rate_limit")?,
            torque_sensor: torque_sensor(function, &value.getattr("torque_sensor")?, n)?,
            seed: nonnegative_integer(function, "seed", &value.getattr("seed")?)? as u64,
        }))
    }

    /// Read one number for all joints, or one per joint.
    fn per_joint(&self, name: &str, n: usize) -> Result<Option<Vec<f64>>, Failure> {
        let Some(value) = self.get(name)? else { return Ok(None) };
        let (shape, values) = numbers(self.function, name, &value, &[SCALAR, Form(&[Axis::Is(n)])])?;
        Ok(Some(spread(&shape, values, n)?))
    }

    pub fn options(&self, n: usize) -> Result<Options, Failure> {
        let function = self.function;
        let every = count(function, "record_every", &self.required("record_every")?)?;
        let times = match self.get("t_eval")? {
            Some(t_eval) if every == 1 => Times::At(any_vector(function, "t_eval", &t_eval)?),
            Some(t_eval) => {
                let problem = format!("takes effect only without t_eval: expected 1 with t_eval, got {every}");
                return Err(input_error(t_eval.py(), function, "record_every", problem).into());
            }
            None => Times::Every(every),
        };
        let method = self.method()?;
        self.require_unused(method)?;
        Ok(Options {
            method,
            t_end: self.number("t_end")?,
            dt: self.optional_number("dt")?,
            rtol: self.optional_number("rtol")?.unwrap_or(RTOL),
            atol: self.optional_number("atol")?.unwrap_or(ATOL),
            max_step: self.optional_number("max_step")?,
            sampling: self.sampling(n)?,
            times,
            tau_max: self.per_joint("tau_max", n)?,
            monitors: flag(self.function, "monitors", &self.required("monitors")?)?,
            state_limit: self.optional_number("state_limit")?.unwrap_or(core::DEFAULT_STATE_LIMIT),
        })
    }

    /// Read the option `metrics`, a dict with the arguments of `armlet.metrics`.
    pub fn measures(&self, n: usize) -> Result<Measures, Failure> {
        let mut measures = Measures::default();
        let Some(given) = self.get("metrics")? else { return Ok(measures) };
        let of = |name: &str| -> Result<Option<Bound<'py, PyAny>>, Failure> { Ok(given.get_item(name).ok().filter(|x| !x.is_none())) };
        let part = |name: &str, forms: &[Form]| -> Result<Option<Vec<f64>>, Failure> {
            let Some(value) = of(name)? else { return Ok(None) };
            let (shape, values) = numbers(self.function, &format!("metrics[\"{name}\"]"), &value, forms)?;
            Ok(Some(spread(&shape, values, n)?))
        };
        measures.band = part("band", &[SCALAR, Form(&[Axis::Is(n)])])?;
        measures.reference = part("reference", &[Form(&[Axis::Is(n)])])?;
        for (name, to) in [("settle", &mut measures.settle), ("tolerance", &mut measures.tolerance)] {
            if let Some(value) = of(name)? {
                *to = number(self.function, &format!("metrics[\"{name}\"]"), &value)?;
            }
        }
        if let Some(frame) = of("frame")? {
            measures.frame = Some(text(self.function, "metrics[\"frame\"]", &frame)?);
        }
        Ok(measures)
    }

    /// Read `check_limits`: the action for starts and targets outside of the joint limits.
    pub fn limit_check(&self) -> Result<LimitCheck, Failure> {
        LimitCheck::of(self.function, self.get("check_limits")?.as_ref())
    }

    pub fn method(&self) -> Result<Method, Failure> {
        let sampled = self.get("sample_time")?.is_some();
        Ok(Method::from_name(&text(self.function, "method", &self.required("method")?)?, sampled)?)
    }

    /// Refuse arguments that the integration method does not use.
    fn require_unused(&self, method: Method) -> Result<(), Failure> {
        let (unused, steps): (&[&str], _) =
            if method.is_adaptive() { (&["dt"], "chooses its steps itself") } else { (&["rtol", "atol", "max_step"], "takes fixed steps") };
        for name in unused {
            if let Some(value) = self.get(name)? {
                let problem = format!("is not used: expected None for {}, which {steps}, got {}", method.name(), quoted(&value));
                return Err(input_error(value.py(), self.function, name, problem).into());
            }
        }
        Ok(())
    }

    /// Read the initial states of the plants: their number of rows, and the numbers, `(rows, states)`.
    ///
    /// `q0`, `v0`, `theta0` and `theta_dot0` are `(n,)` for one run, and `(B, n)` for a batch.
    pub fn initial_states(&self, plants: &[&PlantSpec], q0: &Bound<'py, PyAny>, batch: bool) -> Result<(usize, Vec<f64>), Failure> {
        let n = plants[0].n();
        if let Some(i) = plants.iter().position(|plant| plant.bristles() != plants[0].bristles()) {
            let problem = format!("mixes models of friction: expected LuGre friction throughout or not at all (first bad index {i})");
            return Err(input_error(q0.py(), self.function, "plant", problem).into());
        }
        let read = |name: &str, value: &Bound<'py, PyAny>| -> Result<(usize, Vec<f64>), Failure> {
            if batch { batch_rows(self.function, name, value, plants[0]) } else { Ok((1, vector(self.function, name, value, n)?)) }
        };
        let (rows, q) = read("q0", q0)?;
        let mut others = [const { None }; 3];
        for (part, name) in others.iter_mut().zip(["v0", "theta0", "theta_dot0"]) {
            let Some(value) = self.get(name)? else { continue };
            let kind = plants[0].kind();
            if if name == "v0" { !kind.has_speeds() } else { !kind.has_motors() } {
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
        let [v, theta, theta_dot] = &others;
        let zero = vec![0.0; n];
        let part = |values: &'_ Option<Vec<f64>>, row: usize| values.as_ref().map(|values| values[row * n..(row + 1) * n].to_vec());
        let mut x0 = memory::reserved(rows.saturating_mul(plants[0].states()))?;
        for row in 0..rows {
            let plant = plants[if plants.len() == 1 { 0 } else { row.min(plants.len() - 1) }];
            let v = part(v, row).unwrap_or_else(|| zero.clone());
            x0.extend(plant.initial_state(&q[row * n..(row + 1) * n], &v, part(theta, row).as_deref(), part(theta_dot, row).as_deref()));
        }
        Ok((rows, x0))
    }

    /// Refuse a `force_frame` without a force. A `Simulator` accepts it, because each of its steps has its own force.
    pub fn require_force(&self) -> Result<(), Failure> {
        require_partner(self.function, "force_frame", self.get("force_frame")?.as_ref(), "force", self.get("force")?.is_some())
    }

    /// Read the force, and the index of the frame at which it acts. `raised` stores the exception of a callable.
    pub fn force(&self, plant: &PlantSpec, law: &LawSpec, raised: &Raised) -> Result<(Option<Force>, Option<usize>), Failure> {
        let (mut forces, frame) = self.forces(plant, law, raised)?;
        Ok((forces.pop(), frame))
    }

    /// Read the forces, and the index of the frame at which they act. The result has no force, one force for all runs, or one force per run
    /// (`[[(t_start, F), ...], ...]`).
    pub fn forces(&self, plant: &PlantSpec, law: &LawSpec, raised: &Raised) -> Result<(Vec<Force>, Option<usize>), Failure> {
        let frame = self.get("force_frame")?;
        require_partner(self.function, "force_frame", frame.as_ref(), "a plant whose input is a torque", plant.kind().has_speeds())?;
        let frame = match frame {
            None => None,
            Some(frame) => Some(force_frame(self.function, plant, &frame)?),
        };
        let Some(value) = self.get("force")? else { return Ok((Vec::new(), frame)) };
        let rows = if frame.is_some() { None } else { law.coordinates().map(|coordinates| coordinates.rows.as_slice()) };
        // A list of pairs (t_start, F) is one force. If the first entry of the first entry is a list or tuple, there is one force per run.
        let inner = value.cast::<PyList>().ok().and_then(|list| list.get_item(0).ok()?.get_item(0).ok());
        let nested = inner.is_some_and(|first| first.is_instance_of::<PyTuple>() || first.is_instance_of::<PyList>());
        let each = if nested {
            items(self.function, "force", "a list: expected lists of pairs (t_start, F)", &value, MOST_ROWS)?
        } else {
            vec![value]
        };
        let mut forces = memory::reserved(each.len())?;
        for value in &each {
            forces.push(force::force(self.function, value, rows, raised)?);
        }
        Ok((forces, frame))
    }
}

/// Read and copy a part of the initial states, `(B, n)`. If memory is insufficient for a batch of this size, the error is a `MemoryError`.
fn batch_rows(function: &str, name: &str, value: &Bound<'_, PyAny>, plant: &PlantSpec) -> Result<(usize, Vec<f64>), Failure> {
    let argument = ArrayArgument::new(function, name, value)?.of(&[Form(&[Axis::Any("B"), Axis::Is(plant.n())])])?;
    memory::require(argument.shape[0].saturating_mul(8 * (plant.n() + plant.states())))?;
    let (shape, values) = argument.values()?;
    require_finite(value.py(), function, name, &shape, &values)?;
    Ok((shape[0], owned(values)?))
}

/// Read an `armlet.TorqueSensor` of `n` joints, or None.
fn torque_sensor(function: &'static str, value: &Bound<'_, PyAny>, n: usize) -> Result<Option<TorqueSensor>, Failure> {
    if value.is_none() {
        return Ok(None);
    }
    let field = |name: &str| -> Result<f64, Failure> { number(function, name, &value.getattr(name)?) };
    let given = value.getattr("bias")?;
    let (shape, bias) = numbers(function, "bias", &given, &[SCALAR, Form(&[Axis::Is(n)])])?;
    let bias = spread(&shape, bias, n)?;
    Ok(Some(TorqueSensor::new(field("noise")?, bias, field("resolution")?, field("bandwidth")?)?))
}

/// Read the argument `law`: a law, or a callable `law(t, q, v, ..)` that returns the plant's input.
pub fn law_of(function: &'static str, law: &Bound<'_, PyAny>, plant: &PlantSpec, raised: &Raised) -> Result<LawSpec, Failure> {
    if let Ok(law) = law.cast::<Law>() {
        return Ok(law.get().spec.clone());
    }
    // A motion and a class are callable, but they are not laws.
    if !law.is_callable() || law.is_instance_of::<Motion>() || law.is_instance_of::<PyType>() {
        object::<Law>(function, "law", A_LAW, law)?;
    }
    let (call, raised, n) = (law.clone().unbind(), raised.clone(), plant.n());
    let answer = move |t: f64, x: &[f64], tau: &mut [f64]| {
        if force::failed(&raised) {
            return false;
        }
        Python::attach(|py| {
            let mut call = || -> Result<(), Failure> {
                // The callable receives t, q, and those of v, theta and theta_dot that are states of the plant.
                let mut arguments = vec![t.into_pyobject(py).map_err(PyErr::from)?.into_any()];
                for part in x.chunks_exact(n) {
                    arguments.push(PyArray1::from_slice(py, part).into_any());
                }
                let answer = call.bind(py).call1(PyTuple::new(py, arguments)?)?;
                tau.copy_from_slice(&vector(function, "law", &answer, n)?);
                Ok(py.check_signals()?)
            };
            call().map_err(|failure| force::store_error(&raised, py, function, failure)).is_ok()
        })
    };
    Ok(LawSpec::External(ExternalSpec { model: plant.model().clone(), plant: plant.kind(), call: Arc::new(answer) }))
}
