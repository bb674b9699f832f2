//! Comparison of decompositions in `armlet_core::linalg` and nalgebra: time, and error of the smallest singular value of graded matrices.
//! `cargo run --release --example linear_algebra` prints the table of `docs/adr/0002-dependencies.md`.

use armlet_core::linalg::{Svd, cholesky, lu, symmetric_eigen};
use nalgebra::{DMatrix, DVector};
use std::hint::black_box;
use std::time::Instant;

/// The number of rounds. The printed time is the time of the fastest round.
const ROUNDS: usize = 15;

/// Return `count` reproducible numbers between -1 and 1, the entries of a row-major matrix.
fn numbers(count: usize) -> Vec<f64> {
    let mut state = 1_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

/// Return the time of one call in the fastest round, s.
fn time(mut call: impl FnMut()) -> f64 {
    const CALLS: u32 = 2_000;
    let round = |_| {
        let begin = Instant::now();
        (0..CALLS).for_each(|_| call());
        begin.elapsed().as_secs_f64() / f64::from(CALLS)
    };
    (0..ROUNDS).map(round).fold(f64::INFINITY, f64::min)
}

fn row(name: &str, own: f64, theirs: f64) {
    println!("| {name} | {:.0} | {:.0} | {:.2} |", own * 1e9, theirs * 1e9, theirs / own);
}

/// Return the positive definite matrix `A A' + n I`.
fn definite(n: usize) -> Vec<f64> {
    let a = DMatrix::from_row_slice(n, n, &numbers(n * n));
    (&a * a.transpose() + DMatrix::identity(n, n) * n as f64).as_slice().to_vec()
}

fn times() {
    println!("| decomposition | armlet, ns | nalgebra, ns | ratio |\n|---|---:|---:|---:|");
    for (m, k) in [(3, 7), (6, 7), (12, 30)] {
        let a = numbers(m * k);
        let mut svd = Svd::new(m, k);
        let own = time(|| svd.decompose(black_box(&a), m, k).expect("finite"));
        let theirs = time(|| {
            black_box(DMatrix::from_row_slice(m, k, black_box(&a)).try_svd(true, true, f64::EPSILON, 1000));
        });
        row(&format!("singular values, {m} x {k}, with vectors"), own, theirs);
    }
    for n in [7, 14, 28] {
        let (a, b) = (definite(n), numbers(n));
        let (mut factor, mut pivots, mut x) = (a.clone(), vec![0; n], b.clone());
        let own = time(|| {
            factor.copy_from_slice(black_box(&a));
            assert!(lu::decompose(n, &mut factor, &mut pivots, || false));
            x.copy_from_slice(&b);
            lu::solve(n, &factor, &pivots, &mut x);
            black_box(&x);
        });
        let theirs = time(|| {
            let factor = DMatrix::from_row_slice(n, n, black_box(&a)).lu();
            black_box(factor.solve(&DVector::from_row_slice(&b)));
        });
        row(&format!("LU and one solve, {n} x {n}"), own, theirs);
        let own = time(|| {
            let factor = cholesky::factor(n, black_box(&a)).expect("definite");
            x.copy_from_slice(&b);
            cholesky::solve(n, &factor, &mut x);
            black_box(&x);
        });
        let theirs = time(|| {
            let factor = DMatrix::from_row_slice(n, n, black_box(&a)).cholesky().expect("definite");
            black_box(factor.solve(&DVector::from_row_slice(&b)));
        });
        row(&format!("Cholesky and one solve, {n} x {n}"), own, theirs);
        let own = time(|| {
            black_box(symmetric_eigen(black_box(&a), n).expect("finite"));
        });
        let theirs = time(|| {
            black_box(DMatrix::from_row_slice(n, n, black_box(&a)).try_symmetric_eigen(f64::EPSILON, 1000));
        });
        row(&format!("symmetric eigenvalues and vectors, {n} x {n}"), own, theirs);
    }
}

/// Print the error of the smallest singular value, or of the product of the eigenvalues, of matrices with scales from 1 to 1e-12.
fn errors() {
    println!("\n| smallest value of a graded matrix, relative error | armlet | nalgebra |\n|---|---:|---:|");
    let n = 6;
    let scale: Vec<f64> = (0..n).map(|i| 10f64.powf(-12.0 * i as f64 / (n - 1) as f64)).collect();
    // If Q has orthonormal rows, the singular values of D Q are the entries of D.
    let q = DMatrix::from_row_slice(n, n, &numbers(n * n)).qr().q();
    let a: Vec<f64> = (0..n * n).map(|at| scale[at / n] * q[(at / n, at % n)]).collect();
    let mut svd = Svd::new(n, n);
    svd.decompose(&a, n, n).expect("finite");
    let theirs = DMatrix::from_row_slice(n, n, &a).singular_values().min();
    let error = |x: f64, want: f64| (x / want - 1.0).abs();
    println!("| singular values of D Q | {:.1e} | {:.1e} |", error(svd.s()[n - 1], scale[n - 1]), error(theirs, scale[n - 1]));
    // The product of the eigenvalues of D S D is its determinant |D|^2 |S|. S has ones on its diagonal and 0.1 elsewhere, so that |S| = (1
    // - 0.1)^(n - 1) (1 + 0.1 (n - 1)).
    for (name, order) in [("falling", [0, 1, 2, 3, 4, 5]), ("rising", [5, 4, 3, 2, 1, 0]), ("mixed", [3, 0, 5, 1, 4, 2])] {
        let root = |i: usize| scale[order[i]].sqrt();
        let s: Vec<f64> = (0..n * n).map(|at| if at / n == at % n { 1.0 } else { 0.1 } * root(at / n) * root(at % n)).collect();
        let product = |values: &[f64]| values.iter().map(|x| x.abs().log10()).sum::<f64>();
        let want = scale.iter().map(|x| x.log10()).sum::<f64>() + (n - 1) as f64 * 0.9f64.log10() + (1.0 + 0.1 * (n - 1) as f64).log10();
        let (own, _) = symmetric_eigen(&s, n).expect("finite");
        let theirs = DMatrix::from_row_slice(n, n, &s).symmetric_eigenvalues();
        let error = |values: &[f64]| (10f64.powf(product(values) - want) - 1.0).abs();
        println!("| product of the eigenvalues of D S D, {name} | {:.1e} | {:.1e} |", error(&own), error(theirs.as_slice()));
    }
    // The matrix [[1, 1e-7], [1e-7, 2e-14]] has the determinant 1e-14.
    let s = [1.0, 1e-7, 1e-7, 2e-14];
    let (own, _) = symmetric_eigen(&s, 2).expect("finite");
    let theirs = DMatrix::from_row_slice(2, 2, &s).symmetric_eigenvalues();
    println!("| smaller eigenvalue of 2 x 2 | {:.1e} | {:.1e} |", error(own[0], 1e-14), error(theirs.min(), 1e-14));
}

fn main() {
    if cfg!(debug_assertions) {
        eprintln!("linear_algebra: times need a release build: cargo run --release --example linear_algebra");
        std::process::exit(1);
    }
    times();
    errors();
}
