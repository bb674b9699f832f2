//! Tests of textbook arms, of arms made from other arms, and of the evaluator on `f64` arrays. References are closed forms and other
//! methods.

use crate::arm_common;

use crate::arm_common::{Rng, close, random_tree};
use armlet_core::arm::{Arm, ChainJoint, Convention, DhRow, JointKind, JointType, STANDARD_GRAVITY};
use armlet_core::dynamics::{Evaluator, Quantity, Query};
use armlet_core::error::Error;

fn compute(arm: &Arm, query: impl Into<Query>, inputs: &[&[f64]]) -> Vec<f64> {
    let query = query.into();
    let (rows, columns) = query.shape(arm.size());
    let mut out = vec![f64::NAN; rows * columns];
    Evaluator::new(arm).one(&query, inputs, &mut out).unwrap();
    out
}

fn at(arm: &Arm, quantity: Quantity, frame: &str, q: &[f64]) -> Vec<f64> {
    compute(arm, Query { frame: arm.frame_index(frame).unwrap(), ..quantity.into() }, &[q])
}

#[track_caller]
fn refused<T: std::fmt::Debug>(result: Result<T, Error>, argument: &str, word: &str) {
    match result {
        Err(error) => assert!(error.argument() == Some(argument) && error.to_string().contains(word), "{error}"),
        Ok(other) => panic!("{other:?}"),
    }
}

#[test]
fn pendulum_is_its_equation() {
    for (inertia, moment) in [(1.0, 1.0), (0.3, 5.0), (2.0, 0.0), (1.0, -2.0)] {
        let arm = Arm::pendulum(inertia, moment).unwrap();
        for theta in [0.0f64, 1e-8, 1.0, -2.0, std::f64::consts::FRAC_PI_2, 9.0] {
            let tau = compute(&arm, Quantity::InverseDynamics, &[&[theta], &[3.0], &[0.7]]);
            close("tau", &tau, &[inertia * 0.7 + moment * theta.sin()], 1e-15, moment.abs() + inertia);
        }
    }
    refused(Arm::pendulum(0.0, 1.0), "inertia", "is not positive");
    refused(Arm::pendulum(1.0, f64::NAN), "gravity_moment", "not finite");
}

#[test]
fn planar_arms() {
    // The tip and the elbow of an arm with links of 1, 1, 0.25 and 0.25 m.
    let arm = Arm::planar(&[1.0, 1.0, 0.25, 0.25], None, None, None, [0.0, -9.81]).unwrap();
    let half = std::f64::consts::FRAC_PI_2;
    let q = [0.0, half, half, 0.0];
    close("tip", &at(&arm, Quantity::Position, "link4", &q), &[0.5, 1.0, 0.0], 1e-15, 1.0);
    close("elbow", &at(&arm, Quantity::Position, "link2", &q), &[1.0, 1.0, 0.0], 1e-15, 1.0);
    let j = at(&arm, Quantity::Jacobian, "link4", &q);
    close("J1 x", &j[..4], &[-1.0, -1.0, 0.0, 0.0], 1e-15, 1.0);
    close("J1 y", &j[4..8], &[0.5, -0.5, -0.5, -0.25], 1e-15, 1.0);
    // A uniform rod has M = m l^2 / 3 and, if it is horizontal, g = m g l / 2. Here m = l.
    let rod = Arm::planar(&[0.8], None, None, None, [0.0, -9.81]).unwrap();
    close("M", &compute(&rod, Quantity::MassMatrix, &[&[0.3]]), &[0.8f64.powi(3) / 3.0], 1e-15, 0.1);
    close("g", &compute(&rod, Quantity::Gravity, &[&[0.0]]), &[9.81 * 0.32], 1e-15, 1.0);
    let given = Arm::planar(&[0.8], Some(&[2.0]), Some(&[0.3]), Some(&[0.05]), [0.0, 0.0]).unwrap();
    close("M", &compute(&given, Quantity::MassMatrix, &[&[0.3]]), &[0.05 + 2.0 * 0.09], 1e-15, 0.1);
    refused(Arm::planar(&[1.0, 1.0], Some(&[1.0]), None, None, [0.0; 2]), "masses", "expected 2");
    refused(Arm::planar(&[], None, None, None, [0.0; 2]), "lengths", "is empty");
    refused(Arm::planar(&[1.0], None, None, Some(&[f64::INFINITY]), [0.0; 2]), "inertias", "not finite");
}

/// Return `Rz(theta) Tz(d) Tx(a) Rx(alpha)`, or Craig's order of these matrices, as a matrix product.
fn dh_by_hand(rows: &[DhRow], q: &[f64], convention: Convention) -> [[f64; 4]; 4] {
    let mul = |a: [[f64; 4]; 4], b: [[f64; 4]; 4]| -> [[f64; 4]; 4] {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
    };
    let mut t: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j)));
    for (row, q) in rows.iter().zip(q) {
        let turning = row.kind != JointKind::Prismatic;
        let (theta, d) = if turning { (row.theta + q, row.d) } else { (row.theta, row.d + q) };
        let ((s, c), (sa, ca)) = (theta.sin_cos(), row.alpha.sin_cos());
        let z = [[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, d], [0.0, 0.0, 0.0, 1.0]];
        let x = [[1.0, 0.0, 0.0, row.a], [0.0, ca, -sa, 0.0], [0.0, sa, ca, 0.0], [0.0, 0.0, 0.0, 1.0]];
        t = if convention == Convention::Standard { mul(mul(t, z), x) } else { mul(mul(t, x), z) };
    }
    t
}

#[test]
fn denavit_hartenberg_rows() {
    let mut rng = Rng(21);
    for convention in [Convention::Standard, Convention::Modified] {
        let kinds = [JointKind::Revolute, JointKind::Prismatic, JointKind::Continuous, JointKind::Revolute, JointKind::Prismatic];
        let rows: Vec<DhRow> = kinds
            .into_iter()
            .map(|kind| DhRow {
                kind,
                a: rng.unit(),
                alpha: 3.0 * rng.unit(),
                d: rng.unit(),
                theta: 3.0 * rng.unit(),
                phi: arm_common::body(&mut rng),
            })
            .collect();
        let arm = Arm::from_dh(&rows, convention, STANDARD_GRAVITY).unwrap();
        let q = rng.vector(5, 2.0);
        for k in 1..=5 {
            let pose = at(&arm, Quantity::Pose, &format!("link{k}"), &q);
            close("pose", &pose, dh_by_hand(&rows[..k], &q, convention).as_flattened(), 1e-14, 1.0);
        }
        // Parameters are about the Denavit-Hartenberg frame. So the centre of mass of the last body is h / m in this frame.
        let mut only = rows.clone();
        for row in &mut only[..4] {
            row.phi = [0.0; 10];
        }
        let com = compute(&Arm::from_dh(&only, convention, STANDARD_GRAVITY).unwrap(), Quantity::Com, &[&q]);
        let (t, phi) = (dh_by_hand(&rows, &q, convention), rows[4].phi);
        let want: Vec<f64> = (0..3).map(|i| t[i][3] + (0..3).map(|k| t[i][k] * phi[1 + k] / phi[0]).sum::<f64>()).collect();
        close("com", &com, &want, 1e-14, 1.0);
    }
    refused(Convention::parse("craig"), "convention", "expected one of standard, modified");
}

#[test]
fn payload_is_a_body_fixed_to_a_frame() {
    let mut rng = Rng(31);
    let arm = random_tree(&mut rng, 5).with_frame("tool", "link3", [0.3, -1.0, 2.0], [0.1, 0.2, -0.3]).unwrap();
    let (mass, com, inertia) = (1.7, [0.05, -0.02, 0.1], [[0.02, 0.001, 0.0], [0.001, 0.03, -0.002], [0.0, -0.002, 0.04]]);
    let loaded = arm.with_payload("tool", mass, com, inertia).unwrap();
    let (q, v) = (rng.vector(5, 2.0), rng.vector(5, 1.0));
    // Compute the kinetic energy of the payload from the Jacobian of its frame.
    let pose = at(&arm, Quantity::Pose, "tool", &q);
    let j = at(&arm, Quantity::Jacobian, "tool", &q);
    let twist: Vec<f64> = (0..6).map(|r| (0..5).map(|k| j[5 * r + k] * v[k]).sum()).collect();
    let turned = |x: &[f64]| -> Vec<f64> { (0..3).map(|c| (0..3).map(|r| pose[4 * r + c] * x[r]).sum()).collect() };
    let (u, w) = (turned(&twist[..3]), turned(&twist[3..]));
    let at_com = [u[0] + w[1] * com[2] - w[2] * com[1], u[1] + w[2] * com[0] - w[0] * com[2], u[2] + w[0] * com[1] - w[1] * com[0]];
    let spin: f64 = (0..3).map(|i| (0..3).map(|k| w[i] * inertia[i][k] * w[k]).sum::<f64>()).sum();
    let extra = 0.5 * (mass * at_com.iter().map(|x| x * x).sum::<f64>() + spin);
    let kinetic = |arm: &Arm| compute(arm, Quantity::Energy, &[&q, &v])[0];
    close("kinetic energy", &[kinetic(&loaded) - kinetic(&arm)], &[extra], 1e-12, 1.0);
    refused(arm.with_payload("tool", -1.0, com, inertia), "mass", "is negative");
    refused(arm.with_payload("tool", 1.0, com, [[1.0, 2.0, 0.0], [0.0; 3], [0.0; 3]]), "inertia", "not symmetric");
    refused(arm.with_payload("nose", 1.0, com, inertia), "frame", "tool");
    refused(arm.with_frame("tool", "link1", [0.0; 3], [0.0; 3]), "name", "is taken");
}

#[test]
fn locked_joints_hold_their_value() {
    let mut rng = Rng(41);
    for n in [3, 6, 9] {
        let arm = random_tree(&mut rng, n);
        let (q, v, a) = (rng.vector(n, 2.0), rng.vector(n, 1.0), rng.vector(n, 1.0));
        let held = [0, n / 2];
        let names: Vec<(&str, f64)> = held.iter().map(|&k| (arm.joints[k].name.as_str(), q[k])).collect();
        let locked = arm.locked(&names).unwrap();
        let free: Vec<usize> = (0..n).filter(|k| !held.contains(k)).collect();
        let pick = |x: &[f64]| -> Vec<f64> { free.iter().map(|&k| x[k]).collect() };
        let still = |x: &[f64]| -> Vec<f64> { (0..n).map(|k| if held.contains(&k) { 0.0 } else { x[k] }).collect() };
        let full = compute(&arm, Quantity::InverseDynamics, &[&q, &still(&v), &still(&a)]);
        close("tau", &compute(&locked, Quantity::InverseDynamics, &[&pick(&q), &pick(&v), &pick(&a)]), &pick(&full), 1e-12, 1.0);
        for frame in arm.frame_names() {
            close(frame, &at(&locked, Quantity::Pose, frame, &pick(&q)), &at(&arm, Quantity::Pose, frame, &q), 1e-13, 1.0);
        }
    }
    refused(random_tree(&mut rng, 2).locked(&[("elbow", 0.0)]), "joint", "joint1");
}

#[test]
fn chains_refuse_what_they_cannot_use() {
    let joint = |axis: [f64; 3]| ChainJoint::new(JointType::Moving(JointKind::Revolute), axis, [0.0; 3], [0.0; 3], [0.0; 10]);
    let build = |list: &[ChainJoint]| Arm::from_chain(list, STANDARD_GRAVITY);
    refused(build(&[joint([0.0; 3])]), "joints[0].axis", "is zero");
    refused(build(&[joint([0.0, f64::NAN, 1.0])]), "joints[0].axis", "first bad index 1");
    refused(build(&[ChainJoint { parent: Some(Some(0)), ..joint([0.0, 0.0, 1.0]) }]), "joints[0].parent", "not an earlier joint");
    let named = ChainJoint { name: Some("a".into()), ..joint([0.0, 0.0, 1.0]) };
    refused(build(&[named.clone(), named]), "joints[1].name", "duplicate");
    refused(Arm::from_chain(&[], [0.0, 0.0, f64::INFINITY]), "gravity", "not finite");
    // An axis may have any length.
    for scale in [5e-324, 1e-200, 1e300] {
        assert_eq!(build(&[joint([0.0, -scale, 0.0])]).unwrap().joints[0].axis, [0.0, -1.0, 0.0]);
    }
    let arm = build(&[joint([3.0, 0.0, 4.0])]).unwrap();
    close("axis", &arm.joints[0].axis, &[0.6, 0.0, 0.8], 1e-16, 1.0);
    refused(arm.with_parameters(&[0.0; 9]), "parameters", "expected 10");
    refused(arm.with_parameters(&[f64::NAN; 10]), "parameters", "not finite");
    assert_eq!(arm.with_parameters(&[7.0; 10]).unwrap().parameters(), [7.0; 10]);
    refused(build(&[]), "joints", "is empty");
}

#[test]
fn evaluator_options() {
    let mut rng = Rng(51);
    let arm = random_tree(&mut rng, 6);
    let n = 6;
    let [q, v, a] = std::array::from_fn(|_| rng.vector(n, 1.5));
    let plain = compute(&arm, Quantity::InverseDynamics, &[&q, &v, &a]);
    let rubbing = Query { friction: true, ..Quantity::InverseDynamics.into() };
    let with = compute(&arm, rubbing, &[&q, &v, &a]);
    let want: Vec<f64> = (0..n).map(|k| plain[k] + arm.joints[k].damping * v[k] + arm.joints[k].friction * v[k].signum()).collect();
    close("friction", &with, &want, 1e-14, 1.0);
    let acceleration = compute(&arm, Query { friction: true, ..Quantity::ForwardDynamics.into() }, &[&q, &v, &with]);
    close("forward with friction", &acceleration, &a, 1e-9, 1.0);
    // After the inertial parameters, there are columns for armature, damping and friction, in this order.
    let y = compute(&arm, Query { friction: true, armature: true, ..Quantity::Regressor.into() }, &[&q, &v, &v, &a]);
    let mut pi = arm.parameters();
    pi.extend(arm.joints.iter().map(|j| j.armature));
    pi.extend(arm.joints.iter().map(|j| j.damping));
    pi.extend(arm.joints.iter().map(|j| j.friction));
    let y_pi: Vec<f64> = (0..n).map(|i| (0..pi.len()).map(|k| y[i * pi.len() + k] * pi[k]).sum()).collect();
    close("Y pi", &y_pi, &with, 1e-13, 1.0);
    // A wrench and its joint torque J' F must have the same effect, in inverse and in forward dynamics.
    let frame = arm.frames.len() - 1;
    let wrench = rng.vector(6, 2.0);
    let pushed = Query { wrench: Some(frame), ..Quantity::InverseDynamics.into() };
    let tau = compute(&arm, pushed, &[&q, &v, &a, &wrench]);
    let j = compute(&arm, Query { frame, ..Quantity::Jacobian.into() }, &[&q]);
    let want: Vec<f64> = (0..n).map(|k| plain[k] - (0..6).map(|r| j[r * n + k] * wrench[r]).sum::<f64>()).collect();
    close("tau = ID - J' F", &tau, &want, 1e-13, 1.0);
    let acceleration = compute(&arm, Query { wrench: Some(frame), ..Quantity::ForwardDynamics.into() }, &[&q, &v, &tau, &wrench]);
    close("forward with a wrench", &acceleration, &a, 1e-9, 1.0);
    let mut evaluator = Evaluator::new(&arm);
    let mut out = [0.0; 36];
    refused(evaluator.one(&Quantity::MassMatrix.into(), &[&q[..5]], &mut out), "q", "expected 6, got 5");
    refused(evaluator.one(&Quantity::MassMatrix.into(), &[&q], &mut out[..35]), "out", "expected 36, got 35");
    refused(evaluator.one(&Quantity::MassMatrix.into(), &[&q, &v], &mut out), "inputs", "expected 1 (q), got 2");
    refused(evaluator.one(&Query { frame: 99, ..Quantity::Jacobian.into() }, &[&q], &mut out), "frame", "out of range");
    refused(evaluator.one(&Quantity::Gravity.into(), &[&[0.0, 0.0, f64::NAN, 0.0, 0.0, 0.0]], &mut out[..6]), "q", "first bad index 2");
}
