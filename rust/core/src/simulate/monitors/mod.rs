//! Monitors: identities of the theory, evaluated at the records of a run.
//!
//! ```text
//! V1 = s' M s / 2 + (a - a_hat)' Gamma^-1 (a - a_hat) / 2
//! V1(0) - V1(t) - int D dt = 0,  D = s' Kd s without further options
//! dM/dt - 2 C is skew
//! E(t) - E(0) - int P dt = 0
//! ```
//!
//! `'` is the transpose, `M` the mass matrix, `C` the Coriolis matrix, and `s` the sliding variable with the gain `Kd`. `E` is the energy
//! stored in the plant, or the law's storage function. `P` is the power supplied to it. `V1` is the Lyapunov function of an adaptive law
//! with the adaptation gain `Gamma`. `D` is the law's dissipation, the rate at which `V1` decreases. `a` are the inertial parameters and
//! `a_hat` their estimates.
//!
//! For a rigid arm with Cartesian impedance, a monitor checks its target model. For a law of elastic joints with an outer loop, a monitor
//! is `max |tau_J - u|`. Here `tau_J` are the torques of the springs, and `u` is the command of the outer loop. A law with a storage
//! function also has the passivity at its port, `int F.x_dot dt - (E(t) - E(0))` with the external power `F.x_dot`. It is never negative in
//! a passive loop. A law with task priorities has two norms per level: of its task error, and of its residual.
//!
//! [`Checks`] computes the monitors on plain numbers or on recorded values, so that programs (recorded and compiled loops) can compute them
//! within a step.

pub mod identities;
mod kind;
mod level_norms;
mod projection_loss;
mod static_torque;
mod target_model;
mod torque_error;

pub use kind::{Flow, Moment, Monitor, MonitorKind, Monitored, Scope};

use super::problem::Problem;
use crate::law::ProjectionLoss;
use crate::trace::Sym;
use identities::Theory;
use level_norms::LevelNorms;
use std::ops::Range;

/// The monitors of a run, each with the number of its series and the places of its integrals.
type Series = Vec<(usize, Range<usize>, Box<dyn Monitor + Send>)>;

/// Lists the kinds of monitors, in the order of their series.
macro_rules! monitors {
    ($($kind:ty,)*) => {
        /// The names of the series of a run, without the norms of priority levels.
        fn series(scope: &Scope) -> Vec<&'static str> {
            let mut all = Vec::new();
            $(if <$kind>::applies(scope) {
                all.extend(<$kind>::NAMES);
            })*
            all
        }

        /// Create the monitors of a run.
        fn build(scope: &Scope) -> Series {
            let (mut all, mut end) = (Vec::new(), 0);
            $(end += <$kind>::INTEGRALS.len();
            if <$kind>::applies(scope) {
                let integrals = end - <$kind>::INTEGRALS.len()..end;
                all.extend(<$kind>::build(scope).map(|monitor| (<$kind>::NAMES.len(), integrals, monitor)));
            })*
            all
        }

        /// The integrals of all monitors, which are the last states of a monitored loop.
        const INTEGRALS: &[&[&str]] = &[$(<$kind>::INTEGRALS),*];

        /// The rates of the integrals of all monitors.
        pub fn rates(flow: &Flow, out: &mut [Sym]) {
            $(let (own, out) = out.split_at_mut(<$kind>::INTEGRALS.len());
            <$kind>::rates(flow, own);)*
            debug_assert!(out.is_empty(), "the loop has a state for each integral");
        }
    };
}

monitors! {
    identities::Exchange,
    identities::Skewness,
    identities::Energy,
    torque_error::InnerLoop,
    identities::Passivity,
    target_model::Target,
    projection_loss::Loss,
    identities::LyapunovBalance,
}

/// Return the names of the integrals in the state of a loop with monitors, or without.
pub fn integrals(monitored: bool) -> impl Iterator<Item = &'static str> {
    let all = if monitored { INTEGRALS } else { &[] };
    all.iter().copied().flatten().copied()
}

/// Return the names of the monitors of a problem's loops, in the order of [`Monitors::evaluate`].
pub fn names(problem: &Problem) -> Vec<&'static str> {
    if !problem.options.monitors {
        return Vec::new();
    }
    let scope = Scope { problem, run: 0, monitored: Monitored::of(problem) };
    let mut all = series(&scope);
    all.extend(level_norms::names(scope.law()));
    all
}

/// The monitors of one run.
pub struct Checks {
    theory: Theory,
    monitors: Series,
    levels: Option<LevelNorms>,
    loss: Option<ProjectionLoss>,
    /// The number of plant states that a law reads.
    states: usize,
    /// The number of bristles, which follow these states.
    bristles: usize,
    /// The number of states of the law.
    p: usize,
    /// The number of norms of priority levels.
    norms: usize,
}

impl Checks {
    /// Create the monitors of a run.
    pub fn new(scope: &Scope) -> Self {
        let (plant, law) = (scope.plant(), scope.law());
        let levels = LevelNorms::of(law);
        Checks {
            theory: Theory::new(plant, law, scope.monitored.storage),
            monitors: build(scope),
            norms: if levels.is_some() { level_norms::names(law).len() } else { 0 },
            levels,
            loss: if scope.monitored.loss { ProjectionLoss::new(law) } else { None },
            states: plant.seen(),
            bristles: plant.bristles(),
            p: law.initial_state().len(),
        }
    }

    /// The number of monitors that are norms of priority levels.
    pub fn norms(&self) -> usize {
        self.norms
    }

    /// Compute the monitors at state `x = [plant, z, integrals]` and input `tau`, and write them to `out`. The function `first` receives
    /// `E - int P dt` and `V1 + int D dt` at this record, and returns their values at the first record.
    pub fn evaluate(
        &mut self,
        (desired, wrench): (&[Sym], &[Sym; 6]),
        (x, tau): (&[Sym], &[Sym]),
        first: impl FnOnce([Sym; 2]) -> [Sym; 2],
        out: &mut [Sym],
    ) {
        let (mut out, norms) = out.split_at_mut(out.len() - self.norms);
        let arm = &mut self.theory.arm;
        arm.move_to(&x[..arm.trig().len()]);
        if let Some(levels) = &mut self.levels {
            levels.evaluate(desired, arm.trig(), &x[..self.states], norms);
        }
        if self.monitors.is_empty() {
            return;
        }
        let identities = self.theory.identities(desired, x);
        let [dissipated, put_in] = identities.quadratures;
        let first = first([identities.energy - put_in, identities.lyapunov + dissipated]);
        let loss = self.loss.as_mut().map(|loss| loss.evaluate(&x[..tau.len()]));
        let (x, rest) = x.split_at(self.states);
        let (z, all) = rest[self.bristles..].split_at(self.p);
        let mut at = Moment { desired, wrench, x, z, tau, arm: &mut self.theory.arm, identities, first, loss, integrals: &[] };
        for (series, integrals, monitor) in &mut self.monitors {
            at.integrals = &all[integrals.clone()];
            let (own, rest) = out.split_at_mut(*series);
            monitor.evaluate(&mut at, own);
            out = rest;
        }
    }
}
