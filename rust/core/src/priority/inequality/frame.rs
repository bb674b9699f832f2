//! Vectors of a solve in the coordinates of the levels. With the basis `N` of the directions that are not yet used, `x = x_above + N y`. A
//! row `a` becomes `N'a`, and a step `p` of the coordinates moves `x` by `N p`.
//!
//! Each vector is a column. Orthogonal transformations act on all columns, so that a triangular factor appears in place (LQ factorisation,
//! the hierarchical decomposition of Escande, Mansard and Wieber 2014, `escande2014hierarchical`). The first `used` coordinates belong to
//! the levels above.

use super::columns::Columns;
use crate::linalg::Svd;
use crate::linalg::householder::reflector;
use std::ops::{Deref, DerefMut};

#[derive(Debug, Clone)]
pub struct Frame {
    /// The vectors: the rows of all levels, the penalty rows, the rows of `N`, the gradient of the norm, and unit vectors.
    columns: Columns,
    rows: usize,
    /// The number of penalty rows, and of unit vectors.
    penalties: usize,
    /// The number of coordinates of the levels above.
    pub used: usize,
    /// Memory for one column.
    work: Vec<f64>,
}

impl Frame {
    /// Allocate memory for `n` coordinates and a number of rows. If `damps`, there are `n` penalty rows and `n` unit vectors.
    pub fn new(n: usize, rows: usize, damps: bool) -> Self {
        let penalties = if damps { n } else { 0 };
        Frame { columns: Columns::new(n, rows + 2 * penalties + n + 1), rows, penalties, used: 0, work: vec![0.0; n] }
    }

    /// The column of penalty row `j`.
    pub fn penalty(&self, j: usize) -> usize {
        self.rows + j
    }

    /// The column of the basis: row `j` of `N`.
    pub fn basis(&self, j: usize) -> usize {
        self.rows + self.penalties + j
    }

    /// The column of the gradient of the norm.
    pub fn norm(&self) -> usize {
        self.basis(self.n())
    }

    /// The column of unit vector `j` of the coordinates at the start of the level.
    pub fn unit(&self, j: usize) -> usize {
        self.norm() + 1 + j
    }

    /// Start with the rows `a` and `N = I`.
    pub fn start(&mut self, a: &Columns) {
        self.used = 0;
        self.columns.start(a);
        for j in 0..self.n() {
            let basis = self.basis(j);
            self[(j, basis)] = 1.0;
        }
    }

    /// Free the last coordinate of the levels above. All columns are zero there.
    pub fn free_last_used(&mut self) {
        self.used -= 1;
        let used = self.used;
        self.coordinate_mut(used).fill(0.0);
    }

    /// The squared norm of a column from coordinate `from` on.
    pub fn norm2(&self, i: usize, from: usize) -> f64 {
        self.vector(i, from).map(|x| x * x).sum()
    }

    /// The scalar product of the coordinates of a column from `from` on with `x`.
    pub fn product(&self, i: usize, from: usize, x: &[f64]) -> f64 {
        self.vector(i, from).zip(x).map(|(a, x)| a * x).sum()
    }

    /// Reflect the coordinates from `from` on, so that column `i` has only its first entry there.
    pub fn reflect(&mut self, i: usize, from: usize) {
        let Frame { columns, work, .. } = self;
        let (n, w) = (columns.n(), &mut work[from..]);
        w.iter_mut().zip(columns.vector(i, from)).for_each(|(w, x)| *w = x);
        let (alpha, beta) = reflector(w);
        if beta != 0.0 {
            columns.reflect(from, w, beta);
        }
        columns[(from, i)] = alpha;
        (from + 1..n).for_each(|j| columns[(j, i)] = 0.0);
    }

    /// Rotate the coordinates `at` and `at + 1`, so that column `i` is zero at `at + 1` (Givens rotation).
    pub fn rotate(&mut self, i: usize, at: usize) {
        let [x, y] = [self[(at, i)], self[(at + 1, i)]];
        let r = x.hypot(y);
        if y == 0.0 || r == 0.0 {
            return;
        }
        self.columns.rotate(at, x / r, y / r);
        self[(at + 1, i)] = 0.0;
    }

    /// Turn the coordinates from `from` on to the right singular vectors of a decomposition, the largest or the smallest singular value
    /// first.
    pub fn turn(&mut self, svd: &Svd, from: usize, smallest_first: bool) {
        let k = self.n() - from;
        self.columns.turn(from, |j| svd.v(if smallest_first { k - 1 - j } else { j }));
    }
}

impl Deref for Frame {
    type Target = Columns;
    fn deref(&self) -> &Columns {
        &self.columns
    }
}

impl DerefMut for Frame {
    fn deref_mut(&mut self) -> &mut Columns {
        &mut self.columns
    }
}
