//! Elastic joints: `equilibrium`, `elastic_limits`, `smallest_reduced_inertia`, `stiffness_limit`, `damping_from_ratio`, and the warning
//! about a long sample time.

use crate::arguments::require_partner;
use crate::arrays::{ArrayArgument, copied, new_array, number, object, optional_number, vector};
use crate::broadcast::{CHECK_PERIOD, columns};
use crate::errors::{Failure, input_error};
use crate::force::{self, Raised, force_frame};
use crate::interrupts::long;
use crate::law::Law;
use crate::plant::Plant;
use crate::warnings::warn;
use armlet_core::analysis::{elastic_limits as limits, equilibrium as core};
use armlet_core::error::{Error, Result as CoreResult};
use armlet_core::interrupt;
use armlet_core::law::LawSpec;
use armlet_core::linalg::ratio_damping;
use armlet_core::plant::PlantSpec;
use armlet_core::simulate::{Force, Problem, Wrench};
use armlet_macros::entered;
use numpy::{Complex64, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A sample time longer than the stability limit divided by this number causes a warning.
const COMFORTABLE: f64 = 3.0;

/// Warn if the sample time is longer than a third of the stability limit of the motor loop.
pub fn warn_of_sampling(py: Python<'_>, function: &str, problem: &Problem) -> PyResult<()> {
    let (Some(sampling), Some(limit)) = (&problem.options.sampling, problem.sample_time_limit(COMFORTABLE)) else { return Ok(()) };
    let text = format!(
        "{function}: sample_time {} s is above a third of {limit:.6} s, where the motor loop becomes unstable: expect oscillation",
        sampling.period
    );
    warn(py, text)
}

/// Read a constant force: its wrench `[f; m]`, N and N m, and the index of the frame at which it acts.
fn constant(
    function: &'static str,
    plant: &PlantSpec,
    law: &LawSpec,
    value: Option<&Bound<'_, PyAny>>,
    frame: Option<&Bound<'_, PyAny>>,
) -> Result<(Wrench, Option<usize>), Failure> {
    require_partner(function, "force_frame", frame, "force", value.is_some())?;
    let named = match frame {
        None => None,
        Some(frame) => Some(force_frame(function, plant, frame)?),
    };
    let own = law.coordinates();
    let at = named.or(own.map(|coordinates| coordinates.frame));
    let Some(value) = value else { return Ok(([0.0; 6], at)) };
    if at.is_none() {
        let problem = format!("is missing: expected a frame for the force, since {} has none", law.name());
        return Err(input_error(value.py(), function, "force_frame", problem).into());
    }
    let rows = if named.is_some() { None } else { own.map(|coordinates| coordinates.rows.as_slice()) };
    match force::force(function, value, rows, &Raised::default())? {
        Force::Steps { values, .. } if values.len() == 1 => Ok((values[0], at)),
        _ => Err(input_error(value.py(), function, "force", "is not constant: expected None or one force").into()),
    }
}

fn put(fields: &Bound<'_, PyDict>, name: &str, values: &[f64]) -> Result<(), Failure> {
    Ok(fields.set_item(name, PyArray1::from_slice(fields.py(), values))?)
}

fn put_eigenvalues(fields: &Bound<'_, PyDict>, values: &[(f64, f64)]) -> Result<(), Failure> {
    let values: Vec<Complex64> = values.iter().map(|&(re, im)| Complex64::new(re, im)).collect();
    Ok(fields.set_item("eigenvalues", PyArray1::from_vec(fields.py(), values))?)
}

/// Return a dict with the fields of an `armlet.Equilibrium`.
#[entered]
#[pyfunction]
#[arguments(plant, law, force, q0, force_frame)]
pub fn equilibrium<'py>(force: Option<&Bound<'py, PyAny>>, force_frame: Option<&Bound<'py, PyAny>>) -> Result<Bound<'py, PyDict>, Failure> {
    let plant = object::<Plant>(NAME, "plant", "a plant such as ElasticArm", plant)?;
    let law = object::<Law>(NAME, "law", "a law such as ElasticImpedance", law)?;
    let (plant, law) = (&plant.get().spec, &law.get().spec);
    let (wrench, frame) = constant(NAME, plant, law, force, force_frame)?;
    let q0 = vector(NAME, "q0", q0, plant.n())?;
    let found = long(py, || core::equilibrium(plant, law, &wrench, frame, &q0))?;
    let fields = PyDict::new(py);
    put(&fields, "q", &found.q)?;
    put(&fields, "tau", &found.tau)?;
    put(&fields, "x", &found.x)?;
    put(&fields, "residual", &found.residual)?;
    if plant.elastic().is_some() {
        put(&fields, "theta", &found.theta)?;
    }
    if !found.integral.is_empty() {
        put(&fields, "estimate", &found.integral)?;
    }
    fields.set_item("reachable", found.reachable)?;
    fields.set_item("spurious", found.spurious)?;
    if plant.wall().is_some() {
        put(&fields, "wall_force", &found.wall_force)?;
    }
    fields.set_item("stable", found.stable)?;
    fields.set_item("free_motions", found.free_motions)?;
    put_eigenvalues(&fields, &found.eigenvalues)?;
    Ok(fields)
}

/// Return a dict with the fields of an `armlet.ElasticLimits`.
#[entered]
#[pyfunction]
#[arguments(plant, law, force, q0, force_frame, sample_time, sensor_bandwidth)]
pub fn elastic_limits<'py>(
    force: Option<&Bound<'py, PyAny>>,
    force_frame: Option<&Bound<'py, PyAny>>,
    sample_time: Option<&Bound<'py, PyAny>>,
    sensor_bandwidth: Option<&Bound<'py, PyAny>>,
) -> Result<Bound<'py, PyDict>, Failure> {
    let plant = object::<Plant>(NAME, "plant", "a plant such as ElasticArm", plant)?;
    let law = object::<Law>(NAME, "law", "a law such as ElasticImpedance", law)?;
    let (plant, law) = (&plant.get().spec, &law.get().spec);
    let (wrench, frame) = constant(NAME, plant, law, force, force_frame)?;
    let q0 = vector(NAME, "q0", q0, plant.n())?;
    let sample_time = optional_number(NAME, "sample_time", sample_time)?;
    require_partner(NAME, "sensor_bandwidth", sensor_bandwidth, "sample_time", sample_time.is_some())?;
    let bandwidth = optional_number(NAME, "sensor_bandwidth", sensor_bandwidth)?.unwrap_or(f64::INFINITY);
    let found = long(py, || limits::elastic_limits(plant, law, &wrench, frame, &q0, sample_time, bandwidth))?;
    let fields = PyDict::new(py);
    fields.set_item("sample_time_max", found.sample_time_max)?;
    if sample_time.is_some() {
        put(&fields, "reduced_inertia_min", &found.reduced_inertia_min)?;
    }
    put(&fields, "stiffness_max", &found.stiffness_max)?;
    put(&fields, "stiffness", &found.stiffness)?;
    fields.set_item("stiffness_scale_max", found.stiffness_scale_max)?;
    put_eigenvalues(&fields, &found.eigenvalues)?;
    Ok(fields)
}

/// Refuse NaN. Infinity is accepted, because it means that there is no limit.
fn require_no_nan(py: Python<'_>, function: &str, name: &str, _: &[usize], values: &[f64]) -> Result<(), Failure> {
    let place = long(py, || {
        Ok(values.chunks(CHECK_PERIOD).enumerate().find_map(|(piece, values)| {
            interrupt::check();
            values.iter().position(|x| x.is_nan()).map(|k| piece * CHECK_PERIOD + k)
        }))
    })?;
    let refuse = |k| input_error(py, function, name, format!("is not a number: expected numbers, got NaN (first bad index {k})"));
    place.map_or(Ok(()), |k| Err(refuse(k).into()))
}

/// Broadcast the arguments, and apply `f` to the numbers of each entry.
fn each<'py, const K: usize>(
    py: Python<'py>,
    function: &str,
    names: [&str; K],
    values: [&Bound<'py, PyAny>; K],
    f: impl Fn([f64; K]) -> CoreResult<f64> + Sync,
) -> Result<Bound<'py, PyAny>, Failure> {
    let problems = columns(function, names, values, require_no_nan, size_of::<f64>())?;
    new_array(py, &problems.shape, |out| {
        long(py, || {
            for (i, out) in out.iter_mut().enumerate() {
                interrupt::check();
                *out = f(problems.row(i))?;
            }
            Ok(())
        })
    })
}

/// The smallest reduced motor inertia `B0` for which a sampled motor loop is stable.
///
/// The link is locked, and feedback of the joint torque makes the motor of inertia `B` behave like one of inertia `B0` (see
/// `ElasticImpedance`). The motor torque is constant during a sample of length `dt`. So a linear map advances the state
/// `(theta, theta_dot)` exactly. With a lag of the sensor, the state includes the sensor's output. At `B0` the spectral radius of this map
/// is 1, with the damping `D0 = 2 zeta sqrt(B0 K_J)`. For `B0 << B` and a sensor without lag, the result is about
/// `K_J (dt / min(4 zeta, 1/zeta))^2`.
///
/// Args:
///     motor_inertia: `B`, kg m^2 or kg, > 0. All arguments are numbers or arrays, and broadcast.
///     joint_stiffness: `K_J`, N m/rad or N/m, > 0.
///     sample_time: `dt`, s, > 0.
///     damping_ratio: `zeta`, > 0; 1 if None (keyword only).
///     sensor_bandwidth: bandwidth of a first-order torque sensor, rad/s; a sensor without lag if None (keyword only).
///
/// Returns:
///     `B0`, kg m^2 or kg, of the common shape; NaN where even `B0 = B` is unstable.
///
/// Raises:
///     InputError: a number is not positive, or the shapes do not broadcast.
///
/// Source: [Ott2008] for the reduction; docs/elastic.md.
///
/// >>> import armlet as al
/// >>> al.smallest_reduced_inertia(0.4, 800.0, [0.0005, 0.001, 0.002]).round(6)
/// array([0.0002  , 0.0008  , 0.003204])
#[entered]
#[pyfunction]
#[arguments(motor_inertia, joint_stiffness, sample_time, *, damping_ratio=None, sensor_bandwidth=None)]
pub fn smallest_reduced_inertia<'py>() -> Result<Bound<'py, PyAny>, Failure> {
    let one = 1.0f64.into_pyobject(py).map_err(PyErr::from)?.into_any();
    let never = f64::INFINITY.into_pyobject(py).map_err(PyErr::from)?.into_any();
    let (ratio, bandwidth) = (damping_ratio.unwrap_or(&one), sensor_bandwidth.unwrap_or(&never));
    let names = ["motor_inertia", "joint_stiffness", "sample_time", "damping_ratio", "sensor_bandwidth"];
    each(py, NAME, names, [motor_inertia, joint_stiffness, sample_time, ratio, bandwidth], |[b, k, dt, zeta, w]| {
        limits::smallest_reduced_inertia(b, k, dt, w, zeta)
    })
}

/// The largest stable stiffness `k` of a spring at a link behind an elastic joint: `k = K_J (1 + d/D0)(1 - d B0/(D0 M))`.
///
/// The Routh criterion gives this limit. With `D0 = 2 sqrt(B0 K_J)` it is `K_J (1 + d/D0)(1 - d D0/(4 M K_J))`. If the limit is negative or
/// zero, no stiffness is stable.
///
/// Args:
///     mass: inertia `M` of the link, kg m^2 or kg, > 0. All arguments are numbers or arrays, and broadcast.
///     joint_stiffness: `K_J`, N m/rad or N/m, > 0.
///     reduced_inertia: reduced motor inertia `B0`, kg m^2 or kg, > 0.
///     damping: `d` of the damper at the link, N m s/rad or N s/m, >= 0.
///     motor_damping: damping `D0` of the motor, N m s/rad or N s/m, > 0; the critical damping `2 sqrt(B0 K_J)` if None (keyword only).
///
/// Returns:
///     `k`, N m/rad or N/m, of the common shape.
///
/// Raises:
///     InputError: a number has the wrong sign or is not finite, or the shapes do not broadcast.
///
/// Source: [Ott2008] for the reduction; docs/elastic.md.
///
/// >>> import armlet as al
/// >>> float(al.stiffness_limit(1.0, 800.0, 0.02, 20.0))
/// 2660.0
#[entered]
#[pyfunction]
#[arguments(mass, joint_stiffness, reduced_inertia, damping, *, motor_damping=None)]
pub fn stiffness_limit<'py>() -> Result<Bound<'py, PyAny>, Failure> {
    let critical = motor_damping.is_none();
    let names = ["mass", "joint_stiffness", "reduced_inertia", "damping", "motor_damping"];
    // Without `motor_damping` the fifth value is a placeholder that is not used.
    let values = [mass, joint_stiffness, reduced_inertia, damping, motor_damping.unwrap_or(mass)];
    each(py, NAME, names, values, |[m, k, b0, d, d0]| {
        let d0 = if critical { 2.0 * (b0 * k).sqrt() } else { d0 };
        for (name, x) in [("mass", m), ("joint_stiffness", k), ("reduced_inertia", b0), ("motor_damping", d0)] {
            armlet_core::error::positive(name, x)?;
        }
        if !(d >= 0.0 && d.is_finite()) {
            return Err(Error::input("damping", format!("is negative or not finite: expected >= 0, got {d}")));
        }
        Ok(limits::stiffness_limit(m, k, b0, d, d0))
    })
}

/// The damping matrix with which every mode of `M a + D v + K x = 0` has the damping ratio `zeta`.
///
/// `D = 2 zeta M^1/2 (M^-1/2 K M^-1/2)^1/2 M^1/2`. If `M = Q'Q` and `K = Q' diag(k) Q`, then `D = 2 zeta Q' diag(k)^1/2 Q`. This design is
/// called double diagonalisation.
///
/// Args:
///     inertia: `M`, `(n, n)` or its diagonal `(n,)`, symmetric and positive definite, kg or kg m^2, such as `M_x` of a law's terms.
///     stiffness: `K`, `(n, n)` or its diagonal `(n,)`, symmetric and positive definite, N/m or N m/rad.
///     ratio: the damping ratio `zeta`, > 0; 1 is critical.
///
/// Returns:
///     `D`, `(n, n)`, symmetric and positive definite, N s/m or N m s/rad.
///
/// Raises:
///     InputError: a matrix is not square, symmetric or positive definite, or the ratio is not positive.
///
/// Source: Albu-Schaeffer, Ott, Frese and Hirzinger, Cartesian impedance control of redundant robots, ICRA 2003.
///
/// >>> import armlet as al
/// >>> al.damping_from_ratio([[2.0, 0.0], [0.0, 0.5]], [[200.0, 0.0], [0.0, 50.0]], 0.7)
/// array([[28.,  0.],
///        [ 0.,  7.]])
#[entered]
#[pyfunction]
#[arguments(inertia, stiffness, ratio)]
pub fn damping_from_ratio<'py>() -> Result<Bound<'py, PyAny>, Failure> {
    let n = ArrayArgument::new(NAME, "inertia", inertia)?.shape.first().copied().unwrap_or(1);
    let square = |name: &'static str, value| crate::arguments::gain(NAME, name, value, n);
    let (m, k) = (square("inertia", inertia)?, square("stiffness", stiffness)?);
    let d = ratio_damping(&m, &k, number(NAME, "ratio", ratio)?)?;
    copied(py, &[n, n], &d.matrix())
}
