//! Selection of samples for concurrent learning (ChowdharyJohnson2010). Sample `j` has the regressor `W_j`. A local search increases the
//! smallest singular value `sigma` of the stacked regressors of the selected samples:
//!
//! ```text
//! sigma^2 = min over |u| = 1 of  sum over the selected j of |W_j u|^2
//! ```
//!
//! `u` is in the space of directions that all candidates together determine. First, samples are added one after another. Each added sample
//! has the largest effect in the directions `u` that are weakest so far. Then samples are exchanged for others as long as this increases
//! `sigma`.

use crate::error::{Error, Result, finite};
use crate::interrupt;
use crate::linalg::{Svd, dot, symmetric_eigen};
use crate::memory;

/// A direction whose scaled singular value is below this fraction of the largest is not determined by the candidates.
const CUTOFF: f64 = 1e-6;
/// Number of candidates that are tried as additions in one exchange.
const ENTERING: usize = 4;
/// Number of chosen samples that are tried as removals in one exchange.
const LEAVING: usize = 8;

/// The selected samples.
///
/// ```
/// use armlet_core::analysis::sample_selection::select;
///
/// // Four samples with n = 1 and p = 2. The first and the third determine both parameters best.
/// let rows = [1.0, 0.0, 0.9, 0.1, 0.0, 1.0, 0.1, 0.1];
/// let selection = select(&rows, 1, 2, 2)?;
/// assert_eq!((selection.indices, selection.rank), (vec![0, 2], 2));
/// assert!(selection.singular_value > 0.5);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// Indices of the chosen samples, increasing.
    pub indices: Vec<usize>,
    /// The smallest singular value of the stacked rows, in the directions that all candidates determine.
    pub singular_value: f64,
    /// The number of directions that all candidates determine.
    pub rank: usize,
}

/// The regressors of the samples in a basis of the determined directions: `Z_j`, `(n, r)`, for sample `j`.
struct Candidates {
    z: Vec<f64>,
    n: usize,
    r: usize,
}

impl Candidates {
    fn of(&self, j: usize) -> &[f64] {
        let size = self.n * self.r;
        &self.z[j * size..(j + 1) * size]
    }

    fn count(&self) -> usize {
        self.z.len() / (self.n * self.r)
    }

    /// The effect of sample `j` on the directions: the sum of `|Z_j u|^2` over the rows `u` of `directions`.
    fn gain(&self, j: usize, directions: &[f64]) -> f64 {
        let square = |u: &[f64]| self.of(j).chunks_exact(self.r).map(|row| dot(row, u).powi(2)).sum::<f64>();
        directions.chunks_exact(self.r).map(square).sum()
    }

    /// Add `sign Z_j' Z_j`, for sample `j`, to `gram`, `(r, r)`.
    fn add(&self, j: usize, sign: f64, gram: &mut [f64]) {
        for row in self.of(j).chunks_exact(self.r) {
            for (x, sums) in row.iter().zip(gram.chunks_exact_mut(self.r)) {
                sums.iter_mut().zip(row).for_each(|(sum, y)| *sum += sign * x * y);
            }
        }
    }

    fn smallest(&self, gram: &[f64]) -> Result<(f64, Vec<f64>)> {
        let (values, vectors) = symmetric_eigen(gram, self.r)?;
        Ok((values[0], vectors[..self.r].to_vec()))
    }
}

/// Choose `count` of `K` samples, so that their stacked regressors have a large smallest singular value.
///
/// `rows`, `(K, n, p)`, has the regressor `W` of each sample. Errors: `WrongShape` for a length that is not a positive multiple of `n p`.
/// `Input` for a `count` out of range, numbers that are not finite or too large, or regressors of zeros. `Memory` if the memory does not
/// suffice.
pub fn select(rows: &[f64], n: usize, p: usize, count: usize) -> Result<Selection> {
    let samples = match n.checked_mul(p) {
        Some(size) if size > 0 && rows.len().is_multiple_of(size) => rows.len() / size,
        _ => return Err(Error::wrong("samples", "length", format!("a multiple of n p > 0, with n = {n} and p = {p}"), rows.len())),
    };
    finite("samples", rows)?;
    if count == 0 || count > samples {
        return Err(Error::input("count", format!("is out of range: expected 1 to {samples}, the number of samples, got {count}")));
    }
    let candidates = shown(rows, n, p)?;
    let least = candidates.r.div_ceil(n);
    if count < least {
        let problem =
            format!("is too small: expected at least {least} for the {} directions that the samples show, got {count}", candidates.r);
        return Err(Error::input("count", problem));
    }
    let mut chosen = first_choice(&candidates, count)?;
    exchange(&candidates, &mut chosen)?;
    chosen.sort_unstable();
    let stacked: Vec<f64> = chosen.iter().flat_map(|&j| candidates.of(j).iter().copied()).collect();
    let mut svd = Svd::new(count * n, candidates.r);
    svd.decompose(&stacked, count * n, candidates.r)?;
    let singular_value = svd.s().last().copied().unwrap_or(0.0);
    Ok(Selection { indices: chosen, singular_value, rank: candidates.r })
}

/// Express the samples in an orthonormal basis of the directions that they determine together. Columns are scaled to length one before the
/// rank decision.
fn shown(rows: &[f64], n: usize, p: usize) -> Result<Candidates> {
    let mut gram = memory::zeros(p * p)?;
    for row in rows.chunks_exact(p) {
        for (x, sums) in row.iter().zip(gram.chunks_exact_mut(p)).filter(|(x, _)| **x != 0.0) {
            sums.iter_mut().zip(row).for_each(|(sum, y)| *sum += x * y);
        }
    }
    if let Some(k) = gram.iter().position(|x| !x.is_finite()) {
        return Err(Error::input("samples", "are too large: expected finite products W' W").at([k]));
    }
    let lengths: Vec<f64> = (0..p).map(|k| gram[k * p + k].sqrt()).collect();
    let inverse = |k: usize| if lengths[k] > 0.0 { 1.0 / lengths[k] } else { 0.0 };
    let scaled: Vec<f64> = (0..p * p).map(|k| gram[k] * inverse(k / p) * inverse(k % p)).collect();
    interrupt::check();
    let (values, vectors) = symmetric_eigen(&scaled, p)?;
    let largest = values.last().copied().unwrap_or(0.0);
    let rank = values.iter().filter(|&&value| value > CUTOFF * CUTOFF * largest).count();
    if rank == 0 {
        return Err(Error::input("samples", "show nothing: expected a record of motion, got zeros"));
    }
    // Let D be the column lengths. The null space of W is D^-1 times the null space of the scaled W. The determined directions are
    // orthogonal to the null space of W. So they are D times the row space of the scaled W.
    let range: Vec<Vec<f64>> =
        vectors.chunks_exact(p).rev().take(rank).map(|u| u.iter().zip(&lengths).map(|(u, d)| u * d).collect()).collect();
    let spread: Vec<f64> = (0..p * p).map(|k| range.iter().map(|u| u[k / p] * u[k % p]).sum()).collect();
    let (_, basis) = symmetric_eigen(&spread, p)?;
    let basis: Vec<&[f64]> = basis.chunks_exact(p).rev().take(rank).collect();
    let mut z = memory::reserved(rows.len() / p * rank)?;
    for row in rows.chunks_exact(p) {
        z.extend(basis.iter().map(|u| dot(row, u)));
    }
    Ok(Candidates { z, n, r: rank })
}

/// Choose samples one after another. Each has the largest effect in the directions that are weakest so far.
fn first_choice(candidates: &Candidates, count: usize) -> Result<Vec<usize>> {
    let r = candidates.r;
    let (mut gram, mut chosen): (Vec<f64>, Vec<usize>) = (vec![0.0; r * r], Vec::with_capacity(count));
    let mut free = vec![true; candidates.count()];
    for _ in 0..count {
        interrupt::check();
        let (values, vectors) = symmetric_eigen(&gram, r)?;
        let none = CUTOFF * CUTOFF * values[r - 1];
        let weak = values.iter().filter(|&&value| value <= none).count().max(1);
        let directions = &vectors[..weak * r];
        let mut best = (f64::NEG_INFINITY, 0);
        for j in (0..free.len()).filter(|&j| free[j]) {
            let gain = candidates.gain(j, directions);
            if gain > best.0 {
                best = (gain, j);
            }
        }
        free[best.1] = false;
        candidates.add(best.1, 1.0, &mut gram);
        chosen.push(best.1);
    }
    Ok(chosen)
}

/// Exchange samples as long as the smallest singular value grows.
fn exchange(candidates: &Candidates, chosen: &mut [usize]) -> Result<()> {
    let r = candidates.r;
    let mut free = vec![true; candidates.count()];
    let mut gram = vec![0.0; r * r];
    for &j in chosen.iter() {
        free[j] = false;
        candidates.add(j, 1.0, &mut gram);
    }
    // Each exchange increases sigma^2 by at least a thousandth. The number of exchanges is limited.
    for _ in 0..20 * chosen.len() {
        interrupt::check();
        let (sigma, u) = candidates.smallest(&gram)?;
        let mut entering: Vec<(f64, usize)> = (0..free.len()).filter(|&j| free[j]).map(|j| (candidates.gain(j, &u), j)).collect();
        entering.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut leaving: Vec<(f64, usize)> = chosen.iter().enumerate().map(|(k, &j)| (candidates.gain(j, &u), k)).collect();
        leaving.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut best: Option<(f64, usize, usize)> = None;
        for &(_, j) in entering.iter().take(ENTERING) {
            for &(_, k) in leaving.iter().take(LEAVING) {
                let mut trial = gram.clone();
                candidates.add(j, 1.0, &mut trial);
                candidates.add(chosen[k], -1.0, &mut trial);
                let (found, _) = candidates.smallest(&trial)?;
                if found > sigma * 1.001 && best.is_none_or(|(most, ..)| found > most) {
                    best = Some((found, j, k));
                }
            }
        }
        let Some((_, j, k)) = best else { return Ok(()) };
        (free[chosen[k]], free[j]) = (true, false);
        candidates.add(chosen[k], -1.0, &mut gram);
        candidates.add(j, 1.0, &mut gram);
        chosen[k] = j;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_a_wrong_length_are_refused() {
        for (n, p) in [(0, 2), (2, 0), (2, 2), (4, 1), (usize::MAX, 2)] {
            let refused = select(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], n, p, 1);
            assert!(matches!(&refused, Err(Error::WrongShape { argument, .. }) if argument == "samples"), "{n} {p}: {refused:?}");
        }
        assert!(select(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 2, 3, 1).is_ok());
    }
}
