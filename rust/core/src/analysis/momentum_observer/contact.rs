//! Results from the residual of a momentum observer: the touched link, and the wrench at a frame.

use super::MomentumObserver;
use crate::error::{Error, Result, finite, positive};
use crate::law::touched;
use crate::linalg::{axpy, clamp_gain, dot};

/// The default `eps`, as a fraction of the largest row norm of `J'`, the transposed Jacobian of the frame. Singular values of `J'` below
/// `eps` are clamped.
const SHARE: f64 = 0.02;

impl MomentumObserver {
    /// Set the thresholds of contact, `(n,)`, > 0, N m or N. Errors: `WrongShape` for a wrong length, `Input` for a threshold that is not
    /// positive.
    pub fn set_thresholds(&mut self, thresholds: Vec<f64>) -> Result<()> {
        if thresholds.len() != self.n() {
            return Err(Error::wrong_shape("threshold", &[self.n()], &[thresholds.len()]));
        }
        thresholds.iter().try_for_each(|&threshold| positive("threshold", threshold))?;
        self.thresholds = Some(thresholds);
        Ok(())
    }

    /// The thresholds of contact, if they are set.
    pub fn thresholds(&self) -> Option<&[f64]> {
        self.thresholds.as_deref()
    }

    /// Set the thresholds from the residuals of a motion without contact, rows of `n`: the absolute value of the mean plus `sigmas`
    /// standard deviations. Errors: `WrongShape` for fewer than two rows or an incomplete row. `Input` for residuals that are not finite or
    /// do not vary, or a `sigmas` that is not positive.
    pub fn calibrate(&mut self, residuals: &[f64], sigmas: f64) -> Result<()> {
        let n = self.n();
        positive("sigmas", sigmas)?;
        finite("residuals", residuals)?;
        let rows = residuals.len() / n;
        if rows < 2 || !residuals.len().is_multiple_of(n) {
            return Err(Error::wrong("residuals", "shape", format!("(K, {n}) with K >= 2"), format!("{} numbers", residuals.len())));
        }
        let of_joint = |i: usize| residuals.iter().skip(i).step_by(n);
        let thresholds = (0..n).map(|i| {
            let mean = of_joint(i).sum::<f64>() / rows as f64;
            let square = of_joint(i).map(|r| (r - mean) * (r - mean)).sum::<f64>() / (rows - 1) as f64;
            mean.abs() + sigmas * square.sqrt()
        });
        let thresholds: Vec<f64> = thresholds.collect();
        if let Some(i) = thresholds.iter().position(|&threshold| !(threshold > 0.0)) {
            return Err(Error::input("residuals", "have no noise: expected residuals that vary, got zeros").at([0, i]));
        }
        self.set_thresholds(thresholds)
    }

    /// Compute the wrench `F = [f; m]` at a frame, rows of 6, N and N m. Also compute the remainder `r - J' F` of the residual `r`, rows of `n`.
    ///
    /// `q` has rows of `n`. Singular values of the transposed Jacobian `J'` below `eps` are clamped; `None` uses a default `eps`. Errors:
    /// `Input` for an observer of motors or before the first sample, an `eps` that is not positive, or a `q` that is not finite. `Unknown`
    /// for an unknown frame, `WrongShape` for a wrong size of `q`.
    pub fn wrench(&mut self, q: &[f64], frame: &str, eps: Option<f64>, out: &mut [f64], remainder: &mut [f64]) -> Result<()> {
        if self.motors.is_some() {
            return Err(Error::input("frame", "is of no use: expected an observer of links, got one of motors"));
        }
        let frame = self.model.tree("frame")?.frame_index(frame)?;
        let n = self.n();
        if let Some(eps) = eps {
            positive("eps", eps)?;
        }
        if self.state.residual.is_empty() {
            return Err(Error::input("q", "comes too early: expected update() or reset() before"));
        }
        self.check(&[("q", q)], Some(self.state.residual.len()))?;
        let mut jacobian = vec![0.0; 6 * n];
        for (row, q) in q.chunks_exact(n).enumerate() {
            let r = &self.state.residual[row * n..(row + 1) * n];
            self.sample.jacobian(q, frame, &mut jacobian);
            for i in 0..n {
                for k in 0..6 {
                    self.transposed[6 * i + k] = jacobian[k * n + i];
                }
            }
            self.svd.decompose(&self.transposed, n, 6)?;
            let largest = self.transposed.chunks_exact(6).map(|row| dot(row, row).sqrt()).fold(0.0, f64::max);
            let eps = eps.unwrap_or(SHARE * largest);
            let f = &mut out[6 * row..6 * (row + 1)];
            f.fill(0.0);
            // Singular values as small as rounding errors of the Jacobian do not count.
            let null = 1e-14 * largest;
            for j in 0..self.svd.s().len() {
                let sigma = self.svd.s()[j];
                if sigma > null {
                    axpy(clamp_gain(sigma, eps) * dot(self.svd.u(j), r), self.svd.v(j), f);
                }
            }
            for i in 0..n {
                remainder[row * n + i] = r[i] - dot(&self.transposed[6 * i..6 * (i + 1)], f);
            }
        }
        Ok(())
    }

    /// The joint of the touched link of each arm; `None` without contact. Errors: `Input` without thresholds.
    pub fn contacts(&self) -> Result<Vec<Option<usize>>> {
        let Some(thresholds) = &self.thresholds else {
            return Err(Error::input("threshold", "is missing: expected thresholds (n,) or calibrate() before"));
        };
        Ok(self.state.residual.chunks_exact(self.n()).map(|r| touched(&self.model, thresholds, r)).collect())
    }
}
