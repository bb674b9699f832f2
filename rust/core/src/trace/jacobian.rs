//! A recorded function `y = f(x)` with its Jacobian `dy/dx`. The interpreter runs it, unless machine code is requested. For functions that
//! are evaluated a few times, machine code would not repay its compilation. The results are valid for angles of any magnitude.

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
    compiled: bool,
    /// The function, prepared at its first evaluation.
    function: Option<Evaluation>,
    /// The function with its derivatives, prepared at the first evaluation. Its inputs are `x`, then a direction. Each lane has another
    /// direction.
    tangent: Option<Evaluation>,
}

impl Jacobian {
    /// Take a recorded function, whose first `moved` results have derivatives.
    pub fn new(recorded: Recorded, moved: usize) -> Self {
        Jacobian { recorded, moved, compiled: false, function: None, tangent: None }
    }

    /// Run the function as machine code. This repays its compilation after some hundred evaluations.
    pub fn compiled(self) -> Self {
        Jacobian { compiled: true, function: None, tangent: None, ..self }
    }

    /// Compute all results at `x`.
    pub fn value(&mut self, x: &[f64]) -> &[f64] {
        let make = || if self.compiled { self.recorded.clone().program(false) } else { self.recorded.clone().interpreted(false) };
        let function = self.function.get_or_insert_with(make);
        function.inputs(0, x.len()).copy_from_slice(x);
        function.run();
        if self.compiled && !function.is_near(0) {
            self.interpret();
            return self.value(x);
        }
        self.function.as_ref().map_or(&[], |function| function.outputs(0, self.recorded.answer.len()))
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
        let (inputs, moved) = (self.recorded.inputs, self.moved);
        let tangent = self.tangent.get_or_insert_with(|| derived(&self.recorded, moved, self.compiled));
        let lanes = tangent.lanes();
        tangent.inputs(0, 2 * inputs).chunks_exact_mut(lanes).zip(x.iter().chain(x_dot)).for_each(|(to, &x)| to.fill(x));
        tangent.run();
        if self.compiled && !tangent.is_near(0) {
            self.interpret();
            return self.along(x, x_dot, y_dot);
        }
        y_dot.iter_mut().zip(tangent.outputs(moved, moved).chunks_exact(lanes)).for_each(|(y_dot, rates)| *y_dot = rates[0]);
    }

    /// Call `put(i, j, dy_i/dx_j)` for all entries of the Jacobian at `x`, column by column.
    pub fn slopes<F: FnMut(usize, usize, f64)>(&mut self, x: &[f64], mut put: F) {
        let (inputs, moved) = (self.recorded.inputs, self.moved);
        let tangent = self.tangent.get_or_insert_with(|| derived(&self.recorded, moved, self.compiled));
        let lanes = tangent.lanes();
        for first in (0..inputs).step_by(lanes) {
            look();
            let (at, direction) = tangent.inputs(0, 2 * inputs).split_at_mut(inputs * lanes);
            at.chunks_exact_mut(lanes).zip(x).for_each(|(at, &x)| at.fill(x));
            direction.fill(0.0);
            let columns = first..(first + lanes).min(inputs);
            columns.clone().for_each(|j| direction[j * lanes + (j - first)] = 1.0);
            tangent.run();
            if self.compiled && !tangent.is_near(0) {
                self.interpret();
                return self.slopes(x, put);
            }
            let rates = tangent.outputs(moved, moved);
            columns.for_each(|j| (0..moved).for_each(|i| put(i, j, rates[i * lanes + (j - first)])));
        }
    }

    /// Use the interpreter from now on, because machine code is not valid for large angles.
    fn interpret(&mut self) {
        (self.compiled, self.function, self.tangent) = (false, None, None);
    }
}

/// The function with the derivatives of its first `moved` results. Its results are these results, then their derivatives.
fn derived(recorded: &Recorded, moved: usize, compiled: bool) -> Evaluation {
    let (given, inputs) = (recorded.values.len(), recorded.inputs);
    let moving: Vec<u32> = (given as u32..(given + inputs) as u32).collect();
    let Tangents { ops, values, rates } = tangents(&recorded.ops, given + inputs, &recorded.answer[..moved], moved, &moving, 1);
    let answer = values.into_iter().chain(rates).collect();
    let both = Recorded { ops, values: recorded.values.clone(), inputs: 2 * inputs, answer };
    if compiled { both.program(true) } else { both.interpreted(true) }
}
