//! Tests of arm functions in batches: the *program* of a function (its recorded machine code) has the bits of direct evaluation, row by
//! row.

use crate::arm_common::{Rng, random_tree};
use crate::counting::counted;
use armlet_core::arm::{Arm, ChainJoint, JointKind, JointType};
use armlet_core::dynamics::{Functions, Quantity, Query};
use armlet_core::scalar::trig::REDUCTION_LIMIT;
use std::sync::Arc;

pub const ALL: [Quantity; 20] = [
    Quantity::MassMatrix,
    Quantity::CoriolisMatrix,
    Quantity::Christoffel,
    Quantity::Gravity,
    Quantity::Bias,
    Quantity::InverseDynamics,
    Quantity::ForwardDynamics,
    Quantity::Regressor,
    Quantity::Energy,
    Quantity::Pose,
    Quantity::PoseVector,
    Quantity::Position,
    Quantity::JointPoses,
    Quantity::Jacobian,
    Quantity::JacobianDot,
    Quantity::Com,
    Quantity::ComJacobian,
    Quantity::PathDynamics,
    Quantity::InverseDynamicsDerivatives,
    Quantity::ForwardDynamicsDerivatives,
];

/// The number of rows for which every program saves time.
const MANY: usize = 1_000_000;

fn bits(x: &[f64]) -> Vec<u64> {
    x.iter().map(|x| x.to_bits()).collect()
}

/// The number of single calls after which the program of a query exists.
const OFTEN: usize = 20;

/// Return a chain of `n` joints whose axes repeat the list `axes`. The fifth joint is prismatic.
fn chain(n: usize, axes: &[[f64; 3]]) -> Arc<Arm> {
    let joint = |i: usize| {
        let kind = JointType::Moving(if i == 4 { JointKind::Prismatic } else { JointKind::Revolute });
        let phi = [1.0 + 0.1 * i as f64, 0.1, 0.02, 0.0, 0.02, 0.0, 0.05, 0.0, 0.0, 0.06];
        ChainJoint::new(kind, axes[i % axes.len()], [0.0; 3], [0.3, 0.0, 0.1], phi)
    };
    Arc::new(Arm::from_chain(&(0..n).map(joint).collect::<Vec<_>>(), [0.0, 0.0, -9.81]).unwrap())
}

fn arms() -> Vec<Arc<Arm>> {
    let mut rng = Rng(31);
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let mut all = vec![chain(2, &[y]), chain(6, &[z, y, y, x, y, x])];
    all.extend([1, 5, 7, 9].map(|n| Arc::new(random_tree(&mut rng, n))));
    all
}

/// A prepared function with inputs for many rows. It computes the rows in batches or one by one.
struct Both {
    functions: Functions,
    query: Query,
    inputs: Vec<Vec<f64>>,
}

impl Both {
    fn new(arm: &Arc<Arm>, query: Query, count: usize, rng: &mut Rng) -> Self {
        let n = arm.n();
        let inputs = (0..query.inputs().len()).map(|k| rng.vector(count * query.input_length(k, n), 2.0)).collect();
        let functions = Functions::new(arm.clone());
        functions.prepare(&query, MANY).unwrap();
        Both { functions, query, inputs }
    }
    fn length(&self) -> usize {
        let (rows, columns) = self.query.shape(self.functions.arm().size());
        rows * columns
    }
    fn width(&self, k: usize) -> usize {
        self.query.input_length(k, self.functions.arm().n())
    }
    /// Return the rows `first..last`, and whether all numbers are finite.
    fn rows(&self, first: usize, last: usize) -> (Vec<f64>, bool) {
        let inputs: Vec<&[f64]> = self.inputs.iter().enumerate().map(|(k, x)| &x[first * self.width(k)..last * self.width(k)]).collect();
        let mut out = vec![f64::NAN; (last - first) * self.length()];
        let sound = self.functions.rows(&self.query, &inputs, last - first, &mut out).unwrap();
        (out, sound)
    }
    fn alone(&self, row: usize) -> Vec<f64> {
        let inputs: Vec<&[f64]> = self.inputs.iter().enumerate().map(|(k, x)| &x[row * self.width(k)..][..self.width(k)]).collect();
        let mut out = vec![f64::NAN; self.length()];
        self.functions.one(&self.query, &inputs, &mut out).unwrap();
        out
    }
}

fn queries(arm: &Arm) -> Vec<Query> {
    let frame = arm.frames.len() - 1;
    let mut all = Vec::new();
    for quantity in ALL {
        let plain = Query { frame, ..quantity.into() };
        all.extend([plain, Query { friction: true, armature: true, ..plain }]);
        if matches!(quantity, Quantity::InverseDynamics | Quantity::ForwardDynamics) {
            all.push(Query { wrench: Some(frame), ..plain });
        }
    }
    all
}

#[test]
fn rows_have_the_bits_of_single_calls() {
    let mut rng = Rng(32);
    for arm in arms() {
        for query in queries(&arm) {
            let both = Both::new(&arm, query, 11, &mut rng);
            let (all, sound) = both.rows(0, 11);
            assert!(sound, "{query:?}");
            for (row, got) in all.chunks_exact(both.length()).enumerate() {
                assert_eq!(bits(got), bits(&both.alone(row)), "{} joints, {query:?}, row {row}", arm.n());
            }
        }
    }
}

#[test]
fn a_chain_of_twenty_joints() {
    let arm = chain(20, &[[0.0, 0.6, 0.8], [0.0, 1.0, 0.0], [0.36, 0.48, 0.8]]);
    let mut rng = Rng(33);
    for quantity in [Quantity::MassMatrix, Quantity::InverseDynamics, Quantity::ForwardDynamics, Quantity::Jacobian] {
        let both = Both::new(&arm, Query { frame: arm.frames.len() - 1, ..quantity.into() }, 5, &mut rng);
        let (all, _) = both.rows(0, 5);
        for (row, got) in all.chunks_exact(both.length()).enumerate() {
            assert_eq!(bits(got), bits(&both.alone(row)), "{quantity:?}, row {row}");
        }
    }
}

#[test]
fn a_row_has_the_same_bits_among_any_others() {
    let mut rng = Rng(34);
    let arm = Arc::new(random_tree(&mut rng, 6));
    for quantity in [Quantity::ForwardDynamics, Quantity::Regressor, Quantity::Position] {
        let both = Both::new(&arm, quantity.into(), 23, &mut rng);
        let (all, length) = (both.rows(0, 23).0, both.length());
        for first in [0, 1, 5, 9] {
            for count in 1..=9 {
                assert_eq!(bits(&both.rows(first, first + count).0), bits(&all[first * length..][..count * length]), "{first} {count}");
            }
        }
    }
}

#[test]
fn angles_beyond_reason_and_rows_that_overflow_are_answered_directly() {
    let mut rng = Rng(35);
    let arm = Arc::new(random_tree(&mut rng, 5));
    let mut both = Both::new(&arm, Quantity::Bias.into(), 14, &mut rng);
    let turn = arm.joints.iter().position(|joint| joint.kind.is_angle()).unwrap();
    let before = both.rows(0, 14);
    assert!(before.1);
    both.inputs[0][5 * 3 + turn] = 3.0 * REDUCTION_LIMIT;
    both.inputs[0][5 * 12 + turn] = -1e15;
    let (got, sound) = both.rows(0, 14);
    assert!(sound);
    let same = |rows: &[f64], row: usize| bits(&rows[5 * row..5 * row + 5]) == bits(&both.alone(row));
    assert!((0..14).all(|row| same(&got, row)));
    // A velocity of 1e200 makes row 8 overflow. The other rows must remain finite.
    both.inputs[1][5 * 8 + turn] = 1e200;
    let (got, sound) = both.rows(0, 14);
    assert!(!sound, "a row overflows");
    assert!((0..14).filter(|row| *row != 8).all(|row| got[5 * row..5 * row + 5].iter().all(|x| x.is_finite())));
    assert!(got[40..45].iter().any(|x| !x.is_finite()));
    // Numbers that are not finite are refused, and the error names their argument.
    both.inputs[1][7] = f64::NAN;
    let inputs = [&both.inputs[0][..], &both.inputs[1]];
    let refused = both.functions.rows(&both.query, &inputs, 14, &mut [0.0; 70]).unwrap_err().to_string();
    assert!(refused.contains("v") && refused.contains("first bad index 7"), "{refused}");
}

#[test]
fn a_singular_mass_matrix_is_told_as_by_single_calls() {
    // The two joints are coaxial. Only the sum of their angles moves a body.
    let still = ChainJoint::new(JointType::Moving(JointKind::Revolute), [0.0, 0.0, 1.0], [0.0; 3], [0.0; 3], [0.0; 10]);
    let mut body = still.clone();
    body.phi = [1.0, 0.2, 0.0, 0.0, 0.01, 0.0, 0.06, 0.0, 0.0, 0.07];
    let arm = Arc::new(Arm::from_chain(&[still, body], [0.0, -9.81, 0.0]).unwrap());
    let both = Both::new(&arm, Quantity::ForwardDynamics.into(), 6, &mut Rng(36));
    let (got, sound) = both.rows(0, 6);
    assert!(!sound);
    for (row, got) in got.chunks_exact(2).enumerate() {
        assert_eq!(bits(got), bits(&both.alone(row)), "{row}");
    }
}

#[test]
fn rows_do_not_allocate_once_their_program_is_there() {
    let mut rng = Rng(37);
    let arm = Arc::new(random_tree(&mut rng, 6));
    for quantity in [Quantity::MassMatrix, Quantity::InverseDynamics, Quantity::Regressor] {
        let both = Both::new(&arm, quantity.into(), 19, &mut rng);
        let (mut out, inputs) = (both.rows(0, 19).0, both.inputs.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let ((), count) = counted(|| {
            for _ in 0..3 {
                both.functions.rows(&both.query, &inputs, 19, &mut out).unwrap();
            }
        });
        assert_eq!(count, 0, "{quantity:?}");
    }
}

#[test]
fn single_calls_have_the_same_bits_before_and_after_their_program() {
    let mut rng = Rng(38);
    for arm in arms() {
        for query in queries(&arm) {
            let mut both = Both::new(&arm, query, OFTEN, &mut rng);
            let first: Vec<Vec<u64>> = (0..OFTEN).map(|row| bits(&both.alone(row))).collect();
            // The allocations are the vectors of inputs and of the result above. One call can also make a long program, when its time is repaid.
            let calls = [(); 2].map(|()| counted(|| both.alone(0)));
            let count = calls.iter().map(|call| call.1).min().unwrap();
            assert!(count <= 2, "{query:?}: {count} allocations");
            assert!(calls.iter().all(|(again, _)| bits(again) == first[0]));
            assert!((1..OFTEN).all(|row| bits(&both.alone(row)) == first[row]), "{} joints, {query:?}", arm.n());
            // Huge angles, numbers that are not finite and arguments of the wrong length must have the same result as in the first call.
            let fresh = Functions::new(arm.clone());
            for bad in [5e6, f64::INFINITY, 1e308] {
                both.inputs[0][0] = bad;
                let inputs: Vec<&[f64]> = both.inputs.iter().enumerate().map(|(k, x)| &x[..both.width(k)]).collect();
                let compute = |functions: &Functions| {
                    let mut out = vec![0.0; both.length()];
                    functions.one(&query, &inputs, &mut out).map(|sound| (sound, bits(&out))).map_err(|error| error.to_string())
                };
                let (one, other) = (compute(&fresh), compute(&both.functions));
                assert_eq!(one, other, "{query:?} {bad}");
            }
            assert!(both.functions.one(&query, &[], &mut []).is_err());
        }
    }
}

#[test]
fn few_rows_go_directly_and_programs_come_when_they_are_repaid() {
    let arm = chain(2, &[[0.0, 1.0, 0.0]]);
    let functions = Functions::new(arm);
    let query = Query::from(Quantity::Gravity);
    assert!(!functions.is_due(&query, 100));
    functions.prepare(&query, 100).unwrap();
    functions.prepare(&query, 100).unwrap();
    assert!(functions.is_due(&query, 100) && !functions.is_due(&Quantity::Bias.into(), 100));
    functions.prepare(&query, 100).unwrap();
    assert!(!functions.is_due(&query, 100), "made, and not to be made again");
}
