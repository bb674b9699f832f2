//! Runs the examples with an arm, and checks their assertions.

#[path = "../../examples/computed_torque.rs"]
mod computed_torque;
#[path = "../../examples/task_priority.rs"]
mod task_priority;
#[path = "../../examples/time_optimal_path.rs"]
mod time_optimal_path;

#[test]
fn computed_torque_follows_and_shows_the_payload() {
    computed_torque::main().unwrap();
}

#[test]
fn a_posture_does_not_disturb_the_tip() {
    task_priority::main().unwrap();
}

#[test]
fn the_fastest_motion_keeps_its_limits() {
    time_optimal_path::main().unwrap();
}
