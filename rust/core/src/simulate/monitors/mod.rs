//! Monitors: identities of the theory, evaluated at the records of a run.
//!
//! ```text
//! V1 = s' M s / 2 + (pi - pi_hat)' Gamma^-1 (pi - pi_hat) / 2
//! V1(0) - V1(t) - int D dt = 0,  D = s' Kd s without further options
//! dM/dt - 2 C is skew
//! E(t) - E(0) - int P dt = 0
//! ```
//!
//! `'` is the transpose, `M` the mass matrix, `C` the Coriolis matrix, and `s` the sliding variable with the gain `Kd`. `E` is the energy
//! stored in the plant, or the law's storage function. `P` is the power supplied to it. `V1` is the Lyapunov function of an adaptive law
//! with the adaptation gain `Gamma`. `D` is the law's dissipation, the rate at which `V1` decreases. `pi` are the inertial parameters and
//! `pi_hat` their estimates.
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

pub use kind::{Flow, Instant, Moment, Monitor, MonitorKind, Monitored, Scope};

use super::problem::Problem;
use crate::law::{LawSpec, ProjectionLoss, RecordedLaw};
use crate::trace::expression::{vector, zeros};
use crate::trace::{E, sym};
use identities::Theory;

/// The monitors of a run, each with the number of its series.
type Series<'a> = Vec<(usize, Box<dyn Monitor + 'a>)>;

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
        fn build<'a>(scope: &Scope<'_, 'a>) -> Series<'a> {
            let mut all = Vec::new();
            $(if <$kind>::applies(scope) {
                all.extend(<$kind>::build(scope).map(|monitor| (<$kind>::NAMES.len(), monitor)));
            })*
            all
        }

        /// The integrals of all monitors, which are the last states of a monitored loop.
        const INTEGRALS: &[&[&str]] = &[$(<$kind>::INTEGRALS),*];

        /// The rates of the integrals of all monitors.
        pub fn rates(flow: &Flow, out: &mut [E]) {
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
pub struct Checks<'a> {
    theory: Theory<'a>,
    law: &'a LawSpec,
    /// The law, if a monitor needs its terms.
    terms: Option<RecordedLaw<'a>>,
    monitors: Series<'a>,
    loss: Option<ProjectionLoss<'a>>,
    /// The number of plant states that a law reads.
    seen: usize,
    /// The number of norms of priority levels.
    norms: usize,
}

impl<'a> Checks<'a> {
    /// Create the monitors of a run.
    pub fn new(scope: &Scope<'_, 'a>) -> Self {
        let (plant, law) = (scope.plant(), scope.law());
        let norms = level_norms::names(law).len();
        let period = scope.problem.options.sampling.as_ref().map(|sampling| sampling.period).filter(|_| law.samples());
        let needs_terms = norms > 0 || torque_error::InnerLoop::applies(scope);
        Checks {
            theory: Theory::new(plant, law, scope.monitored.storage),
            law,
            terms: needs_terms.then(|| RecordedLaw::new(law, period, zeros(0))),
            monitors: build(scope),
            loss: law.projecting().filter(|_| scope.monitored.loss).map(ProjectionLoss::new),
            seen: plant.seen(),
            norms,
        }
    }

    /// The number of monitors that are norms of priority levels.
    pub fn norms(&self) -> usize {
        self.norms
    }

    /// Compute the monitors at state `x = [plant, z, integrals]` and input `tau`, and write them to `out`. The function `first` receives
    /// `E - int P dt` and `V1 + int D dt` at this record, and returns their values at the first record.
    pub fn evaluate(
        &self,
        (desired, wrench): (&[E], &[E; 6]),
        (x, tau): (&[E], &[E]),
        first: impl FnOnce([E; 2]) -> [E; 2],
        out: &mut [E],
    ) {
        let (mut out, norms) = out.split_at_mut(out.len() - self.norms);
        let at = self.theory.instant(desired, x);
        let terms = self.terms.as_ref().map(|law| law.terms(desired, &x[..self.seen], at.z.as_slice()));
        if let Some(terms) = terms.as_ref().filter(|_| self.norms > 0) {
            norms.iter_mut().zip(level_norms::norms(self.law, terms)).for_each(|(to, norm)| *to = norm);
        }
        if self.monitors.is_empty() {
            return;
        }
        let identities = self.theory.identities(&at);
        let [dissipated, put_in] = identities.quadratures;
        let first = first([identities.energy - put_in, identities.lyapunov + dissipated]);
        let loss = self.loss.as_ref().map(|loss| sym::contract(|| loss.evaluate(&at.plant.q)));
        let moment = Moment { at: &at, wrench, tau: &vector(tau), identities, first, loss, terms: terms.as_ref() };
        for (series, monitor) in &self.monitors {
            let (own, others) = out.split_at_mut(*series);
            sym::contract(|| monitor.evaluate(&moment, own));
            out = others;
        }
    }
}
