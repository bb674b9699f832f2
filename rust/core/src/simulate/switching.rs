//! The contacts of a plant, its wall and its joint stops. Each is `Apart`, `Pressed` or `Slack`. It has functions whose change of sign ends
//! this mode.

use crate::dynamics::{AnyArm, Dynamics, Workspace};
use crate::plant::{PlantSpec, Stop, Stops, Touch, Wall};
use crate::scalar::Real;
use crate::spatial::{Vector, Vector3};

/// The position and the velocity of a frame at a plant state.
pub struct Probe {
    arm: AnyArm<f64>,
    ws: Workspace<f64>,
    trig: Vec<(f64, f64)>,
    jacobian: Vec<f64>,
}

impl Probe {
    pub fn new(plant: &PlantSpec) -> Self {
        let (n, arm) = (plant.n(), AnyArm::from_lanes(|_| plant.model()));
        Probe { ws: arm.workspace(), arm, trig: vec![(0.0, 1.0); n], jacobian: vec![0.0; 6 * n] }
    }

    /// Position and velocity of the origin of `frame`, world axes, at `x = [q, v, ..]`.
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

/// The contacts of one plant, the wall first, then the stops.
pub struct Switching {
    probe: Probe,
    wall: Option<Wall>,
    stops: Option<Stops>,
    which: Vec<Stop>,
    /// The present state of each contact.
    pub touches: Vec<Touch>,
}

impl Switching {
    /// `None` for a plant that touches nothing.
    pub fn of(plant: &PlantSpec) -> Option<Self> {
        if plant.is_free() {
            return None;
        }
        let (wall, stops) = (plant.wall().cloned(), plant.stops().cloned());
        let which: Vec<Stop> = stops.iter().flat_map(Stops::all).collect();
        let touches = vec![Touch::Apart; usize::from(wall.is_some()) + which.len()];
        Some(Switching { probe: Probe::new(plant), wall, stops, which, touches })
    }

    /// Depth and push `k d + c d_dot` of contact `i` at plant state `x`.
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

    /// Set the contacts to their state at `x`.
    pub fn begin(&mut self, x: &[f64]) {
        for i in 0..self.touches.len() {
            let (depth, push) = self.contact(i, x);
            self.touches[i] = Touch::at(depth, push);
        }
    }

    /// How many guards there are: two of each contact.
    pub fn guards(&self) -> usize {
        2 * self.touches.len()
    }

    /// Guard `k` at `x`: negative if its contact has another state than the assumed one.
    pub fn guard(&mut self, k: usize, x: &[f64]) -> f64 {
        let (depth, push) = self.contact(k / 2, x);
        self.touches[k / 2].guards(depth, push)[k % 2]
    }

    /// The contact of guard `k` changes at `x`.
    pub fn switch(&mut self, k: usize, x: &[f64]) {
        let i = k / 2;
        let (depth, _) = self.contact(i, x);
        // A contact without damper ends at the surface, on both sides of the state's small error.
        let depth = if self.damped(i) { depth } else { 0.0 };
        self.touches[i] = self.touches[i].next(k % 2, depth);
    }
}
