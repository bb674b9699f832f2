//! `armlet.torque_optimal_time`: the fastest rest-to-rest motion of one link under torque limits, and its results in Python.

use super::link::{LinkProblem, float, part, pickled_call, scalar, single, truth};
use crate::arrays::{WHATEVER, numbers, owned, require_finite, written_arrays};
use crate::broadcast::number_or_array;
use crate::errors::{Failure, input_error};
use crate::interrupts::long;
use crate::properties::properties;
use crate::seal::Sealed;
use armlet_core::error::Error;
use armlet_core::interrupt;
use armlet_core::plan::{self, TorqueProfile};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::sync::OnceLock;

/// The fastest rest-to-rest motion of one link under torque limits.
///
/// `inertia * theta_ddot + gravity_moment sin theta + viscous theta_dot + coulomb sign(theta_dot) = tau` with `tau_min <= tau <= tau_max`.
/// The *monotone* motion has full torque towards the goal, and then full torque against the motion. The fields `t`, `theta_switch` and
/// `t_switch` describe the fastest monotone motion. `best` is the fastest of this motion, a *back-swing* (torque -, +, -) and an
/// *overshoot* (torque +, -, +), where + is towards the goal.
///
/// Args:
///     theta0, thetaf: start and end, rad from the downward vertical. Angles beyond +-pi are not wrapped.
///     inertia: inertia about the joint, kg m^2, > 0.
///     gravity_moment: mass times gravity times distance of the centre of mass, N m. With a negative value, the angles are measured from
///         the upward vertical.
///     tau_max: largest torque, N m, >= 0; > 0 if `tau_min` is None.
///     tau_min: smallest torque, N m, <= 0; `-tau_max` if None (keyword only, as all below).
///     viscous: viscous friction, N m s/rad, >= 0. With friction, the motion is integrated numerically.
///     coulomb: Coulomb friction, N m, >= 0.
///
/// Returns:
///     A `TorqueOptimum`. If no monotone motion is feasible, `t` is NaN, and `reason` states the missing torque. This is not an error.
///
/// Raises:
///     InputError: a number is not finite, or outside its range.
///
/// Source: docs/minimum_time.md.
///
/// >>> import armlet as al, math
/// >>> o = al.torque_optimal_time(math.pi / 2, 3.0, inertia=1.0, gravity_moment=1.0, tau_max=1.02)
/// >>> round(o.t, 3), o.certified_global, o.best.kind, round(o.best.t, 3)
/// (8.419, False, 'back-swing', 5.702)
/// >>> q, v, a, tau = o.profile(0.0)
/// >>> tau
/// -1.02
#[entered]
#[pyfunction]
#[arguments(theta0, thetaf, inertia, gravity_moment, tau_max, *, tau_min=None, viscous=None, coulomb=None)]
pub fn torque_optimal_time<'py>() -> Result<TorqueOptimum, Failure> {
    let problem = single(py, NAME, [theta0, thetaf, inertia, gravity_moment, tau_max], tau_min)?;
    let friction = |name, value: Option<&Bound<'py, PyAny>>| value.map_or(Ok(0.0), |value| scalar(NAME, name, value));
    let friction = [friction("viscous", viscous)?, friction("coulomb", coulomb)?];
    long(py, || TorqueOptimum::solve(problem, friction))
}

/// The fastest monotone motion, and the fastest of all monotone motions, back-swings and overshoots, from `torque_optimal_time`.
#[pyclass(frozen, module = "armlet", name = "TorqueOptimum")]
pub struct TorqueOptimum {
    core: plan::TorqueOptimum,
    problem: LinkProblem,
    friction: [f64; 2],
    /// The profiles of the best motion and of the monotone motion. They are computed at their first use.
    profiles: [OnceLock<Option<TorqueProfile>>; 2],
}

/// The number of times that are evaluated between two checks for Ctrl-C.
const CHECK_PERIOD: usize = 256;

impl TorqueOptimum {
    pub fn solve(problem: LinkProblem, friction: [f64; 2]) -> Result<Self, Error> {
        let [theta0, thetaf, inertia, gravity_moment, tau_max, tau_min] = problem;
        let [viscous, coulomb] = friction;
        let core = if friction == [0.0; 2] {
            plan::torque_optimal_time(theta0, thetaf, inertia, gravity_moment, tau_min, tau_max)?
        } else {
            plan::torque_optimal_time_with_friction(theta0, thetaf, inertia, gravity_moment, tau_min, tau_max, [viscous, coulomb])?
        };
        Ok(TorqueOptimum { core, problem, friction, profiles: [OnceLock::new(), OnceLock::new()] })
    }

    /// Evaluate the profile `which` (0: best, 1: monotone) at one time or at an array of times, s.
    fn sample<'py>(&self, py: Python<'py>, function: &str, which: usize, t: &Bound<'py, PyAny>) -> Result<[Bound<'py, PyAny>; 4], Failure> {
        let core = &self.core;
        let profile = self.profiles[which].get_or_init(|| if which == 0 { core.profile() } else { core.monotone_profile() });
        let Some(profile) = profile else {
            let problem = "has no motion: expected a feasible problem, see its `reason`";
            return Err(input_error(py, function, "the optimum", problem).into());
        };
        if let Some(t) = number_or_array(function, "t", t)? {
            require_finite(py, function, "t", &[], &[t])?;
            let s = profile.at(t);
            let mut out = Vec::with_capacity(4);
            for x in [s.q, s.v, s.a, s.tau] {
                out.push(x.into_pyobject(py).map_err(PyErr::from)?.into_any());
            }
            return Ok(out.try_into().expect("four numbers"));
        }
        let (shape, times) = numbers(function, "t", t, &[WHATEVER])?;
        require_finite(py, function, "t", &shape, &times)?;
        // Use a copy, because other threads may write to the caller's array during the evaluation.
        let times = owned(times)?;
        written_arrays(py, &shape, |mut outs: [&mut [f64]; 4]| {
            long(py, || {
                for (i, &t) in times.iter().enumerate() {
                    if i % CHECK_PERIOD == 0 {
                        interrupt::check();
                    }
                    let s = profile.at(t);
                    for (out, x) in outs.iter_mut().zip([s.q, s.v, s.a, s.tau]) {
                        out[i] = x;
                    }
                }
                Ok(())
            })
        })
    }

    fn why(&self) -> String {
        if self.core.feasible { String::new() } else { self.core.reason.to_string() }
    }
}

properties!(TorqueOptimum {
    /// Whether a monotone motion is feasible.
    feasible: bool;
    /// The duration of the fastest monotone motion, s; NaN if none is feasible.
    t: f64;
    /// The angle, rad, at which the torque of the monotone motion switches.
    theta_switch: f64;
    /// The time, s, at which the torque of the monotone motion switches.
    t_switch: f64;
    /// The signed velocity of the monotone motion at its switch, rad/s.
    v_peak: f64;
    /// Whether Sturm's comparison theorem proves that no motion is faster than the fastest monotone motion.
    certified_global: bool;
    /// The duration `pi / sqrt(|gravity_moment|/inertia - (viscous/(2 inertia))^2)`, s. A shorter optimal motion switches at most once.
    ///
    /// This is not proved with Coulomb friction. For an overdamped link the value is infinite.
    sturm_bound: f64;
    /// The reason why no monotone motion is feasible, with the missing torque. It is empty if one is feasible.
    reason: String = |result| result.why();
});

#[entered]
#[pymethods]
impl TorqueOptimum {
    /// The fastest motion of the three families: monotone, back-swing and overshoot.
    #[getter]
    fn best(slf: &Bound<'_, Self>) -> Best {
        Best { core: slf.get().core.best, owner: slf.clone().unbind() }
    }

    /// Compute `q, v, a, tau` (rad, rad/s, rad/s^2, N m) of the best motion at the time `t` in s, a number or an array.
    ///
    /// The motion is at rest before the time 0 and after its end. Without a motion the call raises `InputError`.
    fn profile<'py>(&self, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyTuple>, Failure> {
        Ok(PyTuple::new(py, self.sample(py, NAME, 0, t)?)?)
    }

    /// Compute `q, v, a, tau` (rad, rad/s, rad/s^2, N m) of the fastest monotone motion at the time `t` in s, a number or an array.
    ///
    /// Without a monotone motion the call raises `InputError`.
    fn monotone_profile<'py>(&self, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyTuple>, Failure> {
        Ok(PyTuple::new(py, self.sample(py, NAME, 1, t)?)?)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let core = &slf.get().core;
        Ok(format!(
            "TorqueOptimum(feasible={}, t={}, theta_switch={}, t_switch={}, certified_global={}, best={}, reason={:?})",
            truth(core.feasible),
            float(core.t),
            float(core.theta_switch),
            float(core.t_switch),
            truth(core.certified_global),
            Self::best(slf)?.__repr__()?,
            slf.get().why()
        ))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().problem == self.problem && other.get().friction == self.friction)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        pickled_call(py, "torque_optimal_time", &[&self.problem[..], &self.friction].concat())
    }
}

/// The fastest motion of the three families: monotone, back-swing and overshoot.
#[pyclass(frozen, module = "armlet._core", name = "Best")]
pub struct Best {
    core: plan::Best,
    owner: Py<TorqueOptimum>,
}

properties!(Best {
    /// The family: `"monotone"`, `"back-swing"` (torque -, +, -), `"overshoot"` (torque +, -, +), or `"none found"`. A torque towards the
    /// goal is +.
    kind: &'static str = |result| result.core.kind.name();
    /// The duration, s; NaN if no motion was found.
    t: f64;
    /// The angles at which the torque switches, rad, in order of time.
    switches: PyResult<Bound<'py, PyTuple>> = |result, py| PyTuple::new(py, &result.core.theta_switches[..result.core.switches]);
    /// The times at which the torque switches, s.
    t_switches: PyResult<Bound<'py, PyTuple>> = |result, py| PyTuple::new(py, &result.core.t_switches[..result.core.switches]);
    /// The angle, rad, at which a back-swing or an overshoot reverses; NaN for the monotone motion.
    theta_turn: f64;
    /// The time, s, at which a back-swing or an overshoot reverses; NaN for the monotone motion.
    t_turn: f64;
});

#[entered]
#[pymethods]
impl Best {
    fn __repr__(&self) -> String {
        let c = &self.core;
        let angles = c.theta_switches[..c.switches].iter().map(|&x| float(x)).collect::<Vec<_>>().join(", ");
        let comma = if c.switches == 1 { "," } else { "" };
        format!("Best(kind='{}', t={}, switches=({angles}{comma}))", c.kind.name(), float(c.t))
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| {
            let (a, b) = (&other.get().core, &self.core);
            a.kind == b.kind
                && a.theta_switches[..a.switches] == b.theta_switches[..b.switches]
                && (a.t == b.t || a.t.is_nan() && b.t.is_nan())
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        part(py, &self.owner, "best")
    }
}
