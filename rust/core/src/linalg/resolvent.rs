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

/// Evaluate `$body` with constant numbers of joints and of blocks in `$pairs`, so that the compiler unrolls the short loops. This applies to
/// small arms whose state of `$n` numbers has no other components than quadratures. For other states, the sizes are variable.
macro_rules! with_constant_sizes {
    ($n:ident, $pairs:ident, $body:expr, [$(($joints:literal, $count:literal)),*]) => {
        match ($pairs.joints, $pairs.count) {
            $(($joints, $count) if $n == 2 * $joints * $count + $pairs.quadratures => {
                let $pairs = Pairs { joints: $joints, count: $count, quadratures: $pairs.quadratures };
                let $n = 2 * $joints * $count + $pairs.quadratures;
                $body
            })*
            _ => $body,
        }
    };
    ($n:ident, $pairs:ident, $body:expr) => {
        with_constant_sizes!($n, $pairs, $body, [(1, 1), (2, 1), (1, 2), (2, 2)])
    };
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

    /// Eliminate the positions of `s I - j`, and write the decomposition of the remaining matrix to `lu`. `j` has the shape `(n, n)`. `lu`
    /// is memory for `n^2` numbers, real or complex like `s`. The result is `false` if the matrix is singular or not finite, or if
    /// `stopped` returned true.
    pub fn decompose<E: Entry>(
        self,
        n: usize,
        s: E,
        j: &[E::Real],
        lu: &mut [E],
        pivots: &mut [usize],
        mut stopped: impl FnMut() -> bool,
    ) -> bool {
        let pairs = self;
        with_constant_sizes!(n, pairs, pairs.decompose_sized(n, s, j, lu, pivots, &mut stopped))
    }

    /// [`Pairs::decompose`] with sizes that may be constants.
    #[inline(always)]
    fn decompose_sized<E: Entry>(
        self,
        n: usize,
        s: E,
        j: &[E::Real],
        lu: &mut [E],
        pivots: &mut [usize],
        stopped: impl FnMut() -> bool,
    ) -> bool {
        let (m, inverse) = (self.rows(n), s.inverse());
        let (j, lu) = (&j[..n * n], &mut lu[..m * m]);
        for block in 0..self.count {
            for i in 0..self.joints {
                self.reduce(n, block * self.joints + i, (2 * block + 1) * self.joints + i, (s, inverse), j, lu);
            }
        }
        for r in self.positions()..m {
            self.reduce(n, r, r + self.positions(), (s, inverse), j, lu);
        }
        lu::decompose(m, lu, &mut pivots[..m], stopped)
    }

    /// Write row `r` of the remaining matrix to `matrix`, from the row `row` of `j`.
    #[inline(always)]
    fn reduce<E: Entry>(self, n: usize, r: usize, row: usize, (s, inverse): (E, E), j: &[E::Real], matrix: &mut [E]) {
        let (m, joints) = (self.rows(n), self.joints);
        let (from, to) = (&j[row * n..(row + 1) * n], &mut matrix[r * m..(r + 1) * m]);
        for block in 0..self.count {
            let from = &from[2 * block * joints..2 * (block + 1) * joints];
            let to = &mut to[block * joints..(block + 1) * joints];
            for i in 0..joints {
                to[i] = E::real(-from[joints + i]).less(inverse, E::real(from[i]));
            }
        }
        for c in self.positions()..m {
            to[c] = E::real(-from[c + self.positions()]);
        }
        to[r] = to[r].less(E::real(E::Real::splat(-1.0)), s);
    }

    /// Solve `(s I - j) u = b` with the decomposition `lu` and its row exchanges `pivots`. `b` is replaced by `u`. `work` is memory for `n`
    /// numbers.
    pub fn solve<E: Entry>(self, n: usize, s: E, j: &[E::Real], decomposed: (&[E], &[usize]), b: &mut [E], work: &mut [E]) {
        let pairs = self;
        with_constant_sizes!(n, pairs, pairs.solve_sized(n, s, j, decomposed, b, work));
    }

    /// [`Pairs::solve`] with sizes that may be constants.
    #[inline(always)]
    fn solve_sized<E: Entry>(self, n: usize, s: E, j: &[E::Real], (lu, pivots): (&[E], &[usize]), b: &mut [E], work: &mut [E]) {
        let (m, joints, positions) = (self.rows(n), self.joints, self.positions());
        // `inverse` is `-1/s`, because `less` subtracts a product, and the sums below add these products.
        let (j, b, work, inverse) = (&j[..n * n], &mut b[..n], &mut work[..m], s.times(E::real(E::Real::splat(-1.0))).inverse());
        for block in 0..self.count {
            for x in &mut b[2 * block * joints..(2 * block + 1) * joints] {
                *x = x.times(inverse);
            }
        }
        for block in 0..self.count {
            for i in 0..joints {
                work[block * joints + i] = self.residue(n, (2 * block + 1) * joints + i, j, b);
            }
        }
        for r in positions..m {
            work[r] = self.residue(n, r + positions, j, b);
        }
        lu::solve(m, lu, pivots, work);
        let zero = E::real(E::Real::zero());
        for block in 0..self.count {
            let (b, work) = (&mut b[2 * block * joints..2 * (block + 1) * joints], &work[block * joints..(block + 1) * joints]);
            for i in 0..joints {
                b[joints + i] = work[i];
                b[i] = zero.less(E::real(E::Real::splat(1.0)), b[i]).less(inverse, work[i]);
            }
        }
        b[2 * positions..n - self.quadratures].copy_from_slice(&work[positions..]);
        let (states, quadratures) = b.split_at_mut(n - self.quadratures);
        for (q, sum) in quadratures.iter_mut().enumerate() {
            let row = &j[(states.len() + q) * n..(states.len() + q + 1) * n];
            let mut driven = *sum;
            for (c, &u) in states.iter().enumerate() {
                driven = driven.less(E::real(-row[c]), u);
            }
            *sum = zero.less(inverse, driven);
        }
    }

    /// The right-hand side of the row `row` of `j`, after the elimination of the positions in `b`.
    #[inline(always)]
    fn residue<E: Entry>(self, n: usize, row: usize, j: &[E::Real], b: &[E]) -> E {
        let mut sum = b[row];
        for block in 0..self.count {
            let positions = 2 * block * self.joints..(2 * block + 1) * self.joints;
            let (row, b) = (&j[row * n..(row + 1) * n][positions.clone()], &b[positions]);
            for i in 0..b.len() {
                sum = sum.less(E::real(row[i]), b[i]);
            }
        }
        sum
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
    fn constant_sizes_have_the_bits_of_general_sizes() {
        for (joints, count, quadratures) in [(1, 1, 0), (2, 1, 0), (1, 2, 1), (2, 2, 0), (2, 2, 2)] {
            let pairs = std::hint::black_box(Pairs { joints, count, quadratures });
            let n = 2 * joints * count + quadratures;
            let j: Vec<f64> = (0..n * n).map(|k| if k % n < n - quadratures { (12.9898 * k as f64).sin() } else { 0.0 }).collect();
            let solved = |constant: bool| {
                let (mut lu, mut pivots, mut work) = (vec![0.0; n * n], vec![0; n], vec![0.0; n]);
                let mut u: Vec<f64> = (0..n).map(|i| (78.233 * i as f64).cos()).collect();
                if constant {
                    assert!(pairs.decompose(n, 3.7, &j, &mut lu, &mut pivots, || false));
                    pairs.solve(n, 3.7, &j, (&lu, &pivots), &mut u, &mut work);
                } else {
                    assert!(pairs.decompose_sized(n, 3.7, &j, &mut lu, &mut pivots, || false));
                    pairs.solve_sized(n, 3.7, &j, (&lu, &pivots), &mut u, &mut work);
                }
                u
            };
            assert_eq!(solved(true), solved(false), "{joints} {count} {quadratures}");
        }
    }

    #[test]
    fn a_singular_matrix_is_refused() {
        let pairs = Pairs { joints: 1, count: 1, quadratures: 0 };
        // The matrix [[0, 1], [4, 0]] has the eigenvalue 2.
        assert!(!pairs.decompose(2, 2.0, &[0.0, 1.0, 4.0, 0.0], &mut [0.0; 4], &mut [0; 2], || false));
        assert!(pairs.decompose(2, 2.5, &[0.0, 1.0, 4.0, 0.0], &mut [0.0; 4], &mut [0; 2], || false));
    }
}
