//! Vectors and matrices of recorded values, with the operators of nalgebra: the notation of laws, plants and monitors.

use super::sym::{self, Sym};
use crate::scalar::Real;
use nalgebra::{DMatrix, DVector};

/// A recorded number.
pub type E = Sym;
/// A vector of recorded numbers.
pub type V = DVector<Sym>;
/// A matrix of recorded numbers.
pub type M = DMatrix<Sym>;

/// The constant `x`.
pub fn constant(x: f64) -> E {
    Sym::splat(x)
}

/// The vector of `n` zeros.
pub fn zeros(n: usize) -> V {
    V::from_element(n, Sym::zero())
}

/// A slice as a vector.
pub fn vector(x: &[E]) -> V {
    V::from_column_slice(x)
}

/// The vectors `parts` one after another.
pub fn stacked<'a>(parts: impl IntoIterator<Item = &'a V>) -> V {
    V::from_vec(parts.into_iter().flat_map(|part| part.iter().copied()).collect())
}

/// The total derivative of `of` with respect to time, if the vectors `at` have the rates `along`, and all other values are constant. Entries of
/// `at` are inputs of the recording, or constants whose rate is zero.
pub fn time_derivative<const N: usize>(of: &V, at: [&V; N], along: [&V; N]) -> V {
    V::from_vec(sym::derivative(of.as_slice(), stacked(at).as_slice(), stacked(along).as_slice()))
}

/// The vector `yes` where `mask` is true, and `no` elsewhere.
pub fn select(mask: E, yes: &V, no: &V) -> V {
    yes.zip_map(no, |yes, no| Sym::select(mask, yes, no))
}

/// The vector `x` with each entry limited to `[-limit, limit]`. If `limit` is empty, there are no limits.
pub fn clamp(x: &V, limit: &V) -> V {
    if limit.is_empty() { x.clone() } else { x.zip_map(limit, |x, limit| x.clamped(-limit, limit)) }
}

/// The magnitudes of the entries of `x`.
pub fn magnitudes(x: &V) -> V {
    x.map(Sym::abs)
}

/// The largest of zero and the entries of `x`.
pub fn largest(x: &V) -> E {
    x.iter().fold(Sym::zero(), |most, &x| most.max(x))
}

/// Whether the condition `mask` is true, as a number 0 or 1.
pub fn indicator(mask: E) -> E {
    Sym::select(mask, constant(1.0), constant(0.0))
}

/// The entries of a matrix, row by row.
pub fn by_rows(x: &M) -> Vec<E> {
    x.transpose().as_slice().to_vec()
}

#[cfg(test)]
mod tests {
    use super::super::function::recorded;
    use super::super::tape::Op;
    use super::*;

    /// The operations that `formula` records for two inputs, with contraction.
    fn operations(formula: impl FnOnce(E, E) -> E) -> Vec<Op> {
        sym::begin();
        sym::end_set_up();
        let (x, y) = (sym::input(), sym::input());
        let before = sym::recorded().0 as usize;
        sym::contract(|| formula(x, y));
        sym::finish().ops[before..].to_vec()
    }

    #[test]
    fn a_product_and_its_sum_are_contracted_in_both_orders() {
        for sum in [|x: E, y: E| x * y + x, |x: E, y: E| x + x * y] {
            assert!(matches!(operations(sum)[..], [Op::Mul(3, 4), Op::Fma(3, 4, 3)]));
        }
        assert!(matches!(operations(|x, y| x - x * y)[..], [Op::Mul(3, 4), Op::Fnma(3, 4, 3)]));
        assert!(matches!(operations(|x, y| x * y - x)[..], [Op::Mul(3, 4), Op::Neg(3), Op::Fma(3, 4, 6)]));
    }

    #[test]
    fn a_scalar_product_is_a_chain_of_multiply_adds() {
        let recorded = operations(|x, y| vector(&[x, y, x]).dot(&vector(&[y, y, x])));
        assert_eq!(recorded.iter().filter(|op| matches!(op, Op::Fma(..))).count(), 2);
        assert_eq!(recorded.iter().filter(|op| matches!(op, Op::Add(..))).count(), 0);
    }

    #[test]
    fn derivatives_with_respect_to_time_follow_the_motion() {
        // For x = q v: x_dot = v v + q a, and x_ddot = 3 v a + q j.
        let rates = recorded(
            4,
            || (),
            |(), x| {
                let [q, v, a, j] = [0, 1, 2, 3].map(|k| vector(&x[k..=k]));
                let rate = time_derivative(&q.component_mul(&v), [&q, &v], [&v, &a]);
                vec![rate[0], time_derivative(&rate, [&q, &v, &a], [&v, &a, &j])[0]]
            },
        );
        let mut rates = rates.expect("the formula does not branch").interpreted(false);
        rates.all_inputs().copy_from_slice(&[2.0, 3.0, 5.0, 7.0]);
        rates.run();
        assert_eq!([rates.output(0)[0], rates.output(1)[0]], [19.0, 59.0]);
    }

    #[test]
    fn differences_that_are_zero_remain_exact() {
        // A product minus itself, and a difference that is recorded as written.
        assert!(matches!(operations(|x, y| x * y - x * y)[..], [Op::Mul(..), Op::Sub(5, 5)]));
        assert!(matches!(operations(|x, y| E::as_written(|| x * y - x))[..], [Op::Mul(..), Op::Sub(5, 3)]));
        // The result of a function of an arm is not contracted with a later sum.
        assert!(matches!(operations(|x, y| E::as_written(|| x * y) - x)[..], [Op::Mul(..), Op::Sub(5, 3)]));
    }
}
