//! The energy stored in a plant: `E = v' M v / 2 + U(q)`, with the mass matrix `M` and the potential energy `U` of gravity. Elastic joints
//! and motors add `(theta - q)' K (theta - q) / 2 + theta_dot' B theta_dot / 2`. Here `theta` are the motor positions, `K` is the joint
//! stiffness and `B` the motor inertia. The springs of wall and stops and the bristles of friction add their energies.

use super::PlantSpec;
use super::contact::LoopWall;
use super::lugre::LoopLuGre;
use super::rigid::loop_bristles;
use super::stops::LoopStops;
use crate::dynamics::ArmAt;
use crate::linalg::gain::AnyGain;
use crate::scalar::Real;
use crate::trace::Sym;

/// Elastic joints and their motors.
struct Springs {
    stiffness: AnyGain<Sym>,
    motor_inertia: AnyGain<Sym>,
    stretch: Vec<Sym>,
}

/// The stored energy of a plant in a control loop.
pub struct Stored {
    n: usize,
    wall: Option<LoopWall>,
    stops: Option<LoopStops>,
    springs: Option<Springs>,
    bristles: Option<LoopLuGre>,
}

impl Stored {
    /// The stored energy of a plant.
    pub fn new(plant: &PlantSpec) -> Self {
        let springs = plant.elastic().map(|elastic| Springs {
            stiffness: AnyGain::new(&elastic.stiffness),
            motor_inertia: AnyGain::new(&elastic.motor_inertia),
            stretch: vec![Sym::zero(); elastic.model.n()],
        });
        Stored {
            n: plant.n(),
            wall: plant.wall().map(LoopWall::new),
            stops: plant.stops().map(LoopStops::new),
            springs,
            bristles: loop_bristles(plant.friction()),
        }
    }

    /// Compute the energy, J, at the plant's state `x`. The arm `links` must already be at the joint positions of `x`.
    pub fn energy(&mut self, links: &mut ArmAt<Sym>, x: &[Sym]) -> Sym {
        let n = self.n;
        let (kinetic, potential) = links.energy(&x[n..2 * n]);
        let (wall, stops) = self.contacts(links, x);
        let mut energy = kinetic + potential + wall + stops;
        if let Some(bristles) = &self.bristles {
            energy += bristles.energy(&x[x.len() - n..]);
        }
        let Some(Springs { stiffness, motor_inertia, stretch }) = &mut self.springs else { return energy };
        for (i, stretch) in stretch.iter_mut().enumerate() {
            *stretch = x[2 * n + i] - x[i];
        }
        let half = Sym::splat(0.5);
        half.mul_add(motor_inertia.quadratic(&x[3 * n..4 * n]), half.mul_add(stiffness.quadratic(stretch), energy))
    }

    /// The energies stored in wall and stops, J.
    pub fn contacts(&self, links: &mut ArmAt<Sym>, x: &[Sym]) -> (Sym, Sym) {
        let wall = self.wall.as_ref().map_or(Sym::zero(), |wall| wall.energy(links.position(wall.frame)));
        (wall, self.stops.as_ref().map_or(Sym::zero(), |stops| stops.energy(&x[..self.n])))
    }
}
