//! Common parts of the priority tests: planar kinematics, a random generator with a seed, and small matrix products.

use std::f64::consts::TAU;

/// Return the Jacobian of the tip of link `tip` (1-based), shape `(2, n)`, row-major, of a planar arm with relative angles.
pub fn planar_jacobian(lengths: &[f64], q: &[f64], tip: usize) -> Vec<f64> {
    let n = q.len();
    let mut j = vec![0.0; 2 * n];
    let mut angle = 0.0;
    let (mut x, mut y) = (vec![0.0; tip], vec![0.0; tip]);
    for i in 0..tip {
        angle += q[i];
        (x[i], y[i]) = (lengths[i] * angle.cos(), lengths[i] * angle.sin());
    }
    for i in 0..tip {
        j[i] = -y[i..].iter().sum::<f64>();
        j[n + i] = x[i..].iter().sum::<f64>();
    }
    j
}

/// A linear congruential random generator with 64 bits (Knuth's MMIX constants). The output is its high bits.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        let mut r = Random(seed ^ 0x9E37_79B9_7F4A_7C15);
        for _ in 0..4 {
            r.uniform();
        }
        r
    }

    /// Return a number that is uniform in `[0, 1)`.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 11) as f64) / ((1u64 << 53) as f64)
    }

    pub fn below(&mut self, n: usize) -> usize {
        ((self.uniform() * n as f64) as usize).min(n - 1)
    }

    /// Return a number with the standard normal distribution (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }

    pub fn normals(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.normal()).collect()
    }
}

/// Return `J v` for a row-major matrix.
pub fn times(j: &[f64], v: &[f64]) -> Vec<f64> {
    j.chunks_exact(v.len()).map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum()).collect()
}

/// Return the row-major product of matrices with the shapes `(m, k)` and `(k, n)`.
pub fn product(a: &[f64], b: &[f64], k: usize, n: usize) -> Vec<f64> {
    a.chunks_exact(k).flat_map(|row| (0..n).map(move |c| row.iter().enumerate().map(|(l, x)| x * b[l * n + c]).sum())).collect()
}

pub fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Return the largest absolute difference.
pub fn apart(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |m, (x, y)| if (x - y).abs() <= m { m } else { (x - y).abs() })
}
