//! `armlet.Guarded`: a law with a momentum observer and a reaction to contact.

use super::Law;
use crate::arguments::gain;
use crate::arrays::{Axis, Form, adopted, copied, number, numbers, object, require_finite, text};
use crate::errors::{Failure, entry, input_error};
use crate::observer::MomentumObserver;
use armlet_core::law::{GuardedSpec, LawEvaluator, LawSpec, Reaction, touched};
use armlet_core::linalg::Gain;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyInt, PyTuple};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

const NAME: &str = "Guarded";
/// The defaults of the reaction "retract": the speed of the fastest joint, rad/s or m/s, and the duration of the motion, s.
const SPEED: f64 = 0.3;
const DURATION: f64 = 0.5;

/// A law with a momentum observer, which detects contact and reacts to it.
///
/// The residual `r` of the observer with the gain `K` follows the external torque `tau_ext`: `r_dot = K (tau_ext - r)`. It is computed from
/// measured states and commanded torques. In a sampled loop it is the residual of `MomentumObserver`. With thresholds, contact is the first
/// sample at which some `|r_i|` is above its threshold. From that sample on, a reaction `tau = g(q) + K_c (q_c - q) + D_c (q_c_dot - v)`
/// replaces the law, and the law's state is constant:
///
/// - "stop": `q_c` is the position at contact;
/// - "float": gravity is compensated, `K_c = 0`, and `D_c = damping` or zero;
/// - "retract": `q_c` moves from the position at contact in the direction of the residual at contact, for `duration`.
///
/// For elastic joints the observer reads the joint torque `K_J (theta - q)`, and the reaction uses the motor positions `theta` as `q`.
/// `run.residual`, `run.contact` and `run.touched` report the results of the observer.
///
/// Args:
///     law: the law before contact, of a rigid or elastic arm. It cannot be a Python function, or a law of a `VelocityArm`.
///     observer: a `MomentumObserver` of links, for its model, gain, friction and thresholds. The law keeps a copy.
///     reaction: "stop", "float" or "retract"; None: only the observer. A reaction requires thresholds, and a run with a `sample_time`.
///     stiffness: `K_c` of "stop" and "retract", N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)` (keyword only).
///     damping: `D_c`, N m s/rad or N s/m, positive definite: scalar, `(n,)` or `(n, n)`; may be None for "float" (keyword only).
///     speed: speed of the fastest joint during "retract", rad/s or m/s, > 0; 0.3 if None (keyword only).
///     duration: time for which `q_c` moves, s, > 0; 0.5 if None (keyword only).
///     joint_stiffness: `K_J`, N m/rad or N/m, scalar, `(n,)` or `(n, n)` (keyword only). It is required if `law` controls an elastic arm
///         and does not itself have `K_J`.
///
/// `run.estimate` records the law's state. It is the state of `law`, then `w` with `r = K (M v - w)`, and the integral of `r`, `(n,)` each.
/// A reaction adds `2 + 2 n` numbers, which are zero before the contact: `c`, `s`, and the products of `c` with `y_c` and `r_c`. `c` is the
/// duration of the sampling period that begins at the contact, and `s` is the time since the contact, both in s. `y_c` and `r_c` are the
/// position and the residual at the contact, `(n,)` each.
///
/// Raises:
///     InputError: an argument is of the wrong type or shape, is missing or not used, or a reaction has an observer without thresholds.
///
/// Source: De Luca, Albu-Schaeffer, Haddadin and Hirzinger, Collision detection and safe reaction with the DLR-III lightweight manipulator
/// arm, IROS 2006. Haddadin, De Luca and Albu-Schaeffer, Robot collisions: a survey on detection, isolation, and identification, 2017.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4])
/// >>> observer = al.MomentumObserver(arm, 50.0, threshold=2.0)
/// >>> law = al.Guarded(al.PDGravity(arm, [0.5, 0.3], 60.0, 9.0), observer, "stop", stiffness=60.0, damping=12.0)
/// >>> push = [(0.0, [0.0, 0.0, 0.0]), (1.0, [0.0, 20.0, 0.0])]
/// >>> run = al.simulate(al.RigidArm(arm), law, [0.5, 0.3], t_end=1.5, sample_time=1e-3, force=push, force_frame="link2")
/// >>> round(run.contact.time, 3), run.contact.joint
/// (1.004, 0)
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct Guarded {
    /// The law before contact.
    #[pyo3(get)]
    law: Py<PyAny>,
    /// The other arguments of the constructor, for `repr` and pickling.
    others: Vec<(&'static str, Py<PyAny>)>,
}

/// The arguments of a reaction: its gains, and the speed and the duration of "retract".
struct ReactionArguments<'a, 'py> {
    n: usize,
    stiffness: Option<&'a Bound<'py, PyAny>>,
    damping: Option<&'a Bound<'py, PyAny>>,
    speed: Option<&'a Bound<'py, PyAny>>,
    duration: Option<&'a Bound<'py, PyAny>>,
}

impl<'py> ReactionArguments<'_, 'py> {
    /// Read a gain that the reaction requires.
    fn needed(&self, py: Python<'py>, name: &'static str, value: Option<&Bound<'py, PyAny>>, kind: &str) -> Result<Gain, Failure> {
        match value {
            Some(value) => gain(NAME, name, value, self.n),
            None => Err(input_error(py, NAME, name, format!("is missing: expected a gain for the reaction {kind:?}, got None")).into()),
        }
    }

    /// Refuse arguments that the reaction does not use.
    fn unused(&self, py: Python<'py>, names: &[&'static str], kind: &str) -> Result<(), Failure> {
        let all = [("stiffness", self.stiffness), ("damping", self.damping), ("speed", self.speed), ("duration", self.duration)];
        match all.into_iter().find(|(name, value)| names.contains(name) && value.is_some()) {
            None => Ok(()),
            Some((name, _)) => Err(input_error(py, NAME, name, format!("is not used: expected None for the reaction {kind}")).into()),
        }
    }

    fn reaction(&self, py: Python<'py>, kind: &str) -> Result<Reaction, Failure> {
        match kind {
            "stop" => {
                self.unused(py, &["speed", "duration"], "'stop'")?;
                Ok(Reaction::Stop(self.needed(py, "stiffness", self.stiffness, kind)?, self.needed(py, "damping", self.damping, kind)?))
            }
            "float" => {
                self.unused(py, &["stiffness", "speed", "duration"], "'float'")?;
                Ok(Reaction::Float(self.damping.map(|damping| gain(NAME, "damping", damping, self.n)).transpose()?))
            }
            "retract" => {
                let number = |name, value: Option<&Bound<'py, PyAny>>, usual| value.map_or(Ok(usual), |value| number(NAME, name, value));
                Ok(Reaction::Retract(
                    self.needed(py, "stiffness", self.stiffness, kind)?,
                    self.needed(py, "damping", self.damping, kind)?,
                    number("speed", self.speed, SPEED)?,
                    number("duration", self.duration, DURATION)?,
                ))
            }
            other => {
                let problem = format!("is unknown: expected 'stop', 'float', 'retract' or None, got {other:?}");
                Err(input_error(py, NAME, "reaction", problem).into())
            }
        }
    }
}

impl Guarded {
    fn spec<'a>(slf: &'a Bound<'_, Self>) -> Option<&'a GuardedSpec> {
        match &slf.as_super().get().spec {
            LawSpec::Guarded(law) => Some(law),
            _ => None,
        }
    }
}

#[entered]
#[pymethods]
impl Guarded {
    #[new]
    #[arguments(law, observer, reaction=None, *, stiffness=None, damping=None, speed=None, duration=None, joint_stiffness=None)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let inner = object::<Law>(NAME, "law", "a law such as PDGravity(..)", law)?;
        let watching = object::<MomentumObserver>(NAME, "observer", "a MomentumObserver(..)", observer)?;
        let spec = inner.get().spec.clone();
        let n = spec.model().n();
        let Some((links, thresholds)) = watching.get().of_links(py) else {
            return Err(input_error(py, NAME, "observer", "is one of motors: expected one of links").into());
        };
        let given = ReactionArguments { n, stiffness, damping, speed, duration };
        let kind = reaction.map(|reaction| text(NAME, "reaction", reaction)).transpose()?;
        let reaction = match &kind {
            None => {
                given.unused(py, &["stiffness", "damping", "speed", "duration"], "None")?;
                None
            }
            Some(kind) => Some(given.reaction(py, kind)?),
        };
        let springs = joint_stiffness.map(|stiffness| gain(NAME, "joint_stiffness", stiffness, n)).transpose()?;
        let spec = LawSpec::from(GuardedSpec::new(spec, links, thresholds, reaction, springs)?);

        let mut others = vec![("observer", py.import("copy")?.call_method1("copy", (observer,))?.unbind())];
        others.extend(kind.map(|kind| ("reaction", kind.into_pyobject(py).map(|text| text.into_any().unbind()))).map(|(name, text)| {
            let Ok(text) = text;
            (name, text)
        }));
        let all = [("stiffness", stiffness), ("damping", damping), ("speed", speed), ("duration", duration)];
        for (name, value) in all.into_iter().chain([("joint_stiffness", joint_stiffness)]) {
            if let Some(value) = value {
                let (shape, values) = numbers(NAME, name, value, &[crate::arrays::WHATEVER])?;
                let copy = copied(py, &shape, &values)?;
                others.push((name, copy.unbind()));
            }
        }
        let evaluator = Mutex::new(LawEvaluator::new(&spec));
        let base = Law { spec, evaluator, arm: inner.get().arm.clone_ref(py), arguments: Vec::new(), warns: AtomicBool::new(false) };
        Ok(PyClassInitializer::from(base).add_subclass(Guarded { law: law.clone().unbind(), others }))
    }

    /// A copy of the observer, with its thresholds.
    #[getter]
    fn observer<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("copy")?.call_method1("copy", (&self.others[0].1,))
    }

    /// The reaction: "stop", "float", "retract", or None.
    #[getter]
    fn reaction(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.others.iter().find(|(name, _)| *name == "reaction").map(|(_, kind)| kind.clone_ref(py))
    }

    /// The motion that the law before contact tracks; None for a law with a constant target.
    #[getter]
    fn motion<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.law.bind(py).getattr("motion")
    }

    /// The gain `K` of the observer, `(n, n)`, 1/s.
    #[getter]
    fn _gain<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        entry(slf.py(), NAME, || {
            let (n, gain) = Guarded::spec(slf).map_or((0, Vec::new()), |law| (law.gain().n(), law.gain().matrix()));
            Ok(adopted(slf.py(), &[n, n], gain)?)
        })
    }

    /// The index in the law's state at which the observer's part begins.
    #[getter]
    fn _first(slf: &Bound<'_, Self>) -> usize {
        Guarded::spec(slf).map_or(0, |law| law.inner.initial_state().len())
    }

    /// The index of the joint of the touched link for residuals `(n,)`, `(K, n)` or `(B, K, n)`, N m or N; -1 without contact.
    ///
    /// The result is one index, or an array of indices `(K,)` or `(B, K)`. The joint is the outermost one with `|r_i|` above its threshold,
    /// as in `MomentumObserver.contact`.
    ///
    /// Raises:
    ///     InputError: a shape is wrong, a number is not finite, or the observer has no thresholds.
    fn touched<'py>(slf: &Bound<'py, Self>, residual: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Failure> {
        let Some(law) = Guarded::spec(slf) else { return Ok(PyInt::new(py, -1).into_any()) };
        let n = law.observed().n();
        let forms = [Form(&[Axis::Is(n)]), Form(&[Axis::Any("K"), Axis::Is(n)]), Form(&[Axis::Any("B"), Axis::Any("K"), Axis::Is(n)])];
        let (shape, values) = numbers(NAME, "residual", residual, &forms)?;
        require_finite(py, NAME, "residual", &shape, &values)?;
        if law.thresholds().is_empty() {
            return Err(input_error(py, NAME, "threshold", "is missing: expected an observer with thresholds").into());
        }
        let joint = |r: &[f64]| touched(law.observed(), law.thresholds(), r).map_or(-1, |joint| joint as i64);
        let found: Vec<i64> = values.chunks_exact(n).map(joint).collect();
        match shape.len() {
            1 => Ok(PyInt::new(py, found[0]).into_any()),
            axes => Ok(adopted(py, &shape[..axes - 1], found)?),
        }
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let py = slf.py();
        let mut parts = vec![slf.get().law.bind(py).repr()?.to_string()];
        for (name, value) in &slf.get().others {
            let value = value.bind(py);
            let value = value.call_method0("tolist").unwrap_or_else(|_| value.clone());
            parts.push(format!("{name}={}", value.repr()?));
        }
        Ok(format!("Guarded({})", parts.join(", ")))
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let keywords = PyDict::new(py);
        keywords.set_item("law", &self.law)?;
        for (name, value) in &self.others {
            keywords.set_item(name, value)?;
        }
        Ok((PyTuple::empty(py), keywords))
    }
}
