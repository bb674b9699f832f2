//! Linear systems `(s I - J) u = b`, where `J` is the Jacobian of the equations of a mechanical system. The state of the system is
//! `x = [x_1, x_1_dot, x_2, x_2_dot, ..., rest]`, with blocks of one number per joint. The row of a position `p` with the rate `c` is
//! `s u_p - u_c = b_p`. So the positions are eliminated. For each other row `r`, an equation remains:
//! `s u_r - sum (J_rc + J_rp / s) u_c = b_r + sum J_rp b_p / s`. The sums are over all components `c` that are not positions. If `c` is not
//! the rate of a position, the terms with `p` are absent.
//!
//! The last components of the state may be quadratures `y`, on which no slope depends. They are not part of the decomposed matrix, and
//! follow from the other components: `s u_y = b_y + sum J_yc u_c`. So they do not change the bits of the other components.

use super::lu::{self, Entry};
use crate::scalar::Real;

/// The positions and rates in a state that begins with `count` blocks of `joints` positions. The block of their rates follows each block of
/// positions. The last `quadratures` components are those on which no slope depends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pairs {
    pub joints: usize,
    pub count: usize,
    pub quadratures: usize,
}

impl Pairs {
    /// The number of positions.
    #[inline]
    fn positions(self) -> usize {
        self.joints * self.count
    }

    /// Return the index of the rate of component `i`. The result is `None` if `i` is not a position.
    pub fn rate_of(self, i: usize) -> Option<usize> {
        (i < 2 * self.positions() && (i / self.joints).is_multiple_of(2)).then_some(i + self.joints)
    }

    /// The number of rows of the decomposed matrix.
    #[inline]
    fn rows(self, n: usize) -> usize {
        n - self.positions() - self.quadratures
    }

    /// Call `each(k, i)` for each component `i` of `n` that is neither a position nor a quadrature. `k` counts the calls.
    #[inline]
    fn unknowns_each(self, n: usize, mut each: impl FnMut(usize, usize)) {
        for block in 0..self.count {
            for i in 0..self.joints {
                each(block * self.joints + i, (2 * block + 1) * self.joints + i);
            }
        }
        for i in 2 * self.positions()..n - self.quadratures {
            each(i - self.positions(), i);
        }
    }

    /// Call `each(k, i)` for each position `i`. `k` counts the calls. The rate of this position is number `k` of the components that are
    /// not positions.
    #[inline]
    fn positions_each(self, mut each: impl FnMut(usize, usize)) {
        for block in 0..self.count {
            for i in 0..self.joints {
                each(block * self.joints + i, 2 * block * self.joints + i);
            }
        }
    }

    /// Eliminate the positions of `s I - j`, and write the decomposition of the remaining matrix to `lu`. `j` has the shape `(n, n)`. `lu`
    /// is memory for `n^2` numbers, real or complex like `s`. The result is `false` if the matrix is singular or not finite, or if
    /// `stopped` returned true.
    #[inline]
    pub fn decompose<E: Entry>(
        self,
        n: usize,
        s: E,
        j: &[E::Real],
        lu: &mut [E],
        pivots: &mut [usize],
        stopped: impl FnMut() -> bool,
    ) -> bool {
        let m = self.rows(n);
        let (j, lu, inverse) = (&j[..n * n], &mut lu[..m * m], s.inverse());
        self.unknowns_each(n, |r, row| {
            let (from, to) = (&j[row * n..(row + 1) * n], &mut lu[r * m..(r + 1) * m]);
            self.unknowns_each(n, |c, column| to[c] = E::real(-from[column]));
            self.positions_each(|c, column| to[c] = to[c].less(inverse, E::real(from[column])));
            to[r] = to[r].less(E::real(E::Real::splat(-1.0)), s);
        });
        lu::decompose(m, lu, &mut pivots[..m], stopped)
    }

    /// Solve `(s I - j) u = b` with the decomposition `lu` and its row exchanges `pivots`. `b` is replaced by `u`. `work` is memory for `n`
    /// numbers.
    #[inline]
    pub fn solve<E: Entry>(self, n: usize, s: E, j: &[E::Real], (lu, pivots): (&[E], &[usize]), b: &mut [E], work: &mut [E]) {
        let m = self.rows(n);
        // `inverse` is `-1/s`, because `less` subtracts a product, and the sums below add these products.
        let (j, b, work, inverse) = (&j[..n * n], &mut b[..n], &mut work[..m], s.times(E::real(E::Real::splat(-1.0))).inverse());
        self.positions_each(|_, column| b[column] = b[column].times(inverse));
        self.unknowns_each(n, |r, row| {
            let mut sum = b[row];
            self.positions_each(|_, column| sum = sum.less(E::real(j[row * n + column]), b[column]));
            work[r] = sum;
        });
        lu::solve(m, lu, pivots, work);
        self.unknowns_each(n, |r, row| b[row] = work[r]);
        let zero = E::real(E::Real::zero());
        self.positions_each(|k, column| b[column] = zero.less(E::real(E::Real::splat(1.0)), b[column]).less(inverse, work[k]));
        let (states, quadratures) = b.split_at_mut(n - self.quadratures);
        for (sum, row) in quadratures.iter_mut().zip(j[states.len() * n..].chunks_exact(n.max(1))) {
            let driven = states.iter().zip(row).fold(*sum, |sum, (&u, &slope)| sum.less(E::real(-slope), u));
            *sum = zero.less(inverse, driven);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lu::Complex;
    use super::*;

    /// Return `|(s I - J) u - b|` divided by `(|J| + |s|) (|u| + |b / s|)`. For a stable method, this
    /// is a small multiple of 1e-16.
    fn residual<E: Entry<Real = f64>>(pairs: Pairs, n: usize, s: E, j: &[f64], b: Vec<E>) -> f64 {
        let (mut lu, mut pivots, mut work, mut u) = (b.repeat(n), vec![0; n], b.clone(), b.clone());
        assert!(pairs.decompose(n, s, j, &mut lu, &mut pivots, || false));
        pairs.solve(n, s, j, (&lu, &pivots), &mut u, &mut work);
        let largest = |x: &[E]| x.iter().map(|x| x.magnitude()).fold(0.0, f64::max);
        let left: Vec<E> = (0..n).map(|i| (0..n).fold(b[i].less(s, u[i]), |sum, c| sum.less(E::real(-j[i * n + c]), u[c]))).collect();
        largest(&left) / ((1e6 + s.magnitude()) * (largest(&u) + largest(&b) / s.magnitude()))
    }

    /// The tolerance covers a dozen roundings. The entries are up to 1e6, and `s` is above and below them.
    #[test]
    fn with_positions_eliminated_the_solution_solves_the_whole_system() {
        for (joints, count, others, quadratures) in
            [(2, 2, 0, 0), (2, 2, 2, 0), (3, 1, 4, 0), (1, 1, 0, 0), (0, 0, 5, 0), (2, 1, 3, 2), (0, 0, 4, 1), (1, 2, 0, 3)]
        {
            let pairs = Pairs { joints, count, quadratures };
            let n = 2 * joints * count + others + quadratures;
            let mut j: Vec<f64> = (0..n * n).map(|k| (12.9898 * k as f64).sin() * if k % 3 == 0 { 1e6 } else { 1.0 }).collect();
            for i in 0..n {
                if let Some(k) = pairs.rate_of(i) {
                    (0..n).for_each(|c| j[i * n + c] = if c == k { 1.0 } else { 0.0 });
                }
            }
            for row in j.chunks_exact_mut(n) {
                row[n - quadratures..].fill(0.0);
            }
            let b: Vec<f64> = (0..n).map(|i| (78.233 * i as f64).cos()).collect();
            for s in [4e-3, 1.0, 4e5, 4e7] {
                let complex = b.iter().map(|&b| Complex(b, 1.0 - b)).collect();
                let worst = residual(pairs, n, s, &j, b.clone()).max(residual(pairs, n, Complex(s, 0.7 * s), &j, complex));
                assert!(worst < 1e-14, "{joints} {count} {others} {quadratures} {s}: {worst:e}");
            }
        }
    }

    /// The last row is much larger than the others, so that a decomposition of the whole matrix would choose it as the pivot row.
    #[test]
    fn a_quadrature_does_not_change_the_bits_of_the_states() {
        let (small, large) = ([0.3, 1.7, -2.1, 0.9], [0.3, 1.7, 0.0, -2.1, 0.9, 0.0, 3e5, 7e6, 0.0]);
        let solved = |n: usize, j: &[f64], quadratures: usize, mut u: Vec<f64>| {
            let pairs = Pairs { quadratures, ..Pairs::default() };
            let (mut lu, mut pivots, mut work) = (vec![0.0; n * n], vec![0; n], vec![0.0; n]);
            assert!(pairs.decompose(n, 0.7, j, &mut lu, &mut pivots, || false));
            pairs.solve(n, 0.7, j, (&lu, &pivots), &mut u, &mut work);
            u
        };
        let (alone, with) = (solved(2, &small, 0, vec![0.1, 1.3]), solved(3, &large, 1, vec![0.1, 1.3, 0.2]));
        assert_eq!(alone, with[..2]);
    }

    #[test]
    fn a_singular_matrix_is_refused() {
        let pairs = Pairs { joints: 1, count: 1, quadratures: 0 };
        // The matrix [[0, 1], [4, 0]] has the eigenvalue 2.
        assert!(!pairs.decompose(2, 2.0, &[0.0, 1.0, 4.0, 0.0], &mut [0.0; 4], &mut [0; 2], || false));
        assert!(pairs.decompose(2, 2.5, &[0.0, 1.0, 4.0, 0.0], &mut [0.0; 4], &mut [0; 2], || false));
    }
}
