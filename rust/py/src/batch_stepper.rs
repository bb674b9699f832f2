//! `_BatchStepper` advances many states of one plant with inputs of the caller. The environments of `armlet.gym` use it.

use crate::arrays::{Axis, Form, count, items, nonnegative_integer, number, numbers, object, owned, written_array};
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::{long, signalled};
use crate::plant::Plant;
use armlet_core::memory;
use armlet_core::parallel::default_threads;
use armlet_core::plant::PlantSpec;
use armlet_core::simulate::BatchStepper;
use armlet_macros::entered;
use pyo3::prelude::*;

/// A batch of `B` states of a plant, one per row. Each row has its input, which is constant during a call of `step`.
#[pyclass(module = "armlet._core")]
pub struct _BatchStepper {
    stepper: BatchStepper,
    plant: PlantSpec,
    /// The states, `(B, states)`.
    x: Vec<f64>,
    /// The inputs of the last `step`, `(B, n)`. `put` sets the inputs of its rows to zero. If the input of the plant is a velocity, `step`
    /// and `put` return the inputs as the velocities.
    tau: Vec<f64>,
}

const NAME: &str = "_BatchStepper";

#[entered]
#[pymethods]
impl _BatchStepper {
    #[new]
    fn new(plant: &Bound<'_, PyAny>, rows: &Bound<'_, PyAny>, dt: &Bound<'_, PyAny>) -> Result<Self, Failure> {
        let plant = object::<Plant>(NAME, "plant", "a plant such as RigidArm", plant)?.get().spec.clone();
        let (rows, dt) = (count(NAME, "rows", rows)?, number(NAME, "dt", dt)?);
        let stepper = BatchStepper::new(&plant, rows, dt)?;
        let zeros = |width: usize| -> Result<Vec<f64>, Failure> { Ok(memory::filled(rows.saturating_mul(width), 0.0)?) };
        Ok(_BatchStepper { x: zeros(plant.states())?, tau: zeros(plant.n())?, stepper, plant })
    }

    /// Advance all rows by `steps` steps of the classical Runge-Kutta method with the inputs `tau`, `(B, n)`.
    ///
    /// Returns the positions and the velocities after the last step, `(B, n)` each. A row that diverges is not finite.
    #[arguments(tau, steps)]
    fn step<'py>(&mut self) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Failure> {
        let (n, rows) = (self.plant.n(), self.tau.len() / self.plant.n());
        let given = owned(numbers(NAME, "tau", tau, &[Form(&[Axis::Is(rows), Axis::Is(n)])])?.1)?;
        let steps = count(NAME, "steps", steps)?;
        let Self { stepper, x, tau, .. } = self;
        let before = x.clone();
        long(py, || {
            if stepper.advance(&given, steps, default_threads(), &mut signalled, x) {
                *x = before;
            } else {
                *tau = given;
            }
            Ok(())
        })?;
        self.read(py)
    }

    /// Set the rows with the indices `rows` to positions and velocities, `(len(rows), n)` each.
    ///
    /// Returns the positions and the velocities of all rows, `(B, n)` each.
    #[arguments(rows, q, v)]
    fn put<'py>(&mut self) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Failure> {
        let (n, states, all) = (self.plant.n(), self.plant.states(), self.tau.len() / self.plant.n());
        let rows: Vec<usize> =
            items(NAME, "rows", "a list", rows, all)?.iter().map(|row| nonnegative_integer(NAME, "rows", row)).collect::<Result<_, _>>()?;
        let shape = [Axis::Is(rows.len()), Axis::Is(n)];
        let (q, v) = (numbers(NAME, "q", q, &[Form(&shape)])?.1, numbers(NAME, "v", v, &[Form(&shape)])?.1);
        if let Some((k, row)) = rows.iter().enumerate().find(|(_, row)| **row >= all) {
            let problem = format!("is out of range: expected numbers below {all}, got {row} (first bad index {k})");
            return Err(input_error(py, NAME, "rows", problem).into());
        }
        for (k, &row) in rows.iter().enumerate() {
            let (q, v) = (&q[k * n..(k + 1) * n], &v[k * n..(k + 1) * n]);
            let v: &[f64] = if self.plant.kind().has_speeds() { v } else { &[] };
            self.x[row * states..(row + 1) * states].copy_from_slice(&self.plant.initial_state(q, v, None, None));
            self.tau[row * n..(row + 1) * n].fill(0.0);
        }
        self.read(py)
    }

    /// A copy of the states of all rows, `(B, states)`.
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        entry(py, NAME, || {
            let copy = |out: &mut [f64]| -> Result<(), Failure> {
                out.copy_from_slice(&self.x);
                Ok(())
            };
            Ok(written_array(py, &[self.tau.len() / self.plant.n(), self.plant.states()], copy)?.into_any())
        })
    }

    #[setter]
    fn set_states(&mut self, states: &Bound<'_, PyAny>) -> PyResult<()> {
        entry(states.py(), NAME, || {
            let shape = [Axis::Is(self.tau.len() / self.plant.n()), Axis::Is(self.plant.states())];
            self.x = owned(numbers(NAME, "states", states, &[Form(&shape)])?.1)?;
            Ok(())
        })
    }
}

impl _BatchStepper {
    /// Copy the positions and the velocities of all rows, `(B, n)` each.
    fn read<'py>(&self, py: Python<'py>) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Failure> {
        let (n, states) = (self.plant.n(), self.plant.states());
        let rows = self.tau.len() / n;
        let column = |from: &[f64], width: usize, first: usize| {
            written_array(py, &[rows, n], |out: &mut [f64]| -> Result<(), Failure> {
                for (to, row) in out.chunks_exact_mut(n).zip(from.chunks_exact(width)) {
                    to.copy_from_slice(&row[first..first + n]);
                }
                Ok(())
            })
        };
        let v = if self.plant.kind().has_speeds() { column(&self.x, states, n) } else { column(&self.tau, n, 0) };
        Ok((column(&self.x, states, 0)?.into_any(), v?.into_any()))
    }
}
