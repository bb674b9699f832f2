//! The quantities of the identities at one state: the largest absolute entry of `N + N'` with `N = dM/dt - 2 C`, the energy `E` and the
//! Lyapunov function `V1`. `'` is the transpose, `M` the mass matrix and `C` the Coriolis matrix of the plant. `E` is the energy stored in
//! the plant, or the law's storage function.
//!
//! `V1` contains the true inertial parameters of the plant. `dM/dt` is derived from the algorithm of `M`, independently of `C`.

use super::{Flow, Instant, Moment, Monitor, MonitorKind, Scope};
use crate::dynamics::{AnyArm, At};
use crate::law::{LawSpec, Lyapunov, Storage};
use crate::plant::{PlantSpec, PlantState, Stored};
use crate::scalar::Real;
use crate::simulate::metrics::gauge::Identities;
use crate::trace::expression::{constant, vector};
use crate::trace::{E, M, sym};
use std::sync::Arc;

/// Computes skewness, energy and Lyapunov function, which satisfy identities of the theory.
pub struct Theory<'a> {
    plant: &'a PlantSpec,
    law: &'a LawSpec,
    arm: Arc<AnyArm<E>>,
    stored: Stored,
    storage: Option<Storage<'a>>,
    lyapunov: Option<Lyapunov<'a>>,
}

impl<'a> Theory<'a> {
    /// The identities of a loop. `storage`: whether the energy is the law's storage function.
    pub fn new(plant: &'a PlantSpec, law: &'a LawSpec, storage: bool) -> Self {
        Theory {
            plant,
            law,
            arm: Arc::new(AnyArm::new(plant.model())),
            stored: Stored::new(plant),
            storage: law.storage().filter(|_| storage).map(Storage::new),
            lyapunov: law.adaptive().map(|law| Lyapunov::new(law, plant)),
        }
    }

    /// The loop at the state `x` with the desired motions `desired`, one after another.
    pub fn instant<'x>(&self, desired: &[E], x: &'x [E]) -> Instant<'x> {
        let (plant, beyond) = x.split_at(self.plant.states());
        let (z, integrals) = beyond.split_at(self.law.initial_state().len());
        let plant = PlantState::of(self.plant, plant);
        let arm = At::new(&self.arm, plant.q.as_slice());
        Instant { desired: self.law.split_samples(desired), x, plant, z: vector(z), integrals, arm }
    }

    /// The quantities of the identities at one instant.
    pub fn identities(&self, at: &Instant) -> Identities<E> {
        sym::contract(|| {
            let energy = match &self.storage {
                Some(storage) => storage.energy(&at.desired[0][0], &at.arm, &self.stored, &at.plant),
                None => self.stored.energy(&at.arm, &at.plant),
            };
            let lyapunov = self.lyapunov.as_ref().map_or(E::zero(), |lyapunov| lyapunov.value(&at.desired[0], &at.arm, &at.plant, &at.z));
            Identities { skewness: skewness(at), energy, lyapunov, quadratures: [at.integrals[0], at.integrals[1]] }
        })
    }
}

/// The largest absolute entry of `N + N'` with `N = dM/dt - 2 C`. Its sums are not fused, because they are differences of equal numbers.
fn skewness(at: &Instant) -> E {
    let (n, m) = (at.plant.v.len(), at.arm.mass_matrix());
    // The derivative of the recorded mass matrix does not use the Coriolis matrix.
    let m_dot = M::from_vec(n, n, sym::derivative(m.as_slice(), at.plant.q.as_slice(), at.plant.v.as_slice()));
    let skew = E::as_written(|| {
        let n = m_dot - at.arm.coriolis_matrix(&at.plant.v) * constant(2.0);
        &n + n.transpose()
    });
    // A maximum would ignore a sum that is NaN.
    let upper = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
    upper.map(|place| skew[place].abs()).fold(E::zero(), |worst, sum| E::select(sum.lt(worst), worst, sum))
}

/// The integrals that the balances require. The first is the integral of the law's dissipation, the rate at which its Lyapunov function
/// decreases. The second is the integral of the power supplied to the stored energy. If the monitored energy is the law's storage function
/// `E`, they are the integrals of `F.x_dot - dE/dt` and of `dE/dt`, where `F.x_dot` is the external power.
pub struct Exchange;

impl MonitorKind for Exchange {
    const NAMES: &'static [&'static str] = &[];
    const INTEGRALS: &'static [&'static str] = &["dissipated", "supplied"];

    fn rates(flow: &Flow, out: &mut [E]) {
        (out[0], out[1]) = match flow.stored {
            Some(stored) => (flow.power.outside - stored, stored),
            None => (flow.dissipated, flow.power.input + flow.power.outside),
        };
    }

    fn applies(_: &Scope) -> bool {
        false
    }

    fn build<'a>(_: &Scope<'_, 'a>) -> Option<Box<dyn Monitor + 'a>> {
        None
    }
}

/// The largest absolute entry of `N + N'`, in the unit of `M` per second.
pub struct Skewness;

impl MonitorKind for Skewness {
    const NAMES: &'static [&'static str] = &["skewness"];

    fn applies(scope: &Scope) -> bool {
        scope.plant().kind().has_speeds()
    }

    fn build<'a>(_: &Scope<'_, 'a>) -> Option<Box<dyn Monitor + 'a>> {
        Some(Box::new(Skewness))
    }
}

impl Monitor for Skewness {
    fn evaluate(&self, at: &Moment, out: &mut [E]) {
        out[0] = at.identities.skewness;
    }
}

/// The energy `E` and its balance `E(t) - E(0) - int P dt`, J.
pub struct Energy;

impl MonitorKind for Energy {
    const NAMES: &'static [&'static str] = &["energy", "energy_balance"];

    fn applies(scope: &Scope) -> bool {
        scope.plant().kind().has_speeds()
    }

    fn build<'a>(_: &Scope<'_, 'a>) -> Option<Box<dyn Monitor + 'a>> {
        Some(Box::new(Energy))
    }
}

impl Monitor for Energy {
    fn evaluate(&self, at: &Moment, out: &mut [E]) {
        let Identities { energy, quadratures: [_, put_in], .. } = at.identities;
        out[0] = energy;
        out[1] = energy - put_in - at.first[0];
    }
}

/// The passivity `int F.x_dot dt - (E(t) - E(0))` with the law's storage function `E` and the external power `F.x_dot`, J. It is never
/// negative in a passive loop.
pub struct Passivity;

impl MonitorKind for Passivity {
    const NAMES: &'static [&'static str] = &["passivity"];

    fn applies(scope: &Scope) -> bool {
        scope.monitored.storage
    }

    fn build<'a>(_: &Scope<'_, 'a>) -> Option<Box<dyn Monitor + 'a>> {
        Some(Box::new(Passivity))
    }
}

impl Monitor for Passivity {
    fn evaluate(&self, at: &Moment, out: &mut [E]) {
        let Identities { energy, quadratures: [dissipated, put_in], .. } = at.identities;
        out[0] = dissipated + put_in + at.first[0] - energy;
    }
}

/// The Lyapunov function `V1` and its balance `V1(0) - V1(t) - int D dt` with the law's dissipation `D`, J.
pub struct LyapunovBalance;

impl MonitorKind for LyapunovBalance {
    const NAMES: &'static [&'static str] = &["lyapunov", "lyapunov_balance"];

    fn applies(scope: &Scope) -> bool {
        scope.law().adaptive().is_some()
    }

    fn build<'a>(_: &Scope<'_, 'a>) -> Option<Box<dyn Monitor + 'a>> {
        Some(Box::new(LyapunovBalance))
    }
}

impl Monitor for LyapunovBalance {
    fn evaluate(&self, at: &Moment, out: &mut [E]) {
        let Identities { lyapunov, quadratures: [dissipated, _], .. } = at.identities;
        out[0] = lyapunov;
        out[1] = at.first[1] - lyapunov - dissipated;
    }
}
