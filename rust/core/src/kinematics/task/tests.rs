//! Jacobians and their rates compared with central differences, on a serial arm and on an arm with branches, a prismatic joint and oblique
//! axes.

use super::{Axis, JointLimits, TaskFunction};
use crate::arm::{Arm, STANDARD_GRAVITY, example_urdf};
use crate::kinematics::{Pose, TaskStack, frame_pose};
use crate::spatial::{Matrix, Vector};

/// The step `h` of central differences. The truncation error is `h^2/6` times a third derivative, which is at most 10 here. The rounding
/// error is proportional to `1/h`.
const STEP: f64 = 1e-5;
const CLOSE: f64 = 1e-8;

fn arm(name: &str) -> Arm {
    Arm::from_urdf(example_urdf(name).unwrap(), name, STANDARD_GRAVITY, None, None).unwrap()
}

/// All kinds of tasks except joint limits, with frames on different branches if the arm has them.
fn functions(arm: &Arm) -> Vec<TaskFunction> {
    let names: Vec<&str> = arm.frame_names().collect();
    let (last, middle) = (names[names.len() - 1], names[names.len() / 2]);
    let joints = vec![arm.joints[1].name.clone(), arm.joints[0].name.clone()];
    vec![
        TaskFunction::frame(arm, last, "z rx ry rz x").unwrap(),
        TaskFunction::frame(arm, middle, "xy").unwrap(),
        TaskFunction::posture(arm, Some(&joints)).unwrap(),
        TaskFunction::centre_of_mass(arm, "yxz").unwrap(),
        TaskFunction::axis(arm, last, [0.3, -2.0, 1.0]).unwrap(),
        TaskFunction::relative(arm, last, middle, "xyz rz rx ry").unwrap(),
        TaskFunction::relative(arm, middle, last, "zx").unwrap(),
    ]
}

fn state(n: usize) -> (Vec<f64>, Vec<f64>) {
    let q = (0..n).map(|i| (1.0 + 1.7 * i as f64).sin()).collect();
    let v = (0..n).map(|i| (0.4 + 2.9 * i as f64).cos()).collect();
    (q, v)
}

/// Targets that are reached at `q`, with zero rates. At a zero error of rotation, the derivative of the log is the identity.
fn targets_at(arm: &Arm, stack: &mut TaskStack, q: &[f64]) -> Vec<Vec<f64>> {
    stack.place(q);
    let functions = stack.functions().to_vec();
    functions
        .iter()
        .enumerate()
        .map(|(k, function)| {
            let (m, size) = (function.rows(), function.target_size());
            let (mut e, mut w) = (vec![0.0; m], vec![0.0; m]);
            let mut desired = vec![0.0; 3 * size];
            if let TaskFunction::Axis(Axis { frame, axis, .. }) = function {
                let pose = arm_pose(arm, q, *frame);
                desired[..3].copy_from_slice(&pose.apply(*axis).array());
            } else {
                // With a target of zero, the error is minus the coordinates, if rotations are smaller than pi.
                stack.error(k, &desired, &mut e, &mut w, None);
                desired.iter_mut().zip(&e).for_each(|(x, e)| *x = -e);
            }
            desired
        })
        .collect()
}

fn arm_pose(arm: &Arm, q: &[f64], frame: usize) -> crate::spatial::Matrix3<f64> {
    let tree = crate::arm::Tree::<f64>::new(arm);
    let trig: Vec<(f64, f64)> = q.iter().map(|q| q.sin_cos()).collect();
    let mut poses = vec![Pose::identity(); q.len()];
    frame_pose(&tree, &mut poses, &trig, q, frame).0
}

fn moved(q: &[f64], v: &[f64], h: f64) -> Vec<f64> {
    q.iter().zip(v).map(|(q, v)| q + h * v).collect()
}

fn errors(stack: &mut TaskStack, targets: &[Vec<f64>], q: &[f64]) -> Vec<f64> {
    stack.place(q);
    let mut all = Vec::new();
    for (k, desired) in targets.iter().enumerate() {
        let m = stack.rows()[k];
        let (mut e, mut w) = (vec![0.0; m], vec![0.0; m]);
        stack.error(k, desired, &mut e, &mut w, None);
        all.extend(e);
    }
    all
}

fn check(name: &str) {
    let arm = arm(name);
    let (n, (q, v)) = (arm.n(), state(arm.n()));
    let mut stack = TaskStack::new(&arm, functions(&arm));
    let targets = targets_at(&arm, &mut stack, &q);
    assert!(errors(&mut stack, &targets, &q).iter().all(|e| e.abs() < 1e-14), "{name}: the targets are met");
    let total: usize = stack.rows().iter().sum();
    let (mut j, mut rate) = (vec![0.0; total * n], vec![0.0; total * n]);
    stack.place(&q);
    stack.set_moving(&v);
    stack.jacobians(&mut j);
    stack.jacobians_dot(&mut rate);
    for i in 0..n {
        let unit: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == i))).collect();
        let ahead = errors(&mut stack, &targets, &moved(&q, &unit, STEP));
        let behind = errors(&mut stack, &targets, &moved(&q, &unit, -STEP));
        for row in 0..total {
            let difference = (behind[row] - ahead[row]) / (2.0 * STEP);
            assert!((j[row * n + i] - difference).abs() < CLOSE, "{name}: row {row}, joint {i}: {} {difference}", j[row * n + i]);
        }
    }
    let mut at = |h: f64| {
        let mut j = vec![0.0; total * n];
        stack.place(&moved(&q, &v, h));
        stack.jacobians(&mut j);
        j
    };
    let (ahead, behind) = (at(STEP), at(-STEP));
    for (k, rate) in rate.iter().enumerate() {
        let difference = (ahead[k] - behind[k]) / (2.0 * STEP);
        assert!((rate - difference).abs() < CLOSE, "{name}: rate of row {}, joint {}: {rate} {difference}", k / n, k % n);
    }
}

#[test]
fn jacobians_and_rates_are_derivatives() {
    for name in ["seven_axis", "two_arms"] {
        check(name);
    }
}

#[test]
fn a_turning_direction_feeds_forward_its_own_turn() {
    let arm = arm("seven_axis");
    let (q, _) = state(arm.n());
    let last = arm.frame_names().last().unwrap().to_string();
    let mut stack = TaskStack::new(&arm, vec![TaskFunction::axis(&arm, &last, [0.0, 0.0, 1.0]).unwrap()]);
    let mut desired = targets_at(&arm, &mut stack, &q).remove(0);
    // The target is `d(t) = (2 + t) exp(t [w]x) d`, whose length has no effect. Its derivatives at `t = 0` follow.
    let (d, w) = (crate::spatial::Vector3::from([desired[0], desired[1], desired[2]]), crate::spatial::Vector3::from([0.3, -0.7, 0.2]));
    let (turn, twice) = (w.cross(d), w.cross(w.cross(d)));
    for k in 0..3 {
        desired[k] = 2.0 * d[k];
        desired[3 + k] = 2.0 * turn[k] + d[k];
        desired[6 + k] = 2.0 * twice[k] + 2.0 * turn[k];
    }
    stack.place(&q);
    let (mut e, mut v, mut a) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    stack.error(0, &desired, &mut e, &mut v, Some(&mut a));
    let TaskFunction::Axis(Axis { frame, across, .. }) = stack.functions()[0].clone() else { panic!("an axis") };
    let r = arm_pose(&arm, &q, frame);
    // The angular velocity of the direction `d` is `w - (w.d) d`, the part of `w` perpendicular to `d`. The rate of this angular velocity
    // is `-(w.d) w x d`.
    let spin_dot = turn.scale(-w.dot(d));
    for k in 0..2 {
        let b = r.apply(across[k]);
        assert!(e[k].abs() < 1e-15 && (v[k] - b.dot(w)).abs() < 1e-15 && (a[k] - b.dot(spin_dot)).abs() < 1e-15, "{v:?} {a:?}");
    }
    // For opposite directions, the rotation is half a turn about a fixed axis.
    (0..3).for_each(|k| desired[k] = -desired[k]);
    stack.error(0, &desired, &mut e, &mut v, None);
    assert!((e[0] - std::f64::consts::PI).abs() < 1e-7 && e[1].abs() < 1e-7, "{e:?}");
}

#[test]
fn joint_limits_pull_back_out_of_the_margin_alone() {
    let arm = arm("seven_axis");
    let function = TaskFunction::joint_limits(&arm, None, 0.1).unwrap();
    let TaskFunction::JointLimits(JointLimits { joints, lower, upper }) = function.clone() else { panic!("joint limits") };
    let mut stack = TaskStack::new(&arm, vec![function]);
    let mut q: Vec<f64> = vec![0.0; arm.n()];
    for (i, &joint) in joints.iter().enumerate() {
        q[joint] = [lower[i] - 0.01, upper[i] + 0.02, 0.5 * (lower[i] + upper[i])][i % 3];
    }
    let (mut e, mut w) = (vec![0.0; joints.len()], vec![1.0; joints.len()]);
    stack.place(&q);
    stack.error(0, &[], &mut e, &mut w, None);
    for (i, e) in e.iter().enumerate() {
        assert!((e - [0.01, -0.02, 0.0][i % 3]).abs() < 1e-15, "{i}: {e}");
    }
    assert!(w.iter().all(|w| *w == 0.0));
}

#[test]
fn what_no_arm_has_is_refused() {
    let arm = arm("seven_axis");
    let last = arm.frame_names().last().unwrap().to_string();
    let refused = |result: crate::error::Result<TaskFunction>, words: &str| {
        let message = result.unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    refused(TaskFunction::frame(&arm, "hand of god", "xyz"), "is unknown");
    refused(TaskFunction::frame(&arm, &last, "xq"), "axes");
    refused(TaskFunction::posture(&arm, Some(&[])), "is empty");
    refused(TaskFunction::posture(&arm, Some(&["nobody".into()])), "joints is unknown");
    refused(TaskFunction::centre_of_mass(&arm, "rx"), "names a rotation");
    refused(TaskFunction::axis(&arm, &last, [0.0; 3]), "no direction");
    refused(TaskFunction::axis(&arm, &last, [f64::NAN, 0.0, 0.0]), "not finite");
    refused(TaskFunction::relative(&arm, &last, &last, "xyz"), "the frame itself");
    refused(TaskFunction::joint_limits(&arm, None, 0.6), "margin");
    assert!(TaskFunction::axis(&arm, &last, [1e300, 0.0, 0.0]).is_ok(), "vectors of extreme length are directions");
}
