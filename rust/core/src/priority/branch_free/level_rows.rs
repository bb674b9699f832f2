//! The rows of one level in the coordinates of the metric.

use super::lq::product;
use crate::priority::metric::Metric;
use crate::scalar::Real;

/// Write the rows of a Jacobian, in the coordinates of the metric, to `rows`. Return the squares of the largest row norm and of the
/// Frobenius norm.
pub(super) fn load<S: Real>(jacobian: &[S], metric: Option<&Metric<S>>, rows: &mut [S], n: usize) -> [S; 2] {
    let (mut most, mut sum) = (S::zero(), S::zero());
    for (row, given) in rows.chunks_exact_mut(n).zip(jacobian.chunks_exact(n)) {
        row.copy_from_slice(given);
        if let Some(metric) = metric {
            metric.row(row);
        }
        let row2 = product(row, row);
        most = S::select(most.lt(row2), row2, most);
        sum += row2;
    }
    [most, sum]
}
