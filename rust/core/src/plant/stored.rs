//! The energy stored in a plant: `E = v' M v / 2 + U(q)`, with the mass matrix `M` and the potential energy `U` of gravity. Elastic joints
//! and motors add `(theta - q)' K (theta - q) / 2 + theta_dot' B theta_dot / 2`. Here `theta` are the motor positions, `K` is the joint
//! stiffness and `B` the motor inertia. The springs of wall and stops and the bristles of friction add their energies.

use super::contact::LoopWall;
use super::lugre::LoopLuGre;
use super::rigid::loop_bristles;
use super::stops::LoopStops;
use super::{Parameters, PlantSpec, PlantState};
use crate::dynamics::At;
use crate::scalar::Real;
use crate::trace::E;
use crate::trace::expression::constant;

/// The stored energy of a plant in a control loop.
pub struct Stored {
    numbers: Parameters,
    elastic: bool,
}

impl Stored {
    /// The stored energy of a plant.
    pub fn new(plant: &PlantSpec) -> Self {
        let numbers = Parameters::default()
            .option(plant.elastic(), |numbers, elastic| {
                numbers.gain("joint_stiffness", &elastic.stiffness).gain("motor_inertia", &elastic.motor_inertia)
            })
            .contacts(plant.wall(), plant.stops())
            .option(loop_bristles(plant.friction()), |numbers, bristles| numbers.made("bristles", bristles));
        Stored { numbers, elastic: plant.elastic().is_some() }
    }

    /// The energy, J, at the plant's state `x` with the links `arm`.
    pub fn energy(&self, arm: &At<E>, x: &PlantState) -> E {
        let (kinetic, potential) = arm.energy(&x.v);
        let (wall, stops) = self.contacts(arm, x);
        let mut energy = kinetic + potential + wall + stops;
        if self.numbers.has("bristles") {
            energy += self.numbers.get_made::<LoopLuGre>("bristles").energy(&x.bristles);
        }
        if self.elastic {
            let stretch = &x.theta - &x.q;
            energy += constant(0.5) * stretch.dot(&(self.numbers.get_gain("joint_stiffness") * &stretch));
            energy += constant(0.5) * x.theta_dot.dot(&(self.numbers.get_gain("motor_inertia") * &x.theta_dot));
        }
        energy
    }

    /// The energies stored in wall and stops, J.
    pub fn contacts(&self, arm: &At<E>, x: &PlantState) -> (E, E) {
        let made = |name| self.numbers.has(name);
        let wall = made("wall").then(|| self.numbers.get_made::<LoopWall>("wall"));
        let stops = made("stops").then(|| self.numbers.get_made::<LoopStops>("stops"));
        (wall.map_or(E::zero(), |wall| wall.energy(arm.position(wall.frame))), stops.map_or(E::zero(), |stops| stops.energy(&x.q)))
    }
}
