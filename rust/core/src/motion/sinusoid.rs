//! A sum of sinusoids per joint: `q_d,i = offset_i + sum_k amplitude_ik sin(frequency_ik t + phase_ik)`.

use super::polynomial::constant;
use super::rows::put;
use crate::error::{Error, Result, finite};
use crate::scalar::{GenericKernel, Real, run_lanes};

/// A sum of sinusoids per joint.
///
/// ```
/// use armlet_core::motion::{Motion, Sinusoid};
/// use nalgebra::dvector;
///
/// // One term per joint: 1 + 0.5 sin 2 t, and 0.2 sin 3 t.
/// let motion = Motion::from(Sinusoid::new(vec![1.0, 0.0], 1, vec![0.5, 0.2], vec![2.0, 3.0], vec![0.0; 2])?);
/// assert_eq!(motion.at(0.0).q, dvector![1.0, 0.0]);
/// assert!((motion.at(0.0).v - dvector![1.0, 0.6]).norm() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Sinusoid {
    offset: Vec<f64>,
    /// Number of terms per joint.
    terms: usize,
    /// Amplitudes, and the frequencies and phases in the next two fields, `(n, terms)` each, row-major.
    amplitude: Vec<f64>,
    frequency: Vec<f64>,
    phase: Vec<f64>,
}

impl Sinusoid {
    /// Create a motion. `offset` is `(n,)`. `amplitude`, `frequency` (rad/s) and `phase` (rad) are `(n, terms)`, row-major. `offset` and
    /// `amplitude` are in rad or m.
    ///
    /// Errors: `Input` for an empty `offset` or numbers that are not finite, `WrongShape` for a wrong length.
    pub fn new(offset: Vec<f64>, terms: usize, amplitude: Vec<f64>, frequency: Vec<f64>, phase: Vec<f64>) -> Result<Self> {
        finite("offset", &offset)?;
        if offset.is_empty() {
            return Err(Error::input("offset", "is empty: expected at least one joint, got 0"));
        }
        for (name, values) in [("amplitude", &amplitude), ("frequency", &frequency), ("phase", &phase)] {
            finite(name, values)?;
            if values.len() != offset.len() * terms {
                return Err(Error::wrong(name, "size", offset.len() * terms, values.len()));
            }
        }
        Ok(Sinusoid { offset, terms, amplitude, frequency, phase })
    }

    /// Number of joints `n`.
    pub fn dof(&self) -> usize {
        self.offset.len()
    }

    /// Number of terms of all joints.
    pub(crate) fn terms(&self) -> usize {
        self.amplitude.len()
    }

    /// Write the position and its derivatives at time `t`, s, to `out`, as [`put`] does.
    #[inline(never)]
    pub(crate) fn evaluate<S: Real, const K: usize, const FROM: usize>(&self, t: S, out: &mut [S]) {
        let n = self.dof();
        (0..n).for_each(|i| put::<_, K, FROM>(n, out, i, self.joint(i, t)));
    }

    /// Position of joint `i` and its derivatives at time `t`: the derivatives of `sin` are `cos`, `-sin`, `-cos` and `sin`.
    #[inline(always)]
    fn joint<S: Real, const K: usize>(&self, i: usize, t: S) -> [S; K] {
        let mut sums = constant(S::splat(self.offset[i]));
        for k in i * self.terms..(i + 1) * self.terms {
            let (w, mut size) = (self.frequency[k], self.amplitude[k]);
            let (sin, cos) = (S::splat(w) * t + S::splat(self.phase[k])).sin_cos();
            for (order, sum) in sums.iter_mut().enumerate() {
                let wave = if order % 2 == 0 { sin } else { cos };
                *sum = if order % 4 < 2 { S::splat(size).mul_add(wave, *sum) } else { S::splat(size).neg_mul_add(wave, *sum) };
                size *= w;
            }
        }
        sums
    }

    /// Sample the motion as in [`super::Motion::sample_each`], with the bits of [`Self::evaluate`].
    pub(super) fn sample_each(&self, times: &[f64], stride: usize, out: &mut [f64]) {
        run_lanes(Samples { motion: self, times, stride, out });
    }
}

/// Samples of a motion, at one instant per lane.
struct Samples<'a> {
    motion: &'a Sinusoid,
    times: &'a [f64],
    stride: usize,
    out: &'a mut [f64],
}

impl GenericKernel for Samples<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Real>(self) {
        let Samples { motion, times, stride, out } = self;
        let n = motion.dof();
        for (times, rows) in times.chunks(S::LANES).zip(out.chunks_mut(S::LANES * stride)) {
            let t = S::from_lanes(|lane| times[lane.min(times.len() - 1)]);
            for i in 0..n {
                let [q, v, a] = motion.joint(i, t);
                for (lane, row) in rows.chunks_mut(stride).take(times.len()).enumerate() {
                    (row[i], row[n + i], row[2 * n + i]) = (q.lane(lane), v.lane(lane), a.lane(lane));
                }
            }
        }
    }
}
