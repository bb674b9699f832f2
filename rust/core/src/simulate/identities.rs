//! The quantities that theory makes promises about, at one state: `N + N'` with `N = dM/dt - 2 C`, the energy `E` stored in the plant or
//! in the law's own storage function, and the Lyapunov function `V1`.
//!
//! `M`, `a` and `E` are those of the true plant; `dM/dt` comes from dual numbers, so that it does not share its formula with `C`.

use super::elastic_monitor::TorqueError;
use super::gauge::Identities;
use crate::dynamics::ArmAt;
use crate::law::{LawSpec, Lyapunov, Storage};
use crate::plant::{PlantSpec, Stored};
use crate::scalar::{Dual, Real};

/// What the identities of runs need, of one run or of several side by side.
pub struct Theory<S: Real> {
    states: usize,
    pub arm: ArmAt<S>,
    /// The same arm as it moves.
    moving: ArmAt<Dual<S>>,
    moving_q: Vec<Dual<S>>,
    moving_m: Vec<Dual<S>>,
    coriolis: Vec<S>,
    stored: Stored<S>,
    storage: Option<Storage<S>>,
    lyapunov: Option<Lyapunov<S>>,
}

impl<S: Real> Theory<S> {
    /// For the plants and laws of the lanes, of one shape each; `storage`: the energy watched is the law's own.
    pub fn new<'a>(plant: impl Fn(usize) -> &'a PlantSpec, law: impl Fn(usize) -> &'a LawSpec, storage: bool) -> Self {
        let n = plant(0).n();
        Theory {
            states: plant(0).states(),
            arm: ArmAt::of_lanes(|lane| plant(lane).model()),
            moving: ArmAt::of_lanes(|lane| plant(lane).model()),
            moving_q: vec![Dual::default(); n],
            moving_m: vec![Dual::default(); n * n],
            coriolis: vec![S::zero(); n * n],
            stored: Stored::new(&plant),
            storage: if storage { Storage::new(&law) } else { None },
            lyapunov: Lyapunov::new(&law, &plant),
        }
    }

    /// Whether velocities are among the plant's states.
    pub fn has_velocities(&self) -> bool {
        self.states > self.moving_q.len()
    }

    /// At state `x = [plant, z, int s' Kd s, int P]`, with the arm moved to its `q`.
    pub fn identities(&mut self, desired: &[S], x: &[S]) -> Identities<S> {
        let n = self.moving_q.len();
        let (plant, rest) = x.split_at(self.states);
        let (z, quadratures) = rest.split_at(rest.len() - 2);
        let (q, v) = (&plant[..n], &plant[n..2 * n]);
        let energy = match &mut self.storage {
            Some(storage) => storage.energy(desired, &mut self.arm, &self.stored, plant),
            None => self.stored.energy(&mut self.arm, plant),
        };
        let lyapunov = match &mut self.lyapunov {
            Some(lyapunov) => lyapunov.value(desired, &mut self.arm, q, v, z),
            None => S::zero(),
        };
        Identities { skewness: self.skewness(q, v), energy, lyapunov, quadratures: [quadratures[0], quadratures[1]] }
    }

    /// The largest entry of `N + N'`.
    fn skewness(&mut self, q: &[S], v: &[S]) -> S {
        let n = q.len();
        for i in 0..n {
            self.moving_q[i] = Dual::new(q[i], v[i]);
        }
        self.moving.move_to(&self.moving_q);
        self.moving.mass_matrix(&mut self.moving_m);
        self.arm.coriolis_matrix(v, &mut self.coriolis);
        let entry = |i: usize, j: usize| S::splat(2.0).neg_mul_add(self.coriolis[n * i + j], self.moving_m[n * i + j].rate);
        let mut worst = S::zero();
        for i in 0..n {
            for j in i..n {
                let sum = (entry(i, j) + entry(j, i)).abs();
                // `max` would hide a sum that is no number.
                worst = S::select(sum.lt(worst), worst, sum);
            }
        }
        worst
    }
}

/// The monitors of a record, in the order of [`super::monitors::names`]: balances count from the first record.
pub struct Balances<S: Real> {
    pub theory: Theory<S>,
    torque: Option<TorqueError<S>>,
    storage: bool,
    states: usize,
}

impl<S: Real> Balances<S> {
    /// As [`Theory::new`].
    pub fn new<'a>(plant: impl Fn(usize) -> &'a PlantSpec, law: impl Fn(usize) -> &'a LawSpec, storage: bool) -> Self {
        let torque = TorqueError::new(&plant, &law);
        Balances { states: plant(0).states(), theory: Theory::new(plant, law, storage), torque, storage }
    }

    /// The monitors at state `x` into `out`, with the arm moved to its `q`. `first`: from `E - int P` and `V1 + int s' Kd s` of this record
    /// those of the first one.
    pub fn evaluate(&mut self, desired: &[S], x: &[S], first: impl FnOnce([S; 2]) -> [S; 2], out: &mut [S]) {
        let Identities { skewness, energy, lyapunov, quadratures } = self.theory.identities(desired, x);
        let first = first([energy - quadratures[1], lyapunov + quadratures[0]]);
        out[0] = skewness;
        out[1] = energy;
        out[2] = energy - quadratures[1] - first[0];
        if let Some(torque) = &mut self.torque {
            let z = &x[self.states..x.len() - 2];
            out[3] = torque.evaluate(desired, self.theory.arm.trig(), &x[..self.states], z);
            if self.storage {
                out[4] = quadratures[0] + quadratures[1] + first[0] - energy;
            }
        } else if out.len() > 3 {
            out[3] = lyapunov;
            out[4] = first[1] - lyapunov - quadratures[0];
        }
    }
}
