//! What can be said of an arm and of a closed loop without running it.

pub mod elastic_limits;
pub mod equilibrium;
pub mod loop_slope;
