//! Task functions of an arm: the error `e(q)`, the feed-forward velocity `w`, the Jacobian `J(q)` and its rate `dJ/dt`. With joint
//! velocities `v` that satisfy `J v = w + K e`, `K > 0`, the error decays (closed-loop inverse kinematics, `siciliano1990kinematic`).
//!
//! Each kind of task has a file and an entry in the macro `tasks!`. Where the table has two errors or Jacobians, the first is for rows of
//! position and the second for rows of orientation:
//!
//! | task | error | Jacobian |
//! |---|---|---|
//! | frame | `p_d - p`, `log(R_d R')` | rows of the geometric Jacobian |
//! | posture | `q_d - q` of chosen joints | rows of the identity |
//! | centre of mass | `c_d - c` | `sum m_b J_b / m_total` over the bodies `b` |
//! | axis | rotation vector from `a` to `a_d`, along two directions `b` of the frame perpendicular to `a` | rows `b' R' J_w` |
//! | relative | `x_d - x`, `log(R_d (R_r' R)')` | `R_r'(J_v - J_v,r + [p - p_r]x J_w,r)`, `R_r'(J_w - J_w,r)` |
//! | distance | `d_d - d` between two spheres or capsules | `n'(J_a - J_b)` at the nearest points |
//! | interval | nearest bound of another task, minus its coordinate | rows of the other task; zero within the bounds |
//! | joint limits | nearest position within the narrowed limits, minus `q` | rows of the identity |
//!
//! `p` and `R` are the position and the rotation matrix of the frame, and `'` is the transpose. `x = R_r'(p - p_r)` is a relative position.
//! `d` is a distance, and `n` its direction. The index `d` means the target, and `r` the reference frame. `J_v` and `J_w` are the linear and
//! angular rows of the geometric Jacobian. `[p]x` is the cross-product matrix.

mod axis;
mod centre_of_mass;
mod distance;
mod frame;
mod interval;
mod joint_limits;
mod kind;
mod posture;
mod relative;
#[cfg(all(test, feature = "urdf"))]
mod tests;

pub use axis::Axis;
pub use centre_of_mass::CentreOfMass;
pub use distance::{Distance, Solid};
pub use interval::Interval;
pub use joint_limits::JointLimits;
pub(crate) use kind::TaskKind;
pub use posture::Posture;
pub use relative::Relative;

use super::{Bodies, Coordinates};
use crate::arm::Tree;
use crate::error::{Error, Result, finite};
use crate::scalar::Real;

/// Declare the kinds of tasks: the enum, and the functions of each kind.
macro_rules! tasks {
    ($($(#[$doc:meta])* $kind:ident($definition:ty),)*) => {
        /// The controlled quantity of an arm.
        ///
        /// ```
        /// use armlet_core::arm::Arm;
        /// use armlet_core::kinematics::TaskFunction;
        ///
        /// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
        /// let position = TaskFunction::frame(&arm, "link2", "xy")?;
        /// let direction = TaskFunction::axis(&arm, "link2", [1.0, 0.0, 0.0])?;
        /// assert_eq!([&position, &direction].map(|task| (task.rows(), task.target_size())), [(2, 2), (2, 3)]);
        /// assert!(direction.require_target(&[0.0, 0.0, 2.0]).is_ok());
        /// assert!(direction.require_target(&[0.0, 0.0, 0.0]).is_err());
        /// # Ok::<(), armlet_core::error::Error>(())
        /// ```
        #[derive(Clone, Debug, PartialEq)]
        pub enum TaskFunction {
            $($(#[$doc])* $kind($definition),)*
        }

        $(impl From<$definition> for TaskFunction {
            fn from(task: $definition) -> Self {
                TaskFunction::$kind(task)
            }
        })*

        impl TaskKind for TaskFunction {
            fn rows(&self) -> usize {
                match self {
                    $(TaskFunction::$kind(task) => task.rows(),)*
                }
            }
            fn target_size(&self) -> usize {
                match self {
                    $(TaskFunction::$kind(task) => task.target_size(),)*
                }
            }
            fn require(&self, target: &[f64]) -> Result<()> {
                match self {
                    $(TaskFunction::$kind(task) => task.require(target),)*
                }
            }
            fn bodies<S: Real>(&self, tree: &Tree<S>) -> usize {
                match self {
                    $(TaskFunction::$kind(task) => task.bodies(tree),)*
                }
            }
            fn error<S: Real>(&self, at: &mut Bodies<S>, target: &[S], e: &mut [S]) {
                match self {
                    $(TaskFunction::$kind(task) => task.error(at, target, e),)*
                }
            }
            fn feedforward<S: Real>(&self, at: &Bodies<S>, desired: [&[S]; 3], w: &mut [S], a: Option<&mut [S]>) {
                match self {
                    $(TaskFunction::$kind(task) => task.feedforward(at, desired, w, a),)*
                }
            }
            fn jacobian<S: Real>(&self, at: &mut Bodies<S>, rate: bool, j: &mut [S]) {
                match self {
                    $(TaskFunction::$kind(task) => task.jacobian(at, rate, j),)*
                }
            }
        }
    };
}

tasks! {
    /// Rows of the position and orientation of a frame, world axes.
    Frame(Coordinates),
    /// Positions of chosen joints.
    Posture(Posture),
    /// Rows of the centre of mass, world axes.
    CentreOfMass(CentreOfMass),
    /// A direction of a frame that points along a direction of the world.
    Axis(Axis),
    /// Rows of the pose of a frame relative to another frame.
    Relative(Relative),
    /// The distance between two solids.
    Distance(Distance),
    /// Another task within bounds.
    Interval(Interval),
    /// Chosen joints within narrowed limits.
    JointLimits(JointLimits),
}

impl TaskFunction {
    /// Number of rows of the task's Jacobian.
    pub fn rows(&self) -> usize {
        TaskKind::rows(self)
    }

    /// Number of entries of the target: the number of rows, but 3 for an axis and 0 for joint limits.
    pub fn target_size(&self) -> usize {
        TaskKind::target_size(self)
    }

    /// Refuse an invalid constant target. Errors: `WrongShape` for a wrong size, `Input` for other faults.
    pub fn require_target(&self, target: &[f64]) -> Result<()> {
        finite("target", target)?;
        if target.len() != self.target_size() {
            return Err(Error::wrong_shape("target", &[self.target_size()], &[target.len()]));
        }
        self.require(target)
    }
}
