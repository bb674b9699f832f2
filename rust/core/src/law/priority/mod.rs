//! Laws with tasks in order of priority, their levels, and the solvers of tasks at single configurations.

mod acceleration;
mod arm_batch;
mod arm_solver;
mod braking;
mod joint_limits;
mod tasks;
mod torque_limits;
mod velocity;

pub use acceleration::PriorityAccelerationSpec;
pub use arm_batch::ArmBatch;
pub use arm_solver::ArmSolver;
pub use joint_limits::{HORIZON, LimitOverrides, MotionLimits};
pub(crate) use tasks::norms;
pub use velocity::{PriorityVelocitySpec, with_limits};
