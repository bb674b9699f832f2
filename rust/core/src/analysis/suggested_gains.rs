//! Suggested gains for a bandwidth `w` and a damping ratio `z`, from the mass matrix at sampled configurations within the joint limits.
//!
//! The prime is the time derivative, and `e` the tracking error. Computed torque decouples the joints: `e'' + kd e' + kp e = 0` with
//! `kp = w^2`, `kd = 2 z w`. For laws with gains in N m/rad,
//!
//! `kp = m w^2`, `kd = 2 z m w`, `m = s max_q diag M(q)`, where `s` is the smallest number with `M(q) <= diag(m)` at all samples.
//!
//! If the mass matrix is constant, each mode of `M e'' + kd e' + kp e = 0` obeys `l y'' + 2 z w y' + w^2 y = 0`. Here `l` is an eigenvalue
//! of `diag(m)^-1 M` in (0, 1]. So the natural frequency is `w / sqrt(l) >= w`, and the damping ratio `z / sqrt(l) >= z`.
//!
//! If the input is constant over a sample `h`, the loop is `x_(k+1) = [1 h; 0 1] x_k - [h^2/2; h] [kp kd] x_k / l`. It is stable if and
//! only if `kd h < 2 l` and `kp h < 2 kd` (Jury), that is `w h < min(4 z, l / z)`. For the gains of decoupled joints, see
//! `SicilianoEtAl2009`, section 8.5.

use super::uniform::within;
use crate::dynamics::Model;
use crate::error::{Error, Result, positive};
use crate::interrupt;
use crate::linalg::symmetric_eigen;
use crate::memory;
use std::fmt;

/// Number of configurations at which the mass matrix is evaluated.
pub const SAMPLES: usize = 512;

/// Gains, and the limits that follow from them.
///
/// ```
/// # use armlet_core::arm::Arm;
/// use armlet_core::analysis::suggested_gains::suggest_gains;
///
/// // A bandwidth of 10 rad/s, critically damped, for an inertia of 2 kg m^2.
/// let gains = suggest_gains(&Arm::pendulum(2.0, 5.0)?.into(), 10.0, 1.0, None)?;
/// assert_eq!((gains.inertia.as_slice(), gains.lightest), (&[2.0][..], 1.0));
/// assert_eq!((gains.kp(), gains.computed_torque()), (vec![200.0], (100.0, 20.0)));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SuggestedGains {
    /// Requested bandwidth, rad/s.
    pub bandwidth: f64,
    /// Requested damping ratio.
    pub damping_ratio: f64,
    /// Sample time of a sampled law, s; `None` for a continuous law.
    pub sample_time: Option<f64>,
    /// Inertia `m` of each joint in the gains `kp = m w^2`, `(n,)`, kg m^2 or kg.
    pub inertia: Vec<f64>,
    /// The smallest `l` of all samples, in (0, 1]: the inertia of the lightest direction relative to `m`.
    pub lightest: f64,
}

impl SuggestedGains {
    /// Position gains of laws with gains in N m/rad, such as PID, `(n,)`, N m/rad or N/m.
    pub fn kp(&self) -> Vec<f64> {
        self.inertia.iter().map(|m| m * self.bandwidth * self.bandwidth).collect()
    }

    /// Velocity gains of laws with gains in N m s/rad, such as PID, `(n,)`, N m s/rad or N s/m.
    pub fn kd(&self) -> Vec<f64> {
        self.inertia.iter().map(|m| 2.0 * self.damping_ratio * m * self.bandwidth).collect()
    }

    /// Gains `kp`, 1/s^2, and `kd`, 1/s, of computed torque, for every joint.
    pub fn computed_torque(&self) -> (f64, f64) {
        (self.bandwidth * self.bandwidth, 2.0 * self.damping_ratio * self.bandwidth)
    }

    /// The bandwidths below which the sampled loop is stable, rad/s: first for laws with gains in N m/rad, such as PID, then for computed
    /// torque. `None` without a sample time.
    pub fn limits(&self) -> Option<(f64, f64)> {
        let z = self.damping_ratio;
        self.sample_time.map(|h| ((4.0 * z).min(self.lightest / z) / h, (4.0 * z).min(1.0 / z) / h))
    }

    /// For a continuous law: the slowest decay rate and the largest absolute value of a pole, rad/s, of all modes at all samples.
    pub fn poles(&self) -> (f64, f64) {
        let (w, z) = (self.bandwidth, self.damping_ratio);
        let of = |l: f64| {
            let root = z * z - l;
            if root < 0.0 { (z * w / l, w / l.sqrt()) } else { (w / (z + root.sqrt()), w * (z + root.sqrt()) / l) }
        };
        // The decay rate increases up to l = z^2 and then decreases, so its smallest value is at an end of the range of l.
        let (light, heavy) = (of(self.lightest), of(1.0));
        (light.0.min(heavy.0), light.1.max(heavy.1))
    }

    /// A step for fixed-step methods, s: the inverse of the largest absolute value of a pole of the continuous law. The method "rk4" is
    /// stable up to 2.785 times this step, "euler" and "semi_implicit" for real poles up to twice this step.
    pub fn step(&self) -> f64 {
        1.0 / self.poles().1
    }
}

/// Suggest gains of an arm for `bandwidth`, rad/s, and a damping ratio.
///
/// The law is continuous, or sampled with `sample_time`, s. Errors: `Input` for arguments that are not positive, a bandwidth too large for
/// the sample time, or a mass matrix that is not positive definite.
///
/// ```
/// use armlet_core::analysis::suggested_gains::suggest_gains;
/// use armlet_core::arm::Arm;
///
/// let gains = suggest_gains(&Arm::pendulum(2.0, 5.0)?.into(), 10.0, 1.0, Some(1e-3))?;
/// assert_eq!((gains.kp(), gains.kd()), (vec![200.0], vec![40.0]));
/// assert_eq!(gains.limits(), Some((1000.0, 1000.0)));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn suggest_gains(model: &Model, bandwidth: f64, damping_ratio: f64, sample_time: Option<f64>) -> Result<SuggestedGains> {
    positive("bandwidth", bandwidth)?;
    positive("damping_ratio", damping_ratio)?;
    sample_time.map_or(Ok(()), |h| positive("sample_time", h))?;
    let (inertia, lightest) = spread(model)?;
    let gains = SuggestedGains { bandwidth, damping_ratio, sample_time, inertia, lightest };
    if let (Some(h), Some((_, limit))) = (sample_time, gains.limits())
        && bandwidth >= limit
    {
        return Err(Error::input(
            "bandwidth",
            format!("is too large for the sample time: expected below min(4 zeta, 1/zeta)/h = {limit} rad/s at h = {h} s, got {bandwidth}"),
        ));
    }
    if let Some(i) = gains.kp().iter().chain(&gains.kd()).position(|k| !k.is_finite()) {
        let problem = format!("makes gains that overflow: expected finite ones, got {bandwidth} rad/s");
        return Err(Error::input("bandwidth", problem).at([i % model.n()]));
    }
    Ok(gains)
}

/// Compute the inertia `m` of each joint, `(n,)`, kg m^2 or kg, and the smallest eigenvalue of `diag(m)^-1 M`, at sampled configurations
/// within the joint limits.
fn spread(model: &Model) -> Result<(Vec<f64>, f64)> {
    let n = model.n();
    let bounds = match model {
        Model::PlanarPr(_) => vec![(f64::NEG_INFINITY, f64::INFINITY); n],
        Model::Tree(arm) => arm.independent().map(|joint| (joint.limits.lower, joint.limits.upper)).collect(),
    };
    let (angles, zeros) = (model.angles(), vec![0.0; n]);
    let (mut q, mut mass) = (vec![0.0; n], memory::zeros(n * n)?);
    let mut at = model.at(&q);
    let mut visit = |each: &mut dyn FnMut(&mut [f64]) -> Result<()>| -> Result<()> {
        let mut state = 0;
        for _ in 0..SAMPLES {
            interrupt::check();
            within(&bounds, &angles, &zeros, &mut state, &mut q);
            at.move_to(&q);
            at.write_mass_matrix(&mut mass);
            each(&mut mass)?;
        }
        Ok(())
    };
    let mut largest = vec![0.0f64; n];
    visit(&mut |mass| {
        largest.iter_mut().enumerate().for_each(|(i, most)| *most = most.max(mass[i * n + i]));
        Ok(())
    })?;
    if let Some(i) = largest.iter().position(|m| !(*m > 0.0 && m.is_finite())) {
        let expected = "expected bodies with mass, from <inertial> elements of the file or from arm.with_payload(frame, mass)";
        return Err(Error::input("arm", format!("has no inertia at a joint: {expected}, got diag M(q) = {}", largest[i])).at([i]));
    }
    let (mut most, mut least) = (0.0f64, f64::INFINITY);
    visit(&mut |mass| {
        for i in 0..n {
            for j in 0..n {
                mass[i * n + j] /= (largest[i] * largest[j]).sqrt();
            }
        }
        let (values, _) = symmetric_eigen(mass, n)?;
        (most, least) = (most.max(values[n - 1]), least.min(values[0]));
        Ok(())
    })?;
    // The rounding error of an eigenvalue is a few times n eps of the largest one.
    if !(least > 4.0 * n as f64 * f64::EPSILON * most) {
        let problem = "has a mass matrix that is not positive definite: expected M(q) > 0 within the joint limits";
        return Err(Error::input("arm", format!("{problem}, got an eigenvalue {least:e} of 1")));
    }
    Ok((largest.iter().map(|m| most * m).collect(), least / most))
}

/// A list of numbers with four decimals, in brackets.
fn shown(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|x| format!("{x:.4}")).collect::<Vec<_>>().join(", "))
}

impl fmt::Display for SuggestedGains {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kp, kd) = self.computed_torque();
        let (slow, fast) = self.poles();
        let (w, z) = (self.bandwidth, self.damping_ratio);
        writeln!(f, "bandwidth {w} rad/s, damping ratio {z}; the mass matrix at {SAMPLES} configurations within the joint limits")?;
        writeln!(f, "PDGravity, PID, Adaptive (gains are torques; N m/rad and N m s/rad, N/m and N s/m):")?;
        writeln!(f, "  kp = {}", shown(&self.kp()))?;
        writeln!(f, "  kd = {}", shown(&self.kd()))?;
        writeln!(f, "  at these configurations every mode has this bandwidth and damping ratio or more;")?;
        writeln!(
            f,
            "  the slowest decays at {slow:.4} rad/s, the fastest pole is at {fast:.4} rad/s, for a step dt <= {:.2e} s",
            self.step()
        )?;
        write!(f, "ComputedTorque (gains are accelerations; 1/s^2 and 1/s): kp = {kp}, kd = {kd}")?;
        if let (Some(h), Some((torque, acceleration))) = (self.sample_time, self.limits()) {
            let verdict = |limit: f64| if self.bandwidth < limit { "stable" } else { "UNSTABLE" };
            writeln!(f, "\nheld for a sample h = {h} s, a loop is stable below min(4 zeta, l/zeta)/h, l = 1 for ComputedTorque and")?;
            writeln!(f, "l = {:.4} for gains that are torques: the lightest direction of M(q) against the kp of its joint", self.lightest)?;
            writeln!(f, "  ComputedTorque: below {acceleration:.4} rad/s: {}", verdict(acceleration))?;
            write!(f, "  gains that are torques: below {torque:.4} rad/s: {}; a third of it is a margin for delays", verdict(torque))?;
        }
        Ok(())
    }
}
