//! The notation of a plant: its parameters, its equations at one instant, and its rates.

use super::contact::{LoopWall, Wall};
use super::parameters::Parameters;
use super::stick_slip::LoopStickSlip;
use super::stops::{LoopStops, Stops};
use super::unilateral::Mode;
use crate::dynamics::At;
use crate::scalar::Real;
use crate::spatial::Vector3;
use crate::trace::expression::{vector, zeros};
use crate::trace::{E, M, V};
use std::rc::Rc;

/// The state of a plant by its parts, `(n,)` each. A part that the plant does not have is empty.
///
/// ```
/// # use armlet_core::arm::Arm;
/// use armlet_core::plant::{PlantSpec, PlantState, RigidSpec};
/// use armlet_core::trace::expression::constant;
///
/// let spec = PlantSpec::from(RigidSpec::new(Arm::pendulum(1.0, 5.0)?.into()));
/// let x = PlantState::of(&spec, &[0.3, 2.0].map(constant));
/// assert_eq!((x.q[0], x.v[0], x.theta.len()), (constant(0.3), constant(2.0), 0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone)]
pub struct PlantState {
    /// Positions of the links, rad or m.
    pub q: V,
    /// Velocities of the links, rad/s or m/s.
    pub v: V,
    /// Positions of the motors, rad or m.
    pub theta: V,
    /// Velocities of the motors, rad/s or m/s.
    pub theta_dot: V,
    /// Deflections of the bristles of friction, rad or m.
    pub bristles: V,
}

/// Power into a plant, W. The sum of both parts is the rate of the stored energy. Both are zero for a velocity-controlled arm.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::plant::{PlantSpec, RigidSpec};
///
/// let arm = Arm::pendulum(1.0, 5.0)?.with_drives(None, Some(&[0.5]), None)?;
/// let plant = PlantSpec::from(RigidSpec { friction: true, ..RigidSpec::new(arm.into()) });
/// let (_, power) = plant.rates_at(&[0.3, 2.0], &[4.0], &[0.0; 6], None);
/// // The torque of 4 N m at 2 rad/s, minus the loss `d v^2` of viscous friction.
/// assert_eq!(power, 8.0 - 2.0);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Power {
    /// Power of the input, W.
    pub input: E,
    /// Power of the wrench, minus the power lost in friction, elastic joints, wall and stops, W.
    pub outside: E,
}

/// The rates of a plant at one instant.
///
/// ```
/// # use armlet_core::arm::Arm;
/// use armlet_core::plant::{PlantSpec, RecordedPlant, RigidSpec};
/// use armlet_core::trace::expression::vector;
/// use armlet_core::trace::function::recorded;
///
/// // A pendulum, `a = tau - 5 sin q`, as a function of position, velocity and torque.
/// let spec = PlantSpec::from(RigidSpec::new(Arm::pendulum(1.0, 5.0)?.into()));
/// let power = |plant: RecordedPlant, x: &[_]| vec![plant.rates(&x[..2], &vector(&x[2..]), &[]).power.input];
/// let mut power = recorded(3, || RecordedPlant::new(&spec, None), power).expect("a plant does not branch").interpreted(false);
/// power.all_inputs().copy_from_slice(&[0.3, 2.0, 4.0]);
/// power.run();
/// assert_eq!(power.output(0), [8.0]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct PlantRates {
    /// The rate of the plant's state.
    pub x_dot: V,
    /// The power into the plant.
    pub power: Power,
    /// The torques of dry friction, `(n,)`, N m or N; `None` without this friction.
    pub friction: Option<V>,
}

/// A plant as its paper: its parameters and its equations.
///
/// ```
/// use armlet_core::plant::{PlantAt, PlantRates, Power};
/// use armlet_core::trace::expression::{constant, stacked};
///
/// /// A rigid arm without friction and contacts: `a = M^-1 (tau - C v - g)`.
/// fn equations(at: &PlantAt) -> PlantRates {
///     let (v, a) = (&at.x.v, at.arm().forward_dynamics(&at.x.v, &at.tau));
///     let power = Power { input: at.tau.dot(v), outside: constant(0.0) };
///     PlantRates { x_dot: stacked([v, &a]), power, friction: None }
/// }
/// # let _ = equations;
/// ```
pub trait PlantEquations {
    /// The numbers that differ between runs.
    fn parameters(&self) -> Parameters;

    /// The equations of the plant at one instant.
    fn equations(&self, at: &PlantAt) -> PlantRates;

    /// The stick-slip friction under the torques on the joints or motors; `None` without this friction.
    fn stick_slip(&self, _: &PlantAt) -> Option<LoopStickSlip<E>> {
        None
    }
}

/// A plant at one instant.
///
/// ```
/// use armlet_core::plant::PlantAt;
/// use armlet_core::trace::V;
///
/// /// The torque of the springs of elastic joints, `K (theta - q)`.
/// fn spring_torque(at: &PlantAt) -> V {
///     at.numbers().get_gain("joint_stiffness") * &(&at.x.theta - &at.x.q)
/// }
/// # let _ = spring_torque;
/// ```
pub struct PlantAt<'a> {
    pub(super) numbers: &'a Parameters,
    pub(super) arm: Option<Rc<At<E>>>,
    /// The state.
    pub x: PlantState,
    /// The input, `(n,)`.
    pub tau: V,
    pub(super) wrench: &'a [E],
    pub(super) force_frame: Option<usize>,
    pub(super) contacts: &'a [Mode<E>],
    pub(super) signs: &'a V,
}

impl PlantAt<'_> {
    /// The numbers of the plant.
    pub fn numbers(&self) -> &Parameters {
        self.numbers
    }

    /// The arm at the joint positions.
    pub fn arm(&self) -> &At<E> {
        let Some(arm) = &self.arm else { unreachable!("a plant with dynamics has the parameters of its arm") };
        arm
    }

    /// The stick-slip friction of the plant in its present modes, without its loads; `None` without this friction.
    pub(super) fn held_friction(&self) -> Option<LoopStickSlip<E>> {
        self.numbers.has("stick_slip").then(|| {
            let mut friction = self.numbers.get_made::<LoopStickSlip<E>>("stick_slip").clone();
            if !self.signs.is_empty() {
                friction.follow_signs(self.signs.as_slice());
            }
            friction
        })
    }

    /// Position and velocity of a frame, and the rows of its Jacobian for the position.
    fn frame(&self, frame: usize) -> (Vector3<E>, Vector3<E>, M) {
        let (p, j) = self.arm().jacobian(frame);
        let j = j.rows(0, 3).into_owned();
        let p_dot = &j * &self.x.v;
        (p, Vector3::new(p_dot[0], p_dot[1], p_dot[2]), j)
    }

    /// The torques of wrench, wall and stops on the joints, `(n,)`, and their power, W. The power of wall and stops is without the energy that
    /// they store.
    pub fn outside(&self) -> (V, E) {
        let (mut torque, mut power) = (zeros(self.x.q.len()), E::zero());
        if let Some(frame) = self.force_frame {
            torque = self.arm().jacobian(frame).1.tr_mul(&vector(self.wrench));
            power = torque.dot(&self.x.v);
        }
        let wall = self.numbers.has("wall").then(|| self.numbers.get_made::<LoopWall>("wall"));
        if let Some(wall) = wall {
            let (p, p_dot, j) = self.frame(wall.frame);
            let (f, dissipated) = wall.force(p, p_dot, self.contacts.first().copied());
            torque += j.tr_mul(&f);
            power -= dissipated;
        }
        if self.numbers.has("stops") {
            let modes = (!self.contacts.is_empty()).then(|| &self.contacts[usize::from(wall.is_some())..]);
            let (stopped, lost) = self.numbers.get_made::<LoopStops>("stops").torque(&self.x.q, &self.x.v, modes);
            torque += stopped;
            power -= lost;
        }
        (torque, power)
    }

    /// Depth `d` and push `k d + c d_dot` of contact `i`. The wall has index 0 if it exists, and the stops follow.
    pub(super) fn contact(&self, i: usize) -> [E; 2] {
        let wall = self.numbers.has("wall").then(|| self.numbers.get_made::<LoopWall>("wall"));
        if let (Some(wall), 0) = (wall, i) {
            let (p, p_dot, _) = self.frame(wall.frame);
            return wall.contact(p, p_dot);
        }
        self.numbers.get_made::<LoopStops>("stops").contact(i - usize::from(wall.is_some()), &self.x.q, &self.x.v)
    }
}

impl Parameters {
    /// Add a wall and stops.
    pub(super) fn contacts(self, wall: Option<&Wall>, stops: Option<&Stops>) -> Self {
        self.option(wall, |numbers, wall| numbers.made("wall", LoopWall::new(wall)))
            .option(stops, |numbers, stops| numbers.made("stops", LoopStops::new(stops)))
    }
}
