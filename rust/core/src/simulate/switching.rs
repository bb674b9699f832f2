//! Where a plant switches: its wall and its joint stops, each `Apart`, `Pressed` or `Slack`, with the functions whose change
//! of sign ends that.

use crate::dynamics::{AnyArm, Dynamics, Workspace};
use crate::plant::{PlantSpec, Stop, Stops, Touch, Wall};
use crate::scalar::Real;
use crate::spatial::V3;

/// Where a frame is at a plant state, and how fast.
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
    pub fn frame(&mut self, frame: usize, x: &[f64]) -> (V3<f64>, V3<f64>) {
        let n = self.trig.len();
        for (trig, &q) in self.trig.iter_mut().zip(x) {
            *trig = Real::sin_cos(q);
        }
        let p = self.arm.jacobian(&mut self.ws, &self.trig, &x[..n], frame, &mut self.jacobian);
        let v = x.get(n..2 * n).unwrap_or(&[]);
        (p, V3(std::array::from_fn(|k| v.iter().zip(&self.jacobian[k * n..]).map(|(v, j)| j * v).sum())))
    }
}

/// The contacts of one plant, the wall first, then the stops.
pub struct Switching {
    probe: Probe,
    wall: Option<Wall>,
    stops: Option<Stops>,
    which: Vec<Stop>,
    /// What each does at present.
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
                return (depth, wall.stiffness * depth - wall.damping * V3(wall.normal).dot(p_dot));
            }
            i -= 1;
        }
        let (Some(stops), stop) = (&self.stops, self.which[i]) else { return (f64::NEG_INFINITY, 0.0) };
        let (depth, rate) = stop.depth(stops.limit(stop), x[stop.joint], x[n + stop.joint]);
        (depth, stops.stiffness[stop.joint] * depth + stops.damping[stop.joint] * rate)
    }

    /// See the contacts as they are at `x`.
    pub fn begin(&mut self, x: &[f64]) {
        for i in 0..self.touches.len() {
            let (depth, push) = self.contact(i, x);
            self.touches[i] = Touch::at(depth, push);
        }
    }

    /// Negative where contact `i` no longer is what it is taken for.
    pub fn guard(&mut self, i: usize, x: &[f64]) -> f64 {
        let (depth, push) = self.contact(i, x);
        self.touches[i].guard(depth, push)
    }

    /// Contact `i` changes at `x`.
    pub fn switch(&mut self, i: usize, x: &[f64]) {
        let (depth, push) = self.contact(i, x);
        self.touches[i] = self.touches[i].next(depth, push);
    }
}
