//! Tests of decompositions: Penrose conditions, orthonormality and relative accuracy. The decompositions must terminate for every input.

use crate::priority_support::{Random, apart, norm, product};
use armlet_core::error::Error;
use armlet_core::linalg::{Svd, null_basis, pinv, symmetric_eigen};

fn transpose(a: &[f64], m: usize, k: usize) -> Vec<f64> {
    (0..k).flat_map(|c| (0..m).map(move |r| r * k + c)).map(|at| a[at]).collect()
}

/// Return a matrix of random size and rank. Rows beyond the rank are combinations of the previous rows.
fn matrix(random: &mut Random) -> (Vec<f64>, usize, usize, usize) {
    let (m, k) = (1 + random.below(9), 1 + random.below(9));
    let rank = random.below(m.min(k) + 1);
    let a = product(&random.normals(m * rank), &random.normals(rank * k), rank.max(1), k);
    (if rank == 0 { vec![0.0; m * k] } else { a }, m, k, rank)
}

#[test]
fn penrose_conditions_hold_at_every_rank() {
    let mut random = Random::new(4);
    for _ in 0..2000 {
        let (a, m, k, rank) = matrix(&mut random);
        let mut svd = Svd::new(m, k);
        svd.decompose(&a, m, k).unwrap();
        let largest = svd.s()[0];
        // Singular values below `cut` are rounding errors. Matrices with small true singular values are not tested.
        let cut = 1e-13 * largest;
        if svd.s().iter().any(|s| *s > cut && *s < 1e-6 * largest) {
            continue;
        }
        assert_eq!(svd.rank(cut), rank, "{:?}", svd.s());
        let x = pinv(&a, m, k, cut).unwrap();
        let (ax, xa) = (product(&a, &x, k, m), product(&x, &a, m, k));
        // The tolerance is the rounding error of the products, multiplied with the condition number, which is at most 1e6.
        let tolerance = 1e-8 * (1.0 + norm(&x)) * (1.0 + norm(&a));
        assert!(apart(&product(&ax, &a, m, k), &a) <= tolerance);
        assert!(apart(&product(&xa, &x, k, m), &x) <= tolerance);
        assert!(apart(&ax, &transpose(&ax, m, m)) <= tolerance);
        assert!(apart(&xa, &transpose(&xa, k, k)) <= tolerance);
        let n = null_basis(&a, m, k, cut).unwrap();
        assert_eq!(n.len(), (k - rank) * k);
        if rank < k {
            assert!(norm(&product(&a, &transpose(&n, k - rank, k), k, k - rank)) <= 1e-14 * (1.0 + norm(&a)));
        }
    }
}

#[test]
fn factors_are_orthonormal_and_reproduce_the_matrix() {
    let mut random = Random::new(5);
    for trial in 0..2000 {
        let (mut a, m, k, _) = matrix(&mut random);
        let scale = [1.0, 1e-300, 1e300, 1e-160, 1e100][trial % 5];
        a.iter_mut().for_each(|x| *x *= scale);
        let mut svd = Svd::new(9, 9);
        svd.decompose(&a, m, k).unwrap();
        assert!(svd.s().windows(2).all(|w| w[0] >= w[1]));
        for i in 0..k {
            for j in 0..k {
                let dot: f64 = svd.v(i).iter().zip(svd.v(j)).map(|(x, y)| x * y).sum();
                // The reflections and rotations have rounding errors.
                assert!((dot - if i == j { 1.0 } else { 0.0 }).abs() <= 1e-14, "V at scale {scale}");
            }
        }
        let mut back = vec![0.0; m * k];
        for j in 0..m.min(k) {
            for r in 0..m {
                (0..k).for_each(|c| back[r * k + c] += svd.s()[j] * svd.u(j)[r] * svd.v(j)[c]);
            }
        }
        // Subnormal entries have fewer digits.
        assert!(apart(&back, &a) <= 1e-14 * svd.s()[0] + 1e-320, "A at scale {scale}: {back:?} {a:?}");
    }
}

#[test]
fn tiny_singular_values_of_graded_rows_keep_their_digits() {
    // With A = diag(1, 1e-8, 1e-16) Q and orthonormal rows of Q, the singular values are 1, 1e-8 and 1e-16 to relative precision.
    let q = [[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]];
    let a: Vec<f64> = (0..3).flat_map(|i| q[i].iter().map(move |x| x / 3.0 * 10f64.powi(-8 * i as i32))).collect();
    let mut svd = Svd::new(3, 3);
    svd.decompose(&a, 3, 3).unwrap();
    for (s, want) in svd.s().iter().zip([1.0, 1e-8, 1e-16]) {
        assert!((s / want - 1.0).abs() < 1e-14, "{s} instead of {want}");
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for at in 0..4 {
            let mut a = [1.0, 2.0, 3.0, 4.0];
            a[at] = bad;
            for error in [Svd::new(2, 2).decompose(&a, 2, 2).unwrap_err(), symmetric_eigen(&a, 2).unwrap_err()] {
                assert!(matches!(&error, Error::Input { .. }) && error.to_string().contains(&format!("first bad index {at}")), "{error}");
            }
        }
    }
    assert!(Svd::new(2, 2).decompose(&[0.0; 6], 3, 2).is_err());
}

#[test]
fn eigenvalues_of_symmetric_matrices() {
    let mut random = Random::new(6);
    for n in 1..9 {
        for trial in 0..100 {
            let b = random.normals(n * n);
            let mut s: Vec<f64> = (0..n * n).map(|at| b[at] + b[at % n * n + at / n]).collect();
            if trial % 4 == 0 {
                // This matrix has repeated eigenvalues.
                s = (0..n * n).map(|at| if at / n == at % n { 2.0 } else { 1.0 }).collect();
            }
            let (values, vectors) = symmetric_eigen(&s, n).unwrap();
            assert!(values.windows(2).all(|w| w[0] <= w[1]));
            for i in 0..n {
                let v = &vectors[i * n..(i + 1) * n];
                let sv = product(&s, v, n, 1);
                let lv: Vec<f64> = v.iter().map(|x| x * values[i]).collect();
                assert!(apart(&sv, &lv) <= 1e-13 * (1.0 + norm(&s)) && (norm(v) - 1.0).abs() <= 1e-14);
            }
        }
    }
}
