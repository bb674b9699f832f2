//! The storage function of Cartesian impedance through elastic joints, with the springs and motors of the law's model:
//!
//! `E = v' M v / 2 + (theta - q)' K_J (theta - q) / 2 + theta_dot' B0 theta_dot / 2 + e' K_m e / 2`, plus the energy of wall and stops.
//! `theta` are the motor positions, `K_J` is the joint stiffness, and `B0` the reduced motor inertia. `e` is the error of the controlled
//! rows and `K_m` their stiffness.

use super::LawSpec;
use crate::dynamics::ArmAt;
use crate::kinematics::Coordinates;
use crate::linalg::gain::AnyGain;
use crate::plant::Stored;
use crate::scalar::Real;
use crate::trace::Sym;

/// The storage function of a law in a control loop.
pub struct Storage {
    coordinates: Coordinates,
    stiffness: AnyGain<Sym>,
    joint_stiffness: AnyGain<Sym>,
    reduced_inertia: AnyGain<Sym>,
    stretch: Vec<Sym>,
    error: Vec<Sym>,
    jacobian: Vec<Sym>,
}

impl Storage {
    /// The storage function of `law`; `None` for a law without one.
    pub fn new(law: &LawSpec) -> Option<Self> {
        let law = law.storage()?;
        let (n, m) = (law.outer.model.n(), law.outer.coordinates.m());
        Some(Storage {
            coordinates: law.outer.coordinates.clone(),
            stiffness: AnyGain::new(&law.outer.stiffness),
            joint_stiffness: AnyGain::new(&law.inner.joint_stiffness),
            reduced_inertia: AnyGain::new(&law.inner.reduced_inertia),
            stretch: vec![Sym::zero(); n],
            error: vec![Sym::zero(); m],
            jacobian: vec![Sym::zero(); m * n],
        })
    }

    /// Compute the storage function `E`, J, for the desired motions at the plant's state `x`. The arm `links` must already be at the joint
    /// positions of `x`.
    pub fn energy(&mut self, desired: &[Sym], links: &mut ArmAt<Sym>, plant: &Stored, x: &[Sym]) -> Sym {
        let n = self.stretch.len();
        let target = &desired[..self.error.len()];
        links.error_and_jacobian(&self.coordinates, target, &mut self.error, &mut self.jacobian);
        let (kinetic, _) = links.energy(&x[n..2 * n]);
        for (i, stretch) in self.stretch.iter_mut().enumerate() {
            *stretch = x[2 * n + i] - x[i];
        }
        let half = Sym::splat(0.5);
        let inner = half * (self.joint_stiffness.quadratic(&self.stretch) + self.reduced_inertia.quadratic(&x[3 * n..4 * n]));
        let (wall, stops) = plant.contacts(links, x);
        kinetic + inner + half * self.stiffness.quadratic(&self.error) + wall + stops
    }
}
