//! Evaluation of a quantity of an arm, from Python arrays to Python arrays.
//!
//! There are three methods: a short path for one configuration, a *program* (recorded machine code) for several, and threads for long work.

use super::Arm;
use crate::arrays::{flag_or_false, index_of, name, of_lengths, of_shape, out_of_shape, out_slice, written_array};
use crate::broadcast::{Broadcast, broadcast, require_all_finite};
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::{long, signalled};
use armlet_core::dynamics::{Quantity, Query};
use armlet_core::error::Error;
use armlet_core::interrupt::interrupt;
use armlet_core::{memory, parallel};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Work is *long* if its estimated time, in ns, is at least this number, or if it records a program. Long work copies the arguments,
/// releases the GIL, and uses several threads.
const LONG: f64 = 1e6;

/// The largest number of joints for which the evaluation of one configuration is never long.
const FEW: usize = 64;

/// The estimated time, in ns, of one piece of long work. Between two pieces a thread checks whether the work must stop.
const PIECE: f64 = 5e5;

/// A call from Python: the name of the function, and the names and values of its arguments.
#[derive(Clone, Copy)]
pub(super) struct ArmCall<'a, 'py, const K: usize> {
    pub function: &'a str,
    pub names: [&'a str; K],
    pub values: [&'a Bound<'py, PyAny>; K],
}

impl Arm {
    pub(super) fn evaluate<'py, const K: usize>(
        &self,
        function: &str,
        names: [&str; K],
        values: [&Bound<'py, PyAny>; K],
        query: Query,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        match self.single(values, &query, out) {
            Some(result) => Ok(result),
            None => self.many(&ArmCall { function, names, values }, query, out),
        }
    }

    /// Evaluate all calls for which [`Arm::single`] returns `None`.
    #[inline(never)]
    fn many<'py, const K: usize>(
        &self,
        call: &ArmCall<'_, 'py, K>,
        query: Query,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = call.values[0].py();
        entry(py, call.function, || {
            let inputs = self.arguments(call)?;
            let (dims, axes) = self.model.shape(&query);
            let full: Vec<usize> = inputs.shape.iter().chain(&dims[..axes]).copied().collect();
            match out {
                None => written_array(py, &full, |data| self.fill(call, &query, inputs, &full, data)),
                Some(out) => {
                    self.fill(call, &query, inputs, &full, out_slice(call.function, out, &full, &call.values)?)?;
                    Ok(out.clone())
                }
            }
        })
    }

    /// Read the arguments, and broadcast them over their leading axes. The method `fill` checks later whether they are finite.
    fn arguments<'a, const K: usize>(&self, call: &ArmCall<'a, '_, K>) -> Result<Broadcast<'a, K>, Failure> {
        let ArmCall { function, names, values } = *call;
        broadcast(function, names, values, std::array::from_fn(|k| if names[k] == "wrench" { 6 } else { self.model.n() }))
    }

    /// Evaluate one configuration whose arguments are float64 vectors. The result is `None` for other arguments, for long work, for an
    /// `out` that overlaps an argument, and for errors, which `many` reports.
    fn single<'py, const K: usize>(
        &self,
        values: [&Bound<'py, PyAny>; K],
        query: &Query,
        out: Option<&Bound<'py, PyAny>>,
    ) -> Option<Bound<'py, PyAny>> {
        let n = self.model.n();
        if n > FEW && query.nanoseconds(self.model.size()) >= LONG {
            return None;
        }
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

    /// Write the results of all configurations to `data`, whose shape is `full`. A number that is not finite is an error.
    fn fill<const K: usize>(
        &self,
        call: &ArmCall<'_, '_, K>,
        query: &Query,
        inputs: Broadcast<K>,
        full: &[usize],
        data: &mut [f64],
    ) -> Result<(), Failure> {
        let (py, length) = (call.values[0].py(), data.len() / inputs.count.max(1));
        let all = &mut *data;
        let parts = move |chunk: usize| {
            let all = all;
            all.chunks_mut((length * chunk).max(1)).enumerate().map(|(i, rows)| (i * chunk, rows)).collect()
        };
        let work = |inputs: &Broadcast<K>, (first, rows): (usize, &mut [f64])| {
            self.rows(query, inputs, first, first + rows.len() / length.max(1), rows)
        };
        if self.share(py, query, inputs, parts, work).map_err(|failure| whose(failure, call))? {
            return Ok(());
        }
        match data.iter().position(|x| !x.is_finite()) {
            None => Ok(()),
            Some(k) => Err(not_finite(call, full, k, data[k])),
        }
    }

    /// Evaluate a query, and return `M` arrays of the shapes `leading + trailing[m]`: new arrays, or the caller's arrays `outs`.
    ///
    /// `scatter` copies the results of one configuration to the elements of the `M` arrays for this configuration.
    pub(super) fn apart<'py, const K: usize, const M: usize>(
        &self,
        call: &ArmCall<'_, 'py, K>,
        query: &Query,
        trailing: [&[usize]; M],
        outs: Option<&Bound<'py, PyAny>>,
        scatter: impl Fn(&[f64], [&mut [f64]; M]) + Sync,
    ) -> Result<Bound<'py, PyTuple>, Failure> {
        let ArmCall { function, values, .. } = *call;
        let py = values[0].py();
        let inputs = self.arguments(call)?;
        let leading = inputs.shape.clone();
        let shapes = trailing.map(|last| leading.iter().chain(last).copied().collect::<Vec<usize>>());
        let arrays = targets(py, function, &shapes, outs)?;
        let mut slices: [&mut [f64]; M] = std::array::from_fn(|_| Default::default());
        for m in 0..M {
            let others: Vec<&Bound<'py, PyAny>> = values.iter().copied().chain(&arrays[..m]).collect();
            slices[m] = match outs {
                None => out_of_shape(&arrays[m], &shapes[m]).unwrap_or_default(),
                Some(_) => out_slice(function, &arrays[m], &shapes[m], &others)?,
            };
        }
        let (dims, axes) = self.model.shape(query);
        let (length, lengths) = (dims[..axes].iter().product::<usize>(), trailing.map(|last| last.iter().product::<usize>()));
        let count = inputs.count;
        let all = slices.each_mut().map(|slice| &mut **slice);
        let parts = move |chunk: usize| {
            let mut remaining = all;
            let cut = |first: usize| {
                let size = chunk.min(count - first);
                let heads: [&mut [f64]; M] = std::array::from_fn(|m| remaining[m].split_off_mut(..size * lengths[m]).unwrap_or_default());
                (first, size, heads)
            };
            (0..count).step_by(chunk.max(1)).map(cut).collect()
        };
        let work = |inputs: &Broadcast<K>, (first, size, mut heads): (usize, usize, [&mut [f64]; M])| {
            let mut numbers = memory::zeros(size.saturating_mul(length))?;
            let sound = self.rows(query, inputs, first, first + size, &mut numbers)?;
            for (i, numbers) in numbers.chunks_exact(length.max(1)).enumerate() {
                let mut m = 0;
                scatter(
                    numbers,
                    heads.each_mut().map(|head| {
                        m += 1;
                        &mut head[i * lengths[m - 1]..(i + 1) * lengths[m - 1]]
                    }),
                );
            }
            Ok(sound)
        };
        if !self.share(py, query, inputs, parts, work).map_err(|failure| whose(failure, call))? {
            for (slice, length) in slices.iter().zip(lengths) {
                if let Some(k) = slice.iter().position(|x| !x.is_finite()) {
                    return Err(not_finite(call, &leading, k / length, slice[k]));
                }
            }
        }
        Ok(PyTuple::new(py, arrays)?)
    }

    /// Evaluate the configurations `first..last` into `out`. The result is true if every number is finite.
    fn rows<const K: usize>(
        &self,
        query: &Query,
        inputs: &Broadcast<K>,
        first: usize,
        last: usize,
        out: &mut [f64],
    ) -> Result<bool, Error> {
        if inputs.count == 1 {
            let rows: [&[f64]; K] = std::array::from_fn(|k| inputs.row(k, 0));
            return self.model.one(query, &rows, out);
        }
        let rows: [_; K] = std::array::from_fn(|k| inputs.rows(k, first, last));
        let rows: [&[f64]; K] = std::array::from_fn(|k| &*rows[k]);
        self.model.rows(query, &rows, last - first, out)
    }

    /// Run `work` on all parts, where `parts(k)` makes parts of at most `k` configurations. The result is true if every number is finite.
    ///
    /// Several threads do long work, and Ctrl-C ends it. Long work uses a copy of the inputs, because other threads may write to the
    /// caller's arrays. While long work runs, other threads may read a mixture of old and new rows from the array `out=`, as in numpy.
    fn share<'a, const K: usize, P: Send>(
        &self,
        py: Python<'_>,
        query: &Query,
        inputs: Broadcast<'a, K>,
        parts: impl FnOnce(usize) -> Vec<P> + Send,
        work: impl Fn(&Broadcast<K>, P) -> Result<bool, Error> + Sync,
    ) -> Result<bool, Failure> {
        let (each, count) = (query.nanoseconds(self.model.size()), inputs.count);
        let prepare = || if count > 1 { self.model.prepare(query, count) } else { Ok(()) };
        if each * (count as f64) < LONG && !self.model.is_due(query, count) {
            prepare()?;
            return Ok(parts(count.max(1)).into_iter().try_fold(true, |all, part| work(&inputs, part).map(|sound| all && sound))?);
        }
        let inputs = inputs.owned()?;
        let chunk = (PIECE / each) as usize / 16 * 16 + 16;
        let piece_results = long(py, || {
            prepare()?;
            let piece_results = parallel::pieces(parallel::default_threads(), &mut signalled, parts(chunk), |part| work(&inputs, part));
            drop(inputs);
            piece_results.unwrap_or_else(|_| interrupt()).into_iter().collect::<Result<Vec<bool>, Error>>()
        })?;
        Ok(piece_results.into_iter().all(|sound| sound))
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
        let friction = match friction {
            None => false,
            given => entry(q.py(), function, || flag_or_false(function, "friction", given))?,
        };
        let query = Query { friction, ..quantity.into() };
        match (wrench, frame) {
            (None, None) => self.evaluate(function, ["q", "v", third], [q, v, a], query, out),
            (Some(wrench), Some(frame)) => {
                let found =
                    || Ok(self.model.frame(name(function, "wrench_frame", frame)?).map_err(|error| error.of_argument("wrench_frame"))?);
                let frame = entry(q.py(), function, found)?;
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

/// The error of an argument that is not finite. The core reports such a number without the argument, so this function finds the argument.
fn whose<const K: usize>(failure: Failure, call: &ArmCall<'_, '_, K>) -> Failure {
    match failure {
        Failure::Core(error) => require_all_finite(call.function, call.names, call.values).err().unwrap_or(error.into()),
        interrupt => interrupt,
    }
}

/// The error of a result that is not finite although all arguments are: a number overflowed, or the mass matrix is singular.
fn not_finite<const K: usize>(call: &ArmCall<'_, '_, K>, shape: &[usize], k: usize, x: f64) -> Failure {
    let at = if shape.is_empty() { String::new() } else { format!(" (first bad index {})", index_of(shape, k)) };
    let problem = format!("give a result that is not finite: expected finite numbers, got {x}{at}");
    input_error(call.values[0].py(), call.function, &call.names.join(", "), problem).into()
}

/// Return new arrays of these shapes, or the caller's arrays. The caller of this function checks their shapes.
fn targets<'py, const M: usize>(
    py: Python<'py>,
    function: &str,
    shapes: &[Vec<usize>; M],
    outs: Option<&Bound<'py, PyAny>>,
) -> Result<Vec<Bound<'py, PyAny>>, Failure> {
    match outs {
        None => shapes.iter().map(|shape| written_array(py, shape, |_| Ok(()))).collect(),
        Some(outs) => match outs.cast::<PyTuple>() {
            Ok(outs) if outs.len() == M => Ok(outs.iter().collect()),
            _ => {
                let problem = format!("is not a tuple of {M} arrays: expected one array for each result");
                Err(input_error(py, function, "out", problem).into())
            }
        },
    }
}
