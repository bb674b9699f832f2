//! Contacts of a plant: its wall and its joint stops. The mode of a contact is `Apart`, `Pressed` or `Slack`. Each mode has two guards,
//! which are functions whose change of sign ends the mode.

use super::rates_loop::RatesLoop;
use crate::plant::{PlantSpec, Touch};

/// The contacts of one plant: the wall, then the stops.
pub struct Switching {
    /// Whether the contact has a damper.
    damped: Vec<bool>,
    /// The depth `d`, m or rad, and the push `k d + c d_dot`, N or N m, of each contact at the last state. `k` is the stiffness of the
    /// contact, and `c` its damping.
    numbers: Vec<f64>,
    /// The present mode of each contact.
    pub touches: Vec<Touch>,
}

impl Switching {
    /// Return the contacts of a plant. The result is `None` for a plant without contacts.
    pub fn of(plant: &PlantSpec) -> Option<Self> {
        let stops = plant.stops().into_iter().flat_map(|stops| stops.all().map(|stop| stops.damping[stop.joint]));
        let damped: Vec<bool> = plant.wall().map(|wall| wall.damping).into_iter().chain(stops).map(|damping| damping > 0.0).collect();
        let (count, touches) = (damped.len(), vec![Touch::Apart; damped.len()]);
        (count > 0).then(|| Switching { damped, numbers: vec![0.0; 2 * count], touches })
    }

    /// Set the mode of each contact to its mode at state `x`.
    pub fn begin(&mut self, system: &mut RatesLoop, x: &[f64]) {
        system.contacts(x, &mut self.numbers);
        for (touch, &[depth, push]) in self.touches.iter_mut().zip(self.numbers.as_chunks().0) {
            *touch = Touch::at(depth, push);
        }
    }

    /// The number of guards: two for each contact.
    pub fn guards(&self) -> usize {
        2 * self.touches.len()
    }

    /// Write the values of all guards at state `x` to `all`. The present mode of contact `i` has ended if guard `2 i` or `2 i + 1` is
    /// negative.
    pub fn evaluate(&mut self, system: &mut RatesLoop, x: &[f64], all: &mut [f64]) {
        system.contacts(x, &mut self.numbers);
        let numbers = self.numbers.as_chunks().0.iter().zip(&self.touches);
        for (guards, (&[depth, push], touch)) in all.as_chunks_mut().0.iter_mut().zip(numbers) {
            *guards = touch.guards(depth, push);
        }
    }

    /// Change the mode of the contact of guard `k` at state `x`.
    pub fn switch(&mut self, system: &mut RatesLoop, k: usize, x: &[f64]) {
        let i = k / 2;
        system.contacts(x, &mut self.numbers);
        // A contact without damper ends exactly at the surface. The state has a small error there, so that its depth may have either sign.
        // Zero replaces this depth.
        let depth = if self.damped[i] { self.numbers[2 * i] } else { 0.0 };
        self.touches[i] = self.touches[i].next(k % 2, depth);
    }
}
