//! Sampled controllers. `sampler` has their clock, `control` the held input, and `torque_sensing` their torque sensors. `motor_loop` checks
//! the stability of motor loops.

pub mod control;
pub mod motor_loop;
pub mod sampler;
pub mod torque_sensing;
