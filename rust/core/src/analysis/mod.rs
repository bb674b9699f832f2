//! What can be said of an arm and its loops without running them.

pub mod inverse_kinematics;
