//! The analytic derivatives of inverse and forward dynamics, and the linearisation that they make.

use super::Arm;
use crate::arrays::{flag_or_false, new_array, out_slice};
use crate::broadcast::Broadcast;
use crate::errors::{Failure, entry, input_error};
use armlet_core::analysis::linearisation::state_matrices;
use armlet_core::dynamics::{Quantity, Query};
use armlet_core::error::Error;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Arrays to return, or the caller's own.
type Outs<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

/// That many zeros, or an error that says how much memory they need.
fn room(count: usize, width: usize) -> Result<Vec<f64>, Failure> {
    let bytes = 8 * count as u128 * width as u128;
    let mut out = Vec::new();
    let length = count.checked_mul(width).ok_or(Error::Memory { bytes })?;
    out.try_reserve_exact(length).map_err(|_| Error::Memory { bytes })?;
    out.resize(length, 0.0);
    Ok(out)
}

impl Arm {
    /// The answers of each configuration, `trailing` numbers, one after the other, and the leading axes.
    pub(super) fn flat<const K: usize>(
        &self,
        function: &str,
        names: [&str; K],
        values: [&Bound<'_, PyAny>; K],
        query: &Query,
        trailing: &[usize],
    ) -> Result<(Vec<usize>, Vec<f64>), Failure> {
        let inputs: Broadcast<K> = self.arguments(function, names, values)?;
        let full: Vec<usize> = inputs.shape.iter().chain(trailing).copied().collect();
        let mut flat = room(inputs.count, trailing.iter().product())?;
        self.fill(function, names, values, query, &inputs, &full, &mut flat)?;
        Ok((inputs.shape, flat))
    }

    /// The rows `(3 n, n)` of each configuration, one after the other, and the leading axes.
    fn slopes<const K: usize>(
        &self,
        function: &str,
        names: [&str; K],
        values: [&Bound<'_, PyAny>; K],
        query: &Query,
    ) -> Result<(Vec<usize>, Vec<f64>), Failure> {
        self.flat(function, names, values, query, &[3 * self.n(), self.n()])
    }

    /// `K` arrays of the shapes `leading + trailing[k]`, filled by `fill`; the caller's own where `outs` gives them.
    pub(super) fn several<'py, const K: usize>(
        py: Python<'py>,
        function: &str,
        values: &[&Bound<'py, PyAny>],
        leading: &[usize],
        trailing: [&[usize]; K],
        outs: Outs<'_, 'py>,
        fill: impl Fn(usize, &mut [f64]),
    ) -> Result<Bound<'py, PyTuple>, Failure> {
        let shapes = trailing.map(|last| leading.iter().chain(last).copied().collect::<Vec<usize>>());
        let given: Option<Vec<Bound<'py, PyAny>>> = match outs {
            None => None,
            Some(outs) => match outs.cast::<PyTuple>() {
                Ok(outs) if outs.len() == K => Some(outs.iter().collect()),
                _ => {
                    return Err(input_error(
                        py,
                        function,
                        "out",
                        format!("is not a tuple of {K} arrays: expected one array for each result"),
                    )
                    .into());
                }
            },
        };
        let mut all = Vec::with_capacity(K);
        for (k, shape) in shapes.iter().enumerate() {
            all.push(match &given {
                None => new_array(py, shape, |data| {
                    fill(k, data);
                    Ok(())
                })?,
                Some(given) => {
                    let others: Vec<&Bound<'py, PyAny>> = values.iter().copied().chain(&given[..k]).collect();
                    fill(k, out_slice(function, &given[k], shape, &others)?);
                    given[k].clone()
                }
            });
        }
        Ok(PyTuple::new(py, all)?)
    }

    fn three<'py>(
        &self,
        function: &str,
        third: &str,
        values: [&Bound<'py, PyAny>; 3],
        (quantity, friction): (Quantity, Option<&Bound<'py, PyAny>>),
        out: Outs<'_, 'py>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let py = values[0].py();
        entry(py, function, || {
            let query = Query { friction: flag_or_false(function, "friction", friction)?, ..quantity.into() };
            let (leading, flat) = self.slopes(function, ["q", "v", third], values, &query)?;
            let square = self.n() * self.n();
            Self::several(py, function, &values, &leading, [&[self.n(); 2]; 3], out, |k, data| {
                for (rows, to) in flat.chunks_exact((3 * square).max(1)).zip(data.chunks_exact_mut(square.max(1))) {
                    to.copy_from_slice(&rows[k * square..(k + 1) * square]);
                }
            })
        })
    }
}

#[pymethods]
impl Arm {
    /// The derivatives of inverse dynamics, `d tau / d q`, `d tau / d v` and `d tau / d a = M`.
    ///
    /// Exact, from one recursion over composite bodies; `d tau / d v = 2 C(q, v)` with the Christoffel `C`.
    ///
    /// Args:
    ///     q, v, a: position, velocity, acceleration, `(..., n)`, broadcast over the leading axes.
    ///     friction: add the damping to `d tau / d v`; Coulomb friction has no slope away from rest (keyword only).
    ///     out: a tuple of three arrays to write to (keyword only).
    ///
    /// Returns:
    ///     Three arrays `(..., n, n)`: row `i`, column `j` is the slope of `tau_i` by coordinate `j`.
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, or `out` cannot be written.
    ///
    /// Source: Carpentier and Mansard 2018.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.pendulum(2.0, 3.0)
    /// >>> dtau_dq, dtau_dv, M = arm.inverse_dynamics_derivatives([0.0], [1.0], [0.0])
    /// >>> float(dtau_dq[0, 0]), float(dtau_dv[0, 0]), float(M[0, 0])
    /// (3.0, 0.0, 2.0)
    #[pyo3(signature = (q, v, a, *, friction=None, out=None), text_signature = "($self, q, v, a, *, friction=False, out=None)")]
    fn inverse_dynamics_derivatives<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
        friction: Option<&Bound<'py, PyAny>>,
        out: Outs<'_, 'py>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        self.three("inverse_dynamics_derivatives", "a", [q, v, a], (Quantity::InverseDynamicsDerivatives, friction), out)
    }

    /// The derivatives of forward dynamics, `d a / d q`, `d a / d v` and `d a / d tau = M^-1`.
    ///
    /// Args:
    ///     q, v, tau: position, velocity, torque, `(..., n)`, broadcast over the leading axes.
    ///     friction: the torque is less the joints' friction (keyword only).
    ///     out: a tuple of three arrays to write to (keyword only).
    ///
    /// Returns:
    ///     Three arrays `(..., n, n)`: row `i`, column `j` is the slope of `a_i` by coordinate `j`.
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, or the mass matrix is singular.
    ///
    /// Source: Carpentier and Mansard 2018.
    ///
    /// >>> import armlet as al
    /// >>> da_dq, da_dv, Minv = al.pendulum(4.0, 3.0).forward_dynamics_derivatives([0.0], [1.0], [0.0])
    /// >>> float(da_dq[0, 0]), float(Minv[0, 0])
    /// (-0.75, 0.25)
    #[pyo3(signature = (q, v, tau, *, friction=None, out=None), text_signature = "($self, q, v, tau, *, friction=False, out=None)")]
    fn forward_dynamics_derivatives<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        tau: &Bound<'py, PyAny>,
        friction: Option<&Bound<'py, PyAny>>,
        out: Outs<'_, 'py>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        self.three("forward_dynamics_derivatives", "tau", [q, v, tau], (Quantity::ForwardDynamicsDerivatives, friction), out)
    }

    /// The arm linearised about a state: `d/dt [dq; dv] = A [dq; dv] + B dtau`.
    ///
    /// `A = [[0, 1], [da/dq, da/dv]]`, `B = [[0], [M^-1]]`; the state need not be an equilibrium.
    ///
    /// Args:
    ///     q, v, tau: position, velocity, torque, `(..., n)`, broadcast over the leading axes.
    ///     friction: the torque is less the joints' friction (keyword only).
    ///     out: a tuple of two arrays to write to (keyword only).
    ///
    /// Returns:
    ///     `A`, `(..., 2 n, 2 n)`, and `B`, `(..., 2 n, n)`.
    ///
    /// Raises:
    ///     InputError: as for `forward_dynamics_derivatives`.
    ///
    /// >>> import armlet as al
    /// >>> A, B = al.pendulum(4.0, 3.0).linearize([0.0], [0.0], [0.0])
    /// >>> (A + 0.0).tolist(), B.tolist()
    /// ([[0.0, 1.0], [-0.75, 0.0]], [[0.0], [0.25]])
    #[pyo3(signature = (q, v, tau, *, friction=None, out=None), text_signature = "($self, q, v, tau, *, friction=False, out=None)")]
    fn linearize<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        tau: &Bound<'py, PyAny>,
        friction: Option<&Bound<'py, PyAny>>,
        out: Outs<'_, 'py>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        const NAME: &str = "linearize";
        let (py, values) = (q.py(), [q, v, tau]);
        entry(py, NAME, || {
            let query = Query { friction: flag_or_false(NAME, "friction", friction)?, ..Quantity::ForwardDynamicsDerivatives.into() };
            let (leading, flat) = self.slopes(NAME, ["q", "v", "tau"], values, &query)?;
            let n = self.n();
            let (mut a, mut b) = (room(flat.len() / 3, 4)?, room(flat.len() / 3, 2)?);
            let square = (n * n).max(1);
            for ((rows, a), b) in flat.chunks_exact(3 * square).zip(a.chunks_exact_mut(4 * square)).zip(b.chunks_exact_mut(2 * square)) {
                state_matrices(n, rows, a, b);
            }
            Self::several(py, NAME, &values, &leading, [&[2 * n, 2 * n], &[2 * n, n]], out, |k, data| {
                data.copy_from_slice(if k == 0 { &a } else { &b });
            })
        })
    }
}
