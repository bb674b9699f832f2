//! From Python arrays to Python arrays: one configuration without a detour, many in lanes, many more in threads.

use super::Arm;
use crate::arrays::{flag_or_false, index_of, name, of_lengths, of_shape, out_of_shape, out_slice, written_array};
use crate::broadcast::{Broadcast, broadcast, require_all_finite};
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::listen;
use armlet_core::dynamics::{Quantity, Query};
use armlet_core::error::Error;
use armlet_core::parallel;
use pyo3::prelude::*;

/// Work that is worth giving up the GIL for, ns: the arguments are then copied, and threads share it.
const LONG: f64 = 1e6;

/// Work of one piece of a shared call, ns: between two pieces a thread looks whether to stop.
const PIECE: f64 = 5e5;

impl Arm {
    pub(super) fn evaluate<'py, const K: usize>(
        &self,
        function: &str,
        names: [&str; K],
        values: [&Bound<'py, PyAny>; K],
        query: Query,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = values[0].py();
        entry(py, function, || {
            if let Some(result) = self.single(values, &query, out) {
                return Ok(result);
            }
            let inputs = self.arguments(function, names, values)?;
            let (dims, axes) = self.model.shape(&query);
            let full: Vec<usize> = inputs.shape.iter().chain(&dims[..axes]).copied().collect();
            match out {
                None => written_array(py, &full, |data| self.fill(function, names, values, &query, &inputs, &full, data)),
                Some(out) => {
                    self.fill(function, names, values, &query, &inputs, &full, out_slice(function, out, &full, &values)?)?;
                    Ok(out.clone())
                }
            }
        })
    }

    /// Arguments, broadcast over their leading axes; whether they are finite is for `fill` to see.
    pub(super) fn arguments<'a, const K: usize>(
        &self,
        function: &str,
        names: [&str; K],
        values: [&'a Bound<'_, PyAny>; K],
    ) -> Result<Broadcast<'a, K>, Failure> {
        broadcast(function, names, values, std::array::from_fn(|k| if names[k] == "wrench" { 6 } else { self.n() }))
    }

    /// One configuration in float64 vectors; None for anything else, errors included, which the general way words.
    fn single<'py, const K: usize>(
        &self,
        values: [&Bound<'py, PyAny>; K],
        query: &Query,
        out: Option<&Bound<'py, PyAny>>,
    ) -> Option<Bound<'py, PyAny>> {
        let n = self.n();
        let mut lengths = [n; K];
        for (k, length) in lengths.iter_mut().enumerate() {
            *length = query.input_length(k, n);
        }
        let rows = of_lengths(values, lengths)?;
        let (dims, axes) = self.model.shape(query);
        let shape = &dims[..axes];
        let fill = |data: &mut [f64]| if self.model.one(query, &rows, data)? { Ok(()) } else { Err(Error::Format(String::new()).into()) };
        match out {
            None => written_array(values[0].py(), shape, fill).ok(),
            Some(out) => {
                let taken = of_shape(out, shape)?.as_ptr_range();
                if rows.iter().any(|row| row.as_ptr_range().start < taken.end && taken.start < row.as_ptr_range().end) {
                    return None;
                }
                fill(out_of_shape(out, shape)?).ok()?;
                Some(out.clone())
            }
        }
    }

    /// Fill `data`, of the shape `full`; finite numbers or an error.
    pub(super) fn fill<const K: usize>(
        &self,
        function: &str,
        names: [&str; K],
        values: [&Bound<'_, PyAny>; K],
        query: &Query,
        inputs: &Broadcast<K>,
        full: &[usize],
        data: &mut [f64],
    ) -> Result<(), Failure> {
        match self.compute(query, inputs, data) {
            Ok(true) => return Ok(()),
            Ok(false) => {}
            // The core looks at every number once; which argument's it was is worth a second look only now.
            Err(Failure::Core(error)) => return require_all_finite(function, names, values).and(Err(error.into())),
            Err(interrupt) => return Err(interrupt),
        }
        // Finite arguments can still overflow, or meet a mass matrix that has no inverse.
        let Some(k) = data.iter().position(|x| !x.is_finite()) else { return Ok(()) };
        let at = if full.is_empty() { String::new() } else { format!(" (first bad index {})", index_of(full, k)) };
        let problem = format!("give a result that is not finite: expected finite numbers, got {}{at}", data[k]);
        Python::attach(|py| Err(input_error(py, function, &names.join(", "), problem).into()))
    }

    fn compute<const K: usize>(&self, query: &Query, inputs: &Broadcast<K>, data: &mut [f64]) -> Result<bool, Failure> {
        let count = inputs.count;
        if count == 1 {
            let rows: [&[f64]; K] = std::array::from_fn(|k| inputs.row(k, 0));
            return Ok(self.model.one(query, &rows, data)?);
        }
        let all: [_; K] = std::array::from_fn(|k| inputs.all(k));
        let rows: [&[f64]; K] = std::array::from_fn(|k| &*all[k]);
        let work = query.nanoseconds(self.n());
        if work * (count as f64) < LONG {
            return Ok(self.model.rows(query, &rows, count, 0, count, data)?);
        }
        // Copied: other threads may write to the caller's arrays once the GIL is given up. Who reads `out=` meanwhile sees rows of before
        // and of now, as with numpy's own functions.
        let own: [Vec<f64>; K] = std::array::from_fn(|k| rows[k].to_vec());
        let rows: [&[f64]; K] = std::array::from_fn(|k| own[k].as_slice());
        let mut signal = None;
        let mut poll = listen(&mut signal);
        let sizes = (data.len() / count, (PIECE / work) as usize / 16 * 16 + 16);
        let said = Python::attach(|py| {
            py.detach(|| {
                let piece = |first: usize, last: usize, part: &mut [f64]| self.model.rows(query, &rows, count, first, last, part);
                parallel::rows(parallel::default_threads(), &mut poll, sizes, data, piece)
            })
        });
        drop(poll);
        match (signal, said) {
            (Some(signal), _) => Err(Failure::Python(signal)),
            (None, Err(_)) => Ok(true),
            (None, Ok(said)) => Ok(said.into_iter().try_fold(true, |all, sound| sound.map(|sound| all && sound))?),
        }
    }

    pub(super) fn framed<'py, const K: usize>(
        &self,
        function: &str,
        names: [&str; K],
        values: [&Bound<'py, PyAny>; K],
        quantity: Quantity,
        frame: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let frame = entry(values[0].py(), function, || Ok(self.model.frame(name(function, "frame", frame)?)?))?;
        self.evaluate(function, names, values, Query { frame, ..quantity.into() }, out)
    }

    /// Inverse or forward dynamics, with a wrench or without.
    pub(super) fn loaded<'py>(
        &self,
        (function, third): (&str, &str),
        [q, v, a]: [&Bound<'py, PyAny>; 3],
        [wrench, frame, friction]: [Option<&Bound<'py, PyAny>>; 3],
        quantity: Quantity,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let friction = entry(q.py(), function, || flag_or_false(function, "friction", friction))?;
        let query = Query { friction, ..quantity.into() };
        match (wrench, frame) {
            (None, None) => self.evaluate(function, ["q", "v", third], [q, v, a], query, out),
            (Some(wrench), Some(frame)) => {
                let frame = entry(q.py(), function, || Ok(self.model.frame(name(function, "wrench_frame", frame)?)?))?;
                let query = Query { wrench: Some(frame), ..query };
                self.evaluate(function, ["q", "v", third, "wrench"], [q, v, a, wrench], query, out)
            }
            _ => Err(input_error(q.py(), function, "wrench", "is not complete: expected both wrench and wrench_frame")),
        }
    }

    pub(super) fn kinematic<'py>(
        &self,
        function: &str,
        q: &Bound<'py, PyAny>,
        quantity: Quantity,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        entry(q.py(), function, || Ok(self.model.tree(function).map(|_| ())?))?;
        self.evaluate(function, ["q"], [q], quantity.into(), out)
    }
}
