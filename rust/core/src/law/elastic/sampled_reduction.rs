//! The motor loop of a sampled controller with locked links. The torque is constant over one sample of length `dt`:
//!
//! `y' = A y + G tau`, `tau = F y` at samples, so `y <- (exp(A dt) + int_0^dt exp(A s) ds G F) y`. `A` and `G` are the matrices of the
//! motors, and `F` has the gains of the controller.
//!
//! The prime is the time derivative. The state `y` is `[theta, theta_dot]`, the motor positions and velocities. A first-order torque sensor
//! of bandwidth `w_c` adds the filtered torque `tau_f` to `y`, with `tau_f' = w_c (tau_J - tau_f)`. The loop is stable if and only if the
//! spectral radius of this map is below 1. `B` is the motor inertia, `B0` the reduced motor inertia and `K_J` the joint stiffness. For
//! `B0 << B` and no sensor, the limit is `omega_n dt < min(4 zeta, 1/zeta)` with `omega_n = sqrt(K_J/B0)` and the damping ratio `zeta`. At
//! `B0 = B`, this rule gives a limit that is too large for damping ratios from 0.5 to 1. Units are those of revolute joints.

use crate::law::inertia_reduction::ReductionSpec;
use crate::linalg::eigenvalues::spectral_radius;
use crate::linalg::{Gain, largest};
use crate::plant::ElasticSpec;
use nalgebra::DMatrix;

/// Motors with locked links and the inner loop of a law.
///
/// ```
/// use armlet_core::law::LockedMotors;
///
/// // A motor of 0.4 kg m^2 at a spring of 800 N m/rad, reduced to 0.02 kg m^2, without a torque sensor.
/// let motor = LockedMotors::single(0.4, 800.0, 0.02, 8.0, f64::INFINITY);
/// let limit = motor.largest_sample_time();
/// assert!(1e-4 < limit && limit < 1e-1);
/// assert!(motor.radius(0.9 * limit) < 1.0 && motor.radius(1.1 * limit) > 1.0);
/// ```
pub struct LockedMotors {
    n: usize,
    /// The matrices of each group of coupled joints; equal groups are stored once.
    groups: Vec<Group>,
}

#[derive(PartialEq)]
struct Group {
    n: usize,
    stiffness: Vec<f64>,
    inverse_inertia: Vec<f64>,
    /// Viscous friction of the motors and joints, `(n,)`, N m s/rad.
    friction: Vec<f64>,
    model_stiffness: Vec<f64>,
    /// Inertia ratio `B B0^-1`, `(n, n)`.
    ratio: Vec<f64>,
    /// Damping gain `B B0^-1 D0`, `(n, n)`, N m s/rad.
    damping: Vec<f64>,
    /// Bandwidth of the torque sensor, rad/s; infinite without a sensor.
    bandwidth: f64,
    /// A sample time that is short compared with the time constants of the loop, s. The search for instability starts with it.
    short: f64,
}

fn times(n: usize, a: &[f64], b: &[f64]) -> Vec<f64> {
    (0..n * n).map(|at| (0..n).map(|k| a[at / n * n + k] * b[k * n + at % n]).sum()).collect()
}

fn norm(n: usize, a: &[f64]) -> f64 {
    (0..n).map(|i| a[i * n..(i + 1) * n].iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max)
}

impl LockedMotors {
    /// Create the motors of `plant` with the inner loop `law`. `bandwidth` is the bandwidth of the torque sensor, rad/s; infinite without a
    /// sensor.
    pub fn new(plant: &ElasticSpec, law: &ReductionSpec, bandwidth: f64) -> Self {
        let n = law.reduced_inertia.n();
        let friction: Vec<f64> = (0..n).map(|i| plant.joint_damping[i] + plant.motor_friction[i]).collect();
        let gains =
            [&plant.stiffness, &plant.motor_inertia, &law.joint_stiffness, &law.motor_inertia, &law.reduced_inertia, &law.motor_damping];
        let joints: Vec<Vec<usize>> =
            if gains.iter().all(|gain| gain.is_diagonal()) { (0..n).map(|i| vec![i]).collect() } else { vec![(0..n).collect()] };
        let mut groups: Vec<Group> = Vec::new();
        for joints in &joints {
            let part = |gain: &Gain| {
                Gain::unchecked(
                    joints.len(),
                    joints.iter().flat_map(|&i| joints.iter().map(move |&j| (i, j))).map(|(i, j)| gain.at(i, j)).collect(),
                )
            };
            let friction = joints.iter().map(|&i| friction[i]).collect();
            let group = Group::new(gains.map(part), friction, bandwidth);
            if !groups.contains(&group) {
                groups.push(group);
            }
        }
        LockedMotors { n, groups }
    }

    /// Create one motor. Inertias are in kg m^2, `stiffness` in N m/rad, `motor_damping` in N m s/rad, and `bandwidth` in rad/s.
    pub fn single(inertia: f64, stiffness: f64, reduced_inertia: f64, motor_damping: f64, bandwidth: f64) -> Self {
        let gains = [stiffness, inertia, stiffness, inertia, reduced_inertia, motor_damping].map(|x| Gain::unchecked(1, vec![x]));
        LockedMotors { n: 1, groups: vec![Group::new(gains, vec![0.0], bandwidth)] }
    }

    /// Number of joints.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Spectral radius of the map over one sample of `dt`, s; infinite if it cannot be computed.
    pub fn radius(&self, dt: f64) -> f64 {
        self.groups.iter().map(|group| group.radius(dt)).fold(0.0, f64::max)
    }

    /// The sample time at which the loop first becomes unstable, s. It is infinite if none is found, and zero if even a very short sample
    /// time is unstable.
    pub fn largest_sample_time(&self) -> f64 {
        self.groups.iter().map(Group::largest_sample_time).fold(f64::INFINITY, f64::min)
    }

    /// The result of [`LockedMotors::largest_sample_time`] if it is at most `until`, s; else infinite.
    pub fn unstable_up_to(&self, until: f64) -> f64 {
        self.groups.iter().map(|group| group.first_instability(group.short, until)).fold(f64::INFINITY, f64::min)
    }

    /// The first unstable sample time from `from` to `until`, s; infinite if none is found. The loop must be stable at `from`.
    pub fn unstable_between(&self, from: f64, until: f64) -> f64 {
        self.groups.iter().map(|group| group.first_instability(from, until)).fold(f64::INFINITY, f64::min)
    }
}

impl Group {
    fn new(gains: [Gain; 6], friction: Vec<f64>, bandwidth: f64) -> Self {
        let n = friction.len();
        let [stiffness, inertia, model_stiffness, model_inertia, reduced, damping] = gains;
        let inverse_reduced = reduced.inverse().matrix();
        let ratio = times(n, &model_inertia.matrix(), &inverse_reduced);
        let rate = norm(n, &times(n, &inverse_reduced, &model_stiffness.matrix())).sqrt();
        let brake = norm(n, &times(n, &inverse_reduced, &damping.matrix()));
        let creep = norm(n, &damping.solve(&model_stiffness).matrix());
        let slowest = if bandwidth.is_finite() { bandwidth } else { 0.0 };
        Group {
            n,
            damping: times(n, &ratio, &damping.matrix()),
            stiffness: stiffness.matrix(),
            inverse_inertia: inertia.inverse().matrix(),
            model_stiffness: model_stiffness.matrix(),
            friction,
            ratio,
            bandwidth,
            short: 1e-2 / rate.max(brake).max(creep).max(slowest),
        }
    }

    /// The map over one sample as a row-major matrix, and its size.
    fn map(&self, dt: f64) -> (Vec<f64>, usize) {
        let n = self.n;
        let sensor = self.bandwidth.is_finite();
        let s = if sensor { 3 * n } else { 2 * n };
        let size = s + n;
        let mut a = vec![0.0; size * size];
        let pull = times(n, &self.inverse_inertia, &self.stiffness);
        for i in 0..n {
            a[i * size + n + i] = dt;
            for j in 0..n {
                a[(n + i) * size + j] = -dt * pull[i * n + j];
                a[(n + i) * size + n + j] = -dt * self.inverse_inertia[i * n + j] * self.friction[j];
                a[(n + i) * size + s + j] = dt * self.inverse_inertia[i * n + j];
                if sensor {
                    a[(2 * n + i) * size + j] = dt * self.bandwidth * self.stiffness[i * n + j];
                }
            }
            if sensor {
                a[(2 * n + i) * size + 2 * n + i] = -dt * self.bandwidth;
            }
        }
        // For larger entries, nalgebra's matrix exponential does not end, because the tenth power of a norm is infinite.
        const MOST: f64 = 1e30;
        let e = if largest(&a) < MOST { DMatrix::from_row_slice(size, size, &a).exp() } else { DMatrix::repeat(size, size, f64::NAN) };
        // The torque is `tau = (I - R) tau_J - R D0 theta_dot` with `R = B B0^-1`, where `tau_J` is modelled or measured.
        let share = |i: usize, j: usize| f64::from(u8::from(i == j)) - self.ratio[i * n + j];
        let mut f = vec![0.0; n * s];
        for i in 0..n {
            for j in 0..n {
                let torque = if sensor { 2 * n + j } else { j };
                f[i * s + torque] = if sensor { share(i, j) } else { (0..n).map(|k| share(i, k) * self.model_stiffness[k * n + j]).sum() };
                f[i * s + n + j] = -self.damping[i * n + j];
            }
        }
        let entry = |at: usize| {
            let (i, j) = (at / s, at % s);
            e[(i, j)] + (0..n).map(|k| e[(i, s + k)] * f[k * s + j]).sum::<f64>()
        };
        ((0..s * s).map(entry).collect(), s)
    }

    fn radius(&self, dt: f64) -> f64 {
        let (map, s) = self.map(dt);
        spectral_radius(&map, s).unwrap_or(f64::INFINITY)
    }

    fn largest_sample_time(&self) -> f64 {
        const CAP: f64 = 1e8;
        self.first_instability(self.short, CAP * self.short)
    }

    /// The first unstable sample time from `from` to `until`, s, searched in steps of 2 percent. It is zero if the loop is unstable at
    /// `from`, and infinite if no step up to `until` is unstable.
    fn first_instability(&self, from: f64, until: f64) -> f64 {
        const GROWTH: f64 = 1.02;
        let mut low = from;
        if self.radius(low) >= 1.0 {
            return 0.0;
        }
        let mut high = loop {
            if low >= until {
                return f64::INFINITY;
            }
            let high = (low * GROWTH).min(until);
            if self.radius(high) >= 1.0 {
                break high;
            }
            low = high;
        };
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                return low;
            }
            if self.radius(middle) < 1.0 { low = middle } else { high = middle }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_of_small_inertia_is_the_rule_of_thumb() {
        let (b, k) = (0.4, 800.0);
        for zeta in [0.1, 0.25, 0.5, 1.0, 2.0] {
            let b0 = 1e-6 * b;
            let omega = f64::sqrt(k / b0);
            let limit = omega * LockedMotors::single(b, k, b0, 2.0 * zeta * (b0 * k).sqrt(), f64::INFINITY).largest_sample_time();
            let rule = (4.0 * zeta).min(1.0 / zeta);
            // The relative error of the rule `omega_n dt < min(4 zeta, 1/zeta)` is of the order of B0/B = 1e-6.
            assert!((limit / rule - 1.0).abs() < 1e-5, "zeta {zeta}: {limit} {rule}");
        }
        // At B0 = B the rule `omega_n dt < min(4 zeta, 1/zeta)` gives a limit that is too large by 8 to 27 %, for damping ratios from 0.5
        // to 1.
        for zeta in [0.5, 0.7, 1.0] {
            let full = LockedMotors::single(b, k, b, 2.0 * zeta * f64::sqrt(b * k), f64::INFINITY).largest_sample_time();
            let excess = (4.0 * zeta).min(1.0 / zeta) / (f64::sqrt(k / b) * full);
            assert!((1.07..1.28).contains(&excess), "zeta {zeta}: {excess}");
        }
    }

    #[test]
    fn coupled_motors_that_do_not_couple_agree_with_single_ones() {
        let single = LockedMotors::single(0.4, 800.0, 0.02, 8.0, 2000.0).largest_sample_time();
        let both = Group::new([800.0, 0.4, 800.0, 0.4, 0.02, 8.0].map(|x| Gain::unchecked(2, vec![x, 0.0, 0.0, x])), vec![0.0; 2], 2000.0)
            .largest_sample_time();
        assert!((single / both - 1.0).abs() < 1e-6, "a double eigenvalue is known to the root of a rounding: {single} {both}");
        // With little damping, a sensor with lag reduces the largest sample time.
        let little = |bandwidth: f64| LockedMotors::single(0.4, 800.0, 0.02, 2.4, bandwidth).largest_sample_time();
        assert!(little(2000.0) < 0.95 * little(f64::INFINITY), "{} {}", little(2000.0), little(f64::INFINITY));
    }
}
