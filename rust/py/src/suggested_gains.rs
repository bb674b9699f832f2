//! `armlet.suggest_gains`: gains for a bandwidth and a damping ratio.

use crate::arm::Arm;
use crate::arrays::{any_vector, copied, number, object, optional_number};
use crate::errors::Failure;
use crate::interrupts::long;
use crate::properties::properties;
use crate::seal::{Sealed, seal};
use crate::warnings;
use armlet_core::analysis::suggested_gains::{SuggestedGains as Core, suggest_gains as core};
use armlet_macros::entered;
use pyo3::prelude::*;

/// Gains for a bandwidth and a damping ratio, from `suggest_gains`. `str(g)` explains them.
///
/// - `kp`, `kd`: `(n,)`, N m/rad and N m s/rad (N/m, N s/m), for `PDGravity`, `PID`, `JointImpedance` and `Adaptive`.
/// - `computed_torque`: the numbers `kp` in 1/s^2 and `kd` in 1/s, for `ComputedTorque`.
/// - `inertia`: `m`, `(n,)`, kg m^2 or kg.
/// - `lightest`: the smallest eigenvalue of `diag(m)^-1 M(q)` at the configurations at which `suggest_gains` computed the mass matrix `M`.
/// - `limit`: the bandwidth, rad/s, below which the sampled loop with `kp` and `kd` is stable; None without a sample time.
/// - `computed_torque_limit`: the same bandwidth for the loop with `ComputedTorque`, rad/s; None without a sample time.
/// - `step`: a step `dt`, s, for fixed-step methods and a continuous law with `kp` and `kd`: the inverse of the fastest pole.
/// - `bandwidth`, `damping_ratio`, `sample_time`: the arguments of `suggest_gains`.
#[pyclass(frozen, module = "armlet")]
pub struct SuggestedGains {
    core: Core,
}

const NAME: &str = "suggest_gains";

properties!(SuggestedGains {
    bandwidth: f64;
    damping_ratio: f64;
    sample_time: Option<f64>;
    lightest: f64;
    inertia: Result<Bound<'py, PyAny>, Failure> = |gains, py| array(py, &gains.core.inertia);
    kp: Result<Bound<'py, PyAny>, Failure> = |gains, py| array(py, &gains.core.kp());
    kd: Result<Bound<'py, PyAny>, Failure> = |gains, py| array(py, &gains.core.kd());
    computed_torque: (f64, f64) = |gains| gains.core.computed_torque();
    limit: Option<f64> = |gains| gains.core.limits().map(|(limit, _)| limit);
    computed_torque_limit: Option<f64> = |gains| gains.core.limits().map(|(_, limit)| limit);
    step: f64 = |gains| gains.core.step();
});

#[entered]
#[pymethods]
impl SuggestedGains {
    #[new]
    #[arguments(bandwidth, damping_ratio, sample_time, inertia, lightest)]
    fn new(sample_time: Option<&Bound<'_, PyAny>>) -> Result<Self, Failure> {
        let core = Core {
            bandwidth: number(NAME, "bandwidth", bandwidth)?,
            damping_ratio: number(NAME, "damping_ratio", damping_ratio)?,
            sample_time: optional_number(NAME, "sample_time", sample_time)?,
            inertia: any_vector(NAME, "inertia", inertia)?,
            lightest: number(NAME, "lightest", lightest)?,
        };
        Ok(SuggestedGains { core })
    }

    fn __str__(&self) -> String {
        self.core.to_string()
    }

    fn __repr__(&self) -> String {
        let Core { bandwidth, damping_ratio, sample_time, .. } = &self.core;
        let h = sample_time.map_or("None".to_string(), |h| h.to_string());
        format!("SuggestedGains(n={}, bandwidth={bandwidth}, damping_ratio={damping_ratio}, sample_time={h})", self.core.inertia.len())
    }

    fn __reduce__<'py>(&self) -> Result<Sealed<'py>, Failure> {
        let Core { bandwidth, damping_ratio, sample_time, inertia, lightest } = &self.core;
        let parts = (*bandwidth, *damping_ratio, *sample_time, array(py, inertia)?, *lightest).into_pyobject(py)?;
        Ok(seal(py.get_type::<Self>().as_any(), parts, None)?)
    }
}

fn array<'py>(py: Python<'py>, values: &[f64]) -> Result<Bound<'py, PyAny>, Failure> {
    copied(py, &[values.len()], values)
}

/// Compute gains of an arm for a bandwidth `w` and a damping ratio `zeta`, from its mass matrix over the workspace.
///
/// `PDGravity`, `PID`, `JointImpedance` and `Adaptive` have *gains that are torques* (N m per rad and per rad/s of the error): `kp = m w^2`
/// and `kd = 2 zeta m w`. For `ComputedTorque`, `.computed_torque` has `kp = w^2` and `kd = 2 zeta w`.
///
/// `m` is the largest `diag M(q)` of 512 configurations within the joint limits, times a factor. It is the smallest factor for which
/// `diag(m) - M(q)` is positive semidefinite at all of them. So, with `M` constant at one of these configurations, every mode has at least
/// the natural frequency `w` and the damping ratio `zeta`. Joints without limits are sampled from -pi to pi rad, or from -1 to 1 m. Equal
/// calls return equal gains.
///
/// With `sample_time=h` the law's input is constant for `h`. The loop is then stable for bandwidths below `min(4 zeta, l/zeta)/h` rad/s.
/// For `ComputedTorque`, `l = 1`; for gains that are torques, `l` is the smallest eigenvalue of `diag(m)^-1 M(q)` at these configurations.
/// This limit assumes that the law compensates gravity, and that the mass matrix is constant at one of these configurations.
///
/// Args:
///     arm: the arm; its inertia includes the armature.
///     bandwidth: `w`, rad/s, > 0.
///     damping_ratio: `zeta`, > 0; 1 is critical damping.
///     sample_time: the time `h` between two samples of the law, s, > 0; None: a continuous law.
///
/// Returns:
///     A `SuggestedGains`: `.kp`, `.kd`, and `str(g)` with bandwidths, poles and limits.
///
/// Raises:
///     InputError: a number is not positive, `bandwidth` is not below the limit for `ComputedTorque` at this sample time, or the mass
///         matrix is not positive definite.
///
/// Warns:
///     UserWarning: `bandwidth` is not below the limit for gains that are torques.
///
/// Source: Siciliano, Sciavicco, Villani and Oriolo, Robotics: Modelling, Planning and Control, section 8.5, 2009.
///
/// >>> import armlet as al
/// >>> g = al.suggest_gains(al.pendulum(2.0, 5.0), 10.0, sample_time=1e-3)
/// >>> g.kp, g.kd, g.limit
/// (array([200.]), array([40.]), 1000.0)
#[entered]
#[pyfunction]
#[arguments(arm, bandwidth, damping_ratio=1.0, sample_time=None)]
pub fn suggest_gains() -> Result<SuggestedGains, Failure> {
    let arm = object::<Arm>(NAME, "arm", "an Arm such as planar_arm(..)", arm)?;
    let model = arm.get().model.core();
    let bandwidth = number(NAME, "bandwidth", bandwidth)?;
    let ratio = optional_number(NAME, "damping_ratio", damping_ratio)?.unwrap_or(1.0);
    let h = optional_number(NAME, "sample_time", sample_time)?;
    let gains = long(py, || core(&model, bandwidth, ratio, h))?;
    warn(py, &gains)?;
    Ok(SuggestedGains { core: gains })
}

fn warn(py: Python<'_>, gains: &Core) -> Result<(), Failure> {
    let Some((limit, _)) = gains.limits().filter(|(limit, _)| gains.bandwidth >= *limit) else { return Ok(()) };
    let text = format!(
        "{NAME}: bandwidth is too large for gains that are torques at this sample time: expected below {limit} rad/s, got {}; ComputedTorque is stable",
        gains.bandwidth
    );
    Ok(warnings::warn(py, text)?)
}
