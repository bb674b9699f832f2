//! Nothing allocates between the making of an evaluator and its end.

mod arm_common;

use arm_common::{Rng, random_tree};
use armlet_core::dynamics::{Evaluator, Quantity, Query};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const ALL: [Quantity; 16] = [
    Quantity::MassMatrix,
    Quantity::CoriolisMatrix,
    Quantity::Gravity,
    Quantity::Bias,
    Quantity::InverseDynamics,
    Quantity::ForwardDynamics,
    Quantity::Regressor,
    Quantity::Energy,
    Quantity::Pose,
    Quantity::Position,
    Quantity::Jacobian,
    Quantity::JacobianDot,
    Quantity::Com,
    Quantity::ComJacobian,
    Quantity::InverseDynamicsDerivatives,
    Quantity::ForwardDynamicsDerivatives,
];

#[test]
fn evaluation_does_not_allocate() {
    let mut rng = Rng(1);
    let arm = random_tree(&mut rng, 7);
    let mut evaluator = Evaluator::new(&arm);
    let numbers = rng.vector(7, 1.0);
    for quantity in ALL {
        let query = Query { frame: arm.frames.len() - 1, friction: true, armature: true, ..quantity.into() };
        let (rows, columns) = query.shape(7);
        let mut out = vec![f64::NAN; rows * columns];
        let inputs = [&numbers[..]; 4];
        let before = COUNT.with(Cell::get);
        for _ in 0..3 {
            evaluator.one(&query, &inputs[..query.inputs().len()], &mut out).unwrap();
        }
        assert_eq!(COUNT.with(Cell::get) - before, 0, "{quantity:?}");
        assert!(out.iter().all(|x| x.is_finite()), "{quantity:?}");
    }
    // The counter counts.
    let before = COUNT.with(Cell::get);
    drop(std::hint::black_box(vec![1.0; 3]));
    assert_eq!(COUNT.with(Cell::get) - before, 1);
}
