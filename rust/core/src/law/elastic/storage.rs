//! The storage function of Cartesian impedance through elastic joints, with the springs and motors of the law's model:
//!
//! `E = v' M v / 2 + (theta - q)' K_J (theta - q) / 2 + theta_dot' B0 theta_dot / 2 + e' K_m e / 2`, plus the energy of wall and stops.
//! `theta` are the motor positions, `K_J` is the joint stiffness, and `B0` the reduced motor inertia. `e` is the error of the controlled
//! rows and `K_m` their stiffness.

use super::ElasticImpedanceSpec;
use crate::dynamics::At;
use crate::plant::{Parameters, PlantState, Stored};
use crate::trace::expression::constant;
use crate::trace::{E, V};

/// The storage function of a law in a control loop.
pub struct Storage<'a> {
    law: &'a ElasticImpedanceSpec,
    numbers: Parameters,
}

impl<'a> Storage<'a> {
    /// The storage function of `law`.
    pub fn new(law: &'a ElasticImpedanceSpec) -> Self {
        let numbers = Parameters::default()
            .gain("stiffness", &law.outer.stiffness)
            .gain("joint_stiffness", &law.inner.joint_stiffness)
            .gain("reduced_inertia", &law.inner.reduced_inertia);
        Storage { law, numbers }
    }

    /// The storage function `E`, J, for the target `x_d`, at the plant's state `x` with the links `arm`.
    pub fn energy(&self, x_d: &V, arm: &At<E>, plant: &Stored, x: &PlantState) -> E {
        let form = |name: &str, x: &V| x.dot(&(self.numbers.get_gain(name) * x));
        let (e, _) = arm.error_and_jacobian(&self.law.outer.coordinates, x_d);
        let (kinetic, _) = arm.energy(&x.v);
        let springs = form("joint_stiffness", &(&x.theta - &x.q)) + form("reduced_inertia", &x.theta_dot) + form("stiffness", &e);
        let (wall, stops) = plant.contacts(arm, x);
        kinetic + constant(0.5) * springs + wall + stops
    }
}
