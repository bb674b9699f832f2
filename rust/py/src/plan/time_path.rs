//! `armlet.time_path`: the fastest timing of a path. This file reads its arguments.

use super::path_limits::{Along, NAME, limit};
use super::timed_path::TimedPath;
use crate::arguments::require_partner;
use crate::arm::{Arm, ArmModel};
use crate::arrays::{
    ArrayArgument, Axis, Form, copied, count, items, nonnegative_integer, number, numbers, object, owned, require_finite, shown, vector,
};
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::long;
use crate::spline::ends;
use crate::warnings::LimitCheck;
use armlet_core::motion::{Ends, Path};
use armlet_core::plan::{self, Friction, Mover, TimePathOptions};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyTuple};
use std::sync::Arc;

/// The default number of samples of a callable path.
const SAMPLES: usize = 201;
const MOST_SAMPLES: usize = 1_000_000;

/// Return the derivatives `dq/ds`, `(K, m)`, at `s`, `(K,)`, of the C2 cubic spline through `q`, `(K, m)`. `spline` is as for `time_path`.
#[entered]
#[pyfunction]
pub fn _spline_slopes<'py>(s: &Bound<'py, PyAny>, q: &Bound<'py, PyAny>, spline: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Failure> {
    let (shape, values) = numbers(NAME, "q", q, &[Form(&[Axis::Any("K"), Axis::Any("m")])])?;
    let s = vector(NAME, "s", s, shape[0])?;
    let (values, ends) = (owned(values)?, ends(NAME, Some(spline), Ends::Natural)?);
    let slopes = long(py, || Path::slopes(&s, &values, shape[1], ends))?;
    copied(py, &shape, &slopes)
}

/// The path through samples of a callable. If the callable returns derivatives, the path uses them.
fn sampled(
    path: &Bound<'_, PyAny>,
    n: usize,
    samples: usize,
    ends: Ends,
    within: impl Fn(&[f64]) -> Result<(), Failure>,
) -> Result<Path, Failure> {
    let py = path.py();
    let s: Vec<f64> = (0..samples).map(|k| k as f64 / (samples - 1) as f64).collect();
    let mut columns: [Vec<f64>; 3] = Default::default();
    let mut parts = 0;
    for (k, &at) in s.iter().enumerate() {
        let got = path.call1((at,))?;
        let given: Vec<Bound<'_, PyAny>> = match got.cast::<PyTuple>() {
            Ok(tuple) if tuple.len() == 3 && !tuple.get_item(0)?.is_instance_of::<pyo3::types::PyFloat>() => tuple.iter().collect(),
            _ => vec![got],
        };
        if k > 0 && given.len() != parts {
            return Err(input_error(
                py,
                NAME,
                "path",
                format!("returns another number of arrays than before: expected {parts} arrays at s = {at}, got {}", given.len()),
            )
            .into());
        }
        parts = given.len();
        for (column, value) in columns.iter_mut().zip(&given) {
            let argument = ArrayArgument::new(NAME, "path", value)?;
            if argument.shape != [n] {
                let shape = shown(&argument.shape);
                let problem = format!("returns the wrong shape: expected ({n},) or three of ({n},), got {shape} at s = {at}");
                return Err(input_error(py, NAME, "path", problem).into());
            }
            let (_, values) = argument.values()?;
            if let Some(j) = values.iter().position(|x| !x.is_finite()) {
                let problem = format!("is not finite: expected finite numbers, got {} at s = {at} (first bad index {j})", values[j]);
                return Err(input_error(py, NAME, "path", problem).into());
            }
            column.extend_from_slice(&values);
        }
    }
    let [q, dq, ddq] = &columns;
    within(q)?;
    Ok(if parts == 3 { Path::table(&s, q, dq, ddq, n)? } else { Path::spline(&s, q, n, ends)? })
}

/// The attribute of `CartesianPath` that has its waypoints and their path positions.
const JOINED: &str = "_waypoints_and_knots";

/// Make the path from waypoints, from a `CartesianPath` or from a callable. The second result is the index of the knot of each waypoint. It
/// is empty for a callable.
///
/// `within` checks the waypoints `(K, n)`, or the samples of a callable. It does not check a `CartesianPath`.
fn path_of(
    path: &Bound<'_, PyAny>,
    n: usize,
    [knots, spline, stops, samples]: [Option<&Bound<'_, PyAny>>; 4],
    within: impl Fn(&[f64]) -> Result<(), Failure>,
) -> Result<(Path, Vec<usize>), Failure> {
    let py = path.py();
    let joined = path.getattr_opt(JOINED)?;
    if path.is_callable() && joined.is_none() {
        for (name, value) in [("knots", knots), ("stops", stops)] {
            if value.is_some() {
                return Err(input_error(py, NAME, name, "is not used: expected None for a callable path").into());
            }
        }
        let samples = samples.map_or(Ok(SAMPLES), |value| count(NAME, "samples", value))?;
        if !(4..=MOST_SAMPLES).contains(&samples) {
            let problem = format!("is out of range: expected 4 to {MOST_SAMPLES}, got {samples}");
            return Err(input_error(py, NAME, "samples", problem).into());
        }
        return Ok((sampled(path, n, samples, ends(NAME, spline, Ends::NotAKnot)?, within)?, Vec::new()));
    }
    let kind = if joined.is_some() { "a CartesianPath" } else { "waypoints" };
    for (name, value) in
        [("samples", samples), ("knots", knots.filter(|_| joined.is_some())), ("spline", spline.filter(|_| joined.is_some()))]
    {
        if value.is_some() {
            return Err(input_error(py, NAME, name, format!("is not used: expected None for {kind}")).into());
        }
    }
    let (points, own) = match joined {
        Some(joined) => (joined.get_item(0)?, Some(joined.get_item(1)?)),
        None => (path.clone(), knots.cloned()),
    };
    let (shape, q) = numbers(NAME, "path", &points, &[Form(&[Axis::Any("K"), Axis::Is(n)])])?;
    require_finite(py, NAME, "path", &shape, &q)?;
    if kind == "waypoints" {
        within(&q)?;
    }
    let default = if kind == "waypoints" { Ends::Natural } else { Ends::NotAKnot };
    let knots = own.as_ref().map(|value| vector(NAME, "knots", value, shape[0])).transpose()?;
    Ok(Path::waypoints(&q, n, knots.as_deref(), ends(NAME, spline, default)?)?)
}

/// Refuse `refine=False` without `grid`, `friction` without limits of torques, and `check_limits` where no limits are checked.
fn require_partners(
    path: &Bound<'_, PyAny>,
    refined: bool,
    (friction, torques): (Option<&Bound<'_, PyAny>>, [Option<&Bound<'_, PyAny>>; 2]),
    (check_limits, positions): (Option<&Bound<'_, PyAny>>, [Option<&Bound<'_, PyAny>>; 2]),
) -> Result<(), Failure> {
    if !refined {
        return Err(input_error(path.py(), NAME, "refine", "takes effect only with grid: expected True without it, got False").into());
    }
    let friction = friction.filter(|friction| !friction.cast::<PyBool>().is_ok_and(|flag| !flag.is_true()));
    require_partner(NAME, "friction", friction, "tau_max or torque_rate", torques.iter().any(Option::is_some))?;
    let checked = positions.iter().all(Option::is_none) && path.getattr_opt(JOINED)?.is_none();
    require_partner(NAME, "check_limits", check_limits, "waypoints or a callable, and without q_min and q_max", checked)
}

/// The fastest timing of a path of an arm under limits of torque, speed and acceleration.
///
/// The motion is `q(s(t))`, so `v = dq/ds ds/dt`, `a = dq/ds u + d2q/ds2 (ds/dt)^2` with `u = d2s/dt2`, and `tau = M a + C v + g`, plus the
/// friction torque with `friction`. Reachability analysis on a grid of `s` computes the timing. A check on a grid ten times finer corrects
/// it until no limit is exceeded by more than a relative 1e-9.
///
/// Args:
///     arm: the arm; `planar_pr` is allowed.
///     path: waypoints `(K, n)`, rad or m, a callable on [0, 1], or a `CartesianPath`. A C2 cubic spline joins waypoints; repeated
///         waypoints count once. A callable that returns `q(s)`, `(n,)`, is replaced by the spline through `samples` of its points. A
///         callable that returns `q, dq/ds, d2q/ds2`, `(n,)` each, is replaced by quintic Hermite polynomials through its samples.
///     tau_max: torque limit, N m or N: number or `(n,)` for both signs, or `(n, 2)` lower and upper (keyword only, as all below).
///     v_max, a_max: limits of joint speed (rad/s or m/s) and acceleration (rad/s^2 or m/s^2): number or `(n,)`. One of `tau_max`, `a_max`
///         and `tip_acceleration` is required. `tau_max`, `v_max` and `a_max` may vary along the path, with the same limit for both signs.
///         They are then `(K, n)` at the waypoints, or a callable `s -> (n,)` that is called at the path's knots. Between these they are
///         linear in `s`. A `tau_max` of shape `(n, 2)` always means lower and upper limits, also if `(K, n)` is the same shape.
///     q_min, q_max: position limits, rad or m: number or `(n,)`, infinite for joints without limits. A path that exceeds them at or
///         between waypoints has no timing. None for both: only `check_limits` applies.
///     tip_speed: largest speed of the origin of `frame`, m/s: a number, `(K,)` at the waypoints, or a callable `s -> number`.
///     stops: indices of waypoints where the arm stops.
///
/// Other Args:
///     knots: path positions of the waypoints, `(K,)`, increasing. None: from 0 to 1, in proportion to the distances between waypoints.
///     spline: end conditions of the spline: "natural" (default for waypoints), "clamped", "not-a-knot" (default for a callable).
///     start_speed, end_speed: path speeds ds/dt at the ends, 1/s; zero if None.
///     friction: True for the arm's damping and Coulomb friction; viscous coefficients, number or `(n,)`, N m s/rad or N s/m; None: none.
///         It requires `tau_max` or `torque_rate`.
///     grid: number of grid points, including the path's knots. None: 201 points at first. Then grids with additional points follow, until
///         the duration changes by less than 1e-4 of its value.
///     refine: halve the segments of `grid` on which the motion exceeds limits, or that make the motion longer (default True).
///         Without `grid` it must be True.
///     samples: number of samples of a callable; 201 if None.
///     torque_rate: limit of |d tau/dt|, N m/s or N/s: number or `(n,)`. It requires a rest-to-rest motion without stops and without
///         Coulomb friction. The fastest timing is averaged over a window of time, and slowed down until it satisfies this limit. So the
///         result is not the fastest one.
///     tip_acceleration: largest norm of the acceleration of the origin of `frame`, m/s^2, in the forms of `tip_speed`.
///     frame: name of the frame that `tip_speed` and `tip_acceleration` limit.
///     check_limits: action if a waypoint, or a sample of a callable, is outside of the arm's joint limits. None warns, True raises, and
///         False does neither. It must be None with `q_min` or `q_max`, and for a `CartesianPath`.
///
/// Returns:
///     A `TimedPath`. Limits that allow no timing are not an error: `p.feasible` is False, and `p.reason` states the reason.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite or out of range, or limits are missing. With `check_limits=True`, a waypoint
///         outside of the joint limits also raises it.
///
/// Warns:
///     UserWarning: a waypoint is outside of the joint limits.
///
/// Source: Pham and Pham, A new approach to time-optimal path parameterization based on reachability analysis, T-RO 34(3),
/// 2018; docs/time_path.md.
///
/// >>> import armlet as al
/// >>> arm = al.planar_pr(2.0, 0.5, 0.5)
/// >>> p = al.time_path(arm, [[0.0, 0.0], [1.0, 0.0]], tau_max=[8.0, 8.0])
/// >>> p.feasible, round(p.duration, 6)
/// (True, 1.0)
/// >>> q, v, a = p(0.25)
/// >>> [round(float(x), 6) for x in (q[0], v[0], a[0])]
/// [0.125, 1.0, 4.0]
#[entered]
#[pyfunction]
#[arguments(
    arm, path, *, tau_max=None, v_max=None, a_max=None, knots=None, spline=None, stops=None, start_speed=None, end_speed=None,
    friction=None, grid=None, refine=true, samples=None, torque_rate=None, q_min=None, q_max=None, tip_speed=None, tip_acceleration=None,
    frame=None, check_limits=None
)]
pub fn time_path<'py>(py: Python<'py>, refine: bool) -> PyResult<Bound<'py, TimedPath>> {
    entry(py, NAME, || {
        let arm = object::<Arm>(NAME, "arm", "an Arm such as planar_arm(..)", arm)?;
        let model = &arm.get().model;
        let n = model.n();
        let check = LimitCheck::of(NAME, check_limits)?;
        require_partners(path, refine || grid.is_some(), (friction, [tau_max, torque_rate]), (check_limits, [q_min, q_max]))?;
        let torque_rate = torque_rate.map(|value| limit("torque_rate", value, n)).transpose()?;
        let mut options = TimePathOptions { refine, torque_rate, ..TimePathOptions::default() };
        for (name, value, to) in [("start_speed", start_speed, &mut options.start_speed), ("end_speed", end_speed, &mut options.end_speed)]
        {
            if let Some(value) = value {
                *to = number(NAME, name, value)?;
            }
        }
        if let Some(value) = grid {
            options.grid = Some(count(NAME, "grid", value)?);
        }
        options.friction = match friction {
            None => None,
            Some(value) if value.is_instance_of::<PyBool>() => value.extract::<bool>()?.then(|| own_friction(model, n)),
            Some(value) => Some(Friction { viscous: limit("friction", value, n)?, coulomb: vec![0.0; n] }),
        };
        let within = |q: &[f64]| match (model, q_min, q_max) {
            (ArmModel::Tree(tree), None, None) => check.rows(py, NAME, "path", tree.arm(), q, true),
            _ => Ok(()),
        };
        let (core, knot) = path_of(path, n, [knots, spline, stops, samples], within)?;
        if let Some(value) = stops {
            for stop in items(NAME, "stops", "a list: expected indices of waypoints", value, knot.len())? {
                let k = nonnegative_integer(NAME, "stops", &stop).ok().and_then(|k| knot.get(k).copied());
                let problem = || format!("is out of range: expected indices of waypoints below {}, got {stop}", knot.len());
                options.stops.push(k.ok_or_else(|| input_error(py, NAME, "stops", problem()))?);
            }
        }
        let core = Arc::new(core);
        let tip = [tip_speed, tip_acceleration, frame];
        let limits = Along { path: &core, knot: &knot }.limits(model, [tau_max, v_max, a_max], [q_min, q_max], tip)?;
        let mover = match model {
            ArmModel::Tree(tree) => Mover::Tree(tree),
            ArmModel::PlanarPr(arm) => Mover::PlanarPr(*arm),
        };
        let answer = long(py, || plan::time_path(mover, core, &limits, &options).map_err(|error| model.core().name_limit(error)))?;
        Ok(Bound::new(py, TimedPath::answer(answer))?)
    })
}

fn own_friction(model: &ArmModel, n: usize) -> Friction {
    let limits = model.limits();
    let of = |name: &str| limits.iter().find(|(known, _)| *known == name).map_or(vec![0.0; n], |(_, values)| values.clone());
    Friction { viscous: of("damping"), coulomb: of("friction") }
}
