//! The interfaces of a plant: its declaration, and its evaluation in a control loop. Most functions have a default.

use super::contact::Wall;
use super::friction::JointFriction;
use super::stick_slip::LoopStickSlip;
use super::stops::Stops;
use super::unilateral::Mode;
use crate::dynamics::Model;
use crate::scalar::Real;
use crate::trace::Sym;

/// A plant with validated parameters.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::Gain;
/// use armlet_core::plant::{Definition, ElasticSpec};
///
/// let model = Model::from(Arm::pendulum(1.0, 5.0)?);
/// let plant = ElasticSpec::new(model, Gain::scalar("stiffness", 1, 100.0)?, Gain::scalar("inertia", 1, 0.1)?, None, None, None)?;
/// // In the state `[q, v, theta, theta_dot]`, the spring carries the gravity load at the start, and the motor moves with the link.
/// let x = plant.initial_state(&[0.3], &[2.0], None, None);
/// assert_eq!((x[0], x[1], x[3]), (0.3, 2.0, 2.0));
/// assert!((x[2] - (0.3 + 0.05 * 0.3f64.sin())).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub trait Definition {
    /// The model of the arm.
    fn model(&self) -> &Model;

    /// Return the initial state `x`. `theta0` and `theta_dot0` are for elastic joints. If `theta0` is `None`, the springs carry the gravity
    /// load. If `theta_dot0` is `None`, the motors move with the links.
    fn initial_state(&self, q0: &[f64], v0: &[f64], _theta0: Option<&[f64]>, _theta_dot0: Option<&[f64]>) -> Vec<f64> {
        [q0, v0].concat()
    }

    /// The wall that a frame may touch; `None` without a wall.
    fn wall(&self) -> Option<&Wall> {
        None
    }

    /// The joint stops; `None` without stops.
    fn stops(&self) -> Option<&Stops> {
        None
    }

    /// Whether the plant is a rigid arm with the viscous and Coulomb friction of the model's joints.
    fn has_friction(&self) -> bool {
        false
    }

    /// The dry friction of the joints, or of the motors of an elastic arm; `None` without dry friction.
    fn friction(&self) -> Option<&JointFriction> {
        None
    }
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
    pub input: Sym,
    /// Power of the wrench, minus the power lost in friction, elastic joints, wall and stops, W.
    pub outside: Sym,
}

/// A plant in a recorded control loop. [`PlantSpec::rates_at`](super::PlantSpec::rates_at) evaluates a plant at a single state.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::plant::{PlantSpec, RigidSpec};
///
/// // A pendulum: `a = tau - 5 sin q`.
/// let spec = PlantSpec::from(RigidSpec::new(Arm::pendulum(1.0, 5.0)?.into()));
/// let (dx, _) = spec.rates_at(&[0.3, 2.0], &[4.0], &[0.0; 6], None);
/// assert!(dx[0] == 2.0 && (dx[1] - (4.0 - 5.0 * 0.3f64.sin())).abs() < 1e-14);
/// assert!(spec.build(None).stick_slip().is_none());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub trait Plant {
    /// Compute the rates `dx` of the plant's state `x` under the input `tau`, `(n,)`, and the wrench, `(6,)`. Return the power into the
    /// plant.
    ///
    /// `trig` has (sin, cos) of each joint position. The wrench acts at the frame with which the plant was built.
    fn rates(&mut self, trig: &[(Sym, Sym)], x: &[Sym], tau: &[Sym], wrench: &[Sym], dx: &mut [Sym]) -> Power;

    /// Hold every contact in its mode of `contacts`, independent of the state. The mode of the wall is the first, and the modes of the
    /// stops follow. If `contacts` is empty, the state determines the modes.
    fn hold(&mut self, _contacts: &mut dyn Iterator<Item = Mode<Sym>>) {}

    /// Return the depth `d` and the push `k d + c d_dot` of contact `i`. The other arguments are as in [`Plant::rates`].
    fn contact(&mut self, _i: usize, _trig: &[(Sym, Sym)], _x: &[Sym]) -> [Sym; 2] {
        [Sym::zero(); 2]
    }

    /// The stick-slip friction of joints or motors, and the index of their first speed in the state; `None` without this friction.
    fn stick_slip(&mut self) -> Option<(&mut LoopStickSlip<Sym>, usize)> {
        None
    }

    /// Write the torques and the loads to the stick-slip friction [`Plant::stick_slip`]. The torques are the sums of all other torques on
    /// the joints or motors. The arguments are as in [`Plant::rates`].
    fn load_friction(&mut self, _trig: &[(Sym, Sym)], _x: &[Sym], _tau: &[Sym], _wrench: &[Sym]) {}
}

/// Implement the functions of a plant with the fields `model`, `wall`, `stops` and `dry`.
macro_rules! fields {
    () => {
        fn model(&self) -> &Model {
            &self.model
        }

        fn wall(&self) -> Option<&Wall> {
            self.wall.as_ref()
        }

        fn stops(&self) -> Option<&Stops> {
            self.stops.as_ref()
        }

        fn friction(&self) -> Option<&JointFriction> {
            self.dry.as_ref()
        }
    };
}
pub(super) use fields;
