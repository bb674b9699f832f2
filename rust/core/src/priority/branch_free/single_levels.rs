//! The solution `J_i# v_i` of each level alone, away from singularities, for the method `chiaverini`. `J_i#` is the pseudo-inverse of the
//! Jacobian of level `i`, and `v_i` its task velocity.
//!
//! It uses an LQ factorisation of the rows. A level with more rows than joints is solved by least squares.

use super::level_rows::load;
use super::lq::{Factor, least_squares};
use crate::priority::metric::Metric;
use crate::scalar::Real;

/// The solver of single levels, with its memory.
#[derive(Debug, Clone)]
pub(super) struct SingleLevels<S> {
    levels: Vec<LevelFactor<S>>,
    /// Memory for the residual of a tall level, and for a column of an inverse.
    residual: Vec<S>,
    column: Vec<S>,
    /// The solution `J_i# v_i`, shape `(n,)`.
    pub v: Vec<S>,
}

#[derive(Debug, Clone)]
struct LevelFactor<S> {
    factor: Factor<S>,
    /// The rows of a level with more rows than joints. Empty for other levels.
    tall: Vec<S>,
}

impl<S: Real> SingleLevels<S> {
    /// Allocate memory for levels with these numbers of rows.
    pub fn new(n: usize, rows: &[usize]) -> Self {
        let zeros = |k: usize| vec![S::zero(); k];
        let most = rows.iter().copied().max().unwrap_or(0).max(n);
        let level = |&m: &usize| match m <= n {
            true => LevelFactor { factor: Factor::new(n, m), tall: Vec::new() },
            false => LevelFactor { factor: Factor::new(n, 0), tall: zeros(m * n) },
        };
        SingleLevels { levels: rows.iter().map(level).collect(), residual: zeros(most), column: zeros(most), v: zeros(n) }
    }

    /// Solve level `i`, and write the solution to `v`. Return `|J_i#|_F^2` and the square of the largest row norm.
    pub fn solve(&mut self, i: usize, jacobian: &[S], metric: Option<&Metric<S>>, command: &[S]) -> [S; 2] {
        let SingleLevels { levels, residual, column, v } = self;
        let LevelFactor { factor, tall: rows } = &mut levels[i];
        factor.y.fill(S::zero());
        if rows.is_empty() {
            let [row_norm2, _] = load(jacobian, metric, &mut factor.l, v.len());
            command.iter().enumerate().for_each(|(at, &command)| factor.eliminate(at, command));
            factor.velocity(v);
            return [factor.inverse_norm2(0, command.len(), column), row_norm2];
        }
        let [row_norm2, _] = load(jacobian, metric, rows, v.len());
        let inverse2 = least_squares(rows, command, 0, &mut factor.y, residual, column);
        v.copy_from_slice(&factor.y);
        [inverse2, row_norm2]
    }
}
