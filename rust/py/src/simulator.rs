//! `armlet.Simulator`: a closed loop with one step per call. The arrays of its state are always the same objects.

mod copies;

pub use copies::_restore_simulator;

use crate::arrays::{new_array, object, of_shape, overwrite, vector};
use crate::errors::{Failure, entry, input_error, solve_error};
use crate::force::{Raised, raise};
use crate::plant::Plant;
use crate::priority::status_member;
use crate::run_options::{RunOptions, law_of};
use crate::simulator_state::{complete, fastest, law_state, state_of, wrench};
use crate::warnings::LimitCheck;
use armlet_core::law::{ExternalSpec, LawSpec};
use armlet_core::plant::PlantSpec;
use armlet_core::simulate::{Force, Problem, Stepping, require_fixed_steps, stepper};
use armlet_core::status::Status;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::{Mutex, PoisonError};

/// A closed loop with one step per call: `step()` advances by `dt` with the law's input, and `step(tau)` with the caller's input.
///
/// The state is in the arrays `q` and `v`, `(n,)`, and the input in `tau`, `(n,)`. For a `VelocityArm`, `v` is the input too. Elastic arms
/// also have `theta` and `theta_dot`, `LuGre` friction has `bristles`, and a law with a state has `estimate`. Every step overwrites these
/// arrays, so copy values to keep them.
///
/// Args:
///     plant: the controlled system, such as `RigidArm(arm)`.
///     law: the control law; None if every step has an input of the caller.
///     q0: initial positions, `(n,)`, rad or m.
///     dt: the step, s (keyword only).
///     v0, theta0, theta_dot0, method, sample_time, force, force_frame, tau_max, state_limit, check_limits: as for `simulate` (keyword
///         only). The method has fixed steps: "euler", "semi_implicit", "rk4" or "ros2". `force_frame` is also the frame of `step(force=)`.
///
/// A step *diverges* if the state after it would not be finite, or would exceed `state_limit`. Such a step raises `SolveError`, and the
/// arrays keep the state and the input before it. Then `status` is no longer `Status.SUCCESS`, and every further step raises until
/// `set_state` or `reset`. If `force` or the law is a Python function that raises an exception, `step` raises it too. This step has no
/// effect, and the next `step` repeats it. `tau` is the input of the last step, after clipping to `tau_max`.
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
    /// The integration method. pyo3 requires the mutex, because Python threads may share the object. No thread ever waits for it.
    stepping: Mutex<Box<dyn Stepping>>,
    plant: PlantSpec,
    law: LawSpec,
    dt: f64,
    start: Vec<f64>,
    raised: Raised,
    has_law: bool,
    check: LimitCheck,
    /// The frame of `step(force=)`: `None` without a frame, `Some(None)` for `force_frame`, `Some(Some(rows))` for the law's coordinates.
    pushed: Option<Option<Vec<usize>>>,
    /// The arguments of the constructor: plant, law, q0 and the keywords.
    made_of: Py<PyTuple>,
    /// The state and the input in the core's order.
    x: Vec<f64>,
    input: Vec<f64>,
    given: Vec<f64>,
    /// Positions, `(n,)`, rad or m. A step overwrites this array.
    #[pyo3(get)]
    q: Py<PyAny>,
    /// Velocities, `(n,)`, rad/s or m/s. A step overwrites this array.
    #[pyo3(get)]
    v: Py<PyAny>,
    /// Input of the last step, `(n,)`, N m or N; rad/s or m/s for a `VelocityArm`. A step overwrites this array.
    #[pyo3(get)]
    tau: Py<PyAny>,
    /// Motor positions of an elastic arm, `(n,)`, rad or m, else None. A step overwrites this array.
    #[pyo3(get)]
    theta: Option<Py<PyAny>>,
    /// Motor velocities of an elastic arm, `(n,)`, rad/s or m/s, else None. A step overwrites this array.
    #[pyo3(get)]
    theta_dot: Option<Py<PyAny>>,
    /// Deflections of the bristles of `LuGre` friction, `(n,)`, rad or m, else None. A step overwrites this array.
    #[pyo3(get)]
    bristles: Option<Py<PyAny>>,
    /// The state of the law, such as the estimate of an adaptive law, or None. A step overwrites this array.
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

    /// Advance by `dt` with the law's input, or with the constant input `tau`.
    ///
    /// Args:
    ///     tau: the plant's input, `(n,)`, N m or N (rad/s or m/s for `VelocityArm`); None: the law's input.
    ///     force: external force during this step, N and N m, in place of the constructor's force (keyword only). With a `force_frame` it
    ///         is `(3,)`, or `(6,)` as `[f; m]`, in world axes. Otherwise it is in the law's coordinates, at the law's frame.
    ///
    /// Raises:
    ///     InputError: an argument has a wrong type, shape or value.
    ///     SolveError: the step diverges. The state does not change.
    #[arguments(tau=None, *, force=None)]
    fn step(&mut self) -> Result<(), Failure> {
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
        if let Err(error) = raise(&self.raised) {
            self.stepping().undo();
            return Err(error);
        }
        self.show(py)?;
        if status == Status::Success { Ok(()) } else { Err(self.ended(py, status)?) }
    }

    /// The status: `Status.SUCCESS`, or `Status.DIVERGED` after a step that diverged.
    #[getter]
    fn status(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        status_member(py, self.stepping.lock().unwrap_or_else(PoisonError::into_inner).status())
    }

    /// Set the state, and continue from it at the present time.
    ///
    /// Args:
    ///     q, v: positions (rad or m) and velocities (rad/s or m/s) of the links, `(n,)`.
    ///     theta, theta_dot: positions (rad or m) and velocities (rad/s or m/s) of the motors of elastic arms, `(n,)` (keyword only). None:
    ///         as at the start of `simulate`, the springs balance gravity, and the motors move with the links.
    ///     bristles: deflections of the bristles of `LuGre` friction, `(n,)`, rad or m (keyword only). None: zeros.
    ///     estimate: state of the law, such as the integral of a `PID` or the estimate of `Adaptive` (keyword only). It has the form of
    ///         `sim.estimate`. None: no change, but filters and observers start from `q` and `v`.
    ///
    /// Raises:
    ///     InputError: a shape is wrong, or a number is not finite. An argument for a state that the loop does not have also raises it.
    #[arguments(q, v, *, theta=None, theta_dot=None, bristles=None, estimate=None)]
    fn set_state(&mut self) -> Result<(), Failure> {
        let state = state_of(NAME, &self.plant, (q, v), (theta, theta_dot), bristles)?;
        let mut law = self.x[state.len()..].to_vec();
        match estimate {
            None => self.law.restart(&state, &mut law),
            Some(estimate) => law = law_state(NAME, estimate, law.len())?,
        }
        self.stepping().put(&[state, law].concat());
        self.show(py)
    }

    /// Restart the plant and the law at `t = 0`, from the initial state or from `q0` (rad or m) and `v0` (rad/s or m/s), `(n,)`.
    #[arguments(q0=None, v0=None)]
    fn reset(&mut self) -> Result<(), Failure> {
        let n = self.plant.n();
        let mut start = self.start.clone();
        if q0.is_some() || v0.is_some() {
            let read = |name, value: Option<&Bound<'_, PyAny>>, from: &[f64]| {
                value.map_or_else(|| Ok(from.to_vec()), |value| vector(NAME, name, value, n))
            };
            let q = read("q0", q0, &self.start[..n])?;
            if let (Some(_), Ok(tree)) = (q0, self.plant.model().tree("arm")) {
                self.check.rows(py, NAME, "q0", tree, &q, false)?;
            }
            let v = if self.plant.kind().has_speeds() { read("v0", v0, &self.start[n..2 * n])? } else { Vec::new() };
            let x = self.plant.initial_state(&q, &v, None, None);
            start[..x.len()].copy_from_slice(&x);
            self.law.restart(&x, &mut start[x.len()..]);
        }
        self.stepping().reset(&start);
        self.show(py)
    }

    /// The time, s: the number of steps times `dt`.
    #[getter]
    fn t(&self) -> f64 {
        self.stepping.lock().unwrap_or_else(PoisonError::into_inner).steps() as f64 * self.dt
    }

    /// The state as a dict of copies: `t`, `q`, `v`, `tau`, and the states of motors, bristles and the law if there are any.
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
}

impl Simulator {
    /// Make a `Simulator(plant, law, q0, **keywords)`. If `warns` is false, `q0` and the law's target are not checked against joint limits.
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
            let given = RunOptions { function: NAME, entries: keywords };
            if !has_law {
                // Without a law the sample time has no effect. `dt` replaces it, because `dt` passes every check of a sample time.
                given.entries.set_item("sample_time", given.required("dt")?)?;
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
            // The frame of `step(force=)` is `force_frame`, or else the frame of the law.
            let rows = if given.get("force_frame")?.is_some() { None } else { law.coordinates().map(|at| at.rows.clone()) };
            let pushed = given.get("force_frame")?.is_some() || rows.is_some();
            let none = Force::steps(vec![0.0], vec![[0.0; 6]])?;
            let problem = if pushed && force.is_none() { Problem { forces: vec![&none], ..problem } } else { problem };
            let check = given.limit_check()?;
            warns.then(|| check.problem(py, NAME, &problem, false)).transpose()?;
            let stepping = stepper(&problem)?;
            let start: Vec<f64> = problem.x0.iter().copied().chain(law.start(&problem.x0)).collect();
            // Use copies, because the caller may change its arrays later.
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

    /// Make the error of a step that diverged.
    fn ended(&self, py: Python<'_>, status: Status) -> Result<Failure, Failure> {
        let t = self.t()?;
        let n = self.plant.n();
        // The message shows the velocities before the step, because the velocities after it may be NaN.
        let v = if self.plant.kind().has_speeds() { &self.x[n..2 * n] } else { &self.input };
        let message = format!("Simulator.step: the step from t = {t} s on diverges: {}{}", status.advice(), fastest(v));
        Ok(solve_error(py, message, status, t, self.state(py)?.into_any().unbind()).into())
    }

    fn stepping(&mut self) -> &mut dyn Stepping {
        self.stepping.get_mut().unwrap_or_else(PoisonError::into_inner).as_mut()
    }

    /// Write the state to the arrays that Python code sees.
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
