//! Limits of the control of elastic joints. Units are those of revolute joints; for a prismatic joint, replace rad by m, N m by N and kg
//! m^2 by kg.
//!
//! - Sampled motor loop: the largest stable sample time for a reduced inertia `B0`, and the smallest stable `B0` for a sample time. Both
//!   depend on the damping ratio and on the bandwidth of a torque sensor.
//! - Stiffness limit of one joint (Routh): `k < K_J (1 + d/D0)(1 - d B0/(D0 M))`. With `D0 = 2 sqrt(B0 K_J)` the limit is
//!   `K_J (1 + d/D0)(1 - d D0/(4 M K_J))`. Here `M` and `d` are inertia and damping of the link, `B0` and `D0` those of the motor.
//! - Stiffness scale: the largest factor `kappa` of the law's stiffness for which the loop is stable. The stiffness is `K_m` of a Cartesian
//!   impedance, or `kp` of a PD law. The loop is linearised at its equilibrium. It is stable if every eigenvalue has a negative real part.
//!   No torque opposes a *free motion*, so its zero eigenvalues do not count.

use super::equilibrium::equilibrium;
use crate::error::{Error, Result, positive};
use crate::interrupt;
use crate::law::{LawSpec, LockedMotors};
use crate::linalg::Gain;
use crate::plant::PlantSpec;

/// Compute the largest stable stiffness `k`, N m/rad, of a spring at a link behind an elastic joint.
///
/// `mass` is the inertia `M` of the link and `reduced_inertia` the inertia `B0` of the motor, kg m^2. `joint_stiffness` is `K_J`, N m/rad.
/// `damping` of the link is `d`, `motor_damping` is `D0`, N m s/rad. If the result is not positive, no stiffness is stable.
pub fn stiffness_limit(mass: f64, joint_stiffness: f64, reduced_inertia: f64, damping: f64, motor_damping: f64) -> f64 {
    joint_stiffness * (1.0 + damping / motor_damping) * (1.0 - damping * reduced_inertia / (motor_damping * mass))
}

/// Compute the smallest reduced inertia `B0 <= B`, kg m^2, whose sampled motor loop with `D0 = 2 zeta sqrt(B0 K_J)` and locked links is
/// stable. The result is NaN if `B0 = B` is unstable, and zero if the loop is stable down to `1e-15 B`.
///
/// `inertia` is `B`, kg m^2, `stiffness` is `K_J`, N m/rad, and `sample_time` is in s. `bandwidth` of the torque sensor is in rad/s,
/// infinite without a sensor. Errors: `Input` for an argument that is not positive.
pub fn smallest_reduced_inertia(inertia: f64, stiffness: f64, sample_time: f64, bandwidth: f64, damping_ratio: f64) -> Result<f64> {
    for (name, x) in
        [("motor_inertia", inertia), ("joint_stiffness", stiffness), ("sample_time", sample_time), ("damping_ratio", damping_ratio)]
    {
        positive(name, x)?;
    }
    if !(bandwidth > 0.0) {
        return Err(Error::input("sensor_bandwidth", format!("is not positive: expected rad/s > 0, got {bandwidth}")));
    }
    let stable = |b0: f64| {
        interrupt::check();
        let damping = 2.0 * damping_ratio * (b0 * stiffness).sqrt();
        let motor = LockedMotors::single(inertia, stiffness, b0, damping, bandwidth);
        // A longer sample time can be stable again, because the motor swings back just before the next sample. Such isolated sample times
        // are excluded: seven shorter sample times must be stable, too.
        (1..=SHORTER).rev().all(|k| motor.radius(sample_time * f64::from(k) / f64::from(SHORTER)) < 1.0)
    };
    const SHORTER: u32 = 8;
    if !stable(inertia) {
        return Ok(f64::NAN);
    }
    const SHRINK: f64 = 0.95;
    const FLOOR: f64 = 1e-15;
    let (mut high, mut low) = (inertia, SHRINK * inertia);
    while stable(low) {
        (high, low) = (low, SHRINK * low);
        if low < FLOOR * inertia {
            return Ok(0.0);
        }
    }
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return Ok(high);
        }
        if stable(middle) { high = middle } else { low = middle }
    }
}

/// Compute the largest factor `kappa` of the law's stiffness for which the loop is stable at its equilibrium. The stiffness is `K_m` of a
/// Cartesian impedance, or `kp` of a PD law. Damping and joint stiffness are unchanged.
///
/// The search increases `kappa` from 1 in steps of 5 percent to the first unstable factor. The result is infinite if all factors up to
/// `1e6` are stable, and zero if the loop is unstable with `kappa = 1`. Errors: `Input` for a law without a spring, and those of
/// [`equilibrium`].
pub fn stiffness_scale(plant: &PlantSpec, law: &LawSpec, wrench: &[f64; 6], force_frame: Option<usize>, q0: &[f64]) -> Result<f64> {
    const GROWTH: f64 = 1.05;
    const CAP: f64 = 1e6;
    // Without a force, and with exact gravity compensation, the equilibrium is the target for every stiffness. Otherwise, the equilibrium
    // depends on `kappa`.
    let mut q = q0.to_vec();
    let mut stable = |kappa: f64| -> Result<bool> {
        let Some(scaled) = law.with_stiffness(kappa) else {
            return Err(Error::input("law", format!("has no spring: expected an impedance or PD law, got {}", law.name())));
        };
        let found = equilibrium(plant, &scaled, wrench, force_frame, &q)?;
        q.copy_from_slice(&found.q);
        Ok(found.stable)
    };
    if !stable(1.0)? {
        return Ok(0.0);
    }
    let (mut low, mut high) = (1.0, GROWTH);
    while stable(high)? {
        (low, high) = (high, GROWTH * high);
        if high > CAP {
            return Ok(f64::INFINITY);
        }
    }
    while high - low > 1e-12 * high {
        let middle = 0.5 * (low + high);
        if stable(middle)? { low = middle } else { high = middle }
    }
    Ok(0.5 * (low + high))
}

/// The limits of an elastic plant with a law, at an equilibrium.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, plant::{ElasticSpec, PlantSpec}};
/// # use armlet_core::law::{Gain, JointImpedanceSpec, LawSpec, PdGravitySpec, ReductionSpec};
/// use armlet_core::analysis::elastic_limits::elastic_limits;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |k: f64| Gain::scalar("gain", 1, k);
/// # let plant = PlantSpec::from(ElasticSpec::new(model.clone(), gain(800.0)?, gain(0.4)?, None, None, None)?);
/// # let outer = PdGravitySpec::new(model, vec![0.5], gain(60.0)?, gain(12.0)?)?;
/// # let inner = ReductionSpec::new(1, gain(800.0)?, gain(0.4)?, gain(0.1)?, None, 0.7, false)?;
///
/// // A joint spring of 60 N m/rad, behind an elastic joint of 800 N m/rad.
/// let law = LawSpec::from(JointImpedanceSpec { outer, inner });
/// let limits = elastic_limits(&plant, &law, &[0.0; 6], None, &[0.5], Some(1e-3), f64::INFINITY)?;
/// assert!(limits.stiffness == [60.0] && limits.stiffness_max[0] > 60.0);
/// assert!(limits.sample_time_max > 1e-3 && limits.reduced_inertia_min[0] < 0.1);
/// assert!(limits.eigenvalues.iter().all(|(real, _)| *real < 0.0) && limits.stiffness_scale_max > 1.0);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ElasticLimits {
    /// The sample time at which the motor loops with locked links become unstable, s.
    pub sample_time_max: f64,
    /// For each joint: the smallest `B0`, kg m^2, at the requested sample time; empty without a sample time.
    pub reduced_inertia_min: Vec<f64>,
    /// For each joint: the largest stable stiffness if the other joints are locked, N m/rad.
    pub stiffness_max: Vec<f64>,
    /// For each joint: the stiffness of the law, N m/rad, which `stiffness_max` bounds: `(J' K_m J)_ii`, or `kp_ii` for a PD law.
    pub stiffness: Vec<f64>,
    /// The largest factor of the law's stiffness with a stable loop at this equilibrium.
    pub stiffness_scale_max: f64,
    /// Eigenvalues of the loop linearised at the equilibrium, as `(real, imaginary)`, 1/s.
    pub eigenvalues: Vec<(f64, f64)>,
}

/// Compute the limits of `plant` with `law` at the equilibrium that is reached from `q0`, `(n,)`.
///
/// The smallest `B0` is computed for `sample_time`, s, `bandwidth` (rad/s, infinite without a torque sensor) and the damping ratio of the
/// law. Errors: `Input` for a plant or a law without motors, and those of [`equilibrium`].
pub fn elastic_limits(
    plant: &PlantSpec,
    law: &LawSpec,
    wrench: &[f64; 6],
    force_frame: Option<usize>,
    q0: &[f64],
    sample_time: Option<f64>,
    bandwidth: f64,
) -> Result<ElasticLimits> {
    let (Some(elastic), Some(inner)) = (plant.elastic(), law.reduction()) else {
        return Err(Error::input("law", format!("has no motor loop: expected a law such as ElasticImpedance, got {}", law.name())));
    };
    let found = equilibrium(plant, law, wrench, force_frame, q0)?;
    let n = plant.n();
    let diagonal = |gain: &Gain| (0..n).map(|i| gain.at(i, i)).collect::<Vec<f64>>();
    let [k_j, b, b0, d0] = [&elastic.stiffness, &elastic.motor_inertia, &inner.reduced_inertia, &inner.motor_damping].map(diagonal);
    let (mass, stiffness, damping) = super::equilibrium::joint_view(plant, law, &found.q);
    let reduced_inertia_min = match sample_time {
        None => Vec::new(),
        Some(dt) => (0..n)
            .map(|i| smallest_reduced_inertia(b[i], k_j[i], dt, bandwidth, d0[i] / (2.0 * (b0[i] * k_j[i]).sqrt())))
            .collect::<Result<_>>()?,
    };
    Ok(ElasticLimits {
        sample_time_max: LockedMotors::new(elastic, inner, bandwidth).largest_sample_time(),
        reduced_inertia_min,
        stiffness_max: (0..n).map(|i| stiffness_limit(mass[i], k_j[i], b0[i], damping[i], d0[i])).collect(),
        stiffness,
        stiffness_scale_max: stiffness_scale(plant, law, wrench, force_frame, &found.q)?,
        eigenvalues: found.eigenvalues,
    })
}
