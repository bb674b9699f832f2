//! Plants: what turns a law's input into motion, and what a state of it is.
//!
//! rigid `x = [q, v]`, elastic `x = [q, v, theta, theta_dot]`, velocity-controlled `x = [q]`. An external wrench
//! `W = [f; m]` (world axes) acts at one frame as `J' W`; a wall pushes back where a frame enters it.

mod contact;
mod elastic;
mod rigid;
pub mod sensors;
mod stops;
mod stored;
pub mod unilateral;
mod velocity;

pub use contact::{LaneWall, Wall};
pub use elastic::{Elastic, ElasticSpec};
pub use rigid::{Rigid, RigidSpec};
pub use stops::{Stop, Stops};
pub use stored::Stored;
pub use unilateral::Touch;
pub use velocity::{Velocity, VelocitySpec};

use crate::dynamics::Model;
use crate::scalar::Real;

/// Power into a plant: its sum is the rate of the stored energy.
#[derive(Clone, Copy, Debug)]
pub struct Power<S> {
    /// By the input.
    pub input: S,
    /// By wrench and wall, less what friction takes.
    pub outside: S,
}

/// A plant in a loop.
pub trait Plant<S: Real> {
    /// Rates `dx` of the plant's state `x` under the input `tau` `(n,)` and the wrench `(6,)` at the frame the plant was
    /// made with; returns the power put in.
    fn rates(&mut self, trig: &[(S, S)], x: &[S], tau: &[S], wrench: &[S], dx: &mut [S]) -> Power<S>;

    /// Hold every contact, the wall first, then the stops, as it is said to be, whatever the state.
    fn hold(&mut self, _contacts: &[Touch]) {}
}

/// Which plant a law is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlantKind {
    /// Rigid joints driven by torques.
    Rigid,
    /// Elastic joints driven by motors.
    Elastic,
    /// Joints that follow a velocity exactly.
    Velocity,
}

impl PlantKind {
    /// The class in Python.
    pub fn name(self) -> &'static str {
        match self {
            PlantKind::Rigid => "RigidArm",
            PlantKind::Elastic => "ElasticArm",
            PlantKind::Velocity => "VelocityArm",
        }
    }

    /// Size of the state of a plant of `n` joints.
    pub fn states(self, n: usize) -> usize {
        match self {
            PlantKind::Rigid => 2 * n,
            PlantKind::Elastic => 4 * n,
            PlantKind::Velocity => n,
        }
    }
}

/// A plant as the user states it, validated.
#[derive(Clone, Debug, PartialEq)]
pub enum PlantSpec {
    /// Rigid joints.
    Rigid(RigidSpec),
    /// Elastic joints.
    Elastic(ElasticSpec),
    /// Velocity-controlled joints.
    Velocity(VelocitySpec),
}

impl From<RigidSpec> for PlantSpec {
    fn from(plant: RigidSpec) -> Self {
        PlantSpec::Rigid(plant)
    }
}

impl From<ElasticSpec> for PlantSpec {
    fn from(plant: ElasticSpec) -> Self {
        PlantSpec::Elastic(plant)
    }
}

impl From<VelocitySpec> for PlantSpec {
    fn from(plant: VelocitySpec) -> Self {
        PlantSpec::Velocity(plant)
    }
}

impl PlantSpec {
    /// The kind of the plant.
    pub fn kind(&self) -> PlantKind {
        match self {
            PlantSpec::Rigid(_) => PlantKind::Rigid,
            PlantSpec::Elastic(_) => PlantKind::Elastic,
            PlantSpec::Velocity(_) => PlantKind::Velocity,
        }
    }

    /// The arm.
    pub fn model(&self) -> &Model {
        match self {
            PlantSpec::Rigid(plant) => &plant.model,
            PlantSpec::Elastic(plant) => &plant.model,
            PlantSpec::Velocity(plant) => &plant.model,
        }
    }

    /// Number of joints, which is that of inputs.
    pub fn n(&self) -> usize {
        self.model().n()
    }

    /// Size of the state `x`.
    pub fn states(&self) -> usize {
        self.kind().states(self.n())
    }

    /// `x` at the start: `theta0 = None` is where the springs carry gravity, `theta_dot0 = None` moves with the links.
    pub fn initial_state(&self, q0: &[f64], v0: &[f64], theta0: Option<&[f64]>, theta_dot0: Option<&[f64]>) -> Vec<f64> {
        let mut x = q0.to_vec();
        match self {
            PlantSpec::Velocity(_) => {}
            PlantSpec::Rigid(_) => x.extend(v0),
            PlantSpec::Elastic(plant) => {
                x.extend(v0);
                match theta0 {
                    Some(theta) => x.extend(theta),
                    None => x.extend(plant.resting_motor(q0)),
                }
                x.extend(theta_dot0.unwrap_or(v0));
            }
        }
        x
    }

    /// The plants of the lanes as one, with the wrench acting at `force_frame`.
    pub fn build<'a, S: Real>(of: impl Fn(usize) -> &'a PlantSpec, force_frame: Option<usize>) -> Box<dyn Plant<S> + Send> {
        match of(0) {
            PlantSpec::Rigid(first) => Box::new(Rigid::new(
                |i| match of(i) {
                    PlantSpec::Rigid(plant) => plant,
                    _ => first,
                },
                force_frame,
            )),
            PlantSpec::Elastic(first) => Box::new(Elastic::new(
                |i| match of(i) {
                    PlantSpec::Elastic(plant) => plant,
                    _ => first,
                },
                force_frame,
            )),
            PlantSpec::Velocity(plant) => Box::new(Velocity { n: plant.model.n() }),
        }
    }

    /// Whether both can run side by side in lanes.
    pub fn same_shape(&self, other: &PlantSpec) -> bool {
        self.kind() == other.kind()
            && self.model().same_geometry(other.model())
            && self.wall().map(|wall| wall.frame) == other.wall().map(|wall| wall.frame)
            && self.stops().into_iter().flat_map(Stops::all).eq(other.stops().into_iter().flat_map(Stops::all))
            && self.has_friction() == other.has_friction()
    }

    /// The wall that a frame may touch.
    pub fn wall(&self) -> Option<&Wall> {
        match self {
            PlantSpec::Rigid(plant) => plant.wall.as_ref(),
            PlantSpec::Elastic(plant) => plant.wall.as_ref(),
            PlantSpec::Velocity(_) => None,
        }
    }

    /// The joint stops.
    pub fn stops(&self) -> Option<&Stops> {
        match self {
            PlantSpec::Rigid(plant) => plant.stops.as_ref(),
            PlantSpec::Elastic(plant) => plant.stops.as_ref(),
            PlantSpec::Velocity(_) => None,
        }
    }

    /// Whether nothing can be touched.
    pub fn is_free(&self) -> bool {
        self.wall().is_none() && self.stops().is_none()
    }

    /// Whether the friction of a rigid arm's joints acts.
    pub fn has_friction(&self) -> bool {
        matches!(self, PlantSpec::Rigid(RigidSpec { friction: true, .. }))
    }
}
