//! A recorded function `y = f(x)` with its Jacobian `dy/dx`. The results are valid for angles of any magnitude.
//!
//! Differentiation and the preparation of the engines take longer than the recording. So recordings with equal operations share both
//! if the cache still contains them.

use super::by_engine::{Evaluator, SharedFunction};
use super::cache::{Cache, MadeOnce};
use super::function::{KEPT_OPERATIONS, Recorded};
use super::tangents::{Tangents, tangents};
use crate::interrupt;
use std::sync::Arc;

/// The maximum number of recorded operations of all stored functions together. Each function is stored with its derivatives, which have
/// two to four times as many operations.
pub const STORED_OPERATIONS: usize = KEPT_OPERATIONS / 8;

/// The largest number of operations for which machine code is made. Its compilation cannot be interrupted.
const LONGEST: usize = 20_000;

/// A recorded function. Recordings with equal operations share it. The values of their set-up parameters may differ, so that a user of an
/// evaluation sets them.
struct Prepared {
    /// The number of inputs that have no derivatives. They are the first inputs.
    fixed: usize,
    /// The number of results that have derivatives.
    moved: usize,
    function: Arc<SharedFunction>,
    /// The function with its derivatives, with one direction per lane. Its inputs are `x`, then a direction. Its results are the first
    /// `moved` results, then their derivatives.
    tangent: MadeOnce<SharedFunction>,
}

static KNOWN: Cache<Arc<Prepared>> = Cache::new();

impl Prepared {
    /// Return the stored function with the operations of a recording, or store a new one.
    fn of(recorded: Recorded, fixed: usize, moved: usize) -> Arc<Self> {
        let is =
            |known: &Arc<Prepared>| (known.fixed, known.moved) == (fixed, moved) && known.function.recorded.has_operations_of(&recorded);
        KNOWN.find(is).unwrap_or_else(|| {
            let function = Arc::new(SharedFunction::new(recorded, false).up_to(LONGEST));
            let prepared = Arc::new(Prepared { fixed, moved, function, tangent: MadeOnce::default() });
            KNOWN.store(prepared.clone(), |all| all.iter().map(|known| known.operations()).sum::<usize>() <= STORED_OPERATIONS);
            prepared
        })
    }

    fn operations(&self) -> usize {
        self.function.recorded.ops.len()
    }

    fn tangent(&self) -> Arc<SharedFunction> {
        self.tangent.get(|| SharedFunction::new(self.derived(), true).up_to(LONGEST))
    }

    fn derived(&self) -> Recorded {
        let (Recorded { ops, values, inputs, answer }, Prepared { fixed, moved, .. }) = (&self.function.recorded, self);
        let (first, end) = (values.len() + fixed, values.len() + inputs);
        let moving: Vec<u32> = (first as u32..end as u32).collect();
        let Tangents { ops, values: results, rates } = tangents(ops, end, &answer[..*moved], *moved, &moving, 1);
        Recorded { ops, values: values.clone(), inputs: 2 * inputs - fixed, answer: results.into_iter().chain(rates).collect() }
    }
}

/// A recorded function with its Jacobian.
///
/// ```
/// use armlet_core::scalar::Real;
/// use armlet_core::trace::Jacobian;
/// use armlet_core::trace::function::recorded;
///
/// // `f(x, y) = x sin y`.
/// let f = recorded(2, || (), |(), x| vec![x[0] * x[1].sin_cos().0]).unwrap();
/// let mut f = Jacobian::new(f, 1);
/// assert!((f.value(&[2.0, 0.5])[0] - 2.0 * 0.5f64.sin()).abs() < 1e-15);
/// let mut slope = [0.0; 2];
/// f.slopes(&[2.0, 0.5], |_, j, rate| slope[j] = rate);
/// assert!((slope[0] - 0.5f64.sin()).abs() < 1e-15 && (slope[1] - 2.0 * 0.5f64.cos()).abs() < 1e-15);
/// ```
#[derive(Clone)]
pub struct Jacobian {
    prepared: Arc<Prepared>,
    /// The set-up parameters.
    values: Vec<f64>,
    function: Option<Evaluator>,
    /// Each lane has another direction.
    tangent: Option<Evaluator>,
}

impl Jacobian {
    /// Take a recorded function, whose first `moved` results have derivatives.
    pub fn new(recorded: Recorded, moved: usize) -> Self {
        Jacobian::with_fixed(recorded, 0, moved)
    }

    /// Take a recorded function, whose first `moved` results have derivatives. They are derivatives with respect to all inputs except the
    /// first `fixed` inputs.
    pub fn with_fixed(recorded: Recorded, fixed: usize, moved: usize) -> Self {
        let values = recorded.values.clone();
        Jacobian { prepared: Prepared::of(recorded, fixed, moved), values, function: None, tangent: None }
    }

    /// The number of recorded operations of the function, without derivatives.
    pub fn operations(&self) -> usize {
        self.prepared.operations()
    }

    /// Compute all results at `x`.
    pub fn value(&mut self, x: &[f64]) -> &[f64] {
        let Jacobian { prepared, values, function, .. } = self;
        let function = function.get_or_insert_with(|| Evaluator::new(prepared.function.clone(), values));
        function.inputs().copy_from_slice(x);
        function.run();
        function.outputs(0, prepared.function.recorded.answer.len())
    }

    fn tangent(&mut self) -> &mut Evaluator {
        let Jacobian { prepared, values, tangent, .. } = self;
        tangent.get_or_insert_with(|| Evaluator::new(prepared.tangent(), values))
    }

    /// Write the rates of the results along the direction `x_dot`, at `x`, to `y_dot`.
    ///
    /// ```
    /// use armlet_core::scalar::Real;
    /// use armlet_core::trace::Jacobian;
    /// use armlet_core::trace::function::recorded;
    ///
    /// // `f(x) = sqrt(1 + x^2)` at `x = 0.75`.
    /// let f = recorded(1, || (), |(), x| vec![x[0].mul_add(x[0], Real::splat(1.0)).sqrt()]).unwrap();
    /// let mut rate = [0.0];
    /// Jacobian::new(f, 1).along(&[0.75], &[2.0], &mut rate);
    /// assert!((rate[0] - 1.2).abs() < 1e-15);
    /// ```
    pub fn along(&mut self, x: &[f64], x_dot: &[f64], y_dot: &mut [f64]) {
        let moved = self.prepared.moved;
        let tangent = self.tangent();
        let lanes = tangent.lanes();
        tangent.inputs().chunks_exact_mut(lanes).zip(x.iter().chain(x_dot)).for_each(|(to, &x)| to.fill(x));
        tangent.run();
        y_dot.iter_mut().zip(tangent.outputs(moved, moved).chunks_exact(lanes)).for_each(|(y_dot, rates)| *y_dot = rates[0]);
    }

    /// Call `put(i, j, dy_i/dx_j)` for all entries of the Jacobian at `x`, column by column. `j` does not count the fixed inputs.
    pub fn slopes<F: FnMut(usize, usize, f64)>(&mut self, x: &[f64], mut put: F) {
        let Prepared { fixed, moved, .. } = *self.prepared;
        let tangent = self.tangent();
        let lanes = tangent.lanes();
        for first in (0..x.len() - fixed).step_by(lanes) {
            interrupt::check();
            let (at, direction) = tangent.inputs().split_at_mut(x.len() * lanes);
            at.chunks_exact_mut(lanes).zip(x).for_each(|(at, &x)| at.fill(x));
            direction.fill(0.0);
            let columns = first..(first + lanes).min(x.len() - fixed);
            columns.clone().for_each(|j| direction[j * lanes + (j - first)] = 1.0);
            tangent.run();
            let rates = tangent.outputs(moved, moved);
            columns.for_each(|j| (0..moved).for_each(|i| put(i, j, rates[i * lanes + (j - first)])));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::function::recorded;
    use super::super::sym::Sym;
    use super::*;
    use crate::scalar::Real;

    #[test]
    fn recordings_with_equal_operations_share_their_derivatives() {
        // `f(a, x) = k a x^2`, with derivatives along `x`.
        let f = |k: f64| {
            let f = recorded(2, || Sym::varying(k), |k, ax| vec![k * ax[0] * ax[1] * ax[1]]).expect("it does not branch");
            Jacobian::with_fixed(f, 1, 1)
        };
        let (mut first, mut second) = (f(0.25), f(1.5));
        assert!(Arc::ptr_eq(&first.prepared, &second.prepared));
        // Machine code continues after some evaluations.
        for _ in 0..300 {
            for (f, k) in [(&mut first, 0.25), (&mut second, 1.5)] {
                let mut slopes = Vec::new();
                f.slopes(&[3.0, 2.0], |i, j, rate| slopes.push((i, j, rate)));
                assert_eq!(slopes, [(0, 0, 2.0 * k * 3.0 * 2.0)]);
                assert_eq!(f.value(&[3.0, 2.0]), [k * 12.0]);
            }
        }
        assert!(!Arc::ptr_eq(&first.prepared, &f(1.0).prepared), "a one is structure");
    }
}
