//! Concurrent learning (ChowdharyJohnson2010; ParikhKamalapurkarDixon2019): the estimate also follows the errors of stored samples.
//!
//! ```text
//! pi_hat_dot = Gamma (Y' s + sum_j W_j' R e_j),   e_j = tau_j - W_j pi_hat,   V1_dot = -s' Kd s - sum_j e_j' R e_j where tau_j = W_j pi
//! W_j = Y(q_j, v_j, v_j, v_dot_j), tau_j the torque there                                      a sample with its acceleration
//! W_j = [Y_M(q, v)] + int Y_D(q, v) dt, tau_j = int tau dt, [.] the change over the window     a window of a record without accelerations
//! ```
//!
//! Here `Y` is the regressor, `s` the sliding variable, `pi_hat` the estimate of the parameters `pi`, `V1` the Lyapunov function, and `'`
//! the transpose. `Y_M` and `Y_D` are the regressors of the momentum `M v` and of the drift `g - C' v`. A control loop only requires the
//! sums `sum W_j' R W_j` and `sum W_j' R tau_j`. The torque of known rotor inertias `B` is subtracted: `tau_j - B v_dot_j` for a sample
//! with its acceleration, `tau_j - B [v]` for a window.

use super::AdaptiveSpec;
use super::adaptation::Concurrent;
use crate::error::{Error, Result, finite, positive};
use crate::interrupt;
use crate::law::sizes::require_size;
use crate::linalg::Gain;
use crate::memory;
use nalgebra::{DMatrix, DVector};

/// A record of a motion at `K` instants: positions, velocities and torques, `(K, n)` each.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, Record};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.0])?, Adaptation::Euclidean(gain(10, 2.0)?));
/// # let law = AdaptiveSpec::new(model, motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
///
/// // Two instants of a motion, with the accelerations that belong to the torques.
/// let (q, a) = ([0.0f64, 0.4], [1.0, -0.5]);
/// let tau = [0, 1].map(|k| 2.0 * a[k] + 5.0 * q[k].sin());
/// let stored = law.samples(Record { q: &q, v: &[0.0, 0.2], tau: &tau }, &a)?;
/// assert_eq!((stored.rows.len(), stored.torques.as_slice()), (2 * 10, &tau[..]));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Record<'a> {
    /// Positions, rad or m.
    pub q: &'a [f64],
    /// Velocities, rad/s or m/s.
    pub v: &'a [f64],
    /// Torques, N m or N.
    pub tau: &'a [f64],
}

/// The division of a record into windows, which are overlapping time intervals. The instants of the record are evenly spaced.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, Record, Windows};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.0])?, Adaptation::Euclidean(gain(10, 2.0)?));
/// # let law = AdaptiveSpec::new(model, motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
///
/// let t: Vec<f64> = (0..=10).map(|k| 0.05 * f64::from(k)).collect();
/// let windows = Windows::of_times(&t, 0.2, false)?;
/// assert!((windows.step - 0.05).abs() < 1e-12);
/// // Each window begins half a window, 0.1 s, after the previous one.
/// let rest = Record { q: &[0.0; 11], v: &[0.0; 11], tau: &[0.0; 11] };
/// assert_eq!(law.window_samples(rest, windows)?.torques.len(), 4);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Windows {
    /// Time between two instants, s.
    pub step: f64,
    /// Length of a window, s. It is rounded to an even number of steps, at least two.
    pub length: f64,
    /// Whether each torque is constant until the next instant, as in a sampled loop.
    pub held: bool,
}

impl Windows {
    /// Create windows for a record at the times `t`, `(K,)`, s, which must be evenly spaced. `length` is in s.
    ///
    /// Errors: `Input` for times that are not finite, not increasing or not evenly spaced, or a `length` that is not positive.
    pub fn of_times(t: &[f64], length: f64, held: bool) -> Result<Self> {
        /// Tolerance for evenly spaced times, as a fraction of a step, because the times may be rounded.
        const UNEVEN: f64 = 1e-6;
        finite("t", t)?;
        let step = if t.len() > 1 { (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64 } else { 0.0 };
        positive("window", length)?;
        if !(step > 0.0) {
            return Err(Error::input("t", format!("does not increase: expected at least two times, got {}", t.len())));
        }
        match t.windows(2).position(|pair| !((pair[1] - pair[0] - step).abs() <= UNEVEN * step)) {
            Some(k) => {
                let problem = format!("is not evenly spaced: expected steps of {step} s, got {} s", t[k + 1] - t[k]);
                Err(Error::input("t", problem).at([k]))
            }
            None => Ok(Windows { step, length, held }),
        }
    }
}

/// `N` samples for concurrent learning.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{Adaptation, AdaptiveSpec, Gain, Record, StoredRows};
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let (motion, adaptation) = (Motion::hold(vec![0.0])?, Adaptation::Euclidean(gain(10, 2.0)?));
/// # let law = AdaptiveSpec::new(model.clone(), motion, gain(1, 50.0)?, gain(1, 10.0)?, adaptation, None, None)?;
///
/// let StoredRows { rows, torques } = law.samples(Record { q: &[0.4], v: &[0.0], tau: &[3.0] }, &[1.0])?;
/// // W pi is the torque of the true parameters: 2 a + 5 sin(q).
/// let torque: f64 = rows.iter().zip(model.parameters()).map(|(w, pi)| w * pi).sum();
/// assert!((torque - (2.0 + 5.0 * 0.4f64.sin())).abs() < 1e-12 && torques == [3.0]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct StoredRows {
    /// Regressors `W` of the samples, `(N, n, p)`, row-major.
    pub rows: Vec<f64>,
    /// Torques `tau` of the samples, `(N, n)`, N m or N. For samples of [`Windows`], integrals of torques over time, N m s or N s.
    pub torques: Vec<f64>,
}

impl AdaptiveSpec {
    /// Add learning from stored samples. `weight` is the weight `R` of the torque errors of the samples, of size `n`.
    ///
    /// Errors: `WrongShape` for the size of `weight`, `Input` for samples of a wrong shape, or numbers that are not finite. `Memory` if the
    /// memory does not suffice.
    pub fn concurrent(mut self, stored: StoredRows, weight: &Gain) -> Result<Self> {
        let (n, p, StoredRows { rows, torques }) = (self.model.n(), self.estimate.len(), stored);
        require_size("concurrent_weight", weight, n)?;
        let count = torques.len() / n;
        if count == 0 || torques.len() != count * n || rows.len() != count * n * p {
            let problem = format!("has the wrong shape: expected W (N, {n}, {p}) and tau (N, {n}), N > 0, of a law with these parameters");
            return Err(Error::input("concurrent", problem));
        }
        finite("concurrent", &rows)?;
        finite("concurrent", &torques)?;
        let (mut gram, mut moment) = (memory::zeros(p * p)?, vec![0.0; p]);
        let (mut weighed, mut column) = (vec![0.0; n * p], vec![0.0; n]);
        for (w, tau) in rows.chunks_exact(n * p).zip(torques.chunks_exact(n)) {
            interrupt::check();
            for k in 0..p {
                for i in 0..n {
                    column[i] = w[i * p + k];
                }
                for (i, x) in weight.times(&column).into_iter().enumerate() {
                    weighed[i * p + k] = x;
                }
            }
            for (row, (weighed, &tau)) in w.chunks_exact(p).zip(weighed.chunks_exact(p).zip(tau)) {
                for (j, &x) in weighed.iter().enumerate() {
                    moment[j] += x * tau;
                    row.iter().zip(&mut gram[j * p..(j + 1) * p]).for_each(|(&w, sum)| *sum += x * w);
                }
            }
        }
        if let Some(k) = gram.iter().chain(&moment).position(|x| !x.is_finite()) {
            let problem = "is too large: expected finite products W' R W and W' R tau";
            return Err(Error::input("concurrent", problem).at([k]));
        }
        self.concurrent = Some(Concurrent { rows, torques, gram, moment });
        Ok(self)
    }

    /// The torque errors `e_j` of the stored samples, `(N, n)`, in the unit of their torques; `None` without stored samples.
    pub(super) fn stored_errors(&self, estimate: &[f64]) -> Option<Vec<f64>> {
        let Concurrent { rows, torques, .. } = self.concurrent.as_ref()?;
        let p = self.estimate.len();
        let error = |(row, &tau): (&[f64], &f64)| row.iter().zip(estimate).fold(tau, |left, (w, a)| left - w * a);
        Some(rows.chunks_exact(p).zip(torques).map(error).collect())
    }

    /// Compute one sample per instant of a record. `a`, `(K, n)`, has the accelerations at these instants, rad/s^2 or m/s^2. Errors:
    /// `Memory` if the memory does not suffice.
    pub fn samples(&self, record: Record, a: &[f64]) -> Result<StoredRows> {
        let ((n, p), armature) = (self.parameter_sizes(), self.known_rotors());
        let count = record.q.len() / n;
        let mut rows = memory::zeros(count * n * p)?;
        let mut arm = self.model.at(&vec![0.0; n]);
        for (k, w) in rows.chunks_exact_mut(n * p).enumerate() {
            interrupt::check();
            let at = k * n..(k + 1) * n;
            let [v, a] = [&record.v[at.clone()], &a[at.clone()]].map(DVector::from_column_slice);
            arm.move_to(&record.q[at]);
            add_to(w, &self.plain_regressor(&arm, &v, &a), 1.0);
        }
        let torques = record.tau.iter().zip(a).enumerate().map(|(k, (tau, a))| tau - armature[k % n] * a);
        Ok(StoredRows { rows, torques: memory::collected(torques)? })
    }

    /// Compute one sample per window of a record, without accelerations. Each window starts half a window after the previous one.
    ///
    /// Errors: `Input` for a window that is longer than the record, or a length or step that is not positive. `Memory` if the memory does
    /// not suffice.
    pub fn window_samples(&self, record: Record, windows: Windows) -> Result<StoredRows> {
        let (n, p) = (self.model.n(), self.estimate.len());
        positive("window", windows.length)?;
        positive("t", windows.step)?;
        let records = record.q.len() / n;
        let halves = (0.5 * windows.length / windows.step).round().max(1.0);
        if 2.0 * halves + 1.0 > records as f64 {
            let longest = windows.step * (records.saturating_sub(1)) as f64;
            let problem = format!("is longer than the record: expected at most {longest} s, got {} s", windows.length);
            return Err(Error::input("window", problem));
        }
        let half = halves as usize;
        let count = (records - 1 - half) / half;
        let mut stored = StoredRows { rows: memory::zeros(count * n * p)?, torques: memory::zeros(count * n)? };
        let armature = self.known_rotors();
        let mut arm = self.model.at(&vec![0.0; n]);
        let parts = stored.rows.chunks_exact_mut(n * p).zip(stored.torques.chunks_exact_mut(n));
        for (window, (w, torque)) in parts.enumerate() {
            interrupt::check();
            let (first, last) = (window * half, (window + 2) * half);
            for k in first..=last {
                let at = k * n..(k + 1) * n;
                let (v, tau) = (DVector::from_column_slice(&record.v[at.clone()]), &record.tau[at.clone()]);
                arm.move_to(&record.q[at]);
                let speeds = self.columns.speeds();
                let end = if k == first { -1.0 } else { f64::from(u8::from(k == last)) };
                // Simpson's rule integrates `Y_D` and a measured torque. The left rectangle rule integrates a torque that is constant
                // between instants.
                let part = if k == first || k == last { 1.0 } else { 2.0 + 2.0 * ((k - first) % 2) as f64 };
                let (weight, held) = (part * windows.step / 3.0, if k == last { 0.0 } else { windows.step });
                if end != 0.0 {
                    add_to(w, &self.momentum_regressor(&arm, &v, speeds), end);
                }
                add_to(w, &self.drift_regressor(&arm, &v, speeds), weight);
                for i in 0..n {
                    torque[i] += if windows.held { held } else { weight } * tau[i] - end * armature[i] * v[i];
                }
            }
        }
        Ok(stored)
    }
}

/// Add `weight y` to a matrix in row-major order.
fn add_to(rows: &mut [f64], y: &DMatrix<f64>, weight: f64) {
    let p = y.ncols();
    rows.iter_mut().enumerate().for_each(|(at, x)| *x += weight * y[(at / p, at % p)]);
}
