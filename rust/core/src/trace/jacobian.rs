//! A recorded function `y = f(x)` with its Jacobian `dy/dx`, run by the interpreter. This suits functions that are evaluated a few times,
//! for which machine code would not repay its compilation. The interpreter is valid for angles of any magnitude.

use super::function::{Evaluation, Recorded};
use super::tangents::{Tangents, tangents};
use crate::interrupt::look;

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
pub struct Jacobian {
    recorded: Recorded,
    /// The number of results that have derivatives.
    moved: usize,
    /// The function, prepared at its first evaluation.
    function: Option<Evaluation>,
    /// The function with its derivatives, prepared at the first evaluation. Its inputs are `x`, then a direction. Each lane has another
    /// direction.
    tangent: Option<Evaluation>,
}

impl Jacobian {
    /// Take a recorded function, whose first `moved` results have derivatives.
    pub fn new(recorded: Recorded, moved: usize) -> Self {
        Jacobian { recorded, moved, function: None, tangent: None }
    }

    /// Compute all results at `x`.
    pub fn value(&mut self, x: &[f64]) -> &[f64] {
        let function = self.function.get_or_insert_with(|| self.recorded.clone().interpreted(false));
        function.inputs(0, x.len()).copy_from_slice(x);
        function.run();
        function.outputs(0, self.recorded.answer.len())
    }

    /// Call `put(i, j, dy_i/dx_j)` for all entries of the Jacobian at `x`, column by column.
    pub fn slopes(&mut self, x: &[f64], mut put: impl FnMut(usize, usize, f64)) {
        let (inputs, moved) = (self.recorded.inputs, self.moved);
        let tangent = self.tangent.get_or_insert_with(|| derived(&self.recorded, moved));
        let lanes = tangent.lanes();
        for first in (0..inputs).step_by(lanes) {
            look();
            let (at, direction) = tangent.inputs(0, 2 * inputs).split_at_mut(inputs * lanes);
            at.chunks_exact_mut(lanes).zip(x).for_each(|(at, &x)| at.fill(x));
            direction.fill(0.0);
            let columns = first..(first + lanes).min(inputs);
            columns.clone().for_each(|j| direction[j * lanes + (j - first)] = 1.0);
            tangent.run();
            let rates = tangent.outputs(moved, moved);
            columns.for_each(|j| (0..moved).for_each(|i| put(i, j, rates[i * lanes + (j - first)])));
        }
    }
}

/// The function with the derivatives of its first `moved` results. Its results are these results, then their derivatives.
fn derived(recorded: &Recorded, moved: usize) -> Evaluation {
    let (given, inputs) = (recorded.values.len(), recorded.inputs);
    let moving: Vec<u32> = (given as u32..(given + inputs) as u32).collect();
    let Tangents { ops, values, rates } = tangents(&recorded.ops, given + inputs, &recorded.answer[..moved], moved, &moving, 1);
    let answer = values.into_iter().chain(rates).collect();
    Recorded { ops, values: recorded.values.clone(), inputs: 2 * inputs, answer }.interpreted(true)
}
