//! Laws of arms with elastic joints.

mod impedance;
mod joint_impedance;
mod joint_tracking;
mod motor_regulation;
mod sampled_reduction;
mod storage;

pub use impedance::*;
pub use joint_impedance::*;
pub use joint_tracking::*;
pub use motor_regulation::*;
pub use sampled_reduction::*;
pub(crate) use storage::Storage;
