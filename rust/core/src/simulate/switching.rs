//! Contacts of a plant: its wall and its joint stops. The mode of a contact is `Apart`, `Pressed` or `Slack`. Each mode has two guards,
//! which are functions whose change of sign ends the mode.

use crate::dynamics::{AnyArm, Dynamics, Workspace};
use crate::plant::{PlantSpec, Stop, Stops, Touch, Wall};
use crate::scalar::Real;
use crate::spatial::{Vector, Vector3};

/// Computes the position and the velocity of a frame.
pub struct Probe {
    arm: AnyArm<f64>,
    ws: Workspace<f64>,
    trig: Vec<(f64, f64)>,
    jacobian: Vec<f64>,
}

impl Probe {
    pub fn new(plant: &PlantSpec) -> Self {
        let (n, arm) = (plant.n(), AnyArm::new(plant.model()));
        Probe { ws: arm.workspace(), arm, trig: vec![(0.0, 1.0); n], jacobian: vec![0.0; 6 * n] }
    }

    /// Return position, m, and velocity, m/s, of the origin of `frame` in world axes. The plant's state is `x = [q, v, ..]`.
    pub fn frame(&mut self, frame: usize, x: &[f64]) -> (Vector3<f64>, Vector3<f64>) {
        let n = self.trig.len();
        for (trig, &q) in self.trig.iter_mut().zip(x) {
            *trig = Real::sin_cos(q);
        }
        let p = self.arm.jacobian(&mut self.ws, &self.trig, &x[..n], frame, &mut self.jacobian);
        let v = x.get(n..2 * n).unwrap_or(&[]);
        (p, Vector3::from(std::array::from_fn::<f64, 3, _>(|k| v.iter().zip(&self.jacobian[k * n..]).map(|(v, j)| j * v).sum())))
    }
}

/// The contacts of one plant: the wall, then the stops.
pub struct Switching {
    probe: Probe,
    wall: Option<Wall>,
    stops: Option<Stops>,
    which: Vec<Stop>,
    /// The present mode of each contact.
    pub touches: Vec<Touch>,
}

impl Switching {
    /// Return the contacts of a plant. The result is `None` for a plant without contacts.
    pub fn of(plant: &PlantSpec) -> Option<Self> {
        if plant.is_free() {
            return None;
        }
        let (wall, stops) = (plant.wall().cloned(), plant.stops().cloned());
        let which: Vec<Stop> = stops.iter().flat_map(Stops::all).collect();
        let touches = vec![Touch::Apart; usize::from(wall.is_some()) + which.len()];
        Some(Switching { probe: Probe::new(plant), wall, stops, which, touches })
    }

    /// Return the depth `d`, m or rad, and the push `k d + c d_dot`, N or N m, of contact `i` at plant state `x`. `k` is the stiffness of
    /// the contact, and `c` its damping.
    fn contact(&mut self, i: usize, x: &[f64]) -> (f64, f64) {
        let (mut i, n) = (i, self.probe.trig.len());
        if let Some(wall) = &self.wall {
            if i == 0 {
                let (p, p_dot) = self.probe.frame(wall.frame, x);
                let depth = wall.depth(p);
                return (depth, wall.stiffness * depth - wall.damping * Vector3::from(wall.normal).dot(p_dot));
            }
            i -= 1;
        }
        let (Some(stops), stop) = (&self.stops, self.which[i]) else { return (f64::NEG_INFINITY, 0.0) };
        let (depth, rate) = stop.depth(stops.limit(stop), x[stop.joint], x[n + stop.joint]);
        (depth, stops.stiffness[stop.joint] * depth + stops.damping[stop.joint] * rate)
    }

    fn damped(&self, i: usize) -> bool {
        let damping = match &self.wall {
            Some(wall) if i == 0 => wall.damping,
            wall => self.stops.as_ref().map_or(0.0, |stops| stops.damping[self.which[i - usize::from(wall.is_some())].joint]),
        };
        damping > 0.0
    }

    /// Set the mode of each contact to its mode at state `x`.
    pub fn begin(&mut self, x: &[f64]) {
        for i in 0..self.touches.len() {
            let (depth, push) = self.contact(i, x);
            self.touches[i] = Touch::at(depth, push);
        }
    }

    /// The number of guards: two for each contact.
    pub fn guards(&self) -> usize {
        2 * self.touches.len()
    }

    /// Write the values of all guards at state `x` to `all`. The present mode of contact `i` has ended if guard `2 i` or `2 i + 1` is
    /// negative.
    pub fn evaluate(&mut self, x: &[f64], all: &mut [f64]) {
        for (i, guards) in all.as_chunks_mut().0.iter_mut().enumerate() {
            let (depth, push) = self.contact(i, x);
            *guards = self.touches[i].guards(depth, push);
        }
    }

    /// Change the mode of the contact of guard `k` at state `x`.
    pub fn switch(&mut self, k: usize, x: &[f64]) {
        let i = k / 2;
        let (depth, _) = self.contact(i, x);
        // A contact without damper ends exactly at the surface. The state has a small error there, so that its depth may have either sign.
        // Zero replaces this depth.
        let depth = if self.damped(i) { depth } else { 0.0 };
        self.touches[i] = self.touches[i].next(k % 2, depth);
    }
}
