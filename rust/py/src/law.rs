//! `armlet.Law` and its members, and `armlet.RigidArm`.

use crate::arm::Arm;
use crate::arrays::{new_array, new_vector, number, numbers, object, require_finite, shown, vector};
use crate::errors::{Failure, entry, input_error};
use crate::motion::Motion;
use armlet_core::law::{AdaptiveSpec, ComputedTorqueSpec, Gain, LawSpec};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

const AN_ARM: &str = "an Arm such as planar_pr(..)";
const A_MOTION: &str = "a Motion such as Hold";

/// A rigid arm driven by joint torques: `M(q) a + C(q, v) v + g(q) = tau`, `x = [q, v]`.
///
/// >>> import armlet as al
/// >>> al.RigidArm(al.planar_pr(2.0, 0.5, 0.5))
/// RigidArm(planar_pr(A=2, B=0.5, C=0.5))
#[pyclass(frozen, module = "armlet")]
pub struct RigidArm {
    #[pyo3(get)]
    pub arm: Py<Arm>,
}

#[pymethods]
impl RigidArm {
    #[new]
    fn new(arm: &Bound<'_, PyAny>) -> PyResult<Self> {
        entry(arm.py(), "RigidArm", || Ok(RigidArm { arm: object::<Arm>("RigidArm", "arm", AN_ARM, arm)?.unbind() }))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("RigidArm({})", self.arm.bind(py).repr()?))
    }

    fn __getnewargs__(&self, py: Python<'_>) -> (Py<Arm>,) {
        (self.arm.clone_ref(py),)
    }
}

/// A control law: `law(t, q, v)` gives the plant's input `(n,)`. The base of all laws.
#[pyclass(frozen, subclass, module = "armlet", name = "Law")]
pub struct Law {
    pub spec: LawSpec,
    /// The arm the law was made for.
    #[pyo3(get)]
    arm: Py<Arm>,
    /// The motion it tracks.
    #[pyo3(get)]
    motion: Py<Motion>,
    arguments: Vec<(&'static str, Py<PyAny>)>,
}

/// `t, q, v` and the law's own state.
type Asked = (f64, Vec<f64>, Vec<f64>, Vec<f64>);

/// What a law is asked about, checked.
fn asked(
    function: &str,
    spec: &LawSpec,
    t: &Bound<'_, PyAny>,
    (q, v): (&Bound<'_, PyAny>, &Bound<'_, PyAny>),
    elastic: [Option<&Bound<'_, PyAny>>; 2],
    state: Option<&Bound<'_, PyAny>>,
) -> Result<Asked, Failure> {
    let py = q.py();
    let t = number(function, "t", t)?;
    require_finite(py, function, "t", &[], &[t])?;
    for (name, value) in ["theta", "theta_dot"].into_iter().zip(elastic) {
        if value.is_some() {
            return Err(input_error(py, function, name, "is not used: expected None for a law of rigid arms").into());
        }
    }
    let n = spec.motion().dof();
    let initial = spec.initial_state();
    let z = match state {
        Some(state) => vector(function, "state", state, initial.len())?,
        None => initial.to_vec(),
    };
    Ok((t, vector(function, "q", q, n)?, vector(function, "v", v, n)?, z))
}

#[pymethods]
impl Law {
    /// The plant's input `(n,)` at time `t` in s, position `q` and velocity `v`, `(n,)`.
    ///
    /// `state`: the law's own state, such as an estimate `(p,)`; its initial value if None.
    #[pyo3(signature = (t, q, v, *, theta=None, theta_dot=None, state=None))]
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        theta: Option<&Bound<'py, PyAny>>,
        theta_dot: Option<&Bound<'py, PyAny>>,
        state: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let name = self.spec.name();
        entry(py, name, || {
            let (t, q, v, z) = asked(name, &self.spec, t, (q, v), [theta, theta_dot], state)?;
            new_vector(py, q.len(), |tau| {
                self.spec.input(t, &q, &v, &z, tau);
                Ok(())
            })
        })
    }

    /// The named parts of the law at one instant, by name: arguments as for a call.
    #[pyo3(signature = (t, q, v, *, theta=None, theta_dot=None, state=None))]
    fn terms<'py>(
        &self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        theta: Option<&Bound<'py, PyAny>>,
        theta_dot: Option<&Bound<'py, PyAny>>,
        state: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        entry(py, "terms", || {
            let (t, q, v, z) = asked("terms", &self.spec, t, (q, v), [theta, theta_dot], state)?;
            let parts = PyDict::new(py);
            for (name, shape, values) in self.spec.terms(t, &q, &v, &z) {
                let array = new_array(py, &shape, |out| {
                    out.copy_from_slice(&values);
                    Ok(())
                })?;
                parts.set_item(name, array)?;
            }
            Ok(parts)
        })
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let (py, law) = (slf.py(), slf.get());
        let mut parts = vec![law.arm.bind(py).repr()?.to_string(), law.motion.bind(py).repr()?.to_string()];
        for (name, value) in &law.arguments {
            let value = value.bind(py);
            let value = value.call_method0("tolist").unwrap_or_else(|_| value.clone());
            parts.push(format!("{name}={}", value.repr()?));
        }
        Ok(format!("{}({})", slf.get_type().name()?, parts.join(", ")))
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let keywords = PyDict::new(py);
        keywords.set_item("arm", &self.arm)?;
        keywords.set_item("motion", &self.motion)?;
        for (name, value) in &self.arguments {
            keywords.set_item(name, value)?;
        }
        Ok((PyTuple::empty(py), keywords))
    }
}

/// A gain as the user gives it: a scalar, `(n,)` or `(n, n)`.
fn gain(function: &str, name: &'static str, value: &Bound<'_, PyAny>, n: usize) -> Result<Gain, Failure> {
    let (shape, values) = numbers(function, name, value)?;
    require_finite(value.py(), function, name, &shape, &values)?;
    match shape.as_slice() {
        [] => Ok(Gain::scalar(name, n, values[0])?),
        [rows] if *rows == n => Ok(Gain::diagonal(name, values.into_owned())?),
        [rows, columns] if *rows == n && *columns == n => Ok(Gain::full(name, n, values.into_owned())?),
        _ => {
            let problem = format!("has the wrong shape: expected a scalar, ({n},) or ({n}, {n}), got {}", shown(&shape));
            Err(input_error(value.py(), function, name, problem).into())
        }
    }
}

/// A copy of what the caller gave, so that changing it later changes nothing here.
fn kept<'py>(function: &str, name: &str, value: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Failure> {
    let (shape, values) = numbers(function, name, value)?;
    new_array(value.py(), &shape, |out| {
        out.copy_from_slice(&values);
        Ok(())
    })
}

/// Adaptive tracking (Slotine and Li): `tau = Y a_hat + Kp e + Kd e_dot`, `a_hat_dot = Gamma Y' s`.
///
/// `e = q_d - q`, `Lambda = Kd^-1 Kp`, `v_r = v_d + Lambda e`, `s = v_r - v`, `Y` the arm's regressor. The error
/// goes to zero from any initial state and any estimate; the estimate converges only under excitation.
///
/// Args:
///     arm: the arm whose regressor is used; its parameters are not.
///     motion: the desired motion.
///     kp, kd: positive definite gains: scalar, `(n,)` or `(n, n)`; `kp = kd Lambda`.
///     gamma: positive definite adaptation gain: scalar, `(p,)` or `(p, p)`.
///     estimate: initial estimate `(p,)`; zero if None (keyword only).
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a gain is not positive definite.
///
/// Source: Slotine and Li, On the adaptive control of robot manipulators, IJRR 6(3), 1987.
///
/// >>> import armlet as al
/// >>> arm = al.planar_pr(2.0, 0.5, 0.5)
/// >>> law = al.Adaptive(arm, al.Hold([1.0, 0.0]), kp=40.0, kd=20.0, gamma=5.0)
/// >>> law(0.0, [0.0, 0.0], [0.0, 0.0])
/// array([40.,  0.])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct Adaptive;

#[pymethods]
impl Adaptive {
    #[new]
    #[pyo3(signature = (arm, motion, kp, kd, gamma, *, estimate=None))]
    fn new(
        arm: &Bound<'_, PyAny>,
        motion: &Bound<'_, PyAny>,
        kp: &Bound<'_, PyAny>,
        kd: &Bound<'_, PyAny>,
        gamma: &Bound<'_, PyAny>,
        estimate: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        const NAME: &str = "Adaptive";
        entry(arm.py(), NAME, || {
            let (arm, motion) =
                (object::<Arm>(NAME, "arm", AN_ARM, arm)?.unbind(), object::<Motion>(NAME, "motion", A_MOTION, motion)?.unbind());
            let model = arm.get().model.planar_pr()?;
            let (n, p) = (2, 3);
            let gains = [gain(NAME, "kp", kp, n)?, gain(NAME, "kd", kd, n)?, gain(NAME, "gamma", gamma, p)?];
            let mut arguments = vec![("kp", kept(NAME, "kp", kp)?), ("kd", kept(NAME, "kd", kd)?), ("gamma", kept(NAME, "gamma", gamma)?)];
            let start = match estimate {
                Some(estimate) => {
                    arguments.push(("estimate", kept(NAME, "estimate", estimate)?));
                    Some(vector(NAME, "estimate", estimate, p)?)
                }
                None => None,
            };
            let [kp, kd, gamma] = gains;
            let spec = AdaptiveSpec::new(model, motion.get().core.clone(), kp, kd, gamma, start)?;
            let arguments = arguments.into_iter().map(|(name, value)| (name, value.unbind())).collect();
            Ok(PyClassInitializer::from(Law { spec: LawSpec::Adaptive(spec), arm, motion, arguments }).add_subclass(Adaptive))
        })
    }
}

/// Computed torque: `tau = M (a_d + Kd e_dot + Kp e) + C v + g`, so that `e_ddot + Kd e_dot + Kp e = 0`.
///
/// Args:
///     arm: the model of the plant.
///     motion: the desired motion.
///     kp, kd: positive definite gains, 1/s^2 and 1/s: scalar, `(n,)` or `(n, n)`.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, a gain is not positive definite.
///
/// >>> import armlet as al
/// >>> law = al.ComputedTorque(al.planar_pr(2.0, 0.5, 0.5), al.Hold([1.0, 0.0]), kp=100.0, kd=20.0)
/// >>> law(0.0, [0.0, 0.0], [0.0, 0.0])
/// array([200.,  50.])
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct ComputedTorque;

#[pymethods]
impl ComputedTorque {
    #[new]
    fn new(
        arm: &Bound<'_, PyAny>,
        motion: &Bound<'_, PyAny>,
        kp: &Bound<'_, PyAny>,
        kd: &Bound<'_, PyAny>,
    ) -> PyResult<PyClassInitializer<Self>> {
        const NAME: &str = "ComputedTorque";
        entry(arm.py(), NAME, || {
            let (arm, motion) =
                (object::<Arm>(NAME, "arm", AN_ARM, arm)?.unbind(), object::<Motion>(NAME, "motion", A_MOTION, motion)?.unbind());
            let model = arm.get().model.planar_pr()?;
            let (kp_gain, kd_gain) = (gain(NAME, "kp", kp, 2)?, gain(NAME, "kd", kd, 2)?);
            let arguments = vec![("kp", kept(NAME, "kp", kp)?.unbind()), ("kd", kept(NAME, "kd", kd)?.unbind())];
            let spec = ComputedTorqueSpec::new(model, motion.get().core.clone(), kp_gain, kd_gain)?;
            Ok(PyClassInitializer::from(Law { spec: LawSpec::ComputedTorque(spec), arm, motion, arguments }).add_subclass(ComputedTorque))
        })
    }
}
