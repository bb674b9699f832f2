//! Desired motions `t -> (q_d, v_d, a_d)`. Each holds its end, and its start before time zero.

mod bang_bang;
mod path;
mod quintic;
mod sinusoid;
mod table;
mod timed_path;

pub use bang_bang::BangBang;
pub use path::{Ends, Path, TERMS};
pub use quintic::Quintic;
pub use sinusoid::Sinusoid;
pub use table::Table;
pub use timed_path::TimedPath;

use crate::error::{Error, Result, finite};
use crate::scalar::{Kernel, Real};

/// A desired motion of `n` joints. An enum, so that loops are composed without a virtual call or a copy of
/// their code per motion.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// `q_d` constant.
    Hold(Vec<f64>),
    Sinusoid(Sinusoid),
    Quintic(Quintic),
    BangBang(BangBang),
    Table(Table),
    TimedPath(TimedPath),
}

impl Motion {
    pub fn hold(q: Vec<f64>) -> Result<Self> {
        finite("q", &q)?;
        if q.is_empty() {
            return Err(Error::input("q", "is empty: expected at least one joint, got 0"));
        }
        Ok(Motion::Hold(q))
    }

    /// Number of joints `n`.
    pub fn dof(&self) -> usize {
        match self {
            Motion::Hold(q) => q.len(),
            Motion::Sinusoid(m) => m.dof(),
            Motion::Quintic(m) => m.dof(),
            Motion::BangBang(m) => m.dof(),
            Motion::Table(m) => m.dof(),
            Motion::TimedPath(m) => m.dof(),
        }
    }

    /// `[q_d, v_d, a_d]` at time `t` into `out`, `(3 n,)`.
    #[inline(always)]
    pub fn sample<S: Real>(&self, t: f64, out: &mut [S]) {
        match self {
            Motion::Hold(q) => {
                let n = q.len();
                for i in 0..n {
                    out[i] = S::splat(q[i]);
                    out[n + i] = S::zero();
                    out[2 * n + i] = S::zero();
                }
            }
            Motion::Sinusoid(m) => m.sample(t, out),
            Motion::Quintic(m) => m.sample(t, out),
            Motion::BangBang(m) => m.sample(t, out),
            Motion::Table(m) => m.sample(t, out),
            Motion::TimedPath(m) => m.sample(t, out),
        }
    }

    /// Times at which a derivative of the motion jumps, increasing: integrators restart there.
    pub fn breaks(&self) -> Vec<f64> {
        match self {
            Motion::Hold(_) | Motion::Sinusoid(_) | Motion::Table(_) => Vec::new(),
            Motion::Quintic(m) => vec![0.0, m.duration()],
            Motion::BangBang(m) => vec![0.0, 0.5 * m.duration(), m.duration()],
            Motion::TimedPath(m) => m.breaks(),
        }
    }
}

/// Sampling in a function of its own, compiled for the instruction set of `S`: the code of all motions stands
/// once per number, not at every stage of every loop.
#[inline(never)]
pub fn sample_apart<S: Real>(motion: &Motion, t: f64, out: &mut [S]) {
    struct Sample<'a, S>(&'a Motion, f64, &'a mut [S]);
    impl<S: Real> Kernel for Sample<'_, S> {
        type Output = ();
        #[inline(always)]
        fn run(self) {
            self.0.sample(self.1, self.2);
        }
    }
    S::enter(Sample(motion, t, out));
}

/// `[x_d, x_d', x_d'']` of each motion at time `t`, one after another, as laws read them.
pub fn sample_all<'a, S: Real>(motions: impl IntoIterator<Item = &'a Motion>, t: f64, out: &mut [S]) {
    let mut at = 0;
    for motion in motions {
        let width = 3 * motion.dof();
        sample_apart(motion, t, &mut out[at..at + width]);
        at += width;
    }
}

/// Start, end and duration of a rest-to-rest motion.
fn require_rest_to_rest(q0: &[f64], q1: &[f64], duration: f64) -> Result<()> {
    finite("q0", q0)?;
    finite("q1", q1)?;
    if q0.is_empty() {
        return Err(Error::input("q0", "is empty: expected at least one joint, got 0"));
    }
    if q0.len() != q1.len() {
        return Err(Error::input("q1", format!("has the wrong shape: expected ({},), got ({},)", q0.len(), q1.len())));
    }
    crate::error::positive("duration", duration)
}

/// `q = q0 + (q1 - q0) s`, and the derivatives, for a path coordinate `s(t)` with its two derivatives.
#[inline(always)]
fn straight<S: Real>(q0: &[f64], q1: &[f64], [s, ds, dds]: [f64; 3], out: &mut [S]) {
    let n = q0.len();
    for i in 0..n {
        let d = q1[i] - q0[i];
        out[i] = S::splat(if s == 1.0 { q1[i] } else { q0[i] + d * s });
        out[n + i] = S::splat(d * ds);
        out[2 * n + i] = S::splat(d * dds);
    }
}

#[cfg(test)]
mod tests;
