//! `armlet.Law`, the base class of all laws, and the common code of their constructors.

mod adaptive;
mod elastic;
mod guarded;
mod impedance;
mod priority;
mod rigid;

pub use adaptive::*;
pub use elastic::*;
pub use guarded::Guarded;
pub use impedance::CartesianImpedance;
pub use priority::*;
pub use rigid::*;

use crate::arguments::Arguments;
use crate::arm::Arm;
use crate::arrays::{adopted, copied, new_vector, number, of_shape, optional_number, require_finite, vector};
use crate::constructor_call::{NamedValues, defined_by_arguments};
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::long;
use crate::motion::Motion;
use crate::priority::put_active_rows;
use crate::warnings::warn;
use armlet_core::error::{all_finite, positive};
use armlet_core::law::{JointReference, LawEvaluator, LawSpec};
use armlet_core::plant::PlantKind;
use armlet_core::trace::cache::free;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyList};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// A control law: `law(t, q, v)` returns the input of the plant, `(n,)`. This is the base class of all laws.
#[pyclass(frozen, subclass, module = "armlet", name = "Law")]
pub struct Law {
    pub spec: LawSpec,
    /// The recordings and buffers of the law, which are reused from call to call.
    evaluator: Mutex<LawEvaluator>,
    /// The arm of the law.
    #[pyo3(get)]
    arm: Py<Arm>,
    /// The other arguments of the constructor, for `repr` and pickling.
    arguments: NamedValues,
    /// Whether a call warns of a command that passes the arm's own speed limits.
    warns: AtomicBool,
}

defined_by_arguments!(Law, arm);

impl Arguments<'_> {
    /// Make the Python object of a law from its arguments and its specification.
    fn law(self, spec: impl Into<LawSpec>) -> PyClassInitializer<Law> {
        let spec = spec.into();
        let evaluator = Mutex::new(LawEvaluator::new(&spec));
        // With `limits=True` commands keep the limits, and with `limits=False` they are ignored.
        let decided = self.arguments.iter().any(|(name, _)| *name == "limits");
        let warns = AtomicBool::new(matches!(spec, LawSpec::PriorityVelocity(_)) && !decided);
        PyClassInitializer::from(Law { spec, evaluator, arm: self.arm.unbind(), arguments: self.arguments, warns })
    }
}

/// The time `t` in s, the state of the plant, and the state of the law.
type CallArguments = (f64, Vec<f64>, Vec<f64>);

/// Check the arguments of a call of a law.
fn call_arguments(
    function: &str,
    spec: &LawSpec,
    t: &Bound<'_, PyAny>,
    (q, v): (&Bound<'_, PyAny>, &Bound<'_, PyAny>),
    motors: [Option<&Bound<'_, PyAny>>; 2],
    state: Option<&Bound<'_, PyAny>>,
) -> Result<CallArguments, Failure> {
    let py = q.py();
    let t = number(function, "t", t)?;
    require_finite(py, function, "t", &[], &[t])?;
    let n = spec.model().n();
    let mut x = vector(function, "q", q, n)?;
    let rates = vector(function, "v", v, n)?;
    if spec.plant().has_speeds() {
        x.extend(rates);
    }
    for (name, value) in ["theta", "theta_dot"].into_iter().zip(motors) {
        match (value, spec.plant().has_motors()) {
            (Some(value), true) => x.extend(vector(function, name, value, n)?),
            (None, true) => {
                let problem = format!("is missing: expected ({n},) for a law of elastic arms, got None");
                return Err(input_error(py, function, name, problem).into());
            }
            (Some(_), false) => return Err(input_error(py, function, name, "is not used: expected None for a law of rigid arms").into()),
            (None, false) => {}
        }
    }
    let initial = spec.initial_state();
    let z = match state {
        Some(state) => vector(function, "state", state, initial.len())?,
        None => spec.start(&x),
    };
    Ok((t, x, z))
}

/// A speed passes its limit if it exceeds the limit by more than this fraction. Rounding of a command at its bound is smaller.
const SPEED_MARGIN: f64 = 1e-6;

/// The names of terms that are lists with one entry per level of priority.
const PER_LEVEL: [&str; 6] = ["e", "e_dot", "J", "J_dot", "command", "residuals"];

/// Split stacked rows into a list of arrays, one per level of priority.
fn by_level<'py>(py: Python<'py>, rows: &[usize], shape: &[usize], values: &[f64]) -> Result<Bound<'py, PyList>, Failure> {
    let width: usize = shape[1..].iter().product();
    let (mut at, mut parts) = (0, Vec::with_capacity(rows.len()));
    for &m in rows {
        let shape: Vec<usize> = std::iter::once(m).chain(shape[1..].iter().copied()).collect();
        parts.push(copied(py, &shape, &values[at * width..(at + m) * width])?);
        at += m;
    }
    Ok(PyList::new(py, parts)?)
}

impl Law {
    /// Evaluate the law. If another thread uses the buffers, this call allocates separate ones.
    fn evaluate<T>(&self, of: impl FnOnce(&mut LawEvaluator) -> T) -> T {
        match free(&self.evaluator) {
            Some(mut evaluator) => of(&mut evaluator),
            None => of(&mut LawEvaluator::new(&self.spec)),
        }
    }

    /// Warn once if commanded velocities pass the finite positive speed limits of the arm.
    fn warn_of_speeds(&self, py: Python<'_>, commands: &[f64]) -> Result<(), Failure> {
        if !self.warns.load(Ordering::Relaxed) {
            return Ok(());
        }
        let arm = self.spec.model().tree("arm")?;
        let ratio = |(command, limit): (&f64, f64)| if limit > 0.0 { command.abs() / limit } else { 0.0 };
        let limited = arm.independent().zip(commands);
        let most = limited.max_by(|(a, x), (b, y)| ratio((x, a.limits.velocity)).total_cmp(&ratio((y, b.limits.velocity))));
        let Some((joint, command)) = most.filter(|(joint, command)| ratio((command, joint.limits.velocity)) > 1.0 + SPEED_MARGIN) else {
            return Ok(());
        };
        self.warns.store(false, Ordering::Relaxed);
        let (unit, limit) = (if joint.kind.is_angle() { "rad/s" } else { "m/s" }, joint.limits.velocity);
        let speed = format!("{:.4} {unit} of {}, whose limit is {limit} {unit}", command.abs(), joint.name);
        let advice = "limits=True of the law keeps the limits, and limits=False omits this warning";
        warn(py, format!("{}: commands pass the arm's speed limits: {speed}; {advice}", self.spec.name()))?;
        Ok(())
    }
}

#[entered]
#[pymethods]
impl Law {
    /// Compute the input of the plant, `(n,)`, at the time `t` in s, the positions `q` and the velocities `v`, `(n,)` each.
    ///
    /// `theta`, `theta_dot`: motor positions and velocities, `(n,)`, rad or m, rad/s or m/s, for laws of elastic arms. `state`: the
    /// state of the law, such as an estimate `(p,)`; its initial value if None.
    ///
    /// Raises:
    ///     InputError: an argument is wrong, or the input is not finite because a product overflows.
    ///
    /// Warns:
    ///     UserWarning: commanded velocities pass the arm's own speed limits for the first time, see `limits` of `PriorityVelocity`.
    #[arguments(t, q, v, *, theta=None, theta_dot=None, state=None)]
    fn __call__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let name = self.spec.name();
        entry(py, name, || {
            let n = self.spec.model().n();
            let answer = |t: f64, parts: &[&[f64]], z: Option<&[f64]>| {
                new_vector(py, n, |tau| {
                    self.evaluate(|evaluator| evaluator.input(t, parts, z, tau));
                    match tau.iter().position(|x| !x.is_finite()) {
                        None => self.warn_of_speeds(py, tau),
                        Some(i) => {
                            let problem = "give an input that is not finite: expected finite numbers, got";
                            Err(input_error(py, name, "t, q, v", format!("{problem} {} (first bad index {i})", tau[i])).into())
                        }
                    }
                })
            };
            // The fast path of a control loop reads arrays in place, if their type and shape allow this.
            if let (PlantKind::Rigid, None, None, None) = (self.spec.plant(), theta, theta_dot, state)
                && let (Ok(time), Some(q), Some(v)) = (t.cast::<PyFloat>(), of_shape(q, &[n]), of_shape(v, &[n]))
                && time.value().is_finite()
                && all_finite(q)
                && all_finite(v)
            {
                return answer(time.value(), &[q, v], None);
            }
            let (t, x, z) = call_arguments(name, &self.spec, t, (q, v), [theta, theta_dot], state)?;
            answer(t, &[&x], Some(&z))
        })
    }

    /// Make a law with other values of some arguments, such as `law.replace(kp=80.0)`. The other arguments do not change.
    ///
    /// Args:
    ///     changes: arguments of the law's constructor, by name.
    ///
    /// Returns:
    ///     A law of the same class.
    ///
    /// Raises:
    ///     InputError: a value is not valid.
    ///     TypeError: the constructor has no argument of this name.
    ///
    /// >>> import armlet as al
    /// >>> law = al.PDGravity(al.planar_arm([1.0], gravity=(0.0, 0.0)), [0.5], 50.0, 10.0)
    /// >>> law(0.0, [0.0], [0.0]), law.replace(kp=80.0)(0.0, [0.0], [0.0])
    /// (array([25.]), array([40.]))
    #[pyo3(signature = (**changes))]
    fn replace<'py>(slf: &Bound<'py, Self>, changes: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        let call = slf.call_method0("__getnewargs_ex__")?;
        let arguments = call.get_item(1)?.cast_into::<PyDict>()?;
        if let Some(changes) = changes {
            arguments.update(changes.as_mapping())?;
        }
        slf.get_type().call((), Some(&arguments))
    }

    /// Return a dict of the quantities that the law computes at one instant, such as its error. It has the same arguments as a call of the
    /// law. For a law with a state, `state` is this state, `(p,)`, and `state_rate` its rate, 1/s times its units. `sample_time`, s, is that of
    /// the loop; None for a continuous loop. Limits of `PriorityVelocity` and `PriorityAcceleration` depend on it.
    #[arguments(t, q, v, *, theta=None, theta_dot=None, state=None, sample_time=None)]
    fn terms<'py>(&self) -> Result<Bound<'py, PyDict>, Failure> {
        let (t, x, z) = call_arguments(NAME, &self.spec, t, (q, v), [theta, theta_dot], state)?;
        let parts = PyDict::new(py);
        let rows = self.spec.level_rows();
        let period = optional_number(NAME, "sample_time", sample_time)?;
        period.map_or(Ok(()), |period| positive("sample_time", period))?;
        let mut terms = self.evaluate(|evaluator| evaluator.sampled_terms(period, t, &[&x], Some(&z)));
        put_active_rows(&parts, &self.spec, &mut terms)?;
        for (name, shape, values) in terms {
            if !rows.is_empty() && matches!(name, "rows" | "ranks") {
                parts.set_item(name, values.iter().map(|&count| count as usize).collect::<Vec<_>>())?;
                continue;
            }
            if !rows.is_empty() && PER_LEVEL.contains(&name) {
                parts.set_item(name, by_level(py, &rows, &shape, &values)?)?;
                continue;
            }
            parts.set_item(name, copied(py, &shape, &values)?)?;
        }
        Ok(parts)
    }

    /// The derivative of `[tau, z_dot]` with respect to `[x, z]`, `(n + p, states + p)`. `tau` is the input of the plant, `x` the plant's
    /// state, and `z` the law's state. None for a law that branches on its data. The arguments are those of a call of the law.
    #[arguments(t, q, v, *, theta=None, theta_dot=None, state=None)]
    fn _slope<'py>(&self) -> Result<Option<Bound<'py, PyAny>>, Failure> {
        let (t, x, z) = call_arguments(NAME, &self.spec, t, (q, v), [theta, theta_dot], state)?;
        let slope = long(py, || Ok(self.evaluate(|evaluator| evaluator.slope(t, &x, &z))))?;
        let Some(slope) = slope else { return Ok(None) };
        let columns = x.len() + z.len();
        Ok(Some(copied(py, &[slope.len() / columns, columns], &slope)?))
    }

    /// The motion that the law tracks, of the joints or of its frame; None for a law with a constant target or with several tasks.
    #[getter]
    fn motion(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        let mut given = self.arguments.iter().filter(|(name, _)| matches!(*name, "motion" | "target")).map(|(_, value)| value);
        given.find(|value| value.bind(py).is_instance_of::<Motion>()).map(|motion| motion.clone_ref(py))
    }

    /// The number of states of the law, such as the entries of an estimate.
    #[getter]
    fn _state_count(&self) -> usize {
        self.spec.initial_state().len()
    }

    /// The motion of the joints from which errors are measured; None for a law with another reference or without one.
    #[getter]
    fn _joint_motion<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let moves = matches!(slf.get().spec.joint_reference(), Some(JointReference::Motion));
        moves.then(|| slf.as_any().getattr("motion")).transpose()
    }

    /// The constant position of the joints from which errors are measured, `(n,)`; None for a law with another reference or without one.
    #[getter]
    fn _joint_target<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(JointReference::Target(target)) = self.spec.joint_reference() else { return Ok(None) };
        adopted(py, &[target.len()], target).map(Some)
    }
}
