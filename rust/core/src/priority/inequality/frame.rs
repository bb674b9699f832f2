//! Vectors of a solve in the coordinates of the levels. With the basis `N` of the directions that are not yet used, `x = x_above + N y`. A
//! row `a` becomes `N'a`, and a step `p` of the coordinates moves `x` by `N p`.
//!
//! Each vector is a column. Orthogonal transformations act on all columns, so that a triangular factor appears in place (LQ factorisation,
//! the hierarchical decomposition of Escande, Mansard and Wieber 2014, `escande2014hierarchical`). The first `used` coordinates belong to
//! the levels above.

use crate::linalg::householder::{reflect, reflector};
use crate::linalg::{Svd, dot};
use nalgebra::DMatrix;

#[derive(Debug, Clone)]
pub struct Frame {
    /// The vectors: the rows of all levels, `n` penalty rows, the rows of `N`, `n` unit vectors, and the gradient of the norm.
    columns: DMatrix<f64>,
    rows: usize,
    /// The number of coordinates of the levels above.
    pub used: usize,
    /// The columns that transformations act on.
    pub live: Vec<usize>,
    /// Memory for one column.
    work: Vec<f64>,
}

impl Frame {
    /// Allocate memory for `n` coordinates and a number of rows.
    pub fn new(n: usize, rows: usize) -> Self {
        let count = rows + 3 * n + 1;
        Frame { columns: DMatrix::zeros(n, count), rows, used: 0, live: Vec::with_capacity(count), work: vec![0.0; n] }
    }

    /// The number of coordinates.
    pub fn n(&self) -> usize {
        self.columns.nrows()
    }

    /// The column of penalty row `j`.
    pub fn penalty(&self, j: usize) -> usize {
        self.rows + j
    }

    /// The column of the basis: row `j` of `N`.
    pub fn basis(&self, j: usize) -> usize {
        self.rows + self.n() + j
    }

    /// The column of unit vector `j` of the coordinates at the start of the level.
    pub fn unit(&self, j: usize) -> usize {
        self.rows + 2 * self.n() + j
    }

    /// The column of the gradient of the norm.
    pub fn norm(&self) -> usize {
        self.rows + 3 * self.n()
    }

    /// Start with the rows `a`, shape `(n, rows)`, and `N = I`.
    pub fn start(&mut self, a: &DMatrix<f64>) {
        let n = self.n();
        self.used = 0;
        self.columns.as_mut_slice()[..n * self.rows].copy_from_slice(a.as_slice());
        self.columns.columns_mut(self.rows, 3 * n + 1).fill(0.0);
        for j in 0..n {
            let basis = self.basis(j);
            self.columns[(j, basis)] = 1.0;
        }
    }

    /// Free the last coordinate of the levels above. All columns are zero there.
    pub fn free_last_used(&mut self) {
        self.used -= 1;
        self.columns.row_mut(self.used).fill(0.0);
    }

    /// A column, shape `(n,)`.
    pub fn column(&self, i: usize) -> &[f64] {
        let n = self.n();
        &self.columns.as_slice()[i * n..(i + 1) * n]
    }

    /// A column, mutable.
    pub fn column_mut(&mut self, i: usize) -> &mut [f64] {
        let n = self.n();
        &mut self.columns.as_mut_slice()[i * n..(i + 1) * n]
    }

    /// The squared norm of a column from coordinate `from` on.
    pub fn norm2(&self, i: usize, from: usize) -> f64 {
        let x = &self.column(i)[from..];
        dot(x, x)
    }

    /// Reflect the coordinates from `from` on, so that column `i` has only its first entry there.
    pub fn reflect(&mut self, i: usize, from: usize) {
        let Frame { columns, live, work, .. } = self;
        let (n, w) = (columns.nrows(), &mut work[from..]);
        let columns = columns.as_mut_slice();
        w.copy_from_slice(&columns[i * n + from..(i + 1) * n]);
        let (alpha, beta) = reflector(w);
        if beta != 0.0 {
            live.iter().for_each(|at| reflect(w, beta, &mut columns[at * n + from..(at + 1) * n]));
        }
        columns[i * n + from] = alpha;
        columns[i * n + from + 1..(i + 1) * n].fill(0.0);
    }

    /// Rotate the coordinates `at` and `at + 1`, so that column `i` is zero at `at + 1` (Givens rotation).
    pub fn rotate(&mut self, i: usize, at: usize) {
        let [x, y] = [self.column(i)[at], self.column(i)[at + 1]];
        let r = x.hypot(y);
        if y == 0.0 || r == 0.0 {
            return;
        }
        let (c, s, n) = (x / r, y / r, self.n());
        let columns = self.columns.as_mut_slice();
        for column in &self.live {
            let [x, y] = [columns[column * n + at], columns[column * n + at + 1]];
            (columns[column * n + at], columns[column * n + at + 1]) = (c * x + s * y, c * y - s * x);
        }
        columns[i * n + at + 1] = 0.0;
    }

    /// Turn the coordinates from `from` on to the right singular vectors of a decomposition, the largest or the smallest singular value
    /// first.
    pub fn turn(&mut self, svd: &Svd, from: usize, smallest_first: bool) {
        let Frame { columns, live, work, .. } = self;
        let (n, k) = (columns.nrows(), columns.nrows() - from);
        for column in live.iter().map(|i| i * n + from..(i + 1) * n) {
            let (x, work) = (&mut columns.as_mut_slice()[column], &mut work[from..]);
            work.copy_from_slice(x);
            x.iter_mut().enumerate().for_each(|(j, x)| *x = dot(svd.v(if smallest_first { k - 1 - j } else { j }), work));
        }
    }
}
