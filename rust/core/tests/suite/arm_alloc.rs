//! Test that an evaluator does not allocate after its construction.

use crate::arm_common::{Rng, random_tree};
use crate::arm_functions::ALL;
use crate::counting::counted;
use armlet_core::dynamics::{Evaluator, Query, Size};

#[test]
fn evaluation_does_not_allocate() {
    let mut rng = Rng(1);
    let arm = random_tree(&mut rng, 7);
    let mut evaluator = Evaluator::new(&arm);
    let numbers = rng.vector(7, 1.0);
    for quantity in ALL {
        let query = Query { frame: arm.frames.len() - 1, friction: true, armature: true, ..quantity.into() };
        let (rows, columns) = query.shape(Size { n: 7, bodies: 7 });
        let mut out = vec![f64::NAN; rows * columns];
        let inputs = [&numbers[..]; 4];
        let ((), count) = counted(|| {
            for _ in 0..3 {
                evaluator.one(&query, &inputs[..query.inputs().len()], &mut out).unwrap();
            }
        });
        assert_eq!(count, 0, "{quantity:?}");
        assert!(out.iter().all(|x| x.is_finite()), "{quantity:?}");
    }
}
