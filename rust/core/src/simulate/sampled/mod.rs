//! Sampled controllers. `sensors` measures the state, and `torque_sensing` has the torque sensors. `clock` has the samples in steps of equal
//! size, and `outputs` the results of the last samples. `recorded_controller`, `frame_controller` and `samples` are the controllers of loops
//! whose steps are programs. `sampler` is the clock of other loops, and `control` their input. `motor_loop` checks the stability of motor loops.

pub mod clock;
pub mod control;
pub mod frame_controller;
pub mod motor_loop;
pub mod outputs;
pub mod recorded_controller;
pub mod sampler;
pub mod samples;
pub mod sensors;
pub mod torque_sensing;
