//! Tests of inverse kinematics from random starts, and of its report for unreachable poses.

use crate::arm_common::Rng;
use armlet_core::analysis::inverse_kinematics::{Goal, IkOptions, inverse_kinematics};
use armlet_core::arm::{Arm, STANDARD_GRAVITY, example_urdf};
use armlet_core::kinematics::{TaskFunction, TaskStack};
use armlet_core::status::Status;
use std::f64::consts::PI;

fn arm(name: &str) -> Arm {
    Arm::from_urdf(example_urdf(name).unwrap(), name, STANDARD_GRAVITY, None, None).unwrap()
}

/// Return the pose of the last frame at `q` as a goal, which is reachable.
fn goal_at(arm: &Arm, q: &[f64], axes: &str) -> Goal {
    let last = arm.frame_names().last().unwrap().to_string();
    let function = TaskFunction::frame(arm, &last, axes).unwrap();
    let (m, mut stack) = (function.rows(), TaskStack::new(arm, vec![function.clone()]));
    let (mut e, mut w) = (vec![0.0; m], vec![0.0; m]);
    stack.place(q);
    stack.error(0, &vec![0.0; 3 * m], &mut e, &mut w, None);
    (function, e.iter().map(|e| -e).collect())
}

fn inside(arm: &Arm, rng: &mut Rng) -> Vec<f64> {
    let limit = |x: f64, or: f64| if x.is_finite() { x } else { or };
    arm.joints
        .iter()
        .map(|joint| {
            let (low, high) = (limit(joint.limits.lower, -PI), limit(joint.limits.upper, PI));
            low + 0.5 * (high - low) * (1.0 + rng.unit())
        })
        .collect()
}

#[test]
fn reachable_poses_are_reached_within_the_limits() {
    for (name, axes) in [("seven_axis", "xyz rx ry rz"), ("six_axis", "xyz rx ry rz"), ("macro_micro_4r", "xy")] {
        let (arm, mut rng) = (arm(name), Rng(1));
        let mut reached = 0;
        for _ in 0..60 {
            let goal = goal_at(&arm, &inside(&arm, &mut rng), axes);
            let q0 = inside(&arm, &mut rng);
            let found = inverse_kinematics(&arm, &[goal], &q0, &IkOptions::default()).unwrap();
            for (q, joint) in found.q.iter().zip(&arm.joints) {
                assert!((joint.limits.lower..=joint.limits.upper).contains(q), "{name}");
            }
            if found.status == Status::Success {
                assert!(found.errors.iter().all(|e| e.abs() <= 1e-9));
                reached += 1;
            }
        }
        // There are 50 random starts. If one start in eight reaches a pose, all starts fail about once in 800 poses.
        assert!(reached == 60, "{name}: {reached} of 60");
    }
}

#[test]
fn the_same_seed_finds_the_same() {
    let arm = arm("seven_axis");
    let goal = goal_at(&arm, &inside(&arm, &mut Rng(5)), "xyz rx ry rz");
    let find =
        |seed| inverse_kinematics(&arm, std::slice::from_ref(&goal), &[0.0; 7], &IkOptions { seed, ..IkOptions::default() }).unwrap();
    assert_eq!(find(3), find(3));
}

#[test]
fn out_of_reach_is_said_and_lower_tasks_give_way() {
    let arm = arm("macro_micro_4r");
    let last = arm.frame_names().last().unwrap().to_string();
    let tip = TaskFunction::frame(&arm, &last, "xy").unwrap();
    let search = IkOptions { restarts: 3, ..IkOptions::default() };
    let far = inverse_kinematics(&arm, &[(tip.clone(), vec![1e3, 0.0])], &[0.3; 4], &search).unwrap();
    assert_eq!((far.status, far.reached.as_slice(), far.restarts), (Status::Infeasible, &[false][..], 3));
    let goal = goal_at(&arm, &[0.3, 0.6, -0.4, 0.8], "xy");
    let posture = TaskFunction::posture(&arm, None).unwrap();
    let both = inverse_kinematics(&arm, &[goal, (posture, vec![0.0; 4])], &[0.3; 4], &search).unwrap();
    assert_eq!((both.status, both.reached.as_slice()), (Status::Degraded, &[true, false][..]));
}
