//! Sampled controllers. `sampling` has their settings, `sampler` their clock, `control` the held input, and `torque_sensing` their torque
//! sensors. `loop_law` evaluates the law, and `motor_loop` checks the stability of motor loops.

pub mod control;
pub mod loop_law;
pub mod motor_loop;
pub mod sampler;
pub mod sampling;
pub mod torque_sensing;
