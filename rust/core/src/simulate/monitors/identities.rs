//! The quantities of the identities at one state: the largest absolute entry of `N + N'` with `N = dM/dt - 2 C`, the energy `E` and the
//! Lyapunov function `V1`. `'` is the transpose, `M` the mass matrix and `C` the Coriolis matrix of the plant. `E` is the energy stored in
//! the plant, or the law's storage function.
//!
//! `V1` contains the true inertial parameters of the plant. `dM/dt` is derived from the algorithm of `M`, independently of `C`.

use super::{Flow, Moment, Monitor, MonitorKind, Scope};
use crate::dynamics::ArmAt;
use crate::law::{LawSpec, Lyapunov, Storage};
use crate::plant::{PlantSpec, Stored};
use crate::scalar::Real;
use crate::simulate::metrics::gauge::Identities;
use crate::trace::{Sym, sym};

/// Computes skewness, energy and Lyapunov function, which satisfy identities of the theory.
pub struct Theory {
    states: usize,
    /// Size of the law's state.
    p: usize,
    pub arm: ArmAt<Sym>,
    /// `dM/dt`, shape `(n, n)`.
    mass: Vec<Sym>,
    /// `C`, shape `(n, n)`.
    coriolis: Vec<Sym>,
    stored: Stored,
    storage: Option<Storage>,
    lyapunov: Option<Lyapunov>,
}

impl Theory {
    /// Create the computation for a plant and a law. If `storage` is true, the energy is the law's storage function.
    pub fn new(plant: &PlantSpec, law: &LawSpec, storage: bool) -> Self {
        let n = plant.n();
        Theory {
            states: plant.states(),
            p: law.initial_state().len(),
            arm: ArmAt::new(plant.model()),
            mass: vec![Sym::zero(); n * n],
            coriolis: vec![Sym::zero(); n * n],
            stored: Stored::new(plant),
            storage: if storage { Storage::new(law) } else { None },
            lyapunov: Lyapunov::new(law, plant),
        }
    }

    /// Compute skewness, energy and Lyapunov function at state `x = [plant, z, integrals]`, whose first integrals are the integrals of
    /// [`Exchange`]. The arm must already be at the position `q` of `x`.
    pub fn identities(&mut self, desired: &[Sym], x: &[Sym]) -> Identities<Sym> {
        let n = self.arm.trig().len();
        let (plant, rest) = x.split_at(self.states);
        let (z, quadratures) = rest.split_at(self.p);
        let (q, v) = (&plant[..n], &plant[n..2 * n]);
        let energy = match &mut self.storage {
            Some(storage) => storage.energy(desired, &mut self.arm, &self.stored, plant),
            None => self.stored.energy(&mut self.arm, plant),
        };
        let lyapunov = match &mut self.lyapunov {
            Some(lyapunov) => lyapunov.value(desired, &mut self.arm, q, v, z),
            None => Sym::zero(),
        };
        Identities { skewness: self.skewness(q, v), energy, lyapunov, quadratures: [quadratures[0], quadratures[1]] }
    }

    /// Return the largest absolute entry of `N + N'`.
    fn skewness(&mut self, q: &[Sym], v: &[Sym]) -> Sym {
        let n = v.len();
        self.arm.mass_matrix(&mut self.mass);
        // The derivative of the recorded mass matrix does not use the Coriolis matrix.
        let rate = sym::derivative(&self.mass, q, v);
        self.arm.coriolis_matrix(v, &mut self.coriolis);
        let entry = |i: usize, j: usize| Sym::splat(2.0).neg_mul_add(self.coriolis[n * i + j], rate[n * i + j]);
        let mut worst = Sym::zero();
        for i in 0..n {
            for j in i..n {
                let sum = (entry(i, j) + entry(j, i)).abs();
                // A maximum would ignore a sum that is NaN.
                worst = Sym::select(sum.lt(worst), worst, sum);
            }
        }
        worst
    }
}

/// The integrals that the balances require. The first is the integral of the law's dissipation, the rate at which its Lyapunov function
/// decreases. The second is the integral of the power supplied to the stored energy. If the monitored energy is the law's storage function
/// `E`, they are the integrals of `F.x_dot - dE/dt` and of `dE/dt`, where `F.x_dot` is the external power.
pub struct Exchange;

impl MonitorKind for Exchange {
    const NAMES: &'static [&'static str] = &[];
    const INTEGRALS: &'static [&'static str] = &["dissipated", "supplied"];

    fn rates(flow: &Flow, out: &mut [Sym]) {
        (out[0], out[1]) = match flow.stored {
            Some(stored) => (flow.power.outside - stored, stored),
            None => (flow.dissipated, flow.power.input + flow.power.outside),
        };
    }

    fn applies(_: &Scope) -> bool {
        false
    }

    fn build(_: &Scope) -> Option<Box<dyn Monitor + Send>> {
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

    fn build(_: &Scope) -> Option<Box<dyn Monitor + Send>> {
        Some(Box::new(Skewness))
    }
}

impl Monitor for Skewness {
    fn evaluate(&mut self, at: &mut Moment, out: &mut [Sym]) {
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

    fn build(_: &Scope) -> Option<Box<dyn Monitor + Send>> {
        Some(Box::new(Energy))
    }
}

impl Monitor for Energy {
    fn evaluate(&mut self, at: &mut Moment, out: &mut [Sym]) {
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

    fn build(_: &Scope) -> Option<Box<dyn Monitor + Send>> {
        Some(Box::new(Passivity))
    }
}

impl Monitor for Passivity {
    fn evaluate(&mut self, at: &mut Moment, out: &mut [Sym]) {
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

    fn build(_: &Scope) -> Option<Box<dyn Monitor + Send>> {
        Some(Box::new(LyapunovBalance))
    }
}

impl Monitor for LyapunovBalance {
    fn evaluate(&mut self, at: &mut Moment, out: &mut [Sym]) {
        let Identities { lyapunov, quadratures: [dissipated, _], .. } = at.identities;
        out[0] = lyapunov;
        out[1] = at.first[1] - lyapunov - dissipated;
    }
}
