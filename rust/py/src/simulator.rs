//! `armlet.Simulator`: a loop with one step per call. Its state is in arrays that remain the same objects.

use crate::arrays::{new_array, object, of_shape, overwrite, vector};
use crate::errors::{Failure, entry, input_error, solve_error};
use crate::force::{Raised, raise};
use crate::keywords::{Keywords, law_of};
use crate::plant::Plant;
use crate::priority::status_member;
use crate::seal::{Sealed, seal_call};
use crate::simulator_state::{complete, fastest, finite_vector, law_state, state_of, wrench};
use crate::warnings::LimitCheck;
use armlet_core::law::{ExternalSpec, LawSpec};
use armlet_core::plant::PlantSpec;
use armlet_core::simulate::{Force, Problem, Stepping, require_fixed_steps, stepper};
use armlet_core::status::Status;
use armlet_macros::entered;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::{Mutex, PoisonError};

/// A closed loop with one step per call: `step()` advances by `dt` under the law, and `step(tau)` under your input.
///
/// `q`, `v` and `tau` are `(n,)` arrays, and so are `theta` and `theta_dot` of elastic arms, and `estimate` of laws with a state. `LuGre`
/// friction adds `bristles`. Every step overwrites them, so copy values that you keep. A call costs less than a microsecond in addition to the arithmetic.
///
/// Args:
///     plant: the controlled system, such as `RigidArm(arm)`.
///     law: the controller; None if every step has an input.
///     q0: initial position, `(n,)`, rad or m.
///     dt: the step, s (keyword only).
///     v0, theta0, theta_dot0, method, sample_time, force, force_frame, tau_max, state_limit, check_limits: as for `simulate` (keyword only).
///         The method has fixed steps: "euler", "semi_implicit", "rk4" or "ros2". `force_frame` is the frame of `step(force=)`.
///
/// `status` is `Status.SUCCESS` until a step diverges. The state would then not be finite, or would exceed `state_limit`. Such a step raises and is
/// not taken, so the arrays keep the state and the input before it. Every further step also raises, until `set_state` or `reset`.
/// `tau` is the input that acted, within `tau_max`.
///
/// Raises:
///     InputError: an argument has a wrong type, shape or value.
///     SolveError: a `step` diverges; `.partial` is the `state` before it.
///
/// Source: [HairerNorsettWanner1993] for the methods; docs/plants_and_laws.md.
///
/// >>> import armlet as al
/// >>> arm = al.pendulum(1.0, 5.0)
/// >>> sim = al.Simulator(al.RigidArm(arm), None, [0.5], dt=1e-3)
/// >>> for _ in range(1000):
/// ...     sim.step(5.0 * (0.2 - sim.q) - 2.0 * sim.v + arm.gravity(sim.q))
/// >>> round(sim.t, 6), sim.q.shape
/// (1.0, (1,))
#[pyclass(module = "armlet")]
pub struct Simulator {
    /// Never contended: the lock only allows Python to share the object.
    stepping: Mutex<Box<dyn Stepping>>,
    plant: PlantSpec,
    law: LawSpec,
    dt: f64,
    start: Vec<f64>,
    raised: Raised,
    has_law: bool,
    check: LimitCheck,
    /// The rows of a force of a step, if there is a frame for it: those of the law's coordinates, or all of a frame's.
    pushed: Option<Option<Vec<usize>>>,
    /// The arguments of the constructor: plant, law, q0 and the keywords.
    made_of: Py<PyTuple>,
    /// The state and the input in the core's order.
    x: Vec<f64>,
    input: Vec<f64>,
    given: Vec<f64>,
    #[pyo3(get)]
    q: Py<PyAny>,
    #[pyo3(get)]
    v: Py<PyAny>,
    #[pyo3(get)]
    tau: Py<PyAny>,
    #[pyo3(get)]
    theta: Option<Py<PyAny>>,
    #[pyo3(get)]
    theta_dot: Option<Py<PyAny>>,
    #[pyo3(get)]
    bristles: Option<Py<PyAny>>,
    #[pyo3(get)]
    estimate: Option<Py<PyAny>>,
}

const NAME: &str = "Simulator";

#[entered]
#[pymethods]
impl Simulator {
    #[new]
    #[pyo3(signature = (plant, law, q0, **keywords))]
    fn new<'py>(
        plant: &Bound<'py, PyAny>,
        law: &Bound<'py, PyAny>,
        q0: &Bound<'py, PyAny>,
        keywords: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Self> {
        Simulator::made(plant, law, q0, keywords.map_or(Ok(PyDict::new(plant.py())), |keywords| keywords.copy())?, true)
    }

    /// Advance by `dt`, under the law or under a constant `tau` `(n,)`.
    ///
    /// Args:
    ///     tau: the plant's input, `(n,)`, N m or N; None: the law's.
    ///     force: external force during this step, in place of that of the constructor (keyword only). It has the law's axes at the law's frame.
    ///         Otherwise it acts at `force_frame`, `(3,)`, or `(6,)` as `[f; m]`, in world axes, N and N m.
    ///
    /// Raises:
    ///     InputError: an argument has a wrong type, shape or value.
    ///     SolveError: the step diverges; it is not taken.
    #[pyo3(signature = (tau=None, *, force=None))]
    fn step(&mut self, py: Python<'_>, tau: Option<&Bound<'_, PyAny>>, force: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        const NAME: &str = "Simulator.step";
        entry(py, NAME, || {
            let push = force.map(|force| wrench(&self.pushed, force)).transpose()?;
            let status = match tau {
                Some(tau) => {
                    let n = self.given.len();
                    match of_shape(tau, &[n]) {
                        Some(values) => self.given.copy_from_slice(values),
                        None => self.given.copy_from_slice(&vector(NAME, "tau", tau, n)?),
                    }
                    if let Some(i) = self.given.iter().position(|x| !x.is_finite()) {
                        let problem = format!("is not finite: expected finite numbers, got {} (first bad index {i})", self.given[i]);
                        return Err(input_error(py, NAME, "tau", problem).into());
                    }
                    self.stepping.get_mut().unwrap_or_else(PoisonError::into_inner).step(Some(&self.given), push.as_ref())
                }
                None if self.has_law => self.stepping().step(None, push.as_ref()),
                None => return Err(input_error(py, NAME, "tau", "is missing: expected (n,), since there is no law").into()),
            };
            raise(&self.raised)?;
            self.show(py)?;
            if status == Status::Success { Ok(()) } else { Err(self.ended(py, status)?) }
        })
    }

    /// The status: `Status.SUCCESS`, or `Status.DIVERGED` after a step that diverged.
    #[getter]
    fn status(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        status_member(py, self.stepping.lock().unwrap_or_else(PoisonError::into_inner).status())
    }

    /// Continue from `q` and `v`, `(n,)`, at the present time. The state of the law does not change, unless it is given.
    ///
    /// Args:
    ///     q, v: position and velocity of the links, `(n,)`, rad or m and per second.
    ///     theta, theta_dot: the same of the motors of elastic arms (keyword only). None: the springs carry gravity, and the motors move with
    ///         the links, as at the start of `simulate`.
    ///     bristles: deflections of the bristles of `LuGre` friction, `(n,)`, rad or m (keyword only). None: zeros.
    ///     estimate: state of the law, as `estimate` of a simulator or of a run has it (keyword only). It is the integral of a `PID`, the estimate
    ///         of `Adaptive`, or the observer and the contact of `Guarded`. None: no change, but filters and observers start from `q` and `v`.
    ///
    /// Raises:
    ///     InputError: a shape is wrong, or a number is not finite. Also for motors, bristles or a state of the law where there are none.
    #[pyo3(signature = (q, v, *, theta=None, theta_dot=None, bristles=None, estimate=None))]
    fn set_state(
        &mut self,
        py: Python<'_>,
        q: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        theta: Option<&Bound<'_, PyAny>>,
        theta_dot: Option<&Bound<'_, PyAny>>,
        bristles: Option<&Bound<'_, PyAny>>,
        estimate: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        const NAME: &str = "Simulator.set_state";
        entry(py, NAME, || {
            let state = state_of(NAME, &self.plant, (q, v), (theta, theta_dot), bristles)?;
            let mut law = self.x[state.len()..].to_vec();
            match estimate {
                None => self.law.restart(&state, &mut law),
                Some(estimate) => law = law_state(NAME, estimate, law.len())?,
            }
            self.stepping().put(&[state, law].concat());
            self.show(py)
        })
    }

    /// Restart at `t = 0`, from the initial state or from `q0` and `v0`, `(n,)`. The state of the law restarts too.
    #[pyo3(signature = (q0=None, v0=None))]
    fn reset(&mut self, py: Python<'_>, q0: Option<&Bound<'_, PyAny>>, v0: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        entry(py, "Simulator.reset", || {
            let n = self.plant.n();
            let mut start = self.start.clone();
            if q0.is_some() || v0.is_some() {
                let read = |name, value: Option<&Bound<'_, PyAny>>, from: &[f64]| {
                    value.map_or_else(|| Ok(from.to_vec()), |value| finite_vector("Simulator.reset", name, value, n))
                };
                let q = read("q0", q0, &self.start[..n])?;
                if let (Some(_), Ok(tree)) = (q0, self.plant.model().tree("arm")) {
                    self.check.rows(py, "Simulator.reset", "q0", tree, &q, false)?;
                }
                let v = if self.plant.kind().has_speeds() { read("v0", v0, &self.start[n..2 * n])? } else { Vec::new() };
                let x = self.plant.initial_state(&q, &v, None, None);
                start[..x.len()].copy_from_slice(&x);
                self.law.restart(&x, &mut start[x.len()..]);
            }
            self.stepping().reset(&start);
            self.show(py)
        })
    }

    /// Time in s: the steps taken times `dt`.
    #[getter]
    fn t(&self) -> f64 {
        self.stepping.lock().unwrap_or_else(PoisonError::into_inner).steps() as f64 * self.dt
    }

    /// The state as a dictionary of copies: `t`, `q`, `v`, `tau`, and the states of motors and of the law.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let state = PyDict::new(py);
        state.set_item("t", self.t()?)?;
        let some = [("theta", &self.theta), ("theta_dot", &self.theta_dot), ("bristles", &self.bristles), ("estimate", &self.estimate)];
        let all = [("q", &self.q), ("v", &self.v), ("tau", &self.tau)];
        for (name, array) in all.into_iter().chain(some.into_iter().filter_map(|(name, array)| Some((name, array.as_ref()?)))) {
            state.set_item(name, array.call_method0(py, "copy")?)?;
        }
        Ok(state)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let law = if self.has_law { self.made_of.bind(py).get_item(1)?.get_type().name()?.to_string() } else { "no law".into() };
        Ok(format!("Simulator({law}, n={}, t={} s, dt={} s)", self.plant.n(), self.t()?, self.dt))
    }

    /// Made again, and set to the state of this one.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        seal_call(py, "_restore_simulator", self.parts(py)?)
    }

    fn __copy__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("armlet._core")?.call_method1("_restore_simulator", self.parts(py)?)
    }

    /// Without a pickle: a law in Python may not support it.
    fn __deepcopy__<'py>(&self, py: Python<'py>, memo: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let parts = py.import("copy")?.call_method1("deepcopy", (self.parts(py)?, memo))?.cast_into::<PyTuple>()?;
        py.import("armlet._core")?.call_method1("_restore_simulator", parts)
    }
}

/// A pickled Simulator: the arguments of the constructor, its steps, state and input, and whether its last step diverged.
#[entered]
#[pyfunction]
#[pyo3(signature = (made_of, at, diverged=false))]
pub fn _restore_simulator(
    py: Python<'_>,
    made_of: (Bound<'_, PyAny>, Bound<'_, PyAny>, Bound<'_, PyAny>, Bound<'_, PyDict>),
    at: (u64, Vec<f64>, Vec<f64>),
    diverged: bool,
) -> PyResult<Simulator> {
    let ((plant, law, q0, keywords), (steps, x, input)) = (made_of, at);
    // The caller was warned when the first one was made.
    let mut simulator = Simulator::made(&plant, &law, &q0, keywords.copy()?, false)?;
    entry(py, NAME, || {
        for (name, length, expected) in [("state", x.len(), simulator.x.len()), ("input", input.len(), simulator.input.len())] {
            if length != expected {
                return Err(input_error(py, NAME, name, format!("has the wrong length: expected {expected}, got {length}")).into());
            }
        }
        simulator.stepping().resume(steps, &x, &input, diverged);
        simulator.show(py)
    })?;
    Ok(simulator)
}

impl Simulator {
    /// As `Simulator(plant, law, q0, **keywords)`; it warns of positions outside of joint limits if `warns`.
    fn made<'py>(
        plant: &Bound<'py, PyAny>,
        law: &Bound<'py, PyAny>,
        q0: &Bound<'py, PyAny>,
        keywords: Bound<'py, PyDict>,
        warns: bool,
    ) -> PyResult<Self> {
        let py = plant.py();
        entry(py, NAME, || {
            let made_of = (plant, law, q0, keywords.copy()?);
            let plant = object::<Plant>(NAME, "plant", "a plant such as RigidArm", plant)?.get().spec.clone();
            complete(NAME, &keywords)?;
            let raised = Raised::default();
            let has_law = !law.is_none();
            let law = if has_law {
                law_of(NAME, law, &plant, &raised)?
            } else {
                LawSpec::External(ExternalSpec::idle(plant.model(), plant.kind()))
            };
            let given = Keywords { function: NAME, keywords };
            if !has_law {
                // There is no law, so its sample time has no effect.
                given.keywords.set_item("sample_time", given.required("dt")?)?;
            }
            given.required("dt")?;
            require_fixed_steps(given.method()?)?;
            let n = plant.n();
            let options = given.options(n)?;
            let dt = options.dt.unwrap_or_default();
            let (_, x0) = given.initial_states(&[&plant], q0, false)?;
            let (force, force_frame) = given.force(&plant, &law, &raised)?;
            let problem = Problem {
                plants: vec![&plant],
                laws: vec![&law],
                x0,
                forces: force.iter().collect(),
                force_frame,
                options,
                measures: None,
            };
            // A frame where a later push may act: the law's own, or the one that is named.
            let rows = if given.get("force_frame")?.is_some() { None } else { law.coordinates().map(|at| at.rows.clone()) };
            let pushed = given.get("force_frame")?.is_some() || rows.is_some();
            let none = Force::steps(vec![0.0], vec![[0.0; 6]])?;
            let problem = if pushed && force.is_none() { Problem { forces: vec![&none], ..problem } } else { problem };
            let check = given.limit_check()?;
            warns.then(|| check.problem(py, NAME, &problem, false)).transpose()?;
            let stepping = stepper(&problem)?;
            let start: Vec<f64> = problem.x0.iter().copied().chain(law.start(&problem.x0)).collect();
            // The caller may change its arrays later.
            let own = py.import("copy")?.call_method1("deepcopy", ((made_of.2, made_of.3),))?;
            let made_of = (made_of.0, made_of.1, own.get_item(0)?, own.get_item(1)?).into_pyobject(py)?.unbind();
            let array = |k: usize| -> Result<Py<PyAny>, Failure> { Ok(new_array(py, &[k], |_| Ok(()))?.unbind()) };
            let elastic = plant.kind().has_motors();
            let mut simulator = Simulator {
                stepping: Mutex::new(stepping),
                dt,
                raised,
                has_law,
                check,
                pushed: pushed.then_some(rows),
                made_of,
                x: vec![0.0; start.len()],
                input: vec![0.0; n],
                given: vec![0.0; n],
                q: array(n)?,
                v: array(n)?,
                tau: array(n)?,
                theta: elastic.then(|| array(n)).transpose()?,
                theta_dot: elastic.then(|| array(n)).transpose()?,
                bristles: (plant.bristles() > 0).then(|| array(n)).transpose()?,
                estimate: Some(law.initial_state().len()).filter(|&p| p > 0).map(array).transpose()?,
                start,
                plant,
                law,
            };
            simulator.show(py)?;
            Ok(simulator)
        })
    }

    /// The arguments of `_restore_simulator`.
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let stepping = self.stepping.lock().unwrap_or_else(PoisonError::into_inner);
        if !stepping.resumable() {
            let problem =
                "Simulator: can't be pickled here: expected a step at which a plain sample is due, got one with samples under way";
            return Err(PyTypeError::new_err(problem));
        }
        let at = (stepping.steps(), self.x.clone(), self.input.clone());
        (self.made_of.clone_ref(py), at, stepping.status() != Status::Success).into_pyobject(py)
    }

    /// The error of a step that diverged.
    fn ended(&self, py: Python<'_>, status: Status) -> Result<Failure, Failure> {
        let t = self.t()?;
        let n = self.plant.n();
        // The state before the step: the state after it may be NaN.
        let v = if self.plant.kind().has_speeds() { &self.x[n..2 * n] } else { &self.input };
        let message = format!("Simulator.step: the step from t = {t} s on diverges: {}{}", status.advice(), fastest(v));
        Ok(solve_error(py, message, status, t, self.state(py)?.into_any().unbind()).into())
    }

    fn stepping(&mut self) -> &mut dyn Stepping {
        self.stepping.get_mut().unwrap_or_else(PoisonError::into_inner).as_mut()
    }

    /// Write the state into the arrays.
    fn show(&mut self, py: Python<'_>) -> Result<(), Failure> {
        self.stepping.get_mut().unwrap_or_else(PoisonError::into_inner).read(&mut self.x, &mut self.input);
        let (n, kind, seen, states) = (self.plant.n(), self.plant.kind(), self.plant.seen(), self.plant.states());
        overwrite(self.q.bind(py), &self.x[..n])?;
        overwrite(self.v.bind(py), if kind.has_speeds() { &self.x[n..2 * n] } else { &self.input })?;
        overwrite(self.tau.bind(py), &self.input)?;
        if let (Some(theta), Some(theta_dot)) = (&self.theta, &self.theta_dot) {
            overwrite(theta.bind(py), &self.x[2 * n..3 * n])?;
            overwrite(theta_dot.bind(py), &self.x[3 * n..4 * n])?;
        }
        if let Some(bristles) = &self.bristles {
            overwrite(bristles.bind(py), &self.x[seen..states])?;
        }
        if let Some(estimate) = &self.estimate {
            overwrite(estimate.bind(py), &self.x[states..])?;
        }
        Ok(())
    }
}
