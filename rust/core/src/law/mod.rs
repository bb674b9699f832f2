//! Control laws: from the desired motion and the measured state to the plant's input.

mod adaptive;
mod computed_torque;
pub mod gain;

pub use adaptive::{Adaptive, AdaptiveSpec, adaptive_terms};
pub use computed_torque::{ComputedTorque, ComputedTorqueSpec, computed_torque_terms};
pub use gain::Gain;

use crate::dynamics::PlanarPr;
use crate::error::{Error, Result};
use crate::motion::Motion;
use crate::scalar::Real;

/// A law in a loop: its input to the plant and its own rate, from one evaluation.
pub trait Law<S: Real> {
    /// `tau` `(n,)` and the rate `dz` `(p,)` of the law's state `z`, from the desired `[q_d, v_d, a_d]`, the
    /// (sin, cos) of the joints and the plant's state `x = [q, v]`.
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]);

    /// The rate at which the law's Lyapunov function falls, as of the last evaluation; zero without one.
    fn dissipation(&self) -> S;
}

/// A law as the user states it, validated; loops make their own [`Law`] from it.
#[derive(Clone, Debug, PartialEq)]
pub enum LawSpec {
    Adaptive(AdaptiveSpec),
    ComputedTorque(ComputedTorqueSpec),
}

impl LawSpec {
    pub fn name(&self) -> &'static str {
        match self {
            LawSpec::Adaptive(_) => "Adaptive",
            LawSpec::ComputedTorque(_) => "ComputedTorque",
        }
    }

    /// The arm the law was made for.
    pub fn arm(&self) -> &PlanarPr<f64> {
        match self {
            LawSpec::Adaptive(law) => &law.arm,
            LawSpec::ComputedTorque(law) => &law.arm,
        }
    }

    pub fn motion(&self) -> &Motion {
        match self {
            LawSpec::Adaptive(law) => &law.motion,
            LawSpec::ComputedTorque(law) => &law.motion,
        }
    }

    /// The law's state at the start of a run, `(p,)`; empty for a law without one.
    pub fn initial_state(&self) -> &[f64] {
        match self {
            LawSpec::Adaptive(law) => &law.estimate,
            LawSpec::ComputedTorque(_) => &[],
        }
    }

    /// The plant's input `(n,)` at time `t`.
    pub fn input(&self, t: f64, q: &[f64], v: &[f64], z: &[f64], tau: &mut [f64]) {
        match self {
            LawSpec::Adaptive(law) => law.input(t, q, v, z, tau),
            LawSpec::ComputedTorque(law) => law.input(t, q, v, tau),
        }
    }

    /// The named parts of the law at time `t`: name, shape, values.
    pub fn terms(&self, t: f64, q: &[f64], v: &[f64], z: &[f64]) -> Vec<Term> {
        match self {
            LawSpec::Adaptive(law) => adaptive_terms(law, t, q, v, z),
            LawSpec::ComputedTorque(law) => computed_torque_terms(law, t, q, v),
        }
    }
}

/// A named part of a law: its values, row-major, in its shape.
pub type Term = (&'static str, Vec<usize>, Vec<f64>);

fn require_same_dof(n: usize, motion: &Motion) -> Result<()> {
    if motion.dof() == n {
        return Ok(());
    }
    Err(Error::input("motion", format!("has the wrong number of joints: expected {n}, got {}", motion.dof())))
}

fn require_size(argument: &str, gain: &Gain, n: usize) -> Result<()> {
    if gain.n() == n {
        return Ok(());
    }
    Err(Error::input(argument, format!("has the wrong size: expected {n}, got {}", gain.n())))
}
