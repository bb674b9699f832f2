//! Sampled controllers: their settings (`sampling`), their clock (`sampler`), the law at a sample (`loop_law`), torque sensors
//! (`torque_sensing`), and the stability of motor loops (`motor_loop`).

pub mod loop_law;
pub mod motor_loop;
pub mod sampler;
pub mod sampling;
pub mod torque_sensing;
