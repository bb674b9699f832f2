//! Functions of arms with very many joints check for an interrupt, and return the same bits afterwards.

use super::derivatives::{factor, solve};
use super::{Evaluator, Functions, Quantity, Query};
use crate::arm::Arm;
use crate::interrupt::{Interrupted, Watch, interruptible};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Number of joints. It exceeds 256, because loops over the rows of a matrix check for an interrupt only from row 256 on.
const JOINTS: usize = 330;

fn with_stop_requested<R>(work: impl FnOnce() -> R) -> Result<R, Interrupted> {
    interruptible(Watch::Flag(Arc::new(AtomicBool::new(true))), work)
}

fn planar(joints: usize) -> Arm {
    Arm::planar(&vec![1.0; joints], None, None, None, [0.0, -9.81]).unwrap()
}

#[test]
fn matrices_are_given_up_and_made_again() {
    let arm = planar(JOINTS);
    let mut evaluator = Evaluator::new(&arm);
    let wave = |from: f64| (0..JOINTS).map(|i| (from + 2.3 * i as f64).sin()).collect::<Vec<f64>>();
    let given = [wave(0.1), wave(0.2), wave(0.3), wave(0.4)];
    for quantity in [Quantity::MassMatrix, Quantity::CoriolisMatrix, Quantity::Regressor, Quantity::InverseDynamicsDerivatives] {
        let query = Query::from(quantity);
        let inputs: Vec<&[f64]> = given[..query.inputs().len()].iter().map(Vec::as_slice).collect();
        let mut out = vec![0.0; query.length(arm.size())];
        assert!(evaluator.one(&query, &inputs, &mut out).unwrap(), "{quantity:?}");
        let mut other = vec![0.0; out.len()];
        // The first call has allocated the buffers. So the interrupt comes from the computation, not from the allocation.
        assert!(with_stop_requested(|| evaluator.one(&query, &inputs, &mut other)).is_err(), "{quantity:?}");
        assert!(evaluator.one(&query, &inputs, &mut other).unwrap(), "{quantity:?}");
        assert!(out.iter().zip(&other).all(|(a, b)| a.to_bits() == b.to_bits()), "{quantity:?}");
    }
}

#[test]
fn a_factor_and_its_solutions_are_given_up() {
    let mut unit = vec![0.0; JOINTS * JOINTS];
    (0..JOINTS).for_each(|i| unit[i * JOINTS + i] = 1.0);
    assert!(with_stop_requested(|| factor(JOINTS, &mut unit.clone())).is_err());
    assert!(with_stop_requested(|| solve(JOINTS, &unit, &mut unit.clone(), 1.0)).is_err());
}

#[test]
fn copies_and_buffers_are_given_up() {
    let arm = planar(5000);
    assert!(with_stop_requested(|| arm.clone()).is_err());
    let tree = crate::arm::Tree::<f64>::new(&arm);
    assert!(with_stop_requested(|| super::Workspace::new(&tree)).is_err());
}

#[test]
fn buffers_of_very_many_joints_are_made_at_the_first_call() {
    const MANY: usize = 5000;
    let functions = Functions::new(Arc::new(planar(MANY)));
    let (zero, mut out) = (vec![0.0; MANY], vec![0.0; MANY]);
    // An interrupted call leaves no partial results.
    let query = Query::from(Quantity::Gravity);
    assert!(with_stop_requested(|| functions.one(&query, &[&zero], &mut out)).is_err());
    assert_eq!(functions.one(&query, &[&zero], &mut out), Ok(true));
    // The links are rods of 1 kg/m on the x axis. The sum has 5,000 rounding errors.
    assert!((out[0] / (9.81 * 0.5 * (MANY * MANY) as f64) - 1.0).abs() < 1e-10, "{}", out[0]);
}
