//! The memory of a solver. It is allocated once, for a number of joints and the rows of each level.

use super::method::PriorityMethod;
use super::metric::Metric;
use super::regular::{Single, regular_ranks};
use crate::linalg::svd::Svd;

#[derive(Debug, Clone)]
pub(super) struct Workspace {
    pub n: usize,
    /// The number of rows of each level.
    pub rows: Vec<usize>,
    /// The index of the first row of each level in the stack.
    pub start: Vec<usize>,
    /// The Jacobians of the original stack, shape `(sum rows, n)`.
    pub jacobian: Vec<f64>,
    /// The task velocities of the original stack, shape `(sum rows,)`.
    pub command: Vec<f64>,
    /// The Jacobians in the coordinates of the metric. Levels with extreme entries are scaled by a power of two.
    pub j: Vec<f64>,
    /// The task velocities, scaled like the levels of `j`.
    pub c: Vec<f64>,
    /// For each level, the exponent of the power of two by which it is scaled.
    pub exponent: Vec<i32>,
    /// The present threshold of each level.
    pub threshold: Vec<f64>,
    /// The rows are an orthonormal basis of joint space. Higher levels have used the rows before `free`. The other rows are still free, and
    /// `scale` has the remaining fraction of each.
    pub basis: Vec<f64>,
    /// Whether the basis is still the identity, because no level has rotated it.
    pub identity: bool,
    pub free: usize,
    pub scale: Vec<f64>,
    pub svd: Svd,
    pub svd2: Svd,
    pub a: Vec<f64>,
    pub r: Vec<f64>,
    pub t: Vec<f64>,
    pub z: Vec<f64>,
    pub regular: Single,
    /// The result in metric coordinates.
    pub y: Vec<f64>,
    pub v: Vec<f64>,
    pub residual: Vec<f64>,
    pub ranks: Vec<usize>,
    pub lost: Vec<bool>,
    pub task_scale: Vec<f64>,
    pub metric: Option<Metric>,
    /// The threshold of each level, in the unit of the level's Jacobian.
    pub eps: Option<Vec<f64>>,
    pub rounding: f64,
    pub bounds: Option<(Vec<f64>, Vec<f64>)>,
}

impl Workspace {
    pub fn new(n: usize, rows: &[usize], method: PriorityMethod, eps: Option<Vec<f64>>, metric: Option<Metric>) -> Self {
        let total: usize = rows.iter().sum();
        let most = rows.iter().copied().max().unwrap_or(0).max(n);
        let levels = rows.len();
        let start = rows.iter().scan(0, |s, r| Some(std::mem::replace(s, *s + r))).collect();
        Workspace {
            n,
            rows: rows.to_vec(),
            start,
            jacobian: vec![0.0; total * n],
            command: vec![0.0; total],
            j: vec![0.0; total * n],
            c: vec![0.0; total],
            exponent: vec![0; levels],
            threshold: vec![0.0; levels],
            identity: true,
            basis: vec![0.0; n * n],
            free: 0,
            scale: vec![1.0; n],
            svd: Svd::new(most, n),
            svd2: Svd::new(most, n),
            a: vec![0.0; most * n],
            r: vec![0.0; most],
            t: vec![0.0; most * n],
            z: vec![0.0; most],
            regular: Single::new(n, rows, method, eps.as_deref(), metric.as_ref()),
            y: vec![0.0; n],
            v: vec![0.0; n],
            residual: vec![0.0; total],
            ranks: vec![0; levels],
            lost: vec![false; levels],
            task_scale: vec![1.0; levels],
            metric,
            eps,
            rounding: super::DEFAULT_ROUNDING,
            bounds: None,
        }
    }

    /// Solve with the algorithm `regular`, and write `v`, `residual` and `ranks`. Return false if the result is not valid.
    pub fn solve_regular(&mut self) -> bool {
        let Workspace { n, rows, regular, jacobian, command, rounding, v, residual, ranks, task_scale, .. } = self;
        let stands = regular.solve(*rounding, jacobian, command, v, residual);
        if stands {
            ranks.iter_mut().zip(regular_ranks(*n, rows)).for_each(|(to, rank)| *to = rank);
            task_scale.fill(1.0);
        }
        stands
    }

    /// The range of rows of level `i` in the stack.
    pub fn level(&self, i: usize) -> std::ops::Range<usize> {
        self.start[i]..self.start[i] + self.rows[i]
    }
}
